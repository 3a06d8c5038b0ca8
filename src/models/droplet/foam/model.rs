//! [`Foam`] as a [`Model`]: what a step does with tilts and forces, and what a frame remembers.

use super::compliance::Compliance;
use super::contact_problem::violation;
use super::tilts::LARGEST;
use super::{DT_MAX, Films, Foam, HARDENS};
use crate::contacts::Contacts;
use crate::domain::Vec2;
use crate::models::droplet::contact::{ACCEPTED, ContactError, due_tolerance};
use crate::models::{Check, Goal, Model, due};
use crate::state::{Frame, FrameError, Packing};

impl Model for Foam {
    fn line_tension(&self) -> f64 {
        self.line_tension
    }

    /// Far from balance the tilts make one step between two contact problems. Where no frame is at hand, or the goal is
    /// [`Goal::EXACT`], they are solved for.
    fn solve(&mut self, packing: &Packing, goal: Goal) -> Result<(), ContactError> {
        if goal == Goal::EXACT || self.net.len() != packing.len() {
            return self.settle(packing);
        }
        self.tilting.step(&self.lines, &self.state, &mut self.tilts);
        self.set_lines(packing, goal.moved);
        if goal.f_max < HARDENS {
            self.state.set_give(0.0);
        }
        let mut next = Some(goal.due(goal.f_max));
        while let Some(due) = next {
            let tolerance = self.due(packing, due);
            self.find_forces(packing, tolerance)?;
            self.balance(packing);
            next = goal.tighter(due, self.f_max, || {
                self.residual() <= self.promised_residual(packing, goal.threshold)
            });
        }
        Ok(())
    }

    fn restore(&mut self, packing: &Packing, frame: &Frame) -> Result<(), FrameError> {
        const MEMORY: FrameError = FrameError::Foreign {
            what: "a memory that is not that of its droplets",
        };
        self.set_lines(packing, f64::INFINITY);
        let lines = self.lines.len();
        let dents = match self.films {
            Films::Straight => 0,
            Films::Arcs => packing.len(),
        };
        let parts = frame.memory.split_at_checked(lines);
        let parts = parts.and_then(|(tilts, rest)| Some((tilts, rest.split_at_checked(dents)?)));
        let Some((tilts, (dents, give))) = parts else {
            return Err(MEMORY);
        };
        let give = match give {
            [] => 0.0,
            [give] if *give > 0.0 && give.is_finite() => *give,
            _ => return Err(MEMORY),
        };
        let possible = tilts.iter().all(|tilt| tilt.abs() <= LARGEST);
        let mut sensible = dents.iter().zip(packing.radii());
        if !possible || !sensible.all(|(d, radius)| *d < *radius && *d > -10.0 * radius) {
            return Err(MEMORY);
        }
        tilts.clone_into(&mut self.tilts);
        self.state.set_dents(dents);
        self.state.set_give(give);
        self.forces.fill(0.0);
        let mut contacts = frame.contacts.iter().zip(&frame.forces).peekable();
        for (pair, force) in self.lines.pairs().iter().zip(&mut self.forces) {
            if let Some((_, f)) = contacts.next_if(|(of, _)| *of == pair) {
                *force = *f;
            }
        }
        self.lines.turn(&self.tilts);
        let given = (&self.lines, packing.radii());
        let forces = (&self.forces[..], self.line_tension);
        let holds = contacts.next().is_none() && frame.forces.iter().all(|f| *f > 0.0);
        if !holds
            || !self
                .state
                .evaluate(given, forces, self.films, f64::INFINITY)
        {
            return Err(FrameError::Foreign {
                what: "forces that no droplets can bear",
            });
        }
        self.state.find_midpoints(&self.lines);
        self.balance(packing);
        Ok(())
    }

    fn copy_memory(&self, memory: &mut Vec<f64>) {
        self.tilts.clone_into(memory);
        if self.films == Films::Arcs {
            memory.extend_from_slice(self.state.dents());
        }
        memory.extend((self.state.give() > 0.0).then_some(self.state.give()));
    }

    fn net_forces(&self) -> &[Vec2] {
        &self.net
    }

    fn f_max(&self) -> f64 {
        self.f_max
    }

    /// The largest `f |T|`.
    fn moment(&self) -> f64 {
        self.moments_left().fold(0.0, |m: f64, x| m.max(x.abs()))
    }

    fn contacts<'a>(&'a self, _: &Packing) -> Contacts<'a> {
        self.contacts.view()
    }

    fn residual(&self) -> f64 {
        let overlaps = self.contacts.view().overlaps.iter();
        let scale = overlaps.fold(0.0, |m: f64, d| m.max(d.abs()));
        let violated = violation(self.state.gaps(), &self.forces);
        if scale > 0.0 {
            violated / scale
        } else {
            violated
        }
    }

    fn accepted_residual(&self) -> f64 {
        // Soft contacts are on the way to hard ones.
        if self.state.give() > 0.0 {
            return -1.0;
        }
        ACCEPTED * self.tolerance
    }

    fn promised_residual(&self, packing: &Packing, threshold: f64) -> f64 {
        let due = due(self.f_max, threshold);
        ACCEPTED * due_tolerance(packing, self.contacts.view().overlaps, due, self.tolerance)
    }

    fn longest_time_step(&mut self, packing: &Packing) -> Result<f64, ContactError> {
        let mut compliance = Compliance::default();
        compliance.find(&self.lines, &self.state);
        let mut stiffness = vec![0.0; packing.len()];
        for (c, pair) in self.lines.pairs().iter().enumerate() {
            if self.forces[c] > 0.0 {
                let compliance = compliance.diagonal()[c];
                for p in pair.map(|p| p as usize) {
                    stiffness[p] += self.line_tension / compliance;
                }
            }
        }
        // A packing without contacts moves as one contact would let it.
        let one = self.line_tension / packing.largest_radius();
        let stiffest = stiffness.into_iter().fold(one, f64::max);
        Ok(DT_MAX / (2.0 * stiffest).sqrt())
    }

    fn stiffens(&self) -> bool {
        true
    }

    fn promise(&self, packing: &Packing, frame: &Frame, threshold: f64) -> f64 {
        let mut restored = self.clone();
        match restored.restore(packing, frame) {
            Ok(()) => restored.promised_residual(packing, threshold),
            Err(_) => 0.0,
        }
    }

    fn check(&self, packing: &Packing, frame: &Frame, threshold: f64) -> Check {
        self.check_frame(packing, frame, threshold)
    }
}
