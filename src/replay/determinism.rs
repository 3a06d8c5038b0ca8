//! Is the recorded trajectory what the scene gives, bit for bit?
//!
//! The recorded frames are compared with those of a new run: from the scene, or segment by segment from one recorded frame to
//! the next. A frame determines the next one, so both ways come to the same verdict: if every segment leads from its frame to
//! the next and the first frame is the scene's, the whole is the scene's. Every row of the metrics has to stand there once, the
//! result has to be where and how this run ends, and the file's bytes have to be those that it writes.

use super::balance::Worst;
use super::bytes;
use super::difference::{Difference, What};
use super::ledger::Ledger;
use super::tolerance;
use super::turns::run_segments;
use super::walk::{End, Segment};
use super::{ReadError, Recording, State};
use crate::protocol::{RelaxError, Relaxation, Status};
use crate::record::{PROGRAM, Snapshots};
use crate::scene::Scene;
use crate::text::shown;
use std::io::Read;

/// How the trajectory is run again.
///
/// ```
/// assert_eq!(softjam::replay::Way::default(), softjam::replay::Way::Whole);
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Way {
    /// From the scene to the end.
    #[default]
    Whole,
    /// From each recorded frame to the next, on so many threads.
    Segments(usize),
}

/// What a replay found.
///
/// See the example of [`determinism`].
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Determinism {
    /// Recorded states.
    pub states: u64,
    /// Recorded metrics.
    pub metrics: u64,
    /// The first and the last recorded step.
    pub steps: Option<(u64, u64)>,
    /// Steps that were run, those in front of the first recorded one included.
    pub run: u64,
    /// Where the run began.
    pub origin: Origin,
    /// The first difference, if there is one.
    pub difference: Option<Difference>,
    /// How far a recording of another [revision of the bits](crate::BITS) is off at worst, between recorded states: positions by
    /// the mean radius, forces by the largest.
    pub deviation: Option<Worst>,
    /// What the comparison of the bytes came to.
    pub bytes: Bytes,
}

/// Where a run that is compared with a recording began.
///
/// ```
/// assert_eq!(softjam::replay::Origin::default(), softjam::replay::Origin::Scene);
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Origin {
    /// Where its scene does: nothing was taken from the recording.
    #[default]
    Scene,
    /// At the positions and radii of the first recorded frame, since the scene starts from a file.
    Positions,
    /// At the first recorded frame as a whole, since the recording goes on from another one that starts from a file.
    Frame,
}

/// What the comparison of a file's bytes with those that the run writes came to.
///
/// ```
/// use softjam::replay::Bytes;
/// assert_eq!(Bytes::default(), Bytes::NotCompared);
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum Bytes {
    /// Nothing was compared: it was not asked for, or what the file holds differs already.
    #[default]
    NotCompared,
    /// Every byte of the file is the run's.
    Same(u64),
    /// The file breaks off; so many bytes from its beginning are the run's.
    SameUpTo(u64),
    /// The file was laid out by another program or by another version of this one: what it holds was compared, not its bytes.
    LaidOutOtherwise,
    /// The file claims to be as this program writes it, and differs from this byte on: it is damaged, or was changed.
    Differ {
        /// The first byte that differs, counted from 0.
        at: u64,
    },
}

/// Why a replay came to no verdict.
///
/// ```
/// use softjam::replay::ReplayError;
/// let error = ReplayError::NoState { path: "run.rrd".to_owned(), closed: true };
/// assert!(error.to_string().contains("not replayed"));
/// ```
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ReplayError {
    /// The recording is damaged.
    #[error(transparent)]
    Read(#[from] ReadError),
    /// The scene cannot be run.
    #[error("the scene cannot be run again: {0}")]
    Run(#[from] RelaxError),
    /// There is nothing to compare.
    #[error(
        "{} holds no state{}: it can be looked at, not replayed",
        shown(path),
        if *closed { "" } else { " before it breaks off" }
    )]
    NoState {
        /// Path of the file.
        path: String,
        /// Whether the file is complete.
        closed: bool,
    },
}

/// Runs a recording again and compares it with what was recorded; `watch` sees every recorded state first. `file` is the file
/// once more, from its first byte, if its bytes are to be compared, too.
///
/// # Errors
///
/// [`ReplayError`] if the recording is damaged, holds no state or its scene cannot be run. A damaged recording has been
/// compared up to the damage.
///
/// # Example
///
/// ```
/// use softjam::replay::{determinism, Bytes, Recording, Way};
/// # use softjam::{record, protocol::Relaxation, scene::Scene};
/// # let path = std::env::temp_dir().join("softjam-determinism-example.rrd");
/// # let scene = Scene { particles: 32, phi: 0.9, ..Scene::default() };
/// # let mut run = Relaxation::new(&scene).unwrap();
/// # let writer = record::Writer::create(&path, true, record::Header::of(&scene, &run)).unwrap();
/// # record::record(&mut run, vec![writer], &scene.channels, |_| true).unwrap();
///
/// for way in [Way::Whole, Way::Segments(2)] {
///     let file = std::fs::File::open(&path).unwrap();
///     let mut recording = Recording::open(&path).unwrap();
///     let verdict = determinism(&mut recording, way, Some(Box::new(file)), |_| {}).unwrap();
///     assert_eq!(verdict.difference, None);
///     assert!(matches!(verdict.bytes, Bytes::Same(_)));
/// }
/// # std::fs::remove_file(&path).unwrap();
/// ```
pub fn determinism(
    recording: &mut Recording,
    way: Way,
    file: Option<Box<dyn Read + Send>>,
    mut watch: impl FnMut(&State),
) -> Result<Determinism, ReplayError> {
    let scene = recording.scene().clone();
    let same_revision = recording.has_same_bits();
    let bytes = match file {
        Some(file) if same_revision => {
            let header = recording.header()?;
            bytes::Recording::begin(recording.format(), header, file).ok()
        }
        _ => None,
    };
    let ledger = Ledger::new(scene.channels.metrics, bytes);
    let mut verdict = Determinism {
        origin: match recording.from_step() {
            _ if !scene.starts_from_file() && same_revision => Origin::Scene,
            0 => Origin::Positions,
            _ => Origin::Frame,
        },
        ..Determinism::default()
    };
    let (ledger, end) = match way {
        _ if !same_revision => {
            run_from_recorded(recording, &scene, ledger, &mut verdict, &mut watch)?
        }
        Way::Whole => run_whole(recording, &scene, ledger, &mut verdict, &mut watch)?,
        Way::Segments(n) => {
            let threads = n.clamp(1, cores());
            run_segments(recording, &scene, threads, ledger, &mut verdict, &mut watch)?
        }
    };
    conclude(recording, ledger, end, &mut verdict);
    Ok(verdict)
}

fn cores() -> usize {
    std::thread::available_parallelism().map_or(1, usize::from)
}

/// The end of the file against the end of the run.
fn conclude(recording: &mut Recording, mut ledger: Ledger, end: End, verdict: &mut Determinism) {
    ledger.find(recording.rows_left());
    let compared = ledger.end(end);
    verdict.metrics = ledger.metrics();
    verdict.difference = ledger.difference().cloned();
    verdict.deviation = ledger.deviation();
    let Some(compared) = compared.filter(|_| verdict.difference.is_none()) else {
        return;
    };
    let otherwise = if recording.is_laid_out_by_softjam() {
        recording.program() != PROGRAM && compared.is_laid_out_otherwise()
    } else {
        compared.is_rewritten()
    };
    verdict.bytes = match compared.first {
        None if compared.ended => Bytes::Same(compared.bytes),
        // What the file lacks at its end is no difference.
        _ if !end.closed && compared.differing == 0 => Bytes::SameUpTo(compared.bytes),
        Some(at) if !otherwise => Bytes::Differ { at },
        _ => Bytes::LaidOutOtherwise,
    };
}

/// Reads the recorded states and hands the way from each to the next to `check`, until that has had enough; how the file ends.
pub(super) fn each_segment(
    recording: &mut Recording,
    verdict: &mut Determinism,
    watch: &mut impl FnMut(&State),
    mut check: impl FnMut(Segment) -> Result<bool, ReplayError>,
) -> Result<End, ReplayError> {
    let (mut last, mut goes_on) = (None, true);
    let mut next = recording.next_state()?;
    while let Some(state) = next.take() {
        let first = last.is_none();
        if first {
            recording.check_run(&state.frame)?;
        }
        watch(&state);
        // Whether it is the last shows when there is none behind it.
        let behind = recording.next_state();
        let end = matches!(behind, Ok(None)).then(|| recording.end());
        let step = state.frame.step;
        verdict.states += 1;
        verdict.steps = Some((verdict.steps.map_or(step, |(first, _)| first), step));
        if goes_on {
            goes_on = check(Segment {
                from: last.replace(state.frame.clone()),
                to: state.frame,
                packing: state.packing,
                domain: recording.domain(),
                legs: if first {
                    recording.legs().to_vec()
                } else {
                    Vec::new()
                },
                rows: state.metrics,
                end,
            })?;
        }
        next = behind?;
    }
    let end = recording.end();
    if verdict.states == 0 {
        return Err(ReplayError::NoState {
            path: recording.path().to_owned(),
            closed: end.closed,
        });
    }
    Ok(end)
}

/// One run along the whole recording.
fn run_whole(
    recording: &mut Recording,
    scene: &Scene,
    mut ledger: Ledger,
    verdict: &mut Determinism,
    watch: &mut impl FnMut(&State),
) -> Result<(Ledger, End), ReplayError> {
    let mut run: Option<Relaxation> = None;
    let mut snapshots = Snapshots::default();
    let mut began = 0;
    let end = each_segment(recording, verdict, watch, |mut segment| {
        ledger.find(core::mem::take(&mut segment.rows));
        let run = match &mut run {
            Some(run) => run,
            none => match segment.run(scene)? {
                Ok(new) => {
                    began = new.step();
                    none.insert(new)
                }
                Err(difference) => {
                    ledger.differs(Some(difference));
                    return Ok(false);
                }
            },
        };
        let found = segment.walk(run, scene, &mut snapshots, |s| ledger.give(s))?;
        ledger.differs(found);
        Ok(ledger.difference().is_none())
    })?;
    if let Some(run) = &mut run {
        go_on_behind(recording, scene, end, run, &mut snapshots, &mut ledger)?;
        let scene = verdict.origin == Origin::Scene;
        verdict.run = run.step() - if scene { 0 } else { began };
    }
    Ok((ledger, end))
}

/// A run a segment, each from what is recorded at its beginning: for another revision of the bits.
fn run_from_recorded(
    recording: &mut Recording,
    scene: &Scene,
    mut ledger: Ledger,
    verdict: &mut Determinism,
    watch: &mut impl FnMut(&State),
) -> Result<(Ledger, End), ReplayError> {
    let mut ran = 0;
    let end = each_segment(recording, verdict, watch, |mut segment| {
        ledger.allow(segment.allowed(scene));
        ledger.find(core::mem::take(&mut segment.rows));
        let mut run = segment.run_from_recorded(scene)?;
        let mut snapshots = Snapshots::default();
        let begin = run.step();
        let found = segment.approach(&mut run, scene, &mut snapshots, |s| ledger.give(s))?;
        ledger.differs(found);
        let off = tolerance::deviation(&segment.packing, &segment.to, &run.frame());
        ledger.deviates(off, segment.to.step);
        ran += run.step() - begin;
        Ok(ledger.difference().is_none())
    })?;
    verdict.run = ran;
    if let Some(outcome) = end.outcome
        && !outcome.converged
        && outcome.steps < scene.steps
    {
        let f_max = outcome.f_max;
        let (step, what) = (outcome.steps, What::GoesOn { f_max });
        ledger.differs(Some(Difference { step, what }));
    }
    Ok((ledger, end))
}

/// Behind the last state of a file that breaks off there may be metrics: runs on as far as they go.
pub(super) fn go_on_behind(
    recording: &mut Recording,
    scene: &Scene,
    end: End,
    run: &mut Relaxation,
    snapshots: &mut Snapshots,
    ledger: &mut Ledger,
) -> Result<(), ReplayError> {
    if end.closed || ledger.difference().is_some() {
        return Ok(());
    }
    ledger.find(recording.rows_left());
    ledger.breaks_off_behind(run.step());
    let until = ledger.found_without_gap_from(run.step());
    while run.step() < until && run.status() == Status::Running {
        run.advance()?;
        if let Some(snapshot) = snapshots.take(run, &scene.channels, false)
            && !ledger.give(snapshot)
        {
            break;
        }
    }
    Ok(())
}
