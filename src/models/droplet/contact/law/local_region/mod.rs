//! A region of contacts on which the forces are corrected: see [`local_update`](super::local_update).
//!
//! - A contact's number is that of the set; contacts that came in this local update follow after.
//! - `place` of a contact is its row in `rows` and `contacts`, or `NOWHERE`, or `GONE` if it is inactive.
//! - A particle with a block has all its active contacts in the region; a contact may have one particle without.
//! - Between local updates the region is empty, every `place` is `NOWHERE` and every `left_of` is 0.

mod descent;

use super::Violation;
use crate::models::droplet::contact::geometry::Geometry;
use crate::models::droplet::contact::matrix::compliance;
use crate::models::droplet::contact::set::ContactSet;
use crate::models::droplet::kernel::Direction;
use crate::state::{Packing, unit_and_length};

/// A contact that is in no region, and one that has left the set.
const NOWHERE: u32 = u32::MAX;
const GONE: u32 = u32::MAX - 1;

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
    forces: Vec<f64>,
    /// Where each contact is in the region, or one of the marks.
    place: Vec<u32>,
    /// The active contacts of the set that have left.
    gone: Vec<u32>,
    added: Vec<Added>,
    /// `(particle, partner, number in added)`, ascending.
    added_of: Vec<[u32; 3]>,
    /// The block of each particle, [`NOWHERE`] if it is not in the region, and the particles of the blocks.
    block: Vec<u32>,
    particles: Vec<u32>,
    /// Where the members of each particle's block end.
    ends: Vec<usize>,
    /// Places of the blocks' contacts, and their directions.
    member: Vec<u32>,
    toward: Vec<Direction>,
    /// The blocks' entries of `A`, as in [`ContactMatrix`](crate::models::droplet::contact::matrix::ContactMatrix).
    value: Vec<f64>,
    /// The contacts of the region, with their vectors.
    contacts: Vec<u32>,
    rows: Vec<Row>,
    room: Vec<(usize, Direction)>,
    /// The particles of the regions of this round, and which they are.
    visited: Vec<u32>,
    is_visited: Vec<bool>,
    /// The residual that regions have left at each contact (length), and the contacts where there is any.
    left_of: Vec<f64>,
    reached: Vec<u32>,
}

#[derive(Clone, Copy, Debug, Default)]
struct Row {
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
    /// Begins a local update, with the forces of the set, which are lent.
    pub(super) fn begin(&mut self, set: &mut ContactSet, particles: usize) {
        self.place.resize(set.len(), NOWHERE);
        self.left_of.resize(set.len(), 0.0);
        self.block.resize(particles, NOWHERE);
        self.is_visited.resize(particles, false);
        for &c in set.inactive() {
            self.place[c as usize] = GONE;
        }
        self.forces = set.lend_forces();
    }

    /// Ends the local update: lists the exchanges that were made, in the order of pairs, and returns the forces to the set, which
    /// knows nothing of the exchanges yet.
    pub(super) fn finish(&mut self, set: &mut ContactSet, exchanges: &mut Vec<Violation>) {
        exchanges.clear();
        for &c in &self.gone {
            let c = c as usize;
            exchanges.push(Violation::Drop(c, set.pairs()[c]));
        }
        let inactive = set.inactive().iter().map(|c| *c as usize);
        let added = self.added.iter().map(|added| added.pair);
        let came = inactive.zip(set.inactive_pairs());
        for (contact, pair) in came.chain((set.len()..).zip(added)) {
            if !self.is_gone(contact) {
                exchanges.push(Violation::Add(pair, self.forces[contact]));
            }
        }
        exchanges.sort_unstable_by_key(|exchange| exchange.pair());
        self.clear();
        self.begin_round();
        for c in self.reached.drain(..) {
            self.left_of[c as usize] = 0.0;
        }
        for c in self.gone.drain(..).chain(set.inactive().iter().copied()) {
            self.place[c as usize] = NOWHERE;
        }
        self.left_of.truncate(set.len());
        self.place.truncate(set.len());
        self.added.clear();
        self.added_of.clear();
        set.return_forces(core::mem::take(&mut self.forces));
    }

    /// The forces of all contacts with the exchanges that were made.
    pub(super) fn forces(&self) -> &[f64] {
        &self.forces
    }

    /// Whether a contact is inactive or has left.
    pub(super) fn is_gone(&self, contact: usize) -> bool {
        self.place[contact] == GONE
    }

    /// The active contacts of the set that have left.
    pub(super) fn gone(&self) -> &[u32] {
        &self.gone
    }

    /// The particles of this round's regions.
    pub(super) fn visited(&self) -> &[u32] {
        &self.visited
    }

    /// Whether one of the particles is in a region of this round.
    pub(super) fn is_near(&self, pair: [u32; 2]) -> bool {
        pair.iter().any(|p| self.is_visited[*p as usize])
    }

    /// A contact leaves; returns its force.
    pub(super) fn remove(&mut self, set: &ContactSet, contact: usize) -> f64 {
        self.place[contact] = GONE;
        if contact < set.len() && set.is_active(contact) {
            self.gone.push(contact as u32);
        }
        core::mem::take(&mut self.forces[contact])
    }

    /// A pair comes, or comes back, with a first guess of its force; returns its contact.
    pub(super) fn add(&mut self, whole: Whole<'_>, pair: [u32; 2], guess: f64) -> usize {
        let contact = if let Some(contact) = self.find(whole, pair) {
            self.gone.retain(|&c| c as usize != contact);
            self.place[contact] = NOWHERE;
            contact
        } else {
            let [i, j] = pair.map(|p| p as usize);
            let (normal, _) = unit_and_length(whole.packing.separation(i, j));
            let ([i, j], k) = (pair, self.added.len() as u32);
            let toward = Direction::of(-normal);
            self.added.push(Added { pair, toward });
            self.added_of.extend([[i, j, k], [j, i, k]]);
            self.added_of.sort_unstable();
            self.place.push(NOWHERE);
            self.left_of.push(0.0);
            self.forces.push(0.0);
            self.forces.len() - 1
        };
        self.forces[contact] = guess;
        contact
    }

    /// The number of a pair that came and may have gone again.
    fn find(&self, whole: Whole<'_>, pair: [u32; 2]) -> Option<usize> {
        let numbered = whole.geometry.duplicate().find(pair);
        let added = || self.find_added(pair).map(|k| whole.pairs.len() + k);
        numbered.map(|c| c as usize).or_else(added)
    }

    /// Whether a pair that the set has no number for has come, and not gone again.
    pub(super) fn has_come(&self, whole: Whole<'_>, pair: [u32; 2]) -> bool {
        let came = self.find_added(pair);
        came.is_some_and(|k| !self.is_gone(whole.pairs.len() + k))
    }

    fn find_added(&self, pair: [u32; 2]) -> Option<usize> {
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
    fn added_of(&self, p: u32) -> impl Iterator<Item = (usize, Direction)> {
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
}
