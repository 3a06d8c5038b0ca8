//! Where the blocks of a [`ContactMatrix`] are, and how contacts come and go without a new structure.

use super::entries_f32::{Operand, rounding};
use super::{ContactMatrix, Geometry, Units};
use crate::models::droplet::contact::list::{ContactList, DuplicateContactList};
use crate::models::droplet::kernel::{G_AT_CONTACT, per_radius};
use crate::numerics::wide::wide;
use crate::state::Packing;
use core::ops::Range;

/// Blocks of `size` contacts, one after the other in each of the columns, and where they begin.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Run {
    pub(super) size: usize,
    count: usize,
    block: usize,
    end: usize,
    value: usize,
}

impl Run {
    fn of(size: usize, count: usize) -> Self {
        Self {
            size,
            count,
            ..Self::default()
        }
    }

    pub(super) fn blocks(&self) -> Range<usize> {
        self.block..self.block + self.count
    }

    pub(super) fn ends(&self) -> Range<usize> {
        self.end..self.end + self.size * self.count
    }

    pub(super) fn values(&self) -> Range<usize> {
        self.value..self.value + pairs_of(self.size) * self.count
    }

    /// The ends and the values of one block.
    pub(super) fn block(&self, place: usize) -> (Range<usize>, Range<usize>) {
        let pairs = pairs_of(self.size);
        let (end, value) = (self.end + self.size * place, self.value + pairs * place);
        (end..end + self.size, value..value + pairs)
    }
}

/// Number of pairs of `z` contacts.
pub(super) const fn pairs_of(z: usize) -> usize {
    z * (z - 1) / 2
}

/// The block of a particle without a contact.
const NO_BLOCK: u32 = u32::MAX;

/// Particles whose blocks are sorted by size together.
const STRETCH: usize = 256;

/// Blocks with more contacts than this share one stretch and have a run each.
const LARGEST_SORTED: usize = 7;

impl ContactMatrix {
    /// Everything that depends on which particles touch, and not on where they are.
    pub(crate) fn restructure(
        &mut self,
        packing: &Packing,
        contacts: &ContactList,
        duplicate: &DuplicateContactList,
        line_tension: f64,
    ) {
        let per_radius = per_radius(line_tension);
        let radii = packing.radii();
        self.diagonal.clear();
        self.pairs.clear();
        self.pairs.extend(contacts.pairs());
        for [i, j] in contacts.pairs() {
            let sum = radii[i as usize] + radii[j as usize];
            self.diagonal.push(compliance(per_radius, sum));
        }
        self.largest_root = compliance(per_radius, 2.0 * packing.largest_radius()).sqrt();
        let root = (packing.largest_radius() * per_radius).sqrt();
        self.units = Units {
            root,
            load: root * line_tension,
            rounding: rounding(packing),
        };
        self.inverse_root.resize(contacts.len(), 0.0);
        self.factor.clear();
        let factor = |r: &f64| -r * per_radius;
        self.factor.extend(radii.iter().map(factor));
        wide(
            #[inline(always)]
            || {
                for (root, compliance) in self.inverse_root.iter_mut().zip(&self.diagonal) {
                    *root = root_of_inverse(*compliance);
                }
            },
        );
        self.lay_out(duplicate);
    }

    /// Places for the blocks.
    fn lay_out(&mut self, duplicate: &DuplicateContactList) {
        self.lacks_values = true;
        self.sort_blocks(duplicate);
        self.block_of.clear();
        self.block_of.resize(duplicate.particles(), NO_BLOCK);
        self.end.clear();
        for (block, &p) in self.particle.iter().enumerate() {
            self.block_of[p as usize] = block as u32;
            let row = duplicate.entries(p as usize);
            self.end.extend(duplicate.ends(p, row));
        }
        let (mut block, mut end, mut value) = (0, 0, 0);
        for run in &mut self.runs {
            (run.block, run.end, run.value) = (block, end, value);
            block += run.count;
            (end, value) = (run.ends().end, run.values().end);
        }
        self.value.resize(value, 0.0);
        self.entries_f32.resize(value, 0.0);
        self.operands.resize(self.pairs.len(), Operand::default());
        self.loads.resize(self.pairs.len(), 0.0);
    }

    /// Adds one more contact, with the next number: `duplicate` has it already. Its particles' blocks move to the end.
    pub(crate) fn add(
        &mut self,
        packing: &Packing,
        duplicate: &DuplicateContactList,
        pair: [u32; 2],
        line_tension: f64,
    ) {
        let radii = packing.radii();
        let sum = radii[pair[0] as usize] + radii[pair[1] as usize];
        let diagonal = compliance(per_radius(line_tension), sum);
        self.pairs.push(pair);
        self.diagonal.push(diagonal);
        self.inverse_root.push(root_of_inverse(diagonal));
        self.operands.push(Operand::default());
        self.loads.push(0.0);
        for p in pair {
            self.remove_block(p);
            let run = Run {
                size: duplicate.entries(p as usize).len(),
                count: 1,
                block: self.particle.len(),
                end: self.end.len(),
                value: self.value.len(),
            };
            self.block_of[p as usize] = run.block as u32;
            self.particle.push(p);
            let row = duplicate.entries(p as usize);
            self.end.extend(duplicate.ends(p, row));
            self.value.resize(run.values().end, 0.0);
            self.entries_f32.resize(run.values().end, 0.0);
            self.runs.push(run);
        }
        self.lacks_values = true;
    }

    /// The run that the block of particle `p` is in, and its place there.
    pub(super) fn place_of(&self, p: u32) -> Option<(usize, usize)> {
        let block = self.block_of[p as usize];
        if block == NO_BLOCK {
            return None;
        }
        let after = self.runs.partition_point(|run| run.block <= block as usize);
        let run = after - 1;
        Some((run, block as usize - self.runs[run].block))
    }

    /// Takes the block of particle `p` out of its run; the last one of the run fills the place.
    fn remove_block(&mut self, p: u32) {
        let Some((run, to)) = self.place_of(p) else {
            return;
        };
        let run = &mut self.runs[run];
        run.count -= 1;
        let (from, z) = (run.count, run.size);
        let moved = self.particle[run.block + from];
        self.particle[run.block + to] = moved;
        self.block_of[moved as usize] = (run.block + to) as u32;
        let ends = run.end + z * from;
        self.end.copy_within(ends..ends + z, run.end + z * to);
    }

    /// Corrections leave the force of contact `c`, which takes no part in them.
    pub(crate) fn deactivate(&mut self, c: usize) {
        self.lacks_values = true;
        self.inverse_root[c] = 0.0;
    }

    /// Corrections reach contact `c` again.
    pub(crate) fn activate(&mut self, c: usize) {
        self.lacks_values = true;
        self.inverse_root[c] = root_of_inverse(self.diagonal[c]);
    }

    /// The order of the blocks: within each stretch of particles by size, then by particle.
    fn sort_blocks(&mut self, duplicate: &DuplicateContactList) {
        const SIZES: usize = LARGEST_SORTED + 2;
        self.particle.clear();
        self.runs.clear();
        self.stretches.clear();
        let size = |p: usize| duplicate.entries(p).len();
        let particles = duplicate.particles();
        for begin in (0..particles).step_by(STRETCH) {
            let stretch = begin..particles.min(begin + STRETCH);
            let mut next = [0; SIZES];
            for p in stretch.clone() {
                next[size(p).min(SIZES - 1)] += 1;
            }
            let mut end = self.particle.len();
            for (z, count) in next.iter_mut().enumerate().skip(1) {
                if *count > 0 && z <= LARGEST_SORTED {
                    self.runs.push(Run::of(z, *count));
                }
                (*count, end) = (end, end + *count);
            }
            self.particle.resize(end, 0);
            for p in stretch.clone().filter(|&p| size(p) > 0) {
                let slot = &mut next[size(p).min(SIZES - 1)];
                self.particle[*slot] = p as u32;
                *slot += 1;
            }
            let after = stretch.end as u32;
            let large = stretch.map(size).filter(|&z| z > LARGEST_SORTED);
            self.runs.extend(large.map(|z| Run::of(z, 1)));
            let contacts = self.pairs.partition_point(|pair| pair[0] < after);
            self.stretches.push([self.runs.len(), contacts]);
        }
        self.sorted_runs = self.runs.len();
    }

    /// The matrix of those contacts alone that are active: `order` has their numbers, `contacts` them in this order, and
    /// `geometry` where they are.
    pub(crate) fn of_some(
        &self,
        order: &[u32],
        contacts: &ContactList,
        geometry: &Geometry,
    ) -> Self {
        let of_these = |column: &[f64]| order.iter().map(|c| column[*c as usize]).collect();
        let mut some = Self {
            diagonal: of_these(&self.diagonal),
            inverse_root: of_these(&self.inverse_root),
            factor: self.factor.clone(),
            pairs: contacts.pairs().collect(),
            largest_root: self.largest_root,
            units: self.units,
            ..Self::default()
        };
        some.lay_out(geometry.duplicate());
        some.complete(geometry);
        some
    }
}

/// `A_cc = (3/4πγ) (R_i + R_j)` from `1/2πγ` and the sum of radii: one formula, and so one rounding, for whoever needs it.
#[inline(always)]
pub(in crate::models::droplet::contact) fn compliance(per_radius: f64, sum: f64) -> f64 {
    -G_AT_CONTACT * per_radius * sum
}

/// `A_cc^(−½)`.
#[inline(always)]
fn root_of_inverse(compliance: f64) -> f64 {
    (1.0 / compliance).sqrt()
}
