//! The search for pairs that touch and are not in contact yet.
//!
//! The gap of a pair depends on all forces on its two particles, which lie wherever their contacts are numbered. Read pair by pair,
//! each number waits for the one before: where the row of a particle is, then its contacts, then their forces and directions.
//! In a large packing none of them is near. So each is read of many pairs before the next, and the memory answers them together.

use super::blocks::compliance;
use super::bulges::Bulges;
use super::complementarity::Offence;
use super::geometry::{Geometry, gap_of};
use crate::droplet::kernel::Direction;
use crate::packing::Packing;
use core::ops::Range;

/// Pairs that are looked at together: few enough for what is read of them to stay in the fastest memory.
const TOGETHER: usize = 64;

/// Where and under which forces pairs are looked at.
#[derive(Clone, Copy)]
pub(super) struct At<'a> {
    pub(super) packing: &'a Packing,
    pub(super) line_tension: f64,
    pub(super) geometry: &'a Geometry,
    pub(super) forces: &'a [f64],
    pub(super) bulges: &'a Bulges,
    /// `1/2πγ`.
    pub(super) per_radius: f64,
    /// How negative a gap may be (length).
    pub(super) tolerance: f64,
}

/// What was found of some pairs, with the buffers.
#[derive(Clone, Debug, Default)]
pub(super) struct Search {
    /// Those whose gap is more negative than allowed.
    pub(super) found: Vec<Offence>,
    /// The most negative gap, and that of those that may be (length, as positive numbers).
    pub(super) worst: f64,
    pub(super) tolerated: f64,
    /// Pairs near enough to touch, whose gaps were computed.
    pub(super) near: Vec<[u32; 2]>,
    /// The rows of the two particles of each pair, in the duplicate list.
    rows: Vec<[Range<usize>; 2]>,
    /// The ends of contacts in these rows, and where those of each particle end.
    ends: Vec<u32>,
    behind: Vec<[usize; 2]>,
    /// Force and direction of each end.
    loads: Vec<(f64, Direction)>,
}

impl Search {
    /// Looks at `pairs`, none of which is in contact.
    pub(super) fn look_at(&mut self, at: At<'_>, pairs: impl Iterator<Item = [u32; 2]>) {
        self.found.clear();
        (self.worst, self.tolerated) = (0.0, 0.0);
        self.near.clear();
        let (radii, positions) = (at.packing.radii(), at.packing.positions());
        let domain = at.packing.domain();
        for pair in pairs {
            let [i, j] = pair.map(|p| p as usize);
            let separation = domain.minimum_image(positions[i] - positions[j]);
            let reach = radii[i] + radii[j] + at.bulges.of(i) + at.bulges.of(j);
            if separation.norm_squared() >= reach * reach {
                continue;
            }
            self.near.push(pair);
        }
        let near = core::mem::take(&mut self.near);
        for pairs in near.chunks(TOGETHER) {
            self.load(at, pairs);
            let mut begin = 0;
            for (k, &pair) in pairs.iter().enumerate() {
                let [middle, end] = self.behind[k];
                let [i, j] = pair.map(|p| p as usize);
                let (of_i, of_j) = (&self.loads[begin..middle], &self.loads[middle..end]);
                let of = |p: usize| if p == i { of_i } else { of_j }.iter().copied();
                let gap = gap_of(at.packing, at.line_tension, [i, j], of);
                begin = end;
                self.worst = self.worst.max(-gap);
                if gap < -at.tolerance {
                    let guess = -gap / compliance(at.per_radius, radii[i] + radii[j]);
                    self.found.push(Offence::Add(pair, guess));
                } else {
                    self.tolerated = self.tolerated.max(-gap);
                }
            }
        }
        self.near = near;
    }

    /// Reads the forces on the particles of `pairs`.
    fn load(&mut self, at: At<'_>, pairs: &[[u32; 2]]) {
        let duplicate = at.geometry.duplicate();
        let rows = |pair: &[u32; 2]| pair.map(|p| duplicate.entries(p as usize));
        self.rows.clear();
        self.rows.extend(pairs.iter().map(rows));
        self.ends.clear();
        self.behind.clear();
        for (pair, rows) in pairs.iter().zip(&self.rows) {
            let mut behind = [0; 2];
            for (k, row) in rows.iter().enumerate() {
                self.ends.extend(duplicate.ends(pair[k], row.clone()));
                behind[k] = self.ends.len();
            }
            self.behind.push(behind);
        }
        self.loads.clear();
        let load = |e: &u32| (at.forces[(e >> 1) as usize], at.geometry.toward(*e));
        self.loads.extend(self.ends.iter().map(load));
    }
}
