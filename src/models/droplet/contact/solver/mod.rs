//! Three ways to solve `A f = δ` for the forces of a given set of contacts.
//!
//! Conjugate gradients is the way of the relaxation: `A` is well conditioned (about 6, whatever the number of
//! particles) and the forces of the last step are a good guess. The other two cross-check it and are its yardsticks in
//! the benchmarks: faer's sparse Cholesky, and the dense Gauss–Jordan elimination of Saitoh 2.2.3.
//!
//! The direct solvers know nothing of inactive contacts: they are given sets without them.
//!
//! See the example of [`LinearSolver`].

mod cholesky;
mod conjugate_gradient;
mod gauss_jordan;
mod single;

pub use cholesky::SparseCholesky;
pub use conjugate_gradient::ConjugateGradient;
pub(crate) use conjugate_gradient::{Goal, Progress, Start};
pub use gauss_jordan::GaussJordan;

use super::matrix::ContactMatrix;
use crate::text::counted;

/// Which solver to use.
///
/// # Example
///
/// ```
/// use softjam::models::droplet::contact::solver::{LinearSolver, Method};
///
/// assert_eq!(Method::default(), Method::ConjugateGradient);
/// let solver = LinearSolver::new(Method::SparseCholesky);
/// # let _ = solver;
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Method {
    /// Conjugate gradients, preconditioned by the diagonal and started from the forces at hand.
    #[default]
    ConjugateGradient,
    /// faer's sparse Cholesky factorisation, simplicial, without threads.
    SparseCholesky,
    /// Dense Gauss–Jordan elimination with row pivoting, O(N_c³).
    GaussJordan,
}

/// Why `A f = δ` was not solved.
///
/// ```
/// use softjam::models::droplet::contact::list::ContactList;
/// use softjam::models::droplet::contact::matrix::{ContactMatrix, Geometry};
/// use softjam::models::droplet::contact::solver::{LinearSolver, Method, SolverError};
/// use softjam::domain::{Domain, Vec2};
/// use softjam::state::Packing;
///
/// let at = |x, y| Vec2::new(x, y);
/// let positions = vec![at(1.0, 2.0), at(1.9, 2.0), at(2.8, 2.1)];
/// let packing = Packing::new(Domain::new(8.0, 8.0).unwrap(), vec![0.5, 0.5, 0.6], positions).unwrap();
/// let contacts = ContactList::new(3, &[[0, 1], [1, 2]]).unwrap();
/// let geometry = Geometry::of(&packing, &contacts);
/// let matrix = ContactMatrix::of(&packing, &contacts, &geometry, 1.0);
/// // An overlap that is no number has no forces, and nothing hangs over it.
/// let mut solver = LinearSolver::new(Method::ConjugateGradient);
/// let error = solver.solve(&matrix, &[f64::NAN, 0.1], &mut [0.0; 2], 1e-12).unwrap_err();
/// assert!(matches!(error, SolverError::NotConverged { .. } | SolverError::NotPositiveDefinite { .. }), "{error}");
/// ```
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SolverError {
    /// The matrix is not positive definite: two contacts of a particle lie at the same angle, or a value is not finite.
    #[error(
        "the contact matrix is not positive definite at contact {contact} of {contacts}: \
         a particle has two neighbours in the same direction"
    )]
    NotPositiveDefinite {
        /// A contact at which it shows.
        contact: usize,
        /// Number of contacts.
        contacts: usize,
    },
    /// The residual did not fall to the tolerance.
    #[error(
        "the contact forces did not converge: residual {residual:e} after {}, asked for {tolerance:e}", counted(.iterations, "iteration")
    )]
    NotConverged {
        /// The largest residual `|A f − δ|` reached (length).
        residual: f64,
        /// The largest residual asked for (length).
        tolerance: f64,
        /// The iterations done.
        iterations: usize,
    },
}

/// A solver with its buffers.
///
/// # Example
///
/// ```
/// use softjam::models::droplet::contact::list::ContactList;
/// use softjam::models::droplet::contact::matrix::{ContactMatrix, Geometry};
/// use softjam::models::droplet::contact::solver::{LinearSolver, Method};
/// use softjam::domain::{Domain, Vec2};
/// use softjam::state::Packing;
///
/// let at = |x| Vec2::new(x, 2.0);
/// let packing = Packing::new(Domain::new(8.0, 8.0).unwrap(), vec![0.5; 3], vec![at(1.0), at(1.9), at(2.8)]).unwrap();
/// let contacts = ContactList::new(3, &[[0, 1], [1, 2]]).unwrap();
/// let geometry = Geometry::of(&packing, &contacts);
/// let matrix = ContactMatrix::of(&packing, &contacts, &geometry, 1.0);
/// for method in [Method::ConjugateGradient, Method::SparseCholesky, Method::GaussJordan] {
///     let mut forces = vec![0.0; 2];
///     LinearSolver::new(method).solve(&matrix, geometry.overlaps(), &mut forces, 1e-15).unwrap();
///     // (3/4π + 1/8π) f = 0.1
///     assert!((forces[0] - 0.1 * 8.0 * std::f64::consts::PI / 7.0).abs() < 1e-13);
/// }
/// ```
#[derive(Clone, Debug)]
pub enum LinearSolver {
    /// See [`Method::ConjugateGradient`].
    ConjugateGradient(ConjugateGradient),
    /// See [`Method::SparseCholesky`].
    SparseCholesky(SparseCholesky),
    /// See [`Method::GaussJordan`].
    GaussJordan(GaussJordan),
}

impl LinearSolver {
    /// A solver of the given kind.
    #[must_use]
    pub fn new(method: Method) -> Self {
        match method {
            Method::ConjugateGradient => Self::ConjugateGradient(ConjugateGradient::default()),
            Method::SparseCholesky => Self::SparseCholesky(SparseCholesky::default()),
            Method::GaussJordan => Self::GaussJordan(GaussJordan::default()),
        }
    }

    /// Solves `A f = δ`; returns the number of iterations (0 for the direct solvers).
    ///
    /// `forces` holds the starting guess and then the solution; `tolerance` bounds `max |A f − δ|` (length) and is
    /// used by the iterative solver, the direct ones go to round-off.
    ///
    /// # Errors
    ///
    /// [`SolverError`]. `forces` is then of no use.
    pub fn solve(
        &mut self,
        matrix: &ContactMatrix,
        overlaps: &[f64],
        forces: &mut [f64],
        tolerance: f64,
    ) -> Result<usize, SolverError> {
        match self {
            Self::ConjugateGradient(cg) => cg.solve(matrix, overlaps, forces, tolerance),
            Self::SparseCholesky(cholesky) => cholesky.solve(matrix, overlaps, forces).map(|()| 0),
            Self::GaussJordan(dense) => dense.solve(matrix, overlaps, forces).map(|()| 0),
        }
    }

    /// How often a pattern was analysed.
    pub(super) fn symbolic_factorizations(&self) -> u64 {
        match self {
            Self::SparseCholesky(cholesky) => cholesky.symbolic_factorizations(),
            Self::ConjugateGradient(_) | Self::GaussJordan(_) => 0,
        }
    }
}
