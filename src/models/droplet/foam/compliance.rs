//! How a contact gives way on its own: the diagonal of `B`, and what it is made of.
//!
//! ```text
//! u_k  = ∂²𝓛/∂f_k∂r = F/2π − K_k + cos δ_k + (what the film adds)          for each side
//! B_cc = Σ_p ( r/4π + u²/𝓛_rr )  −  C_ff  +  ε
//! ```

use super::lines::Lines;
use super::sides::{LANES, Lanes};
use super::state::State;
use crate::numerics::wide::wide;
use core::f64::consts::PI;

/// See the [module](self).
#[derive(Clone, Debug, Default)]
pub(super) struct Compliance {
    /// `u` of each side.
    weights: Vec<Lanes>,
    /// What each side adds to the diagonal (length/force).
    shares: Vec<Lanes>,
    diagonal: Vec<f64>,
}

impl Compliance {
    /// Finds that of a state.
    pub fn find(&mut self, lines: &Lines, state: &State) {
        let groups = lines.layout().groups();
        self.weights.resize(groups, [0.0; LANES]);
        self.shares.resize(groups, [0.0; LANES]);
        self.diagonal.clear();
        wide(
            #[inline(always)]
            || {
                self.find_shares(lines, state);
                let shares = self.shares.as_flattened();
                let give = state.give();
                let lines = lines.layout().of_lines().iter().enumerate();
                self.diagonal.extend(lines.map(|(c, [a, b])| {
                    shares[*a as usize] + shares[*b as usize] + (state.film(c).softness() + give)
                }));
            },
        );
    }

    #[inline(always)]
    fn find_shares(&mut self, lines: &Lines, state: &State) {
        let droplets = state.droplets().iter().zip(state.corners());
        for (p, (droplet, r)) in droplets.enumerate() {
            let (share, own) = (droplet.force / (2.0 * PI), r / (4.0 * PI));
            let softness = 1.0 / droplet.stiffness;
            for g in lines.layout().groups_of(p) {
                let (kernel, chords) = (&state.kernel_sums()[g], state.chords(g));
                for k in 0..LANES {
                    let u = share - kernel[k] + chords[k];
                    self.weights[g][k] = u;
                    self.shares[g][k] = own + u * u * softness;
                }
            }
        }
    }

    /// `u` of each side.
    #[inline(always)]
    pub fn weights(&self) -> &[Lanes] {
        &self.weights
    }

    /// `B_cc` of each line (length/force).
    #[inline(always)]
    pub fn diagonal(&self) -> &[f64] {
        &self.diagonal
    }
}
