//! Candidate pairs: a Verlet list that is rebuilt from a cell list.
//!
//! The list only saves work. Which pairs are looked at is decided afresh in every step by an exact comparison of
//! distances, and the pairs come in ascending order, so neither the age nor the reach of the list can reach a result:
//! a replay that starts with a fresh list walks the same bits.
//!
//! See the example of [`NeighborList`].

pub(crate) mod crowding;
pub(crate) mod octaves;

use crate::domain::{Domain, Vec2};

use crate::numerics::wide::wide;
use crate::state::Packing;

/// All pairs `i < j` whose undeformed surfaces were closer than `reach` when the list was built, ascending.
///
/// # Example
///
/// ```
/// use softjam::domain::{Domain, Vec2};
/// use softjam::neighbors::NeighborList;
/// use softjam::state::Packing;
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
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// The pairs `[i, j]`, `i < j`, ascending. Shape: one entry a pair.
    #[must_use]
    pub fn pairs(&self) -> &[[u32; 2]] {
        &self.pairs
    }

    /// Whether the list was built for the particles and the box of `packing`, wherever they were.
    pub(crate) fn is_of(&self, packing: &Packing) -> bool {
        let reference = self.reference.as_ref();
        reference.is_some_and(|reference| reference.same_particles(packing))
    }

    /// How often the list was built: a count of work, for benches and tests.
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
    /// # use softjam::{domain::{Domain, Vec2}, state::Packing, neighbors::NeighborList};
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
    /// The particles in their own order, and in that of their cells.
    particles: Vec<Seat>,
    seats: Vec<Seat>,
    /// Cell c has `seats[first[c]..first[c + 1]]`.
    first: Vec<u32>,
    /// Pairs in the order in which the cells give them, and in that of their second particles.
    found: Vec<[u32; 2]>,
    by_second: Vec<[u32; 2]>,
    slots: Vec<u32>,
}

/// A particle in a cell, with what its distances take.
#[derive(Clone, Copy, Debug, Default)]
struct Seat {
    at: Vec2,
    radius: f64,
    particle: u32,
    cell: u32,
}

impl CellList {
    fn pairs_within(&mut self, packing: &Packing, reach: f64, pairs: &mut Vec<[u32; 2]>) {
        let longest = 2.0 * packing.largest_radius() + reach;
        let n = packing.len();
        let grid = Grid::new(packing.domain(), longest, n);
        // Fewer than three cells along a side, or cells that hold many: a narrow box, or a few particles much larger than the others.
        let grid = grid.filter(|grid| n <= CROWDED * grid.columns * grid.rows);
        let count = match grid {
            Some(grid) => {
                self.fill(packing, grid);
                wide(
                    #[inline(always)]
                    || self.search(packing.domain(), reach, grid),
                )
            }
            None if n <= FEW => return pairs_of_all(packing, reach, pairs),
            None => {
                pairs_by_size(packing, reach, &mut self.found);
                self.found.len()
            }
        };
        let (found, slots) = (&self.found[..count], &mut self.slots);
        sort_by_number(found, &mut self.by_second, slots, n, |pair| pair[1]);
        sort_by_number(&self.by_second, pairs, slots, n, |pair| pair[0]);
    }

    fn fill(&mut self, packing: &Packing, grid: Grid) {
        let places = packing.positions().iter().zip(packing.radii());
        self.particles.clear();
        self.particles
            .extend((0..).zip(places).map(|(particle, (&at, &radius))| Seat {
                at,
                radius,
                particle,
                cell: grid.cell(packing.domain().upright(at)),
            }));
        let cells = grid.columns * grid.rows;
        let (seats, first) = (&mut self.seats, &mut self.first);
        sort_by_number(&self.particles, seats, first, cells, |seat| seat.cell);
    }

    /// Looks once at each two particles of neighbouring cells; says how many pairs were found.
    #[inline(always)]
    fn search(&mut self, domain: Domain, reach: f64, grid: Grid) -> usize {
        let mut count = 0;
        for cell in 0..grid.columns * grid.rows {
            let mut ahead = grid
                .ahead(cell)
                .map(|(from, to)| self.first[from] as usize..self.first[to] as usize);
            let here = self.first[cell] as usize..self.first[cell + 1] as usize;
            let most: usize = ahead.iter().map(ExactSizeIterator::len).sum();
            for k in here {
                if self.found.len() < count + most {
                    self.found.resize(2 * (count + most), [0; 2]);
                }
                let seat = self.seats[k];
                ahead[0].start = k + 1;
                for others in &ahead {
                    let others = &self.seats[others.clone()];
                    let slots = &mut self.found[count..][..others.len()];
                    let mut near = 0;
                    // Without a branch: nobody could guess who is near.
                    for other in others {
                        let apart = seat.at - other.at;
                        let [x, y] = domain.fold([apart.x, apart.y]);
                        let sum = seat.radius + other.radius + reach;
                        let (i, j) = (seat.particle, other.particle);
                        slots[near] = [i.min(j), i.max(j)];
                        near += usize::from(x * x + y * y < sum * sum);
                    }
                    count += near;
                }
            }
        }
        count
    }
}

/// Particles a cell on average, from which on they are looked for by size.
const CROWDED: usize = 16;

/// So few particles are looked through as they are.
const FEW: usize = 64;

/// The pairs of surfaces closer than `reach`, ascending, from a look at every two particles.
fn pairs_of_all(packing: &Packing, reach: f64, pairs: &mut Vec<[u32; 2]>) {
    let n = packing.len() as u32;
    let near = |i: u32, j: u32| {
        let (i, j) = (i as usize, j as usize);
        let sum = packing.radii()[i] + packing.radii()[j] + reach;
        packing.separation(i, j).norm_squared() < sum * sum
    };
    pairs.clear();
    for i in 0..n {
        pairs.extend((i + 1..n).filter(|&j| near(i, j)).map(|j| [i, j]));
    }
}

/// The same in some order: each particle against those near it that are of its octave of sizes or a larger one.
fn pairs_by_size(packing: &Packing, reach: f64, pairs: &mut Vec<[u32; 2]>) {
    let (domain, grids) = (packing.domain(), octaves::by_size(packing, reach));
    pairs.clear();
    for (k, small) in grids.iter().enumerate() {
        for seat in small.seats() {
            for (larger, grid) in grids[k..].iter().enumerate() {
                for other in grid.near(seat.at).flatten() {
                    let (i, j) = (seat.particle, other.particle);
                    let sum = seat.radius + other.radius + reach;
                    let apart = domain.minimum_image(seat.at - other.at).norm_squared();
                    if apart < sum * sum && (larger > 0 || i < j) {
                        pairs.push([i.min(j), i.max(j)]);
                    }
                }
            }
        }
    }
}

/// Counting sort of `items` into `sorted` by a number below `numbers`; equal ones keep their order. Those of number c
/// become `sorted[first[c]..first[c + 1]]`.
fn sort_by_number<T: Copy + Default>(
    items: &[T],
    sorted: &mut Vec<T>,
    first: &mut Vec<u32>,
    numbers: usize,
    number: impl Fn(&T) -> u32,
) {
    first.clear();
    first.resize(numbers + 1, 0);
    for item in items {
        first[number(item) as usize] += 1;
    }
    // Where each number ends; filling backwards turns that into where it begins.
    let mut end = 0;
    for count in &mut *first {
        end += *count;
        *count = end;
    }
    sorted.resize(items.len(), T::default());
    for item in items.iter().rev() {
        let slot = &mut first[number(item) as usize];
        *slot -= 1;
        sorted[*slot as usize] = *item;
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
        let (columns, rows) = (count(domain.heights().x), count(domain.heights().y));
        (columns >= 3.0 && rows >= 3.0).then(|| Self {
            columns: columns as usize,
            rows: rows as usize,
            per_length: Vec2::new(columns, rows).component_div(&domain.lengths()),
        })
    }

    /// The cell of a place in the upright box.
    fn cell(&self, p: Vec2) -> u32 {
        let at = p.component_mul(&self.per_length);
        // A product may round up to the number of cells.
        let column = (at.x as usize).min(self.columns - 1);
        let row = (at.y as usize).min(self.rows - 1);
        (row * self.columns + column) as u32
    }

    /// A cell, the one to its right and the three above it, as stretches of cells of a row: the first begins with the
    /// cell itself, and what lies across the edge makes stretches of its own.
    #[inline(always)]
    fn ahead(&self, cell: usize) -> [(usize, usize); 4] {
        let (column, end) = (cell % self.columns, self.columns);
        let row = cell - column;
        let above = if row + end == self.rows * end {
            0
        } else {
            row + end
        };
        let (right, across) = if column + 1 == end {
            (end, (row, row + 1))
        } else {
            (column + 2, (row, row))
        };
        let (three, beyond) = if column == 0 {
            ((0, 2), (end - 1, end))
        } else if column + 1 == end {
            ((end - 2, end), (0, 1))
        } else {
            ((column - 1, column + 2), (0, 0))
        };
        let raised = |(from, to)| (above + from, above + to);
        [(cell, row + right), across, raised(three), raised(beyond)]
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
        fn pairs_by_size_are_those_of_all(
            points in prop::collection::vec((0.0..1.0f64, 0.0..1.0f64, 0.01..0.4f64), 1..120),
            lengths in (0.3..8.0f64, 0.3..8.0f64),
            intruder in 0.0..4.0f64,
            reach in 0.0..0.5f64,
        ) {
            let mut radii: Vec<f64> = points.iter().map(|p| p.2).collect();
            radii[0] += intruder;
            let at = |p: &(f64, f64, f64)| Vec2::new(p.0 * lengths.0, p.1 * lengths.1);
            let positions = points.iter().map(at).collect();
            let domain = Domain::new(lengths.0, lengths.1).unwrap();
            let packing = Packing::new(domain, radii, positions).unwrap();
            let (mut by_size, mut all) = (Vec::new(), Vec::new());
            pairs_by_size(&packing, reach, &mut by_size);
            by_size.sort_unstable();
            pairs_of_all(&packing, reach, &mut all);
            prop_assert_eq!(&by_size, &all);
            let mut list = NeighborList::new();
            list.update(&packing, reach, 0.0);
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
