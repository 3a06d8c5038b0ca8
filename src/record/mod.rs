//! Recordings: what a run looked like, for the rerun viewer, for a collaborator and for a replay.
//!
//! A run is recorded as a sequence of [`Snapshot`]s: a step, what is recorded of it, and nothing else. What no channel
//! asks for is not computed. A [`Recorder`] turns snapshots into a file: [`RrdRecorder`] for the rerun viewer,
//! [`McapRecorder`] for Foxglove and everything else that reads MCAP. [`Writer`] runs one on a thread of its own behind a
//! bounded queue; when it fails, the next snapshot fails with it, so that a full disk ends the run instead of emptying it. The file
//! is a [`NewFile`], which takes its place with the first snapshot: a file under its own name holds a state.
//!
//! ```
//! use softjam::{record, protocol::Relaxation, scene::Scene};
//!
//! let path = std::env::temp_dir().join("softjam-record-example.rrd");
//! let scene = Scene { particles: 32, phi: 0.9, ..Scene::default() };
//! let mut run = Relaxation::new(&scene).unwrap();
//! let writer = record::Writer::create(&path, true, record::Header::of(&scene, &run)).unwrap();
//! let summary = record::record(&mut run, vec![writer], &scene.channels, |_| true).unwrap();
//! assert!(summary.files[0].bytes > 0);
//! # std::fs::remove_file(&path).unwrap();
//! ```

mod blueprint;
mod cells;
mod columns;
mod encode;
mod file;
mod format;
mod header;
mod hover;
mod images;
mod ipc;
mod legend;
mod legs;
mod live;
mod mcap;
pub(crate) mod messages;
mod patience;
mod pictures;
mod pipeline;
mod redraw;
mod rows;
mod rrd;
mod scene_update;
mod sink;
mod snapshot;
mod states;
mod writer;

pub use file::{NewFile, abandon_new_files, part_of, same_file};
pub use format::Format;
pub use legs::Leg;
pub use live::{Ended, Live, LiveError, Shown, Viewer};
pub use mcap::McapRecorder;
pub use rrd::RrdRecorder;
pub use snapshot::Snapshot;
pub use writer::{Writer, Written};

pub(crate) use legs::{from_text as legs_from_text, to_text as legs_to_text};
pub(crate) use snapshot::{Snapshots, nanoseconds};

use crate::analysis::Stability;
use crate::protocol::{RelaxError, Relaxation, Status};
use crate::scene::{Channels, Scene};
use crate::state::Packing;
use crate::text::{counted, shown};
use std::io;
use std::sync::Arc;

/// The version of the recording's layout; a reader refuses newer ones.
pub const FORMAT_VERSION: u32 = 2;

/// The program as it is named in recordings.
pub const PROGRAM: &str = concat!(env!("CARGO_PKG_NAME"), " ", env!("CARGO_PKG_VERSION"));

/// The id of a recording of `scene`: the first half of the scene's BLAKE3 in hexadecimal, so that the same scene has the
/// same id.
///
/// ```
/// use softjam::{record::recording_id, scene::Scene};
/// assert_eq!(recording_id(&Scene::default()).len(), 32);
/// ```
#[must_use]
pub fn recording_id(scene: &Scene) -> String {
    id_of(scene.digest(), None)
}

/// The id of a recording of a scene whose text has this BLAKE3, after these [legs](Leg).
pub(crate) fn id_of(digest: [u8; 32], legs: Option<&str>) -> String {
    let scene = blake3::Hash::from_bytes(digest).to_hex();
    match legs {
        None => scene[..32].to_owned(),
        Some(legs) => blake3::hash(format!("{scene}{legs}").as_bytes()).to_hex()[..32].to_owned(),
    }
}

/// What a recording says of itself before its first frame.
///
/// ```
/// use softjam::{record::Header, protocol::Relaxation, scene::Scene};
///
/// let scene = Scene { particles: 32, ..Scene::default() };
/// let run = Relaxation::new(&scene).unwrap();
/// assert_eq!(Header::of(&scene, &run).from_step, 0);
/// ```
#[derive(Clone, Debug)]
pub struct Header {
    /// The scene, with every default.
    pub scene: Scene,
    /// Radii and box.
    pub packing: Packing,
    /// The step of the first frame; not 0 if the run goes on from another recording.
    pub from_step: u64,
    /// How its run came to that step, where not as a run of its scene would; empty otherwise.
    pub legs: Vec<Leg>,
    /// The version of the layout; [`FORMAT_VERSION`] but for what an older version laid out.
    pub format: u32,
    /// The program that writes the recording, as `softjam 0.4.0`.
    pub program: String,
    /// The [revision of the bits](crate::BITS) that its states were computed with.
    pub bits: u32,
}

impl Header {
    /// The header of a recording that begins with the present step of `run`.
    #[must_use]
    pub fn of(scene: &Scene, run: &Relaxation) -> Self {
        Self {
            scene: scene.clone(),
            packing: run.packing().clone(),
            from_step: run.step(),
            legs: Vec::new(),
            format: FORMAT_VERSION,
            program: PROGRAM.to_owned(),
            bits: crate::BITS,
        }
    }

    /// The scene as the recording has it.
    pub(crate) fn toml(&self) -> String {
        self.scene.to_toml_of(self.format)
    }

    /// BLAKE3 of [`toml`](Self::toml).
    pub(crate) fn digest(&self) -> [u8; 32] {
        *blake3::hash(self.toml().as_bytes()).as_bytes()
    }
}

/// Turns snapshots into a file of one format.
///
/// ```
/// use softjam::record::{Header, McapRecorder, Recorder, RrdRecorder, Snapshot};
/// use softjam::{protocol::Relaxation, scene::Scene};
///
/// let scene = Scene { particles: 32, ..Scene::default() };
/// let run = Relaxation::new(&scene).unwrap();
/// let header = Header::of(&scene, &run);
/// let snapshot = Snapshot::of(&run, &scene.channels, true).unwrap();
/// let (mut rrd, mut mcap) = (Vec::new(), Vec::new());
/// let recorders: [Box<dyn Recorder + '_>; 2] = [
///     Box::new(RrdRecorder::new(&mut rrd, header.clone()).unwrap()),
///     Box::new(McapRecorder::new(&mut mcap, header).unwrap()),
/// ];
/// for mut recorder in recorders {
///     recorder.record(&snapshot).unwrap();
///     let written = recorder.finish(None).unwrap();
///     assert_eq!((written.states, written.bytes), (1, recorder.written()));
///     assert_eq!(recorder.intact(), Some(0), "step 0 is in the file");
/// }
/// ```
pub trait Recorder {
    /// Takes a snapshot; snapshots come in ascending steps. It reaches the sink with its batch.
    ///
    /// # Errors
    ///
    /// Whatever the sink fails with; [`intact`](Self::intact) is then the last step that it holds in full.
    fn record(&mut self, snapshot: &Snapshot) -> io::Result<()>;

    /// The last step that the sink holds in full.
    fn intact(&self) -> Option<u64>;

    /// Bytes that the sink holds and that make sense on their own: what comes behind them is a torn end.
    fn written(&self) -> u64;

    /// Writes what is left and the outcome and closes the file. Without an outcome the recording is one of an
    /// unfinished run.
    ///
    /// # Errors
    ///
    /// Whatever the sink fails with.
    fn finish(&mut self, outcome: Option<Outcome>) -> io::Result<Written>;
}

/// How a run ended, as it is recorded.
///
/// ```
/// use softjam::{record::Outcome, analysis::Stability};
/// let stability = Some(Stability::Minimum);
/// let outcome = Outcome { converged: true, steps: 9, f_max: 1e-11, stability };
/// assert_eq!(outcome.to_string(), "converged in 9 steps to a minimum");
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Outcome {
    /// Whether `f_max` fell to the threshold.
    pub converged: bool,
    /// Moves made.
    pub steps: u64,
    /// The last `f_max` (units of γ).
    pub f_max: f64,
    /// Of a converged run, whether it is a minimum; recordings of 0.2.0 and before do not say.
    pub stability: Option<Stability>,
}

impl Outcome {
    /// How `run` has ended; `None` if it goes on.
    #[must_use]
    pub fn of(run: &Relaxation) -> Option<Self> {
        let status = run.status();
        (status != Status::Running).then(|| Self {
            converged: status == Status::Converged,
            steps: run.step(),
            f_max: run.f_max(),
            stability: run.stability(),
        })
    }
}

/// In words, such as `converged in 9 steps to a minimum`.
impl core::fmt::Display for Outcome {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        let steps = counted(self.steps, "step");
        if !self.converged {
            return write!(f, "not converged within {steps}");
        }
        write!(f, "converged in {steps}")?;
        match self.stability {
            Some(Stability::Minimum) => write!(f, " to a minimum"),
            Some(Stability::Saddle) => write!(f, " on a saddle: balanced, but not stable"),
            Some(Stability::NotJammed) => write!(f, ", not jammed: no contact bears a force"),
            Some(Stability::NotJudged) => write!(f, ", minimum or saddle not judged"),
            None => Ok(()),
        }
    }
}

/// What a recorded run came to.
///
/// See the example of the [module](self).
#[derive(Clone, Debug, PartialEq)]
pub struct Summary {
    /// How the run ended; `None` if it was interrupted.
    pub outcome: Option<Outcome>,
    /// What was written, a file each.
    pub files: Vec<Written>,
}

/// Why a recording could not be made.
///
/// ```
/// use softjam::record::RecordError;
/// let error = RecordError::Exists { path: "run.rrd".to_owned() };
/// assert!(error.to_string().contains("--force"));
/// ```
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RecordError {
    /// The file exists and is not to be replaced.
    #[error("{} exists; say --force to replace it, or name another file", shown(.path))]
    Exists {
        /// Path of the file.
        path: String,
    },
    /// Somebody else is writing the file.
    #[error(
        "{path} is being written by another softjam ({locked} is locked); wait for it, or name another file"
    )]
    Busy {
        /// Path of the file.
        path: String,
        /// The file whose lock the other holds.
        locked: String,
    },
    /// The name says no format.
    #[error("{}: the name of a recording ends in .rrd (rerun) or .mcap (Foxglove)", shown(.path))]
    Name {
        /// Path of the file.
        path: String,
    },
    /// The name says another format than was asked for.
    #[error("{}: the name of an MCAP file ends in .mcap; .rrd files are for -o", shown(.path))]
    NotMcap {
        /// Path of the file.
        path: String,
    },
    /// The file is one that the run reads from.
    #[error("{} is what is read from; name another file to write", shown(.path))]
    Input {
        /// Path of the file.
        path: String,
    },
    /// Two outputs are one file.
    #[error("{} is named twice; give each format a file of its own", shown(.path))]
    Twice {
        /// Path of the file.
        path: String,
    },
    /// The file could not be made.
    #[error("cannot create {}: {}", shown(.path), shown(&.source.to_string()))]
    Create {
        /// Path of the file.
        path: String,
        /// The system's reason.
        source: std::io::Error,
    },
    /// The file could not be written on.
    #[error(
        "step {step}: cannot write {}: {source}; {}",
        shown(.path),
        recorded_up_to(*intact)
    )]
    Write {
        /// Path of the file.
        path: String,
        /// The step at which writing failed.
        step: u64,
        /// The last step that is whole in the file; `None` if there is no new file.
        intact: Option<u64>,
        /// The system's reason.
        source: std::io::Error,
    },
    /// The run failed.
    #[error(transparent)]
    Run(#[from] RelaxError),
}

fn recorded_up_to(intact: Option<u64>) -> String {
    match intact {
        Some(step) => format!("the recording is whole up to step {step}"),
        None => "no step is recorded, and no file was made or replaced".to_owned(),
    }
}

/// Relaxes `run` to its end and records it with each of `writers`; `watch` sees every step and ends the run by returning
/// `false`.
///
/// An interrupted run is closed as a readable recording that names no result.
///
/// # Errors
///
/// [`RecordError::Write`] at the step at which a file could not be written, [`RecordError::Run`] if the relaxation
/// failed; the steps before it are then in the files.
///
/// See the example of the [module](self).
pub fn record(
    run: &mut Relaxation,
    writers: Vec<Writer>,
    channels: &Channels,
    watch: impl FnMut(&Relaxation) -> bool,
) -> Result<Summary, RecordError> {
    record_live(run, writers, None, channels, watch)
}

/// [`record`], and a viewer looks on; what becomes of the viewer does not concern the run.
///
/// # Errors
///
/// Those of [`record`].
///
/// See the example of [`Live`].
pub fn record_live(
    run: &mut Relaxation,
    mut writers: Vec<Writer>,
    live: Option<&Live>,
    channels: &Channels,
    mut watch: impl FnMut(&Relaxation) -> bool,
) -> Result<Summary, RecordError> {
    let first = run.step();
    let mut snapshots = Snapshots::default();
    loop {
        let status = run.status();
        let goes_on = watch(run);
        let last = status != Status::Running || !goes_on;
        let edge = last || run.step() == first;
        if let Some(snapshot) = snapshots.take(run, channels, edge) {
            for writer in &mut writers {
                writer.send(Arc::clone(&snapshot))?;
            }
            if let Some(live) = live {
                live.send(snapshot);
            }
        }
        if last {
            let outcome = Outcome::of(run);
            // Every file is closed, whatever becomes of the others.
            let closed: Vec<_> = writers.into_iter().map(|w| w.finish(outcome)).collect();
            let files = closed.into_iter().collect::<Result<_, _>>()?;
            return Ok(Summary { outcome, files });
        }
        if let Err(error) = run.advance() {
            // What was recorded before stays readable. Should closing fail as well, the first failure is the news.
            drop(writers);
            return Err(error.into());
        }
    }
}
