//! The matrix `A` that couples the forces of a set of contacts, Saitoh (4)–(6).

pub use super::geometry::Geometry;

use super::blocks::{Run, pairs_of};
use super::fill::{Blocks, fill, fill_blocks};
use super::list::ContactList;
use super::product::{Number, product, product_of_blocks};
use crate::domain::Vec2;
use crate::droplet::kernel::Direction;
use crate::packing::Packing;
use crate::wide::wide;
use core::f64::consts::PI;
use core::ops::Range;

/// The matrix `A` of `A f = δ`: what Saitoh (6) writes as `𝒦⁻¹`, symmetric and positive definite.
///
/// ```text
/// A_cc' = −Σ_p (R_p / 2πγ) g(θ between c and c' at p)      p: the particle that c and c' share
/// A_cc  = (3 / 4πγ) (R_i + R_j)
/// ```
///
/// Every Fourier coefficient of `−g` is ≥ 0, hence `A` is positive definite as long as the contacts of each particle
/// lie at distinct angles. Unit: length per force.
///
/// Stored particle by particle, as the sum above is written: a particle with `z` contacts gives a symmetric block of
/// `z (z − 1)/2` entries, each computed and stored once for its two places, so the matrix is symmetric to the last bit.
/// A product with a vector then reads half the numbers that rows would hold, and one index a contact and particle
/// instead of one an entry. Blocks of one size stand together (within stretches of 256 particles, to stay near each
/// other in memory), so that each size has a loop of its own without branches.
///
/// # Example
///
/// ```
/// use softjam::contact::{list::ContactList, matrix::{ContactMatrix, Geometry}};
/// use softjam::domain::{Domain, Vec2};
/// use softjam::packing::Packing;
/// use std::f64::consts::PI;
///
/// // Three particles in a row: the two contacts of the middle one face each other, g(π) = −1/2.
/// let at = |x| Vec2::new(x, 2.0);
/// let packing = Packing::new(Domain::new(8.0, 8.0).unwrap(), vec![0.5; 3], vec![at(1.0), at(1.9), at(2.8)]).unwrap();
/// let contacts = ContactList::new(3, &[[0, 1], [1, 2]]).unwrap();
/// let matrix = ContactMatrix::of(&packing, &contacts, &Geometry::of(&packing, &contacts), 1.0);
/// assert!((matrix.diagonal()[0] - 0.75 / PI).abs() < 1e-15);
/// assert_eq!(matrix.row(0).collect::<Vec<_>>(), [(1, 0.125 / PI)]);
/// ```
#[derive(Clone, Debug, Default)]
pub struct ContactMatrix {
    pub(super) diagonal: Vec<f64>,
    /// `A_cc^(−½)`, and 0 for a contact that is at rest.
    pub(super) scaling: Vec<f64>,
    /// A bound of `A_cc^½`.
    pub(super) largest_root: f64,
    /// Runs of blocks of one size, and how many of them were sorted.
    pub(super) runs: Vec<Run>,
    pub(super) sorted: usize,
    /// The particle of each block.
    pub(super) particle: Vec<u32>,
    /// The ends of contacts in the blocks: `2c` for the lower particle of contact `c`, `2c + 1` for the higher.
    pub(super) end: Vec<u32>,
    /// The entries of the blocks: those between the block's contacts `b` and `a < b`, by `b` and then by `a`.
    pub(super) value: Vec<f64>,
    /// `value` of `D^(−½) A D^(−½)` with `D = diag A`, in single precision: no unit, none above 1. 0 for contacts at rest.
    pub(super) scaled: Vec<f32>,
    /// Whether `scaled` is of contacts that have come to rest or woken since.
    pub(super) stale: bool,
    /// Room for the directions of a run.
    pub(super) toward: Vec<Direction>,
    /// Where the runs and the contacts end whose (lower) particles are in a stretch.
    pub(super) stretches: Vec<[usize; 2]>,
    /// The block of each particle, [`NO_BLOCK`] where it has no contact.
    pub(super) block_of: Vec<u32>,
    /// The particles of each contact.
    pub(super) pairs: Vec<[u32; 2]>,
    /// Whether contacts were added, or are at rest.
    pub(super) changed: bool,
}

impl ContactMatrix {
    /// The matrix of `contacts`, `line_tension` being γ (force, positive).
    ///
    /// ```
    /// # use softjam::contact::{list::ContactList, matrix::{ContactMatrix, Geometry}};
    /// # use softjam::{domain::{Domain, Vec2}, packing::Packing};
    /// # let packing = Packing::new(Domain::new(8.0, 8.0).unwrap(), vec![0.5], vec![Vec2::zeros()]).unwrap();
    /// let none = ContactList::new(1, &[]).unwrap();
    /// assert_eq!(ContactMatrix::of(&packing, &none, &Geometry::of(&packing, &none), 1.0).len(), 0);
    /// ```
    #[must_use]
    pub fn of(
        packing: &Packing,
        contacts: &ContactList,
        geometry: &Geometry,
        line_tension: f64,
    ) -> Self {
        let mut matrix = Self::default();
        matrix.rebuild(packing, contacts, geometry, line_tension);
        matrix
    }

    pub(crate) fn rebuild(
        &mut self,
        packing: &Packing,
        contacts: &ContactList,
        geometry: &Geometry,
        line_tension: f64,
    ) {
        self.restructure(packing, contacts, geometry.duplicate(), line_tension);
        let forces = vec![0.0; contacts.len()];
        let products = &mut vec![0.0; contacts.len()];
        let at = At {
            packing,
            forces: &forces,
            per_radius: 1.0 / (2.0 * PI * line_tension),
        };
        wide(
            #[inline(always)]
            || self.fill(at, geometry, 0..self.runs.len(), products),
        );
    }

    /// Whether the contacts are those that the structure was built of, in their order.
    pub(crate) fn is_whole(&self) -> bool {
        !self.changed
    }

    /// The contacts that the structure was built of come first, this many, in the order of pairs.
    pub(crate) fn sorted_contacts(&self) -> usize {
        self.stretches.last().map_or(0, |stretch| stretch[1])
    }

    /// Number of particles.
    pub(crate) fn particles(&self) -> usize {
        self.block_of.len()
    }

    /// How many blocks stand alone because contacts were added.
    pub(crate) fn stragglers(&self) -> usize {
        self.runs.len() - self.sorted
    }

    /// Directions and values at the positions of `packing`, and what the off-diagonal entries make of `forces`, as
    /// [`products`](Self::products) has it. `pairs` are the contacts by number, those of `geometry`.
    ///
    /// One stretch of particles after the other, so that what is computed stays near: the directions that a block needs are
    /// those of its own stretch or of one before.
    pub(crate) fn refresh(
        &mut self,
        geometry: &mut Geometry,
        at: At<'_>,
        pairs: &[[u32; 2]],
        products: &mut Vec<f64>,
    ) {
        products.clear();
        products.resize(self.len(), 0.0);
        let sorted = self.sorted_contacts();
        let stretches = core::mem::take(&mut self.stretches);
        wide(
            #[inline(always)]
            || {
                geometry.refresh(at.packing, pairs, sorted..pairs.len());
                let [mut run, mut contact] = [0; 2];
                for &[runs, contacts] in &stretches {
                    geometry.refresh(at.packing, pairs, contact..contacts);
                    self.fill(at, geometry, run..runs, products);
                    [run, contact] = [runs, contacts];
                }
                self.fill(at, geometry, run..self.runs.len(), products);
            },
        );
        self.stretches = stretches;
        self.stale = false;
    }

    /// The values of some runs, scaled and not, and their products with the forces.
    #[inline(always)]
    fn fill(&mut self, at: At<'_>, geometry: &Geometry, runs: Range<usize>, products: &mut [f64]) {
        let radii = at.packing.radii();
        for run in &self.runs[runs] {
            let ends = &self.end[run.ends()];
            // Nothing that is called here may be left to a function of its own, which would not be compiled for wide vectors.
            if self.toward.len() < ends.len() {
                self.toward.resize(ends.len(), Direction::of(Vec2::x()));
            }
            for (toward, end) in self.toward.iter_mut().zip(ends) {
                *toward = geometry.toward(*end);
            }
            let particles = &self.particle[run.block..run.block + run.count];
            let blocks = Blocks {
                toward: &self.toward,
                ends,
                values: &mut self.value[run.values()],
                scaled: &mut self.scaled[run.values()],
                scaling: &self.scaling,
                forces: at.forces,
                products,
            };
            let scales = particles.iter();
            let scales = scales.map(|p| -radii[*p as usize] * at.per_radius);
            match run.size {
                1 => {}
                2 => fill::<2, 1>(blocks, scales),
                3 => fill::<3, 3>(blocks, scales),
                4 => fill::<4, 6>(blocks, scales),
                5 => fill::<5, 10>(blocks, scales),
                6 => fill::<6, 15>(blocks, scales),
                7 => fill::<7, 21>(blocks, scales),
                z => fill_blocks(z, blocks, scales),
            }
        }
    }

    /// Number of rows, the number of contacts.
    ///
    /// ```
    /// # use softjam::contact::matrix::ContactMatrix;
    /// assert_eq!(ContactMatrix::default().len(), 0);
    /// ```
    #[must_use]
    pub fn len(&self) -> usize {
        self.diagonal.len()
    }

    /// Whether there is no contact.
    ///
    /// ```
    /// # use softjam::contact::matrix::ContactMatrix;
    /// assert!(ContactMatrix::default().is_empty());
    /// ```
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.diagonal.is_empty()
    }

    /// The diagonal `A_cc`, the compliance of a contact on its own.
    ///
    /// ```
    /// # use softjam::contact::matrix::ContactMatrix;
    /// assert!(ContactMatrix::default().diagonal().is_empty());
    /// ```
    #[must_use]
    pub fn diagonal(&self) -> &[f64] {
        &self.diagonal
    }

    /// `A_cc^(−½)`.
    pub(crate) fn scaling(&self) -> &[f64] {
        &self.scaling
    }

    /// A bound of `A_cc^½`, from the largest radius.
    pub(crate) fn largest_root(&self) -> f64 {
        self.largest_root
    }

    /// The off-diagonal entries of row `c` as `(column, value)`, in no particular order of columns.
    ///
    /// # Panics
    ///
    /// If there is no row `c`. See the example of [`ContactMatrix`].
    pub fn row(&self, c: usize) -> impl Iterator<Item = (usize, f64)> + '_ {
        let places = self.pairs[c].map(|p| self.place_of(p));
        places.into_iter().flatten().flat_map(move |(run, place)| {
            let (ends, values) = self.runs[run].block(place);
            let ends = &self.end[ends];
            let own = ends.iter().position(|e| *e as usize / 2 == c).unwrap_or(0);
            let others = ends.iter().enumerate().filter(move |(k, _)| *k != own);
            others.map(move |(k, &end)| {
                let (a, b) = (own.min(k), own.max(k));
                (end as usize / 2, self.value[values.start + pairs_of(b) + a])
            })
        })
    }

    /// Number of off-diagonal entries.
    ///
    /// ```
    /// # use softjam::contact::matrix::ContactMatrix;
    /// assert_eq!(ContactMatrix::default().off_diagonals(), 0);
    /// ```
    #[must_use]
    pub fn off_diagonals(&self) -> usize {
        2 * self
            .runs
            .iter()
            .map(|run| run.values().len())
            .sum::<usize>()
    }

    /// `y = A x`.
    ///
    /// # Panics
    ///
    /// If `x` or `y` is shorter than the matrix.
    ///
    /// ```
    /// # use softjam::contact::matrix::ContactMatrix;
    /// ContactMatrix::default().multiply(&[], &mut []);
    /// ```
    pub fn multiply(&self, x: &[f64], y: &mut [f64]) {
        wide(
            #[inline(always)]
            || self.multiply_here(x, y),
        );
    }

    /// [`multiply`](Self::multiply), to be inlined into loops that are compiled for wide vectors.
    #[inline(always)]
    pub(crate) fn multiply_here(&self, x: &[f64], y: &mut [f64]) {
        let n = self.len();
        let (x, y) = (&x[..n], &mut y[..n]);
        self.off_diagonal_products(x, y);
        for ((y, x), d) in y.iter_mut().zip(x).zip(&self.diagonal) {
            *y += d * x;
        }
    }

    /// The [`products`](Self::products) of the off-diagonal entries of `A` itself.
    #[inline(always)]
    pub(crate) fn off_diagonal_products(&self, x: &[f64], y: &mut [f64]) {
        self.products(&self.value, x, y);
    }

    /// What the off-diagonal entries of `A` make of `x`, contact by contact. `values` are those of `A`, or others in their
    /// places.
    ///
    /// A contact has two ends. What comes from the others at one end is a sum in the order of the particle's partners; of the
    /// two sums it is the same which is added to which. So whatever numbers the contacts have and however the blocks are
    /// sorted, the bits are the same.
    #[inline(always)]
    pub(crate) fn products<F: Number>(&self, values: &[F], x: &[F], y: &mut [F]) {
        y.fill(F::default());
        for run in &self.runs {
            let (e, v) = (&self.end[run.ends()], &values[run.values()]);
            match run.size {
                1 => {}
                2 => product::<F, 2, 1>(e, v, x, y),
                3 => product::<F, 3, 3>(e, v, x, y),
                4 => product::<F, 4, 6>(e, v, x, y),
                5 => product::<F, 5, 10>(e, v, x, y),
                6 => product::<F, 6, 15>(e, v, x, y),
                7 => product::<F, 7, 21>(e, v, x, y),
                z => product_of_blocks(z, e, v, x, y),
            }
        }
    }

    /// Brings the scaled values up to date.
    pub(crate) fn rescale(&mut self) {
        if !core::mem::take(&mut self.stale) {
            return;
        }
        for run in &self.runs {
            let ends = self.end[run.ends()].chunks_exact(run.size);
            let values = self.value[run.values()].iter();
            let couples = (1..run.size).flat_map(|b| (0..b).map(move |a| (a, b)));
            let couples = ends.flat_map(|ends| couples.clone().map(|(a, b)| [ends[a], ends[b]]));
            let scaled = self.scaled[run.values()].iter_mut();
            for ((scaled, value), couple) in scaled.zip(values).zip(couples) {
                let [a, b] = couple.map(|e| self.scaling[(e >> 1) as usize]);
                *scaled = (value * (a * b)) as f32;
            }
        }
    }

    /// The off-diagonal entries of `D^(−½) A D^(−½)` with `D = diag A`, in single precision and in the places of the others.
    pub(crate) fn scaled(&self) -> &[f32] {
        &self.scaled
    }
}

/// What the values are computed at.
#[derive(Clone, Copy)]
pub(crate) struct At<'a> {
    pub(crate) packing: &'a Packing,
    pub(crate) forces: &'a [f64],
    /// `1/2πγ`.
    pub(crate) per_radius: f64,
}
