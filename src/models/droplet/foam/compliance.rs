//! How a contact gives way on its own: the diagonal of `B`, and what it is made of.
//!
//! ```text
//! u_k  = ∂²𝓛/∂f_k∂r = F/2π − K_k + cos δ_k + (what the film adds)          for each side
//! B_cc = Σ_p ( r/4π + u²/𝓛_rr )  −  C_ff  +  ε
//! ```

use super::lines::Lines;
use super::sides::{LANES, Lanes, Place};
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
        self.diagonal.resize(lines.len(), 0.0);
        wide(
            #[inline(always)]
            || {
                let (weights, shares) = (&mut self.weights[..], &mut self.shares[..]);
                find_shares(lines.layout().places(), state, weights, shares);
                let (shares, give) = (shares.as_flattened(), state.give());
                let sides = self.diagonal.iter_mut().zip(lines.layout().of_lines());
                for ((diagonal, [a, b]), softness) in sides.zip(state.softness()) {
                    let (a, b) = (shares[*a as usize], shares[*b as usize]);
                    *diagonal = a + b + (softness + give);
                }
            },
        );
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

#[inline(always)]
fn find_shares(places: &[Place], state: &State, weights: &mut [Lanes], shares: &mut [Lanes]) {
    let (kernel, droplets) = (state.kernel_sums(), state.droplets());
    for place in places {
        let (droplet, r) = (&droplets[place.droplet()], state.corners()[place.droplet()]);
        let (share, own) = (droplet.force * (0.5 / PI), r * (0.25 / PI));
        let softness = 1.0 / droplet.stiffness;
        for g in place.groups() {
            let (kernel, chords) = (&kernel[g], state.chords(g));
            let (mut u, mut of_side) = ([0.0; LANES], [0.0; LANES]);
            for k in 0..LANES {
                u[k] = share - kernel[k] + chords[k];
                of_side[k] = own + u[k] * u[k] * softness;
            }
            (weights[g], shares[g]) = (u, of_side);
        }
    }
}
