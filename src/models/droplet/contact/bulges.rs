//! Bounds of the bulges: how far outside its undeformed disk a particle can reach.
//!
//! A bulge is at most `B_i = (R_i/2πγ) (g_max Σ_{f>0} f + 3/2 Σ_{f<0} |f|)`. A wider bound serves as well and costs a few gaps
//! more, so the sums are not made in every step: each force is counted with something to spare, and only those that have
//! outgrown it are added on. Bounds grow that way; from time to time they are summed anew.

use crate::models::droplet::kernel::{G_AT_CONTACT, G_MAX};
use crate::numerics::wide::wide;
use crate::state::Packing;

/// What a force is counted with to spare, in units of the mean force.
const SPARE: f64 = 0.05;

/// Steps that the bounds grow before they are summed anew.
const LONGEST: u32 = 50;

/// How much wider than its sum a bound is taken, for the rounding of the sum.
pub(super) const WIDER: f64 = 1.0 + 1e-12;

/// Bounds of the bulges of all particles (length).
#[derive(Clone, Debug, Default)]
pub(super) struct Bulges {
    bound: Vec<f64>,
    largest: f64,
    /// What each force is counted as, less `spare`.
    counted: Vec<f64>,
    spare: f64,
    age: u32,
}

/// The most of a bulge that force `f` makes, in units of `R/2πγ` (force).
pub(super) fn most_of(f: f64) -> f64 {
    if f > 0.0 { G_MAX * f } else { G_AT_CONTACT * f }
}

/// The force (positive) that bulges as much as `f`.
#[inline(always)]
fn equivalent(f: f64) -> f64 {
    if f < 0.0 { G_AT_CONTACT / G_MAX * f } else { f }
}

impl Bulges {
    /// The bound of particle `p`.
    pub(super) fn of(&self, p: usize) -> f64 {
        self.bound[p]
    }

    /// The largest bound there is; NaN if one is.
    pub(super) fn largest(&self) -> f64 {
        self.largest
    }

    /// The contacts have other numbers than before.
    pub(super) fn forget(&mut self) {
        self.age = LONGEST;
    }

    /// Bounds for the `forces` of `pairs`; `per_radius` is `1/2πγ`. Numbers of contacts are those of the last time, and
    /// perhaps more, unless [`forget`](Self::forget) was called.
    pub(super) fn bound(
        &mut self,
        pairs: &[[u32; 2]],
        forces: &[f64],
        radii: &[f64],
        per_radius: f64,
    ) {
        self.age = self.age.saturating_add(1);
        if self.age > LONGEST
            || self.bound.len() != radii.len()
            || forces.len() < self.counted.len()
        {
            let sum: f64 = forces.iter().map(|f| f.abs()).sum();
            self.spare = SPARE * sum / forces.len().max(1) as f64;
            self.sum_with(pairs, forces, radii, per_radius);
            self.age = 0;
            return;
        }
        // A contact that came since counts for nothing yet.
        self.counted.resize(forces.len(), -self.spare);
        let rows = forces.chunks(64).zip(self.counted.chunks_mut(64));
        for ((forces, counted), pairs) in rows.zip(pairs.chunks(64)) {
            let outgrown = wide(
                #[inline(always)]
                || {
                    let mut within = true;
                    for (f, counted) in forces.iter().zip(&*counted) {
                        within &= equivalent(*f) <= counted + self.spare;
                    }
                    !within
                },
            );
            if !outgrown {
                continue;
            }
            for ((f, counted), pair) in forces.iter().zip(counted).zip(pairs) {
                let f = equivalent(*f);
                if f <= *counted + self.spare {
                    continue;
                }
                for p in pair.map(|p| p as usize) {
                    let growth = WIDER * G_MAX * (f - *counted) * (radii[p] * per_radius);
                    self.bound[p] += growth;
                    // A NaN stays.
                    if self.bound[p] > self.largest || self.bound[p].is_nan() {
                        self.largest = self.bound[p];
                    }
                }
                *counted = f;
            }
        }
    }

    fn sum_with(&mut self, pairs: &[[u32; 2]], forces: &[f64], radii: &[f64], per_radius: f64) {
        self.counted.clear();
        self.counted.extend(forces.iter().map(|f| equivalent(*f)));
        self.bound.clear();
        self.bound.resize(radii.len(), 0.0);
        for (&[i, j], f) in pairs.iter().zip(&self.counted) {
            self.bound[i as usize] += f + self.spare;
            self.bound[j as usize] += f + self.spare;
        }
        self.largest = 0.0;
        for (bound, radius) in self.bound.iter_mut().zip(radii) {
            *bound *= WIDER * G_MAX * (radius * per_radius);
            if *bound > self.largest || bound.is_nan() {
                self.largest = *bound;
            }
        }
    }

    /// Narrows all bounds to what `exact` says of the particles, and that to `widest`: a particle that may bulge farther has no bound
    /// any more, so that of another decides which pairs are looked at, and must not depend on how it has grown. Returns the first
    /// particle of which `exact` says more than `widest`, with what it says. The next bounds are summed anew.
    pub(super) fn cut(
        &mut self,
        widest: f64,
        exact: impl Fn(usize) -> f64,
    ) -> Option<(usize, f64)> {
        let mut first = None;
        for (particle, bound) in self.bound.iter_mut().enumerate() {
            *bound = exact(particle);
            if bound.is_nan() || *bound > widest {
                first.get_or_insert((particle, *bound));
                *bound = widest;
            }
        }
        self.largest = self.bound.iter().copied().fold(0.0, f64::max);
        self.forget();
        first
    }

    /// Whether two particles are so near that their bulges might meet.
    #[inline]
    pub(super) fn may_touch(&self, packing: &Packing, pair: [u32; 2]) -> bool {
        let ([i, j], radii) = (pair.map(|p| p as usize), packing.radii());
        let reach = radii[i] + radii[j] + self.of(i) + self.of(j);
        packing.separation(i, j).norm_squared() < reach * reach
    }

    /// A particle's bound as it is known to be now.
    pub(super) fn widen(&mut self, p: usize, bound: f64) {
        if bound > self.bound[p] {
            self.bound[p] = bound;
            self.largest = self.largest.max(bound);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bounds_stay_above_the_sums_while_forces_come_go_and_grow() {
        let radii: Vec<f64> = (0..40).map(|p| 0.5 + 0.01 * f64::from(p)).collect();
        let mut pairs: Vec<[u32; 2]> = (0..39).map(|p| [p, p + 1]).collect();
        let mut bulges = Bulges::default();
        let (mut sums, mut too_wide) = (0, 0);
        for step in 0..400 {
            if step % 30 == 10 && pairs.len() < 60 {
                let p = pairs.len() as u32 - 39;
                pairs.push([p, p + 2]);
            }
            let force = |c: usize| {
                let wave = libm::sin(0.37 * c as f64 + 0.021 * f64::from(step));
                // Most grow and shrink, some are 0, some pull.
                if c % 7 == 3 {
                    0.0
                } else {
                    0.2 + wave.max(-0.3)
                }
            };
            let forces: Vec<f64> = (0..pairs.len()).map(force).collect();
            bulges.bound(&pairs, &forces, &radii, 0.16);
            sums += u32::from(bulges.age == 0);
            let mut exact = vec![0.0; 40];
            for (pair, &f) in pairs.iter().zip(&forces) {
                for p in pair.map(|p| p as usize) {
                    let g = if f > 0.0 { G_MAX } else { G_AT_CONTACT };
                    exact[p] += g * f * radii[p] * 0.16;
                }
            }
            for (p, exact) in exact.iter().enumerate() {
                assert!(bulges.of(p) >= *exact);
                assert!(bulges.of(p) <= bulges.largest());
                too_wide += usize::from(bulges.of(p) > 2.0 * exact + 0.1);
            }
        }
        assert!(sums < 10, "summed {sums} times");
        assert!(
            too_wide < 400 * 40 / 10,
            "{too_wide} bounds are much too wide"
        );
        bulges.bound(&pairs, &vec![f64::NAN; pairs.len()], &radii, 0.16);
        assert!(bulges.largest().is_nan());
        assert_eq!(bulges.cut(1.0, |_| 0.5), None, "not as bad as that");
        assert_eq!(bulges.largest(), 0.5);
        bulges.bound(&pairs, &vec![f64::NAN; pairs.len()], &radii, 0.16);
        let exact = |p| if p < 3 { 0.9 } else { 1.5 };
        assert_eq!(bulges.cut(1.0, exact), Some((3, 1.5)));
        assert_eq!(bulges.largest(), 1.0);
    }

    #[test]
    fn bounds_that_are_cut_do_not_know_how_they_have_grown() {
        let radii = [0.5; 30];
        let pairs: Vec<[u32; 2]> = (0..29).map(|p| [p, p + 1]).collect();
        let forces = |step: u32| -> Vec<f64> {
            let wave = |c: usize| 0.2 + 0.1 * libm::sin(1.3 * c as f64 + 0.2 * f64::from(step));
            (0..29).map(wave).collect()
        };
        let mut diverged = forces(40);
        diverged[7] = 1e3;
        let exact = |p: usize| {
            let own = [p.checked_sub(1), (p < 29).then_some(p)];
            let sum: f64 = own
                .into_iter()
                .flatten()
                .map(|c| most_of(diverged[c]))
                .sum();
            sum * 0.5 * 0.16
        };
        let cut = |first: u32| {
            let mut bulges = Bulges::default();
            for step in first..40 {
                bulges.bound(&pairs, &forces(step), &radii, 0.16);
            }
            bulges.bound(&pairs, &diverged, &radii, 0.16);
            let grown: Vec<f64> = (0..30).map(|p| bulges.of(p)).collect();
            assert_eq!(bulges.cut(2.5, exact).map(|c| c.0), Some(7));
            let cut: Vec<f64> = (0..30).map(|p| bulges.of(p)).collect();
            (grown, cut)
        };
        let ((long, a), (short, b)) = (cut(0), cut(39));
        assert_ne!(long, short, "they have grown in different ways");
        assert_eq!(a, b);
    }
}
