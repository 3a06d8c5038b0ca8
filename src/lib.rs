//! Relaxation of two-dimensional packings of deformable particles, recorded.
//!
//! softjam relaxes packings of particles that dent where they touch and bulge elsewhere (the Morse–Witten model) to
//! mechanical equilibrium, and records the way there for the [rerun](https://rerun.io) viewer and for replay. It follows
//! K. Saitoh, *Jamming of soft particles* (2025); equation numbers in the docs are of that paper.
//!
//! ```
//! use softjam::{relax::{Relaxation, Status}, scene::Scene};
//!
//! let scene = Scene { particles: 64, phi: 0.9, seed: 7, ..Scene::default() };
//! let mut run = Relaxation::new(&scene)?;
//! while run.status() == Status::Running {
//!     run.advance()?;
//! }
//! let o = run.observables();
//! println!("Z = {:.3}, p = {:.4} γ/length after {} steps", o.coordination(), o.pressure(), run.step());
//! assert!(o.f_max <= scene.threshold);
//! # Ok::<(), softjam::relax::RelaxError>(())
//! ```
//!
//! # The model
//!
//! A particle `i` of undeformed radius `R_i` is a droplet with line tension `γ`. Its contour, in polar coordinates about
//! its centre, is the circle plus one copy of a kernel `g` for each contact force, Saitoh (1)–(3):
//!
//! ```text
//! ρ_i(θ) = R_i + ΔR_i(θ),    ΔR_i(θ) = (R_i / 2πγ) Σ_j f_ij g(θ − θ_j)
//! g(θ) = (π − θ) sin θ − ½ cos θ − 1    (0 ≤ θ ≤ 2π)
//! ```
//!
//! Two particles in contact share a point of their contours, which couples all contacts to one linear system for the
//! force magnitudes, Saitoh (4)–(6), with the overlaps of the undeformed disks `δ_ij = R_i + R_j − r_ij`:
//!
//! ```text
//! A f = δ,    A_cc' = −Σ_p (R_p / 2πγ) g(angle between c and c' at p),    A_cc = (3 / 4πγ)(R_i + R_j)
//! ```
//!
//! Which pairs touch follows from `f ≥ 0`, `gap ≥ 0`, `f · gap = 0`. The forces act along the lines of centres, and FIRE
//! moves the particles until no net force is larger than the threshold; Newton's method can finish.
//!
//! # Units
//!
//! Lengths in diameters of the small particle (with the default mixture), forces in units of `γ`, mass 1. The coverage
//! `φ` is always that of the undeformed disks.
//!
//! # The modules
//!
//! | | |
//! | --- | --- |
//! | [`scene`] | what a run depends on: TOML, defaults, ranges, first packings |
//! | [`domain`], [`packing`], [`neighbors`] | periodic box, positions and radii, candidate pairs |
//! | [`disks`] | the undeformed packing that a run starts from |
//! | [`droplet`] | one particle: kernel and contour |
//! | [`contact`] | contact lists, the matrix `A`, the complementarity problem, its solvers |
//! | [`force`] | net forces, energy, stress, coordination |
//! | [`relax`] | FIRE and the loop that yields frames |
//! | [`frame`] | a frame and its digest |
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

pub mod contact;
#[cfg(feature = "recording")]
pub mod convert;
pub mod disks;
pub mod domain;
pub mod droplet;
#[cfg(feature = "figure")]
pub mod figure;
pub mod force;
pub mod frame;
pub mod neighbors;
pub mod packing;
#[cfg(feature = "recording")]
pub mod record;
pub mod relax;
#[cfg(feature = "recording")]
pub mod replay;
pub mod scene;
mod simplicial;
mod wide;
