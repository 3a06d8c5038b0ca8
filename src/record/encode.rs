//! Rerun's stream format, written synchronously and with the same bytes every time.
//!
//! The messages are rerun's own, down to their encoding. What is ours is the order: each message goes to a `Write` in
//! one piece, so that a full disk shows at the message that hit it, and the stores and fields of the footer are sorted,
//! where rerun's own encoder takes them from a hash map.

use super::ipc::{self, Pieces};
use prost::Message as _;
use prost::encoding::{WireType, encode_key, encode_varint};
use re_protos::common::v1alpha1::Compression as Compressed;
use re_protos::log_msg::v1alpha1 as protocol;
use re_sorbet::ChunkBatch;
use rerun::external::re_log_encoding::ToTransport as _;
use rerun::external::re_log_encoding::rrd::{
    Compression, CrateVersion, Encodable as _, EncodingOptions, MessageHeader, MessageKind,
    RRD_FOURCC, RrdFooter, RrdManifestBuilder, Serializer, StreamFooter, StreamHeader,
};
use rerun::external::re_log_types::{
    ArrowMsg, BlueprintActivationCommand, LogMsg, SetStoreInfo, StoreId, StoreInfo, StoreSource,
};
use rerun::external::re_tuid::Tuid;
use rerun::log::{Chunk, ChunkId, RowId};
use rerun::{AsComponents, TimePoint};
use std::io::{self, IoSlice, Write};

/// Where a message lies, without its header, and its size uncompressed.
#[derive(Clone, Copy)]
struct Place {
    span: re_span::Span<u64>,
    size: u64,
}

/// A batch as a message of rerun's.
fn whole(batch: &ChunkBatch) -> ArrowMsg {
    ArrowMsg {
        chunk_id: batch.chunk_id().as_tuid(),
        batch: batch.into(),
        on_release: None,
    }
}

/// What pads values.
const ZEROS: [u8; 64] = [0; 64];

/// Writes all of `slices`, in one go where the sink takes them so.
fn write_all_slices(sink: &mut impl Write, mut slices: &mut [IoSlice<'_>]) -> io::Result<()> {
    // Removes what is empty at the front.
    IoSlice::advance_slices(&mut slices, 0);
    while !slices.is_empty() {
        match sink.write_vectored(slices) {
            Ok(0) => return Err(io::ErrorKind::WriteZero.into()),
            Ok(written) => IoSlice::advance_slices(&mut slices, written),
            Err(e) if e.kind() == io::ErrorKind::Interrupted => {}
            Err(e) => return Err(e),
        }
    }
    Ok(())
}

/// An `.rrd` stream in the making.
pub(super) struct Encoder<W> {
    sink: W,
    /// Bytes of the whole messages written so far.
    written: u64,
    buffer: Vec<u8>,
    /// What the footer will list; a stream without one may go on for ever.
    manifests: Option<Vec<(StoreId, RrdManifestBuilder)>>,
    ids: u128,
}

impl<W: Write> Encoder<W> {
    /// Starts a stream that lists its chunks at the end.
    pub fn new(sink: W) -> io::Result<Self> {
        Self::start(sink, Some(Vec::new()))
    }

    /// Starts a stream that is read as it comes, and keeps no list of its chunks.
    pub fn unlisted(sink: W) -> io::Result<Self> {
        Self::start(sink, None)
    }

    fn start(
        mut sink: W,
        manifests: Option<Vec<(StoreId, RrdManifestBuilder)>>,
    ) -> io::Result<Self> {
        let mut buffer = Vec::new();
        StreamHeader {
            fourcc: RRD_FOURCC,
            version: CrateVersion::LOCAL.to_bytes(),
            options: EncodingOptions {
                // LZ4 would gain 3 % on positions and contours.
                compression: Compression::Off,
                serializer: Serializer::Protobuf,
            },
        }
        .to_rrd_bytes(&mut buffer)
        .map_err(io::Error::other)?;
        sink.write_all(&buffer)?;
        Ok(Self {
            sink,
            written: buffer.len() as u64,
            buffer,
            manifests,
            ids: 0,
        })
    }

    /// Bytes of the whole messages written so far: where a file is cut after a failed write.
    pub fn written(&self) -> u64 {
        self.written
    }

    /// Lets the sequence of ids begin anew: chunks of two recordings of one run that begin with other steps are not taken for the same.
    pub fn number_from(&mut self, step: u64) {
        self.ids += u128::from(step) << 64;
    }

    /// The next of a fixed sequence of row ids.
    pub fn row_id(&mut self) -> RowId {
        self.ids += 1;
        RowId::from_u128(self.ids)
    }

    /// The next of a fixed sequence of chunk ids.
    pub fn chunk_id(&mut self) -> ChunkId {
        self.ids += 1;
        ChunkId::from_u128(self.ids)
    }

    /// A chunk of one row, for data that has one value: static, or at one time.
    pub fn single(
        &mut self,
        store: &StoreId,
        entity: &str,
        time: impl Into<TimePoint>,
        data: &dyn AsComponents,
    ) -> io::Result<()> {
        let (chunk, row) = (self.chunk_id(), self.row_id());
        let builder = Chunk::builder_with_id(chunk, entity).with_archetype(row, time, data);
        self.append(store, &builder.build().map_err(io::Error::other)?)
    }

    /// Opens a store. No clock, host or compiler is named in it.
    pub fn open(&mut self, store: &StoreId) -> io::Result<()> {
        self.message(&LogMsg::SetStoreInfo(SetStoreInfo {
            row_id: Tuid::from_u128(0),
            info: StoreInfo::new(
                store.clone(),
                StoreSource::Other(env!("CARGO_PKG_NAME").to_owned()),
            ),
        }))
        .map(|_| ())
    }

    /// Writes a chunk into a store.
    pub fn append(&mut self, store: &StoreId, chunk: &Chunk) -> io::Result<()> {
        let batch = chunk.to_chunk_batch().map_err(io::Error::other)?;
        let place = match Pieces::of(&batch).map_err(io::Error::other)? {
            Some(pieces) => self.message_in_pieces(store, &batch, &pieces)?,
            None => self.message(&LogMsg::ArrowMsg(store.clone(), whole(&batch)))?,
        };
        self.list(store, &batch, place)
    }

    /// Writes a record batch without a copy of its values.
    fn message_in_pieces(
        &mut self,
        store: &StoreId,
        batch: &ChunkBatch,
        pieces: &Pieces,
    ) -> io::Result<Place> {
        let size = pieces.len() as u64;
        // The payload is field 5 of the message, between its others.
        let before = protocol::ArrowMsg {
            store_id: Some(store.clone().into()),
            uncompressed_size: size,
            encoding: protocol::Encoding::ArrowIpc.into(),
            compression: Compressed::None.into(),
            ..Default::default()
        };
        let behind = protocol::ArrowMsg {
            chunk_id: Some(batch.chunk_id().as_tuid().into()),
            is_static: Some(batch.is_static()),
            ..Default::default()
        };
        let (mut open, mut close) = (before.encode_to_vec(), ipc::END.to_vec());
        encode_key(5, WireType::LengthDelimited, &mut open);
        encode_varint(size, &mut open);
        close.extend(behind.encode_to_vec());
        let len = (open.len() + close.len() - ipc::END.len()) as u64 + size;
        self.buffer.clear();
        let kind = MessageKind::ArrowMsg;
        MessageHeader { kind, len }
            .to_rrd_bytes(&mut self.buffer)
            .map_err(io::Error::other)?;
        let start = self.written + self.buffer.len() as u64;
        self.buffer.extend_from_slice(&open);
        self.buffer.extend_from_slice(&pieces.head);
        let mut slices = Vec::with_capacity(2 * pieces.buffers.len() + 2);
        slices.push(IoSlice::new(&self.buffer));
        for values in &pieces.buffers {
            let padding = ipc::padded(values.len()) - values.len();
            slices.push(IoSlice::new(values));
            slices.push(IoSlice::new(&ZEROS[..padding]));
        }
        slices.push(IoSlice::new(&close));
        write_all_slices(&mut self.sink, &mut slices)?;
        self.written = start + len;
        let span = re_span::Span { start, len };
        Ok(Place { span, size })
    }

    /// Makes a blueprint the one that the viewer shows.
    pub fn activate(&mut self, blueprint: &StoreId) -> io::Result<()> {
        self.message(&LogMsg::BlueprintActivationCommand(
            BlueprintActivationCommand {
                blueprint_id: blueprint.clone(),
                make_active: true,
                make_default: true,
            },
        ))
        .map(|_| ())
    }

    fn message(&mut self, message: &LogMsg) -> io::Result<Place> {
        let transport = message
            .to_transport(Compression::Off)
            .map_err(io::Error::other)?;
        self.buffer.clear();
        transport
            .to_rrd_bytes(&mut self.buffer)
            .map_err(io::Error::other)?;
        self.sink.write_all(&self.buffer)?;
        let header = MessageHeader::ENCODED_SIZE_BYTES as u64;
        let span = re_span::Span {
            start: self.written + header,
            len: self.buffer.len() as u64 - header,
        };
        self.written += self.buffer.len() as u64;
        let size = transport.byte_size_uncompressed();
        Ok(Place { span, size })
    }

    /// Remembers a chunk for the footer.
    fn list(&mut self, store: &StoreId, batch: &ChunkBatch, place: Place) -> io::Result<()> {
        let Some(manifests) = &mut self.manifests else {
            return Ok(());
        };
        let known = manifests.iter().position(|(id, _)| id == store);
        let index = known.unwrap_or(manifests.len());
        if known.is_none() {
            let manifest = RrdManifestBuilder::default();
            manifests.push((store.clone(), manifest));
        }
        let manifest = &mut manifests[index].1;
        manifest
            .append(batch, place.span, place.size)
            .map_err(io::Error::other)
    }

    /// Closes the stream with a footer: which chunk lies where, store by store in the order of their opening.
    pub fn finish(&mut self) -> io::Result<()> {
        let mut footer = RrdFooter::default()
            .to_transport(())
            .map_err(io::Error::other)?;
        for (store, manifest) in self.manifests.take().into_iter().flatten() {
            let mut manifest = manifest.build(store).map_err(io::Error::other)?;
            let mut fields = manifest.sorbet_schema.fields().to_vec();
            fields.sort();
            manifest.sorbet_schema.fields = fields.into();
            footer
                .manifests
                .push(manifest.to_transport(()).map_err(io::Error::other)?);
        }
        // An end message is framed like any other; the stream footer points at its payload.
        self.buffer.clear();
        footer
            .to_rrd_bytes(&mut self.buffer)
            .map_err(io::Error::other)?;
        let mut bytes = Vec::with_capacity(self.buffer.len() + 64);
        MessageHeader {
            kind: MessageKind::End,
            len: self.buffer.len() as u64,
        }
        .to_rrd_bytes(&mut bytes)
        .map_err(io::Error::other)?;
        let start = self.written + bytes.len() as u64;
        bytes.extend_from_slice(&self.buffer);
        StreamFooter::from_rrd_footer_bytes(start, &self.buffer)
            .to_rrd_bytes(&mut bytes)
            .map_err(io::Error::other)?;
        self.sink.write_all(&bytes)?;
        self.sink.flush()?;
        self.written += bytes.len() as u64;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rerun::external::arrow::array::{Float64Array, ListArray, StringArray};
    use rerun::external::arrow::buffer::OffsetBuffer;
    use rerun::external::arrow::datatypes::Field;
    use rerun::{ComponentDescriptor, TimeColumn};
    use std::sync::Arc;

    /// A chunk with lists of numbers, of vectors and of texts; some of it empty if `empty`.
    fn chunk(encoder: &mut Encoder<&mut Vec<u8>>, rows: usize, empty: bool) -> Chunk {
        use rerun::external::arrow::array::{Array as _, ArrayRef, FixedSizeListArray};
        let count = |k: usize| if empty { 0 } else { 3 * k + 1 };
        let offsets = OffsetBuffer::<i32>::from_lengths((0..rows).map(count));
        let total = *offsets.last().unwrap() as usize;
        let numbers = |n: usize| Float64Array::from_iter_values((0..n).map(|k| k as f64 / 3.0));
        let item =
            |values: &ArrayRef| Arc::new(Field::new("item", values.data_type().clone(), true));
        let vectors = FixedSizeListArray::new(
            Arc::new(Field::new("item", numbers(1).data_type().clone(), false)),
            2,
            Arc::new(numbers(2 * total)),
            None,
        );
        let texts = StringArray::from_iter_values((0..total).map(|k| "x".repeat(k % 5)));
        let columns: [ArrayRef; 3] = [Arc::new(numbers(total)), Arc::new(vectors), Arc::new(texts)];
        let columns = columns
            .into_iter()
            .zip(["a:a", "a:b", "a:c"])
            .map(|(values, name)| {
                let list = ListArray::new(item(&values), offsets.clone(), values, None);
                (ComponentDescriptor::partial(name), list)
            });
        let times = TimeColumn::new_sequence("step", 0..rows as i64);
        let (id, ids) = (
            encoder.chunk_id(),
            (0..rows).map(|_| encoder.row_id()).collect::<Vec<_>>(),
        );
        let timelines = core::iter::once((*times.timeline().name(), times)).collect();
        Chunk::from_native_row_ids(id, "/a".into(), None, &ids, timelines, columns.collect())
            .unwrap()
    }

    #[test]
    fn messages_in_pieces_are_the_bytes_of_reruns_own_encoder() {
        let store = StoreId::recording("softjam", "test");
        let (mut ours, mut theirs, mut scratch) = (Vec::new(), Vec::new(), Vec::new());
        let mut chunks = Encoder::new(&mut scratch).unwrap();
        let mut pieces = Encoder::new(&mut ours).unwrap();
        let mut plain = Encoder::new(&mut theirs).unwrap();
        for (rows, empty) in [(4, false), (1, false), (300, false), (5, true), (2, false)] {
            let chunk = chunk(&mut chunks, rows, empty);
            let batch = chunk.to_chunk_batch().unwrap();
            let taken = Pieces::of(&batch).unwrap();
            assert_eq!(taken.is_some(), !empty);
            pieces.append(&store, &chunk).unwrap();
            let message = LogMsg::ArrowMsg(store.clone(), chunk.to_arrow_msg().unwrap());
            let place = plain.message(&message).unwrap();
            plain.list(&store, &batch, place).unwrap();
            assert_eq!(pieces.written(), plain.written());
        }
        pieces.finish().unwrap();
        plain.finish().unwrap();
        assert!(ours == theirs);
        assert!(ours.len() > 50_000);
    }

    #[test]
    fn slices_are_written_whole_by_a_sink_that_takes_a_few_bytes_at_a_time() {
        struct Narrow(Vec<u8>);
        impl Write for Narrow {
            fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
                let taken = bytes.len().min(3);
                self.0.extend_from_slice(&bytes[..taken]);
                Ok(taken)
            }
            fn flush(&mut self) -> io::Result<()> {
                Ok(())
            }
        }
        let mut sink = Narrow(Vec::new());
        let parts: [&[u8]; 5] = [b"", b"softjam", b"", b"writes", b"!"];
        write_all_slices(&mut sink, &mut parts.map(IoSlice::new)).unwrap();
        assert_eq!(sink.0, b"softjamwrites!");
        write_all_slices(&mut sink, &mut []).unwrap();
    }
}
