//! The matrix `A` that couples the forces of a set of contacts, Saitoh (4)–(6).

pub use super::geometry::Geometry;

use super::list::{ContactList, DuplicateContactList};
use super::product::{Number, product, product_of_block, scale, scale_block};
use crate::droplet::kernel::{Direction, G_AT_CONTACT};
use crate::packing::Packing;
use crate::wide::{largest_magnitude, wide};
use core::f64::consts::PI;

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
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ContactMatrix {
    diagonal: Vec<f64>,
    /// `A_cc^(−½)`.
    scaling: Vec<f64>,
    /// The largest `A_cc^½`.
    largest_root: f64,
    /// The particle of each block.
    particle: Vec<u32>,
    /// Where each block's contacts and values begin, and where the last ends.
    start: Vec<[u32; 2]>,
    /// Stretches of blocks of one size: the number of contacts in a block, and the number of blocks.
    runs: Vec<(usize, usize)>,
    /// The contacts of the blocks.
    contact: Vec<u32>,
    /// The entries of the blocks: those between the block's contacts `b` and `a < b`, by `b` and then by `a`.
    value: Vec<f64>,
    /// Where the values of each particle's block begin, of those that have one.
    value_of: Vec<u32>,
    /// Room for [`exchange`](Self::exchange).
    old: (Vec<f64>, Vec<u32>),
    /// The block of each particle, [`NO_BLOCK`] where it has not two contacts.
    block_of: Vec<u32>,
    list: ContactList,
}

/// A particle with one contact couples it to none.
const NO_BLOCK: u32 = u32::MAX;

/// Particles whose blocks are sorted by size together.
const STRETCH: usize = 256;

/// Blocks with more contacts than this share one stretch and have a run each.
const LARGEST_SORTED: usize = 7;

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
        self.refresh(packing, geometry, line_tension);
    }

    /// Everything that depends on which particles touch, and not on where they are.
    pub(crate) fn restructure(
        &mut self,
        packing: &Packing,
        contacts: &ContactList,
        duplicate: &DuplicateContactList,
        line_tension: f64,
    ) {
        let per_radius = 1.0 / (2.0 * PI * line_tension);
        let radii = packing.radii();
        self.diagonal.resize(contacts.len(), 0.0);
        let mut rows = self.diagonal.iter_mut();
        for (i, radius) in radii.iter().enumerate() {
            for (&j, compliance) in contacts.partners(i).iter().zip(&mut rows) {
                let sum = radius + radii[j as usize];
                *compliance = -G_AT_CONTACT * per_radius * sum;
            }
        }
        self.scaling.resize(contacts.len(), 0.0);
        wide(
            #[inline(always)]
            || {
                for (scaling, compliance) in self.scaling.iter_mut().zip(&self.diagonal) {
                    *scaling = (1.0 / compliance).sqrt();
                }
                self.largest_root = largest_magnitude(&self.diagonal).sqrt();
            },
        );
        self.sort_blocks(duplicate);
        self.list.assign(contacts);
        self.block_of.clear();
        self.block_of.resize(radii.len(), NO_BLOCK);
        self.start.clear();
        self.contact.clear();
        self.value_of.resize(radii.len(), 0);
        let mut end = 0;
        for (block, &p) in self.particle.iter().enumerate() {
            let numbers = duplicate.contacts(p as usize);
            self.start.push([self.contact.len() as u32, end]);
            self.value_of[p as usize] = end;
            self.contact.extend_from_slice(numbers);
            end += (numbers.len() * (numbers.len() - 1) / 2) as u32;
            self.block_of[p as usize] = block as u32;
        }
        self.start.push([self.contact.len() as u32, end]);
        self.value.resize(end as usize, 0.0);
    }

    /// Takes over contacts that differ by some pairs, at the same positions: only the blocks of their particles are computed.
    pub(crate) fn exchange(
        &mut self,
        packing: &Packing,
        contacts: &ContactList,
        geometry: &Geometry,
        exchanged: &[[u32; 2]],
        line_tension: f64,
    ) {
        core::mem::swap(&mut self.value, &mut self.old.0);
        core::mem::swap(&mut self.value_of, &mut self.old.1);
        self.restructure(packing, contacts, geometry.duplicate(), line_tension);
        let (old, old_of) = (&self.old.0, &mut self.old.1);
        for &p in exchanged.as_flattened() {
            old_of[p as usize] = u32::MAX;
        }
        let per_radius = 1.0 / (2.0 * PI * line_tension);
        let (mut block, mut values) = (0, &mut self.value[..]);
        for &(z, count) in &self.runs {
            let pairs = z * (z - 1) / 2;
            for &p in &self.particle[block..block + count] {
                let (own, rest) = values.split_at_mut(pairs);
                values = rest;
                let from = old_of[p as usize] as usize;
                if let Some(old) = old.get(from..from + pairs) {
                    own.copy_from_slice(old);
                } else {
                    let scale = -packing.radii()[p as usize] * per_radius;
                    fill_block(scale, geometry.toward(p as usize), own);
                }
            }
            block += count;
        }
    }

    /// The order of the blocks: within each stretch of particles by size, then by particle.
    fn sort_blocks(&mut self, duplicate: &DuplicateContactList) {
        const SIZES: usize = LARGEST_SORTED + 2;
        self.particle.clear();
        self.runs.clear();
        let size = |p: usize| duplicate.entries(p).len();
        let particles = duplicate.particles();
        for begin in (0..particles).step_by(STRETCH) {
            let stretch = begin..particles.min(begin + STRETCH);
            let mut next = [0; SIZES];
            for p in stretch.clone() {
                next[size(p).min(SIZES - 1)] += 1;
            }
            let mut end = self.particle.len();
            for (z, count) in next.iter_mut().enumerate().skip(2) {
                if *count > 0 && z <= LARGEST_SORTED {
                    self.runs.push((z, *count));
                }
                (*count, end) = (end, end + *count);
            }
            self.particle.resize(end, 0);
            for p in stretch.clone().filter(|&p| size(p) > 1) {
                let slot = &mut next[size(p).min(SIZES - 1)];
                self.particle[*slot] = p as u32;
                *slot += 1;
            }
            let large = stretch.map(size).filter(|&z| z > LARGEST_SORTED);
            self.runs.extend(large.map(|z| (z, 1)));
        }
    }

    /// The values, from the directions of the contacts.
    pub(crate) fn refresh(&mut self, packing: &Packing, geometry: &Geometry, line_tension: f64) {
        wide(
            #[inline(always)]
            || self.refresh_here(packing, geometry, line_tension),
        );
    }

    #[inline(always)]
    fn refresh_here(&mut self, packing: &Packing, geometry: &Geometry, line_tension: f64) {
        let per_radius = 1.0 / (2.0 * PI * line_tension);
        let (mut block, mut value) = (0, 0);
        for &(z, count) in &self.runs {
            let pairs = z * (z - 1) / 2;
            let particles = &self.particle[block..block + count];
            let values = &mut self.value[value..value + count * pairs];
            (block, value) = (block + count, value + count * pairs);
            let blocks = particles.iter().map(|&p| {
                let p = p as usize;
                (-packing.radii()[p] * per_radius, geometry.toward(p))
            });
            match z {
                2 => fill::<2, 1>(blocks, values),
                3 => fill::<3, 3>(blocks, values),
                4 => fill::<4, 6>(blocks, values),
                5 => fill::<5, 10>(blocks, values),
                6 => fill::<6, 15>(blocks, values),
                7 => fill::<7, 21>(blocks, values),
                _ => {
                    for ((scale, toward), values) in blocks.zip(values.chunks_exact_mut(pairs)) {
                        fill_block(scale, toward, values);
                    }
                }
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

    /// The largest `A_cc^½`.
    pub(crate) fn largest_root(&self) -> f64 {
        self.largest_root
    }

    /// The off-diagonal entries of row `c` as `(column, value)`, in no particular order of columns.
    ///
    /// # Panics
    ///
    /// If there is no row `c`. See the example of [`ContactMatrix`].
    pub fn row(&self, c: usize) -> impl Iterator<Item = (usize, f64)> + '_ {
        let blocks = self.list.pair(c).map(|p| self.block_of[p as usize]);
        let blocks = blocks.into_iter().filter(|b| *b != NO_BLOCK);
        blocks.flat_map(move |block| {
            let [first, values] = self.start[block as usize].map(|s| s as usize);
            let end = self.start[block as usize + 1][0] as usize;
            let contacts = &self.contact[first..end];
            let own = contacts.iter().position(|&k| k as usize == c).unwrap_or(0);
            let others = contacts.iter().enumerate().filter(move |(k, _)| *k != own);
            others.map(move |(k, &column)| {
                let (a, b) = (own.min(k), own.max(k));
                (column as usize, self.value[values + b * (b - 1) / 2 + a])
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
        2 * self.value.len()
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
        for ((y, x), d) in y.iter_mut().zip(x).zip(&self.diagonal) {
            *y = d * x;
        }
        self.add_off_diagonal(x, y);
    }

    /// `y += (A − diag A) x`.
    #[inline(always)]
    pub(crate) fn add_off_diagonal(&self, x: &[f64], y: &mut [f64]) {
        self.add_product(&self.value, x, y);
    }

    /// `y += V x` with other values in the places of the off-diagonal entries: `values` are in their order.
    #[inline(always)]
    pub(crate) fn add_product<F: Number>(&self, values: &[F], x: &[F], y: &mut [F]) {
        let (mut contacts, mut values) = (&self.contact[..], values);
        for &(z, count) in &self.runs {
            let (c, v);
            (c, contacts) = contacts.split_at(count * z);
            (v, values) = values.split_at(count * (z * (z - 1) / 2));
            match z {
                2 => product::<F, 2, 1>(c, v, x, y),
                3 => product::<F, 3, 3>(c, v, x, y),
                4 => product::<F, 4, 6>(c, v, x, y),
                5 => product::<F, 5, 10>(c, v, x, y),
                6 => product::<F, 6, 15>(c, v, x, y),
                7 => product::<F, 7, 21>(c, v, x, y),
                _ => product_of_block(c, v, x, y),
            }
        }
    }

    /// The off-diagonal entries of `D^(−½) A D^(−½)` with `D = diag A`, in single precision: no unit, none above 1.
    #[inline(always)]
    pub(crate) fn scale_off_diagonal(&self, scaled: &mut Vec<f32>) {
        scaled.resize(self.value.len(), 0.0);
        let (mut contacts, mut values) = (&self.contact[..], &self.value[..]);
        let mut scaled = &mut scaled[..];
        for &(z, count) in &self.runs {
            let (c, v, s);
            (c, contacts) = contacts.split_at(count * z);
            (v, values) = values.split_at(count * (z * (z - 1) / 2));
            (s, scaled) = scaled.split_at_mut(count * (z * (z - 1) / 2));
            let by = &self.scaling[..];
            match z {
                2 => scale::<2, 1>(c, v, by, s),
                3 => scale::<3, 3>(c, v, by, s),
                4 => scale::<4, 6>(c, v, by, s),
                5 => scale::<5, 10>(c, v, by, s),
                6 => scale::<6, 15>(c, v, by, s),
                7 => scale::<7, 21>(c, v, by, s),
                _ => scale_block(c, v, by, s),
            }
        }
    }
}

/// The entries of blocks of `Z` contacts, `T = Z (Z − 1)/2` each.
#[inline(always)]
fn fill<'a, const Z: usize, const T: usize>(
    blocks: impl Iterator<Item = (f64, &'a [Direction])>,
    values: &mut [f64],
) {
    for ((scale, toward), values) in blocks.zip(values.as_chunks_mut::<T>().0) {
        if let Some(toward) = toward.first_chunk::<Z>() {
            for b in 1..Z {
                for a in 0..b {
                    values[b * (b - 1) / 2 + a] = scale * toward[a].g_between(toward[b]);
                }
            }
        }
    }
}

#[inline(always)]
fn fill_block(scale: f64, toward: &[Direction], values: &mut [f64]) {
    let mut values = values.iter_mut();
    for b in 1..toward.len() {
        for (a, value) in toward[..b].iter().zip(&mut values) {
            *value = scale * a.g_between(toward[b]);
        }
    }
}
