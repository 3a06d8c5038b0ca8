//! Sums of terms that are rounded to multiples of one power of two, so that they are exact and no order reaches them.
//! (J. Demmel and H. D. Nguyen, IEEE Trans. Comput. 64, 2060 (2015).)

use super::wide::wide;

/// Chains that are summed side by side: two registers of four, as one sum has to wait for the one before.
pub(crate) const CHAINS: usize = 8;

/// The number of `forces` of contacts that are not 0, and their sum (force), in whatever order.
pub(crate) fn sum_of_forces(forces: &[f64]) -> (f64, f64) {
    let (forces, rest) = forces.as_chunks();
    let mut last = [0.0; CHAINS];
    last[..rest.len()].copy_from_slice(rest);
    wide(
        #[inline(always)]
        || {
            let [mut bearing, mut most, mut sums] = [[0.0; CHAINS]; 3];
            for f in forces.iter().chain([&last]) {
                for k in 0..CHAINS {
                    bearing[k] += if f[k] == 0.0 { 0.0 } else { 1.0 };
                }
                for k in 0..CHAINS {
                    most[k] = larger(most[k], f[k].abs());
                }
            }
            let number: f64 = bearing.iter().sum();
            let largest = most.into_iter().fold(0.0, larger);
            let rounder = rounder(number.max(2.0) * largest);
            for f in forces.iter().chain([&last]) {
                for k in 0..CHAINS {
                    sums[k] += (f[k] + rounder) - rounder;
                }
            }
            (number, sums.iter().sum())
        },
    )
}

#[inline(always)]
pub(crate) fn larger(m: f64, x: f64) -> f64 {
    if x > m { x } else { m }
}

/// A number that, added to terms and subtracted again, rounds them so that sums of magnitude up to `bound` are exact. Terms are
/// up to half of that.
#[inline(always)]
pub(crate) fn rounder(bound: f64) -> f64 {
    // With `p ≤ bound < 2p`, a sum of this and a term is between 2p and 4p: a multiple of 2⁻⁵¹ p, and 2⁵² of these are 2p.
    let power = f64::from_bits(bound.to_bits() & 0x7ff0_0000_0000_0000);
    3.0 * power
}
