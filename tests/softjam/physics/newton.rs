//! FIRE and then Newton's method: how fast it finishes, where it ends, that it falls back and never fails.

use crate::common::fire;
use crate::common::{answer, assert_at_most, converged, largest_difference, monodisperse, scene};
use softjam::domain::Vec2;
use softjam::minimize::fire::FireState;
use softjam::minimize::newton::Turns;
use softjam::models::droplet::Form;
use softjam::models::droplet::contact::Rule;
use softjam::models::droplet::contact::solver::Method;
use softjam::protocol::{Relaxation, Status};
use softjam::scene::{Minimizer, Radii, Scene, Start, start};
use softjam::state::Frame;
use softjam::state::Packing;

fn finishing(particles: usize, phi: f64, seed: u64) -> Scene {
    Scene {
        minimizer: Minimizer::FireNewton,
        threshold: 1e-13,
        ..scene(particles, phi, seed)
    }
}

/// Steps, steps of Newton's method that were kept and attempts given up, and the lowest `f_max` on the way.
#[derive(Debug)]
struct Count {
    steps: u64,
    kept: u32,
    given_up: u32,
    lowest: f64,
}

/// A run to its end, whatever that is.
fn run_to_the_end(scene: &Scene) -> (Relaxation, Count) {
    let mut run = Relaxation::new(scene).unwrap();
    let mut count = Count {
        steps: 0,
        kept: 0,
        given_up: 0,
        lowest: run.f_max(),
    };
    let mut before = Turns::default();
    while run.status() == Status::Running {
        run.advance().unwrap();
        count.lowest = count.lowest.min(run.f_max());
        let turns = fire(&run.frame()).turns;
        if turns.failures > before.failures || (turns.failures == 1 && turns.wait > before.wait) {
            count.given_up += 1;
        }
        before = turns;
    }
    count.steps = run.step();
    count.kept = before.moves;
    (run, count)
}

/// The frame at which FIRE alone first has `f_max ≤ threshold`, with the packing it belongs to.
fn fire_to(threshold: f64, scene: &Scene) -> (Packing, Frame) {
    let run = converged(&Scene {
        minimizer: Minimizer::Fire,
        threshold,
        ..scene.clone()
    });
    (run.packing().clone(), run.frame())
}

#[test]
fn newton_converges_quadratically_from_a_millionth() {
    // Near jamming most packings have a mode so soft that FIRE has to go on first; these two have not.
    let mut scenes = vec![(0.845, 2), (0.845, 4)];
    for phi in [0.86, 0.90, 0.95, 1.0] {
        scenes.extend((1..=6).map(|seed| (phi, seed)));
    }
    let mut constants = Vec::new();
    for form in [Form::Central, Form::Gradient] {
        for &(phi, seed) in &scenes {
            let scene = Scene {
                forces: form,
                ..finishing(256, phi, seed)
            };
            let (packing, frame) = fire_to(1e-6, &scene);
            let mut run = Relaxation::resume(&scene, packing, frame).unwrap();
            let mut sequence = vec![run.f_max()];
            while run.status() == Status::Running {
                run.advance().unwrap();
                sequence.push(run.f_max());
            }
            let shown: Vec<String> = sequence.iter().map(|f| format!("{f:.1e}")).collect();
            println!("{form:?}, phi {phi}, seed {seed}: {}", shown.join(" -> "));
            assert_eq!(run.status(), Status::Converged);
            assert!(sequence.len() <= 5, "at most four steps: {shown:?}");
            // What is at most 1e-13 is round-off.
            let pairs = sequence.windows(2).filter(|pair| pair[1] > 1e-13);
            constants.extend(pairs.map(|pair| pair[1] / (pair[0] * pair[0])));
        }
    }
    // The remainder of a step is of second order, C f_max². C is larger where a soft mode lets particles go far, and a contact that
    // comes or goes is a step of its own.
    let large = constants.iter().filter(|c| **c > 1e6).count();
    println!("{large} of {} steps with C > 1e6", constants.len());
    assert!(constants.len() > 40 && 10 * large <= constants.len());
}

#[test]
fn newton_ends_in_the_packing_that_fire_ends_in() {
    let mut furthest: f64 = 0.0;
    let mut worst: f64 = 0.0;
    for (phi, seed) in [(0.86, 1), (0.88, 2), (0.90, 3), (0.95, 4), (1.0, 5)] {
        let scene = finishing(128, phi, seed);
        let (packing, frame) = fire_to(1e-7, &scene);
        let ends = [Minimizer::Fire, Minimizer::FireNewton].map(|minimizer| {
            let scene = Scene {
                minimizer,
                threshold: if minimizer == Minimizer::Fire {
                    1e-12
                } else {
                    1e-13
                },
                ..scene.clone()
            };
            let mut run = Relaxation::resume(&scene, packing.clone(), frame.clone()).unwrap();
            while run.status() == Status::Running {
                run.advance().unwrap();
            }
            assert_eq!(
                run.status(),
                Status::Converged,
                "{minimizer:?}, φ = {phi}: {:e}",
                run.f_max()
            );
            run
        });
        let held = |list: Vec<([u32; 2], f64)>| -> Vec<_> {
            // A rattler may lean on a neighbour with a force below the threshold.
            list.into_iter().filter(|c| c.1 > 1e-11).collect()
        };
        let [a, b] = ends.each_ref().map(|run| held(answer(run.law().unwrap())));
        worst = worst.max(largest_difference(&a, &b));
        let bearing: Vec<usize> = {
            let mut list: Vec<usize> = a
                .iter()
                .flat_map(|(p, _)| [p[0] as usize, p[1] as usize])
                .collect();
            list.sort_unstable();
            list.dedup();
            list
        };
        let domain = packing.domain();
        let (x, y) = (ends[0].packing().positions(), ends[1].packing().positions());
        let apart = |p: &usize| domain.minimum_image(x[*p] - y[*p]);
        let shift: Vec2 = bearing.iter().map(apart).sum::<Vec2>() / bearing.len() as f64;
        for p in &bearing {
            furthest = furthest.max((apart(p) - shift).norm());
        }
    }
    assert_at_most("force, difference", worst, 1e-9);
    assert_at_most("position up to the translation, difference", furthest, 1e-8);
}

#[test]
fn run_taken_up_at_every_frame_makes_the_same_next_step() {
    let mut kept = 0;
    for scene in [
        finishing(64, 0.90, 1),
        finishing(64, 0.845, 2),
        Scene {
            forces: Form::Gradient,
            ..finishing(64, 0.95, 3)
        },
        Scene {
            contact_rule: Rule::Saitoh,
            contact_solver: Method::SparseCholesky,
            ..finishing(48, 0.88, 4)
        },
    ] {
        let packing = start::packing(&scene).unwrap();
        let frames: Result<Vec<Frame>, _> = Relaxation::new(&scene).unwrap().collect();
        let frames = frames.unwrap();
        for pair in frames.windows(2) {
            let resumed = Relaxation::resume(&scene, packing.clone(), pair[0].clone());
            let mut resumed = resumed.unwrap();
            assert_eq!(resumed.status(), Status::Running);
            resumed.advance().unwrap();
            assert_eq!(
                resumed.frame().digest(),
                pair[1].digest(),
                "φ = {}, step {}",
                scene.phi,
                pair[1].step
            );
        }
        kept += fire(frames.last().unwrap()).turns.moves;
    }
    assert!(kept >= 8, "Newton's method was at work: {kept} steps");
}

#[test]
fn a_frame_keeps_the_turns_and_plain_fire_has_none() {
    let (run, count) = run_to_the_end(&finishing(64, 0.9, 1));
    let values = run.frame().minimizer.values().to_vec();
    assert_eq!(values.len(), 9);
    assert_eq!(values[6], f64::from(count.kept));
    assert!(run.frame().velocities.iter().all(|v| *v == Vec2::zeros()));
    assert_eq!(FireState::from_values(&values), Some(fire(&run.frame())));
    for wrong in [
        values[..8].to_vec(),
        [&values[..6], &[0.0; 3]].concat(),
        [&values[..6], &[1.0, 0.5, 0.0]].concat(),
        [&values[..], &[0.0]].concat(),
    ] {
        assert_eq!(FireState::from_values(&wrong), None, "{wrong:?}");
    }
    let fire = converged(&scene(64, 0.9, 1));
    assert_eq!(fire.frame().minimizer.values().len(), 6);
}

#[test]
fn every_jammed_packing_is_finished_to_round_off() {
    for phi in [0.845, 0.86, 0.88, 0.90, 0.95, 1.0] {
        let mut counts = Vec::new();
        for seed in 1..=20 {
            let scene = finishing(256, phi, seed);
            let (run, count) = run_to_the_end(&scene);
            assert_eq!(
                run.status(),
                Status::Converged,
                "φ = {phi}, seed {seed}: f_max = {:e} after {count:?}",
                run.f_max()
            );
            assert!(run.f_max() <= 1e-13);
            counts.push(count);
        }
        let mean = |what: &dyn Fn(&Count) -> f64| {
            counts.iter().map(what).sum::<f64>() / counts.len() as f64
        };
        println!(
            "phi {phi}: {:.0} steps, {:.2} of Newton's method kept, {:.2} given up (most {})",
            mean(&|c| c.steps as f64),
            mean(&|c| f64::from(c.kept)),
            mean(&|c| f64::from(c.given_up)),
            counts.iter().map(|c| c.given_up).max().unwrap_or(0),
        );
        let idle = counts.iter().filter(|c| c.kept == 0).count();
        assert!(idle <= 2, "φ = {phi}: {idle} runs without Newton's method");
    }
}

#[test]
fn few_particles_unjammed_ones_and_rattlers_end_as_they_should() {
    // Two to five particles in a box that is just large enough for them.
    for particles in [2, 3, 5] {
        for seed in 1..=4 {
            let scene = Scene {
                radii: monodisperse(),
                ..finishing(particles, 0.2, seed)
            };
            match Relaxation::new(&scene) {
                Ok(_) => {
                    let (run, _) = run_to_the_end(&scene);
                    assert_eq!(run.status(), Status::Converged, "N = {particles}");
                }
                Err(error) => assert!(error.to_string().contains("box"), "{error}"),
            }
        }
    }
    // Nothing touches in the end.
    for seed in 1..=5 {
        let (run, count) = run_to_the_end(&finishing(128, 0.6, seed));
        assert_eq!(run.status(), Status::Converged, "seed {seed}: {count:?}");
        assert!(run.observables().coordination() < 1e-12);
    }
    // Near jamming there are rattlers; they end without a force above the threshold.
    let (run, _) = run_to_the_end(&finishing(256, 0.85, 3));
    assert_eq!(run.status(), Status::Converged);
    assert!(run.observables().rattlers > 0);
}

#[test]
fn the_fewest_particles_that_can_jam_across_the_box_are_finished() {
    let mut jammed = 0;
    for particles in [10, 12, 16] {
        for seed in 1..=10 {
            let (run, _) = match Relaxation::new(&finishing(particles, 0.9, seed)) {
                Ok(_) => run_to_the_end(&finishing(particles, 0.9, seed)),
                Err(_) => continue,
            };
            assert_eq!(
                run.status(),
                Status::Converged,
                "N = {particles}, seed {seed}"
            );
            jammed += u32::from(run.observables().pressure() > 1e-3);
        }
    }
    assert!(jammed > 0);
}

#[test]
fn disturbed_crystal_is_finished() {
    // Every contact has the same force and all ties are exact.
    let crystal = Scene {
        radii: monodisperse(),
        start: Start::Hexagonal,
        ..finishing(56, 0.93, 1)
    };
    let at_rest = Relaxation::new(&crystal).unwrap();
    assert_eq!(at_rest.status(), Status::Converged, "{:e}", at_rest.f_max());
    let mut frame = at_rest.frame();
    frame.positions[20].x += 0.01;
    frame.positions[31].y -= 0.007;
    let mut run = Relaxation::resume(&crystal, at_rest.packing().clone(), frame).unwrap();
    while run.status() == Status::Running {
        run.advance().unwrap();
    }
    assert_eq!(run.status(), Status::Converged);
    let worst = largest_difference(&answer(run.law().unwrap()), &answer(at_rest.law().unwrap()));
    assert_at_most("force after the disturbance, difference", worst, 1e-11);
}

#[test]
fn all_solvers_rules_and_tensions_are_finished() {
    for contact_solver in [
        Method::ConjugateGradient,
        Method::SparseCholesky,
        Method::GaussJordan,
    ] {
        for contact_rule in [Rule::Complementarity, Rule::Saitoh] {
            let (run, _) = run_to_the_end(&Scene {
                contact_rule,
                contact_solver,
                radii: Radii::Spread { min: 0.4, max: 0.9 },
                aspect: 1.4,
                ..finishing(48, 0.92, 2)
            });
            assert_eq!(run.status(), Status::Converged, "{contact_solver:?}");
        }
    }
    for contact_tolerance in [1e-6, 1e-14] {
        let (run, _) = run_to_the_end(&Scene {
            contact_tolerance,
            ..finishing(64, 0.9, 3)
        });
        assert_eq!(run.status(), Status::Converged, "{contact_tolerance:e}");
    }
    let (at_one, one) = run_to_the_end(&finishing(64, 0.9, 3));
    for line_tension in [0.25, 4.0, 2f64.powi(-40)] {
        let (run, count) = run_to_the_end(&Scene {
            line_tension,
            ..finishing(64, 0.9, 3)
        });
        // Powers of four: the same walk without rounding.
        assert_eq!((count.steps, count.kept), (one.steps, one.kept));
        assert_eq!(run.f_max(), at_one.f_max());
    }
}

#[test]
fn a_threshold_out_of_reach_ends_at_the_step_limit() {
    // Below the round-off of the positions there is nothing to be had: attempts are given up, and ever more rarely.
    let (run, count) = run_to_the_end(&Scene {
        threshold: 1e-22,
        steps: 3000,
        ..finishing(64, 0.9, 1)
    });
    assert_eq!(run.status(), Status::StepLimit);
    assert_eq!(run.step(), 3000);
    // The last frame is one of many at the level of round-off, whose f_max goes up and down by a factor of ten.
    assert!(count.lowest < 5e-13, "{count:?}");
    assert!(run.f_max() < 5e-12, "{:e}", run.f_max());
    assert!((1..=20).contains(&count.given_up), "{count:?}");
}
