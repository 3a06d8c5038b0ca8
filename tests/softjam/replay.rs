//! Replay: a recording proves itself, and nothing that is done to it passes in silence.

use crate::common::fire;
use crate::files::{judged, open, record_as, states};
use softjam::analysis::METRICS;
use softjam::minimize::fire::FireState;
use softjam::minimize::newton::Turns;
use softjam::models::droplet::Form;
use softjam::protocol::Relaxation;
use softjam::record::{Format, Snapshot};
use softjam::replay::{
    Balance, Bytes, Determinism, Event, ReadError, Recording, ReplayError, Way, determinism,
};
use softjam::scene::{Channels, Minimizer, Radii, Scene, Schedule, Species};

pub fn scene() -> Scene {
    Scene {
        particles: 48,
        phi: 0.88,
        channels: Channels {
            contours: Schedule::Every(100),
            contacts: Schedule::Every(100),
            metrics: Schedule::Every(1),
            state: Schedule::Every(20),
            ..Channels::default()
        },
        ..Scene::default()
    }
}

pub fn record(scene: &Scene, change: impl FnMut(&mut Snapshot)) -> Vec<u8> {
    record_as(Format::Rrd, scene, change)
}

pub fn replay(bytes: &[u8], way: Way) -> Result<Determinism, ReplayError> {
    determinism(&mut open(bytes)?, way, None, |_| {})
}

/// What is done to a snapshot on its way to the recorder.
type Forge = fn(&mut Snapshot);

const WAYS: [Way; 3] = [Way::Whole, Way::Segments(1), Way::Segments(3)];

#[test]
fn a_fresh_recording_is_what_its_scene_gives_whichever_way_it_is_run() {
    let bytes = record(&scene(), |_| {});
    let verdicts = WAYS.map(|way| replay(&bytes, way).expect("a verdict"));
    assert_eq!(verdicts[0].difference, None);
    let last = states(&bytes).last().expect("a state").step;
    assert_eq!(verdicts[0].steps, Some((0, last)));
    assert_eq!(verdicts[0].metrics, 9 * (last + 1));
    assert_eq!(verdicts[0], verdicts[1]);
    assert_eq!(verdicts[0], verdicts[2]);
}

/// Recorded to the last frame with Newton's method at work, with either form of the forces.
fn finished(forces: Form) -> Scene {
    Scene {
        minimizer: Minimizer::FireNewton,
        forces,
        threshold: 1e-13,
        channels: Channels {
            state: Schedule::Every(1),
            ..scene().channels
        },
        ..scene()
    }
}

#[test]
fn a_run_finished_by_newton_with_either_form_of_forces_is_verified() {
    for forces in [Form::Central, Form::Gradient] {
        let scene = finished(forces);
        let bytes = record(&scene, |_| {});
        let frames = states(&bytes);
        let last = frames.last().expect("a state");
        assert!(fire(last).turns.moves > 0, "{forces:?}");
        for way in WAYS {
            let verdict = replay(&bytes, way).expect("a verdict");
            assert_eq!(verdict.difference, None, "{forces:?}, {way:?}");
        }
        let mut balance = Balance::new(&scene);
        let mut recording = open(&bytes).expect("a recording");
        let mut packing = None;
        for event in &mut recording {
            if let Event::State(frame) = event.expect("undamaged") {
                let packing = packing.get_or_insert_with(|| {
                    Relaxation::new(&scene).expect("a scene").packing().clone()
                });
                let there = Relaxation::resume(&scene, packing.clone(), frame.clone());
                balance.check(there.expect("a frame").packing(), &frame, &[]);
            }
        }
        assert!(balance.agrees(), "{forces:?}: {balance:?}");
        assert!(balance.last.is_some_and(|(_, f_max)| f_max <= 1e-13));
    }
}

#[test]
fn forged_turns_of_the_minimiser_are_found() {
    let scene = finished(Form::Central);
    let whole = record(&scene, |_| {});
    let first = states(&whole).into_iter().find(|f| fire(f).turns.moves > 0);
    let step = first.expect("Newton's method at work").step;
    let forged = record(&scene, |snapshot| {
        if let Some(frame) = snapshot.frame.as_mut().filter(|f| f.step == step) {
            let mut state = fire(frame);
            state.turns.moves += 1;
            frame.minimizer = state.numbers();
        }
    });
    for way in WAYS {
        let found = replay(&forged, way).expect("a verdict").difference;
        let found = found.expect("the forgery is found").to_string();
        assert!(
            found.starts_with(&format!("step {step}: newton_moves of the minimiser")),
            "{way:?}: {found}"
        );
    }
    let forged = record(&scene, |snapshot| {
        if let Some(frame) = snapshot.frame.as_mut().filter(|f| f.step == step) {
            let state = FireState {
                turns: Turns::default(),
                ..fire(frame)
            };
            frame.minimizer = state.numbers();
        }
    });
    let found = replay(&forged, Way::Whole).expect("a verdict").difference;
    let found = found.expect("the forgery is found").to_string();
    assert!(found.contains("values of the minimiser"), "{found}");
}

#[test]
fn a_frame_that_the_run_did_not_give_is_found_and_named() {
    // The last bit of one coordinate, recorded with a digest that fits it: only a replay can tell.
    let forged = record(&scene(), |snapshot| {
        if let Some(frame) = &mut snapshot.frame
            && frame.step == 60
        {
            frame.positions[7].y = frame.positions[7].y.next_up();
        }
    });
    for way in WAYS {
        let verdict = replay(&forged, way).expect("a verdict");
        let difference = verdict
            .difference
            .expect("the forgery is found")
            .to_string();
        assert!(
            difference.starts_with("step 60: y of particle 7") && difference.ends_with("(1 ulp)"),
            "{way:?}: {difference}"
        );
    }
}

#[test]
fn forged_metrics_forces_and_minimisers_are_found_in_either_way() {
    let forgeries: [(&str, Forge); 4] = [
        ("metric pressure", |s| {
            // The pressure is the fourth of the metrics.
            if let Some(metrics) = s.metrics.as_mut().filter(|_| s.step == 33) {
                metrics[3] = metrics[3].map(f64::next_up);
            }
        }),
        ("force of contact 5", |s| {
            if let Some(frame) = s.frame.as_mut().filter(|f| f.step == 40) {
                frame.forces[5] = frame.forces[5].next_down();
            }
        }),
        ("alpha of the minimiser", |s| {
            if let Some(frame) = s.frame.as_mut().filter(|f| f.step == 40) {
                let mut state = fire(frame);
                state.alpha *= 0.99;
                frame.minimizer = state.numbers();
            }
        }),
        ("contacts: ", |s| {
            if let Some(frame) = s.frame.as_mut().filter(|f| f.step == 40) {
                frame.contacts.pop();
                frame.forces.pop();
            }
        }),
    ];
    for (name, forge) in forgeries {
        let forged = record(&scene(), forge);
        let found = WAYS.map(|way| replay(&forged, way).expect("a verdict").difference);
        let text = found[0].as_ref().expect(name).to_string();
        assert!(text.contains(name), "{text}");
        assert_eq!(found[0], found[1]);
        assert_eq!(found[0], found[2]);
    }
}

#[test]
fn frames_of_large_and_small_particles_are_in_balance() {
    // A length that hardly matters between large particles is a strong force between small ones.
    let species = |radius: f64, fraction: f64| Species { radius, fraction };
    let scene = Scene {
        particles: 600,
        phi: 1.0,
        seed: 4,
        radii: Radii::Species(vec![species(0.5, 0.8), species(10.0, 0.2)]),
        ..Scene::default()
    };
    let mut run = Relaxation::new(&scene).expect("a packing");
    let mut balance = Balance::new(&scene);
    for _ in 0..60 {
        run.advance().expect("a step");
        let metrics: Vec<_> = METRICS
            .into_iter()
            .zip(run.observables().metrics())
            .filter_map(|(name, value)| Some((name, value?)))
            .collect();
        balance.check(run.packing(), &run.frame(), &metrics);
    }
    assert_eq!(balance.frames, 60);
    assert!(balance.agrees(), "{balance:?}");
}

#[test]
fn forces_that_do_not_balance_are_told_from_positions_alone() {
    let scene = scene();
    let true_one = record(&scene, |_| {});
    let last = states(&true_one).last().expect("a state").step;
    let forged = |step: u64, by: f64| {
        record(&scene, move |snapshot| {
            if let Some(frame) = snapshot.frame.as_mut().filter(|f| f.step == step) {
                frame.forces[3] *= 1.0 + by;
            }
        })
    };
    // Far from balance a frame promises less than at the end.
    let forgeries = [(40, 3e-2), (last, 1e-6)];
    let files = forgeries.map(|(step, by)| (forged(step, by), Some((step, by))));
    for (bytes, forgery) in [(true_one, None)].into_iter().chain(files) {
        let mut recording = open(&bytes).expect("a recording");
        let mut balance = Balance::new(&scene);
        while let Some(state) = recording.next_state().expect("undamaged") {
            let metrics = state
                .metrics
                .get(&state.frame.step)
                .expect("metrics of every step");
            balance.check(&state.packing, &state.frame, metrics);
        }
        assert!(
            balance.energy_and_pressure.value > 0.0,
            "the recorded metrics were looked at"
        );
        assert_eq!(balance.agrees(), forgery.is_none());
        if let Some((step, _)) = forgery {
            assert_eq!(balance.equation_4.step, step);
        }
        if forgery.is_none_or(|(step, _)| step != last) {
            assert!(balance.bears_out(&recording.outcome().expect("a result"), 0.0));
        }
    }
}

#[test]
fn both_contact_rules_and_a_lattice_verify() {
    let base = scene();
    let scenes = [
        Scene {
            contact_rule: softjam::models::droplet::contact::Rule::Saitoh,
            ..base.clone()
        },
        Scene {
            contact_solver: softjam::models::droplet::contact::solver::Method::SparseCholesky,
            ..base.clone()
        },
        Scene {
            start: softjam::scene::Start::Hexagonal,
            ..base
        },
    ];
    for scene in scenes {
        let bytes = record(&scene, |_| {});
        for way in WAYS {
            assert_eq!(
                replay(&bytes, way).expect("a verdict").difference,
                None,
                "{scene:?}"
            );
        }
    }
}

#[test]
fn recordings_in_a_row_missing_states_and_wrong_results_each_have_their_error() {
    let scene = scene();
    let bytes = record(&scene, |_| {});
    let error = |bytes: &[u8]| {
        open(bytes)
            .expect("a header")
            .find_map(Result::err)
            .expect("an error")
    };
    let twice = [bytes.clone(), bytes.clone()].concat();
    let text = error(&twice).to_string();
    assert!(text.contains("follow the end of the recording"), "{text}");

    // A recorder that drops, or repeats, a frame.
    let without = record(&scene, |s| s.state &= s.step != 60);
    match error(&without) {
        ReadError::Steps {
            intact, problem, ..
        } => {
            assert_eq!(intact, Some(40));
            assert_eq!(
                problem,
                "the states between step 40 and step 80 are missing"
            );
        }
        other => panic!("{other}"),
    }
    let swapped = record(&scene, |s| {
        if s.state && s.step == 60 {
            s.step = 20;
            s.frame.iter_mut().for_each(|frame| frame.step = 20);
        }
    });
    assert!(matches!(
        error(&swapped),
        ReadError::Steps {
            intact: Some(40),
            ..
        }
    ));
    let late = record(&scene, |s| s.state &= s.step > 0);
    assert!(matches!(
        error(&late),
        ReadError::Steps { intact: None, .. }
    ));
}

#[test]
fn a_recording_without_states_says_that_it_cannot_be_replayed() {
    let mut scene = scene();
    scene.channels.state = Schedule::Off;
    let bytes = record(&scene, |_| {});
    let error = replay(&bytes, Way::Whole).expect_err("nothing to replay");
    assert!(matches!(error, ReplayError::NoState { .. }));
    assert_eq!(
        error.to_string(),
        "test holds no state: it can be looked at, not replayed"
    );
}

#[test]
fn a_newer_format_is_refused_by_its_number() {
    let bytes = record(
        &Scene {
            steps: 0,
            ..scene()
        },
        |_| {},
    );
    // The version is a u32 2 in a padded buffer of its own in the header; find it by trying.
    let mut versions = Vec::new();
    for place in (0..bytes.len().min(200_000) - 64).step_by(4) {
        if bytes[place..place + 4] == [2, 0, 0, 0]
            && bytes[place + 4..place + 60].iter().all(|b| *b == 0)
        {
            let mut newer = bytes.clone();
            newer[place] = 7;
            if let Err(error @ ReadError::Newer { .. }) = open(&newer) {
                versions.push(error.to_string());
            }
        }
    }
    assert!(!versions.is_empty(), "the version was not found");
    assert!(
        versions
            .iter()
            .all(|v| v.contains("format version 7, this program reads up to 2"))
    );
}

#[test]
fn a_changed_radius_is_found() {
    let mut scene = scene();
    scene.radii = softjam::scene::Radii::Spread { min: 0.4, max: 0.6 };
    let mut bytes = record(&scene, |_| {});
    let radius = open(&bytes).expect("a recording").radii()[11];
    let needle = radius.to_le_bytes();
    let place = bytes
        .windows(8)
        .position(|w| w == needle)
        .expect("it is in the file");
    bytes[place] ^= 1;
    for way in WAYS {
        let difference = replay(&bytes, way)
            .expect("a verdict")
            .difference
            .expect("found");
        assert!(
            difference.to_string().contains("radius of particle 11"),
            "{difference}"
        );
    }
}

#[test]
fn golden_recordings_verify() {
    let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("recordings");
    let cases = [
        ("jammed.rrd", true, true),
        ("jammed.mcap", true, true),
        ("near-jamming.rrd", true, true),
        ("hexagonal.rrd", true, true),
        ("state-only.rrd", true, true),
        ("step-limit.rrd", true, false),
        ("disks.rrd", true, true),
        ("rounded-polygon.rrd", true, true),
        ("wet-foam.rrd", true, true),
        ("shear.rrd", true, true),
        ("killed.rrd", false, false),
    ];
    let mut size = 0;
    for (name, closed, converged) in cases {
        let path = folder.join(name);
        size += std::fs::metadata(&path).expect(name).len();
        for way in WAYS {
            let mut recording = Recording::open(&path).expect(name);
            let (verdict, balance) = judged(&mut recording, way);
            assert_eq!(verdict.difference, None, "{name}");
            assert!(balance.agrees(), "{name}: {balance:?}");
            assert_eq!(recording.is_closed(), closed, "{name}");
            assert_eq!(
                recording.outcome().is_some_and(|end| end.converged),
                converged,
                "{name}"
            );
            if let Some(end) = recording.outcome() {
                assert!(balance.bears_out(&end, 0.0), "{name}");
            }
        }
    }
    assert!(size < 9 << 20, "{size} bytes of golden recordings");
}

#[test]
fn recordings_of_version_0_1_are_verified_by_what_they_hold() {
    let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("recordings/version-0.1");
    for name in ["jammed.rrd", "jammed.mcap", "state-only.rrd"] {
        for way in WAYS {
            let path = folder.join(name);
            let mut recording = Recording::open(&path).expect(name);
            assert_eq!(
                (recording.program(), recording.bits()),
                ("softjam 0.1.0", 1)
            );
            let file = std::fs::File::open(&path).expect(name);
            let verdict = determinism(&mut recording, way, Some(Box::new(file)), |_| {});
            let verdict = verdict.expect(name);
            assert_eq!(verdict.difference, None, "{name}");
            assert_eq!(verdict.bytes, Bytes::LaidOutOtherwise, "{name}");
        }
    }
}

/// Near the transition contacts overlap by 1e-8 and less, and the rounding of lengths is a large part of that.
#[test]
fn packings_that_hardly_touch_are_verified() {
    for (seed, phi) in [(2, 0.84), (1, 0.8), (3, 0.842)] {
        let scene = Scene {
            particles: 64,
            seed,
            phi,
            ..Scene::default()
        };
        let bytes = record_as(Format::Rrd, &scene, |_| {});
        let (verdict, balance) = judged(&mut open(&bytes).expect("a recording"), Way::Whole);
        assert_eq!(verdict.difference, None);
        assert!(balance.agrees(), "φ = {phi}, seed {seed}: {balance:?}");
    }
}
