//! Where the contacts of a list are: normals, distances, overlaps, and the directions seen from each particle.

use super::list::{ContactList, DuplicateContactList};
use crate::domain::{Vec2, nearest};
use crate::droplet::kernel::{Angles, Direction};
use crate::packing::{Packing, unit_and_length};
use crate::wide::wide;
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
    /// The angles of the directions from the lower particle to the higher, likewise, and room for their making.
    angles: Vec<f64>,
    nodes: Vec<[f64; 2]>,
    /// Room for [`exchange`](Self::exchange): the directions from the lower particles to the higher.
    lower: Vec<Direction>,
}

/// A stretch of contacts that stay, and the pair that comes behind it.
#[derive(Clone, Debug)]
pub(crate) struct Kept {
    pub(crate) range: Range<usize>,
    pub(crate) then: Option<[u32; 2]>,
}

/// The contacts that come with an exchange, each with its number among those that there are then.
pub(crate) fn arrivals(kept: &[Kept]) -> impl Iterator<Item = (usize, [u32; 2])> + '_ {
    let mut end = 0;
    kept.iter().filter_map(move |part| {
        end += part.range.len();
        let place = end;
        end += usize::from(part.then.is_some());
        part.then.map(|pair| (place, pair))
    })
}

/// Moves the entries of contacts that stay to where an exchange puts them; those of new ones are anything, `fill` at first.
pub(crate) fn rearrange<T: Copy>(column: &mut Vec<T>, kept: &[Kept], fill: T) {
    let count = |part: &Kept| part.range.len() + usize::from(part.then.is_some());
    let len = kept.iter().map(count).sum();
    if column.len() < len {
        column.resize(len, fill);
    }
    // What moves down from the front, what moves up from the back: nothing is overwritten before it has moved.
    let mut end = 0;
    for part in kept {
        if end < part.range.start {
            column.copy_within(part.range.clone(), end);
        }
        end += count(part);
    }
    for part in kept.iter().rev() {
        end -= count(part);
        if end > part.range.start {
            column.copy_within(part.range.clone(), end);
        }
    }
    column.truncate(len);
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
        self.toward.resize(2 * contacts.len(), NOWHERE);
    }

    /// Computes everything anew for the positions of `packing`; `contacts` is the list that the structure is of.
    pub(crate) fn refresh(&mut self, packing: &Packing, contacts: &ContactList) {
        assert_eq!(packing.len(), contacts.particles(), "one list, one packing");
        wide(
            #[inline(always)]
            || self.refresh_here(packing, contacts),
        );
    }

    #[inline(always)]
    fn refresh_here(&mut self, packing: &Packing, contacts: &ContactList) {
        let (positions, radii) = (packing.positions(), packing.radii());
        let sides = packing.domain().lengths();
        let toward = &mut self.toward[..];
        let slots = self.duplicate.slots();
        let angles = Angles::new();
        let mut begin = 0;
        // Some particles at a time, so that what is computed of them stays in the fastest memory.
        for first in (0..packing.len()).step_by(TOGETHER) {
            let group = first..packing.len().min(first + TOGETHER);
            let count = contacts.count(group.clone());
            let range = begin..begin + count;
            begin += count;
            if self.x.len() < count {
                self.x.resize(count, 0.0);
                self.y.resize(count, 0.0);
                self.angles.resize(count, 0.0);
            }
            let (x, y) = (&mut self.x[..count], &mut self.y[..count]);
            let distances = &mut self.distances[range.clone()];
            let overlaps = &mut self.overlaps[range.clone()];
            let mut rows = x.iter_mut().zip(&mut *y).zip(&mut *overlaps);
            for i in group {
                let (position, radius) = (positions[i], radii[i]);
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
                // Coincident centres are told apart along x, as in `unit_and_length`.
                *x = if *r > 0.0 { *x * inverse } else { 1.0 };
                *y = if *r > 0.0 { *y * inverse } else { 0.0 };
            }
            for (overlap, r) in overlaps.iter_mut().zip(&*distances) {
                *overlap -= r;
            }
            let normals = &mut self.normals[range.clone()];
            for (normal, (x, y)) in normals.iter_mut().zip(x.iter_mut().zip(&mut *y)) {
                *normal = Vec2::new(*x, *y);
                (*x, *y) = (-*x, -*y);
            }
            let own = &mut self.angles[..count];
            angles.of_columns((x, y), &mut self.nodes, own);
            let slots = &slots[range];
            for ((slots, angle), (x, y)) in slots.iter().zip(own).zip(x.iter().zip(&*y)) {
                let direction = Direction {
                    cos: *x,
                    sin: *y,
                    angle: *angle,
                };
                toward[slots[0] as usize] = direction;
                toward[slots[1] as usize] = direction.opposite();
            }
        }
    }

    /// Takes over other contacts at the same positions. `kept` are stretches of the contacts as they were, each but the
    /// last followed by a new contact if it says so; only new contacts are computed.
    pub(crate) fn exchange(&mut self, packing: &Packing, contacts: &ContactList, kept: &[Kept]) {
        self.lower.clear();
        let slots = self.duplicate.slots();
        for part in kept {
            let slots = &slots[part.range.clone()];
            let toward = slots.iter().map(|s| self.toward[s[0] as usize]);
            self.lower.extend(toward);
            if part.then.is_some() {
                self.lower.push(NOWHERE);
            }
        }
        rearrange(&mut self.normals, kept, Vec2::zeros());
        rearrange(&mut self.distances, kept, 0.0);
        rearrange(&mut self.overlaps, kept, 0.0);
        for (place, [i, j]) in arrivals(kept) {
            let (i, j) = (i as usize, j as usize);
            let (normal, distance) = unit_and_length(packing.separation(i, j));
            self.normals[place] = normal;
            self.lower[place] = Direction::of(-normal);
            self.distances[place] = distance;
            self.overlaps[place] = packing.radii()[i] + packing.radii()[j] - distance;
        }
        self.restructure(contacts);
        let rows = self.lower.iter().zip(self.duplicate.slots());
        for (direction, slots) in rows {
            self.toward[slots[0] as usize] = *direction;
            self.toward[slots[1] as usize] = direction.opposite();
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

/// Particles whose contacts are computed together.
const TOGETHER: usize = 256;

const NOWHERE: Direction = Direction {
    cos: 0.0,
    sin: 0.0,
    angle: 0.0,
};

#[cfg(test)]
mod tests {
    use super::*;

    /// What an exchange does to a column, one entry after the other.
    fn slowly(column: &[u32], kept: &[Kept]) -> Vec<u32> {
        let mut out = Vec::new();
        for part in kept {
            out.extend_from_slice(&column[part.range.clone()]);
            out.extend(part.then.map(|pair| pair[1]));
        }
        out
    }

    #[test]
    fn columns_are_rearranged_in_place_whichever_way_their_parts_move() {
        // Five places, each left alone, dropped, or given one or two contacts before it: all 4⁵ exchanges.
        for code in 0..1024u32 {
            let (mut kept, mut begin) = (Vec::new(), 0);
            for place in 0..5 {
                let end = 3 * place + 1;
                let then = Some([0, 100 + place as u32]);
                match code >> (2 * place) & 3 {
                    1 => {
                        kept.push(Kept {
                            range: begin..end,
                            then: None,
                        });
                        begin = end + 1;
                    }
                    more @ 2.. => {
                        kept.push(Kept {
                            range: begin..end,
                            then,
                        });
                        begin = end;
                        if more == 3 {
                            kept.push(Kept {
                                range: end..end,
                                then,
                            });
                        }
                    }
                    _ => {}
                }
            }
            kept.push(Kept {
                range: begin..16,
                then: None,
            });
            let column: Vec<u32> = (0..16).collect();
            let mut quickly = column.clone();
            rearrange(&mut quickly, &kept, 0);
            for (place, pair) in arrivals(&kept) {
                quickly[place] = pair[1];
            }
            assert_eq!(quickly, slowly(&column, &kept));
        }
    }
}
