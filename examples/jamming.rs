//! The approach to jamming: coordination and pressure of packings above the transition, mean of a few seeds.
//!
//! `cargo run --release --example jamming [N [SEEDS]]` prints φ, Z, its standard error, the pressure and the share of
//! rattlers; Z − 4 falls to zero at the transition near φ = 0.842.

#![expect(clippy::print_stdout, reason = "the table is what this program is for")]

use softjam::relax::{RelaxError, Relaxation, Status};
use softjam::scene::Scene;

fn main() -> Result<(), RelaxError> {
    let mut numbers = std::env::args().skip(1).map_while(|text| text.parse().ok());
    let particles: usize = numbers.next().unwrap_or(256);
    let seeds: usize = numbers.next().unwrap_or(5);
    println!("   phi       Z   +/-      p        rattlers   jammed");
    for phi in [0.845, 0.85, 0.86, 0.87, 0.88, 0.90, 0.92, 0.95] {
        let (mut z, mut p, mut rattlers) = (Vec::new(), 0.0, 0);
        for seed in 1..=seeds as u64 {
            let scene = Scene {
                particles,
                phi,
                seed,
                steps: 20_000,
                ..Scene::default()
            };
            let mut run = Relaxation::new(&scene)?;
            while run.status() == Status::Running {
                run.advance()?;
            }
            let o = run.observables();
            // A packing below its transition comes apart: no contacts, no pressure.
            if run.status() == Status::Converged && o.backbone_contacts > 0 {
                z.push(o.coordination());
                p += o.pressure();
                rattlers += o.rattlers;
            }
        }
        let n = z.len() as f64;
        let mean = z.iter().sum::<f64>() / n;
        let variance = z.iter().map(|z| (z - mean) * (z - mean)).sum::<f64>() / (n - 1.0);
        println!(
            "{phi:6.3} {mean:8.4} {:6.4} {:9.5} {:8.2} % {:6} of {seeds}",
            (variance / n).sqrt(),
            p / n,
            100.0 * rattlers as f64 / (n * particles as f64),
            z.len()
        );
    }
    Ok(())
}
