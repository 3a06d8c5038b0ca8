//! Candidate pairs: a Verlet list that is rebuilt from a cell list.
//!
//! The list only saves work. Which pairs are looked at is decided afresh in every step by an exact comparison of
//! distances, and the pairs come in ascending order, so neither the age nor the reach of the list can reach a result:
//! a replay that starts with a fresh list walks the same bits.

use crate::domain::{Domain, Vec2, nearest};
use crate::packing::Packing;
use crate::wide::wide;

/// All pairs `i < j` whose undeformed surfaces were closer than `reach` when the list was built, ascending.
///
/// # Example
///
/// ```
/// use softjam::domain::{Domain, Vec2};
/// use softjam::neighbors::NeighborList;
/// use softjam::packing::Packing;
///
/// let at = |x| Vec2::new(x, 1.0);
/// let packing = Packing::new(Domain::new(9.0, 9.0).unwrap(), vec![0.5; 3], vec![at(0.1), at(1.3), at(8.9)]).unwrap();
/// let mut list = NeighborList::new();
/// // Surfaces up to 0.25 apart matter; 0.1 more is kept as a skin, to be spent on motion.
/// list.update(&packing, 0.25, 0.1);
/// assert_eq!(list.pairs(), [[0, 1], [0, 2]]);
/// ```
#[derive(Clone, Debug, Default)]
pub struct NeighborList {
    pairs: Vec<[u32; 2]>,
    /// The packing that the list was built for.
    reference: Option<Packing>,
    reach: f64,
    /// The largest displacement since the build is at most this; nothing is known of it if it is infinite.
    displaced: f64,
    builds: u64,
    cells: CellList,
}

impl NeighborList {
    /// An empty list, to be filled by the first [`update`](Self::update).
    ///
    /// ```
    /// assert!(softjam::neighbors::NeighborList::new().pairs().is_empty());
    /// ```
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// The pairs `[i, j]`, `i < j`, ascending. Shape: one entry a pair.
    ///
    /// ```
    /// assert_eq!(softjam::neighbors::NeighborList::new().pairs().len(), 0);
    /// ```
    #[must_use]
    pub fn pairs(&self) -> &[[u32; 2]] {
        &self.pairs
    }

    /// How often the list was built: a count of work, for benches and tests.
    ///
    /// ```
    /// assert_eq!(softjam::neighbors::NeighborList::new().builds(), 0);
    /// ```
    #[must_use]
    pub fn builds(&self) -> u64 {
        self.builds
    }

    /// Makes sure that every pair with `r_ij < R_i + R_j + margin` is listed; says whether the list was rebuilt.
    ///
    /// A list of reach `margin + skin` serves until some particle has moved so far that a pair outside it could have
    /// come within the margin: while `margin + 2 d_max ≤ reach`, `d_max` the largest displacement since the build.
    /// Both lengths are in units of length and not negative.
    ///
    /// ```
    /// # use softjam::{domain::{Domain, Vec2}, packing::Packing, neighbors::NeighborList};
    /// # let packing = Packing::new(Domain::new(4.0, 4.0).unwrap(), vec![0.5], vec![Vec2::zeros()]).unwrap();
    /// let mut list = NeighborList::new();
    /// assert!(list.update(&packing, 0.0, 0.3));
    /// assert!(!list.update(&packing, 0.2, 0.3), "the skin covers a larger margin");
    /// assert!(list.update(&packing, 0.4, 0.3));
    /// ```
    pub fn update(&mut self, packing: &Packing, margin: f64, skin: f64) -> bool {
        self.update_after(packing, margin, skin, f64::INFINITY)
    }

    /// [`update`](Self::update) for particles of which none has moved by more than `moved` (length) since the last one:
    /// positions are looked at only when the sum of such moves could have spent the skin.
    pub(crate) fn update_after(
        &mut self,
        packing: &Packing,
        margin: f64,
        skin: f64,
        moved: f64,
    ) -> bool {
        // Something for the rounding of sums of moves and of positions.
        self.displaced += (1.0 + 1e-9) * moved + 1e-12;
        if margin + 2.0 * self.displaced <= self.reach || self.covers(packing, margin) {
            return false;
        }
        self.displaced = 0.0;
        self.reach = margin + skin;
        match &mut self.reference {
            Some(reference) => reference.clone_from(packing),
            none => *none = Some(packing.clone()),
        }
        self.cells
            .pairs_within(packing, self.reach, &mut self.pairs);
        self.builds += 1;
        true
    }

    fn covers(&mut self, packing: &Packing, margin: f64) -> bool {
        let domain = packing.domain();
        let Some(reference) = &self.reference else {
            return false;
        };
        if !reference.same_particles(packing) || margin > self.reach {
            return false;
        }
        let spare = 0.5 * (self.reach - margin);
        let moved = |(p, q): (&Vec2, &Vec2)| domain.minimum_image(p - q).norm_squared();
        // In pieces, each without a branch. A NaN is farther than anything.
        let pieces = packing.positions().chunks(64);
        let mut farthest: f64 = 0.0;
        let covered = pieces.zip(reference.positions().chunks(64)).all(|(p, q)| {
            let (mut near, mut most) = (true, 0.0);
            for squared in p.iter().zip(q).map(moved) {
                near &= squared <= spare * spare;
                most = if squared > most { squared } else { most };
            }
            farthest = farthest.max(most);
            near
        });
        self.displaced = farthest.sqrt();
        covered
    }
}

/// Particles sorted into cells at least as wide as the longest distance asked for: O(N) to fill and to search.
#[derive(Clone, Debug, Default)]
struct CellList {
    /// The particles of cell c are `seats[first[c]..first[c + 1]]`.
    first: Vec<u32>,
    seats: Vec<Seat>,
    cell_of: Vec<u32>,
    near: Vec<u32>,
}

/// A particle in a cell, with what its distances take.
#[derive(Clone, Copy, Debug, Default)]
struct Seat {
    at: Vec2,
    radius: f64,
    particle: u32,
}

impl CellList {
    fn pairs_within(&mut self, packing: &Packing, reach: f64, pairs: &mut Vec<[u32; 2]>) {
        pairs.clear();
        let longest = 2.0 * packing.largest_radius() + reach;
        let Some(grid) = Grid::new(packing.domain(), longest, packing.len()) else {
            // Fewer than three cells along a side: every pair is a neighbour pair of cells anyway.
            let n = packing.len() as u32;
            let near = |i: u32, j: u32| {
                let (i, j) = (i as usize, j as usize);
                let sum = packing.radii()[i] + packing.radii()[j] + reach;
                packing.separation(i, j).norm_squared() < sum * sum
            };
            for i in 0..n {
                pairs.extend((i + 1..n).filter(|&j| near(i, j)).map(|j| [i, j]));
            }
            return;
        };
        self.fill(packing, grid);
        wide(
            #[inline(always)]
            || self.search(packing, reach, grid, pairs),
        );
    }

    #[inline(always)]
    fn search(&mut self, packing: &Packing, reach: f64, grid: Grid, pairs: &mut Vec<[u32; 2]>) {
        let sides = packing.domain().lengths();
        let particles = packing.positions().iter().zip(packing.radii());
        for ((i, &cell), (at, radius)) in (0..).zip(&self.cell_of).zip(particles) {
            let mut found = 0;
            for (from, to) in grid.around(cell) {
                let seats = &self.seats[self.first[from] as usize..self.first[to] as usize];
                if self.near.len() < found + seats.len() {
                    self.near.resize(found + seats.len(), 0);
                }
                // Without a branch: nobody could guess who is near.
                for seat in seats {
                    let x = nearest(at.x - seat.at.x, sides.x);
                    let y = nearest(at.y - seat.at.y, sides.y);
                    let sum = radius + seat.radius + reach;
                    self.near[found] = seat.particle;
                    found += usize::from((seat.particle > i) & (x * x + y * y < sum * sum));
                }
            }
            let near = &mut self.near[..found];
            near.sort_unstable();
            pairs.extend(near.iter().map(|&j| [i, j]));
        }
    }

    /// Counting sort of the particles by cell.
    fn fill(&mut self, packing: &Packing, grid: Grid) {
        let positions = packing.positions();
        self.first.clear();
        self.first.resize(grid.columns * grid.rows + 1, 0);
        self.cell_of.clear();
        self.cell_of.extend(positions.iter().map(|&p| grid.cell(p)));
        // Where each cell ends; filling from the end turns that into where it begins.
        for &c in &self.cell_of {
            self.first[c as usize] += 1;
        }
        for c in 1..self.first.len() {
            self.first[c] += self.first[c - 1];
        }
        self.seats.clear();
        self.seats.resize(positions.len(), Seat::default());
        for (i, &c) in self.cell_of.iter().enumerate().rev() {
            let slot = &mut self.first[c as usize];
            *slot -= 1;
            self.seats[*slot as usize] = Seat {
                at: positions[i],
                radius: packing.radii()[i],
                particle: i as u32,
            };
        }
    }
}

#[derive(Clone, Copy, Debug)]
struct Grid {
    columns: usize,
    rows: usize,
    per_length: Vec2,
}

impl Grid {
    /// A grid of cells no narrower than `width`, at most about one a particle; `None` below three a side.
    fn new(domain: Domain, width: f64, particles: usize) -> Option<Self> {
        let most = libm::ceil((particles as f64).sqrt()).max(3.0);
        let count = |length: f64| libm::floor(length / width).min(most);
        let (columns, rows) = (count(domain.lengths().x), count(domain.lengths().y));
        (columns >= 3.0 && rows >= 3.0).then(|| Self {
            columns: columns as usize,
            rows: rows as usize,
            per_length: Vec2::new(columns, rows).component_div(&domain.lengths()),
        })
    }

    fn cell(&self, p: Vec2) -> u32 {
        let at = p.component_mul(&self.per_length);
        // A product may round up to the number of cells.
        let column = (at.x as usize).min(self.columns - 1);
        let row = (at.y as usize).min(self.rows - 1);
        (row * self.columns + column) as u32
    }

    /// The nine cells around one, itself included, as stretches of cells in a row: three, and three across the edge.
    #[inline(always)]
    fn around(&self, cell: u32) -> [(usize, usize); 6] {
        let columns = self.columns as u32;
        let (column, row) = ((cell % columns) as usize, (cell / columns) as usize);
        let end = self.columns;
        let [here, across] = if column == 0 {
            [(0, 2), (end - 1, end)]
        } else if column + 1 == end {
            [(end - 2, end), (0, 1)]
        } else {
            [(column - 1, column + 2), (0, 0)]
        };
        let below = if row == 0 { self.rows } else { row } - 1;
        let above = if row + 1 == self.rows { 0 } else { row + 1 };
        let [a, b, c] = [below, row, above].map(|row| row * end);
        [(a, here), (b, here), (c, here), (a, across), (b, across), (c, across)]
            .map(|(row, (from, to))| (row + from, row + to))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn packing(points: &[(f64, f64)], radius: f64, lengths: (f64, f64)) -> Packing {
        Packing::new(
            Domain::new(lengths.0, lengths.1).unwrap(),
            (0..points.len())
                .map(|i| radius * (1.0 + 0.1 * (i % 5) as f64))
                .collect(),
            points
                .iter()
                .map(|&(x, y)| Vec2::new(x * lengths.0, y * lengths.1))
                .collect(),
        )
        .unwrap()
    }

    proptest! {
        #[test]
        fn cells_find_the_pairs_that_a_search_of_all_finds(
            points in prop::collection::vec((0.0..1.0f64, 0.0..1.0f64), 1..120),
            radius in 0.05..0.6f64,
            reach in 0.0..0.5f64,
            aspect in 0.5..2.0f64,
        ) {
            let packing = packing(&points, radius, (8.0 * aspect, 8.0));
            let mut list = NeighborList::new();
            list.update(&packing, reach, 0.0);
            let mut all = Vec::new();
            for i in 0..packing.len() {
                for j in i + 1..packing.len() {
                    let sum = packing.radii()[i] + packing.radii()[j] + reach;
                    if packing.separation(i, j).norm_squared() < sum * sum {
                        all.push([i as u32, j as u32]);
                    }
                }
            }
            prop_assert_eq!(list.pairs(), all);
        }

        #[test]
        fn an_old_list_still_holds_every_pair_within_the_margin(
            points in prop::collection::vec((0.0..1.0f64, 0.0..1.0f64), 2..60),
            shifts in prop::collection::vec((-0.2..0.2f64, -0.2..0.2f64), 60..63),
        ) {
            let before = packing(&points, 0.4, (8.0, 8.0));
            let mut list = NeighborList::new();
            list.update(&before, 0.1, 0.3);
            let moved: Vec<_> = points.iter().zip(&shifts).map(|(p, s)| (p.0 + s.0 / 8.0, p.1 + s.1 / 8.0)).collect();
            let after = packing(&moved, 0.4, (8.0, 8.0));
            let farthest = (0..after.len())
                .map(|i| after.domain().minimum_image(after.positions()[i] - before.positions()[i]).norm())
                .fold(0.0, f64::max);
            // Whether it is told how far the particles have gone or looks for itself, at once or in two parts.
            let told = match shifts.len() % 3 {
                0 => farthest,
                1 => 0.5 * farthest,
                _ => f64::INFINITY,
            };
            if told < farthest {
                list.displaced += farthest - told;
            }
            list.update_after(&after, 0.1, 0.3, told);
            for i in 0..after.len() {
                for j in i + 1..after.len() {
                    let sum = after.radii()[i] + after.radii()[j] + 0.1;
                    if after.separation(i, j).norm() < sum {
                        prop_assert!(list.pairs().binary_search(&[i as u32, j as u32]).is_ok());
                    }
                }
            }
        }
    }
}
