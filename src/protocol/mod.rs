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
//! # Straining the box
//!
//! Behind that relaxation a scene may have stages, each of which strains the box in steps and relaxes behind each: compression to a coverage or a
//! pressure, shear, the search of φ_J (`drive.rs`). A step moves the particles with the box, which leaves less to relax; the box of
//! step `k` is computed from that at the beginning of its stage, so nothing adds up. Stress and energy belong to the relaxed states.
//!
//! ```
//! use softjam::{protocol::{Relaxation, Status}, scene::Scene};
//!
//! let scene = Scene::from_toml("particles = 32\nphi = 0.9\n[[protocol]]\nact = 'shear'\nstrain = 0.004").unwrap();
//! let mut run = Relaxation::new(&scene).unwrap();
//! let mut curve = Vec::new();
//! while run.status() == Status::Running {
//!     if run.is_relaxed_state() {
//!         let o = run.observables();
//!         curve.push((o.phi_and_strain.unwrap()[1], o.stress_xy()));
//!     }
//!     run.advance().unwrap();
//! }
//! assert_eq!(curve.len(), 4, "and the last state is at hand");
//! ```
//!
//! A frame carries everything that the next one depends on. Nothing else that the loop keeps (neighbour list, buffers)
//! can reach a result; [`Relaxation::resume`] starts from any frame and walks the same bits.

mod drive;
mod relax;

pub use drive::{Jamming, StageEnd};
pub use relax::{DiskReport, RelaxError, Relaxation, Status, relax_disks};
