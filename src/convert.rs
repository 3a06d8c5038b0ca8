//! Converting recordings: `.rrd` ⇄ `.mcap`, with more channels or fewer.
//!
//! States, metrics, scene and result go over as they are. Contours and contacts are drawn anew from the states, and so is
//! whatever else the channels ask for at steps that the recording does not hold: a frame determines the next one, so the
//! run is walked again from the recorded frame before, and has to arrive at the recorded frame behind.
//!
//! ```
//! use softjam::{convert, record, protocol::Relaxation, replay::Recording, scene::{Channels, Scene}};
//!
//! let folder = std::env::temp_dir();
//! let path = |name: &str| folder.join(format!("softjam-convert-example-{name}"));
//! let scene = Scene { particles: 32, phi: 0.9, ..Scene::default() };
//! let mut run = Relaxation::new(&scene).unwrap();
//! let writer = record::Writer::create(path("a.rrd"), true, record::Header::of(&scene, &run)).unwrap();
//! record::record(&mut run, vec![writer], &scene.channels, |_| true).unwrap();
//!
//! for (from, to) in [("a.rrd", "b.mcap"), ("b.mcap", "c.rrd")] {
//!     let mut recording = Recording::open(path(from)).unwrap();
//!     let header = convert::header(&recording, scene.channels).unwrap();
//!     let writer = record::Writer::create(path(to), true, header).unwrap();
//!     convert::convert(&mut recording, writer, &scene.channels).unwrap();
//! }
//! assert!(std::fs::read(path("a.rrd")).unwrap() == std::fs::read(path("c.rrd")).unwrap());
//! # for name in ["a.rrd", "b.mcap", "c.rrd"] { std::fs::remove_file(path(name)).unwrap(); }
//! ```

use crate::analysis::{METRICS, Metrics, metrics_of};
use crate::minimize::dt_and_time;
use crate::protocol::{RelaxError, Relaxation, Status};
use crate::record::{
    Header, Outcome, PROGRAM, RecordError, Snapshot, Snapshots, Writer, Written, nanoseconds,
};
use crate::replay::{Event, ReadError, Recording};
use crate::scene::{Channels, Scene, SceneError, Schedule};
use crate::state::Frame;
use crate::text::counted;
use crate::text::shown;
use std::collections::BTreeMap;

/// What a conversion came to.
///
/// See the example of the [module](self).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Converted {
    /// How the run ended; `None` if the recording is one of an unfinished run.
    pub outcome: Option<Outcome>,
    /// What was written.
    pub written: Written,
    /// Steps that were walked again, because the recording does not hold what was asked for.
    pub rebuilt: u64,
}

/// Why a recording cannot be converted.
///
/// ```
/// use softjam::convert::ConvertError;
/// let error = ConvertError::NoState { path: "run.rrd".to_owned() };
/// assert!(error.to_string().contains("only its metrics can be converted"));
/// ```
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ConvertError {
    /// The recording is damaged; what is whole has been converted.
    #[error(transparent)]
    Read(#[from] ReadError),
    /// The new file could not be written.
    #[error(transparent)]
    Write(#[from] RecordError),
    /// The run could not be walked again.
    #[error(transparent)]
    Run(#[from] RelaxError),
    /// The channels are out of range.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// The channels ask for what only a state can give.
    #[error(
        "{} holds no states, so nothing can be rebuilt from it: only its metrics can be converted, with \
         `--channels metrics` and their schedule as it is",
        shown(.path)
    )]
    NoState {
        /// Path of the recording.
        path: String,
    },
    /// Walking the run again did not lead to the recorded frame.
    #[error(
        "walking again from step {from} does not lead to the recorded state of step {step}: see `softjam replay {}`",
        shown(.path)
    )]
    Differs {
        /// Path of the recording.
        path: String,
        /// The recorded step before.
        from: u64,
        /// The recorded step behind.
        step: u64,
    },
}

/// The header of a conversion of `recording` to `channels`.
///
/// # Errors
///
/// [`ConvertError::NoState`] if the recording does not hold what the channels need, [`ConvertError::Scene`] if they are out of
/// range.
///
/// See the example of the [module](self).
pub fn header(recording: &Recording, channels: Channels) -> Result<Header, ConvertError> {
    can_be_rebuilt(recording, &channels)?;
    let mut header = Header {
        program: PROGRAM.to_owned(),
        ..recording.header()?
    };
    header.scene.channels = channels;
    header.scene.validate()?;
    if channels.contours.is_on() || channels.contacts.is_on() {
        let particles = recording.radii().len();
        let name = format!("drawing {}", counted(particles, "particle"));
        recording.allow(name, header.scene.memory_estimate(particles))?;
    }
    Ok(header)
}

/// Writes what `channels` ask of `recording` with `writer`, whose header is that of [`header`].
///
/// The new file takes its place when it is whole.
///
/// # Errors
///
/// [`ConvertError`]. With [`ConvertError::Read`] the new file is closed as one of an unfinished run and holds the states that came
/// before the damage; if there were none, or with any other error, there is no new file, and one that was there is as it was.
///
/// See the example of the [module](self).
pub fn convert(
    recording: &mut Recording,
    writer: Writer,
    channels: &Channels,
) -> Result<Converted, ConvertError> {
    writer.wait_until_whole();
    can_be_rebuilt(recording, channels)?;
    let mut conversion = Conversion {
        writer,
        channels: *channels,
        first: recording.from_step(),
        has_states: recording.scene().channels.state.is_on(),
        stage: 0,
        has: metrics_at(recording.scene(), recording.scene().last_stage()),
        waiting: BTreeMap::new(),
        last: None,
        rebuilt: 0,
    };
    let mut damage = None;
    while damage.is_none() {
        match recording.next() {
            None => break,
            // Not damaged, but not of one run: half of it would be of no use.
            Some(Err(error @ ReadError::Join { .. })) => return Err(error.into()),
            Some(Err(error)) => damage = Some(error),
            Some(Ok(Event::State(frame))) => conversion.arrive(recording, frame)?,
            Some(Ok(Event::Metric {
                name,
                step,
                nanoseconds,
                value,
            })) => {
                conversion.keep(name, step, nanoseconds, value);
                if !conversion.has_states {
                    conversion.write_whole_rows()?;
                }
            }
            Some(Ok(Event::Drawn { .. } | Event::Result { .. })) => {}
        }
    }
    conversion.end(recording, damage)
}

/// Without states only the metrics can go over, as they are.
fn can_be_rebuilt(recording: &Recording, wanted: &Channels) -> Result<(), ConvertError> {
    let held = &recording.scene().channels;
    let pictures = [wanted.contours, wanted.contacts, wanted.state];
    if !held.state.is_on()
        && (pictures.into_iter().any(Schedule::is_on)
            || (wanted.metrics.is_on() && wanted.metrics != held.metrics))
    {
        return Err(ConvertError::NoState {
            path: recording.path().to_owned(),
        });
    }
    Ok(())
}

/// Steps whose metrics wait for the next state.
const MOST_WAITING: usize = 1 << 17;

/// A conversion on its way.
struct Conversion {
    writer: Writer,
    channels: Channels,
    /// The step that the recording begins with.
    first: u64,
    /// Whether there are states to wait for.
    has_states: bool,
    /// The stage of the last recorded frame, and which metrics it has; those of the last stage before the first.
    stage: u32,
    has: [bool; METRICS.len()],
    /// Metrics of steps that are not written yet.
    waiting: BTreeMap<u64, Row>,
    /// The last recorded frame; not written yet, since the last of all is written by every channel.
    last: Option<Frame>,
    rebuilt: u64,
}

/// The metrics of a step as far as they have been read.
#[derive(Clone, Copy, Default)]
struct Row {
    nanoseconds: i64,
    values: [Option<f64>; METRICS.len()],
}

/// Which metrics the rows of a stage have.
fn metrics_at(scene: &Scene, stage: u32) -> [bool; METRICS.len()] {
    let is_of_disks = stage == 0 && scene.records_disks();
    let is_strained = !scene.protocol.is_empty() && !is_of_disks;
    metrics_of(scene.stage(stage).model, is_strained)
}

impl Row {
    /// The metrics, if all are there that a row `has`.
    fn whole(&self, has: &[bool; METRICS.len()]) -> Option<Metrics> {
        let mut had = self.values.iter().zip(has);
        had.all(|(value, has)| value.is_some() || !has)
            .then_some(self.values)
    }
}

impl Conversion {
    fn keep(&mut self, name: &str, step: u64, nanoseconds: i64, value: f64) {
        if self.waiting.len() > MOST_WAITING {
            // A state far away is walked to, and the metrics on the way are found anew; without states a row that nothing
            // makes whole is given up.
            if self.has_states {
                self.waiting.pop_last();
            } else {
                self.waiting.pop_first();
            }
        }
        if let Some(place) = METRICS.iter().position(|known| *known == name) {
            let row = self.waiting.entry(step).or_default();
            row.nanoseconds = nanoseconds;
            row.values[place] = Some(value);
        }
    }

    /// A recorded frame: everything in front of it can be written.
    fn arrive(&mut self, recording: &Recording, frame: Frame) -> Result<(), ConvertError> {
        if let Some(from) = self.last.take() {
            self.write_frame(recording, &from, false)?;
            let behind = from.step + 1;
            let channels = recording.scene().scheduled(&self.channels, from.stage);
            if self.lacks_something(&channels, behind, frame.step) {
                self.walk(recording, from, &frame)?;
            } else {
                let rows: Vec<_> = self.waiting.range(behind..frame.step).collect();
                let rows: Vec<(u64, Row)> = rows.into_iter().map(|(k, row)| (*k, *row)).collect();
                for (step, row) in rows {
                    self.write_row(step, row)?;
                }
            }
        }
        self.waiting = self.waiting.split_off(&frame.step);
        self.last = Some(frame);
        Ok(())
    }

    /// Whether the channels ask for something at the steps from `behind` to before `until` that was not recorded.
    fn lacks_something(&self, channels: &Channels, behind: u64, until: u64) -> bool {
        let Channels {
            contours,
            contacts,
            metrics,
            state,
            ..
        } = *channels;
        let asks = |schedule: Schedule| {
            let first = behind.checked_sub(1).and_then(|step| schedule.after(step));
            first.filter(|step| *step < until)
        };
        if [contours, contacts, state]
            .into_iter()
            .any(|s| asks(s).is_some())
        {
            return true;
        }
        let mut step = asks(metrics);
        while let Some(k) = step.filter(|k| *k < until) {
            let row = self.waiting.get(&k);
            if row.and_then(|row| row.whole(&self.has)).is_none() {
                return true;
            }
            step = metrics.after(k);
        }
        false
    }

    /// Walks the run again from a recorded frame to the next.
    fn walk(&mut self, recording: &Recording, from: Frame, to: &Frame) -> Result<(), ConvertError> {
        let start = from.step;
        let packing = recording.packing(&from)?;
        recording.check_run(&from)?;
        let mut run = Relaxation::resume(recording.scene(), packing, from)?;
        let mut snapshots = Snapshots::default();
        let differs = || ConvertError::Differs {
            path: recording.path().to_owned(),
            from: start,
            step: to.step,
        };
        loop {
            if run.status() != Status::Running {
                // It ends before it comes there.
                return Err(differs());
            }
            run.advance()?;
            if run.step() == to.step {
                break;
            }
            self.rebuilt += 1;
            if let Some(snapshot) = snapshots.take(&run, &self.channels, false) {
                self.writer.send(snapshot)?;
            }
        }
        if run.frame().digest() == to.digest() {
            Ok(())
        } else {
            Err(differs())
        }
    }

    /// Writes a recorded frame and its metrics.
    fn write_frame(
        &mut self,
        recording: &Recording,
        frame: &Frame,
        last: bool,
    ) -> Result<(), ConvertError> {
        let step = frame.step;
        let begins_stage = core::mem::replace(&mut self.stage, frame.stage) != frame.stage;
        let again = || -> Result<Relaxation, ConvertError> {
            let packing = recording.packing(frame)?;
            Ok(Relaxation::resume(
                recording.scene(),
                packing,
                frame.clone(),
            )?)
        };
        // Which states a protocol has relaxed, and where its stages end, is not told by a frame alone.
        let of_protocol = (!recording.scene().protocol.is_empty()).then(again);
        let of_protocol = of_protocol.transpose()?;
        let is_relaxed = (of_protocol.as_ref()).is_some_and(Relaxation::is_relaxed_state);
        let edge = last || step == self.first || begins_stage || is_relaxed;
        let channels = recording.scene().scheduled(&self.channels, frame.stage);
        let [contours, contacts, metrics, state] = channels.at(step, edge);
        self.has = metrics_at(recording.scene(), frame.stage);
        let row = self.waiting.get(&step);
        let row = row.and_then(|row| row.whole(&self.has));
        let metrics = match (metrics, row) {
            (false, _) => None,
            (true, Some(recorded)) => Some(recorded),
            (true, None) => Some(again()?.observables().metrics()),
        };
        let pictured = contours || contacts || state;
        if pictured || metrics.is_some() {
            self.writer.send(Snapshot {
                step,
                nanoseconds: nanoseconds(dt_and_time(&frame.minimizer).1),
                metrics,
                frame: pictured.then(|| frame.clone()),
                contours,
                contacts,
                state,
                edge,
                stage: of_protocol.and_then(|run| run.stage_end()).map(Box::new),
            })?;
        }
        Ok(())
    }

    /// Writes the metrics of a step that has no recorded frame.
    fn write_row(&mut self, step: u64, row: Row) -> Result<(), ConvertError> {
        let metrics = row.whole(&self.has);
        let metrics = metrics.filter(|_| self.channels.metrics.includes(step));
        if metrics.is_some() {
            self.writer.send(Snapshot {
                step,
                nanoseconds: row.nanoseconds,
                metrics,
                frame: None,
                contours: false,
                contacts: false,
                state: false,
                edge: false,
                stage: None,
            })?;
        }
        Ok(())
    }

    /// Writes the metrics that are whole, where there are no states to wait for.
    fn write_whole_rows(&mut self) -> Result<(), ConvertError> {
        while let Some(entry) = self.waiting.first_entry()
            && let Some(metrics) = entry.get().whole(&self.has)
        {
            let (step, row) = entry.remove_entry();
            self.writer.send(Snapshot {
                step,
                nanoseconds: row.nanoseconds,
                metrics: Some(metrics),
                frame: None,
                contours: false,
                contacts: false,
                state: false,
                edge: false,
                stage: None,
            })?;
        }
        Ok(())
    }

    /// The last frame, and the end of the file.
    fn end(
        mut self,
        recording: &Recording,
        damage: Option<ReadError>,
    ) -> Result<Converted, ConvertError> {
        let nothing = recording.scene().channels.state.is_on() && recording.intact().is_none();
        if nothing && (damage.is_some() || !recording.is_closed()) {
            return Err(damage.map_or_else(
                || {
                    ConvertError::Read(ReadError::Damaged {
                        path: recording.path().to_owned(),
                        problem: "it breaks off before its first state".to_owned(),
                        intact: None,
                    })
                },
                ConvertError::Read,
            ));
        }
        if let Some(frame) = self.last.take() {
            // The last recorded frame of a file that breaks off is only the last if it is not on the schedule.
            self.write_frame(recording, &frame, true)?;
        }
        let outcome = recording.outcome();
        let written = self.writer.finish(outcome)?;
        match damage {
            Some(error) => Err(error.into()),
            None => Ok(Converted {
                outcome,
                written,
                rebuilt: self.rebuilt,
            }),
        }
    }
}
