//! Forces of the disks, the hot loop of their relaxation.

use super::stiffness_sum;
use crate::contacts::largest_force;
use crate::domain::{Domain, Vec2};
use crate::numerics::wide::wide;
use crate::state::Packing;

/// Candidate pairs, ascending, with the sums `R_i + R_j` of their radii.
#[derive(Clone, Debug, Default)]
pub(super) struct Candidates {
    pairs: Vec<[u32; 2]>,
    sums: Vec<f64>,
}

impl Candidates {
    pub(super) fn renew(&mut self, radii: &[f64], pairs: &[[u32; 2]]) {
        self.pairs.clear();
        self.pairs.extend(pairs);
        self.sums.clear();
        let sums = pairs
            .iter()
            .map(|pair| radii[pair[0] as usize] + radii[pair[1] as usize]);
        self.sums.extend(sums);
    }

    /// Net forces into `net`; the largest of them is returned.
    pub(super) fn forces(&self, packing: &Packing, line_tension: f64, net: &mut [Vec2]) -> f64 {
        let stiffness_sum = stiffness_sum(line_tension);
        let (fours, pairs) = self.pairs.as_chunks::<4>();
        let (sums_of_fours, sums) = self.sums.as_chunks::<4>();
        net.fill(Vec2::zeros());
        wide(
            #[inline(always)]
            || add_fours(packing, fours, sums_of_fours, stiffness_sum, net),
        );
        add(packing, pairs, sums, stiffness_sum, net);
        let largest = largest_force(net);
        if largest.is_finite() {
            return largest;
        }
        // Coincident centres have no direction in `add_fours`.
        net.fill(Vec2::zeros());
        add(packing, &self.pairs, &self.sums, stiffness_sum, net);
        largest_force(net)
    }
}

/// Adds the forces of `pairs` to `net`, one by one.
fn add(packing: &Packing, pairs: &[[u32; 2]], sums: &[f64], stiffness_sum: f64, net: &mut [Vec2]) {
    for (&[i, j], sum) in pairs.iter().zip(sums) {
        let separation = packing.separation(i as usize, j as usize);
        let distance = (separation.x * separation.x + separation.y * separation.y).sqrt();
        let overlap = if *sum > distance { sum - distance } else { 0.0 };
        let force = if distance == 0.0 {
            // Coincident centres are told apart along x, as in `unit_and_length`.
            Vec2::new(stiffness_sum, 0.0)
        } else {
            // n f = (r/|r|) k δ
            separation * (stiffness_sum * overlap / (sum * distance))
        };
        net[i as usize] += force;
        net[j as usize] -= force;
    }
}

/// Fours under way at a time; a power of two, so that places are found by a mask.
const UNDER_WAY: usize = 16;

/// How many fours later a four goes through its next stage: what was stored can be loaded then.
const LATER: usize = 2;

/// What [`add`] does, four pairs at a time and without a branch: which of the candidates touch is nothing that a
/// processor could guess; those that do not give zero.
///
/// A four goes through five stages. The processor looks some three hundred instructions ahead, two fours: in one go the
/// chain of root and division would keep it waiting, in stages it has five fours to work on.
#[inline(always)]
fn add_fours(
    packing: &Packing,
    fours: &[[[u32; 2]; 4]],
    sums: &[[f64; 4]],
    stiffness_sum: f64,
    net: &mut [Vec2],
) {
    let positions = packing.positions();
    let domain = packing.domain();
    let mut under_way = [Four::default(); UNDER_WAY];
    // Pairs of one particle follow each other: its sum stays out of memory until they end.
    let (mut first, mut sum_of_first) = (0, Vec2::zeros());
    for step in 0..fours.len() + 4 * LATER {
        let place = |stage: usize| step.checked_sub(stage * LATER);
        if let Some(pairs) = fours.get(step) {
            under_way[step % UNDER_WAY].separate(positions, pairs);
        }
        if let Some(place) = place(1) {
            under_way[place % UNDER_WAY].take_nearest_images(domain);
        }
        if let Some(place) = place(2) {
            under_way[place % UNDER_WAY].take_roots();
        }
        if let Some(place) = place(3)
            && let Some(sums) = sums.get(place)
        {
            under_way[place % UNDER_WAY].push(sums, stiffness_sum);
        }
        if let Some(place) = place(4)
            && let Some(pairs) = fours.get(place)
        {
            let Four { x, y, .. } = &under_way[place % UNDER_WAY];
            for ((&[i, j], &x), &y) in pairs.iter().zip(x).zip(y) {
                let force = Vec2::new(x, y);
                if i != first {
                    net[first as usize] = sum_of_first;
                    (first, sum_of_first) = (i, net[i as usize]);
                }
                sum_of_first += force;
                net[j as usize] -= force;
            }
        }
    }
    net[first as usize] = sum_of_first;
}

/// Four pairs under way. One simple loop a quantity, so that each is done for all four at once.
#[derive(Clone, Copy, Default)]
struct Four {
    separation: [Vec2; 4],
    /// Components of the separation, then of the force.
    x: [f64; 4],
    y: [f64; 4],
    /// The distance, and its square before.
    distance: [f64; 4],
}

impl Four {
    #[inline(always)]
    fn separate(&mut self, positions: &[Vec2], pairs: &[[u32; 2]; 4]) {
        for (separation, &[i, j]) in self.separation.iter_mut().zip(pairs) {
            *separation = positions[i as usize] - positions[j as usize];
        }
    }

    #[inline(always)]
    fn take_nearest_images(&mut self, domain: Domain) {
        let (mut x, mut y) = ([0.0; 4], [0.0; 4]);
        for k in 0..4 {
            (x[k], y[k]) = (self.separation[k].x, self.separation[k].y);
        }
        domain.fold_columns(&mut x, &mut y);
        for k in 0..4 {
            self.distance[k] = x[k] * x[k] + y[k] * y[k];
        }
        (self.x, self.y) = (x, y);
    }

    #[inline(always)]
    fn take_roots(&mut self) {
        for distance in &mut self.distance {
            *distance = distance.sqrt();
        }
    }

    /// `n f = (r/|r|) k δ`.
    #[inline(always)]
    fn push(&mut self, sums: &[f64; 4], stiffness_sum: f64) {
        let Self { x, y, distance, .. } = self;
        let mut factor = [0.0; 4];
        for k in 0..4 {
            let overlap = if sums[k] > distance[k] {
                sums[k] - distance[k]
            } else {
                0.0
            };
            factor[k] = stiffness_sum * overlap / (sums[k] * distance[k]);
        }
        for k in 0..4 {
            x[k] *= factor[k];
        }
        for k in 0..4 {
            y[k] *= factor[k];
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use core::f64::consts::PI;
    use proptest::prelude::*;

    proptest! {
        /// Fours and single pairs are two ways of the same operations.
        #[test]
        fn four_pairs_at_a_time_give_the_bits_of_one_pair_at_a_time(
            points in prop::collection::vec((0.0..1.0f64, 0.0..1.0f64), 2..60),
            together in any::<bool>(),
        ) {
            let mut points: Vec<_> = points.iter().map(|p| Vec2::new(5.0 * p.0, 4.0 * p.1)).collect();
            if together {
                points[1] = points[0];
            }
            let radii = (0..points.len()).map(|i| 0.3 + 0.02 * (i % 7) as f64).collect();
            let packing = Packing::new(Domain::new(5.0, 4.0).unwrap(), radii, points).unwrap();
            let n = packing.len() as u32;
            let pairs: Vec<_> = (0..n).flat_map(|i| (i + 1..n).map(move |j| [i, j])).collect();
            let mut candidates = Candidates::default();
            candidates.renew(packing.radii(), &pairs);
            let (mut net, mut expected) = (vec![Vec2::zeros(); n as usize], vec![Vec2::zeros(); n as usize]);
            let largest = candidates.forces(&packing, 0.7, &mut net);
            add(&packing, &pairs, &candidates.sums, 4.0 * PI * 0.7 / 3.0, &mut expected);
            prop_assert!(largest.is_finite());
            prop_assert_eq!(largest, largest_force(&expected));
            prop_assert_eq!(net, expected);
        }
    }
}
