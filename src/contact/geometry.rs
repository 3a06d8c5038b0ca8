//! Where the contacts of a list are: normals, distances, overlaps, and the directions seen from each particle.

use super::list::{ContactList, DuplicateContactList};
use crate::domain::{Vec2, nearest};
use crate::droplet::kernel::{Angles, Direction};
use crate::packing::{Packing, unit_and_length};
use core::f64::consts::PI;
use core::ops::Range;

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
    duplicate: DuplicateContactList,
    /// Parallel to the duplicate list: the direction from the particle to its partner.
    toward: Vec<Direction>,
    /// Components of the normals, for the loops of [`refresh`](Self::refresh).
    x: Vec<f64>,
    y: Vec<f64>,
    /// The directions from the lower particle to the higher.
    directions: Vec<Direction>,
    /// Room for [`exchange`](Self::exchange).
    spare: Spare,
}

#[derive(Clone, Debug, Default)]
struct Spare {
    normals: Vec<Vec2>,
    directions: Vec<Direction>,
    distances: Vec<f64>,
    overlaps: Vec<f64>,
}

/// A stretch of contacts that stay, and the pair that comes behind it.
#[derive(Clone, Debug)]
pub(crate) struct Kept {
    pub(crate) range: Range<usize>,
    pub(crate) then: Option<[u32; 2]>,
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
        self.restructure(contacts);
        self.refresh(packing, contacts);
    }

    /// Takes over which particles touch; positions follow in [`refresh`](Self::refresh).
    pub(crate) fn restructure(&mut self, contacts: &ContactList) {
        self.duplicate.rebuild(contacts);
        self.normals.resize(contacts.len(), Vec2::zeros());
        self.distances.resize(contacts.len(), 0.0);
        self.overlaps.resize(contacts.len(), 0.0);
        self.directions.resize(contacts.len(), NOWHERE);
        self.x.resize(contacts.len(), 0.0);
        self.y.resize(contacts.len(), 0.0);
        self.toward.resize(2 * contacts.len(), NOWHERE);
    }

    /// Computes everything anew for the positions of `packing`; `contacts` is the list that the structure is of.
    pub(crate) fn refresh(&mut self, packing: &Packing, contacts: &ContactList) {
        assert_eq!(packing.len(), contacts.particles(), "one list, one packing");
        let (positions, radii) = (packing.positions(), packing.radii());
        let sides = packing.domain().lengths();
        let Self {
            normals,
            distances,
            overlaps,
            directions,
            x,
            y,
            ..
        } = self;
        let (x, y) = (&mut x[..], &mut y[..]);
        let mut rows = x.iter_mut().zip(&mut *y).zip(&mut *overlaps);
        for (i, (position, radius)) in positions.iter().zip(radii).enumerate() {
            // The partners first: when they run out, no row is taken.
            for (&j, ((x, y), overlap)) in contacts.partners(i).iter().zip(&mut rows) {
                let difference = position - positions[j as usize];
                (*x, *y) = (difference.x, difference.y);
                *overlap = radius + radii[j as usize];
            }
        }
        // One simple loop a quantity, so that each is done several contacts at a time.
        for x in &mut *x {
            *x = nearest(*x, sides.x);
        }
        for y in &mut *y {
            *y = nearest(*y, sides.y);
        }
        for ((r, x), y) in distances.iter_mut().zip(&*x).zip(&*y) {
            *r = (x * x + y * y).sqrt();
        }
        for ((x, y), r) in x.iter_mut().zip(&mut *y).zip(&*distances) {
            let inverse = 1.0 / r;
            *x *= inverse;
            *y *= inverse;
        }
        for (overlap, r) in overlaps.iter_mut().zip(&*distances) {
            *overlap -= r;
        }
        let angles = Angles::new();
        let rows = normals.iter_mut().zip(&*distances).zip(directions);
        for (((normal, r), direction), (x, y)) in rows.zip(x.iter().zip(&*y)) {
            // Coincident centres are told apart along x, as in `unit_and_length`.
            *normal = if *r > 0.0 {
                Vec2::new(*x, *y)
            } else {
                Vec2::new(1.0, 0.0)
            };
            *direction = Direction::with(angles, -*normal);
        }
        self.look_around();
    }

    /// The directions of the contacts, as each of the two particles sees them.
    fn look_around(&mut self) {
        let toward = &mut self.toward[..];
        for (direction, slots) in self.directions.iter().zip(self.duplicate.slots()) {
            toward[slots[0] as usize] = *direction;
            toward[slots[1] as usize] = direction.opposite();
        }
    }

    /// Takes over other contacts at the same positions. `kept` are stretches of the contacts as they were, each but the
    /// last followed by a new contact if it says so; only new contacts are computed.
    pub(crate) fn exchange(&mut self, packing: &Packing, contacts: &ContactList, kept: &[Kept]) {
        let spare = &mut self.spare;
        spare.normals.clear();
        spare.directions.clear();
        spare.distances.clear();
        spare.overlaps.clear();
        for part in kept {
            let range = part.range.clone();
            spare
                .normals
                .extend_from_slice(&self.normals[range.clone()]);
            spare
                .directions
                .extend_from_slice(&self.directions[range.clone()]);
            spare
                .distances
                .extend_from_slice(&self.distances[range.clone()]);
            spare.overlaps.extend_from_slice(&self.overlaps[range]);
            if let Some([i, j]) = part.then {
                let (i, j) = (i as usize, j as usize);
                let (normal, distance) = unit_and_length(packing.separation(i, j));
                spare.normals.push(normal);
                spare.directions.push(Direction::of(-normal));
                spare.distances.push(distance);
                let sum = packing.radii()[i] + packing.radii()[j];
                spare.overlaps.push(sum - distance);
            }
        }
        core::mem::swap(&mut self.normals, &mut spare.normals);
        core::mem::swap(&mut self.directions, &mut spare.directions);
        core::mem::swap(&mut self.distances, &mut spare.distances);
        core::mem::swap(&mut self.overlaps, &mut spare.overlaps);
        self.restructure(contacts);
        self.look_around();
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

const NOWHERE: Direction = Direction {
    cos: 0.0,
    sin: 0.0,
    angle: 0.0,
};
