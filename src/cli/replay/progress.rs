//! What a replay that takes long says of itself, on standard error.

use crate::cli::{bar, warn};
use softjam::replay::Recording;
use softjam::text::counted;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::{RecvTimeoutError, Sender, channel};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// A replay that is done sooner says nothing.
const LONG: Duration = Duration::from_secs(3);

/// Tells again after so long where nobody sees a line change.
const AGAIN: Duration = Duration::from_mins(1);

/// Shows the recorded step that the run is on its way to.
pub(super) struct Progress {
    towards: Arc<AtomicU64>,
    /// Hanging up ends the thread.
    end: Option<Sender<()>>,
    thread: Option<JoinHandle<()>>,
}

impl Progress {
    pub fn of(recording: &Recording) -> Self {
        let towards = Arc::new(AtomicU64::new(0));
        let (end, ended) = channel();
        let (seen, particles) = (Arc::clone(&towards), recording.radii().len());
        let limit = recording.scene().steps;
        let thread = std::thread::spawn(move || {
            let start = Instant::now();
            let bar = bar("{spinner} {msg}");
            let mut wait = LONG;
            while let Err(RecvTimeoutError::Timeout) = ended.recv_timeout(wait) {
                let text = format!(
                    "running {} again, towards the recorded step {} (the scene's limit is {limit}); {} s so far, Ctrl-C ends it",
                    counted(particles, "particle"),
                    seen.load(Ordering::Relaxed),
                    start.elapsed().as_secs()
                );
                if bar.is_hidden() {
                    warn(&text);
                    wait = AGAIN;
                } else {
                    bar.set_message(text);
                    bar.tick();
                    wait = Duration::from_millis(200);
                }
            }
            bar.finish_and_clear();
        });
        Self {
            towards,
            end: Some(end),
            thread: Some(thread),
        }
    }

    /// The run goes on towards this step.
    pub fn towards(&self, step: u64) {
        self.towards.store(step, Ordering::Relaxed);
    }
}

impl Drop for Progress {
    fn drop(&mut self) {
        self.end = None;
        if let Some(thread) = self.thread.take() {
            // It only shows.
            drop(thread.join());
        }
    }
}
