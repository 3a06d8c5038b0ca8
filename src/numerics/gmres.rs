//! Generalised minimal residuals, preconditioned from the right.
//!
//! Y. Saad and M. H. Schultz, SIAM J. Sci. Stat. Comput. 7, 856 (1986): modified Gram–Schmidt, Givens rotations, no
//! restart. The residual that is minimised is the true one, `|b − J x|`.

use crate::numerics::wide::wide;

/// The part of the tolerance that the products may use up, and the least accuracy of a product.
const SHARE: f64 = 0.1;
const LOOSEST: f64 = 0.05;

/// What [`Gmres::solve`] came to.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Report {
    /// `|b − J x| / |b|`.
    pub(crate) residual: f64,
    /// Products with `J`.
    pub(crate) iterations: usize,
}

/// The basis and the small triangle, kept for their memory.
#[derive(Clone, Debug, Default)]
pub(crate) struct Gmres {
    basis: Vec<Vec<f64>>,
    /// The columns of `R`.
    triangle: Vec<Vec<f64>>,
    rotations: Vec<(f64, f64)>,
    rest: Vec<f64>,
}

impl Gmres {
    /// Solves `J x = b` to `|b − J x| ≤ tolerance |b|`, with at most `most` products; `product(v, w, accuracy)` sets
    /// `w = J P⁻¹ v`, right to `accuracy` at least, and says whether it could. The answer is `x = P⁻¹ y`; `y` is put into
    /// `y`.
    ///
    /// Products may become less exact as the residual falls (V. Simoncini and D. B. Szyld, SIAM J. Sci. Comput. 25, 454
    /// (2003)): `accuracy` is [`SHARE`] of the tolerance over the residual.
    ///
    /// `None` when a product failed or a number is not finite.
    pub(crate) fn solve(
        &mut self,
        b: &[f64],
        y: &mut [f64],
        tolerance: f64,
        most: usize,
        mut product: impl FnMut(&[f64], &mut [f64], f64) -> bool,
    ) -> Option<Report> {
        let n = b.len();
        y.fill(0.0);
        let beta = norm(b);
        if !(beta.is_finite() && beta > 0.0) {
            return None;
        }
        self.triangle.clear();
        self.rotations.clear();
        self.rest.clear();
        self.rest.push(beta);
        self.vector(0, n);
        for (v, b) in self.basis[0].iter_mut().zip(b) {
            *v = b / beta;
        }
        let mut report = Report {
            residual: 1.0,
            iterations: 0,
        };
        while report.iterations < most && report.residual > tolerance {
            let k = report.iterations;
            self.vector(k + 1, n);
            let (known, new) = self.basis.split_at_mut(k + 1);
            let w = &mut new[0];
            let accuracy = (SHARE * tolerance / report.residual).min(LOOSEST);
            if !product(&known[k], w, accuracy) {
                return None;
            }
            report.iterations += 1;
            let mut column = Vec::with_capacity(k + 2);
            for v in known.iter() {
                let h = dot(v, w);
                axpy(-h, v, w);
                column.push(h);
            }
            let length = norm(w);
            if !length.is_finite() {
                return None;
            }
            for (row, (cos, sin)) in self.rotations.iter().enumerate() {
                let (a, b) = (column[row], column[row + 1]);
                column[row] = cos * a + sin * b;
                column[row + 1] = cos * b - sin * a;
            }
            let diagonal = column[k];
            let radius = (diagonal * diagonal + length * length).sqrt();
            if radius == 0.0 {
                // The product is singular on this space: nothing more to be had.
                break;
            }
            let (cos, sin) = (diagonal / radius, length / radius);
            column[k] = radius;
            self.rotations.push((cos, sin));
            self.triangle.push(column);
            let last = self.rest[k];
            self.rest[k] = cos * last;
            self.rest.push(-sin * last);
            report.residual = (sin * last).abs() / beta;
            if length <= f64::MIN_POSITIVE {
                break;
            }
            for x in w.iter_mut() {
                *x /= length;
            }
        }
        let mut coefficients = self.rest[..self.triangle.len()].to_vec();
        for k in (0..self.triangle.len()).rev() {
            coefficients[k] /= self.triangle[k][k];
            for row in 0..k {
                coefficients[row] -= self.triangle[k][row] * coefficients[k];
            }
        }
        for (c, v) in coefficients.iter().zip(&self.basis) {
            axpy(*c, v, y);
        }
        y.iter().all(|x| x.is_finite()).then_some(report)
    }

    fn vector(&mut self, k: usize, n: usize) {
        if self.basis.len() <= k {
            self.basis.push(Vec::new());
        }
        self.basis[k].resize(n, 0.0);
    }
}

/// The sum of products in one fixed order, eight chains wide.
pub(crate) fn dot(a: &[f64], b: &[f64]) -> f64 {
    let (a8, a_rest) = a.as_chunks::<8>();
    let (b8, b_rest) = b.as_chunks::<8>();
    let mut sums = [0.0; 8];
    wide(
        #[inline(always)]
        || {
            for (x, y) in a8.iter().zip(b8) {
                for k in 0..8 {
                    sums[k] += x[k] * y[k];
                }
            }
        },
    );
    let rest: f64 = a_rest.iter().zip(b_rest).map(|(x, y)| x * y).sum();
    let pairs = [
        sums[0] + sums[4],
        sums[1] + sums[5],
        sums[2] + sums[6],
        sums[3] + sums[7],
    ];
    (pairs[0] + pairs[2]) + (pairs[1] + pairs[3]) + rest
}

pub(crate) fn norm(a: &[f64]) -> f64 {
    dot(a, a).sqrt()
}

fn axpy(k: f64, x: &[f64], y: &mut [f64]) {
    wide(
        #[inline(always)]
        || {
            for (y, x) in y.iter_mut().zip(x) {
                *y += k * x;
            }
        },
    );
}
