//! The set of contacts, with their forces: it says which pairs are in contact. Whoever changes that (`law/exchange.rs`) tells geometry
//! and matrix.
//!
//! - A contact's number is its place in `pairs` and in `forces`, which are equally long unless the forces are lent. No pair occurs twice.
//! - The first `sorted` pairs ascend. The others came since then, in any order.
//! - `inactive` ascends. The force of an inactive contact is 0; it has left the set and keeps its number.
//! - Which numbers the contacts have reaches no bit of a result.

use core::ops::Range;

/// Contacts by number.
#[derive(Clone, Debug, Default)]
pub(super) struct ContactSet {
    pairs: Vec<[u32; 2]>,
    forces: Vec<f64>,
    sorted: usize,
    inactive: Vec<u32>,
}

impl ContactSet {
    /// The pairs by number, inactive ones among them.
    pub(super) fn pairs(&self) -> &[[u32; 2]] {
        &self.pairs
    }

    /// The forces by number; 0 where a contact is inactive.
    pub(super) fn forces(&self) -> &[f64] {
        &self.forces
    }

    /// The forces, for a solver that leaves those of inactive contacts alone.
    pub(super) fn forces_mut(&mut self) -> &mut [f64] {
        &mut self.forces
    }

    /// Lends the forces to a local update, which may append to them; there are none until they are [returned](Self::return_forces).
    pub(super) fn lend_forces(&mut self) -> Vec<f64> {
        core::mem::take(&mut self.forces)
    }

    /// Takes the lent forces back, without what was appended.
    pub(super) fn return_forces(&mut self, mut forces: Vec<f64>) {
        forces.truncate(self.pairs.len());
        self.forces = forces;
    }

    /// The numbers of the inactive contacts, ascending.
    pub(super) fn inactive(&self) -> &[u32] {
        &self.inactive
    }

    /// The pairs of the inactive contacts.
    pub(super) fn inactive_pairs(&self) -> impl Iterator<Item = [u32; 2]> + Clone {
        self.inactive.iter().map(|c| self.pairs[*c as usize])
    }

    /// The pairs that ascend.
    pub(super) fn sorted(&self) -> &[[u32; 2]] {
        &self.pairs[..self.sorted]
    }

    /// The pairs that came since.
    pub(super) fn added(&self) -> &[[u32; 2]] {
        &self.pairs[self.sorted..]
    }

    /// How many numbers there are.
    pub(super) fn len(&self) -> usize {
        self.pairs.len()
    }

    /// How many contacts are active.
    pub(super) fn active_count(&self) -> usize {
        self.pairs.len() - self.inactive.len()
    }

    pub(super) fn is_active(&self, contact: usize) -> bool {
        self.inactive.binary_search(&(contact as u32)).is_err()
    }

    /// Whether all contacts are active and ascend.
    pub(super) fn is_ordered(&self) -> bool {
        self.inactive.is_empty() && self.sorted == self.pairs.len()
    }

    /// Takes other contacts, which ascend, and their forces.
    pub(super) fn replace(&mut self, pairs: &[[u32; 2]], forces: &[f64]) {
        debug_assert!(pairs.len() == forces.len() && pairs.windows(2).all(|w| w[0] < w[1]));
        self.pairs.clear();
        self.pairs.extend_from_slice(pairs);
        self.forces.clear();
        self.forces.extend_from_slice(forces);
        self.sorted = pairs.len();
        self.inactive.clear();
    }

    /// The contact leaves the set.
    pub(super) fn deactivate(&mut self, contact: usize) {
        self.forces[contact] = 0.0;
        if let Err(place) = self.inactive.binary_search(&(contact as u32)) {
            self.inactive.insert(place, contact as u32);
        }
    }

    /// The contact comes back, with a force to begin with.
    pub(super) fn activate(&mut self, contact: usize, force: f64) {
        self.forces[contact] = force;
        if let Ok(place) = self.inactive.binary_search(&(contact as u32)) {
            self.inactive.remove(place);
        }
    }

    /// A pair that has no number gets the next one, and a force to begin with.
    pub(super) fn add(&mut self, pair: [u32; 2], force: f64) {
        debug_assert!(!self.pairs.contains(&pair), "no pair occurs twice");
        self.pairs.push(pair);
        self.forces.push(force);
    }

    /// Numbers the active contacts and those that `came` in the order of pairs.
    pub(super) fn sort(&mut self, came: &[([u32; 2], f64)]) {
        let known = self.in_order().into_iter().flatten();
        let known = known.map(|c| (self.pairs[c], self.forces[c]));
        let mut contacts: Vec<_> = known.chain(came.iter().copied()).collect();
        // Most ascend already.
        contacts.sort_by_key(|c| c.0);
        (self.pairs, self.forces) = contacts.into_iter().unzip();
        self.sorted = self.pairs.len();
        self.inactive.clear();
    }

    /// The active contacts in the order of pairs, as ranges of their numbers.
    pub(super) fn in_order(&self) -> Vec<Range<usize>> {
        // Before which of the sorted ones a later one belongs.
        let mut late = Vec::new();
        for c in (self.sorted..self.pairs.len()).filter(|c| self.is_active(*c)) {
            let before = self.sorted().partition_point(|pair| *pair < self.pairs[c]);
            late.push((before, self.pairs[c], c));
        }
        late.sort_unstable();
        let (mut ranges, mut from) = (Vec::new(), 0);
        let mut late = late.into_iter().peekable();
        let ends = self.inactive.iter().map(|c| *c as usize);
        for end in ends.take_while(|c| *c < self.sorted).chain([self.sorted]) {
            while let Some((before, _, c)) = late.next_if(|(before, ..)| *before <= end) {
                ranges.extend([from..before, c..c + 1]);
                from = before;
            }
            ranges.push(from..end);
            from = end + 1;
        }
        ranges
    }
}
