//! The loops that compute the blocks of [`ContactMatrix`](super::ContactMatrix), one for each size.
//!
//! Whatever a run of blocks is needed for at new positions is done while its entries are near: its values, the same in single
//! precision and without units, and the products with the forces. One simple loop each: a single loop for all is slower.

use super::product::{product, product_of_blocks};
use crate::models::droplet::kernel::Direction;

/// Blocks of one size, and what they are computed from.
pub(super) struct Blocks<'a> {
    /// The directions of the ends.
    pub(super) toward: &'a [Direction],
    pub(super) ends: &'a [u32],
    pub(super) values: &'a mut [f64],
    pub(super) entries_f32: &'a mut [f32],
    /// `A_cc^(−½)` of all contacts, and their forces.
    pub(super) inverse_root: &'a [f64],
    pub(super) forces: &'a [f64],
    /// What the entries make of the forces is added to these.
    pub(super) products: &'a mut [f64],
}

/// Blocks of `Z` contacts with `T = Z (Z − 1)/2` entries each, `factors` times `g`.
#[inline(always)]
pub(super) fn fill<const Z: usize, const T: usize>(
    blocks: Blocks<'_>,
    factors: impl Iterator<Item = f64>,
) {
    let Blocks {
        toward,
        ends,
        values,
        entries_f32,
        inverse_root,
        forces,
        products,
    } = blocks;
    let (values, singles) = (
        values.as_chunks_mut::<T>().0,
        entries_f32.as_chunks_mut::<T>().0,
    );
    let ends = ends.as_chunks::<Z>().0;
    let toward = toward.as_chunks::<Z>().0;
    let blocks = values.iter_mut().zip(factors).zip(toward);
    for ((values, factor), toward) in blocks {
        for b in 1..Z {
            for a in 0..b {
                values[b * (b - 1) / 2 + a] = factor * toward[a].g_between(toward[b]);
            }
        }
    }
    for ((&ends, values), singles) in ends.iter().zip(&*values).zip(singles) {
        let mut by = [0.0; Z];
        for (by, e) in by.iter_mut().zip(ends) {
            *by = inverse_root[(e >> 1) as usize];
        }
        for b in 1..Z {
            for a in 0..b {
                let k = b * (b - 1) / 2 + a;
                singles[k] = (values[k] * (by[a] * by[b])) as f32;
            }
        }
    }
    product::<f64, Z, T>(ends.as_flattened(), values.as_flattened(), forces, products);
}

/// [`fill`] of blocks of any size.
#[inline(always)]
pub(super) fn fill_blocks(size: usize, blocks: Blocks<'_>, factors: impl Iterator<Item = f64>) {
    let Blocks {
        toward,
        ends,
        values,
        entries_f32,
        inverse_root,
        forces,
        products,
    } = blocks;
    let pairs = size * (size - 1) / 2;
    let values = values.chunks_exact_mut(pairs);
    let values = values.zip(entries_f32.chunks_exact_mut(pairs));
    let ends = ends.chunks_exact(size).zip(toward.chunks_exact(size));
    for (((ends, toward), factor), (values, singles)) in ends.zip(factors).zip(values) {
        let by = |e: u32| inverse_root[(e >> 1) as usize];
        let mut columns = values.iter_mut().zip(singles);
        for b in 1..size {
            for (a, (value, single)) in (0..b).zip(&mut columns) {
                *value = factor * toward[a].g_between(toward[b]);
                *single = (*value * (by(ends[a]) * by(ends[b]))) as f32;
            }
        }
        product_of_blocks(size, ends, values, forces, products);
    }
}
