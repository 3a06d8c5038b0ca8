//! Newton's method on the balance of forces: how `minimizer = "fire+newton"` finishes.
//!
//! FIRE takes a packing through its rearrangements; what is left is smooth but for contacts that open and close, and there
//! Newton's method converges quadratically. A step solves the coupled problem in `(r, f)`, linearised at a frame,
//!
//! ```text
//! A Δf + (∂A/∂r Δr) f − ∂δ/∂r Δr = δ − A f,        ∂F/∂r Δr + ∂F/∂f Δf = −F
//! ```
//!
//! with `Δf` eliminated: `J Δr = −F`, `J` being the derivative of the net forces with the contact problem solved inside
//! (`linear.rs`). It is solved only as far as the step is worth (an inexact Newton method: R. S. Dembo, S. C. Eisenstat and
//! T. Steihaug, SIAM J. Numer. Anal. 19, 400 (1982)), by GMRES, preconditioned with the sparse Cholesky factor of the
//! stiffness of independent contacts (`stiffness.rs`): 10 to 30 products at N = 256 and 1024. Then the contact problem is
//! solved at the new positions from `f + Δf`, which is its answer to second order.
//!
//! `f_max` (γ) from about 1e-6 on, N = 256, by the test `newton_converges_quadratically_from_a_millionth`:
//!
//! | | |
//! | --- | --- |
//! | central, φ = 0.845 | 9.8e-7 → 6.2e-8 → 1.9e-12 → 1.0e-14 |
//! | central, φ = 0.86 | 9.7e-7 → 1.6e-10 → 8.2e-15 |
//! | central, φ = 0.90 | 9.3e-7 → 1.7e-8 → 2.2e-14 |
//! | central, φ = 1.00 | 9.9e-7 → 2.0e-10 → 7.2e-15 |
//! | gradient, φ = 0.90 | 9.2e-7 → 2.9e-10 → 2.8e-15 |
//!
//! **One step is one frame, and nothing is remembered.** No history of steps, no lagged factorisation: a step is a
//! function of positions, contacts and forces alone, so a run goes on from any frame with the same bits. (The ordering of
//! the factorisation is kept while the contacts stay; it is a function of the contacts.) Of the minimiser's state a step
//! changes the [`Turns`]; it takes no time, ends at rest, and FIRE would start anew from there.
//!
//! **Contact sets.** The linear problem holds for one set of contacts. When a step ends in another one and `|F|` has not
//! fallen, the step is computed anew from the same positions on the smooth piece of that set, with the forces that solve
//! `A f = δ` there whatever their signs. A rattler that a moving neighbour just reaches, and a contact with `f ≈ 0`, are
//! settled so at the first or second try, where a shortened step would flip between two sets.
//!
//! **Nothing is forced.** `F` need not be the gradient of anything, so a step is judged by `|F|`, the root of the sum of
//! squares of the net forces: it is kept if `|F|` falls to one half or less. A step along a soft mode leaves forces of second
//! order in stiff directions, which the next step takes away; it is kept as well, some times on end, if the contacts stay
//! and the distance `|K̃⁻¹ F|` that the forces stand for falls to one half. A step against the forces (`F·Δr ≤ 0`) would climb
//! to a saddle and is not tried, nor one whose linear problem is not solved. A step given up leaves the frame as it was;
//! FIRE makes the move instead, and 200 moves and more before the next attempt, up to 800 after repeated failure. Rattlers
//! without contacts have `F = 0` and stay where they are; a packing that comes apart ends with `f_max = 0` like with FIRE
//! alone.
//!
//! **Round-off.** The forces of a step that was small enough are taken as they come: they balance to round-off (`f_max` of
//! 1e-14 and less) and fulfil the contact law to 1e-12. Solving the contact problem anew would spoil that, because the
//! overlaps carry the rounding of the positions (half a unit in the last place of the box's side, 4e-15 at N = 1024),
//! whose forces do not balance better than some 1e-13.

pub(crate) mod foam;
mod step;
mod stiffness;

use crate::domain::Vec2;
use crate::models::Model;
use crate::models::droplet::contact::ContactLaw;
use crate::models::droplet::contact::solver::ConjugateGradient;
use crate::models::droplet::linear::Linear;
use crate::models::droplet::{MorseWitten, NetForces};
use crate::numerics::exact_sum::sum_of_forces;
use crate::state::Packing;

use step::{GROWTH, KEPT, Step};
pub(crate) use stiffness::Stiffness;

/// How FIRE and Newton's method take turns: part of the minimiser's state.
///
/// ```
/// use softjam::minimize::newton::Turns;
/// assert_eq!(Turns::default().moves, 0);
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Turns {
    /// Steps of Newton's method that were kept.
    pub moves: u32,
    /// Attempts since the last one that halved `|F|`: given up, or kept all the same.
    pub failures: u32,
    /// Moves that FIRE has still to make before the next attempt.
    pub wait: u32,
}

impl Turns {
    /// An attempt was given up: FIRE's turn, the longer the more often that has happened.
    pub(crate) fn fail(&mut self) {
        self.wait = PAUSE << self.failures.min(LONGEST_PAUSE);
        self.failures = self.failures.saturating_add(1);
    }

    /// An attempt was kept, since it halved `|F|` or only since it came nearer.
    pub(crate) fn succeed(&mut self, halved: bool) {
        self.moves = self.moves.saturating_add(1);
        self.failures = if halved {
            0
        } else {
            self.failures.saturating_add(1)
        };
    }

    /// Whether a step that does not halve `|F|` may be kept: not many times on end.
    pub(crate) fn is_patient(self) -> bool {
        self.failures < PATIENCE
    }
}

/// Moves of FIRE after an attempt given up, doubled with each further one, up to 2^`LONGEST_PAUSE` times. An attempt takes as
/// long as some 200 moves at N = 1024; with 50 moves at first two of
/// twelve runs at φ = 0.86 take 14 and 31 % longer, two 5 % less, the others as long.
const PAUSE: u32 = 200;
const LONGEST_PAUSE: u32 = 2;

/// Newton's method is tried when `f_max` is not above this fraction of the mean contact force, whatever the scene.
///
/// Measured to `f_max` of 1e-13, N = 256, ten seeds each: with 2e-3, 1e-3 and 5e-4 a run at φ = 0.86 takes 1173, 1222 and 1256
/// steps in all with 0.6, 0.4 and 0.2 attempts given up, at φ = 1.0 it takes 312, 335 and 363 with 0.5, 0.3 and 0.3. To 1e-12,
/// N = 1024, five seeds, φ = 0.86: 2200, 2176 and 2014 with 2.6, 1.8 and 0.2.
const SWITCH: f64 = 5e-4;

/// How many attempts may fail to halve `|F|`, one after the other, before only halving counts.
const PATIENCE: u32 = 6;

/// How often a step is computed anew on the contact set that the last one ran into. Of 88 steps that were kept in 32 runs at
/// N = 1024, φ = 0.86, 74 were computed once, 11 twice, 3 three times and none four times.
const CORRECTIONS: u32 = 2;

/// A step that runs into a contact set which differs in more contacts than this has left the range of the linear problem. Of
/// 40 such runs, steps into sets that differ in 1, 2, 3 and 4 contacts were kept in the end 10 of 13, 5 of 11, 3 of 7 and 0 of 5
/// times.
const MOST_EXCHANGED: usize = 3;

/// What became of an attempt.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Attempt {
    /// Kept: `|F|` is half of what it was, or less.
    Halved,
    /// Kept: `|F|` is not, but the distance that it stands for is.
    Nearer,
    /// Not kept.
    GivenUp,
}

/// Newton's method with its buffers; they hold nothing that one step hands to the next.
#[derive(Clone, Debug, Default)]
pub(crate) struct Newton {
    linear: Linear,
    step: Step,
    pairs: Vec<[u32; 2]>,
    forces: Vec<f64>,
    guess: Vec<f64>,
    positions: Vec<Vec2>,
    net: Vec<Vec2>,
    piece: Vec<[u32; 2]>,
    solver: ConjugateGradient,
}

impl Newton {
    /// Whether `f_max` is low enough for an attempt; right behind a step that was kept (`goes_on`) it may have grown.
    pub(crate) fn is_due(droplets: &MorseWitten, goes_on: bool) -> bool {
        let most = if goes_on { GROWTH * SWITCH } else { SWITCH };
        let law = droplets.law();
        let (number, sum) = sum_of_forces(law.numbered().forces);
        droplets.f_max() * law.line_tension() * number <= most * sum
    }

    /// Tries one step from the contacts and forces of `droplets` at the positions of `packing`.
    ///
    /// If the step is kept, both are at its end; otherwise they are as they were. `goal` is the `f_max` (units of γ) below which
    /// nothing more is asked for; `patient` allows [`Attempt::Nearer`].
    pub(crate) fn advance(
        &mut self,
        packing: &mut Packing,
        droplets: &mut MorseWitten,
        goal: f64,
        patient: bool,
    ) -> Attempt {
        let f_max = droplets.f_max();
        let (law, form, net) = droplets.parts();
        let attempt = self.attempt(packing, law, form, net, (f_max, goal), patient);
        droplets.balance(packing);
        attempt
    }

    fn attempt(
        &mut self,
        packing: &mut Packing,
        law: &mut ContactLaw,
        form: &mut NetForces,
        net: &[Vec2],
        (f_max, goal): (f64, f64),
        patient: bool,
    ) -> Attempt {
        self.pairs.clear();
        self.pairs.extend_from_slice(law.contacts().pairs);
        self.forces.clear();
        self.forces.extend_from_slice(law.contacts().forces);
        self.positions.clear();
        self.positions.extend_from_slice(packing.positions());
        self.net.clear();
        self.net.extend_from_slice(net);
        let before = length(net);
        for correction in 0..=CORRECTIONS {
            if !self.propose(packing, law, form, (f_max, goal)) {
                break;
            }
            self.piece.clear();
            self.piece.extend_from_slice(law.contacts().pairs);
            let part = self.step.make(packing, &self.positions);
            self.guess.clear();
            let forces = law.contacts().forces.iter();
            self.guess
                .extend(forces.zip(&self.step.change).map(|(f, df)| f + part * df));
            if !self.settle(packing, law) {
                break;
            }
            form.evaluate(&law.contacts(), packing, law.line_tension(), &mut self.net);
            if length(&self.net) <= KEPT * before {
                return Attempt::Halved;
            }
            let exchanged = exchanged(&self.piece, law.contacts().pairs);
            let is_near = length(&self.net) <= GROWTH * before;
            if patient && exchanged == 0 && is_near && self.step.is_nearer(net, &self.net) {
                return Attempt::Nearer;
            }
            packing.positions_mut().copy_from_slice(&self.positions);
            // A set whose step leads back to the first one would lead here again.
            let returns = correction > 0 && law.contacts().pairs == self.pairs;
            if correction == CORRECTIONS
                || returns
                || !(1..=MOST_EXCHANGED).contains(&exchanged)
                || !self.change_piece(packing, law)
            {
                break;
            }
            form.evaluate(&law.contacts(), packing, law.line_tension(), &mut self.net);
        }
        packing.positions_mut().copy_from_slice(&self.positions);
        law.restore(packing, &self.pairs, &self.forces);
        Attempt::GivenUp
    }

    /// The contact law at the positions of `packing`, from the contacts of `piece` with the forces of `guess`; `false` if
    /// there is no answer.
    ///
    /// Behind a step that was small enough the guess *is* the answer, and the balance that it was made for would only
    /// suffer from solving again: positions are rounded, and the overlaps with them.
    fn settle(&self, packing: &Packing, law: &mut ContactLaw) -> bool {
        if self.guess.iter().all(|f| *f > 0.0) {
            law.restore(packing, &self.piece, &self.guess);
            if law.residual() <= law.accepted_residual().min(EXACT) {
                return true;
            }
        }
        law.solve(packing, &self.piece, &self.guess).is_ok()
            && law.residual() <= law.accepted_residual()
    }

    /// The step ran into the contact set that `law` has now: takes this set, at the positions from which the step was made
    /// and with the forces that solve `A f = δ` there, whatever their signs. `false` if they cannot be had.
    fn change_piece(&mut self, packing: &Packing, law: &mut ContactLaw) -> bool {
        self.piece.clear();
        self.piece.extend_from_slice(law.contacts().pairs);
        self.guess.clear();
        self.guess.extend_from_slice(law.contacts().forces);
        law.restore(packing, &self.piece, &self.guess);
        let overlaps = law.contacts().overlaps;
        let scale = overlaps.iter().fold(0.0, |m: f64, d| m.max(d.abs()));
        let solved = self
            .solver
            .solve(law.matrix(), overlaps, &mut self.guess, EXACT * scale);
        if solved.is_ok() {
            law.restore(packing, &self.piece, &self.guess);
        }
        solved.is_ok()
    }

    /// The step from the contacts of `law`, whose net forces are in `net`; `false` where there is none worth trying.
    fn propose(
        &mut self,
        packing: &Packing,
        law: &ContactLaw,
        form: &NetForces,
        (f_max, goal): (f64, f64),
    ) -> bool {
        let contacts = law.contacts();
        let mut linear = self.linear.at(form.form(), law, packing);
        let given = (&contacts, law.matrix().diagonal());
        let goal = (f_max, goal, law.line_tension());
        self.step.find(&mut linear, given, &self.net, goal)
    }
}

/// The residual of the contact law, relative to the largest overlap, below which forces are taken as they are.
const EXACT: f64 = 1e-12;

/// In how many pairs two lists, both ascending, differ.
fn exchanged(a: &[[u32; 2]], b: &[[u32; 2]]) -> usize {
    let missing = |a: &[[u32; 2]], b: &[[u32; 2]]| {
        let lacks = |p: &&[u32; 2]| b.binary_search(p).is_err();
        a.iter().filter(lacks).count()
    };
    missing(a, b) + missing(b, a)
}

fn length(net: &[Vec2]) -> f64 {
    net.iter().map(Vec2::norm_squared).sum::<f64>().sqrt()
}
