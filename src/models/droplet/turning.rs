//! What happens to `A f` when contacts turn: the part of the model's derivatives that comes from the angles.
//!
//! Contact `c` points in the direction `φ_c`, the same angle (up to π) for both of its particles. `A` depends on the
//! positions through differences of these angles only, so with `p` the particle that `c` and `c'` share
//!
//! ```text
//! G_cc' = ∂A_cc'/∂φ_c  = −(R_p/2πγ) g'(φ_c − φ_c')        = −G_c'c       (length per force and radian)
//! H_cc' = ∂²A_cc'/∂φ_c² = −(R_p/2πγ) g''(φ_c − φ_c')      =  H_c'c
//! ```
//!
//! and, at fixed forces, `d(A f) = M dφ` with `(M x)_c = Σ_c' G_cc' f_c' (x_c − x_c')`. The *torque* of a contact is what
//! turning it does to the energy, `τ_c = −∂U/∂φ_c = ½ fᵀ (∂A/∂φ_c) f = f_c Σ_c' G_cc' f_c' = ½ (Mᵀ f)_c`
//! (force times length).

use crate::contacts::Contacts;
use crate::models::droplet::contact::list::{ContactList, DuplicateContactList};
use crate::models::droplet::kernel::{Direction, per_radius};
use crate::state::Packing;

/// Two contacts of one particle.
#[derive(Clone, Copy, Debug)]
struct Couple {
    c: u32,
    d: u32,
    /// `G_cd`.
    slope: f64,
    /// `H_cd`.
    curvature: f64,
}

/// All couples of contacts that share a particle, particle by particle, each couple once.
#[derive(Clone, Debug, Default)]
pub(crate) struct Turning {
    couples: Vec<Couple>,
    directions: Vec<Direction>,
    list: ContactList,
    duplicate: DuplicateContactList,
}

impl Turning {
    /// The couples of `contacts` in `packing`, `line_tension` being γ (force).
    pub(crate) fn rebuild(
        &mut self,
        contacts: &Contacts<'_>,
        packing: &Packing,
        line_tension: f64,
    ) {
        self.list.rebuild(packing.len(), contacts.pairs);
        self.duplicate.rebuild(&self.list);
        self.directions.clear();
        self.directions
            .extend(contacts.normals.iter().map(|n| Direction::of(-n)));
        self.couples.clear();
        let per_radius = -per_radius(line_tension);
        for (p, radius) in packing.radii().iter().enumerate() {
            let scale = per_radius * radius;
            let (partners, numbers) = (self.duplicate.partners(p), self.duplicate.contacts(p));
            let toward = |a: usize| {
                let from_lower = self.directions[numbers[a] as usize];
                if p < partners[a] as usize {
                    from_lower
                } else {
                    from_lower.opposite()
                }
            };
            for a in 0..numbers.len() {
                let from = toward(a);
                for b in a + 1..numbers.len() {
                    let (slope, curvature) = from.slopes_between(toward(b));
                    self.couples.push(Couple {
                        c: numbers[a],
                        d: numbers[b],
                        slope: scale * slope,
                        curvature: scale * curvature,
                    });
                }
            }
        }
    }

    /// Adds `M x` to `y`.
    pub(crate) fn add_m(&self, forces: &[f64], x: &[f64], y: &mut [f64]) {
        for couple in &self.couples {
            let (c, d) = (couple.c as usize, couple.d as usize);
            let turn = couple.slope * (x[c] - x[d]);
            y[c] += forces[d] * turn;
            y[d] += forces[c] * turn;
        }
    }

    /// Adds `Mᵀ z` to `y`.
    pub(crate) fn add_m_transposed(&self, forces: &[f64], z: &[f64], y: &mut [f64]) {
        for couple in &self.couples {
            let (c, d) = (couple.c as usize, couple.d as usize);
            let s = couple.slope * (forces[d] * z[c] + forces[c] * z[d]);
            y[c] += s;
            y[d] -= s;
        }
    }

    /// Adds `S x` to `y`: how the torques change at fixed forces when contacts turn by `x`,
    /// `(S x)_c = f_c Σ_c' H_cc' f_c' (x_c − x_c')`.
    pub(crate) fn add_s(&self, forces: &[f64], x: &[f64], y: &mut [f64]) {
        for couple in &self.couples {
            let (c, d) = (couple.c as usize, couple.d as usize);
            let s = couple.curvature * forces[c] * forces[d] * (x[c] - x[d]);
            y[c] += s;
            y[d] -= s;
        }
    }

    /// The torques `τ_c` into `torques`. What one contact of a couple gains the other loses, so they sum to zero.
    pub(crate) fn torques(&self, forces: &[f64], torques: &mut Vec<f64>) {
        torques.clear();
        torques.resize(forces.len(), 0.0);
        for couple in &self.couples {
            let (c, d) = (couple.c as usize, couple.d as usize);
            let s = couple.slope * forces[c] * forces[d];
            torques[c] += s;
            torques[d] -= s;
        }
    }
}
