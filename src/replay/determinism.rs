//! Is the recorded trajectory what the scene gives, bit for bit?
//!
//! The recorded frames are compared with those of a new run: from the scene, or segment by segment from one recorded frame to
//! the next. A frame determines the next one, so both ways come to the same verdict: if every segment leads from its frame to
//! the next and the first frame is the scene's, the whole is the scene's. Recorded metrics are compared too, at every step.

use super::difference::{self, Difference, What};
use super::{Metrics, ReadError, Recording, State};
use crate::force::{Backbone, METRICS, Observables};
use crate::frame::Frame;
use crate::packing::Packing;
use crate::relax::{RelaxError, Relaxation};
use crate::scene::Scene;
use std::sync::Mutex;
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};

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
    /// The first difference, if there is one.
    pub difference: Option<Difference>,
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
        "{path} holds no state{}: it can be looked at, not replayed",
        if *closed { "" } else { " before it breaks off" }
    )]
    NoState {
        /// Path of the file.
        path: String,
        /// Whether the file is complete.
        closed: bool,
    },
}

/// The way from one recorded state to the next.
struct Segment {
    /// The state before; `None` for the first.
    from: Option<Frame>,
    to: Frame,
    metrics: Metrics,
}

/// Runs a recording again and compares it with what was recorded; `watch` sees every recorded state first.
///
/// # Errors
///
/// [`ReplayError`] if the recording is damaged, holds no state or its scene cannot be run. A damaged recording has been
/// compared up to the damage.
///
/// # Example
///
/// ```
/// use softjam::replay::{determinism, Recording, Way};
/// # use softjam::{record, relax::Relaxation, scene::Scene};
/// # let path = std::env::temp_dir().join("softjam-determinism-example.rrd");
/// # let scene = Scene { particles: 32, phi: 0.9, ..Scene::default() };
/// # let mut run = Relaxation::new(&scene).unwrap();
/// # let writer = record::Writer::create(&path, true, record::Header::of(&scene, &run)).unwrap();
/// # record::record(&mut run, vec![writer], &scene.channels, |_| true).unwrap();
///
/// for way in [Way::Whole, Way::Segments(2)] {
///     let verdict = determinism(&mut Recording::open(&path).unwrap(), way, |_| {}).unwrap();
///     assert_eq!(verdict.difference, None);
/// }
/// # std::fs::remove_file(&path).unwrap();
/// ```
pub fn determinism(
    recording: &mut Recording,
    way: Way,
    mut watch: impl FnMut(&State),
) -> Result<Determinism, ReplayError> {
    let scene = recording.scene().clone();
    let mut verdict = Determinism::default();
    match way {
        Way::Whole => {
            let mut whole = Whole::new(&scene);
            each_segment(recording, &mut verdict, &mut watch, |segment, packing| {
                whole.check(&segment, packing)
            })?;
        }
        Way::Segments(threads) => {
            let found: Mutex<Vec<Result<Option<Difference>, RelaxError>>> = Mutex::default();
            let (queue, segments) = sync_channel::<(Segment, Packing)>(2 * threads);
            let segments = Mutex::new(segments);
            let (found_by, scene) = (&found, &scene);
            std::thread::scope(|scope| {
                for _ in 0..threads.max(1) {
                    scope.spawn(|| work(scene, &segments, found_by));
                }
                // Moved in here, so that the workers see the end of the queue.
                let queue: SyncSender<_> = queue;
                each_segment(recording, &mut verdict, &mut watch, |segment, packing| {
                    // Workers end only when the queue does.
                    let _ = queue.send((segment, packing));
                    Ok(None)
                })
            })?;
            for result in found.into_inner().unwrap_or_default() {
                let difference = result?;
                verdict.difference = earlier(verdict.difference.take(), difference);
            }
        }
    }
    if verdict.states == 0 {
        return Err(ReplayError::NoState {
            path: recording.path().to_owned(),
            closed: recording.is_closed(),
        });
    }
    Ok(verdict)
}

fn earlier(a: Option<Difference>, b: Option<Difference>) -> Option<Difference> {
    match (a, b) {
        (Some(a), Some(b)) => Some(if b.step < a.step { b } else { a }),
        (a, b) => a.or(b),
    }
}

/// Hands the way from each state to the next to `check`, until one differs.
fn each_segment(
    recording: &mut Recording,
    verdict: &mut Determinism,
    watch: &mut impl FnMut(&State),
    mut check: impl FnMut(Segment, Packing) -> Result<Option<Difference>, ReplayError>,
) -> Result<(), ReplayError> {
    let mut last: Option<Frame> = None;
    while let Some(state) = recording.next_state()? {
        watch(&state);
        let step = state.frame.step;
        verdict.states += 1;
        verdict.metrics += state.metrics.values().map(|m| m.len() as u64).sum::<u64>();
        verdict.steps = Some((verdict.steps.map_or(step, |(first, _)| first), step));
        let segment = Segment {
            from: last.replace(state.frame.clone()),
            to: state.frame,
            metrics: state.metrics,
        };
        if verdict.difference.is_none() {
            verdict.difference = check(segment, state.packing)?;
        }
    }
    Ok(())
}

/// One run along the whole recording.
struct Whole<'a> {
    scene: &'a Scene,
    run: Option<Relaxation>,
}

impl<'a> Whole<'a> {
    fn new(scene: &'a Scene) -> Self {
        Self { scene, run: None }
    }

    fn check(
        &mut self,
        segment: &Segment,
        packing: Packing,
    ) -> Result<Option<Difference>, ReplayError> {
        let run = match &mut self.run {
            Some(run) => run,
            none => none.insert(match first_run(self.scene, &segment.to, packing)? {
                Ok(run) => run,
                Err(difference) => return Ok(Some(difference)),
            }),
        };
        Ok(walk(run, segment)?)
    }
}

/// A run of the scene from its start, or how the recorded radii and box differ from the scene's.
///
/// A start from a file is what the first frame recorded of it; the file itself need not be at hand.
fn first_run(
    scene: &Scene,
    first: &Frame,
    recorded: Packing,
) -> Result<Result<Relaxation, Difference>, RelaxError> {
    if !scene.starts_from_disks() {
        return Ok(Ok(if first.step == 0 {
            Relaxation::of_packing(scene, recorded)?
        } else {
            // It goes on from another recording: its first frame is all there is.
            Relaxation::resume(scene, recorded, first.clone())?
        }));
    }
    let run = Relaxation::new(scene)?;
    let numbers = |packing: &Packing| {
        let l = packing.domain().lengths();
        let mut numbers = vec![l.x, l.y];
        numbers.extend_from_slice(packing.radii());
        numbers
    };
    let (here, there) = (numbers(&recorded), numbers(run.packing()));
    let what = if here.len() == there.len() {
        difference::numbers(&here, &there, |k| match k {
            0 => "L_x of the box".to_owned(),
            1 => "L_y of the box".to_owned(),
            _ => format!("radius of particle {}", k - 2),
        })
    } else {
        difference::count("particles", here.len() - 2, there.len() - 2)
    };
    let step = first.step;
    Ok(what.map_or(Ok(run), |what| Err(Difference { step, what })))
}

/// Advances `run` to the segment's end; the first difference on the way.
fn walk(run: &mut Relaxation, segment: &Segment) -> Result<Option<Difference>, RelaxError> {
    let mut backbone = Backbone::default();
    loop {
        if let Some(metrics) = segment.metrics.get(&run.step())
            && let Some(what) = metrics_differ(&run.observables_counted(&mut backbone), metrics)
        {
            let step = run.step();
            return Ok(Some(Difference { step, what }));
        }
        if run.step() >= segment.to.step {
            return Ok(Difference::between(&segment.to, &run.frame()));
        }
        run.advance()?;
    }
}

fn metrics_differ(o: &Observables, recorded: &[(&'static str, f64)]) -> Option<What> {
    let computed = o.metrics();
    recorded.iter().find_map(|(name, here)| {
        let there = computed[METRICS.iter().position(|n| n == name)?];
        (here.to_bits() != there.to_bits()).then(|| What::Value {
            name: format!("metric {name}"),
            here: *here,
            there,
        })
    })
}

/// A thread's work: segments until the queue ends.
fn work(
    scene: &Scene,
    segments: &Mutex<Receiver<(Segment, Packing)>>,
    found: &Mutex<Vec<Result<Option<Difference>, RelaxError>>>,
) {
    loop {
        let next = segments.lock().ok().and_then(|queue| queue.recv().ok());
        let Some((segment, packing)) = next else {
            return;
        };
        let run = match &segment.from {
            Some(from) => Relaxation::resume(scene, packing, from.clone()).map(Ok),
            None => first_run(scene, &segment.to, packing),
        };
        let result = run.and_then(|run| match run {
            Ok(mut run) => walk(&mut run, &segment),
            Err(difference) => Ok(Some(difference)),
        });
        if !matches!(result, Ok(None))
            && let Ok(mut found) = found.lock()
        {
            found.push(result);
        }
    }
}
