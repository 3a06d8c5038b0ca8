//! The approach to jamming: coordination and pressure of packings above the transition, mean of a few samples.
//!
//! `cargo run --release --example jamming -- [FOLDER [N [SAMPLES]]]` prints φ, Z with its standard error, the pressure and the
//! share of rattlers, and draws `jamming.svg`: Z beside that of undeformed disks, `4 + 3.6 √(φ − 0.842)` (C. S. O'Hern et
//! al., Phys. Rev. E 68, 011306 (2003), for two dimensions).

#![expect(clippy::print_stdout, reason = "the table is what this program is for")]

use softjam::figure::{Axis, Curve, Mark, Scale, chart, write};
use softjam::protocol::{Relaxation, Status};
use softjam::scene::Scene;
use std::error::Error;
use std::path::PathBuf;

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let folder = PathBuf::from(arguments.next().unwrap_or(".".to_owned()));
    let particles: usize = arguments.next().map_or(Ok(256), |n| n.parse())?;
    let samples: u64 = arguments.next().map_or(Ok(5), |n| n.parse())?;
    let mut measured = Curve {
        label: format!("deformable, N = {particles}"),
        mark: Mark::Dots,
        ..Curve::default()
    };
    println!("   phi       Z   +/-  p (γ/length)  rattlers   jammed");
    for phi in [0.845, 0.85, 0.86, 0.87, 0.88, 0.90, 0.92, 0.95] {
        let (mut z, mut p, mut rattlers) = (Vec::new(), 0.0, 0);
        for seed in 1..=samples {
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
        if z.len() < 2 {
            println!("{phi:6.3}  {n} of {samples} jammed: no mean");
            continue;
        }
        let mean = z.iter().sum::<f64>() / n;
        let variance = z.iter().map(|z| (z - mean) * (z - mean)).sum::<f64>() / (n - 1.0);
        let error = (variance / n).sqrt();
        let share = 100.0 * rattlers as f64 / (n * particles as f64);
        let p = p / n;
        println!("{phi:6.3} {mean:8.4} {error:6.4} {p:13.6} {share:7.2} % {n:6} of {samples}");
        measured.points.push((phi, mean));
        measured.errors.push(error);
    }
    let disks = Curve {
        label: "undeformed disks, O'Hern et al. 2003".to_owned(),
        points: (0..=110)
            .map(|k| f64::from(k) / 1000.0)
            .map(|x| (0.842 + x, 4.0 + 3.6 * x.sqrt()))
            .collect(),
        mark: Mark::Dashes,
        ..Curve::default()
    };
    let axis = |title: &str| Axis {
        title: title.to_owned(),
        scale: Scale::Linear,
    };
    let svg = chart(
        &axis("coverage φ of the undeformed disks"),
        &axis("coordination Z"),
        &[disks, measured],
    )?;
    write(folder.join("jamming.svg"), &svg)?;
    Ok(())
}
