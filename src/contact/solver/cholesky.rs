//! faer's sparse Cholesky factorisation.

use super::SolverError;
use crate::contact::matrix::ContactMatrix;
use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::cholesky::llt::factor::LltError;
use faer::sparse::linalg::SupernodalThreshold;
use faer::sparse::linalg::cholesky::{
    CholeskySymbolicParams, SymbolicCholesky, SymmetricOrdering, factorize_symbolic_cholesky,
};
use faer::sparse::{SparseColMatRef, SymbolicSparseColMatRef};
use faer::{Conj, MatMut, Par, Side};

/// faer's `L Lᵀ` of the lower triangle, with an approximate minimum-degree ordering; the symbolic part is kept while
/// the pattern of the matrix stays.
///
/// The factorisation is the simplicial one, without threads: its sums have one order on every machine. The supernodal
/// one would pick its kernels by the CPU.
///
/// # Example
///
/// See [`LinearSolver`](super::LinearSolver).
#[derive(Clone, Debug, Default)]
pub struct SparseCholesky {
    /// Lower triangle by columns: pointers, rows (ascending) and values.
    pointers: Vec<u32>,
    rows: Vec<u32>,
    values: Vec<f64>,
    symbolic: Option<Symbolic>,
    factor: Vec<f64>,
    order: Vec<(u32, f64)>,
    analyses: u64,
}

#[derive(Clone, Debug)]
struct Symbolic {
    pointers: Vec<u32>,
    rows: Vec<u32>,
    factorization: std::sync::Arc<SymbolicCholesky<u32>>,
}

impl SparseCholesky {
    /// Solves `A f = δ` to round-off; what `forces` held before does not matter.
    ///
    /// # Errors
    ///
    /// [`SolverError::NotPositiveDefinite`] when a pivot is not positive.
    ///
    /// ```
    /// # use softjam::contact::{matrix::ContactMatrix, solver::SparseCholesky};
    /// assert_eq!(SparseCholesky::default().solve(&ContactMatrix::default(), &[], &mut []), Ok(()));
    /// ```
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
        let pattern = SymbolicSparseColMatRef::new_checked(n, n, &self.pointers, None, &self.rows);
        let known = self
            .symbolic
            .take()
            .filter(|s| s.pointers == self.pointers && s.rows == self.rows);
        let stands = known.is_some();
        let symbolic = match known {
            Some(symbolic) => symbolic,
            None => Symbolic {
                pointers: self.pointers.clone(),
                rows: self.rows.clone(),
                factorization: std::sync::Arc::new(
                    factorize_symbolic_cholesky(
                        pattern,
                        Side::Lower,
                        SymmetricOrdering::Amd,
                        CholeskySymbolicParams {
                            supernodal_flop_ratio_threshold: SupernodalThreshold::FORCE_SIMPLICIAL,
                            ..Default::default()
                        },
                    )
                    .map_err(|_| failed(0))?,
                ),
            },
        };
        self.analyses += u64::from(!stands);
        let factorization = std::sync::Arc::clone(&symbolic.factorization);
        self.symbolic = Some(symbolic);
        self.factor.clear();
        self.factor.resize(factorization.len_val(), 0.0);
        let mut memory = MemBuffer::new(
            factorization.factorize_numeric_llt_scratch::<f64>(Par::Seq, Default::default()),
        );
        let llt = factorization
            .factorize_numeric_llt(
                &mut self.factor,
                SparseColMatRef::new(pattern, &self.values),
                Side::Lower,
                Default::default(),
                Par::Seq,
                MemStack::new(&mut memory),
                Default::default(),
            )
            .map_err(|error| match error {
                LltError::NonPositivePivot { index } => failed(index),
            })?;
        forces.copy_from_slice(overlaps);
        let mut memory = MemBuffer::new(factorization.solve_in_place_scratch::<f64>(1, Par::Seq));
        llt.solve_in_place_with_conj(
            Conj::No,
            MatMut::from_column_major_slice_mut(forces, n, 1),
            Par::Seq,
            MemStack::new(&mut memory),
        );
        match forces.iter().position(|f| !f.is_finite()) {
            Some(contact) => Err(failed(contact)),
            None => Ok(()),
        }
    }

    /// How often a pattern was analysed.
    pub(crate) fn symbolic_factorizations(&self) -> u64 {
        self.analyses
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
            self.values.extend(self.order.iter().map(|e| e.1));
            self.pointers.push(self.rows.len() as u32);
        }
    }
}
