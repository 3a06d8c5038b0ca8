//! Where an MCAP writer writes to: whole pieces only, and the closing summary in one order.
//!
//! `mcap::Writer` takes the schemas and channels of its summary from a hash map, so their order changes from run to run.
//! They are sorted here by their numbers before they reach the file. The groups keep their places and lengths; only the
//! checksum in the footer has to follow.

use mcap::MAGIC;
use mcap::records::op;
use std::io::{self, Write};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// A sink that is shared with the MCAP writer that writes on it.
pub(super) struct Sink<W>(Arc<Mutex<State<W>>>);

struct State<W> {
    inner: W,
    /// What has come since the last flush.
    buffer: Vec<u8>,
    written: u64,
    /// Whether `flush` waits for [`Sink::close`].
    held: bool,
    /// Whether the inner sink has failed: nothing more may follow a torn piece.
    failed: bool,
}

impl<W> Clone for Sink<W> {
    fn clone(&self) -> Self {
        Self(Arc::clone(&self.0))
    }
}

impl<W: Write> Sink<W> {
    pub fn new(inner: W) -> Self {
        Self(Arc::new(Mutex::new(State {
            inner,
            buffer: Vec::new(),
            written: 0,
            held: false,
            failed: false,
        })))
    }

    fn state(&self) -> MutexGuard<'_, State<W>> {
        // A panic elsewhere leaves the bytes as they are.
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Bytes of the whole pieces written so far.
    pub fn written(&self) -> u64 {
        self.state().written
    }

    /// From now on bytes are kept back: what follows is the end of the file.
    pub fn hold(&self) {
        self.state().held = true;
    }

    /// Writes what was held back, its summary in order.
    pub fn close(&self) -> io::Result<()> {
        let mut state = self.state();
        state.buffer = sort_summary(&state.buffer).map_err(io::Error::other)?;
        state.held = false;
        state.flush()
    }
}

impl<W: Write> State<W> {
    fn flush(&mut self) -> io::Result<()> {
        if self.held || self.failed {
            return Ok(());
        }
        let piece = self
            .inner
            .write_all(&self.buffer)
            .and_then(|()| self.inner.flush());
        self.failed = piece.is_err();
        self.written += if self.failed {
            0
        } else {
            self.buffer.len() as u64
        };
        self.buffer.clear();
        piece
    }
}

impl<W: Write> Write for Sink<W> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.state().buffer.extend_from_slice(bytes);
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        self.state().flush()
    }
}

/// Bytes of an operation code and a length.
const HEAD: usize = 9;

/// Sorts the schemas and the channels in the end of a file: data end, summary, footer, magic.
fn sort_summary(bytes: &[u8]) -> Result<Vec<u8>, &'static str> {
    const WRONG: &str = "the summary is not what was expected";
    let mut records: Vec<&[u8]> = Vec::new();
    let mut rest = bytes.strip_suffix(MAGIC).ok_or(WRONG)?;
    while let Some((_, length)) = rest.get(..HEAD).and_then(|head| head.split_first()) {
        let length = length.try_into().map(u64::from_le_bytes);
        let length = length.ok().and_then(|n| usize::try_from(n).ok());
        let end = length.and_then(|n| n.checked_add(HEAD)).ok_or(WRONG)?;
        let (record, behind) = rest.split_at_checked(end).ok_or(WRONG)?;
        records.push(record);
        rest = behind;
    }
    for group in records.chunk_by_mut(|a, b| a[0] == b[0]) {
        if matches!(group[0][0], op::SCHEMA | op::CHANNEL) {
            // Both begin with their number.
            group.sort_by_key(|record| record.get(HEAD..HEAD + 2).map(|id| [id[1], id[0]]));
        }
    }
    let [data_end, summary @ .., footer] = records.as_slice() else {
        return Err(WRONG);
    };
    if data_end[0] != op::DATA_END || footer[0] != op::FOOTER || footer.len() != HEAD + 20 {
        return Err(WRONG);
    }
    let mut sorted = data_end.to_vec();
    let start = sorted.len();
    for record in summary {
        sorted.extend_from_slice(record);
    }
    // The checksum covers the summary and the footer up to itself.
    sorted.extend_from_slice(&footer[..HEAD + 16]);
    let checksum = crc32fast::hash(&sorted[start..]);
    sorted.extend_from_slice(&checksum.to_le_bytes());
    sorted.extend_from_slice(MAGIC);
    Ok(sorted)
}
