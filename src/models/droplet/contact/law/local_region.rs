//! A region of contacts on which the forces are corrected: see [`local_update`](super::local_update).
//!
//! - A contact's number is that of the set; contacts that came in this local update follow after.
//! - `place` of a contact is its row in `rows` and `contacts`, or `NOWHERE`, or `GONE` if it is inactive.
//! - A particle with a block has all its active contacts in the region; a contact may have one particle without.
//! - Between local updates the region is empty, every `place` is `NOWHERE` and every `left_of` is 0.

use crate::models::droplet::contact::geometry::Geometry;
use crate::models::droplet::contact::matrix::compliance;
use crate::models::droplet::kernel::Direction;
use crate::state::Packing;

/// Iterations that are tried.
const ITERATIONS: usize = 40;

/// A contact that is in no region, and one that has left the set.
pub(super) const NOWHERE: u32 = u32::MAX;
pub(super) const GONE: u32 = u32::MAX - 1;

/// A contact that came to the set.
#[derive(Clone, Debug)]
struct Added {
    pair: [u32; 2],
    /// From the lower particle to the higher.
    toward: Direction,
}

impl Added {
    fn toward_from(&self, p: u32) -> Direction {
        if self.pair[0] == p {
            self.toward
        } else {
            self.toward.opposite()
        }
    }
}

/// The region, and the exchanges of the local update that it belongs to.
#[derive(Clone, Debug, Default)]
pub(super) struct LocalRegion {
    /// The forces of all contacts with the exchanges that were made.
    pub(super) forces: Vec<f64>,
    /// Where each contact is in the region, or one of the marks.
    pub(super) place: Vec<u32>,
    /// The contacts that have left.
    pub(super) gone: Vec<u32>,
    added: Vec<Added>,
    /// `(particle, partner, number in added)`, ascending.
    pub(super) added_of: Vec<[u32; 3]>,
    /// The block of each particle, [`NOWHERE`] if it is not in the region, and the particles of the blocks.
    pub(super) block: Vec<u32>,
    pub(super) particles: Vec<u32>,
    /// Where the members of each particle's block end.
    pub(super) ends: Vec<usize>,
    /// Places of the blocks' contacts, and their directions.
    pub(super) member: Vec<u32>,
    pub(super) toward: Vec<Direction>,
    /// The blocks' entries of `A`, as in [`ContactMatrix`](crate::models::droplet::contact::matrix::ContactMatrix).
    pub(super) value: Vec<f64>,
    /// The contacts of the region, with their vectors.
    pub(super) contacts: Vec<u32>,
    pub(super) rows: Vec<Row>,
    room: Vec<(usize, Direction)>,
    /// The particles of the regions of this round, and which they are.
    pub(super) visited: Vec<u32>,
    pub(super) is_visited: Vec<bool>,
    /// The residual that regions have left at each contact (length), and the contacts where there is any.
    pub(super) left_of: Vec<f64>,
    reached: Vec<u32>,
}

#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Row {
    diagonal: f64,
    inverse: f64,
    residual: f64,
    direction: f64,
    image: f64,
    correction: f64,
}

/// What a region is cut from.
#[derive(Clone, Copy)]
pub(super) struct Whole<'a> {
    packing: &'a Packing,
    geometry: &'a Geometry,
    pairs: &'a [[u32; 2]],
    /// `1/2πγ`.
    per_radius: f64,
}

impl<'a> Whole<'a> {
    /// `per_radius` is `1/2πγ`.
    pub(super) fn of(
        packing: &'a Packing,
        geometry: &'a Geometry,
        pairs: &'a [[u32; 2]],
        per_radius: f64,
    ) -> Self {
        Self {
            packing,
            geometry,
            pairs,
            per_radius,
        }
    }
}

impl LocalRegion {
    /// The number of a pair that came and may have gone again.
    pub(super) fn find(&self, whole: Whole<'_>, pair: [u32; 2]) -> Option<usize> {
        let numbered = whole.geometry.duplicate().find(pair);
        let added = || self.find_added(pair).map(|k| whole.pairs.len() + k);
        numbered.map(|c| c as usize).or_else(added)
    }

    /// The pairs that came, some of which may have gone again.
    pub(super) fn added_pairs(&self) -> impl Iterator<Item = [u32; 2]> {
        self.added.iter().map(|added| added.pair)
    }

    pub(super) fn find_added(&self, pair: [u32; 2]) -> Option<usize> {
        let mut of = self.added_of(pair[0]).map(|(k, _)| k);
        of.find(|&k| self.added[k].pair == pair)
    }

    pub(super) fn pair(&self, whole: Whole<'_>, contact: usize) -> [u32; 2] {
        let n = whole.pairs.len();
        whole
            .pairs
            .get(contact)
            .map_or_else(|| self.added[contact - n].pair, |pair| *pair)
    }

    /// The contacts that came to particle `p`, with their directions, in the order of its partners.
    pub(super) fn added_of(&self, p: u32) -> impl Iterator<Item = (usize, Direction)> {
        let begin = self.added_of.partition_point(|a| a[0] < p);
        let of = self.added_of[begin..].iter().take_while(move |a| a[0] == p);
        of.map(move |&[_, _, k]| {
            let added = &self.added[k as usize];
            let toward = added.toward_from(p);
            (k as usize, toward)
        })
    }

    /// The contacts of particle `p` and their directions, in the order of its partners, those that came among them.
    pub(super) fn contacts_of<'a>(
        &'a self,
        whole: Whole<'a>,
        p: u32,
    ) -> impl Iterator<Item = (usize, Direction)> + 'a {
        let numbered = whole.geometry.around(p as usize);
        let mut numbered = numbered.map(|(q, c, d)| (q, c as usize, d)).peekable();
        let n = whole.pairs.len();
        let added = self.added_of(p).map(move |(k, toward)| {
            let [i, j] = self.added[k].pair;
            (i + j - p, n + k, toward)
        });
        // Both ascend by the partner.
        let mut added = added.peekable();
        core::iter::from_fn(move || {
            let first = match (numbered.peek(), added.peek()) {
                (Some(a), Some(b)) if b.0 < a.0 => added.next(),
                (Some(_), _) => numbered.next(),
                (None, _) => added.next(),
            };
            first.map(|(_, contact, toward)| (contact, toward))
        })
    }

    fn direction_at(&self, whole: Whole<'_>, p: u32, contact: usize) -> Option<Direction> {
        let n = whole.pairs.len();
        if contact >= n {
            let mut of = self.added_of(p);
            return of.find(|(k, _)| n + k == contact).map(|(_, toward)| toward);
        }
        let mut around = whole.geometry.around(p as usize);
        around.find(|a| a.1 as usize == contact).map(|a| a.2)
    }

    /// Empties the region; what was exchanged stays.
    pub(super) fn clear(&mut self) {
        for &c in &self.contacts {
            if self.place[c as usize] != GONE {
                self.place[c as usize] = NOWHERE;
            }
        }
        for &p in &self.particles {
            self.block[p as usize] = NOWHERE;
        }
        self.contacts.clear();
        self.rows.clear();
        self.particles.clear();
        self.ends.clear();
        self.member.clear();
        self.toward.clear();
        self.value.clear();
    }

    /// A new round of exchanges.
    pub(super) fn begin_round(&mut self) {
        for p in self.visited.drain(..) {
            self.is_visited[p as usize] = false;
        }
    }

    /// Takes note of where the region is and of the residual that was `left` there; returns the largest sum of what regions have
    /// left at one contact.
    pub(super) fn leave(&mut self, left: f64) -> f64 {
        for &p in &self.particles {
            if !core::mem::replace(&mut self.is_visited[p as usize], true) {
                self.visited.push(p);
            }
        }
        let there = self.contacts.iter().map(|c| self.left_of[*c as usize]);
        let sum = left + there.fold(0.0, f64::max);
        for &c in &self.contacts {
            if core::mem::replace(&mut self.left_of[c as usize], sum) == 0.0 {
                self.reached.push(c);
            }
        }
        sum
    }

    /// One more contact that came, in the direction from its lower particle to the higher.
    pub(super) fn add(&mut self, pair: [u32; 2], toward: Direction) {
        let ([i, j], k) = (pair, self.added.len() as u32);
        self.added.push(Added { pair, toward });
        self.added_of.extend([[i, j, k], [j, i, k]]);
        self.added_of.sort_unstable();
        self.place.push(NOWHERE);
        self.left_of.push(0.0);
    }

    /// Forgets the exchanges too.
    pub(super) fn finish(&mut self) {
        self.clear();
        self.begin_round();
        for c in self.reached.drain(..) {
            self.left_of[c as usize] = 0.0;
        }
        self.left_of.truncate(self.left_of.len() - self.added.len());
        for c in self.gone.drain(..) {
            self.place[c as usize] = NOWHERE;
        }
        self.place.truncate(self.place.len() - self.added.len());
        self.added.clear();
        self.added_of.clear();
    }

    /// Takes particle `p` into the region, with all its contacts.
    fn take_in(&mut self, whole: Whole<'_>, p: u32) {
        if self.block[p as usize] != NOWHERE {
            return;
        }
        self.block[p as usize] = self.particles.len() as u32;
        self.particles.push(p);
        let first = self.member.len();
        let i = p as usize;
        let mut contacts = core::mem::take(&mut self.room);
        contacts.extend(self.contacts_of(whole, p));
        for (contact, toward) in contacts.drain(..) {
            self.join(whole, contact, toward);
        }
        self.room = contacts;
        self.ends.push(self.member.len());
        let factor = -whole.packing.radii()[i] * whole.per_radius;
        let toward = &self.toward[first..];
        for b in 1..toward.len() {
            for a in &toward[..b] {
                self.value.push(factor * a.g_between(toward[b]));
            }
        }
    }

    fn join(&mut self, whole: Whole<'_>, contact: usize, toward: Direction) {
        let mut place = self.place[contact];
        if place == GONE {
            return;
        }
        if place == NOWHERE {
            place = self.contacts.len() as u32;
            self.place[contact] = place;
            self.contacts.push(contact as u32);
            let [i, j] = self.pair(whole, contact).map(|p| p as usize);
            let sum = whole.packing.radii()[i] + whole.packing.radii()[j];
            let diagonal = compliance(whole.per_radius, sum);
            self.rows.push(Row {
                diagonal,
                inverse: 1.0 / diagonal,
                ..Row::default()
            });
        }
        self.member.push(place);
        self.toward.push(toward);
    }

    /// The residual next to a contact whose force was changed by `change`.
    pub(super) fn disturb(&mut self, whole: Whole<'_>, contact: usize, change: f64) {
        for p in self.pair(whole, contact) {
            self.take_in(whole, p);
            let Some(own) = self.direction_at(whole, p, contact) else {
                continue;
            };
            let factor = -whole.packing.radii()[p as usize] * whole.per_radius;
            let block = self.block[p as usize] as usize;
            let first = if block == 0 { 0 } else { self.ends[block - 1] };
            for k in first..self.ends[block] {
                let place = self.member[k];
                if self.contacts[place as usize] as usize != contact {
                    let entry = factor * own.g_between(self.toward[k]);
                    self.rows[place as usize].residual -= entry * change;
                }
            }
        }
    }

    /// Adds the correction to the forces; returns the iterations and the largest residual left. Does nothing if the region
    /// outgrows `most` contacts or the iterations do not end.
    pub(super) fn descend(
        &mut self,
        whole: Whole<'_>,
        tolerance: f64,
        most: usize,
    ) -> Option<(usize, f64)> {
        let (mut rz, mut largest) = (0.0, 0.0f64);
        for row in &self.rows {
            rz += row.residual * row.residual * row.inverse;
            largest = largest.max(row.residual.abs());
        }
        let (mut beta, mut grown) = (0.0, 0);
        for iteration in 0..ITERATIONS {
            // A NaN hides from the largest entry, but not from the sum.
            if largest <= tolerance && f64::is_finite(rz) {
                for (row, &c) in self.rows.iter().zip(&self.contacts) {
                    self.forces[c as usize] += row.correction;
                }
                return Some((iteration, largest));
            }
            let reached = self.rows.len();
            for row in &mut self.rows {
                row.direction = row.residual * row.inverse + beta * row.direction;
            }
            for place in grown..reached {
                for p in self.pair(whole, self.contacts[place] as usize) {
                    self.take_in(whole, p);
                }
            }
            grown = reached;
            if self.rows.len() > most {
                return None;
            }
            self.product();
            let curvature: f64 = self.rows.iter().map(|row| row.direction * row.image).sum();
            if curvature.is_nan() || curvature <= 0.0 {
                return None;
            }
            let alpha = rz / curvature;
            let mut next = 0.0;
            largest = 0.0;
            for row in &mut self.rows {
                row.correction += alpha * row.direction;
                row.residual -= alpha * row.image;
                next += row.residual * row.residual * row.inverse;
                largest = largest.max(row.residual.abs());
            }
            beta = next / rz;
            rz = next;
        }
        None
    }

    /// The images of the directions.
    fn product(&mut self) {
        let rows = &mut self.rows[..];
        for row in &mut *rows {
            row.image = row.diagonal * row.direction;
        }
        let (mut first, mut values) = (0, self.value.iter());
        for &end in &self.ends {
            let members = &self.member[first..end];
            first = end;
            for (b, &cb) in members.iter().enumerate() {
                let at = rows[cb as usize].direction;
                let mut sum = 0.0;
                for (&ca, entry) in members[..b].iter().zip(&mut values) {
                    let row = &mut rows[ca as usize];
                    row.image += entry * at;
                    sum += entry * row.direction;
                }
                rows[cb as usize].image += sum;
            }
        }
    }
}
