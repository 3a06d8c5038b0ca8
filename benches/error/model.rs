//! (c, g, h) The error of a law itself, which no solver can lower: against closed forms, and against the exact wet foam.
//!
//! A droplet between n equal walls has an exact shape, an n-gon with rounded corners. At the same distance of the walls the linear model's
//! force is held against its (`walls`), and softjam's own forces, of each law, in the crystals whose cells are these n-gons, in a row of
//! unequal droplets and in a checkerboard of them (`numbers.toml`): what is left there of the laws that are exact is numerical error.
//! Disordered packings are held against wet foam ([`packings`](super::packings)).

use super::packings::{self, LAWS};
use super::table::{Table, digits};
use serde::Deserialize;
use softjam::domain::{Domain, Vec2};
use softjam::models::Kind;
use softjam::models::droplet::kernel::g;
use softjam::models::droplet::validity::Validity;
use softjam::protocol::Relaxation;
use softjam::scene::Scene;
use softjam::state::Packing;
use std::error::Error;
use std::f64::consts::PI;

/// Names of a droplet between `n` walls, and of the crystal of such droplets.
const GEOMETRIES: [(&str, &str, u32); 4] = [
    ("two plates", "row", 2),
    ("triangle", "honeycomb crystal", 3),
    ("square", "square crystal", 4),
    ("hexagon", "hexagonal crystal", 6),
];

/// The undeformed radius of droplets in crystals.
const RADIUS: f64 = 0.5;

pub fn measure(quick: bool) -> Result<Table, Box<dyn Error>> {
    let mut table = Table::new(&[
        "geometry",
        "law",
        "phi",
        "squeeze",
        "force_exact",
        "force_model",
        "model_error",
        "numerical_error",
        "energy_error",
        "pressure_error",
        "force_rms",
        "seconds",
        "seeds",
    ]);
    let (points, squeezes): (u32, &[f64]) = if quick {
        (6, &[0.1])
    } else {
        (30, &[0.003, 0.01, 0.03, 0.1, 0.2, 0.4])
    };
    for (walls, crystal, n) in GEOMETRIES {
        for k in 0..=points {
            let exact = Ngon::of(n, 10f64.powf(-3.0 + 3.5 * f64::from(k) / f64::from(points)));
            let force = linear(n, exact.inradius);
            let squeeze = digits(f64::from(n) * force / (2.0 * PI));
            row(
                &mut table,
                (walls, Kind::MorseWitten, &squeeze),
                (exact.force, force),
                &[],
            );
        }
        for &squeeze in squeezes {
            let exact = Ngon::of(n, squeeze);
            let packing = crystal_of(n, 2.0 * RADIUS * exact.inradius)?;
            let energy = packing.len() as f64 * RADIUS * exact.energy;
            let known = (exact.force, energy, Some(linear(n, exact.inradius)));
            each_law(&mut table, crystal, &packing, known);
        }
    }
    let numbers = include_str!("../../src/models/droplet/foam/numbers.toml");
    let numbers: Numbers = toml::from_str(numbers)?;
    for (name, rows, pairs) in [
        ("row of two sizes", 1, numbers.channel),
        ("checkerboard", 4, numbers.checkerboard),
    ] {
        for pair in pairs {
            let packing = lattice(&pair, rows)?;
            let energy = 0.5 * packing.len() as f64 * pair.energy;
            each_law(&mut table, name, &packing, (pair.f, energy, None));
        }
    }
    packings::measure(&mut table, quick)?;
    Ok(table)
}

/// A droplet of area π between `n` walls: a regular n-gon with rounded corners.
struct Ngon {
    /// Distance of the walls.
    inradius: f64,
    /// Force on each (units of γ), and perimeter less 2π.
    force: f64,
    energy: f64,
}

impl Ngon {
    /// At the squeeze `n f/2π`.
    fn of(n: u32, squeeze: f64) -> Self {
        let sides = f64::from(n);
        let force = 2.0 * PI * squeeze / sides;
        // Of area πR²/r² = q²π and perimeter 2π (1 + p) at r = 1; the perimeter exceeds 2πq by 2π (1 + p − q). A stadium's sides are f long.
        let (x, p, square) = if n == 2 {
            (0.0, force / PI, 0.0)
        } else {
            let tan = (PI / sides).tan();
            let (x, t) = (0.5 * force / tan, sides * tan / PI);
            (x, t * x, t * x * x)
        };
        let q = (1.0 + 2.0 * p + square).sqrt();
        Self {
            inradius: (1.0 + x) / q,
            force,
            energy: 2.0 * PI * (p * p - square) / ((1.0 + p + q) * q),
        }
    }
}

/// The linear model's force on each of `n` walls at this distance (radii, units of γ): `1 − inradius = (f/2π) Σ −g`.
fn linear(n: u32, inradius: f64) -> f64 {
    let around = (0..n).map(|k| g(2.0 * PI * f64::from(k) / f64::from(n)));
    2.0 * PI * (inradius - 1.0) / around.sum::<f64>()
}

/// Droplets of `RADIUS`, each with `n` neighbours at a distance.
fn crystal_of(n: u32, distance: f64) -> Result<Packing, Box<dyn Error>> {
    // Sites of a rectangular cell, the cell, and how often it is repeated.
    let high = 3f64.sqrt();
    let (sites, cell, times): (&[[f64; 2]], _, _) = match n {
        2 => (&[[0.0, 0.0]], [1.0, 8.0], [4, 1]),
        3 => (
            &[
                [0.0, 0.0],
                [0.5, 0.5 / high],
                [0.5, 1.5 / high],
                [0.0, 2.0 / high],
            ],
            [1.0, 3.0 / high],
            [4, 2],
        ),
        4 => (&[[0.0, 0.0]], [1.0, 1.0], [6, 6]),
        _ => (&[[0.0, 0.0], [0.5, 0.5 * high]], [1.0, high], [6, 4]),
    };
    // Neighbours of the honeycomb are 1/√3 of its cell apart.
    let scale = if n == 3 { high * distance } else { distance };
    let mut positions = Vec::new();
    for column in 0..times[0] {
        for line in 0..times[1] {
            positions.extend(sites.iter().map(|site| {
                let corner = Vec2::new(f64::from(column) * cell[0], f64::from(line) * cell[1]);
                (corner + Vec2::new(site[0], site[1])) * scale
            }));
        }
    }
    let [width, height] = [0, 1].map(|k| f64::from(times[k]) * cell[k] * scale);
    let radii = vec![RADIUS; positions.len()];
    let domain = Domain::new(width, height).ok_or("a box without room")?;
    Ok(Packing::new(domain, radii, positions)?)
}

#[derive(Deserialize)]
struct Numbers {
    channel: Vec<Pair>,
    checkerboard: Vec<Pair>,
}

/// Droplets of two sizes in turn, `d` apart: force and energy of two of them.
#[derive(Deserialize)]
struct Pair {
    #[serde(rename = "R1")]
    one: f64,
    #[serde(rename = "R2")]
    other: f64,
    d: f64,
    f: f64,
    #[serde(rename = "U_pair")]
    energy: f64,
}

/// A row of four such droplets, or four rows.
fn lattice(pair: &Pair, rows: u32) -> Result<Packing, Box<dyn Error>> {
    let at = |k: u32| Vec2::new(f64::from(k % 4), f64::from(k / 4)) * pair.d;
    let radius = |k: u32| [pair.one, pair.other][((k % 4 + k / 4) % 2) as usize];
    let height = if rows == 1 { 4.0 } else { 4.0 * pair.d };
    let domain = Domain::new(4.0 * pair.d, height).ok_or("a box without room")?;
    let sites = 0..4 * rows;
    Ok(Packing::new(
        domain,
        sites.clone().map(radius).collect(),
        sites.map(at).collect(),
    )?)
}

/// The forces and the energy that each law has in a packing whose contacts are all alike, against the exact ones and the linear force.
fn each_law(
    table: &mut Table,
    geometry: &str,
    packing: &Packing,
    (force, energy, linear): (f64, f64, Option<f64>),
) {
    for law in LAWS {
        let scene = Scene {
            model: law,
            contact_tolerance: 1e-13,
            ..Scene::default()
        };
        let Ok(run) = Relaxation::of_packing(&scene, packing.clone()) else {
            eprintln!("  {geometry}: no {} has these contacts", law.name());
            continue;
        };
        let (contacts, found) = (run.contacts(), run.observables().energy);
        let mut errors = vec![("energy_error", found / energy - 1.0)];
        if let Some(linear) = linear.filter(|_| law == Kind::MorseWitten) {
            let off = contacts.forces.iter().map(|f| (f / linear - 1.0).abs());
            errors.push(("numerical_error", off.fold(0.0, f64::max)));
        }
        let squeeze = digits(Validity::of(&contacts, packing.len(), 1.0).mean);
        row(
            table,
            (geometry, law, &squeeze),
            (force, contacts.forces[0]),
            &errors,
        );
    }
}

/// A row of a geometry, a law and its squeeze, with the exact and the law's force and other errors.
fn row(
    table: &mut Table,
    (geometry, law, squeeze): (&str, Kind, &str),
    (exact, force): (f64, f64),
    errors: &[(&str, f64)],
) {
    let numbers = [
        ("force_exact", exact),
        ("force_model", force),
        ("model_error", 1.0 - force / exact),
    ];
    let texts: Vec<(&str, String)> = numbers
        .iter()
        .chain(errors)
        .map(|(name, x)| (*name, digits(*x)))
        .collect();
    let mut fields = vec![
        ("geometry", geometry),
        ("law", law.name()),
        ("squeeze", squeeze),
    ];
    fields.extend(texts.iter().map(|(name, text)| (*name, text.as_str())));
    table.add(&fields);
}
