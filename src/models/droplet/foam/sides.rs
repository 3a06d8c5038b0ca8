//! Which lines each droplet has, and where what belongs to them is kept.
//!
//! A line is a *side* of each of its two droplets. Sides of a droplet are numbered in the order of the pairs, and stand in groups of [`LANES`]:
//! nearly every droplet has one group, so a loop over its sides is a loop over vectors of one length. Columns by sides are columns of such
//! groups. A matrix between the sides of a droplet is kept by rows, each of as many groups as the droplet has.
//!
//! - Droplet `p` has the groups `first[p]..first[p + 1]`; its sides stand first in them, places behind are empty.
//! - The number of a side is its place among all, empty ones counted.
//! - In a column, empty places hold zeros wherever they are summed or multiplied.
//! - Block `p` begins at row `blocks[p]`.

use crate::models::droplet::contact::matrix::product::Number;
use core::ops::Range;

/// Sides in a group.
pub(super) const LANES: usize = 8;

/// One number for each side of a group.
pub(super) type Lanes<F = f64> = [F; LANES];

/// A side of a droplet: which line it is, and whether the droplet is the second of its pair.
#[derive(Clone, Copy, Debug)]
pub(super) struct Side {
    pub line: u32,
    pub is_second: bool,
}

/// See the [module](self).
#[derive(Clone, Debug, Default)]
pub(super) struct Sides {
    first: Vec<u32>,
    counts: Vec<u32>,
    sides: Vec<Side>,
    /// The side that a line is of its first and its second droplet.
    of_lines: Vec<[u32; 2]>,
    blocks: Vec<u32>,
}

impl Sides {
    /// Numbers the sides of droplets that these pairs have lines between.
    pub fn number(&mut self, droplets: usize, pairs: &[[u32; 2]]) {
        self.counts.clear();
        self.counts.resize(droplets, 0);
        for p in pairs.as_flattened() {
            self.counts[*p as usize] += 1;
        }
        self.first.clear();
        self.blocks.clear();
        let (mut group, mut row) = (0, 0);
        for count in &self.counts {
            self.first.push(group);
            self.blocks.push(row);
            let width = count.div_ceil(LANES as u32);
            group += width;
            row += width * count;
        }
        self.first.push(group);
        self.blocks.push(row);
        let none = Side {
            line: u32::MAX,
            is_second: false,
        };
        self.sides.clear();
        self.sides.resize(LANES * group as usize, none);
        self.of_lines.clear();
        self.counts.fill(0);
        for (line, &[i, j]) in (0..).zip(pairs) {
            self.of_lines.push([(i, false), (j, true)].map(|(p, is_second)| {
                let count = &mut self.counts[p as usize];
                let side = LANES as u32 * self.first[p as usize] + *count;
                *count += 1;
                self.sides[side as usize] = Side { line, is_second };
                side
            }));
        }
    }

    #[inline(always)]
    pub fn droplets(&self) -> usize {
        self.counts.len()
    }

    /// The groups of all droplets.
    #[inline(always)]
    pub fn groups(&self) -> usize {
        self.sides.len() / LANES
    }

    /// The rows of all blocks, in groups.
    pub fn rows(&self) -> usize {
        self.blocks.last().map_or(0, |rows| *rows as usize)
    }

    /// The sides of droplet `p`.
    #[inline(always)]
    pub fn of(&self, p: usize) -> &[Side] {
        let first = LANES * self.first[p] as usize;
        &self.sides[first..first + self.counts[p] as usize]
    }

    /// The groups of droplet `p`.
    #[inline(always)]
    pub fn groups_of(&self, p: usize) -> Range<usize> {
        self.first[p] as usize..self.first[p + 1] as usize
    }

    /// The rows of droplet `p`'s block, in groups.
    #[inline(always)]
    pub fn rows_of(&self, p: usize) -> Range<usize> {
        self.blocks[p] as usize..self.blocks[p + 1] as usize
    }

    /// The sides that each line is of its two droplets.
    #[inline(always)]
    pub fn of_lines(&self) -> &[[u32; 2]] {
        &self.of_lines
    }

    /// Writes what the lines have, seen from their first and from their second droplets, to their sides, and zeros to empty places.
    #[inline(always)]
    pub fn scatter<F: Copy + Default>(
        &self,
        column: &mut Vec<Lanes<F>>,
        of_lines: impl Iterator<Item = [F; 2]>,
    ) {
        column.clear();
        column.resize(self.groups(), [F::default(); LANES]);
        let column = column.as_flattened_mut();
        for ([a, b], [first, second]) in self.of_lines.iter().zip(of_lines) {
            column[*a as usize] = first;
            column[*b as usize] = second;
        }
    }
}

/// `Σ_l x_l row_l`, of group `g` of the rows of a block that are `width` groups each.
#[inline(always)]
pub(super) fn combine<F: Number>(
    rows: &[Lanes<F>],
    (g, width): (usize, usize),
    x: impl Iterator<Item = F>,
) -> Lanes<F> {
    let mut sum = [F::default(); LANES];
    for (row, x) in rows[g..].iter().step_by(width).zip(x) {
        for k in 0..LANES {
            sum[k] += row[k] * x;
        }
    }
    sum
}

/// The sum of a group's numbers.
#[inline(always)]
pub(super) fn total(x: Lanes) -> f64 {
    let four: [f64; 4] = core::array::from_fn(|k| x[k] + x[k + 4]);
    (four[0] + four[2]) + (four[1] + four[3])
}
