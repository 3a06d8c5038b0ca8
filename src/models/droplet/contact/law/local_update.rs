//! What an exchange of a few contacts changes, and nothing else.
//!
//! The forces `f` of a contact set are known to a residual `ρ = δ − A f`. If a few contacts go or come, `f` is changed by
//! their forces, and the residual by what these forces do to the contacts next to them: a right-hand side that is zero but
//! for a few entries. The correction solves `A Δf = r` for it. After `k` iterations conjugate gradients have reached
//! contacts at most `k` steps away, so they are run on a region of contacts that grows by one step an iteration: the
//! very iterations of the whole system, without the zeros. What is left of `r` adds to `ρ`, and the sum is kept below the
//! tolerance.
//!
//! Each exchange has a region of its own, and is made on the forces that the ones before have left: in a large packing most lie far
//! apart, and each needs but the iterations that it asks for. Where regions meet, what they leave is added up.
//!
//! Contacts beyond the region keep their forces, so that none of them begins to pull; the gap of a pair depends on the
//! forces on its two particles, so that only pairs with a particle of the region are looked at again.

use super::ContactLaw;
use super::complementarity::{Violation, WIDEST_BULGE};
use super::local_region::{LocalRegion, Whole};
use crate::models::droplet::contact::bulges::{WIDER, most_of};
use crate::models::droplet::contact::geometry::gap_of;
use crate::models::droplet::contact::matrix::compliance;
use crate::state::Packing;

/// Exchanges that are tried before the whole set is solved again.
const ROUNDS: usize = 8;

impl ContactLaw {
    /// Exchanges the violating pairs and corrects the forces around them until no pair violates the law; says whether it got there.
    /// If not, the contacts are exchanged all the same, with forces to go on from.
    pub(super) fn update_locally(&mut self, packing: &Packing) -> bool {
        let mut region = core::mem::take(&mut self.region);
        region.begin(&mut self.set, packing.len());
        let settled = self.update_in(packing, &mut region);
        region.finish(&mut self.set, &mut self.violations);
        self.region = region;
        self.exchange(packing, self.violations.len());
        settled
    }

    fn update_in(&mut self, packing: &Packing, region: &mut LocalRegion) -> bool {
        let allowed = self.allowed();
        let (before, tolerance) = (self.equation, self.passed_over());
        let per_radius = self.per_radius();
        for _ in 0..ROUNDS {
            self.work.local_updates += 1;
            region.begin_round();
            let violations = core::mem::take(&mut self.violations);
            for violation in &violations {
                let Some((contact, change)) = self.change(packing, region, *violation, tolerance)
                else {
                    continue;
                };
                region.clear();
                let most = self.set.active_count() / 4;
                let whole = Whole::of(packing, &self.geometry, self.set.pairs(), per_radius);
                region.disturb(whole, contact, change);
                let descent = region.descend(whole, 0.5 * allowed, most);
                let Some((iterations, left)) = descent else {
                    return false;
                };
                self.work.local_iterations += iterations as u64;
                self.equation = self.equation.max(before + region.leave(left));
                if self.equation > 2.0 * allowed {
                    return false;
                }
            }
            self.violations = violations;
            if !self.inspect_round(packing, region, tolerance) {
                return false;
            }
            if self.violations.is_empty() {
                return true;
            }
        }
        false
    }

    /// Exchanges a violating pair, if it still violates the law by more than `tolerance` (length); returns its contact and by how much
    /// the force of that has changed.
    fn change(
        &mut self,
        packing: &Packing,
        region: &mut LocalRegion,
        violation: Violation,
        tolerance: f64,
    ) -> Option<(usize, f64)> {
        match violation {
            Violation::Drop(contact, _) => {
                if region.forces()[contact] > 0.0 {
                    return None;
                }
                Some((contact, -region.remove(&self.set, contact)))
            }
            Violation::Add(pair, _) => {
                let guess = self.overlap_force(packing, region, pair, tolerance)?;
                let per_radius = self.per_radius();
                let whole = Whole::of(packing, &self.geometry, self.set.pairs(), per_radius);
                Some((region.add(whole, pair, guess), guess))
            }
        }
    }

    /// Lists the pairs that violate the law around the regions of a round; `false` if the forces diverge.
    fn inspect_round(&mut self, packing: &Packing, region: &LocalRegion, tolerance: f64) -> bool {
        let per_radius = self.per_radius();
        let widest = WIDEST_BULGE * packing.largest_radius();
        self.violations.clear();
        let mut largest: f64 = 0.0;
        for &p in region.visited() {
            let mut bulge = 0.0;
            let whole = Whole::of(packing, &self.geometry, self.set.pairs(), per_radius);
            for (contact, _) in region.contacts_of(whole, p) {
                let f = region.forces()[contact];
                bulge += most_of(f);
                if f <= 0.0 && !region.is_gone(contact) {
                    let pair = region.pair(whole, contact);
                    self.violations.push(Violation::Drop(contact, pair));
                }
            }
            bulge *= WIDER * packing.radii()[p as usize] * per_radius;
            if bulge.is_nan() || bulge > widest {
                return false;
            }
            self.bulges.widen(p as usize, bulge);
            largest = largest.max(bulge);
        }
        if largest > self.candidates.covered() {
            self.candidates.cover(packing, largest);
            self.candidates.list(&self.set);
        }
        let candidates = core::mem::take(&mut self.candidates);
        let pairs = candidates.pairs().iter();
        for &pair in pairs.filter(|pair| region.is_near(**pair)) {
            let whole = Whole::of(packing, &self.geometry, self.set.pairs(), per_radius);
            if !region.has_come(whole, pair) {
                self.inspect_pair(packing, region, pair, tolerance);
            }
        }
        self.candidates = candidates;
        for k in 0..self.set.inactive().len() {
            let c = self.set.inactive()[k];
            let pair = self.set.pairs()[c as usize];
            if region.is_gone(c as usize) && region.is_near(pair) {
                self.inspect_pair(packing, region, pair, tolerance);
            }
        }
        for &c in region.gone() {
            self.inspect_pair(packing, region, self.set.pairs()[c as usize], tolerance);
        }
        // A contact between two particles that were visited was met twice.
        self.violations
            .sort_unstable_by_key(|violation| violation.pair());
        self.violations.dedup_by_key(|violation| violation.pair());
        true
    }

    fn inspect_pair(
        &mut self,
        packing: &Packing,
        region: &LocalRegion,
        pair: [u32; 2],
        tolerance: f64,
    ) {
        self.work.distances += 1;
        if !self.bulges.may_touch(packing, pair) {
            return;
        }
        if let Some(guess) = self.overlap_force(packing, region, pair, tolerance) {
            self.violations.push(Violation::Add(pair, guess));
        }
    }

    /// A first guess of the force of a pair without one whose contours overlap by more than `tolerance` (length).
    fn overlap_force(
        &mut self,
        packing: &Packing,
        region: &LocalRegion,
        pair: [u32; 2],
        tolerance: f64,
    ) -> Option<f64> {
        let [i, j] = pair.map(|p| p as usize);
        let per_radius = self.per_radius();
        let whole = Whole::of(packing, &self.geometry, self.set.pairs(), per_radius);
        self.work.gaps += 1;
        let forces = region.forces();
        let gap = gap_of(packing, self.line_tension, [i, j], |p| {
            let contacts = region.contacts_of(whole, p as u32);
            contacts.map(|(contact, toward)| (forces[contact], toward))
        });
        if gap < -tolerance {
            let sum = packing.radii()[i] + packing.radii()[j];
            Some(-gap / compliance(per_radius, sum))
        } else {
            self.tolerated = self.tolerated.max(-gap);
            None
        }
    }
}
