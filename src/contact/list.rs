//! The contact list and the duplicate contact list of Saitoh 2.2.2.

/// The contact list: for each particle `i` its partners `j > i`, ascending, all in one row.
///
/// A contact's number is its place in this row; overlaps, forces and the rows of the matrix `A` follow the same
/// order. `N_c` contacts of `N` particles give the mean coordination number `z = 2 N_c / N`, Saitoh (5).
///
/// # Example
///
/// ```
/// use softjam::contact::list::ContactList;
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
    ///
    /// ```
    /// use softjam::contact::list::ContactList;
    ///
    /// assert!(ContactList::new(4, &[[0, 3], [0, 1]]).is_none(), "out of order");
    /// assert!(ContactList::new(4, &[[1, 1]]).is_none(), "a particle does not touch itself");
    /// assert!(ContactList::new(4, &[[1, 4]]).is_none(), "there is no particle 4");
    /// ```
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
    ///
    /// ```
    /// # use softjam::contact::list::ContactList;
    /// assert_eq!(ContactList::new(2, &[[0, 1]]).unwrap().len(), 1);
    /// ```
    #[must_use]
    pub fn len(&self) -> usize {
        self.partner.len()
    }

    /// Whether no particle touches another.
    ///
    /// ```
    /// # use softjam::contact::list::ContactList;
    /// assert!(ContactList::new(2, &[]).unwrap().is_empty());
    /// ```
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.partner.is_empty()
    }

    /// Number of particles `N`.
    ///
    /// ```
    /// # use softjam::contact::list::ContactList;
    /// assert_eq!(ContactList::new(2, &[]).unwrap().particles(), 2);
    /// ```
    #[must_use]
    pub fn particles(&self) -> usize {
        self.first.len().saturating_sub(1)
    }

    /// The partners `j > i` of particle `i`, ascending.
    ///
    /// # Panics
    ///
    /// If there is no particle `i`.
    ///
    /// ```
    /// # use softjam::contact::list::ContactList;
    /// assert_eq!(ContactList::new(3, &[[0, 2], [1, 2]]).unwrap().partners(1), [2]);
    /// ```
    #[must_use]
    pub fn partners(&self, i: usize) -> &[u32] {
        &self.partner[self.first[i] as usize..self.first[i + 1] as usize]
    }

    /// Becomes `other`, in the memory that it has.
    pub(crate) fn assign(&mut self, other: &Self) {
        self.first.clone_from(&other.first);
        self.partner.clone_from(&other.partner);
    }

    /// The pair of contact `c`, in O(log N).
    pub(crate) fn pair(&self, c: usize) -> [u32; 2] {
        let lower = self.first.partition_point(|f| *f as usize <= c);
        [lower.saturating_sub(1) as u32, self.partner[c]]
    }

    /// Number of contacts whose lower particle is in `particles`.
    pub(crate) fn count(&self, particles: core::ops::Range<usize>) -> usize {
        (self.first[particles.end] - self.first[particles.start]) as usize
    }

    /// All pairs `[i, j]`, `i < j`, in the order of the list.
    ///
    /// ```
    /// # use softjam::contact::list::ContactList;
    /// let list = ContactList::new(3, &[[0, 2], [1, 2]]).unwrap();
    /// assert_eq!(list.pairs().last(), Some([1, 2]));
    /// ```
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
/// use softjam::contact::list::{ContactList, DuplicateContactList};
///
/// let contacts = ContactList::new(4, &[[0, 1], [0, 3], [2, 3]]).unwrap();
/// let both = DuplicateContactList::of(&contacts);
/// assert_eq!(both.partners(3), [0, 2]);
/// assert_eq!(both.contacts(3), [1, 2]);
/// ```
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct DuplicateContactList {
    first: Vec<u32>,
    partner: Vec<u32>,
    contact: Vec<u32>,
    /// Where contact c stands in the row of its lower and in that of its higher particle.
    slots: Vec<[u32; 2]>,
    next: Vec<u32>,
}

impl DuplicateContactList {
    /// The duplicate list of a contact list, in O(N + `N_c`).
    ///
    /// ```
    /// # use softjam::contact::list::{ContactList, DuplicateContactList};
    /// let both = DuplicateContactList::of(&ContactList::new(2, &[[0, 1]]).unwrap());
    /// assert_eq!((both.partners(0), both.partners(1)), (&[1][..], &[0][..]));
    /// ```
    #[must_use]
    pub fn of(contacts: &ContactList) -> Self {
        let mut list = Self::default();
        list.rebuild(contacts);
        list
    }

    pub(crate) fn rebuild(&mut self, contacts: &ContactList) {
        let particles = contacts.particles();
        self.first.clear();
        self.first.resize(particles + 1, 0);
        for i in 0..particles {
            let partners = contacts.partners(i);
            self.first[i + 1] += partners.len() as u32;
            for &j in partners {
                self.first[j as usize + 1] += 1;
            }
        }
        for i in 0..particles {
            self.first[i + 1] += self.first[i];
        }
        self.next.clear();
        self.next.extend_from_slice(&self.first);
        self.partner.resize(2 * contacts.len(), 0);
        self.contact.resize(2 * contacts.len(), 0);
        self.slots.resize(contacts.len(), [0; 2]);
        let (next, partner, contact) = (&mut *self.next, &mut *self.partner, &mut *self.contact);
        let mut place = |c: u32, p: u32, q: u32| {
            let next = &mut next[p as usize];
            let slot = *next;
            *next += 1;
            (partner[slot as usize], contact[slot as usize]) = (q, c);
            slot
        };
        // Pairs ascend, so a particle meets first its lower partners and then its higher ones, each ascending.
        let mut slots = (0..).zip(&mut self.slots);
        for i in 0..particles as u32 {
            for (&j, (c, slots)) in contacts.partners(i as usize).iter().zip(&mut slots) {
                *slots = [place(c, i, j), place(c, j, i)];
            }
        }
    }

    /// Where each contact stands in the row of its lower and in that of its higher particle.
    pub(crate) fn slots(&self) -> &[[u32; 2]] {
        &self.slots
    }

    /// Number of particles.
    pub(crate) fn particles(&self) -> usize {
        self.first.len().saturating_sub(1)
    }

    /// The entries of particle `i`, as a range into rows that are parallel to this list.
    pub(crate) fn entries(&self, i: usize) -> core::ops::Range<usize> {
        self.first[i] as usize..self.first[i + 1] as usize
    }

    /// All partners of particle `i`, ascending.
    ///
    /// # Panics
    ///
    /// If there is no particle `i`.
    ///
    /// ```
    /// # use softjam::contact::list::{ContactList, DuplicateContactList};
    /// let both = DuplicateContactList::of(&ContactList::new(3, &[[0, 2], [1, 2]]).unwrap());
    /// assert_eq!(both.partners(2), [0, 1]);
    /// ```
    #[must_use]
    pub fn partners(&self, i: usize) -> &[u32] {
        &self.partner[self.entries(i)]
    }

    /// The contact numbers of particle `i`, in the order of [`partners`](Self::partners).
    ///
    /// # Panics
    ///
    /// If there is no particle `i`.
    ///
    /// ```
    /// # use softjam::contact::list::{ContactList, DuplicateContactList};
    /// let both = DuplicateContactList::of(&ContactList::new(3, &[[0, 2], [1, 2]]).unwrap());
    /// assert_eq!(both.contacts(2), [0, 1]);
    /// ```
    #[must_use]
    pub fn contacts(&self, i: usize) -> &[u32] {
        &self.contact[self.entries(i)]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_seeds_example_keeps_its_partners_in_ascending_order() {
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
}
