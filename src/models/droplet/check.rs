//! A frame of droplets held against the contact law by their contours, without `A` and without a solver.
//!
//! The contour of a particle is Saitoh (1)–(3), `ρ_i(θ) = R_i + (R_i/2πγ) Σ_k f_k g(θ − θ_k)`. Forces that push where the gap
//! `r_ij − ρ_i(θ_j) − ρ_j(θ_i)` vanishes, and gaps that are not negative elsewhere, are the one answer of the contact problem.

use super::MorseWitten;
use super::contact::{ACCEPTED, Rule, due_tolerance};
use super::form::NetForces;
use super::kernel::{G_AT_CONTACT, G_MAX, g};
use crate::contacts::{Contacts, FrameContacts, largest_force};
use crate::domain::Vec2;
use crate::models::check::worse;
use crate::models::{Check, Model};
use crate::neighbors::NeighborList;
use crate::state::{Frame, Packing};
use core::f64::consts::PI;

impl MorseWitten {
    /// The residual of the contact law that the frame promises; see [`Model::promise`].
    pub(super) fn promise_of(&self, packing: &Packing, frame: &Frame, threshold: f64) -> f64 {
        let contacts = FrameContacts::of(packing, frame);
        self.promise(packing, &contacts.view(), threshold).1
    }

    /// What the frame's forces are worth; see [`Model::check`].
    pub(super) fn check_frame(&self, packing: &Packing, frame: &Frame, threshold: f64) -> Check {
        let contacts = FrameContacts::of(packing, frame);
        let contacts = contacts.view();
        let gamma = self.line_tension();
        let (f_max, promised) = self.promise(packing, &contacts, threshold);
        let contours = Contours::of(packing, &contacts, gamma);
        let of_contacts = contacts.pairs.iter().map(|pair| contours.gap(*pair));
        let residual = of_contacts.fold(0.0, |m: f64, gap| worse(m, gap.abs()));
        // Wider contours than the largest particle is large belong to forces that do not fulfil eq. (4).
        let reach = contours.reach().min(packing.largest_radius());
        let mut neighbors = NeighborList::new();
        neighbors.update(packing, 2.0 * reach, 0.0);
        let apart = |pair: &&[u32; 2]| contacts.pairs.binary_search(pair).is_err();
        let others = neighbors.pairs().iter().filter(apart);
        let overlap = others.fold(0.0, |m: f64, pair| worse(m, -contours.gap(*pair)));
        Check::of(
            &contacts,
            packing.domain(),
            gamma,
            (promised, f_max),
            (residual, overlap),
        )
    }

    /// `f_max` of these contacts (units of γ), and the residual of the contact law that it promises where balance is asked for to
    /// `threshold` (units of γ).
    fn promise(&self, packing: &Packing, contacts: &Contacts<'_>, threshold: f64) -> (f64, f64) {
        let gamma = self.line_tension();
        let mut net = vec![Vec2::zeros(); packing.len()];
        NetForces::new(self.form()).evaluate(contacts, packing, gamma, &mut net);
        let f_max = largest_force(&net) / gamma;
        let follows = f_max > threshold && self.law().rule() == Rule::Complementarity;
        let due = if follows { f_max } else { 0.0 };
        let tolerance = self.law().accepted_residual() / ACCEPTED;
        let due = due_tolerance(packing, contacts.overlaps, due, tolerance);
        (f_max, ACCEPTED * due)
    }
}

/// The contours of a frame, by the contacts that shape them.
struct Contours<'a> {
    packing: &'a Packing,
    /// `1/2πγ` (1/force).
    per_force: f64,
    /// Angle and force of each contact of each particle.
    pushes: Vec<Vec<(f64, f64)>>,
}

impl<'a> Contours<'a> {
    fn of(packing: &'a Packing, contacts: &Contacts<'_>, line_tension: f64) -> Self {
        let mut pushes = vec![Vec::new(); packing.len()];
        let forces = contacts.pairs.iter().zip(contacts.forces);
        for ((&[i, j], &f), n) in forces.zip(contacts.normals) {
            pushes[i as usize].push((libm::atan2(-n.y, -n.x), f));
            pushes[j as usize].push((libm::atan2(n.y, n.x), f));
        }
        Self {
            packing,
            per_force: 0.5 / (PI * line_tension),
            pushes,
        }
    }

    /// `ρ_p(θ) − R_p` (length).
    fn bulge(&self, p: u32, angle: f64) -> f64 {
        let pushes = self.pushes[p as usize].iter();
        let bulge: f64 = pushes.map(|(at, f)| f * g(angle - at)).sum();
        self.packing.radii()[p as usize] * (self.per_force * bulge)
    }

    /// The gap between two contours on the line of their centres, from the gap of the disks: where forces are weak nothing is lost to
    /// the rounding of radii (length).
    fn gap(&self, [i, j]: [u32; 2]) -> f64 {
        let apart = self.packing.separation(i as usize, j as usize);
        let seen_by_i = libm::atan2(-apart.y, -apart.x);
        let seen_by_j = libm::atan2(apart.y, apart.x);
        let [r_i, r_j] = [i, j].map(|p| self.packing.radii()[p as usize]);
        let overlap = r_i + r_j - apart.norm();
        -overlap - self.bulge(i, seen_by_i) - self.bulge(j, seen_by_j)
    }

    /// No contour reaches beyond its undeformed circle by more than this (length).
    fn reach(&self) -> f64 {
        let reach = |(pushes, r): (&Vec<(f64, f64)>, &f64)| {
            let most = pushes
                .iter()
                .map(|(_, f)| (f * G_MAX).max(f * G_AT_CONTACT));
            r * self.per_force * most.sum::<f64>()
        };
        let reaches = self.pushes.iter().zip(self.packing.radii()).map(reach);
        reaches.fold(0.0, f64::max)
    }
}
