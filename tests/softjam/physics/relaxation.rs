//! Whole relaxations: how long they take, where they end, and that they can be taken up anywhere.

use crate::common::{
    answer, assert_at_most, assert_within, converged, largest_difference, median, monodisperse,
    scene,
};
use softjam::models::droplet::contact::Rule;
use softjam::models::droplet::contact::solver::Method;
use softjam::numerics::threads;
use softjam::protocol::relax_disks;
use softjam::protocol::{Relaxation, Status};
use softjam::scene::DiskParameters;
use softjam::scene::{Radii, Scene, Start, start};
use softjam::state::Frame;
use std::sync::atomic::{AtomicU32, Ordering};

#[test]
fn saitoh_rule_and_contact_law_end_in_the_same_packing() {
    let mut worst: f64 = 0.0;
    for particles in [64, 96, 128] {
        for seed in 1..=4 {
            let law = converged(&scene(particles, 0.9, seed));
            let rule = converged(&Scene {
                contact_rule: Rule::Saitoh,
                ..scene(particles, 0.9, seed)
            });
            worst = worst.max(largest_difference(
                &answer(law.law().unwrap()),
                &answer(rule.law().unwrap()),
            ));
        }
    }
    assert_at_most(
        "force at the end by the other rule, difference",
        worst,
        1e-8,
    );
}

#[test]
fn undeformed_disks_have_the_coordination_of_harmonic_packings() {
    // Z = 4 + 3.6 √(φ − 0.842); LAMMPS, one sample of the same size: 4.475 and 4.878. Samples scatter by about 0.02.
    for phi in [0.86, 0.90] {
        let seeds = 1..=8;
        let mut sum = 0.0;
        for seed in seeds.clone() {
            let mut packing = start::packing(&scene(1024, phi, seed)).unwrap();
            let report = relax_disks(&mut packing, &DiskParameters::default(), 1.0).unwrap();
            assert!(report.converged, "φ = {phi}, seed {seed}: {report:?}");
            sum += report.coordination;
        }
        let (mean, expected) = (
            sum / seeds.count() as f64,
            4.0 + 3.6 * f64::sqrt(phi - 0.842),
        );
        assert_within(
            &format!("phi {phi}: mean Z"),
            mean,
            expected - 0.03,
            expected + 0.03,
        );
    }
}

#[test]
fn disks_report_of_a_run_is_that_of_its_disks() {
    let scene = scene(128, 0.86, 2);
    let run = Relaxation::new(&scene).unwrap();
    let mut packing = start::packing(&scene).unwrap();
    let report = relax_disks(&mut packing, &scene.disks, scene.line_tension).unwrap();
    assert_eq!(run.disks(), Some(report));
    assert_eq!(run.packing(), &packing);
}

#[test]
fn largest_force_falls_below_the_threshold_and_later_near_jamming() {
    let steps = |phi: f64| {
        let runs = (1..=15).map(|seed| {
            let mut run = Relaxation::new(&scene(256, phi, seed)).unwrap();
            let first = run.f_max();
            while run.status() == Status::Running {
                run.advance().unwrap();
            }
            assert_eq!(run.status(), Status::Converged, "φ = {phi}, seed {seed}");
            // So near to jamming a few packings are not jammed at all, and their disks hardly press on each other.
            let held = run.observables().backbone_contacts > 0;
            assert!(
                run.f_max() <= 1e-10 && (first > 1e-4 || !held),
                "φ = {phi}, seed {seed}"
            );
            assert!(held || phi < 0.85, "φ = {phi}, seed {seed} is not jammed");
            run.step()
        });
        let counts: Vec<u64> = runs.collect();
        let mean = counts.iter().sum::<u64>() as f64 / counts.len() as f64;
        println!(
            "phi {phi}: mean of the steps {mean:.0}, median {}",
            median(counts)
        );
        mean
    };
    let near = steps(0.843);
    for phi in [0.86, 0.88, 0.90] {
        assert!(
            near > 1.5 * steps(phi),
            "φ = {phi} against {near} steps at 0.843"
        );
    }
}

#[test]
fn two_threads_walk_the_bits_of_one() {
    let scene = Scene {
        disks: DiskParameters {
            steps: 150,
            ..DiskParameters::default()
        },
        ..scene(9000, 0.88, 3)
    };
    let walk = || {
        let mut run = Relaxation::new(&scene).unwrap();
        let mut digests = Vec::new();
        for _ in 0..25 {
            run.advance().unwrap();
            digests.push(run.frame().digest());
        }
        let work = run.law().unwrap().work();
        assert!(
            run.contacts().forces.len() > 16_384,
            "enough for a second thread"
        );
        assert!(
            work.local_updates > 0 && work.gaps > 0,
            "contacts came and went"
        );
        (digests, work)
    };
    let [one, two] = [1, 2].map(|threads| threads::with(threads, walk).unwrap());
    assert_eq!(one, two);
}

#[test]
fn a_second_thread_is_had_in_a_pool_of_the_callers() {
    let started = AtomicU32::new(0);
    let most = AtomicU32::new(0);
    let task = |k: u32| {
        let result = threads::with(2, || {
            most.fetch_max(started.fetch_add(1, Ordering::SeqCst) + 1, Ordering::SeqCst);
            let mut run = Relaxation::new(&scene(32, 0.9, u64::from(k))).unwrap();
            (0..20).for_each(|_| run.advance().unwrap());
            started.fetch_sub(1, Ordering::SeqCst);
            run.step()
        });
        assert_eq!(result.unwrap(), 20);
    };
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(2)
        .build()
        .unwrap();
    let task = &task;
    pool.scope(|scope| {
        for k in 1..=40 {
            scope.spawn(move |_| task(k));
        }
    });
    let most = most.into_inner();
    assert!(most <= 2, "{most} runs at a time on two threads");
}

#[test]
fn a_panic_beside_a_second_thread_is_passed_on() {
    let result = std::panic::catch_unwind(|| threads::with(2, || panic!("as told")));
    let panic = result.unwrap_err();
    assert_eq!(panic.downcast_ref::<&str>(), Some(&"as told"));
}

#[test]
fn run_taken_up_at_any_frame_ends_in_the_same_bits() {
    let scenes = [
        scene(64, 0.90, 1),
        scene(48, 0.843, 2),
        Scene {
            aspect: 0.7,
            line_tension: 0.5,
            radii: Radii::Spread { min: 0.4, max: 1.0 },
            ..scene(60, 0.95, 3)
        },
    ];
    for scene in scenes {
        for contact_rule in [Rule::Complementarity, Rule::Saitoh] {
            for contact_solver in [Method::ConjugateGradient, Method::SparseCholesky] {
                let scene = Scene {
                    contact_rule,
                    contact_solver,
                    ..scene.clone()
                };
                let packing = start::packing(&scene).unwrap();
                let frames: Result<Vec<Frame>, _> = Relaxation::new(&scene).unwrap().collect();
                let frames = frames.unwrap();
                let last = frames.len() - 1;
                for k in [0, 1, 2, 30, last / 3, last / 2, last - 1, last] {
                    let resumed = Relaxation::resume(&scene, packing.clone(), frames[k].clone());
                    let rest: Result<Vec<Frame>, _> = resumed.unwrap().collect();
                    let rest = rest.unwrap();
                    assert_eq!(
                        rest.len(),
                        frames.len() - k,
                        "{contact_rule:?} from step {k}"
                    );
                    for (a, b) in rest.iter().zip(&frames[k..]) {
                        assert_eq!(a.digest(), b.digest(), "{contact_rule:?} from step {k}");
                    }
                }
            }
        }
    }
}

/// A run numbers its contacts by when they came; one that is taken up numbers them by their pairs. No bit may depend on it.
#[test]
fn numbers_of_contacts_reach_no_bit() {
    let scene = Scene {
        disks: DiskParameters {
            threshold: 1e-2,
            ..DiskParameters::default()
        },
        steps: 400,
        // A number with which the same product in two orders has two roundings.
        line_tension: 3.05,
        ..scene(300, 0.87, 6)
    };
    let packing = start::packing(&scene).unwrap();
    let mut run = Relaxation::new(&scene).unwrap();
    let mut exchanges = 0;
    while run.status() == Status::Running {
        let frame = run.frame();
        let contacts = frame.contacts.clone();
        let mut again = Relaxation::resume(&scene, packing.clone(), frame).unwrap();
        run.advance().unwrap();
        again.advance().unwrap();
        exchanges += u32::from(run.contacts().pairs != contacts);
        assert_eq!(run.frame().digest(), again.frame().digest());
        assert_eq!(
            run.law().unwrap().residual(),
            again.law().unwrap().residual()
        );
        assert_eq!(run.net_forces(), again.net_forces());
        assert_eq!(run.observables(), again.observables());
    }
    let structures = run.law().unwrap().work().structures;
    assert!(
        exchanges > 100 && structures < 40,
        "{exchanges}, {structures}"
    );
}

#[test]
fn same_scene_walks_the_same_bits() {
    let scene = scene(100, 0.87, 9);
    let (a, b) = (converged(&scene), converged(&scene));
    assert_eq!(a.frame().digest(), b.frame().digest());
}

#[test]
fn tightest_contact_tolerance_that_a_scene_may_ask_for_is_reached() {
    for seed in 1..=3 {
        for contact_solver in [Method::ConjugateGradient, Method::SparseCholesky] {
            let run = converged(&Scene {
                contact_tolerance: 1e-14,
                contact_solver,
                ..scene(100, 0.9, seed)
            });
            assert!(run.law().unwrap().residual() <= 1.6e-13);
        }
    }
}

#[test]
fn disturbed_crystal_of_equal_particles_relaxes_back() {
    let crystal = Scene {
        particles: 56,
        phi: 0.93,
        radii: monodisperse(),
        start: Start::Hexagonal,
        ..Scene::default()
    };
    let at_rest = Relaxation::new(&crystal).unwrap();
    let mut frame = at_rest.frame();
    frame.positions[20].x += 0.05;
    frame.positions[31].y -= 0.03;
    let mut run = Relaxation::resume(&crystal, at_rest.packing().clone(), frame).unwrap();
    while run.status() == Status::Running {
        run.advance().unwrap();
    }
    assert_eq!(run.status(), Status::Converged);
    let worst = largest_difference(&answer(run.law().unwrap()), &answer(at_rest.law().unwrap()));
    assert_at_most("force after the disturbance, difference", worst, 1e-8);
}

#[test]
fn the_line_tension_is_the_unit_of_force_and_changes_nothing_else() {
    let run_at = |line_tension: f64| {
        let scene = Scene {
            line_tension,
            ..scene(64, 0.9, 3)
        };
        let mut run = Relaxation::new(&scene).unwrap();
        while run.status() == Status::Running {
            run.advance().unwrap();
        }
        assert_eq!(run.status(), Status::Converged);
        (run.step(), run.disks(), run.observables())
    };
    let (steps, disks, at_one) = run_at(1.0);
    // Powers of four: forces scale by them and times by their roots, both without rounding.
    for line_tension in [0.25, 4.0, 2f64.powi(-40), 2f64.powi(30)] {
        let (other_steps, other_disks, other) = run_at(line_tension);
        assert_eq!(
            (steps, disks),
            (other_steps, other_disks),
            "γ = {line_tension}"
        );
        assert_eq!(other.f_max, at_one.f_max);
        assert_eq!(other.energy, at_one.energy);
        assert_eq!(other.stress, at_one.stress);
        assert_eq!(other.dt * line_tension.sqrt(), at_one.dt);
    }
}
