//! Recordings: what goes in comes out, damage is noticed, failures are reported where they happen.

use crate::common::Folder;
use crate::files::{FORMATS, SmallDisk, open, record_all, record_as, recorder};
use softjam::protocol::{Relaxation, Status};
use softjam::record::{self, Header, Snapshot, Writer};
use softjam::replay::{Event, ReadError, Recording};
use softjam::scene::{Channels, Scene, Schedule};
use softjam::state::Frame;
use std::io;
use std::path::Path;
use std::thread::sleep;
use std::time::{Duration, Instant};

fn scene() -> Scene {
    Scene {
        particles: 48,
        phi: 0.88,
        channels: Channels {
            state: Schedule::Every(7),
            ..Channels::default()
        },
        ..Scene::default()
    }
}

fn record_to(path: &Path, scene: &Scene) {
    let mut run = Relaxation::new(scene).expect("a valid scene");
    let writer = Writer::create(path, false, Header::of(scene, &run)).expect("a file");
    record::record(&mut run, vec![writer], &scene.channels, |_| true).expect("recorded");
}

fn states(path: &Path) -> Vec<Frame> {
    Recording::open(path)
        .expect("a recording")
        .filter_map(|event| match event.expect("undamaged") {
            Event::State(frame) => Some(frame),
            _ => None,
        })
        .collect()
}

#[test]
fn recorded_frames_come_back_with_the_bits_they_went_in_with() {
    let folder = Folder::new();
    let path = folder.path().join("a.rrd");
    let scene = scene();
    record_to(&path, &scene);
    let mut run = Relaxation::new(&scene).expect("a valid scene");
    let mut expected = Vec::new();
    loop {
        let last = run.status() != Status::Running;
        if last || run.step().is_multiple_of(7) {
            expected.push(run.frame());
        }
        if last {
            break;
        }
        run.advance().expect("a step");
    }
    let found = states(&path);
    assert_eq!(found.len(), expected.len());
    for (a, b) in found.iter().zip(&expected) {
        assert_eq!(a.digest(), b.digest(), "step {}", b.step);
    }
}

#[test]
fn a_run_resumed_from_any_recorded_frame_ends_in_the_same_bits() {
    let folder = Folder::new();
    let path = folder.path().join("a.rrd");
    let scene = scene();
    record_to(&path, &scene);
    let frames = states(&path);
    let last = frames.last().expect("a last frame").digest();
    let packing = Relaxation::new(&scene)
        .expect("a valid scene")
        .packing()
        .clone();
    for frame in frames.iter().step_by(frames.len() / 5) {
        let run =
            Relaxation::resume(&scene, packing.clone(), frame.clone()).expect("a frame of it");
        let end = run.last().expect("a frame").expect("no failure");
        assert_eq!(end.digest(), last, "resumed at step {}", frame.step);
    }
}

#[test]
fn the_result_names_the_digest_over_all_recorded_states() {
    let folder = Folder::new();
    let path = folder.path().join("a.rrd");
    record_to(&path, &scene());
    let mut hash = blake3::Hasher::new();
    for frame in states(&path) {
        hash.update(&frame.digest());
    }
    let result = Recording::open(&path)
        .expect("a recording")
        .find_map(|event| match event.expect("undamaged") {
            Event::Result { outcome, digest } => Some((outcome, digest)),
            _ => None,
        });
    let (outcome, digest) = result.expect("a result");
    assert!(outcome.converged && outcome.f_max <= 1e-10);
    assert_eq!(digest, *hash.finalize().as_bytes());
}

#[test]
fn a_changed_position_is_noticed_by_its_digest() {
    let folder = Folder::new();
    let path = folder.path().join("a.rrd");
    record_to(&path, &scene());
    let frames = states(&path);
    let target = &frames[frames.len() / 2];
    let mut bytes = std::fs::read(&path).expect("bytes");
    let needle = target.positions[10].x.to_le_bytes();
    let place = bytes
        .windows(8)
        .position(|w| w == needle)
        .expect("the position is in the file");
    bytes[place] ^= 1;
    std::fs::write(&path, &bytes).expect("written");
    let error = Recording::open(&path)
        .expect("the header is whole")
        .find_map(Result::err)
        .expect("the change is noticed");
    match error {
        ReadError::Digest { step, intact, .. } => {
            assert_eq!(step, target.step);
            assert_eq!(intact, Some(step - 7));
        }
        other => panic!("not the digest: {other}"),
    }
}

#[test]
fn other_files_are_told_apart_from_recordings() {
    let folder = Folder::new();
    let open = |bytes: &[u8]| {
        let path = folder.path().join("x.rrd");
        std::fs::write(&path, bytes).expect("written");
        Recording::open(&path).err().expect("refused").to_string()
    };
    assert!(open(b"").contains("is not a"));
    assert!(open(b"# box = 1, 1\nx,y,radius\n").contains("is not a recording (.rrd or .mcap)"));
    let path = folder.path().join("a.rrd");
    record_to(&path, &scene());
    let bytes = std::fs::read(&path).expect("bytes");
    // Cut inside the blueprint: a rerun stream without a scene.
    assert!(open(&bytes[..2000]).contains("not a softjam recording"));
}

#[test]
fn a_disk_that_fills_up_is_reported_at_once_wherever_it_happens() {
    let scene = scene();
    let start = Relaxation::new(&scene).expect("a valid scene");
    for format in FORMATS {
        let whole = record_as(format, &scene, |_| {}).len();
        let mut failures = 0;
        for tenth in 0..10 {
            let size = whole * tenth / 10;
            let (mut run, mut bytes) = (start.clone(), Vec::new());
            let disk = SmallDisk {
                bytes: &mut bytes,
                size,
            };
            let Ok(mut recorder) = recorder(format, disk, Header::of(&scene, &run)) else {
                continue;
            };
            let error = record_all(recorder.as_mut(), &mut run, &scene, |_| {})
                .expect_err("the disk is too small");
            assert_eq!(error.kind(), io::ErrorKind::StorageFull);
            let (written, intact) = (recorder.written(), recorder.intact());
            drop(recorder);
            assert!(written <= size as u64 && bytes.len() <= size);
            // Cut back to what is whole, the file is a recording that breaks off.
            let mut recording = open(&bytes[..written as usize]).expect("a header");
            recording
                .by_ref()
                .for_each(|event| drop(event.expect("whole")));
            assert!(!recording.is_closed());
            let scheduled = |step: u64| step - step % 7;
            assert_eq!(recording.intact(), intact.map(scheduled));
            failures += 1;
        }
        assert!(failures >= 7, "{failures} disks: the test tests nothing");
    }
}

#[test]
fn rare_metrics_reach_the_file_while_the_run_goes_on() {
    let folder = Folder::new();
    for name in ["a.rrd", "a.mcap"] {
        let path = folder.path().join(name);
        let scene = scene();
        let run = Relaxation::new(&scene).expect("a valid scene");
        let mut writer = Writer::create(&path, false, Header::of(&scene, &run)).expect("a file");
        let mut send = |step| {
            let snapshot = Snapshot {
                step,
                nanoseconds: 0,
                metrics: Some(run.observables().metrics()),
                frame: None,
                contours: false,
                contacts: false,
                state: false,
                edge: false,
                stage: None,
            };
            writer.send(snapshot).expect("room");
        };
        // More than a batch spans, in fewer snapshots than are handed over together.
        (0..12).for_each(|k| send(1000 * k));
        let before = Instant::now();
        let arrived = || {
            Recording::open(&path)
                .is_ok_and(|mut file| file.any(|event| matches!(event, Ok(Event::Metric { .. }))))
        };
        while !arrived() {
            assert!(
                before.elapsed().as_secs() < 60,
                "{name}: no metrics after a minute"
            );
            sleep(Duration::from_millis(20));
        }
    }
}
