//! Is the file, byte for byte, what the run writes?
//!
//! What the run gives goes through the recorder of the file's format again, on a thread of its own, into a sink that compares
//! instead of writing. Pictures, colours, layout and names are then under proof as well as numbers.

use super::walk::End;
use crate::record::{Format, Header, McapRecorder, Outcome, Recorder, RrdRecorder, Snapshot};
use std::cell::Cell;
use std::io::{self, Read, Write};
use std::sync::Arc;
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::thread::JoinHandle;

/// Snapshots are handed over together until there are so many, or one with a frame: waking a thread costs more than the metrics
/// of a step.
const TOGETHER: usize = 64;

/// Groups of snapshots that may wait for the recorder.
const WAITING: usize = 4;

/// A comparison ends where more than one byte of so many differs: the file is laid out otherwise, and the rest tells no more.
const FEW: u64 = 8;

/// Bytes that are compared before it may end so.
const ENOUGH: u64 = 1 << 16;

/// Flipped bits change fewer bytes than a program that writes the file anew, if only its headers.
const DAMAGE: u64 = 64;

/// What a comparison of bytes came to.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Compared {
    /// Bytes that the run gives and the file has.
    pub bytes: u64,
    /// How many of them differ.
    pub differing: u64,
    /// Where the first difference is, an end that only one side has included.
    pub first: Option<u64>,
    /// Whether the recorder came to the end of the file.
    pub ended: bool,
}

impl Compared {
    /// Whether so much differs that the file is not the run's with some bytes changed, but laid out otherwise.
    pub fn is_laid_out_otherwise(&self) -> bool {
        self.differing * FEW > self.bytes
    }

    /// Whether more differs than flipped bits do, of which one may say that another program wrote the file.
    pub fn is_rewritten(&self) -> bool {
        self.differing > DAMAGE
    }
}

/// A run that is recorded again.
pub(super) struct Recording {
    queue: SyncSender<Message>,
    held: Vec<Arc<Snapshot>>,
    thread: JoinHandle<Compared>,
}

enum Message {
    Snapshots(Vec<Arc<Snapshot>>),
    /// The end of a closed file, with its outcome if it has one.
    Finish(Option<Outcome>),
}

impl Recording {
    /// Begins with the header; `file` is the whole file, from its first byte.
    pub fn begin(format: Format, header: Header, file: Box<dyn Read + Send>) -> io::Result<Self> {
        let (queue, messages) = sync_channel(WAITING);
        let thread = std::thread::Builder::new()
            .name("softjam-comparison".to_owned())
            .spawn(move || compare(format, header, file, &messages))?;
        Ok(Self {
            queue,
            held: Vec::new(),
            thread,
        })
    }

    /// Records what the run gives next.
    pub fn give(&mut self, snapshot: Arc<Snapshot>) {
        let has_frame = snapshot.frame.is_some();
        self.held.push(snapshot);
        if has_frame || self.held.len() >= TOGETHER {
            self.hand_over();
        }
    }

    fn hand_over(&mut self) {
        let held = core::mem::take(&mut self.held);
        // The thread hangs up once it has seen enough.
        drop(self.queue.send(Message::Snapshots(held)));
    }

    /// The verdict on a file that ends so.
    pub fn end(mut self, end: End) -> Compared {
        self.hand_over();
        if end.closed {
            drop(self.queue.send(Message::Finish(end.outcome)));
        }
        drop(self.queue);
        self.thread
            .join()
            .unwrap_or_else(|panic| std::panic::resume_unwind(panic))
    }
}

/// The thread's work.
fn compare(
    format: Format,
    header: Header,
    mut file: Box<dyn Read + Send>,
    messages: &Receiver<Message>,
) -> Compared {
    let mut compared = Compared::default();
    let over = Cell::new(false);
    let sink = Sink {
        file: &mut file,
        compared: &mut compared,
        theirs: Vec::new(),
        over: &over,
    };
    // A sink fails only where enough was seen.
    let whole = match format {
        Format::Rrd => RrdRecorder::new(sink, header).and_then(|r| record(r, messages, &over)),
        Format::Mcap => McapRecorder::new(sink, header).and_then(|r| record(r, messages, &over)),
    };
    compared.ended = matches!(whole, Ok(true));
    if compared.ended && !matches!(file.read(&mut [0]), Ok(0)) {
        compared.first = compared.first.or(Some(compared.bytes));
    }
    compared
}

/// Records until the queue ends; whether that was the end of the file, too.
fn record(
    mut recorder: impl Recorder,
    messages: &Receiver<Message>,
    over: &Cell<bool>,
) -> io::Result<bool> {
    while let Ok(message) = messages.recv() {
        match message {
            Message::Snapshots(snapshots) => {
                for snapshot in snapshots {
                    recorder.record(&snapshot)?;
                }
            }
            Message::Finish(outcome) => {
                recorder.finish(outcome)?;
                return Ok(true);
            }
        }
    }
    // A recorder of MCAP that is dropped closes its file, which this one is not.
    over.set(true);
    Ok(false)
}

/// Compares what is written with a file instead of writing it.
struct Sink<'a> {
    file: &'a mut Box<dyn Read + Send>,
    compared: &'a mut Compared,
    theirs: Vec<u8>,
    /// Whether what still comes is no part of the file.
    over: &'a Cell<bool>,
}

impl Write for Sink<'_> {
    fn write(&mut self, ours: &[u8]) -> io::Result<usize> {
        if self.over.get() {
            return Err(io::Error::other("the file is over"));
        }
        self.theirs.clear();
        let length = ours.len() as u64;
        self.file
            .by_ref()
            .take(length)
            .read_to_end(&mut self.theirs)?;
        let found = &mut *self.compared;
        if ours != self.theirs {
            let differ = ours.iter().zip(&self.theirs).map(|(a, b)| a != b);
            let first = differ.clone().position(|differs| differs);
            found.first = found.first.or(Some(
                found.bytes + first.unwrap_or(self.theirs.len()) as u64,
            ));
            found.differing += differ.filter(|differs| *differs).count() as u64;
        }
        found.bytes += self.theirs.len() as u64;
        let seen = found.bytes > ENOUGH && found.is_laid_out_otherwise();
        if seen || self.theirs.len() < ours.len() {
            return Err(io::Error::other("seen enough"));
        }
        Ok(ours.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}
