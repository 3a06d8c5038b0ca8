//! Is the recorded packing in force balance, and do its contacts fulfil the contact law?
//!
//! Each recorded frame is judged from its positions and the radii alone: the contact problem is solved anew, from no guess,
//! and what comes out is compared with what was recorded. That the forces solve `A f = δ` and that no other pair overlaps
//! is checked by sums of its own over a freshly assembled `A`, not by the solver's word.

use crate::analysis::Observables;
use crate::contacts::FrameContacts;
use crate::contacts::largest_force;
use crate::domain::Vec2;
use crate::models::droplet::NetForces;
use crate::models::droplet::contact::list::ContactList;
use crate::models::droplet::contact::matrix::{ContactMatrix, Geometry};
use crate::models::droplet::contact::solver::Method;
use crate::models::droplet::contact::{ACCEPTED, ContactError, ContactLaw, Rule, due_tolerance};
use crate::record::Outcome;
use crate::scene::Scene;
use crate::state::Frame;
use crate::state::Packing;

/// The worst of each residual over the frames, with the step at which it occurred.
///
/// Residuals of lengths are relative to the largest `|δ|` among the frame's contacts, those of forces to its largest force.
/// Each frame is held to the tolerance that is [due](crate::models::droplet::contact::due_tolerance) at its own `f_max`, the converged one
/// to the scene's.
///
/// ```
/// let worst = softjam::replay::Worst::default();
/// assert_eq!((worst.value, worst.step), (0.0, 0));
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Worst {
    /// The value that is the largest part of what its frame allows.
    pub value: f64,
    /// What that frame allows.
    pub allowed: f64,
    /// The step at which it occurred.
    pub step: u64,
}

impl Worst {
    pub(super) fn of(&mut self, value: f64, allowed: f64, step: u64) {
        // A NaN is worse than any number, and stays.
        let worse = value * self.allowed > self.value * allowed
            || (value > 0.0 && allowed <= 0.0 && value > self.value)
            || (value > 0.0 && self.value == 0.0);
        if (worse && !self.value.is_nan()) || value.is_nan() {
            *self = Self {
                value,
                allowed,
                step,
            };
        }
    }

    /// Whether the value is within what is allowed.
    ///
    /// ```
    /// assert!(softjam::replay::Worst::default().agrees());
    /// ```
    #[must_use]
    pub fn agrees(&self) -> bool {
        self.value <= self.allowed
    }
}

/// What the residuals of a frame may be.
#[derive(Clone, Copy)]
struct Allowed {
    step: u64,
    /// Of lengths: what its `f_max` promises.
    lengths: f64,
    /// Of forces, which a matrix of condition 6 amplifies.
    forces: f64,
}

/// What the frames seen so far are worth.
///
/// # Example
///
/// ```
/// use softjam::{protocol::Relaxation, replay::Balance, scene::Scene};
///
/// let scene = Scene { particles: 48, phi: 0.9, ..Scene::default() };
/// let mut run = Relaxation::new(&scene).unwrap();
/// let mut balance = Balance::new(&scene);
/// balance.check(run.packing(), &run.frame(), &[("energy", run.observables().energy)]);
/// assert!(balance.agrees());
/// ```
#[derive(Clone, Debug)]
pub struct Balance {
    law: ContactLaw,
    form: NetForces,
    rule: Rule,
    threshold: f64,
    tolerance: f64,
    /// `max |A f − δ|` of the recorded forces: Saitoh (4).
    pub equation_4: Worst,
    /// The same of the last frame alone.
    pub last_equation_4: f64,
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

/// How far a residual may always be from zero: round-off, and the full tolerance amplified by a matrix of condition 6.
const ALLOWED: f64 = 1e-9;

/// How much larger a residual of forces may be than one of lengths, among particles of one size: the condition number of `A` is
/// about 6. The largest overlap is that of large particles; between small ones, whose contacts are stiffer, the same length stands for
/// a force that is larger by the ratio of sizes.
pub(super) const AMPLIFIED: f64 = 6.0;

impl Balance {
    /// Nothing seen yet of a recording of `scene`.
    ///
    /// See the example of [`Balance`].
    #[must_use]
    pub fn new(scene: &Scene) -> Self {
        Self {
            law: ContactLaw::new(
                Rule::Complementarity,
                // The answer is unique, and not every solver is fit for every number of contacts.
                Method::ConjugateGradient,
                scene.line_tension,
                scene.contact_tolerance.min(1e-12),
            ),
            form: NetForces::new(scene.forces),
            rule: scene.contact_rule,
            threshold: scene.threshold,
            tolerance: scene.contact_tolerance,
            equation_4: Worst::default(),
            last_equation_4: 0.0,
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
    pub fn check(&mut self, packing: &Packing, frame: &Frame, metrics: &[(&'static str, f64)]) {
        let step = frame.step;
        self.frames += 1;
        let recorded = FrameContacts::of(packing, frame);
        let view = recorded.view();
        let scale = view.overlaps.iter().fold(0.0, |m: f64, d| m.max(d.abs()));
        let relative = |x: f64| if scale > 0.0 { x / scale } else { x };
        let mut net = vec![Vec2::zeros(); packing.len()];
        let gamma = self.law.line_tension();
        self.form.evaluate(&view, packing, gamma, &mut net);
        let f_max = largest_force(&net) / gamma;
        self.last = Some((step, f_max));
        let allowed = self.allowed(packing, view.overlaps, f_max, step);
        // Eq. (4), row by row.
        if let Some(list) = ContactList::new(packing.len(), view.pairs) {
            let geometry = Geometry::of(packing, &list);
            let gamma = self.law.line_tension();
            let matrix = ContactMatrix::of(packing, &list, &geometry, gamma);
            self.last_equation_4 = 0.0;
            for (c, delta) in view.overlaps.iter().enumerate() {
                let row: f64 = matrix.row(c).map(|(k, a)| a * view.forces[k]).sum();
                let residual = matrix.diagonal()[c] * view.forces[c] + row - delta;
                let residual = relative(residual.abs());
                self.equation_4.of(residual, allowed.lengths, step);
                self.last_equation_4 = self.last_equation_4.max(residual);
            }
            self.check_gaps(packing, &list, &geometry, view.forces, scale, allowed);
        }
        let strongest = view.forces.iter().fold(0.0, |m: f64, f| m.max(f.abs()));
        for f in view.forces {
            let pull = if strongest > 0.0 { -f / strongest } else { -f };
            self.pull.of(pull, 0.0, step);
        }
        match self.law.solve(packing, &[], &[]) {
            Ok(()) => {
                self.compare(view.pairs, view.forces, strongest, allowed);
                self.compare_metrics(packing, metrics, allowed);
            }
            Err(error) => self.failed = self.failed.take().or(Some((step, error))),
        }
    }

    /// What the frame's `f_max` promises.
    fn allowed(&self, packing: &Packing, overlaps: &[f64], f_max: f64, step: u64) -> Allowed {
        let due = if f_max > self.threshold && self.rule == Rule::Complementarity {
            f_max
        } else {
            0.0
        };
        let promised = ACCEPTED * due_tolerance(packing, overlaps, due, self.tolerance);
        let ratio = packing.largest_radius() / packing.smallest_radius();
        Allowed {
            step,
            lengths: promised.max(ALLOWED),
            forces: (AMPLIFIED * ratio * promised).max(ALLOWED),
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
        allowed: Allowed,
    ) {
        let gamma = self.law.line_tension();
        let mut neighbors = crate::neighbors::NeighborList::new();
        // Wider bulges than the largest particle is large are left to the comparison with the forces found anew.
        neighbors.update(packing, 2.0 * packing.largest_radius(), 0.0);
        for &[i, j] in neighbors.pairs() {
            if list.partners(i as usize).binary_search(&j).is_err() {
                let gap = geometry.gap(packing, gamma, forces, i as usize, j as usize);
                let overlap = if scale > 0.0 { -gap / scale } else { -gap };
                self.overlap.of(overlap, allowed.lengths, allowed.step);
            }
        }
    }

    /// Recorded contacts and forces against those found anew.
    fn compare(&mut self, pairs: &[[u32; 2]], forces: &[f64], strongest: f64, allowed: Allowed) {
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
                    lonely += u64::from(relative(forces[a]) > allowed.forces);
                    a += 1;
                }
                _ => {
                    worst = worst.max(relative(anew.forces[b]));
                    lonely += u64::from(relative(anew.forces[b]) > allowed.forces);
                    b += 1;
                }
            }
        }
        self.forces.of(worst, allowed.forces, allowed.step);
        self.contacts.of(lonely as f64, 0.0, allowed.step);
    }

    /// Recorded energy and pressure against those of the contacts found anew.
    fn compare_metrics(
        &mut self,
        packing: &Packing,
        metrics: &[(&'static str, f64)],
        allowed: Allowed,
    ) {
        let (domain, gamma) = (packing.domain(), self.law.line_tension());
        let anew = Observables::of(
            &self.law.contacts(),
            domain,
            packing.len(),
            gamma,
            (0.0, 0.0),
        );
        for (name, recorded) in metrics {
            let value = match *name {
                "energy" => anew.energy,
                "pressure" => anew.pressure(),
                _ => continue,
            };
            let scale = value.abs().max(recorded.abs());
            if scale > 0.0 || recorded.is_nan() {
                let difference = (value - recorded).abs() / scale;
                self.energy_and_pressure
                    .of(difference, allowed.forces, allowed.step);
            }
        }
    }

    /// Whether all frames seen fulfil the contact law to the tolerance that is due in them. With Saitoh's rule contacts lag behind their
    /// positions by a step, so only the last frame is asked for: its step must not be among the worst.
    ///
    /// See the example of [`Balance`].
    #[must_use]
    pub fn agrees(&self) -> bool {
        let last = self.last.map_or(0, |(step, _)| step);
        let within =
            |worst: &Worst| worst.agrees() || (self.rule == Rule::Saitoh && worst.step != last);
        self.failed.is_none()
            && within(&self.equation_4)
            && within(&self.overlap)
            && within(&self.pull)
            && within(&self.forces)
            && within(&self.energy_and_pressure)
            && within(&self.contacts)
    }

    /// Whether the last frame bears out a result: a converged run ends with `f_max` not above its threshold. The recorded `f_max` may be
    /// off by `tolerance` (units of γ), 0 for the same bits.
    ///
    /// ```
    /// use softjam::{record::Outcome, protocol::Relaxation, replay::Balance, scene::Scene};
    ///
    /// let scene = Scene { particles: 48, phi: 0.9, ..Scene::default() };
    /// let run = Relaxation::new(&scene).unwrap();
    /// let mut balance = Balance::new(&scene);
    /// balance.check(run.packing(), &run.frame(), &[]);
    /// let claim = Outcome { converged: true, steps: 0, f_max: 0.0, stability: None };
    /// assert!(!balance.bears_out(&claim, 0.0), "the first frame is far from balance");
    /// ```
    #[must_use]
    pub fn bears_out(&self, outcome: &Outcome, tolerance: f64) -> bool {
        self.last.is_some_and(|(step, f_max)| {
            step == outcome.steps
                && (f_max.to_bits() == outcome.f_max.to_bits()
                    || (f_max - outcome.f_max).abs() <= tolerance)
                && outcome.converged == (outcome.f_max <= self.threshold)
        })
    }
}
