//! The packing of undeformed disks that a relaxation starts from, Saitoh 2.2.1.
//!
//! Disks repel with `f = k_ij δ_ij` for `δ_ij > 0`, `k_ij = 4πγ / 3(R_i + R_j)`: the force of one Morse–Witten contact
//! on its own, so that both stages share their units. FIRE relaxes them from zero velocity. Work and memory are O(N) a
//! step, by a Verlet list from a cell list.

use crate::domain::Vec2;
use crate::force::{backbone, largest_force, mean_coordination};
use crate::neighbors::NeighborList;
use crate::packing::{Packing, unit_and_length};
use crate::relax::fire::{Fire, FireState};
use core::f64::consts::PI;

/// When the relaxation of the disks ends.
///
/// ```
/// assert_eq!(softjam::disks::DiskParameters::default().threshold, 1e-6);
/// ```
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct DiskParameters {
    /// The relaxation ends when `f_max` (units of γ) is not above this.
    pub threshold: f64,
    /// The relaxation ends after this many steps in any case.
    pub steps: u64,
}

impl Default for DiskParameters {
    fn default() -> Self {
        Self {
            threshold: 1e-6,
            steps: 50_000,
        }
    }
}

/// How the disks relaxed.
///
/// See the example of [`relax`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DiskReport {
    /// Steps made.
    pub steps: u64,
    /// The largest net force at the end (units of γ).
    pub f_max: f64,
    /// Whether `f_max` is not above the threshold.
    pub converged: bool,
    /// Mean coordination number of the disks that are held; see
    /// [`Observables::coordination`](crate::force::Observables::coordination).
    pub coordination: f64,
    /// Rattlers among the disks.
    pub rattlers: usize,
}

/// Relaxes the disks of `packing` in place; `line_tension` is γ (force, positive).
///
/// # Example
///
/// ```
/// use softjam::disks::{relax, DiskParameters};
/// use softjam::domain::{Domain, Vec2};
/// use softjam::packing::Packing;
///
/// let at = |x| Vec2::new(x, 2.0);
/// let mut packing = Packing::new(Domain::new(8.0, 8.0).unwrap(), vec![0.5; 2], vec![at(1.0), at(1.7)]).unwrap();
/// let report = relax(&mut packing, &DiskParameters::default(), 1.0);
/// assert!(report.converged && report.f_max <= 1e-6);
/// assert!(packing.separation(0, 1).norm() > 1.0 - 1e-6);
/// ```
pub fn relax(packing: &mut Packing, parameters: &DiskParameters, line_tension: f64) -> DiskReport {
    let fire = Fire::default();
    let mut neighbors = NeighborList::new();
    let mut velocities = vec![Vec2::zeros(); packing.len()];
    let mut forces = DiskForces::new(packing.len(), line_tension);
    let stiffest = 4.0 * PI * line_tension / (6.0 * packing.smallest_radius());
    let mut state = FireState::start(&fire, DT_MAX / stiffest.sqrt());
    let domain = packing.domain();
    let mut step = 0;
    loop {
        neighbors.update(packing, 0.0, SKIN * packing.largest_radius());
        forces.compute(packing, neighbors.pairs());
        let f_max = largest_force(&forces.net) / line_tension;
        let converged = f_max <= parameters.threshold;
        if converged || step >= parameters.steps {
            let (rattlers, contacts) = backbone(packing.len(), &touching(packing, &neighbors));
            return DiskReport {
                steps: step,
                f_max,
                converged,
                coordination: mean_coordination(contacts, packing.len() - rattlers),
                rattlers,
            };
        }
        fire.advance(
            &mut state,
            &forces.net,
            &mut velocities,
            packing.positions_mut(),
            domain,
        );
        step += 1;
    }
}

/// `dt_max √k` of the stiffest pair. The triangular lattice has `ω_max² = 6 k`, so that 2/√6 = 0.82 is the limit of
/// stability of the densest contact network; half of it keeps clear, the whole multiplies the steps by five.
const DT_MAX: f64 = 0.41;

/// How far the neighbour list reaches beyond the disks, in units of the largest radius.
const SKIN: f64 = 0.3;

/// The net forces of the disks, and what they are computed with.
struct DiskForces {
    net: Vec<Vec2>,
    /// The share of the pairs whose lower particle is in the second half.
    second: Vec<Vec2>,
    stiffness_sum: f64,
}

impl DiskForces {
    fn new(particles: usize, line_tension: f64) -> Self {
        Self {
            net: vec![Vec2::zeros(); particles],
            second: vec![Vec2::zeros(); particles],
            stiffness_sum: 4.0 * PI * line_tension / 3.0, // k_ij (R_i + R_j)
        }
    }

    /// Net forces into `net`, from candidates that ascend.
    ///
    /// Two sums are run side by side, of the pairs whose lower particle is in the first and in the second half, since
    /// pairs of one particle have to wait for each other. Where the halves part does not depend on the candidates, so the
    /// order of each sum does not either.
    fn compute(&mut self, packing: &Packing, candidates: &[[u32; 2]]) {
        self.net.fill(Vec2::zeros());
        self.second.fill(Vec2::zeros());
        let half = (packing.len() / 2) as u32;
        let (first, second) =
            candidates.split_at(candidates.partition_point(|pair| pair[0] < half));
        let both = first.len().min(second.len());
        for (a, b) in first.iter().zip(second) {
            let (f, g) = (self.force(packing, *a), self.force(packing, *b));
            add(&mut self.net, *a, f);
            add(&mut self.second, *b, g);
        }
        for a in &first[both..] {
            let f = self.force(packing, *a);
            add(&mut self.net, *a, f);
        }
        for b in &second[both..] {
            let g = self.force(packing, *b);
            add(&mut self.second, *b, g);
        }
        for (net, second) in self.net.iter_mut().zip(&self.second) {
            *net += second;
        }
    }

    /// The force on the lower particle. A pair that does not touch gives zero, without a branch: which of the candidates
    /// touch is nothing that a processor could guess.
    #[inline]
    fn force(&self, packing: &Packing, [i, j]: [u32; 2]) -> Vec2 {
        let (i, j) = (i as usize, j as usize);
        let separation = packing.separation(i, j);
        let sum = packing.radii()[i] + packing.radii()[j];
        let distance = separation.norm_squared().sqrt();
        if distance > 0.0 {
            // n f = (r/|r|) k δ
            let overlap = (sum - distance).max(0.0);
            separation * (self.stiffness_sum * overlap / (sum * distance))
        } else {
            unit_and_length(separation).0 * self.stiffness_sum
        }
    }
}

#[inline]
fn add(net: &mut [Vec2], [i, j]: [u32; 2], force: Vec2) {
    net[i as usize] += force;
    net[j as usize] -= force;
}

/// The pairs of disks that overlap.
fn touching(packing: &Packing, neighbors: &NeighborList) -> Vec<[u32; 2]> {
    let overlap = |pair: &&[u32; 2]| {
        let [i, j] = pair.map(|p| p as usize);
        let sum = packing.radii()[i] + packing.radii()[j];
        packing.separation(i, j).norm_squared() < sum * sum
    };
    neighbors.pairs().iter().filter(overlap).copied().collect()
}
