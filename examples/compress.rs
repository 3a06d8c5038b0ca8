//! The library without the program: a packing compressed slowly, by a loop of one's own (a scene has `[[protocol]]` for it).
//!
//! `cargo run --release --no-default-features --example compress -- [FOLDER]` needs the physics alone. A packing is relaxed, its
//! box made a little smaller, relaxed again, and so on. The forces are the gradient of the stored energy `U`, so that the work
//! of the walls `W = −∫ p dV` is what `U` gains, but for what rearrangements dissipate: `W ≥ U(end) − U(start)`. Contours
//! are drawn by hand, as `compress.svg`: the library gives polygons, the picture is yours.

#![expect(clippy::print_stdout, reason = "the table is what this program is for")]

use softjam::domain::Domain;
use softjam::models::Model;
use softjam::models::droplet::Form;
use softjam::models::droplet::contour::{ContourStyle, Contours};
use softjam::protocol::{Relaxation, Status};
use softjam::scene::{Minimizer, Scene};
use softjam::state::Packing;
use std::error::Error;
use std::fmt::Write as _;
use std::path::PathBuf;

fn main() -> Result<(), Box<dyn Error>> {
    let folder = PathBuf::from(std::env::args().nth(1).unwrap_or(".".to_owned()));
    let scene = Scene {
        particles: 100,
        phi: 0.86,
        seed: 2,
        forces: Form::Gradient,
        minimizer: Minimizer::FireNewton,
        ..Scene::default()
    };
    let mut run = Relaxation::new(&scene)?;
    let (mut work, mut before) = (0.0, None);
    println!("   phi        Z  p (γ/length)  U (γ length)  W (γ length)");
    for k in 0..=40 {
        if k > 0 {
            let smaller = scaled(run.packing(), 0.86 + 0.001 * f64::from(k))?;
            run = Relaxation::of_packing(&scene, smaller)?;
        }
        while run.status() == Status::Running {
            run.advance()?;
        }
        let o = run.observables();
        let (phi, volume) = (run.packing().coverage(), run.packing().domain().area());
        if let Some((p, v)) = before {
            work += 0.5 * (p + o.pressure()) * (v - volume);
        }
        before = Some((o.pressure(), volume));
        let (z, p, u) = (o.coordination(), o.pressure(), o.energy);
        println!("{phi:6.3} {z:8.4} {p:13.8} {u:13.8} {work:13.8}");
    }
    std::fs::write(folder.join("compress.svg"), picture(&run))?;
    Ok(())
}

/// The packing in a box of the same shape, so small that the coverage is `phi`.
fn scaled(packing: &Packing, phi: f64) -> Result<Packing, Box<dyn Error>> {
    let factor = (packing.coverage() / phi).sqrt();
    let lengths = packing.domain().lengths() * factor;
    let domain = Domain::new(lengths.x, lengths.y).ok_or("the box has no area")?;
    let positions = packing.positions().iter().map(|r| domain.wrap(r * factor));
    Ok(Packing::new(
        domain,
        packing.radii().to_vec(),
        positions.collect(),
    )?)
}

/// The contours as SVG, forty pixels a length, y upwards.
fn picture(run: &Relaxation) -> String {
    let (packing, pixels) = (run.packing(), 40.0);
    let mut contours = Contours::new(ContourStyle::default());
    contours.draw(
        packing.radii(),
        packing.positions(),
        &run.contacts(),
        run.model().line_tension(),
    );
    let l = packing.domain().lengths() * pixels;
    let mut svg = format!(
        "<svg xmlns='http://www.w3.org/2000/svg' width='{:.0}' height='{:.0}'>\n<rect width='100%' height='100%' fill='white'/>\n<g id='packing'>\n",
        l.x, l.y
    );
    for p in 0..contours.len() {
        svg += "<polygon fill='#cfdfe8' stroke='#1c1c1c' points='";
        for v in contours.polygon(p) {
            // Writing to a String cannot fail.
            let _ = write!(svg, "{:.1},{:.1} ", pixels * v.x, l.y - pixels * v.y);
        }
        svg += "'/>\n";
    }
    svg += "</g>\n";
    // What crosses an edge of the box comes in at the other.
    for (x, y) in [(0, 1), (1, 0), (1, 1), (1, -1)] {
        for sign in [-1.0, 1.0] {
            let (x, y) = (sign * f64::from(x) * l.x, sign * f64::from(y) * l.y);
            let _ = writeln!(svg, "<use href='#packing' x='{x:.1}' y='{y:.1}'/>");
        }
    }
    svg + "</svg>\n"
}
