//! Rows of line strips, gathered component by component: what a viewer gets most bytes of is copied least.

use super::pictures::Rgb;
use crate::domain::Vec2;
use rerun::external::arrow::array::{
    Array, ArrayRef, FixedSizeListArray, Float32Array, ListArray, UInt32Array,
};
use rerun::external::arrow::buffer::{OffsetBuffer, ScalarBuffer};
use rerun::external::arrow::datatypes::{DataType, Field};
use rerun::{ComponentDescriptor, LineStrips2D};
use std::io;
use std::sync::Arc;

/// A component of a chunk, one list a row.
pub(super) type Column = (ComponentDescriptor, ListArray);

/// `LineStrips2D` rows in the making.
#[derive(Default)]
pub(super) struct StripRows {
    /// Step and simulated time in nanoseconds of each row.
    pub times: Vec<(u64, i64)>,
    /// Where the strips of each row end.
    rows: Vec<usize>,
    /// Where the points of each strip end.
    strips: Vec<usize>,
    points: Vec<f32>,
    colors: Vec<u32>,
    radii: Vec<f32>,
}

impl StripRows {
    /// Room for as much as `other` holds: one batch is like the next.
    pub fn with_room_of(other: &Self) -> Self {
        Self {
            times: Vec::with_capacity(other.times.len()),
            rows: Vec::with_capacity(other.rows.len()),
            strips: Vec::with_capacity(other.strips.len()),
            points: Vec::with_capacity(other.points.len() + other.points.len() / 8),
            colors: Vec::with_capacity(other.colors.len()),
            radii: Vec::with_capacity(other.radii.len()),
        }
    }

    /// Adds a strip to the row at hand.
    pub fn strip<'a>(&mut self, points: impl IntoIterator<Item = &'a Vec2>, [r, g, b]: Rgb) {
        for v in points {
            self.points.extend_from_slice(&[v.x as f32, v.y as f32]);
        }
        self.strips.push(self.points.len() / 2);
        self.colors.push(u32::from_be_bytes([r, g, b, 255]));
    }

    /// Half the width of the strip added last (length); either all strips of an entity have one or none.
    pub fn half_width(&mut self, half_width: f64) {
        self.radii.push(half_width as f32);
    }

    /// Closes the row at hand.
    pub fn end_row(&mut self, step: u64, nanoseconds: i64) {
        self.times.push((step, nanoseconds));
        self.rows.push(self.strips.len());
    }

    /// The components of all rows.
    pub fn into_columns(self) -> io::Result<Vec<Column>> {
        let rows = offsets(&self.rows)?;
        let point = Arc::new(Field::new("item", DataType::Float32, false));
        let points =
            FixedSizeListArray::new(point, 2, array(Float32Array::from(self.points)), None);
        let item = Arc::new(Field::new("item", points.data_type().clone(), false));
        let strips = ListArray::new(item, offsets(&self.strips)?, array(points), None);
        let mut columns = vec![
            (
                LineStrips2D::descriptor_strips(),
                lists(rows.clone(), array(strips)),
            ),
            (
                LineStrips2D::descriptor_colors(),
                lists(rows.clone(), array(UInt32Array::from(self.colors))),
            ),
        ];
        if !self.radii.is_empty() {
            let radii = lists(rows, array(Float32Array::from(self.radii)));
            columns.push((LineStrips2D::descriptor_radii(), radii));
        }
        Ok(columns)
    }
}

fn array(array: impl Array + 'static) -> ArrayRef {
    Arc::new(array)
}

/// Lists of what `values` holds, one a row.
pub(super) fn lists(rows: OffsetBuffer<i32>, values: ArrayRef) -> ListArray {
    let item = Arc::new(Field::new("item", values.data_type().clone(), true));
    ListArray::new(item, rows, values, None)
}

/// Arrow counts with 32 bits.
pub(super) fn offsets(ends: &[usize]) -> io::Result<OffsetBuffer<i32>> {
    let all = core::iter::once(&0).chain(ends);
    let narrow = all
        .map(|end| i32::try_from(*end))
        .collect::<Result<Vec<i32>, _>>();
    let narrow = narrow.map_err(|_| {
        io::Error::new(
            io::ErrorKind::InvalidInput,
            "more than 2^31 vertices in one batch; record fewer of them (--vertices) or no contours",
        )
    })?;
    Ok(OffsetBuffer::new(ScalarBuffer::from(narrow)))
}
