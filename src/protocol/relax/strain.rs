//! The stages of a protocol: the box is strained between relaxed states.

use super::super::drive::{self, Jamming, Next, Progress, StageEnd};
use super::{RelaxError, Relaxation, finishes};
use crate::domain::Vec2;
use crate::minimize::Mover;
use crate::models::{Goal, Model};
use crate::state::Packing;

impl Relaxation {
    /// Whether this frame is one of a stage of the protocol, which has a box of its own.
    pub(super) fn is_strained(&self) -> bool {
        self.scene.stage_of_protocol(self.stage).is_some()
    }

    /// What the protocol does behind this frame, which is balanced, and in which stage; `None` if it is at its end. A stage without a step to make is
    /// passed over, unless it is to relax the state further.
    pub(super) fn next_of_protocol(&self) -> Option<(u32, Next)> {
        if self.scene.protocol.is_empty() {
            return None;
        }
        let pressure = self.observables().pressure();
        let (mut stage, mut progress) = (self.stage, self.progress.clone());
        loop {
            if let Some(found) = self.scene.stage_of_protocol(stage) {
                let further = stage != self.stage && !self.is_balanced_to(found.threshold);
                let next = drive::next(found.act, &progress, &self.packing, pressure);
                if further || !matches!(next, Next::Over) {
                    return Some((stage, if further { Next::Over } else { next }));
                }
            }
            stage += 1;
            if stage > self.scene.last_stage() {
                return None;
            }
            progress = Progress::begin(progress.strain, &self.packing, self.step);
        }
    }

    /// What a search of φ_J, which is the stage of this frame, has come to; `None` in other stages and before its end.
    #[must_use]
    pub fn jamming(&self) -> Option<Jamming> {
        let stage = self.scene.stage_of_protocol(self.stage)?;
        let found = || {
            let pressure = self.observables().pressure();
            let next = drive::next(stage.act, &self.progress, &self.packing, pressure);
            matches!(next, Next::Over)
                .then(|| drive::jamming(stage.act, &self.progress, &self.packing, pressure))?
        };
        self.is_balanced().then(found)?
    }

    /// What a stage has come to in a run with a protocol, if this frame is its last; `None` otherwise.
    #[must_use]
    pub fn stage_end(&self) -> Option<StageEnd> {
        if !self.is_relaxed_state() || self.is_on_saddle() {
            return None;
        }
        let next = self.next_of_protocol();
        if next.is_some_and(|(stage, _)| stage == self.stage) {
            return None;
        }
        let o = self.observables();
        let stage = self.scene.stage_of_protocol(self.stage);
        Some(StageEnd {
            stage: self.stage,
            act: stage.map_or("relax", |stage| stage.act.name()),
            phi: self.packing.coverage(),
            strain: self.progress.strain,
            pressure: o.pressure(),
            stress: o.stress,
            coordination: o.coordination(),
            jamming: self.jamming(),
        })
    }

    /// Goes over to a later stage, whose states are relaxed further, with the present packing.
    pub(super) fn enter(&mut self, stage: u32) {
        self.progress = Progress::begin(self.progress.strain, &self.packing, self.step);
        self.set_stage(stage);
    }

    fn set_stage(&mut self, stage: u32) {
        self.begins_stage = stage != self.stage;
        self.stage = stage;
        if let Some(found) = self.scene.stage_of_protocol(stage) {
            self.threshold = found.threshold;
            self.step_limit = self.progress.began.saturating_add(found.steps);
        }
    }

    /// The packing in another box, at rest, its model solved.
    pub(super) fn strain(
        &mut self,
        stage: u32,
        packing: Packing,
        mut progress: Progress,
    ) -> Result<(), RelaxError> {
        self.step += 1;
        self.judgement.take();
        progress.began = self.step;
        (self.packing, self.progress) = (packing, progress);
        self.set_stage(stage);
        self.velocities.fill(Vec2::zeros());
        let step = self.step;
        let solved = self.model.solve(&self.packing, Goal::EXACT);
        let dt_max = solved.and_then(|()| match self.dt_max {
            Some(dt_max) => Ok(dt_max),
            None => self.model.longest_time_step(&self.packing),
        });
        let dt_max = dt_max.map_err(|source| {
            self.failed = true;
            RelaxError::Contact { step, source }
        })?;
        let time = self.mover.time();
        self.mover = Mover::start(self.scene.fire, finishes(&self.scene), dt_max, time);
        Ok(())
    }
}
