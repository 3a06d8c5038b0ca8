//! What other programs do to a recording: its messages put together with those of another, in another order, without some of them,
//! under another name. Each is read, or named for what it is.

use crate::files::{open, recorder};
use softjam::protocol::{Relaxation, Status};
use softjam::record::{Format, Header, Outcome, Snapshot};
use softjam::replay::{Bytes, ReadError, Way, determinism};
use softjam::scene::{Scene, Schedule};
use std::collections::BTreeSet;
use std::io::Cursor;

fn scene(seed: u64) -> Scene {
    let mut scene = Scene {
        particles: 48,
        phi: 0.9,
        threshold: 1e-6,
        seed,
        ..Scene::default()
    };
    scene.channels.state = Schedule::Every(5);
    scene
}

/// What the run of a scene records from a step on, up to another or to its end.
fn part(scene: &Scene, from: u64, until: u64) -> Vec<u8> {
    let mut run = Relaxation::new(scene).expect("a scene");
    while run.step() < from {
        run.advance().expect("a step");
    }
    let mut bytes = Vec::new();
    let mut recorder =
        recorder(Format::Rrd, &mut bytes, Header::of(scene, &run)).expect("a header");
    loop {
        let ended = run.status() != Status::Running;
        let edge = ended || run.step() == from;
        if let Some(snapshot) = Snapshot::of(&run, &scene.channels, edge) {
            recorder.record(&snapshot).expect("recorded");
        }
        if ended || run.step() == until {
            recorder.finish(Outcome::of(&run)).expect("closed");
            break;
        }
        run.advance().expect("a step");
    }
    drop(recorder);
    bytes
}

/// Bytes in front of the first message, and of the head of a message.
const START: usize = 12;
const HEAD: usize = 16;

/// The messages of an `.rrd` file; what is behind the last is its end.
fn messages(bytes: &[u8]) -> (&[u8], Vec<&[u8]>, &[u8]) {
    let (mut place, mut found) = (START, Vec::new());
    loop {
        let head = &bytes[place..place + HEAD];
        let length = u64::from_le_bytes(head[8..].try_into().expect("8 bytes")) as usize;
        // The last kind of all.
        if head[0] == 0 {
            return (&bytes[..START], found, &bytes[place..]);
        }
        found.push(&bytes[place..place + HEAD + length]);
        place += HEAD + length;
    }
}

/// A file of these messages.
fn file(of: &[u8], chosen: &[&[u8]]) -> Vec<u8> {
    let (start, _, end) = messages(of);
    [start, &chosen.concat(), end].concat()
}

fn names(message: &[u8], text: &str) -> bool {
    message.windows(text.len()).any(|w| w == text.as_bytes())
}

/// Whether it holds rows of an entity.
fn is_of(message: &[u8], entity: &str) -> bool {
    // A string stands between the last byte of its length and a zero.
    names(message, &format!("\0{entity}\0"))
}

fn first_error(bytes: &[u8]) -> ReadError {
    match open(bytes) {
        Ok(mut recording) => recording.find_map(Result::err).expect("an error"),
        Err(error) => error,
    }
}

#[test]
fn parts_of_one_run_and_recordings_of_several_in_one_file_are_told_apart() {
    let (one, other) = (scene(1), scene(2));
    let (whole, first, rest) = (
        part(&one, 0, u64::MAX),
        part(&one, 0, 40),
        part(&one, 40, u64::MAX),
    );
    let foreign = part(&other, 0, u64::MAX);
    let all = |bytes: &[u8]| messages(bytes).1.concat();
    let behind = |a: &[u8], b: &[u8]| file(a, &[&all(a), &all(b)]);
    for (a, b) in [(&first, &rest), (&rest, &first), (&whole, &whole)] {
        let error = first_error(&behind(a, b));
        assert!(matches!(error, ReadError::Parts { .. }), "{error}");
        assert!(error.to_string().contains("softjam join"), "{error}");
    }
    for b in [&rest, &whole] {
        let error = first_error(&behind(&foreign, b));
        assert!(matches!(error, ReadError::Several { .. }), "{error}");
    }
    // Merged: one opening, the rows of both, and of two headers the later, behind them.
    let (_, a, _) = messages(&first);
    let (_, b, _) = messages(&rest);
    let is_header = |m: &&&[u8]| is_of(m, "/scene") || is_of(m, "/particles");
    let rows = |m: &&&[u8]| is_of(m, "/state") || names(m, "/metrics/");
    let opening: Vec<&[u8]> = a
        .iter()
        .take_while(|m| !is_of(m, "/scene"))
        .copied()
        .collect();
    let merged: Vec<&[u8]> = opening
        .iter()
        .copied()
        .chain(a.iter().filter(rows).copied())
        .chain(b.iter().filter(is_header).copied())
        .chain(b.iter().filter(rows).copied())
        .collect();
    let error = first_error(&file(&rest, &merged));
    assert!(matches!(error, ReadError::Parts { .. }), "{error}");
    let ahead: Vec<&[u8]> = opening
        .iter()
        .copied()
        .chain(a.iter().filter(is_header).copied())
        .chain(a.iter().filter(rows).copied())
        .chain(b.iter().filter(rows).copied())
        .collect();
    let text = first_error(&file(&rest, &ahead)).to_string();
    assert!(
        text.contains(
            "several parts of one run, states of some steps more than once (40 follows 40)"
        ),
        "{text}"
    );
}

#[test]
fn states_out_of_order_and_states_that_were_taken_out_are_told_apart() {
    let whole = part(&scene(1), 0, u64::MAX);
    let (_, all, _) = messages(&whole);
    let states: Vec<usize> = (0..all.len())
        .filter(|k| is_of(all[*k], "/state"))
        .collect();
    assert!(states.len() >= 2, "the first state has a chunk of its own");
    let mut swapped = all.clone();
    swapped.swap(states[0], states[1]);
    let text = first_error(&file(&whole, &swapped)).to_string();
    assert!(
        text.contains("its states are out of order: the first is that of step 5, not 0"),
        "{text}"
    );
    let without = |entity: &str| -> Vec<&[u8]> {
        all.iter().filter(|m| !is_of(m, entity)).copied().collect()
    };
    let cases = [
        ("/state", "it holds none: they were taken out of it"),
        ("/scene", "it has no scene"),
        ("/particles", "it has no radii"),
    ];
    for (entity, words) in cases {
        let text = first_error(&file(&whole, &without(entity))).to_string();
        assert!(text.contains(words), "{entity}: {text}");
    }
    let mut missing = all.clone();
    missing.remove(states[0]);
    let text = first_error(&file(&whole, &missing)).to_string();
    assert!(
        text.contains("the first state is that of step 5, not 0"),
        "{text}"
    );
}

#[test]
fn a_recording_under_another_name_is_read_but_not_under_that_of_another_scene() {
    let whole = part(&scene(1), 0, u64::MAX);
    let id = softjam::record::recording_id(&scene(1));
    let named = |name: &str| {
        assert_eq!(name.len(), id.len());
        let mut bytes = whole.clone();
        for k in 0..bytes.len() - id.len() {
            if bytes[k..].starts_with(id.as_bytes()) {
                bytes[k..k + id.len()].copy_from_slice(name.as_bytes());
            }
        }
        bytes
    };
    let renamed = named("my favourite run, the first one.");
    let mut recording = open(&renamed).expect("it is read");
    let file = Box::new(Cursor::new(renamed.clone()));
    let found = determinism(&mut recording, Way::Whole, Some(file), |_| {}).expect("a verdict");
    assert_eq!(
        (found.difference, found.bytes),
        (None, Bytes::LaidOutOtherwise)
    );
    assert!(!recording.is_laid_out_by_softjam());
    let error = first_error(&named(&softjam::record::recording_id(&scene(2))));
    assert!(matches!(error, ReadError::Changed { .. }), "{error}");
}

#[test]
fn the_parts_of_a_run_have_no_chunk_of_one_number() {
    // Viewers and programs that merge files take two chunks of one number for the same.
    let id = softjam::record::recording_id(&scene(1));
    // Every run of 32 hexadecimal digits in the messages of states, but for the name of the recording.
    let ids = |bytes: &[u8]| -> BTreeSet<String> {
        let (_, all, _) = messages(bytes);
        let states = all.iter().filter(|m| is_of(m, "/state"));
        let runs = states.flat_map(|m| m.split(|b| !b.is_ascii_hexdigit()));
        let names = runs.filter(|run| run.len() == 32);
        let names = names.map(|run| String::from_utf8_lossy(run).into_owned());
        names.filter(|name| *name != id).collect()
    };
    let (first, rest) = (part(&scene(1), 0, 40), part(&scene(1), 40, u64::MAX));
    let (a, b) = (ids(&first), ids(&rest));
    assert!(!a.is_empty() && !b.is_empty());
    assert!(a.is_disjoint(&b), "{a:?} {b:?}");
}
