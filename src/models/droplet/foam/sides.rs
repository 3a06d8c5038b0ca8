//! Which lines each droplet has, and where what belongs to them is kept.
//!
//! A line is a *side* of each of its two droplets. Sides of a droplet are numbered in the order of the pairs, and stand in groups of [`LANES`]:
//! nearly every droplet has one group, so a loop over its sides is a loop over vectors of one length. Columns by sides are columns of such
//! groups. A matrix between the sides of a droplet is kept by rows, each of as many groups as the droplet has.
//!
//! - Droplets with equally many sides stand together: then the ends of loops over sides are foreseen.
//! - The sides of a droplet stand first in its groups; places behind them are empty.
//! - The number of a side is its place among all, empty ones counted.
//! - In a column, empty places hold zeros wherever they are summed or multiplied.

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

/// Where the sides of a droplet stand.
#[derive(Clone, Copy, Debug)]
pub(super) struct Place {
    droplet: u32,
    group: u32,
    width: u32,
    row: u32,
    count: u32,
}

impl Place {
    #[inline(always)]
    pub fn droplet(self) -> usize {
        self.droplet as usize
    }

    /// Its groups.
    #[inline(always)]
    pub fn groups(self) -> Range<usize> {
        self.group as usize..(self.group + self.width) as usize
    }

    /// How many groups it has, and so each row of its block.
    #[inline(always)]
    pub fn width(self) -> usize {
        self.width as usize
    }

    /// The groups of its block.
    #[inline(always)]
    pub fn rows(self) -> Range<usize> {
        self.row as usize..(self.row + self.count * self.width) as usize
    }

    /// How many sides it has.
    #[inline(always)]
    pub fn count(self) -> usize {
        self.count as usize
    }
}

/// See the [module](self).
#[derive(Clone, Debug, Default)]
pub(super) struct Sides {
    places: Vec<Place>,
    /// The number of each droplet's place.
    of_droplets: Vec<u32>,
    list: Vec<Side>,
    /// The side that a line is of its first and its second droplet.
    of_lines: Vec<[u32; 2]>,
    /// The groups of all blocks.
    rows: usize,
}

impl Sides {
    /// Numbers the sides of droplets that these pairs have lines between.
    pub fn number(&mut self, droplets: usize, pairs: &[[u32; 2]]) {
        self.places.clear();
        self.places
            .extend((0..droplets as u32).map(|droplet| Place {
                droplet,
                group: 0,
                width: 0,
                row: 0,
                count: 0,
            }));
        for p in pairs.as_flattened() {
            self.places[*p as usize].count += 1;
        }
        self.places.sort_by_key(|place| place.count);
        self.of_droplets.resize(droplets, 0);
        let (mut group, mut row) = (0, 0);
        for (number, place) in (0..).zip(&mut self.places) {
            self.of_droplets[place.droplet()] = number;
            // A group for those without sides, too: no loop has to ask.
            let width = place.count.div_ceil(LANES as u32).max(1);
            (place.group, place.width, place.row) = (group, width, row);
            group += width;
            row += width * place.count;
            place.count = 0;
        }
        self.rows = row as usize;
        let none = Side {
            line: u32::MAX,
            is_second: false,
        };
        self.list.clear();
        self.list.resize(LANES * group as usize, none);
        self.of_lines.clear();
        for (line, &[i, j]) in (0..).zip(pairs) {
            self.of_lines
                .push([(i, false), (j, true)].map(|(p, is_second)| {
                    let place = &mut self.places[self.of_droplets[p as usize] as usize];
                    let side = LANES as u32 * place.group + place.count;
                    place.count += 1;
                    self.list[side as usize] = Side { line, is_second };
                    side
                }));
        }
    }

    /// Where the sides of droplet `p` stand.
    #[inline(always)]
    pub fn place(&self, p: usize) -> Place {
        self.places[self.of_droplets[p] as usize]
    }

    /// Where the sides of the droplets stand, in their order: those with few sides first.
    #[inline(always)]
    pub fn places(&self) -> &[Place] {
        &self.places
    }

    /// The groups of all droplets.
    #[inline(always)]
    pub fn groups(&self) -> usize {
        self.list.len() / LANES
    }

    /// The groups of all blocks.
    #[inline(always)]
    pub fn rows(&self) -> usize {
        self.rows
    }

    /// The sides of a droplet.
    #[inline(always)]
    pub fn of(&self, place: Place) -> &[Side] {
        let first = LANES * place.group as usize;
        &self.list[first..first + place.count()]
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

/// Does something for a number of groups. There are two copies, since nearly all droplets have one group: the compiler knows it in one of them.
#[inline(always)]
pub(super) fn with_width<R>(width: usize, mut what: impl FnMut(usize) -> R) -> R {
    if width == 1 { what(1) } else { what(width) }
}

/// `Σ_l x_l row_l`, of group `g` of the rows of a block that are `width` groups each.
#[inline(always)]
pub(super) fn combine<F: Number>(
    rows: &[Lanes<F>],
    (g, width): (usize, usize),
    x: impl Iterator<Item = F>,
) -> Lanes<F> {
    let mut sum = [F::default(); LANES];
    for (row, x) in rows[g..].chunks(width).zip(x) {
        for k in 0..LANES {
            sum[k] += row[0][k] * x;
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

/// The products of the numbers of two groups.
#[inline(always)]
pub(super) fn product(a: &Lanes, b: &Lanes) -> Lanes {
    let mut product = *a;
    for (product, b) in product.iter_mut().zip(b) {
        *product *= b;
    }
    product
}
