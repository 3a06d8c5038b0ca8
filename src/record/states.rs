//! Rows of lossless states, gathered component by component.

use super::columns::{Column, array, lists, offsets};
use crate::domain::Vec2;
use crate::frame::Frame;
use rerun::ComponentDescriptor;
use rerun::external::arrow::array::{
    ArrayRef, FixedSizeListArray, Float64Array, UInt8Array, UInt32Array,
};
use rerun::external::arrow::datatypes::{DataType, Field};
use std::io;
use std::sync::Arc;

/// `softjam.State` rows in the making.
#[derive(Default)]
pub(super) struct StateRows {
    /// Step and simulated time in nanoseconds of each row.
    pub times: Vec<(u64, i64)>,
    positions: Rows<[f64; 2]>,
    velocities: Rows<[f64; 2]>,
    contacts: Rows<[u32; 2]>,
    forces: Rows<f64>,
    minimizers: Rows<f64>,
    digests: Rows<u8>,
}

/// One component of all rows.
#[derive(Default)]
struct Rows<T> {
    values: Vec<T>,
    /// Where the values of each row end.
    ends: Vec<usize>,
}

impl<T> Rows<T> {
    fn with_room_of(other: &Self) -> Self {
        Self {
            values: Vec::with_capacity(other.values.len()),
            ends: Vec::with_capacity(other.ends.len()),
        }
    }

    fn push(&mut self, row: impl IntoIterator<Item = T>) {
        self.values.extend(row);
        self.ends.push(self.values.len());
    }

    fn into_column(
        self,
        name: &'static str,
        values: impl FnOnce(Vec<T>) -> ArrayRef,
    ) -> io::Result<Column> {
        let mut descriptor = ComponentDescriptor::partial(name);
        descriptor.archetype = Some("softjam.State".into());
        Ok((descriptor, lists(offsets(&self.ends)?, values(self.values))))
    }
}

impl StateRows {
    /// Room for as much as `other` holds: one batch is like the next.
    pub fn with_room_of(other: &Self) -> Self {
        Self {
            times: Vec::with_capacity(other.times.len()),
            positions: Rows::with_room_of(&other.positions),
            velocities: Rows::with_room_of(&other.velocities),
            contacts: Rows::with_room_of(&other.contacts),
            forces: Rows::with_room_of(&other.forces),
            minimizers: Rows::with_room_of(&other.minimizers),
            digests: Rows::with_room_of(&other.digests),
        }
    }

    /// Adds the state of a frame and its digest.
    pub fn push(&mut self, nanoseconds: i64, frame: &Frame, digest: &[u8; 32]) {
        let components = |v: &Vec2| [v.x, v.y];
        self.times.push((frame.step, nanoseconds));
        self.positions.push(frame.positions.iter().map(components));
        self.velocities
            .push(frame.velocities.iter().map(components));
        self.contacts.push(frame.contacts.iter().copied());
        self.forces.push(frame.forces.iter().copied());
        self.minimizers.push(frame.minimizer.values());
        self.digests.push(*digest);
    }

    /// The components of all rows.
    pub fn into_columns(self) -> io::Result<Vec<Column>> {
        let points = |v: Vec<[f64; 2]>| {
            pairs(
                DataType::Float64,
                array(Float64Array::from(v.into_flattened())),
            )
        };
        let contacts = |v: Vec<[u32; 2]>| {
            pairs(
                DataType::UInt32,
                array(UInt32Array::from(v.into_flattened())),
            )
        };
        let numbers = |v: Vec<f64>| array(Float64Array::from(v));
        Ok(vec![
            self.positions
                .into_column("softjam.State:position", points)?,
            self.velocities
                .into_column("softjam.State:velocity", points)?,
            self.contacts
                .into_column("softjam.State:contact", contacts)?,
            self.forces.into_column("softjam.State:force", numbers)?,
            self.minimizers
                .into_column("softjam.State:minimizer", numbers)?,
            self.digests
                .into_column("softjam.State:digest", |v| array(UInt8Array::from(v)))?,
        ])
    }
}

fn pairs(of: DataType, flat: ArrayRef) -> ArrayRef {
    let item = Arc::new(Field::new("item", of, false));
    array(FixedSizeListArray::new(item, 2, flat, None))
}
