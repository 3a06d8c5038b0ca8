//! The loops over sides and lines that gaps are summed in.

use super::sides::{LANES, Lanes, Place};
use super::state::OfDroplet;
use core::f64::consts::PI;

/// `r (K − F/2π) + d` of all sides, and what droplets have of `𝓛`, with the part `−f (d_i + d_j)` of their contacts.
#[inline(always)]
pub(super) fn find_hollows(
    places: &[Place],
    (droplets, dents, corners): (&[OfDroplet], &[f64], &[f64]),
    kernel: &[Lanes],
    hollows: &mut [Lanes],
) -> f64 {
    let mut lagrangian = 0.0;
    for place in places {
        let p = place.droplet();
        let (droplet, dent, r) = (&droplets[p], dents[p], corners[p]);
        lagrangian += r * droplet.second + (PI * dent * dent / r - droplet.force * dent);
        let share = droplet.force * (0.5 / PI);
        for g in place.groups() {
            let (kernel, mut hollow) = (&kernel[g], [0.0; LANES]);
            for k in 0..LANES {
                hollow[k] = dent + r * (kernel[k] - share);
            }
            hollows[g] = hollow;
        }
    }
    lagrangian
}

/// The gaps between straight films, and what contacts have of `𝓛`: `f (R_i + R_j − n·Δx)`.
#[inline(always)]
pub(super) fn find_gaps(
    (overlaps, shorter): (&[f64], &[f64]),
    (sides, hollows): (&[[u32; 2]], &[f64]),
    (loads, give): (&[f64], f64),
    gaps: &mut [f64],
) -> f64 {
    let mut lagrangian = 0.0;
    let lines = overlaps.iter().zip(shorter).zip(sides.iter().zip(loads));
    for (gap, ((overlap, shorter), ([a, b], load))) in gaps.iter_mut().zip(lines) {
        let (depth, soft) = (overlap + shorter, give * load);
        *gap = hollows[*a as usize] + hollows[*b as usize] - depth + soft;
        lagrangian += load * (depth - 0.5 * soft);
    }
    lagrangian
}

/// What two columns have of each line.
#[inline(always)]
pub(super) fn pairs_of([first, second]: [&[f64]; 2]) -> impl Iterator<Item = [f64; 2]> {
    first.iter().zip(second).map(|(a, b)| [*a, *b])
}
