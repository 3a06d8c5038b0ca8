//! The lines along which droplets may press on each other, and what each droplet's lines have to do with each other.
//!
//! Every pair of droplets that are near enough has a line: the vector `Δx = x_j − x_i` to the nearest image, turned by the tilt `τ` of the
//! pair, gives the unit normal `n` of their contact, outward from `i`. Of each droplet the kernel between its [sides](Sides) is kept,
//!
//! ```text
//! Â_kl = −g(θ_k − θ_l)/2π,   Â_kk = 3/4π,        G_kl = g'(θ_k − θ_l)/2π,   G_kk = 0
//! ```
//!
//! which is the matrix of Morse and Witten for a droplet of radius 1, and its slope.
//!
//! Invariants: `pairs` ascend; columns by lines are as long as they are. What stands at empty places beside the sides of a droplet is finite.

use super::sides::{LANES, Lanes, Place, Side, Sides, with_width};
use super::tilts::half_turn;
use crate::domain::Vec2;
use crate::models::droplet::kernel::{Angles, Direction};
use crate::numerics::wide::wide;
use crate::state::Packing;
use core::f64::consts::PI;

/// A line is kept for droplets whose centres are no farther apart than this (sums of their radii). Contacts reach 1.15 in balance at φ = 0.995, and
/// 1.225 on the way from disks at 0.99.
pub(super) const REACH: f64 = 1.3;

/// See the [module](self).
#[derive(Clone, Debug, Default)]
pub(super) struct Lines {
    pairs: Vec<[u32; 2]>,
    /// `Δx/|Δx|`, its components, and `|Δx|` (length).
    along: [Vec<f64>; 2],
    distances: Vec<f64>,
    /// `δ = R_i + R_j − |Δx|` (length).
    overlaps: Vec<f64>,
    /// `|Δx| − n·Δx = 2|Δx| sin²(τ/2)`, and `|Δx| sin τ` (length).
    shorter: Vec<f64>,
    across: Vec<f64>,
    /// `n`, outward from the first droplet, its components, and its angle (radians).
    normals: Vec<Vec2>,
    turned: [Vec<f64>; 2],
    angles: Vec<f64>,
    sides: Sides,
    /// The outward directions by sides: components and angle.
    outward: [Vec<Lanes>; 3],
    kernel: Vec<Lanes>,
    slopes: Vec<Lanes>,
    /// Room for pairs and the sums of their radii, for the making of angles, and for a column.
    next: Vec<[u32; 2]>,
    sums: Vec<f64>,
    nodes: Vec<[f64; 2]>,
    known: Vec<f64>,
}

impl Lines {
    /// The lines of `packing` among `near`, which holds all pairs that are near enough and ascends. What is `known` of a pair stays with it; of
    /// another nothing is known, 0.
    pub fn set(&mut self, packing: &Packing, near: &[[u32; 2]], known: [&mut Vec<f64>; 2]) {
        let count = wide(
            #[inline(always)]
            || self.find(packing, near),
        );
        self.next.truncate(count);
        if self.next != self.pairs || self.droplets() != packing.len() {
            core::mem::swap(&mut self.pairs, &mut self.next);
            for column in known {
                carry((&self.next, &self.pairs), column, &mut self.known);
            }
            self.sides.number(packing.len(), &self.pairs);
        }
        for column in
            self.along
                .iter_mut()
                .chain([&mut self.sums, &mut self.distances, &mut self.overlaps])
        {
            column.resize(count, 0.0);
        }
        let [x, y] = &mut self.along;
        wide(
            #[inline(always)]
            || {
                lengths((x, y), &mut self.distances);
                unit(x, &self.distances, 1.0);
                unit(y, &self.distances, 0.0);
                less(&self.sums, &self.distances, &mut self.overlaps);
            },
        );
    }

    /// Which pairs are near enough, with `Δx` and the sums of their radii; how many there are.
    #[inline(always)]
    fn find(&mut self, packing: &Packing, near: &[[u32; 2]]) -> usize {
        let (radii, positions) = (packing.radii(), packing.positions());
        let [x, y] = &mut self.along;
        for column in [&mut *x, &mut *y, &mut self.sums] {
            column.resize(near.len(), 0.0);
        }
        self.next.resize(near.len(), [0; 2]);
        let (x, y) = (&mut x[..near.len()], &mut y[..near.len()]);
        let (sums, next) = (&mut self.sums[..near.len()], &mut self.next[..near.len()]);
        for (c, [i, j]) in near.iter().map(|pair| pair.map(|p| p as usize)).enumerate() {
            let between = positions[j] - positions[i];
            (x[c], y[c], sums[c]) = (between.x, between.y, radii[i] + radii[j]);
        }
        packing.domain().fold_columns(x, y);
        // Without a branch: nobody could guess who is near.
        let mut count = 0;
        for (c, pair) in near.iter().enumerate() {
            let (dx, dy, sum) = (x[c], y[c], sums[c]);
            (x[count], y[count], sums[count], next[count]) = (dx, dy, sum, *pair);
            let reach = REACH * sum;
            count += usize::from(dx * dx + dy * dy < reach * reach);
        }
        count
    }

    /// Turns each line by its tilt.
    pub fn turn(&mut self, tilts: &[f64]) {
        let count = self.len();
        for column in
            self.turned
                .iter_mut()
                .chain([&mut self.shorter, &mut self.across, &mut self.angles])
        {
            column.resize(count, 0.0);
        }
        for block in [&mut self.kernel, &mut self.slopes] {
            block.resize(self.sides.rows(), [0.0; LANES]);
        }
        self.normals.resize(count, Vec2::zeros());
        wide(
            #[inline(always)]
            || {
                let [x, y] = &mut self.turned;
                lean(&self.distances, tilts, &mut self.shorter, &mut self.across);
                rotate(&self.along, tilts, x, y);
                Angles::new().of_columns((x, y), &mut self.nodes, &mut self.angles);
                for ((n, x), y) in self.normals.iter_mut().zip(&*x).zip(&*y) {
                    *n = Vec2::new(*x, *y);
                }
                let [cos, sin, angle] = &mut self.outward;
                self.sides.scatter(cos, x.iter().map(|x| [*x, -x]));
                self.sides.scatter(sin, y.iter().map(|y| [*y, -y]));
                let angles = self.angles.iter();
                self.sides
                    .scatter(angle, angles.map(|a| [*a, opposite(*a)]));
                let blocks = (&mut self.kernel[..], &mut self.slopes[..]);
                fill_blocks(self.sides.places(), [cos, sin, angle], blocks);
            },
        );
    }

    pub fn len(&self) -> usize {
        self.pairs.len()
    }

    pub fn droplets(&self) -> usize {
        self.sides.places().len()
    }

    #[inline(always)]
    pub fn pairs(&self) -> &[[u32; 2]] {
        &self.pairs
    }

    #[inline(always)]
    pub fn distances(&self) -> &[f64] {
        &self.distances
    }

    /// `n`, outward from the first droplet of each pair.
    pub fn normals(&self) -> &[Vec2] {
        &self.normals
    }

    /// The components of the outward normals by sides.
    #[inline(always)]
    pub fn outward(&self) -> [&[Lanes]; 2] {
        [&self.outward[0], &self.outward[1]]
    }

    /// `Δx` of a line, from its first droplet to its second (length).
    pub fn between(&self, line: usize) -> Vec2 {
        let [x, y] = self.along.each_ref().map(|x| x[line]);
        Vec2::new(x, y) * self.distances[line]
    }

    /// `R_i + R_j − |Δx|` of each line (length).
    #[inline(always)]
    pub fn overlaps(&self) -> &[f64] {
        &self.overlaps
    }

    /// `|Δx| − n·Δx` of each line (length).
    #[inline(always)]
    pub fn shorter(&self) -> &[f64] {
        &self.shorter
    }

    /// `|Δx| sin τ` of each line (length).
    #[inline(always)]
    pub fn across(&self) -> &[f64] {
        &self.across
    }

    /// The outward direction of a side.
    pub fn direction(&self, side: Side) -> Direction {
        let line = side.line as usize;
        let [cos, sin] = self.turned.each_ref().map(|x| x[line]);
        let angle = self.angles[line];
        let direction = Direction { cos, sin, angle };
        if side.is_second {
            direction.opposite()
        } else {
            direction
        }
    }

    /// The sides of droplet `p`.
    #[inline(always)]
    pub fn sides(&self, p: usize) -> &[Side] {
        self.sides.of(self.place(p))
    }

    /// Where the sides of droplet `p` stand.
    #[inline(always)]
    pub fn place(&self, p: usize) -> Place {
        self.sides.place(p)
    }

    /// Where sides stand.
    #[inline(always)]
    pub fn layout(&self) -> &Sides {
        &self.sides
    }

    /// The number of the first side of droplet `p`.
    #[cfg_attr(
        not(test),
        expect(dead_code, reason = "for derivatives by tilts and positions")
    )]
    pub fn first_side(&self, p: usize) -> usize {
        LANES * self.place(p).groups().start
    }

    /// The sides that a line is of its two droplets.
    #[inline(always)]
    pub fn sides_of(&self, line: usize) -> [usize; 2] {
        self.sides.of_lines()[line].map(|side| side as usize)
    }

    /// `Â` of all droplets, block by block.
    #[inline(always)]
    pub fn kernel(&self) -> &[Lanes] {
        &self.kernel
    }

    /// `G` of all droplets, block by block.
    #[inline(always)]
    pub fn slopes(&self) -> &[Lanes] {
        &self.slopes
    }

    /// `Â` and `G` between side `k` of droplet `p`, counted from its first, and each of its sides.
    pub fn rows(&self, p: usize, k: usize) -> (&[f64], &[f64]) {
        let place = self.place(p);
        let first = place.rows().start + k * place.width();
        let [kernel, slopes] = [&self.kernel, &self.slopes]
            .map(|block| &block[first..first + place.width()].as_flattened()[..place.count()]);
        (kernel, slopes)
    }
}

/// `Â` and `G` of all droplets, row by row, from the outward directions.
#[inline(always)]
fn fill_blocks(
    places: &[Place],
    [cos, sin, angle]: [&[Lanes]; 3],
    (kernel, slopes): (&mut [Lanes], &mut [Lanes]),
) {
    for place in places {
        let (kernel, slopes) = (&mut kernel[place.rows()], &mut slopes[place.rows()]);
        let [cos, sin, angle] = [cos, sin, angle].map(|column| &column[place.groups()]);
        with_width(
            place.width(),
            #[inline(always)]
            |width| {
                let rows = kernel.chunks_exact_mut(width);
                let rows = rows.zip(slopes.chunks_exact_mut(width)).enumerate();
                for (k, (kernel, slopes)) in rows {
                    let seen = [cos, sin, angle].map(|column| column.as_flattened()[k]);
                    for g in 0..width {
                        (kernel[g], slopes[g]) = row([&cos[g], &sin[g], &angle[g]], seen);
                    }
                    kernel.as_flattened_mut()[k] = 0.75 / PI;
                    slopes.as_flattened_mut()[k] = 0.0;
                }
            },
        );
    }
}

/// `Â_kl` and `G_kl` of a group of sides `l` and one side `k`, by cosine, sine and angle.
#[inline(always)]
fn row([cos, sin, angle]: [&Lanes; 3], [c, s, a]: [f64; 3]) -> (Lanes, Lanes) {
    const PER_TURN: f64 = 1.0 / (2.0 * PI);
    let (c, s) = (0.5 * PER_TURN * c, 0.5 * PER_TURN * s);
    let (mut kernel, mut slopes) = ([0.0; LANES], [0.0; LANES]);
    for l in 0..LANES {
        let difference = a - angle[l]; // in [−2π, 2π]
        // Half of sine and cosine of it, per turn; and 2 sign(θ) (π − |θ|).
        let half_sin = s * cos[l] - c * sin[l];
        let half_cos = c * cos[l] + s * sin[l];
        let twice = 2.0 * (PI.copysign(difference) - difference);
        kernel[l] = (PER_TURN - twice * half_sin) + half_cos;
        slopes[l] = twice * half_cos - half_sin;
    }
    (kernel, slopes)
}

/// The angle of the opposite direction (radians).
#[inline(always)]
fn opposite(angle: f64) -> f64 {
    let (cos, sin) = (0.0, 0.0);
    Direction { cos, sin, angle }.opposite().angle
}

/// What is known of pairs that were there before, in the order of the pairs that there are; both ascend.
fn carry((before, pairs): (&[[u32; 2]], &[[u32; 2]]), column: &mut Vec<f64>, room: &mut Vec<f64>) {
    core::mem::swap(column, room);
    column.clear();
    let mut next = 0;
    for pair in pairs {
        while before.get(next).is_some_and(|old| old < pair) {
            next += 1;
        }
        let same = before.get(next) == Some(pair);
        column.push(if same { room[next] } else { 0.0 });
    }
}

// One simple loop for each column that is made: then several lines are done at once.

#[inline(always)]
fn lengths((x, y): (&[f64], &[f64]), lengths: &mut [f64]) {
    for ((length, x), y) in lengths.iter_mut().zip(x).zip(y) {
        *length = (x * x + y * y).sqrt();
    }
}

/// `x/length`, and `otherwise` where there is no length.
#[inline(always)]
fn unit(x: &mut [f64], lengths: &[f64], otherwise: f64) {
    for (x, length) in x.iter_mut().zip(lengths) {
        let unit = *x * (1.0 / length);
        *x = if *length > 0.0 { unit } else { otherwise };
    }
}

#[inline(always)]
fn less(a: &[f64], b: &[f64], difference: &mut [f64]) {
    for ((d, a), b) in difference.iter_mut().zip(a).zip(b) {
        *d = a - b;
    }
}

/// `2|Δx| sin²(τ/2)` and `|Δx| sin τ`.
#[inline(always)]
fn lean(distances: &[f64], tilts: &[f64], shorter: &mut [f64], across: &mut [f64]) {
    let lines = distances.iter().zip(tilts);
    for ((distance, tilt), (shorter, across)) in lines.zip(shorter.iter_mut().zip(across)) {
        let (sin, cos) = half_turn(*tilt);
        let twice = 2.0 * distance * sin;
        (*shorter, *across) = (twice * sin, twice * cos);
    }
}

/// The directions `along`, turned by the tilts.
#[inline(always)]
fn rotate([along_x, along_y]: &[Vec<f64>; 2], tilts: &[f64], x: &mut [f64], y: &mut [f64]) {
    let lines = along_x.iter().zip(along_y).zip(tilts);
    for (((e_x, e_y), tilt), (x, y)) in lines.zip(x.iter_mut().zip(y)) {
        let (sin, cos) = half_turn(*tilt);
        let (sin, cos) = (2.0 * sin * cos, 1.0 - 2.0 * (sin * sin));
        let (turned_x, turned_y) = (e_x * cos - e_y * sin, e_x * sin + e_y * cos);
        // A unit vector to the last bit that it can be: angles are told from it.
        let one = 1.5 - 0.5 * (turned_x * turned_x + turned_y * turned_y);
        (*x, *y) = (one * turned_x, one * turned_y);
    }
}

#[cfg(test)]
mod tests {
    use super::super::state::{Films, State};
    use super::*;
    use crate::domain::Domain;
    use crate::models::droplet::kernel::{dg, g};

    #[test]
    fn droplets_with_many_sides_have_the_kernel_between_all_of_them() {
        for count in [1, 7, 8, 9, 20] {
            let at = |k: usize| 2.0 * PI * k as f64 / count as f64 - 3.0;
            let centre = Vec2::new(10.0, 10.0);
            let mut positions = vec![centre];
            positions.extend((0..count).map(|k| {
                let (sin, cos) = libm::sincos(at(k));
                centre + 3.4 * Vec2::new(cos, sin)
            }));
            let mut radii = vec![0.4; count + 1];
            radii[0] = 3.0;
            let packing = Packing::new(Domain::new(20.0, 20.0).unwrap(), radii, positions).unwrap();
            let near: Vec<[u32; 2]> = (1..=count as u32).map(|k| [0, k]).collect();
            let (mut lines, mut state) = (Lines::default(), State::default());
            lines.set(&packing, &near, [&mut Vec::new(), &mut Vec::new()]);
            lines.turn(&vec![0.0; count]);
            let forces: Vec<f64> = (0..count).map(|k| 0.01 * (1 + k % 3) as f64).collect();
            let given = (&lines, packing.radii());
            assert!(state.evaluate(given, (&forces, 1.0), Films::Straight, 1e-14));
            state.find_midpoints(&lines);
            for k in 0..count {
                let (kernel, slopes) = lines.rows(0, k);
                assert_eq!((kernel.len(), slopes.len()), (count, count));
                let (mut of_kernel, mut of_slopes) = (0.0, 0.0);
                for l in 0..count {
                    let angle = at(k) - at(l);
                    // The slope is odd.
                    let slope = dg(angle.abs()) / (2.0 * PI);
                    let slope = if k > l { slope } else { -slope };
                    let slope = if k == l { 0.0 } else { slope };
                    assert!((kernel[l] + g(angle) / (2.0 * PI)).abs() < 1e-14);
                    assert!((slopes[l] - slope).abs() < 1e-14);
                    of_kernel -= forces[l] * g(angle) / (2.0 * PI);
                    of_slopes += forces[l] * slope;
                }
                let side = state.side(lines.first_side(0) + k);
                assert!((side.k - of_kernel).abs() < 1e-14 && (side.m - of_slopes).abs() < 1e-14);
            }
        }
    }
}
