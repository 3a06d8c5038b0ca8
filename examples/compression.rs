//! A compression as a protocol: one start in three models, pressure against coverage, and the foam at three coverages.
//!
//! `cargo run --release --example compression -- [FOLDER]` prints φ, Z and p of the three at some coverages, and draws `compression.svg` and the wet foam
//! at its beginning, in the middle and almost dry, `compression-a.svg` to `compression-c.svg`.

#![expect(clippy::print_stdout, reason = "the table is what this program is for")]

use softjam::figure::{CHART_WIDTH, Course, RelaxedState, Style, packing, pressure_phi, write};
use softjam::models::Kind;
use softjam::protocol::{Relaxation, Status};
use softjam::scene::{Act, Increment, Scene, Stage, Until};
use std::error::Error;
use std::path::{Path, PathBuf};

const START: f64 = 0.85;
const END: f64 = 0.98;
const STEP: f64 = 0.005;

fn main() -> Result<(), Box<dyn Error>> {
    let folder = PathBuf::from(std::env::args().nth(1).unwrap_or(".".to_owned()));
    println!("model            φ        Z  p (γ/length)");
    let models = [
        ("disks", Kind::Disks),
        ("Morse–Witten", Kind::MorseWitten),
        ("wet foam", Kind::WetFoam),
    ];
    let mut courses = Vec::new();
    for (label, model) in models {
        courses.push(Course {
            label: label.to_owned(),
            states: compressed(model, &folder)?,
            ..Course::default()
        });
    }
    write(
        folder.join("compression.svg"),
        &pressure_phi(CHART_WIDTH, &courses)?,
    )?;
    Ok(())
}

/// The relaxed states of a compression; draws those of the foam that are asked for.
fn compressed(model: Kind, folder: &Path) -> Result<Vec<RelaxedState>, Box<dyn Error>> {
    let scene = Scene {
        particles: 48,
        phi: START,
        model,
        protocol: vec![Stage {
            act: Act::Compress {
                until: Until::Phi(END),
                by: Increment::Absolute(STEP),
            },
            threshold: 1e-10,
            steps: 20_000,
        }],
        ..Scene::default()
    };
    let style = Style {
        range: Some([0.4, 1.6]),
        width: 300.0,
        chains: false,
        ..Style::default()
    };
    let mut run = Relaxation::new(&scene)?;
    let mut states = Vec::new();
    loop {
        if run.is_relaxed_state() {
            let (o, phi) = (run.observables(), run.packing().coverage());
            if states.len().is_multiple_of(5) || run.status() == Status::Converged {
                let (z, p) = (o.coordination(), o.pressure());
                println!("{:13} {phi:6.3} {z:8.4} {p:13.8}", model.name());
            }
            let letter = [START, 0.91, END]
                .iter()
                .position(|at| (at - phi).abs() < 1e-9);
            if let (Some(k), Kind::WetFoam) = (letter, model) {
                let svg = packing(run.packing(), &run.frame(), &scene, &style);
                let name = format!("compression-{}.svg", ["a", "b", "c"][k]);
                write(folder.join(name), &svg)?;
            }
            states.push(RelaxedState {
                phi,
                area: run.packing().domain().area(),
                energy: o.energy,
                stress: o.stress,
                ..RelaxedState::default()
            });
        }
        if run.status() != Status::Running {
            break;
        }
        run.advance()?;
    }
    Ok(states)
}
