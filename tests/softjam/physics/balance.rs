//! Balance of forces, energy and pressure, recomputed from centres and radii alone.

use super::model::Model;
use crate::common::{
    Random, assert_at_most, converged, law, random_packing, relaxed_disks, scene, solved,
};
use softjam::analysis::Observables;
use softjam::domain::{Domain, Vec2};
use softjam::models::droplet::contact::Rule;
use softjam::models::droplet::contact::solver::Method;
use softjam::protocol::{Relaxation, Status};
use softjam::scene::{Radii, Scene};
use softjam::state::Packing;

/// The scenes whose ends are looked at.
fn scenes() -> Vec<Scene> {
    vec![
        scene(64, 0.90, 1),
        scene(100, 0.86, 2),
        scene(100, 0.95, 3),
        Scene {
            aspect: 1.6,
            line_tension: 2.0,
            radii: Radii::Spread { min: 0.4, max: 0.9 },
            ..scene(80, 0.92, 4)
        },
        Scene {
            contact_rule: Rule::Saitoh,
            contact_solver: Method::SparseCholesky,
            ..scene(80, 0.9, 5)
        },
    ]
}

#[test]
fn last_frame_is_in_balance_by_an_independent_solution_of_the_contact_problem() {
    for scene in scenes() {
        let run = converged(&scene);
        let (frame, packing) = (run.frame(), run.packing());
        // Nothing but centres, radii and the set of contacts is taken from the run.
        let empty = vec![0.0; frame.contacts.len()];
        let geometry = Model::new(packing, &frame.contacts, &empty, scene.line_tension);
        let factor = geometry.matrix().cholesky().expect("positive definite");
        let forces = factor.solve(&geometry.overlaps());
        let model = Model::new(packing, &frame.contacts, &forces, scene.line_tension);

        let largest = forces.iter().copied().fold(0.0, f64::max);
        let worst = forces.iter().zip(&frame.forces);
        let worst = worst.fold(0.0, |m: f64, (a, b)| m.max((a - b).abs()));
        assert_at_most(
            "recorded force, difference over the largest",
            worst / largest,
            1e-11,
        );
        assert!(forces.iter().all(|f| *f > 0.0), "no contact pulls");
        let overlap = -model.smallest_gap_elsewhere();
        assert_at_most("overlap of pairs that are not in contact", overlap, 1e-12);
        assert_at_most(
            "f_max recomputed, units of γ",
            model.largest_net_force() / scene.line_tension,
            scene.threshold + 1e-12,
        );

        let o = run.observables();
        assert_at_most(
            "energy, relative error",
            (o.energy * scene.line_tension / model.energy() - 1.0).abs(),
            1e-11,
        );
        assert_at_most(
            "pressure, relative error",
            (o.pressure() * scene.line_tension / model.pressure() - 1.0).abs(),
            1e-11,
        );
    }
}

#[test]
fn energy_is_the_maximum_of_the_dual_problem() {
    // U = max over f ≥ 0 of δᵀf − ½ fᵀA f: no other forces on the same contacts give more.
    let packing = relaxed_disks(64, 0.92, 1);
    let law = solved(&packing);
    let contacts = law.contacts();
    let dual = |forces: &[f64]| {
        let mut image = vec![0.0; forces.len()];
        law.matrix().multiply(forces, &mut image);
        let terms = forces.iter().zip(contacts.overlaps).zip(&image);
        terms.map(|((f, d), q)| f * (d - 0.5 * q)).sum::<f64>()
    };
    let energy = Observables::of(&contacts, packing.domain(), 64, 1.0, (0.0, 0.0)).energy;
    assert!((dual(contacts.forces) / energy - 1.0).abs() < 1e-12);
    let mut random = Random::new(2);
    for _ in 0..100 {
        let other: Vec<f64> = contacts
            .forces
            .iter()
            .map(|f| f * random.within(0.5, 1.5))
            .collect();
        assert!(dual(&other) < energy);
    }
}

#[test]
fn momentum_stays_zero_through_a_run() {
    let (mut velocity, mut force): (f64, f64) = (0.0, 0.0);
    for scene in [scene(100, 0.86, 2), scene(64, 0.9, 1), scene(64, 0.843, 3)] {
        let mut run = Relaxation::new(&scene).unwrap();
        while run.status() == Status::Running {
            run.advance().unwrap();
            let n = scene.particles as f64;
            let momentum: Vec2 = run.frame().velocities.iter().sum();
            let total: Vec2 = run.net_forces().iter().sum();
            velocity = velocity.max(momentum.norm() / n);
            force = force.max(total.norm() / n);
        }
    }
    assert_at_most("momentum a particle", velocity, 1e-12);
    assert_at_most("total force a particle", force, 1e-12);
}

/// `packing` with box and centres, not radii, multiplied by `scale`.
fn rescaled(packing: &Packing, scale: f64) -> Packing {
    let sides = packing.domain().lengths() * scale;
    Packing::new(
        Domain::new(sides.x, sides.y).unwrap(),
        packing.radii().to_vec(),
        packing.positions().iter().map(|p| p * scale).collect(),
    )
    .unwrap()
}

fn observables(packing: &Packing) -> Observables {
    let mut law = law(Rule::Complementarity, Method::SparseCholesky);
    law.solve(packing, &[], &[]).unwrap();
    Observables::of(
        &law.contacts(),
        packing.domain(),
        packing.len(),
        1.0,
        (0.0, 0.0),
    )
}

#[test]
fn pressure_is_the_change_of_energy_with_volume() {
    let mut random = Random::new(31);
    let mut list: Vec<Packing> = [(0.86, 1), (0.92, 2), (1.05, 3)]
        .map(|(phi, seed)| relaxed_disks(80, phi, seed))
        .into();
    for (phi, ratio, steps) in [(0.85, 1.4, 10), (0.95, 2.5, 40), (1.05, 1.4, 60)] {
        list.push(random_packing(&mut random, 80, phi, ratio, steps));
    }
    for packing in list {
        let o = observables(&packing);
        assert_eq!(o.pressure(), -0.5 * (o.stress[0] + o.stress[2]));
        // Centred in V.
        let quotient = |h: f64| {
            let (more, less) = (
                rescaled(&packing, (1.0 + h).sqrt()),
                rescaled(&packing, (1.0 - h).sqrt()),
            );
            -(observables(&more).energy - observables(&less).energy)
                / (more.domain().area() - less.domain().area())
        };
        let h = 1e-6;
        assert_at_most(
            "pressure, relative error of −dU/dV",
            (quotient(h) / o.pressure() - 1.0).abs(),
            1e-6,
        );
    }
}
