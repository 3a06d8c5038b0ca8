//! Quasi-static shear: stress against strain, elastic stretches and the events in which particles rearrange and stress falls.
//!
//! `cargo run --release --example shear -- [FOLDER [STRAIN]]` prints how often and at which stress a packing of disks and one of Morse–Witten
//! droplets yield, and draws `shear.svg` and the droplets in their sheared box, `sheared.svg`. Forces are the gradient of the stored energy: central
//! ones do work of their own on the way.

#![expect(clippy::print_stdout, reason = "the table is what this program is for")]

use softjam::figure::{CHART_WIDTH, Course, RelaxedState, Style, packing, stress_strain, write};
use softjam::models::Kind;
use softjam::models::droplet::Form;
use softjam::protocol::{Relaxation, Status};
use softjam::scene::{Act, Scene, Shear, Stage};
use std::error::Error;
use std::path::PathBuf;

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let folder = PathBuf::from(arguments.next().unwrap_or(".".to_owned()));
    let strain: f64 = arguments.next().map_or(Ok(0.3), |s| s.parse())?;
    let models = [
        ("disks", Kind::Disks, Form::Central),
        ("Morse–Witten droplets", Kind::MorseWitten, Form::Gradient),
    ];
    println!(
        "model                  states  events  mean stress (γ/length)  final energy (γ length)"
    );
    let mut courses = Vec::new();
    for (label, model, forces) in models {
        let scene = Scene {
            particles: 128,
            phi: 0.9,
            model,
            forces,
            protocol: vec![Stage {
                act: Act::Shear {
                    mode: Shear::Simple,
                    strain,
                    step: 1e-3,
                    cycles: 0,
                },
                threshold: 1e-9,
                steps: 20_000,
            }],
            ..Scene::default()
        };
        let mut run = Relaxation::new(&scene)?;
        let mut states = vec![];
        loop {
            states.extend(run.is_relaxed_state().then(|| state(&run)));
            if run.status() != Status::Running {
                break;
            }
            run.advance()?;
        }
        let course = Course {
            label: label.to_owned(),
            states,
            has_potential: true,
            diameter: 1.0,
            ..Course::default()
        };
        let stress = course.states.iter().map(|state| state.stress[1]);
        let (count, events) = (course.states.len(), course.yields().count());
        let (mean, energy) = (stress.sum::<f64>() / count as f64, run.observables().energy);
        println!("{label:22} {count:6} {events:7} {mean:23.6} {energy:24.8}");
        courses.push(course);
        if model == Kind::MorseWitten {
            let svg = packing(run.packing(), &run.frame(), &scene, &Style::default());
            write(folder.join("sheared.svg"), &svg)?;
        }
    }
    write(
        folder.join("shear.svg"),
        &stress_strain(CHART_WIDTH, &courses)?,
    )?;
    Ok(())
}

fn state(run: &Relaxation) -> RelaxedState {
    let o = run.observables();
    let [phi, strain] = o.phi_and_strain.unwrap_or_default();
    RelaxedState {
        strain,
        phi,
        area: run.packing().domain().area(),
        energy: o.energy,
        stress: o.stress,
    }
}
