//! The undeformed disks that droplets start from.

use super::{Channels, Minimizer, Preparation, Scene, Schedule, Stage, Start};
use crate::minimize::fire::Fire;
use crate::models::Kind;
use crate::models::droplet::Form;
use crate::models::droplet::contact::Rule;
use crate::state::{Frame, FrameError};
use std::borrow::Cow;

/// The relaxation of the disks that droplets start from.
///
/// ```
/// use softjam::scene::{DiskParameters, Schedule};
/// let disks = DiskParameters::default();
/// assert_eq!((disks.threshold, disks.record), (1e-6, Schedule::Off));
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DiskParameters {
    /// The relaxation ends when `f_max` (units of γ) is not above this.
    pub threshold: f64,
    /// The relaxation ends after this many steps in any case.
    pub steps: u64,
    /// When contours, contacts and state of the disks are recorded; metrics keep their schedule. Unless it is off, the disks are
    /// the first stage of the run, whose steps count from their start.
    pub record: Schedule,
}

impl Default for DiskParameters {
    fn default() -> Self {
        Self {
            threshold: 1e-6,
            steps: 50_000,
            record: Schedule::Off,
        }
    }
}

impl Scene {
    /// Whether the centres are relaxed as undeformed disks before the run; those of a start file are if it is asked for. A run of
    /// disks is that relaxation.
    #[must_use]
    pub fn starts_from_disks(&self) -> bool {
        let prepared = match self.start {
            Start::Random | Start::Hexagonal => true,
            Start::File { preparation, .. } => preparation == Preparation::Relaxed,
        };
        prepared && self.model != Kind::Disks
    }

    /// Whether the disks of the start are the first stage of the run, and recorded with it.
    #[must_use]
    pub fn records_disks(&self) -> bool {
        self.disks.record.is_on() && self.starts_from_disks()
    }

    /// The scene of one stage of a run, counted from 0: that of undeformed disks first, where they are recorded.
    ///
    /// ```
    /// use softjam::{models::Kind, scene::Scene};
    ///
    /// let scene = Scene::from_toml("disks.record = 'every 5'").unwrap();
    /// assert_eq!([0, 1].map(|k| scene.stage(k).model), [Kind::Disks, Kind::MorseWitten]);
    /// assert_eq!(Scene::default().stage(0).model, Kind::MorseWitten);
    /// ```
    #[must_use]
    pub fn stage(&self, stage: u32) -> Cow<'_, Self> {
        if stage == 0 && self.records_disks() {
            return Cow::Owned(self.of_disks());
        }
        match self.stage_of_protocol(stage) {
            Some(Stage {
                threshold, steps, ..
            }) => Cow::Owned(Self {
                threshold: *threshold,
                steps: *steps,
                ..self.clone()
            }),
            None => Cow::Borrowed(self),
        }
    }

    /// The stage of the protocol that a stage of the run is; `None` for the relaxation at its start.
    #[must_use]
    pub fn stage_of_protocol(&self, stage: u32) -> Option<&Stage> {
        let first = 1 + u32::from(self.records_disks());
        self.protocol.get(stage.checked_sub(first)? as usize)
    }

    /// The last stage of a run.
    pub(crate) fn last_stage(&self) -> u32 {
        u32::from(self.records_disks()) + self.protocol.len() as u32
    }

    /// What `channels` ask for in a stage of a run of this scene.
    #[must_use]
    pub fn scheduled(&self, channels: &Channels, stage: u32) -> Channels {
        if stage == 0 && self.records_disks() {
            channels.of_disks(self.disks.record)
        } else {
            *channels
        }
    }

    /// Whether a run of this scene can have a frame with such a stage, memory and box.
    pub(crate) fn admits(&self, frame: &Frame) -> Result<(), FrameError> {
        let is_of_protocol = self.stage_of_protocol(frame.stage).is_some();
        let model = self.stage(frame.stage).model;
        let foreign = [
            ("a later stage", frame.stage > self.last_stage()),
            ("a memory", !frame.memory.is_empty() && !model.has_memory()),
            (
                "a box of its own",
                frame.domain.is_some() && !is_of_protocol,
            ),
            (
                "no box of its own",
                frame.domain.is_none() && is_of_protocol,
            ),
            (
                "numbers of a protocol",
                frame.protocol.is_empty() == is_of_protocol,
            ),
        ];
        let found = foreign.into_iter().find(|(_, is)| *is);
        found.map_or(Ok(()), |(what, _)| Err(FrameError::Foreign { what }))
    }

    /// The scene in which the undeformed disks of the start relax.
    #[must_use]
    pub(crate) fn of_disks(&self) -> Self {
        Self {
            model: Kind::Disks,
            threshold: self.disks.threshold,
            steps: self.disks.steps,
            minimizer: Minimizer::Fire,
            fire: Fire::default(),
            forces: Form::default(),
            contact_rule: Rule::default(),
            dt_max: None,
            channels: self.channels.of_disks(self.disks.record),
            disks: DiskParameters::default(),
            protocol: Vec::new(),
            start: Start::default(),
            ..self.clone()
        }
    }
}
