//! The linear complementarity problem of the contact law, and the seed's drop-and-add rule.
//!
//! # The way to the answer
//!
//! A guess of the contact set gives forces by `A f = δ`. A contact with `f ≤ 0` ought to go; a pair outside the set
//! with a negative gap ought to come. [`Rule::Complementarity`](super::Rule::Complementarity) exchanges them all at once and solves again, which
//! takes one or two sweeps when the guess comes from the step before.
//!
//! Exchanging all at once can cycle. The safeguard is that of J. J. Júdice and F. M. Pires (Comput. Oper. Res. 21, 587
//! (1994)): when three sweeps have not lowered the number of offending pairs below its best, only the *first* offending
//! pair in the order of the list is exchanged, until the number falls below its best. With the first pair alone the
//! sequence is Murty's (K. G. Murty, Opsearch 11, 54 (1974)), which reaches the answer of a problem whose matrix is
//! positive definite in finitely many exchanges; so the best number falls again and again, down to zero.
//!
//! # Which pairs are looked at
//!
//! A pair that is not in the set can only have a negative gap if its bulges bridge the distance. A bulge is at most
//! `B_i = (R_i/2πγ) (g_max Σ_{f>0} f + 3/2 Σ_{f<0} |f|)`, so pairs with `r_ij ≥ R_i + R_j + B_i + B_j` are passed over,
//! by an exact comparison: how far the neighbour list reaches cannot change a bit of the answer.
//!
//! See the example of [`ContactLaw`], through which this is used.

use super::error::ContactError;
use super::geometry::{Kept, arrivals, rearrange};
use super::images::second_image;
use super::law::ContactLaw;
use super::solver::LinearSolver;
use super::tolerance::ACCEPTED;
use crate::droplet::kernel::{G_AT_CONTACT, G_MAX};
use crate::packing::Packing;
use core::f64::consts::PI;

/// The widest bulge that candidates are looked for with, in units of the largest radius. At φ = 1.3 bulges are below one.
pub(super) const WIDEST_BULGE: f64 = 5.0;

/// A tolerance, relative to the largest `|δ|`, at which round-off in a residual does not matter.
const FAR_ABOVE_ROUND_OFF: f64 = 1e-10;

/// A pair that breaks the law.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Offence {
    /// Contact number `.0` pulls.
    Drop(usize, [u32; 2]),
    /// This pair overlaps and has no force; `.1` is a first guess of it.
    Add([u32; 2], f64),
}

impl Offence {
    pub(super) fn pair(self) -> [u32; 2] {
        match self {
            Self::Drop(_, pair) | Self::Add(pair, _) => pair,
        }
    }
}

impl ContactLaw {
    /// Exchanges contacts until none offends.
    pub(super) fn settle(&mut self, packing: &Packing) -> Result<(), ContactError> {
        const PATIENCE: u32 = 3;
        let most = 1000 + 20 * packing.len();
        let (mut best, mut mends) = (usize::MAX, 3);
        let mut patience = PATIENCE;
        for _ in 0..most {
            self.sweep(packing)?;
            let count = self.offending.len();
            if count == 0 {
                return Ok(());
            }
            if mends > 0 && self.is_mendable() {
                mends -= 1;
                if self.mend(packing) {
                    self.assemble(packing);
                    let (scale, worst) = (self.scale(), self.off.max(self.tolerated));
                    self.residual = if scale > 0.0 { worst / scale } else { worst };
                    return Ok(());
                }
                continue;
            }
            if count < best {
                best = count;
                patience = PATIENCE;
                self.exchange(count);
            } else if patience > 0 {
                patience -= 1;
                self.exchange(count);
            } else {
                self.exchange(1);
            }
        }
        Err(ContactError::Unsettled {
            offending: self.offending.len(),
            contacts: self.pairs.len(),
            sweeps: most,
        })
    }

    /// Whether few contacts offend, and the tolerance is one that a sum of residuals may be held against.
    fn is_mendable(&self) -> bool {
        let scale = self.scale();
        matches!(self.solver, LinearSolver::ConjugateGradient(_))
            && self.allowed(scale) > FAR_ABOVE_ROUND_OFF * scale
            && 64 * self.offending.len() <= self.pairs.len()
    }

    /// Forces of the present set, and the pairs that offend, in the order of the list.
    pub(super) fn sweep(&mut self, packing: &Packing) -> Result<(), ContactError> {
        self.work.sweeps += 1;
        self.assemble(packing);
        let scale = self.scale();
        let tolerance = self.allowed(scale);
        let overlaps = self.geometry.overlaps();
        let iterations = if tolerance > FAR_ABOVE_ROUND_OFF * scale {
            self.solver
                .solve_loosely(&self.matrix, overlaps, &mut self.forces, tolerance)
        } else {
            self.solver
                .solve(&self.matrix, overlaps, &mut self.forces, tolerance)
        }?;
        self.work.iterations += iterations as u64;
        match self.solver.largest_residual() {
            Some(largest) => self.off = largest,
            None => self.measure_equation(),
        }
        self.inspect(packing);
        Ok(())
    }

    /// Geometry and matrix of the present set at the present positions; what still stands is not done again.
    pub(super) fn assemble(&mut self, packing: &Packing) {
        if self.structured && self.refreshed {
            return;
        }
        if !self.structured {
            self.list.rebuild(packing.len(), &self.pairs);
            self.work.structures += 1;
            if self.refreshed {
                self.geometry.exchange(packing, &self.list, &self.kept);
                let (of, tension) = (&self.geometry, self.line_tension);
                self.matrix
                    .exchange(packing, &self.list, of, &self.exchanged, tension);
                self.structured = true;
                return;
            }
            self.geometry.restructure(&self.list);
            let duplicate = self.geometry.duplicate();
            self.matrix
                .restructure(packing, &self.list, duplicate, self.line_tension);
        }
        if !self.refreshed {
            self.geometry.refresh(packing, &self.list);
            self.work.assemblies += 1;
        }
        self.matrix
            .refresh(packing, &self.geometry, self.line_tension);
        (self.structured, self.refreshed) = (true, true);
    }

    /// The largest `|δ|`, the scale of all residuals.
    pub(super) fn scale(&self) -> f64 {
        let overlaps = self.geometry.overlaps();
        overlaps.iter().fold(0.0, |m: f64, d| m.max(d.abs()))
    }

    /// `max |A f − δ|` of the present forces.
    pub(super) fn measure_equation(&mut self) {
        self.image.resize(self.forces.len(), 0.0);
        self.matrix.multiply(&self.forces, &mut self.image);
        self.off = 0.0;
        for (q, d) in self.image.iter().zip(self.geometry.overlaps()) {
            self.off = self.off.max((d - q).abs());
        }
    }

    /// Measures how far the present forces are from the contact law, and lists the pairs that offend.
    pub(super) fn inspect(&mut self, packing: &Packing) {
        let scale = self.scale();
        self.bound_bulges(packing);
        let tolerance = ACCEPTED * self.allowed(scale);
        let worst = self.off.max(self.find_offences(packing, tolerance));
        self.residual = if scale > 0.0 { worst / scale } else { worst };
    }

    /// `B_i`, and a neighbour list that covers the largest of them.
    fn bound_bulges(&mut self, packing: &Packing) {
        self.bulges.clear();
        self.bulges.resize(packing.len(), 0.0);
        for (&[i, j], &f) in self.pairs.iter().zip(&self.forces) {
            let bulge = if f > 0.0 { G_MAX * f } else { G_AT_CONTACT * f };
            self.bulges[i as usize] += bulge;
            self.bulges[j as usize] += bulge;
        }
        // The forces of an unfinished exchange can be anything; pairs beyond the widest bulge are left to a later sweep.
        let widest = WIDEST_BULGE * packing.largest_radius();
        let mut largest: f64 = 0.0;
        self.absurd = None;
        for (particle, (bulge, radius)) in self.bulges.iter_mut().zip(packing.radii()).enumerate() {
            *bulge *= radius / (2.0 * PI * self.line_tension);
            if bulge.is_nan() || *bulge > widest {
                self.absurd.get_or_insert((particle, *bulge));
                *bulge = widest;
            }
            largest = largest.max(*bulge);
        }
        self.cover(packing, largest);
    }

    /// A neighbour list that covers bulges up to `largest`.
    pub(super) fn cover(&mut self, packing: &Packing, largest: f64) {
        let skin = 0.3 * packing.largest_radius();
        if self
            .neighbors
            .update(packing, 2.0 * largest, skin + largest)
        {
            self.parted = false;
        }
        self.covered = largest;
    }

    /// An answer that leaves out a second image of a neighbour, or that bulges absurdly, is none.
    pub(super) fn check_images(&self, packing: &Packing) -> Result<(), ContactError> {
        let reach = |p: usize| packing.radii()[p] + self.bulges[p];
        let scale = self.scale();
        if let Some((particle, other)) = second_image(
            packing,
            &self.contacts(),
            self.line_tension,
            reach,
            ACCEPTED * self.allowed(scale),
        ) {
            return Err(ContactError::BoxTooSmall {
                particle,
                other,
                reach: reach(particle),
                shortest: packing.domain().shortest(),
            });
        }
        if let Some((particle, bulge)) = self.absurd {
            return Err(ContactError::Absurd {
                particle,
                bulge,
                radius: packing.radii()[particle],
            });
        }
        Ok(())
    }

    /// The pairs of the neighbour list that are not in the set.
    pub(super) fn part(&mut self) {
        if self.parted {
            return;
        }
        self.others.clear();
        let mut contacts = self.pairs.iter().peekable();
        // Both ascend.
        for &pair in self.neighbors.pairs() {
            while contacts.next_if(|c| **c < pair).is_some() {}
            if contacts.peek() != Some(&&pair) {
                self.others.push(pair);
            }
        }
        self.parted = true;
    }

    /// Lists the pairs that offend by more than `tolerance` (length); returns the largest offence, below it or above.
    fn find_offences(&mut self, packing: &Packing, tolerance: f64) -> f64 {
        self.part();
        self.offending.clear();
        self.tolerated = 0.0;
        let (radii, positions) = (packing.radii(), packing.positions());
        let domain = packing.domain();
        let mut worst: f64 = 0.0;
        for (contact, &f) in self.forces.iter().enumerate() {
            if f <= 0.0 {
                self.offending
                    .push(Offence::Drop(contact, self.pairs[contact]));
                worst = worst.max(-f * self.matrix.diagonal()[contact]);
            }
        }
        let drops = self.offending.len();
        self.work.distances += self.others.len() as u64;
        for &pair in &self.others {
            let [i, j] = [pair[0] as usize, pair[1] as usize];
            let separation = domain.minimum_image(positions[i] - positions[j]);
            let reach = radii[i] + radii[j] + self.bulges[i] + self.bulges[j];
            if separation.norm_squared() >= reach * reach {
                continue;
            }
            self.work.gaps += 1;
            let gap = self
                .geometry
                .gap(packing, self.line_tension, &self.forces, i, j);
            worst = worst.max(-gap);
            if gap < -tolerance {
                let compliance =
                    -G_AT_CONTACT * (radii[i] + radii[j]) / (2.0 * PI * self.line_tension);
                self.offending.push(Offence::Add(pair, -gap / compliance));
            } else {
                self.tolerated = self.tolerated.max(-gap);
            }
        }
        if drops > 0 && self.offending.len() > drops {
            self.offending
                .sort_unstable_by_key(|offence| offence.pair());
        }
        worst
    }

    /// Exchanges the first `count` offending pairs between the two sides.
    pub(super) fn exchange(&mut self, count: usize) {
        debug_assert!(self.offending.windows(2).all(|w| w[0].pair() < w[1].pair()));
        if count == 0 {
            return;
        }
        self.kept.clear();
        let mut begin = 0;
        for offence in &self.offending[..count] {
            let (end, then) = match *offence {
                Offence::Drop(contact, _) => (contact, None),
                Offence::Add(pair, _) => (self.pairs.partition_point(|p| *p < pair), Some(pair)),
            };
            let range = begin..end;
            begin = end + usize::from(then.is_none());
            self.kept.push(Kept { range, then });
        }
        self.exchanged.clear();
        let pairs = self.offending[..count].iter().map(|o| o.pair());
        self.exchanged.extend(pairs);
        let range = begin..self.pairs.len();
        self.kept.push(Kept { range, then: None });
        rearrange(&mut self.pairs, &self.kept, [0; 2]);
        rearrange(&mut self.forces, &self.kept, 0.0);
        let guesses = self.offending[..count].iter().filter_map(|o| match o {
            Offence::Add(_, guess) => Some(guess),
            Offence::Drop(..) => None,
        });
        for ((place, pair), guess) in arrivals(&self.kept).zip(guesses) {
            self.pairs[place] = pair;
            self.forces[place] = *guess;
        }
        self.structured = false;
        self.part_again(count);
    }

    /// The pairs of the neighbour list that are not in the set, after the first `count` offending ones were exchanged.
    fn part_again(&mut self, count: usize) {
        const FEW: usize = 64;
        if count > FEW {
            self.parted = false;
        }
        for offence in &self.offending[..count.min(FEW)] {
            let pair = offence.pair();
            match (offence, self.others.binary_search(&pair)) {
                // Only what the neighbour list holds.
                (Offence::Drop(..), Err(place))
                    if self.neighbors.pairs().binary_search(&pair).is_ok() =>
                {
                    self.others.insert(place, pair);
                }
                (Offence::Add(..), Ok(place)) => {
                    self.others.remove(place);
                }
                _ => {}
            }
        }
    }
}
