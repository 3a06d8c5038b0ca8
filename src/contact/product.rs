//! The loops over the blocks of [`ContactMatrix`](super::matrix::ContactMatrix), one for each size.

use core::ops::{AddAssign, Mul};

/// What is multiplied: in double or in single precision.
pub(crate) trait Number: Copy + Default + AddAssign + Mul<Output = Self> {}

impl Number for f64 {}
impl Number for f32 {}

/// `y += A x` of blocks of `Z` contacts with `T = Z (Z − 1)/2` entries each.
#[inline(always)]
pub(super) fn product<F: Number, const Z: usize, const T: usize>(
    contacts: &[u32],
    values: &[F],
    x: &[F],
    y: &mut [F],
) {
    let (contacts, values) = (contacts.as_chunks::<Z>().0, values.as_chunks::<T>().0);
    let x = &x[..y.len()];
    // Numbers of contacts by value, so that each is checked once.
    for (&c, v) in contacts.iter().zip(values) {
        let mut at = [F::default(); Z];
        for (at, c) in at.iter_mut().zip(c) {
            *at = x[c as usize];
        }
        let mut sum = [F::default(); Z];
        for b in 1..Z {
            for a in 0..b {
                let entry = v[b * (b - 1) / 2 + a];
                sum[a] += entry * at[b];
                sum[b] += entry * at[a];
            }
        }
        for (c, sum) in c.into_iter().zip(sum) {
            y[c as usize] += sum;
        }
    }
}

/// `y += A x` of one block of any size.
#[inline(always)]
pub(super) fn product_of_block<F: Number>(contacts: &[u32], values: &[F], x: &[F], y: &mut [F]) {
    let mut values = values.iter();
    for (b, &cb) in contacts.iter().enumerate() {
        for (&ca, &entry) in contacts[..b].iter().zip(&mut values) {
            y[ca as usize] += entry * x[cb as usize];
            y[cb as usize] += entry * x[ca as usize];
        }
    }
}

/// The entries of blocks of `Z` contacts, each times the numbers `by` of its row and its column.
#[inline(always)]
pub(super) fn scale<const Z: usize, const T: usize>(
    contacts: &[u32],
    values: &[f64],
    by: &[f64],
    scaled: &mut [f32],
) {
    let (contacts, values) = (contacts.as_chunks::<Z>().0, values.as_chunks::<T>().0);
    let blocks = scaled.as_chunks_mut::<T>().0.iter_mut();
    for ((c, v), scaled) in contacts.iter().zip(values).zip(blocks) {
        let mut at = [0.0; Z];
        for (at, c) in at.iter_mut().zip(c) {
            *at = by[*c as usize];
        }
        for b in 1..Z {
            for a in 0..b {
                let entry = b * (b - 1) / 2 + a;
                scaled[entry] = (v[entry] * (at[a] * at[b])) as f32;
            }
        }
    }
}

/// [`scale`] of one block of any size.
#[inline(always)]
pub(super) fn scale_block(contacts: &[u32], values: &[f64], by: &[f64], scaled: &mut [f32]) {
    let mut entries = values.iter().zip(scaled);
    for (b, &cb) in contacts.iter().enumerate() {
        for (&ca, (value, scaled)) in contacts[..b].iter().zip(&mut entries) {
            *scaled = (value * (by[ca as usize] * by[cb as usize])) as f32;
        }
    }
}
