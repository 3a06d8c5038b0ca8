//! Minimum or saddle: what the run says of its end, against all eigenvalues of a dense matrix.

use super::stress::stiffness::Spectrum;
use crate::common::scene;
use softjam::analysis::Stability;
use softjam::domain::{Domain, Vec2};
use softjam::models::droplet::Form;
use softjam::protocol::{Relaxation, Status};
use softjam::scene::{Minimizer, Scene};
use softjam::state::Packing;

pub fn to_its_end(run: &mut Relaxation) {
    while run.status() == Status::Running {
        run.advance().unwrap();
    }
}

/// Runs to balance and asserts that what the run says of it is what the eigenvalues say.
fn judged(scene: &Scene) -> Stability {
    let mut run = Relaxation::new(scene).unwrap();
    to_its_end(&mut run);
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
pub fn square(columns: usize, rows: usize, a: f64, sides: Vec2) -> Packing {
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
            to_its_end(&mut run);
            assert_eq!(run.status(), Status::Converged);
            let stability = assert_judged_right(&run, &scene);
            assert_ne!(stability, Stability::Saddle);
            let energy = run.observables().energy;
            println!("U = {saddle:.6e} → {energy:.6e} in {} steps", run.step());
            assert!(energy < saddle);
        }
    }
}

/// A hexagonal crystal with four vacancies around one particle, which its neighbours left and right hold between them: it is a strut that buckles.
/// One mode of a few particles among thousands.
fn strut(columns: usize, rows: usize, a: f64) -> Packing {
    let height = a * 3f64.sqrt() / 2.0;
    let (i0, j0) = (columns / 2, rows / 2 / 2 * 2);
    let place = |i: usize, j: usize| {
        let shifted = i as f64 + 0.5 * (j % 2) as f64 + 0.25;
        Vec2::new(shifted * a, (j as f64 + 0.5) * height)
    };
    let vacant = |i: usize, j: usize| j.abs_diff(j0) == 1 && (i == i0 || i + 1 == i0);
    let positions: Vec<Vec2> = (0..rows)
        .flat_map(|j| (0..columns).map(move |i| (i, j)))
        .filter(|&(i, j)| !vacant(i, j))
        .map(|(i, j)| place(i, j))
        .collect();
    let domain = Domain::new(columns as f64 * a, rows as f64 * height).unwrap();
    Packing::new(domain, vec![0.5; positions.len()], positions).unwrap()
}

/// Relaxed by forces alone the strut stands by symmetry; a nudge shows that it lay higher.
#[test]
fn a_buckling_strut_among_thousands_of_particles_is_seen() {
    for (columns, rows) in [(8, 8), (36, 36), (40, 40)] {
        for forces in [Form::Central, Form::Gradient] {
            let scene = Scene {
                forces,
                steps: 20_000,
                ..Scene::default()
            };
            let run = |minimizer, packing: &Packing| {
                let scene = Scene {
                    minimizer,
                    ..scene.clone()
                };
                let mut run = Relaxation::of_packing(&scene, packing.clone()).unwrap();
                to_its_end(&mut run);
                assert_eq!(run.status(), Status::Converged);
                run
            };
            let run = run(Minimizer::FireNewton, &strut(columns, rows, 0.96));
            assert_eq!(run.stability(), Some(Stability::Minimum));
            let end = run.observables().energy;
            // By hand out of the mirror plane, FIRE to the bottom.
            let positions = run.packing().positions().iter().enumerate();
            let nudge = |(k, x): (usize, &Vec2)| x + Vec2::new(0.0, 1e-5 * (k as f64 * 1.7).sin());
            let nudged = Packing::new(
                run.packing().domain(),
                run.packing().radii().to_vec(),
                positions.map(nudge).collect(),
            )
            .unwrap();
            let mut again = Relaxation::of_packing(&scene, nudged).unwrap();
            to_its_end(&mut again);
            let shaken = again.observables().energy;
            println!("{columns} × {rows}: U = {end:.9}, shaken {shaken:.9}");
            assert!(
                (shaken - end).abs() < 1e-6 * end,
                "{columns} × {rows}, {forces:?}"
            );
        }
    }
}
