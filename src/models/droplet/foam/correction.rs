//! Newton's correction of the forces, by conjugate gradients in single precision.
//!
//! `B_SS Δ = −gap_S` is scaled by its diagonal, `B̂ = D^(−½) B D^(−½)`, and its right-hand side by the largest of its entries: no units, and no number
//! far from 1. Each droplet has a block of `B̂` between its sides,
//!
//! ```text
//! B̂_kl = D_k^(−½) [ r (Â_kl − 1/2π) + u_k u_l/𝓛_rr ] D_l^(−½)   for k ≠ l,      B̂_kk = 0
//! ```
//!
//! and what is on the diagonal is 1 for each line. A few digits are asked for; what is left is found by the next step of Newton's method, whose
//! residual is in double precision.
//!
//! - Lines beside the set `S`, those that bear a force or overlap, have a `D^(−½)` of 0, and so stay as they are.
//! - Sums are those of [`CHAINS`] chains in the order of the lines, which follows from the pairs alone.

use super::compliance::Compliance;
use super::coupling::Coupling;
use super::lines::Lines;
use super::sides::{LANES, Lanes, Sides, combine, with_width};
use super::state::State;
use crate::numerics::wide::wide;
use core::f64::consts::PI;

const CHAINS: usize = 16;

/// Iterations that a correction may take.
const ITERATIONS: usize = 1000;

/// See the [module](self).
#[derive(Clone, Debug, Default)]
pub(super) struct Correction {
    compliance: Compliance,
    coupling: Coupling,
    /// `D^(−½)` by lines, and by sides.
    roots: Vec<f64>,
    roots_of_sides: Vec<Lanes<f32>>,
    blocks: Vec<Lanes<f32>>,
    solution: Vec<f32>,
    residual: Vec<f32>,
    direction: Vec<f32>,
    image: Vec<f32>,
    images_of_sides: Vec<Lanes<f32>>,
    step: Vec<f64>,
}

impl Correction {
    /// `Δ` (units of γ).
    pub fn step(&self) -> &[f64] {
        &self.step
    }

    /// Finds the correction at a state, to `relative` of the right-hand side.
    pub fn find(&mut self, lines: &Lines, state: &State, relative: f64) {
        self.compliance.find(lines, state);
        let count = lines.len();
        for column in [
            &mut self.solution,
            &mut self.residual,
            &mut self.direction,
            &mut self.image,
        ] {
            column.clear();
            column.resize(count, 0.0);
        }
        self.roots.resize(count, 0.0);
        self.step.resize(count, 0.0);
        let layout = lines.layout();
        self.blocks.resize(layout.rows(), [0.0; LANES]);
        self.images_of_sides.resize(layout.groups(), [0.0; LANES]);
        wide(
            #[inline(always)]
            || {
                scale(state, self.compliance.diagonal(), &mut self.roots);
                let roots = self.roots.iter().map(|root| [*root as f32; 2]);
                layout.scatter(&mut self.roots_of_sides, roots);
                let weights = self.compliance.weights();
                fill_blocks(
                    (lines, state),
                    (&self.roots_of_sides, weights),
                    &mut self.blocks,
                );
                self.coupling
                    .find(lines, state, weights.as_flattened(), &self.roots);
                let largest = largest(&self.roots, state.gaps());
                if largest > 0.0 && largest.is_finite() {
                    let rest = self.residual.iter_mut().zip(&self.roots);
                    for ((rest, root), gap) in rest.zip(state.gaps()) {
                        *rest = (-gap * root / largest) as f32;
                    }
                    self.iterate(lines, relative as f32);
                }
                let steps = self.step.iter_mut().zip(&self.solution);
                for ((step, x), root) in steps.zip(&self.roots) {
                    *step = f64::from(*x) * (largest * root);
                }
            },
        );
    }

    /// Conjugate gradients from 0 until the residual is `relative` of what it was.
    #[inline(always)]
    fn iterate(&mut self, lines: &Lines, relative: f32) {
        let layout = lines.layout();
        let (solution, residual) = (&mut self.solution[..], &mut self.residual[..]);
        let (direction, image) = (&mut self.direction[..], &mut self.image[..]);
        direction.copy_from_slice(residual);
        let mut size = dot(residual, residual);
        let enough = relative * relative * size;
        for _ in 0..ITERATIONS {
            if size <= enough {
                return;
            }
            multiply_blocks(layout, &self.blocks, direction, &mut self.images_of_sides);
            gather(layout, &self.images_of_sides, direction, image);
            self.coupling.add(lines.pairs(), direction, image);
            let curvature = dot(direction, image);
            if curvature.is_nan() || curvature <= 0.0 {
                return;
            }
            let length = size / curvature;
            advance(solution, direction, length);
            advance(residual, image, -length);
            let next = dot(residual, residual);
            turn(direction, residual, next / size);
            size = next;
        }
    }
}

/// The blocks of `B̂`.
#[inline(always)]
fn fill_blocks(
    (lines, state): (&Lines, &State),
    (roots, weights): (&[Lanes<f32>], &[Lanes]),
    blocks: &mut [Lanes<f32>],
) {
    let (kernel, places) = (lines.kernel(), lines.layout().places());
    for place in places {
        let (groups, p) = (place.groups(), place.droplet());
        let (kernel, blocks) = (&kernel[place.rows()], &mut blocks[place.rows()]);
        let (roots, weights) = (&roots[groups.clone()], &weights[groups]);
        let r = state.corners()[p] as f32;
        let softness = (1.0 / state.droplets()[p].stiffness) as f32;
        with_width(
            place.width(),
            #[inline(always)]
            |width| {
                let rows = blocks
                    .chunks_exact_mut(width)
                    .zip(kernel.chunks_exact(width));
                for (k, (blocks, kernel)) in rows.enumerate() {
                    let (root, u) = (roots.as_flattened()[k], weights.as_flattened()[k]);
                    let factors = [r * root, softness * root * u as f32];
                    for g in 0..width {
                        blocks[g] = row(&kernel[g], factors, &weights[g], &roots[g]);
                    }
                    blocks.as_flattened_mut()[k] = 0.0;
                }
            },
        );
    }
}

/// Entries of `B̂` between a side and a group, but for the diagonal.
#[inline(always)]
fn row(
    kernel: &Lanes,
    [by_kernel, by_area]: [f32; 2],
    weights: &Lanes,
    roots: &Lanes<f32>,
) -> Lanes<f32> {
    const ROUND: f32 = (0.5 / PI) as f32;
    let mut entries = [0.0; LANES];
    for l in 0..LANES {
        let entry = by_kernel * (kernel[l] as f32 - ROUND) + by_area * weights[l] as f32;
        entries[l] = entry * roots[l];
    }
    entries
}

/// What the blocks make of a direction.
#[inline(always)]
fn multiply_blocks(
    layout: &Sides,
    blocks: &[Lanes<f32>],
    direction: &[f32],
    images: &mut [Lanes<f32>],
) {
    for place in layout.places() {
        let (blocks, images) = (&blocks[place.rows()], &mut images[place.groups()]);
        let sides = layout.of(*place);
        with_width(
            place.width(),
            #[inline(always)]
            |width| {
                for (g, image) in images.iter_mut().enumerate().take(width) {
                    let each = sides.iter().map(|side| direction[side.line as usize]);
                    *image = combine(blocks, (g, width), each);
                }
            },
        );
    }
}

/// `image = B̂ direction`, from what the blocks make of it.
#[inline(always)]
fn gather(layout: &Sides, images: &[Lanes<f32>], direction: &[f32], image: &mut [f32]) {
    let images = images.as_flattened();
    let lines = direction.iter().zip(layout.of_lines());
    for (image, (own, [a, b])) in image.iter_mut().zip(lines) {
        *image = own + images[*a as usize] + images[*b as usize];
    }
}

/// `D^(−½)`, 0 beside the set.
#[inline(always)]
fn scale(state: &State, diagonal: &[f64], roots: &mut [f64]) {
    let lines = state.gaps().iter().zip(state.loads()).zip(diagonal);
    for (root, ((gap, load), d)) in roots.iter_mut().zip(lines) {
        let within = *load > 0.0 || *gap < 0.0;
        let own = 1.0 / d.sqrt();
        *root = if within { own } else { 0.0 };
    }
}

/// The largest `|D^(−½) gap|`, or one that is no number.
#[inline(always)]
fn largest(roots: &[f64], gaps: &[f64]) -> f64 {
    let (mut most, mut sums) = ([0.0; CHAINS], [0.0; CHAINS]);
    let (roots, more_roots) = roots.as_chunks::<CHAINS>();
    let (gaps, more_gaps) = gaps.as_chunks::<CHAINS>();
    let mut look = |k: usize, root: f64, gap: f64| {
        let x = (root * gap).abs();
        most[k] = if x > most[k] { x } else { most[k] };
        sums[k] += x;
    };
    for (root, gap) in roots.iter().zip(gaps) {
        for k in 0..CHAINS {
            look(k, root[k], gap[k]);
        }
    }
    for (k, (root, gap)) in more_roots.iter().zip(more_gaps).enumerate() {
        look(k, *root, *gap);
    }
    let sum: f64 = sums.iter().sum();
    let most = most.into_iter().fold(0.0, f64::max);
    if sum.is_nan() { sum } else { most }
}

#[inline(always)]
fn dot(a: &[f32], b: &[f32]) -> f32 {
    let (a, more_a) = a.as_chunks::<CHAINS>();
    let (b, more_b) = b.as_chunks::<CHAINS>();
    let mut sums = [0.0; CHAINS];
    for (a, b) in a.iter().zip(b) {
        for k in 0..CHAINS {
            sums[k] += a[k] * b[k];
        }
    }
    for (k, (a, b)) in more_a.iter().zip(more_b).enumerate() {
        sums[k] += a * b;
    }
    sums.iter().sum()
}

#[inline(always)]
fn advance(x: &mut [f32], by: &[f32], length: f32) {
    for (x, by) in x.iter_mut().zip(by) {
        *x += length * by;
    }
}

/// `p ← r + β p`.
#[inline(always)]
fn turn(direction: &mut [f32], residual: &[f32], beta: f32) {
    for (p, r) in direction.iter_mut().zip(residual) {
        *p = r + beta * *p;
    }
}
