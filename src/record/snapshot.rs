//! What is recorded of a step, and how snapshots are taken of a run.

use crate::analysis::{Backbone, Metrics};
use crate::protocol::{Relaxation, StageEnd};
use crate::scene::Channels;
use crate::state::Frame;
use std::collections::VecDeque;
use std::sync::Arc;

/// What is recorded of one step.
///
/// ```
/// use softjam::{record::Snapshot, protocol::Relaxation, scene::{Channels, Scene, Schedule}};
///
/// let run = Relaxation::new(&Scene { particles: 32, ..Scene::default() }).unwrap();
/// let channels = Channels { contours: Schedule::Off, contacts: Schedule::Off, state: Schedule::Off, ..Channels::default() };
/// let snapshot = Snapshot::of(&run, &channels, false).unwrap();
/// assert!(snapshot.frame.is_none(), "metrics alone cost no copy of the state");
/// ```
#[derive(Clone, Debug)]
#[expect(
    clippy::struct_excessive_bools,
    reason = "each says something of its own"
)]
pub struct Snapshot {
    /// The step.
    pub step: u64,
    /// Simulated time in nanoseconds of its unit, rounded towards zero.
    pub nanoseconds: i64,
    /// The metrics, if they are recorded.
    pub metrics: Option<Metrics>,
    /// The frame, if contours, contacts or state are recorded.
    pub frame: Option<Frame>,
    /// Whether contours are scheduled; a recorder leaves them out if they would look like those before.
    pub contours: bool,
    /// Whether contacts are scheduled; a recorder leaves them out if they would look like those before.
    pub contacts: bool,
    /// Whether the state is recorded.
    pub state: bool,
    /// Whether it is the first or the last step of the recording, the first of a stage or a relaxed state of a protocol, of which every
    /// picture is drawn.
    pub edge: bool,
    /// What a stage of a protocol has come to, whose last frame this is.
    pub stage: Option<Box<StageEnd>>,
}

impl Snapshot {
    /// What `channels` ask for at the present step of `run`; `None` if that is nothing. At an `edge`, the first or the last
    /// step of a recording, and at the first of a stage every channel that is on records.
    #[must_use]
    pub fn of(run: &Relaxation, channels: &Channels, edge: bool) -> Option<Self> {
        Self::made(
            run,
            channels,
            edge,
            &mut Backbone::default(),
            Frame::default,
        )
    }

    /// [`of`](Self::of) with a counter of rattlers that remembers the snapshot before, and `room` for the frame.
    fn made(
        run: &Relaxation,
        channels: &Channels,
        edge: bool,
        backbone: &mut Backbone,
        room: impl FnOnce() -> Frame,
    ) -> Option<Self> {
        let channels = run.scheduled(channels);
        let edge = edge || run.begins_stage() || run.is_relaxed_state();
        let [contours, contacts, metrics, state] = channels.at(run.step(), edge);
        let pictured = contours || contacts || state;
        (pictured || metrics).then(|| Self {
            step: run.step(),
            nanoseconds: nanoseconds(run.time()),
            metrics: metrics.then(|| run.observables_counted(backbone).metrics()),
            frame: pictured.then(|| {
                let mut frame = room();
                run.copy_frame(&mut frame);
                frame
            }),
            contours,
            contacts,
            state,
            edge,
            stage: run.stage_end().map(Box::new),
        })
    }
}

/// Simulated time as recordings have it.
pub(crate) fn nanoseconds(time: f64) -> i64 {
    (time * 1e9) as i64
}

/// Takes snapshots of a run, step after step. The contacts of the one before tell it who rattles, and the memory of those
/// that nobody holds any more serves for the next.
#[derive(Default)]
pub(crate) struct Snapshots {
    backbone: Backbone,
    /// Snapshots with a frame that others may still hold.
    out: VecDeque<Arc<Snapshot>>,
    /// Frames that nobody needs.
    free: Vec<Frame>,
}

impl Snapshots {
    /// [`Snapshot::of`] the present step of `run`, shared with this.
    pub fn take(
        &mut self,
        run: &Relaxation,
        channels: &Channels,
        edge: bool,
    ) -> Option<Arc<Snapshot>> {
        let Self {
            backbone,
            out,
            free,
        } = self;
        let room = || {
            // Two for each that is taken, so that they do not become more and more behind one that is held for long.
            for snapshot in [out.pop_front(), out.pop_front()].into_iter().flatten() {
                match Arc::try_unwrap(snapshot) {
                    Ok(snapshot) => free.extend(snapshot.frame),
                    Err(held) => out.push_back(held),
                }
            }
            free.pop().unwrap_or_default()
        };
        let snapshot = Snapshot::made(run, channels, edge, backbone, room).map(Arc::new)?;
        if snapshot.frame.is_some() {
            out.push_back(Arc::clone(&snapshot));
        }
        Some(snapshot)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Scene;

    #[test]
    fn frames_that_nobody_holds_serve_again_whatever_others_hold() {
        let scene = Scene {
            particles: 16,
            ..Scene::default()
        };
        let run = Relaxation::new(&scene).unwrap();
        let mut snapshots = Snapshots::default();
        let mut take = || snapshots.take(&run, &scene.channels, true).unwrap();
        let (first, mut queue, mut places) = (take(), VecDeque::new(), Vec::new());
        for _ in 0..1000 {
            let snapshot = take();
            let frame = snapshot.frame.as_ref().unwrap();
            assert_eq!(*frame, run.frame());
            places.push(frame.positions.as_ptr());
            queue.push_back(snapshot);
            if queue.len() > 5 {
                queue.pop_front();
            }
        }
        places.sort_unstable();
        places.dedup();
        assert!(places.len() < 30, "{} places for 1000 frames", places.len());
        assert!(snapshots.out.len() + snapshots.free.len() < 30);
        assert_eq!(first.frame.as_ref().unwrap(), &run.frame(), "never touched");
    }
}
