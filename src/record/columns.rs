//! Rows of line strips, gathered component by component: what a viewer gets most bytes of is copied least.

use super::cells::Number as _;
use super::pictures::{Network, Rgb};
use crate::contacts::Contacts;
use crate::domain::Vec2;
use crate::models::droplet::contour::{Contours, Extent};
use rerun::external::arrow::array::{Array, ArrayRef, FixedSizeListArray, ListArray};
use rerun::external::arrow::buffer::{OffsetBuffer, ScalarBuffer};
use rerun::external::arrow::datatypes::{DataType, Field};
use rerun::{ComponentDescriptor, LineStrips2D};
use std::io;
use std::sync::Arc;

/// A component of a chunk, one list a row.
pub(super) type Column = (ComponentDescriptor, ListArray);

/// What contours are drawn with and from: radii (length), frame, contacts, line tension γ (force).
pub(super) type Drawing<'a> = (
    &'a mut Contours,
    &'a [f64],
    &'a [Vec2],
    &'a Contacts<'a>,
    f64,
);

/// `LineStrips2D` rows in the making.
#[derive(Default)]
pub(super) struct StripRows {
    /// Step and simulated time in nanoseconds of each row.
    pub times: Vec<(u64, i64)>,
    /// Where the strips of each row end.
    rows: Vec<usize>,
    /// Where the points of each strip end.
    strips: Vec<usize>,
    points: Vec<[f32; 2]>,
    colors: Vec<u32>,
    radii: Vec<f32>,
}

impl StripRows {
    /// No rows, and room for so many vertices.
    pub fn with_room_for(vertices: usize) -> Self {
        Self {
            points: Vec::with_capacity(vertices + vertices / 8),
            ..Self::default()
        }
    }

    /// Vertices of all strips.
    pub fn vertices(&self) -> usize {
        self.points.len()
    }

    /// Adds a strip to the row at hand.
    pub fn strip(&mut self, points: impl IntoIterator<Item = [f32; 2]>, color: Rgb) {
        self.points.extend(points);
        self.strips.push(self.points.len());
        self.colors.push(rgba(color));
    }

    /// Half the width of the strip added last (length); either all strips of an entity have one or none.
    pub fn half_width(&mut self, half_width: f64) {
        self.radii.push(half_width as f32);
    }

    /// Adds the closed contours of all particles to the row at hand: their number of vertices. `each` is told particle,
    /// contour and its extent, and says the colour.
    pub fn contours(
        &mut self,
        (contours, radii, positions, contacts, line_tension): Drawing<'_>,
        mut each: impl FnMut(usize, &[[f32; 2]], Extent) -> Rgb,
    ) -> usize {
        let (before, mut p) = (self.points.len(), 0);
        let (strips, colors) = (&mut self.strips, &mut self.colors);
        contours.trace(
            (radii, positions, contacts, line_tension),
            &mut self.points,
            |points, first, extent| {
                points.push(points[first]);
                strips.push(points.len());
                colors.push(rgba(each(p, &points[first..], extent)));
                p += 1;
            },
        );
        self.points.len() - before
    }

    /// Adds the segments of a network to the row at hand.
    pub fn network(&mut self, network: &Network) {
        let single = |v: &Vec2| [v.x as f32, v.y as f32];
        let ends = (1..=network.segments.len()).map(|k| self.points.len() + 2 * k);
        self.strips.extend(ends);
        self.points
            .extend(network.segments.as_flattened().iter().map(single));
        let relative = network.relative.iter();
        self.colors
            .extend(relative.clone().map(|&r| rgba(Network::color(r))));
        self.radii
            .extend(relative.map(|&r| network.half_width(r) as f32));
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
            FixedSizeListArray::new(point, 2, f32::array(self.points.into_flattened()), None);
        let item = Arc::new(Field::new("item", points.data_type().clone(), false));
        let strips = ListArray::new(item, offsets(&self.strips)?, array(points), None);
        let mut columns = vec![
            (
                LineStrips2D::descriptor_strips(),
                lists(rows.clone(), array(strips)),
            ),
            (
                LineStrips2D::descriptor_colors(),
                lists(rows.clone(), u32::array(self.colors)),
            ),
        ];
        if !self.radii.is_empty() {
            let radii = lists(rows, f32::array(self.radii));
            columns.push((LineStrips2D::descriptor_radii(), radii));
        }
        Ok(columns)
    }
}

/// An opaque colour as rerun has it.
pub(super) fn rgba([r, g, b]: Rgb) -> u32 {
    u32::from_be_bytes([r, g, b, 255])
}

pub(super) fn array(array: impl Array + 'static) -> ArrayRef {
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
            "more than 2^31 entries in one batch; record fewer vertices (--vertices) or no contours",
        )
    })?;
    Ok(OffsetBuffer::new(ScalarBuffer::from(narrow)))
}
