//! Bounds of the bulges: how far outside its undeformed disk a particle can reach.
//!
//! A bulge is at most `B_i = (R_i/2πγ) (g_max Σ_{f>0} f + 3/2 Σ_{f<0} |f|)`.

use super::images::Loaded;
use crate::models::droplet::kernel::{G_AT_CONTACT, G_MAX};
use crate::numerics::wide::wide;

/// How much wider than its sum a bound is taken, for the rounding of the sum.
pub(super) const WIDER: f64 = 1.0 + 1e-12;

/// Bounds of the bulges of all particles (length).
#[derive(Clone, Debug, Default)]
pub(super) struct Bulges {
    bound: Vec<f64>,
    largest: f64,
}

/// The most of a bulge that force `f` makes, in units of `R/2πγ` (force).
#[inline(always)]
pub(super) fn most_of(f: f64) -> f64 {
    if f > 0.0 { G_MAX * f } else { G_AT_CONTACT * f }
}

impl Bulges {
    /// The bound of particle `p`.
    pub(super) fn of(&self, p: usize) -> f64 {
        self.bound[p]
    }

    /// The largest bound there is.
    pub(super) fn largest(&self) -> f64 {
        self.largest
    }

    /// Bounds for the forces on `particles`, cut short at `widest`. Returns the first particle whose bound was, and that bound.
    pub(super) fn bound(&mut self, particles: Loaded<'_>, widest: f64) -> Option<(usize, f64)> {
        let count = particles.packing.len();
        self.bound.resize(count, 0.0);
        self.largest = wide(
            #[inline(always)]
            || {
                let mut largest: f64 = 0.0;
                for (p, bound) in self.bound.iter_mut().enumerate() {
                    *bound = particles.bulge(p);
                    largest = if *bound <= largest { largest } else { *bound };
                }
                largest
            },
        );
        let is_cut = |bound: f64| bound.is_nan() || bound > widest;
        let first = self.bound.iter().position(|bound| is_cut(*bound))?;
        let diverged = Some((first, self.bound[first]));
        for bound in self.bound.iter_mut().filter(|bound| is_cut(**bound)) {
            *bound = widest;
        }
        self.largest = widest;
        diverged
    }

    /// A particle's bound as it is known to be now.
    pub(super) fn widen(&mut self, p: usize, bound: f64) {
        if bound > self.bound[p] {
            self.bound[p] = bound;
            self.largest = self.largest.max(bound);
        }
    }
}
