//! Sums over contacts that no order reaches.
//!
//! A run numbers its contacts by when they came, a recording by their pairs. Terms are therefore rounded to multiples of one power
//! of two, so that the sums of them are exact: of each term at most `2⁻⁵²` of the number of terms times
//! the largest one is left out, which is what a plain sum can lose as well. (J. Demmel and H. D. Nguyen, IEEE Trans. Comput. 64, 2060 (2015).)

use crate::contact::Contacts;
use crate::wide::wide;

/// Chains that are summed side by side.
const CHAINS: usize = 8;

/// What a frame's contacts sum up to.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Sums {
    /// `Σ_c δ_c f_c` (force·length).
    pub(super) work: f64,
    /// `Σ_c f_c r_c n_α n_β` for xx, xy and yy (force·length).
    pub(super) moments: [f64; 3],
    /// Number of contacts with `f > 0`.
    pub(super) touching: usize,
}

impl Sums {
    pub(super) fn of(contacts: &Contacts<'_>) -> Self {
        wide(
            #[inline(always)]
            || Self::of_all(contacts),
        )
    }

    #[inline(always)]
    fn of_all(contacts: &Contacts<'_>) -> Self {
        let (forces, distances) = (contacts.forces, contacts.distances);
        let (normals, overlaps) = (contacts.normals, contacts.overlaps);
        // The number of terms, and bounds of them: `|n_α n_β| ≤ 1` but for rounding.
        let (mut touching, mut bearing) = ([0.0; CHAINS], [0.0; CHAINS]);
        let (mut most_moment, mut most_work) = ([0.0; CHAINS], [0.0; CHAINS]);
        each(forces.len(), |k, c| {
            let f: f64 = forces[c];
            touching[k] += if f > 0.0 { 1.0 } else { 0.0 };
            bearing[k] += if f == 0.0 { 0.0 } else { 1.0 };
            most_moment[k] = larger(most_moment[k], (f * distances[c]).abs());
            most_work[k] = larger(most_work[k], (f * overlaps[c]).abs());
        });
        let bearing = bearing.iter().sum::<f64>().max(2.0);
        let of_moments = rounder(1.01 * bearing * most_moment.into_iter().fold(0.0, larger));
        let of_work = rounder(bearing * most_work.into_iter().fold(0.0, larger));
        let (mut work, mut moments) = ([0.0; CHAINS], [[0.0; CHAINS]; 3]);
        each(forces.len(), |k, c| {
            let (f, n) = (forces[c], normals[c]);
            let moment = f * distances[c];
            let rounded = |x: f64, rounder: f64| (x + rounder) - rounder;
            work[k] += rounded(f * overlaps[c], of_work);
            moments[0][k] += rounded(moment * n.x * n.x, of_moments);
            moments[1][k] += rounded(moment * n.x * n.y, of_moments);
            moments[2][k] += rounded(moment * n.y * n.y, of_moments);
        });
        Self {
            work: work.iter().sum(),
            moments: moments.map(|chains| chains.iter().sum()),
            touching: touching.iter().sum::<f64>() as usize,
        }
    }
}

/// Calls `add` with the chain and the number of each of `count` contacts.
#[inline(always)]
fn each(count: usize, mut add: impl FnMut(usize, usize)) {
    let whole = count - count % CHAINS;
    for first in (0..whole).step_by(CHAINS) {
        for k in 0..CHAINS {
            add(k, first + k);
        }
    }
    for c in whole..count {
        add(0, c);
    }
}

#[inline(always)]
fn larger(m: f64, x: f64) -> f64 {
    if x > m { x } else { m }
}

/// A number that, added to terms and subtracted again, rounds them so that sums of magnitude up to `bound` are exact. Terms are
/// up to half of that.
#[inline(always)]
fn rounder(bound: f64) -> f64 {
    // With `p ≤ bound < 2p`, a sum of this and a term is between 2p and 4p: a multiple of 2⁻⁵¹ p, and 2⁵² of these are 2p.
    let power = f64::from_bits(bound.to_bits() & 0x7ff0_0000_0000_0000);
    3.0 * power
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::domain::Vec2;

    /// A term of each kind from contacts with forces over many orders of magnitude.
    fn columns(count: usize) -> (Vec<f64>, Vec<Vec2>, Vec<f64>, Vec<f64>) {
        let wave = |c: usize, k: f64| libm::sin(k * c as f64 + 0.3);
        let forces = (0..count).map(|c| libm::exp(-6.0 * wave(c, 1.7).abs()));
        let normals = (0..count).map(|c| {
            let (sin, cos) = libm::sincos(2.4 * c as f64);
            Vec2::new(cos, sin)
        });
        let distances = (0..count).map(|c| 1.0 + 0.3 * wave(c, 0.9));
        let overlaps = (0..count).map(|c| 0.1 * wave(c, 3.1));
        (
            forces.collect(),
            normals.collect(),
            distances.collect(),
            overlaps.collect(),
        )
    }

    #[test]
    fn sums_are_the_same_in_any_order_and_with_contacts_at_rest_among_them() {
        for count in [1, 2, 7, 8, 9, 100, 2345] {
            let (forces, normals, distances, overlaps) = columns(count);
            let sums = |order: &[usize], idle: bool| {
                let pick = |v: &[f64]| order.iter().map(|c| v[*c]).collect::<Vec<_>>();
                let mut forces = pick(&forces);
                let mut normals: Vec<_> = order.iter().map(|c| normals[*c]).collect();
                let (mut distances, mut overlaps) = (pick(&distances), pick(&overlaps));
                if idle {
                    for place in [0, forces.len() / 2, forces.len()] {
                        forces.insert(place, 0.0);
                        normals.insert(place, Vec2::new(0.6, 0.8));
                        distances.insert(place, 9.0);
                        overlaps.insert(place, -9.0);
                    }
                }
                Sums::of(&Contacts {
                    pairs: &[],
                    normals: &normals,
                    distances: &distances,
                    overlaps: &overlaps,
                    forces: &forces,
                })
            };
            let ascending: Vec<usize> = (0..count).collect();
            let mut shuffled = ascending.clone();
            shuffled.sort_by_key(|c| c * 7919 % count);
            let expected = sums(&ascending, false);
            assert_eq!(expected, sums(&shuffled, false));
            assert_eq!(expected, sums(&shuffled, true));

            // Against a plain sum from the smallest to the largest; six standard deviations of as many roundings.
            let mut terms: Vec<f64> = (0..count).map(|c| forces[c] * overlaps[c]).collect();
            terms.sort_by(|a, b| a.abs().total_cmp(&b.abs()));
            let (plain, n) = (terms.iter().sum::<f64>(), count.max(2) as f64);
            let unit = f64::EPSILON * n * terms[count - 1].abs();
            let rounding = 6.0 * (n / 12.0).sqrt() * unit;
            assert!((expected.work - plain).abs() <= rounding);
            assert_eq!(expected.touching, count);
        }
    }

    #[test]
    fn no_contacts_and_no_numbers_are_no_trouble() {
        let none = Contacts {
            pairs: &[],
            normals: &[],
            distances: &[],
            overlaps: &[],
            forces: &[],
        };
        assert_eq!(Sums::of(&none), Sums::default());
        let sums = Sums::of(&Contacts {
            normals: &[Vec2::x(); 2],
            distances: &[1.0; 2],
            overlaps: &[f64::NAN, 0.1],
            forces: &[1.0; 2],
            ..none
        });
        assert!(sums.work.is_nan());
        assert_eq!(sums.moments, [2.0, 0.0, 0.0]);
    }
}
