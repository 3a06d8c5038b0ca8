//! Undeformed disks, Saitoh 2.2.1: the model of the packing that droplets start from, and one of its own.
//!
//! Disks repel with `f = k_ij δ_ij` for `δ_ij > 0`, `k_ij = 4πγ / 3(R_i + R_j)`: the force of one Morse–Witten contact
//! on its own, so that both models share their units. Work and memory are O(N) a step, by a Verlet list from a cell list.
//!
//! ```
//! use softjam::models::Kind;
//! use softjam::protocol::{Relaxation, Status};
//! use softjam::scene::Scene;
//!
//! let scene = Scene { particles: 64, phi: 0.9, model: Kind::Disks, ..Scene::default() };
//! let mut run = Relaxation::new(&scene).unwrap();
//! while run.status() == Status::Running {
//!     run.advance().unwrap();
//! }
//! assert_eq!(run.status(), Status::Converged);
//! assert!(run.observables().coordination() > 4.0);
//! ```

mod check;
mod forces;

use super::{Check, Goal, Model};
use crate::contacts::{Contacts, FrameContacts};
use crate::domain::Vec2;
use crate::models::droplet::contact::ContactError;
use crate::neighbors::NeighborList;
use crate::state::{Frame, FrameError, Packing};
use core::f64::consts::PI;
use forces::Candidates;
use std::sync::OnceLock;

/// `k (R_i + R_j) = 4πγ/3` (force).
pub(crate) fn stiffness_sum(line_tension: f64) -> f64 {
    4.0 * PI * line_tension / 3.0
}

/// Undeformed disks.
///
/// ```
/// use softjam::domain::{Domain, Vec2};
/// use softjam::models::{Goal, Model, disks::Disks};
/// use softjam::state::Packing;
///
/// let at = |x| Vec2::new(x, 2.0);
/// let packing = Packing::new(Domain::new(8.0, 8.0).unwrap(), vec![0.5; 2], vec![at(1.0), at(1.7)]).unwrap();
/// let mut disks = Disks::new(3.0);
/// disks.solve(&packing, Goal::EXACT).unwrap();
/// assert!((disks.f_max() - 0.3 * 4.0 * std::f64::consts::PI / 3.0).abs() < 1e-14);
/// ```
#[derive(Clone, Debug)]
pub struct Disks {
    /// γ (force).
    line_tension: f64,
    neighbors: NeighborList,
    candidates: Candidates,
    /// How far the neighbour list reaches beyond the disks (length); reaches no bit.
    skin: f64,
    net: Vec<Vec2>,
    /// Largest net force (units of γ).
    f_max: f64,
    /// The contacts, once somebody asked.
    contacts: OnceLock<FrameContacts>,
}

impl Disks {
    /// Disks at line tension γ (force, positive).
    #[must_use]
    pub fn new(line_tension: f64) -> Self {
        Self {
            line_tension,
            neighbors: NeighborList::new(),
            candidates: Candidates::default(),
            skin: f64::INFINITY,
            net: Vec::new(),
            f_max: 0.0,
            contacts: OnceLock::new(),
        }
    }

    fn contacts_at(&self, packing: &Packing) -> &FrameContacts {
        let stiffness_sum = stiffness_sum(self.line_tension);
        let force = |sum: f64, overlap: f64| stiffness_sum * overlap / sum;
        self.contacts
            .get_or_init(|| FrameContacts::touching(packing, self.neighbors.pairs(), force))
    }
}

impl Model for Disks {
    fn line_tension(&self) -> f64 {
        self.line_tension
    }

    fn solve(&mut self, packing: &Packing, goal: Goal) -> Result<(), ContactError> {
        self.contacts.take();
        let radius = packing.ample_radius();
        let skin = if goal.moved.is_finite() {
            (12.0 * goal.moved * radius).sqrt()
        } else {
            self.skin
        };
        self.skin = skin.clamp(SKIN[0] * radius, SKIN[1] * radius);
        if self
            .neighbors
            .update_after(packing, 0.0, self.skin, goal.moved)
        {
            self.candidates
                .renew(packing.radii(), self.neighbors.pairs());
        }
        self.net.resize(packing.len(), Vec2::zeros());
        let largest = self
            .candidates
            .forces(packing, self.line_tension, &mut self.net);
        self.f_max = largest / self.line_tension;
        Ok(())
    }

    /// Forces follow from the positions alone.
    fn restore(&mut self, packing: &Packing, _: &Frame) -> Result<(), FrameError> {
        // Disks have an answer at any positions.
        let _: Result<(), ContactError> = self.solve(packing, Goal::EXACT);
        Ok(())
    }

    fn net_forces(&self) -> &[Vec2] {
        &self.net
    }

    fn f_max(&self) -> f64 {
        self.f_max
    }

    fn contacts<'a>(&'a self, packing: &Packing) -> Contacts<'a> {
        self.contacts_at(packing).view()
    }

    fn residual(&self) -> f64 {
        0.0
    }

    fn accepted_residual(&self) -> f64 {
        0.0
    }

    fn promised_residual(&self, _: &Packing, _: f64) -> f64 {
        0.0
    }

    /// `0.5/√k` of the stiffest pair.
    fn longest_time_step(&mut self, packing: &Packing) -> Result<f64, ContactError> {
        let stiffest = 4.0 * PI * self.line_tension / (6.0 * packing.smallest_radius());
        Ok(DT_MAX / stiffest.sqrt())
    }

    /// Forces follow from the positions to round-off.
    fn promise(&self, _: &Packing, _: &Frame, _: f64) -> f64 {
        0.0
    }

    fn check(&self, packing: &Packing, frame: &Frame, _: f64) -> Check {
        self.check_frame(packing, frame)
    }
}

/// `1/k` of contacts between `pairs` (length/force).
pub(crate) fn compliances(packing: &Packing, pairs: &[[u32; 2]], line_tension: f64) -> Vec<f64> {
    let radius = |p: u32| packing.radii()[p as usize];
    let compliance = |&[i, j]: &[u32; 2]| (radius(i) + radius(j)) / stiffness_sum(line_tension);
    pairs.iter().map(compliance).collect()
}

/// `y = J x`: how the net forces of `contacts` answer to displacements `x` (two numbers a particle), where `compliances` are
/// `1/k` (length/force). With `x_c = dr_i − dr_j`, unit vector `n` and tangent `t` (`n` turned by a quarter)
///
/// ```text
/// dF_i = Σ_c ( −k (n·x_c) n + (f/r) (t·x_c) t )
/// ```
pub(crate) fn answer(contacts: &Contacts<'_>, compliances: &[f64], x: &[f64], y: &mut [f64]) {
    y.fill(0.0);
    for (c, &[i, j]) in contacts.pairs.iter().enumerate() {
        let (i, j) = (2 * i as usize, 2 * j as usize);
        let x = Vec2::new(x[i] - x[j], x[i + 1] - x[j + 1]);
        let n = contacts.normals[c];
        let t = Vec2::new(-n.y, n.x);
        let across = t * (t.dot(&x) * contacts.forces[c] / contacts.distances[c]);
        let force = across - n * (n.dot(&x) / compliances[c]);
        y[i] += force.x;
        y[i + 1] += force.y;
        y[j] -= force.x;
        y[j + 1] -= force.y;
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::protocol::Relaxation;
    use crate::scene::Scene;

    #[test]
    fn answer_to_displacements_is_the_derivative_of_the_net_forces() {
        let scene = Scene {
            particles: 48,
            phi: 1.0,
            ..Scene::default()
        };
        let packing = Relaxation::new(&scene).unwrap().packing().clone();
        let mut disks = Disks::new(1.7);
        disks.solve(&packing, Goal::EXACT).unwrap();
        let contacts = disks.contacts(&packing);
        let compliances = compliances(&packing, contacts.pairs, 1.7);
        let x: Vec<f64> = (0..96).map(|k| libm::sin(0.7 * f64::from(k + 1))).collect();
        let mut product = vec![0.0; 96];
        answer(&contacts, &compliances, &x, &mut product);
        let moved = |h: f64| {
            let mut moved = packing.clone();
            for (p, s) in moved.positions_mut().iter_mut().zip(x.as_chunks::<2>().0) {
                *p = packing.domain().wrap(*p + Vec2::new(s[0], s[1]) * h);
            }
            let mut there = Disks::new(1.7);
            there.solve(&moved, Goal::EXACT).unwrap();
            there.net_forces().to_vec()
        };
        let h = 1e-6;
        let (minus, plus) = (moved(-h), moved(h));
        for (k, (a, b)) in minus.iter().zip(&plus).enumerate() {
            let slope = (b - a) / (2.0 * h);
            assert!((slope.x - product[2 * k]).abs() < 1e-7, "particle {k}");
            assert!((slope.y - product[2 * k + 1]).abs() < 1e-7, "particle {k}");
        }
    }
}
