//! Dense Gauss–Jordan elimination, the solver that Saitoh 2.2.3 names.

use super::SolverError;
use crate::models::droplet::contact::matrix::ContactMatrix;

/// Gauss–Jordan elimination on the dense matrix, with row pivoting: O(`N_c`³) work, `N_c`² memory.
///
/// A yardstick and a cross-check, not a way to run: at 1000 contacts it needs a thousand times the work of the other
/// solvers.
///
/// See the example of [`LinearSolver`](super::LinearSolver).
#[derive(Clone, Debug, Default)]
pub struct GaussJordan {
    dense: Vec<f64>,
}

impl GaussJordan {
    /// Solves `A f = δ` to round-off; what `forces` held before does not matter.
    ///
    /// # Errors
    ///
    /// [`SolverError::NotPositiveDefinite`] when no pivot is left.
    pub fn solve(
        &mut self,
        matrix: &ContactMatrix,
        overlaps: &[f64],
        forces: &mut [f64],
    ) -> Result<(), SolverError> {
        let n = matrix.len();
        let width = n + 1; // the matrix, and the right-hand side as its last column
        self.dense.clear();
        self.dense.resize(n * width, 0.0);
        for c in 0..n {
            let row = &mut self.dense[c * width..(c + 1) * width];
            row[c] = matrix.diagonal()[c];
            row[n] = overlaps[c];
            for (k, v) in matrix.row(c) {
                row[k] = v;
            }
        }
        let mut pivot_row = vec![0.0; width];
        for column in 0..n {
            let pivot = (column..n)
                .max_by(|&a, &b| {
                    let magnitude = |r: usize| self.dense[r * width + column].abs();
                    magnitude(a).total_cmp(&magnitude(b))
                })
                .unwrap_or(column);
            let value = self.dense[pivot * width + column];
            if !(value.is_finite() && value != 0.0) {
                return Err(SolverError::NotPositiveDefinite {
                    contact: column,
                    contacts: n,
                });
            }
            for k in column..width {
                self.dense.swap(pivot * width + k, column * width + k);
                self.dense[column * width + k] /= value;
            }
            pivot_row.copy_from_slice(&self.dense[column * width..(column + 1) * width]);
            for (r, row) in self.dense.chunks_exact_mut(width).enumerate() {
                let factor = row[column];
                if r != column && factor != 0.0 {
                    for k in column..width {
                        row[k] -= factor * pivot_row[k];
                    }
                }
            }
        }
        for (f, row) in forces.iter_mut().zip(self.dense.chunks_exact(width)) {
            *f = row[n];
        }
        Ok(())
    }
}
