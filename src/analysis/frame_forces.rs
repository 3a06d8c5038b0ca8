//! The forces of a frame that comes from a file, or from anywhere else.

use super::{Backbone, Observables};
use crate::domain::Vec2;
use crate::minimize::dt_and_time;
use crate::models::{AnyModel, Model};
use crate::state::{Frame, FrameError, Packing};

/// Net forces, torques and observables of a frame, whatever its model: the bits of the run that it comes from.
///
/// # Example
///
/// Of the last state of a recording:
///
/// ```
/// # #[cfg(feature = "recording")] {
/// use softjam::{analysis::FrameForces, replay::Recording};
/// # use softjam::{models::droplet::Form, record, protocol::Relaxation, scene::Scene};
/// # let path = std::env::temp_dir().join("softjam-frame-forces-example.rrd");
/// # let scene = Scene { particles: 32, phi: 0.9, forces: Form::Gradient, ..Scene::default() };
/// # let mut run = Relaxation::new(&scene).unwrap();
/// # let writer = record::Writer::create(&path, true, record::Header::of(&scene, &run)).unwrap();
/// # record::record(&mut run, vec![writer], &scene.channels, |_| true).unwrap();
///
/// let mut recording = Recording::open(&path).unwrap();
/// let mut last = None;
/// while let Some(state) = recording.next_state().unwrap() {
///     last = Some(state.frame);
/// }
/// let frame = last.unwrap();
/// let packing = recording.packing(&frame).unwrap();
/// let scene = recording.scene();
/// let forces = FrameForces::of(&packing, &frame, scene.model()).unwrap();
/// assert_eq!(forces.net().len(), 32);
/// assert!(forces.observables().f_max <= scene.threshold);
/// # std::fs::remove_file(&path).unwrap();
/// # }
/// ```
#[derive(Clone, Debug)]
pub struct FrameForces {
    net: Vec<Vec2>,
    torques: Vec<f64>,
    observables: Observables,
}

impl FrameForces {
    /// Of `frame` with the radii and the box of `packing`, whose positions are not looked at; `model` is that of the
    /// scene's [stage](crate::scene::Scene::stage).
    ///
    /// # Errors
    ///
    /// [`FrameError::Foreign`] if no frame of the model has such a memory.
    ///
    /// # Panics
    ///
    /// If the frame does not [belong](Frame::validate) to the packing.
    ///
    /// ```
    /// use softjam::{analysis::FrameForces, models::droplet::Form, protocol::Relaxation, scene::Scene};
    ///
    /// let scene = Scene { particles: 32, phi: 0.9, forces: Form::Gradient, ..Scene::default() };
    /// let run = Relaxation::new(&scene).unwrap();
    /// let forces = FrameForces::of(run.packing(), &run.frame(), scene.model()).unwrap();
    /// assert_eq!(forces.net(), run.net_forces());
    /// assert_eq!(forces.observables(), &run.observables());
    /// ```
    pub fn of(packing: &Packing, frame: &Frame, mut model: AnyModel) -> Result<Self, FrameError> {
        let mut packing = packing.clone();
        frame.positions.clone_into(packing.positions_mut());
        model.restore(&packing, frame)?;
        let (dt, _) = dt_and_time(&frame.minimizer);
        Ok(Self {
            net: model.net_forces().to_vec(),
            torques: model.torques().to_vec(),
            observables: Observables::of_model(&model, &packing, dt, &mut Backbone::default()),
        })
    }

    /// The net force `F_i` on each particle (force).
    #[must_use]
    pub fn net(&self) -> &[Vec2] {
        &self.net
    }

    /// The torque `τ_c` of each contact (force·length); empty for the central form.
    #[must_use]
    pub fn torques(&self) -> &[f64] {
        &self.torques
    }

    /// Balance, energy, stress and coordination.
    #[must_use]
    pub fn observables(&self) -> &Observables {
        &self.observables
    }
}
