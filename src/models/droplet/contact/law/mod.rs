//! [`ContactLaw`]: positions in, contacts and forces out.
//!
//! - The [set](super::set) says which pairs are in contact. It changes in [`exchange`] alone, where geometry and matrix follow: unless
//!   they are [outdated](Standing::Outdated) they have its numbers, and the inactive contacts of one are those of the other.
//! - `ordered` is made from the set when it is asked for, and dropped when another solution begins.

mod complementarity;
mod exchange;
mod forces;
mod local_region;
mod local_update;
mod ordered;
#[cfg(test)]
mod tests;

use crate::models::droplet::contact::bulges::Bulges;
use crate::models::droplet::contact::candidates::Candidates;
use crate::models::droplet::contact::error::ContactError;
use crate::models::droplet::contact::matrix::product::FirstProducts;
use crate::models::droplet::contact::matrix::{ContactMatrix, Geometry, Precision};
use crate::models::droplet::contact::search::Search;
use crate::models::droplet::contact::set::ContactSet;
use crate::models::droplet::contact::solver::{LinearSolver, Method};
use crate::models::droplet::contact::tolerance::{ACCEPTED, relative_tolerance, slack};
use crate::models::droplet::kernel::per_radius;
use crate::state::Packing;
pub(super) use complementarity::Violation;
use local_region::LocalRegion;
use ordered::Ordered;
use std::sync::OnceLock;

/// How the contact list follows the positions.
///
/// ```
/// assert_eq!(softjam::models::droplet::contact::Rule::default(), softjam::models::droplet::contact::Rule::Complementarity);
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Rule {
    /// The contact law is solved in every step: forces and gaps are ≥ 0 and the list depends on the positions alone.
    #[default]
    Complementarity,
    /// Saitoh 2.2.5: in every step solve, drop the contacts with `f < 0`, add the pairs with `Δ > 0`, solve once more. The
    /// list is then a matter of history and a force can be negative for a step. (`f = 0` is dropped too, and `Δ` has to
    /// exceed the solver's tolerance.)
    ///
    /// Until version 0.2 it was called `seed`, which scenes may still say.
    #[serde(alias = "seed")]
    Saitoh,
}

/// The contact law: a solver of the contact problem with its settings, its buffers and its last answer.
///
/// # Example
///
/// A particle pressed between two others bulges sideways and touches a fourth that no undeformed disk would reach:
///
/// ```
/// use softjam::models::droplet::contact::ContactLaw;
/// use softjam::domain::{Domain, Vec2};
/// use softjam::state::Packing;
///
/// let packing = Packing::new(
///     Domain::new(9.0, 9.0).unwrap(),
///     vec![0.5; 4],
///     vec![Vec2::new(3.0, 3.0), Vec2::new(3.9, 3.0), Vec2::new(4.8, 3.0), Vec2::new(3.9, 4.005)],
/// ).unwrap();
/// let mut law = ContactLaw::default();
/// law.solve(&packing, &[], &[]).unwrap();
/// assert_eq!(law.contacts().pairs, [[0, 1], [1, 2], [1, 3]]);
/// assert!(law.contacts().overlaps[2] < 0.0 && law.contacts().forces[2] > 0.0);
/// assert!(law.residual() < 1e-12);
/// ```
#[derive(Clone, Debug)]
pub struct ContactLaw {
    rule: Rule,
    line_tension: f64,
    tolerance: f64,
    solver: LinearSolver,
    geometry: Geometry,
    matrix: ContactMatrix,
    set: ContactSet,
    /// What came (`true`) and went in the last solution, one after the other.
    changes: Vec<([u32; 2], bool)>,
    /// The names of the set of contacts before the last solution and now.
    sets: (u64, u64),
    standing: Standing,
    /// The active contacts in the order of pairs, once they are asked for.
    ordered: OnceLock<Ordered>,
    candidates: Candidates,
    /// What the first residual of this solution is computed in.
    precision: Precision,
    /// The residual that is looked for beyond the tolerance (length); see [`due_tolerance`](crate::models::droplet::contact::due_tolerance).
    slack: f64,
    /// `A f`, where the solver does not know the residual (length).
    image: Vec<f64>,
    products: FirstProducts,
    bulges: Bulges,
    /// The largest overlap of contours outside the set that the tolerance lets pass (length).
    tolerated: f64,
    /// Searches for pairs that touch, in each of two threads.
    searches: [Search; 2],
    region: LocalRegion,
    /// The first particle whose bulge was cut short, and the bound of its bulge (length); its forces diverged.
    diverged: Option<(usize, f64)>,
    violations: Vec<Violation>,
    /// The largest `|δ|` of the contacts (length).
    largest_overlap: f64,
    /// The largest `|A f − δ|` (length).
    equation: f64,
    residual: f64,
    work: Work,
}

/// What geometry and matrix are of.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Standing {
    /// Of other contacts than the set's, or of other numbers.
    Outdated,
    /// Of the set's contacts by their numbers, at other positions.
    Structured,
    /// Of the set's contacts by their numbers, at the positions at hand.
    Assembled,
}

/// What solving the contact problem has cost so far: counts for benches and tests, never part of a result.
///
/// ```
/// assert_eq!(softjam::models::droplet::contact::ContactLaw::default().work().solves, 0);
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Work {
    /// Contact problems solved.
    pub solves: u64,
    /// Linear systems solved.
    pub sweeps: u64,
    /// Iterations of the linear solver.
    pub iterations: u64,
    /// Exchanges of few contacts after which only the forces around them were solved for.
    pub local_updates: u64,
    /// Iterations of the linear solver on such regions.
    pub local_iterations: u64,
    /// Geometries computed of all contacts; after an exchange only that of new ones is.
    pub assemblies: u64,
    /// Those of which entries were computed in single precision, which is enough far from balance.
    pub singles: u64,
    /// Structures of the contact set (lists, places in `A`) built.
    pub structures: u64,
    /// Symbolic factorisations; none unless the solver is the sparse Cholesky.
    pub symbolic: u64,
    /// Distances computed of pairs outside the set.
    pub distances: u64,
    /// Gaps evaluated of pairs outside the set.
    pub gaps: u64,
    /// Neighbour lists built.
    pub neighbor_lists: u64,
}

impl Default for ContactLaw {
    fn default() -> Self {
        Self::new(Rule::default(), Method::default(), 1.0, 1e-12)
    }
}

impl ContactLaw {
    /// A law with line tension γ (force, positive) and a `tolerance` on the residual relative to the largest overlap.
    #[must_use]
    pub fn new(rule: Rule, method: Method, line_tension: f64, tolerance: f64) -> Self {
        Self {
            rule,
            line_tension,
            tolerance,
            solver: LinearSolver::new(method),
            geometry: Geometry::default(),
            matrix: ContactMatrix::default(),
            set: ContactSet::default(),
            changes: Vec::new(),
            sets: (0, 0),
            standing: Standing::Outdated,
            ordered: OnceLock::new(),
            candidates: Candidates::default(),
            precision: Precision::Double,
            slack: 0.0,
            image: Vec::new(),
            products: FirstProducts::default(),
            bulges: Bulges::default(),
            tolerated: 0.0,
            searches: Default::default(),
            region: LocalRegion::default(),
            diverged: None,
            violations: Vec::new(),
            largest_overlap: 0.0,
            equation: 0.0,
            residual: 0.0,
            work: Work::default(),
        }
    }

    /// Line tension γ (force).
    #[must_use]
    pub fn line_tension(&self) -> f64 {
        self.line_tension
    }

    /// How the contact list follows the positions.
    pub(crate) fn rule(&self) -> Rule {
        self.rule
    }

    /// `1/2πγ`.
    fn per_radius(&self) -> f64 {
        per_radius(self.line_tension)
    }

    /// Solves `A x = b` with the matrix found last, from the guess in `x`, to `max |A x − b| ≤ tolerance`.
    ///
    /// # Errors
    ///
    /// [`ContactError::Solver`].
    pub fn solve_linear(
        &mut self,
        b: &[f64],
        x: &mut [f64],
        tolerance: f64,
    ) -> Result<(), ContactError> {
        // `matrix` borrows the whole law.
        let mut solver = core::mem::replace(&mut self.solver, LinearSolver::new(Method::default()));
        let solved = solver.solve(self.matrix(), b, x, tolerance);
        self.solver = solver;
        solved?;
        Ok(())
    }

    /// Takes contacts and forces as the answer at the positions of `packing`, without solving: for a run that goes on.
    pub(crate) fn restore(&mut self, packing: &Packing, pairs: &[[u32; 2]], forces: &[f64]) {
        self.take(packing, pairs, forces);
        self.moved_by(f64::INFINITY);
        self.assemble(packing);
        self.measure_equation();
        self.inspect(packing);
    }

    /// The particles are elsewhere, none of them by more than `distance` (length).
    fn moved_by(&mut self, distance: f64) {
        self.standing = self.standing.min(Standing::Structured);
        self.candidates.note_motion(distance);
    }

    /// How far the last answer is from the contact law, relative to the largest `|δ|` among the contacts: the largest
    /// of `|A f − δ|` on contacts, of `−gap` elsewhere and of `−f A_cc`.
    #[must_use]
    pub fn residual(&self) -> f64 {
        self.residual
    }

    /// The residual below which the law counts as fulfilled, in the same measure.
    ///
    /// Sixteen tolerances: a linear system solved to the tolerance leaves gaps and forces uncertain by about the
    /// condition number of `A`, some 6 of them.
    #[must_use]
    pub fn accepted_residual(&self) -> f64 {
        ACCEPTED * self.tolerance
    }

    /// What it has cost so far.
    #[must_use]
    pub fn work(&self) -> Work {
        Work {
            neighbor_lists: self.candidates.builds(),
            symbolic: self.solver.symbolic_factorizations(),
            ..self.work
        }
    }

    /// Solves the contact problem at the positions of `packing`, starting from contacts and forces of a step before.
    ///
    /// `pairs` ascend, `forces` are in the same order; both may be empty. With [`Rule::Complementarity`] the start
    /// decides only how fast the answer is found (and its last bits, within the tolerance).
    ///
    /// # Errors
    ///
    /// [`ContactError`]; the law's last answer is then of no use.
    ///
    /// # Panics
    ///
    /// If `pairs` names a particle that the packing lacks or the slices differ in length.
    pub fn solve(
        &mut self,
        packing: &Packing,
        pairs: &[[u32; 2]],
        forces: &[f64],
    ) -> Result<(), ContactError> {
        assert_eq!(pairs.len(), forces.len(), "one force a contact");
        self.take(packing, pairs, forces);
        self.solve_within(packing, 0.0, f64::INFINITY)
    }

    /// [`solve`](Self::solve), starting from the contacts and forces found last.
    ///
    /// # Errors
    ///
    /// As [`solve`](Self::solve).
    ///
    /// ```
    /// # use softjam::models::droplet::contact::ContactLaw;
    /// # use softjam::{domain::{Domain, Vec2}, state::Packing};
    /// # let at = |x| Vec2::new(x, 2.0);
    /// # let packing = Packing::new(Domain::new(8.0, 8.0).unwrap(), vec![0.5; 2], vec![at(1.0), at(1.9)]).unwrap();
    /// let mut law = ContactLaw::default();
    /// law.solve(&packing, &[], &[]).unwrap();
    /// let iterations = law.work().iterations;
    /// law.solve_again(&packing).unwrap();
    /// assert_eq!(law.work().iterations, iterations, "the answer is its own best guess");
    /// ```
    pub fn solve_again(&mut self, packing: &Packing) -> Result<(), ContactError> {
        if !self.candidates.is_of(packing) {
            // Other particles: contacts of the ones before mean nothing.
            self.take(packing, &[], &[]);
        }
        self.solve_within(packing, 0.0, f64::INFINITY)
    }

    /// [`solve_again`](Self::solve_again) to the tolerance that is due at `f_max` (units of γ). No particle has moved by more
    /// than `moved` (length) since the solution before.
    pub(crate) fn solve_within(
        &mut self,
        packing: &Packing,
        f_max: f64,
        moved: f64,
    ) -> Result<(), ContactError> {
        self.ordered.take();
        self.changes.clear();
        self.sets.0 = self.sets.1;
        self.moved_by(moved);
        self.slack = slack(packing, f_max);
        self.work.solves += 1;
        match self.rule {
            Rule::Complementarity => self.settle(packing)?,
            Rule::Saitoh => {
                (self.slack, self.precision) = (0.0, Precision::Double);
                self.sweep(packing)?;
                self.exchange(packing, self.violations.len());
                self.sweep(packing)?;
            }
        }
        self.check_answer(packing)
    }

    /// Solves on at the positions solved last, to the tolerance that is due at `f_max` (units of γ).
    pub(crate) fn tighten(&mut self, packing: &Packing, f_max: f64) -> Result<(), ContactError> {
        if self.rule == Rule::Saitoh {
            // It solves twice and takes what comes.
            return Ok(());
        }
        self.ordered.take();
        self.slack = slack(packing, f_max);
        self.settle(packing)?;
        self.check_answer(packing)
    }

    /// The forces of an unfinished exchange can be anything; only an answer is held against the box.
    fn check_answer(&self, packing: &Packing) -> Result<(), ContactError> {
        if self.residual * self.largest_overlap <= ACCEPTED * self.allowed() {
            self.check_images(packing)?;
        }
        Ok(())
    }

    /// The tolerance that is due in a frame whose largest net force is `f_max` (units of γ), with the contacts found last;
    /// see [`due_tolerance`](crate::models::droplet::contact::due_tolerance).
    #[must_use]
    pub fn tolerance_at(&self, packing: &Packing, f_max: f64) -> f64 {
        match self.rule {
            Rule::Complementarity => {
                relative_tolerance(self.tolerance, slack(packing, f_max), self.largest_overlap)
            }
            Rule::Saitoh => self.tolerance,
        }
    }

    /// How far contours of a pair without a force may overlap (length). Where the tolerance follows `f_max` it is half of what is
    /// accepted, so that `f_max` may fall by half in a step before such a pair breaks its promise.
    fn passed_over(&self) -> f64 {
        let part = if self.slack > 0.0 { 0.5 } else { 1.0 };
        part * ACCEPTED * self.allowed()
    }

    /// The residual looked for, as a length.
    fn allowed(&self) -> f64 {
        self.largest_overlap * relative_tolerance(self.tolerance, self.slack, self.largest_overlap)
    }
}
