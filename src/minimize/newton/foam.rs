//! Newton's method for droplets that keep their area, whose normals and corner radii follow, too.
//!
//! As for Morse and Witten's droplets (see the [module](super)), all but positions is eliminated (`linear.rs` of the foam), and a step is kept if
//! it halves what is to be balanced; here that is forces and moments.

use super::step::{GROWTH, KEPT, Step};
use super::{Attempt, SWITCH};
use crate::models::Model;
use crate::models::droplet::foam::Foam;
use crate::models::droplet::foam::linear::Linear;
use crate::numerics::exact_sum::sum_of_forces;
use crate::state::Packing;

/// Newton's method with its buffers; they hold nothing that one step hands to the next.
#[derive(Clone, Debug, Default)]
pub(crate) struct Newton {
    linear: Linear,
    step: Step,
}

impl Newton {
    /// As [`is_due`](super::Newton::is_due) of the other droplets.
    pub(crate) fn is_due(foam: &Foam, packing: &Packing, goes_on: bool) -> bool {
        let most = if goes_on { GROWTH * SWITCH } else { SWITCH };
        let (number, sum) = sum_of_forces(foam.contacts(packing).forces);
        let left = foam.f_max().max(foam.moment() / packing.largest_radius());
        !foam.is_soft() && left * foam.line_tension() * number <= most * sum
    }

    /// As [`advance`](super::Newton::advance) of the other droplets.
    pub(crate) fn advance(
        &mut self,
        packing: &mut Packing,
        foam: &mut Foam,
        goal: f64,
        patient: bool,
    ) -> Attempt {
        let (start, positions) = (foam.clone(), packing.positions().to_vec());
        let attempt = self.attempt(packing, foam, goal, patient);
        if attempt == Attempt::GivenUp {
            *foam = start;
            packing.positions_mut().clone_from_slice(&positions);
        }
        attempt
    }

    fn attempt(
        &mut self,
        packing: &mut Packing,
        foam: &mut Foam,
        goal: f64,
        patient: bool,
    ) -> Attempt {
        let before = unbalanced(packing, foam);
        let (pairs, net) = (
            foam.contacts(packing).pairs.to_vec(),
            foam.net_forces().to_vec(),
        );
        if !self.propose(packing, foam, goal) {
            return Attempt::GivenUp;
        }
        let positions = packing.positions().to_vec();
        let part = self.step.make(packing, &positions);
        let followed = foam.follow(packing, &self.linear, &self.step.change, part);
        if followed.is_err() || foam.is_soft() {
            return Attempt::GivenUp;
        }
        let after = unbalanced(packing, foam);
        let is_same_set = pairs == foam.contacts(packing).pairs;
        if after <= KEPT * before {
            Attempt::Halved
        } else if patient
            && is_same_set
            && after <= GROWTH * before
            && self.step.is_nearer(&net, foam.net_forces())
        {
            Attempt::Nearer
        } else {
            Attempt::GivenUp
        }
    }

    /// The step from where `foam` is; `false` where there is none worth trying.
    fn propose(&mut self, packing: &Packing, foam: &Foam, goal: f64) -> bool {
        let contacts = foam.contacts(packing);
        let all: Vec<usize> = (0..contacts.pairs.len()).collect();
        let goal = (foam.f_max(), goal, foam.line_tension());
        let compliances;
        self.linear.set(foam, &all) && {
            compliances = self.linear.compliances().to_vec();
            let given = (&contacts, &compliances[..]);
            (self.step).find(&mut self.linear, given, foam.net_forces(), goal)
        }
    }
}

/// The root of the sum of squares of net forces and moments (units of γ, moments over the largest radius).
fn unbalanced(packing: &Packing, foam: &Foam) -> f64 {
    let (gamma, radius) = (foam.line_tension(), packing.largest_radius());
    let net = foam.net_forces().iter();
    let forces: f64 = net.map(|f| f.norm_squared() / (gamma * gamma)).sum();
    let moments: f64 = foam.moments_left().map(|m| m * m / (radius * radius)).sum();
    (forces + moments).sqrt()
}
