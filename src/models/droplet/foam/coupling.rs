//! What films put beside the diagonal of `𝓛_rr`: the droplets of a contact share how their corner radii answer.
//!
//! The blocks of a correction have `(𝓛_rr)⁻¹` from its diagonal. Where films bear much, `C_ij` is added by two repeats of Jacobi's iteration; without
//! it Newton's method takes off no more than a sixth of the gaps a step in a crystal at φ = 0.99. Where they bear little, it is left to the next step.

use super::lines::Lines;
use super::state::State;

/// `|C_ij|/𝓛_rr` of a line from which on all are looked at.
const STRONG: f64 = 2e-3;

/// See the [module](self).
#[derive(Clone, Debug, Default)]
pub(super) struct Coupling {
    /// `D^(−½) u` of the two sides of each line, and `C_ij`; empty where it is weak.
    weights: Vec<[f32; 2]>,
    entries: Vec<f32>,
    /// `1/𝓛_rr` of each droplet, on the diagonal.
    softness: Vec<f32>,
    /// Room for the droplets: `u·v`, what is left of it, and how the corner radii answer.
    pressed: Vec<f32>,
    rest: Vec<f32>,
    answers: Vec<f32>,
}

impl Coupling {
    /// That of a state; `weights` are `u` by sides, `roots` are `D^(−½)`.
    pub fn find(&mut self, lines: &Lines, state: &State, weights: &[f64], roots: &[f64]) {
        self.weights.clear();
        self.entries.clear();
        let droplets = state.droplets();
        let is_strong = |(c, pair): (usize, &[u32; 2])| {
            let [i, j] = pair.map(|p| droplets[p as usize].stiffness);
            state.film(c).second()[1].abs() > STRONG * i.min(j)
        };
        if !lines.pairs().iter().enumerate().any(is_strong) {
            return;
        }
        let sides = lines.layout().of_lines().iter().zip(roots);
        self.weights
            .extend(sides.map(|(sides, root)| sides.map(|k| (weights[k as usize] * root) as f32)));
        let entries = (0..lines.len()).map(|c| state.film(c).second()[1] as f32);
        self.entries.extend(entries);
        self.softness.clear();
        let softness = droplets.iter().map(|d| (1.0 / d.stiffness) as f32);
        self.softness.extend(softness);
    }

    /// Adds what it makes of a direction to the image.
    pub fn add(&mut self, pairs: &[[u32; 2]], direction: &[f32], image: &mut [f32]) {
        if self.entries.is_empty() {
            return;
        }
        self.pressed.clear();
        self.pressed.resize(self.softness.len(), 0.0);
        for (([u_i, u_j], v), pair) in self.weights.iter().zip(direction).zip(pairs) {
            let [i, j] = pair.map(|p| p as usize);
            self.pressed[i] += u_i * v;
            self.pressed[j] += u_j * v;
        }
        self.pressed.clone_into(&mut self.rest);
        for repeat in 0..=2 {
            self.answers.clear();
            let rest = self.rest.iter().zip(&self.softness);
            self.answers
                .extend(rest.map(|(rest, softness)| rest * softness));
            if repeat < 2 {
                self.pressed.clone_into(&mut self.rest);
                for (entry, pair) in self.entries.iter().zip(pairs) {
                    let [i, j] = pair.map(|p| p as usize);
                    self.rest[i] -= entry * self.answers[j];
                    self.rest[j] -= entry * self.answers[i];
                }
            }
        }
        // The blocks have what the diagonal alone answers.
        let alone = self.pressed.iter().zip(&self.softness);
        for (answer, (pressed, softness)) in self.answers.iter_mut().zip(alone) {
            *answer -= pressed * softness;
        }
        for ((image, [u_i, u_j]), pair) in image.iter_mut().zip(&self.weights).zip(pairs) {
            let [i, j] = pair.map(|p| self.answers[p as usize]);
            *image += u_i * i + u_j * j;
        }
    }
}
