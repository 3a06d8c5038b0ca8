//! Minimisers: what moves the particles towards balance. Each has its own numbers, which a frame carries under its name.
//!
//! See the example of [`fire::Fire`].

pub mod fire;
pub mod newton;
