//! Preconditioned conjugate gradients.

use super::SolverError;
use super::single::Single;
use crate::contact::matrix::ContactMatrix;
use crate::wide::wide;

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
    single: Single,
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
        let mut quickly = true;
        loop {
            let before = self.largest;
            self.largest = self.true_residual(matrix, overlaps, forces);
            if self.largest <= tolerance {
                return Ok(iterations);
            }
            if iterations >= most || !self.largest.is_finite() {
                return Err(self.not_converged(tolerance, iterations));
            }
            if iterations == 0 {
                self.single.take(matrix);
            } else {
                quickly &= self.largest <= 0.5 * before;
            }
            if quickly && let Some((more, _)) = self.correct(matrix, forces, tolerance) {
                iterations += more;
            } else {
                iterations += self.descend(matrix, forces, tolerance, most - iterations)?;
            }
        }
    }

    /// [`solve`](Self::solve) to a tolerance far above round-off: the residual tested last is the recurrence's own with
    /// an estimate of its round-off. Saves a product with the matrix.
    pub(crate) fn solve_loosely(
        &mut self,
        matrix: &ContactMatrix,
        overlaps: &[f64],
        forces: &mut [f64],
        tolerance: f64,
    ) -> Result<usize, SolverError> {
        let (most, mut iterations) = (self.prepare(matrix), 0);
        loop {
            let before = self.largest;
            self.largest = self.true_residual(matrix, overlaps, forces);
            if self.largest <= tolerance {
                return Ok(iterations);
            }
            if iterations == 0 {
                self.single.take(matrix);
            } else if self.largest > 0.5 * before {
                break;
            }
            let Some((more, bound)) = self.correct(matrix, forces, tolerance) else {
                break;
            };
            iterations += more;
            if bound <= tolerance {
                self.largest = bound;
                return Ok(iterations);
            }
        }
        iterations += self.descend(matrix, forces, tolerance, most)?;
        if self.largest <= tolerance {
            Ok(iterations)
        } else {
            Err(self.not_converged(tolerance, iterations))
        }
    }

    /// A round of the correction in single precision; see [`Single::correct`].
    fn correct(
        &mut self,
        matrix: &ContactMatrix,
        forces: &mut [f64],
        tolerance: f64,
    ) -> Option<(usize, f64)> {
        let residual = &self.residual;
        self.single.correct(matrix, residual, forces, tolerance)
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
        let (residual, image) = (&mut self.residual[..], &mut self.image[..]);
        wide(
            #[inline(always)]
            || {
                if forces.iter().all(|f| *f == 0.0) {
                    image.fill(0.0);
                } else {
                    matrix.multiply_here(forces, image);
                }
                subtract(residual, overlaps, image)
            },
        )
    }

    /// Iterates from the residual at hand until the recurrence's residual meets the tolerance.
    fn descend(
        &mut self,
        matrix: &ContactMatrix,
        forces: &mut [f64],
        tolerance: f64,
        most: usize,
    ) -> Result<usize, SolverError> {
        wide(
            #[inline(always)]
            || self.descend_here(matrix, forces, tolerance, most),
        )
    }

    #[inline(always)]
    fn descend_here(
        &mut self,
        matrix: &ContactMatrix,
        forces: &mut [f64],
        tolerance: f64,
        most: usize,
    ) -> Result<usize, SolverError> {
        let (diagonal, scaling) = (matrix.diagonal(), matrix.scaling());
        let mut rz = 0.0;
        for (r, s) in self.residual.iter().zip(scaling) {
            rz += r * r * (s * s);
        }
        self.direction.fill(0.0);
        let mut beta = 0.0;
        for iteration in 1..=most {
            turn(
                &mut self.direction,
                &mut self.image,
                &self.residual,
                (diagonal, scaling),
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
                scaling,
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

/// `r = d − q`; returns the largest magnitude, NaN if any is.
#[inline(always)]
fn subtract(residual: &mut [f64], overlaps: &[f64], image: &[f64]) -> f64 {
    let larger = |m: f64, x: f64| if x > m || x.is_nan() { x } else { m };
    let (r8, r_rest) = residual.as_chunks_mut::<8>();
    let (d8, d_rest) = overlaps.as_chunks::<8>();
    let (q8, q_rest) = image.as_chunks::<8>();
    let mut largest = [0.0; 8];
    for ((r, d), q) in r8.iter_mut().zip(d8).zip(q8) {
        for k in 0..8 {
            r[k] = d[k] - q[k];
            largest[k] = larger(largest[k], r[k].abs());
        }
    }
    let mut most = largest.into_iter().fold(0.0, larger);
    for ((r, d), q) in r_rest.iter_mut().zip(d_rest).zip(q_rest) {
        *r = d - q;
        most = larger(most, r.abs());
    }
    most
}

/// The next direction `p = D⁻¹ r + β p`, and the diagonal's part of its image, `q = D p`.
#[inline(always)]
fn turn(
    direction: &mut [f64],
    image: &mut [f64],
    residual: &[f64],
    (diagonal, scaling): (&[f64], &[f64]),
    beta: f64,
) {
    let rows = direction.iter_mut().zip(image).zip(residual);
    for (((p, q), r), (d, s)) in rows.zip(diagonal.iter().zip(scaling)) {
        *p = r * (s * s) + beta * *p;
        *q = d * *p;
    }
}

/// A move by `α` along the direction; returns `rᵀ D⁻¹ r` and `max |r|` behind it. The sum has four chains.
#[inline(always)]
fn advance(
    forces: &mut [f64],
    residual: &mut [f64],
    (direction, image): (&[f64], &[f64]),
    scaling: &[f64],
    alpha: f64,
) -> (f64, f64) {
    let (f4, f_rest) = forces.as_chunks_mut::<4>();
    let (r4, r_rest) = residual.as_chunks_mut::<4>();
    let (p4, p_rest) = direction.as_chunks::<4>();
    let (q4, q_rest) = image.as_chunks::<4>();
    let (w4, w_rest) = scaling.as_chunks::<4>();
    let (mut sums, mut largest) = ([0.0; 4], [0.0f64; 4]);
    for ((((f, r), p), q), w) in f4.iter_mut().zip(r4).zip(p4).zip(q4).zip(w4) {
        for k in 0..4 {
            f[k] += alpha * p[k];
            r[k] -= alpha * q[k];
            sums[k] += r[k] * r[k] * (w[k] * w[k]);
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
        rest += *r * *r * (w * w);
        largest_rest = largest_rest.max(r.abs());
    }
    let [a, b, c, d] = largest;
    (
        (sums[0] + sums[1]) + (sums[2] + sums[3]) + rest,
        a.max(b).max(c.max(d)).max(largest_rest),
    )
}

/// The sum of products in one fixed order, four chains wide.
#[inline(always)]
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
