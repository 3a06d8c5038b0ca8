//! The contact list and the duplicate contact list of Saitoh 2.2.2.
//!
//! See the example of [`ContactList`].

use core::ops::Range;

/// The contact list: for each particle `i` its partners `j > i`, ascending, all in one row.
///
/// A contact's number is its place in this row; overlaps, forces and the rows of the matrix `A` follow the same
/// order. `N_c` contacts of `N` particles give the mean coordination number `z = 2 N_c / N`, Saitoh (5).
///
/// # Example
///
/// ```
/// use softjam::models::droplet::contact::list::ContactList;
///
/// let contacts = ContactList::new(4, &[[0, 1], [0, 3], [2, 3]]).unwrap();
/// assert_eq!(contacts.len(), 3);
/// assert_eq!(contacts.partners(0), [1, 3]);
/// assert_eq!(contacts.pairs().collect::<Vec<_>>(), [[0, 1], [0, 3], [2, 3]]);
/// ```
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct ContactList {
    /// The partners of `i` are `partner[first[i]..first[i + 1]]`.
    first: Vec<u32>,
    partner: Vec<u32>,
}

impl ContactList {
    /// The list of `pairs` among `particles` particles; `None` unless every pair has `i < j < particles` and the
    /// pairs ascend strictly.
    #[must_use]
    pub fn new(particles: usize, pairs: &[[u32; 2]]) -> Option<Self> {
        let ascending = pairs.windows(2).all(|w| w[0] < w[1]);
        let valid = pairs
            .iter()
            .all(|&[i, j]| i < j && (j as usize) < particles);
        let mut list = Self::default();
        (ascending && valid && pairs.len() < u32::MAX as usize)
            .then(|| list.rebuild(particles, pairs))?;
        Some(list)
    }

    /// Rebuilds the list in place from pairs known to ascend.
    pub(crate) fn rebuild(&mut self, particles: usize, pairs: &[[u32; 2]]) {
        self.first.clear();
        self.first.resize(particles + 1, 0);
        self.partner.clear();
        self.partner.extend(pairs.iter().map(|p| p[1]));
        for p in pairs {
            self.first[p[0] as usize + 1] += 1;
        }
        for i in 0..particles {
            self.first[i + 1] += self.first[i];
        }
    }

    /// Number of contacts `N_c`.
    #[must_use]
    pub fn len(&self) -> usize {
        self.partner.len()
    }

    /// Whether no particle touches another.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.partner.is_empty()
    }

    /// Number of particles `N`.
    #[must_use]
    pub fn particles(&self) -> usize {
        self.first.len().saturating_sub(1)
    }

    /// The partners `j > i` of particle `i`, ascending.
    ///
    /// # Panics
    ///
    /// If there is no particle `i`.
    #[must_use]
    pub fn partners(&self, i: usize) -> &[u32] {
        &self.partner[self.first[i] as usize..self.first[i + 1] as usize]
    }

    /// All pairs `[i, j]`, `i < j`, in the order of the list.
    pub fn pairs(&self) -> impl Iterator<Item = [u32; 2]> + '_ {
        (0..self.particles())
            .flat_map(move |i| self.partners(i).iter().map(move |&j| [i as u32, j]))
    }
}

/// The duplicate contact list: for each particle *all* its partners, ascending, each with the number of the contact.
///
/// # Example
///
/// ```
/// use softjam::models::droplet::contact::list::{ContactList, DuplicateContactList};
///
/// let contacts = ContactList::new(4, &[[0, 1], [0, 3], [2, 3]]).unwrap();
/// let both = DuplicateContactList::of(&contacts);
/// assert_eq!(both.partners(3), [0, 2]);
/// assert_eq!(both.contacts(3), [1, 2]);
/// ```
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct DuplicateContactList {
    /// Where the row of each particle begins and ends.
    rows: Vec<[u32; 2]>,
    partner: Vec<u32>,
    contact: Vec<u32>,
}

impl DuplicateContactList {
    /// The duplicate list of a contact list, in O(N + `N_c`).
    #[must_use]
    pub fn of(contacts: &ContactList) -> Self {
        let mut list = Self::default();
        list.rebuild(contacts);
        list
    }

    pub(crate) fn rebuild(&mut self, contacts: &ContactList) {
        let particles = contacts.particles();
        self.rows.clear();
        self.rows.resize(particles, [0; 2]);
        for i in 0..particles {
            let partners = contacts.partners(i);
            self.rows[i][0] += partners.len() as u32;
            for &j in partners {
                self.rows[j as usize][0] += 1;
            }
        }
        let mut end = 0;
        for row in &mut self.rows {
            let begin = end;
            end += row[0];
            *row = [begin; 2];
        }
        self.partner.clear();
        self.partner.resize(2 * contacts.len(), 0);
        self.contact.clear();
        self.contact.resize(2 * contacts.len(), 0);
        let (rows, partner, contact) = (&mut *self.rows, &mut *self.partner, &mut *self.contact);
        let mut place = |c: u32, p: u32, q: u32| {
            let end = &mut rows[p as usize][1];
            let slot = *end;
            *end += 1;
            (partner[slot as usize], contact[slot as usize]) = (q, c);
        };
        // Pairs ascend, so a particle meets first its lower partners and then its higher ones, each ascending.
        for (c, [i, j]) in (0..).zip(contacts.pairs()) {
            place(c, i, j);
            place(c, j, i);
        }
    }

    /// Adds contact `number` between two particles: their rows move to the end, each with the new partner in its place.
    pub(super) fn add(&mut self, number: u32, [i, j]: [u32; 2]) {
        for [p, q] in [[i, j], [j, i]] {
            let row = self.entries(p as usize);
            let place = self.partners(p as usize).partition_point(|k| *k < q);
            let (begin, at) = (self.partner.len(), row.start + place);
            self.partner.extend_from_within(row.start..at);
            self.partner.push(q);
            self.partner.extend_from_within(at..row.end);
            self.contact.extend_from_within(row.start..at);
            self.contact.push(number);
            self.contact.extend_from_within(at..row.end);
            self.rows[p as usize] = [begin as u32, self.partner.len() as u32];
        }
    }

    /// The number of the contact between two particles.
    pub(super) fn find(&self, [i, j]: [u32; 2]) -> Option<u32> {
        let place = self.partners(i as usize).iter().position(|k| *k == j)?;
        Some(self.contacts(i as usize)[place])
    }

    /// Number of particles.
    pub(super) fn particles(&self) -> usize {
        self.rows.len()
    }

    /// The entries of particle `i`, as a range into rows that are parallel to this list.
    pub(super) fn entries(&self, i: usize) -> Range<usize> {
        let [begin, end] = self.rows[i];
        begin as usize..end as usize
    }

    /// The ends of the contacts in the row `entries` of particle `p`: `2c` for contact `c` of which it is the lower particle,
    /// `2c + 1` of which it is the higher.
    #[inline(always)]
    pub(super) fn ends(&self, p: u32, entries: Range<usize>) -> impl Iterator<Item = u32> {
        let partners = self.partner[entries.clone()].iter();
        let numbers = self.contact[entries].iter();
        let end = move |(q, c): (&u32, &u32)| 2 * c + u32::from(*q < p);
        partners.zip(numbers).map(end)
    }

    /// All partners of particle `i`, ascending.
    ///
    /// # Panics
    ///
    /// If there is no particle `i`.
    #[must_use]
    pub fn partners(&self, i: usize) -> &[u32] {
        &self.partner[self.entries(i)]
    }

    /// The contact numbers of particle `i`, in the order of [`partners`](Self::partners).
    ///
    /// # Panics
    ///
    /// If there is no particle `i`.
    #[must_use]
    pub fn contacts(&self, i: usize) -> &[u32] {
        &self.contact[self.entries(i)]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn saitohs_example_keeps_its_partners_in_ascending_order() {
        // Saitoh 2.2.2: particle i with partners 5, 2, 10, 7 is listed as {2, 5, 7, 10}.
        let mut pairs = vec![[1, 5], [1, 2], [1, 10], [1, 7], [0, 1]];
        pairs.sort_unstable();
        let list = ContactList::new(11, &pairs).unwrap();
        assert_eq!(list.partners(1), [2, 5, 7, 10]);
        let both = DuplicateContactList::of(&list);
        assert_eq!(both.partners(1), [0, 2, 5, 7, 10]);
        assert_eq!(both.contacts(1), [0, 1, 2, 3, 4]);
        assert_eq!(both.partners(7), [1]);
    }

    #[test]
    fn rows_with_contacts_added_are_those_of_a_list_made_with_them() {
        let all = [[0, 1], [0, 4], [1, 2], [1, 4], [2, 3], [3, 4]];
        for late in 0..1u32 << all.len() {
            let is_late = |k: usize| late >> k & 1 == 1;
            let numbers = 0..all.len();
            let (first, then): (Vec<_>, Vec<_>) = numbers.partition(|k| !is_late(*k));
            let base: Vec<_> = first.iter().map(|k| all[*k]).collect();
            let mut list = DuplicateContactList::of(&ContactList::new(5, &base).unwrap());
            // Added from the last to the first, so that they come before others.
            let order: Vec<usize> = first.into_iter().chain(then.into_iter().rev()).collect();
            for &k in &order[base.len()..] {
                let number = order.iter().position(|o| *o == k).unwrap();
                list.add(number as u32, all[k]);
            }
            let whole = DuplicateContactList::of(&ContactList::new(5, &all).unwrap());
            for p in 0..5 {
                assert_eq!(list.partners(p), whole.partners(p));
                let numbers = list.contacts(p).iter().map(|c| order[*c as usize] as u32);
                assert!(numbers.eq(whole.contacts(p).iter().copied()));
            }
            for (c, &k) in order.iter().enumerate() {
                assert_eq!(list.find(all[k]), Some(c as u32));
            }
            assert_eq!(list.find([2, 4]), None);
        }
    }
}
