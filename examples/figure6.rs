//! Saitoh's figure 6: how `f_max` falls with the number of steps, for several coverages and samples.
//!
//! `cargo run --release --example figure6 -- [FOLDER [N]]` writes `figure6.svg`, and the numbers as `figure6.csv`: one line a
//! step. Near jamming, φ = 0.84, some samples take long, others come apart at once.

#![expect(clippy::print_stdout, reason = "the table is what this program is for")]

use softjam::figure::{Fall, relaxation, write};
use softjam::protocol::{Relaxation, Status};
use softjam::scene::Scene;
use std::error::Error;
use std::fmt::Write as _;
use std::path::PathBuf;

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let folder = PathBuf::from(arguments.next().unwrap_or(".".to_owned()));
    let particles = arguments.next().map_or(Ok(256), |n| n.parse())?;
    let mut runs = Vec::new();
    let mut table = "phi,seed,step,f_max\n".to_owned();
    println!("  phi  seed   steps        Z    p (γ/length)");
    for phi in [0.84, 0.86, 0.88, 0.90] {
        for seed in 1..=3 {
            let scene = Scene {
                particles,
                phi,
                seed,
                ..Scene::default()
            };
            let mut run = Relaxation::new(&scene)?;
            let mut points = vec![(run.step(), run.f_max())];
            while run.status() == Status::Running {
                run.advance()?;
                points.push((run.step(), run.f_max()));
            }
            for (step, f_max) in &points {
                writeln!(table, "{phi},{seed},{step},{f_max:e}")?;
            }
            let (o, steps) = (run.observables(), run.step());
            let (z, p) = (o.coordination(), o.pressure());
            println!("{phi:5.2} {seed:5} {steps:7} {z:8.4} {p:15.6}");
            runs.push(Fall {
                label: format!("φ = {phi:.2}"),
                points,
                threshold: Some(scene.threshold),
            });
        }
    }
    std::fs::write(folder.join("figure6.csv"), table)?;
    write(folder.join("figure6.svg"), &relaxation(&runs)?)?;
    Ok(())
}
