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
//! with `(𝓛_rr)⁻¹` from its diagonal and, where films bear much, what lies beside it ([`Coupling`](super::coupling)).
//!
use super::correction::Correction;
use super::lines::Lines;
use super::state::{Films, State};
use crate::numerics::wide::wide;

/// Newton steps that a contact problem may take.
const STEPS: usize = 60;

/// A force beyond this (units of γ) is that of droplets in cells that are too small for them.
const STRONGEST: f64 = 50.0;

/// No step is asked for more exactly than that: it is made in single precision.
const SINGLE: f64 = 3e-5;

/// How often a step is halved.
const HALVINGS: usize = 30;

/// Armijo's share of the rise that the slope promises, and what rounding may take of `𝓛` (relative).
const SHARE: f64 = 1e-4;
const ROUNDING: f64 = 1e-13;

/// Room for the steps.
#[derive(Clone, Debug, Default)]
pub(super) struct Steps {
    correction: Correction,
    /// Forces and gaps before a step.
    before: Vec<f64>,
    gaps: Vec<f64>,
}

/// The largest `|gap|` where there is a force and the deepest overlap where there is none (length).
pub(super) fn violation(gaps: &[f64], forces: &[f64]) -> f64 {
    wide(
        #[inline(always)]
        || {
            let (gaps8, gaps) = gaps.as_chunks::<8>();
            let (forces8, forces) = forces.as_chunks::<8>();
            // A NaN hides behind comparisons, not behind a sum.
            let (mut most, mut sums) = ([0.0; 8], [0.0; 8]);
            let mut look = |k: usize, gap: f64, f: f64| {
                let off = if f > 0.0 { gap.abs() } else { -gap };
                most[k] = if off > most[k] { off } else { most[k] };
                sums[k] += gap;
            };
            for (gaps, forces) in gaps8.iter().zip(forces8) {
                for k in 0..8 {
                    look(k, gaps[k], forces[k]);
                }
            }
            for (k, (gap, f)) in gaps.iter().zip(forces).enumerate() {
                look(k, *gap, *f);
            }
            let sum: f64 = sums.iter().sum();
            let most = most.into_iter().fold(0.0, f64::max);
            if sum.is_nan() { sum } else { most }
        },
    )
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
        let corner_tolerance = 0.1 * tolerance / mean;
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
                .clamp(SINGLE, 1e-2)
                .max(0.3 * tolerance / violated);
            self.correction.find(lines.0, state, relative);
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

    /// `f ← max(0, f + αΔ)` with the first of α = 1, ½, ¼, … with which `𝓛` does not fall; `false` if there is none.
    fn take_step(
        &mut self,
        lines: (&Lines, &[f64]),
        state: &mut State,
        (forces, line_tension): (&mut [f64], f64),
        films: Films,
        corner_tolerance: f64,
    ) -> bool {
        forces.clone_into(&mut self.before);
        state.gaps().clone_into(&mut self.gaps);
        let from = state.lagrangian();
        let mut length = 1.0;
        for _ in 0..HALVINGS {
            let (promised, strongest) = wide(
                #[inline(always)]
                || self.move_forces(forces, length, line_tension),
            );
            if strongest <= STRONGEST
                && state.evaluate(lines, (forces, line_tension), films, corner_tolerance)
                && state.lagrangian() >= from + SHARE * promised - ROUNDING * (1.0 + from.abs())
            {
                return true;
            }
            length *= 0.5;
        }
        false
    }

    /// `f ← max(0, f + αΔ)`; what the slope promises of it (γ·length), and the largest force (units of γ).
    #[inline(always)]
    fn move_forces(&self, forces: &mut [f64], length: f64, line_tension: f64) -> (f64, f64) {
        const CHAINS: usize = 4;
        let (mut promised, mut strongest) = ([0.0; CHAINS], [0.0; CHAINS]);
        let given = self.before.chunks(CHAINS).zip(self.gaps.chunks(CHAINS));
        let steps = self.correction.step().chunks(CHAINS);
        for (forces, ((before, gaps), steps)) in forces.chunks_mut(CHAINS).zip(given.zip(steps)) {
            let lines = before.iter().zip(gaps).zip(steps);
            for (k, (f, ((before, gap), step))) in forces.iter_mut().zip(lines).enumerate() {
                *f = (before + length * line_tension * step).max(0.0);
                promised[k] -= gap * (*f - before);
                strongest[k] = if *f > strongest[k] { *f } else { strongest[k] };
            }
        }
        let promised: f64 = promised.iter().sum();
        let strongest = strongest.into_iter().fold(0.0, f64::max);
        (promised / line_tension, strongest / line_tension)
    }
}
