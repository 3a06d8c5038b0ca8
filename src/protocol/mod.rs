//! Protocols: what is done to a packing, and which minimiser answers.
//!
//! # Relaxation
//!
//! From undeformed disks to mechanical equilibrium, one frame after the other.
//!
//! The loop is that of Saitoh 2.2.5. Frame 0 is the packing of undeformed disks in balance, with the Morse–Witten
//! forces solved on it; every move of [FIRE](crate::minimize::fire) is followed by a new solution of the contact problem; the run ends at
//! the first frame whose `f_max` is not above the threshold, or at the step limit.
//!
//! ```
//! use softjam::{protocol::{Relaxation, Status}, scene::Scene};
//!
//! let scene = Scene { particles: 64, phi: 0.9, ..Scene::default() };
//! let mut run = Relaxation::new(&scene).unwrap();
//! while run.status() == Status::Running {
//!     run.advance().unwrap();
//! }
//! assert_eq!(run.status(), Status::Converged);
//! assert!(run.f_max() <= scene.threshold);
//! ```
//!
//! A frame carries everything that the next one depends on. Nothing else that the loop keeps (neighbour list, buffers)
//! can reach a result; [`Relaxation::resume`] starts from any frame and walks the same bits.

mod drive;
mod relax;

pub use drive::Jamming;
pub use relax::{DiskReport, RelaxError, Relaxation, Status, relax_disks};
