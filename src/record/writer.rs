//! The thread that encodes and writes, behind a bounded queue.

use super::patience::Patience;
use super::pipeline::Pipeline;
use super::{Format, Header, McapRecorder, NewFile, Outcome, RecordError, Recorder, Snapshot};
use crate::state::Frame;
use std::fs::File;
use std::io;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::thread::JoinHandle;

/// So many messages may wait for the disk before the run does; of an `.rrd` more, if they hold no more than so many bytes: while a
/// run rearranges, its pictures are drawn more slowly than it goes on, and later there are few. MCAP takes ten times as long for a
/// picture, so much would wait for long.
const QUEUE: usize = 8;
const QUEUE_BYTES: usize = 1 << 25;

/// Snapshots are handed over together until they span so many steps, their frames hold so many bytes, or the steps up to the next have
/// come to so many moves of a particle (some 30 ms): waking the thread costs more than the metrics of a step. The first goes at once.
const TOGETHER: u64 = 64;
const TOGETHER_BYTES: usize = 1 << 19;
const TOGETHER_MOVES: u64 = 300_000;

/// How far threads that draw and write step back behind the run.
#[cfg(target_os = "linux")]
const NICE: i32 = 5;

/// A recording in the making: takes snapshots, encodes and writes them on a thread of its own.
///
/// # Example
///
/// See the [module](super).
#[derive(Debug)]
pub struct Writer {
    queue: Option<SyncSender<Message>>,
    thread: Option<JoinHandle<Result<Written, RecordError>>>,
    /// Snapshots not yet handed over.
    held: Vec<Arc<Snapshot>>,
    patience: Patience,
    /// Whether the first has been handed over.
    begun: bool,
    place: Arc<Place>,
}

/// The file that is written, and when it takes its place.
#[derive(Debug)]
pub(super) struct Place {
    file: NewFile,
    /// Whether it waits for the last snapshot; else it goes with the first.
    last: AtomicBool,
}

impl Place {
    /// What is recorded first has been written.
    pub fn first_is_written(&self) -> io::Result<()> {
        if self.last.load(Ordering::Relaxed) {
            return Ok(());
        }
        self.file.publish()
    }

    /// What keeps a step from being written; `intact` is the last that the file holds in full.
    fn failure(&self, step: u64, intact: Option<u64>, source: io::Error) -> RecordError {
        let path = self.file.path().display().to_string();
        match source.kind() {
            // It has come there since the recording was begun.
            io::ErrorKind::AlreadyExists => RecordError::Exists { path },
            _ => RecordError::Write {
                path,
                step,
                intact,
                source,
            },
        }
    }
}

/// What was written.
///
/// ```
/// assert_eq!(softjam::record::Written::default().states, 0);
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Written {
    /// Size of the file (bytes).
    pub bytes: u64,
    /// Frames whose state was recorded.
    pub states: u64,
}

#[derive(Debug)]
enum Message {
    Snapshots(Vec<Arc<Snapshot>>),
    Finish(Option<Outcome>),
}

impl Writer {
    /// Creates the file of a recording, in the [format that its name says](Format::named), and starts it; an existing file is
    /// replaced only if `replace` says so, and not before the first snapshot has been written.
    ///
    /// # Errors
    ///
    /// Those of [`NewFile::create`], and [`RecordError::Name`] where the name says no format.
    ///
    /// ```
    /// use softjam::{record::{Header, Writer}, protocol::Relaxation, scene::Scene};
    ///
    /// let scene = Scene { particles: 32, ..Scene::default() };
    /// let run = Relaxation::new(&scene).unwrap();
    /// let error = Writer::create("/nowhere/run.rrd", false, Header::of(&scene, &run)).unwrap_err();
    /// assert!(error.to_string().starts_with("cannot create /nowhere/run.rrd"));
    /// ```
    pub fn create(
        path: impl AsRef<Path>,
        replace: bool,
        header: Header,
    ) -> Result<Self, RecordError> {
        let format = Format::named(&path)?;
        Self::create_as(format, path, replace, header)
    }

    /// [`create`](Self::create) with the format said outright.
    ///
    /// # Errors
    ///
    /// Those of [`NewFile::create`].
    pub fn create_as(
        format: Format,
        path: impl AsRef<Path>,
        replace: bool,
        header: Header,
    ) -> Result<Self, RecordError> {
        Self::start(format, NewFile::create(path, replace)?, header)
    }

    /// Starts a recording in a file that has been begun.
    ///
    /// # Errors
    ///
    /// [`RecordError::Create`] if the system has no threads left.
    ///
    /// ```
    /// use softjam::{record::{Format, Header, NewFile, Writer}, protocol::Relaxation, scene::Scene};
    ///
    /// let path = std::env::temp_dir().join("softjam-writer-start-example.rrd");
    /// // Whoever cannot have the file hears of it before the disks relax.
    /// let file = NewFile::create(&path, true).unwrap();
    /// let scene = Scene { particles: 32, ..Scene::default() };
    /// let run = Relaxation::new(&scene).unwrap();
    /// Writer::start(Format::Rrd, file, Header::of(&scene, &run)).unwrap().finish(None).unwrap();
    /// assert!(path.exists());
    /// # std::fs::remove_file(&path).unwrap();
    /// ```
    pub fn start(format: Format, file: NewFile, header: Header) -> Result<Self, RecordError> {
        Self::begin(format, file, header, QUEUE_BYTES)
    }

    /// [`start`](Self::start) for snapshots that are read from another file: that can wait, so little waits here.
    ///
    /// # Errors
    ///
    /// [`RecordError::Create`].
    pub fn start_conversion(
        format: Format,
        file: NewFile,
        header: Header,
    ) -> Result<Self, RecordError> {
        Self::begin(format, file, header, QUEUE_BYTES / 4)
    }

    /// A writer for which so many bytes of snapshots may wait.
    fn begin(
        format: Format,
        file: NewFile,
        header: Header,
        waiting: usize,
    ) -> Result<Self, RecordError> {
        let name = file.path().display().to_string();
        let fails = |source| RecordError::Create {
            path: name.clone(),
            source,
        };
        let sink = file.open_file().map_err(fails)?;
        let place = Arc::new(Place {
            file,
            last: AtomicBool::new(false),
        });
        let patience = Patience::of(&header, TOGETHER_MOVES);
        // What a frame holds of each particle, with 2.5 contacts.
        let frame = 72 * header.packing.len();
        let room = match format {
            Format::Rrd => QUEUE.max(waiting / frame.max(TOGETHER_BYTES)),
            Format::Mcap => QUEUE,
        };
        let (queue, messages) = sync_channel(room);
        let thread = std::thread::Builder::new()
            .name("softjam-recorder".to_owned())
            .spawn({
                let place = Arc::clone(&place);
                move || match format {
                    Format::Rrd => write(sink, &place, &messages, |sink| {
                        Pipeline::new(sink, header, Arc::clone(&place))
                    }),
                    Format::Mcap => write(sink, &place, &messages, |sink| {
                        McapRecorder::new(sink, header)
                    }),
                }
            })
            .map_err(fails)?;
        Ok(Self {
            queue: Some(queue),
            thread: Some(thread),
            held: Vec::new(),
            patience,
            begun: false,
            place,
        })
    }

    /// Lets the file take its place when it is whole, and not with the first snapshot.
    pub(crate) fn wait_until_whole(&self) {
        self.place.last.store(true, Ordering::Relaxed);
    }

    /// Hands a snapshot to the thread, small ones some at a time; waits while the queue is full.
    ///
    /// # Errors
    ///
    /// [`RecordError::Write`] if an earlier snapshot could not be written.
    ///
    /// See the example of the [module](super).
    pub fn send(&mut self, snapshot: impl Into<Arc<Snapshot>>) -> Result<(), RecordError> {
        let snapshot = snapshot.into();
        let step = snapshot.step;
        let first = self.held.first().map_or(step, |held| held.step);
        let spans = step.saturating_sub(first);
        self.held.push(snapshot);
        let frames = self.held.iter().filter_map(|held| held.frame.as_ref());
        let bytes: usize = frames.map(Frame::bytes).sum();
        let waits = self.begun
            && bytes < TOGETHER_BYTES
            && spans < TOGETHER
            && !self.patience.ends(first, step);
        if waits {
            return Ok(());
        }
        self.begun = true;
        self.hand_over()
    }

    fn hand_over(&mut self) -> Result<(), RecordError> {
        let held = core::mem::take(&mut self.held);
        self.post(Message::Snapshots(held))
    }

    /// Writes what is left and closes the file; without an outcome the recording is marked as unfinished.
    ///
    /// # Errors
    ///
    /// [`RecordError::Write`].
    ///
    /// See the example of the [module](super).
    pub fn finish(mut self, outcome: Option<Outcome>) -> Result<Written, RecordError> {
        self.hand_over()?;
        self.post(Message::Finish(outcome))?;
        self.join()
    }

    fn post(&mut self, message: Message) -> Result<(), RecordError> {
        let sent = self.queue.as_ref().map(|queue| queue.send(message));
        match sent {
            Some(Ok(())) => Ok(()),
            // The thread is gone: it has left the reason behind.
            _ => self.join().map(|_| ()),
        }
    }

    fn join(&mut self) -> Result<Written, RecordError> {
        self.queue = None;
        match self.thread.take().map(JoinHandle::join) {
            Some(Ok(result)) => result,
            Some(Err(panic)) => std::panic::resume_unwind(panic),
            None => {
                Err(self
                    .place
                    .failure(0, None, io::Error::other("the recorder has already ended")))
            }
        }
    }
}

/// A writer that is dropped without [`Writer::finish`] leaves what it was given, unfinished but readable; where it was given nothing,
/// there is no new file.
impl Drop for Writer {
    fn drop(&mut self) {
        if let Some(queue) = self.queue.take() {
            let held = core::mem::take(&mut self.held);
            drop(queue.send(Message::Snapshots(held)));
        }
        if let Some(thread) = self.thread.take() {
            // Whoever drops a writer has another failure to report.
            drop(thread.join());
        }
    }
}

/// Lets the run go first where threads compete for processors: snapshots can wait, up to what the queue holds.
///
/// On Linux only, where this is a property of the thread; elsewhere it would be one of the process.
fn step_back() {
    #[cfg(target_os = "linux")]
    {
        // It costs nothing but time if the system turns it down.
        let _ = rustix::process::nice(NICE);
    }
}

/// The thread's work.
fn write<R: Recorder>(
    sink: File,
    place: &Place,
    messages: &Receiver<Message>,
    start_recorder: impl FnOnce(File) -> io::Result<R>,
) -> Result<Written, RecordError> {
    let mut step = 0;
    let start = |source| place.failure(0, None, source);
    let cut = sink.try_clone().map_err(start)?;
    step_back();
    let mut recorder = start_recorder(sink).map_err(start)?;
    // What the run came to; `None` if nobody has said that it is over.
    let mut end = None;
    let mut result = Ok(());
    while result.is_ok() {
        match messages.recv() {
            Ok(Message::Snapshots(snapshots)) => {
                result = snapshots.iter().try_for_each(|snapshot| {
                    step = snapshot.step;
                    recorder.record(snapshot)?;
                    recorder
                        .intact()
                        .map_or(Ok(()), |_| place.first_is_written())
                });
            }
            Ok(Message::Finish(outcome)) => {
                end = Some(outcome);
                break;
            }
            Err(_) => break,
        }
    }
    result
        .and_then(|()| {
            let written = recorder.finish(end.flatten())?;
            match cut.sync_data() {
                // Pipes and devices have nothing to bring to the disk.
                Err(e) if e.kind() != io::ErrorKind::InvalidInput => return Err(e),
                _ => {}
            }
            if end.is_some() {
                place.file.publish()?;
            } else if recorder.intact().is_some() {
                place.first_is_written()?;
            }
            Ok(written)
        })
        .map_err(|source| {
            // A message that reached the disk in part would be a torn end. What is no file cannot be cut, and need not be.
            drop(cut.set_len(recorder.written()));
            let intact = recorder.intact().filter(|_| place.file.is_published());
            place.failure(step, intact, source)
        })
}
