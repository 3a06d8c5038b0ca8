//! The relaxation: the loop that yields frames.

mod disks;
mod present;
mod status;
mod take_over;

pub use disks::{DiskReport, relax_disks};
pub use status::{RelaxError, Status};

use crate::analysis::{Judgement, Stability, judge};
use crate::domain::Vec2;
use crate::minimize::fire::{Fire, FireState};
use crate::minimize::newton::{Attempt, Newton};
use crate::models::{AnyModel, Goal, Model};
use crate::scene::{Minimizer, Scene, start};
use crate::state::Frame;
use crate::state::Packing;
use std::sync::OnceLock;

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
    fire: Fire,
    state: FireState,
    step: u64,
    threshold: f64,
    step_limit: u64,
    /// What finishes; `None` where FIRE goes all the way.
    newton: Option<Newton>,
    disks: Option<DiskReport>,
    /// What this frame is, if it is in balance and somebody asked.
    judgement: OnceLock<Judgement>,
    yielded: bool,
    failed: bool,
}

impl Relaxation {
    /// Frame 0 of a scene: its start, its disks relaxed, the contact problem solved.
    ///
    /// # Errors
    ///
    /// [`RelaxError::Scene`] for an invalid scene, [`RelaxError::Contact`] if the contact problem cannot be solved.
    pub fn new(scene: &Scene) -> Result<Self, RelaxError> {
        scene.validate()?;
        Self::of_start(scene, start::packing(scene)?)
    }

    /// Frame 0 of a scene whose start is at hand: disks relaxed if the scene says so, the contact problem solved.
    ///
    /// # Errors
    ///
    /// As [`new`](Self::new).
    pub fn of_start(scene: &Scene, mut packing: Packing) -> Result<Self, RelaxError> {
        scene.validate()?;
        let disks = scene
            .starts_from_disks()
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
        let mut model = scene.model();
        let at_start = |source| RelaxError::Contact { step: 0, source };
        model.solve(&packing, Goal::EXACT).map_err(at_start)?;
        let dt_max = match scene.dt_max {
            Some(dt_max) => dt_max,
            None => model.longest_time_step(&packing).map_err(at_start)?,
        };
        let state = FireState::start(&scene.fire, dt_max);
        let velocities = vec![Vec2::zeros(); packing.len()];
        Ok(Self::at(scene, packing, model, (0, velocities, state)))
    }

    /// A run of `scene` at a step with its velocities and minimiser; `model` has its contacts and forces.
    fn at(
        scene: &Scene,
        packing: Packing,
        model: AnyModel,
        (step, velocities, state): (u64, Vec<Vec2>, FireState),
    ) -> Self {
        Self {
            newton: (scene.minimizer == Minimizer::FireNewton).then(Newton::default),
            packing,
            velocities,
            model,
            fire: scene.fire,
            state,
            step,
            threshold: scene.threshold,
            step_limit: scene.steps,
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
    pub fn resume(scene: &Scene, mut packing: Packing, frame: Frame) -> Result<Self, RelaxError> {
        scene.validate()?;
        frame.validate(packing.len(), packing.domain())?;
        *packing.positions_mut() = frame.positions;
        let mut model = scene.model();
        model.restore(&packing, &frame.contacts, &frame.forces);
        let moving = (frame.step, frame.velocities, frame.minimizer);
        Ok(Self::at(scene, packing, model, moving))
    }

    /// One move and the contact problem after it.
    ///
    /// # Errors
    ///
    /// [`RelaxError::Contact`] if the contact problem cannot be solved, [`RelaxError::TooFar`] if the run blew up. The
    /// run has then [failed](Status::Failed) and is of no further use.
    pub fn advance(&mut self) -> Result<(), RelaxError> {
        if self.is_on_saddle() {
            return self.leave_saddle();
        }
        if self.finish() {
            self.step += 1;
            self.judgement.take();
            return Ok(());
        }
        let domain = self.packing.domain();
        // Infinite after a step back: then each velocity is looked at.
        let moved = self.fire.advance(
            &mut self.state,
            self.model.net_forces(),
            &mut self.velocities,
            self.packing.positions_mut(),
            domain,
        );
        self.step += 1;
        let dt = self.state.dt;
        let far = 0.25 * domain.shortest();
        // A NaN is thrown too.
        let within = |v: &Vec2| (v * dt).norm_squared() <= far * far;
        let thrown = |v: &Vec2| !within(v);
        let near = moved <= 0.99 * far;
        // Disks push each other by finite forces, however far they overlap.
        let near = near || matches!(self.model, AnyModel::Disks(_));
        if !near && let Some(particle) = self.velocities.iter().position(thrown) {
            self.failed = true;
            return Err(RelaxError::TooFar {
                step: self.step,
                particle,
                distance: (self.velocities[particle] * dt).norm(),
                dt,
                dt_max: self.state.dt_max,
            });
        }
        self.solve_or_fail(moved)
    }

    /// Whether Newton's method has come to a saddle, and the run goes on for that.
    fn is_on_saddle(&self) -> bool {
        self.newton.is_some() && self.stability() == Some(Stability::Saddle)
    }

    /// A step down from a saddle: the particles are displaced along the direction that grows, the farthest by
    /// [`LEAVE`] of the smallest radius, and FIRE goes on from there, at rest, for as long as after a step of Newton's method
    /// that was given up.
    fn leave_saddle(&mut self) -> Result<(), RelaxError> {
        let way_down = self.judgement.take().map_or_else(Vec::new, |j| j.way_down);
        let longest = way_down.iter().fold(0.0, |m: f64, u| m.max(u.norm()));
        let moved = LEAVE * self.packing.smallest_radius();
        let domain = self.packing.domain();
        for (x, u) in self.packing.positions_mut().iter_mut().zip(&way_down) {
            *x = domain.wrap(*x + u * (moved / longest));
        }
        self.state.turns.fail();
        self.state.restart(&self.fire);
        self.velocities.fill(Vec2::zeros());
        self.step += 1;
        // Rounding may take the farthest a little farther.
        self.solve_or_fail(1.01 * moved)
    }

    /// The model at the new positions; no particle has moved by more than `moved` (length).
    fn solve_or_fail(&mut self, moved: f64) -> Result<(), RelaxError> {
        let step = self.step;
        let goal = Goal {
            f_max: self.model.f_max(),
            threshold: self.threshold,
            moved,
        };
        self.judgement.take();
        self.model.solve(&self.packing, goal).map_err(|source| {
            self.failed = true;
            RelaxError::Contact { step, source }
        })
    }

    /// One step of Newton's method, where it is its turn; `false` if the move is left to FIRE.
    ///
    /// After a step that is kept the particles are at rest, and FIRE would start anew.
    fn finish(&mut self) -> bool {
        let (Some(newton), AnyModel::MorseWitten(droplets)) = (&mut self.newton, &mut self.model)
        else {
            return false;
        };
        // Only Newton's method leaves the particles at rest.
        let goes_on =
            self.state.turns.moves > 0 && self.velocities.iter().all(|v| *v == Vec2::zeros());
        if !Newton::is_due(droplets, goes_on) {
            return false;
        }
        let turns = &mut self.state.turns;
        if turns.wait > 0 {
            turns.wait -= 1;
            return false;
        }
        let attempt = newton.advance(
            &mut self.packing,
            droplets,
            self.threshold,
            turns.is_patient(),
        );
        let kept = attempt != Attempt::GivenUp;
        if kept {
            turns.succeed(attempt == Attempt::Halved);
            self.state.restart(&self.fire);
            self.velocities.fill(Vec2::zeros());
        } else {
            turns.fail();
        }
        kept
    }

    /// The residual that this frame keeps to, relative to the largest `|δ|` of its contacts; see
    /// [`Model::promised_residual`].
    #[must_use]
    pub fn promised_residual(&self) -> f64 {
        self.model.promised_residual(&self.packing, self.threshold)
    }

    /// Whether `f_max` is not above the threshold, and the contact law is fulfilled.
    fn is_balanced(&self) -> bool {
        self.f_max() <= self.threshold && self.model.residual() <= self.model.accepted_residual()
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
        } else if self.is_balanced() && !self.is_on_saddle() {
            Status::Converged
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

/// How far a step down from a saddle takes the particle that moves most, in units of the smallest radius.
const LEAVE: f64 = 0.02;
