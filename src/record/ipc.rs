//! A record batch as an Arrow stream, without a copy of its values.
//!
//! Arrow's writer copies all values behind each other, rerun's encoder copies the result into a message, and that into a
//! buffer. Here a message is a list of pieces: what stands around the values, and the values where they are. The bytes are
//! those of the two libraries. The schema is written by Arrow itself. The description of the values (a flatbuffer, whose layout
//! depends on the number of arrays and buffers alone) is Arrow's own of one row, with the numbers of this batch put in.

use rerun::external::arrow::array::{Array as _, ArrayData, RecordBatch};
use rerun::external::arrow::buffer::Buffer;
use rerun::external::arrow::datatypes::DataType;
use rerun::external::arrow::error::ArrowError;
use rerun::external::arrow::ipc::writer::StreamWriter;

/// Buffers begin at multiples of this many bytes of the values.
const ALIGNMENT: usize = 64;

/// What ends an Arrow stream: a message of no length.
pub(super) const END: [u8; 8] = [0xff, 0xff, 0xff, 0xff, 0, 0, 0, 0];

/// Marks the beginning of a message, before its length.
const CONTINUATION: usize = 8;

/// A record batch as pieces of a stream, without its [`END`].
pub(super) struct Pieces {
    /// Schema and description.
    pub head: Vec<u8>,
    /// The values; each is padded with zeros to [`padded`] bytes.
    pub buffers: Vec<Buffer>,
}

impl Pieces {
    /// Length of the stream with its end (bytes).
    pub fn len(&self) -> usize {
        let values: usize = self.buffers.iter().map(|b| padded(b.len())).sum();
        self.head.len() + values + END.len()
    }
}

/// What `length` bytes take up.
pub(super) fn padded(length: usize) -> usize {
    length.next_multiple_of(ALIGNMENT)
}

/// Makes [`Pieces`].
#[derive(Default)]
pub(super) struct Ipc {
    /// Descriptions of one row by the numbers of arrays and buffers.
    descriptions: Vec<([usize; 2], Vec<u8>)>,
}

impl Ipc {
    /// The pieces of `batch`; `None` if it holds what is not written here: nulls, slices, lists of nothing, other types.
    pub fn pieces(&mut self, batch: &RecordBatch) -> Result<Option<Pieces>, ArrowError> {
        let (mut lengths, mut buffers) = (Vec::new(), Vec::new());
        for column in batch.columns() {
            if gather(&column.to_data(), &mut lengths, &mut buffers).is_none() {
                return Ok(None);
            }
        }
        let mut head = Vec::with_capacity(8192);
        StreamWriter::try_new(&mut head, batch.schema_ref())?;
        let start = head.len();
        let counts = [lengths.len(), buffers.len()];
        let known = self.descriptions.iter().position(|(c, _)| *c == counts);
        let known = if let Some(known) = known {
            known
        } else {
            let one = description_of_one(&batch.slice(0, 1), start)?;
            self.descriptions.push((counts, one));
            self.descriptions.len() - 1
        };
        head.extend_from_slice(&self.descriptions[known].1);
        let put = put(&mut head[start..], batch.num_rows(), &lengths, &buffers);
        Ok(put.map(|()| Pieces { head, buffers }))
    }
}

/// The message that describes the values of `one`, with its continuation mark; `start` bytes are the schema's.
fn description_of_one(one: &RecordBatch, start: usize) -> Result<Vec<u8>, ArrowError> {
    let mut bytes = Vec::new();
    StreamWriter::try_new(&mut bytes, one.schema_ref())?.write(one)?;
    let length = u32_at(&bytes, start + 4).unwrap_or(0);
    bytes.truncate(start + CONTINUATION + length);
    Ok(bytes.split_off(start))
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

/// Puts the numbers of a batch into the description of another: its rows, lengths and buffers; `None` if it is no
/// description of so many.
fn put(message: &mut [u8], rows: usize, lengths: &[usize], buffers: &[Buffer]) -> Option<()> {
    let flat = message.get_mut(CONTINUATION..)?;
    let root = u32_at(flat, 0)?;
    let (body, batch) = (field(flat, root, 3)?, field(flat, root, 2)?);
    let batch = batch + u32_at(flat, batch)?;
    let (length, arrays, places) = (
        field(flat, batch, 0)?,
        field(flat, batch, 1)?,
        field(flat, batch, 2)?,
    );
    let arrays = arrays + u32_at(flat, arrays)?;
    let places = places + u32_at(flat, places)?;
    if u32_at(flat, arrays)? != lengths.len() || u32_at(flat, places)? != buffers.len() {
        return None;
    }
    let mut set = |at: usize, value: usize| {
        let bytes = flat.get_mut(at..at + 8)?;
        bytes.copy_from_slice(&(value as u64).to_le_bytes());
        Some(())
    };
    set(length, rows)?;
    for (k, length) in lengths.iter().enumerate() {
        set(arrays + 4 + 16 * k, *length)?;
        set(arrays + 12 + 16 * k, 0)?;
    }
    let mut offset = 0;
    for (k, buffer) in buffers.iter().enumerate() {
        set(places + 4 + 16 * k, offset)?;
        set(places + 12 + 16 * k, buffer.len())?;
        offset += padded(buffer.len());
    }
    set(body, offset)
}

/// Where a flatbuffer's table at `table` has its field of number `number`; `None` if it has the default value.
fn field(flat: &[u8], table: usize, number: usize) -> Option<usize> {
    let back = u32_at(flat, table)? as u32 as i32;
    let entry = usize::try_from(table as i64 - i64::from(back)).ok()? + 4 + 2 * number;
    let offset = flat.get(entry..entry + 2)?;
    let offset = u16::from_le_bytes(offset.try_into().ok()?);
    (offset != 0).then_some(table + usize::from(offset))
}

fn u32_at(bytes: &[u8], at: usize) -> Option<usize> {
    let bytes = bytes.get(at..at + 4)?;
    Some(u32::from_le_bytes(bytes.try_into().ok()?) as usize)
}
