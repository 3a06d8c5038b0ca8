//! What is read off a packing: energy, stress and coordination, rattlers, and whether a balance is stable.
//!
//! # Stress
//!
//! The stress that the contacts exert, averaged over the box of area `V = L_x L_y`, *tension positive*: a compressed packing has
//! negative `σ_xx` and `σ_yy`, and `p = −(σ_xx + σ_yy)/2` is positive. From the derivative of `U` with an affine strain, `V σ_αβ =
//! ∂U/∂ε_αβ` at fixed contact forces,
//!
//! ```text
//! central:   σ_αβ = −(1/V) Σ_c f_c r_c n_α n_β
//! gradient:  σ_αβ = −(1/V) Σ_c ( f_c r_c n_α n_β + τ_c (t_α n_β + n_α t_β)/2 )
//! ```
//!
//! (γ/length), with `n` from one particle of the contact to the other (either way) and `t` turned from it by a quarter,
//! counter-clockwise. The second term has no trace and is symmetric because `Σ τ_c = 0`. The share of the contours' own line
//! tension and of the pressure in the droplets is not in it: it is isotropic in a free droplet and no contact's doing.
//!
//! `σ_xy` is a recorded metric, `stress_xy`; all three come from a recorded state by [`FrameForces`], `softjam info` and
//! `softjam info --json`.

mod frame_forces;
mod observables;
mod rattlers;
mod stability;
mod sums;

pub use frame_forces::FrameForces;
#[cfg(feature = "recording")]
pub(crate) use observables::metrics_of;
pub use observables::{METRICS, Metrics, Observables};
pub use rattlers::{Backbone, backbone, held};
pub use stability::Stability;
pub(crate) use stability::{Judgement, judge};
