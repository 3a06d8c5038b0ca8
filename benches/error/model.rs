//! (c) The error of the model itself, which no solver can lower: its forces against the exact Young–Laplace ones.
//!
//! At the same distance of the walls (or the same φ of the crystal) the model's force is held against that of a droplet
//! between n equal walls, whose shape is exact: an n-gon with rounded corners. Forces of the hexagonal crystal are softjam's
//! own, so that their *numerical* error against the model's closed form shows beside the model's.

use super::table::{Table, digits};
use softjam::models::droplet::kernel::g;
use softjam::models::droplet::validity::Validity;
use softjam::protocol::{Relaxation, Status};
use softjam::scene::{Radii, Scene, Species, Start};
use std::error::Error;
use std::f64::consts::PI;

pub fn measure(quick: bool) -> Result<Table, Box<dyn Error>> {
    let mut table = Table::new(&[
        "geometry",
        "phi",
        "squeeze",
        "force_exact",
        "force_model",
        "model_error",
        "numerical_error",
    ]);
    for (name, walls) in [
        ("two plates", 2u32),
        ("triangle", 3),
        ("square", 4),
        ("hexagon", 6),
    ] {
        for k in 0..=(if quick { 6 } else { 30 }) {
            let squeeze = 10f64.powf(-3.0 + 2.6 * f64::from(k) / if quick { 6.0 } else { 30.0 });
            // The model: dent = (f/2π) Σ −g, and Σ f = 2π s.
            let force = 2.0 * PI * squeeze / f64::from(walls);
            let dent = -(0..walls)
                .map(|k| g(2.0 * PI * f64::from(k) / f64::from(walls)))
                .sum::<f64>()
                * force
                / (2.0 * PI);
            if let Some(exact) = exact_force(walls, 1.0 - dent) {
                table.push(vec![
                    name.into(),
                    String::new(),
                    digits(squeeze),
                    digits(exact),
                    digits(force),
                    digits(1.0 - force / exact),
                    String::new(),
                ]);
            }
        }
    }
    for phi in [0.9075, 0.908, 0.91, 0.915, 0.92, 0.93, 0.94, 0.96] {
        crystal(&mut table, phi)?;
    }
    for phi in [0.845, 0.85, 0.86, 0.87, 0.88, 0.90, 0.92, 0.95, 1.0] {
        packing(&mut table, phi, if quick { 64 } else { 256 })?;
    }
    Ok(table)
}

/// The force on each of `n` walls at `inradius`·R from the centre of a droplet of area πR² (units of γ), by bisection;
/// `None` where no droplet fits.
fn exact_force(n: u32, inradius: f64) -> Option<f64> {
    if n == 2 {
        return (inradius > 0.0).then(|| 0.5 * PI * (1.0 / (inradius * inradius) - 1.0));
    }
    let slope = (PI / f64::from(n)).tan();
    let b = f64::from(n) * slope / PI;
    let at = |x: f64| (1.0 + x) / (1.0 + 2.0 * b * x + b * x * x).sqrt();
    // x → ∞ is the polygon itself, of inradius b^(−1/2).
    if inradius <= 1.0 / b.sqrt() || inradius >= 1.0 {
        return None;
    }
    let (mut low, mut high) = (0.0, 1.0);
    while at(high) > inradius {
        high *= 2.0;
    }
    for _ in 0..200 {
        let middle = 0.5 * (low + high);
        if at(middle) > inradius {
            low = middle;
        } else {
            high = middle;
        }
    }
    Some(2.0 * low * slope)
}

fn crystal(table: &mut Table, phi: f64) -> Result<(), Box<dyn Error>> {
    let scene = Scene {
        particles: 120,
        phi,
        radii: Radii::Species(vec![Species {
            radius: 0.5,
            fraction: 1.0,
        }]),
        start: Start::Hexagonal,
        contact_tolerance: 1e-14,
        ..Scene::default()
    };
    let run = Relaxation::new(&scene)?;
    let inradius = (PI / (12f64.sqrt() * phi)).sqrt();
    let closed = 2.0 * PI * (1.0 - inradius) / (6.0 - PI * 3f64.sqrt());
    let forces = run.contacts().forces;
    let worst = forces
        .iter()
        .fold(0.0, |m: f64, f| m.max((f / closed - 1.0).abs()));
    let exact = exact_force(6, inradius).ok_or("no droplet fits")?;
    table.push(vec![
        "hexagonal crystal".into(),
        phi.to_string(),
        digits(Validity::of(&run.contacts(), 120, 1.0).mean),
        digits(exact),
        digits(forces[0]),
        digits(1.0 - forces[0] / exact),
        digits(worst),
    ]);
    Ok(())
}

/// A disordered packing has no exact answer; where it stands on the axis of the squeeze.
fn packing(table: &mut Table, phi: f64, particles: usize) -> Result<(), Box<dyn Error>> {
    let scene = Scene {
        particles,
        phi,
        threshold: 1e-8,
        ..Scene::default()
    };
    let mut run = Relaxation::new(&scene)?;
    while run.status() == Status::Running {
        run.advance()?;
    }
    let validity = Validity::of(&run.contacts(), particles, 1.0);
    table.push(vec![
        "packing".into(),
        phi.to_string(),
        digits(validity.mean),
        String::new(),
        String::new(),
        digits(softjam::models::droplet::validity::model_error(
            validity.mean,
        )),
        String::new(),
    ]);
    Ok(())
}
