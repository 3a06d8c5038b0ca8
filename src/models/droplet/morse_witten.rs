//! The Morse–Witten model: the contact problem of the droplets and the net forces of its answer.

use super::contact::{ACCEPTED, ContactError, ContactLaw};
use super::form::{Form, NetForces};
use super::frequency::largest_frequency;
use crate::contacts::{Contacts, largest_force};
use crate::domain::Vec2;
use crate::models::{Check, Goal, Model, due};
use crate::state::{Frame, FrameError, Packing};

/// `dt_max ω_max`. The limit of stability is 2 for the linear problem with its contacts held fixed. Geometric means of the steps
/// with 1.0, 1.2 and 1.3 (the first with α_start = 0.25, the others with 0.1), N = 1024: 3184, 2654, 2573 at φ = 0.86 (96 seeds);
/// 6293, 4817, 4641 at 0.845, 1322, 1150, 1102 at 0.90, and 672, 690, 659 at 0.95 (24 seeds). With α_start = 0.25, 1.4 takes twice
/// as many as 1.2.
const DT_MAX_TIMES_OMEGA: f64 = 1.2;

/// Droplets of the Morse–Witten model: [`ContactLaw`] and the net forces of one [`Form`].
///
/// ```
/// use softjam::models::{Model, droplet::{Form, MorseWitten, contact::ContactLaw}};
/// let droplets = MorseWitten::new(ContactLaw::default(), Form::Gradient);
/// assert_eq!((droplets.form(), droplets.f_max()), (Form::Gradient, 0.0));
/// ```
#[derive(Clone, Debug)]
pub struct MorseWitten {
    law: ContactLaw,
    forces: NetForces,
    net: Vec<Vec2>,
    f_max: f64,
}

impl MorseWitten {
    /// Droplets that fulfil `law` and are moved by forces of the given form.
    #[must_use]
    pub fn new(law: ContactLaw, form: Form) -> Self {
        Self {
            law,
            forces: NetForces::new(form),
            net: Vec::new(),
            f_max: 0.0,
        }
    }

    /// The contact law with its last answer and its count of work.
    #[must_use]
    pub fn law(&self) -> &ContactLaw {
        &self.law
    }

    /// The form of the net forces.
    #[must_use]
    pub fn form(&self) -> Form {
        self.forces.form()
    }

    /// The contact law, the net forces' buffers and the net forces, for a minimiser that solves contacts and positions together;
    /// [`balance`](Self::balance) has to follow.
    pub(crate) fn parts(&mut self) -> (&mut ContactLaw, &mut NetForces, &[Vec2]) {
        (&mut self.law, &mut self.forces, &self.net)
    }

    /// Net forces of the answer that the law has.
    pub(crate) fn balance(&mut self, packing: &Packing) {
        self.net.resize(packing.len(), Vec2::zeros());
        self.forces.evaluate_law(&self.law, packing, &mut self.net);
        self.f_max = largest_force(&self.net) / self.law.line_tension();
    }
}

impl Model for MorseWitten {
    fn line_tension(&self) -> f64 {
        self.law.line_tension()
    }

    /// The contact problem, to the tolerance that is due at the `f_max` that its forces give.
    ///
    /// The tolerance at first is that of the frame before; it is a function of that frame, so a run that is taken up there
    /// takes the same way.
    fn solve(&mut self, packing: &Packing, goal: Goal) -> Result<(), ContactError> {
        let mut due = goal.due(goal.f_max);
        self.law.solve_within(packing, due, goal.moved)?;
        self.balance(packing);
        // The full tolerance, due at 0, keeps every promise; a frame that might be the last is always solved to it.
        while let Some(tighter) = goal.tighter(due, self.f_max, || {
            self.law.residual() <= self.promised_residual(packing, goal.threshold)
        }) {
            due = tighter;
            self.law.tighten(packing, due)?;
            self.balance(packing);
        }
        Ok(())
    }

    fn restore(&mut self, packing: &Packing, frame: &Frame) -> Result<(), FrameError> {
        self.law.restore(packing, &frame.contacts, &frame.forces);
        self.balance(packing);
        Ok(())
    }

    fn net_forces(&self) -> &[Vec2] {
        &self.net
    }

    fn f_max(&self) -> f64 {
        self.f_max
    }

    fn contacts<'a>(&'a self, _: &Packing) -> Contacts<'a> {
        self.law.contacts()
    }

    fn copy_contacts(&self, _: &Packing, pairs: &mut Vec<[u32; 2]>, forces: &mut Vec<f64>) {
        self.law.copy_contacts(pairs, forces);
    }

    fn torques(&self) -> &[f64] {
        self.forces.torques()
    }

    fn residual(&self) -> f64 {
        self.law.residual()
    }

    fn accepted_residual(&self) -> f64 {
        self.law.accepted_residual()
    }

    /// Sixteen times the [tolerance](super::contact::due_tolerance) at the frame's `f_max`, at the full tolerance if `f_max` is
    /// not above the threshold.
    fn promised_residual(&self, packing: &Packing, threshold: f64) -> f64 {
        ACCEPTED * self.law.tolerance_at(packing, due(self.f_max, threshold))
    }

    /// `1.2/ω_max`.
    fn longest_time_step(&mut self, packing: &Packing) -> Result<f64, ContactError> {
        Ok(DT_MAX_TIMES_OMEGA / largest_frequency(packing, &mut self.law, 20)?)
    }

    fn promise(&self, packing: &Packing, frame: &Frame, threshold: f64) -> f64 {
        self.promise_of(packing, frame, threshold)
    }

    fn check(&self, packing: &Packing, frame: &Frame, threshold: f64) -> Check {
        self.check_frame(packing, frame, threshold)
    }
}
