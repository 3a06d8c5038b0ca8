//! How a relaxation stands, and why it cannot go on.

use crate::models::droplet::contact::ContactError;
use crate::scene::SceneError;
use crate::state::FrameError;

/// How a relaxation stands.
///
/// ```
/// assert_ne!(softjam::protocol::Status::Running, softjam::protocol::Status::Converged);
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Status {
    /// Above the threshold, below the step limit.
    Running,
    /// `f_max` is not above the threshold and the contact law is fulfilled. Newton's method goes on from what
    /// is told to be a [saddle](super::Stability::Saddle); FIRE alone ends there.
    Converged,
    /// The step limit came first.
    StepLimit,
    /// A step could not be made; see the error of [`Relaxation::advance`](super::Relaxation::advance).
    Failed,
}

/// Why a relaxation cannot go on.
///
/// ```
/// use softjam::{protocol::{Relaxation, RelaxError}, scene::Scene};
/// let scene = Scene { particles: 64, phi: 0.9, dt_max: Some(1e3), ..Scene::default() };
/// let mut run = Relaxation::new(&scene).unwrap();
/// let error = (0..1000).find_map(|_| run.advance().err()).unwrap();
/// assert!(matches!(error, RelaxError::TooFar { .. } | RelaxError::Contact { .. }), "{error}");
/// ```
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RelaxError {
    /// The scene makes no sense.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// The contact problem at a step has no answer.
    #[error("step {step}: {source}")]
    Contact {
        /// The step.
        step: u64,
        /// What went wrong.
        source: ContactError,
    },
    /// A particle was thrown through the box: the time step is too long for this scene.
    #[error(
        "step {step}: particle {particle} moved by {distance:.3e} in one step of {dt:.3e}; choose a smaller dt_max than {dt_max:.3e}"
    )]
    TooFar {
        /// The step.
        step: u64,
        /// The particle.
        particle: usize,
        /// How far it moved (length).
        distance: f64,
        /// The time step.
        dt: f64,
        /// The bound of the time step in use.
        dt_max: f64,
    },
    /// A stage of the protocol cannot come to its end.
    #[error("step {step}: \"{act}\" cannot come to its end: {why}")]
    Protocol {
        /// The step of the last relaxed state.
        step: u64,
        /// What the stage does.
        act: &'static str,
        /// Why it cannot.
        why: &'static str,
    },
    /// The frame to go on from does not belong to the scene.
    #[error("the frame does not belong to this scene: {0}")]
    Frame(#[from] FrameError),
}
