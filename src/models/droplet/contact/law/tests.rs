//! What a law keeps between two solutions changes no bit: one that has gone a long way and one that is taken up at its last answer
//! go on alike.

use super::{ContactLaw, Rule};
use crate::analysis::{Backbone, Observables};
use crate::contacts::net_forces;
use crate::domain::{Domain, Vec2};
use crate::models::droplet::contact::list::ContactList;
use crate::models::droplet::contact::matrix::product::Products;
use crate::models::droplet::contact::matrix::{ContactMatrix, Geometry};
use crate::models::droplet::contact::solver::{ConjugateGradient, Method};
use crate::protocol::Relaxation;
use crate::scene::Scene;
use crate::state::Packing;
use core::f64::consts::TAU;

fn law(line_tension: f64, tolerance: f64) -> ContactLaw {
    ContactLaw::new(
        Rule::Complementarity,
        Method::ConjugateGradient,
        line_tension,
        tolerance,
    )
}

fn bits(v: &[f64]) -> Vec<u64> {
    v.iter().map(|x| x.to_bits()).collect()
}

fn rows(matrix: &ContactMatrix) -> Vec<Vec<(usize, u64)>> {
    let row = |c| {
        let mut row: Vec<_> = matrix.row(c).map(|(k, v)| (k, v.to_bits())).collect();
        row.sort_unstable();
        row
    };
    (0..matrix.len()).map(row).collect()
}

/// What the entries in single precision make of some vector.
fn image(matrix: &ContactMatrix) -> Vec<f32> {
    let x: Vec<f32> = (0..matrix.len())
        .map(|k| (k * 37 % 101) as f32 - 50.0)
        .collect();
    let mut y = Products::default();
    matrix.products_into(matrix.entries_f32(), &x, &mut y);
    y.sums().to_vec()
}

/// Everything that can be asked of two laws, and of the matrix made anew.
fn assert_same(run: &ContactLaw, again: &ContactLaw, packing: &Packing, counter: &mut Backbone) {
    let (a, b) = (run.contacts(), again.contacts());
    assert_eq!(a.pairs, b.pairs);
    assert_eq!(bits(a.forces), bits(b.forces));
    assert_eq!(bits(a.distances), bits(b.distances));
    assert_eq!(bits(a.overlaps), bits(b.overlaps));
    assert_eq!(run.residual().to_bits(), again.residual().to_bits());
    let list = ContactList::new(packing.len(), a.pairs).unwrap();
    let geometry = Geometry::of(packing, &list);
    let anew = ContactMatrix::of(packing, &list, &geometry, run.line_tension());
    for matrix in [run.matrix(), again.matrix()] {
        assert_eq!(rows(matrix), rows(&anew));
        assert_eq!(bits(matrix.diagonal()), bits(anew.diagonal()));
        assert_eq!(bits(matrix.inverse_root()), bits(anew.inverse_root()));
        assert_eq!(image(matrix), image(&anew));
    }
    let [mut net, mut expected] = [(); 2].map(|()| vec![Vec2::zeros(); packing.len()]);
    run.sum_forces(&mut net);
    net_forces(&b, &mut expected);
    assert_eq!(net, expected);
    let (domain, tension) = (packing.domain(), run.line_tension());
    assert_eq!(
        Observables::of_law(run, packing, (0.1, 0.1), counter),
        Observables::of(&b, domain, packing.len(), tension, (0.1, 0.1))
    );
}

/// A random walk about a packing; returns in how many steps contacts were exchanged, or how it ended.
fn walk(
    mut packing: Packing,
    (tension, tolerance): (f64, f64),
    (steps, size, f_max): (usize, f64, f64),
    seed: u64,
) -> Result<usize, String> {
    let mut bits = seed;
    let mut random = || {
        bits = bits.wrapping_mul(6_364_136_223_846_793_005);
        bits = bits.wrapping_add(1_442_695_040_888_963_407);
        (bits >> 11) as f64 / (1_u64 << 53) as f64 - 0.5
    };
    let mut run = law(tension, tolerance);
    run.solve(&packing, &[], &[]).map_err(|e| e.to_string())?;
    let (home, mut counter) = (packing.positions().to_vec(), Backbone::default());
    let mut exchanges = 0;
    for step in 0..steps {
        let (pairs, forces) = (
            run.contacts().pairs.to_vec(),
            run.contacts().forces.to_vec(),
        );
        let mut again = law(tension, tolerance);
        again.restore(&packing, &pairs, &forces);
        let domain = packing.domain();
        for (p, home) in packing.positions_mut().iter_mut().zip(&home) {
            let back = domain.minimum_image(home - *p);
            *p = domain.wrap(*p + back * 0.02 + Vec2::new(random(), random()) * size);
        }
        let answer = run.solve_within(&packing, f_max, f64::INFINITY);
        assert_eq!(answer, again.solve_within(&packing, f_max, f64::INFINITY));
        answer.map_err(|e| e.to_string())?;
        exchanges += usize::from(run.contacts().pairs != pairs);
        assert_same(&run, &again, &packing, &mut counter);
        if step % 5 == 0 {
            let answer = run.tighten(&packing, 0.1 * f_max);
            assert_eq!(answer, again.tighten(&packing, 0.1 * f_max));
            answer.map_err(|e| e.to_string())?;
            assert_same(&run, &again, &packing, &mut counter);
        }
    }
    Ok(exchanges)
}

#[test]
fn walks_of_packings_at_any_line_tension() {
    let mut all = 0;
    for (particles, phi, tension) in [
        (24, 0.9, 0.3),
        (64, 1.0, 1e-90),
        (128, 0.86, 3.05),
        (128, 1.2, 1e90),
        (300, 0.88, 12.2),
    ] {
        for (size, f_max) in [(3e-3, 1e-3), (1e-2, 1e-1), (1e-2, 0.0), (5e-2, 1e-2)] {
            let scene = Scene {
                particles,
                phi,
                line_tension: tension,
                ..Scene::default()
            };
            let start = Relaxation::new(&scene).unwrap();
            let steps = (60, size, f_max);
            let exchanges = walk(start.packing().clone(), (tension, 1e-12), steps, 3).unwrap();
            all += exchanges;
        }
    }
    assert!(all > 600, "{all} steps with an exchange");
}

#[test]
fn walks_of_a_hub_with_many_contacts() {
    let mut all = 0;
    for (count, radius) in [(20_u32, 2.0), (70, 5.5)] {
        for (size, f_max, tolerance) in [(3e-3, 1e-2, 1e-12), (1e-2, 1e-1, 1e-6)] {
            let centre = Vec2::new(20.0, 20.0);
            let at = |k: f64, r: f64| {
                let (sin, cos) = libm::sincos(TAU * k / f64::from(count));
                centre + Vec2::new(cos, sin) * r
            };
            let (mut points, mut radii) = (vec![centre], vec![radius]);
            for k in (0..count).map(f64::from) {
                points.extend([at(k, radius + 0.2995), at(k + 0.5, radius + 0.82)]);
                radii.extend([0.3; 2]);
            }
            let domain = Domain::new(40.0, 40.0).unwrap();
            let packing = Packing::new(domain, radii, points).unwrap();
            let exchanges = walk(packing, (0.3, tolerance), (60, size, f_max), 1).unwrap();
            all += exchanges;
        }
    }
    assert!(all > 100, "{all} steps with an exchange");
}

/// 64 couples apart; a particle with others `near` it, by angle and gap, and one to its right that overlaps it by `push`.
fn cluster(push: f64, near: &[(f64, f64)]) -> Packing {
    let mut points = Vec::new();
    for k in 0..64 {
        let left = Vec2::new(2.0 + 4.0 * f64::from(k % 8), 12.0 + 3.0 * f64::from(k / 8));
        points.extend([left, left + Vec2::new(0.95, 0.0)]);
    }
    let centre = Vec2::new(20.0, 4.0);
    points.extend([centre, centre + Vec2::new(1.001 - push, 0.0)]);
    for &(angle, gap) in near {
        let (sin, cos) = libm::sincos(angle);
        points.push(centre + Vec2::new(cos, sin) * (1.0 + gap));
    }
    let radii = vec![0.5; points.len()];
    Packing::new(Domain::new(40.0, 40.0).unwrap(), radii, points).unwrap()
}

#[test]
fn local_update_that_adds_many_contacts_leaves_a_law_that_agrees_with_itself() {
    let near = [(1.3, 1e-4), (-1.3, 1e-4)];
    let (before, after) = (cluster(0.0, &near), cluster(0.02, &near));
    let mut run = law(1.0, 1e-6);
    run.solve(&before, &[], &[]).unwrap();
    let (pairs, forces) = (
        run.contacts().pairs.to_vec(),
        run.contacts().forces.to_vec(),
    );
    let mut again = law(1.0, 1e-6);
    again.restore(&before, &pairs, &forces);
    run.solve_again(&after).unwrap();
    again.solve_again(&after).unwrap();
    assert!(run.work().local_updates > 0 && run.contacts().pairs.len() >= pairs.len() + 3);
    assert_same(&run, &again, &after, &mut Backbone::default());
}

#[test]
fn contact_that_a_local_update_activates_is_there_in_single_precision_too() {
    let near = [(1.3, -0.02)];
    let (one, two) = (cluster(0.03, &near), cluster(-0.03, &near));
    let mut run = law(1.0, 1e-6);
    run.solve(&one, &[], &[]).unwrap();
    run.solve_again(&two).unwrap();
    assert!(!run.set.is_ordered(), "a contact is inactive");
    run.solve_again(&one).unwrap();
    assert!(
        run.set.is_ordered() && run.work().structures < 3,
        "and active again"
    );
    let count = run.contacts().pairs.len();
    let b: Vec<f64> = (0..count)
        .map(|k| 0.01 * libm::sin(0.7 * k as f64))
        .collect();
    let (mut x, mut image) = (vec![0.0; count], vec![0.0; count]);
    let matrix = run.matrix();
    ConjugateGradient::default()
        .solve_loosely(matrix, &b, &mut x, 1e-6)
        .unwrap();
    matrix.multiply(&x, &mut image);
    for (q, d) in image.iter().zip(&b) {
        assert!((q - d).abs() <= 1e-6);
    }
}

#[test]
fn box_that_is_too_small_is_refused_in_the_same_words() {
    // A chain across a narrow box, squeezed until it touches its own second image.
    let at = |step: f64| {
        let centres = (0..5).map(|k| Vec2::new(0.5 + step * f64::from(k), 0.5));
        Packing::new(
            Domain::new(6.0, 1.02).unwrap(),
            vec![0.5; 5],
            centres.collect(),
        )
        .unwrap()
    };
    let mut run = law(1.0, 1e-12);
    run.solve(&at(0.99), &[], &[]).unwrap();
    for k in 0..60 {
        let step = 0.99 - 0.0007 * f64::from(k);
        let (pairs, forces) = (
            run.contacts().pairs.to_vec(),
            run.contacts().forces.to_vec(),
        );
        let mut again = law(1.0, 1e-12);
        again.restore(&at(step), &pairs, &forces);
        let answer = run.solve_again(&at(step - 0.0007));
        assert_eq!(answer, again.solve_again(&at(step - 0.0007)));
        if answer.is_err() {
            return;
        }
    }
    panic!("never too small");
}

#[test]
fn law_is_not_held_to_the_particles_of_the_packing_before() {
    let domain = Domain::new(20.0, 20.0).unwrap();
    let at = |x| Vec2::new(x, 2.0);
    let couple = |radius| Packing::new(domain, vec![radius; 2], vec![at(1.0), at(1.9)]).unwrap();
    let mut run = law(1.0, 1e-12);
    run.solve(&couple(0.5), &[], &[]).unwrap();
    let (pairs, forces) = (
        run.contacts().pairs.to_vec(),
        run.contacts().forces.to_vec(),
    );
    run.solve(&couple(0.6), &pairs, &forces).unwrap();
    // A contact on its own is a spring of stiffness 4πγ / 3 (R_i + R_j).
    assert!((run.contacts().forces[0] - 0.3 * 2.0 * TAU / 3.6).abs() < 1e-12);
    let positions = vec![at(1.0), at(1.9), at(8.0), at(8.9)];
    let more = Packing::new(domain, vec![0.5; 4], positions).unwrap();
    run.solve_again(&more).unwrap();
    assert_eq!(run.contacts().pairs, [[0, 1], [2, 3]]);
}

/// Where each buffer is, and how long it may get without moving.
fn buffers(law: &ContactLaw) -> [(usize, usize); 5] {
    fn of<T>(v: &[T]) -> (usize, usize) {
        (v.as_ptr() as usize, v.len())
    }
    [
        of(law.set.pairs()),
        of(law.set.forces()),
        of(law.candidates.pairs()),
        of(&law.violations),
        of(law.set.inactive()),
    ]
}

#[test]
fn a_solution_with_the_same_contacts_moves_no_buffer() {
    let side = 6.0;
    let mut points = Vec::new();
    for k in 0..36 {
        points.push(Vec2::new(0.5 + f64::from(k % 6), 0.5 + f64::from(k / 6)));
    }
    let packing = |shift: f64| {
        let mut points = points.clone();
        for (k, p) in points.iter_mut().enumerate() {
            p.x += shift * (k as f64).sqrt();
        }
        Packing::new(Domain::new(side, side).unwrap(), vec![0.52; 36], points).unwrap()
    };
    let mut law = ContactLaw::default();
    law.solve(&packing(0.0), &[], &[]).unwrap();
    law.solve_again(&packing(1e-4)).unwrap();
    let (before, structures) = (buffers(&law), law.work().structures);
    for k in 2..50 {
        law.solve_again(&packing(1e-4 * f64::from(k))).unwrap();
    }
    assert_eq!(law.work().structures, structures, "the same contacts");
    assert_eq!(buffers(&law), before);
}
