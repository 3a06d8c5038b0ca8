//! The contact law: what an answer fulfils, that there is only one, and what it does not depend on.

use super::model::Model;
use crate::common::{
    Random, answer, assert_at_most, largest_difference, law, random_packing, relaxed_disks, scene,
    solved,
};
use proptest::prop_assert;
use proptest::test_runner::{Config, RngSeed, TestCaseError, TestRunner};
use softjam::domain::{Domain, Vec2};
use softjam::models::droplet::contact::solver::Method;
use softjam::models::droplet::contact::{ContactError, ContactLaw, Rule};
use softjam::protocol::Relaxation;
use softjam::state::Packing;
use std::cell::Cell;

/// Packings for the uniqueness and the invariances: before, at and far from balance.
fn packings() -> Vec<Packing> {
    let mut random = Random::new(21);
    let mut list: Vec<Packing> = [(0.86, 1), (0.9, 2), (1.0, 3)]
        .map(|(phi, seed)| relaxed_disks(90, phi, seed))
        .into();
    for (phi, ratio, steps) in [(0.85, 1.4, 12), (0.95, 2.0, 40), (1.05, 1.4, 80)] {
        list.push(random_packing(&mut random, 90, phi, ratio, steps));
    }
    list
}

/// Whether two disks overlap by more than the radius of one of them.
fn nested(packing: &Packing) -> bool {
    let (radii, positions) = (packing.radii(), packing.positions());
    (0..packing.len()).any(|i| {
        (0..i).any(|j| {
            let separation = packing.domain().minimum_image(positions[i] - positions[j]);
            separation.norm() < radii[i].max(radii[j])
        })
    })
}

#[test]
fn forces_and_gaps_are_never_negative_and_never_both_positive() {
    let config = Config {
        cases: 60,
        // A refused packing does not count: 60 are solved, or the test fails.
        max_global_rejects: 600,
        failure_persistence: None,
        // The same cases every time; the stress program has more.
        rng_seed: RngSeed::Fixed(1),
        ..Config::default()
    };
    let cases = (
        0..u64::MAX,
        20..=80usize,
        0.80..1.1f64,
        1.0..5.0f64,
        0..60u64,
    );
    let (at_contacts, elsewhere) = (Cell::new(0.0f64), Cell::new(f64::MIN));
    let (refused, diverged) = (Cell::new(0), Cell::new(0));
    TestRunner::new(config)
        .run(&cases, |(seed, particles, phi, ratio, steps)| {
            let packing = random_packing(&mut Random::new(seed), particles, phi, ratio, steps);
            let mut law = ContactLaw::default();
            match law.solve(&packing, &[], &[]) {
                Err(ContactError::BoxTooSmall { .. }) => {
                    refused.set(refused.get() + 1);
                    return Err(TestCaseError::reject("box too small"));
                }
                // Forces may diverge only of a start in which disks lie in each other.
                Err(ContactError::Diverged { .. }) if nested(&packing) => {
                    diverged.set(diverged.get() + 1);
                    return Err(TestCaseError::reject("disks lie in each other"));
                }
                Err(error) => return Err(TestCaseError::fail(error.to_string())),
                Ok(()) => {}
            }
            let contacts = law.contacts();
            let overlaps = contacts.overlaps.iter();
            let scale = overlaps.fold(f64::MIN_POSITIVE, |m, d| m.max(d.abs()));
            let tolerance = law.accepted_residual() * scale;
            let model = Model::new(&packing, contacts.pairs, contacts.forces, 1.0);
            let pulling = contacts.forces.iter().find(|f| **f < 0.0);
            prop_assert!(pulling.is_none(), "force {pulling:?}");
            let (gap, overlap) = (
                model.largest_gap_at_contacts(),
                -model.smallest_gap_elsewhere(),
            );
            at_contacts.set(at_contacts.get().max(gap / scale));
            elsewhere.set(elsewhere.get().max(overlap / scale));
            prop_assert!(gap <= tolerance, "gap {gap:e} at a contact");
            prop_assert!(overlap <= tolerance, "overlap {overlap:e} elsewhere");
            Ok(())
        })
        .unwrap();
    println!("{} packings in too small a box", refused.get());
    assert!(diverged.get() <= 3, "{} diverged", diverged.get());
    assert_at_most(
        "gap at a contact over the largest overlap",
        at_contacts.get(),
        1.6e-11,
    );
    assert_at_most(
        "overlap elsewhere over the largest overlap",
        elsewhere.get(),
        1.6e-11,
    );
}

/// Contacts with forces to start from: a part of the near pairs, much more than the near pairs, or any pairs at all.
fn wrong_guess(packing: &Packing, kind: usize, random: &mut Random) -> (Vec<[u32; 2]>, Vec<f64>) {
    let n = packing.len() as u32;
    let mut pairs: Vec<[u32; 2]> = (0..n)
        .flat_map(|i| (i + 1..n).map(move |j| [i, j]))
        .collect();
    pairs.retain(|&[i, j]| {
        let (i, j) = (i as usize, j as usize);
        let distance = packing.separation(i, j).norm();
        let surface = distance - packing.radii()[i] - packing.radii()[j];
        match kind % 3 {
            0 => surface < 0.0 && random.below(3) > 0,
            1 => surface < 0.3 && random.below(5) > 0,
            _ => random.below(40) == 0,
        }
    });
    let forces = pairs.iter().map(|_| random.within(-1.0, 3.0)).collect();
    (pairs, forces)
}

#[test]
fn answer_does_not_depend_on_the_first_guess() {
    let mut random = Random::new(77);
    let mut worst: f64 = 0.0;
    for packing in packings() {
        let expected = answer(&solved(&packing));
        for attempt in 0..24 {
            let (pairs, forces) = wrong_guess(&packing, attempt, &mut random);
            let mut law = ContactLaw::default();
            law.solve(&packing, &pairs, &forces).unwrap();
            worst = worst.max(largest_difference(&answer(&law), &expected));
        }
    }
    assert_at_most("force from another guess, difference", worst, 1e-10);
}

/// The largest difference of two lists of forces; a contact that one of them lacks has no force there.
fn difference_with_absent(a: &[([u32; 2], f64)], b: &[([u32; 2], f64)]) -> f64 {
    let force = |list: &[([u32; 2], f64)], pair| {
        list.binary_search_by_key(&pair, |c| c.0)
            .map_or(0.0, |k| list[k].1)
    };
    let pairs = a.iter().chain(b).map(|c| c.0);
    pairs.fold(0.0, |m: f64, pair| {
        m.max((force(a, pair) - force(b, pair)).abs())
    })
}

#[test]
fn answer_from_the_step_before_is_the_answer_from_nothing() {
    let mut worst: f64 = 0.0;
    let mut of_promise: f64 = 0.0;
    for (phi, seed) in [(0.86, 4), (0.92, 5)] {
        let mut run = Relaxation::new(&scene(80, phi, seed)).unwrap();
        for _ in 0..200 {
            let before = run.frame();
            run.advance().unwrap();
            let cold = solved(run.packing());
            let mut warm = ContactLaw::default();
            warm.solve(run.packing(), &before.contacts, &before.forces)
                .unwrap();
            worst = worst.max(largest_difference(&answer(&warm), &answer(&cold)));
            // The run itself solves no more exactly than its frame promises.
            let strongest = cold.contacts().forces.iter().copied().fold(0.0, f64::max);
            let difference = difference_with_absent(&answer(run.law().unwrap()), &answer(&cold));
            of_promise = of_promise.max(difference / strongest / run.promised_residual());
        }
    }
    assert_at_most("force from the step before, difference", worst, 1e-10);
    assert_at_most(
        "force of the run over its promise, difference",
        of_promise,
        8.0,
    );
}

#[test]
fn saitoh_rule_repeated_at_fixed_positions_ends_at_the_contact_law() {
    let mut random = Random::new(78);
    let mut worst: f64 = 0.0;
    let mut most = 0;
    for packing in packings() {
        let expected = answer(&solved(&packing));
        let mut guesses = vec![(Vec::new(), Vec::new())];
        guesses.extend((0..12).map(|k| wrong_guess(&packing, k % 2, &mut random)));
        for (pairs, forces) in guesses {
            let mut seed = law(Rule::Saitoh, Method::ConjugateGradient);
            seed.solve(&packing, &pairs, &forces).unwrap();
            let mut repeats = 0;
            while seed.residual() > seed.accepted_residual() {
                seed.solve_again(&packing).unwrap();
                repeats += 1;
                assert!(repeats < 100, "no end after {repeats} repeats");
            }
            most = most.max(repeats);
            worst = worst.max(largest_difference(&answer(&seed), &expected));
        }
    }
    println!("at most {most} repeats");
    assert_at_most("force by Saitoh's rule, difference", worst, 1e-10);
}

/// The same contact problem on packings that are one and the same to physics: positions by `place`, particles by `name`.
fn assert_invariant(
    what: &str,
    packing: &Packing,
    domain: Domain,
    place: impl Fn(Vec2) -> Vec2,
    name: impl Fn(usize) -> usize,
) {
    let n = packing.len();
    let (mut radii, mut positions) = (vec![0.0; n], vec![Vec2::zeros(); n]);
    for p in 0..n {
        radii[name(p)] = packing.radii()[p];
        positions[name(p)] = place(packing.positions()[p]);
    }
    let image = Packing::new(domain, radii, positions).unwrap();
    let mut expected: Vec<([u32; 2], f64)> = answer(&solved(packing))
        .into_iter()
        .map(|([i, j], f)| {
            let (i, j) = (name(i as usize) as u32, name(j as usize) as u32);
            ([i.min(j), i.max(j)], f)
        })
        .collect();
    expected.sort_by_key(|c| c.0);
    let worst = largest_difference(&answer(&solved(&image)), &expected);
    assert_at_most(&format!("{what}: force, difference"), worst, 1e-11);
}

#[test]
fn contact_problem_is_the_same_after_a_translation_across_the_box_edge() {
    for packing in packings() {
        let shift = packing
            .domain()
            .lengths()
            .component_mul(&Vec2::new(0.37, 0.71));
        assert_invariant(
            "translation",
            &packing,
            packing.domain(),
            |p| p + shift,
            |k| k,
        );
    }
}

#[test]
fn contact_problem_is_the_same_after_a_quarter_turn_and_a_reflection() {
    for packing in packings() {
        let sides = packing.domain().lengths();
        let turned = Domain::new(sides.y, sides.x).unwrap();
        assert_invariant(
            "quarter turn",
            &packing,
            turned,
            |p| Vec2::new(sides.y - p.y, p.x),
            |k| k,
        );
        let mirror = |p: Vec2| Vec2::new(sides.x - p.x, p.y);
        assert_invariant("reflection", &packing, packing.domain(), mirror, |k| k);
    }
}

#[test]
fn contact_problem_is_the_same_under_other_particle_numbers() {
    let mut random = Random::new(4);
    for packing in packings() {
        let mut names: Vec<usize> = (0..packing.len()).collect();
        random.shuffle(&mut names);
        assert_invariant(
            "relabelling",
            &packing,
            packing.domain(),
            |p| p,
            |k| names[k],
        );
    }
}

#[test]
fn forces_scale_with_the_line_tension_and_not_with_the_unit_of_length() {
    for packing in packings() {
        let one = answer(&solved(&packing));
        let sides = packing.domain().lengths() * 3.0;
        let tripled = Packing::new(
            Domain::new(sides.x, sides.y).unwrap(),
            packing.radii().iter().map(|r| 3.0 * r).collect(),
            packing.positions().iter().map(|p| p * 3.0).collect(),
        )
        .unwrap();
        let difference = largest_difference(&answer(&solved(&tripled)), &one);
        assert_at_most("unit of length: force, difference", difference, 1e-11);
        let mut tense =
            ContactLaw::new(Rule::Complementarity, Method::ConjugateGradient, 2.5, 1e-12);
        tense.solve(&packing, &[], &[]).unwrap();
        let scaled: Vec<_> = answer(&tense)
            .into_iter()
            .map(|(p, f)| (p, f / 2.5))
            .collect();
        assert_at_most(
            "line tension: force, difference",
            largest_difference(&scaled, &one),
            1e-11,
        );
    }
}

/// Two particles at x = 0.5 and x = 8.0 of a box of the given side.
fn two_across_the_edge(radius: f64, side: f64) -> Packing {
    let centres = vec![Vec2::new(0.5, 4.0), Vec2::new(8.0, 4.0)];
    Packing::new(Domain::new(side, 9.0).unwrap(), vec![radius; 2], centres).unwrap()
}

#[test]
fn law_that_has_seen_other_radii_gives_the_answer_of_a_new_one() {
    let mut law = solved(&two_across_the_edge(0.5, 9.0));
    let grown = two_across_the_edge(0.8, 9.0);
    law.solve(&grown, &[], &[]).unwrap();
    assert_eq!(
        answer(&law),
        answer(&solved(&grown)),
        "δ = 0.1 at the same centres"
    );
}

#[test]
fn law_that_has_seen_another_box_gives_the_answer_of_a_new_one() {
    let mut law = solved(&two_across_the_edge(0.5, 9.0));
    let narrowed = two_across_the_edge(0.5, 8.4);
    law.solve(&narrowed, &[], &[]).unwrap();
    assert_eq!(
        answer(&law),
        answer(&solved(&narrowed)),
        "δ = 0.1 at the same centres"
    );
}
