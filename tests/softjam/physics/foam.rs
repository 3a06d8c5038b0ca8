//! Rounded polygons and wet foam: relaxation, and that a frame determines the next one.

use crate::common::scene;
use softjam::models::{Kind, Model};
use softjam::protocol::{RelaxError, Relaxation, Status};
use softjam::scene::{Minimizer, Radii, Scene, Species};
use softjam::state::{Frame, FrameError};

const KINDS: [Kind; 2] = [Kind::RoundedPolygon, Kind::WetFoam];

#[test]
fn packings_come_to_balance_of_forces_and_moments_from_jamming_to_dry_foam() {
    for phi in [0.8, 0.86, 0.92, 0.97, 0.99] {
        for model in KINDS {
            for seed in [1, 2] {
                let scene = Scene {
                    model,
                    ..scene(64, phi, seed)
                };
                let mut run = Relaxation::new(&scene).unwrap();
                while run.status() == Status::Running {
                    run.advance().unwrap();
                }
                let at = format!("{model:?} at φ = {phi}, seed {seed}");
                assert_eq!(run.status(), Status::Converged, "{at}");
                assert!(
                    run.f_max() <= 1e-10 && run.model().moment() <= 1e-10,
                    "{at}"
                );
                // By code that shares nothing with the solver.
                let found = run
                    .model()
                    .check(run.packing(), &run.frame(), scene.threshold);
                assert!(
                    found.residual <= found.promised.max(1e-9),
                    "{at}: {found:?}"
                );
                assert!(found.overlap <= found.promised.max(1e-9), "{at}: {found:?}");
                assert!(
                    found.moment <= 1e-10 && found.pull == 0.0,
                    "{at}: {found:?}"
                );
                let o = run.observables();
                assert!((found.energy - o.energy).abs() <= 1e-10 * o.energy, "{at}");
                assert!(
                    (found.pressure - o.pressure()).abs() <= 1e-9 * o.pressure(),
                    "{at}"
                );
                // Bits of the energy that a linear model misses, or none where nothing touches.
                assert_eq!(o.energy > 0.0, o.contacts > 0, "{at}");
            }
        }
    }
}

#[test]
fn run_of_droplets_taken_up_at_any_frame_walks_the_same_bits() {
    // From relaxed disks, wet and dry; in another unit of force, with sizes from 1 to 3.
    let small = Species {
        radius: 0.4,
        fraction: 0.75,
    };
    let large = Species {
        radius: 1.2,
        fraction: 0.25,
    };
    let scenes = [
        scene(40, 0.9, 1),
        scene(40, 0.99, 2),
        Scene {
            line_tension: 3.05e-3,
            radii: Radii::Species(vec![small, large]),
            ..scene(40, 0.94, 3)
        },
    ];
    for scene in scenes {
        for (model, minimizer) in [
            (Kind::RoundedPolygon, Minimizer::Fire),
            (Kind::WetFoam, Minimizer::Fire),
            (Kind::RoundedPolygon, Minimizer::FireNewton),
            (Kind::WetFoam, Minimizer::FireNewton),
        ] {
            let scene = Scene {
                model,
                minimizer,
                ..scene.clone()
            };
            let run = Relaxation::new(&scene).unwrap();
            let packing = run.packing().clone();
            let frames: Vec<Frame> = run.map(Result::unwrap).collect();
            let last = frames.len() - 1;
            for k in [
                0,
                1,
                2,
                49,
                50,
                last / 2,
                last - 3,
                last - 2,
                last - 1,
                last,
            ] {
                let resumed = Relaxation::resume(&scene, packing.clone(), frames[k].clone());
                let rest: Vec<Frame> = resumed.unwrap().map(Result::unwrap).collect();
                assert_eq!(rest.len(), frames.len() - k, "{model:?} from step {k}");
                for (a, b) in rest.iter().zip(&frames[k..]) {
                    assert_eq!(a.digest(), b.digest(), "{model:?} from step {k}");
                }
            }
        }
    }
}

#[test]
fn memories_that_no_frame_of_droplets_has_are_refused() {
    let scene = Scene {
        model: Kind::WetFoam,
        ..scene(24, 0.9, 1)
    };
    let run = Relaxation::new(&scene).unwrap();
    let changes: [&dyn Fn(&mut Frame); 8] = [
        &|f| f.memory.clear(),
        &|f| f.memory.truncate(7),
        &|f| f.memory[0] = f64::NAN,
        &|f| f.memory[0] = 2.0,
        &|f| *f.memory.last_mut().unwrap() = 0.9,
        &|f| f.memory.extend([0.1, 0.1]),
        &|f| f.memory.push(f64::INFINITY),
        &|f| f.forces[0] = 1e9,
    ];
    for (k, change) in changes.iter().enumerate() {
        let mut frame = run.frame();
        change(&mut frame);
        let error = Relaxation::resume(&scene, run.packing().clone(), frame).unwrap_err();
        let refused = matches!(
            error,
            RelaxError::Frame(FrameError::Foreign { .. } | FrameError::Value { .. })
        );
        assert!(refused, "change {k}: {error}");
    }
}

#[test]
fn tight_starts_end_with_a_packing_or_a_reason() {
    for model in KINDS {
        // No droplets fit into less than their own area.
        let scene = Scene {
            model,
            steps: 60,
            ..scene(24, 1.2, 1)
        };
        match Relaxation::new(&scene) {
            Err(error) => assert!(error.to_string().contains("no room"), "{error}"),
            Ok(mut run) => {
                while run.status() == Status::Running {
                    if let Err(error) = run.advance() {
                        assert!(error.to_string().contains("no room"), "{error}");
                    }
                }
                assert_ne!(run.status(), Status::Converged);
            }
        }
    }
}
