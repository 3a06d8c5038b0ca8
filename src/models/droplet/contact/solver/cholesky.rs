//! faer's sparse Cholesky factorisation.

use super::SolverError;
use crate::models::droplet::contact::matrix::ContactMatrix;
use crate::numerics::simplicial::Simplicial;

/// faer's `L Lᵀ` of the lower triangle, with an approximate minimum-degree ordering; the symbolic part is kept while
/// the pattern of the matrix stays.
///
/// The factorisation is the simplicial one, without threads: its sums have one order on every machine. The supernodal
/// one would pick its kernels by the CPU.
///
/// See the example of [`LinearSolver`](super::LinearSolver).
#[derive(Clone, Debug, Default)]
pub struct SparseCholesky {
    /// Lower triangle by columns: pointers, rows (ascending) and values.
    pointers: Vec<u32>,
    rows: Vec<u32>,
    values: Vec<[[f64; 1]; 1]>,
    factor: Simplicial<1>,
    order: Vec<(u32, f64)>,
}

impl SparseCholesky {
    /// Solves `A f = δ` to round-off; what `forces` held before does not matter.
    ///
    /// # Errors
    ///
    /// [`SolverError::NotPositiveDefinite`] when a pivot is not positive.
    pub fn solve(
        &mut self,
        matrix: &ContactMatrix,
        overlaps: &[f64],
        forces: &mut [f64],
    ) -> Result<(), SolverError> {
        let n = matrix.len();
        if n == 0 {
            return Ok(());
        }
        let failed = |contact: usize| SolverError::NotPositiveDefinite {
            contact,
            contacts: n,
        };
        self.lower_triangle(matrix);
        self.factor
            .factorize(&self.pointers, &self.rows, &self.values)
            .map_err(|pivot| failed(pivot.0))?;
        forces.copy_from_slice(overlaps);
        self.factor.solve(forces);
        match forces.iter().position(|f| !f.is_finite()) {
            Some(contact) => Err(failed(contact)),
            None => Ok(()),
        }
    }

    /// How often a pattern was analysed.
    pub(super) fn symbolic_factorizations(&self) -> u64 {
        self.factor.analyses()
    }

    fn lower_triangle(&mut self, matrix: &ContactMatrix) {
        self.pointers.clear();
        self.rows.clear();
        self.values.clear();
        self.pointers.push(0);
        for c in 0..matrix.len() {
            self.order.clear();
            self.order.push((c as u32, matrix.diagonal()[c]));
            // The matrix is symmetric: row c, right of the diagonal, is column c below it.
            self.order.extend(
                matrix
                    .row(c)
                    .filter(|&(k, _)| k > c)
                    .map(|(k, v)| (k as u32, v)),
            );
            self.order.sort_unstable_by_key(|&(k, _)| k);
            self.rows.extend(self.order.iter().map(|e| e.0));
            self.values.extend(self.order.iter().map(|e| [[e.1]]));
            self.pointers.push(self.rows.len() as u32);
        }
    }
}
