//! The run along a stretch of a recording: from one recorded state to the next.

use super::Metrics;
use super::difference::{self, Difference, What};
use crate::domain::Domain;
use crate::protocol::{RelaxError, Relaxation, Status};
use crate::record::{Leg, Outcome, Snapshot, Snapshots};
use crate::scene::{Scene, Schedule};
use crate::state::Frame;
use crate::state::Packing;
use std::sync::Arc;

/// The way from one recorded state to the next.
pub(super) struct Segment {
    /// The state before; `None` for the first.
    pub from: Option<Frame>,
    /// The state at its end, and the packing at it.
    pub to: Frame,
    pub packing: Packing,
    /// The box of frames that have none of their own.
    pub domain: Domain,
    /// What the run went by before the first; empty for the others.
    pub legs: Vec<Leg>,
    /// Metrics that the file has on the way, and late ones.
    pub rows: Metrics,
    /// How the file ends behind it, if it does.
    pub end: Option<End>,
}

/// The end of a file.
#[derive(Clone, Copy)]
pub(super) struct End {
    /// Whether its writer closed it.
    pub closed: bool,
    /// The recorded result.
    pub outcome: Option<Outcome>,
}

impl Segment {
    /// The run at the beginning of the segment, or how the recorded radii and box differ from the scene's.
    pub fn run(&self, scene: &Scene) -> Result<Result<Relaxation, Difference>, RelaxError> {
        match &self.from {
            Some(from) => Relaxation::resume(scene, self.packing_of(from), from.clone()).map(Ok),
            None => first_run(scene, &self.legs, &self.to, &self.packing),
        }
    }

    /// The packing at a frame of the segment.
    pub fn packing_of(&self, frame: &Frame) -> Packing {
        let mut packing = self.packing.clone();
        packing.set_domain(frame.domain.unwrap_or(self.domain));
        frame.positions.clone_into(packing.positions_mut());
        packing
    }

    /// Advances `run` to the segment's end and hands on what is recorded on the way, until `emit` has had enough; the first
    /// difference of the states and the end.
    pub fn walk(
        &self,
        run: &mut Relaxation,
        scene: &Scene,
        snapshots: &mut Snapshots,
        emit: impl FnMut(Arc<Snapshot>) -> bool,
    ) -> Result<Option<Difference>, RelaxError> {
        let found = self.approach(run, scene, snapshots, emit)?;
        let end = self.end.filter(|end| end.closed);
        Ok(found
            .or_else(|| Difference::between(&self.to, &run.frame()))
            .or_else(|| end.and_then(|end| end.differs(run))))
    }

    /// [`walk`](Self::walk) without the comparison at its end.
    pub fn approach(
        &self,
        run: &mut Relaxation,
        scene: &Scene,
        snapshots: &mut Snapshots,
        mut emit: impl FnMut(Arc<Snapshot>) -> bool,
    ) -> Result<Option<Difference>, RelaxError> {
        let (to, first) = (self.to.step, self.from.is_none());
        while run.step() < to {
            if let Some(end) = ended(run) {
                return Ok(Some(end));
            }
            run.advance()?;
            if run.step() < to && !first && run.begins_stage() {
                // Whatever the schedules, every channel that is on records the first frame of a stage.
                let what = What::Count {
                    name: "states of the first step of a stage",
                    here: 0,
                    there: 1,
                };
                let step = run.step();
                return Ok(Some(Difference { step, what }));
            }
            // What is in front of the first recorded state is in another recording.
            if run.step() < to
                && !first
                && let Some(snapshot) = snapshots.take(run, &scene.channels, false)
                && !emit(snapshot)
            {
                return Ok(None);
            }
        }
        let edge = first || self.is_last(run, run.scheduled(&scene.channels).state);
        if let Some(snapshot) = snapshots.take(run, &scene.channels, edge) {
            emit(snapshot);
        }
        Ok(None)
    }

    /// Whether the run was ended at the segment's end: every channel that is on has recorded it.
    fn is_last(&self, run: &Relaxation, schedule: Schedule) -> bool {
        let closed = self.end.is_some_and(|end| end.closed);
        closed || run.status() != Status::Running || !schedule.includes(self.to.step)
    }
}

impl End {
    /// How the end of a file that was closed differs from where and how the run ends.
    fn differs(self, run: &Relaxation) -> Option<Difference> {
        let step = run.step();
        let converged = run.status() == Status::Converged;
        let what = match (self.outcome, run.status() != Status::Running) {
            // Somebody ended the run.
            (None, false) => None,
            (None, true) => Some(What::Ends { converged }),
            (Some(_), false) => Some(What::GoesOn { f_max: run.f_max() }),
            (Some(end), true) if end.converged != converged => {
                Some(What::Converged { there: converged })
            }
            (Some(end), true) if end.steps != step => Some(What::Steps { here: end.steps }),
            (Some(end), true) if end.stability.is_some() && end.stability != run.stability() => {
                Some(What::Stability {
                    here: end.stability,
                    there: run.stability(),
                })
            }
            (Some(end), true) => difference::numbers(&[end.f_max], &[run.f_max()], |_| {
                "f_max of the result".into()
            }),
        };
        what.map(|what| Difference { step, what })
    }
}

/// The difference that it is for a recording to go on where the run ends.
fn ended(run: &Relaxation) -> Option<Difference> {
    let converged = run.status() == Status::Converged;
    let what = What::Ends { converged };
    let step = run.step();
    (run.status() != Status::Running).then_some(Difference { step, what })
}

/// A run of the scene from its start, or how the recorded radii and box differ from the scene's.
///
/// A start from a file is what the first frame recorded of it, its disks relaxed if they were; the file itself need not be at hand.
fn first_run(
    scene: &Scene,
    legs: &[Leg],
    first: &Frame,
    recorded: &Packing,
) -> Result<Result<Relaxation, Difference>, RelaxError> {
    if scene.starts_from_file() {
        return Ok(Ok(if first.step == 0 {
            Relaxation::of_packing(scene, recorded.clone())?
        } else {
            // It goes on from another recording: its first frame is all there is.
            Relaxation::resume(scene, recorded.clone(), first.clone())?
        }));
    }
    let step = first.step;
    // Before the disks of a scene are relaxed that the file has nothing to do with.
    let count = difference::count("particles", recorded.len(), scene.particles);
    if let Some(what) = count {
        return Ok(Err(Difference { step, what }));
    }
    let mut scenes = legs.iter().map(|leg| leg.scene(scene));
    let mut now = scenes.next().unwrap_or(scene.clone());
    let mut run = Relaxation::new(&now)?;
    let numbers = |packing: &Packing| {
        let l = packing.domain().lengths();
        let mut numbers = vec![l.x, l.y];
        numbers.extend_from_slice(packing.radii());
        numbers
    };
    let (here, there) = (numbers(recorded), numbers(run.packing()));
    // A box that a protocol has changed is compared with the frame that has it.
    let begin = if first.domain.is_some() { 2 } else { 0 };
    let what = difference::numbers(&here[begin..], &there[begin..], |k| match k + begin {
        0 => "L_x of the box".to_owned(),
        1 => "L_y of the box".to_owned(),
        number => format!("radius of particle {}", number - 2),
    });
    if let Some(what) = what {
        return Ok(Err(Difference { step, what }));
    }
    for leg in legs {
        while run.step() < leg.until {
            if let Some(end) = ended(&run) {
                return Ok(Err(end));
            }
            run.advance()?;
        }
        let next = scenes.next().unwrap_or(scene.clone());
        run = Relaxation::take_over(&now, &next, run.packing().clone(), run.frame())?;
        now = next;
    }
    Ok(Ok(run))
}
