//! Conjugate gradients in single precision, for corrections.
//!
//! The forces of a step differ from those of the step before by a small correction, and of it a few digits are asked for: it
//! solves `A Δf = r` with `r = δ − A f` in double precision. Numbers of half the size are half the memory traffic, which is
//! what an iteration costs, and twice as many are computed at a time. A correction that has to be deeper than
//! [`DEEPEST`] is made in several rounds, each from the residual that the forces really leave (iterative refinement:
//! J. H. Wilkinson, *Rounding Errors in Algebraic Processes*, 1963).
//!
//! What is solved is `Â u = D^(−½) r / s` with `Â = D^(−½) A D^(−½)`, `D = diag A`, `Δf = s D^(−½) u`, and `s` the largest
//! entry of `D^(−½) r`: no units, no number far from 1. It is the same as preconditioning with the diagonal.
//!
//! Sums have 16 chains within stretches of [`STRETCH`] contacts, and the stretches are added in double precision: one order,
//! the same bits on every processor.

use crate::contact::matrix::ContactMatrix;
use crate::wide::wide;

/// How far one round lowers the residual at most.
const DEEPEST: f64 = 1e-4;

/// Iterations that are tried in a round; a dozen are enough.
const ITERATIONS: usize = 60;

/// An estimate of the rounding of a residual, in units of the largest entry of `u`: sixteen units in the last place of single
/// precision, about one for each entry of a row. Where it matters the residual is computed anew in double precision.
const ROUNDING: f64 = 16.0 * (f32::EPSILON as f64);

const STRETCH: usize = 1024;
const CHAINS: usize = 16;

/// The matrix and the vectors.
#[derive(Clone, Debug, Default)]
pub(super) struct Single {
    value: Vec<f32>,
    residual: Vec<f32>,
    direction: Vec<f32>,
    image: Vec<f32>,
    correction: Vec<f32>,
}

impl Single {
    /// Takes over the matrix.
    pub(super) fn take(&mut self, matrix: &ContactMatrix) {
        wide(
            #[inline(always)]
            || matrix.scale_off_diagonal(&mut self.value),
        );
        for v in [
            &mut self.residual,
            &mut self.direction,
            &mut self.image,
            &mut self.correction,
        ] {
            v.resize(matrix.len(), 0.0);
        }
    }

    /// Corrects `forces`, which leave `residual` (length), so that it falls to `goal`, or as far as a round goes. Returns
    /// the iterations and an estimate of the residual then; `None`, and nothing done, where single precision is not enough.
    pub(super) fn correct(
        &mut self,
        matrix: &ContactMatrix,
        residual: &[f64],
        forces: &mut [f64],
        goal: f64,
    ) -> Option<(usize, f64)> {
        wide(
            #[inline(always)]
            || self.correct_here(matrix, residual, forces, goal),
        )
    }

    #[inline(always)]
    fn correct_here(
        &mut self,
        matrix: &ContactMatrix,
        residual: &[f64],
        forces: &mut [f64],
        goal: f64,
    ) -> Option<(usize, f64)> {
        let scaling = matrix.scaling();
        let scale = largest_product(residual, scaling);
        let inverse = 1.0 / scale;
        if !(scale.is_finite() && inverse.is_finite()) {
            return None;
        }
        for ((own, r), s) in self.residual.iter_mut().zip(residual).zip(scaling) {
            *own = (r * s * inverse) as f32;
        }
        // |r_c| is at most this many times what is left of entry c.
        let length = scale * matrix.largest_root();
        let target = (0.5 * goal / length).max(DEEPEST) as f32;
        self.direction.fill(0.0);
        self.correction.fill(0.0);
        let (mut rr, mut beta) = (dot(&self.residual, &self.residual), 0.0);
        for iteration in 1..=ITERATIONS {
            let rows = self.direction.iter_mut().zip(&mut self.image);
            for ((p, q), r) in rows.zip(&self.residual) {
                *p = r + beta * *p;
                *q = *p;
            }
            matrix.add_product(&self.value, &self.direction, &mut self.image);
            let curvature = dot(&self.direction, &self.image);
            if curvature.is_nan() || curvature <= 0.0 {
                return None;
            }
            let alpha = (rr / curvature) as f32;
            let largest = advance(
                &mut self.correction,
                &mut self.residual,
                (&self.direction, &self.image),
                alpha,
            );
            let next = dot(&self.residual, &self.residual);
            if largest <= target && next.is_finite() {
                let largest_correction = largest_magnitude(&self.correction);
                for ((f, u), s) in forces.iter_mut().zip(&self.correction).zip(scaling) {
                    *f += f64::from(*u) * (scale * s);
                }
                let rounding = ROUNDING * f64::from(largest_correction);
                return Some((iteration, (f64::from(largest) + rounding) * length));
            }
            beta = (next / rr) as f32;
            rr = next;
        }
        None
    }
}

/// A move by `α` along the direction; returns the largest magnitude of the residual behind it.
#[inline(always)]
fn advance(
    correction: &mut [f32],
    residual: &mut [f32],
    (direction, image): (&[f32], &[f32]),
    alpha: f32,
) -> f32 {
    let rows = correction.iter_mut().zip(&mut *residual);
    for ((u, r), (p, q)) in rows.zip(direction.iter().zip(image)) {
        *u += alpha * p;
        *r -= alpha * q;
    }
    largest_magnitude(residual)
}

/// The largest `|x|`, NaN if there is one.
#[inline(always)]
fn largest_magnitude(v: &[f32]) -> f32 {
    let larger = |m: f32, x: f32| if x > m || x.is_nan() { x } else { m };
    let (chunks, rest) = v.as_chunks::<CHAINS>();
    let mut most = [0.0; CHAINS];
    for x in chunks {
        for k in 0..CHAINS {
            most[k] = larger(most[k], x[k].abs());
        }
    }
    let most = most.into_iter().fold(0.0, larger);
    rest.iter().map(|x| x.abs()).fold(most, larger)
}

/// The largest `|a b|`, NaN if there is one.
#[inline(always)]
fn largest_product(a: &[f64], b: &[f64]) -> f64 {
    let larger = |m: f64, x: f64| if x > m || x.is_nan() { x } else { m };
    let (a8, a_rest) = a.as_chunks::<8>();
    let (b8, b_rest) = b.as_chunks::<8>();
    let mut most = [0.0; 8];
    for (a, b) in a8.iter().zip(b8) {
        for k in 0..8 {
            most[k] = larger(most[k], (a[k] * b[k]).abs());
        }
    }
    let most = most.into_iter().fold(0.0, larger);
    let rest = a_rest.iter().zip(b_rest).map(|(a, b)| (a * b).abs());
    rest.fold(most, larger)
}

#[inline(always)]
fn dot(a: &[f32], b: &[f32]) -> f64 {
    let mut total = 0.0;
    for (a, b) in a.chunks(STRETCH).zip(b.chunks(STRETCH)) {
        let (a_chunks, a_rest) = a.as_chunks::<CHAINS>();
        let (b_chunks, b_rest) = b.as_chunks::<CHAINS>();
        let mut sums = [0.0_f32; CHAINS];
        for (x, y) in a_chunks.iter().zip(b_chunks) {
            for k in 0..CHAINS {
                sums[k] += x[k] * y[k];
            }
        }
        let mut half = CHAINS / 2;
        while half > 0 {
            for k in 0..half {
                sums[k] += sums[k + half];
            }
            half /= 2;
        }
        let rest: f32 = a_rest.iter().zip(b_rest).map(|(x, y)| x * y).sum();
        total += f64::from(sums[0] + rest);
    }
    total
}

#[cfg(test)]
mod tests {
    use crate::contact::list::ContactList;
    use crate::contact::matrix::{ContactMatrix, Geometry};
    use crate::contact::solver::ConjugateGradient;
    use crate::domain::{Domain, Vec2};
    use crate::packing::Packing;
    use crate::relax::Relaxation;
    use crate::scene::Scene;

    /// `max |A f − δ|`.
    fn residual(matrix: &ContactMatrix, overlaps: &[f64], forces: &[f64]) -> f64 {
        let mut image = vec![0.0; forces.len()];
        matrix.multiply(forces, &mut image);
        let differences = image.iter().zip(overlaps).map(|(q, d)| (q - d).abs());
        differences.fold(0.0, f64::max)
    }

    #[test]
    fn what_is_left_is_below_the_tolerance_and_below_the_bound() {
        // Line tensions far outside of what single precision could hold.
        for (phi, line_tension) in [(0.86, 1.0), (1.0, 1e-90), (1.2, 1e90)] {
            let scene = Scene {
                particles: 256,
                phi,
                line_tension,
                ..Scene::default()
            };
            let run = Relaxation::new(&scene).unwrap();
            let (matrix, overlaps) = (run.law().matrix(), run.contacts().overlaps);
            let scale = overlaps.iter().fold(0.0, |m: f64, d| m.max(d.abs()));
            for tolerance in [1e-1, 1e-3, 1e-5, 1e-7, 1e-9, 1e-11, 1e-13] {
                let far_above_round_off = tolerance > 1e-10;
                let tolerance = tolerance * scale;
                let mut solver = ConjugateGradient::default();
                let mut forces = vec![0.0; overlaps.len()];
                solver
                    .solve(matrix, overlaps, &mut forces, tolerance)
                    .unwrap();
                assert!(residual(matrix, overlaps, &forces) <= tolerance);
                if far_above_round_off {
                    forces.fill(0.0);
                    solver
                        .solve_loosely(matrix, overlaps, &mut forces, tolerance)
                        .unwrap();
                    let (left, bound) = (
                        residual(matrix, overlaps, &forces),
                        solver.largest_residual(),
                    );
                    assert!(left <= bound && bound <= tolerance, "{left:e}, {bound:e}");
                }
            }
        }
    }

    #[test]
    fn neighbours_in_nearly_one_direction_are_solved_to_the_tolerance() {
        // Two neighbours ever closer to one direction: beyond 1e-7 their rows are the same in single precision.
        for angle in [1e-3, 1e-5, 1e-7, 1e-9, 1e-11] {
            let at = |r: f64, t: f64| {
                let (sin, cos) = libm::sincos(t);
                Vec2::new(4.0 + r * cos, 4.0 + r * sin)
            };
            let positions = vec![at(0.0, 0.0), at(0.9, 0.3), at(0.9, 0.3 + angle)];
            let packing =
                Packing::new(Domain::new(8.0, 8.0).unwrap(), vec![0.5; 3], positions).unwrap();
            let list = ContactList::new(3, &[[0, 1], [0, 2]]).unwrap();
            let geometry = Geometry::of(&packing, &list);
            let matrix = ContactMatrix::of(&packing, &list, &geometry, 1.0);
            let overlaps = [0.1, 0.1 + 0.1 * angle];
            let mut forces = vec![0.0; 2];
            let mut solver = ConjugateGradient::default();
            solver
                .solve_loosely(&matrix, &overlaps, &mut forces, 1e-9)
                .unwrap();
            let left = residual(&matrix, &overlaps, &forces);
            assert!(left <= 1e-9, "{left:e} at {angle:e}");
        }
    }
}
