//! What waits for the viewer: bounded, and never in the way of the run.

use super::super::{Outcome, Snapshot};
use std::collections::VecDeque;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Instant;
use tokio::sync::{Notify, watch};

/// Snapshots that wait for the viewer hold no more than this many bytes.
const LIMIT: usize = 16 << 20;

/// Between the run and the thread of the live view.
#[derive(Debug)]
pub struct Queue {
    waiting: Mutex<Waiting>,
    arrived: Notify,
    closing: watch::Sender<Option<Closing>>,
}

/// How the run ended, for those who wait.
#[derive(Clone, Copy, Debug)]
pub struct Closing {
    pub at: Instant,
    pub outcome: Option<Outcome>,
    /// Nobody waits for what is left.
    pub abandoned: bool,
}

#[derive(Debug, Default)]
struct Waiting {
    snapshots: VecDeque<Arc<Snapshot>>,
    bytes: usize,
    offered: u64,
}

impl Queue {
    pub fn new() -> Self {
        Self {
            waiting: Mutex::default(),
            arrived: Notify::new(),
            closing: watch::Sender::new(None),
        }
    }

    /// Takes a snapshot; what waits is thinned out if it does not fit. Waits for nothing but the time that another push,
    /// or a [`take`](Self::take), needs.
    pub fn push(&self, snapshot: Arc<Snapshot>) {
        let mut waiting = self.waiting();
        waiting.offered += 1;
        let bytes = size(&snapshot);
        while waiting.bytes + bytes > LIMIT && !waiting.snapshots.is_empty() {
            waiting.thin();
        }
        waiting.push(snapshot);
        drop(waiting);
        self.arrived.notify_one();
    }

    /// Counts a snapshot that nobody will see.
    pub fn pass(&self) {
        self.waiting().offered += 1;
    }

    /// The snapshot that has waited longest.
    pub fn take(&self) -> Option<Arc<Snapshot>> {
        let mut waiting = self.waiting();
        let snapshot = waiting.snapshots.pop_front()?;
        waiting.bytes -= size(&snapshot);
        Some(snapshot)
    }

    /// Drops everything but the newest snapshot.
    pub fn skip_to_newest(&self) {
        let mut waiting = self.waiting();
        if let Some(newest) = waiting.snapshots.pop_back() {
            waiting.snapshots.clear();
            waiting.bytes = 0;
            waiting.push(newest);
        }
    }

    /// The snapshots that were pushed so far.
    pub fn offered(&self) -> u64 {
        self.waiting().offered
    }

    /// Returns when a snapshot has come since the last return.
    pub async fn arrival(&self) {
        self.arrived.notified().await;
    }

    /// Nothing more will come.
    pub fn close(&self, closing: Closing) {
        self.closing.send_replace(Some(closing));
        self.arrived.notify_one();
    }

    pub fn closing(&self) -> Option<Closing> {
        *self.closing.borrow()
    }

    /// Returns when the queue is closed.
    pub async fn closed(&self) -> Closing {
        let mut closing = self.closing.subscribe();
        loop {
            if let Some(closing) = *closing.borrow_and_update() {
                return closing;
            }
            // The sender lives as long as the queue.
            drop(closing.changed().await);
        }
    }

    fn waiting(&self) -> MutexGuard<'_, Waiting> {
        // Nothing that holds the lock leaves it in disorder.
        self.waiting.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Waiting {
    fn push(&mut self, snapshot: Arc<Snapshot>) {
        self.bytes += size(&snapshot);
        self.snapshots.push_back(snapshot);
    }

    /// Takes every other frame away, and leaves its metrics; where no two frames are left, every other snapshot. So what
    /// is left is thinner the older it is, and a pass is rare.
    fn thin(&mut self) {
        let snapshots = core::mem::take(&mut self.snapshots);
        self.bytes = 0;
        let frames = snapshots.iter().filter(|s| s.frame.is_some());
        if frames.count() > 1 {
            let mut keep = false;
            for snapshot in snapshots {
                keep ^= snapshot.frame.is_some();
                if snapshot.frame.is_none() || keep {
                    self.push(snapshot);
                } else if snapshot.metrics.is_some() {
                    let (frame, stage) = (None, snapshot.stage.clone());
                    self.push(Arc::new(Snapshot {
                        frame,
                        stage,
                        ..*snapshot
                    }));
                }
            }
        } else if snapshots.len() > 1 {
            snapshots.into_iter().step_by(2).for_each(|s| self.push(s));
        }
    }
}

/// Whether a snapshot is all that was recorded of its step: the frame of what is pictured has not been taken away.
pub fn is_whole(snapshot: &Snapshot) -> bool {
    snapshot.frame.is_some() || !(snapshot.contours || snapshot.contacts || snapshot.state)
}

/// Bytes that a snapshot holds, up to what an allocator adds.
fn size(snapshot: &Snapshot) -> usize {
    let frame = snapshot.frame.as_ref();
    size_of::<Arc<Snapshot>>()
        + size_of::<Snapshot>()
        + frame.map_or(0, |f| {
            size_of_val(&*f.positions)
                + size_of_val(&*f.velocities)
                + size_of_val(&*f.contacts)
                + size_of_val(&*f.forces)
        })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::protocol::Relaxation;
    use crate::scene::{Channels, Scene, Schedule};

    #[test]
    fn what_waits_is_bounded_thins_out_with_age_and_ends_with_the_newest() {
        let scene = Scene {
            particles: 256,
            ..Scene::default()
        };
        let run = Relaxation::new(&scene).expect("a run");
        let metrics = Channels {
            contours: Schedule::Off,
            contacts: Schedule::Off,
            state: Schedule::Off,
            ..Channels::default()
        };
        let at = |step: u64, picture: bool| {
            let snapshot = Snapshot::of(&run, &Channels::default(), true);
            let mut snapshot = snapshot.expect("a snapshot");
            if !picture {
                snapshot = Snapshot::of(&run, &metrics, false).expect("a snapshot");
            }
            Arc::new(Snapshot { step, ..snapshot })
        };
        let queue = Queue::new();
        // Four times what fits, a frame every fourth step.
        let frames = 4 * LIMIT as u64 / size(&at(0, true)) as u64;
        for step in 0..4 * frames {
            queue.push(at(step, step % 4 == 0));
            assert!(queue.waiting().bytes <= LIMIT);
        }
        queue.push(at(4 * frames, true));
        assert_eq!(queue.offered(), 4 * frames + 1);
        let left: Vec<_> = core::iter::from_fn(|| queue.take()).collect();
        assert_eq!(queue.waiting().bytes, 0);
        let steps: Vec<u64> = left.iter().map(|e| e.step).collect();
        assert_eq!(
            steps,
            (0..=4 * frames).collect::<Vec<_>>(),
            "no metric goes"
        );
        let framed: Vec<_> = left.iter().filter(|e| e.frame.is_some()).collect();
        let last = framed.last().expect("the newest frame");
        assert!(last.step == 4 * frames && is_whole(last));
        assert_eq!(framed[0].step, 0);
        // Half of what fits is the least that is left, beside the metrics.
        let rows = (4 * frames) as usize * size(&at(0, false));
        let bytes = framed.iter().map(|e| size(e)).sum::<usize>();
        assert!(
            bytes > (LIMIT - rows) / 2 - 2 * size(&at(0, true)),
            "{bytes}"
        );
        // The older, the thinner.
        let steps: Vec<u64> = framed.iter().map(|e| e.step).collect();
        let gaps: Vec<u64> = steps.windows(2).map(|w| w[1] - w[0]).collect();
        assert!(gaps.windows(2).all(|w| w[0] >= w[1]), "{gaps:?}");
        for snapshot in &left {
            assert_eq!(
                is_whole(snapshot),
                snapshot.frame.is_some() || snapshot.step % 4 != 0
            );
        }
        // Where nothing but metrics is left, they are thinned out as well.
        let rows = 2 * LIMIT as u64 / size(&at(0, false)) as u64;
        let template = at(0, false);
        for step in 0..rows {
            queue.push(Arc::new(Snapshot {
                step,
                frame: None,
                stage: None,
                ..*template
            }));
        }
        assert!(queue.waiting().bytes <= LIMIT);
        queue.skip_to_newest();
        assert_eq!(queue.take().map(|e| e.step), Some(rows - 1));
        assert!(queue.take().is_none());
    }
}
