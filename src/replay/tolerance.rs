//! Recordings of another revision of the bits: the same physics, within tolerances.
//!
//! Two revisions round otherwise, and a trajectory makes much of little. So each stretch is run from the recorded state before it, and
//! its end may be off by what the frames promise: contact forces are as exact as `f_max` makes sensible.

use super::balance::{AMPLIFIED, Worst};
use super::walk::Segment;
use crate::models::Model;
use crate::protocol::{RelaxError, Relaxation};
use crate::scene::Scene;
use crate::state::Frame;
use crate::state::Packing;

/// What two revisions may always differ by, relative to the largest force and to the mean radius.
const ALLOWED: f64 = 1e-9;

impl Segment {
    /// The run at the beginning of the segment, from what is recorded there.
    pub fn run_from_recorded(&self, scene: &Scene) -> Result<Relaxation, RelaxError> {
        match &self.from {
            Some(from) => Relaxation::resume(scene, self.packing_of(from), from.clone()),
            None if self.to.step == 0 => Relaxation::of_packing(scene, self.packing.clone()),
            None => Relaxation::resume(scene, self.packing.clone(), self.to.clone()),
        }
    }

    /// What the segment's end, and the metrics on the way, may be off by.
    pub fn allowed(&self, scene: &Scene) -> f64 {
        let begin = self.from.as_ref().unwrap_or(&self.to);
        let steps = (self.to.step - begin.step).max(1);
        let ratio = self.packing.largest_radius() / self.packing.smallest_radius();
        let promised = |frame| promised(scene, &self.packing_of(frame), frame);
        let promised = promised(begin).max(promised(&self.to));
        (AMPLIFIED * ratio * promised).max(ALLOWED) * steps as f64
    }
}

/// The residual of the contact law that a frame promises at its own `f_max`.
fn promised(scene: &Scene, packing: &Packing, frame: &Frame) -> f64 {
    let scene = scene.stage(frame.stage);
    scene.model().promise(packing, frame, scene.threshold)
}

/// How far two frames of one step are apart: positions by the mean radius, forces by the largest.
pub(super) fn deviation(packing: &Packing, a: &Frame, b: &Frame) -> f64 {
    let mean = packing.radii().iter().sum::<f64>() / packing.len() as f64;
    let domain = packing.domain();
    let pairs = a.positions.iter().zip(&b.positions);
    let moved = pairs.fold(0.0, |m: f64, (p, q)| {
        m.max(domain.minimum_image(p - q).norm())
    });
    let strongest = a.forces.iter().fold(0.0, |m: f64, f| m.max(f.abs()));
    let (mut i, mut j, mut apart) = (0, 0, 0.0_f64);
    while i < a.contacts.len() || j < b.contacts.len() {
        let (p, q) = (a.contacts.get(i), b.contacts.get(j));
        // A contact that is there on one side only bears no force on the other.
        let here = p.is_some_and(|p| q.is_none_or(|q| p <= q));
        let there = q.is_some_and(|q| p.is_none_or(|p| q <= p));
        let force = if here { a.forces[i] } else { 0.0 } - if there { b.forces[j] } else { 0.0 };
        apart = apart.max(force.abs());
        (i, j) = (i + usize::from(here), j + usize::from(there));
    }
    let apart = if strongest > 0.0 {
        apart / strongest
    } else {
        apart
    };
    apart.max(moved / mean)
}

/// Notes a recorded metric that is off from the run's, where it says something of forces as a whole; the others count contacts that may
/// bear next to none.
pub(super) fn note_metric(
    worst: &mut Worst,
    name: &str,
    here: f64,
    there: f64,
    allowed: f64,
    step: u64,
) {
    if matches!(name, "energy" | "pressure") {
        let scale = here.abs().max(there.abs());
        let off = if here == there {
            0.0
        } else {
            (here - there).abs() / scale
        };
        worst.of(off, allowed, step);
    }
}
