//! The approach to jamming by decompression: excess contacts and pressure against the distance to each sample's own φ_J.
//!
//! `cargo run --release --example approach -- [FOLDER [N [SAMPLES]]]` prints φ_J of each sample and draws `approach.svg`. A stage `jam` halves the
//! pressure until φ_J can be extrapolated to; its relaxed states are the curve. A packing of N particles that are held has N(4 − 2/N)/2
//! contacts at φ_J, so `Z − 4 + 2/N` is the excess; it goes as √(φ − φ_J), and `p` as φ − φ_J (C. S. O'Hern et al., Phys. Rev. E 68,
//! 011306 (2003)).

#![expect(clippy::print_stdout, reason = "the table is what this program is for")]

use softjam::figure::{Axis, Curve, Mark, Scale, chart, write};
use softjam::models::Kind;
use softjam::protocol::{Relaxation, Status};
use softjam::scene::{Act, Scene, Stage, Way};
use std::error::Error;
use std::path::PathBuf;

/// The search starts from this coverage, which is part of what it finds.
const START: f64 = 0.87;

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let folder = PathBuf::from(arguments.next().unwrap_or(".".to_owned()));
    let particles: usize = arguments.next().map_or(Ok(128), |n| n.parse())?;
    let samples: u64 = arguments.next().map_or(Ok(4), |n| n.parse())?;
    let mut curves = Vec::new();
    println!("model          seed         φ_J   dp/dφ  states");
    for (name, model) in [("disks", Kind::Disks), ("Morse–Witten", Kind::MorseWitten)] {
        let (mut excess, mut pressure) = (Vec::new(), Vec::new());
        for seed in 1..=samples {
            let scene = Scene {
                particles,
                phi: START,
                seed,
                model,
                protocol: vec![jam()],
                ..Scene::default()
            };
            let (states, phi_j, slope) = decompressed(&scene)?;
            let count = states.len();
            println!("{name:13} {seed:5} {phi_j:11.8} {slope:7.4} {count:7}");
            for [phi, p, z] in states {
                // Less than half a contact is what rounding makes of none.
                excess.extend((z > 1.0 / particles as f64).then_some((phi - phi_j, z)));
                pressure.push((phi - phi_j, p));
            }
        }
        for (what, points) in [("Z − 4 + 2/N", excess), ("p", pressure)] {
            curves.push(Curve {
                label: format!("{what}, {name}"),
                points,
                mark: Mark::Dots,
                ..Curve::default()
            });
        }
    }
    let power = |label: &str, factor: f64, exponent: f64| Curve {
        label: label.to_owned(),
        points: [1e-5, 4e-2]
            .map(|x: f64| (x, factor * libm::pow(x, exponent)))
            .to_vec(),
        mark: Mark::Dashes,
        ..Curve::default()
    };
    curves.push(power("slopes ½ and 1", 3.6, 0.5));
    curves.push(power("slopes ½ and 1", 1.4, 1.0));
    let axis = |title: &str| Axis {
        title: title.to_owned(),
        scale: Scale::Logarithmic,
    };
    let svg = chart(
        &axis("φ − φ_J"),
        &axis("excess contacts, pressure (γ/length)"),
        &curves,
    )?;
    write(folder.join("approach.svg"), &svg)?;
    Ok(())
}

fn jam() -> Stage {
    Stage {
        act: Act::Jam {
            way: Way::Halving,
            end: 1e-5,
        },
        threshold: 1e-11,
        steps: 100_000,
    }
}

/// Coverage, pressure and excess contacts of each state; φ_J and the slope of the pressure there.
type Branch = (Vec<[f64; 3]>, f64, f64);

/// Coverage, pressure and excess contacts of the jammed states on the way down; φ_J and the slope of the pressure there.
fn decompressed(scene: &Scene) -> Result<Branch, Box<dyn Error>> {
    let mut run = Relaxation::new(scene)?;
    let mut states = Vec::new();
    loop {
        let o = run.observables();
        // A state that came apart has no contacts to count.
        if run.is_relaxed_state() && o.pressure() > 1e-8 {
            let held = (o.particles - o.rattlers) as f64;
            let excess = o.coordination() - 4.0 + 2.0 / held;
            states.push([run.packing().coverage(), o.pressure(), excess]);
        }
        if run.status() != Status::Running {
            break;
        }
        run.advance()?;
    }
    let found = run.jamming().ok_or("the search did not come to its end")?;
    Ok((states, found.phi_j, found.slope.unwrap_or_default()))
}
