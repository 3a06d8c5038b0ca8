//! What is not needed is not computed: counts of work, not of seconds.

use crate::common::{Folder, assert_at_most, converged, scene};
use softjam::analysis::Backbone;
use softjam::models::droplet::contact::solver::Method;
use softjam::models::droplet::contact::{ContactLaw, Work};
use softjam::protocol::{Relaxation, Status};
use softjam::scene::{Preparation, Scene, Start};
use softjam::state::Packing;
use std::f64::consts::PI;
use std::fmt::Write as _;

/// Works off a run; `seen` is told the step's work and whether the contacts are those of the step before.
fn walk(scene: &Scene, mut seen: impl FnMut(&Relaxation, Work, bool)) -> Relaxation {
    let mut run = Relaxation::new(scene).unwrap();
    while run.status() == Status::Running {
        let (before, pairs) = (run.law().unwrap().work(), run.contacts().pairs.to_vec());
        run.advance().unwrap();
        let after = run.law().unwrap().work();
        let step = Work {
            solves: after.solves - before.solves,
            sweeps: after.sweeps - before.sweeps,
            iterations: after.iterations - before.iterations,
            local_updates: after.local_updates - before.local_updates,
            local_iterations: after.local_iterations - before.local_iterations,
            assemblies: after.assemblies - before.assemblies,
            singles: after.singles - before.singles,
            structures: after.structures - before.structures,
            symbolic: after.symbolic - before.symbolic,
            distances: after.distances - before.distances,
            gaps: after.gaps - before.gaps,
            neighbor_lists: after.neighbor_lists - before.neighbor_lists,
        };
        seen(&run, step, pairs == run.contacts().pairs);
    }
    run
}

#[test]
fn entries_in_double_precision_are_made_near_balance() {
    // Far from balance, where FIRE alone is left to finish, and near the end.
    let (mut steps, mut made) = ([0u64; 3], [0; 3]);
    walk(&scene(256, 0.86, 2), |run, work, same| {
        let place = match run.f_max() {
            f if f > 1e-3 => 0,
            f if f > 1e-8 => 1,
            _ => 2,
        };
        // An exchange of many contacts at once is solved for again.
        if same || place == 2 {
            steps[place] += 1;
            made[place] += work.assemblies - work.singles;
        }
    });
    println!("made in {made:?} of {steps:?} steps");
    assert!(steps[0] > 50 && steps[1] > 200 && steps[2] > 50);
    assert!(100 * made[0] <= steps[0], "far from balance");
    assert!(made[2] >= steps[2], "near balance");
}

#[test]
fn contacts_come_and_go_without_a_new_structure() {
    let (mut exchanges, mut tightened) = (0u64, 0);
    let run = walk(&scene(256, 0.86, 2), |_, work, same| {
        assert_eq!(work.solves, 1);
        assert!(
            (1..=1 + work.structures).contains(&work.assemblies),
            "positions are taken over once a step, and again for a structure that is built at them"
        );
        if !same {
            exchanges += 1;
            assert!(
                work.sweeps + work.local_updates >= 2,
                "an exchange is followed by a solution"
            );
        }
        tightened += u64::from(same && work.sweeps > 1);
    });
    let structures = run.law().unwrap().work().structures;
    println!(
        "{structures} structures for {exchanges} exchanges in {} steps, {tightened} solved on",
        run.step()
    );
    assert!(exchanges > 50, "contacts do come and go");
    assert!(
        10 * structures < exchanges,
        "{structures} structures for {exchanges} exchanges"
    );
}

#[test]
fn few_exchanges_are_solved_for_in_a_local_update_and_keep_the_promise() {
    let (mut updates, mut sweeps, mut steps) = (0, 0, 0);
    let scene = Scene {
        threshold: 1e-6,
        ..scene(1024, 0.86, 2)
    };
    let run = walk(&scene, |run, work, _| {
        updates += work.local_updates;
        sweeps += work.sweeps;
        steps += 1;
        if work.local_updates > 0 {
            // Taken up from the frame, the residual of all contacts and all gaps is measured anew.
            let again = Relaxation::resume(&scene, run.packing().clone(), run.frame()).unwrap();
            assert!(again.law().unwrap().residual() <= run.promised_residual());
            // What the local update claims is an upper bound, but for round-off.
            assert!(again.law().unwrap().residual() <= run.law().unwrap().residual() + 1e-12);
        }
    });
    println!("{updates} updates, {sweeps} sweeps in {steps} steps");
    assert!(10 * updates > steps, "exchanges are local updates");
    assert!(10 * sweeps < 11 * steps, "and hardly ever solved for anew");
    // Measured: 2 to 3 iterations a local update.
    let iterations = run.law().unwrap().work().local_iterations;
    assert!(iterations < 6 * updates, "{iterations} in {updates}");
}

#[test]
fn forces_far_from_balance_take_few_iterations() {
    // Measured: 4.6 to 5.6 a step; 20 to 40 with the full tolerance.
    for (particles, phi) in [(256, 0.86), (256, 0.95), (1024, 0.86)] {
        let (mut iterations, mut steps) = (0u64, 0u32);
        let scene = Scene {
            threshold: 1e-5,
            ..scene(particles, phi, 1)
        };
        walk(&scene, |_, work, _| {
            iterations += work.iterations;
            steps += 1;
        });
        assert_at_most(
            &format!("N = {particles}, phi {phi}: iterations a step"),
            iterations as f64 / f64::from(steps),
            7.0,
        );
    }
}

#[test]
fn frames_keep_the_residual_that_they_promise_and_the_last_the_full_tolerance() {
    for (phi, seed) in [(0.845, 3), (0.9, 4), (1.0, 5)] {
        let mut loose = 0;
        let run = walk(&scene(128, phi, seed), |run, _, _| {
            assert!(run.law().unwrap().residual() <= run.promised_residual());
            loose +=
                u64::from(run.law().unwrap().residual() > run.law().unwrap().accepted_residual());
        });
        assert_eq!(run.status(), Status::Converged);
        assert!(run.law().unwrap().residual() <= 1.6e-11);
        assert!(loose > run.step() / 2, "{loose} of {} frames", run.step());
    }
}

/// The pairs whose bulges could bridge the distance between them, by `factor` times the bound `R (0.640 76 Σ f)/2π` of each
/// bulge.
fn pairs_in_reach(packing: &Packing, law: &ContactLaw, factor: f64) -> u64 {
    let mut reach = packing.radii().to_vec();
    for (&[i, j], f) in law.contacts().pairs.iter().zip(law.contacts().forces) {
        for p in [i as usize, j as usize] {
            reach[p] += factor * packing.radii()[p] * 0.640_76 * f / (2.0 * PI);
        }
    }
    let n = packing.len();
    let near = |i: usize, j: usize| packing.separation(i, j).norm() < reach[i] + reach[j];
    let pairs = (0..n).flat_map(|i| (i + 1..n).map(move |j| (i, j)));
    pairs.filter(|&(i, j)| near(i, j)).count() as u64
}

#[test]
fn gaps_are_computed_of_pairs_that_could_touch_and_of_no_other() {
    for (phi, seed) in [(0.86, 1), (0.95, 2)] {
        let run = converged(&scene(256, phi, seed));
        let mut law = run.law().unwrap().clone();
        let before = law.work();
        law.solve_again(run.packing()).unwrap();
        let work = law.work();
        assert_eq!(work.sweeps - before.sweeps, 1);
        assert_eq!(work.iterations, before.iterations, "the answer is known");
        let contacts = law.contacts().pairs.len() as u64;
        // The bounds that are kept are wider than they would have to be, by no more than the forces grew since.
        let looked_at = work.gaps - before.gaps + contacts;
        let [least, most] = [1.0, 1.3].map(|k| pairs_in_reach(run.packing(), &law, k));
        assert!(
            (least..=most).contains(&looked_at),
            "{looked_at} pairs, {least} to {most} in reach"
        );
        // Distances only of what the neighbour list holds besides: about one a particle.
        let distances = (work.distances - before.distances) as f64 / 256.0;
        assert_at_most(&format!("phi {phi}: distances a particle"), distances, 2.0);
    }
}

#[test]
fn neighbour_list_serves_many_steps() {
    let run = converged(&scene(256, 0.86, 3));
    let lists = run.law().unwrap().work().neighbor_lists;
    println!("{lists} lists in {} steps", run.step());
    assert!(
        100 * lists <= run.step(),
        "{lists} lists in {} steps",
        run.step()
    );
}

#[test]
fn symbolic_factorisation_is_made_by_the_cholesky_alone_and_once_a_structure() {
    for contact_solver in [Method::ConjugateGradient, Method::SparseCholesky] {
        let run = converged(&Scene {
            contact_solver,
            ..scene(64, 0.9, 1)
        });
        let work = run.law().unwrap().work();
        match contact_solver {
            Method::SparseCholesky => {
                assert!(work.symbolic > 0 && work.symbolic <= work.structures);
                assert!(work.structures < work.sweeps);
            }
            _ => assert_eq!(work.symbolic, 0),
        }
    }
}

#[test]
fn run_that_starts_from_a_file_or_a_frame_relaxes_no_disks() {
    let first = converged(&scene(48, 0.9, 1));
    let folder = Folder::new();
    let l = first.packing().domain().lengths();
    let mut text = format!("# box = {}, {}\nx,y,radius\n", l.x, l.y);
    for (p, radius) in first
        .packing()
        .positions()
        .iter()
        .zip(first.packing().radii())
    {
        writeln!(text, "{},{},{radius}", p.x, p.y).unwrap();
    }
    let path = folder.path().join("start.csv");
    std::fs::write(&path, text).unwrap();
    let from_file = Relaxation::new(&Scene {
        start: Start::File {
            path: path.to_str().unwrap().to_owned(),
            blake3: None,
            preparation: Preparation::AsItStands,
        },
        ..Scene::default()
    })
    .unwrap();
    assert_eq!(from_file.disks(), None);
    assert_eq!(from_file.status(), Status::Converged, "nothing was moved");
    let resumed =
        Relaxation::resume(&scene(48, 0.9, 1), first.packing().clone(), first.frame()).unwrap();
    assert_eq!(resumed.disks(), None);
    let work = resumed.law().unwrap().work();
    assert_eq!(
        (work.solves, work.iterations),
        (0, 0),
        "the forces are in the frame"
    );
}

#[test]
fn rattlers_are_counted_again_only_when_contacts_change_that_matter() {
    let mut run = Relaxation::new(&scene(64, 0.86, 1)).expect("a packing");
    let mut backbone = Backbone::default();
    let (mut changes, mut last) = (0, None);
    while run.status() == Status::Running {
        let contacts = run.contacts();
        assert!(contacts.forces.iter().all(|f| *f > 0.0));
        changes += u64::from(last.as_deref() != Some(contacts.pairs));
        last = Some(contacts.pairs.to_vec());
        let o = run.observables_counted(&mut backbone);
        // Independently: rattlers are taken away one at a time, in whatever order.
        assert_eq!(
            (o.rattlers, o.backbone_contacts),
            peeled(o.particles, contacts.pairs)
        );
        run.advance().expect("a step");
    }
    // Most changes leave what is held as it is.
    assert!(2 * backbone.counts() < changes, "{}", backbone.counts());
    assert!(4 * changes < run.step(), "{changes} changes");
}

/// Rattlers and the contacts left between the others, by the definition.
fn peeled(particles: usize, pairs: &[[u32; 2]]) -> (usize, usize) {
    let mut left = pairs.to_vec();
    let mut alive = vec![true; particles];
    let of = |left: &[[u32; 2]], k: usize| left.iter().filter(|p| p.contains(&(k as u32))).count();
    while let Some(k) = (0..particles).rev().find(|&k| alive[k] && of(&left, k) < 3) {
        alive[k] = false;
        left.retain(|p| !p.contains(&(k as u32)));
    }
    (alive.iter().filter(|a| !**a).count(), left.len())
}
