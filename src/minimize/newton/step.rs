//! The displacements of one step: `J Δx = −F` by GMRES, preconditioned by the stiffness of independent contacts.

use super::Stiffness;
use crate::contacts::Contacts;
use crate::domain::Vec2;
use crate::models::droplet::linear::Linearised;
use crate::numerics::gmres::{Gmres, Report, norm};
use crate::state::Packing;

/// A step is kept if it brings what is unbalanced to this fraction of what it was, or less; a linear problem that is not solved so far is no guide.
pub(super) const KEPT: f64 = 0.5;

/// A step that comes nearer is kept if `|F|` grows to this multiple at most.
pub(super) const GROWTH: f64 = 10.0;

/// The longest displacement of a particle in one step, in units of the smallest radius.
const LONGEST: f64 = 0.1;

/// Products with `J` in one step.
const MOST_PRODUCTS: usize = 100;

/// Displacements and what follows them, with buffers.
#[derive(Clone, Debug, Default)]
pub(super) struct Step {
    stiffness: Stiffness,
    gmres: Gmres,
    right: Vec<f64>,
    shift: Vec<f64>,
    scratch: Vec<f64>,
    /// What follows the step, by its whole length.
    pub change: Vec<f64>,
}

impl Step {
    /// The step from these contacts and net forces; `false` where there is none worth trying.
    ///
    /// `f_max` and the `goal` below which nothing more is asked for are in units of the line tension, which is the third.
    pub fn find(
        &mut self,
        linear: &mut impl Linearised,
        (contacts, compliances): (&Contacts<'_>, &[f64]),
        net: &[Vec2],
        (f_max, goal, line_tension): (f64, f64, f64),
    ) -> bool {
        if contacts.pairs.is_empty() || contacts.distances.contains(&0.0) {
            return false;
        }
        let rebuilt = (self.stiffness).rebuild(contacts, compliances, net.len(), 0.0);
        if rebuilt.is_err() {
            return false;
        }
        self.right.clear();
        self.right.extend(net.iter().flat_map(|f| [-f.x, -f.y]));
        if !linear.correct(&mut self.right, &mut self.change) {
            return false;
        }
        // What is left of |F| behind a full step is O(|F|²): solving the linear problem further than that is in vain, and
        // so is a result far below the goal.
        let mean = contacts.forces.iter().sum::<f64>() / contacts.forces.len() as f64;
        let quadratic = 10.0 * f_max * line_tension / mean;
        let tolerance = quadratic.max(0.1 * goal / f_max).clamp(1e-10, 1e-2);
        let n = self.right.len();
        self.shift.resize(n, 0.0);
        self.scratch.resize(n, 0.0);
        let (stiffness, scratch) = (&self.stiffness, &mut self.scratch);
        let Some(Report { residual, .. }) = self.gmres.solve(
            &self.right,
            &mut self.shift,
            tolerance,
            MOST_PRODUCTS,
            |v, w, accuracy| {
                scratch.copy_from_slice(v);
                stiffness.solve(scratch);
                linear.product(scratch, w, accuracy)
            },
        ) else {
            return false;
        };
        stiffness.solve(&mut self.shift);
        let downhill: f64 = (self.right.iter().zip(&self.shift))
            .map(|(b, x)| -b * x)
            .sum();
        // A NaN is no step either.
        let worth_trying = residual <= KEPT && downhill > 0.0;
        if !worth_trying || !linear.follow(&self.shift, 1e-8) {
            return false;
        }
        for (total, more) in self.change.iter_mut().zip(linear.change()) {
            *total += more;
        }
        true
    }

    /// Moves the particles from `positions` by the step, shortened if it is too long; returns the part of it that was made.
    pub fn make(&self, packing: &mut Packing, positions: &[Vec2]) -> f64 {
        let steps = self.shift.as_chunks::<2>().0;
        let squared = steps
            .iter()
            .fold(0.0, |m: f64, [x, y]| m.max(x * x + y * y));
        let part = (LONGEST * packing.smallest_radius() / squared.sqrt()).min(1.0);
        let domain = packing.domain();
        let moved = packing.positions_mut().iter_mut().zip(positions);
        for ((x, old), s) in moved.zip(steps) {
            *x = domain.wrap(old + Vec2::new(s[0], s[1]) * part);
        }
        part
    }

    /// Whether the net forces at the end of the step stand for half the distance of those at its `start`, or less, measured by
    /// its stiffness: `|K̃⁻¹ F|`.
    ///
    /// Along a soft mode a small force means a long way, and going it leaves forces of second order in stiff directions,
    /// which are large and mean next to nothing (P. Deuflhard, *Newton Methods for Nonlinear Problems*, 2004, calls such a
    /// test natural).
    pub fn is_nearer(&mut self, start: &[Vec2], end: &[Vec2]) -> bool {
        let (stiffness, scratch) = (&self.stiffness, &mut self.scratch);
        let mut distance = |forces: &[Vec2]| {
            scratch.clear();
            scratch.extend(forces.iter().flat_map(|f| [f.x, f.y]));
            stiffness.solve(scratch);
            norm(scratch)
        };
        let before = distance(start);
        distance(end) <= KEPT * before
    }
}
