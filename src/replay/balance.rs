//! Is the recorded packing in force balance, and do its contacts fulfil the contact law?
//!
//! Each recorded frame is judged from its positions and the radii alone: the contact problem is solved anew, from no guess,
//! and what comes out is compared with what was recorded. That the forces solve `A f = δ` and that no other pair overlaps
//! is checked by sums of its own over a freshly assembled `A`, not by the solver's word.

use crate::contact::list::ContactList;
use crate::contact::matrix::{ContactMatrix, Geometry};
use crate::contact::{ContactError, ContactLaw, FrameContacts, Rule};
use crate::domain::Vec2;
use crate::force::{Observables, largest_force, net_forces};
use crate::frame::Frame;
use crate::packing::Packing;
use crate::record::Outcome;
use crate::scene::Scene;

/// The worst of each residual over the frames, with the step at which it occurred.
///
/// Residuals of lengths are relative to the largest `|δ|` among the frame's contacts, those of forces to its largest force.
///
/// ```
/// let worst = softjam::replay::Worst::default();
/// assert_eq!((worst.value, worst.step), (0.0, 0));
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Worst {
    /// The largest value.
    pub value: f64,
    /// The step at which it occurred.
    pub step: u64,
}

impl Worst {
    fn of(&mut self, value: f64, step: u64) {
        // A NaN is worse than any number, and stays.
        if value > self.value || value.is_nan() {
            *self = Self { value, step };
        }
    }
}

/// What the frames seen so far are worth.
///
/// # Example
///
/// ```
/// use softjam::{relax::Relaxation, replay::Balance, scene::Scene};
///
/// let scene = Scene { particles: 48, phi: 0.9, ..Scene::default() };
/// let mut run = Relaxation::new(&scene).unwrap();
/// let mut balance = Balance::new(&scene);
/// balance.check(run.packing(), &run.frame(), &[("energy".to_owned(), run.observables().energy)]);
/// assert!(balance.agrees());
/// ```
#[derive(Clone, Debug)]
pub struct Balance {
    law: ContactLaw,
    rule: Rule,
    threshold: f64,
    /// `max |A f − δ|` of the recorded forces: Saitoh (4).
    pub equation_4: Worst,
    /// The deepest overlap of deformed contours among pairs that are no contacts, `−gap`.
    pub overlap: Worst,
    /// The largest pull `−f` among the recorded forces; `f · gap = 0` since contacts have no gap and no other pair has a force.
    pub pull: Worst,
    /// The largest difference between recorded forces and those of the contact problem solved anew.
    pub forces: Worst,
    /// The largest relative difference between recorded energy, pressure and those of the contact problem solved anew.
    pub energy_and_pressure: Worst,
    /// Pairs that are contacts on one side only.
    pub contacts: Worst,
    /// Frames seen.
    pub frames: u64,
    /// The step of the last frame, and its `f_max` from positions alone (units of γ).
    pub last: Option<(u64, f64)>,
    /// The first frame whose contact problem had no answer.
    pub failed: Option<(u64, ContactError)>,
}

/// How far a residual may be from zero: the solver's tolerance, its amplification by a matrix of condition 6, and round-off.
const ALLOWED: f64 = 1e-9;

impl Balance {
    /// Nothing seen yet of a recording of `scene`.
    ///
    /// See the example of [`Balance`].
    #[must_use]
    pub fn new(scene: &Scene) -> Self {
        Self {
            law: ContactLaw::new(
                Rule::Complementarity,
                scene.contact_solver,
                scene.line_tension,
                scene.contact_tolerance.min(1e-12),
            ),
            rule: scene.contact_rule,
            threshold: scene.threshold,
            equation_4: Worst::default(),
            overlap: Worst::default(),
            pull: Worst::default(),
            forces: Worst::default(),
            energy_and_pressure: Worst::default(),
            contacts: Worst::default(),
            frames: 0,
            last: None,
            failed: None,
        }
    }

    /// Looks at a frame; `packing` has its positions, `metrics` are those recorded at its step.
    ///
    /// # Panics
    ///
    /// If frame and packing do not belong together; a [`Recording`](super::Recording) gives only such that do.
    ///
    /// See the example of [`Balance`].
    pub fn check(&mut self, packing: &Packing, frame: &Frame, metrics: &[(String, f64)]) {
        let step = frame.step;
        self.frames += 1;
        let recorded = FrameContacts::of(packing, frame);
        let view = recorded.view();
        let scale = view.overlaps.iter().fold(0.0, |m: f64, d| m.max(d.abs()));
        let relative = |x: f64| if scale > 0.0 { x / scale } else { x };
        // Eq. (4), row by row.
        if let Some(list) = ContactList::new(packing.len(), view.pairs) {
            let geometry = Geometry::of(packing, &list);
            let gamma = self.law.line_tension();
            let matrix = ContactMatrix::of(packing, &list, &geometry, gamma);
            for (c, delta) in view.overlaps.iter().enumerate() {
                let row: f64 = matrix.row(c).map(|(k, a)| a * view.forces[k]).sum();
                let residual = matrix.diagonal()[c] * view.forces[c] + row - delta;
                self.equation_4.of(relative(residual.abs()), step);
            }
            self.check_gaps(packing, &list, &geometry, view.forces, scale, step);
        }
        let strongest = view.forces.iter().fold(0.0, |m: f64, f| m.max(f.abs()));
        for f in view.forces {
            self.pull
                .of(if strongest > 0.0 { -f / strongest } else { -f }, step);
        }
        let mut net = vec![Vec2::zeros(); packing.len()];
        net_forces(&view, &mut net);
        self.last = Some((step, largest_force(&net) / self.law.line_tension()));
        match self.law.solve(packing, &[], &[]) {
            Ok(()) => {
                self.compare(view.pairs, view.forces, strongest, step);
                self.compare_metrics(packing, metrics, step);
            }
            Err(error) => self.failed = self.failed.take().or(Some((step, error))),
        }
    }

    /// Every pair of particles whose contours could meet, whether or not any list names it.
    fn check_gaps(
        &mut self,
        packing: &Packing,
        list: &ContactList,
        geometry: &Geometry,
        forces: &[f64],
        scale: f64,
        step: u64,
    ) {
        let gamma = self.law.line_tension();
        let mut neighbors = crate::neighbors::NeighborList::new();
        // Wider bulges than the largest particle is large are left to the comparison with the forces found anew.
        neighbors.update(packing, 2.0 * packing.largest_radius(), 0.0);
        for &[i, j] in neighbors.pairs() {
            if list.partners(i as usize).binary_search(&j).is_err() {
                let gap = geometry.gap(packing, gamma, forces, i as usize, j as usize);
                let overlap = if scale > 0.0 { -gap / scale } else { -gap };
                self.overlap.of(overlap, step);
            }
        }
    }

    /// Recorded contacts and forces against those found anew.
    fn compare(&mut self, pairs: &[[u32; 2]], forces: &[f64], strongest: f64, step: u64) {
        let anew = self.law.contacts();
        let (mut a, mut b) = (0, 0);
        let (mut lonely, mut worst): (u64, f64) = (0, 0.0);
        let relative = |x: f64| {
            if strongest > 0.0 {
                x.abs() / strongest
            } else {
                x.abs()
            }
        };
        while a < pairs.len() || b < anew.pairs.len() {
            let (p, q) = (pairs.get(a), anew.pairs.get(b));
            match (p, q) {
                (Some(p), Some(q)) if p == q => {
                    worst = worst.max(relative(forces[a] - anew.forces[b]));
                    (a, b) = (a + 1, b + 1);
                }
                (Some(p), q) if q.is_none_or(|q| p < q) => {
                    worst = worst.max(relative(forces[a]));
                    lonely += u64::from(relative(forces[a]) > ALLOWED);
                    a += 1;
                }
                _ => {
                    worst = worst.max(relative(anew.forces[b]));
                    lonely += u64::from(relative(anew.forces[b]) > ALLOWED);
                    b += 1;
                }
            }
        }
        self.forces.of(worst, step);
        self.contacts.of(lonely as f64, step);
    }

    /// Recorded energy and pressure against those of the contacts found anew.
    fn compare_metrics(&mut self, packing: &Packing, metrics: &[(String, f64)], step: u64) {
        let (domain, gamma) = (packing.domain(), self.law.line_tension());
        let anew = Observables::of(
            &self.law.contacts(),
            domain,
            packing.len(),
            gamma,
            (0.0, 0.0),
        );
        for (name, recorded) in metrics {
            let value = match name.as_str() {
                "energy" => anew.energy,
                "pressure" => anew.pressure(),
                _ => continue,
            };
            let scale = value.abs().max(recorded.abs());
            if scale > 0.0 || recorded.is_nan() {
                self.energy_and_pressure
                    .of((value - recorded).abs() / scale, step);
            }
        }
    }

    /// Whether all frames seen fulfil the contact law to round-off. With the seed's rule contacts lag behind their
    /// positions by a step, so only the last frame is asked for: its step must not be among the worst.
    ///
    /// See the example of [`Balance`].
    #[must_use]
    pub fn agrees(&self) -> bool {
        let last = self.last.map_or(0, |(step, _)| step);
        let within = |worst: &Worst, allowed: f64| {
            worst.value <= allowed || (self.rule == Rule::Seed && worst.step != last)
        };
        self.failed.is_none()
            && within(&self.equation_4, ALLOWED)
            && within(&self.overlap, ALLOWED)
            && within(&self.pull, 0.0)
            && within(&self.forces, ALLOWED)
            && within(&self.energy_and_pressure, ALLOWED)
            && within(&self.contacts, 0.0)
    }

    /// Whether the last frame bears out a result: a converged run ends with `f_max` not above its threshold.
    ///
    /// ```
    /// use softjam::{record::Outcome, relax::Relaxation, replay::Balance, scene::Scene};
    ///
    /// let scene = Scene { particles: 48, phi: 0.9, ..Scene::default() };
    /// let run = Relaxation::new(&scene).unwrap();
    /// let mut balance = Balance::new(&scene);
    /// balance.check(run.packing(), &run.frame(), &[]);
    /// let claim = Outcome { converged: true, steps: 0, f_max: 0.0 };
    /// assert!(!balance.bears_out(&claim), "the first frame is far from balance");
    /// ```
    #[must_use]
    pub fn bears_out(&self, outcome: &Outcome) -> bool {
        self.last.is_some_and(|(step, f_max)| {
            step == outcome.steps
                && f_max.to_bits() == outcome.f_max.to_bits()
                && outcome.converged == (f_max <= self.threshold)
        })
    }
}
