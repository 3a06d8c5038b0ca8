//! Times one relaxation from its random start to equilibrium, stage by stage, and prints a line of JSON.
//!
//! ```sh
//! cargo bench --no-default-features --bench relax_timing -- --write DIR 'particles = 1024' 'seed = 3' 'threshold = 1e-12'
//! ```
//!
//! Every argument that is not a flag is a line of a scene file. With `--write DIR` the start and the end of the run are
//! written there as text, one particle or contact a line with 17 digits, for programs that compare or check.

#![expect(
    clippy::unwrap_used,
    reason = "every run of it is one of droplets, which have a contact law, from disks that can be relaxed"
)]
#![expect(
    clippy::print_stdout,
    reason = "its line of JSON is what the program is for"
)]

use softjam::analysis::Stability;
use softjam::protocol::relax_disks;
use softjam::protocol::{Relaxation, Status};
use softjam::scene::{Scene, start};
use softjam::state::Packing;
use std::error::Error;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::time::Instant;

fn main() -> Result<(), Box<dyn Error>> {
    let mut lines = String::new();
    let mut folder = None;
    let mut arguments = std::env::args().skip(1);
    while let Some(argument) = arguments.next() {
        match argument.as_str() {
            // What `cargo bench` passes on to every bench.
            "--bench" => {}
            "--write" => folder = arguments.next().map(PathBuf::from),
            line => {
                lines.push_str(line);
                lines.push('\n');
            }
        }
    }
    let scene = Scene::from_toml(&lines)?;

    let mut packing = start::packing(&scene)?;
    if let Some(folder) = &folder {
        std::fs::create_dir_all(folder)?;
        write_packing(&folder.join("start.txt"), &packing)?;
    }

    let clock = Instant::now();
    let disks = relax_disks(&mut packing, &scene.disks, scene.line_tension).unwrap();
    let disks_s = clock.elapsed().as_secs_f64();

    let clock = Instant::now();
    let mut run = Relaxation::of_packing(&scene, packing)?;
    let first_s = clock.elapsed().as_secs_f64();
    let clock = Instant::now();
    while run.status() == Status::Running {
        run.advance()?;
    }
    let steps_s = clock.elapsed().as_secs_f64();
    // Newton's method has asked already.
    let clock = Instant::now();
    let stability = run.stability().map_or("not in balance", Stability::name);
    let judged_s = clock.elapsed().as_secs_f64();

    if let Some(folder) = &folder {
        write_packing(&folder.join("end.txt"), run.packing())?;
        let mut text = String::new();
        let contacts = run.contacts();
        for (&[i, j], f) in contacts.pairs.iter().zip(contacts.forces) {
            writeln!(text, "{i} {j} {f:.17e}")?;
        }
        std::fs::write(folder.join("contacts.txt"), text)?;
    }
    let work = run.law().unwrap().work();
    println!(
        "{{\"particles\": {}, \"phi\": {}, \"seed\": {}, \"converged\": {}, \"f_max\": {:e}, \"residual\": {:e}, \
         \"disks_s\": {disks_s:.6}, \"disks_steps\": {}, \"first_s\": {first_s:.6}, \"steps_s\": {steps_s:.6}, \
         \"judged_s\": {judged_s:.6}, \"stability\": \"{stability}\", \
         \"steps\": {}, \"solves\": {}, \"sweeps\": {}, \"iterations\": {}, \"contacts\": {}}}",
        run.packing().len(),
        scene.phi,
        scene.seed,
        run.status() == Status::Converged,
        run.f_max(),
        run.law().unwrap().residual(),
        disks.steps,
        run.step(),
        work.solves,
        work.sweeps,
        work.iterations,
        run.contacts().pairs.len(),
    );
    Ok(())
}

/// The box in the first line, then x, y, radius of each particle.
fn write_packing(path: &Path, packing: &Packing) -> Result<(), Box<dyn Error>> {
    let l = packing.domain().lengths();
    let mut text = format!("{:.17e} {:.17e} 0\n", l.x, l.y);
    for (p, radius) in packing.positions().iter().zip(packing.radii()) {
        writeln!(text, "{:.17e} {:.17e} {radius:.17e}", p.x, p.y)?;
    }
    std::fs::write(path, text)?;
    Ok(())
}
