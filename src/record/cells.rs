//! Rows of values, one cell of `W` numbers for each instance of an entity.

use super::columns::{Column, lists, offsets};
use rerun::ComponentDescriptor;
use rerun::external::arrow::array::{
    Array as _, ArrayRef, FixedSizeListArray, Float32Array, Float64Array, StringArray, UInt8Array,
    UInt32Array,
};
use rerun::external::arrow::buffer::Buffer;
use rerun::external::arrow::datatypes::{ArrowNativeType, Field};
use std::io;
use std::sync::Arc;

/// A number that a cell holds.
pub(super) trait Number: ArrowNativeType {
    fn array(values: Vec<Self>) -> ArrayRef;
}

macro_rules! numbers {
    ($($number:ty: $array:ty),*) => {$(
        impl Number for $number {
            fn array(values: Vec<Self>) -> ArrayRef {
                Arc::new(<$array>::from(values))
            }
        }
    )*};
}

numbers!(f32: Float32Array, f64: Float64Array, u32: UInt32Array, u8: UInt8Array);

/// Cells in the making; their rows are those of the strips or points beside which they stand.
pub(super) struct Cells<T: Number, const W: usize> {
    values: Vec<[T; W]>,
    /// Where the cells of each row end.
    rows: Vec<usize>,
}

impl<T: Number, const W: usize> Default for Cells<T, W> {
    fn default() -> Self {
        Self {
            values: Vec::new(),
            rows: Vec::new(),
        }
    }
}

impl<T: Number, const W: usize> Cells<T, W> {
    /// Whether no row has a cell.
    pub fn is_empty(&self) -> bool {
        self.values.is_empty()
    }

    /// Adds a cell to the row at hand.
    pub fn push(&mut self, cell: [T; W]) {
        self.values.push(cell);
    }

    /// Adds cells to the row at hand.
    pub fn extend(&mut self, cells: impl IntoIterator<Item = [T; W]>) {
        self.values.extend(cells);
    }

    /// Closes the row at hand.
    pub fn end_row(&mut self) {
        self.rows.push(self.values.len());
    }

    /// The component of all rows.
    pub fn into_column(self, descriptor: ComponentDescriptor) -> io::Result<Column> {
        let rows = offsets(&self.rows)?;
        let mut values = T::array(self.values.into_flattened());
        if W > 1 {
            let item = Arc::new(Field::new("item", values.data_type().clone(), false));
            values = Arc::new(FixedSizeListArray::new(item, W as i32, values, None));
        }
        Ok((descriptor, lists(rows, values)))
    }
}

/// Rows of short texts, one for each instance.
#[derive(Default)]
pub(super) struct Texts {
    /// ASCII.
    text: Vec<u8>,
    /// Where each text ends.
    ends: Vec<usize>,
    /// Where the texts of each row end.
    rows: Vec<usize>,
}

impl Texts {
    /// Whether no row has a text.
    pub fn is_empty(&self) -> bool {
        self.ends.is_empty()
    }

    /// Adds to the text at hand.
    pub fn push(&mut self, text: &str) {
        self.extend(text.as_bytes());
    }

    /// Adds a count to the text at hand.
    pub fn push_count(&mut self, count: u32) {
        let (mut digits, mut first, mut rest) = ([0; 10], 10, count);
        while first > 0 {
            first -= 1;
            digits[first] = digit(rest);
            rest /= 10;
            if rest == 0 {
                break;
            }
        }
        self.extend(&digits[first..]);
    }

    fn extend(&mut self, ascii: &[u8]) {
        self.text.extend_from_slice(ascii);
    }

    /// Adds a number to the text at hand, rounded to three digits: `0.0346`, `12.3`, `461`, `4.61e-8`. The general way to
    /// print a number takes ten times as long.
    pub fn push_number(&mut self, x: f64) {
        if !(1e-300..1e300).contains(&x) {
            self.push(if x == 0.0 { "0" } else { "?" });
            return;
        }
        // x is about m · 10⁻ᵏ with 100 ≤ m < 1000.
        let (mut m, mut k) = (x, 0_i32);
        while m < 99.95 {
            (m, k) = (10.0 * m, k + 1);
        }
        while m >= 999.5 {
            (m, k) = (0.1 * m, k - 1);
        }
        let m = (m + 0.5) as u32;
        let [a, b, c] = [digit(m / 100), digit(m / 10), digit(m)];
        match k {
            0 => self.extend(&[a, b, c]),
            1 => self.extend(&[a, b, b'.', c]),
            2 => self.extend(&[a, b'.', b, c]),
            3..=6 => {
                let zeros = (k - 3) as usize;
                self.extend(&b"0.000"[..2 + zeros]);
                self.extend(&[a, b, c]);
            }
            _ => {
                self.extend(&[a, b'.', b, c, b'e']);
                if k > 2 {
                    self.extend(b"-");
                }
                self.push_count((2 - k).unsigned_abs());
            }
        }
    }

    /// Closes the text at hand.
    pub fn end_cell(&mut self) {
        self.ends.push(self.text.len());
    }

    /// Closes the row at hand.
    pub fn end_row(&mut self) {
        self.rows.push(self.ends.len());
    }

    /// The component of all rows.
    pub fn into_column(self, descriptor: ComponentDescriptor) -> io::Result<Column> {
        let (ends, rows) = (offsets(&self.ends)?, offsets(&self.rows)?);
        let texts = StringArray::try_new(ends, Buffer::from(self.text), None);
        let texts = texts.map_err(io::Error::other)?;
        Ok((descriptor, lists(rows, Arc::new(texts))))
    }
}

/// The last digit of `n`.
fn digit(n: u32) -> u8 {
    b'0' + (n % 10) as u8
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_printed_to_three_digits() {
        let printed = |x| {
            let mut texts = Texts::default();
            texts.push_number(x);
            String::from_utf8(texts.text).unwrap()
        };
        for (x, text) in [
            (0.0, "0"),
            (0.125, "0.125"),
            (0.034_56, "0.0346"),
            (0.000_999_7, "0.00100"),
            (12.34, "12.3"),
            (461.2, "461"),
            (9.999, "10.0"),
            (1.0, "1.00"),
            (0.000_123, "0.000123"),
            (4.607e-8, "4.61e-8"),
            (1234.0, "1.23e3"),
            (5e22, "5.00e22"),
            (f64::NAN, "?"),
        ] {
            assert_eq!(printed(x), text);
        }
        // Against the library's own rounding, wherever the two print in the same way.
        for n in 1..2000_u32 {
            let x = f64::from(n) * 7.3e-4;
            let value: f64 = printed(x).parse().unwrap();
            assert!(
                (value / x - 1.0).abs() < 0.005_001,
                "{x} is printed as {value}"
            );
        }
    }

    #[test]
    fn counts_are_printed_in_full() {
        let mut texts = Texts::default();
        for n in [0, 7, 10, 4_294_967_295] {
            texts.push_count(n);
            texts.push(" ");
        }
        assert_eq!(texts.text, b"0 7 10 4294967295 ");
    }
}
