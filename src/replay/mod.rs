//! Replay: a recording proves itself.
//!
//! [`Recording`] streams a file of either format, `.rrd` or `.mcap`: its scene and radii first, then what was recorded, in the order of the file. Memory
//! does not grow with the file. A frame comes out with the bits it went in with, and its digest is checked on the way.
//!
//! Two questions are put to it. [`determinism`]: is the trajectory what the scene gives, bit for bit? And [`Balance`]: do
//! its frames fulfil the contact law and, at the end, balance of forces, from positions and radii alone? [`compare`] holds
//! two recordings against each other.
//!
//! See the example of [`Recording`].

mod balance;
mod bytes;
mod compare;
mod determinism;
mod difference;
mod joined;
mod ledger;
mod mcap;
mod recording;
mod rrd;
mod source;
mod standing;
mod steps;
mod tolerance;
mod turns;
mod walk;

pub use balance::{Balance, Worst};
pub use compare::{Comparison, compare};
pub use determinism::{Bytes, Determinism, Origin, ReplayError, Way, determinism};
pub use difference::{Difference, Row, What, ulps};
pub use recording::place_of_byte;
pub use recording::{Metrics, Recording, State};
pub use source::reading_damaged_bytes;
pub use standing::Standing;

#[cfg(feature = "figure")]
pub(crate) use source::guarded;

use crate::record::Outcome;
use crate::scene::SceneError;
use crate::state::{Frame, FrameError};
use crate::text::{lines, shown};

/// Something that a recording holds behind its header.
///
/// ```
/// use softjam::replay::Event;
/// assert!(matches!(Event::Drawn { channel: "contours", step: 0 }, Event::Drawn { step: 0, .. }));
/// ```
#[derive(Clone, Debug, PartialEq)]
pub enum Event {
    /// A recorded state; its digest was right.
    State(Frame),
    /// One scalar of `/metrics`.
    Metric {
        /// Its name, one of [`METRICS`](crate::analysis::METRICS).
        name: &'static str,
        /// The step.
        step: u64,
        /// Simulated time in nanoseconds of its unit.
        nanoseconds: i64,
        /// Its value.
        value: f64,
    },
    /// The contours or the contacts of a step, which are for the eye and can be rebuilt from the state.
    Drawn {
        /// `contours` or `contacts`.
        channel: &'static str,
        /// The step.
        step: u64,
    },
    /// How the run ended, and the digest over the digests of all recorded states.
    Result {
        /// How it ended.
        outcome: Outcome,
        /// BLAKE3 over the digests of the recorded frames in order.
        digest: [u8; 32],
    },
}

/// Why a recording cannot be read.
///
/// ```
/// use softjam::replay::{ReadError, Recording};
/// let error = Recording::open("no/such/run.rrd").err().unwrap();
/// assert!(matches!(error, ReadError::Open { .. }));
/// assert!(error.to_string().starts_with("cannot read no/such/run.rrd"));
/// ```
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ReadError {
    /// The file cannot be opened.
    #[error("cannot read {}: {source}", shown(.path))]
    Open {
        /// Path of the file.
        path: String,
        /// The system's reason.
        source: std::io::Error,
    },
    /// The file is not what its format asks for.
    #[error("{} is not {format}: {}", shown(.path), shown(.problem))]
    Format {
        /// Path of the file.
        path: String,
        /// What it ought to be.
        format: &'static str,
        /// What is wrong.
        problem: String,
    },
    /// A file of another program, or one that breaks off before its scene.
    #[error(
        "{} is not a softjam recording, or breaks off before it says so: it has no {missing}",
        shown(.path)
    )]
    NotSoftjam {
        /// Path of the file.
        path: String,
        /// What is missing.
        missing: &'static str,
    },
    /// The recording is of a later version of the layout.
    #[error(
        "{} has format version {found}, this program reads up to {known}: use a newer softjam",
        shown(.path)
    )]
    Newer {
        /// Path of the file.
        path: String,
        /// Its version.
        found: u32,
        /// The newest version known here.
        known: u32,
    },
    /// The scene in the recording does not parse.
    #[error("the scene in {} cannot be read: {source}", shown(.path))]
    Scene {
        /// Path of the file.
        path: String,
        /// What is wrong with it.
        source: SceneError,
    },
    /// The recording was made of another scene than the one it names.
    #[error(
        "the scene in {} was changed after it was recorded, or its recording was given another's name: it is {}, its scene makes {}",
        shown(.path),
        shown(.found),
        shown(.expected)
    )]
    Changed {
        /// Path of the file.
        path: String,
        /// The recording's id.
        found: String,
        /// The id that its scene gives.
        expected: String,
    },
    /// Radii or box are none that its scene can have.
    #[error("{} is no recording of its scene: {problem}", shown(.path))]
    Particles {
        /// Path of the file.
        path: String,
        /// What its scene and its radii do not agree on.
        problem: String,
    },
    /// It claims to need more memory than there may be.
    #[error("{}: {problem}", shown(.path))]
    Budget {
        /// Path of the file.
        path: String,
        /// What needs too much, and the way out.
        problem: String,
    },
    /// Particles lie on each other as in no packing, so nothing can be computed from their positions.
    #[error(
        "{}: at step {step} {others} particles overlap particle {particle}, where a packing has room for some dozens: nothing can \
         be computed from this state",
        shown(.path)
    )]
    Crowded {
        /// Path of the file.
        path: String,
        /// The step.
        step: u64,
        /// The particle.
        particle: usize,
        /// How many others overlap it.
        others: usize,
    },
    /// The stream is damaged.
    #[error("{} is damaged: {}; {}", shown(.path), shown(.problem), intact_up_to(*intact))]
    Damaged {
        /// Path of the file.
        path: String,
        /// What is wrong.
        problem: String,
        /// The last recorded state before the damage.
        intact: Option<u64>,
    },
    /// The file holds more than one recording.
    #[error("{} holds several recordings; {}", shown(.path), intact_up_to(*intact))]
    Several {
        /// Path of the file.
        path: String,
        /// The last recorded state of the first.
        intact: Option<u64>,
    },
    /// The file holds several parts of one run, put together by another program.
    #[error(
        "{} holds several parts of one run, put together by another program, which may have lost some of their rows: give the files \
         that it was made of to `softjam join`; {}",
        shown(.path),
        intact_up_to(*intact)
    )]
    Parts {
        /// Path of the file.
        path: String,
        /// The last recorded state of the first.
        intact: Option<u64>,
    },
    /// The file is a piece that was cut out of a recording.
    #[error(
        "{} is a piece of a recording, as `rerun rrd split` makes them: take the recording as a whole",
        shown(.path)
    )]
    Piece {
        /// Path of the file.
        path: String,
    },
    /// It is not the next part of the run that the ones before it are of.
    #[error("{} cannot be joined: {}", shown(.path), lines(.problem))]
    Join {
        /// Path of the file.
        path: String,
        /// What it and the parts before it do not agree on.
        problem: String,
    },
    /// States are missing or out of order.
    #[error("{}: {}; {}", shown(.path), shown(.problem), intact_up_to(*intact))]
    Steps {
        /// Path of the file.
        path: String,
        /// What is wrong with the order.
        problem: String,
        /// The last recorded state before it.
        intact: Option<u64>,
    },
    /// The recorded result does not belong to the recorded states.
    #[error("{}: the result is wrong: {}; {}", shown(.path), shown(.problem), intact_up_to(*intact))]
    Result {
        /// Path of the file.
        path: String,
        /// What is wrong.
        problem: String,
        /// The last recorded state.
        intact: Option<u64>,
    },
    /// A frame is not one that a run can give.
    #[error("{}: the state at step {step} is damaged: {source}; {}", shown(.path), intact_up_to(*intact))]
    Frame {
        /// Path of the file.
        path: String,
        /// The step.
        step: u64,
        /// What is wrong.
        source: FrameError,
        /// The last recorded state before it.
        intact: Option<u64>,
    },
    /// The state of a frame does not have the digest that was recorded with it.
    #[error("{}: the digest of step {step} differs, so its state was changed after it was written; {}", shown(.path), intact_up_to(*intact))]
    Digest {
        /// Path of the file.
        path: String,
        /// The step.
        step: u64,
        /// The last recorded state before it.
        intact: Option<u64>,
    },
}

fn intact_up_to(intact: Option<u64>) -> String {
    match intact {
        Some(step) => format!("intact up to step {step}"),
        None => "no state before it".to_owned(),
    }
}
