//! The matrix `A` that couples the forces of a set of contacts, Saitoh (4)–(6).
//!
//! - Rows are the numbers of the contacts. An inactive contact has a row, whose inverse root is 0.
//! - A particle with contacts has one block; a block names its contacts in the order of the particle's partners.
//! - The first `sorted_runs` hold whole stretches of particles. A block that a contact was added to stands after them, alone.
//! - After an assembly `entries_f32` is of the positions and contacts at hand; so is `value`, unless it `lacks_values`.
//!
//! See the example of [`ContactMatrix`].

mod assemble;
mod blocks;
mod entries_f32;
mod entries_f64;
pub(crate) mod product;

pub use crate::models::droplet::contact::geometry::Geometry;

pub(super) use blocks::compliance;
pub(super) use entries_f32::rounding;

use crate::models::droplet::contact::list::ContactList;
use crate::numerics::wide::wide;
use crate::state::Packing;
use assemble::Scratch;
use blocks::{Run, pairs_of};
use core::ops::Range;
use entries_f32::Operand;
use product::{Number, Products, product, product_of_blocks};

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
/// use softjam::models::droplet::contact::list::ContactList;
/// use softjam::models::droplet::contact::matrix::{ContactMatrix, Geometry};
/// use softjam::domain::{Domain, Vec2};
/// use softjam::state::Packing;
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
    /// `A_cc` (length per force).
    diagonal: Vec<f64>,
    /// `A_cc^(−½)`, and 0 for an inactive contact.
    inverse_root: Vec<f64>,
    /// A bound of `A_cc^½`.
    largest_root: f64,
    /// Runs of blocks of one size.
    runs: Vec<Run>,
    /// How many of the runs were sorted when the structure was built.
    sorted_runs: usize,
    /// The particle of each block.
    particle: Vec<u32>,
    /// The ends of contacts in the blocks: `2c` for the lower particle of contact `c`, `2c + 1` for the higher.
    end: Vec<u32>,
    /// `−R_p/2πγ` of each particle: what `g` is multiplied with.
    factor: Vec<f64>,
    /// The entries of the blocks: those between the block's contacts `b` and `a < b`, by `b` and then by `a`.
    value: Vec<f64>,
    /// `value` of `D^(−½) A D^(−½)` with `D = diag A`, in single precision: no unit, none above 1. 0 for inactive contacts.
    entries_f32: Vec<f32>,
    /// What entries in single precision are computed from, see [`entries_f32`].
    operands: Vec<Operand>,
    /// `A_cc^½ f_c`, in units of `units.load`: what entries in single precision are multiplied with first.
    loads: Vec<f32>,
    /// What single precision counts in.
    units: Units,
    /// Whether `value` is not of the positions and contacts at hand; an empty matrix lacks none.
    lacks_values: bool,
    /// Buffers for a run, one a thread.
    scratch: [Scratch; 2],
    /// Where the runs and the contacts end whose (lower) particles are in a stretch.
    stretches: Vec<[usize; 2]>,
    /// The block of each particle, [`NO_BLOCK`](blocks::NO_BLOCK) where it has no contact.
    block_of: Vec<u32>,
    /// The particles of each contact.
    pairs: Vec<[u32; 2]>,
}

/// What entries are computed in.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum Precision {
    Single,
    #[default]
    Double,
}

/// What single precision counts in, so that none of its numbers is far from 1.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Units {
    /// `(R_max/2πγ)^½` (length per force, to the half).
    pub(super) root: f64,
    /// `A_cc^½ f_c` of a force γ on the largest particles, up to a factor of order 1 (length times force, to the half).
    pub(super) load: f64,
    /// An estimate of the [rounding](entries_f32::rounding) of what entries make of the forces.
    pub(super) rounding: f64,
}

impl ContactMatrix {
    /// The matrix of `contacts`, `line_tension` being γ (force, positive).
    #[must_use]
    pub fn of(
        packing: &Packing,
        contacts: &ContactList,
        geometry: &Geometry,
        line_tension: f64,
    ) -> Self {
        let mut matrix = Self::default();
        matrix.restructure(packing, contacts, geometry.duplicate(), line_tension);
        matrix.complete(geometry);
        matrix
    }

    /// The unit of the products of [`Self::loads`] (length times force, to the half).
    pub(super) fn unit_of_loads(&self) -> f64 {
        self.units.load
    }

    /// What their rounding may come to, as a part of the largest `|A_cc f|`.
    pub(super) fn rounding_of_loads(&self) -> f64 {
        self.units.rounding
    }

    /// Whether the contacts are those that the structure was built of, in their order, and all active.
    pub(super) fn is_whole(&self) -> bool {
        self.stragglers() == 0 && self.inverse_root.iter().all(|s| *s > 0.0)
    }

    /// The contacts that the structure was built of come first, this many, in the order of pairs.
    fn sorted_contacts(&self) -> usize {
        self.stretches.last().map_or(0, |stretch| stretch[1])
    }

    /// Number of particles.
    pub(super) fn particles(&self) -> usize {
        self.block_of.len()
    }

    /// How many blocks stand alone because contacts were added.
    pub(super) fn stragglers(&self) -> usize {
        self.runs.len() - self.sorted_runs
    }

    /// The particles of each contact.
    pub(super) fn pairs(&self) -> &[[u32; 2]] {
        &self.pairs
    }

    /// Number of rows, the number of contacts.
    #[must_use]
    pub fn len(&self) -> usize {
        self.diagonal.len()
    }

    /// Whether there is no contact.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.diagonal.is_empty()
    }

    /// The diagonal `A_cc`, the compliance of a contact on its own.
    #[must_use]
    pub fn diagonal(&self) -> &[f64] {
        &self.diagonal
    }

    /// `A_cc^(−½)`.
    pub(super) fn inverse_root(&self) -> &[f64] {
        &self.inverse_root
    }

    /// A bound of `A_cc^½`, from the largest radius.
    pub(super) fn largest_root(&self) -> f64 {
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
    pub fn multiply(&self, x: &[f64], y: &mut [f64]) {
        let n = self.len();
        let (x, y) = (&x[..n], &mut y[..n]);
        y.fill(0.0);
        wide(
            #[inline(always)]
            || {
                self.add_products(&self.value, 0..self.runs.len(), x, y);
                self.add_diagonal(x, y);
            },
        );
    }

    /// [`multiply`](Self::multiply), by two threads if there are two.
    pub(super) fn multiply_into(&self, x: &[f64], y: &mut Products<f64>) {
        self.off_diagonal_products(x, y);
        wide(
            #[inline(always)]
            || self.add_diagonal(x, y.sums_mut()),
        );
    }

    #[inline(always)]
    fn add_diagonal(&self, x: &[f64], y: &mut [f64]) {
        for ((y, x), d) in y.iter_mut().zip(x).zip(&self.diagonal) {
            *y += d * x;
        }
    }

    /// The [products](Self::add_products) of the off-diagonal entries of `A` itself.
    pub(super) fn off_diagonal_products(&self, x: &[f64], y: &mut Products<f64>) {
        debug_assert!(self.is_complete(), "values of other positions");
        self.products_into(&self.value, x, y);
    }

    /// Adds to `y` what the off-diagonal entries of `A` in some runs make of `x`, contact by contact. `values` are those of `A`, or
    /// others in their places.
    ///
    /// A contact has two ends. What comes from the others at one end is a sum in the order of the particle's partners; of the
    /// two sums it is the same which is added to which. So whatever numbers the contacts have and however the blocks are
    /// sorted, the bits are the same.
    #[inline(always)]
    fn add_products<F: Number>(&self, values: &[F], runs: Range<usize>, x: &[F], y: &mut [F]) {
        for run in &self.runs[runs] {
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

    /// The off-diagonal entries of `D^(−½) A D^(−½)` with `D = diag A`, in single precision and in the places of the others.
    pub(super) fn entries_f32(&self) -> &[f32] {
        &self.entries_f32
    }
}
