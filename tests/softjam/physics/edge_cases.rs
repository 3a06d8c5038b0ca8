//! The edges of what can be asked: one particle, no contact, centres on one point, neighbours in one direction; and
//! the first digits of a seed.

use crate::common::fire;
use crate::common::{Random, monodisperse, scene};
use softjam::domain::{Domain, Vec2};
use softjam::models::droplet::contact::solver::Method;
use softjam::models::droplet::contact::{ContactError, ContactLaw, Rule};
use softjam::protocol::{RelaxError, Relaxation, Status};
use softjam::scene::{Preparation, Radii, Scene, Start, start};
use softjam::state::Packing;

const METHODS: [Method; 3] = [
    Method::ConjugateGradient,
    Method::SparseCholesky,
    Method::GaussJordan,
];

#[test]
fn single_particle_is_in_balance_at_once() {
    for rule in [Rule::Complementarity, Rule::Saitoh] {
        let scene = Scene {
            contact_rule: rule,
            ..scene(1, 0.05, 1)
        };
        let run = Relaxation::new(&scene).unwrap();
        assert_eq!((run.status(), run.step()), (Status::Converged, 0));
        let o = run.observables();
        assert_eq!(
            (o.contacts, o.rattlers, o.energy, o.pressure()),
            (0, 1, 0.0, 0.0)
        );
        assert_eq!((o.coordination(), o.f_max), (0.0, 0.0));
        let dt_max = fire(&run.frame()).dt_max;
        assert!(dt_max > 0.0 && dt_max.is_finite());
        assert_eq!(run.count(), 1, "one frame, no move");
    }
}

#[test]
fn dilute_packing_converges_at_once_without_contact_and_pressure() {
    for seed in 1..=3 {
        let run = Relaxation::new(&scene(200, 0.05, seed)).unwrap();
        assert_eq!((run.status(), run.step()), (Status::Converged, 0));
        let o = run.observables();
        assert_eq!((o.contacts, o.rattlers, o.energy), (0, 200, 0.0));
        assert_eq!((o.pressure(), o.coordination()), (0.0, 0.0));
        assert_eq!(o.stress.map(f64::abs), [0.0; 3]);
        assert_eq!(run.count(), 1, "one frame, no move");
    }
}

fn at(x: f64, y: f64) -> Vec2 {
    Vec2::new(x, y)
}

fn packing(points: &[Vec2]) -> Packing {
    Packing::new(
        Domain::new(9.0, 9.0).unwrap(),
        vec![0.5; points.len()],
        points.to_vec(),
    )
    .unwrap()
}

#[test]
fn two_coincident_centres_repel_with_a_finite_force() {
    let points = [at(3.0, 3.0), at(3.0, 3.0), at(3.8, 3.1), at(6.0, 6.0)];
    for method in METHODS {
        let mut law = ContactLaw::new(Rule::Complementarity, method, 1.0, 1e-12);
        law.solve(&packing(&points), &[], &[]).unwrap();
        let contacts = law.contacts();
        assert_eq!(contacts.pairs[0], [0, 1]);
        assert_eq!((contacts.distances[0], contacts.overlaps[0]), (0.0, 1.0));
        assert_eq!(contacts.normals[0], at(1.0, 0.0), "by definition");
        assert!(contacts.forces.iter().all(|f| f.is_finite() && *f > 0.0));
    }
}

#[test]
fn coincident_centres_of_a_start_file_relax_apart() {
    let folder = crate::common::Folder::new();
    let path = folder.path().join("coincident.csv");
    let rows = "1,1,0.5\n1,1,0.5\n4,4,0.5\n4,4,0.7\n4,4,0.6\n7,2,0.5\n";
    std::fs::write(&path, format!("# box = 9, 9\nx,y,radius\n{rows}")).unwrap();
    // Separated beforehand, relaxed as disks, or left to the model by whoever makes the packing himself.
    for preparation in [
        Preparation::Separated,
        Preparation::Relaxed,
        Preparation::AsItStands,
    ] {
        let scene = Scene {
            start: Start::File {
                path: path.to_str().unwrap().into(),
                blake3: None,
                preparation,
            },
            ..Scene::default()
        };
        let start = Relaxation::new(&scene);
        let mut run = match preparation {
            Preparation::AsItStands => {
                assert!(start.is_err());
                let packing = start::read_csv(&path, None).unwrap();
                Relaxation::of_packing(&scene, packing).unwrap()
            }
            _ => start.unwrap(),
        };
        assert_eq!(run.disks().is_some(), preparation == Preparation::Relaxed);
        while run.status() == Status::Running {
            run.advance().unwrap();
            let frame = run.frame();
            assert!(frame.validate(6, run.packing().domain()).is_ok());
        }
        assert_eq!(run.status(), Status::Converged);
        // FIRE comes to rest where the contours hardly touch.
        assert!(run.packing().separation(0, 1).norm() > 1.0 - 1e-9);
    }
}

#[test]
fn neighbours_in_one_direction_give_an_answer_or_an_error_but_no_panic() {
    // Centres on a coarse grid: many coincide, many are in line. Then A may be singular to the last bit.
    let mut random = Random::new(13);
    let mut answered = 0;
    for case in 0..300 {
        let spacing = [0.5, 0.25, 0.125][case % 3];
        let points: Vec<Vec2> = (0..14)
            .map(|_| {
                let x = spacing * random.within(0.0, 5.0 / spacing).floor();
                at(x, spacing * random.within(0.0, 5.0 / spacing).floor())
            })
            .collect();
        for method in METHODS {
            for rule in [Rule::Complementarity, Rule::Saitoh] {
                let mut law = ContactLaw::new(rule, method, 1.0, 1e-12);
                match law.solve(&packing(&points), &[], &[]) {
                    Ok(()) => {
                        answered += 1;
                        assert!(law.contacts().forces.iter().all(|f| f.is_finite()));
                        // Saitoh's rule promises no more after two sweeps than numbers.
                        let most = match rule {
                            Rule::Complementarity => law.accepted_residual(),
                            Rule::Saitoh => f64::MAX,
                        };
                        assert!(law.residual() <= most, "case {case} {method:?} {rule:?}");
                    }
                    Err(ContactError::BoxTooSmall { reach, .. }) => assert!(!reach.is_nan()),
                    Err(error) => assert!(matches!(error, ContactError::Solver(_)), "{error}"),
                }
            }
        }
    }
    assert!(answered > 900, "{answered} of 1800 answered");
}

/// Where a point stands along Morton's curve: which quarter of the box it is in, which quarter of that, …
fn quadrants([mut x, mut y]: [f64; 2], side: f64) -> u32 {
    let mut half = side / 2.0;
    let mut place = 0;
    for _ in 0..16 {
        let (right, up) = (x >= half, y >= half);
        place = 4 * place + 2 * u32::from(up) + u32::from(right);
        x -= if right { half } else { 0.0 };
        y -= if up { half } else { 0.0 };
        half /= 2.0;
    }
    place
}

#[test]
fn seed_one_starts_where_chacha8_says() {
    // Computed apart from the crate, in Python: ChaCha8 with the key 1, 0, 0, … and nonce 0, checked with the vector of
    // draft-strombergson-chacha-test-vectors; (word >> 11) 2⁻⁵³ times the side of the box.
    const SIDE: f64 = 4.650359889705409;
    const CENTRES: [[f64; 2]; 16] = [
        [1.7740630656704606, 1.371518206193181],
        [3.712169533810352, 4.260442185901514],
        [3.9799730709649594, 0.6472581466372485],
        [3.412651984880416, 3.6492708550824795],
        [1.8807550590659903, 2.1359712843390346],
        [3.9216572003772883, 1.0199859688288109],
        [1.6057706619852663, 3.506986214566336],
        [0.8396849558073113, 3.2834417157610543],
        [4.5209413578444275, 1.4161565004566008],
        [4.421262113593018, 3.9141413021950813],
        [3.4049834014390092, 3.784242008438833],
        [0.1635472758247531, 0.06972537872317194],
        [0.29821613614741604, 2.276245359825702],
        [1.2978436121100492, 4.566908683647916],
        [2.7738491070978792, 4.639895249772279],
        [3.740878008366009, 3.420207159880165],
    ];
    let start = start::packing(&scene(16, 0.86, 1)).unwrap();
    assert_eq!(start.domain().lengths(), at(SIDE, SIDE));
    // Radii are given out in the order of drawing, small ones first; then the particles are numbered along the curve.
    let mut drawn: Vec<(u32, [f64; 2], f64)> = (0..16)
        .map(|k| {
            (
                quadrants(CENTRES[k], SIDE),
                CENTRES[k],
                if k < 8 { 0.5 } else { 0.7 },
            )
        })
        .collect();
    drawn.sort_by_key(|d| d.0);
    for (k, (_, [x, y], radius)) in drawn.into_iter().enumerate() {
        assert_eq!((start.positions()[k], start.radii()[k]), (at(x, y), radius));
    }
    let other = start::packing(&scene(16, 0.86, 2)).unwrap();
    assert_ne!(start.positions(), other.positions());
}

#[test]
fn seed_one_draws_radii_before_centres_and_shuffles_the_radii_of_a_crystal() {
    // The same stream of numbers, again in Python.
    let spread = Scene {
        radii: Radii::Spread { min: 0.4, max: 0.6 },
        ..scene(12, 0.86, 1)
    };
    let start = start::packing(&spread).unwrap();
    for radius in [0.4762978826476522, 0.458985465156335, 0.5596508494763192] {
        assert!(start.radii().contains(&radius));
    }
    let first = at(1.1811191586712653, 2.5795518035553218);
    let place = start.positions().iter().position(|p| *p == first).unwrap();
    assert_eq!(start.radii()[place], 0.4762978826476522);
    let last = at(2.7798574990030405, 0.7438700802737316);
    assert!(start.positions().contains(&last));
    let crystal = Scene {
        start: Start::Hexagonal,
        ..scene(16, 0.86, 1)
    };
    // Fisher and Yates from the end, eight small particles followed by eight large ones.
    let shuffled = [7, 5, 5, 7, 7, 5, 7, 5, 7, 5, 5, 7, 7, 7, 5, 5].map(|k| f64::from(k) / 10.0);
    assert_eq!(start::packing(&crystal).unwrap().radii(), shuffled);
}

#[test]
fn time_step_far_too_long_is_an_error_or_an_end_but_no_panic() {
    for dt_max in [3.0, 100.0, 1e6, 1e300] {
        let scene = Scene {
            dt_max: Some(dt_max),
            steps: 300,
            ..scene(64, 0.9, 1)
        };
        let mut run = Relaxation::new(&scene).unwrap();
        let end = loop {
            match run.next() {
                None => break "end",
                Some(Ok(frame)) => assert!(frame.validate(64, run.packing().domain()).is_ok()),
                Some(Err(RelaxError::TooFar { .. } | RelaxError::Contact { .. })) => {
                    break "error";
                }
                Some(Err(other)) => panic!("{other}"),
            }
        };
        println!("dt_max {dt_max:e}: {end} at step {}", run.step());
        assert!(run.next().is_none(), "the iterator ends behind an error");
    }
}

#[test]
fn frame_with_impossible_forces_is_an_error_or_a_run_but_no_panic() {
    let scene = Scene {
        steps: 50,
        ..scene(40, 0.9, 1)
    };
    let start = Relaxation::new(&scene).unwrap();
    let all: Vec<[u32; 2]> = (0..40)
        .flat_map(|i| (i + 1..40).map(move |j| [i, j]))
        .collect();
    for force in [1e300, -1e300, 1.0, -1.0, 0.0, -0.0] {
        for rule in [Rule::Complementarity, Rule::Saitoh] {
            let mut frame = start.frame();
            frame.contacts = all.clone();
            frame.forces = vec![force; all.len()];
            let scene = Scene {
                contact_rule: rule,
                ..scene.clone()
            };
            let run = Relaxation::resume(&scene, start.packing().clone(), frame).unwrap();
            for frame in run.flatten().skip(1) {
                assert!(frame.validate(40, start.packing().domain()).is_ok());
            }
        }
    }
}

#[test]
fn smallest_box_of_a_crystal_is_told_from_one_that_is_too_small() {
    // Five largest radii are asked for: two columns of equal particles are not enough, four are.
    for (particles, fits) in [(2, false), (4, false), (6, false), (16, true)] {
        let scene = Scene {
            radii: monodisperse(),
            start: Start::Hexagonal,
            ..scene(particles, 0.92, 1)
        };
        assert_eq!(
            Relaxation::new(&scene).is_ok(),
            fits,
            "{particles} particles"
        );
    }
}
