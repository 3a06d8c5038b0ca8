//! The packing of undeformed disks that a relaxation starts from, Saitoh 2.2.1.
//!
//! Disks repel with `f = k_ij δ_ij` for `δ_ij > 0`, `k_ij = 4πγ / 3(R_i + R_j)`: the force of one Morse–Witten contact
//! on its own, so that both stages share their units. FIRE relaxes them from zero velocity. Work and memory are O(N) a
//! step, by a Verlet list from a cell list.

mod forces;

use crate::analysis::{backbone, mean_coordination};
use crate::domain::Vec2;
use crate::minimize::fire::{Fire, FireState};
use crate::neighbors::NeighborList;
use crate::state::Packing;
use core::f64::consts::PI;
use forces::Candidates;

/// When the relaxation of the disks ends.
///
/// ```
/// assert_eq!(softjam::models::disks::DiskParameters::default().threshold, 1e-6);
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
    /// [`Observables::coordination`](crate::analysis::Observables::coordination).
    pub coordination: f64,
    /// Rattlers among the disks.
    pub rattlers: usize,
}

/// Relaxes the disks of `packing` in place; `line_tension` is γ (force, positive).
///
/// # Example
///
/// ```
/// use softjam::models::disks::{relax, DiskParameters};
/// use softjam::domain::{Domain, Vec2};
/// use softjam::state::Packing;
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
    let mut candidates = Candidates::default();
    let mut velocities = vec![Vec2::zeros(); packing.len()];
    let mut net = vec![Vec2::zeros(); packing.len()];
    let stiffest = 4.0 * PI * line_tension / (6.0 * packing.smallest_radius());
    let mut state = FireState::start(&fire, DT_MAX / stiffest.sqrt());
    let domain = packing.domain();
    let radius = packing.ample_radius();
    let mut skin = SKIN[1] * radius;
    let (mut step, mut moved) = (0, f64::INFINITY);
    loop {
        if neighbors.update_after(packing, 0.0, skin, moved) {
            candidates.renew(packing.radii(), neighbors.pairs());
        }
        let f_max = candidates.forces(packing, line_tension, &mut net) / line_tension;
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
        moved = fire.advance(
            &mut state,
            &net,
            &mut velocities,
            packing.positions_mut(),
            domain,
        );
        if moved.is_finite() {
            skin = (12.0 * moved * radius).sqrt();
            skin = skin.clamp(SKIN[0] * radius, SKIN[1] * radius);
        }
        step += 1;
    }
}

/// `dt_max √k` of the stiffest pair. The triangular lattice has `ω_max² = 6 k`, so that 2/√6 = 0.82 is the limit of
/// stability of the densest contact network. Geometric means of the steps to 1e-6 at N = 1024 (40 seeds), for 0.41, 0.5 and
/// 0.57: 4344, 3683, 3553 at φ = 0.86; 9114 and 7051 for the last two at 0.845, 1559 and 1595 at 0.92.
const DT_MAX: f64 = 0.5;

/// How far the neighbour list reaches beyond the disks at least and at most, in units of the largest radius `R`, or of
/// [`Packing::ample_radius`] where few are so large.
///
/// A skin `s` lasts `s/2v` steps at `v` a step. A list costs as much as some eight pairs a particle, and holds some 1.2 `s/R`
/// pairs a particle in vain: both together cost least near `s = √(12 v R)`.
const SKIN: [f64; 2] = [0.05, 0.8];

/// The pairs of disks that overlap.
fn touching(packing: &Packing, neighbors: &NeighborList) -> Vec<[u32; 2]> {
    let overlap = |pair: &&[u32; 2]| {
        let [i, j] = pair.map(|p| p as usize);
        let sum = packing.radii()[i] + packing.radii()[j];
        packing.separation(i, j).norm_squared() < sum * sum
    };
    neighbors.pairs().iter().filter(overlap).copied().collect()
}
