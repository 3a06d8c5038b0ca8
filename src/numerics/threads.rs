//! A second thread for one run.
//!
//! A step is a chain of short loops, some 20 µs each at N = 1024: too short to wake a thread for. So the second thread of
//! [`with`] is kept awake, and takes its half of a loop within a microsecond. It is worth its core for one run that is waited for;
//! for many runs, as many processes or threads with one run each do more.
//!
//! The two halves of a loop write to places of their own, and no sum knows how it was shared out: the bits of a run are the same with
//! one thread and with two.
//!
//! See the example of [`with`].

use core::cell::Cell;
use core::hint::spin_loop;
use core::sync::atomic::{AtomicBool, Ordering};

thread_local! {
    /// Whether this thread has a second one at hand.
    static PAIRED: Cell<bool> = const { Cell::new(false) };
}

/// The most threads that a run has a use for.
pub const MOST: usize = 2;

/// Why there are no such threads.
///
/// ```
/// let error = softjam::numerics::threads::with(3, || ()).unwrap_err();
/// assert_eq!(error.to_string(), "3 threads: a run has a use for 1 or 2; for many runs, start several at a time");
/// ```
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ThreadsError {
    /// More than [`MOST`], or none.
    #[error("{0} threads: a run has a use for 1 or 2; for many runs, start several at a time")]
    Number(usize),
    /// The system has no more threads.
    #[error("cannot start a second thread: {0}")]
    Start(#[from] rayon::ThreadPoolBuildError),
    /// The system has no more threads to wait in.
    #[error("cannot start a thread to wait in: {0}")]
    Wait(#[from] std::io::Error),
}

/// Does `work` with so many `threads`, 1 (which adds none) or 2. The second shares the steps of packings with 16 384 contacts or
/// more, from some 7000 particles on; it takes all of its core until `work` is done, whatever the size.
///
/// # Errors
///
/// [`ThreadsError::Number`], and [`ThreadsError::Start`] if the system has no more threads.
///
/// ```
/// use softjam::{protocol::Relaxation, scene::Scene};
///
/// let scene = Scene { particles: 32, ..Scene::default() };
/// let digest = |threads| softjam::numerics::threads::with(threads, || {
///     let mut run = Relaxation::new(&scene).unwrap();
///     for _ in 0..10 {
///         run.advance().unwrap();
///     }
///     run.frame().digest()
/// });
/// assert_eq!(digest(1).unwrap(), digest(2).unwrap());
/// ```
pub fn with<R: Send>(threads: usize, work: impl FnOnce() -> R + Send) -> Result<R, ThreadsError> {
    if threads == 0 || threads > MOST {
        return Err(ThreadsError::Number(threads));
    }
    if threads == 1 {
        return Ok(work());
    }
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(threads)
        .thread_name(|k| format!("softjam-{k}"))
        .build()?;
    let by_both = || pool.install(|| beside_another(work));
    if rayon::current_thread_index().is_none() {
        return Ok(by_both());
    }
    // A thread of the caller's own pool would begin the next of its tasks while it waits, and that one another, all on one stack.
    std::thread::scope(|scope| {
        let waiting = std::thread::Builder::new().spawn_scoped(scope, by_both)?;
        waiting
            .join()
            .map_or_else(|panic| std::panic::resume_unwind(panic), Ok)
    })
}

/// Does `work` while another thread of the pool stays awake.
fn beside_another<R: Send>(work: impl FnOnce() -> R + Send) -> R {
    let (awake, done) = (AtomicBool::new(false), AtomicBool::new(false));
    rayon::scope(|scope| {
        // Whatever becomes of the work, the other thread is let go.
        let _end = End(&done);
        scope.spawn(|_| {
            awake.store(true, Ordering::Release);
            while !done.load(Ordering::Acquire) {
                if rayon::yield_now() != Some(rayon::Yield::Executed) {
                    spin_loop();
                }
            }
        });
        while !awake.load(Ordering::Acquire) {
            std::thread::yield_now();
        }
        PAIRED.set(true);
        work()
    })
}

/// Ends the second thread's waiting when it goes out of scope.
struct End<'a>(&'a AtomicBool);

impl Drop for End<'_> {
    fn drop(&mut self) {
        self.0.store(true, Ordering::Release);
    }
}

/// Contacts below which the loops are too short for a second thread.
const FEWEST: usize = 16_384;

/// Whether this thread has a second one at hand, and loops over so many `contacts` are worth sharing with it.
#[inline]
pub(crate) fn are_two_for(contacts: usize) -> bool {
    contacts >= FEWEST && PAIRED.get()
}

/// Does one thing and the other: at the same time if `two`, which says that there [are](are_two_for).
#[inline]
pub(crate) fn both(two: bool, one: impl FnOnce() + Send, other: impl FnOnce() + Send) {
    if two {
        rayon::join(one, other);
    } else {
        one();
        other();
    }
}
