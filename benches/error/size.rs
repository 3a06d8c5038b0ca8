//! (d) What a step costs a particle, against the number of particles.
//!
//! All sizes are made first and stepped in turn, so that they meet the same machine: disks relaxed to f_max = 1e-4, the
//! contact problem solved, 100 steps, then rounds of equal work. A round counts with all its steps, those with an exchange of
//! contacts and those without (in a large packing there is one in every step); the median is that of the rounds. After each round
//! comes one with two threads, which a packing of fewer than some 7000 particles does not use.

use super::table::{Table, digits, median};
use softjam::numerics::threads;
use softjam::protocol::relax_disks;
use softjam::protocol::{RelaxError, Relaxation};
use softjam::scene::{Scene, start};
use std::error::Error;
use std::time::Instant;

pub fn measure(quick: bool) -> Result<Table, Box<dyn Error>> {
    let mut table = Table::new(&[
        "particles",
        "phi",
        "ns_per_step_and_particle",
        "iterations_per_step",
        "sweeps_per_step",
        "disks_ns_per_step_and_particle",
        "two_threads_ns_per_step_and_particle",
    ]);
    let sizes: &[usize] = if quick {
        &[64, 256]
    } else {
        &[64, 256, 1024, 4096, 16_384, 65_536]
    };
    for phi in if quick { vec![0.86] } else { vec![0.86, 0.95] } {
        let mut runs = Vec::new();
        for &particles in sizes {
            let mut scene = Scene {
                particles,
                phi,
                threshold: 1e-300,
                ..Scene::default()
            };
            scene.disks.threshold = 1e-4;
            let mut packing = start::packing(&scene)?;
            let clock = Instant::now();
            let report = relax_disks(&mut packing, &scene.disks, scene.line_tension).unwrap();
            let disks =
                clock.elapsed().as_secs_f64() / (report.steps.max(1) as f64 * particles as f64);
            let mut run = Relaxation::of_packing(&scene, packing)?;
            for _ in 0..100 {
                run.advance()?;
            }
            let before = run.law().unwrap().work();
            runs.push((run, before, disks, [Vec::new(), Vec::new()]));
        }
        let rounds = if quick { 2 } else { 8 };
        for _ in 0..rounds {
            for (run, _, _, times) in &mut runs {
                let steps = (65_536 / run.packing().len()).clamp(8, 64);
                for (threads, times) in (1..).zip(times) {
                    let time = threads::with(threads, || {
                        let clock = Instant::now();
                        for _ in 0..steps {
                            run.advance()?;
                        }
                        Ok::<_, RelaxError>(clock.elapsed().as_secs_f64())
                    })??;
                    times.push(time / steps as f64);
                }
            }
        }
        for (run, before, disks, [one, two]) in runs {
            let (n, steps) = (run.packing().len() as f64, (run.step() - 100) as f64);
            let work = run.law().unwrap().work();
            table.push(vec![
                run.packing().len().to_string(),
                phi.to_string(),
                digits(1e9 * median(one) / n),
                format!(
                    "{:.2}",
                    (work.iterations - before.iterations) as f64 / steps
                ),
                format!("{:.3}", (work.sweeps - before.sweeps) as f64 / steps),
                digits(1e9 * disks),
                digits(1e9 * median(two) / n),
            ]);
        }
    }
    Ok(table)
}
