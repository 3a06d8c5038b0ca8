//! The contacts as they are seen from outside: in the order of pairs, and no other among them.

use super::Contacts;
use super::list::{ContactList, DuplicateContactList};
use super::matrix::ContactMatrix;
use crate::domain::Vec2;
use std::sync::OnceLock;

/// The contacts that are not at rest, in the order of pairs.
#[derive(Clone, Debug, Default)]
pub(super) struct Present {
    /// Their numbers.
    order: Vec<u32>,
    pairs: Vec<[u32; 2]>,
    normals: Vec<Vec2>,
    distances: Vec<f64>,
    overlaps: Vec<f64>,
    forces: Vec<f64>,
    particles: usize,
    matrix: OnceLock<ContactMatrix>,
}

impl Present {
    /// Those of `numbered`, the contacts of `matrix`.
    pub(super) fn of(numbered: &Contacts<'_>, matrix: &ContactMatrix) -> Self {
        let order = in_order(numbered.pairs, matrix);
        let pick = |c: &u32| *c as usize;
        Self {
            pairs: order.iter().map(|c| numbered.pairs[pick(c)]).collect(),
            normals: order.iter().map(|c| numbered.normals[pick(c)]).collect(),
            distances: order.iter().map(|c| numbered.distances[pick(c)]).collect(),
            overlaps: order.iter().map(|c| numbered.overlaps[pick(c)]).collect(),
            forces: order.iter().map(|c| numbered.forces[pick(c)]).collect(),
            particles: matrix.particles(),
            order,
            matrix: OnceLock::new(),
        }
    }

    pub(super) fn contacts(&self) -> Contacts<'_> {
        Contacts {
            pairs: &self.pairs,
            normals: &self.normals,
            distances: &self.distances,
            overlaps: &self.overlaps,
            forces: &self.forces,
        }
    }

    /// The matrix of these contacts; `whole` is that of all numbers.
    pub(super) fn matrix(&self, whole: &ContactMatrix) -> &ContactMatrix {
        self.matrix.get_or_init(|| {
            let mut list = ContactList::default();
            list.rebuild(self.particles, &self.pairs);
            let duplicate = DuplicateContactList::of(&list);
            whole.of_some(&self.order, &list, &duplicate)
        })
    }
}

/// The numbers of the contacts that are not at rest, in the order of pairs.
pub(super) fn in_order(pairs: &[[u32; 2]], matrix: &ContactMatrix) -> Vec<u32> {
    let at_work = |c: &u32| matrix.scaling()[*c as usize] > 0.0;
    let (sorted, all) = (matrix.sorted_contacts() as u32, pairs.len() as u32);
    let mut late: Vec<u32> = (sorted..all).filter(at_work).collect();
    late.sort_unstable_by_key(|c| pairs[*c as usize]);
    let mut late = late.into_iter().peekable();
    let mut order = Vec::with_capacity(pairs.len());
    for c in (0..sorted).filter(at_work) {
        while let Some(k) = late.next_if(|k| pairs[*k as usize] < pairs[c as usize]) {
            order.push(k);
        }
        order.push(c);
    }
    order.extend(late);
    order
}
