//! The records of an MCAP file, those of its chunks among them.
//!
//! The library says which bytes belong to which record and whether the checksums over data and summary are right. What it
//! asks for is held against the file's length and the budget first. Chunks are unpacked here: its reader waits for ever for
//! what a chunk claims and does not hold, and reads on behind a chunk that ends within a record.

use crate::budget::Budget;
use crate::replay::source::{Ending, Problem, guarded, more_behind};
use crate::text::{counted, shown};
use mcap::McapError;
use mcap::records::{ChunkHeader, Record};
use mcap::sans_io::{LinearReadEvent, LinearReader, LinearReaderOptions};
use rerun::external::re_log_encoding::external::lz4_flex;
use std::io::{Cursor, ErrorKind, Read};

/// An MCAP file that is being read, record by record, chunks unpacked.
pub(super) struct Stream {
    file: Records,
    /// The unpacked chunk that is being read.
    chunk: Option<Records>,
    budget: Budget,
}

/// Records one behind the other.
struct Records {
    source: Box<dyn Read + Send>,
    length: u64,
    offset: u64,
    reader: LinearReader,
    /// The byte of the file at which the chunk begins that holds them.
    chunk: Option<u64>,
    /// Whether the data have been read: behind them stand indexes, which are not needed, and a footer.
    behind: bool,
    ending: Option<Ending>,
}

enum Step {
    Record(Record<'static>),
    /// So many bytes are missing.
    Missing(usize),
    End,
}

impl Stream {
    /// Starts to read a source of `length` bytes.
    pub fn open(source: Box<dyn Read + Send>, length: u64, budget: Budget) -> Self {
        Self {
            file: Records::new(source, length, None),
            chunk: None,
            budget,
        }
    }

    /// How the file ended; `None` before its end.
    pub fn ending(&self) -> Option<Ending> {
        self.file.ending
    }

    /// The next record of the data section, chunks taken apart; `None` at the end.
    pub fn next(&mut self) -> Result<Option<Record<'static>>, Problem> {
        loop {
            if let Some(chunk) = self.chunk.as_mut().filter(|chunk| chunk.left() > 0) {
                let record = chunk.next(self.budget)?;
                let cut = || "a chunk ends within a record".to_owned().into();
                return record.ok_or_else(cut).map(Some);
            }
            let start = self.file.offset;
            match self.file.next(self.budget)? {
                Some(Record::Chunk { header, data }) => {
                    let name = format_args!("the chunk at byte {start}, unpacked,");
                    self.budget.allow_piece(name, header.uncompressed_size)?;
                    let at = |problem| format!("the record at byte {start}: {problem}");
                    let bytes = Cursor::new(unpack(&header, &data).map_err(at)?);
                    let length = header.uncompressed_size;
                    self.chunk = Some(Records::new(Box::new(bytes), length, Some(start)));
                }
                // What points at other records; the records are read in their order.
                Some(Record::MessageIndex(_) | Record::Unknown { .. }) => {}
                other => return Ok(other),
            }
        }
    }
}

impl Records {
    fn new(source: Box<dyn Read + Send>, length: u64, chunk: Option<u64>) -> Self {
        let in_file = chunk.is_none();
        Self {
            source,
            length,
            offset: 0,
            reader: LinearReader::new_with_options(LinearReaderOptions {
                skip_start_magic: !in_file,
                skip_end_magic: !in_file,
                emit_chunks: true,
                validate_data_section_crc: in_file,
                validate_summary_section_crc: in_file,
                record_length_limit: usize::try_from(length.saturating_sub(9)).ok(),
                ..LinearReaderOptions::default()
            }),
            chunk,
            behind: false,
            ending: None,
        }
    }

    fn left(&self) -> u64 {
        self.length - self.offset
    }

    /// The next record; `None` at the end and where a record is not whole.
    fn next(&mut self, budget: Budget) -> Result<Option<Record<'static>>, Problem> {
        let name = format!("the record at byte {}", self.chunk.unwrap_or(self.offset));
        loop {
            let step = guarded(|| step(&mut self.reader, self.behind));
            self.ending = match step.map_err(|problem| format!("{name}: {problem}"))? {
                Step::Record(record) => {
                    self.behind |= self.chunk.is_none() && matches!(record, Record::DataEnd(_));
                    return Ok(Some(record));
                }
                Step::Missing(need) if need as u64 <= self.left() => {
                    budget.allow_piece(&name, need as u64)?;
                    let read = self.source.read_exact(self.reader.insert(need));
                    read.map_err(|error| match error.kind() {
                        ErrorKind::UnexpectedEof => {
                            "the file became shorter while it was read".to_owned()
                        }
                        _ => error.to_string(),
                    })?;
                    self.reader.notify_read(need);
                    self.offset += need as u64;
                    continue;
                }
                Step::End if self.left() > 0 => return Err(more_behind(self.left()).into()),
                Step::End if self.behind => Some(Ending::Closed),
                _ => Some(Ending::BreaksOff),
            };
            return Ok(None);
        }
    }
}

/// Reads on; what stands behind the data is not decoded.
fn step(reader: &mut LinearReader, behind: bool) -> Result<Step, String> {
    Ok(match reader.next_event().transpose() {
        Ok(Some(LinearReadEvent::Record { opcode, data })) => {
            let opcode = if behind { 0 } else { opcode };
            let record = mcap::parse_record(opcode, data).map_err(|e| e.to_string())?;
            Step::Record(record.into_owned())
        }
        Ok(Some(LinearReadEvent::ReadRequest(need))) => Step::Missing(need),
        // Longer than the file.
        Err(McapError::RecordTooLarge { .. }) => Step::Missing(usize::MAX),
        Err(McapError::BadMagic) => return Err("it does not end like an MCAP file".to_owned()),
        Err(error) => return Err(error.to_string()),
        Ok(None) => Step::End,
    })
}

/// The records in a chunk, which its checksum covers.
fn unpack(header: &ChunkHeader, packed: &[u8]) -> Result<Vec<u8>, String> {
    let claimed = header.uncompressed_size;
    let mut bytes = Vec::new();
    let wrong = |e: std::io::Error| format!("a chunk cannot be unpacked: {e}");
    // One byte more than claimed is one too many.
    let most = claimed + 1;
    match header.compression.as_str() {
        "" => packed.take(most).read_to_end(&mut bytes),
        "zstd" => zstd::Decoder::new(packed)
            .and_then(|unpacked| unpacked.take(most).read_to_end(&mut bytes)),
        "lz4" => lz4_flex::frame::FrameDecoder::new(packed)
            .take(most)
            .read_to_end(&mut bytes),
        other => {
            return Err(format!(
                "a chunk is packed with {}, which is not known here",
                shown(other)
            ));
        }
    }
    .map_err(wrong)?;
    if bytes.len() as u64 != claimed {
        return Err(format!(
            "a chunk claims to hold {} and does not",
            counted(claimed, "byte")
        ));
    }
    let saved = header.uncompressed_crc;
    if saved != 0 && saved != crc32fast::hash(&bytes) {
        return Err("the checksum of a chunk is wrong".to_owned());
    }
    Ok(bytes)
}
