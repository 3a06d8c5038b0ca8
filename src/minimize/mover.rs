//! FIRE, which Newton's method may finish: what a relaxation moves its particles by.

use super::fire::{Fire, FireState};
use super::newton::{Attempt, Newton, foam};
use crate::domain::Vec2;
use crate::models::{AnyModel, Model};
use crate::state::{Numbers, Packing};

/// How far a step down from a saddle takes the particle that moves most, in units of the smallest radius.
const LEAVE: f64 = 0.02;

/// What became of a move.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Motion {
    /// No particle has moved by more than this (length); the model is to be solved.
    Moved(f64),
    /// The model is at the end of the move already.
    Solved,
}

/// Newton's method, for either kind of droplets.
#[derive(Clone, Debug, Default)]
struct Finish {
    linear: Newton,
    foam: foam::Newton,
}

/// A minimiser at work.
#[derive(Clone, Debug)]
pub(crate) struct Mover {
    fire: Fire,
    state: FireState,
    /// What finishes; `None` where FIRE goes all the way.
    newton: Option<Finish>,
}

impl Mover {
    /// A minimiser with the given bound of the time step, before its first move at `time`; `finishes` says whether Newton's
    /// method does.
    pub fn start(fire: Fire, finishes: bool, dt_max: f64, time: f64) -> Self {
        let state = FireState {
            time,
            ..FireState::start(&fire, dt_max)
        };
        Self::at(fire, finishes, state)
    }

    /// A minimiser that goes on from the numbers of a frame; `None` if they are another's.
    pub fn resume(fire: Fire, finishes: bool, numbers: &Numbers) -> Option<Self> {
        FireState::of(numbers).map(|state| Self::at(fire, finishes, state))
    }

    fn at(fire: Fire, finishes: bool, state: FireState) -> Self {
        Self {
            fire,
            state,
            newton: finishes.then(Finish::default),
        }
    }

    /// The time step (time).
    pub fn dt(&self) -> f64 {
        self.state.dt
    }

    /// The upper bound of the time step (time).
    pub fn dt_max(&self) -> f64 {
        self.state.dt_max
    }

    /// Another upper bound of the time step (time).
    pub fn set_dt_max(&mut self, dt_max: f64) {
        self.state.dt_max = dt_max;
        self.state.dt = self.state.dt.min(dt_max);
    }

    /// Simulated time, the sum of the time steps (time).
    pub fn time(&self) -> f64 {
        self.state.time
    }

    /// What it carries from one move to the next.
    pub fn numbers(&self) -> Numbers {
        self.state.numbers()
    }

    /// Whether it goes on from a saddle instead of ending there.
    pub fn leaves_saddles(&self) -> bool {
        self.newton.is_some()
    }

    /// One move, from the net forces of `model`, towards an `f_max` of `threshold` (units of γ).
    pub fn advance(
        &mut self,
        packing: &mut Packing,
        velocities: &mut [Vec2],
        model: &mut AnyModel,
        threshold: f64,
    ) -> Motion {
        if self.finish(packing, velocities, model, threshold) {
            return Motion::Solved;
        }
        let domain = packing.domain();
        let net = model.net_forces();
        let positions = packing.positions_mut();
        let moved = self
            .fire
            .advance(&mut self.state, net, velocities, positions, domain);
        Motion::Moved(moved)
    }

    /// One step of Newton's method, where it is its turn; `false` if the move is left to FIRE.
    ///
    /// After a step that is kept the particles are at rest, and FIRE would start anew.
    fn finish(
        &mut self,
        packing: &mut Packing,
        velocities: &mut [Vec2],
        model: &mut AnyModel,
        threshold: f64,
    ) -> bool {
        let Some(newton) = &mut self.newton else {
            return false;
        };
        let turns = &mut self.state.turns;
        // Only Newton's method leaves the particles at rest.
        let goes_on = turns.moves > 0 && velocities.iter().all(|v| *v == Vec2::zeros());
        let is_due = match model {
            AnyModel::MorseWitten(droplets) => Newton::is_due(droplets, goes_on),
            AnyModel::Foam(droplets) => foam::Newton::is_due(droplets, packing, goes_on),
            AnyModel::Disks(_) => false,
        };
        if !is_due {
            return false;
        }
        if turns.wait > 0 {
            turns.wait -= 1;
            return false;
        }
        let patient = turns.is_patient();
        let attempt = match model {
            AnyModel::MorseWitten(droplets) => {
                (newton.linear).advance(packing, droplets, threshold, patient)
            }
            AnyModel::Foam(droplets) => {
                (newton.foam).advance(packing, droplets, threshold, patient)
            }
            AnyModel::Disks(_) => Attempt::GivenUp,
        };
        let kept = attempt != Attempt::GivenUp;
        if kept {
            turns.succeed(attempt == Attempt::Halved);
            self.state.restart(&self.fire);
            velocities.fill(Vec2::zeros());
        } else {
            turns.fail();
        }
        kept
    }

    /// A step down from a saddle: the particles are displaced along `way_down`, the farthest by [`LEAVE`] of the smallest radius,
    /// and FIRE goes on from there, at rest, for as long as after a step of Newton's method that was given up.
    pub fn leave_saddle(
        &mut self,
        packing: &mut Packing,
        velocities: &mut [Vec2],
        way_down: &[Vec2],
    ) -> Motion {
        let longest = way_down.iter().fold(0.0, |m: f64, u| m.max(u.norm()));
        let moved = LEAVE * packing.smallest_radius();
        let domain = packing.domain();
        for (x, u) in packing.positions_mut().iter_mut().zip(way_down) {
            *x = domain.wrap(*x + u * (moved / longest));
        }
        self.state.turns.fail();
        self.state.restart(&self.fire);
        velocities.fill(Vec2::zeros());
        // Rounding may take the farthest a little farther.
        Motion::Moved(1.01 * moved)
    }
}
