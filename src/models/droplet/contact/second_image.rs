//! Whether a box is large enough for its particles: no two may touch across two sides of it.
//!
//! A pair of particles has one contact, at its nearest image. In a small box a second image of the same neighbour, or of
//! the particle itself, can come within reach; then the contact problem that was solved lacks a contact and its answer
//! means nothing. Images other than the nearest are at least half a side away, so that a bound of the bulges settles the
//! question for nearly all particles; for the others the contours themselves are asked.

use super::bulges::{WIDER, most_of};
use super::geometry::Geometry;
use crate::domain::Vec2;
use crate::models::droplet::kernel::Direction;
use crate::state::{Packing, unit_and_length};

/// Particles with the forces on them. All sums run in the order of a particle's partners.
#[derive(Clone, Copy)]
pub(super) struct Loaded<'a> {
    pub(super) packing: &'a Packing,
    pub(super) geometry: &'a Geometry,
    pub(super) forces: &'a [f64],
    /// `1/2πγ`.
    pub(super) per_radius: f64,
}

impl Loaded<'_> {
    /// A bound of the bulge of particle `p` (length); see [`bulges`](super::bulges).
    pub(super) fn bulge(self, p: usize) -> f64 {
        let on = self.geometry.duplicate().contacts(p).iter();
        let bulges = on.map(|&c| most_of(self.forces[c as usize]));
        WIDER * bulges.sum::<f64>() * self.packing.radii()[p] * self.per_radius
    }

    /// `ρ_p` in a direction, Saitoh (1) and (3).
    fn contour(self, p: usize, direction: Direction) -> f64 {
        let around = self.geometry.around(p);
        let terms =
            around.map(|(_, c, toward)| self.forces[c as usize] * direction.g_between(toward));
        self.packing.radii()[p] * (1.0 + terms.sum::<f64>() * self.per_radius)
    }
}

/// A particle and one whose second image its contour overlaps by more than `tolerance` (length), the lower first; the first such
/// pair in order.
///
/// `reach` bounds the contour of each particle from outside (length); a wider bound finds the same. Whose second image is in reach, its
/// nearest is too: `near` holds at least the pairs `i < j` that reach each other, ascending.
pub(super) fn second_image(
    particles: Loaded<'_>,
    near: &[[u32; 2]],
    reach: impl Fn(usize) -> f64,
    tolerance: f64,
) -> Option<(usize, usize)> {
    let packing = particles.packing;
    let half = 0.5 * packing.domain().shortest();
    let touches = |&(i, j): &(usize, usize)| {
        let together = reach(i) + reach(j);
        // No image but the nearest is nearer than half a side.
        together > half
            && farther_images(packing, i, j, together).any(|separation| {
                let (normal, distance) = unit_and_length(separation);
                let to_j = Direction::of(-normal);
                let gap =
                    distance - particles.contour(i, to_j) - particles.contour(j, to_j.opposite());
                gap.is_nan() || gap < -tolerance
            })
    };
    let own = (0..packing.len()).map(|i| (i, i)).find(touches);
    let pairs = near.iter().map(|pair| (pair[0] as usize, pair[1] as usize));
    let other = pairs
        .take_while(|pair| own.is_none_or(|own| *pair < own))
        .find(touches);
    other.or(own)
}

/// `r_i − r_j` to all images of `j` closer than `reach`, but for the nearest.
pub(in crate::models::droplet) fn farther_images(
    packing: &Packing,
    i: usize,
    j: usize,
    reach: f64,
) -> impl Iterator<Item = Vec2> + use<> {
    let (domain, l) = (packing.domain(), packing.domain().lengths());
    let nearest = packing.separation(i, j);
    // A reach is capped by the caller; the cap here only keeps a wrong one from a long loop.
    let count = |side: f64| libm::ceil(reach / side).clamp(1.0, 16.0) as i32;
    let (columns, rows) = (count(l.x), count(l.y));
    (-columns..=columns)
        .flat_map(move |x| (-rows..=rows).map(move |y| (x, y)))
        .filter(|image| *image != (0, 0))
        .map(move |(x, y)| nearest + domain.period(x, y))
        .filter(move |separation| separation.norm_squared() < reach * reach)
}
