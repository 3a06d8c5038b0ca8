//! A recorder in two threads: while one draws a batch, the other encodes and writes the one before.

use super::rows::{Batch, Rows};
use super::rrd::Chunks;
use super::writer::Place;
use super::{Header, Outcome, Recorder, RrdRecorder, Snapshot, Written};
use std::fs::File;
use std::io;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::thread::JoinHandle;

/// Writes a file as [`RrdRecorder`] does, byte for byte.
pub(super) struct Pipeline {
    rows: Rows,
    /// `None` once the thread has ended.
    writer: Option<(SyncSender<Order>, JoinHandle<End>)>,
    /// What the file holds; known when the thread has ended.
    intact: Option<u64>,
    written: u64,
}

enum Order {
    Write(Box<Batch>),
    /// How the run ended, the number of its states and their digest.
    Finish(Option<Outcome>, (u64, [u8; 32])),
}

/// What the thread leaves behind: the result, the last whole step and the bytes of whole messages.
type End = (io::Result<Written>, Option<u64>, u64);

impl Pipeline {
    /// Starts a recording in `file`; `place` is told when the first of it has been written.
    pub fn new(file: File, header: Header, place: Arc<Place>) -> io::Result<Self> {
        let (rows, chunks) = RrdRecorder::new(file, header)?.split();
        // One batch is drawn, one waits at most, one is written.
        let (orders, work) = sync_channel(1);
        let thread = std::thread::Builder::new()
            .name("softjam-writer".to_owned())
            .spawn(move || write(chunks, &place, &work))?;
        Ok(Self {
            rows,
            writer: Some((orders, thread)),
            intact: None,
            written: 0,
        })
    }

    fn send(&mut self, batch: Batch) -> io::Result<()> {
        let order = Order::Write(Box::new(batch));
        let sent = self.writer.as_ref().map(|(orders, _)| orders.send(order));
        match sent {
            Some(Ok(())) => Ok(()),
            // The thread is gone: it has left the reason behind.
            _ => self.join().map(|_| ()),
        }
    }

    fn join(&mut self) -> io::Result<Written> {
        let Some((orders, thread)) = self.writer.take() else {
            return Err(io::Error::other("the recorder has already ended"));
        };
        drop(orders);
        let (result, intact, written) = thread
            .join()
            .unwrap_or_else(|panic| std::panic::resume_unwind(panic));
        (self.intact, self.written) = (intact, written);
        result
    }
}

impl Recorder for Pipeline {
    /// An error is one of a batch before.
    fn record(&mut self, snapshot: &Snapshot) -> io::Result<()> {
        match self.rows.take(snapshot) {
            Some(batch) => self.send(batch),
            None => Ok(()),
        }
    }

    fn intact(&self) -> Option<u64> {
        self.intact
    }

    fn written(&self) -> u64 {
        self.written
    }

    fn finish(&mut self, outcome: Option<Outcome>) -> io::Result<Written> {
        let batch = self.rows.batch();
        self.send(batch)?;
        let order = Order::Finish(outcome, self.rows.states());
        if let Some((orders, _)) = &self.writer {
            // Should the thread be gone, it has left the reason behind.
            drop(orders.send(order));
        }
        self.join()
    }
}

/// The thread's work.
fn write(mut chunks: Chunks<File>, place: &Place, work: &Receiver<Order>) -> End {
    let mut result = Ok(Written::default());
    while result.is_ok() {
        match work.recv() {
            Ok(Order::Write(batch)) => {
                result = chunks.write(*batch).and_then(|()| {
                    if chunks.intact().is_some() {
                        place.first_is_written()?;
                    }
                    Ok(Written::default())
                });
            }
            Ok(Order::Finish(outcome, states)) => {
                result = chunks.finish(outcome, states);
                break;
            }
            Err(_) => break,
        }
    }
    (result, chunks.intact(), chunks.written())
}
