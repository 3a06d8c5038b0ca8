//! Run time against error: measures, writes a CSV file an item, and draws the figure from them.
//!
//! ```sh
//! cargo bench --no-default-features --bench error                     # everything, about ten minutes
//! cargo bench --no-default-features --bench error -- contact          # one item; `figure` only draws
//! cargo bench --no-default-features --bench error -- --quick          # small sizes, some seconds: does it still run?
//! cargo bench --no-default-features --bench error -- --out docs/benchmark
//! ```
//!
//! Files go to `target/benchmark` unless `--out` names a folder. Items: `contact` (a), `relaxation` (b), `model` (c, g, h), `size`
//! (d), `recording` (e; needs the program, `cargo build --release`, or its path in `SOFTJAM`), `contour` (f), `figure`. What is
//! compared is measured in turn in one run; times are medians.

#![expect(
    clippy::unwrap_used,
    reason = "every run of it is one of droplets, which have a contact law, from disks that can be relaxed"
)]
#![expect(
    clippy::print_stderr,
    clippy::print_stdout,
    reason = "a program that says what it measures"
)]
#![expect(
    clippy::disallowed_methods,
    reason = "nothing here has to have the same bits everywhere"
)]

mod chart;
mod contact;
mod contour;
mod figure;
mod laws;
mod model;
mod packings;
mod recording;
mod relaxation;
mod size;
mod table;

use std::error::Error;
use std::path::{Path, PathBuf};
use std::time::Instant;
use table::Table;

/// An item: what it measures, quickly or in full.
type Measure = fn(bool) -> Result<Table, Box<dyn Error>>;

const ITEMS: [(&str, Measure); 6] = [
    ("contact", contact::measure),
    ("relaxation", relaxation::measure),
    ("model", model::measure),
    ("size", size::measure),
    ("recording", recording::measure),
    ("contour", contour::measure),
];

fn main() -> Result<(), Box<dyn Error>> {
    let (mut quick, mut out) = (false, PathBuf::from("target/benchmark"));
    let mut items: Vec<String> = Vec::new();
    let mut arguments = std::env::args().skip(1);
    while let Some(argument) = arguments.next() {
        match argument.as_str() {
            // What `cargo bench` passes on to every bench.
            "--bench" => {}
            "--quick" => quick = true,
            "--out" => {
                out = arguments
                    .next()
                    .map(PathBuf::from)
                    .ok_or("--out needs a folder")?;
            }
            name if name == "figure" || ITEMS.iter().any(|i| i.0 == name) => items.push(argument),
            other => return Err(format!("no item is called {other}").into()),
        }
    }
    std::fs::create_dir_all(&out)?;
    let asked = |name: &str| items.is_empty() || items.iter().any(|i| i == name);
    for (name, measure) in ITEMS {
        if asked(name) {
            let clock = Instant::now();
            eprintln!("{name}");
            let table = measure(quick)?;
            table.write(&out.join(format!("{name}.csv")))?;
            eprintln!("  {:.1} s", clock.elapsed().as_secs_f64());
        }
    }
    if asked("figure") {
        draw(&out)?;
    }
    Ok(())
}

fn draw(folder: &Path) -> Result<(), Box<dyn Error>> {
    let mut tables = Vec::new();
    for (name, _) in ITEMS {
        let path = folder.join(format!("{name}.csv"));
        // The figure is drawn of what there is.
        tables.push(if path.exists() {
            Table::read(&path)?
        } else {
            Table::default()
        });
    }
    let path = folder.join("run-time-against-error.svg");
    std::fs::write(&path, figure::draw(&tables))?;
    println!("{}", path.display());
    Ok(())
}
