//! The loops over the blocks of [`ContactMatrix`](super::ContactMatrix), one for each size.
//!
//! A block names its contacts by their ends, `2c` or `2c + 1` for contact `c`.

use crate::numerics::wide::wide;
use core::ops::{AddAssign, Mul};

/// What is multiplied: in double or in single precision.
pub(crate) trait Number:
    Copy + Default + AddAssign + Mul<Output = Self> + Send + Sync
{
}

impl Number for f64 {}
impl Number for f32 {}

/// A column of products, which two threads may make: a contact gets something from each of its two ends, and which is added to
/// which makes no difference.
#[derive(Clone, Debug, Default)]
pub(crate) struct Products<F> {
    sums: Vec<F>,
    /// What the second thread has made; empty if there is none.
    more: Vec<F>,
}

impl<F: Number> Products<F> {
    /// The products, once they are added up.
    #[inline(always)]
    pub(crate) fn sums(&self) -> &[F] {
        &self.sums
    }

    #[inline(always)]
    pub(crate) fn sums_mut(&mut self) -> &mut [F] {
        &mut self.sums
    }

    /// Zeros for `length` contacts, for one thread.
    pub(crate) fn alone(&mut self, length: usize) -> &mut [F] {
        self.more.clear();
        self.sums.clear();
        self.sums.resize(length, F::default());
        &mut self.sums
    }

    /// Zeros for `length` contacts, for two threads.
    pub(crate) fn both(&mut self, length: usize) -> [&mut [F]; 2] {
        for column in [&mut self.sums, &mut self.more] {
            column.clear();
            column.resize(length, F::default());
        }
        [&mut self.sums, &mut self.more]
    }

    /// Adds up what two threads have made.
    pub(crate) fn add_up(&mut self) {
        wide(
            #[inline(always)]
            || {
                for (sum, more) in self.sums.iter_mut().zip(&self.more) {
                    *sum += *more;
                }
            },
        );
    }
}

/// What the off-diagonal entries of `A` make of the forces, in either precision.
#[derive(Clone, Copy, Debug)]
pub(crate) enum First<'a> {
    /// As a length.
    Double(&'a [f64]),
    /// Of `D^(−½) A D^(−½)` and `D^½ f`, in units of the matrix.
    Single(&'a [f32]),
}

/// The products with the forces, in the precision that they were made in last.
#[derive(Clone, Debug, Default)]
pub(crate) struct FirstProducts {
    pub(super) double: Products<f64>,
    pub(super) single: Products<f32>,
}

impl FirstProducts {
    /// Those in double precision.
    pub(crate) fn double(&self) -> First<'_> {
        First::Double(self.double.sums())
    }

    /// Those in single precision.
    pub(crate) fn single(&self) -> First<'_> {
        First::Single(self.single.sums())
    }
}

/// `y += A x` of blocks of `Z` contacts with `T = Z (Z − 1)/2` entries each.
#[inline(always)]
pub(super) fn product<F: Number, const Z: usize, const T: usize>(
    ends: &[u32],
    values: &[F],
    x: &[F],
    y: &mut [F],
) {
    let (ends, values) = (ends.as_chunks::<Z>().0, values.as_chunks::<T>().0);
    let x = &x[..y.len()];
    // Ends by value, so that the number of each contact is checked once.
    for (&ends, v) in ends.iter().zip(values) {
        let mut at = [F::default(); Z];
        for (at, e) in at.iter_mut().zip(ends) {
            *at = x[(e >> 1) as usize];
        }
        let mut sum = [F::default(); Z];
        for b in 1..Z {
            for a in 0..b {
                let entry = v[b * (b - 1) / 2 + a];
                sum[a] += entry * at[b];
                sum[b] += entry * at[a];
            }
        }
        for (e, sum) in ends.into_iter().zip(sum) {
            y[(e >> 1) as usize] += sum;
        }
    }
}

/// [`product`] of blocks of any size.
#[inline(always)]
pub(super) fn product_of_blocks<F: Number>(
    size: usize,
    ends: &[u32],
    values: &[F],
    x: &[F],
    y: &mut [F],
) {
    let mut values = values.chunks_exact(size * (size - 1) / 2);
    for (ends, values) in ends.chunks_exact(size).zip(&mut values) {
        let entry = |a: usize, b: usize| {
            let (a, b) = (a.min(b), a.max(b));
            values[b * (b - 1) / 2 + a]
        };
        for (b, eb) in ends.iter().enumerate() {
            let mut sum = F::default();
            for (a, ea) in ends.iter().enumerate().filter(|(a, _)| *a != b) {
                sum += entry(a, b) * x[(ea >> 1) as usize];
            }
            y[(eb >> 1) as usize] += sum;
        }
    }
}
