//! The candidates: pairs near enough to come into contact that have no number in the set.
//!
//! - The neighbour list holds every pair within reach of bulges up to `covered`.
//! - While `listed`, `pairs` are those of the neighbour list that the set has no number for, ascending.
//! - `moved` bounds how far a particle has moved since the neighbour list was looked at (length).

use super::set::ContactSet;
use crate::neighbors::NeighborList;
use crate::state::Packing;

#[derive(Clone, Debug, Default)]
pub(super) struct Candidates {
    neighbors: NeighborList,
    pairs: Vec<[u32; 2]>,
    listed: bool,
    covered: f64,
    moved: f64,
}

impl Candidates {
    /// The candidates listed last.
    pub(super) fn pairs(&self) -> &[[u32; 2]] {
        &self.pairs
    }

    /// All pairs within reach, those of the set among them.
    pub(super) fn within_reach(&self) -> &[[u32; 2]] {
        self.neighbors.pairs()
    }

    /// The largest bulge that is covered (length).
    pub(super) fn covered(&self) -> f64 {
        self.covered
    }

    /// Number of neighbour lists built.
    pub(super) fn builds(&self) -> u64 {
        self.neighbors.builds()
    }

    /// Whether the neighbour list is of these particles.
    pub(super) fn is_of(&self, packing: &Packing) -> bool {
        self.neighbors.is_of(packing)
    }

    /// Takes note that no particle has moved by more than `distance` (length) since the last call.
    pub(super) fn note_motion(&mut self, distance: f64) {
        self.moved += distance;
    }

    /// The set has other numbers than before.
    pub(super) fn forget(&mut self) {
        self.listed = false;
    }

    /// Covers bulges up to `largest` (length).
    pub(super) fn cover(&mut self, packing: &Packing, largest: f64) {
        let skin = 0.3 * packing.ample_radius();
        let moved = core::mem::replace(&mut self.moved, 0.0);
        let (margin, skin) = (2.0 * largest, skin + largest);
        if self.neighbors.update_after(packing, margin, skin, moved) {
            self.listed = false;
        }
        self.covered = largest;
    }

    /// Lists the candidates, unless they are listed.
    pub(super) fn list(&mut self, set: &ContactSet) {
        if self.listed {
            return;
        }
        self.pairs.clear();
        let mut sorted = set.sorted().iter().peekable();
        let mut added = set.added().to_vec();
        added.sort_unstable();
        // All ascend.
        for &pair in self.neighbors.pairs() {
            while sorted.next_if(|c| **c < pair).is_some() {}
            if sorted.peek() != Some(&&pair) && added.binary_search(&pair).is_err() {
                self.pairs.push(pair);
            }
        }
        self.listed = true;
    }

    /// Takes out pairs that came to the set, which ascend.
    pub(super) fn remove(&mut self, came: impl Iterator<Item = [u32; 2]>) {
        let mut came = came.peekable();
        if came.peek().is_some() {
            self.pairs.retain(|pair| {
                while came.next_if(|c| c < pair).is_some() {}
                came.peek() != Some(pair)
            });
        }
    }
}
