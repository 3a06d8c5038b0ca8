//! Preconditioned conjugate gradients.

use super::SolverError;
use super::single::Single;
use crate::models::droplet::contact::matrix::ContactMatrix;
use crate::models::droplet::contact::matrix::product::{First, Products};
use crate::numerics::wide::wide;

/// Conjugate gradients with the diagonal as preconditioner; owns its vectors, so a solve allocates nothing once they are
/// long enough.
///
/// See the example of [`LinearSolver`](super::LinearSolver); this is its default.
#[derive(Clone, Debug, Default)]
pub struct ConjugateGradient {
    residual: Vec<f64>,
    direction: Vec<f64>,
    image: Products<f64>,
    largest: f64,
    /// `max |D^(−½) r|` of the residual that was computed last.
    largest_weighted: f64,
    single: Single,
}

/// What is asked for.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Goal {
    /// The largest residual (length).
    pub(crate) tolerance: f64,
    /// Whether the recurrence's own residual, with an estimate of its round-off, will do: for tolerances far above round-off. That
    /// saves a product with the matrix.
    pub(crate) loosely: bool,
}

/// What there is to begin with.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Start<'a> {
    /// The products of the matrix's off-diagonal entries with the forces, if they are at hand. Those in single precision count with an
    /// estimate of their rounding.
    pub(crate) products: Option<First<'a>>,
    /// The iterations done so far.
    pub(crate) iterations: usize,
}

/// How far a solution has come.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Progress {
    /// To its end, after so many iterations.
    Done(usize),
    /// To where the residual is computed anew, after so many iterations, which needs the
    /// [values](ContactMatrix::is_complete).
    NeedsValues(usize),
    /// To where single precision ends, after so many iterations: double precision sums in the order of the contacts and needs a
    /// matrix that [is whole](ContactMatrix::is_whole).
    NeedsWhole(usize),
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
    pub fn solve(
        &mut self,
        matrix: &ContactMatrix,
        overlaps: &[f64],
        forces: &mut [f64],
        tolerance: f64,
    ) -> Result<usize, SolverError> {
        let loosely = false;
        self.solve_to(matrix, overlaps, forces, Goal { tolerance, loosely })
    }

    /// [`solve`](Self::solve), [loosely](Goal::loosely).
    pub(crate) fn solve_loosely(
        &mut self,
        matrix: &ContactMatrix,
        overlaps: &[f64],
        forces: &mut [f64],
        tolerance: f64,
    ) -> Result<usize, SolverError> {
        let loosely = true;
        self.solve_to(matrix, overlaps, forces, Goal { tolerance, loosely })
    }

    fn solve_to(
        &mut self,
        matrix: &ContactMatrix,
        overlaps: &[f64],
        forces: &mut [f64],
        goal: Goal,
    ) -> Result<usize, SolverError> {
        match self.begin(matrix, overlaps, forces, goal, Start::default())? {
            Progress::Done(iterations) => Ok(iterations),
            Progress::NeedsWhole(iterations) | Progress::NeedsValues(iterations) => {
                self.finish(matrix, overlaps, forces, goal.tolerance, iterations)
            }
        }
    }

    /// [`solve`](Self::solve) as far as single precision corrects the forces: each round from the residual that they really
    /// leave. What [needs values](Progress::NeedsValues) goes on here.
    pub(crate) fn begin(
        &mut self,
        matrix: &ContactMatrix,
        overlaps: &[f64],
        forces: &mut [f64],
        Goal { tolerance, loosely }: Goal,
        start: Start<'_>,
    ) -> Result<Progress, SolverError> {
        self.prepare(matrix);
        self.single.prepare(matrix.len());
        let Start {
            mut products,
            mut iterations,
        } = start;
        loop {
            let (before, mut rounding) = (self.largest, 0.0);
            self.largest = match products.take() {
                Some(First::Double(q)) => self.residual_of(matrix, (overlaps, forces, q), 1.0).0,
                Some(First::Single(q)) => {
                    let unit = matrix.unit_of_loads();
                    let (largest, load) = self.residual_of(matrix, (overlaps, forces, q), unit);
                    rounding = matrix.rounding_of_loads() * load;
                    if !largest.is_finite() {
                        return Ok(Progress::NeedsValues(iterations));
                    }
                    largest
                }
                None if !matrix.is_complete() => return Ok(Progress::NeedsValues(iterations)),
                None => self.true_residual(matrix, overlaps, forces),
            };
            if self.largest + rounding <= tolerance {
                self.largest += rounding;
                return Ok(Progress::Done(iterations));
            }
            if !self.largest.is_finite() {
                return Err(self.not_converged(tolerance, iterations));
            }
            if iterations > 0 && self.largest > 0.5 * before {
                return Ok(Progress::NeedsWhole(iterations));
            }
            let residual = (&self.residual[..], self.largest_weighted);
            let corrected = self.single.correct(matrix, residual, forces, tolerance);
            let Some((more, bound)) = corrected else {
                return Ok(Progress::NeedsWhole(iterations));
            };
            iterations += more;
            if loosely && bound + rounding <= tolerance {
                self.largest = bound + rounding;
                return Ok(Progress::Done(iterations));
            }
        }
    }

    /// Goes on in double precision, after so many `iterations`, to a residual that is computed anew from the solution.
    pub(crate) fn finish(
        &mut self,
        matrix: &ContactMatrix,
        overlaps: &[f64],
        forces: &mut [f64],
        tolerance: f64,
        mut iterations: usize,
    ) -> Result<usize, SolverError> {
        debug_assert!(matrix.is_whole(), "sums in the order of the contacts");
        self.prepare(matrix);
        let most = 100 + 10 * matrix.len();
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

    fn prepare(&mut self, matrix: &ContactMatrix) {
        let n = matrix.len();
        for v in [&mut self.residual, &mut self.direction] {
            v.resize(n, 0.0);
        }
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

    /// `residual = δ − A f`, and its largest magnitude (NaN if any entry is); inactive contacts have none.
    fn true_residual(&mut self, matrix: &ContactMatrix, overlaps: &[f64], forces: &[f64]) -> f64 {
        matrix.off_diagonal_products(forces, &mut self.image);
        let image = core::mem::take(&mut self.image);
        let largest = self.residual_of(matrix, (overlaps, forces, image.sums()), 1.0);
        self.image = image;
        largest.0
    }

    /// [`true_residual`](Self::true_residual) with the products of the off-diagonal entries given, in units of `unit`; and the largest
    /// `|A_cc f|`.
    fn residual_of<Q: Product>(
        &mut self,
        matrix: &ContactMatrix,
        columns: (&[f64], &[f64], &[Q]),
        unit: f64,
    ) -> (f64, f64) {
        let [largest, weighted, load] = wide(
            #[inline(always)]
            || subtract(&mut self.residual, matrix, columns, unit),
        );
        self.largest_weighted = weighted;
        (largest, load)
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
        let roots = matrix.inverse_root();
        let mut rz = 0.0;
        for (r, s) in self.residual.iter().zip(roots) {
            rz += r * r * (s * s);
        }
        self.direction.fill(0.0);
        let mut beta = 0.0;
        for iteration in 1..=most {
            for ((p, r), s) in self.direction.iter_mut().zip(&self.residual).zip(roots) {
                *p = r * (s * s) + beta * *p;
            }
            matrix.multiply_into(&self.direction, &mut self.image);
            let curvature = dot(&self.direction, self.image.sums());
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
                (&self.direction, self.image.sums()),
                roots,
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

/// A product of the off-diagonal entries in a row.
trait Product: Copy {
    /// As a length, in a row with this diagonal and inverse root.
    fn length(self, diagonal: f64, inverse_root: f64, unit: f64) -> f64;
}

impl Product for f64 {
    #[inline(always)]
    fn length(self, _: f64, _: f64, _: f64) -> f64 {
        self
    }
}

impl Product for f32 {
    #[inline(always)]
    fn length(self, diagonal: f64, inverse_root: f64, unit: f64) -> f64 {
        f64::from(self) * (unit * (diagonal * inverse_root))
    }
}

/// `r = δ − (A_cc f + q)` with `q` from the off-diagonal entries, 0 for inactive contacts; returns the largest `|r|`,
/// `|D^(−½) r|` and `|A_cc f|`, NaN if any is.
#[inline(always)]
fn subtract<Q: Product>(
    residual: &mut [f64],
    matrix: &ContactMatrix,
    (overlaps, forces, products): (&[f64], &[f64], &[Q]),
    unit: f64,
) -> [f64; 3] {
    let larger = |m: f64, x: f64| if x > m || x.is_nan() { x } else { m };
    let left = |d: f64, af: f64, q: Q, a: f64, s: f64| {
        let r = d - (af + q.length(a, s, unit));
        if s > 0.0 { r } else { 0.0 }
    };
    let (r8, r_rest) = residual.as_chunks_mut::<8>();
    let (d8, d_rest) = overlaps.as_chunks::<8>();
    let (f8, f_rest) = forces.as_chunks::<8>();
    let (q8, q_rest) = products.as_chunks::<8>();
    let (a8, a_rest) = matrix.diagonal().as_chunks::<8>();
    let (s8, s_rest) = matrix.inverse_root().as_chunks::<8>();
    let (mut largest, mut weighted, mut load) = ([0.0; 8], [0.0; 8], [0.0; 8]);
    let rows = r8.iter_mut().zip(d8).zip(f8.iter().zip(q8));
    for (((r, d), (f, q)), (a, s)) in rows.zip(a8.iter().zip(s8)) {
        for k in 0..8 {
            let af = a[k] * f[k];
            r[k] = left(d[k], af, q[k], a[k], s[k]);
            largest[k] = larger(largest[k], r[k].abs());
            weighted[k] = larger(weighted[k], (r[k] * s[k]).abs());
            load[k] = larger(load[k], af.abs());
        }
    }
    let mut most = [largest, weighted, load].map(
        #[inline(always)]
        |most| most.into_iter().fold(0.0, larger),
    );
    let rows = r_rest.iter_mut().zip(d_rest).zip(f_rest.iter().zip(q_rest));
    for (((r, d), (f, q)), (a, s)) in rows.zip(a_rest.iter().zip(s_rest)) {
        let af = a * f;
        *r = left(*d, af, *q, *a, *s);
        most[0] = larger(most[0], r.abs());
        most[1] = larger(most[1], (*r * s).abs());
        most[2] = larger(most[2], af.abs());
    }
    most
}

/// A move by `α` along the direction; returns `rᵀ D⁻¹ r` and `max |r|` after it. The sum has four chains.
#[inline(always)]
fn advance(
    forces: &mut [f64],
    residual: &mut [f64],
    (direction, image): (&[f64], &[f64]),
    roots: &[f64],
    alpha: f64,
) -> (f64, f64) {
    let (f4, f_rest) = forces.as_chunks_mut::<4>();
    let (r4, r_rest) = residual.as_chunks_mut::<4>();
    let (p4, p_rest) = direction.as_chunks::<4>();
    let (q4, q_rest) = image.as_chunks::<4>();
    let (w4, w_rest) = roots.as_chunks::<4>();
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
