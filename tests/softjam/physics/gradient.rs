//! The gradient form: forces that are the gradient of the stored energy.

use super::model::Model;
use crate::common::{
    Random, assert_at_most, assert_within, converged, random_packing, relaxed_disks, scene,
};
use softjam::analysis::FrameForces;
use softjam::analysis::Observables;
use softjam::domain::{Domain, Vec2};
use softjam::models::droplet::contact::solver::Method;
use softjam::models::droplet::contact::{ContactLaw, Rule};
use softjam::models::droplet::{Form, NetForces};
use softjam::protocol::{Relaxation, Status};
use softjam::scene::{Minimizer, Scene};
use softjam::state::Packing;

/// The contact law to round-off.
fn exact(packing: &Packing) -> ContactLaw {
    let mut law = ContactLaw::new(Rule::Complementarity, Method::ConjugateGradient, 1.0, 1e-14);
    law.solve(packing, &[], &[]).unwrap();
    law
}

fn energy(law: &ContactLaw) -> f64 {
    let contacts = law.contacts();
    let terms = contacts.overlaps.iter().zip(contacts.forces);
    terms.map(|(d, f)| 0.5 * d * f).sum()
}

fn net(law: &ContactLaw, packing: &Packing, form: Form) -> Vec<Vec2> {
    let mut net = vec![Vec2::zeros(); packing.len()];
    NetForces::new(form).evaluate(&law.contacts(), packing, law.line_tension(), &mut net);
    net
}

fn largest(net: &[Vec2]) -> f64 {
    net.iter().fold(0.0, |m: f64, f| m.max(f.norm()))
}

/// `packing` with its centres moved.
fn moved(packing: &Packing, shift: impl Fn(usize) -> Vec2) -> Packing {
    let positions = packing.positions().iter().enumerate();
    Packing::new(
        packing.domain(),
        packing.radii().to_vec(),
        positions.map(|(p, r)| r + shift(p)).collect(),
    )
    .unwrap()
}

/// Packings in and out of balance, from hardly touching to far beyond the model's range.
fn packings() -> Vec<Packing> {
    let mut random = Random::new(77);
    let mut list: Vec<Packing> = [(0.86, 1), (0.95, 2), (1.1, 3)]
        .map(|(phi, seed)| relaxed_disks(40, phi, seed))
        .into();
    for (phi, ratio, steps) in [(0.85, 1.4, 20), (0.95, 2.5, 60), (1.05, 1.4, 80)] {
        list.push(random_packing(&mut random, 40, phi, ratio, steps));
    }
    list
}

#[test]
fn gradient_form_is_the_gradient_of_the_energy() {
    let (mut worst, mut central_off, mut compared, mut left_out): (f64, f64, u32, u32) =
        (0.0, 0.0, 0, 0);
    for packing in packings() {
        let law = exact(&packing);
        let forces = net(&law, &packing, Form::Gradient);
        let central = net(&law, &packing, Form::Central);
        let scale = largest(&forces);
        for p in 0..packing.len() {
            for (k, axis) in [Vec2::x(), Vec2::y()].into_iter().enumerate() {
                // Five points: the error is O(h⁴), as long as no contact opens or closes between them.
                let h = 2e-4;
                let mut same = true;
                let mut at = |x: f64| {
                    let there = exact(&moved(&packing, |q| axis * if q == p { x } else { 0.0 }));
                    same &= there.contacts().pairs == law.contacts().pairs;
                    energy(&there)
                };
                let slope = (at(-2.0 * h) - at(2.0 * h) + 8.0 * (at(h) - at(-h))) / (12.0 * h);
                if same {
                    compared += 1;
                    worst = worst.max((forces[p][k] + slope).abs() / scale);
                    central_off = central_off.max((central[p][k] + slope).abs() / scale);
                } else {
                    left_out += 1;
                }
            }
        }
    }
    assert_at_most("gradient form, error over the largest force", worst, 1e-7);
    assert!(
        compared > 9 * left_out,
        "{compared} components compared, {left_out} left out since contacts changed"
    );
    assert!(
        central_off > 1e-2,
        "the central form is another: {central_off:e}"
    );
}

#[test]
fn forms_differ_by_second_order_in_the_forces() {
    // Scaling the overlaps down scales the forces; the relative difference goes down with them.
    let mut last = f64::INFINITY;
    for phi in [1.1, 0.95, 0.88, 0.85] {
        let packing = relaxed_disks(128, phi, 1);
        let law = exact(&packing);
        let (a, b) = (
            net(&law, &packing, Form::Central),
            net(&law, &packing, Form::Gradient),
        );
        let apart: Vec<Vec2> = a.iter().zip(&b).map(|(a, b)| a - b).collect();
        let strongest = law
            .contacts()
            .forces
            .iter()
            .fold(0.0, |m: f64, f| m.max(*f));
        let relative = largest(&apart) / strongest;
        println!("phi {phi}: strongest contact {strongest:.4}, difference over it {relative:.5}");
        assert!(relative < last, "φ = {phi}");
        assert!(relative < 0.5 * strongest, "O(f²): φ = {phi}");
        last = relative;
    }
}

#[test]
fn total_force_and_torque_are_zero() {
    let mut random = Random::new(5);
    for packing in packings() {
        let law = exact(&packing);
        let forces = net(&law, &packing, Form::Gradient);
        let total: Vec2 = forces.iter().sum();
        assert_at_most("total force", total.norm() / largest(&forces), 1e-13);
    }
    // A cluster in a box that it does not span.
    for _ in 0..20 {
        let radii: Vec<f64> = (0..24).map(|_| random.within(0.4, 0.7)).collect();
        let positions: Vec<Vec2> = (0..24)
            .map(|k| {
                let place = Vec2::new(f64::from(k % 5), f64::from(k / 5)) * 0.98;
                place
                    + Vec2::new(5.0, 5.0)
                    + Vec2::new(random.within(-0.1, 0.1), random.within(-0.1, 0.1))
            })
            .collect();
        let packing =
            Packing::new(Domain::new(16.0, 16.0).unwrap(), radii, positions.clone()).unwrap();
        let law = exact(&packing);
        let forces = net(&law, &packing, Form::Gradient);
        let torque: f64 = forces
            .iter()
            .zip(&positions)
            .map(|(f, r)| r.x * f.y - r.y * f.x)
            .sum();
        assert_at_most("total torque", torque.abs() / largest(&forces), 1e-12);
    }
}

#[test]
fn energy_is_conserved_with_an_error_of_second_order_in_the_time_step() {
    /// The largest error of the energy over a run by velocity Verlet, and how often the contacts changed.
    fn run(form: Form, dt: f64, seed: u64) -> (f64, u32) {
        let mut packing = relaxed_disks(32, 0.90, seed);
        let mut random = Random::new(seed);
        let mut velocities: Vec<Vec2> = (0..packing.len())
            .map(|_| Vec2::new(random.within(-0.05, 0.05), random.within(-0.05, 0.05)))
            .collect();
        let mut forces = NetForces::new(form);
        let mut law = exact(&packing);
        let mut net = vec![Vec2::zeros(); packing.len()];
        forces.evaluate(&law.contacts(), &packing, 1.0, &mut net);
        let kinetic = |v: &[Vec2]| 0.5 * v.iter().map(Vec2::norm_squared).sum::<f64>();
        let first = kinetic(&velocities) + energy(&law);
        let (mut worst, mut changes): (f64, u32) = (0.0, 0);
        let steps = (20.0 / dt) as u32;
        for _ in 0..steps {
            for (v, f) in velocities.iter_mut().zip(&net) {
                *v += f * (0.5 * dt);
            }
            packing = moved(&packing, |p| velocities[p] * dt);
            let before = law.contacts().pairs.to_vec();
            law.solve_again(&packing).unwrap();
            changes += u32::from(before != law.contacts().pairs);
            forces.evaluate(&law.contacts(), &packing, 1.0, &mut net);
            for (v, f) in velocities.iter_mut().zip(&net) {
                *v += f * (0.5 * dt);
            }
            worst = worst.max((kinetic(&velocities) + energy(&law) - first).abs());
        }
        (worst, changes)
    }
    // The largest error of a run depends on when contacts change; the mean over several runs hardly does.
    let seeds = 1..=12;
    let mean = |form: Form, dt: f64| {
        let mut sum = 0.0;
        for seed in seeds.clone() {
            let (error, changes) = run(form, dt, seed);
            assert!(changes > 10, "contacts change on the way: {changes}");
            sum += error;
        }
        sum / seeds.clone().count() as f64
    };
    let errors = [0.04, 0.02, 0.01].map(|dt| mean(Form::Gradient, dt));
    println!(
        "gradient form: {:.3e} {:.3e} {:.3e}",
        errors[0], errors[1], errors[2]
    );
    let exponent = (errors[0] / errors[2]).log2() / 2.0;
    assert_within("exponent of the error of the energy", exponent, 1.85, 2.15);
    // With the central form there is an error that no time step takes away.
    let (coarse, fine) = (mean(Form::Central, 0.02), mean(Form::Central, 0.01));
    println!("central form: {coarse:.3e} -> {fine:.3e}");
    assert!(fine > 0.5 * coarse && fine > 10.0 * errors[2]);
}

/// `packing` with box and centres, not radii, stretched.
fn stretched(packing: &Packing, x: f64, y: f64) -> Packing {
    let sides = packing.domain().lengths();
    Packing::new(
        Domain::new(sides.x * x, sides.y * y).unwrap(),
        packing.radii().to_vec(),
        packing
            .positions()
            .iter()
            .map(|p| Vec2::new(p.x * x, p.y * y))
            .collect(),
    )
    .unwrap()
}

#[test]
fn stress_is_the_change_of_energy_with_strain() {
    for packing in packings() {
        let law = exact(&packing);
        let mut forces = NetForces::new(Form::Gradient);
        let mut net = vec![Vec2::zeros(); packing.len()];
        forces.evaluate(&law.contacts(), &packing, 1.0, &mut net);
        let central = Observables::of(&law.contacts(), packing.domain(), 40, 1.0, (0.0, 0.0));
        let stress = central
            .with_torques(&law.contacts(), packing.domain(), 1.0, forces.torques())
            .stress;
        let h = 1e-6;
        let slope = |x: f64, y: f64| {
            let (more, less) = (
                stretched(&packing, 1.0 + x * h, 1.0 + y * h),
                stretched(&packing, 1.0 - x * h, 1.0 - y * h),
            );
            (energy(&exact(&more)) - energy(&exact(&less))) / (2.0 * h * packing.domain().area())
        };
        let scale = central.pressure();
        // p = −dU/dV holds with both forms, what stretches one side only needs the torques.
        assert_at_most(
            "−dU/dV, relative error",
            (0.5 * slope(1.0, 1.0) / scale + 1.0).abs(),
            1e-6,
        );
        assert_at_most(
            "pressure with the torques, relative difference",
            (0.5 * (stress[0] + stress[2]) / scale + 1.0).abs(),
            1e-13,
        );
        for (value, x, y) in [(stress[0], 1.0, 0.0), (stress[2], 0.0, 1.0)] {
            assert_at_most(
                "dU/dε over the pressure, error",
                (value - slope(x, y)).abs() / scale,
                1e-6,
            );
        }
    }
}

#[test]
fn both_minimisers_find_the_balance_of_the_gradient_form() {
    for (phi, seed) in [(0.845, 2), (0.86, 1), (0.90, 2), (0.95, 3), (1.0, 4)] {
        for (minimizer, threshold) in [(Minimizer::Fire, 1e-10), (Minimizer::FireNewton, 1e-13)] {
            let run = converged(&Scene {
                forces: Form::Gradient,
                minimizer,
                threshold,
                ..scene(128, phi, seed)
            });
            let law = exact(run.packing());
            let forces = net(&law, run.packing(), Form::Gradient);
            assert_at_most("f_max, solved anew", largest(&forces), threshold + 1e-12);
            let central = Model::new(
                run.packing(),
                law.contacts().pairs,
                law.contacts().forces,
                1.0,
            )
            .largest_net_force();
            assert!(central > 1e-6, "the central form is not in balance there");
        }
    }
}

#[test]
fn a_relaxed_packing_of_the_gradient_form_is_a_minimum() {
    let mut random = Random::new(3);
    for (phi, seed) in [(0.86, 1), (0.95, 3)] {
        let run = converged(&Scene {
            forces: Form::Gradient,
            minimizer: Minimizer::FireNewton,
            ..scene(64, phi, seed)
        });
        let least = energy(&exact(run.packing()));
        for _ in 0..50 {
            let shifts: Vec<Vec2> = (0..64)
                .map(|_| Vec2::new(random.within(-1e-3, 1e-3), random.within(-1e-3, 1e-3)))
                .collect();
            let there = energy(&exact(&moved(run.packing(), |p| shifts[p])));
            assert!(there > least, "φ = {phi}: {there} is below {least}");
        }
    }
}

#[test]
fn forces_and_stress_of_a_frame_are_those_of_the_run_it_comes_from() {
    for forces in [Form::Central, Form::Gradient] {
        let scene = Scene {
            forces,
            line_tension: 3.0,
            ..scene(100, 0.87, 2)
        };
        let mut run = Relaxation::new(&scene).unwrap();
        let mut torques = 0;
        loop {
            let frame = run.frame();
            let found = FrameForces::of(run.packing(), &frame, scene.model()).unwrap();
            assert_eq!(found.net(), run.net_forces(), "step {}", frame.step);
            assert_eq!(
                *found.observables(),
                run.observables(),
                "step {}",
                frame.step
            );
            torques += found.torques().len();
            if run.status() != Status::Running {
                break;
            }
            // Contacts come and go in between.
            for _ in 0..10 {
                if run.status() == Status::Running {
                    run.advance().unwrap();
                }
            }
        }
        assert_eq!(torques > 0, forces == Form::Gradient);
        let o = run.observables();
        assert!(
            o.stress_xx() < 0.0 && o.stress_yy() < 0.0,
            "it is compressed"
        );
    }
}
