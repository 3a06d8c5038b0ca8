//! The physics against exact answers, against a second computation from the formulas, and against its own promises.
//!
//! `model` is the second computation: the Morse–Witten model written down from Saitoh (1)–(6) with dense matrices and
//! `std`'s mathematics, sharing no code with the crate.

mod balance;
mod contact_law;
mod crystal;
mod edge_cases;
mod foam;
mod foam_newton;
mod golden;
mod gradient;
mod matrix;
mod model;
mod newton;
mod protocol;
mod relaxation;
mod stability;
mod stress;
mod work;
