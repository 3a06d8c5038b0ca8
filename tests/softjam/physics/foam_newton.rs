//! Newton's method on rounded polygons and wet foam, and whether they are minima: against a dense matrix of differences.

use super::stability::{square, to_its_end};
use crate::common::scene;
use nalgebra::DMatrix;
use softjam::analysis::Stability;
use softjam::domain::{Domain, Vec2};
use softjam::models::{Goal, Kind, Model};
use softjam::protocol::{Relaxation, Status};
use softjam::scene::{Minimizer, Scene};
use softjam::state::Packing;

const KINDS: [Kind; 2] = [Kind::RoundedPolygon, Kind::WetFoam];

fn finishing(model: Kind, scene: Scene) -> Scene {
    Scene {
        model,
        minimizer: Minimizer::FireNewton,
        threshold: 1e-12,
        ..scene
    }
}

/// Moves one coordinate.
fn nudged(packing: &Packing, coordinate: usize, by: f64) -> Packing {
    let mut positions = packing.positions().to_vec();
    let shift = if coordinate.is_multiple_of(2) {
        Vec2::new(by, 0.0)
    } else {
        Vec2::new(0.0, by)
    };
    let x = &mut positions[coordinate / 2];
    *x = packing.domain().wrap(*x + shift);
    Packing::new(packing.domain(), packing.radii().to_vec(), positions).unwrap()
}

/// The Hessian of the energy by central differences of the net forces, droplets solved for anew at each displacement.
fn hessian(run: &Relaxation) -> DMatrix<f64> {
    const STEP: f64 = 1e-6;
    let n = 2 * run.packing().len();
    let mut hessian = DMatrix::zeros(n, n);
    for k in 0..n {
        let [ahead, behind] = [STEP, -STEP].map(|by| {
            let packing = nudged(run.packing(), k, by);
            let mut model = run.model().clone();
            model.solve(&packing, Goal::EXACT).unwrap();
            model.net_forces().to_vec()
        });
        for (i, (a, b)) in ahead.iter().zip(&behind).enumerate() {
            let slope = (a - b) / (2.0 * STEP);
            hessian[(2 * i, k)] = -slope.x;
            hessian[(2 * i + 1, k)] = -slope.y;
        }
    }
    let asymmetry = (&hessian - hessian.transpose()).amax();
    assert!(asymmetry < 1e-5 * hessian.amax(), "{asymmetry:e}");
    0.5 * (&hessian + hessian.transpose())
}

/// The lowest eigenvalue, but for those of translations and rattlers.
fn lowest(run: &Relaxation) -> f64 {
    let values = hessian(run).symmetric_eigenvalues();
    let beyond = values.iter().copied().filter(|l| l.abs() > 1e-5);
    beyond.fold(f64::INFINITY, f64::min)
}

#[test]
fn newton_finishes_to_round_off_at_minima() {
    for phi in [0.86, 0.90, 0.95, 0.97] {
        for model in KINDS {
            for seed in 1..=2 {
                let mut run = Relaxation::new(&finishing(model, scene(256, phi, seed))).unwrap();
                to_its_end(&mut run);
                let at = format!("{model:?} at φ = {phi}, seed {seed}");
                assert_eq!(run.status(), Status::Converged, "{at}");
                let left = run.f_max().max(run.model().moment());
                assert!(left <= 1e-12, "{at}: {left:e}");
                assert_eq!(run.stability(), Some(Stability::Minimum), "{at}");
                let moves = run.frame().minimizer.values()[6];
                assert!((1.0..8.0).contains(&moves), "{at}: {moves} steps of Newton");
            }
        }
    }
}

#[test]
fn dense_matrices_bear_out_what_is_said_of_packings() {
    for phi in [0.85, 0.90, 0.95, 0.98] {
        for model in KINDS {
            for seed in 1..=2 {
                let mut run = Relaxation::new(&finishing(model, scene(48, phi, seed))).unwrap();
                to_its_end(&mut run);
                let at = format!("{model:?} at φ = {phi}, seed {seed}");
                assert_eq!(run.status(), Status::Converged, "{at}");
                let lowest = lowest(&run);
                println!("{at}: {:?}, {lowest:.3e}", run.stability());
                assert_eq!(run.stability(), Some(Stability::Minimum), "{at}");
                assert!(lowest > 0.0, "{at}: {lowest:e}");
            }
        }
    }
}

#[test]
fn square_lattice_of_droplets_is_a_saddle_and_is_left() {
    for model in KINDS {
        for n in [6, 8] {
            let side = 0.98 * f64::from(n);
            let packing = square(n as usize, n as usize, 0.98, Vec2::new(side, side));
            let still = Scene {
                minimizer: Minimizer::Fire,
                ..finishing(model, Scene::default())
            };
            let run = Relaxation::of_packing(&still, packing.clone()).unwrap();
            assert_eq!(run.status(), Status::Converged, "FIRE has nothing to do");
            assert_eq!(run.stability(), Some(Stability::Saddle));
            assert!(lowest(&run) < 0.0);
            let energy = run.observables().energy;
            let finishing = finishing(model, Scene::default());
            let mut run = Relaxation::of_packing(&finishing, packing).unwrap();
            assert_eq!(run.status(), Status::Running);
            to_its_end(&mut run);
            assert_eq!(run.status(), Status::Converged);
            assert_ne!(run.stability(), Some(Stability::Saddle));
            assert!(run.observables().energy < energy);
        }
    }
}

/// Positions and box shrunk to another coverage.
fn compressed(packing: &Packing, phi: f64) -> Packing {
    let share = (packing.coverage() / phi).sqrt();
    let sides = packing.domain().lengths() * share;
    let domain = Domain::new(sides.x, sides.y).unwrap();
    let positions = packing.positions().iter().map(|x| x * share).collect();
    Packing::new(domain, packing.radii().to_vec(), positions).unwrap()
}

#[test]
fn compression_to_dry_foam_converges_throughout() {
    for model in KINDS {
        for seed in [1, 2] {
            let scene = finishing(model, scene(64, 0.95, seed));
            let mut run = Relaxation::new(&scene).unwrap();
            to_its_end(&mut run);
            let mut pressure = run.observables().pressure();
            for k in 1..=8 {
                let phi = 0.95 + 0.005 * f64::from(k);
                run = Relaxation::of_packing(&scene, compressed(run.packing(), phi)).unwrap();
                to_its_end(&mut run);
                let at = format!("{model:?} at φ = {phi}, seed {seed}");
                assert_eq!(run.status(), Status::Converged, "{at}");
                assert_eq!(run.stability(), Some(Stability::Minimum), "{at}");
                let now = run.observables().pressure();
                println!("{at}: {} steps, Π = {now:.6}", run.step());
                assert!(now > pressure, "{at}: {pressure} → {now}");
                pressure = now;
            }
        }
    }
}
