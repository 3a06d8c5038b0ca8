//! What a run is at its present frame.

use super::Relaxation;
use super::disks::DiskReport;
use crate::analysis::{Backbone, Observables};
use crate::contacts::Contacts;
use crate::domain::Vec2;
use crate::models::droplet::contact::ContactLaw;
use crate::models::{AnyModel, Model};
use crate::scene::Channels;
use crate::state::Frame;
use crate::state::Packing;

impl Relaxation {
    /// This frame, as a value of its own.
    #[must_use]
    pub fn frame(&self) -> Frame {
        let mut frame = Frame::default();
        self.copy_frame(&mut frame);
        frame
    }

    /// [`frame`](Self::frame) in the place of another, whose memory it takes.
    pub fn copy_frame(&self, frame: &mut Frame) {
        frame.step = self.step;
        self.packing.positions().clone_into(&mut frame.positions);
        self.velocities.clone_into(&mut frame.velocities);
        let (pairs, forces) = (&mut frame.contacts, &mut frame.forces);
        self.model.copy_contacts(&self.packing, pairs, forces);
        frame.minimizer = self.mover.numbers();
        self.model.copy_memory(&mut frame.memory);
        frame.stage = self.stage;
        frame.domain = None;
        frame.protocol.clear();
        if self.is_strained() {
            frame.domain = Some(self.packing.domain());
            frame.protocol.extend(self.progress.values());
        }
    }

    /// The stage of the run, counted from 0: disks that are recorded come first.
    #[must_use]
    pub fn stage(&self) -> u32 {
        self.stage
    }

    /// Whether this frame is the first of a stage behind another. A run that was taken up there does not know.
    #[must_use]
    pub fn begins_stage(&self) -> bool {
        self.begins_stage
    }

    /// What `channels` ask for in this stage.
    #[must_use]
    pub fn scheduled(&self, channels: &Channels) -> Channels {
        self.scene.scheduled(channels, self.stage)
    }

    /// Whether this frame is one of those between which a protocol strains the box: a relaxed state.
    #[must_use]
    pub fn is_relaxed_state(&self) -> bool {
        !self.scene.protocol.is_empty() && !self.is_of_disks() && self.is_balanced()
    }

    /// The packing as it stands.
    #[must_use]
    pub fn packing(&self) -> &Packing {
        &self.packing
    }

    /// The contacts and forces at this frame.
    #[must_use]
    pub fn contacts(&self) -> Contacts<'_> {
        self.model.contacts(&self.packing)
    }

    /// The net forces `F_i`, one a particle (force; `line_tension` is in the same unit).
    #[must_use]
    pub fn net_forces(&self) -> &[Vec2] {
        self.model.net_forces()
    }

    /// Number of moves made.
    #[must_use]
    pub fn step(&self) -> u64 {
        self.step
    }

    /// Simulated time, the sum of the time steps.
    #[must_use]
    pub fn time(&self) -> f64 {
        self.mover.time()
    }

    /// The largest net force `f_max` (units of γ).
    #[must_use]
    pub fn f_max(&self) -> f64 {
        self.model.f_max()
    }

    /// Balance, energy, stress and coordination at this frame.
    #[must_use]
    pub fn observables(&self) -> Observables {
        self.observables_counted(&mut Backbone::default())
    }

    /// [`observables`](Self::observables) with a counter of rattlers that remembers the frame before.
    pub fn observables_counted(&self, backbone: &mut Backbone) -> Observables {
        let o = Observables::of_model(&self.model, &self.packing, self.mover.dt(), backbone);
        let strained = !self.scene.protocol.is_empty() && !self.is_of_disks();
        Observables {
            phi_and_strain: strained.then(|| [self.packing.coverage(), self.progress.strain]),
            ..o
        }
    }

    /// The model with its residual.
    #[must_use]
    pub fn model(&self) -> &AnyModel {
        &self.model
    }

    /// The contact law of droplets with its residual and its count of work; `None` with another model.
    #[must_use]
    pub fn law(&self) -> Option<&ContactLaw> {
        match &self.model {
            AnyModel::MorseWitten(droplets) => Some(droplets.law()),
            AnyModel::Disks(_) | AnyModel::Foam(_) => None,
        }
    }

    /// How the undeformed disks relaxed; `None` where there was no such stage (a start from a file, a resumed run).
    #[must_use]
    pub fn disks(&self) -> Option<DiskReport> {
        self.disks
    }
}
