//! One particle squeezed from n sides, against the exact droplet.
//!
//! A droplet between n equal walls on the sides of a regular n-gon is exactly an n-gon with rounded corners, so its force is
//! known: the error of the Morse–Witten model, which is linear in the forces, can be read off. Here the walls are the
//! mirror lines between a particle and its neighbours, which is the same problem.
//!
//! `cargo run --release --example squeeze -- [FOLDER]` prints the indentation, both forces and the model's error for a particle
//! in a hexagonal crystal (n = 6), and draws `squeeze.svg`.

#![expect(clippy::print_stdout, reason = "the table is what this program is for")]

use softjam::figure::{Axis, Curve, Mark, Scale, chart, write};
use softjam::protocol::Relaxation;
use softjam::scene::{Radii, Scene, Species, Start};
use std::error::Error;
use std::f64::consts::PI;
use std::path::PathBuf;

/// The exact force (units of γ) on each of the `n` sides of a droplet of undeformed radius 1 whose walls are at distance
/// `a` from its centre: with corners of radius r and x = (a − r)/r, the area gives 1/r² = 1 + (2t/π) x + (t/π) x²,
/// t = n tan(π/n), and the flat sides give f = 2 x tan(π/n).
fn exact_force(n: f64, a: f64) -> f64 {
    let t = n * libm::tan(PI / n);
    // (1 + x)² = (a/r)² = a² (1 + (2t/π) x + (t/π) x²): a quadratic equation for x.
    let (p, q) = (1.0 - a * a * t / PI, 1.0 - a * a);
    // p x² + 2p x + q = 0
    let x = -1.0 + (1.0 - q / p).sqrt();
    2.0 * x * libm::tan(PI / n)
}

fn main() -> Result<(), Box<dyn Error>> {
    let folder = PathBuf::from(std::env::args().nth(1).unwrap_or(".".to_owned()));
    let curve = |label: &str, mark| Curve {
        label: label.to_owned(),
        mark,
        ..Curve::default()
    };
    let mut exact_curve = curve("exact droplet", Mark::Dashes);
    let mut model_curve = curve("Morse–Witten", Mark::Dots);
    println!("    phi   indentation   f exact    f Morse-Witten   error");
    for phi in [0.908, 0.910, 0.915, 0.920, 0.930, 0.940, 0.960] {
        let scene = Scene {
            particles: 64,
            phi,
            radii: Radii::Species(vec![Species {
                radius: 0.5,
                fraction: 1.0,
            }]),
            start: Start::Hexagonal,
            ..Scene::default()
        };
        // A crystal is in balance as it stands.
        let run = Relaxation::new(&scene)?;
        let contacts = run.contacts();
        let n = contacts.forces.len() as f64;
        let f = contacts.forces.iter().sum::<f64>() / n;
        // Half the distance over the radius 1/2.
        let a = contacts.distances.iter().sum::<f64>() / n;
        let exact = exact_force(6.0, a);
        let indentation = 100.0 * (1.0 - a);
        println!(
            "{phi:7.3} {indentation:11.4} % {exact:11.5} {f:14.5} {:10.1} %",
            100.0 * (f / exact - 1.0)
        );
        model_curve.points.push((indentation, f));
    }
    for k in 0..=145 {
        let indentation = f64::from(k) / 50.0;
        let exact = exact_force(6.0, 1.0 - indentation / 100.0);
        exact_curve.points.push((indentation, exact));
    }
    let axis = |title: &str| Axis {
        title: title.to_owned(),
        scale: Scale::Linear,
    };
    let svg = chart(
        &axis("indentation 1 − a/R (%)"),
        &axis("force on each of six sides f / γ"),
        &[exact_curve, model_curve],
    )?;
    write(folder.join("squeeze.svg"), &svg)?;
    Ok(())
}
