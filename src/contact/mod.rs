//! The contact problem: which particles touch, and with what forces.
//!
//! For a set of contacts the forces solve `A f = δ`, Saitoh (4)–(6): [`matrix`] builds `A`, [`solver`] solves. Which
//! pairs *are* in contact is part of the answer. The gap between the deformed contours of a pair is
//!
//! ```text
//! gap_ij = r_ij − ρ_i(θ_j) − ρ_j(θ_i) = (A f)_ij − δ_ij          (= −Δ_ij in Saitoh 2.2.4)
//! ```
//!
//! and the contact law asks, over all candidate pairs, for
//!
//! ```text
//! f ≥ 0,   gap ≥ 0,   f · gap = 0                                 (a linear complementarity problem)
//! ```
//!
//! that is, for the minimum of `½ fᵀA f − δᵀf` over `f ≥ 0`. `A` is positive definite, so there is exactly one answer:
//! the contact list is a function of the positions alone. [`complementarity`] finds it by exchanging contacts between
//! the two sides; Saitoh's drop-and-add rule is one such exchange and can be had on its own.
//!
//! [`ContactLaw`] is what the rest of the crate sees: positions in, contacts and forces out. A second law would be
//! added behind it.

mod blocks;
mod bulges;
pub mod complementarity;
mod error;
mod fill;
mod geometry;
#[cfg(test)]
mod history;
mod images;
mod law;
pub mod list;
pub mod matrix;
mod mend;
mod patch;
mod present;
pub(crate) mod product;
mod refresh;
mod search;
mod sight;
pub mod solver;
mod tolerance;

pub use error::ContactError;
pub use law::{ContactLaw, Rule, Work};
pub(crate) use tolerance::ACCEPTED;
pub use tolerance::due_tolerance;

use crate::domain::Vec2;
use crate::frame::Frame;
use crate::packing::{Packing, unit_and_length};

/// The contacts of a packing with what a balance of forces needs: one entry a contact in every slice.
///
/// # Example
///
/// ```
/// use softjam::contact::ContactLaw;
/// use softjam::domain::{Domain, Vec2};
/// use softjam::packing::Packing;
///
/// let at = |x| Vec2::new(x, 2.0);
/// let packing = Packing::new(Domain::new(8.0, 8.0).unwrap(), vec![0.5; 2], vec![at(1.0), at(1.9)]).unwrap();
/// let mut law = ContactLaw::default();
/// law.solve(&packing, &[], &[]).unwrap();
/// let contacts = law.contacts();
/// assert_eq!(contacts.pairs, [[0, 1]]);
/// // One contact on its own is a spring of stiffness 4πγ / 3 (R_i + R_j).
/// assert!((contacts.forces[0] - 0.1 * 4.0 * std::f64::consts::PI / 3.0).abs() < 1e-13);
/// ```
#[derive(Clone, Copy, Debug)]
pub struct Contacts<'a> {
    /// The pairs `[i, j]`, `i < j`, ascending.
    pub pairs: &'a [[u32; 2]],
    /// The unit vectors `n_ij` from `j` to `i`.
    pub normals: &'a [Vec2],
    /// The centre distances `r_ij` (length).
    pub distances: &'a [f64],
    /// The overlaps of the undeformed disks `δ_ij` (length).
    pub overlaps: &'a [f64],
    /// The force magnitudes `f_ij` (force); `f_ij n_ij` acts on `i`.
    pub forces: &'a [f64],
}

/// The contacts of a frame, with their geometry recomputed from its positions: the same bits as in the run.
///
/// # Example
///
/// ```
/// use softjam::contact::FrameContacts;
/// use softjam::relax::Relaxation;
/// use softjam::scene::Scene;
///
/// let relaxation = Relaxation::new(&Scene { particles: 32, ..Scene::default() }).unwrap();
/// let contacts = FrameContacts::of(relaxation.packing(), &relaxation.frame());
/// assert_eq!(contacts.view().overlaps, relaxation.contacts().overlaps);
/// ```
#[derive(Clone, Debug, Default)]
pub struct FrameContacts {
    pairs: Vec<[u32; 2]>,
    normals: Vec<Vec2>,
    distances: Vec<f64>,
    overlaps: Vec<f64>,
    forces: Vec<f64>,
}

impl FrameContacts {
    /// The contacts of `frame`; `packing` gives the radii and the box, its positions are not used.
    ///
    /// # Panics
    ///
    /// If the frame names a particle that the packing lacks; a frame that came through [`Frame::validate`] does not.
    ///
    /// See the example of [`FrameContacts`].
    #[must_use]
    pub fn of(packing: &Packing, frame: &Frame) -> Self {
        let mut contacts = Self {
            pairs: frame.contacts.clone(),
            forces: frame.forces.clone(),
            ..Self::default()
        };
        let domain = packing.domain();
        for &[i, j] in &frame.contacts {
            let (i, j) = (i as usize, j as usize);
            let separation = domain.minimum_image(frame.positions[i] - frame.positions[j]);
            let (normal, distance) = unit_and_length(separation);
            contacts.normals.push(normal);
            contacts.distances.push(distance);
            contacts
                .overlaps
                .push(packing.radii()[i] + packing.radii()[j] - distance);
        }
        contacts
    }

    /// The contacts as slices.
    ///
    /// ```
    /// assert!(softjam::contact::FrameContacts::default().view().pairs.is_empty());
    /// ```
    #[must_use]
    pub fn view(&self) -> Contacts<'_> {
        Contacts {
            pairs: &self.pairs,
            normals: &self.normals,
            distances: &self.distances,
            overlaps: &self.overlaps,
            forces: &self.forces,
        }
    }
}
