//! One case: a scene run to its end, and what has become of it.

use super::stiffness::Spectrum;
use super::verify::{Answer, Check};
use softjam::analysis::Stability;
use softjam::models::droplet::contact::ContactError;
use softjam::models::droplet::contact::solver::SolverError;
use softjam::protocol::relax_disks;
use softjam::protocol::{RelaxError, Relaxation, Status};
use softjam::scene::{Scene, SceneError, start};
use softjam::state::Packing;
use std::f64::consts::PI;
use std::panic::{AssertUnwindSafe, catch_unwind};

/// How a case ended.
#[derive(Clone, Debug)]
pub struct Outcome {
    /// `converged`, `step limit`, or the name of the error.
    pub end: &'static str,
    /// What the error said; empty without one.
    pub message: String,
    /// Steps made.
    pub steps: u64,
    /// The check by formulas of its own; `None` where there is no answer to check.
    pub check: Option<Check>,
    /// What the run says of its balance; `None` where there is none.
    pub stability: Option<Stability>,
    /// What is wrong with it; `None` is a pass.
    pub wrong: Option<String>,
}

/// Packings up to this size have all their eigenvalues computed.
const EIGENVALUES: usize = 130;

/// Runs a scene from its own start.
pub fn of_scene(scene: &Scene) -> Outcome {
    guarded(scene, || {
        scene.validate()?;
        let mut packing = start::packing(scene)?;
        if scene.starts_from_disks() {
            relax_disks(&mut packing, &scene.disks, scene.line_tension).unwrap();
        }
        Ok(packing)
    })
}

/// Runs a scene from a packing as it stands.
pub fn of_packing(scene: &Scene, packing: &Packing) -> Outcome {
    guarded(scene, || Ok(packing.clone()))
}

/// The pressure at the end of a scene's run (γ/length); 0 if it had none.
pub fn pressure_of(scene: &Scene) -> f64 {
    of_scene(scene).check.map_or(0.0, |c| c.pressure)
}

/// A panic is an outcome, and a wrong one.
fn guarded(scene: &Scene, packing: impl FnOnce() -> Result<Packing, SceneError>) -> Outcome {
    catch_unwind(AssertUnwindSafe(|| match packing() {
        Ok(packing) => run(scene, packing),
        Err(error) => refused(scene, &error),
    }))
    .unwrap_or_else(|_| Outcome {
        end: "panic",
        message: String::new(),
        steps: 0,
        check: None,
        stability: None,
        wrong: Some("a panic".into()),
    })
}

fn run(scene: &Scene, packing: Packing) -> Outcome {
    let kept = packing.clone();
    let mut run = match Relaxation::of_packing(scene, packing) {
        Ok(run) => run,
        Err(error) => {
            // The relaxation is gone; the law alone is asked again, and shows how far it came.
            let mut law = scene.contact_law();
            let again = law.solve(&kept, &[], &[]);
            let check = again.is_err().then(|| check(scene, &kept, law.contacts()));
            return failed(&error, &kept, 0, check);
        }
    };
    loop {
        match run.status() {
            Status::Running => {
                if let Err(error) = run.advance() {
                    let check = check(scene, run.packing(), run.contacts());
                    return failed(&error, run.packing(), run.step(), Some(check));
                }
            }
            status => return ended(scene, &run, status),
        }
    }
}

fn check(scene: &Scene, packing: &Packing, contacts: softjam::contacts::Contacts<'_>) -> Check {
    let centres: Vec<[f64; 2]> = packing.positions().iter().map(|p| [p.x, p.y]).collect();
    let l = packing.domain().lengths();
    Answer {
        sides: [l.x, l.y],
        radii: packing.radii(),
        centres: &centres,
        pairs: contacts.pairs,
        forces: contacts.forces,
        line_tension: scene.line_tension,
        gradient: scene.to_toml().contains("\nforces = \"gradient\""),
    }
    .check()
}

/// An answer counts if the law is fulfilled, whether or not the step limit came first.
fn ended(scene: &Scene, run: &Relaxation, status: Status) -> Outcome {
    let c = check(scene, run.packing(), run.contacts());
    let converged = status == Status::Converged;
    // Sixteen tolerances is what the law promises; as much again for this other way to compute it. Away from balance forces need
    // only be exact to a hundredth of f_max: f_max (3/2π) R_min / 100 as a length, and 1e-4 of the overlaps at most.
    let least = run
        .packing()
        .radii()
        .iter()
        .copied()
        .fold(f64::INFINITY, f64::min);
    let loose = (0.01 * c.f_max * 1.5 / PI * least).min(1e-4 * c.overlap);
    let due = if converged { 0.0 } else { loose };
    let law = 32.0 * due.max(scene.contact_tolerance * c.overlap) + c.round_off;
    let mut wrong = None;
    let mut ask = |good: bool, what: String| {
        if !good && wrong.is_none() {
            wrong = Some(what);
        }
    };
    ask(c.finite, "not finite".into());
    ask(
        c.law <= law,
        format!(
            "the law is broken by {:.1e} at overlaps of {:.1e}",
            c.law, c.overlap
        ),
    );
    ask(
        c.least_force > 0.0,
        format!("a force of {:.1e}", c.least_force),
    );
    ask(
        c.second_image <= 1e-9,
        format!("a second image overlaps by {:.1e}", c.second_image),
    );
    // Forces of order 1 are summed in another order.
    let balance = scene.threshold * 1.001 + 1e-14;
    if converged {
        ask(c.f_max <= balance, format!("f_max is {:.1e}", c.f_max));
        if run.packing().len() <= EIGENVALUES {
            let spectrum = Spectrum::of_run(run, scene.forces);
            let stability = run.stability();
            ask(
                spectrum.bears_out(run),
                format!("called {stability:?}, with {spectrum:?}"),
            );
        }
    } else {
        ask(c.f_max > scene.threshold * 0.999, "it had converged".into());
        ask(run.step() >= scene.steps, "before the step limit".into());
    }
    Outcome {
        end: if converged { "converged" } else { "step limit" },
        message: String::new(),
        steps: run.step(),
        check: Some(c),
        stability: run.stability(),
        wrong,
    }
}

impl Outcome {
    /// A scene that was refused as it was read.
    pub fn refused(error: &SceneError) -> Self {
        Self {
            end: "scene: out of range",
            message: error.to_string(),
            steps: 0,
            check: None,
            stability: None,
            wrong: None,
        }
    }
}

/// Whether the reason that a scene names holds.
fn refused(scene: &Scene, error: &SceneError) -> Outcome {
    let (end, right) = match error {
        SceneError::BoxTooSmall {
            length_x,
            length_y,
            largest_radius,
            ..
        } => (
            "scene: box too small",
            length_x.min(*length_y) < 4.0 * largest_radius,
        ),
        SceneError::Range { .. } => (
            "scene: out of range",
            // A coverage so low that the box has no finite area shows only when the radii are there.
            scene.validate().is_err() || !(1e-5 * 1e-5 / scene.phi).is_finite(),
        ),
        SceneError::StartFile { .. } => ("scene: start file", true),
        _ => ("scene: other", false),
    };
    Outcome {
        end,
        message: error.to_string(),
        steps: 0,
        check: None,
        stability: None,
        wrong: (!right).then(|| format!("the reason does not hold: {error}")),
    }
}

fn failed(error: &RelaxError, packing: &Packing, steps: u64, check: Option<Check>) -> Outcome {
    let shortest = packing.domain().shortest();
    let (end, right) = match error {
        RelaxError::Contact { source, .. } => match source {
            // A second image does overlap.
            ContactError::BoxTooSmall { .. } => {
                ("box too small", check.is_some_and(|c| c.second_image > 0.0))
            }
            // The forces found fulfil the law, and bound a bulge of more than five of the largest radii.
            ContactError::Diverged { .. } => ("diverged", check.is_some_and(|c| c.bulge > 5.0)),
            // These say that A is singular or that exchanges cycle: never right where contacts have directions of their own.
            ContactError::Solver(SolverError::NotPositiveDefinite { .. }) => {
                ("not positive definite", false)
            }
            ContactError::Solver(SolverError::NotConverged { .. }) => ("solver stuck", false),
            ContactError::Unsettled { .. } => ("unsettled", false),
            _ => ("contact: other", false),
        },
        RelaxError::TooFar { distance, .. } => (
            "thrown through the box",
            // NaN would not be a distance.
            *distance > 0.25 * shortest,
        ),
        RelaxError::Scene(_) => ("scene: out of range", true),
        _ => ("other", false),
    };
    Outcome {
        end,
        message: error.to_string(),
        steps,
        check,
        stability: None,
        wrong: (!right).then(|| format!("the reason does not hold: {error}")),
    }
}
