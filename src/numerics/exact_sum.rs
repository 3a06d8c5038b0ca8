//! Sums that no order reaches.
//!
//! Terms are rounded to multiples of one power of two, so that the sums of them are exact: of each term at most `2⁻⁵²` of the number
//! of terms times the largest one is left out, which is what a plain sum can lose as well. (J. Demmel and H. D. Nguyen, IEEE Trans.
//! Comput. 64, 2060 (2015).)

/// Rounds terms so that sums of them are exact.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Rounder(f64);

impl Rounder {
    /// For sums of magnitude up to `bound`, of terms up to half of that.
    pub(crate) fn up_to(bound: f64) -> Self {
        // With `p ≤ bound < 2p`, a sum of 3p and a term is between 2p and 4p: a multiple of 2⁻⁵¹ p, and 2⁵² of these are 2p.
        let power = f64::from_bits(bound.to_bits() & 0x7ff0_0000_0000_0000);
        Self(3.0 * power)
    }

    /// `term`, rounded.
    #[inline]
    pub(crate) fn round(self, term: f64) -> f64 {
        (term + self.0) - self.0
    }
}

/// The larger one; `m` where `x` is no number.
#[inline]
pub(crate) fn larger(m: f64, x: f64) -> f64 {
    if x > m { x } else { m }
}

/// The number of `forces` of contacts that are not 0, and their sum (force), in whatever order.
pub(crate) fn sum_of_forces(forces: &[f64]) -> (f64, f64) {
    let number = forces.iter().filter(|f| **f != 0.0).count() as f64;
    let largest = forces.iter().fold(0.0, |m, f| larger(m, f.abs()));
    let rounder = Rounder::up_to(number.max(2.0) * largest);
    let sum = forces.iter().fold(0.0, |sum, f| sum + rounder.round(*f));
    (number, sum)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sum_is_the_same_in_any_order_and_with_zeros_among_the_terms() {
        for count in [1, 2, 7, 100, 2345] {
            let force = |c: usize| libm::exp(-6.0 * libm::sin(1.7 * c as f64 + 0.3).abs());
            let forces: Vec<f64> = (0..count).map(force).collect();
            let backwards: Vec<f64> = forces.iter().rev().copied().chain([0.0]).collect();
            let (number, sum) = sum_of_forces(&forces);
            assert_eq!((number, sum), sum_of_forces(&backwards));
            assert_eq!(number, count as f64);
            let plain: f64 = backwards.iter().sum();
            assert!((sum - plain).abs() <= 1e-12 * plain);
        }
    }
}
