//! The search for pairs that overlap and have no force.
//!
//! - A pair is passed over only if the bounds of its bulges cannot bridge its distance.
//! - A gap has the bits of [`gap_of`], whichever other pairs are looked at with it.

use super::bulges::Bulges;
use super::geometry::{Geometry, gap_of};
use super::law::Violation;
use super::matrix::compliance;
use crate::state::Packing;

/// Where and under which forces pairs are looked at.
#[derive(Clone, Copy)]
pub(super) struct Conditions<'a> {
    pub(super) packing: &'a Packing,
    /// γ (force).
    pub(super) line_tension: f64,
    pub(super) geometry: &'a Geometry,
    /// By the numbers of the contacts.
    pub(super) forces: &'a [f64],
    pub(super) bulges: &'a Bulges,
    /// `1/2πγ`.
    pub(super) per_radius: f64,
    /// How negative a gap may be (length).
    pub(super) tolerance: f64,
}

/// What was found of some pairs.
#[derive(Clone, Debug, Default)]
pub(super) struct Search {
    violations: Vec<Violation>,
    worst: f64,
    tolerated: f64,
    gaps: u64,
}

impl Search {
    /// Looks at `pairs`, none of which is in contact.
    pub(super) fn look_at(&mut self, at: Conditions<'_>, pairs: impl Iterator<Item = [u32; 2]>) {
        self.violations.clear();
        (self.worst, self.tolerated, self.gaps) = (0.0, 0.0, 0);
        let radii = at.packing.radii();
        for pair in pairs.filter(|pair| at.bulges.may_touch(at.packing, *pair)) {
            self.gaps += 1;
            let [i, j] = pair.map(|p| p as usize);
            let gap = gap_of(at.packing, at.line_tension, [i, j], |p| {
                let contacts = at.geometry.around(p);
                contacts.map(|(_, c, toward)| (at.forces[c as usize], toward))
            });
            self.worst = self.worst.max(-gap);
            if gap < -at.tolerance {
                let guess = -gap / compliance(at.per_radius, radii[i] + radii[j]);
                self.violations.push(Violation::Add(pair, guess));
            } else {
                self.tolerated = self.tolerated.max(-gap);
            }
        }
    }

    /// Pairs whose gap is more negative than the tolerance, in the order in which they were looked at.
    pub(super) fn violations(&self) -> &[Violation] {
        &self.violations
    }

    /// The most negative gap, as a positive length; 0 if there is none.
    pub(super) fn worst(&self) -> f64 {
        self.worst
    }

    /// The most negative gap within the tolerance, as a positive length; 0 if there is none.
    pub(super) fn tolerated(&self) -> f64 {
        self.tolerated
    }

    /// Number of gaps that were computed.
    pub(super) fn gaps(&self) -> u64 {
        self.gaps
    }
}
