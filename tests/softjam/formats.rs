//! The formats of recordings: what the first was is kept, what the second has more comes back.

use crate::common::Folder;
use crate::files::{FORMATS, judged, open, record_as, states};
use softjam::convert;
use softjam::domain::Domain;
use softjam::models::{Kind, Model};
use softjam::protocol::Relaxation;
use softjam::record::{Outcome, Writer};
use softjam::replay::{Balance, Bytes, Recording, Way, determinism};
use softjam::scene::{Channels, Scene, Schedule};
use softjam::state::Frame;
use std::fs;
use std::path::{Path, PathBuf};

fn golden(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("recordings")
        .join(name)
}

#[test]
fn recordings_of_the_first_format_are_verified_to_the_last_byte() {
    for name in [
        "jammed.rrd",
        "jammed.mcap",
        "near-jamming.rrd",
        "hexagonal.rrd",
        "state-only.rrd",
        "step-limit.rrd",
    ] {
        let path = golden("format-1").join(name);
        let mut recording = Recording::open(&path).expect(name);
        assert_eq!(recording.format_version(), 1, "{name}");
        let file = fs::File::open(&path).expect(name);
        let mut balance = Balance::new(recording.scene());
        let verdict = determinism(&mut recording, Way::Whole, Some(Box::new(file)), |state| {
            balance.check(&state.packing, &state.frame, &[]);
        });
        let verdict = verdict.expect(name);
        let size = fs::metadata(&path).expect(name).len();
        assert_eq!(verdict.difference, None, "{name}");
        assert_eq!(verdict.bytes, Bytes::Same(size), "{name}");
        assert!(balance.agrees(), "{name}: {balance:?}");
    }
}

#[test]
fn recordings_of_the_first_format_are_converted_to_each_other_and_have_the_states_of_the_second() {
    let folder = Folder::new();
    for (from, to) in [("jammed.rrd", "jammed.mcap"), ("jammed.mcap", "jammed.rrd")] {
        let mut recording = Recording::open(golden("format-1").join(from)).expect(from);
        let channels = recording.scene().channels;
        let mut header = convert::header(&recording, channels).expect(from);
        // What the version that made them called itself.
        recording.program().clone_into(&mut header.program);
        let path = folder.path().join(to);
        let writer = Writer::create(&path, true, header).expect("a file");
        convert::convert(&mut recording, writer, &channels).expect(from);
        let (found, expected) = (fs::read(&path), fs::read(golden("format-1").join(to)));
        assert!(found.expect(to) == expected.expect(to), "{to}");
    }
    for name in [
        "jammed.rrd",
        "jammed.mcap",
        "near-jamming.rrd",
        "state-only.rrd",
    ] {
        let [first, second] = ["format-1", ""].map(|folder| {
            let bytes = fs::read(golden(folder).join(name)).expect(name);
            let digests: Vec<_> = states(&bytes).iter().map(Frame::digest).collect();
            digests
        });
        assert_eq!(first, second, "{name}");
    }
}

#[test]
fn memory_box_and_stage_of_a_frame_come_back_from_either_format() {
    let scene = Scene {
        particles: 24,
        phi: 0.9,
        steps: 3,
        channels: Channels {
            state: Schedule::Every(1),
            ..Channels::default()
        },
        ..Scene::default()
    };
    for format in FORMATS {
        let mut expected = Vec::new();
        let bytes = record_as(format, &scene, |snapshot| {
            let frame = snapshot.frame.as_mut().expect("a state in every step");
            // The first frame has none of them.
            let k = frame.step as f64;
            if frame.step > 0 {
                frame.memory = vec![0.25 * k, -0.0, k];
                frame.domain = Domain::new(100.0 + k, 100.0).and_then(|d| d.tilted(0.5 * k));
                frame.stage = frame.step as u32 - 1;
            }
            expected.push(frame.clone());
        });
        let found = states(&bytes);
        assert_eq!(found, expected, "{format:?}");
        assert_eq!(found.len(), 4);
        // Each of them is in the digest.
        let plain = found[2].digest();
        let changed = |change: &dyn Fn(&mut Frame)| {
            let mut frame = found[2].clone();
            change(&mut frame);
            frame.digest()
        };
        assert_ne!(plain, changed(&|f| f.memory[1] = 0.0));
        assert_ne!(plain, changed(&|f| f.domain = None));
        assert_ne!(plain, changed(&|f| f.stage += 1));
    }
}

#[test]
fn disks_are_recorded_replayed_and_converted_like_droplets() {
    let scene = Scene {
        model: Kind::Disks,
        particles: 48,
        phi: 0.9,
        channels: Channels {
            state: Schedule::Every(9),
            ..Channels::default()
        },
        ..Scene::default()
    };
    for format in FORMATS {
        let bytes = record_as(format, &scene, |_| {});
        for way in [Way::Whole, Way::Segments(2)] {
            let mut recording = open(&bytes).expect("a recording");
            let (verdict, balance) = judged(&mut recording, way);
            assert_eq!(verdict.difference, None);
            assert!(balance.agrees(), "{balance:?}");
            assert!(balance.equation_4.value < 1e-14 && balance.overlap.value == 0.0);
            let end = recording.outcome().expect("a result");
            assert!(end.converged && balance.bears_out(&end, 0.0));
        }
        // A force that no overlap makes, a contact that is not there, and one that is kept quiet about.
        let forge = |by: f64| {
            record_as(format, &scene, |snapshot| {
                if let Some(frame) = snapshot.frame.as_mut().filter(|f| f.step == 18) {
                    if by == 0.0 {
                        frame.contacts.pop();
                        frame.forces.pop();
                    } else {
                        frame.forces[3] *= 1.0 + by;
                    }
                }
            })
        };
        for by in [1e-6, 0.0] {
            let mut recording = open(&forge(by)).expect("a recording");
            let mut balance = Balance::new(recording.scene());
            while let Some(state) = recording.next_state().expect("undamaged") {
                balance.check(&state.packing, &state.frame, &[]);
            }
            let worst = if by > 0.0 {
                balance.equation_4
            } else {
                balance.overlap
            };
            assert!(!balance.agrees() && worst.step == 18, "{balance:?}");
        }
    }
}

#[test]
fn droplets_that_keep_their_area_are_recorded_replayed_and_converted() {
    let folder = Folder::new();
    for model in [Kind::RoundedPolygon, Kind::WetFoam] {
        let scene = Scene {
            model,
            particles: 32,
            phi: 0.93,
            channels: Channels {
                state: Schedule::Every(9),
                ..Channels::default()
            },
            ..Scene::default()
        };
        let files = FORMATS.map(|format| record_as(format, &scene, |_| {}));
        for (bytes, other) in [(&files[0], &files[1]), (&files[1], &files[0])] {
            for way in [Way::Whole, Way::Segments(2)] {
                let mut recording = open(bytes).expect("a recording");
                let file = std::io::Cursor::new(bytes.clone());
                let verdict = determinism(&mut recording, way, Some(Box::new(file)), |_| {});
                let verdict = verdict.expect("a verdict");
                assert_eq!(verdict.difference, None);
                assert_eq!(verdict.bytes, Bytes::Same(bytes.len() as u64));
                let (_, balance) = judged(&mut open(bytes).expect("a recording"), way);
                assert!(balance.agrees(), "{balance:?}");
            }
            let mut recording = open(bytes).expect("a recording");
            let header = convert::header(&recording, scene.channels).expect("convertible");
            let name = if bytes == &files[0] {
                "b.mcap"
            } else {
                "b.rrd"
            };
            let path = folder.path().join(name);
            let writer = Writer::create(&path, true, header).expect("a file");
            convert::convert(&mut recording, writer, &scene.channels).expect("converted");
            assert!(&fs::read(path).expect(name) == other, "{name}");
        }
        // A tilt, a corner radius, a force and an area that are not the law's.
        let changes: [&dyn Fn(&mut Frame); 3] = [
            &|f| f.memory[2] += 1e-6,
            &|f| f.forces[3] *= 1.0 + 1e-6,
            &|f| f.positions[1].x += 1e-9,
        ];
        for change in changes {
            let bytes = record_as(FORMATS[0], &scene, |snapshot| {
                if let Some(frame) = snapshot.frame.as_mut().filter(|f| f.step == 27) {
                    change(frame);
                }
            });
            let mut recording = open(&bytes).expect("a recording");
            let verdict = determinism(&mut recording, Way::Whole, None, |_| {});
            assert!(
                verdict
                    .expect("a verdict")
                    .difference
                    .is_some_and(|d| d.step == 27)
            );
        }
    }
}

#[test]
fn a_packing_whose_moments_are_not_balanced_has_not_converged() {
    let mut scene = Scene {
        model: Kind::WetFoam,
        particles: 32,
        phi: 0.93,
        ..Scene::default()
    };
    let mut start = Relaxation::new(&scene).expect("a valid scene");
    let balanced = start.by_ref().last().expect("a frame").expect("no failure");
    let packing = start.packing();
    // A contact of large droplets that is turned from balance has a moment larger than its net force.
    let turned = |k: usize| {
        let mut frame = balanced.clone();
        frame.memory[k] += 1e-4;
        Relaxation::resume(&scene, packing.clone(), frame).expect("a frame")
    };
    let uneven = |run: &Relaxation| run.f_max() < 0.85 * run.model().moment();
    let run = (0..balanced.contacts.len()).map(turned).find(uneven);
    let run = run.expect("one of the contacts");
    let frame = run.frame();
    scene.threshold = 0.9 * run.model().moment();
    let mut balance = Balance::new(&scene);
    balance.check(run.packing(), &frame, &[]);
    let claim = |converged| Outcome {
        converged,
        steps: frame.step,
        f_max: run.f_max(),
        stability: None,
    };
    assert!(!balance.bears_out(&claim(true), 0.0) && balance.bears_out(&claim(false), 0.0));
}
