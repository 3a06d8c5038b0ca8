//! What an exchange of a few contacts changes, and nothing else.
//!
//! The forces `f` of a contact set are known to a residual `ρ = δ − A f`. If a few contacts go or come, `f` is changed by
//! their forces, and the residual by what these forces do to the contacts next to them: a right-hand side that is zero but
//! for a few entries. The correction solves `A Δf = r` for it. After `k` iterations conjugate gradients have reached
//! contacts at most `k` steps away, so they are run on a patch of contacts that grows by one step an iteration: the
//! very iterations of the whole system, without the zeros. What is left of `r` adds to `ρ`, and the sum is kept below the
//! tolerance.
//!
//! Contacts beyond the patch keep their forces, so that none of them begins to pull; the gap of a pair depends on the
//! forces on its two particles, so that only pairs with a particle of the patch are looked at again.

use super::complementarity::{Offence, WIDEST_BULGE};
use super::geometry::gap_of;
use super::law::ContactLaw;
use super::patch::{Added, GONE, NOWHERE, Patch, Whole};
use super::tolerance::ACCEPTED;
use crate::droplet::kernel::{Direction, G_AT_CONTACT, G_MAX};
use crate::packing::{Packing, unit_and_length};
use core::f64::consts::PI;

/// Exchanges that are tried before the whole set is solved again.
const ROUNDS: usize = 8;

impl ContactLaw {
    /// Exchanges the offending contacts and mends the forces around them until none offends; says whether it got there.
    /// If not, the contacts are exchanged all the same, with forces to go on from.
    pub(super) fn mend(&mut self, packing: &Packing) -> bool {
        let mut patch = core::mem::take(&mut self.patch);
        let known = self.pairs.len();
        patch.place.resize(known, NOWHERE);
        patch.block.resize(packing.len(), NOWHERE);
        for &c in &self.at_rest {
            patch.place[c as usize] = GONE;
        }
        let settled = self.mend_in(packing, &mut patch);
        self.offending.clear();
        for &c in &patch.gone {
            self.offending
                .push(Offence::Drop(c as usize, self.pairs[c as usize]));
        }
        for &c in &self.at_rest {
            if patch.place[c as usize] != GONE {
                let (pair, force) = (self.pairs[c as usize], self.forces[c as usize]);
                self.offending.push(Offence::Add(pair, force));
            }
            patch.place[c as usize] = NOWHERE;
        }
        for (k, added) in patch.added.iter().enumerate() {
            if patch.place[known + k] != GONE {
                self.offending
                    .push(Offence::Add(added.pair, self.forces[known + k]));
            }
        }
        self.offending
            .sort_unstable_by_key(|offence| offence.pair());
        self.forces.truncate(known);
        patch.finish();
        self.patch = patch;
        self.exchange(packing, self.offending.len());
        settled
    }

    fn mend_in(&mut self, packing: &Packing, patch: &mut Patch) -> bool {
        let allowed = self.allowed(self.scale());
        for _ in 0..ROUNDS {
            self.work.patches += 1;
            self.disturb(packing, patch);
            let most = self.contact_count() / 4;
            let (whole, forces) = self.whole(packing);
            let Some((iterations, left)) = patch.descend(whole, forces, 0.5 * allowed, most) else {
                return false;
            };
            self.work.patch_iterations += iterations as u64;
            self.off += left;
            if self.off > 2.0 * allowed || !self.inspect_patch(packing, patch, ACCEPTED * allowed) {
                return false;
            }
            if self.offending.is_empty() {
                return true;
            }
        }
        false
    }

    fn whole<'a>(&'a mut self, packing: &'a Packing) -> (Whole<'a>, &'a mut [f64]) {
        let whole = Whole {
            packing,
            geometry: &self.geometry,
            pairs: &self.pairs,
            per_radius: 1.0 / (2.0 * PI * self.line_tension),
        };
        (whole, &mut self.forces)
    }

    /// Exchanges the offending contacts, and a patch around them with the residual that this leaves.
    fn disturb(&mut self, packing: &Packing, patch: &mut Patch) {
        patch.clear();
        let known = self.pairs.len();
        let mut changes = Vec::with_capacity(self.offending.len());
        for at in 0..self.offending.len() {
            let (contact, change) = match self.offending[at] {
                Offence::Drop(contact, _) => {
                    patch.place[contact] = GONE;
                    if contact < known && !self.is_at_rest(contact) {
                        patch.gone.push(contact as u32);
                    }
                    (contact, -core::mem::take(&mut self.forces[contact]))
                }
                Offence::Add(pair, guess) => {
                    let (whole, _) = self.whole(packing);
                    let contact = if let Some(contact) = patch.find(whole, pair) {
                        patch.gone.retain(|&c| c as usize != contact);
                        patch.place[contact] = NOWHERE;
                        contact
                    } else {
                        let [i, j] = pair.map(|p| p as usize);
                        let (normal, _) = unit_and_length(packing.separation(i, j));
                        let toward = Direction::of(-normal);
                        patch.added.push(Added { pair, toward });
                        patch.place.push(NOWHERE);
                        self.forces.push(0.0);
                        self.forces.len() - 1
                    };
                    self.forces[contact] = guess;
                    (contact, guess)
                }
            };
            changes.push((contact, change));
        }
        patch.added_of.clear();
        for (k, added) in patch.added.iter().enumerate() {
            let ([i, j], k) = (added.pair, k as u32);
            patch.added_of.extend([[i, j, k], [j, i, k]]);
        }
        patch.added_of.sort_unstable();
        let (whole, _) = self.whole(packing);
        for (contact, change) in changes {
            patch.disturb(whole, contact, change);
        }
    }

    /// Lists the pairs around the patch that offend; `false` if the forces are absurd.
    fn inspect_patch(&mut self, packing: &Packing, patch: &Patch, tolerance: f64) -> bool {
        let radii = packing.radii();
        let per_radius = 1.0 / (2.0 * PI * self.line_tension);
        let widest = WIDEST_BULGE * packing.largest_radius();
        let (mut first, mut largest) = (0, 0.0f64);
        for (&p, &end) in patch.particles.iter().zip(&patch.ends) {
            let mut bulge = 0.0;
            for &place in &patch.member[first..end] {
                let f = self.forces[patch.contacts[place as usize] as usize];
                bulge += if f > 0.0 { G_MAX * f } else { G_AT_CONTACT * f };
            }
            first = end;
            bulge *= (1.0 + 1e-12) * radii[p as usize] * per_radius;
            if bulge.is_nan() || bulge > widest {
                return false;
            }
            self.bulges.widen(p as usize, bulge);
            largest = largest.max(bulge);
        }
        if largest > self.covered {
            self.cover(packing, largest);
            self.part();
        }
        self.offending.clear();
        let known = self.pairs.len();
        for &c in &patch.contacts {
            let c = c as usize;
            if self.forces[c] <= 0.0 {
                let (whole, _) = self.whole(packing);
                let pair = patch.pair(whole, c);
                self.offending.push(Offence::Drop(c, pair));
            }
        }
        let others = core::mem::take(&mut self.others);
        for &pair in &others {
            let [i, j] = pair.map(|p| p as usize);
            if patch.block[i] == NOWHERE && patch.block[j] == NOWHERE {
                continue;
            }
            let came = patch.find_added(pair);
            if came.is_none_or(|k| patch.place[known + k] == GONE) {
                self.inspect_pair(packing, patch, pair, tolerance);
            }
        }
        self.others = others;
        let at_rest = core::mem::take(&mut self.at_rest);
        for &c in &at_rest {
            let pair = self.pairs[c as usize];
            let near = pair.iter().any(|p| patch.block[*p as usize] != NOWHERE);
            if near && patch.place[c as usize] == GONE {
                self.inspect_pair(packing, patch, pair, tolerance);
            }
        }
        self.at_rest = at_rest;
        for &c in &patch.gone {
            self.inspect_pair(packing, patch, self.pairs[c as usize], tolerance);
        }
        // The same order whichever of them have numbers.
        self.offending
            .sort_unstable_by_key(|offence| offence.pair());
        true
    }

    /// Whether contact `c` was at rest before the exchanges that are being mended.
    fn is_at_rest(&self, c: usize) -> bool {
        self.matrix.scaling()[c] == 0.0
    }

    fn inspect_pair(&mut self, packing: &Packing, patch: &Patch, pair: [u32; 2], tolerance: f64) {
        let [i, j] = pair.map(|p| p as usize);
        let radii = packing.radii();
        let per_radius = 1.0 / (2.0 * PI * self.line_tension);
        let separation = packing.separation(i, j);
        let reach = radii[i] + radii[j] + self.bulges.of(i) + self.bulges.of(j);
        self.work.distances += 1;
        if separation.norm_squared() >= reach * reach {
            return;
        }
        self.work.gaps += 1;
        let whole = Whole {
            packing,
            geometry: &self.geometry,
            pairs: &self.pairs,
            per_radius,
        };
        let forces = &self.forces;
        let gap = gap_of(packing, self.line_tension, [i, j], |p| {
            let contacts = patch.contacts_of(whole, p as u32);
            contacts.map(|(contact, toward)| (forces[contact], toward))
        });
        if gap < -tolerance {
            let compliance = -G_AT_CONTACT * (radii[i] + radii[j]) * per_radius;
            self.offending.push(Offence::Add(pair, -gap / compliance));
        } else {
            self.tolerated = self.tolerated.max(-gap);
        }
    }
}
