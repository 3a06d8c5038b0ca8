//! The disks of a start as the first stage of a recording.

use crate::common::Folder;
use crate::files::{FORMATS, judged, open, record_as, states};
use softjam::convert;
use softjam::domain::Domain;
use softjam::models::Kind;
use softjam::models::droplet::Form;
use softjam::protocol::{RelaxError, Relaxation};
use softjam::record::{Format, Writer};
use softjam::replay::{Balance, Bytes, Recording, Way, determinism};
use softjam::scene::{Channels, Minimizer, Scene, Schedule};
use softjam::state::{Frame, FrameError};
use std::fs;

/// What is done to a frame.
type Change<'a> = &'a dyn Fn(&mut Frame);

/// A scene whose disks are recorded, and the same without them.
fn scenes() -> [Scene; 2] {
    let plain = Scene {
        particles: 40,
        phi: 0.9,
        seed: 3,
        channels: Channels {
            state: Schedule::Every(7),
            contours: Schedule::Every(5),
            metrics: Schedule::Every(3),
            ..Channels::default()
        },
        ..Scene::default()
    };
    let mut staged = plain.clone();
    staged.disks.record = Schedule::Every(9);
    [staged, plain]
}

fn frames(run: Relaxation) -> Vec<Frame> {
    run.map(|frame| frame.expect("a step")).collect()
}

#[test]
fn droplets_behind_recorded_disks_are_those_of_the_run_without_them() {
    for (minimizer, forces) in [
        (Minimizer::Fire, Form::Central),
        (Minimizer::FireNewton, Form::Gradient),
    ] {
        let [staged, plain] = scenes().map(|scene| Scene {
            minimizer,
            forces,
            ..scene
        });
        let run = Relaxation::new(&plain).expect("a valid scene");
        let report = run.disks().expect("disks");
        let expected = frames(run);
        let mut run = Relaxation::new(&staged).expect("a valid scene");
        assert_eq!(run.disks(), None);
        let all: Vec<Frame> = run.by_ref().map(|frame| frame.expect("a step")).collect();
        assert_eq!(run.disks(), Some(report), "known once they are relaxed");
        let (disks, droplets) = all.split_at(report.steps as usize + 1);
        assert!(disks.iter().all(|f| f.stage == 0) && droplets.iter().all(|f| f.stage == 1));
        assert_eq!(droplets.len(), expected.len());
        assert_eq!(
            disks.last().map(|f| &f.positions),
            Some(&expected[0].positions),
            "the droplets begin where the disks end"
        );
        for (a, b) in droplets.iter().zip(&expected) {
            assert_eq!(a.step, b.step + report.steps + 1);
            assert_eq!((&a.positions, &a.velocities), (&b.positions, &b.velocities));
            assert_eq!((&a.contacts, &a.forces), (&b.contacts, &b.forces));
        }
        // Disks bear f = kδ, k = 4πγ/3(R_i + R_j), wherever they overlap and nowhere else.
        let packing = run.packing();
        let (middle, radii) = (&disks[disks.len() / 2], packing.radii());
        let mut contacts = 0;
        for i in 0..radii.len() {
            for j in i + 1..radii.len() {
                let between = middle.positions[i] - middle.positions[j];
                let sum = radii[i] + radii[j];
                let overlap = sum - packing.domain().minimum_image(between).norm();
                if overlap <= 0.0 {
                    continue;
                }
                let force = 4.0 * std::f64::consts::PI / 3.0 / sum * overlap;
                assert_eq!(middle.contacts[contacts], [i as u32, j as u32]);
                assert!((middle.forces[contacts] / force - 1.0).abs() < 1e-12);
                contacts += 1;
            }
        }
        assert_eq!(contacts, middle.contacts.len());
    }
}

#[test]
fn run_taken_up_in_either_stage_walks_the_same_bits() {
    let [scene, _] = scenes();
    let run = Relaxation::new(&scene).expect("a valid scene");
    let packing = run.packing().clone();
    let all = frames(run);
    let begin = all.iter().position(|f| f.stage == 1).expect("droplets");
    for k in [
        0,
        1,
        begin / 2,
        begin - 2,
        begin - 1,
        begin,
        begin + 1,
        all.len() - 1,
    ] {
        let resumed = Relaxation::resume(&scene, packing.clone(), all[k].clone());
        let rest = frames(resumed.expect("a frame of it"));
        assert_eq!(rest, all[k..], "from step {k}");
    }
}

#[test]
fn recordings_with_their_disks_are_verified_and_converted_byte_for_byte() {
    let folder = Folder::new();
    let [scene, _] = scenes();
    let files = FORMATS.map(|format| record_as(format, &scene, |_| {}));
    for bytes in &files {
        let found = states(bytes);
        let begin = found.iter().position(|f| f.stage == 1).expect("droplets");
        let steps: Vec<u64> = found.iter().map(|f| f.step).collect();
        assert!(begin > 3 && found.len() > begin + 3);
        assert!(steps[..begin].iter().all(|s| s % 9 == 0));
        assert!(steps[begin + 1..steps.len() - 1].iter().all(|s| s % 7 == 0));
        for way in [Way::Whole, Way::Segments(2)] {
            let file = std::io::Cursor::new(bytes.clone());
            let mut recording = open(bytes).expect("a recording");
            let verdict = determinism(&mut recording, way, Some(Box::new(file)), |_| {});
            let verdict = verdict.expect("a verdict");
            assert_eq!(verdict.difference, None);
            assert_eq!(verdict.bytes, Bytes::Same(bytes.len() as u64));
            let mut recording = open(bytes).expect("a recording");
            let (_, balance) = judged(&mut recording, way);
            assert!(balance.agrees(), "{balance:?}");
        }
    }
    let names = ["a.rrd", "a.mcap"].map(|name| folder.path().join(name));
    for (path, bytes) in names.iter().zip(&files) {
        fs::write(path, bytes).expect("written");
    }
    let converted = |from: &std::path::Path, to: &str, channels: &Channels| {
        let mut recording = Recording::open(from).expect("a recording");
        let header = convert::header(&recording, *channels).expect("convertible");
        let path = folder.path().join(to);
        let writer = Writer::create(&path, true, header).expect("a file");
        convert::convert(&mut recording, writer, channels).expect("converted");
        fs::read(path).expect("a file")
    };
    assert!(converted(&names[0], "b.mcap", &scene.channels) == files[1]);
    assert!(converted(&names[1], "b.rrd", &scene.channels) == files[0]);
    // From states alone, or from fewer of them, to all of it.
    let lean = Channels {
        contours: Schedule::Off,
        contacts: Schedule::Off,
        metrics: Schedule::Off,
        state: Schedule::Log(4),
        ..scene.channels
    };
    converted(&names[0], "lean.rrd", &lean);
    let path = folder.path().join("lean.rrd");
    assert!(converted(&path, "whole.rrd", &scene.channels) == files[0]);
}

#[test]
fn forged_states_of_either_stage_are_noticed() {
    let [scene, _] = scenes();
    let begin = frames(Relaxation::new(&scene).expect("a valid scene"))
        .iter()
        .position(|f| f.stage == 1)
        .expect("droplets") as u64;
    let changes: [(u64, Change<'_>); 4] = [
        (18, &|f| f.stage = 1),
        (begin, &|f| f.stage = 0),
        (18, &|f| f.positions[3].x *= 1.0 + 1e-15),
        (begin, &|f| f.stage = 2),
    ];
    for (step, change) in changes {
        let bytes = record_as(Format::Rrd, &scene, |snapshot| {
            if let Some(frame) = snapshot.frame.as_mut().filter(|f| f.step == step) {
                change(frame);
            }
        });
        let mut recording = open(&bytes).expect("a recording");
        let verdict = determinism(&mut recording, Way::Whole, None, |_| {});
        assert!(
            verdict.is_err() || verdict.is_ok_and(|v| v.difference.is_some()),
            "step {step}"
        );
    }
}

#[test]
fn frames_with_what_no_run_of_the_scene_has_are_refused() {
    let [staged, plain] = scenes();
    let changes: [(&str, &Scene, Change<'_>); 4] = [
        ("a later stage", &staged, &|f| f.stage = 2),
        ("a later stage", &plain, &|f| f.stage = 1),
        ("a memory", &plain, &|f| f.memory = vec![0.0]),
        ("a box of its own", &plain, &|f| {
            f.domain = Domain::new(90.0, 90.0);
        }),
    ];
    for (expected, scene, change) in changes {
        let run = Relaxation::new(scene).expect("a valid scene");
        let mut frame = run.frame();
        change(&mut frame);
        let error = Relaxation::resume(scene, run.packing().clone(), frame).expect_err(expected);
        assert!(
            matches!(error, RelaxError::Frame(FrameError::Foreign { what }) if what == expected),
            "{error}"
        );
    }
}

#[test]
fn each_stage_has_a_scene_and_disks_alone_no_second() {
    let [staged, plain] = scenes();
    let first = staged.stage(0);
    assert_eq!(
        (first.model, first.threshold),
        (Kind::Disks, plain.disks.threshold)
    );
    assert_eq!(first.channels.state, Schedule::Every(9));
    assert_eq!(first.channels.metrics, Schedule::Every(3));
    assert_eq!(
        (staged.stage(1).model, plain.stage(0).model),
        (Kind::MorseWitten, Kind::MorseWitten)
    );
    let error = Scene::from_toml("model = 'disks'\ndisks.record = 'every 2'").expect_err("refused");
    assert!(
        error.to_string().starts_with("disks.record = \"every 2\""),
        "{error}"
    );
}

#[test]
fn a_step_limit_ends_the_run_in_either_stage() {
    let [mut scene, _] = scenes();
    scene.steps = 25;
    let last = frames(Relaxation::new(&scene).expect("a valid scene")).pop();
    assert_eq!(last.map(|f| (f.step, f.stage)), Some((25, 0)));
    let bytes = record_as(Format::Rrd, &scene, |_| {});
    let (verdict, balance) = judged(&mut open(&bytes).expect("a recording"), Way::Whole);
    assert!(verdict.difference.is_none() && balance.agrees());
}

#[test]
fn first_state_of_a_stage_must_not_be_missing() {
    let [scene, _] = scenes();
    let mut before = 0;
    let bytes = record_as(Format::Rrd, &scene, |snapshot| {
        let stage = snapshot.frame.as_ref().map_or(before, |f| f.stage);
        if stage > before {
            snapshot.state = false;
        }
        before = stage;
    });
    let (verdict, _) = judged(&mut open(&bytes).expect("a recording"), Way::Whole);
    let difference = verdict.difference.expect("a state is missing");
    assert!(
        difference.to_string().contains("first step of a stage"),
        "{difference}"
    );
}

#[test]
fn balance_alone_notices_a_stage_that_no_run_has() {
    let [scene, _] = scenes();
    let bytes = record_as(Format::Mcap, &scene, |snapshot| {
        if let Some(frame) = snapshot.frame.as_mut().filter(|f| f.stage == 1) {
            frame.stage = 2;
        }
    });
    let mut recording = open(&bytes).expect("a recording");
    let mut balance = Balance::new(recording.scene());
    while let Some(state) = recording.next_state().expect("undamaged") {
        balance.check(&state.packing, &state.frame, &[]);
    }
    assert!(!balance.agrees());
}
