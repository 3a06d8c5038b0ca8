//! Damage: flipped bits and files that break off.

use crate::common::Random;
use crate::files::{open, states};
use crate::replay::{record, replay, scene};
use softjam::analysis::METRICS;
use softjam::replay::{Event, ReadError, Way};
use softjam::scene::Scene;
use softjam::state::Frame;

/// Where the numbers of a recorded state lie in the file: positions, velocities, contacts, forces, minimiser; without
/// those that another state shares, like the contacts of a packing that has settled.
fn state_bytes(bytes: &[u8], frame: &Frame) -> Vec<std::ops::Range<usize>> {
    let vectors = |v: &[softjam::domain::Vec2]| -> Vec<u8> {
        v.iter()
            .flat_map(|p| [p.x, p.y])
            .flat_map(f64::to_le_bytes)
            .collect()
    };
    let parts: [Vec<u8>; 5] = [
        vectors(&frame.positions),
        vectors(&frame.velocities),
        frame
            .contacts
            .iter()
            .flatten()
            .flat_map(|c| c.to_le_bytes())
            .collect(),
        frame.forces.iter().flat_map(|f| f.to_le_bytes()).collect(),
        frame
            .minimizer
            .values()
            .iter()
            .flat_map(|v| v.to_le_bytes())
            .collect(),
    ];
    parts
        .iter()
        .filter_map(|part| {
            let mut places =
                (0..=bytes.len() - part.len()).filter(|p| bytes[*p..].starts_with(part.as_slice()));
            let start = places.next()?;
            places.next().is_none().then(|| start..start + part.len())
        })
        .collect()
}

#[test]
fn any_flipped_bit_of_a_state_is_noticed_with_its_step() {
    let mut bytes = record(&scene(), |_| {});
    let frames = states(&bytes);
    let mut random = Random::new(3);
    for attempt in 0..200 {
        // Velocities of frame 0 are zeros, which are everywhere.
        let frame = &frames[1 + random.below(frames.len() - 1)];
        let ranges = state_bytes(&bytes, frame);
        assert!(
            ranges.len() >= 4,
            "positions, velocities, forces and minimiser are never the same"
        );
        let range = &ranges[random.below(ranges.len())];
        let (place, bit) = (
            range.start + random.below(range.len()),
            1 << random.below(8),
        );
        bytes[place] ^= bit;
        let result = replay(&bytes, Way::Segments(2));
        let text = match result {
            Err(error) => error.to_string(),
            Ok(verdict) => verdict.difference.expect("noticed").to_string(),
        };
        assert!(
            text.contains(&format!("step {}", frame.step)),
            "attempt {attempt}: {text}"
        );
        bytes[place] ^= bit;
    }
}

#[test]
fn a_recording_cut_anywhere_never_passes_for_a_whole_one() {
    let bytes = record(&scene(), |_| {});
    let mut random = Random::new(4);
    let mut whole_states = 0;
    for _ in 0..200 {
        let length = random.below(bytes.len());
        let Ok(mut recording) = open(&bytes[..length]) else {
            continue;
        };
        let read: Result<Vec<Event>, ReadError> = recording.by_ref().collect();
        assert!(
            read.is_err() || !recording.is_closed(),
            "{length} of {} bytes",
            bytes.len()
        );
        whole_states += u32::from(recording.intact().is_some());
    }
    assert!(
        whole_states > 0,
        "no cut left a state: the test tests nothing"
    );
    assert!({
        let mut recording = open(&bytes).expect("whole");
        recording.by_ref().for_each(drop);
        recording.is_closed()
    });
}

#[test]
fn a_recording_cut_between_its_columns_is_what_its_scene_gives_as_far_as_it_goes() {
    let bytes = record(&scene(), |_| {});
    let columns = f64::from(METRICS.len() as u32);
    let mut between = 0;
    for k in 1..60 {
        let part = &bytes[..bytes.len() * k / 60];
        for way in [Way::Whole, Way::Segments(2)] {
            // Without a state there is nothing to replay.
            let Ok(verdict) = replay(part, way) else {
                continue;
            };
            assert_eq!(verdict.difference, None, "{way:?}, {} bytes", part.len());
            let rows = verdict.metrics as f64 / columns;
            between += u32::from(rows.fract() != 0.0);
        }
    }
    assert!(
        between > 0,
        "no cut was between columns: the test tests nothing"
    );
}

#[test]
fn flipped_bits_anywhere_never_panic() {
    let bytes = record(
        &Scene {
            particles: 32,
            steps: 60,
            ..scene()
        },
        |_| {},
    );
    let mut random = Random::new(5);
    for _ in 0..2000 {
        let mut copy = bytes.clone();
        for _ in 0..=random.below(4) {
            let place = random.below(copy.len());
            copy[place] ^= 1 << random.below(8);
        }
        if let Ok(recording) = open(&copy) {
            recording.for_each(drop);
        }
    }
}
