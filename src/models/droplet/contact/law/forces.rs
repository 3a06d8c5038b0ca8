//! Where `A f = δ`, Saitoh (4), is solved for the contacts of the set.
//!
//! Far from balance it begins in single precision: with entries of `A` made in it, if the tolerance is [coarse](COARSE). Conjugate
//! gradients then ask for more as they need it, see [`Progress`].

use super::{ContactLaw, Standing};
use crate::models::droplet::contact::list::ContactList;
use crate::models::droplet::contact::matrix::{Precision, rounding};
use crate::models::droplet::contact::solver::{
    ConjugateGradient, Goal, LinearSolver, Progress, SolverError, Start,
};
use crate::state::Packing;

/// A tolerance, relative to the largest `|δ|`, at which round-off in a residual does not matter.
const FAR_ABOVE_ROUND_OFF: f64 = 1e-10;

/// How many times the rounding of single precision a tolerance has to be for a solution to begin with it.
const COARSE: f64 = 5.0;

impl ContactLaw {
    /// What the first residual of a solution has to be computed in, going by the contacts found last.
    pub(super) fn precision_for(&self, packing: &Packing) -> Precision {
        let coarse = COARSE * rounding(packing) * self.largest_overlap;
        let coarse = self.slack > 0.0 && self.allowed() >= coarse;
        if coarse && matches!(self.solver, LinearSolver::ConjugateGradient(_)) {
            Precision::Single
        } else {
            Precision::Double
        }
    }

    /// Whether round-off in a residual does not matter.
    pub(super) fn is_far_above_round_off(&self) -> bool {
        self.allowed() > FAR_ABOVE_ROUND_OFF * self.largest_overlap
    }

    /// The forces of the set, and how far they are from `A f = δ`.
    pub(super) fn find_forces(&mut self, packing: &Packing) -> Result<(), SolverError> {
        let multiplied = self.assemble(packing);
        if self.precision == Precision::Double {
            self.matrix.complete(&self.geometry);
        }
        let goal = Goal {
            tolerance: self.allowed(),
            loosely: self.is_far_above_round_off(),
        };
        let (overlaps, forces) = (self.geometry.overlaps(), self.set.forces_mut());
        if let LinearSolver::ConjugateGradient(solver) = &mut self.solver {
            let mut solver = core::mem::take(solver);
            let found = self.iterate(packing, &mut solver, goal, multiplied);
            self.equation = solver.largest_residual();
            self.solver = LinearSolver::ConjugateGradient(solver);
            self.work.iterations += found? as u64;
        } else {
            debug_assert!(self.matrix.is_whole(), "a set without inactive contacts");
            self.solver
                .solve(&self.matrix, overlaps, forces, goal.tolerance)?;
            self.measure_equation();
        }
        Ok(())
    }

    /// Conjugate gradients; returns the iterations. If the matrix was `multiplied`, `products` are of the forces.
    fn iterate(
        &mut self,
        packing: &Packing,
        solver: &mut ConjugateGradient,
        goal: Goal,
        multiplied: bool,
    ) -> Result<usize, SolverError> {
        let in_single = self.precision == Precision::Single;
        if in_single && !multiplied {
            let (geometry, products) = (&self.geometry, &mut self.products);
            self.matrix
                .assemble_f32(geometry, self.set.forces(), products);
        }
        let (overlaps, forces) = (self.geometry.overlaps(), self.set.forces_mut());
        let products = if in_single {
            Some(self.products.single())
        } else {
            multiplied.then(|| self.products.double())
        };
        let start = Start {
            products,
            iterations: 0,
        };
        let mut progress = solver.begin(&self.matrix, overlaps, forces, goal, start)?;
        if let Progress::NeedsValues(iterations) = progress {
            self.matrix.complete(&self.geometry);
            let start = Start {
                products: None,
                iterations,
            };
            progress = solver.begin(&self.matrix, overlaps, forces, goal, start)?;
        }
        let iterations = match progress {
            Progress::Done(iterations) => return Ok(iterations),
            Progress::NeedsWhole(iterations) | Progress::NeedsValues(iterations) => iterations,
        };
        self.put_in_order(&[]);
        self.assemble(packing);
        self.matrix.complete(&self.geometry);
        let (overlaps, forces) = (self.geometry.overlaps(), self.set.forces_mut());
        solver.finish(&self.matrix, overlaps, forces, goal.tolerance, iterations)
    }

    /// Geometry and matrix of the set at these positions; what still stands is not done again. Says whether it was
    /// not, and `products` are those of the off-diagonal entries of `A` with the forces.
    pub(super) fn assemble(&mut self, packing: &Packing) -> bool {
        if self.standing == Standing::Assembled {
            return false;
        }
        if self.is_untidy() {
            self.put_in_order(&[]);
        }
        if self.standing == Standing::Outdated {
            let mut list = ContactList::default();
            list.rebuild(packing.len(), self.set.pairs());
            self.work.structures += 1;
            self.geometry.restructure(&list);
            let duplicate = self.geometry.duplicate();
            self.matrix
                .restructure(packing, &list, duplicate, self.line_tension);
        }
        let (geometry, products) = (&mut self.geometry, &mut self.products);
        let at = (packing, self.set.pairs(), self.set.forces());
        self.largest_overlap = self.matrix.assemble(geometry, at, products, self.precision);
        self.work.singles += u64::from(self.precision == Precision::Single);
        self.work.assemblies += 1;
        self.standing = Standing::Assembled;
        true
    }

    /// `max |A f − δ|` of the forces.
    pub(super) fn measure_equation(&mut self) {
        self.image.resize(self.set.len(), 0.0);
        self.matrix.complete(&self.geometry);
        self.matrix.multiply(self.set.forces(), &mut self.image);
        self.equation = 0.0;
        let rows = self.image.iter().zip(self.geometry.overlaps());
        for ((q, d), s) in rows.zip(self.matrix.inverse_root()) {
            if *s > 0.0 {
                self.equation = self.equation.max((d - q).abs());
            }
        }
    }
}
