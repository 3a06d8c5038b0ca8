//! Rows of values, one cell of `W` numbers for each instance of an entity.

use super::columns::{Column, lists, offsets};
use rerun::ComponentDescriptor;
use rerun::external::arrow::array::{
    Array as _, ArrayRef, FixedSizeListArray, Float32Array, UInt32Array,
};
use rerun::external::arrow::datatypes::Field;
use std::io;
use std::sync::Arc;

/// A number that a cell holds.
pub(super) trait Number: Copy {
    fn array(values: Vec<Self>) -> ArrayRef;
}

impl Number for f32 {
    fn array(values: Vec<Self>) -> ArrayRef {
        Arc::new(Float32Array::from(values))
    }
}

impl Number for u32 {
    fn array(values: Vec<Self>) -> ArrayRef {
        Arc::new(UInt32Array::from(values))
    }
}

/// Cells in the making; their rows are those of the strips or points beside which they stand.
#[derive(Clone)]
pub(super) struct Cells<T, const W: usize> {
    values: Vec<T>,
    /// Where the cells of each row end.
    rows: Vec<usize>,
}

impl<T, const W: usize> Default for Cells<T, W> {
    fn default() -> Self {
        Self {
            values: Vec::new(),
            rows: Vec::new(),
        }
    }
}

impl<T: Number, const W: usize> Cells<T, W> {
    /// Adds a cell to the row at hand.
    pub fn push(&mut self, cell: [T; W]) {
        self.values.extend_from_slice(&cell);
    }

    /// Closes the row at hand.
    pub fn end_row(&mut self) {
        self.rows.push(self.values.len() / W);
    }

    /// The component of all rows.
    pub fn into_column(self, descriptor: ComponentDescriptor) -> io::Result<Column> {
        let rows = offsets(&self.rows)?;
        let mut values = T::array(self.values);
        if W > 1 {
            let item = Arc::new(Field::new("item", values.data_type().clone(), false));
            values = Arc::new(FixedSizeListArray::new(item, W as i32, values, None));
        }
        Ok((descriptor, lists(rows, values)))
    }
}

/// A component of our own, `softjam.Archetype:field`.
pub(super) fn own(component: &'static str) -> ComponentDescriptor {
    let archetype = component.split(':').next().unwrap_or(component);
    ComponentDescriptor {
        archetype: Some(archetype.into()),
        component: component.into(),
        component_type: None,
    }
}
