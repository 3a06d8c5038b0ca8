//! The loops over the blocks of [`ContactMatrix`](super::matrix::ContactMatrix), one for each size.
//!
//! A block names its contacts by their ends, `2c` or `2c + 1` for contact `c`.

use core::ops::{AddAssign, Mul};

/// What is multiplied: in double or in single precision.
pub(crate) trait Number: Copy + Default + AddAssign + Mul<Output = Self> {}

impl Number for f64 {}
impl Number for f32 {}

/// The products of blocks of `Z` contacts with `T = Z (Z − 1)/2` entries each, into the `halves` of their contacts.
#[inline(always)]
pub(super) fn product<F: Number, const Z: usize, const T: usize>(
    ends: &[u32],
    values: &[F],
    x: &[F],
    halves: &mut [[F; 2]],
) {
    let (ends, values) = (ends.as_chunks::<Z>().0, values.as_chunks::<T>().0);
    let x = &x[..halves.len()];
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
            halves[(e >> 1) as usize][(e & 1) as usize] = sum;
        }
    }
}

/// [`product`] of blocks of one contact, which is coupled to no other there.
#[inline(always)]
pub(super) fn alone<F: Number>(ends: &[u32], halves: &mut [[F; 2]]) {
    let halves = halves.as_flattened_mut();
    for e in ends {
        halves[*e as usize] = F::default();
    }
}

/// [`product`] of blocks of any size.
#[inline(always)]
pub(super) fn product_of_blocks<F: Number>(
    size: usize,
    ends: &[u32],
    values: &[F],
    x: &[F],
    halves: &mut [[F; 2]],
) {
    let (mut values, halves) = (values.iter(), halves.as_flattened_mut());
    for ends in ends.chunks_exact(size) {
        for (b, &eb) in ends.iter().enumerate() {
            halves[eb as usize] = F::default();
            for (&ea, &entry) in ends[..b].iter().zip(&mut values) {
                halves[ea as usize] += entry * x[(eb >> 1) as usize];
                halves[eb as usize] += entry * x[(ea >> 1) as usize];
            }
        }
    }
}
