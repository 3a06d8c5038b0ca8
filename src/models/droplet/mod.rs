//! One deformable particle: the Morse–Witten kernel and the contour that it draws.
//!
//! A particle is a two-dimensional droplet of undeformed radius `R` and line tension `γ`. To first order in the
//! forces its contour is the circle plus one copy of the kernel [`kernel::g`] for each contact force,
//! Saitoh (1)–(3).
//!
//! # Two forms of the net force
//!
//! *Central*, Saitoh 2.2.3: `F_i = Σ_j f_ij n_ij`. It acts along the lines of centres and is not the gradient of anything:
//! no energy need fall on the way to balance, and none is searched for.
//!
//! *Gradient*: `F_i = −∂U/∂r_i` of the stored energy of the contact problem (force times length),
//!
//! ```text
//! U(r) = max over f ≥ 0 of  δᵀf − ½ fᵀA f  =  ½ Σ_c δ_c f_c .
//! ```
//!
//! At the maximum a change of `f` does not change `U` (where the contact set changes, `f = 0` there), so only the explicit
//! dependence on the positions counts: `−∂U/∂r = −(∂δ/∂r)ᵀ f + ½ fᵀ (∂A/∂r) f`. With `δ_c = R_i + R_j − r_c` the first
//! term is the central form. `A` depends on the positions through the angles `φ_c` of its contacts only,
//!
//! ```text
//! A_cc' = −Σ_p (R_p/2πγ) g(φ_c − φ_c'),        G_cc' = ∂A_cc'/∂φ_c = −(R_p/2πγ) g'(φ_c − φ_c') = −G_c'c
//! ½ fᵀ dA f = ½ Σ_cc' f_c f_c' G_cc' (dφ_c − dφ_c') = Σ_c τ_c dφ_c,        τ_c = f_c Σ_c' G_cc' f_c'
//! ```
//!
//! (`G`: length per force and radian, `τ`: force times length), where the last step uses that `G` is odd: every pair occurs
//! twice, with the same value. A contact turns by `dφ_c = t_c·(dr_i − dr_j)/r_c`, `t_c` being `n_c` turned by a quarter.
//! Hence
//!
//! ```text
//! F_i = Σ_j ( f_ij n_ij + (τ_ij / r_ij) t_ij ),
//! ```
//!
//! a tangential force at each contact that depends on the other contacts of its two particles: a three-body force, O(f²).
//! What one contact of a couple gains in torque the other loses, so `Σ τ_c = 0`: no total force, no total torque. `g'` jumps
//! from −π to π at angle 0, where no two contacts of a particle lie. `U` is continuous with its first derivatives, also where
//! contacts open and close. An isotropic rescaling turns no contact: `p = −dU/dV` holds with both forms.
//!
//! # How far apart their packings lie
//!
//! N = 256, 15 random starts each, relaxed to `f_max ≤ 1e-12` γ. Medians of the root mean square and the largest displacement
//! (lengths; rattlers left out, the common translation taken off) between the packings that central and gradient forces
//! make of the same start, and between the central packing and what gradient forces make of *that*; of the relative change of energy
//! and pressure from the central packing to that of the gradient form; and of Z in both
//! (`cargo run --release --example forms`):
//!
//! | φ | same start: rms | largest | onward: rms | largest | energy | pressure | Z central | Z gradient |
//! | --- | --- | --- | --- | --- | --- | --- | --- | --- |
//! | 0.86 | 0.0015 | 0.0062 | 0.0014 | 0.0043 | −0.009 % | −0.19 % | 4.598 | 4.601 |
//! | 0.90 | 0.0084 | 0.041 | 0.0060 | 0.026 | −0.039 % | −0.47 % | 5.180 | 5.195 |
//! | 0.95 | 0.015 | 0.082 | 0.011 | 0.050 | −0.076 % | −0.50 % | 5.625 | 5.633 |
//! | 1.00 | 0.076 | 0.38 | 0.021 | 0.095 | −0.028 % | −0.50 % | 5.938 | 5.969 |

mod angle;
mod arc;
mod check;
pub mod contact;
pub mod contour;
pub mod foam;
mod form;
pub mod frequency;
pub mod kernel;
pub(crate) mod linear;
mod morse_witten;
mod outline;
pub(crate) mod turning;
pub mod validity;

pub(crate) use form::tangent;
pub use form::{Form, NetForces};
pub use morse_witten::MorseWitten;
