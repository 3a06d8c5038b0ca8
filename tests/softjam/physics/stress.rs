//! A fast part of the stress program (`benches/stress`): every case ends converged, at its step limit or with a named
//! reason, and what it says is true by formulas that the solver does not share.

#[path = "../../../benches/stress/families.rs"]
mod families;
#[path = "../../../benches/stress/hand_made.rs"]
mod hand_made;
#[path = "../../../benches/stress/outcome.rs"]
mod outcome;
#[path = "../../../benches/stress/random.rs"]
mod random;
#[path = "../../../benches/stress/stiffness.rs"]
pub mod stiffness;
#[path = "../../../benches/stress/verify.rs"]
mod verify;

use crate::common::Random;
use families::Case;
use softjam::analysis::Stability;
use softjam::domain::{Domain, Vec2};
use softjam::models::droplet::Form;
use softjam::models::droplet::contact::{ContactError, ContactLaw};
use softjam::protocol::relax_disks;
use softjam::scene::DiskParameters;
use softjam::scene::Scene;
use softjam::state::Packing;
use verify::Answer;

/// The cases of a family.
fn family(name: &str) -> Vec<Case> {
    let family = families::all()
        .into_iter()
        .find(|f| f.name == name)
        .unwrap();
    println!("{}", family.what);
    (family.cases)()
}

/// Runs all cases; counts those that converged, fails at the first wrong one.
#[track_caller]
fn converged(cases: impl IntoIterator<Item = Case>) -> (usize, usize) {
    let (converged, all, _) = judged(cases);
    (converged, all)
}

/// [`converged`], and how many are a minimum or a saddle, as all eigenvalues say.
#[track_caller]
fn judged(cases: impl IntoIterator<Item = Case>) -> (usize, usize, usize) {
    let (mut converged, mut all, mut judged) = (0, 0, 0);
    for (name, case) in cases {
        let outcome = case();
        assert!(outcome.wrong.is_none(), "{name}: {outcome:?}");
        all += 1;
        converged += usize::from(outcome.end == "converged");
        let told = [Some(Stability::Minimum), Some(Stability::Saddle)];
        judged += usize::from(told.contains(&outcome.stability));
        let squeeze = outcome.check.map_or(0.0, |c| c.squeeze);
        println!(
            "{name}: {} after {} steps, squeeze {squeeze:.3} {}",
            outcome.end, outcome.steps, outcome.message
        );
    }
    (converged, all, judged)
}

#[test]
fn random_packings_of_all_coverages_and_size_ratios_converge() {
    // The two that a bound of the bulges alone would refuse are among them.
    let some = family("random")
        .into_iter()
        .enumerate()
        .filter(|(k, _)| k % 4 == 0 || *k == 29 || *k == 287);
    let (converged, all, judged) = judged(some.map(|c| c.1));
    assert_eq!((converged, all), (252, 252));
    assert!(judged > 100, "{judged} are jammed");
}

#[test]
fn a_box_is_too_small_only_where_a_second_image_touches() {
    let (converged, all) = converged(family("tight box"));
    println!("{converged} of {all} fit");
    assert!(converged > 150 && all - converged > 50);
}

#[test]
fn in_strips_and_around_intruders_no_second_image_is_missed() {
    let mut random = Random::new(17);
    let (mut converged, mut refused, mut later) = (0, 0, 0);
    for case in 0..300 {
        // Strips as high as two to five radii, and squares half as wide as their intruder.
        let strip = case % 2 == 0;
        let (sides, count) = if strip {
            ([9.0, random.within(1.0, 2.6)], 9)
        } else {
            let side = random.within(5.0, 8.0);
            ([side, side], 12)
        };
        let mut radii = vec![0.5; count];
        if !strip {
            radii[0] = 2.0;
        }
        let points = (0..count)
            .map(|_| Vec2::new(random.within(0.0, sides[0]), random.within(0.0, sides[1])))
            .collect();
        let domain = Domain::new(sides[0], sides[1]).unwrap();
        let mut packing = Packing::new(domain, radii, points).unwrap();
        let parameters = DiskParameters {
            steps: 40,
            ..DiskParameters::default()
        };
        relax_disks(&mut packing, &parameters, 1.0).unwrap();
        let outcome = outcome::of_packing(&Scene::default(), &packing);
        assert!(outcome.wrong.is_none(), "{case}: {outcome:?}");
        let too_small = outcome.end == "box too small";
        converged += u32::from(outcome.end == "converged");
        refused += u32::from(too_small);
        later += u32::from(too_small && outcome.steps > 0);
    }
    println!("{converged} converged, {refused} refused, {later} of them on their way");
    assert!(converged > 100 && refused > 20 && later > 3);
}

#[test]
fn nearly_equal_angles_thresholds_and_lattices_all_converge() {
    for name in ["same angle", "threshold", "lattice"] {
        let (converged, all) = converged(family(name));
        assert_eq!(converged, all, "{name}");
    }
}

#[test]
fn coincident_centres_converge_or_their_forces_diverge() {
    let (converged, all) = converged(family("coincident"));
    assert!(converged + 6 >= all, "{converged} of {all}");
}

#[test]
fn coincident_centres_do_not_spoil_the_gradient_form() {
    // A contact without a direction cannot turn; its torque over its length was NaN.
    let at = |x: f64, y: f64| Vec2::new(x, y);
    let points = vec![at(4.0, 4.0), at(4.9, 4.0), at(4.9, 4.0), at(4.0, 4.9)];
    let packing = Packing::new(Domain::new(9.0, 9.0).unwrap(), vec![0.5; 4], points).unwrap();
    let scene = Scene {
        forces: Form::Gradient,
        ..Scene::default()
    };
    let outcome = outcome::of_packing(&scene, &packing);
    assert!(outcome.wrong.is_none(), "{outcome:?}");
    assert_eq!(outcome.end, "converged");
}

#[test]
fn two_three_and_five_particles_converge_or_are_refused_for_their_box() {
    let (converged, _) = converged(family("few"));
    assert!(converged >= 200);
}

#[test]
fn both_sides_of_jamming_converge() {
    assert_eq!(converged(families::jamming_of(64, 1)), (3, 3));
}

#[test]
fn fields_at_the_ends_of_their_ranges_end_well_or_say_why_not() {
    // The slow ones are left to the program.
    let quick = |name: &str| !name.contains("20000") && !name.contains("1e-6, fraction = 0.5");
    let (_, all) = converged(family("extremes").into_iter().filter(|c| quick(&c.0)));
    assert!(all > 40, "{all}");
}

#[test]
fn second_images_are_found_beyond_the_bound_of_the_bulges() {
    // Two particles in a box of 2.1 × 6: each touches the other on both sides, and neither reaches a quarter of 6.
    let at = |x: f64, y: f64| Vec2::new(x, y);
    let packing = |side: f64, second: Vec2| {
        let domain = Domain::new(side, 6.0).unwrap();
        Packing::new(domain, vec![0.6; 2], vec![at(0.3, 3.0), second]).unwrap()
    };
    let mut law = ContactLaw::default();
    let error = law
        .solve(&packing(2.1, at(1.35, 3.0)), &[], &[])
        .unwrap_err();
    let ContactError::BoxTooSmall {
        particle, other, ..
    } = error
    else {
        panic!("{error}");
    };
    assert_eq!((particle, other), (0, 1));
    // A little wider they touch on one side alone, though both reach more than a quarter of the side.
    for side in [2.3, 2.32] {
        let packing = packing(side, at(1.35, 3.0));
        law.solve(&packing, &[], &[]).unwrap();
        let contacts = law.contacts();
        let answer = Answer {
            sides: [side, 6.0],
            radii: packing.radii(),
            centres: &[[0.3, 3.0], [1.35, 3.0]],
            pairs: contacts.pairs,
            forces: contacts.forces,
            line_tension: 1.0,
            gradient: false,
        };
        let check = answer.check();
        assert!(check.second_image == 0.0 && check.law < 1e-13 && check.finite);
    }
    // One particle that is wider than its box touches itself.
    let alone = Packing::new(
        Domain::new(1.0, 6.0).unwrap(),
        vec![0.6],
        vec![at(0.5, 3.0)],
    )
    .unwrap();
    let error = law.solve(&alone, &[], &[]).unwrap_err();
    assert!(
        matches!(
            error,
            ContactError::BoxTooSmall {
                particle: 0,
                other: 0,
                ..
            }
        ),
        "{error}"
    );
}
