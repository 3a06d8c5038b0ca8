//! Recordings: what a run looked like, for the rerun viewer, for a collaborator and for a replay.
//!
//! A run is recorded as a sequence of [`Snapshot`]s: a step, what is recorded of it, and nothing else. What no channel
//! asks for is not computed. [`Writer`] encodes them on a thread of its own behind a bounded queue; when it fails, the
//! next snapshot fails with it, so that a full disk ends the run instead of emptying it.
//!
//! ```
//! use softjam::{record, relax::Relaxation, scene::Scene};
//!
//! let path = std::env::temp_dir().join("softjam-record-example.rrd");
//! let scene = Scene { particles: 32, phi: 0.9, ..Scene::default() };
//! let mut run = Relaxation::new(&scene).unwrap();
//! let writer = record::Writer::create(&path, true, record::Header::of(&scene, &run)).unwrap();
//! let summary = record::record(&mut run, writer, &scene.channels, |_| true).unwrap();
//! assert!(summary.bytes > 0);
//! # std::fs::remove_file(&path).unwrap();
//! ```

mod blueprint;
mod encode;
mod pictures;
mod rrd;
mod writer;

pub use rrd::RrdRecorder;
pub use writer::{Writer, Written};

use crate::force::Observables;
use crate::frame::Frame;
use crate::packing::Packing;
use crate::relax::{RelaxError, Relaxation, Status};
use crate::scene::{Channels, Scene};

/// The version of the recording's layout; a reader refuses newer ones.
///
/// ```
/// assert_eq!(softjam::record::FORMAT_VERSION, 1);
/// ```
pub const FORMAT_VERSION: u32 = 1;

/// The program as it is named in recordings.
///
/// ```
/// assert!(softjam::record::PROGRAM.starts_with("softjam "));
/// ```
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
    blake3::Hash::from_bytes(scene.digest()).to_hex()[..32].to_owned()
}

/// What a recording says of itself before its first frame.
///
/// ```
/// use softjam::{record::Header, relax::Relaxation, scene::Scene};
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
}

impl Header {
    /// The header of a recording that begins with the present step of `run`.
    ///
    /// See the example of [`Header`].
    #[must_use]
    pub fn of(scene: &Scene, run: &Relaxation) -> Self {
        Self {
            scene: scene.clone(),
            packing: run.packing().clone(),
            from_step: run.step(),
        }
    }
}

/// What is recorded of one step.
///
/// ```
/// use softjam::{record::Snapshot, relax::Relaxation, scene::{Channels, Scene, Schedule}};
///
/// let run = Relaxation::new(&Scene { particles: 32, ..Scene::default() }).unwrap();
/// let channels = Channels { contours: Schedule::Off, contacts: Schedule::Off, state: Schedule::Off, ..Channels::default() };
/// let snapshot = Snapshot::of(&run, &channels, false).unwrap();
/// assert!(snapshot.frame.is_none(), "metrics alone cost no copy of the state");
/// ```
#[derive(Clone, Debug)]
pub struct Snapshot {
    /// The step.
    pub step: u64,
    /// Simulated time.
    pub time: f64,
    /// The metrics, if they are recorded.
    pub metrics: Option<Observables>,
    /// The frame, if contours, contacts or state are recorded.
    pub frame: Option<Frame>,
    /// Whether contours are recorded.
    pub contours: bool,
    /// Whether contacts are recorded.
    pub contacts: bool,
    /// Whether the state is recorded.
    pub state: bool,
}

impl Snapshot {
    /// What `channels` ask for at the present step of `run`; `None` if that is nothing. The first and the `last` step
    /// are recorded by every channel that is on.
    ///
    /// See the example of [`Snapshot`].
    #[must_use]
    pub fn of(run: &Relaxation, channels: &Channels, last: bool) -> Option<Self> {
        let step = run.step();
        let [contours, contacts, metrics, state] = channels
            .named()
            .map(|(_, schedule)| schedule.includes(step) || (last && schedule.is_on()));
        let frame = contours || contacts || state;
        (frame || metrics).then(|| Self {
            step,
            time: run.time(),
            metrics: metrics.then(|| run.observables()),
            frame: frame.then(|| run.frame()),
            contours,
            contacts,
            state,
        })
    }
}

/// How a run ended, as it is recorded.
///
/// ```
/// let outcome = softjam::record::Outcome { converged: true, steps: 9, f_max: 1e-11 };
/// assert!(outcome.converged);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Outcome {
    /// Whether `f_max` fell to the threshold.
    pub converged: bool,
    /// Moves made.
    pub steps: u64,
    /// The last `f_max` (units of γ).
    pub f_max: f64,
}

/// What a recorded run came to.
///
/// See the example of the [module](self).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Summary {
    /// How the run ended; `None` if it was interrupted.
    pub outcome: Option<Outcome>,
    /// Size of the file (bytes).
    pub bytes: u64,
    /// Frames whose state was recorded.
    pub states: u64,
}

/// Why a recording could not be made.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RecordError {
    /// The file exists and is not to be replaced.
    #[error("{path} exists; say --force to replace it, or name another file with -o")]
    Exists {
        /// Path of the file.
        path: String,
    },
    /// The file is one that the run reads from.
    #[error("{path} is an input of this run; name another file with -o")]
    Input {
        /// Path of the file.
        path: String,
    },
    /// The file could not be made.
    #[error("cannot create {path}: {source}")]
    Create {
        /// Path of the file.
        path: String,
        /// The system's reason.
        source: std::io::Error,
    },
    /// The file could not be written on.
    #[error(
        "step {step}: cannot write {path}: {source}; {}",
        recorded_up_to(*intact)
    )]
    Write {
        /// Path of the file.
        path: String,
        /// The step at which writing failed.
        step: u64,
        /// The last step that is whole in the file.
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
        None => "no step is in the recording".to_owned(),
    }
}

/// Relaxes `run` to its end and records it; `watch` sees every step and ends the run by returning `false`.
///
/// An interrupted run is closed as a readable recording that names no result.
///
/// # Errors
///
/// [`RecordError::Write`] at the step at which the file could not be written, [`RecordError::Run`] if the relaxation
/// failed; the steps before it are then in the file.
///
/// See the example of the [module](self).
pub fn record(
    run: &mut Relaxation,
    mut writer: Writer,
    channels: &Channels,
    mut watch: impl FnMut(&Relaxation) -> bool,
) -> Result<Summary, RecordError> {
    loop {
        let status = run.status();
        let goes_on = watch(run);
        let last = status != Status::Running || !goes_on;
        if let Some(snapshot) = Snapshot::of(run, channels, last) {
            writer.send(snapshot)?;
        }
        if last {
            let outcome = (status != Status::Running).then(|| Outcome {
                converged: status == Status::Converged,
                steps: run.step(),
                f_max: run.f_max(),
            });
            let written = writer.finish(outcome)?;
            return Ok(Summary {
                outcome,
                bytes: written.bytes,
                states: written.states,
            });
        }
        if let Err(error) = run.advance() {
            // What was recorded before stays readable. Should closing fail as well, the first failure is the news.
            drop(writer.finish(None));
            return Err(error.into());
        }
    }
}
