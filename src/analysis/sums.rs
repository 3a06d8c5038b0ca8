//! Sums over contacts that no order reaches.
//!
//! A run numbers its contacts by when they came, a recording by their pairs. Terms are therefore rounded to multiples of one power
//! of two, so that the sums of them are exact: of each term at most `2⁻⁵²` of the number of terms times
//! the largest one is left out, which is what a plain sum can lose as well. (J. Demmel and H. D. Nguyen, IEEE Trans. Comput. 64, 2060 (2015).)

use crate::contacts::Contacts;
use crate::domain::Vec2;
use crate::numerics::sums::{CHAINS, larger, rounder};
use crate::numerics::wide::wide;

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
        let (forces, f_rest) = contacts.forces.as_chunks();
        let (normals, n_rest) = contacts.normals.as_chunks();
        let (distances, r_rest) = contacts.distances.as_chunks();
        let (overlaps, delta_rest) = contacts.overlaps.as_chunks();
        // The last are filled up with contacts without a force.
        let [mut f, mut r, mut delta] = [[0.0; CHAINS]; 3];
        let mut n = [Vec2::zeros(); CHAINS];
        f[..f_rest.len()].copy_from_slice(f_rest);
        n[..n_rest.len()].copy_from_slice(n_rest);
        r[..r_rest.len()].copy_from_slice(r_rest);
        delta[..delta_rest.len()].copy_from_slice(delta_rest);

        // Each loop is compiled apart: with all that they add up together there are not enough registers.
        // The number of terms, and bounds of them: `|n_α n_β| ≤ 1` but for rounding.
        let bounds = wide(
            #[inline(always)]
            || {
                let mut bounds = Bounds::default();
                for (f, (r, delta)) in forces.iter().zip(distances.iter().zip(overlaps)) {
                    bounds.take(f, r, delta);
                }
                bounds.take(&f, &r, &delta);
                bounds
            },
        );
        let terms = bounds.bearing.iter().sum::<f64>().max(2.0);
        let largest = |chains: [f64; CHAINS]| chains.into_iter().fold(0.0, larger);
        let of_moments = rounder(1.01 * terms * largest(bounds.moment));
        let of_work = rounder(terms * largest(bounds.work));

        let work = wide(
            #[inline(always)]
            || {
                let mut work = [0.0; CHAINS];
                for (f, delta) in forces.iter().zip(overlaps) {
                    add_work(&mut work, f, delta, of_work);
                }
                add_work(&mut work, &f, &delta, of_work);
                work
            },
        );
        let moments = wide(
            #[inline(always)]
            || {
                let mut moments = [[0.0; CHAINS]; 3];
                for (f, (r, n)) in forces.iter().zip(distances.iter().zip(normals)) {
                    add_moments(&mut moments, f, r, n, of_moments);
                }
                add_moments(&mut moments, &f, &r, &n, of_moments);
                moments
            },
        );
        Self {
            work: work.iter().sum(),
            moments: moments.map(|chains| chains.iter().sum()),
            touching: bounds.touching.iter().sum::<f64>() as usize,
        }
    }
}

/// Numbers and bounds of the terms, in chains.
#[derive(Clone, Copy, Default)]
struct Bounds {
    touching: [f64; CHAINS],
    bearing: [f64; CHAINS],
    moment: [f64; CHAINS],
    work: [f64; CHAINS],
}

impl Bounds {
    #[inline(always)]
    fn take(&mut self, f: &[f64; CHAINS], r: &[f64; CHAINS], delta: &[f64; CHAINS]) {
        let Self {
            touching,
            bearing,
            moment,
            work,
        } = self;
        for k in 0..CHAINS {
            touching[k] += if f[k] > 0.0 { 1.0 } else { 0.0 };
        }
        for k in 0..CHAINS {
            bearing[k] += if f[k] == 0.0 { 0.0 } else { 1.0 };
        }
        for k in 0..CHAINS {
            moment[k] = larger(moment[k], (f[k] * r[k]).abs());
        }
        for k in 0..CHAINS {
            work[k] = larger(work[k], (f[k] * delta[k]).abs());
        }
    }
}

#[inline(always)]
fn add_work(work: &mut [f64; CHAINS], f: &[f64; CHAINS], delta: &[f64; CHAINS], rounder: f64) {
    for k in 0..CHAINS {
        work[k] += (f[k] * delta[k] + rounder) - rounder;
    }
}

#[inline(always)]
fn add_moments(
    [xx, xy, yy]: &mut [[f64; CHAINS]; 3],
    f: &[f64; CHAINS],
    r: &[f64; CHAINS],
    n: &[Vec2; CHAINS],
    rounder: f64,
) {
    let [mut x, mut y, mut moment] = [[0.0; CHAINS]; 3];
    for k in 0..CHAINS {
        (x[k], y[k]) = (n[k].x, n[k].y);
    }
    for k in 0..CHAINS {
        moment[k] = f[k] * r[k];
    }
    for k in 0..CHAINS {
        xx[k] += (moment[k] * x[k] * x[k] + rounder) - rounder;
    }
    for k in 0..CHAINS {
        xy[k] += (moment[k] * x[k] * y[k] + rounder) - rounder;
    }
    for k in 0..CHAINS {
        yy[k] += (moment[k] * y[k] * y[k] + rounder) - rounder;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numerics::sums::sum_of_forces;

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

            let backwards: Vec<f64> = forces.iter().rev().copied().chain([0.0]).collect();
            let of_forces = sum_of_forces(&forces);
            assert_eq!(of_forces, sum_of_forces(&backwards));
            let plain: f64 = backwards.iter().sum();
            assert!((of_forces.1 - plain).abs() <= 1e-12 * plain);
            assert_eq!(of_forces.0, count as f64);

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
