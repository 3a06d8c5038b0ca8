//! A run a segment, on several threads: what they give reaches the ledger in the order of the segments.

use super::determinism::{Determinism, Origin, ReplayError, each_segment, go_on_behind};
use super::ledger::Ledger;
use super::walk::{End, Segment};
use super::{Recording, State};
use crate::protocol::{RelaxError, Relaxation};
use crate::record::Snapshots;
use crate::scene::Scene;
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};

/// Walks the segments of a recording on so many threads.
pub(super) fn run_segments(
    recording: &mut Recording,
    scene: &Scene,
    threads: usize,
    ledger: Ledger,
    verdict: &mut Determinism,
    watch: &mut impl FnMut(&State),
) -> Result<(Ledger, End), ReplayError> {
    let turns = Turns::new(ledger);
    let (queue, segments) = sync_channel::<(u64, Segment)>(2 * threads);
    let segments = Mutex::new(segments);
    let turns_by = &turns;
    let end = std::thread::scope(|scope| {
        for _ in 0..threads {
            scope.spawn(|| work(scene, &segments, turns_by));
        }
        // Moved in here, so that the workers see the end of the queue.
        let queue: SyncSender<_> = queue;
        let mut numbers = 0..;
        each_segment(recording, verdict, watch, |segment| {
            // Workers end only when the queue does.
            let _ = queue.send((numbers.next().unwrap_or_default(), segment));
            Ok(turns_by.goes_on())
        })
    })?;
    let (mut ledger, last, failure) = turns.end();
    if let Some(failure) = failure {
        return Err(failure.into());
    }
    if let Some(mut run) = last {
        let mut snapshots = Snapshots::default();
        go_on_behind(recording, scene, end, &mut run, &mut snapshots, &mut ledger)?;
    }
    if let Some((first, last)) = verdict.steps {
        let scene = verdict.origin == Origin::Scene;
        verdict.run = last - if scene { 0 } else { first };
    }
    Ok((ledger, end))
}

/// Whose turn it is to add to the ledger.
struct Turns {
    state: Mutex<TurnState>,
    passed: Condvar,
}

struct TurnState {
    /// The segment whose turn it is.
    turn: u64,
    ledger: Ledger,
    /// The run at the end of the last segment that was walked.
    last: Option<Relaxation>,
    failure: Option<RelaxError>,
}

impl Turns {
    fn new(ledger: Ledger) -> Self {
        let state = TurnState {
            turn: 0,
            ledger,
            last: None,
            failure: None,
        };
        Self {
            state: Mutex::new(state),
            passed: Condvar::new(),
        }
    }

    fn lock(&self) -> MutexGuard<'_, TurnState> {
        // A panic elsewhere ends the replay anyway.
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Waits for the turn of a segment.
    fn wait(&self, segment: u64) -> MutexGuard<'_, TurnState> {
        let state = self.lock();
        self.passed
            .wait_while(state, |state| state.turn != segment)
            .unwrap_or_else(PoisonError::into_inner)
    }

    /// Whether nothing differs and nothing has failed yet.
    fn goes_on(&self) -> bool {
        let state = self.lock();
        state.ledger.difference().is_none() && state.failure.is_none()
    }

    fn end(self) -> (Ledger, Option<Relaxation>, Option<RelaxError>) {
        let state = self
            .state
            .into_inner()
            .unwrap_or_else(PoisonError::into_inner);
        (state.ledger, state.last, state.failure)
    }
}

/// A segment's turn, which is passed on however the segment ends.
struct Turn<'a> {
    turns: &'a Turns,
    segment: u64,
}

impl Drop for Turn<'_> {
    fn drop(&mut self) {
        self.turns.wait(self.segment).turn += 1;
        self.turns.passed.notify_all();
    }
}

/// Snapshots that a segment holds until it is its turn: so many bytes of frames, and so many of them.
const HELD_BYTES: usize = 1 << 22;
const HELD: usize = 1 << 14;

/// A thread's work: segments until the queue ends.
fn work(scene: &Scene, segments: &Mutex<Receiver<(u64, Segment)>>, turns: &Turns) {
    loop {
        let next = segments.lock().ok().and_then(|queue| queue.recv().ok());
        let Some((number, mut segment)) = next else {
            return;
        };
        let turn = Turn {
            turns,
            segment: number,
        };
        let mut rows = Some(core::mem::take(&mut segment.rows));
        let (mut held, mut bytes) = (Vec::new(), 0);
        let mut pass = |held: &mut Vec<_>| {
            let mut state = turns.wait(number);
            if let Some(rows) = rows.take() {
                state.ledger.find(rows);
            }
            // What comes behind a difference is not compared.
            held.drain(..).all(|s| state.ledger.give(s)) && state.failure.is_none()
        };
        let run = segment.run(scene);
        let result = run.and_then(|run| match run {
            Ok(mut run) => {
                let found = segment.walk(&mut run, scene, &mut Snapshots::default(), |s| {
                    bytes += s.frame.as_ref().map_or(0, crate::state::Frame::bytes);
                    held.push(s);
                    if bytes < HELD_BYTES && held.len() < HELD {
                        return true;
                    }
                    bytes = 0;
                    pass(&mut held)
                })?;
                Ok((found, Some(run)))
            }
            Err(difference) => Ok((Some(difference), None)),
        });
        pass(&mut held);
        let mut state = turns.wait(number);
        match result {
            Ok((found, run)) => {
                state.ledger.differs(found);
                state.last = run;
            }
            Err(failure) => state.failure = state.failure.take().or(Some(failure)),
        }
        drop(state);
        drop(turn);
    }
}
