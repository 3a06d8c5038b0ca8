//! Preconditioned conjugate gradients.

use super::SolverError;
use crate::contact::matrix::ContactMatrix;

/// Conjugate gradients with the diagonal as preconditioner; owns its vectors, so a solve allocates nothing once they are
/// long enough.
///
/// See the example of [`LinearSolver`](super::LinearSolver); this is its default.
#[derive(Clone, Debug, Default)]
pub struct ConjugateGradient {
    residual: Vec<f64>,
    direction: Vec<f64>,
    image: Vec<f64>,
    largest: f64,
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
        let (most, mut iterations) = (self.prepare(matrix), 0);
        loop {
            self.largest = self.true_residual(matrix, overlaps, forces);
            if self.largest <= tolerance {
                return Ok(iterations);
            }
            if iterations >= most || !self.largest.is_finite() {
                return Err(self.not_converged(tolerance, iterations));
            }
            iterations += self.descend(matrix, forces, tolerance, most - iterations)?;
        }
    }

    /// [`solve`](Self::solve) to a tolerance far above round-off: the residual is the recurrence's own, which differs from
    /// the true one by round-off alone. Saves a product with the matrix.
    pub(crate) fn solve_loosely(
        &mut self,
        matrix: &ContactMatrix,
        overlaps: &[f64],
        forces: &mut [f64],
        tolerance: f64,
    ) -> Result<usize, SolverError> {
        let most = self.prepare(matrix);
        self.largest = self.true_residual(matrix, overlaps, forces);
        if self.largest <= tolerance {
            return Ok(0);
        }
        let iterations = self.descend(matrix, forces, tolerance, most)?;
        if self.largest <= tolerance {
            Ok(iterations)
        } else {
            Err(self.not_converged(tolerance, iterations))
        }
    }

    /// Makes room; returns the most iterations that are tried.
    fn prepare(&mut self, matrix: &ContactMatrix) -> usize {
        let n = matrix.len();
        for v in [&mut self.residual, &mut self.direction, &mut self.image] {
            v.resize(n, 0.0);
        }
        100 + 10 * n
    }

    fn not_converged(&self, tolerance: f64, iterations: usize) -> SolverError {
        SolverError::NotConverged {
            residual: self.largest,
            tolerance,
            iterations,
        }
    }

    /// `max |A f − δ|` of the last solution (length).
    pub(crate) fn largest_residual(&self) -> f64 {
        self.largest
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
        let (diagonal, inverse) = (matrix.diagonal(), matrix.inverse_diagonal());
        let mut rz = 0.0;
        for (r, w) in self.residual.iter().zip(inverse) {
            rz += r * r * w;
        }
        self.direction.fill(0.0);
        let mut beta = 0.0;
        for iteration in 1..=most {
            turn(
                &mut self.direction,
                &mut self.image,
                &self.residual,
                (diagonal, inverse),
                beta,
            );
            matrix.add_off_diagonal(&self.direction, &mut self.image);
            let curvature = dot(&self.direction, &self.image);
            if curvature.is_nan() || curvature <= 0.0 {
                let contact = largest_entry(&self.direction);
                return Err(SolverError::NotPositiveDefinite {
                    contact,
                    contacts: matrix.len(),
                });
            }
            let alpha = rz / curvature;
            let (next, largest) = advance(
                forces,
                &mut self.residual,
                (&self.direction, &self.image),
                inverse,
                alpha,
            );
            self.largest = largest;
            // A NaN hides from the largest entry, but not from the sum.
            if largest <= 0.5 * tolerance && next.is_finite() {
                return Ok(iteration);
            }
            beta = next / rz;
            rz = next;
        }
        Ok(most)
    }
}

/// The next direction `p = D⁻¹ r + β p`, and the diagonal's part of its image, `q = D p`.
fn turn(
    direction: &mut [f64],
    image: &mut [f64],
    residual: &[f64],
    (diagonal, inverse): (&[f64], &[f64]),
    beta: f64,
) {
    let rows = direction.iter_mut().zip(image).zip(residual);
    for (((p, q), r), (d, w)) in rows.zip(diagonal.iter().zip(inverse)) {
        *p = r * w + beta * *p;
        *q = d * *p;
    }
}

/// A move by `α` along the direction; returns `rᵀ D⁻¹ r` and `max |r|` behind it. The sum has four chains.
fn advance(
    forces: &mut [f64],
    residual: &mut [f64],
    (direction, image): (&[f64], &[f64]),
    inverse: &[f64],
    alpha: f64,
) -> (f64, f64) {
    let (f4, f_rest) = forces.as_chunks_mut::<4>();
    let (r4, r_rest) = residual.as_chunks_mut::<4>();
    let (p4, p_rest) = direction.as_chunks::<4>();
    let (q4, q_rest) = image.as_chunks::<4>();
    let (w4, w_rest) = inverse.as_chunks::<4>();
    let (mut sums, mut largest) = ([0.0; 4], [0.0f64; 4]);
    for ((((f, r), p), q), w) in f4.iter_mut().zip(r4).zip(p4).zip(q4).zip(w4) {
        for k in 0..4 {
            f[k] += alpha * p[k];
            r[k] -= alpha * q[k];
            sums[k] += r[k] * r[k] * w[k];
            let magnitude = r[k].abs();
            largest[k] = if magnitude > largest[k] {
                magnitude
            } else {
                largest[k]
            };
        }
    }
    let (mut rest, mut largest_rest) = (0.0, 0.0f64);
    let rows = f_rest.iter_mut().zip(r_rest).zip(p_rest);
    for (((f, r), p), (q, w)) in rows.zip(q_rest.iter().zip(w_rest)) {
        *f += alpha * p;
        *r -= alpha * q;
        rest += *r * *r * w;
        largest_rest = largest_rest.max(r.abs());
    }
    let [a, b, c, d] = largest;
    (
        (sums[0] + sums[1]) + (sums[2] + sums[3]) + rest,
        a.max(b).max(c.max(d)).max(largest_rest),
    )
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
