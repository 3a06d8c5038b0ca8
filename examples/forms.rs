//! How far apart the packings of the two force forms lie: the same starts relaxed with central and with gradient forces.
//!
//! `cargo run --release --example forms -- [SEEDS]` prints a line a coverage, medians over the seeds: root mean square and largest
//! displacement between the two packings (rattlers left out, the common translation taken off), the same two from the
//! central packing relaxed on with gradient forces, the relative differences of energy and pressure (gradient over central,
//! less one) and the coordination numbers.

#![expect(clippy::print_stdout, reason = "the table is what this program is for")]

use softjam::domain::Vec2;
use softjam::models::droplet::Form;
use softjam::protocol::{RelaxError, Relaxation, Status};
use softjam::scene::{Minimizer, Scene};
use std::error::Error;

fn main() -> Result<(), Box<dyn Error>> {
    let seeds: u64 = std::env::args().nth(1).map_or(Ok(15), |n| n.parse())?;
    println!(
        "phi,seeds,rms,largest,rms_onward,largest_onward,energy,pressure,z_central,z_gradient"
    );
    for phi in [0.86, 0.90, 0.95, 1.0] {
        let mut columns: [Vec<f64>; 8] = Default::default();
        for seed in 1..=seeds {
            let start = Relaxation::new(&scene(phi, seed, Form::Central))?;
            let central = relaxed(start)?;
            let start = Relaxation::new(&scene(phi, seed, Form::Gradient))?;
            let gradient = relaxed(start)?;
            let end = central.packing().clone();
            let start = Relaxation::of_packing(&scene(phi, seed, Form::Gradient), end)?;
            let onward = relaxed(start)?;
            let (rms, largest) = distance(&central, &gradient);
            let (rms_onward, largest_onward) = distance(&central, &onward);
            let (a, b) = (central.observables(), gradient.observables());
            let values = [
                rms,
                largest,
                rms_onward,
                largest_onward,
                b.energy / a.energy - 1.0,
                b.pressure() / a.pressure() - 1.0,
                a.coordination(),
                b.coordination(),
            ];
            for (column, value) in columns.iter_mut().zip(values) {
                column.push(value);
            }
        }
        let row: Vec<String> = columns
            .into_iter()
            .map(|c| format!("{:.3e}", median(c)))
            .collect();
        println!("{phi},{seeds},{}", row.join(","));
    }
    Ok(())
}

fn scene(phi: f64, seed: u64, forces: Form) -> Scene {
    Scene {
        particles: 256,
        phi,
        seed,
        forces,
        minimizer: Minimizer::FireNewton,
        threshold: 1e-12,
        ..Scene::default()
    }
}

/// A run to its end.
fn relaxed(mut run: Relaxation) -> Result<Relaxation, RelaxError> {
    while run.status() == Status::Running {
        run.advance()?;
    }
    Ok(run)
}

/// Root mean square and largest displacement (length) of the particles that bear a force in both packings.
fn distance(a: &Relaxation, b: &Relaxation) -> (f64, f64) {
    let bears = |run: &Relaxation| {
        let mut bears = vec![false; run.packing().len()];
        for (pair, f) in run.contacts().pairs.iter().zip(run.contacts().forces) {
            for p in pair {
                bears[*p as usize] |= *f > 1e-9;
            }
        }
        bears
    };
    let (in_a, in_b) = (bears(a), bears(b));
    let apart: Vec<Vec2> = (0..in_a.len())
        .filter(|&p| in_a[p] && in_b[p])
        .map(|p| {
            let difference = b.packing().positions()[p] - a.packing().positions()[p];
            a.packing().domain().minimum_image(difference)
        })
        .collect();
    let shift = apart.iter().sum::<Vec2>() / apart.len() as f64;
    let lengths = apart.iter().map(|d| (d - shift).norm());
    let squares: f64 = lengths.clone().map(|l| l * l).sum();
    (
        (squares / apart.len() as f64).sqrt(),
        lengths.fold(0.0, f64::max),
    )
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}
