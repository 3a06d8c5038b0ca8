//! Relaxation of two-dimensional packings of deformable particles, recorded.
//!
//! softjam relaxes packings of particles that dent where they touch and bulge elsewhere (the Morse–Witten model) to
//! mechanical equilibrium, and records the way there for the [rerun](https://rerun.io) viewer and for replay. It follows
//! K. Saitoh, *Jamming of soft particles* (2025); equation numbers in the docs are of that paper.
//!
//! ```
//! use softjam::{protocol::{Relaxation, Status}, scene::Scene};
//!
//! let scene = Scene { particles: 64, phi: 0.9, seed: 7, ..Scene::default() };
//! let mut run = Relaxation::new(&scene)?;
//! while run.status() == Status::Running {
//!     run.advance()?;
//! }
//! let o = run.observables();
//! println!("Z = {:.3}, p = {:.4} γ/length after {} steps", o.coordination(), o.pressure(), run.step());
//! assert!(o.f_max <= scene.threshold);
//! # Ok::<(), softjam::protocol::RelaxError>(())
//! ```
//!
//! # The model
//!
//! A particle is a droplet: each contact force dents its contour and lets it bulge elsewhere. Two particles in contact share a
//! point of their contours, which couples all contact forces to one linear system; which pairs touch follows from forces that
//! push and contours that do not overlap. FIRE moves the particles until no net force is larger than the threshold;
//! Newton's method can finish. The page [`model`] has it all, in the order of the paper, with its formulas.
//!
//! # Units
//!
//! Lengths in the unit of the radii (with the default mixture the diameter of the small particle), forces in units of `γ`, mass
//! 1. The coverage `φ` is always that of the undeformed disks.
//!
//! # The modules
//!
//! | | |
//! | --- | --- |
//! | [`model`] | the physics, formula by formula: nothing but text |
//! | [`scene`] | what a run depends on: TOML, defaults, ranges, first packings |
//! | [`domain`], [`state`], [`neighbors`] | periodic box; packings and frames; candidate pairs |
//! | [`contacts`] | what every model tells about its contacts |
//! | [`models`] | [disks](models::disks); [droplets](models::droplet): kernel, contour, the matrix `A`, the complementarity problem |
//! | [`minimize`] | FIRE, Newton's method |
//! | [`analysis`] | energy, stress, coordination, rattlers, minimum or saddle |
//! | [`protocol`] | the relaxation: the loop that yields frames; behind it the box is compressed, sheared, or φ_J is looked for |
//! | [`numerics`] | a second thread for one run |
//! | [`text`], [`budget`] | text from strangers; how much memory their files may take |
#![cfg_attr(
    feature = "recording",
    doc = "| [`record`] | recordings, `.rrd` and `.mcap` |\n| [`replay`] | reading them back, checking them |\n| [`convert`] | from one format to the other, with more channels or fewer |"
)]
#![cfg_attr(
    feature = "figure",
    doc = "| [`figure`] | figures of packings and relaxations |"
)]
//!
//! # Reproducibility
//!
//! The same scene gives the same bits, on any x86-64 CPU: every transcendental function comes from the crate `libm`,
//! sums have one order, random numbers come from a named generator. A frame determines the next one.

pub mod analysis;
pub mod budget;
pub mod contacts;
#[cfg(feature = "recording")]
pub mod convert;
pub mod domain;
#[cfg(feature = "figure")]
pub mod figure;
pub mod minimize;
#[doc = include_str!("model.md")]
pub mod model {}
pub mod models;
pub mod neighbors;
pub mod numerics;
pub mod protocol;
#[cfg(feature = "recording")]
pub mod record;
#[cfg(feature = "recording")]
pub mod replay;
pub mod scene;
pub mod state;
pub mod text;

/// The revision of the bits: a number that is raised whenever a change of the program alters a bit of any state. A scene gives
/// the same bits with every version of one revision; of another revision a replay expects the same physics, not the same bits.
///
/// Revision 2: Newton's method leaves a saddle instead of ending there. Runs by FIRE alone are those of revision 1.
pub const BITS: u32 = 2;
