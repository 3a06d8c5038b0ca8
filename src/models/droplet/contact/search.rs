//! The search for pairs that touch and are not in contact yet.
//!
//! The gap of a pair depends on all forces on its two particles, which lie wherever their contacts are numbered. Read pair by pair,
//! each number waits for the one before: where the row of a particle is, then its contacts, then their forces and directions.
//! In a large packing none of them is near. So each is read of many pairs before the next, and the memory answers them together;
//! and of the two particles of a pair the one that may reach farther comes first, which spares the other in half of the cases.

use super::blocks::compliance;
use super::bulges::Bulges;
use super::complementarity::Offence;
use super::geometry::{Geometry, bulge_toward};
use crate::models::droplet::kernel::Direction;
use crate::state::{Packing, unit_and_length};
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
    /// Pairs near enough to touch by the bounds of their bulges.
    pub(super) near: Vec<[u32; 2]>,
    facing: Vec<Facing>,
    /// The rows of one particle of each pair, in the duplicate list.
    rows: Vec<Range<usize>>,
    /// The ends of contacts in these rows, and where those of each particle end.
    ends: Vec<u32>,
    behind: Vec<usize>,
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
            self.facing.clear();
            self.facing
                .extend(pairs.iter().map(|pair| Facing::of(at, *pair)));
            // Of half of the pairs one contour tells that they are apart, however far the other may reach.
            self.load(at, 0);
            let meets = |facing: &Facing| {
                let other = at.bulges.of(facing.particles[1]);
                facing.bulges[0] + other > facing.apart - SLACK * facing.distance
            };
            self.facing.retain(meets);
            self.load(at, 1);
            for facing in &self.facing {
                let gap = facing.gap();
                self.worst = self.worst.max(-gap);
                if gap < -at.tolerance {
                    let [i, j] = facing.particles;
                    let guess = -gap / compliance(at.per_radius, radii[i] + radii[j]);
                    self.found.push(Offence::Add(facing.pair(), guess));
                } else {
                    self.tolerated = self.tolerated.max(-gap);
                }
            }
        }
        self.near = near;
    }

    /// The bulges of one of the two particles of each pair.
    fn load(&mut self, at: At<'_>, side: usize) {
        let duplicate = at.geometry.duplicate();
        let particles = || self.facing.iter().map(|facing| facing.particles[side]);
        self.rows.clear();
        self.rows.extend(particles().map(|p| duplicate.entries(p)));
        self.ends.clear();
        self.behind.clear();
        for (p, row) in particles().zip(&self.rows) {
            self.ends.extend(duplicate.ends(p as u32, row.clone()));
            self.behind.push(self.ends.len());
        }
        self.loads.clear();
        let load = |e: &u32| (at.forces[(e >> 1) as usize], at.geometry.toward(*e));
        self.loads.extend(self.ends.iter().map(load));
        let mut begin = 0;
        for (facing, &behind) in self.facing.iter_mut().zip(&self.behind) {
            let forces = self.loads[begin..behind].iter().copied();
            let radius = at.packing.radii()[facing.particles[side]];
            let toward = facing.toward[side];
            facing.bulges[side] = bulge_toward(toward, radius, at.line_tension, forces);
            begin = behind;
        }
    }
}

/// What part of the distance of two particles is left to the rounding of sums that differ in their order.
const SLACK: f64 = 1e-12;

/// Two particles without a contact, the one that may reach farther first.
#[derive(Clone, Copy, Debug)]
struct Facing {
    particles: [usize; 2],
    /// The direction from each to the other.
    toward: [Direction; 2],
    distance: f64,
    /// The gap of the undeformed disks (length).
    apart: f64,
    /// How far each reaches toward the other beyond its disk (length).
    bulges: [f64; 2],
}

impl Facing {
    fn of(at: At<'_>, pair: [u32; 2]) -> Self {
        let [i, j] = pair.map(|p| p as usize);
        let (normal, distance) = unit_and_length(at.packing.separation(i, j));
        let to_j = Direction::of(-normal);
        let overlap = at.packing.radii()[i] + at.packing.radii()[j] - distance;
        let (mut particles, mut toward) = ([i, j], [to_j, to_j.opposite()]);
        if at.bulges.of(i) < at.bulges.of(j) {
            particles.reverse();
            toward.reverse();
        }
        Self {
            particles,
            toward,
            distance,
            apart: -overlap,
            bulges: [0.0; 2],
        }
    }

    fn pair(&self) -> [u32; 2] {
        let [i, j] = self.particles.map(|p| p as u32);
        [i.min(j), i.max(j)]
    }

    /// The gap of the deformed contours (length), to the bits of [`gap_of`](super::geometry::gap_of).
    fn gap(&self) -> f64 {
        let [a, b] = self.bulges;
        let [of_i, of_j] = if self.particles[0] < self.particles[1] {
            [a, b]
        } else {
            [b, a]
        };
        self.apart - of_i - of_j
    }
}
