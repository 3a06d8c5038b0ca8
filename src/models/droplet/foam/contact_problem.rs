//! The contact problem at given lines and tilts: forces `f ≥ 0`, gaps ≥ 0, `f · gap = 0`.
//!
//! `𝓛` is concave in the forces where films are straight, so there is one answer; for arcs that is what was found wherever it was looked for.
//! Newton's steps lead there: each solves one linear complementarity problem like Morse and Witten's, on the lines that bear a force or whose
//! droplets overlap, by conjugate gradients on
//!
//! ```text
//! B_kl = −∂²𝓛/∂f_k∂f_l = Σ_p r (Â_kl − 1/2π)  +  u (𝓛_rr)⁻¹ uᵀ  −  δ_kl C_ff,      u_k = ∂²𝓛/∂f_k∂r
//! ```
//!
//! with `(𝓛_rr)⁻¹` from its diagonal and, for arcs, two repeats of Jacobi's iteration with what lies beside it.

use super::lines::Lines;
use super::state::{Films, State};
use crate::numerics::wide::wide;
use core::f64::consts::PI;

/// Newton steps that a contact problem may take.
const STEPS: usize = 60;

/// A force beyond this (units of γ) is that of droplets in cells that are too small for them.
const STRONGEST: f64 = 50.0;

/// How often a step is halved.
const HALVINGS: usize = 30;

/// Armijo's share of the rise that the slope promises, and what rounding may take of `𝓛` (relative).
const SHARE: f64 = 1e-4;
const ROUNDING: f64 = 1e-13;

/// Room for the steps.
#[derive(Clone, Debug, Default)]
pub(super) struct Steps {
    set: Vec<bool>,
    weights: Vec<[f64; 2]>,
    /// `−C_ff + ε` and `C_ij` of each line.
    softness: Vec<f64>,
    couplings: Vec<f64>,
    inverse_diagonal: Vec<f64>,
    step: Vec<f64>,
    rest: Vec<f64>,
    direction: Vec<f64>,
    product: Vec<f64>,
    pressures: [Vec<f64>; 3],
    of_sides: Vec<f64>,
    before: Vec<f64>,
    slope: Vec<f64>,
}

/// The largest `|gap|` where there is a force and the deepest overlap where there is none (length).
pub(super) fn violation(gaps: &[f64], forces: &[f64]) -> f64 {
    gaps.iter().zip(forces).fold(0.0, |most: f64, (gap, f)| {
        let off = if *f > 0.0 { gap.abs() } else { (-gap).max(0.0) };
        if off > most || off.is_nan() {
            off
        } else {
            most
        }
    })
}

impl Steps {
    /// Solves for `forces` from those at hand until no violation is above `tolerance` (length); `false` if there is no answer.
    pub fn solve(
        &mut self,
        lines: (&Lines, &[f64]),
        state: &mut State,
        (forces, line_tension): (&mut [f64], f64),
        films: Films,
        tolerance: f64,
    ) -> bool {
        let radii = lines.1;
        let mean = radii.iter().sum::<f64>() / radii.len().max(1) as f64;
        let corner_tolerance = 0.05 * tolerance / mean;
        if !state.evaluate(lines, (forces, line_tension), films, corner_tolerance) {
            forces.fill(0.0);
            if !state.evaluate(lines, (forces, line_tension), films, corner_tolerance) {
                return false;
            }
        }
        for _ in 0..STEPS {
            let violated = violation(state.gaps(), forces);
            if violated <= tolerance {
                return true;
            }
            let relative = (violated / mean)
                .clamp(1e-7, 1e-2)
                .max(0.3 * tolerance / violated);
            self.find_step(lines.0, state, forces, films, relative);
            if !self.take_step(
                lines,
                state,
                (forces, line_tension),
                films,
                corner_tolerance,
            ) {
                return false;
            }
        }
        violation(state.gaps(), forces) <= tolerance
    }

    /// `B_SS Δ = −gap_S` by conjugate gradients to `relative` of the right-hand side, scaled by the diagonal.
    fn find_step(
        &mut self,
        lines: &Lines,
        state: &State,
        forces: &[f64],
        films: Films,
        relative: f64,
    ) {
        let count = lines.len();
        self.set.clear();
        let gaps = state.gaps().iter().zip(forces);
        self.set.extend(gaps.map(|(gap, f)| *f > 0.0 || *gap < 0.0));
        self.weights.clear();
        self.weights
            .extend((0..count).map(|c| state.weights(lines, c)));
        self.inverse_diagonal.clear();
        self.inverse_diagonal
            .extend((0..count).map(|c| 1.0 / diagonal(lines, state, c)));
        self.softness.clear();
        self.softness
            .extend((0..count).map(|c| state.film(c).softness() + state.give()));
        self.couplings.clear();
        if films == Films::Arcs {
            self.couplings
                .extend((0..count).map(|c| state.film(c).second()[1]));
        }
        for room in [&mut self.step, &mut self.product] {
            room.clear();
            room.resize(count, 0.0);
        }
        self.rest.clear();
        let within = self.set.iter().zip(state.gaps());
        self.rest
            .extend(within.map(|(is, gap)| if *is { -gap } else { 0.0 }));
        self.direction.clear();
        let scaled = self.rest.iter().zip(&self.inverse_diagonal);
        self.direction.extend(scaled.map(|(r, d)| r * d));
        let mut size: f64 = dot(&self.rest, &self.direction);
        let enough = relative * relative * size;
        for _ in 0..10 * count.max(10) {
            if size <= enough || size == 0.0 {
                return;
            }
            self.multiply(lines, state, films);
            let curvature = dot(&self.direction, &self.product);
            if curvature.is_nan() || curvature <= 0.0 {
                return;
            }
            let length = size / curvature;
            let mut next = 0.0;
            for c in 0..count {
                self.step[c] += length * self.direction[c];
                self.rest[c] -= length * self.product[c];
                next += self.rest[c] * self.rest[c] * self.inverse_diagonal[c];
            }
            let ratio = next / size;
            for c in 0..count {
                self.direction[c] =
                    self.rest[c] * self.inverse_diagonal[c] + ratio * self.direction[c];
            }
            size = next;
        }
    }

    /// `product = B direction` on the set.
    fn multiply(&mut self, lines: &Lines, state: &State, films: Films) {
        wide(
            #[inline(always)]
            || self.multiply_droplets(lines, state),
        );
        // (𝓛_rr)⁻¹ u·v
        let [pressed, answer, beside] = &mut self.pressures;
        answer.clear();
        let stiffness = state.droplets().iter().map(|droplet| droplet.stiffness);
        answer.extend(pressed.iter().zip(stiffness.clone()).map(|(w, d)| w / d));
        if films == Films::Arcs {
            for _ in 0..2 {
                beside.clear();
                beside.extend_from_slice(pressed);
                for (c_ij, &[i, j]) in self.couplings.iter().zip(lines.pairs()) {
                    beside[i as usize] -= c_ij * answer[j as usize];
                    beside[j as usize] -= c_ij * answer[i as usize];
                }
                for ((w, rest), d) in answer.iter_mut().zip(&*beside).zip(stiffness.clone()) {
                    *w = rest / d;
                }
            }
        }
        for (c, [i, j]) in lines.pairs().iter().enumerate() {
            self.product[c] = if self.set[c] {
                let [u_i, u_j] = self.weights[c];
                let [a, b] = lines.sides_of(c);
                let own = self.softness[c] * self.direction[c];
                let kernel = self.of_sides[a] + self.of_sides[b];
                own + kernel + u_i * answer[*i as usize] + u_j * answer[*j as usize]
            } else {
                0.0
            };
        }
    }

    /// `r (Â − 1/2π) v` of each side, and `u·v` of each droplet.
    #[inline(always)]
    fn multiply_droplets(&mut self, lines: &Lines, state: &State) {
        let pressed = &mut self.pressures[0];
        pressed.clear();
        self.of_sides.clear();
        self.of_sides.resize(2 * lines.len(), 0.0);
        for p in 0..lines.droplets() {
            let sides = lines.sides(p);
            let first = lines.first_side(p);
            let products = &mut self.of_sides[first..first + sides.len()];
            let (mut sum, mut pressure) = (0.0, 0.0);
            for (l, side) in sides.iter().enumerate() {
                let c = side.line as usize;
                // 0 beside the set.
                let v = self.direction[c];
                if v != 0.0 {
                    sum += v;
                    pressure += self.weights[c][usize::from(side.is_second)] * v;
                    for (product, a) in products.iter_mut().zip(lines.rows(p, l).0) {
                        *product += a * v;
                    }
                }
            }
            let r = state.corners()[p];
            for product in products {
                *product = r * (*product - sum / (2.0 * PI));
            }
            pressed.push(pressure);
        }
    }

    /// `f ← max(0, f + αΔ)` with the first of α = 1, ½, ¼, … with which `𝓛` does not fall; `false` if there is none.
    fn take_step(
        &mut self,
        lines: (&Lines, &[f64]),
        state: &mut State,
        (forces, line_tension): (&mut [f64], f64),
        films: Films,
        corner_tolerance: f64,
    ) -> bool {
        self.before.clear();
        self.before.extend_from_slice(forces);
        self.slope.clear();
        self.slope.extend(state.gaps().iter().map(|gap| -gap));
        let from = state.lagrangian();
        let mut length = 1.0;
        for _ in 0..HALVINGS {
            let mut promised = 0.0;
            for (c, f) in forces.iter_mut().enumerate() {
                *f = (self.before[c] + length * line_tension * self.step[c]).max(0.0);
                promised += self.slope[c] * (*f - self.before[c]) / line_tension;
            }
            let weak = forces.iter().all(|f| *f <= STRONGEST * line_tension);
            if weak
                && state.evaluate(lines, (forces, line_tension), films, corner_tolerance)
                && state.lagrangian() >= from + SHARE * promised - ROUNDING * (1.0 + from.abs())
            {
                return true;
            }
            length *= 0.5;
        }
        false
    }
}

/// `B_cc` (length/force).
pub(super) fn diagonal(lines: &Lines, state: &State, line: usize) -> f64 {
    let pair = lines.pairs()[line];
    let of_end = |(p, u): (u32, f64)| {
        let p = p as usize;
        state.corners()[p] / (4.0 * PI) + u * u / state.droplets()[p].stiffness
    };
    let [i, j] = state.weights(lines, line);
    of_end((pair[0], i)) + of_end((pair[1], j)) + state.film(line).softness() + state.give()
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}
