//! One deformable particle: the Morse–Witten kernel and the contour that it draws.
//!
//! A particle is a two-dimensional droplet of undeformed radius `R` and line tension `γ`. To first order in the
//! forces its contour is the circle plus one copy of the kernel [`kernel::g`] for each contact force,
//! Saitoh (1)–(3).

mod angle;
pub mod contour;
pub mod kernel;
mod outline;
pub mod validity;
