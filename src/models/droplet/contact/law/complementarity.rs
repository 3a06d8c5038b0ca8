//! The linear complementarity problem of the contact law, and Saitoh's drop-and-add rule.
//!
//! # The way to the answer
//!
//! A guess of the contact set gives forces by `A f = δ`. A contact with `f ≤ 0` ought to go; a pair outside the set with a negative
//! gap ought to come. [`Rule::Complementarity`](super::Rule::Complementarity) exchanges them all at once and solves again, which takes
//! one or two sweeps when the guess comes from the step before.
//!
//! Exchanging all at once can cycle. The safeguard is that of J. J. Júdice and F. M. Pires (Comput. Oper. Res. 21, 587
//! (1994)): when three sweeps have not lowered the number of violating pairs below its best, only the *first* violating
//! pair in the order of the list is exchanged, until the number falls below its best. With the first pair alone the
//! sequence is Murty's (K. G. Murty, Opsearch 11, 54 (1974)), which reaches the answer of a problem whose matrix is
//! positive definite in finitely many exchanges; so the best number falls again and again, down to zero.
//!
//! # Which pairs are looked at
//!
//! A pair that is not in the set can only have a negative gap if its bulges bridge the distance: pairs with `r_ij ≥ R_i + R_j +
//! B_i + B_j` are passed over, `B_i` being a bound of a bulge ([`bulges`](crate::models::droplet::contact::bulges)). Their gaps are
//! positive, and a positive gap changes nothing: how far the neighbour list reaches, or by how much a bound is too wide, cannot
//! change a bit of the answer. The forces of an unfinished exchange can be anything, and bulges as wide as many particles; they are
//! cut short, and then all bounds are the exact sums.
//!
//! See the example of [`ContactLaw`], through which this is used.

use super::ContactLaw;
use crate::models::droplet::contact::error::ContactError;
use crate::models::droplet::contact::search::Conditions;
use crate::models::droplet::contact::second_image::{Loaded, second_image};
use crate::models::droplet::contact::solver::LinearSolver;
use crate::models::droplet::contact::tolerance::ACCEPTED;
use crate::numerics::threads::both;
use crate::numerics::wide::wide;
use crate::state::Packing;

/// The widest bulge that candidates are looked for with, in units of the largest radius. Conditions φ = 1.3 bulges are below one.
pub(super) const WIDEST_BULGE: f64 = 5.0;

/// A pair that breaks the law.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(in crate::models::droplet::contact) enum Violation {
    /// Contact number `.0` pulls.
    Drop(usize, [u32; 2]),
    /// This pair overlaps and has no force; `.1` is a first guess of it.
    Add([u32; 2], f64),
}

impl Violation {
    pub(super) fn pair(self) -> [u32; 2] {
        match self {
            Self::Drop(_, pair) | Self::Add(pair, _) => pair,
        }
    }
}

impl ContactLaw {
    /// Exchanges contacts until no pair violates the law.
    pub(super) fn settle(&mut self, packing: &Packing) -> Result<(), ContactError> {
        const PATIENCE: u32 = 3;
        const LOCAL_UPDATES: u32 = 3;
        let most = 1000 + 20 * packing.len();
        let (mut best, mut updates) = (usize::MAX, LOCAL_UPDATES);
        self.precision = self.precision_for(packing);
        let mut patience = PATIENCE;
        for _ in 0..most {
            self.sweep(packing)?;
            let count = self.violations.len();
            if count == 0 {
                return Ok(());
            }
            if updates > 0 && self.is_local() {
                updates -= 1;
                if self.update_locally(packing) {
                    self.assemble(packing);
                    self.residual = self.relative(self.equation.max(self.tolerated));
                    return Ok(());
                }
                continue;
            }
            if count < best {
                best = count;
                patience = PATIENCE;
                self.exchange(packing, count);
            } else if patience > 0 {
                patience -= 1;
                self.exchange(packing, count);
            } else {
                self.exchange(packing, 1);
            }
        }
        Err(ContactError::Unsettled {
            violating: self.violations.len(),
            contacts: self.set.active_count(),
            sweeps: most,
        })
    }

    /// Whether few pairs violate the law, and the tolerance is one that a sum of residuals may be held against.
    fn is_local(&self) -> bool {
        matches!(self.solver, LinearSolver::ConjugateGradient(_))
            && self.is_far_above_round_off()
            && 64 * self.violations.len() <= self.set.active_count()
    }

    /// Forces of the set, and the pairs that violate the law, in the order of the list.
    pub(super) fn sweep(&mut self, packing: &Packing) -> Result<(), ContactError> {
        self.work.sweeps += 1;
        self.find_forces(packing)?;
        self.inspect(packing);
        Ok(())
    }

    /// Measures how far the forces are from the contact law, and lists the pairs that violate it.
    pub(super) fn inspect(&mut self, packing: &Packing) {
        self.bound_bulges(packing);
        let tolerance = self.passed_over();
        let worst = self.equation.max(self.find_violations(packing, tolerance));
        self.residual = self.relative(worst);
    }

    /// A length in units of the largest overlap.
    fn relative(&self, length: f64) -> f64 {
        if self.largest_overlap > 0.0 {
            length / self.largest_overlap
        } else {
            length
        }
    }

    /// `B_i`, and a neighbour list that covers the largest of them.
    fn bound_bulges(&mut self, packing: &Packing) {
        let widest = WIDEST_BULGE * packing.largest_radius();
        let per_radius = self.per_radius();
        let (pairs, forces) = (self.set.pairs(), self.set.forces());
        self.bulges
            .bound(pairs, forces, packing.radii(), per_radius);
        // The forces of an unfinished exchange can be anything; pairs beyond the widest bulge are left to a later sweep.
        self.diverged = None;
        if self.bulges.largest().is_nan() || self.bulges.largest() > widest {
            let loaded = Loaded {
                packing,
                geometry: &self.geometry,
                forces,
                per_radius,
            };
            self.diverged = self.bulges.cut(widest, |p| loaded.bulge(p));
        }
        self.candidates.cover(packing, self.bulges.largest());
    }

    /// An answer that leaves out a second image of a neighbour, or that bulges without bound, is none.
    pub(super) fn check_images(&self, packing: &Packing) -> Result<(), ContactError> {
        let reach = |p: usize| packing.radii()[p] + self.bulges.of(p);
        let farthest = packing.largest_radius() + self.bulges.largest();
        if self.diverged.is_none() && 4.0 * farthest <= packing.domain().shortest() {
            return Ok(());
        }
        debug_assert!(
            self.bulges.largest() <= self.candidates.covered(),
            "pairs in reach are listed"
        );
        let tolerance = ACCEPTED * self.allowed();
        let loaded = Loaded {
            packing,
            geometry: &self.geometry,
            forces: self.set.forces(),
            per_radius: self.per_radius(),
        };
        if let Some((particle, other)) =
            second_image(loaded, self.candidates.within_reach(), reach, tolerance)
        {
            return Err(ContactError::BoxTooSmall {
                particle,
                other,
                reach: packing.radii()[particle] + loaded.bulge(particle),
                shortest: packing.domain().shortest(),
            });
        }
        if let Some((particle, bulge)) = self.diverged {
            return Err(ContactError::Diverged {
                particle,
                bulge,
                radius: packing.radii()[particle],
            });
        }
        Ok(())
    }

    /// Lists the pairs that violate the law by more than `tolerance` (length); returns the largest violation, below it or above.
    fn find_violations(&mut self, packing: &Packing, tolerance: f64) -> f64 {
        self.candidates.list(&self.set);
        self.violations.clear();
        self.tolerated = 0.0;
        let mut worst: f64 = 0.0;
        let pulls = |f: f64, inverse_root: f64| f <= 0.0 && inverse_root > 0.0;
        let rows = self
            .set
            .forces()
            .chunks(64)
            .zip(self.matrix.inverse_root().chunks(64));
        for (k, (forces, roots)) in rows.enumerate() {
            let rows = || forces.iter().zip(roots);
            let any = wide(
                #[inline(always)]
                || rows().fold(false, |any, (f, s)| any | (pulls(*f, *s))),
            );
            if !any {
                continue;
            }
            for (contact, (&f, &s)) in (64 * k..).zip(rows()) {
                if pulls(f, s) {
                    self.violations
                        .push(Violation::Drop(contact, self.set.pairs()[contact]));
                    worst = worst.max(-f * self.matrix.diagonal()[contact]);
                }
            }
        }
        let candidates = self.candidates.pairs();
        self.work.distances += (candidates.len() + self.set.inactive().len()) as u64;
        let at = Conditions {
            packing,
            line_tension: self.line_tension,
            geometry: &self.geometry,
            forces: self.set.forces(),
            bulges: &self.bulges,
            per_radius: self.per_radius(),
            tolerance,
        };
        let inactive = self.set.inactive_pairs();
        let two = self.matrix.is_for_two();
        let half = if two { candidates.len() / 2 } else { 0 };
        let (some, more) = candidates.split_at(half);
        let [one, other] = &mut self.searches;
        both(
            two,
            || one.look_at(at, some.iter().copied()),
            || other.look_at(at, more.iter().copied().chain(inactive)),
        );
        for search in &self.searches {
            self.work.gaps += search.gaps();
            self.violations.extend_from_slice(search.violations());
            worst = worst.max(search.worst());
            self.tolerated = self.tolerated.max(search.tolerated());
        }
        self.violations
            .sort_unstable_by_key(|violation| violation.pair());
        worst
    }
}
