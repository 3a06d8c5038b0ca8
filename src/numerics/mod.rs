//! What is not physics: a sparse factorisation with one order of sums, sums that no order reaches, general linear systems, loops for wide vectors, a second thread.
//!
//! See the example of [`threads::with`].

pub(crate) mod exact_sum;
pub(crate) mod gmres;
pub(crate) mod simplicial;
pub mod threads;
pub(crate) mod wide;

/// Entry `k` of a fixed vector with a part of every mode: multiples of the golden ratio, folded into ±1/2.
pub(crate) fn folded(k: usize) -> f64 {
    let x = 0.618_033_988_749_894_9 * k as f64;
    x - libm::floor(x) - 0.5
}
