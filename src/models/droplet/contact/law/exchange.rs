//! Where contacts come and go: the set changes here alone, and the columns of geometry and matrix with it.

use super::{ContactLaw, Standing, Violation};
use crate::models::droplet::contact::solver::LinearSolver;
use crate::state::Packing;

impl ContactLaw {
    /// Takes contacts and forces from outside, in the order of pairs.
    pub(super) fn take(&mut self, packing: &Packing, pairs: &[[u32; 2]], forces: &[f64]) {
        self.ordered.take();
        let known = self.set.is_ordered() && self.set.pairs() == pairs;
        self.set.replace(pairs, forces);
        if !known || !self.candidates.is_of(packing) {
            self.renumbered();
            self.sets.1 = pairs.iter().fold(0, |set, pair| set ^ name(*pair));
        }
        self.changes.clear();
        self.sets.0 = self.sets.1;
    }

    /// Exchanges the first `count` violating pairs between the two sides.
    ///
    /// A contact that leaves becomes inactive where it is, and one that comes back becomes active; others are added after those
    /// that there are. Neither touches the rest of the structure.
    pub(super) fn exchange(&mut self, packing: &Packing, count: usize) {
        debug_assert!(
            self.violations
                .windows(2)
                .all(|w| w[0].pair() < w[1].pair())
        );
        let mut came: Vec<([u32; 2], f64)> = Vec::new();
        let (mut left, mut joined): (f64, f64) = (0.0, 0.0);
        for at in 0..count {
            let violation = self.violations[at];
            let pair = violation.pair();
            self.changes
                .push((pair, matches!(violation, Violation::Add(..))));
            self.sets.1 ^= name(pair);
            match violation {
                Violation::Drop(contact, _) => {
                    left = left.max(self.geometry.overlaps()[contact].abs());
                    self.set.deactivate(contact);
                    self.matrix.deactivate(contact);
                }
                Violation::Add(pair, guess) => match self.geometry.duplicate().find(pair) {
                    Some(contact) => {
                        joined = joined.max(self.geometry.overlaps()[contact as usize].abs());
                        self.set.activate(contact as usize, guess);
                        self.matrix.activate(contact as usize);
                    }
                    None => came.push((pair, guess)),
                },
            }
        }
        if !matches!(self.solver, LinearSolver::ConjugateGradient(_))
            || 32 * came.len() > self.set.len()
        {
            self.put_in_order(&came);
            return;
        }
        for &(pair, guess) in &came {
            self.set.add(pair, guess);
            self.geometry.add(packing, pair);
            joined = joined.max(self.geometry.overlaps()[self.set.len() - 1].abs());
            let duplicate = self.geometry.duplicate();
            self.matrix.add(packing, duplicate, pair, self.line_tension);
        }
        if left >= self.largest_overlap {
            let all = 0..self.matrix.len();
            self.largest_overlap = self.matrix.largest_overlap(&self.geometry, all);
        }
        self.largest_overlap = self.largest_overlap.max(joined);
        self.candidates.remove(came.iter().map(|c| c.0));
        debug_assert!(self.columns_agree());
    }

    /// Numbers the contacts in the order of pairs, without those that have left and with those that `came`; their structure
    /// is to be built.
    pub(super) fn put_in_order(&mut self, came: &[([u32; 2], f64)]) {
        if came.is_empty() && self.set.is_ordered() {
            return;
        }
        self.set.sort(came);
        self.renumbered();
    }

    /// Whether so many contacts have left or come since the structure was built that it is time for a new one.
    pub(super) fn is_untidy(&self) -> bool {
        16 * self.set.inactive().len() > self.set.len() + 256
            || 64 * self.matrix.stragglers() > self.set.len() + 1024
    }

    /// The contacts have other numbers: what goes by the old ones is of no use.
    fn renumbered(&mut self) {
        self.candidates.forget();
        self.bulges.forget();
        self.standing = Standing::Outdated;
    }

    /// Whether geometry and matrix have the contacts of the set by its numbers, and the same of them are inactive.
    fn columns_agree(&self) -> bool {
        let inactive = |c: &u32| self.matrix.inverse_root()[*c as usize] == 0.0;
        self.geometry.overlaps().len() == self.set.len()
            && self.matrix.pairs() == self.set.pairs()
            && (0..self.set.len() as u32)
                .filter(inactive)
                .eq(self.set.inactive().iter().copied())
    }
}

/// A pair's part in the name of a set of contacts, see [`ContactLaw::sets`]: the finalizer of SplitMix64 (G. L. Steele, D. Lea and
/// C. H. Flood, OOPSLA 2014).
fn name([i, j]: [u32; 2]) -> u64 {
    let mut x = (u64::from(i) << 32 | u64::from(j)).wrapping_add(0x9e37_79b9_7f4a_7c15);
    x = (x ^ x >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    x = (x ^ x >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
    x ^ x >> 31
}
