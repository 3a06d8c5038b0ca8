//! Droplets with the symmetry of a regular polygon, where the model has a closed form and Young–Laplace an exact one.
//!
//! A bubble of area πR² between n equal walls is exactly an n-gon of inradius `a` with corners rounded to radius `r`.
//! With `t = n tan(π/n)` and `x = (a − r)/r`: `R²/r² = 1 + (2t/π) x + (t/π) x²`, `f = 2 x tan(π/n)`. To first order
//! `a = R + (R f/2πγ)(π cot(π/n) − n)`, which is also what Morse and Witten say, to all orders.

use crate::common::{assert_at_most, monodisperse};
use softjam::contacts::Contacts;
use softjam::domain::{Domain, Vec2};
use softjam::models::droplet::contact::list::ContactList;
use softjam::models::droplet::contact::matrix::{ContactMatrix, Geometry};
use softjam::models::droplet::contact::solver::Method;
use softjam::models::droplet::contact::{ContactLaw, Rule};
use softjam::models::droplet::contour::{ContourStyle, Contours, Placement};
use softjam::protocol::{Relaxation, Status};
use softjam::scene::{Scene, Start};
use softjam::state::Packing;
use std::f64::consts::PI;

const METHODS: [Method; 3] = [
    Method::ConjugateGradient,
    Method::SparseCholesky,
    Method::GaussJordan,
];

/// `π cot(π/n) − n`; `cot(π/2)` is 0.
fn coefficient(n: usize) -> f64 {
    if n == 2 {
        return -2.0;
    }
    PI / (PI / n as f64).tan() - n as f64
}

/// The inradius of the exact bubble over R, and its force over γ, at corner ratio `x`.
fn exact_bubble(n: usize, x: f64) -> (f64, f64) {
    let slope = (PI / n as f64).tan();
    let b = n as f64 * slope / PI;
    let inradius = (1.0 + x) / (1.0 + 2.0 * b * x + b * x * x).sqrt();
    (inradius, 2.0 * x * slope)
}

/// The force on each of `n` walls at distance `inradius`·R from the centre of the exact bubble, by bisection.
fn exact_force(n: usize, inradius: f64) -> f64 {
    let (mut low, mut high) = (0.0, 1.0);
    while high - low > 1e-16 * high {
        let middle = 0.5 * (low + high);
        if middle == low || middle == high {
            break;
        }
        if exact_bubble(n, middle).0 > inradius {
            low = middle;
        } else {
            high = middle;
        }
    }
    exact_bubble(n, 0.5 * (low + high)).1
}

/// A particle of radius 0.6 near the corner of its box, `n` of radius 0.45 around it at equal angles, each 0.05 deep.
fn star(n: usize, turn: f64) -> (Packing, ContactList) {
    let centre = Vec2::new(0.1, 0.2);
    let around = (0..n).map(|k| {
        let angle = turn + 2.0 * PI * k as f64 / n as f64;
        centre + Vec2::new(angle.cos(), angle.sin()) * (0.6 + 0.45 - 0.05)
    });
    let positions: Vec<Vec2> = std::iter::once(centre).chain(around).collect();
    let mut radii = vec![0.45; n + 1];
    radii[0] = 0.6;
    let packing = Packing::new(Domain::new(8.0, 8.0).unwrap(), radii, positions).unwrap();
    let pairs: Vec<[u32; 2]> = (1..=n as u32).map(|k| [0, k]).collect();
    (packing, ContactList::new(n + 1, &pairs).unwrap())
}

/// The hexagonal crystal of radius 1/2, with its forces.
fn hexagonal(phi: f64, method: Method) -> Relaxation {
    let scene = Scene {
        particles: 120,
        phi,
        radii: monodisperse(),
        start: Start::Hexagonal,
        contact_solver: method,
        contact_tolerance: 1e-14,
        ..Scene::default()
    };
    Relaxation::new(&scene).unwrap()
}

/// Half the lattice constant over R of the hexagonal crystal: from `π R² = φ (√3/2) (2 a)²`.
fn hexagonal_inradius(phi: f64) -> f64 {
    (PI / (12f64.sqrt() * phi)).sqrt()
}

/// The Morse–Witten force on a particle of a crystal with `n` neighbours at distance `2 · inradius`·R: δ = 2R(1 − inradius)
/// equals twice the dent `(R/2πγ)(n − π cot(π/n)) f`.
fn crystal_force(n: usize, inradius: f64) -> f64 {
    2.0 * PI * (1.0 - inradius) / -coefficient(n)
}

#[test]
fn contact_matrix_dents_a_regularly_squeezed_particle_by_pi_cot_minus_n() {
    let (gamma, force) = (1.7, 0.3);
    for n in 2..=8 {
        for turn in [0.0, 0.4, 1.9] {
            let (packing, list) = star(n, turn);
            let geometry = Geometry::of(&packing, &list);
            let matrix = ContactMatrix::of(&packing, &list, &geometry, gamma);
            let exact = 0.6 * force / (2.0 * PI * gamma) * coefficient(n);
            for c in 0..n {
                assert_eq!(matrix.row(c).count(), n - 1);
                // Of the diagonal, the centre's part by radius is 0.6 out of 0.6 + 0.45.
                let own = matrix.diagonal()[c] * 0.6 / (0.6 + 0.45);
                let dent = -(own + matrix.row(c).map(|e| e.1).sum::<f64>()) * force;
                assert!(
                    (dent / exact - 1.0).abs() < 1e-12,
                    "n = {n}, contact {c}: {dent} against {exact}"
                );
            }
        }
    }
}

#[test]
fn contour_of_a_regularly_squeezed_particle_reaches_the_same_dent() {
    let (gamma, force) = (1.7, 0.3);
    for n in 2..=8 {
        let (packing, list) = star(n, 0.4);
        let geometry = Geometry::of(&packing, &list);
        let pairs: Vec<_> = list.pairs().collect();
        let forces = vec![force; n];
        let mut contours = Contours::new(ContourStyle {
            vertices: 3,
            placement: Placement::Contacts,
        });
        let contacts = Contacts {
            pairs: &pairs,
            normals: geometry.normals(),
            distances: geometry.distances(),
            overlaps: geometry.overlaps(),
            forces: &forces,
        };
        contours.draw(packing.radii(), packing.positions(), &contacts, gamma);
        let exact = 0.6 * (1.0 + force / (2.0 * PI * gamma) * coefficient(n));
        for normal in geometry.normals() {
            let tip = contours
                .polygon(0)
                .iter()
                .map(|v| v - packing.positions()[0])
                .max_by(|a, b| {
                    let towards = |v: &Vec2| -v.normalize().dot(normal);
                    towards(a).total_cmp(&towards(b))
                })
                .unwrap();
            assert!((tip.norm() / exact - 1.0).abs() < 1e-14, "n = {n}");
        }
    }
}

#[test]
fn exact_bubble_obeys_virtual_work_and_starts_with_the_morse_witten_slope() {
    for n in 3..=8 {
        let slope = (PI / n as f64).tan();
        let t = n as f64 * slope;
        // Perimeter over R at constant area: its change with the inradius is the work of n forces.
        let perimeter = |x: f64| {
            let (inradius, _) = exact_bubble(n, x);
            let r = inradius / (1.0 + x);
            (2.0 * t * x + 2.0 * PI) * r
        };
        for x in [0.02, 0.3, 2.0] {
            let h = 1e-5 * x;
            let work = (perimeter(x + h) - perimeter(x - h))
                / (exact_bubble(n, x + h).0 - exact_bubble(n, x - h).0);
            let force = exact_bubble(n, x).1;
            assert!(
                (work / (-(n as f64) * force) - 1.0).abs() < 1e-6,
                "n = {n}, x = {x}"
            );
        }
        let slope_at = |x: f64| {
            let (inradius, force) = exact_bubble(n, x);
            (inradius - 1.0) / force * 2.0 * PI / coefficient(n)
        };
        // The departure halves with the force.
        let (one, half) = (slope_at(2e-5) - 1.0, slope_at(1e-5) - 1.0);
        assert!(
            half.abs() < 1e-4 && (one / half - 2.0).abs() < 1e-3,
            "n = {n}"
        );
    }
}

#[test]
fn hexagonal_crystal_has_its_closed_form_forces() {
    let mut worst: f64 = 0.0;
    for method in METHODS {
        for phi in [0.93, 0.96, 1.0, 1.1] {
            let run = hexagonal(phi, method);
            assert_eq!(run.status(), Status::Converged);
            assert_eq!((run.step(), run.contacts().pairs.len()), (0, 3 * 120));
            let exact = crystal_force(6, hexagonal_inradius(phi));
            for f in run.contacts().forces {
                worst = worst.max((f / exact - 1.0).abs());
            }
        }
    }
    assert_at_most("hexagonal crystal, relative error of a force", worst, 1e-12);
}

#[test]
fn square_crystal_has_its_closed_form_forces() {
    // Spacing 15/16 of a diameter on 8 × 8 sites: positions and overlaps are exact in binary.
    let spacing = 0.9375;
    let site = |k: usize| Vec2::new((k % 8) as f64 * spacing, (k / 8) as f64 * spacing);
    let packing = Packing::new(
        Domain::new(8.0 * spacing, 8.0 * spacing).unwrap(),
        vec![0.5; 64],
        (0..64).map(site).collect(),
    )
    .unwrap();
    let mut worst: f64 = 0.0;
    for method in METHODS {
        for gamma in [1.0, 0.3] {
            let mut law = ContactLaw::new(Rule::Complementarity, method, gamma, 1e-14);
            law.solve(&packing, &[], &[]).unwrap();
            let contacts = law.contacts();
            assert_eq!(contacts.pairs.len(), 2 * 64);
            let exact = gamma * crystal_force(4, spacing);
            for (f, overlap) in contacts.forces.iter().zip(contacts.overlaps) {
                assert_eq!(*overlap, 0.0625);
                worst = worst.max((f / exact - 1.0).abs());
            }
        }
    }
    assert_at_most("square crystal, relative error of a force", worst, 1e-12);
}

#[test]
fn hexagonal_crystal_reproduces_the_table_of_the_model_error() {
    // φ, exact force, Morse–Witten force, error in per cent: the project's table of the model error.
    for (phi, exact, morse_witten, error) in [
        (0.908, 0.00688, 0.00682, -1.0),
        (0.910, 0.01972, 0.01918, -2.8),
        (0.915, 0.05377, 0.04990, -7.2),
        (0.920, 0.09096, 0.08037, -11.6),
        (0.930, 0.17697, 0.14057, -20.6),
        (0.940, 0.28367, 0.19981, -29.6),
        (0.960, 0.60693, 0.31551, -48.0),
    ] {
        let f = hexagonal(phi, Method::ConjugateGradient).contacts().forces[0];
        let young_laplace = exact_force(6, hexagonal_inradius(phi));
        println!("phi {phi}: exact {young_laplace:.7} Morse-Witten {f:.7}");
        assert!((f - morse_witten).abs() <= 0.5e-5, "phi = {phi}: f = {f}");
        assert!(
            (young_laplace - exact).abs() <= 0.5e-5,
            "phi = {phi}: exact f = {young_laplace}"
        );
        let percent = 100.0 * (f / young_laplace - 1.0);
        let digit = if phi == 0.960 { 0.5 } else { 0.05 };
        assert!((percent - error).abs() <= digit, "phi = {phi}: {percent} %");
    }
}

#[test]
fn hexagon_matches_young_laplace_to_first_order() {
    // To second order f_MW/f_YL = 1 − (3b/2) x with b = t/π, and 1 − a/R = (b − 1) x = (φ − φ_c)/2φ_c.
    let critical = PI / 12f64.sqrt();
    let b = 6.0 * (PI / 6.0).tan() / PI;
    let slope = -3.0 * b / (4.0 * critical * (b - 1.0));
    let departures: Vec<f64> = (0..8)
        .map(|k| {
            let phi = critical + 2e-3 * 0.5f64.powi(k);
            let f = hexagonal(phi, Method::SparseCholesky).contacts().forces[0];
            (f / exact_force(6, hexagonal_inradius(phi)) - 1.0) / (phi - critical)
        })
        .collect();
    let worst = departures
        .iter()
        .fold(0.0, |m: f64, d| m.max((d / slope - 1.0).abs()));
    assert_at_most(
        "(f_MW/f_YL − 1)/(φ − φ_c), relative error of its limit",
        worst,
        5e-5,
    );
}

#[test]
fn hexagonal_crystal_at_its_exact_threshold_is_in_balance() {
    let critical = PI / 12f64.sqrt();
    for phi in [
        critical,
        critical - 1e-15,
        critical + 1e-15,
        critical - 1e-9,
    ] {
        let run = hexagonal(phi, Method::ConjugateGradient);
        assert_eq!(run.status(), Status::Converged);
        assert!(
            run.contacts()
                .forces
                .iter()
                .all(|f| (0.0..1e-13).contains(f))
        );
    }
}
