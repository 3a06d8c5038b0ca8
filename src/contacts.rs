//! What every model tells about its contacts: pairs, normals, distances, overlaps and forces; and the net forces that they add up to.
//!
//! See the example of [`Contacts`].

use crate::domain::Vec2;
use crate::numerics::wide::wide;
use crate::state::{Frame, Packing, unit_and_length};
use core::ops::Range;

/// The contacts of a packing with what a balance of forces needs: one entry a contact in every slice.
///
/// # Example
///
/// ```
/// use softjam::models::droplet::contact::ContactLaw;
/// use softjam::domain::{Domain, Vec2};
/// use softjam::state::Packing;
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
/// use softjam::contacts::FrameContacts;
/// use softjam::protocol::Relaxation;
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
    #[must_use]
    pub fn of(packing: &Packing, frame: &Frame) -> Self {
        let mut contacts = Self {
            forces: frame.forces.clone(),
            ..Self::default()
        };
        for pair in &frame.contacts {
            let (normal, distance) = unit_and_length(between(packing, &frame.positions, *pair));
            contacts.push(packing, *pair, normal, distance);
        }
        contacts
    }

    /// Those of `pairs` that overlap, with the force that `force` makes of the sum of their radii and their overlap (lengths).
    pub(crate) fn touching(
        packing: &Packing,
        pairs: &[[u32; 2]],
        force: impl Fn(f64, f64) -> f64,
    ) -> Self {
        let mut contacts = Self::default();
        for pair in pairs {
            let (normal, distance) = unit_and_length(between(packing, packing.positions(), *pair));
            let [i, j] = pair.map(|p| packing.radii()[p as usize]);
            let sum = i + j;
            if sum > distance {
                contacts.push(packing, *pair, normal, distance);
                contacts.forces.push(force(sum, sum - distance));
            }
        }
        contacts
    }

    /// Takes all contacts out.
    pub(crate) fn clear(&mut self) {
        self.pairs.clear();
        self.normals.clear();
        self.distances.clear();
        self.overlaps.clear();
        self.forces.clear();
    }

    /// Adds a contact, which comes behind the others, along a normal of its own.
    pub(crate) fn add(
        &mut self,
        packing: &Packing,
        pair: [u32; 2],
        (normal, distance): (Vec2, f64),
        force: f64,
    ) {
        self.push(packing, pair, normal, distance);
        self.forces.push(force);
    }

    /// Adds a contact but for its force.
    fn push(&mut self, packing: &Packing, pair: [u32; 2], normal: Vec2, distance: f64) {
        let [i, j] = pair.map(|p| packing.radii()[p as usize]);
        self.pairs.push(pair);
        self.normals.push(normal);
        self.distances.push(distance);
        self.overlaps.push(i + j - distance);
    }

    /// Those `stretches` of `contacts`, one after the other.
    pub(crate) fn picked(contacts: &Contacts<'_>, stretches: &[Range<usize>]) -> Self {
        Self {
            pairs: picked(contacts.pairs, stretches),
            normals: picked(contacts.normals, stretches),
            distances: picked(contacts.distances, stretches),
            overlaps: picked(contacts.overlaps, stretches),
            forces: picked(contacts.forces, stretches),
        }
    }

    /// The contacts as slices.
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

/// `r_i − r_j`, the nearest image.
fn between(packing: &Packing, positions: &[Vec2], [i, j]: [u32; 2]) -> Vec2 {
    let difference = positions[i as usize] - positions[j as usize];
    packing.domain().minimum_image(difference)
}

/// Stretches of `values`, one after the other.
fn picked<T: Copy>(values: &[T], stretches: &[Range<usize>]) -> Vec<T> {
    let mut picked = Vec::with_capacity(values.len());
    for stretch in stretches {
        picked.extend_from_slice(&values[stretch.clone()]);
    }
    picked
}

/// Net forces of the contacts on each particle, `F_i = Σ_j f_ij n_ij` (force), summed in the order of the contact list.
///
/// # Panics
///
/// If a contact names a particle beyond `net`.
///
/// # Example
///
/// ```
/// use softjam::contacts::Contacts;
/// use softjam::domain::Vec2;
/// use softjam::contacts::net_forces;
///
/// let contacts = Contacts {
///     pairs: &[[0, 1]],
///     normals: &[Vec2::new(-1.0, 0.0)],
///     distances: &[0.9],
///     overlaps: &[0.1],
///     forces: &[0.4],
/// };
/// let mut net = vec![Vec2::zeros(); 2];
/// net_forces(&contacts, &mut net);
/// assert_eq!(net, [Vec2::new(-0.4, 0.0), Vec2::new(0.4, 0.0)]);
/// ```
pub fn net_forces(contacts: &Contacts<'_>, net: &mut [Vec2]) {
    net.fill(Vec2::zeros());
    let forces = contacts.normals.iter().zip(contacts.forces);
    let Some(&[mut first, _]) = contacts.pairs.first() else {
        return;
    };
    // Contacts of one particle follow each other: its sum stays out of memory until they end.
    let mut sum_of_first = Vec2::zeros();
    for (&[i, j], (n, &f)) in contacts.pairs.iter().zip(forces) {
        let force = n * f;
        if i != first {
            net[first as usize] = sum_of_first;
            (first, sum_of_first) = (i, net[i as usize]);
        }
        sum_of_first += force;
        net[j as usize] -= force;
    }
    net[first as usize] = sum_of_first;
}

/// `f_max`, the largest magnitude of a net force (force): the measure of equilibrium, Saitoh 2.4.
///
/// # Example
///
/// ```
/// use softjam::{domain::Vec2, contacts::largest_force};
/// assert_eq!(largest_force(&[Vec2::new(3.0, 4.0), Vec2::new(1.0, 0.0)]), 5.0);
/// assert!(largest_force(&[Vec2::new(f64::NAN, 4.0), Vec2::new(1.0, 0.0)]).is_nan());
/// ```
#[must_use]
pub fn largest_force(net: &[Vec2]) -> f64 {
    let (net4, rest) = net.as_chunks::<4>();
    let larger = |m: f64, s: f64| if s > m { s } else { m };
    let (most, sums) = wide(
        #[inline(always)]
        || {
            // A NaN hides behind comparisons, not behind a sum.
            let (mut most, mut sums) = ([0.0; 4], [0.0; 4]);
            for f in net4 {
                for k in 0..4 {
                    let squared = f[k].x * f[k].x + f[k].y * f[k].y;
                    most[k] = larger(most[k], squared);
                    sums[k] += squared;
                }
            }
            (most, sums)
        },
    );
    let rest = rest.iter().map(Vec2::norm_squared);
    let sum: f64 = sums.into_iter().chain(rest.clone()).sum();
    let most = most.into_iter().chain(rest).fold(0.0, larger);
    if sum.is_nan() { sum } else { most.sqrt() }
}
