//! The geometry of a set of contacts and the matrix `A` that couples their forces, Saitoh (4)–(6).

use super::list::{ContactList, DuplicateContactList};
use crate::domain::Vec2;
use crate::droplet::kernel::{Direction, G_AT_CONTACT};
use crate::packing::{Packing, unit_and_length};
use core::f64::consts::PI;

/// Where the contacts of a list are: one entry a contact, in the list's order.
///
/// # Example
///
/// ```
/// use softjam::contact::{list::ContactList, matrix::Geometry};
/// use softjam::domain::{Domain, Vec2};
/// use softjam::packing::Packing;
///
/// let at = |x| Vec2::new(x, 2.0);
/// let packing = Packing::new(Domain::new(8.0, 8.0).unwrap(), vec![0.5; 2], vec![at(1.0), at(1.9)]).unwrap();
/// let geometry = Geometry::of(&packing, &ContactList::new(2, &[[0, 1]]).unwrap());
/// assert_eq!(geometry.normals(), [Vec2::new(-1.0, 0.0)]);
/// assert!((geometry.overlaps()[0] - 0.1).abs() < 1e-15);
/// ```
#[derive(Clone, Debug, Default)]
pub struct Geometry {
    normals: Vec<Vec2>,
    distances: Vec<f64>,
    overlaps: Vec<f64>,
    /// The direction from the lower particle to the higher.
    directions: Vec<Direction>,
    duplicate: DuplicateContactList,
    /// Parallel to the duplicate list: the direction from the particle to its partner.
    toward: Vec<Direction>,
}

impl Geometry {
    /// The geometry of `contacts` in `packing`.
    ///
    /// # Panics
    ///
    /// If the list is of another number of particles.
    ///
    /// ```
    /// # use softjam::contact::{list::ContactList, matrix::Geometry};
    /// # use softjam::{domain::{Domain, Vec2}, packing::Packing};
    /// let packing = Packing::new(Domain::new(8.0, 8.0).unwrap(), vec![0.5], vec![Vec2::zeros()]).unwrap();
    /// assert!(Geometry::of(&packing, &ContactList::new(1, &[]).unwrap()).distances().is_empty());
    /// ```
    #[must_use]
    pub fn of(packing: &Packing, contacts: &ContactList) -> Self {
        let mut geometry = Self::default();
        geometry.rebuild(packing, contacts);
        geometry
    }

    pub(crate) fn rebuild(&mut self, packing: &Packing, contacts: &ContactList) {
        assert_eq!(packing.len(), contacts.particles(), "one list, one packing");
        self.duplicate.rebuild(contacts);
        self.normals.clear();
        self.distances.clear();
        self.overlaps.clear();
        self.directions.clear();
        for [i, j] in contacts.pairs() {
            let (i, j) = (i as usize, j as usize);
            let (normal, distance) = unit_and_length(packing.separation(i, j));
            self.normals.push(normal);
            self.distances.push(distance);
            self.overlaps
                .push(packing.radii()[i] + packing.radii()[j] - distance);
            self.directions.push(Direction::of(-normal));
        }
        self.toward.clear();
        for p in 0..packing.len() {
            let (partners, numbers) = (self.duplicate.partners(p), self.duplicate.contacts(p));
            for (&q, &c) in partners.iter().zip(numbers) {
                let from_lower = self.directions[c as usize];
                self.toward.push(if p < q as usize {
                    from_lower
                } else {
                    from_lower.opposite()
                });
            }
        }
    }

    /// The unit vectors `n_ij = (r_i − r_j)/r_ij`; the force on `i` is `+f_ij n_ij`.
    ///
    /// ```
    /// # use softjam::contact::matrix::Geometry;
    /// assert!(Geometry::default().normals().is_empty());
    /// ```
    #[must_use]
    pub fn normals(&self) -> &[Vec2] {
        &self.normals
    }

    /// The centre distances `r_ij` (length).
    ///
    /// ```
    /// # use softjam::contact::matrix::Geometry;
    /// assert!(Geometry::default().distances().is_empty());
    /// ```
    #[must_use]
    pub fn distances(&self) -> &[f64] {
        &self.distances
    }

    /// The overlaps of the undeformed disks `δ_ij = R_i + R_j − r_ij` (length); negative where only bulges meet.
    ///
    /// ```
    /// # use softjam::contact::matrix::Geometry;
    /// assert!(Geometry::default().overlaps().is_empty());
    /// ```
    #[must_use]
    pub fn overlaps(&self) -> &[f64] {
        &self.overlaps
    }

    /// The duplicate contact list that belongs to the contacts.
    ///
    /// ```
    /// # use softjam::contact::{list::ContactList, matrix::Geometry};
    /// # use softjam::{domain::{Domain, Vec2}, packing::Packing};
    /// # let at = |x| Vec2::new(x, 2.0);
    /// # let packing = Packing::new(Domain::new(8.0, 8.0).unwrap(), vec![0.5; 2], vec![at(1.0), at(1.9)]).unwrap();
    /// let geometry = Geometry::of(&packing, &ContactList::new(2, &[[0, 1]]).unwrap());
    /// assert_eq!(geometry.duplicate().partners(1), [0]);
    /// ```
    #[must_use]
    pub fn duplicate(&self) -> &DuplicateContactList {
        &self.duplicate
    }

    /// The directions from particle `p` to its partners, in the order of the duplicate list.
    pub(crate) fn toward(&self, p: usize) -> &[Direction] {
        &self.toward[self.duplicate.entries(p)]
    }

    /// The gap between the deformed contours of particles `i < j` that are not in contact (length):
    /// `r_ij − ρ_i(θ_j) − ρ_j(θ_i)`, which is `−Δ_ij` in Saitoh 2.2.4.
    ///
    /// `forces` has one entry a contact, `line_tension` is γ.
    pub(crate) fn gap(
        &self,
        packing: &Packing,
        line_tension: f64,
        forces: &[f64],
        i: usize,
        j: usize,
    ) -> f64 {
        let (normal, distance) = unit_and_length(packing.separation(i, j));
        let overlap = packing.radii()[i] + packing.radii()[j] - distance;
        let to_j = Direction::of(-normal);
        let bulge = |p: usize, direction: Direction| {
            let scale = packing.radii()[p] / (2.0 * PI * line_tension);
            self.displacement(scale, p, direction, forces)
        };
        -overlap - bulge(i, to_j) - bulge(j, to_j.opposite())
    }

    /// `ΔR_p` in a direction, Saitoh (3): `scale Σ_k f_pk g(θ − θ_k)` with `scale = R_p / 2πγ`.
    fn displacement(&self, scale: f64, p: usize, direction: Direction, forces: &[f64]) -> f64 {
        let sum: f64 = self
            .toward(p)
            .iter()
            .zip(self.duplicate.contacts(p))
            .map(|(d, &c)| forces[c as usize] * direction.g_between(*d))
            .sum();
        scale * sum
    }
}

/// The matrix `A` of `A f = δ`: what Saitoh (6) writes as `𝒦⁻¹`, symmetric and positive definite.
///
/// ```text
/// A_cc' = −Σ_p (R_p / 2πγ) g(θ between c and c' at p)      p: the particle that c and c' share
/// A_cc  = (3 / 4πγ) (R_i + R_j)
/// ```
///
/// Every Fourier coefficient of `−g` is ≥ 0, hence `A` is positive definite as long as the contacts of each particle
/// lie at distinct angles. Stored by rows without the diagonal; one entry is computed for the two places it fills, so
/// the matrix is symmetric to the last bit. Unit: length per force.
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
    /// Row c is `first[c]..first[c + 1]` of `column` and `value`: first the contacts that share `i`, then those of `j`.
    first: Vec<u32>,
    column: Vec<u32>,
    value: Vec<f64>,
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
        let per_radius = 1.0 / (2.0 * PI * line_tension);
        let radii = packing.radii();
        let others = |p: u32| geometry.duplicate.entries(p as usize).len() as u32 - 1;
        self.diagonal.clear();
        self.first.clear();
        self.first.push(0);
        let mut end = 0;
        for [i, j] in contacts.pairs() {
            let sum = radii[i as usize] + radii[j as usize];
            self.diagonal.push(-G_AT_CONTACT * per_radius * sum);
            end += others(i) + others(j);
            self.first.push(end);
        }
        self.column.resize(end as usize, 0);
        self.value.resize(end as usize, 0.0);
        for (p, radius) in radii.iter().enumerate() {
            let scale = -radius * per_radius;
            let toward = geometry.toward(p);
            let numbers = geometry.duplicate.contacts(p);
            let partners = geometry.duplicate.partners(p);
            // Where p's part of row c begins: at its start if p is the lower particle, else behind the partner's part.
            let part = |a: usize| {
                let row = self.first[numbers[a] as usize] as usize;
                if (partners[a] as usize) < p {
                    row + others(partners[a]) as usize
                } else {
                    row
                }
            };
            for a in 0..toward.len() {
                let row_a = part(a);
                for b in a + 1..toward.len() {
                    let value = scale * toward[a].g_between(toward[b]);
                    // Each row leaves itself out.
                    let (in_a, in_b) = (row_a + b - 1, part(b) + a);
                    self.column[in_a] = numbers[b];
                    self.value[in_a] = value;
                    self.column[in_b] = numbers[a];
                    self.value[in_b] = value;
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

    /// The off-diagonal entries of row `c` as `(column, value)`, in no particular order of columns.
    ///
    /// # Panics
    ///
    /// If there is no row `c`. See the example of [`ContactMatrix`].
    pub fn row(&self, c: usize) -> impl Iterator<Item = (usize, f64)> + '_ {
        let range = self.first[c] as usize..self.first[c + 1] as usize;
        self.column[range.clone()]
            .iter()
            .map(|&k| k as usize)
            .zip(self.value[range].iter().copied())
    }

    /// Number of off-diagonal entries.
    ///
    /// ```
    /// # use softjam::contact::matrix::ContactMatrix;
    /// assert_eq!(ContactMatrix::default().off_diagonals(), 0);
    /// ```
    #[must_use]
    pub fn off_diagonals(&self) -> usize {
        self.value.len()
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
        let n = self.len();
        let (x, y) = (&x[..n], &mut y[..n]);
        for c in 0..n {
            let range = self.first[c] as usize..self.first[c + 1] as usize;
            // Two chains of sums hide the latency of an addition; their order is part of the result.
            let mut even = self.diagonal[c] * x[c];
            let mut odd = 0.0;
            let (columns, values) = (&self.column[range.clone()], &self.value[range]);
            let (column_pairs, last_column) = columns.as_chunks::<2>();
            let (value_pairs, last_value) = values.as_chunks::<2>();
            for (k, v) in column_pairs.iter().zip(value_pairs) {
                even += v[0] * x[k[0] as usize];
                odd += v[1] * x[k[1] as usize];
            }
            if let ([k], [v]) = (last_column, last_value) {
                even += v * x[*k as usize];
            }
            y[c] = even + odd;
        }
    }
}
