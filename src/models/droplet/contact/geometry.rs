//! Where the contacts of a list are: normals, distances, overlaps, and the directions seen from each particle.

use super::list::{ContactList, DuplicateContactList};
use crate::domain::Vec2;
use crate::models::droplet::kernel::{Angles, Direction};
use crate::numerics::wide::wide;
use crate::state::{Packing, unit_and_length};
use core::f64::consts::PI;
use core::ops::Range;

/// Where the contacts of a list are: one entry a contact, in the list's order.
///
/// # Example
///
/// ```
/// use softjam::models::droplet::contact::list::ContactList;
/// use softjam::models::droplet::contact::matrix::Geometry;
/// use softjam::domain::{Domain, Vec2};
/// use softjam::state::Packing;
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
    /// The angles of the directions from the lower particle to the higher, those of `−n_ij`.
    angles: Vec<f64>,
    duplicate: DuplicateContactList,
    /// Room for the components of the normals and the making of the angles, in each of two threads.
    scratch: [Scratch; 2],
}

/// The directions of contacts as a loop wants them: as slices, whose places are known. At N = 1024 a step takes 2 to 3 % longer
/// where they are looked up in [`Geometry`] for each end.
#[derive(Clone, Copy)]
pub(super) struct Directions<'a> {
    pub(super) normals: &'a [Vec2],
    /// Of the opposite of the normals.
    pub(super) angles: &'a [f64],
}

impl Directions<'_> {
    /// The direction in which an end of a contact points: `2c` for the lower particle of contact `c`, `2c + 1` for the higher.
    #[inline(always)]
    pub(super) fn toward(self, end: u32) -> Direction {
        let c = (end >> 1) as usize;
        let normal = self.normals[c];
        let from_lower = Direction {
            cos: -normal.x,
            sin: -normal.y,
            angle: self.angles[c],
        };
        let from_higher = from_lower.opposite();
        if end & 1 == 0 {
            from_lower
        } else {
            from_higher
        }
    }
}

/// Room for some contacts.
#[derive(Clone, Debug, Default)]
struct Scratch {
    x: Vec<f64>,
    y: Vec<f64>,
    nodes: Vec<[f64; 2]>,
}

/// The columns of some contacts.
pub(super) struct Part<'a> {
    normals: &'a mut [Vec2],
    distances: &'a mut [f64],
    overlaps: &'a mut [f64],
    angles: &'a mut [f64],
    scratch: &'a mut Scratch,
}

impl Geometry {
    /// The geometry of `contacts` in `packing`.
    ///
    /// # Panics
    ///
    /// If the list is of another number of particles.
    #[must_use]
    pub fn of(packing: &Packing, contacts: &ContactList) -> Self {
        let mut geometry = Self::default();
        geometry.restructure(contacts);
        let pairs: Vec<_> = contacts.pairs().collect();
        wide(
            #[inline(always)]
            || geometry.part(0..pairs.len()).refresh(packing, &pairs),
        );
        geometry
    }

    /// Takes over which particles touch; positions follow with [`Part::refresh`].
    pub(super) fn restructure(&mut self, contacts: &ContactList) {
        self.duplicate.rebuild(contacts);
        self.normals.resize(contacts.len(), Vec2::zeros());
        self.distances.resize(contacts.len(), 0.0);
        self.overlaps.resize(contacts.len(), 0.0);
        self.angles.resize(contacts.len(), 0.0);
    }

    /// Adds one more contact at the positions of `packing`, with the next number.
    pub(super) fn add(&mut self, packing: &Packing, pair: [u32; 2]) {
        let [i, j] = pair.map(|p| p as usize);
        let (normal, distance) = unit_and_length(packing.separation(i, j));
        self.duplicate.add(self.normals.len() as u32, pair);
        self.normals.push(normal);
        self.distances.push(distance);
        let sum = packing.radii()[i] + packing.radii()[j];
        self.overlaps.push(sum - distance);
        self.angles.push(Direction::of(-normal).angle);
    }

    /// The columns of some contacts, to be computed anew.
    #[inline(always)]
    pub(super) fn part(&mut self, contacts: Range<usize>) -> Part<'_> {
        Part {
            normals: &mut self.normals[contacts.clone()],
            distances: &mut self.distances[contacts.clone()],
            overlaps: &mut self.overlaps[contacts.clone()],
            angles: &mut self.angles[contacts],
            scratch: &mut self.scratch[0],
        }
    }

    /// Those of all contacts, in two parts: the first `middle` contacts and the others.
    pub(super) fn halves(&mut self, middle: usize) -> [Part<'_>; 2] {
        let (normals, more_normals) = self.normals.split_at_mut(middle);
        let (distances, more_distances) = self.distances.split_at_mut(middle);
        let (overlaps, more_overlaps) = self.overlaps.split_at_mut(middle);
        let (angles, more_angles) = self.angles.split_at_mut(middle);
        let [scratch, more_scratch] = &mut self.scratch;
        let one = Part {
            normals,
            distances,
            overlaps,
            angles,
            scratch,
        };
        let other = Part {
            normals: more_normals,
            distances: more_distances,
            overlaps: more_overlaps,
            angles: more_angles,
            scratch: more_scratch,
        };
        [one, other]
    }

    /// The unit vectors `n_ij = (r_i − r_j)/r_ij`; the force on `i` is `+f_ij n_ij`.
    #[must_use]
    pub fn normals(&self) -> &[Vec2] {
        &self.normals
    }

    /// The centre distances `r_ij` (length).
    #[must_use]
    pub fn distances(&self) -> &[f64] {
        &self.distances
    }

    /// The overlaps of the undeformed disks `δ_ij = R_i + R_j − r_ij` (length); negative where only bulges meet.
    #[must_use]
    pub fn overlaps(&self) -> &[f64] {
        &self.overlaps
    }

    /// The duplicate contact list that belongs to the contacts.
    #[must_use]
    pub fn duplicate(&self) -> &DuplicateContactList {
        &self.duplicate
    }

    /// [`Directions::toward`].
    #[inline(always)]
    pub(super) fn toward(&self, end: u32) -> Direction {
        self.directions().toward(end)
    }

    /// The directions of all contacts.
    #[inline(always)]
    pub(super) fn directions(&self) -> Directions<'_> {
        Directions {
            normals: &self.normals,
            angles: &self.angles,
        }
    }

    /// That of some of the contacts, `contacts`: `order` has their numbers.
    pub(super) fn of_some(&self, order: &[u32], contacts: &ContactList) -> Self {
        let pick = |column: &[f64]| order.iter().map(|c| column[*c as usize]).collect();
        Self {
            normals: order.iter().map(|c| self.normals[*c as usize]).collect(),
            distances: pick(&self.distances),
            overlaps: pick(&self.overlaps),
            angles: pick(&self.angles),
            duplicate: DuplicateContactList::of(contacts),
            ..Self::default()
        }
    }

    /// The contacts of particle `p` with their partners and directions, in the order of the partners.
    pub(super) fn around(&self, p: usize) -> impl Iterator<Item = (u32, u32, Direction)> + '_ {
        let partners = self.duplicate.partners(p).iter();
        let ends = self.duplicate.ends(p as u32, self.duplicate.entries(p));
        partners
            .zip(ends)
            .map(|(&q, end)| (q, end >> 1, self.toward(end)))
    }
}

impl Part<'_> {
    /// Computes the contacts `pairs` at the positions of `packing`.
    ///
    /// To be inlined into loops that are compiled for wide vectors.
    #[inline(always)]
    pub(super) fn refresh(self, packing: &Packing, pairs: &[[u32; 2]]) {
        let (positions, radii) = (packing.positions(), packing.radii());
        let domain = packing.domain();
        let angles = Angles::new();
        for column in [&mut self.scratch.x, &mut self.scratch.y] {
            column.resize(TOGETHER, 0.0);
        }
        // Some contacts at a time, so that what is computed of them stays in the fastest memory.
        let columns = self.distances.chunks_mut(TOGETHER);
        let columns = columns.zip(self.overlaps.chunks_mut(TOGETHER));
        let columns = columns.zip(self.normals.chunks_mut(TOGETHER));
        let groups = self.angles.chunks_mut(TOGETHER);
        let groups = groups.zip(pairs.chunks(TOGETHER));
        for (((distances, overlaps), normals), (own, pairs)) in columns.zip(groups) {
            let count = pairs.len();
            let (x, y) = (&mut self.scratch.x[..count], &mut self.scratch.y[..count]);
            let rows = x.iter_mut().zip(&mut *y).zip(&mut *overlaps);
            for (&[i, j], ((x, y), overlap)) in pairs.iter().zip(rows) {
                let (i, j) = (i as usize, j as usize);
                let difference = positions[i] - positions[j];
                (*x, *y) = (difference.x, difference.y);
                *overlap = radii[i] + radii[j];
            }
            // One simple loop a quantity, so that each is done several contacts at a time.
            domain.fold_columns(x, y);
            for ((r, x), y) in distances.iter_mut().zip(&*x).zip(&*y) {
                *r = (x * x + y * y).sqrt();
            }
            for ((x, y), r) in x.iter_mut().zip(&mut *y).zip(&*distances) {
                let inverse = 1.0 / r;
                // Coincident centres are told apart along x, as in `unit_and_length`.
                *x = if *r > 0.0 { *x * inverse } else { 1.0 };
                *y = if *r > 0.0 { *y * inverse } else { 0.0 };
            }
            for (overlap, r) in overlaps.iter_mut().zip(&*distances) {
                *overlap -= r;
            }
            for (normal, (x, y)) in normals.iter_mut().zip(x.iter_mut().zip(&mut *y)) {
                *normal = Vec2::new(*x, *y);
                (*x, *y) = (-*x, -*y);
            }
            angles.of_columns((x, y), &mut self.scratch.nodes, own);
        }
    }
}

/// The gap between the deformed contours of particles `i < j` that are not in contact (length); the forces on a particle, and the
/// directions they come from, are given by `forces`.
pub(super) fn gap_of<F: Iterator<Item = (f64, Direction)>>(
    packing: &Packing,
    line_tension: f64,
    [i, j]: [usize; 2],
    mut forces: impl FnMut(usize) -> F,
) -> f64 {
    let (normal, distance) = unit_and_length(packing.separation(i, j));
    let overlap = packing.radii()[i] + packing.radii()[j] - distance;
    let to_j = Direction::of(-normal);
    let mut bulge = |p: usize, direction: Direction| {
        bulge_toward(direction, packing.radii()[p], line_tension, forces(p))
    };
    -overlap - bulge(i, to_j) - bulge(j, to_j.opposite())
}

/// How far a particle of `radius` reaches beyond its undeformed disk in a direction (length), Saitoh (3): `ΔR(θ) = (R/2πγ) Σ_k f_k
/// g(θ − θ_k)` of its `forces` and the directions that they come from.
pub(super) fn bulge_toward(
    direction: Direction,
    radius: f64,
    line_tension: f64,
    forces: impl Iterator<Item = (f64, Direction)>,
) -> f64 {
    let sum: f64 = forces.map(|(f, d)| f * direction.g_between(d)).sum();
    radius / (2.0 * PI * line_tension) * sum
}

/// Contacts that are computed together.
const TOGETHER: usize = 512;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::domain::Domain;

    #[test]
    fn contacts_added_have_the_bits_of_contacts_that_were_there() {
        let points = [(1.0, 1.0), (1.9, 1.3), (2.6, 1.9), (1.2, 1.9), (7.7, 0.8)];
        let positions = points.map(|(x, y)| Vec2::new(x, y)).to_vec();
        let packing =
            Packing::new(Domain::new(8.0, 8.0).unwrap(), vec![0.6; 5], positions).unwrap();
        let all = [[0, 1], [0, 3], [0, 4], [1, 2], [1, 3]];
        let whole = Geometry::of(&packing, &ContactList::new(5, &all).unwrap());
        for late in [[0, 4], [0, 1], [1, 2]] {
            let base: Vec<_> = all.into_iter().filter(|pair| *pair != late).collect();
            let mut geometry = Geometry::of(&packing, &ContactList::new(5, &base).unwrap());
            geometry.add(&packing, late);
            let mut pairs = base;
            pairs.push(late);
            let mut refreshed = geometry.clone();
            refreshed.part(0..5).refresh(&packing, &pairs);
            for geometry in [geometry, refreshed] {
                for p in 0..5 {
                    let bits = |(q, _, d): (u32, u32, Direction)| {
                        (q, [d.cos, d.sin, d.angle].map(f64::to_bits))
                    };
                    assert!(geometry.around(p).map(bits).eq(whole.around(p).map(bits)));
                }
                let place = all.iter().position(|pair| *pair == late).unwrap();
                assert_eq!(geometry.normals()[4], whole.normals()[place]);
                assert_eq!(geometry.overlaps()[4], whole.overlaps()[place]);
                assert_eq!(geometry.distances()[4], whole.distances()[place]);
            }
        }
    }
}
