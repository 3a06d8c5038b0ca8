//! What the laws make of one packing: energy, osmotic pressure and forces against the exact wet foam, and the time to relax.
//!
//! Each law relaxes the same disks. Where they end up in the same minimum, which most do, what is left between them is the error of the
//! law; the median over the seeds leaves out those that do not.

use super::table::{Table, digits, median};
use softjam::models::Kind;
use softjam::models::droplet::validity::Validity;
use softjam::protocol::{Relaxation, Status, relax_disks};
use softjam::scene::{Scene, start};
use std::collections::BTreeMap;
use std::error::Error;
use std::time::Instant;

/// The laws, the exact one last.
pub const LAWS: [Kind; 4] = [
    Kind::Disks,
    Kind::MorseWitten,
    Kind::RoundedPolygon,
    Kind::WetFoam,
];

/// A packing relaxed by one law.
struct Relaxed {
    /// U (γ·length) and Π (γ/length).
    energy: f64,
    pressure: f64,
    /// Mean squeeze `Σf/2πγ`.
    squeeze: f64,
    forces: BTreeMap<[u32; 2], f64>,
    /// Both stages (s).
    seconds: f64,
}

/// What is measured of one law over the seeds: one list an item.
#[derive(Default)]
struct Found {
    energy: Vec<f64>,
    pressure: Vec<f64>,
    force_rms: Vec<f64>,
    squeeze: Vec<f64>,
    seconds: Vec<f64>,
}

/// Bidisperse packings of each law against wet foam, medians over seeds: signed errors of U and Π, and
/// `rms(f − f_exact)/mean(f_exact)` over the pairs that bear a force in either.
pub fn measure(table: &mut Table, quick: bool) -> Result<(), Box<dyn Error>> {
    let phis: &[f64] = if quick {
        &[0.90]
    } else {
        &[0.86, 0.88, 0.90, 0.93, 0.96, 0.98]
    };
    let seeds = if quick { 1 } else { 8 };
    for &phi in phis {
        let mut found = LAWS.map(|_| Found::default());
        for seed in 1..=seeds {
            let laws = relaxed(64, phi, seed)?;
            if let Some(exact) = laws.last().and_then(Option::as_ref) {
                for (found, law) in found.iter_mut().zip(&laws) {
                    if let Some(law) = law {
                        found.add(law, exact);
                    }
                }
            }
        }
        for (law, found) in LAWS.iter().zip(found) {
            let seeds = found.energy.len();
            let [energy, pressure, force_rms, squeeze, seconds] = [
                found.energy,
                found.pressure,
                found.force_rms,
                found.squeeze,
                found.seconds,
            ]
            .map(|values| digits(median(values)));
            table.add(&[
                ("geometry", "packing"),
                ("law", law.name()),
                ("phi", &phi.to_string()),
                ("squeeze", &squeeze),
                ("energy_error", &energy),
                ("pressure_error", &pressure),
                ("force_rms", &force_rms),
                ("seconds", &seconds),
                ("seeds", &seeds.to_string()),
            ]);
        }
    }
    Ok(())
}

impl Found {
    fn add(&mut self, law: &Relaxed, exact: &Relaxed) {
        let force = |of: &Relaxed, pair: &[u32; 2]| of.forces.get(pair).copied().unwrap_or(0.0);
        let mut pairs: Vec<_> = law.forces.keys().chain(exact.forces.keys()).collect();
        pairs.sort_unstable();
        pairs.dedup();
        let squares = pairs
            .iter()
            .map(|pair| (force(law, pair) - force(exact, pair)).powi(2));
        let rms = (squares.sum::<f64>() / pairs.len() as f64).sqrt();
        let mean = exact.forces.values().sum::<f64>() / exact.forces.len() as f64;
        self.energy.push(law.energy / exact.energy - 1.0);
        self.pressure.push(law.pressure / exact.pressure - 1.0);
        self.force_rms.push(rms / mean);
        self.squeeze.push(law.squeeze);
        self.seconds.push(law.seconds);
    }
}

/// One start relaxed by each law; `None` where one does not converge.
fn relaxed(particles: usize, phi: f64, seed: u64) -> Result<[Option<Relaxed>; 4], Box<dyn Error>> {
    let scene = Scene {
        particles,
        phi,
        seed,
        ..Scene::default()
    };
    let clock = Instant::now();
    let mut packing = start::packing(&scene)?;
    relax_disks(&mut packing, &scene.disks, scene.line_tension).unwrap();
    let disks = clock.elapsed().as_secs_f64();
    let mut laws = [const { None }; 4];
    for (relaxed, law) in laws.iter_mut().zip(LAWS) {
        let scene = Scene {
            model: law,
            ..scene.clone()
        };
        let clock = Instant::now();
        let mut run = Relaxation::of_packing(&scene, packing.clone())?;
        while run.status() == Status::Running {
            run.advance()?;
        }
        if run.status() == Status::Converged {
            let (contacts, observables) = (run.contacts(), run.observables());
            let forces = contacts
                .pairs
                .iter()
                .copied()
                .zip(contacts.forces.iter().copied());
            *relaxed = Some(Relaxed {
                energy: observables.energy,
                pressure: observables.pressure(),
                squeeze: Validity::of(&contacts, particles, 1.0).mean,
                forces: forces.collect(),
                seconds: disks + clock.elapsed().as_secs_f64(),
            });
        }
    }
    Ok(laws)
}
