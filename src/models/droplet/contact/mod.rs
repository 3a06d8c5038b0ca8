//! The contact problem: which particles touch, and with what forces.
//!
//! For a set of contacts the forces solve `A f = δ`, Saitoh (4)–(6): [`matrix`] builds `A`, [`solver`] solves. Which
//! pairs *are* in contact is part of the answer. The gap between the deformed contours of a pair is
//!
//! ```text
//! gap_ij = r_ij − ρ_i(θ_j) − ρ_j(θ_i) = (A f)_ij − δ_ij          (= −Δ_ij in Saitoh 2.2.4)
//! ```
//!
//! and the contact law asks, over all candidate pairs, for
//!
//! ```text
//! f ≥ 0,   gap ≥ 0,   f · gap = 0                                 (a linear complementarity problem)
//! ```
//!
//! that is, for the minimum of `½ fᵀA f − δᵀf` over `f ≥ 0`. `A` is positive definite, so there is exactly one answer:
//! the contact list is a function of the positions alone. [`ContactLaw`] finds it by exchanging contacts between
//! the two sides; Saitoh's drop-and-add rule is one such exchange and can be had on its own ([`Rule`]).
//!
//! The law is what the rest of the crate sees: positions in, contacts and forces out. A second law would be
//! added behind it.

mod bulges;
mod candidates;
mod error;
mod geometry;
mod law;
pub mod list;
pub mod matrix;
mod search;
pub(super) mod second_image;
mod set;
pub mod solver;
mod tolerance;

pub use error::ContactError;
pub use law::{ContactLaw, Rule, Work};
pub(crate) use tolerance::ACCEPTED;
pub use tolerance::due_tolerance;
