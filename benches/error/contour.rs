//! (f) Contours as polygons: how far the polygon is from the contour, against the number of vertices.
//!
//! A converged packing (N = 256, φ = 0.90). The distance is measured along the ray from the centre, at eight angles
//! between every two vertices and at all contacts, against ρ(θ) from its formula; in units of the particle's radius.

use super::table::{Table, digits};
use softjam::models::droplet::contour::{ContourStyle, Contours, Placement};
use softjam::models::droplet::kernel::g;
use softjam::protocol::{Relaxation, Status};
use softjam::scene::Scene;
use std::error::Error;
use std::f64::consts::PI;
use std::time::Instant;

pub fn measure(quick: bool) -> Result<Table, Box<dyn Error>> {
    let mut table = Table::new(&[
        "placement",
        "vertices",
        "vertices_per_particle",
        "largest_error",
        "rms_error",
        "area_error",
        "ns_per_particle",
    ]);
    let scene = Scene {
        particles: if quick { 64 } else { 256 },
        phi: 0.90,
        threshold: 1e-8,
        ..Scene::default()
    };
    let mut run = Relaxation::new(&scene)?;
    while run.status() == Status::Running {
        run.advance()?;
    }
    for (name, placement) in [
        ("equal angles", Placement::Equal),
        ("and on contacts", Placement::Contacts),
    ] {
        for exponent in 3..=(if quick { 6 } else { 11 }) {
            style(
                &mut table,
                &run,
                name,
                ContourStyle {
                    vertices: 1 << exponent,
                    placement,
                },
            );
        }
    }
    Ok(table)
}

fn style(table: &mut Table, run: &Relaxation, name: &str, style: ContourStyle) {
    let (packing, contacts) = (run.packing(), run.contacts());
    let mut contours = Contours::new(style);
    let clock = Instant::now();
    contours.draw(packing.radii(), packing.positions(), &contacts, 1.0);
    let seconds = clock.elapsed().as_secs_f64();
    let mut around: Vec<Vec<(f64, f64)>> = vec![Vec::new(); packing.len()];
    for ((&[i, j], n), &f) in contacts
        .pairs
        .iter()
        .zip(contacts.normals)
        .zip(contacts.forces)
    {
        around[i as usize].push(((-n.y).atan2(-n.x), f));
        around[j as usize].push((n.y.atan2(n.x), f));
    }
    let (mut largest, mut squares, mut samples, mut area): (f64, f64, f64, f64) =
        (0.0, 0.0, 0.0, 0.0);
    for (p, pushed) in around.iter().enumerate() {
        let radius = packing.radii()[p];
        let rho = |angle: f64| {
            1.0 + pushed.iter().map(|(t, f)| f * g(angle - t)).sum::<f64>() / (2.0 * PI)
        };
        let centre = packing.positions()[p];
        let vertices: Vec<_> = contours
            .polygon(p)
            .iter()
            .map(|v| (v - centre) / radius)
            .collect();
        let mut polygon_area = 0.0;
        for (k, a) in vertices.iter().enumerate() {
            let b = vertices[(k + 1) % vertices.len()];
            polygon_area += 0.5 * a.perp(&b);
            let from = a.y.atan2(a.x);
            let width = (b.y.atan2(b.x) - from).rem_euclid(2.0 * PI);
            let mut angles: Vec<f64> = (1..=8)
                .map(|s| from + width * (f64::from(s) - 0.5) / 8.0)
                .collect();
            angles.extend(
                pushed
                    .iter()
                    .map(|c| c.0)
                    .filter(|t| (t - from).rem_euclid(2.0 * PI) < width),
            );
            for angle in angles {
                // The chord from a to b, met by the ray at this angle.
                let ray = softjam::domain::Vec2::new(angle.cos(), angle.sin());
                let chord = a.perp(&b) / ray.perp(&(b - a));
                let error = (chord - rho(angle)).abs();
                if width > 0.0 && error.is_finite() {
                    largest = largest.max(error);
                    squares += error * error;
                    samples += 1.0;
                }
            }
        }
        // ∮ ½ρ² dθ by the midpoint rule, fine beside what is compared.
        let n = 20_000;
        let exact: f64 = (0..n)
            .map(|k| rho(2.0 * PI * (f64::from(k) + 0.5) / f64::from(n)))
            .map(|r| 0.5 * r * r * 2.0 * PI / f64::from(n))
            .sum();
        area = area.max((polygon_area / exact - 1.0).abs());
    }
    table.push(vec![
        name.into(),
        style.vertices.to_string(),
        format!("{:.2}", contours.vertices() as f64 / packing.len() as f64),
        digits(largest),
        digits((squares / samples).sqrt()),
        digits(area),
        digits(1e9 * seconds / packing.len() as f64),
    ]);
}
