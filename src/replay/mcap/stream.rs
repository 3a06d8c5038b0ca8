//! The records of an MCAP file: which bytes belong to which, and whether their checksums are right.
//!
//! The file is framed here because the library's reader allocates what a record claims to be long and takes a file that
//! breaks off for a broken one. The records themselves are decoded by the library.

use crate::budget::Budget;
use crate::replay::source::{Ending, Problem, guarded, more_behind};
use crate::text::{counted, shown};
use mcap::MAGIC;
use mcap::records::{ChunkHeader, Record, op};
use rerun::external::re_log_encoding::external::lz4_flex;
use std::io::{Cursor, Read};

/// An MCAP file that is being read, record by record, chunks unpacked.
pub(super) struct Stream {
    source: Box<dyn Read + Send>,
    length: u64,
    offset: u64,
    /// The record at hand: operation code, length, body.
    bytes: Vec<u8>,
    /// Checksum of the section that is being read.
    checksum: crc32fast::Hasher,
    ending: Option<Ending>,
    /// The unpacked chunk that is being read, and how far.
    chunk: Cursor<Vec<u8>>,
    budget: Budget,
}

/// Bytes of an operation code and a length.
const HEAD: usize = 9;

impl Stream {
    /// Starts to read a source of `length` bytes.
    pub fn open(source: Box<dyn Read + Send>, length: u64, budget: Budget) -> Result<Self, String> {
        let mut stream = Self {
            source,
            length,
            offset: 0,
            bytes: Vec::new(),
            checksum: crc32fast::Hasher::new(),
            ending: None,
            chunk: Cursor::default(),
            budget,
        };
        if !stream.read(MAGIC.len() as u64)? || stream.bytes != MAGIC {
            return Err("it does not begin like one".to_owned());
        }
        stream.checksum.update(MAGIC);
        Ok(stream)
    }

    /// How the file ended; `None` before its end.
    pub fn ending(&self) -> Option<Ending> {
        self.ending
    }

    /// The next record of the data section, chunks taken apart; `None` at the end.
    pub fn next(&mut self) -> Result<Option<Record<'static>>, Problem> {
        loop {
            if let Some(record) = self.next_in_chunk()? {
                return Ok(Some(record));
            }
            let start = self.offset;
            let at = |problem: String| format!("the record at byte {start}: {problem}");
            let Some(opcode) = self.next_outside()? else {
                return Ok(None);
            };
            if opcode != op::DATA_END {
                self.checksum.update(&self.bytes);
            }
            match parse(opcode, &self.bytes[HEAD..]).map_err(at)? {
                Record::DataEnd(end) => {
                    let saved = end.data_section_crc;
                    let checksum = core::mem::take(&mut self.checksum).finalize();
                    if saved != 0 && saved != checksum {
                        return Err("the checksum over the data is wrong".to_owned().into());
                    }
                    return self.read_summary();
                }
                Record::Chunk { header, data } => {
                    let name = format_args!("the chunk at byte {start}, unpacked,");
                    self.budget.allow_piece(name, header.uncompressed_size)?;
                    self.chunk = Cursor::new(unpack(&header, &data).map_err(at)?);
                }
                // What points at other records; the records are read in their order.
                Record::MessageIndex(_) => {}
                record => return Ok(Some(record)),
            }
        }
    }

    /// The next record of the open chunk.
    fn next_in_chunk(&mut self) -> Result<Option<Record<'static>>, String> {
        const CUT: &str = "a chunk ends within a record";
        let start = self.chunk.position() as usize;
        let rest = &self.chunk.get_ref()[start..];
        if rest.is_empty() {
            return Ok(None);
        }
        let (head, rest) = rest.split_first_chunk::<HEAD>().ok_or(CUT)?;
        let body = length(head).and_then(|n| rest.get(..n)).ok_or(CUT)?;
        let record = parse(head[0], body)?;
        let end = start + HEAD + body.len();
        self.chunk.set_position(end as u64);
        Ok(Some(record))
    }

    /// Reads a record whole; its operation code, or `None` where the file breaks off.
    fn next_outside(&mut self) -> Result<Option<u8>, Problem> {
        if self.ending.is_some() {
            return Ok(None);
        }
        self.bytes.clear();
        if self.read(HEAD as u64)? {
            let head = self.bytes.first_chunk::<HEAD>();
            // A length beyond any machine's memory lies behind the end of any file.
            let body = head.and_then(length).unwrap_or(usize::MAX) as u64;
            if body <= self.length - self.offset {
                let start = self.offset - HEAD as u64;
                let name = format_args!("the record at byte {start}");
                self.budget.allow_piece(name, body)?;
                self.read(body)?;
                return Ok(self.bytes.first().copied());
            }
        }
        self.ending = Some(Ending::BreaksOff);
        Ok(None)
    }

    /// Behind the data: indexes, which are not needed, a footer with a checksum over them, and nothing else.
    fn read_summary(&mut self) -> Result<Option<Record<'static>>, Problem> {
        while let Some(opcode) = self.next_outside()? {
            if opcode != op::FOOTER {
                self.checksum.update(&self.bytes);
                continue;
            }
            let Record::Footer(footer) = parse(opcode, &self.bytes[HEAD..])? else {
                return Err("its footer is not one".to_owned().into());
            };
            self.checksum.update(&self.bytes[..HEAD + 16]);
            let checksum = core::mem::take(&mut self.checksum).finalize();
            if footer.summary_crc != 0 && footer.summary_crc != checksum {
                return Err("the checksum over the summary is wrong".to_owned().into());
            }
            self.bytes.clear();
            if !self.read(MAGIC.len() as u64)? {
                break;
            }
            if self.bytes != MAGIC {
                return Err("it does not end like an MCAP file".to_owned().into());
            }
            if self.offset < self.length {
                let more = self.length - self.offset;
                return Err(more_behind(more).into());
            }
            self.ending = Some(Ending::Closed);
            return Ok(None);
        }
        self.ending = Some(Ending::BreaksOff);
        Ok(None)
    }

    /// Appends `count` bytes to the buffer; `false` if the file has not so many left.
    fn read(&mut self, count: u64) -> Result<bool, String> {
        if count > self.length - self.offset {
            return Ok(false);
        }
        let source = self.source.by_ref();
        let read = source.take(count).read_to_end(&mut self.bytes);
        let read = read.map_err(|e| e.to_string())? as u64;
        self.offset += read;
        if read < count {
            return Err("the file became shorter while it was read".to_owned());
        }
        Ok(true)
    }
}

fn length(head: &[u8; HEAD]) -> Option<usize> {
    let [_, length @ ..] = *head;
    usize::try_from(u64::from_le_bytes(length)).ok()
}

fn parse(opcode: u8, body: &[u8]) -> Result<Record<'static>, String> {
    guarded(|| {
        let record = mcap::parse_record(opcode, body).map_err(|e| e.to_string())?;
        Ok(record.into_owned())
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
