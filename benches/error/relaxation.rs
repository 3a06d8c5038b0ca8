//! (b) The relaxation: wall time, both stages, to each decade of f_max.
//!
//! Scenes are lines of a scene file; one that this version does not know is left out and said so.

use super::table::{Table, digits, median};
use softjam::disks;
use softjam::relax::{Relaxation, Status};
use softjam::scene::{Scene, start};
use std::error::Error;
use std::time::Instant;

/// Name, lines of the scene, factor on the default dt_max.
const VARIANTS: [(&str, &str, f64); 7] = [
    ("fire", "", 1.0),
    ("fire + newton", "minimizer = \"fire+newton\"", 1.0),
    ("fire, gradient form", "forces = \"gradient\"", 1.0),
    (
        "fire + newton, gradient form",
        "minimizer = \"fire+newton\"\nforces = \"gradient\"",
        1.0,
    ),
    ("fire, dt_max / 2", "", 0.5),
    ("fire, dt_max × 1.4", "", 1.4),
    ("fire, dt_max × 2", "", 2.0),
];

pub fn measure(quick: bool) -> Result<Table, Box<dyn Error>> {
    let mut table = Table::new(&[
        "particles",
        "phi",
        "variant",
        "f_max",
        "seconds",
        "disks_seconds",
        "steps",
        "seeds",
        "steps_per_s",
    ]);
    let samples: Vec<(usize, f64, u64)> = if quick {
        vec![(64, 0.90, 1)]
    } else {
        let mut samples: Vec<_> = [0.845, 0.86, 0.90, 0.95].map(|phi| (256, phi, 5)).to_vec();
        samples.extend([0.845, 0.86, 0.90, 0.95].map(|phi| (1024, phi, 3)));
        samples.push((4096, 0.86, 1));
        samples
    };
    for (particles, phi, seeds) in samples {
        for (k, (name, lines, factor)) in VARIANTS.into_iter().enumerate() {
            // Time steps and gradient form are compared at one size and coverage; both forms at two.
            let asked = match k {
                0 | 1 => true,
                2 | 3 => particles <= 1024 && (phi == 0.86 || phi == 0.90),
                _ => (particles == 1024 && phi == 0.86) || quick,
            };
            if asked {
                variant(&mut table, (particles, phi, seeds), (name, lines, factor))?;
            }
        }
    }
    Ok(table)
}

fn variant(
    table: &mut Table,
    (particles, phi, seeds): (usize, f64, u64),
    (name, lines, factor): (&str, &str, f64),
) -> Result<(), Box<dyn Error>> {
    // Seconds, seconds of the disks and steps to each decade, a list entry a seed.
    let mut reached: Vec<Vec<(f64, f64, f64)>> = vec![Vec::new(); 14];
    let mut rates = Vec::new();
    for seed in 1..=seeds {
        let lines = format!(
            "particles = {particles}\nphi = {phi}\nseed = {seed}\nthreshold = 1e-13\nsteps = 30000\n{lines}"
        );
        let Ok(mut scene) = Scene::from_toml(&lines) else {
            eprintln!("  {name}: this version has no such scene");
            return Ok(());
        };
        let clock = Instant::now();
        let mut packing = start::packing(&scene)?;
        disks::relax(&mut packing, &scene.disks, scene.line_tension);
        let disks_seconds = clock.elapsed().as_secs_f64();
        if factor != 1.0 {
            // FIRE starts at a known part of its bound.
            let probe = Relaxation::of_packing(&scene, packing.clone())?;
            scene.dt_max = Some(factor * probe.observables().dt / scene.fire.first_dt);
        }
        let clock = Instant::now();
        let mut run = Relaxation::of_packing(&scene, packing)?;
        let mut decade = 1;
        loop {
            let seconds = disks_seconds + clock.elapsed().as_secs_f64();
            while decade <= 13 && run.f_max() <= 10f64.powi(-decade) {
                reached[decade as usize].push((seconds, disks_seconds, run.step() as f64));
                decade += 1;
            }
            if decade > 13 || run.status() != Status::Running {
                break;
            }
            run.advance()?;
        }
        rates.push(run.step() as f64 / clock.elapsed().as_secs_f64());
    }
    for (decade, list) in reached.iter().enumerate() {
        // A median over the seeds, where most have come so far.
        if 2 * list.len() > seeds as usize {
            let middle =
                |pick: fn(&(f64, f64, f64)) -> f64| median(list.iter().map(pick).collect());
            table.push(vec![
                particles.to_string(),
                phi.to_string(),
                name.into(),
                format!("1e-{decade}"),
                digits(middle(|r| r.0)),
                digits(middle(|r| r.1)),
                format!("{:.0}", middle(|r| r.2)),
                format!("{} of {seeds}", list.len()),
                format!("{:.0}", median(rates.clone())),
            ]);
        }
    }
    Ok(())
}
