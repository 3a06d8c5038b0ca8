//! Packings that no random start gives.

use super::families::{Case, common};
use super::outcome::of_packing;
use super::random::Random;
use softjam::domain::{Domain, Vec2};
use softjam::models::droplet::contact::ContactLaw;
use softjam::protocol::relax_disks;
use softjam::scene::DiskParameters;
use softjam::scene::{Radii, Scene, Species, Start};
use softjam::state::Packing;
use std::f64::consts::PI;

fn case(name: String, packing: Packing) -> Case {
    (name, Box::new(move || of_packing(&common(), &packing)))
}

/// A packing of `(x, y, radius)` in a box; the numbers are the program's own, so it exists.
fn packing(sides: [f64; 2], particles: &[(f64, f64, f64)]) -> Packing {
    let domain = Domain::new(sides[0], sides[1]).expect("a box");
    let radii = particles.iter().map(|p| p.2).collect();
    let centres = particles.iter().map(|p| Vec2::new(p.0, p.1)).collect();
    Packing::new(domain, radii, centres).expect("a packing")
}

pub fn tight_boxes() -> Vec<Case> {
    let mut random = Random::new(2);
    let mut cases = Vec::new();
    for k in 0..300 {
        let n = [1, 2, 3, 5][k % 4];
        let side = random.within(1.0, 3.0);
        let particles: Vec<_> = (0..n)
            .map(|_| (random.within(0.0, side), random.within(0.0, side), 0.5))
            .collect();
        cases.push(case(
            format!("N = {n}, side {side:.4}"),
            packing([side, side], &particles),
        ));
    }
    cases
}

pub fn same_angle() -> Vec<Case> {
    let mut cases = Vec::new();
    for apart in [0.0, 1e-15, 1e-12, 1e-9, 1e-6, 1e-3] {
        for turn in 0..12 {
            // Axes and diagonals are among the directions; the others have no exact sines.
            let angle = PI * f64::from(turn) / 6.0 + if turn % 2 == 0 { 0.0 } else { PI / 12.0 };
            let at = |angle: f64, r: f64| (5.0 + r * angle.cos(), 5.0 + r * angle.sin());
            for (r, s, radius) in [(0.9, 1.3, 1.0), (0.9, 0.9, 0.5), (0.95, 1.05, 0.7)] {
                for ring in [false, true] {
                    let (near, far) = (at(angle, r), at(angle + apart, s));
                    let mut particles = vec![
                        (5.0, 5.0, 0.5),
                        (near.0, near.1, 0.5),
                        (far.0, far.1, radius),
                    ];
                    if ring {
                        for k in 1..5 {
                            let p = at(angle + 2.0 * PI * f64::from(k) / 5.0, 0.97);
                            particles.push((p.0, p.1, 0.5));
                        }
                    }
                    cases.push(case(
                        format!(
                            "{apart:e} rad apart at {angle:.3} rad, distances {r} and {s}{}",
                            if ring { ", four more" } else { "" }
                        ),
                        packing([10.0, 10.0], &particles),
                    ));
                }
            }
        }
    }
    cases
}

pub fn threshold() -> Vec<Case> {
    let mut cases = Vec::new();
    let beside = |x: f64| [("below", x.next_down()), ("at", x), ("above", x.next_up())];
    for (side, distance) in beside(1.2) {
        // 0.5 + 0.7 is 1.2 to the last bit; the origin keeps the distance exact.
        let two = [(0.0, 3.0, 0.5), (distance, 3.0, 0.7)];
        cases.push(case(
            format!("pair {side} contact"),
            packing([9.0, 9.0], &two),
        ));
        for squeeze in [1.0, 0.9] {
            let chain: Vec<_> = (0..8)
                .map(|k| {
                    let step = if k % 2 == 0 { 1.0 } else { squeeze };
                    (f64::from(k) * 1.125 * step, 4.5, 0.5625)
                })
                .collect();
            let name = format!("chain of eight around the box, {side} contact, squeeze {squeeze}");
            cases.push(case(name, packing([9.0 * distance / 1.2, 9.0], &chain)));
        }
    }
    // The pair 1, 3 of this packing meets only because 1 is pressed from both sides: the height at which it does.
    let pressed = |y: f64| {
        packing(
            [9.0, 9.0],
            &[
                (3.0, 3.0, 0.5),
                (3.9, 3.0, 0.5),
                (4.8, 3.0, 0.5),
                (3.9, 3.0 + y, 0.5),
            ],
        )
    };
    let touches = |y: f64| {
        let mut law = ContactLaw::default();
        law.solve(&pressed(y), &[], &[]).is_ok() && law.contacts().pairs.len() == 3
    };
    let (mut low, mut high): (f64, f64) = (1.0, 1.1);
    while low.next_up() < high {
        let middle = 0.5 * (low + high);
        if touches(middle) {
            low = middle;
        } else {
            high = middle;
        }
    }
    let mut y = low;
    for _ in 0..8 {
        y = y.next_down();
    }
    for k in -8..=8 {
        cases.push(case(
            format!("pair that bulges bring together, {k} units from where it meets"),
            pressed(y),
        ));
        y = y.next_up();
    }
    for ulps in -4..=4 {
        let critical = PI / 12f64.sqrt();
        let phi = f64::from_bits(critical.to_bits().wrapping_add_signed(ulps));
        cases.push(lattice(
            format!("hexagonal, φ_c {ulps:+} units"),
            hexagonal(phi, false),
        ));
    }
    cases
}

pub fn coincident() -> Vec<Case> {
    let mut random = Random::new(3);
    let mut cases = Vec::new();
    let mut push = |name: String, p: &Packing| {
        cases.push(case(format!("{name}, as it stands"), p.clone()));
        let mut relaxed = p.clone();
        relax_disks(&mut relaxed, &DiskParameters::default(), 1.0).unwrap();
        cases.push(case(format!("{name}, disks relaxed"), relaxed));
    };
    for n in 2..=12 {
        let alone = vec![(7.0, 7.0, 0.5); n];
        push(
            format!("{n} centres on one point"),
            &packing([20.0, 20.0], &alone),
        );
        let mut amid = vec![(7.0, 7.0, 0.5); n];
        amid.extend((0..30).map(|_| (random.within(0.0, 9.0), random.within(0.0, 9.0), 0.5)));
        push(
            format!("{n} centres on one point amid 30 others"),
            &packing([9.0, 9.0], &amid),
        );
    }
    for k in 0..10 {
        let mut points: Vec<_> = (0..24)
            .map(|_| (random.within(0.0, 6.0), random.within(0.0, 6.0), 0.5))
            .collect();
        points.extend_from_within(0..12);
        push(
            format!("12 coincident pairs among 36, sample {k}"),
            &packing([6.0, 6.0], &points),
        );
    }
    cases
}

pub fn lattices() -> Vec<Case> {
    let mut cases = Vec::new();
    for phi in [0.70, PI / 4.0, 0.80, 0.85, 0.9, 1.0, 1.1, 1.25] {
        for n in [6, 8, 9] {
            let spacing = (PI * 0.25 / phi).sqrt();
            let particles: Vec<_> = (0..n * n)
                .map(|k| (f64::from(k % n) * spacing, f64::from(k / n) * spacing, 0.5))
                .collect();
            let side = f64::from(n) * spacing;
            cases.push(case(
                format!("square {n} × {n}, φ = {phi:.4}"),
                packing([side, side], &particles),
            ));
        }
        for mixed in [false, true] {
            let kind = if mixed {
                "hexagonal, two sizes"
            } else {
                "hexagonal"
            };
            cases.push(lattice(
                format!("{kind}, φ = {phi:.4}"),
                hexagonal(phi, mixed),
            ));
        }
    }
    cases
}

fn hexagonal(phi: f64, mixed: bool) -> Scene {
    let one = Radii::Species(vec![Species {
        radius: 0.5,
        fraction: 1.0,
    }]);
    Scene {
        particles: 120,
        phi,
        radii: if mixed { Radii::default() } else { one },
        start: Start::Hexagonal,
        ..common()
    }
}

fn lattice(name: String, scene: Scene) -> Case {
    super::families::case(name, scene)
}
