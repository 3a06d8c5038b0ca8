//! Memory of columns, which comes back when the file has them.
//!
//! A batch is megabytes, and each is like the one before. Memory that is given back to the system and asked for again is
//! zeroed page by page, which costs as much as the values themselves.

use bytes::Bytes;
use core::ops::{Deref, DerefMut};
use rerun::external::arrow::buffer::Buffer;
use rerun::external::arrow::datatypes::{ArrowNativeType, ToByteSlice};
use std::sync::{Arc, Mutex, PoisonError};

/// Values of a column in the making, `W` numbers each.
pub(super) struct Values<T: ArrowNativeType, const W: usize> {
    values: Vec<[T; W]>,
    /// Memory that came back.
    shelf: Arc<Mutex<Vec<Vec<[T; W]>>>>,
}

impl<T: ArrowNativeType, const W: usize> Default for Values<T, W> {
    fn default() -> Self {
        Self {
            values: Vec::new(),
            shelf: Arc::default(),
        }
    }
}

impl<T: ArrowNativeType, const W: usize> Values<T, W> {
    /// No values, in memory that came back from a column before `other`, or with room for as much as that holds.
    pub fn with_room_of(other: &Self) -> Self {
        let back = other.shelf().pop();
        Self {
            values: back.unwrap_or_else(|| Vec::with_capacity(other.len() + other.len() / 8)),
            shelf: Arc::clone(&other.shelf),
        }
    }

    /// The values as Arrow has them, not copied; their memory comes back when nobody needs them.
    pub fn into_buffer(self) -> Buffer {
        Buffer::from(Bytes::from_owner(self))
    }

    fn shelf(&self) -> impl DerefMut<Target = Vec<Vec<[T; W]>>> {
        self.shelf.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl<T: ArrowNativeType, const W: usize> AsRef<[u8]> for Values<T, W> {
    fn as_ref(&self) -> &[u8] {
        self.values.as_flattened().to_byte_slice()
    }
}

impl<T: ArrowNativeType, const W: usize> Deref for Values<T, W> {
    type Target = Vec<[T; W]>;

    fn deref(&self) -> &Self::Target {
        &self.values
    }
}

impl<T: ArrowNativeType, const W: usize> DerefMut for Values<T, W> {
    fn deref_mut(&mut self) -> &mut Self::Target {
        &mut self.values
    }
}

impl<T: ArrowNativeType, const W: usize> Drop for Values<T, W> {
    fn drop(&mut self) {
        let mut values = core::mem::take(&mut self.values);
        // The last that knows of the shelf takes it along.
        if values.capacity() > 0 && Arc::strong_count(&self.shelf) > 1 {
            values.clear();
            self.shelf().push(values);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn memory_of_a_buffer_serves_again_when_the_buffer_is_gone() {
        let mut first = Values::<f64, 2>::default();
        first.extend([[1.0, 2.0], [3.0, 4.0]]);
        let place = first.as_ptr();
        let second = Values::with_room_of(&first);
        let buffer = first.into_buffer();
        assert_eq!(buffer.typed_data::<f64>(), [1.0, 2.0, 3.0, 4.0]);
        assert_eq!(buffer.as_ptr(), place.cast(), "not copied");
        let third = Values::with_room_of(&second);
        assert_ne!(third.as_ptr(), place, "somebody reads it");
        drop(buffer);
        let fourth = Values::with_room_of(&third);
        assert_eq!((fourth.as_ptr(), fourth.len()), (place, 0));
    }
}
