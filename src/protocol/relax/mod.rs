//! The relaxation: the loop that yields frames.

mod disks;
mod present;
mod status;
mod strain;
mod take_over;

pub use disks::{DiskReport, relax_disks};
pub use status::{RelaxError, Status};

use super::drive::{Next, Progress};
use crate::analysis::{Judgement, Stability, judge};
use crate::domain::Vec2;
use crate::minimize::{Motion, Mover};
use crate::models::{AnyModel, Goal, Model};
use crate::scene::{Minimizer, Scene, start};
use crate::state::{Frame, FrameError, Packing};
use std::sync::OnceLock;

/// Steps after which the bound of the time step is found anew where a model stiffens.
const STIFFENS: u64 = 50;

/// A packing on its way to mechanical equilibrium.
///
/// # Example
///
/// See the [module](super); as an iterator of frames:
///
/// ```
/// use softjam::{protocol::Relaxation, scene::Scene};
///
/// let scene = Scene { particles: 32, phi: 0.9, ..Scene::default() };
/// let frames: Result<Vec<_>, _> = Relaxation::new(&scene).unwrap().collect();
/// let frames = frames.unwrap();
/// assert_eq!(frames[0].step, 0);
/// assert_eq!(frames.last().unwrap().step as usize, frames.len() - 1);
/// ```
#[derive(Clone, Debug)]
pub struct Relaxation {
    packing: Packing,
    velocities: Vec<Vec2>,
    model: AnyModel,
    mover: Mover,
    /// The bound of the time step that the scene gives (time).
    dt_max: Option<f64>,
    step: u64,
    threshold: f64,
    step_limit: u64,
    /// Of all stages.
    scene: Box<Scene>,
    /// Counted from 0.
    stage: u32,
    /// How far a stage of the protocol has come.
    progress: Progress,
    /// Whether this frame is the first of a stage behind another.
    begins_stage: bool,
    disks: Option<DiskReport>,
    /// What this frame is, if it is in balance and somebody asked.
    judgement: OnceLock<Judgement>,
    yielded: bool,
    failed: bool,
}

impl Relaxation {
    /// Frame 0 of a scene: its start, its disks relaxed unless they are the first stage, the model solved.
    ///
    /// # Errors
    ///
    /// [`RelaxError::Scene`] for an invalid scene, [`RelaxError::Contact`] if the contact problem cannot be solved.
    pub fn new(scene: &Scene) -> Result<Self, RelaxError> {
        scene.validate()?;
        Self::of_start(scene, start::packing(scene)?)
    }

    /// [`new`](Self::new) of a scene whose start is at hand.
    ///
    /// # Errors
    ///
    /// As [`new`](Self::new).
    pub fn of_start(scene: &Scene, mut packing: Packing) -> Result<Self, RelaxError> {
        scene.validate()?;
        let relaxes_first = scene.starts_from_disks() && !scene.records_disks();
        let disks = relaxes_first
            .then(|| relax_disks(&mut packing, &scene.disks, scene.line_tension))
            .transpose()?;
        let run = Self::of_packing(scene, packing)?;
        Ok(Self { disks, ..run })
    }

    /// Frame 0 of a run of `scene` that starts from `packing` as it stands, whatever start the scene names.
    ///
    /// # Errors
    ///
    /// [`RelaxError::Scene`] for an invalid scene, [`RelaxError::Contact`] if the contact problem cannot be solved.
    ///
    /// ```
    /// use softjam::{protocol::Relaxation, scene::Scene};
    ///
    /// let scene = Scene { particles: 32, ..Scene::default() };
    /// let run = Relaxation::new(&scene).unwrap();
    /// let same = Relaxation::of_packing(&scene, run.packing().clone()).unwrap();
    /// assert_eq!(run.frame().digest(), same.frame().digest());
    /// ```
    pub fn of_packing(scene: &Scene, packing: Packing) -> Result<Self, RelaxError> {
        scene.validate()?;
        let run = Self::begin(&scene.stage(0), packing, (0, 0.0))?;
        let scene = Box::new(scene.clone());
        Ok(Self { scene, ..run })
    }

    /// The first frame of a run of `scene` as it stands, which is valid, after so many steps and at such a time.
    fn begin(
        scene: &Scene,
        packing: Packing,
        (step, time): (u64, f64),
    ) -> Result<Self, RelaxError> {
        let mut model = scene.model();
        let at_start = |source| RelaxError::Contact { step, source };
        model.solve(&packing, Goal::EXACT).map_err(at_start)?;
        let dt_max = match scene.dt_max {
            Some(dt_max) => dt_max,
            None => model.longest_time_step(&packing).map_err(at_start)?,
        };
        let mover = Mover::start(scene.fire, finishes(scene), dt_max, time);
        let velocities = vec![Vec2::zeros(); packing.len()];
        Ok(Self::at(scene, packing, model, (step, velocities, mover)))
    }

    /// A run of `scene` at a step with its velocities and minimiser; `model` has its contacts and forces.
    fn at(
        scene: &Scene,
        packing: Packing,
        model: AnyModel,
        (step, velocities, mover): (u64, Vec<Vec2>, Mover),
    ) -> Self {
        Self {
            packing,
            velocities,
            dt_max: scene.dt_max,
            model,
            mover,
            step,
            threshold: scene.threshold,
            step_limit: scene.steps,
            scene: Box::new(scene.clone()),
            stage: 0,
            progress: Progress::default(),
            begins_stage: false,
            disks: None,
            judgement: OnceLock::new(),
            yielded: false,
            failed: false,
        }
    }

    /// Goes on from a frame of an earlier run of `scene`, exactly as that run did.
    ///
    /// `packing` gives the radii and the box.
    ///
    /// # Errors
    ///
    /// [`RelaxError::Frame`] if the frame does not fit the packing, otherwise as [`new`](Self::new).
    pub fn resume(
        scene: &Scene,
        mut packing: Packing,
        mut frame: Frame,
    ) -> Result<Self, RelaxError> {
        scene.validate()?;
        frame.validate(packing.len(), packing.domain())?;
        scene.admits(&frame)?;
        if let Some(domain) = frame.domain {
            packing.set_domain(domain);
        }
        *packing.positions_mut() = core::mem::take(&mut frame.positions);
        let whole = scene;
        let scene = &*whole.stage(frame.stage);
        let mut model = scene.model();
        model.restore(&packing, &frame)?;
        let mover = Mover::resume(scene.fire, finishes(scene), &frame.minimizer).ok_or(
            FrameError::Minimizer {
                minimizer: frame.minimizer.name(),
                count: frame.minimizer.values().len(),
            },
        )?;
        let progress = match whole.stage_of_protocol(frame.stage) {
            Some(stage) => Progress::from_values(&frame.protocol, stage.act, packing.len()),
            None => Some(Progress::default()),
        };
        let progress = progress.ok_or(NOT_ITS_NUMBERS)?;
        let moving = (frame.step, frame.velocities, mover);
        let run = Self::at(scene, packing, model, moving);
        Ok(Self {
            scene: Box::new(whole.clone()),
            stage: frame.stage,
            step_limit: progress.began.saturating_add(run.step_limit),
            progress,
            ..run
        })
    }

    /// One move and the contact problem after it; at the end of a stage, the next one at the same positions.
    ///
    /// # Errors
    ///
    /// [`RelaxError::Contact`] if the contact problem cannot be solved, [`RelaxError::TooFar`] if the run blew up. The
    /// run has then [failed](Status::Failed) and is of no further use.
    pub fn advance(&mut self) -> Result<(), RelaxError> {
        if self.are_disks_over() {
            return self.enter_next_stage();
        }
        self.begins_stage = false;
        if self.is_balanced() && !self.is_on_saddle() {
            match self.next_of_protocol() {
                Some((stage, Next::Strained(packing, progress))) => {
                    return self.strain(stage, *packing, progress);
                }
                Some((stage, Next::Over)) => self.enter(stage),
                Some((stage, Next::Impossible(why))) => {
                    self.failed = true;
                    let act = self.scene.stage_of_protocol(stage).map(|s| s.act.name());
                    return Err(RelaxError::Protocol {
                        step: self.step,
                        act: act.unwrap_or_default(),
                        why,
                    });
                }
                None => {}
            }
        }
        self.step += 1;
        let is_on_saddle = self.is_on_saddle();
        let (packing, velocities) = (&mut self.packing, &mut self.velocities);
        if is_on_saddle {
            let way_down = self.judgement.take().map_or_else(Vec::new, |j| j.way_down);
            let motion = (self.mover).leave_saddle(packing, velocities, &way_down);
            return self.solve_or_fail(motion);
        }
        let motion = (self.mover).advance(packing, velocities, &mut self.model, self.threshold);
        if let Motion::Moved(moved) = motion {
            self.check_distance(moved)?;
        }
        self.solve_or_fail(motion)
    }

    /// Whether this is a frame of recorded disks.
    fn is_of_disks(&self) -> bool {
        self.stage == 0 && self.scene.records_disks()
    }

    /// Whether this is the last frame of recorded disks.
    fn are_disks_over(&self) -> bool {
        self.is_of_disks() && (self.is_balanced() || self.step >= self.step_limit)
    }

    /// The disks are relaxed, and become what the scene says.
    fn enter_next_stage(&mut self) -> Result<(), RelaxError> {
        let disks = Some(self.disk_report());
        let at = (self.step + 1, self.mover.time());
        let begun = Self::begin(&self.scene, self.packing.clone(), at);
        self.failed = begun.is_err();
        *self = Self {
            stage: self.stage + 1,
            begins_stage: true,
            disks,
            yielded: self.yielded,
            ..begun?
        };
        Ok(())
    }

    /// Whether a run that goes on from saddles has come to one.
    fn is_on_saddle(&self) -> bool {
        self.mover.leaves_saddles() && self.stability() == Some(Stability::Saddle)
    }

    /// Fails if a particle was thrown through the box, where none has moved by more than `moved` (length; infinite where that is not
    /// known).
    fn check_distance(&mut self, moved: f64) -> Result<(), RelaxError> {
        let (dt, far) = (self.mover.dt(), 0.25 * self.packing.domain().shortest());
        // Disks push each other by finite forces, however far they overlap.
        if moved <= 0.99 * far || matches!(self.model, AnyModel::Disks(_)) {
            return Ok(());
        }
        // A NaN is thrown too.
        let within = |v: &Vec2| (v * dt).norm_squared() <= far * far;
        let Some(particle) = self.velocities.iter().position(|v| !within(v)) else {
            return Ok(());
        };
        self.failed = true;
        Err(RelaxError::TooFar {
            step: self.step,
            particle,
            distance: (self.velocities[particle] * dt).norm(),
            dt,
            dt_max: self.mover.dt_max(),
        })
    }

    /// The model at the end of a move.
    fn solve_or_fail(&mut self, motion: Motion) -> Result<(), RelaxError> {
        self.judgement.take();
        let Motion::Moved(moved) = motion else {
            return Ok(());
        };
        let step = self.step;
        let goal = Goal {
            f_max: self.model.f_max(),
            threshold: self.threshold,
            moved,
        };
        let solved = self.model.solve(&self.packing, goal);
        let solved = solved.and_then(|()| {
            let follows = self.dt_max.is_none() && self.model.stiffens();
            if follows && step.is_multiple_of(STIFFENS) {
                let dt_max = self.model.longest_time_step(&self.packing)?;
                self.mover.set_dt_max(dt_max);
            }
            Ok(())
        });
        solved.map_err(|source| {
            self.failed = true;
            RelaxError::Contact { step, source }
        })
    }

    /// The residual that this frame keeps to, relative to the largest `|δ|` of its contacts; see
    /// [`Model::promised_residual`].
    #[must_use]
    pub fn promised_residual(&self) -> f64 {
        self.model.promised_residual(&self.packing, self.threshold)
    }

    /// Whether `f_max` is not above the threshold, nor a moment (γ·length), and the contact law is fulfilled.
    fn is_balanced(&self) -> bool {
        self.is_balanced_to(self.threshold)
    }

    fn is_balanced_to(&self, threshold: f64) -> bool {
        self.f_max() <= threshold
            && self.model.moment() <= threshold
            && self.model.residual() <= self.model.accepted_residual()
    }

    /// Whether a frame in balance is a minimum or a saddle; `None` while it is not in balance.
    ///
    /// It is a function of positions, contacts and forces alone, found when it is asked for the first time.
    #[must_use]
    pub fn stability(&self) -> Option<Stability> {
        let judge = || judge(&self.packing, &self.model);
        self.is_balanced()
            .then(|| self.judgement.get_or_init(judge).stability)
    }

    /// How the run stands at this frame.
    #[must_use]
    pub fn status(&self) -> Status {
        if self.failed {
            Status::Failed
        } else if self.is_of_disks() {
            if self.step < self.scene.steps {
                Status::Running
            } else {
                Status::StepLimit
            }
        } else if self.is_balanced() && !self.is_on_saddle() {
            if self.next_of_protocol().is_none() {
                Status::Converged
            } else {
                Status::Running
            }
        } else if self.step >= self.step_limit {
            Status::StepLimit
        } else {
            Status::Running
        }
    }
}

/// Frames from the present one to the last, both included.
impl Iterator for Relaxation {
    type Item = Result<Frame, RelaxError>;

    fn next(&mut self) -> Option<Self::Item> {
        if self.yielded {
            if self.status() != Status::Running {
                return None;
            }
            if let Err(error) = self.advance() {
                return Some(Err(error));
            }
        }
        self.yielded = true;
        Some(Ok(self.frame()))
    }
}

const NOT_ITS_NUMBERS: FrameError = FrameError::Foreign {
    what: "numbers of a protocol that are not its stage's",
};

/// Whether the scene's minimiser ends with Newton's method.
fn finishes(scene: &Scene) -> bool {
    scene.minimizer == Minimizer::FireNewton
}
