//! A run that goes on under another scene.

use super::super::drive::Progress;
use super::{NOT_ITS_NUMBERS, RelaxError, Relaxation};
use crate::minimize::dt_and_time;
use crate::models::{Goal, Model};
use crate::scene::Scene;
use crate::state::Frame;
use crate::state::Packing;

impl Relaxation {
    /// Goes on under `scene` from a frame of a run of `before`, which differs in its model, its threshold, its minimiser or its form of the
    /// forces alone.
    ///
    /// The frame becomes what `scene` computes from it: its contact problem is solved on, where `scene` asks for more at the `f_max` of
    /// its own forces. Under another model nothing but the positions stays, and the minimiser starts at rest. From there on [`resume`](Self::resume) walks the same bits.
    ///
    /// # Errors
    ///
    /// As [`resume`](Self::resume), and [`RelaxError::Contact`] if the contact problem cannot be solved.
    ///
    /// ```
    /// use softjam::{protocol::{Relaxation, Status}, scene::Scene};
    ///
    /// let scene = Scene { particles: 32, phi: 0.9, ..Scene::default() };
    /// let mut run = Relaxation::new(&scene).unwrap();
    /// while run.f_max() > 1e-4 {
    ///     run.advance().unwrap();
    /// }
    /// let rough = Scene { threshold: 1e-3, ..scene.clone() };
    /// let run = Relaxation::take_over(&scene, &rough, run.packing().clone(), run.frame()).unwrap();
    /// assert_eq!(run.status(), Status::Converged);
    /// ```
    pub fn take_over(
        before: &Scene,
        scene: &Scene,
        mut packing: Packing,
        mut frame: Frame,
    ) -> Result<Self, RelaxError> {
        let step = frame.step;
        let stages = [before, scene].map(|scene| scene.stage(frame.stage));
        if stages[0].model != stages[1].model {
            scene.validate()?;
            frame.validate(packing.len(), packing.domain())?;
            let (_, time) = dt_and_time(&frame.minimizer);
            *packing.positions_mut() = core::mem::take(&mut frame.positions);
            before.admits(&frame)?;
            let progress = match scene.stage_of_protocol(frame.stage) {
                Some(stage) => Progress::from_values(&frame.protocol, stage.act, packing.len()),
                None => Some(Progress::default()),
            };
            let progress = progress.ok_or(NOT_ITS_NUMBERS)?;
            if let Some(domain) = frame.domain {
                packing.set_domain(domain);
            }
            let run = Self::begin(&stages[1], packing, (step, time))?;
            let limit = progress.began.saturating_add(run.step_limit);
            return Ok(Self {
                scene: Box::new(scene.clone()),
                stage: frame.stage,
                step_limit: limit,
                progress: progress.forgotten(),
                ..run
            });
        }
        let mut run = Self::resume(scene, packing, frame)?;
        if run.model.residual() > run.promised_residual() {
            run.model
                .solve(&run.packing, Goal::EXACT)
                .map_err(|source| RelaxError::Contact { step, source })?;
        }
        Ok(run)
    }
}
