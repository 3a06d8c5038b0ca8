//! The frames of an `.rrd` stream: which bytes belong to which message.
//!
//! Rerun's own decoder takes a file that breaks off for one that ends, two files in a row for one, and allocates what a
//! compressed message claims to need. A recording that is to be trusted needs to know. The messages themselves are
//! decoded by rerun.

use crate::budget::Budget;
use crate::replay::source::{Ending, Problem, guarded, more_behind};
use crate::text::counted;
use re_protos::common::v1alpha1::Compression;
use re_protos::log_msg::v1alpha1::ArrowMsg;
use re_protos::log_msg::v1alpha1::log_msg::Msg;
use rerun::external::arrow::ipc::root_as_message;
use rerun::external::re_log_encoding::ToApplication as _;
use rerun::external::re_log_encoding::external::lz4_flex;
use rerun::external::re_log_encoding::rrd::{
    Compression as StreamCompression, Decodable as _, MessageHeader, MessageKind, RRD_FOURCC,
    StreamFooter, StreamHeader,
};
use rerun::external::re_log_types::{StoreId, StoreKind};
use rerun::log::Chunk;
use std::io::{self, Read};

/// A stream that is being read, message by message.
pub(super) struct Stream {
    source: Box<dyn Read + Send>,
    length: u64,
    offset: u64,
    bytes: Vec<u8>,
    ending: Option<Ending>,
    /// Whether it says that its messages are not compressed, as softjam's are.
    plain: bool,
    budget: Budget,
}

/// A message that matters here.
pub(super) enum Message {
    /// A recording begins.
    Opens,
    /// Rows of an entity of a recording.
    Chunk(StoreId, Box<Chunk>),
    /// The blueprint, which is for the viewer.
    Layout,
}

impl Stream {
    /// Starts to read a source of `length` bytes.
    pub fn open(
        mut source: Box<dyn Read + Send>,
        length: u64,
        budget: Budget,
    ) -> Result<Self, String> {
        let mut header = [0; StreamHeader::ENCODED_SIZE_BYTES];
        if length == 0 {
            return Err("the file is empty".to_owned());
        }
        source.read_exact(&mut header).map_err(|e| match e.kind() {
            io::ErrorKind::UnexpectedEof => format!("it has only {}", counted(length, "byte")),
            _ => e.to_string(),
        })?;
        let StreamHeader { options, .. } =
            StreamHeader::from_rrd_bytes(&header).map_err(|e| e.to_string())?;
        Ok(Self {
            source,
            length,
            offset: header.len() as u64,
            bytes: Vec::new(),
            ending: None,
            plain: options.compression == StreamCompression::Off,
            budget,
        })
    }

    /// Whether the stream says that its messages are not compressed: rerun's tools compress what they write.
    pub fn is_plain(&self) -> bool {
        self.plain
    }

    /// How the stream ended; `None` before its end.
    pub fn ending(&self) -> Option<Ending> {
        self.ending
    }

    /// Bytes read so far.
    pub fn offset(&self) -> u64 {
        self.offset
    }

    /// The next message; `None` at the end.
    pub fn next(&mut self) -> Result<Option<Message>, Problem> {
        if self.ending.is_some() {
            return Ok(None);
        }
        let start = self.offset;
        let header_size = MessageHeader::ENCODED_SIZE_BYTES as u64;
        if self.length - start < header_size {
            self.ending = Some(Ending::BreaksOff);
            return Ok(None);
        }
        self.bytes.clear();
        self.read(header_size)?;
        let at = |problem: String| format!("the message at byte {start}: {problem}");
        let header = MessageHeader::from_rrd_bytes(&self.bytes).map_err(|e| at(e.to_string()))?;
        if header.len > self.length - self.offset {
            self.ending = Some(Ending::BreaksOff);
            return Ok(None);
        }
        let name = format_args!("the message at byte {start}");
        self.budget.allow_piece(name, header.len)?;
        self.read(header.len)?;
        if matches!(header.kind, MessageKind::End) {
            return Ok(self.close()?);
        }
        let message = Option::<Msg>::from_rrd_bytes(&self.bytes).map_err(|e| {
            let begins = |bytes: &[u8]| bytes == RRD_FOURCC;
            at(if self.bytes.windows(RRD_FOURCC.len()).any(begins) {
                "it breaks off, and another file follows: several files in one?".to_owned()
            } else {
                e.to_string()
            })
        })?;
        match message {
            Some(Msg::ArrowMsg(mut arrow)) => {
                let store = arrow.store_id.clone();
                let store = store.ok_or_else(|| at("no store is named".to_owned()))?;
                let store = StoreId::try_from(store).map_err(|e| at(e.to_string()))?;
                if store.kind() != StoreKind::Recording {
                    return Ok(Some(Message::Layout));
                }
                if arrow.compression() == Compression::Lz4 {
                    let name = format_args!("the message at byte {start}, unpacked,");
                    self.budget.allow_piece(name, arrow.uncompressed_size)?;
                }
                let chunk = guarded(|| {
                    decompress(&mut arrow)?;
                    check_claims(&arrow.payload)?;
                    let arrow = arrow.to_application(()).map_err(|e| e.to_string())?;
                    Chunk::from_arrow_msg(&arrow).map_err(|e| e.to_string())
                });
                Ok(Some(Message::Chunk(store, Box::new(chunk.map_err(at)?))))
            }
            Some(Msg::SetStoreInfo(opening)) => {
                let store = opening.info.and_then(|info| info.store_id);
                let store = store.ok_or_else(|| at("no store is named".to_owned()))?;
                let store = StoreId::try_from(store).map_err(|e| at(e.to_string()))?;
                Ok(Some(match store.kind() {
                    StoreKind::Recording => Message::Opens,
                    StoreKind::Blueprint => Message::Layout,
                }))
            }
            _ => Ok(Some(Message::Layout)),
        }
    }

    /// Behind the end message: the stream footer, and then nothing.
    fn close(&mut self) -> Result<Option<Message>, String> {
        let left = self.length - self.offset;
        let footer = StreamFooter::ENCODED_SIZE_BYTES as u64;
        if left < footer {
            self.ending = Some(Ending::BreaksOff);
            return Ok(None);
        }
        self.bytes.clear();
        self.read(footer)?;
        StreamFooter::from_rrd_bytes(&self.bytes).map_err(|e| format!("its footer: {e}"))?;
        if left > footer {
            return Err(more_behind(left - footer));
        }
        self.ending = Some(Ending::Closed);
        Ok(None)
    }

    /// Appends `count` bytes, which the source is known to have, to the buffer.
    fn read(&mut self, count: u64) -> Result<(), String> {
        let read = self
            .source
            .by_ref()
            .take(count)
            .read_to_end(&mut self.bytes);
        let read = read.map_err(|e| e.to_string())? as u64;
        self.offset += read;
        if read < count {
            return Err("the file became shorter while it was read".to_owned());
        }
        Ok(())
    }
}

/// Replaces a payload that rerun's tools have compressed; softjam's own are not.
fn decompress(arrow: &mut ArrowMsg) -> Result<(), String> {
    if arrow.compression() != Compression::Lz4 {
        return Ok(());
    }
    let bytes = lz4_flex::block::decompress(&arrow.payload, arrow.uncompressed_size as usize);
    arrow.payload = bytes.map_err(|e| e.to_string())?.into();
    arrow.set_compression(Compression::None);
    Ok(())
}

/// Checks that the messages of an Arrow stream are no longer than the stream: Arrow's reader allocates what they claim.
fn check_claims(mut bytes: &[u8]) -> Result<(), String> {
    while let Some((head, rest)) = bytes.split_first_chunk::<8>() {
        let [a, b, c, d, e, f, g, h] = *head;
        if [a, b, c, d] != [0xff; 4] {
            return Err("an Arrow message does not begin where it should".to_owned());
        }
        let length = u32::from_le_bytes([e, f, g, h]) as usize;
        if length == 0 {
            return Ok(());
        }
        let metadata = rest.get(..length).ok_or("an Arrow message is cut off")?;
        let message = root_as_message(metadata).map_err(|e| e.to_string())?;
        let compressed = message
            .header_as_record_batch()
            .is_some_and(|batch| batch.compression().is_some());
        if compressed {
            return Err("its Arrow buffers are compressed, as no recording's are".to_owned());
        }
        let body = usize::try_from(message.bodyLength()).ok();
        let end = body.and_then(|body| length.checked_add(body));
        let end = end.filter(|end| *end <= rest.len());
        bytes = &rest[end.ok_or("an Arrow message claims more bytes than there are")?..];
    }
    Ok(())
}
