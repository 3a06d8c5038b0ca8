//! Whether a box is large enough for its particles: no two may touch across two sides of it.
//!
//! A pair of particles has one contact, at its nearest image. In a small box a second image of the same neighbour, or of
//! the particle itself, can come within reach; then the contact problem that was solved lacks a contact and its answer
//! means nothing. Images other than the nearest are at least half a side away, so that a bound of the bulges settles the
//! question for nearly all particles; for the others the contours themselves are asked.

use super::Contacts;
use crate::domain::Vec2;
use crate::droplet::kernel::Direction;
use crate::packing::{Packing, unit_and_length};
use core::f64::consts::PI;

/// A particle and one whose second image its contour overlaps by more than `tolerance` (length), the first in order.
///
/// `reach` bounds the contour of each particle from outside (length), `line_tension` is γ. Costs O(N) for each particle
/// whose reach exceeds a quarter of the shorter side, nothing else.
pub(super) fn second_image(
    packing: &Packing,
    contacts: &Contacts<'_>,
    line_tension: f64,
    reach: impl Fn(usize) -> f64,
    tolerance: f64,
) -> Option<(usize, usize)> {
    let half = 0.5 * packing.domain().shortest();
    // Of two particles that reach half a side together, one reaches a quarter.
    let far: Vec<usize> = (0..packing.len())
        .filter(|&i| 2.0 * reach(i) > half)
        .collect();
    for i in far {
        for j in 0..packing.len() {
            let together = reach(i) + reach(j);
            if together <= half {
                continue;
            }
            for separation in farther_images(packing, i, j, together) {
                let (normal, distance) = unit_and_length(separation);
                let to_j = Direction::of(-normal);
                let gap = distance
                    - contour(packing, contacts, line_tension, i, to_j)
                    - contour(packing, contacts, line_tension, j, to_j.opposite());
                if gap.is_nan() || gap < -tolerance {
                    return Some((i, j));
                }
            }
        }
    }
    None
}

/// `r_i − r_j` to all images of `j` closer than `reach`, but for the nearest.
fn farther_images(
    packing: &Packing,
    i: usize,
    j: usize,
    reach: f64,
) -> impl Iterator<Item = Vec2> + use<> {
    let l = packing.domain().lengths();
    let nearest = packing.separation(i, j);
    // A reach is capped by the caller; the cap here only keeps a wrong one from a long loop.
    let count = |side: f64| libm::ceil(reach / side).clamp(1.0, 16.0) as i32;
    let (columns, rows) = (count(l.x), count(l.y));
    (-columns..=columns)
        .flat_map(move |x| (-rows..=rows).map(move |y| (x, y)))
        .filter(|image| *image != (0, 0))
        .map(move |(x, y)| nearest + Vec2::new(f64::from(x) * l.x, f64::from(y) * l.y))
        .filter(move |separation| separation.norm_squared() < reach * reach)
}

/// `ρ_p` in a direction, Saitoh (1) and (3).
fn contour(
    packing: &Packing,
    contacts: &Contacts<'_>,
    line_tension: f64,
    p: usize,
    direction: Direction,
) -> f64 {
    let mut sum = 0.0;
    for (c, &[i, j]) in contacts.pairs.iter().enumerate() {
        let to_j = Direction::of(-contacts.normals[c]);
        if i as usize == p {
            sum += contacts.forces[c] * direction.g_between(to_j);
        } else if j as usize == p {
            sum += contacts.forces[c] * direction.g_between(to_j.opposite());
        }
    }
    packing.radii()[p] * (1.0 + sum / (2.0 * PI * line_tension))
}
