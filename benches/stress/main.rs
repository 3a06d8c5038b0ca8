//! The stress program: many hard cases, each answer checked by formulas that the solver does not share.
//!
//! ```sh
//! cargo bench --no-default-features --bench stress -- --write docs/stress.md   # everything, and the report
//! cargo bench --no-default-features --bench stress -- lattice threshold        # some families
//! cargo bench --no-default-features --bench stress -- --set 'minimizer = "fire+newton"' --set 'forces = "gradient"'
//! ```
//!
//! Every case has to end converged, at its step limit or with a named error, and what it says must be true: the contact
//! law, the balance and the reason of an error are computed anew in `verify.rs`. The exit code is 1 if a case is wrong.

#![expect(
    clippy::unwrap_used,
    reason = "every run of it is one of droplets, which have a contact law, from disks that can be relaxed"
)]
#![expect(
    clippy::print_stdout,
    clippy::print_stderr,
    clippy::expect_used,
    reason = "a program that prints its findings and makes its own packings"
)]
#![expect(
    clippy::disallowed_methods,
    reason = "the checks use the standard library's mathematics on purpose: nothing is shared with the crate"
)]

mod families;
mod hand_made;
mod outcome;
mod random;
mod report;
mod stiffness;
mod verify;

use report::Row;
use softjam::scene::Scene;
use std::process::ExitCode;
use std::time::Instant;

fn main() -> ExitCode {
    let mut only: Vec<String> = Vec::new();
    let (mut file, mut lines) = (None, String::new());
    let mut arguments = std::env::args().skip(1);
    while let Some(argument) = arguments.next() {
        match argument.as_str() {
            // What `cargo bench` passes on to every bench.
            "--bench" => {}
            "--write" => file = arguments.next(),
            "--set" => {
                lines.push_str(&arguments.next().unwrap_or_default());
                lines.push('\n');
            }
            _ => only.push(argument),
        }
    }
    match Scene::from_toml(&lines) {
        Ok(scene) => families::COMMON.get_or_init(|| scene),
        Err(error) => {
            eprintln!("{error}");
            return ExitCode::FAILURE;
        }
    };
    families::COMMON_LINES.get_or_init(|| lines.clone());
    // A panic is counted, not printed.
    std::panic::set_hook(Box::new(|_| {}));
    let mut rows = Vec::new();
    for family in families::all() {
        if !only.is_empty() && !only.iter().any(|o| family.name.contains(o.as_str())) {
            continue;
        }
        eprintln!("{}: {}", family.name, family.what);
        let clock = Instant::now();
        let mut row = Row::new(&family);
        for (name, case) in (family.cases)() {
            let clock = Instant::now();
            let outcome = case();
            if clock.elapsed().as_secs_f64() > 2.0 {
                eprintln!("  {name}: {:.1} s", clock.elapsed().as_secs_f64());
            }
            if let Some(wrong) = &outcome.wrong {
                println!("WRONG: {}, {name}: {wrong}", family.name);
            }
            row.count(name, outcome);
        }
        row.seconds = clock.elapsed().as_secs_f64();
        eprintln!("  {}", row.line());
        rows.push(row);
    }
    let text = report::markdown(&rows, &lines);
    match file {
        None => println!("{text}"),
        Some(path) => {
            if let Err(error) = std::fs::write(&path, text) {
                eprintln!("cannot write {path}: {error}");
                return ExitCode::FAILURE;
            }
        }
    }
    if rows.iter().all(Row::good) {
        ExitCode::SUCCESS
    } else {
        ExitCode::FAILURE
    }
}
