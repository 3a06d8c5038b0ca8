//! The contacts as they are seen from outside: in the order of pairs, and no other among them. And what can be read off them in
//! the order of their numbers, with the same bits.

use super::ContactLaw;
use crate::contacts::net_forces;
use crate::contacts::{Contacts, FrameContacts};
use crate::domain::Vec2;
use crate::models::droplet::contact::list::ContactList;
use crate::models::droplet::contact::matrix::{ContactMatrix, Geometry};
use core::ops::Range;
use std::sync::OnceLock;

impl ContactLaw {
    /// The contacts and forces found last.
    #[must_use]
    pub fn contacts(&self) -> Contacts<'_> {
        if self.set.is_ordered() {
            self.numbered()
        } else {
            self.ordered().contacts()
        }
    }

    /// Pairs and forces of [`contacts`](Self::contacts), copied to where others were.
    pub(crate) fn copy_contacts(&self, pairs: &mut Vec<[u32; 2]>, forces: &mut Vec<f64>) {
        pairs.clear();
        forces.clear();
        pairs.reserve(self.set.active_count());
        forces.reserve(self.set.active_count());
        for stretch in self.set.in_order() {
            pairs.extend_from_slice(&self.set.pairs()[stretch.clone()]);
            forces.extend_from_slice(&self.set.forces()[stretch]);
        }
    }

    /// The contacts in the order of their numbers, the inactive ones among them with no force.
    pub(crate) fn numbered(&self) -> Contacts<'_> {
        Contacts {
            pairs: self.set.pairs(),
            normals: self.geometry.normals(),
            distances: self.geometry.distances(),
            overlaps: self.geometry.overlaps(),
            forces: self.set.forces(),
        }
    }

    /// The matrix `A` of the contacts found last.
    #[must_use]
    pub fn matrix(&self) -> &ContactMatrix {
        if self.set.is_ordered() && self.matrix.is_complete() {
            &self.matrix
        } else {
            self.ordered().matrix(&self.matrix, &self.geometry)
        }
    }

    /// The net force on each particle into `net`, `F_i = Σ_j f_ij n_ij` (force), summed in the order of its partners: the bits
    /// of [`net_forces`] with [`contacts`](Self::contacts).
    pub(crate) fn sum_forces(&self, net: &mut [Vec2]) {
        let numbered = self.numbered();
        net_forces(&numbered, net);
        // A contact that came late is at the end of the numbers, and not in its place.
        for &p in self.set.added().as_flattened() {
            let duplicate = self.geometry.duplicate();
            let partners = duplicate.partners(p as usize).iter();
            let mut sum = Vec2::zeros();
            for (&q, &c) in partners.zip(duplicate.contacts(p as usize)) {
                let force = numbered.normals[c as usize] * numbered.forces[c as usize];
                sum += if p < q { force } else { -force };
            }
            net[p as usize] = sum;
        }
    }

    /// What came (`true`) and went in the last solution, one after the other.
    pub(crate) fn changes(&self) -> &[([u32; 2], bool)] {
        &self.changes
    }

    /// What the set of contacts was called before the last solution and is called now: the same set has the same name, and
    /// another has another but for one in 2⁶⁴.
    pub(crate) fn sets(&self) -> (u64, u64) {
        self.sets
    }

    /// Number of contacts.
    pub(crate) fn contact_count(&self) -> usize {
        self.set.active_count()
    }

    pub(super) fn ordered(&self) -> &Ordered {
        self.ordered
            .get_or_init(|| Ordered::of(&self.numbered(), &self.set.in_order(), &self.matrix))
    }
}

/// The contacts that are active, in the order of pairs.
#[derive(Clone, Debug, Default)]
pub(super) struct Ordered {
    /// Their numbers.
    order: Vec<u32>,
    contacts: FrameContacts,
    particles: usize,
    matrix: OnceLock<ContactMatrix>,
}

impl Ordered {
    /// Those `stretches` of `numbered`, the contacts of `matrix`.
    fn of(numbered: &Contacts<'_>, stretches: &[Range<usize>], matrix: &ContactMatrix) -> Self {
        let order = stretches.iter().cloned().flatten();
        Self {
            contacts: FrameContacts::picked(numbered, stretches),
            particles: matrix.particles(),
            order: order.map(|c| c as u32).collect(),
            matrix: OnceLock::new(),
        }
    }

    pub(super) fn contacts(&self) -> Contacts<'_> {
        self.contacts.view()
    }

    /// The matrix of these contacts; `whole` is that of all numbers, and `geometry` theirs.
    pub(super) fn matrix(&self, whole: &ContactMatrix, geometry: &Geometry) -> &ContactMatrix {
        self.matrix.get_or_init(|| {
            let mut list = ContactList::default();
            list.rebuild(self.particles, self.contacts.view().pairs);
            let geometry = geometry.of_some(&self.order, &list);
            whole.of_some(&self.order, &list, &geometry)
        })
    }
}
