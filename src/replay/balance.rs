//! Is the recorded packing in force balance, and do its contacts fulfil the contact law?
//!
//! Each recorded frame is held against the law of its model by [`Model::check`], from positions, radii and forces alone and by no solver.

use crate::models::droplet::contact::Rule;
use crate::models::{AnyModel, Model};
use crate::record::Outcome;
use crate::scene::Scene;
use crate::state::{Frame, Packing};

/// The worst of each residual over the frames, with the step at which it occurred.
///
/// Residuals of lengths are relative to the largest `|δ|` among the frame's contacts, those of forces to its largest force.
/// Each frame is held to the tolerance that is [due](crate::models::droplet::contact::due_tolerance) at its own `f_max`, the converged one
/// to the scene's.
///
/// ```
/// let worst = softjam::replay::Worst::default();
/// assert_eq!((worst.value, worst.step), (0.0, 0));
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Worst {
    /// The value that is the largest part of what its frame allows.
    pub value: f64,
    /// What that frame allows.
    pub allowed: f64,
    /// The step at which it occurred.
    pub step: u64,
}

impl Worst {
    pub(super) fn of(&mut self, value: f64, allowed: f64, step: u64) {
        // A NaN is worse than any number, and stays.
        let worse = value * self.allowed > self.value * allowed
            || (value > 0.0 && allowed <= 0.0 && value > self.value)
            || (value > 0.0 && self.value == 0.0);
        if (worse && !self.value.is_nan()) || value.is_nan() {
            *self = Self {
                value,
                allowed,
                step,
            };
        }
    }

    /// Whether the value is within what is allowed.
    #[must_use]
    pub fn agrees(&self) -> bool {
        self.value <= self.allowed
    }
}

/// What the frames seen so far are worth.
///
/// # Example
///
/// ```
/// use softjam::{protocol::Relaxation, replay::Balance, scene::Scene};
///
/// let scene = Scene { particles: 48, phi: 0.9, ..Scene::default() };
/// let mut run = Relaxation::new(&scene).unwrap();
/// let mut balance = Balance::new(&scene);
/// balance.check(run.packing(), &run.frame(), &[("energy", run.observables().energy)]);
/// assert!(balance.agrees());
/// ```
#[derive(Clone, Debug)]
pub struct Balance {
    scene: Scene,
    /// The stage of the frame before, and its model.
    stage: (u32, AnyModel),
    /// `max |A f − δ|` of the recorded forces: Saitoh (4).
    pub equation_4: Worst,
    /// The same of the last frame alone.
    pub last_equation_4: f64,
    /// The deepest overlap of deformed contours among pairs that are no contacts, `−gap`.
    pub overlap: Worst,
    /// The largest pull `−f` among the recorded forces; `f · gap = 0` since contacts have no gap and no other pair has a force.
    pub pull: Worst,
    /// The largest relative difference between recorded energy, pressure and those of the recorded forces.
    pub energy_and_pressure: Worst,
    /// The largest of `f_max` and moment of the states between which a protocol strains the box (units of γ), as far above what their stage is
    /// relaxed to as one is.
    pub relaxed: Worst,
    /// Frames seen.
    pub frames: u64,
    /// The step of the last frame, and its `f_max` from positions alone (units of γ).
    pub last: Option<(u64, f64)>,
    /// The largest moment of a contact in the last frame (γ·length).
    last_moment: f64,
    /// The strain step of the last frame, where there is a protocol.
    strain_step: Option<(u32, u64)>,
}

/// How far a residual may always be from zero: round-off, and the full tolerance amplified by a matrix of condition 6.
const ALLOWED: f64 = 1e-9;

/// How much larger a residual of forces may be than one of lengths, among particles of one size: the condition number of `A` is
/// about 6. The largest overlap is that of large particles; between small ones, whose contacts are stiffer, the same length stands for
/// a force that is larger by the ratio of sizes.
pub(super) const AMPLIFIED: f64 = 6.0;

impl Balance {
    /// Nothing seen yet of a recording of `scene`.
    #[must_use]
    pub fn new(scene: &Scene) -> Self {
        Self {
            scene: scene.clone(),
            stage: (0, scene.stage(0).model()),
            equation_4: Worst::default(),
            last_equation_4: 0.0,
            overlap: Worst::default(),
            pull: Worst::default(),
            energy_and_pressure: Worst::default(),
            relaxed: Worst::default(),
            frames: 0,
            last: None,
            last_moment: 0.0,
            strain_step: None,
        }
    }

    /// Looks at a frame; `packing` has its positions, `metrics` are those recorded at its step.
    ///
    /// # Panics
    ///
    /// If frame and packing do not belong together; a [`Recording`](super::Recording) gives only such that do.
    pub fn check(&mut self, packing: &Packing, frame: &Frame, metrics: &[(&'static str, f64)]) {
        let step = frame.step;
        self.leave_state(frame);
        let scene = self.scene.stage(frame.stage);
        if frame.stage != self.stage.0 {
            self.stage = (frame.stage, scene.model());
        }
        let found = (self.stage.1).check(packing, frame, scene.threshold);
        self.frames += 1;
        self.last = Some((step, found.f_max));
        self.last_moment = found.moment;
        self.last_equation_4 = found.residual;
        let lengths = found.promised.max(ALLOWED);
        let ratio = packing.largest_radius() / packing.smallest_radius();
        let forces = (AMPLIFIED * ratio * found.promised).max(ALLOWED);
        self.equation_4.of(found.residual, lengths, step);
        if self.scene.admits(frame).is_err() {
            // No law holds what no run can have.
            self.equation_4.of(f64::NAN, lengths, step);
        }
        self.overlap.of(found.overlap, lengths, step);
        self.pull.of(found.pull, 0.0, step);
        for (name, recorded) in metrics {
            let value = match *name {
                "energy" => found.energy,
                "pressure" => found.pressure,
                _ => continue,
            };
            let scale = value.abs().max(recorded.abs());
            if scale > 0.0 || recorded.is_nan() {
                let difference = (value - recorded).abs() / scale;
                self.energy_and_pressure.of(difference, forces, step);
            }
        }
    }

    /// The frame before was the last of its strain step, and relaxed, if this one is of another.
    fn leave_state(&mut self, frame: &Frame) {
        let is_of_disks = frame.stage == 0 && self.scene.records_disks();
        if self.scene.protocol.is_empty() || is_of_disks {
            return;
        }
        let step = (
            frame.stage,
            frame.protocol.get(1).map_or(0, |count| *count as u64),
        );
        if let (Some((last, f_max)), Some(before)) = (self.last, self.strain_step)
            && before != step
        {
            let threshold = self.scene.stage(before.0).threshold;
            self.relaxed
                .of(f_max.max(self.last_moment), threshold, last);
        }
        self.strain_step = Some(step);
    }

    /// Whether all frames seen fulfil the contact law to the tolerance that is due in them. With Saitoh's rule contacts lag behind their
    /// positions by a step, so only the last frame is asked for: its step must not be among the worst.
    #[must_use]
    pub fn agrees(&self) -> bool {
        let last = self.last.map_or(0, |(step, _)| step);
        let within = |worst: &Worst| {
            worst.agrees() || (self.scene.contact_rule == Rule::Saitoh && worst.step != last)
        };
        within(&self.equation_4)
            && within(&self.overlap)
            && within(&self.pull)
            && within(&self.energy_and_pressure)
            && self.relaxed.agrees()
    }

    /// Whether the last frame bears out a result: a converged run ends with `f_max` and moments not above its threshold. The recorded `f_max` may be
    /// off by `tolerance` (units of γ), 0 for the same bits.
    ///
    /// ```
    /// use softjam::{record::Outcome, protocol::Relaxation, replay::Balance, scene::Scene};
    ///
    /// let scene = Scene { particles: 48, phi: 0.9, ..Scene::default() };
    /// let run = Relaxation::new(&scene).unwrap();
    /// let mut balance = Balance::new(&scene);
    /// balance.check(run.packing(), &run.frame(), &[]);
    /// let claim = Outcome { converged: true, steps: 0, f_max: 0.0, stability: None };
    /// assert!(!balance.bears_out(&claim, 0.0), "the first frame is far from balance");
    /// ```
    #[must_use]
    pub fn bears_out(&self, outcome: &Outcome, tolerance: f64) -> bool {
        let threshold = self.scene.stage(self.stage.0).threshold;
        self.last.is_some_and(|(step, f_max)| {
            step == outcome.steps
                && (f_max.to_bits() == outcome.f_max.to_bits()
                    || (f_max - outcome.f_max).abs() <= tolerance)
                && outcome.converged
                    == (outcome.f_max <= threshold && self.last_moment <= threshold)
        })
    }
}
