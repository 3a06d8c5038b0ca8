//! A record batch as an Arrow stream, without a copy of its values.
//!
//! Arrow's writer copies all values behind each other, rerun's encoder copies the result into a message, and that into a
//! buffer. Here a message is a list of pieces: what stands around the values, and the values where they are. The bytes are
//! those of the two libraries. The schema is written by Arrow itself, and the description of the values by Arrow's builders.

use flatbuffers::FlatBufferBuilder;
use rerun::external::arrow::array::{Array as _, ArrayData, RecordBatch};
use rerun::external::arrow::buffer::Buffer;
use rerun::external::arrow::datatypes::DataType;
use rerun::external::arrow::error::ArrowError;
use rerun::external::arrow::ipc;
use rerun::external::arrow::ipc::writer::{
    EncodedData, IpcWriteOptions, StreamWriter, write_message,
};

/// Buffers begin at multiples of this many bytes of the values.
const ALIGNMENT: usize = 64;

/// What ends an Arrow stream: a message of no length.
pub(super) const END: [u8; 8] = [0xff, 0xff, 0xff, 0xff, 0, 0, 0, 0];

/// A record batch as pieces of a stream, without its [`END`].
pub(super) struct Pieces {
    /// Schema and description.
    pub head: Vec<u8>,
    /// The values; each is padded with zeros to [`padded`] bytes.
    pub buffers: Vec<Buffer>,
}

/// What `length` bytes take up.
pub(super) fn padded(length: usize) -> usize {
    length.next_multiple_of(ALIGNMENT)
}

impl Pieces {
    /// The pieces of `batch`; `None` if it holds what is not written here: nulls, slices, lists of nothing, other types.
    pub fn of(batch: &RecordBatch) -> Result<Option<Self>, ArrowError> {
        let (mut lengths, mut buffers) = (Vec::new(), Vec::new());
        for column in batch.columns() {
            if gather(&column.to_data(), &mut lengths, &mut buffers).is_none() {
                return Ok(None);
            }
        }
        let mut head = Vec::with_capacity(8192);
        StreamWriter::try_new(&mut head, batch.schema_ref())?;
        let description = EncodedData {
            ipc_message: description(batch.num_rows(), &lengths, &buffers),
            arrow_data: Vec::new(),
        };
        write_message(&mut head, description, &IpcWriteOptions::default())?;
        Ok(Some(Self { head, buffers }))
    }

    /// Length of the stream with its end (bytes).
    pub fn len(&self) -> usize {
        let values: usize = self.buffers.iter().map(|b| padded(b.len())).sum();
        self.head.len() + values + END.len()
    }
}

/// Appends length and buffers of an array and of those within it, in Arrow's order.
fn gather(data: &ArrayData, lengths: &mut Vec<usize>, buffers: &mut Vec<Buffer>) -> Option<()> {
    let length = data.len();
    if length == 0 || data.offset() != 0 || data.null_count() != 0 {
        return None;
    }
    lengths.push(length);
    // No nulls, no bitmap of them.
    buffers.push(Buffer::from(&[]));
    let mut push = |k: usize, bytes: usize| {
        let buffer: &Buffer = data.buffers().get(k)?;
        let whole = buffer.len() >= bytes;
        whole.then(|| buffers.push(buffer.slice_with_length(0, bytes)))
    };
    match data.data_type() {
        DataType::List(_) => {
            push(0, 4 * (length + 1))?;
            let (child, offsets) = (data.child_data().first()?, data.buffer::<i32>(0));
            let all = offsets[0] == 0 && offsets[length] as usize == child.len();
            all.then(|| gather(child, lengths, buffers))?
        }
        DataType::FixedSizeList(_, width) => {
            let child = data.child_data().first()?;
            let all = child.len() == length * *width as usize;
            all.then(|| gather(child, lengths, buffers))?
        }
        DataType::Utf8 => {
            push(0, 4 * (length + 1))?;
            let offsets = data.buffer::<i32>(0);
            if offsets[0] != 0 {
                return None;
            }
            push(1, offsets[length] as usize)
        }
        DataType::FixedSizeBinary(width) => push(0, length * *width as usize),
        other => push(0, length * other.primitive_width()?),
    }
}

/// Arrow's description of the values of a batch: its rows, the lengths of its arrays, and where their buffers lie.
fn description(rows: usize, lengths: &[usize], buffers: &[Buffer]) -> Vec<u8> {
    let mut builder = FlatBufferBuilder::new();
    let mut end = 0;
    let places = buffers.iter().map(|buffer| {
        let start = end;
        end += padded(buffer.len());
        ipc::Buffer::new(start as i64, buffer.len() as i64)
    });
    let places: Vec<ipc::Buffer> = places.collect();
    let nodes = lengths.iter().map(|n| ipc::FieldNode::new(*n as i64, 0));
    let nodes: Vec<ipc::FieldNode> = nodes.collect();
    let places = builder.create_vector(&places);
    let nodes = builder.create_vector(&nodes);
    let mut batch = ipc::RecordBatchBuilder::new(&mut builder);
    batch.add_length(rows as i64);
    batch.add_nodes(nodes);
    batch.add_buffers(places);
    let batch = batch.finish().as_union_value();
    let mut message = ipc::MessageBuilder::new(&mut builder);
    message.add_version(ipc::MetadataVersion::V5);
    message.add_header_type(ipc::MessageHeader::RecordBatch);
    message.add_bodyLength(end as i64);
    message.add_header(batch);
    let message = message.finish();
    builder.finish(message, None);
    builder.finished_data().to_vec()
}
