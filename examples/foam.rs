//! What a model makes of a packing: one start relaxed as disks, as Morse–Witten droplets and as wet foam; and a foam that is almost dry.
//!
//! `cargo run --release --example foam -- [FOLDER]` writes `models.svg` and `foam.svg`. Disks overlap, Morse–Witten droplets lose area and have
//! tips where they touch, and the wet foam has the arcs of Young and Laplace.

#![expect(clippy::print_stdout, reason = "the table is what this program is for")]

use softjam::figure::{FigureError, Style, packing, write};
use softjam::models::Kind;
use softjam::protocol::{Relaxation, Status};
use softjam::scene::Scene;
use std::error::Error;
use std::path::PathBuf;

/// Width of a panel, and height of its title (pixels).
const PANEL: u32 = 300;
const TITLE: u32 = 22;

fn main() -> Result<(), Box<dyn Error>> {
    let folder = PathBuf::from(std::env::args().nth(1).unwrap_or(".".to_owned()));
    println!("model            phi        Z  p (γ/length)");
    let style = Style {
        chains: false,
        range: Some([0.4, 1.6]),
        width: f64::from(PANEL),
        ..Style::default()
    };
    let models = [
        ("disks", Kind::Disks),
        ("Morse–Witten", Kind::MorseWitten),
        ("wet foam", Kind::WetFoam),
    ];
    let mut panels = Vec::new();
    for (title, model) in models {
        panels.push((title, relaxed(model, 0.95, 48, &style)?));
    }
    write(folder.join("models.svg"), &row(&panels)?)?;

    let style = Style {
        chains: false,
        films: true,
        ..Style::default()
    };
    let foam = relaxed(Kind::WetFoam, 0.99, 80, &style)?;
    write(folder.join("foam.svg"), &foam)?;
    Ok(())
}

/// A packing in balance, as SVG.
fn relaxed(
    model: Kind,
    phi: f64,
    particles: usize,
    style: &Style,
) -> Result<String, Box<dyn Error>> {
    let scene = Scene {
        particles,
        phi,
        model,
        ..Scene::default()
    };
    let mut run = Relaxation::new(&scene)?;
    while run.status() == Status::Running {
        run.advance()?;
    }
    let o = run.observables();
    let (z, p) = (o.coordination(), o.pressure());
    println!("{:13} {phi:6.3} {z:8.4} {p:13.8}", model.name());
    Ok(packing(run.packing(), &run.frame(), &scene, style))
}

/// Pictures side by side, each below its title.
fn row(panels: &[(&str, String)]) -> Result<String, Box<dyn Error>> {
    let (mut inside, mut height, mut x) = (Vec::new(), 0.0_f64, 0);
    for (title, svg) in panels {
        let after = svg.split(" height=\"").nth(1);
        let number = after.and_then(|rest| rest.split('"').next());
        let number =
            number.ok_or_else(|| FigureError::Nothing("a picture without a height".to_owned()))?;
        height = height.max(number.parse()?);
        let place = format!("<svg x=\"{x}\" y=\"{TITLE}\" ");
        // Each has its own box to clip at.
        let svg = svg
            .replacen("<svg ", &place, 1)
            .replace("\"box\"", &format!("\"box{x}\""));
        let svg = svg.replace("#box", &format!("#box{x}"));
        let middle = x + PANEL / 2;
        inside.push(format!(
            "<text x=\"{middle}\" y=\"20\" text-anchor=\"middle\" font-size=\"16\">{title}</text>\n{svg}\n"
        ));
        x += PANEL;
    }
    let (inside, height) = (inside.concat(), height + f64::from(TITLE));
    Ok(format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{x}\" height=\"{height}\" viewBox=\"0 0 {x} {height}\" \
         font-family=\"DejaVu Sans, Verdana, sans-serif\">\n<rect width=\"100%\" height=\"100%\" fill=\"white\"/>\n{inside}</svg>\n"
    ))
}
