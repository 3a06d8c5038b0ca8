//! Loops compiled for wide vectors, where the processor has them.
//!
//! The crate is built for every x86-64 processor, which gives loops two numbers at a time. [`wide`] has a second copy of
//! what it is given, compiled for AVX2, and takes it on processors that know it. Both copies give the same bits: the same
//! operations in the same order, each rounded once (IEEE 754); sums keep the chains that the source gives them, and a
//! compiler does not fuse a product and a sum on its own. Functions that are called within are compiled with it where they are
//! inlined.

/// Runs `loops`, with wide vectors if there are any.
#[inline]
pub(crate) fn wide<R>(loops: impl FnOnce() -> R) -> R {
    pulp::Arch::new().dispatch(loops)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What the digests of recordings rely on: the copy for wide vectors rounds every product before it is added.
    #[test]
    fn wide_loops_give_the_bits_of_narrow_ones() {
        let number = |k: usize| libm::sin(1.7 * k as f64) / 3.0;
        let a: Vec<f64> = (0..1000).map(number).collect();
        let b: Vec<f64> = a.iter().rev().copied().collect();
        let one_by_one = |k: usize| {
            let product = core::hint::black_box(a[k] * b[k]);
            let sum = core::hint::black_box(product + 0.1);
            (core::hint::black_box(sum * sum + 1.0).sqrt() / sum).to_bits()
        };
        let narrow: Vec<u64> = (0..1000).map(one_by_one).collect();
        let mut together = vec![0.0; 1000];
        wide(
            #[inline(always)]
            || {
                for ((x, a), b) in together.iter_mut().zip(&a).zip(&b) {
                    let sum = a * b + 0.1;
                    *x = (sum * sum + 1.0).sqrt() / sum;
                }
            },
        );
        let together: Vec<u64> = together.into_iter().map(f64::to_bits).collect();
        assert_eq!(together, narrow);
    }
}
