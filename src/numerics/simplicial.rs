//! faer's sparse Cholesky factorisation, tamed: simplicial and without threads.
//!
//! The supernodal factorisation would pick its kernels by the CPU; the simplicial one has one order of sums on every
//! machine.

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::perm::PermRef;
use faer::sparse::linalg::SupernodalThreshold;
use faer::sparse::linalg::amd;
use faer::sparse::linalg::cholesky::{
    CholeskySymbolicParams, LdltRef, LltRef, SymbolicCholesky, SymmetricOrdering,
    factorize_symbolic_cholesky,
};
use faer::sparse::{SparseColMatRef, SymbolicSparseColMatRef};
use faer::{Conj, MatMut, Par, Side};

/// A symmetric matrix of square blocks of side `BLOCK`, by its lower triangle, and its factor: `L Lᵀ`, or `L D Lᵀ` without exchanges of rows where
/// it is `SIGNED`, which every matrix has whose pivots are positive for some rows and negative for the others in whatever order (a *quasidefinite*
/// one: R. J. Vanderbei, SIAM J. Optim. 5, 100 (1995)).
///
/// The ordering is approximate minimum degree on the graph of the blocks. It and the pattern of `L` are kept while the
/// pattern of the matrix stays; they depend on nothing else.
#[derive(Clone, Debug, Default)]
pub(crate) struct Simplicial<const BLOCK: usize, const SIGNED: bool = false> {
    /// Column pointers and rows (ascending, the diagonal first) of the lower triangle of blocks.
    pointers: Vec<u32>,
    rows: Vec<u32>,
    symbolic: Option<std::sync::Arc<SymbolicCholesky<u32>>>,
    /// Lower triangle of the scalar matrix, by columns.
    scalar_pointers: Vec<u32>,
    scalar_rows: Vec<u32>,
    scalar_values: Vec<f64>,
    factor: Vec<f64>,
    analyses: u64,
}

/// There is no factor: the index of the pivot that is not positive (is 0, of a signed one), or 0 where memory was short.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct NotPositive(pub(crate) usize);

impl<const BLOCK: usize, const SIGNED: bool> Simplicial<BLOCK, SIGNED> {
    /// Factorises the matrix of `blocks`: `rows[pointers[c]..pointers[c + 1]]` are the block rows of block column `c`,
    /// ascending, the diagonal first; a block is stored by columns, of diagonal blocks the lower triangle is used.
    pub(crate) fn factorize(
        &mut self,
        pointers: &[u32],
        rows: &[u32],
        blocks: &[[[f64; BLOCK]; BLOCK]],
    ) -> Result<(), NotPositive> {
        if self.symbolic.is_none() || self.pointers != pointers || self.rows != rows {
            self.analyze(pointers, rows)?;
        }
        self.scalar_values.clear();
        for column in pointers.windows(2) {
            let blocks = &blocks[column[0] as usize..column[1] as usize];
            for k in 0..BLOCK {
                for (b, block) in blocks.iter().enumerate() {
                    self.scalar_values
                        .extend_from_slice(&block[k][if b == 0 { k } else { 0 }..]);
                }
            }
        }
        let Some(symbolic) = &self.symbolic else {
            return Err(NotPositive(0));
        };
        let n = symbolic.nrows();
        let pattern = SymbolicSparseColMatRef::new_checked(
            n,
            n,
            &self.scalar_pointers,
            None,
            &self.scalar_rows,
        );
        self.factor.clear();
        self.factor.resize(symbolic.len_val(), 0.0);
        let matrix = SparseColMatRef::new(pattern, &self.scalar_values);
        if SIGNED {
            let mut memory = MemBuffer::new(
                symbolic.factorize_numeric_ldlt_scratch::<f64>(Par::Seq, Default::default()),
            );
            let factored = symbolic.factorize_numeric_ldlt(
                &mut self.factor,
                matrix,
                Side::Lower,
                Default::default(),
                Par::Seq,
                MemStack::new(&mut memory),
                Default::default(),
            );
            return factored.map(|_| ()).map_err(|error| match error {
                faer::linalg::cholesky::ldlt::factor::LdltError::ZeroPivot { index } => {
                    NotPositive(index)
                }
            });
        }
        let mut memory = MemBuffer::new(
            symbolic.factorize_numeric_llt_scratch::<f64>(Par::Seq, Default::default()),
        );
        let factored = symbolic.factorize_numeric_llt(
            &mut self.factor,
            matrix,
            Side::Lower,
            Default::default(),
            Par::Seq,
            MemStack::new(&mut memory),
            Default::default(),
        );
        factored.map(|_| ()).map_err(|error| match error {
            faer::linalg::cholesky::llt::factor::LltError::NonPositivePivot { index } => {
                NotPositive(index)
            }
        })
    }

    /// Solves in place with the factor found last; does nothing where there is none.
    pub(crate) fn solve(&self, x: &mut [f64]) {
        let Some(symbolic) = &self.symbolic else {
            return;
        };
        let mut memory = MemBuffer::new(symbolic.solve_in_place_scratch::<f64>(1, Par::Seq));
        let n = x.len();
        let (x, stack) = (
            MatMut::from_column_major_slice_mut(x, n, 1),
            MemStack::new(&mut memory),
        );
        if SIGNED {
            LdltRef::new(symbolic, &self.factor).solve_in_place_with_conj(
                Conj::No,
                x,
                Par::Seq,
                stack,
            );
        } else {
            LltRef::new(symbolic, &self.factor).solve_in_place_with_conj(
                Conj::No,
                x,
                Par::Seq,
                stack,
            );
        }
    }

    /// How often a pattern was analysed.
    pub(crate) fn analyses(&self) -> u64 {
        self.analyses
    }

    fn analyze(&mut self, pointers: &[u32], rows: &[u32]) -> Result<(), NotPositive> {
        self.analyses += 1;
        let n = pointers.len().saturating_sub(1);
        self.symbolic = None;
        self.pointers = pointers.to_vec();
        self.rows = rows.to_vec();
        let graph = SymbolicSparseColMatRef::new_checked(n, n, pointers, None, rows);
        let mut memory = MemBuffer::new(amd::order_scratch::<u32>(n, rows.len()));
        let (mut order, mut inverse) = (vec![0_u32; n], vec![0_u32; n]);
        amd::order(
            &mut order,
            &mut inverse,
            graph,
            Default::default(),
            MemStack::new(&mut memory),
        )
        .map_err(|_| NotPositive(0))?;
        let spread = |order: &[u32]| -> Vec<u32> {
            order
                .iter()
                .flat_map(|&o| (0..BLOCK as u32).map(move |k| BLOCK as u32 * o + k))
                .collect()
        };
        let forward = spread(&order);
        let mut backward = vec![0_u32; forward.len()];
        for (place, &index) in forward.iter().enumerate() {
            backward[index as usize] = place as u32;
        }
        self.scalar_pointers.clear();
        self.scalar_rows.clear();
        self.scalar_pointers.push(0);
        for (c, column) in pointers.windows(2).enumerate() {
            let rows = &rows[column[0] as usize..column[1] as usize];
            for k in 0..BLOCK as u32 {
                for &r in rows {
                    let first = if r as usize == c { k } else { 0 };
                    self.scalar_rows
                        .extend((first..BLOCK as u32).map(|m| BLOCK as u32 * r + m));
                }
                self.scalar_pointers.push(self.scalar_rows.len() as u32);
            }
        }
        let size = n * BLOCK;
        let pattern = SymbolicSparseColMatRef::new_checked(
            size,
            size,
            &self.scalar_pointers,
            None,
            &self.scalar_rows,
        );
        let symbolic = factorize_symbolic_cholesky(
            pattern,
            Side::Lower,
            SymmetricOrdering::Custom(PermRef::new_checked(&forward, &backward, size)),
            CholeskySymbolicParams {
                supernodal_flop_ratio_threshold: SupernodalThreshold::FORCE_SIMPLICIAL,
                ..Default::default()
            },
        )
        .map_err(|_| NotPositive(0))?;
        self.symbolic = Some(std::sync::Arc::new(symbolic));
        Ok(())
    }
}
