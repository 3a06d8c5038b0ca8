//! Recordings in memory, of either format, and sinks that fail.

use softjam::protocol::{Relaxation, Status};
use softjam::record::{
    Format, Header, McapRecorder, Outcome, Recorder, RrdRecorder, Snapshot, Written,
};
use softjam::replay::{Balance, Determinism, Event, ReadError, Recording, Way, determinism};
use softjam::scene::Scene;
use softjam::state::Frame;
use std::io::{self, Cursor, Write};

pub const FORMATS: [Format; 2] = [Format::Rrd, Format::Mcap];

/// A recorder of `format` that writes into `sink`.
pub fn recorder<'a>(
    format: Format,
    sink: impl Write + 'a,
    header: Header,
) -> io::Result<Box<dyn Recorder + 'a>> {
    Ok(match format {
        Format::Rrd => Box::new(RrdRecorder::new(sink, header)?),
        Format::Mcap => Box::new(McapRecorder::new(sink, header)?),
    })
}

/// Records `run` to its end, tampered with on the way by `change`.
pub fn record_all(
    recorder: &mut dyn Recorder,
    run: &mut Relaxation,
    scene: &Scene,
    mut change: impl FnMut(&mut Snapshot),
) -> io::Result<Written> {
    let first = run.step();
    loop {
        let last = run.status() != Status::Running;
        let edge = last || run.step() == first;
        if let Some(mut snapshot) = Snapshot::of(run, &scene.channels, edge) {
            change(&mut snapshot);
            recorder.record(&snapshot)?;
        }
        if last {
            return recorder.finish(Outcome::of(run));
        }
        run.advance().expect("a step");
    }
}

/// A whole recording of `scene`, tampered with on the way by `change`.
pub fn record_as(format: Format, scene: &Scene, change: impl FnMut(&mut Snapshot)) -> Vec<u8> {
    let mut run = Relaxation::new(scene).expect("a valid scene");
    let mut bytes = Vec::new();
    let mut recorder = recorder(format, &mut bytes, Header::of(scene, &run)).expect("a header");
    record_all(recorder.as_mut(), &mut run, scene, change).expect("recorded");
    drop(recorder);
    bytes
}

pub fn open(bytes: &[u8]) -> Result<Recording, ReadError> {
    let length = bytes.len() as u64;
    Recording::read("test", Cursor::new(bytes.to_vec()), length)
}

/// The verdict on the determinism of a recording, and the balance of its states with their metrics.
pub fn judged(recording: &mut Recording, way: Way) -> (Determinism, Balance) {
    let mut balance = Balance::new(recording.scene());
    let verdict = determinism(recording, way, None, |state| {
        let metrics = state.metrics.get(&state.frame.step);
        balance.check(
            &state.packing,
            &state.frame,
            metrics.map_or(&[], Vec::as_slice),
        );
    });
    (verdict.expect("a verdict"), balance)
}

pub fn states(bytes: &[u8]) -> Vec<Frame> {
    open(bytes)
        .expect("a recording")
        .filter_map(|event| match event.expect("undamaged") {
            Event::State(frame) => Some(frame),
            _ => None,
        })
        .collect()
}

/// A disk of limited size.
pub struct SmallDisk<'a> {
    pub bytes: &'a mut Vec<u8>,
    pub size: usize,
}

impl Write for SmallDisk<'_> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let left = self.size - self.bytes.len();
        if left == 0 {
            return Err(io::ErrorKind::StorageFull.into());
        }
        let n = bytes.len().min(left);
        self.bytes.extend_from_slice(&bytes[..n]);
        Ok(n)
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}
