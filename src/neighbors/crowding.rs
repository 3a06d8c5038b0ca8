//! Particles that lie on each other as no packing has them: looked for before anything is built from positions of a file.
//!
//! Each pair is counted at its smaller particle. That bounds the number of pairs by [`MOST`] times that of the particles,
//! whatever their sizes; among the few particles that fit around one without overlap, six are no smaller.

use crate::domain::{Domain, Vec2};
use crate::neighbors::octaves;
use crate::neighbors::octaves::{Grid, Seat};
use crate::state::Packing;
use std::collections::BTreeMap;

/// Particles no smaller than itself that a particle may overlap or touch. Centres strewn at random at φ = 1.3 come to about 5 on
/// average, and to some 25 in ten million.
pub(crate) const MOST: usize = 64;

/// A particle that overlaps too many others.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Crowd {
    pub particle: usize,
    /// How many others overlap it.
    pub others: usize,
}

/// The number of pairs of overlapping disks, or the first particle found that overlaps more than [`MOST`] which are no smaller. Memory is
/// proportional to the number of particles, and coincident ones are found at once.
pub(crate) fn pairs(packing: &Packing) -> Result<usize, Crowd> {
    let (domain, grids) = (packing.domain(), octaves::by_size(packing, 0.0));
    let mut pairs = 0;
    for (k, small) in grids.iter().enumerate() {
        for seat in small.seats() {
            let mut larger = 0;
            for grid in &grids[k..] {
                let (no_smaller, counted) = around(grid, domain, seat, MOST - larger);
                (larger, pairs) = (larger + no_smaller, pairs + counted);
                if larger > MOST {
                    return Err(Crowd::of(packing, seat.particle as usize));
                }
            }
        }
    }
    Ok(pairs)
}

/// Particles nearer to each other than this (smallest radii) stand on one point: in which direction they part is noise.
const POINT: f64 = 1e-3;

/// Cells along a side at most: their numbers have to be exact.
const MOST_CELLS: f64 = (1_u64 << 48) as f64;

/// The particles that stand where one of a lower number does, or on a periodic image of it, each as `[lower, particle]`; of those of
/// one point the lowest. Time is `O(N log N)` however many stand on one point.
pub(crate) fn coincident(packing: &Packing) -> Vec<[usize; 2]> {
    let (domain, reach) = (packing.domain(), POINT * packing.smallest_radius());
    let l = domain.lengths();
    // No narrower than what is looked for on both sides, so that it lies in two cells of a row at most.
    let count = |length: f64| libm::floor(length / (2.0 * reach)).clamp(1.0, MOST_CELLS);
    let cells = [count(l.x), count(l.y)];
    let cell = |at: Vec2| {
        let place = |x: f64, length: f64, cells: f64| {
            let k = libm::floor(x / length * cells);
            (if k < 0.0 {
                k + cells
            } else if k >= cells {
                k - cells
            } else {
                k
            }) as u64
        };
        [place(at.x, l.x, cells[0]), place(at.y, l.y, cells[1])]
    };
    let mut lowest: BTreeMap<[u64; 2], Vec<u32>> = BTreeMap::new();
    let mut found = Vec::new();
    for (particle, &at) in packing.positions().iter().enumerate() {
        let corners = [[-1.0, -1.0], [1.0, -1.0], [-1.0, 1.0], [1.0, 1.0]]
            .map(|[x, y]| cell(at + reach * Vec2::new(x, y)));
        let near = corners.iter().filter_map(|cell| lowest.get(cell)).flatten();
        let on = |other: &&u32| {
            let other = packing.positions()[**other as usize];
            domain.minimum_image(at - other).norm_squared() < reach * reach
        };
        match near.filter(on).min() {
            Some(&other) => found.push([other as usize, particle]),
            None => lowest.entry(cell(at)).or_default().push(particle as u32),
        }
    }
    found
}

/// The first particle that more than [`MOST`] of `contacts` join to particles which are no smaller.
#[cfg(feature = "recording")]
pub(crate) fn contacts(radii: &[f64], contacts: &[[u32; 2]]) -> Option<Crowd> {
    let mut counts = vec![[0_u32; 2]; radii.len()];
    for &[i, j] in contacts {
        let (i, j) = (i as usize, j as usize);
        counts[i][1] += 1;
        counts[j][1] += 1;
        counts[i][0] += u32::from(radii[j] >= radii[i]);
        counts[j][0] += u32::from(radii[i] >= radii[j]);
    }
    let particle = counts.iter().position(|c| c[0] as usize > MOST)?;
    let others = counts[particle][1] as usize;
    Some(Crowd { particle, others })
}

impl Crowd {
    fn of(packing: &Packing, particle: usize) -> Self {
        let radii = packing.radii();
        let overlaps = |j: &usize| {
            let sum = radii[particle] + radii[*j];
            *j != particle && packing.separation(particle, *j).norm_squared() < sum * sum
        };
        let others = (0..packing.len()).filter(overlaps).count();
        Self { particle, others }
    }
}

/// How many particles of an octave that are no smaller overlap `seat`, and how many of these pairs count here: one of equals at its
/// lower particle. Ends when there are more than `enough`.
fn around(grid: &Grid, domain: Domain, seat: &Seat, enough: usize) -> (usize, usize) {
    let one = |holds: bool| usize::from(holds);
    let (mut no_smaller, mut counted) = (0, 0);
    for others in grid.near(seat.at) {
        // Without a branch: nobody could guess who is near.
        for other in others {
            let sum = seat.radius + other.radius;
            let near = domain.minimum_image(seat.at - other.at).norm_squared() < sum * sum;
            let another = one(near) & one(other.particle != seat.particle);
            let larger = one(other.radius > seat.radius);
            let equal = one(other.radius == seat.radius);
            let first = one(seat.particle < other.particle);
            no_smaller += another & (larger | equal);
            counted += another & (larger | equal & first);
        }
        if no_smaller > enough {
            break;
        }
    }
    (no_smaller, counted)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn packing(points: &[(f64, f64, f64)], (x, y): (f64, f64)) -> Packing {
        let radii = points.iter().map(|p| p.2).collect();
        let at = points.iter().map(|p| Vec2::new(p.0 * x, p.1 * y)).collect();
        Packing::new(Domain::new(x, y).unwrap(), radii, at).unwrap()
    }

    proptest! {
        #[test]
        fn pairs_are_those_that_a_search_of_all_finds(
            points in prop::collection::vec((0.0..1.0f64, 0.0..1.0f64, 0.01..0.7f64), 1..60),
            aspect in 0.05..2.0f64,
        ) {
            let packing = packing(&points, (6.0 * aspect, 6.0));
            let radii = packing.radii();
            let overlap = |i: usize, j: usize| {
                let sum = radii[i] + radii[j];
                packing.separation(i, j).norm_squared() < sum * sum
            };
            let n = packing.len();
            let all = (0..n).map(|i| (i + 1..n).filter(|&j| overlap(i, j)).count()).sum();
            prop_assert_eq!(pairs(&packing), Ok(all));
        }
    }

    #[test]
    fn coincident_particles_are_found_at_once_and_a_speck_beside_them_changes_nothing() {
        let mut points = vec![(0.5, 0.5, 0.5); 100_000];
        for speck in [false, true] {
            if speck {
                points.push((0.1, 0.1, 1e-9));
            }
            let packing = packing(&points, (400.0, 400.0));
            let crowd = pairs(&packing).unwrap_err();
            assert_eq!(crowd.others, 99_999);
        }
    }

    proptest! {
        #[test]
        fn coincident_particles_are_those_that_a_search_of_all_finds(
            points in prop::collection::vec((0..7u8, 0..7u8, 0.0..1.2f64, 0.0..6.3f64), 1..60),
            aspect in 0.05..2.0f64,
        ) {
            // On a lattice with a place on either edge, and a little beside it.
            let l = Vec2::new(6.0 * aspect, 6.0);
            let at = |&(x, y, r, angle): &(u8, u8, f64, f64)| {
                let (sin, cos) = libm::sincos(angle);
                let place = Vec2::new(f64::from(x) * l.x, f64::from(y) * l.y) / 6.0;
                place + 1e-4 * r * Vec2::new(cos, sin)
            };
            let packing = Packing::new(
                Domain::new(l.x, l.y).unwrap(),
                vec![0.1; points.len()],
                points.iter().map(at).collect(),
            )
            .unwrap();
            let mut alone: Vec<usize> = Vec::new();
            let mut all = Vec::new();
            for k in 0..packing.len() {
                match alone.iter().find(|j| packing.separation(**j, k).norm() < 1e-4) {
                    Some(&j) => all.push([j, k]),
                    None => alone.push(k),
                }
            }
            prop_assert_eq!(coincident(&packing), all);
        }
    }

    #[test]
    fn a_million_particles_on_two_points_are_found_soon() {
        let points: Vec<_> = (0..1_000_000)
            .map(|k| (f64::from(k % 2), 0.5, 0.5))
            .collect();
        let packing = packing(&points, (400.0, 400.0));
        let found = coincident(&packing);
        assert_eq!(found.len(), 999_999, "the two are images of each other");
        assert_eq!(found[0], [0, 1]);
    }

    #[test]
    fn small_particles_around_a_large_one_are_no_crowd() {
        let around = |k: usize| {
            let (sin, cos) = libm::sincos(core::f64::consts::TAU * k as f64 / 3000.0);
            (0.5 + 0.1 * cos, 0.5 + 0.1 * sin, 0.001)
        };
        let mut points: Vec<_> = (0..3000).map(around).collect();
        points.push((0.5, 0.5, 1.0));
        let packing = packing(&points, (10.0, 10.0));
        assert!(pairs(&packing).unwrap() >= 3000);
    }

    #[test]
    #[cfg(feature = "recording")]
    fn contacts_are_counted_at_the_smaller_particle() {
        let star: Vec<[u32; 2]> = (1..=100).map(|j| [0, j]).collect();
        let mut radii = vec![1.0; 101];
        let crowd = Crowd {
            particle: 0,
            others: 100,
        };
        assert_eq!(contacts(&radii, &star), Some(crowd));
        radii[0] = 1.1;
        assert_eq!(contacts(&radii, &star), None);
    }
}
