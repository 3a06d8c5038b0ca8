//! Sums over the contacts of a frame that no order reaches: a run numbers its contacts by when they came, a recording by their pairs.

use crate::contacts::Contacts;
use crate::numerics::exact_sum::{Rounder, larger};

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
        let (forces, normals) = (contacts.forces, contacts.normals);
        let (distances, overlaps) = (contacts.distances, contacts.overlaps);
        let mut sums = Self::default();
        // The number of terms and the largest ones: `|n_α n_β| ≤ 1` but for rounding.
        let (mut terms, mut moment, mut work) = (0, 0.0, 0.0);
        for (f, (r, delta)) in forces.iter().zip(distances.iter().zip(overlaps)) {
            sums.touching += usize::from(*f > 0.0);
            terms += usize::from(*f != 0.0);
            moment = larger(moment, (f * r).abs());
            work = larger(work, (f * delta).abs());
        }
        let terms = terms.max(2) as f64;
        let of_moments = Rounder::up_to(1.01 * terms * moment);
        let of_work = Rounder::up_to(terms * work);
        let [xx, xy, yy] = &mut sums.moments;
        for (c, n) in normals.iter().enumerate() {
            let moment = forces[c] * distances[c];
            *xx += of_moments.round(moment * n.x * n.x);
            *xy += of_moments.round(moment * n.x * n.y);
            *yy += of_moments.round(moment * n.y * n.y);
            sums.work += of_work.round(forces[c] * overlaps[c]);
        }
        sums
    }
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
        for count in [1, 2, 7, 100, 2345] {
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
