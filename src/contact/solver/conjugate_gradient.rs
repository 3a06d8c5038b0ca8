//! Preconditioned conjugate gradients.

use super::SolverError;
use crate::contact::matrix::ContactMatrix;

/// Conjugate gradients with the diagonal as preconditioner; owns its vectors, so a solve allocates nothing.
///
/// # Example
///
/// See [`LinearSolver`](super::LinearSolver); this is its default.
#[derive(Clone, Debug, Default)]
pub struct ConjugateGradient {
    residual: Vec<f64>,
    preconditioned: Vec<f64>,
    direction: Vec<f64>,
    image: Vec<f64>,
}

impl ConjugateGradient {
    /// Solves `A f = δ` from the guess in `forces` to `max |A f − δ| ≤ tolerance`; returns the iterations.
    ///
    /// The residual that is tested last is computed anew from the solution, never the recurrence's own.
    ///
    /// # Errors
    ///
    /// [`SolverError::NotPositiveDefinite`] when a search direction has no positive curvature,
    /// [`SolverError::NotConverged`] after `100 + 10 N_c` iterations.
    ///
    /// ```
    /// # use softjam::contact::{matrix::ContactMatrix, solver::ConjugateGradient};
    /// assert_eq!(ConjugateGradient::default().solve(&ContactMatrix::default(), &[], &mut [], 0.0), Ok(0));
    /// ```
    pub fn solve(
        &mut self,
        matrix: &ContactMatrix,
        overlaps: &[f64],
        forces: &mut [f64],
        tolerance: f64,
    ) -> Result<usize, SolverError> {
        let n = matrix.len();
        let most = 100 + 10 * n;
        for v in [
            &mut self.residual,
            &mut self.preconditioned,
            &mut self.direction,
            &mut self.image,
        ] {
            v.resize(n, 0.0);
        }
        let mut iterations = 0;
        loop {
            let largest = self.true_residual(matrix, overlaps, forces);
            if largest <= tolerance {
                return Ok(iterations);
            }
            if iterations >= most || !largest.is_finite() {
                return Err(SolverError::NotConverged {
                    residual: largest,
                    tolerance,
                    iterations,
                });
            }
            iterations += self.descend(matrix, forces, tolerance, most - iterations)?;
        }
    }

    /// `residual = δ − A f`, and its largest magnitude (NaN if any entry is).
    fn true_residual(&mut self, matrix: &ContactMatrix, overlaps: &[f64], forces: &[f64]) -> f64 {
        matrix.multiply(forces, &mut self.image);
        let mut largest: f64 = 0.0;
        for ((r, q), d) in self.residual.iter_mut().zip(&self.image).zip(overlaps) {
            *r = d - q;
            largest = if r.abs() <= largest { largest } else { r.abs() };
        }
        largest
    }

    /// Iterates from the residual at hand until the recurrence's residual meets the tolerance.
    fn descend(
        &mut self,
        matrix: &ContactMatrix,
        forces: &mut [f64],
        tolerance: f64,
        most: usize,
    ) -> Result<usize, SolverError> {
        let diagonal = matrix.diagonal();
        for ((z, r), d) in self
            .preconditioned
            .iter_mut()
            .zip(&self.residual)
            .zip(diagonal)
        {
            *z = r / d;
        }
        self.direction.copy_from_slice(&self.preconditioned);
        let mut rz = dot(&self.residual, &self.preconditioned);
        for iteration in 1..=most {
            matrix.multiply(&self.direction, &mut self.image);
            let curvature = dot(&self.direction, &self.image);
            if curvature.is_nan() || curvature <= 0.0 {
                let contact = largest_entry(&self.direction);
                return Err(SolverError::NotPositiveDefinite {
                    contact,
                    contacts: matrix.len(),
                });
            }
            let alpha = rz / curvature;
            let mut largest: f64 = 0.0;
            for c in 0..matrix.len() {
                forces[c] += alpha * self.direction[c];
                self.residual[c] -= alpha * self.image[c];
                self.preconditioned[c] = self.residual[c] / diagonal[c];
                largest = largest.max(self.residual[c].abs());
            }
            if largest <= 0.5 * tolerance {
                return Ok(iteration);
            }
            let next = dot(&self.residual, &self.preconditioned);
            let beta = next / rz;
            rz = next;
            for (p, z) in self.direction.iter_mut().zip(&self.preconditioned) {
                *p = z + beta * *p;
            }
        }
        Ok(most)
    }
}

/// The sum of products in one fixed order, four chains wide.
fn dot(a: &[f64], b: &[f64]) -> f64 {
    let (a4, a_rest) = a.as_chunks::<4>();
    let (b4, b_rest) = b.as_chunks::<4>();
    let mut sums = [0.0; 4];
    for (x, y) in a4.iter().zip(b4) {
        for k in 0..4 {
            sums[k] += x[k] * y[k];
        }
    }
    let rest: f64 = a_rest.iter().zip(b_rest).map(|(x, y)| x * y).sum();
    (sums[0] + sums[1]) + (sums[2] + sums[3]) + rest
}

fn largest_entry(v: &[f64]) -> usize {
    let mut best = 0;
    for (k, x) in v.iter().enumerate() {
        if x.abs() > v[best].abs() || x.is_nan() {
            best = k;
        }
    }
    best
}
