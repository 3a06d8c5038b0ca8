//! The lines along which droplets may press on each other, and what each droplet's lines have to do with each other.
//!
//! Every pair of droplets that are near enough has a line: the vector `Δx = x_j − x_i` to the nearest image, turned by the tilt `τ` of the
//! pair, gives the unit normal `n` of their contact, outward from `i`. A line is a *side* of each of its two droplets; sides of a droplet are
//! numbered in the order of the pairs. Of each droplet the kernel between its sides is kept,
//!
//! ```text
//! Â_kl = −g(θ_k − θ_l)/2π,   Â_kk = 3/4π,        G_kl = g'(θ_k − θ_l)/2π,   G_kk = 0
//! ```
//!
//! which is the matrix of Morse and Witten for a droplet of radius 1, and its slope.
//!
//! Invariants: `pairs` ascend; `sides[first[p]..first[p + 1]]` are those of droplet `p`, and block `p` is the square of their number.

use crate::domain::Vec2;
use crate::models::droplet::kernel::Direction;
use crate::numerics::wide::wide;
use crate::state::{Packing, unit_and_length};
use core::f64::consts::PI;

/// A line is kept for droplets whose centres are no farther apart than this (sums of their radii). Contacts reach 1.15 in balance at φ = 0.995, and
/// 1.225 on the way from disks at 0.99.
pub(super) const REACH: f64 = 1.3;

/// A side of a droplet: which line it is, and whether the droplet is the second of its pair.
#[derive(Clone, Copy, Debug)]
pub(super) struct Side {
    pub line: u32,
    pub is_second: bool,
}

/// See the [module](self).
#[derive(Clone, Debug, Default)]
pub(super) struct Lines {
    pairs: Vec<[u32; 2]>,
    /// `Δx/|Δx|` and `|Δx|` (length).
    along: Vec<Vec2>,
    distances: Vec<f64>,
    /// `δ = R_i + R_j − |Δx|` (length).
    overlaps: Vec<f64>,
    /// `|Δx| − n·Δx = 2|Δx| sin²(τ/2)`, and `|Δx| sin τ` (length).
    turned: Vec<[f64; 2]>,
    /// `n`, outward from the first droplet.
    normals: Vec<Vec2>,
    first: Vec<u32>,
    sides: Vec<Side>,
    /// The side that a line is of its first and its second droplet.
    sides_of: Vec<[u32; 2]>,
    /// Where the blocks of droplets begin in `kernel` and `slopes`.
    blocks: Vec<u32>,
    kernel: Vec<f64>,
    slopes: Vec<f64>,
    /// `n` with its angle.
    directions: Vec<Direction>,
}

/// `−g(θ)/2π` and `g'(θ)/2π` of the angle `θ` from `b` to `a`: `g = (π − |θ|) sin |θ| − ½ cos θ − 1`.
#[inline(always)]
fn between(a: Direction, b: Direction) -> (f64, f64) {
    const PER_TURN: f64 = 1.0 / (2.0 * PI);
    let difference = a.angle - b.angle; // in [−2π, 2π]
    let sin = a.sin * b.cos - a.cos * b.sin;
    let cos = a.cos * b.cos + a.sin * b.sin;
    // sign(θ) (π − |θ|)
    let rest = PI.copysign(difference) - difference;
    let kernel = (1.0 - rest * sin) + 0.5 * cos;
    (PER_TURN * kernel, PER_TURN * (rest * cos - 0.5 * sin))
}

impl Lines {
    /// The lines of `packing` among `near`, which holds all pairs that are near enough and ascends.
    pub fn set(&mut self, packing: &Packing, near: &[[u32; 2]]) {
        let (radii, positions) = (packing.radii(), packing.positions());
        let domain = packing.domain();
        self.pairs.clear();
        self.along.clear();
        self.distances.clear();
        self.overlaps.clear();
        for &[i, j] in near {
            let [p, q] = [i as usize, j as usize];
            let between = domain.minimum_image(positions[q] - positions[p]);
            let reach = REACH * (radii[p] + radii[q]);
            if between.norm_squared() < reach * reach {
                let (along, distance) = unit_and_length(between);
                self.pairs.push([i, j]);
                self.along.push(along);
                self.distances.push(distance);
                self.overlaps.push(radii[p] + radii[q] - distance);
            }
        }
        self.number_sides(packing.len());
    }

    fn number_sides(&mut self, droplets: usize) {
        self.first.clear();
        self.first.resize(droplets + 1, 0);
        for p in self.pairs.as_flattened() {
            self.first[*p as usize + 1] += 1;
        }
        for p in 0..droplets {
            self.first[p + 1] += self.first[p];
        }
        let none = Side {
            line: u32::MAX,
            is_second: false,
        };
        self.sides.clear();
        self.sides.resize(2 * self.pairs.len(), none);
        self.sides_of.clear();
        let mut next = self.first.clone();
        for (line, &[i, j]) in (0..).zip(&self.pairs) {
            let of = [(i, false), (j, true)].map(|(p, is_second)| {
                let side = next[p as usize];
                next[p as usize] += 1;
                self.sides[side as usize] = Side { line, is_second };
                side
            });
            self.sides_of.push(of);
        }
        self.blocks.clear();
        let mut block = 0;
        for p in 0..droplets {
            self.blocks.push(block);
            let sides = self.first[p + 1] - self.first[p];
            block += sides * sides;
        }
        self.kernel.resize(block as usize, 0.0);
        self.slopes.resize(block as usize, 0.0);
    }

    /// Turns each line by its tilt.
    pub fn turn(&mut self, tilts: &[f64]) {
        self.turned.clear();
        self.turned
            .extend(self.distances.iter().zip(tilts).map(|(distance, tilt)| {
                let (sin, cos) = libm::sincos(0.5 * tilt);
                [2.0 * distance * sin * sin, 2.0 * distance * sin * cos]
            }));
        self.normals.clear();
        self.normals
            .extend(self.along.iter().zip(tilts).map(|(e, &tilt)| {
                let (sin, cos) = libm::sincos(tilt);
                let turned = Vec2::new(e.x * cos - e.y * sin, e.x * sin + e.y * cos);
                // A unit vector to the last bit that it can be: angles are told from it.
                unit_and_length(turned).0
            }));
        self.directions.clear();
        let directions = self.normals.iter().map(|n| Direction::of(*n));
        self.directions.extend(directions);
        let sides = core::mem::take(&mut self.sides);
        wide(
            #[inline(always)]
            || self.fill_blocks(&sides),
        );
        self.sides = sides;
    }

    /// `Â` and `G` of all droplets: each pair of sides once, since the first is even and the second odd.
    #[inline(always)]
    fn fill_blocks(&mut self, sides: &[Side]) {
        let mut seen: Vec<Direction> = Vec::new();
        for p in 0..self.droplets() {
            seen.clear();
            let of_droplet = &sides[self.first[p] as usize..self.first[p + 1] as usize];
            seen.extend(of_droplet.iter().map(|side| self.direction(*side)));
            let (count, block) = (seen.len(), self.blocks[p] as usize);
            for (k, a) in seen.iter().enumerate() {
                self.kernel[block + k * (count + 1)] = 0.75 / PI;
                self.slopes[block + k * (count + 1)] = 0.0;
                for (l, b) in seen.iter().enumerate().take(k) {
                    let (kernel, slope) = between(*a, *b);
                    let (here, there) = (block + k * count + l, block + l * count + k);
                    self.kernel[here] = kernel;
                    self.kernel[there] = kernel;
                    self.slopes[here] = slope;
                    self.slopes[there] = -slope;
                }
            }
        }
    }

    pub fn len(&self) -> usize {
        self.pairs.len()
    }

    pub fn droplets(&self) -> usize {
        self.blocks.len()
    }

    pub fn pairs(&self) -> &[[u32; 2]] {
        &self.pairs
    }

    pub fn distances(&self) -> &[f64] {
        &self.distances
    }

    /// `n`, outward from the first droplet of each pair.
    pub fn normals(&self) -> &[Vec2] {
        &self.normals
    }

    /// `Δx` of a line, from its first droplet to its second (length).
    pub fn between(&self, line: usize) -> Vec2 {
        self.along[line] * self.distances[line]
    }

    /// `R_i + R_j − n·Δx` of a line (length).
    pub fn depth(&self, line: usize) -> f64 {
        self.overlaps[line] + self.turned[line][0]
    }

    /// `n·Δx` of a line (length).
    pub fn along(&self, line: usize) -> f64 {
        self.distances[line] - self.turned[line][0]
    }

    /// `|Δx| sin τ` of a line (length).
    pub fn across(&self, line: usize) -> f64 {
        self.turned[line][1]
    }

    /// The outward direction of a side.
    pub fn direction(&self, side: Side) -> Direction {
        let direction = self.directions[side.line as usize];
        if side.is_second {
            direction.opposite()
        } else {
            direction
        }
    }

    /// The sides of droplet `p`.
    pub fn sides(&self, p: usize) -> &[Side] {
        &self.sides[self.first[p] as usize..self.first[p + 1] as usize]
    }

    /// The number of the first side of droplet `p`.
    pub fn first_side(&self, p: usize) -> usize {
        self.first[p] as usize
    }

    /// The sides that a line is of its two droplets.
    pub fn sides_of(&self, line: usize) -> [usize; 2] {
        self.sides_of[line].map(|side| side as usize)
    }

    /// `Â` and `G` between side `k` of droplet `p`, counted from its first, and each of its sides.
    pub fn rows(&self, p: usize, k: usize) -> (&[f64], &[f64]) {
        let count = self.sides(p).len();
        let row = self.blocks[p] as usize + k * count;
        (
            &self.kernel[row..row + count],
            &self.slopes[row..row + count],
        )
    }
}
