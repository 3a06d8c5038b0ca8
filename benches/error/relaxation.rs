//! (b) The relaxation: wall time, both stages, to each decade of f_max.
//!
//! Scenes are lines of a scene file; one that this version does not know is left out and said so.

use super::table::{Table, digits, median};
use softjam::protocol::relax_disks;
use softjam::protocol::{Relaxation, Status};
use softjam::scene::{Scene, start};
use std::error::Error;
use std::time::Instant;

/// Name, lines of the scene, factor on the default dt_max.
type Variant = (&'static str, &'static str, f64);

const VARIANTS: [Variant; 7] = [
    ("fire", "", 1.0),
    ("fire + newton", "minimizer = \"fire+newton\"", 1.0),
    ("fire (gradient form)", "forces = \"gradient\"", 1.0),
    (
        "fire + newton (gradient form)",
        "minimizer = \"fire+newton\"\nforces = \"gradient\"",
        1.0,
    ),
    ("fire (dt_max / 2)", "", 0.5),
    ("fire (dt_max × 1.4)", "", 1.4),
    ("fire (dt_max × 2)", "", 2.0),
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
        let asked: Vec<Variant> = VARIANTS
            .into_iter()
            .enumerate()
            // Time steps and gradient form are compared at one size and coverage; both forms at two.
            .filter(|(k, _)| match k {
                0 | 1 => true,
                2 | 3 => particles <= 1024 && (phi == 0.86 || phi == 0.90),
                _ => (particles == 1024 && phi == 0.86) || quick,
            })
            .map(|(_, variant)| variant)
            .collect();
        sample(&mut table, (particles, phi, seeds), &asked)?;
    }
    Ok(table)
}

/// The variants in turn, seed by seed, so that a disturbance of the machine meets all of them.
fn sample(
    table: &mut Table,
    (particles, phi, seeds): (usize, f64, u64),
    variants: &[Variant],
) -> Result<(), Box<dyn Error>> {
    let mut runs: Vec<Vec<Reached>> = vec![Vec::new(); variants.len()];
    for seed in 1..=seeds {
        for (list, variant) in runs.iter_mut().zip(variants) {
            list.extend(run((particles, phi, seed), variant)?);
        }
    }
    for (list, (name, ..)) in runs.iter().zip(variants) {
        if list.is_empty() {
            eprintln!("  {name}: this version has no such scene");
        }
        for decade in 1..=LAST_OF_NEWTON {
            // A median over the seeds, where most have come so far.
            let of = |pick: fn(&(f64, u64)) -> f64| -> Vec<f64> {
                let came = list.iter().filter_map(|r| r.decades.get(decade - 1));
                came.map(pick).collect()
            };
            let seconds = of(|r| r.0);
            if 2 * seconds.len() > seeds as usize {
                table.push(vec![
                    particles.to_string(),
                    phi.to_string(),
                    (*name).into(),
                    format!("1e-{decade}"),
                    digits(median(seconds.clone())),
                    digits(median(list.iter().map(|r| r.disks).collect())),
                    format!("{:.0}", median(of(|r| r.1 as f64))),
                    format!("{} of {seeds}", seconds.len()),
                    format!("{:.0}", median(list.iter().map(|r| r.rate).collect())),
                ]);
            }
        }
    }
    Ok(())
}

/// Round-off keeps FIRE from much less than 1e-12; Newton's method goes on.
const LAST_OF_FIRE: usize = 12;
const LAST_OF_NEWTON: usize = 13;

/// What a run has reached.
#[derive(Clone)]
struct Reached {
    /// Seconds since the start and steps, when f_max fell to 1e-1, 1e-2, …
    decades: Vec<(f64, u64)>,
    /// Seconds of the disks.
    disks: f64,
    /// Steps a second.
    rate: f64,
}

/// One relaxation; `None` if this version has no such scene.
fn run(
    (particles, phi, seed): (usize, f64, u64),
    (name, lines, factor): &Variant,
) -> Result<Option<Reached>, Box<dyn Error>> {
    let last = if name.contains("newton") {
        LAST_OF_NEWTON
    } else {
        LAST_OF_FIRE
    };
    let lines = format!(
        "particles = {particles}\nphi = {phi}\nseed = {seed}\nthreshold = 1e-{last}\nsteps = 30000\n{lines}"
    );
    let Ok(mut scene) = Scene::from_toml(&lines) else {
        return Ok(None);
    };
    let clock = Instant::now();
    let mut packing = start::packing(&scene)?;
    relax_disks(&mut packing, &scene.disks, scene.line_tension).unwrap();
    let disks = clock.elapsed().as_secs_f64();
    if *factor != 1.0 {
        // FIRE starts at a known part of its bound.
        let probe = Relaxation::of_packing(&scene, packing.clone())?;
        scene.dt_max = Some(factor * probe.observables().dt / scene.fire.first_dt);
    }
    let clock = Instant::now();
    let mut run = Relaxation::of_packing(&scene, packing)?;
    let mut decades = Vec::new();
    loop {
        let seconds = disks + clock.elapsed().as_secs_f64();
        while decades.len() < last && run.f_max() <= 0.1f64.powi(decades.len() as i32 + 1) {
            decades.push((seconds, run.step()));
        }
        if decades.len() == last || run.status() != Status::Running {
            break;
        }
        run.advance()?;
    }
    let rate = run.step() as f64 / clock.elapsed().as_secs_f64();
    Ok(Some(Reached {
        decades,
        disks,
        rate,
    }))
}
