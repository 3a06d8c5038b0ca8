//! Minimum or saddle: what the run says of its end, against all eigenvalues of a dense matrix.

use super::stress::stiffness::Spectrum;
use crate::common::scene;
use softjam::domain::{Domain, Vec2};
use softjam::force::Form;
use softjam::packing::Packing;
use softjam::relax::{Relaxation, Stability, Status};
use softjam::scene::{Minimizer, Scene};

/// Runs to balance and asserts that what the run says of it is what the eigenvalues say.
fn judged(scene: &Scene) -> Stability {
    let mut run = Relaxation::new(scene).unwrap();
    while run.status() == Status::Running {
        run.advance().unwrap();
    }
    assert_judged_right(&run, scene)
}

fn assert_judged_right(run: &Relaxation, scene: &Scene) -> Stability {
    let spectrum = Spectrum::of_run(run, scene.forces);
    let stability = run.stability().unwrap();
    println!(
        "{stability:?}: {spectrum:?} (φ = {}, seed {})",
        scene.phi, scene.seed
    );
    assert!(
        spectrum.bears_out(run),
        "{stability:?}, but {spectrum:?}: {scene:?}"
    );
    stability
}

/// Twelve coverages around and above the transition, three samples each.
#[test]
fn samples_near_jamming_are_judged_as_their_eigenvalues_say() {
    let mut jammed = 0;
    for k in 0..12 {
        for seed in 1..=3 {
            let stability = judged(&Scene {
                minimizer: if k % 2 == 0 {
                    Minimizer::Fire
                } else {
                    Minimizer::FireNewton
                },
                ..scene(256, 0.843 + 0.007 / 11.0 * f64::from(k), seed)
            });
            jammed += usize::from(stability == Stability::Minimum);
        }
    }
    println!("{jammed} of 36 are minima");
    assert!(jammed >= 18, "{jammed}");
}

/// Disks of radius 1/2 on a square lattice of spacing `a`, `columns` × `rows`, in a box of sides `columns a` and `height`.
fn square(columns: usize, rows: usize, a: f64, sides: Vec2) -> Packing {
    let place = |k: usize| {
        let (x, y) = (k % columns, k / columns);
        Vec2::new((x as f64 + 0.5) * a, (y as f64 + 0.5) * a)
    };
    let positions = (0..columns * rows).map(place).collect();
    let domain = Domain::new(sides.x, sides.y).unwrap();
    Packing::new(domain, vec![0.5; columns * rows], positions).unwrap()
}

/// A square lattice shears (`G_xy = −f/a`), a column buckles: both are balanced to round-off as they stand.
fn unstable() -> Vec<Packing> {
    let mut list = Vec::new();
    for n in [6, 8, 10] {
        for a in [0.9, 0.95, 0.98, 0.999] {
            let side = n as f64 * a;
            list.push(square(n, n, a, Vec2::new(side, side)));
            list.push(square(1, n, a, Vec2::new(side, side)));
        }
    }
    list
}

#[test]
fn lattices_that_only_stand_by_symmetry_are_saddles() {
    for packing in unstable() {
        for forces in [Form::Central, Form::Gradient] {
            let scene = Scene {
                forces,
                ..Scene::default()
            };
            let run = Relaxation::of_packing(&scene, packing.clone()).unwrap();
            assert_eq!(run.status(), Status::Converged, "FIRE has nothing to do");
            let stability = assert_judged_right(&run, &scene);
            assert_eq!(stability, Stability::Saddle);
        }
    }
}

/// Where it goes from there lies lower: with the gradient form there is an energy to tell.
#[test]
fn newtons_method_does_not_end_on_a_saddle() {
    for packing in unstable() {
        for forces in [Form::Central, Form::Gradient] {
            let scene = Scene {
                forces,
                minimizer: Minimizer::FireNewton,
                ..Scene::default()
            };
            let mut run = Relaxation::of_packing(&scene, packing.clone()).unwrap();
            let saddle = run.observables().energy;
            assert_eq!(run.stability(), Some(Stability::Saddle));
            assert_eq!(run.status(), Status::Running);
            while run.status() == Status::Running {
                run.advance().unwrap();
            }
            assert_eq!(run.status(), Status::Converged);
            let stability = assert_judged_right(&run, &scene);
            assert_ne!(stability, Stability::Saddle);
            let energy = run.observables().energy;
            println!("U = {saddle:.6e} → {energy:.6e} in {} steps", run.step());
            assert!(energy < saddle);
        }
    }
}
