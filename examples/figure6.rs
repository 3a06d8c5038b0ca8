//! The seed's figure 6: how f_max falls with the number of steps, for several coverages.
//!
//! `cargo run --release --example figure6 > figure6.csv` writes one line a step and coverage; the sample near
//! φ = 0.84 stagnates first and then drops.

#![expect(clippy::print_stdout, reason = "the table is what this program is for")]

use softjam::relax::{RelaxError, Relaxation};
use softjam::scene::Scene;

fn main() -> Result<(), RelaxError> {
    println!("phi,step,f_max");
    for phi in [0.843, 0.86, 0.88, 0.90] {
        let scene = Scene {
            particles: 256,
            phi,
            seed: 3,
            ..Scene::default()
        };
        let mut run = Relaxation::new(&scene)?;
        loop {
            println!("{phi},{},{:e}", run.step(), run.f_max());
            if run.f_max() <= scene.threshold || run.step() >= scene.steps {
                break;
            }
            run.advance()?;
        }
        let o = run.observables();
        eprintln_summary(phi, run.step(), o.coordination(), o.pressure());
    }
    Ok(())
}

#[expect(clippy::print_stderr, reason = "the table goes to standard output")]
fn eprintln_summary(phi: f64, steps: u64, z: f64, pressure: f64) {
    eprintln!("φ = {phi}: {steps} steps, Z = {z:.3}, p = {pressure:.5} γ/length");
}
