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
//! **Sums without an order.** The contacts have other numbers in a run that goes on than in one that is taken up at a frame, and
//! some of them are inactive. Inner products are therefore summed as integers: the products are rounded to a multiple of
//! [`STEPS`]⁻¹ of the largest that there could be, and sums of integers are exact. The bits do not depend on numbers, on inactive
//! contacts or on wide vectors. (The idea is that of J. Demmel and H. D. Nguyen, IEEE Trans. Comput. 64, 2060 (2015).)

use crate::models::droplet::contact::matrix::ContactMatrix;
use crate::models::droplet::contact::matrix::product::Products;
use crate::numerics::threads::{are_two_for, both};
use crate::numerics::wide::wide;

/// How far one round lowers the residual at most.
const DEEPEST: f64 = 1e-4;

/// Iterations that are tried in a round; a dozen are enough.
const ITERATIONS: usize = 60;

/// An estimate of the rounding of a residual, in units of the largest entry of `u`: sixteen units in the last place of single
/// precision, about one for each entry of a row. Where it matters the residual is computed anew in double precision.
const ROUNDING: f64 = 16.0 * (f32::EPSILON as f64);

/// Products of an inner product are rounded to this part of a power of two above the largest one there could be. Three times as
/// much, added to a number of magnitude up to it, leaves the number in the last bits, rounded to an integer.
const STEPS: f32 = 4_194_304.0;

/// The bits of 0 after that.
const NONE: u32 = (3.0 * STEPS).to_bits();

/// A bound of the sums of magnitudes in the rows of `Â`: no entry is above 1, few are above a quarter.
const ROW: f32 = 64.0;

/// Numbers that are summed before the sums are widened: 256 of up to [`STEPS`] in each of the chains.
const BATCH: usize = 256 * CHAINS;
const CHAINS: usize = 16;

/// The vectors.
#[derive(Clone, Debug, Default)]
pub(super) struct Single {
    residual: Vec<f32>,
    direction: Vec<f32>,
    image: Products<f32>,
    correction: Vec<f32>,
}

impl Single {
    /// Room for the contacts of a matrix.
    pub(super) fn prepare(&mut self, contacts: usize) {
        for v in [
            &mut self.residual,
            &mut self.direction,
            &mut self.correction,
        ] {
            v.resize(contacts, 0.0);
        }
    }

    /// Corrects `forces`, which leave the `residual` (length; with its largest `|D^(−½) r|`), so that it falls to `goal`, or as far
    /// as a round goes. Returns the iterations and an estimate of the residual then; `None`, and nothing done, where single
    /// precision is not enough.
    pub(super) fn correct(
        &mut self,
        matrix: &ContactMatrix,
        (residual, scale): (&[f64], f64),
        forces: &mut [f64],
        goal: f64,
    ) -> Option<(usize, f64)> {
        let roots = matrix.inverse_root();
        let inverse = 1.0 / scale;
        if !(scale.is_finite() && inverse.is_finite()) {
            return None;
        }
        // |r_c| is at most this many times what is left of entry c.
        let length = scale * matrix.largest_root();
        let target = (0.5 * goal / length).max(DEEPEST) as f32;
        self.direction.fill(0.0);
        self.correction.fill(0.0);
        // Bounds of the entries of residual, direction and image.
        let (mut most_r, mut most_p) = (1.0, 0.0);
        let ones = Rounding::below(most_r, most_r)?;
        let squares = wide(
            #[inline(always)]
            || {
                for ((own, r), s) in self.residual.iter_mut().zip(residual).zip(roots) {
                    *own = (r * s * inverse) as f32;
                }
                let squares = self.residual.iter().map(|r| ones.integer(*r, *r));
                squares.map(i64::from).sum()
            },
        );
        let (mut rr, mut beta) = (ones.value(squares), 0.0);
        for iteration in 1..=ITERATIONS {
            turn(&mut self.direction, &self.residual, beta);
            most_p = most_r + beta.abs() * most_p;
            matrix.products_into(matrix.entries_f32(), &self.direction, &mut self.image);
            let image = self.image.sums_mut();
            let (curvature, most_q) = collect(image, &self.direction, most_p)?;
            if curvature <= 0.0 {
                return None;
            }
            let alpha = (rr / curvature) as f32;
            let (next, largest) = advance(
                &mut self.correction,
                &mut self.residual,
                (&self.direction, self.image.sums()),
                alpha,
                most_r + alpha.abs() * most_q,
            )?;
            if largest <= target {
                let largest_correction = largest_magnitude(&self.correction);
                if !largest_correction.is_finite() {
                    return None;
                }
                wide(
                    #[inline(always)]
                    || {
                        for ((f, u), s) in forces.iter_mut().zip(&self.correction).zip(roots) {
                            *f += f64::from(*u) * (scale * s);
                        }
                    },
                );
                let rounding = ROUNDING * f64::from(largest_correction);
                return Some((iteration, (f64::from(largest) + rounding) * length));
            }
            beta = (next / rr) as f32;
            (rr, most_r) = (next, largest);
        }
        None
    }
}

/// Where a column of so many numbers is cut for two threads; at its end if it is too short for both.
fn half(length: usize) -> usize {
    if are_two_for(length) {
        (length / 2).next_multiple_of(BATCH).min(length)
    } else {
        length
    }
}

/// The next direction, `p = r + β p`.
fn turn(direction: &mut [f32], residual: &[f32], beta: f32) {
    let part = |direction: &mut [f32], residual: &[f32]| {
        wide(
            #[inline(always)]
            || {
                for (p, r) in direction.iter_mut().zip(residual) {
                    *p = r + beta * *p;
                }
            },
        );
    };
    let half = half(direction.len());
    let (p, more_p) = direction.split_at_mut(half);
    let (r, more_r) = residual.split_at(half);
    let two = !more_p.is_empty();
    both(two, || part(p, r), || part(more_p, more_r));
}

/// The image `q = p + (Â − 1) p`, of which `image` has the second part; returns `pᵀ q` and the largest `|q|`. `most` bounds
/// `|p|`. `None` if a number is none, or out of hand.
fn collect(image: &mut [f32], direction: &[f32], most: f32) -> Option<(f64, f32)> {
    let rounding = Rounding::below(most, ROW * most)?;
    let [mut one, mut other] = [Sum::default(); 2];
    let part = |q: &mut [f32], p: &[f32], sum: &mut Sum| {
        wide(
            #[inline(always)]
            || collect_here(q, p, rounding, sum),
        );
    };
    let half = half(image.len());
    let (q, more_q) = image.split_at_mut(half);
    let (p, more_p) = direction.split_at(half);
    let two = !more_q.is_empty();
    both(
        two,
        || part(q, p, &mut one),
        || part(more_q, more_p, &mut other),
    );
    let (total, largest) = one.with(other);
    (largest <= ROW * most).then(|| (rounding.value(total), largest))
}

#[inline(always)]
fn collect_here(image: &mut [f32], direction: &[f32], rounding: Rounding, sum: &mut Sum) {
    let mut largest = [0; CHAINS];
    for (q, p) in image.chunks_mut(BATCH).zip(direction.chunks(BATCH)) {
        let (q16, q_rest) = q.as_chunks_mut::<CHAINS>();
        let (p16, p_rest) = p.as_chunks::<CHAINS>();
        let mut sums = [0; CHAINS];
        for (q, p) in q16.iter_mut().zip(p16) {
            for k in 0..CHAINS {
                q[k] += p[k];
                sums[k] = rounding.add(sums[k], p[k], q[k]);
                largest[k] = largest[k].max(magnitude(q[k]));
            }
        }
        sum.total += sum_of(sums, q16.len());
        for (q, p) in q_rest.iter_mut().zip(p_rest) {
            *q += p;
            sum.total += i64::from(rounding.integer(*p, *q));
            largest[0] = largest[0].max(magnitude(*q));
        }
    }
    sum.largest = largest.into_iter().fold(0, u32::max);
}

/// A move by `α` along the direction; returns `rᵀ r` and the largest `|r|` after it. `most` bounds `|r|`. `None` if a number is
/// none, or out of hand.
fn advance(
    correction: &mut [f32],
    residual: &mut [f32],
    (direction, image): (&[f32], &[f32]),
    alpha: f32,
    most: f32,
) -> Option<(f64, f32)> {
    // A little more, for the rounding of the residual.
    let rounding = Rounding::below(1.01 * most, 1.01 * most)?;
    let [mut one, mut other] = [Sum::default(); 2];
    let part = |u: &mut [f32], r: &mut [f32], by: (&[f32], &[f32]), sum: &mut Sum| {
        wide(
            #[inline(always)]
            || advance_here((u, r), by, (alpha, rounding), sum),
        );
    };
    let half = half(residual.len());
    let (u, more_u) = correction.split_at_mut(half);
    let (r, more_r) = residual.split_at_mut(half);
    let (p, more_p) = direction.split_at(half);
    let (q, more_q) = image.split_at(half);
    let two = !more_u.is_empty();
    both(
        two,
        || part(u, r, (p, q), &mut one),
        || part(more_u, more_r, (more_p, more_q), &mut other),
    );
    let (total, largest) = one.with(other);
    (largest <= 1.01 * most).then(|| (rounding.value(total), largest))
}

#[inline(always)]
fn advance_here(
    (correction, residual): (&mut [f32], &mut [f32]),
    (direction, image): (&[f32], &[f32]),
    (alpha, rounding): (f32, Rounding),
    sum: &mut Sum,
) {
    let mut largest = [0; CHAINS];
    let moved = correction.chunks_mut(BATCH);
    let moved = moved.zip(residual.chunks_mut(BATCH));
    let by = direction.chunks(BATCH).zip(image.chunks(BATCH));
    for ((u, r), (p, q)) in moved.zip(by) {
        let (u16, u_rest) = u.as_chunks_mut::<CHAINS>();
        let (r16, r_rest) = r.as_chunks_mut::<CHAINS>();
        let (p16, p_rest) = p.as_chunks::<CHAINS>();
        let (q16, q_rest) = q.as_chunks::<CHAINS>();
        let mut sums = [0; CHAINS];
        for ((u, r), (p, q)) in u16.iter_mut().zip(&mut *r16).zip(p16.iter().zip(q16)) {
            for k in 0..CHAINS {
                u[k] += alpha * p[k];
                r[k] -= alpha * q[k];
                sums[k] = rounding.add(sums[k], r[k], r[k]);
                largest[k] = largest[k].max(magnitude(r[k]));
            }
        }
        sum.total += sum_of(sums, r16.len());
        let rest = u_rest.iter_mut().zip(r_rest).zip(p_rest.iter().zip(q_rest));
        for ((u, r), (p, q)) in rest {
            *u += alpha * p;
            *r -= alpha * q;
            sum.total += i64::from(rounding.integer(*r, *r));
            largest[0] = largest[0].max(magnitude(*r));
        }
    }
    sum.largest = largest.into_iter().fold(0, u32::max);
}

/// What one thread has summed, and the bits of the largest magnitude that it met.
#[derive(Clone, Copy, Default)]
struct Sum {
    total: i64,
    largest: u32,
}

impl Sum {
    fn with(self, other: Self) -> (i64, f32) {
        let largest = self.largest.max(other.largest);
        (self.total + other.total, f32::from_bits(largest))
    }
}

/// The bits of `|x|`: they order as the magnitudes do, and NaN comes above all.
#[inline(always)]
fn magnitude(x: f32) -> u32 {
    x.to_bits() & 0x7fff_ffff
}

/// The largest `|x|`, NaN if there is one.
#[inline(always)]
fn largest_magnitude(v: &[f32]) -> f32 {
    let (chunks, rest) = v.as_chunks::<CHAINS>();
    let mut most = [0; CHAINS];
    for x in chunks {
        for k in 0..CHAINS {
            most[k] = most[k].max(magnitude(x[k]));
        }
    }
    let rest = rest.iter().map(|x| magnitude(*x));
    f32::from_bits(most.into_iter().chain(rest).fold(0, u32::max))
}

/// Products as integers: multiples of [`STEPS`]⁻¹ of a power of two above all of them.
#[derive(Clone, Copy)]
struct Rounding {
    scale: f32,
}

impl Rounding {
    /// For products of numbers with magnitudes up to `a` and up to `b`; `None` if one is no number or too far from 1.
    #[inline(always)]
    fn below(a: f32, b: f32) -> Option<Self> {
        let most = a * b;
        // The next exponent, and no fraction.
        let above = || f32::from_bits((most.to_bits() & 0x7f80_0000) + 0x0080_0000);
        let within = (1e-25..1e25).contains(&most);
        within.then(|| Self {
            scale: STEPS / above(),
        })
    }

    /// The product, with [`NONE`] added to its bits. Nothing but the product is rounded before it is made an integer.
    #[inline(always)]
    fn bits(self, x: f32, y: f32) -> u32 {
        ((x * y) * self.scale + 3.0 * STEPS).to_bits()
    }

    #[inline(always)]
    fn integer(self, x: f32, y: f32) -> i32 {
        self.bits(x, y).wrapping_sub(NONE).cast_signed()
    }

    /// One more product in a chain.
    #[inline(always)]
    fn add(self, chain: u32, x: f32, y: f32) -> u32 {
        chain.wrapping_add(self.bits(x, y))
    }

    #[inline(always)]
    fn value(self, total: i64) -> f64 {
        total as f64 / f64::from(self.scale)
    }
}

/// The sum of chains of `length` products each.
#[inline(always)]
fn sum_of(chains: [u32; CHAINS], length: usize) -> i64 {
    let added = NONE.wrapping_mul(length as u32);
    let chain = |sum: u32| i64::from(sum.wrapping_sub(added).cast_signed());
    chains.into_iter().map(chain).sum()
}

#[cfg(test)]
mod tests {
    use crate::domain::{Domain, Vec2};
    use crate::models::droplet::contact::list::ContactList;
    use crate::models::droplet::contact::matrix::{ContactMatrix, Geometry};
    use crate::models::droplet::contact::solver::ConjugateGradient;
    use crate::protocol::Relaxation;
    use crate::scene::Scene;
    use crate::state::Packing;

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
            let (matrix, overlaps) = (run.law().unwrap().matrix(), run.contacts().overlaps);
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
