//! The allowed ranges.

use super::stages::MOST as MOST_STAGES;
use super::{Minimizer, Preparation, Radii, Scene, SceneError, Start};
use crate::models::Kind;
use crate::models::droplet::Form;
use crate::models::droplet::contact::Rule;
use crate::models::droplet::contact::solver::Method;

/// What waits for a recorder or is under way in it, and in a second one or a live view, does not grow beyond this (bytes); 100 kB
/// a particle if that is less.
const UNDER_WAY: u64 = 1 << 27;

impl Scene {
    /// Checks every field, whatever way the scene was made.
    ///
    /// # Errors
    ///
    /// [`SceneError::Range`] for the first field that is wrong. Whether the box is large enough shows when the radii
    /// are there, in [`start::packing`](super::start::packing).
    pub fn validate(&self) -> Result<(), SceneError> {
        within(
            "line_tension",
            self.line_tension,
            (1e-100..=1e100).contains(&self.line_tension),
            // Squares of forces far below it must not vanish, nor those far above it overflow.
            "1e-100 ≤ line_tension ≤ 1e100 (the unit of force)",
        )?;
        positive("threshold", self.threshold)?;
        if let Some(dt_max) = self.dt_max {
            positive("dt_max", dt_max)?;
        }
        within(
            "contact_tolerance",
            self.contact_tolerance,
            (1e-14..=1e-6).contains(&self.contact_tolerance),
            "1e-14 ≤ contact_tolerance ≤ 1e-6 (residual relative to the largest overlap)",
        )?;
        self.validate_model()?;
        within(
            "protocol",
            self.protocol.len() as f64,
            self.protocol.len() <= MOST_STAGES,
            "1000 stages",
        )?;
        for (k, stage) in (1..).zip(&self.protocol) {
            stage.validate(k)?;
        }
        self.validate_minimizer()?;
        within(
            "contours.vertices",
            self.contours.vertices as f64,
            (3..=4096).contains(&self.contours.vertices),
            "3 ≤ vertices ≤ 4096 (equally spaced vertices a contour)",
        )?;
        within(
            "channels.redraw",
            self.channels.redraw,
            (0.0..=1.0).contains(&self.channels.redraw),
            "0 ≤ redraw ≤ 1 (mean radii)",
        )?;
        if let Start::File { .. } = self.start {
            return Ok(());
        }
        self.validate_packing()
    }

    /// What belongs to droplets is not asked of disks.
    fn validate_model(&self) -> Result<(), SceneError> {
        let relaxed = matches!(
            self.start,
            Start::File { preparation, .. } if preparation == Preparation::Relaxed
        );
        let [newton, turning, saitoh] = [
            self.minimizer == Minimizer::FireNewton,
            self.forces == Form::Gradient,
            self.contact_rule == Rule::Saitoh,
        ];
        let record = self.disks.record.to_string();
        let (field, value, why) = match self.model {
            Kind::MorseWitten => return Ok(()),
            Kind::Disks if newton => (
                "minimizer",
                "fire+newton",
                "Newton's method solves for the contact forces of droplets; take fire",
            ),
            _ if turning => (
                "forces",
                "gradient",
                "its forces are the gradient of its energy as they are; leave it out",
            ),
            _ if saitoh => (
                "contact_rule",
                "saitoh",
                "its contacts follow the positions in every step; leave it out",
            ),
            Kind::Disks if relaxed => (
                "disks.relax",
                "true",
                "the run itself relaxes them; leave it out",
            ),
            Kind::Disks if self.disks.record.is_on() => (
                "disks.record",
                record.as_str(),
                "the run itself is of disks, which [channels] schedules; leave it out",
            ),
            Kind::Disks | Kind::RoundedPolygon | Kind::WetFoam => return Ok(()),
        };
        Err(SceneError::Conflict {
            field: field.into(),
            value: format!("\"{value}\""),
            with: format!("model = \"{}\"", self.model.name()),
            why: why.into(),
        })
    }

    fn validate_minimizer(&self) -> Result<(), SceneError> {
        let open = |x: f64| x > 0.0 && x < 1.0;
        let half_open = |x: f64| x > 0.0 && x <= 1.0;
        let f = &self.fire;
        within(
            "fire.increase",
            f.increase,
            f.increase > 1.0 && f.increase <= 10.0,
            "1 < increase ≤ 10",
        )?;
        within(
            "fire.decrease",
            f.decrease,
            open(f.decrease),
            "0 < decrease < 1",
        )?;
        within(
            "fire.mixing",
            f.mixing,
            half_open(f.mixing),
            "0 < mixing ≤ 1",
        )?;
        within(
            "fire.mixing_decay",
            f.mixing_decay,
            half_open(f.mixing_decay),
            "0 < mixing_decay ≤ 1",
        )?;
        within(
            "fire.first_dt",
            f.first_dt,
            half_open(f.first_dt),
            "0 < first_dt ≤ 1 (a fraction of dt_max)",
        )?;
        within(
            "fire.least_dt",
            f.least_dt,
            half_open(f.least_dt) && f.least_dt <= f.first_dt,
            "0 < least_dt ≤ first_dt (a fraction of dt_max)",
        )?;
        positive("disks.threshold", self.disks.threshold)
    }

    fn validate_packing(&self) -> Result<(), SceneError> {
        within(
            "particles",
            self.particles as f64,
            (1..=10_000_000).contains(&self.particles),
            "1 ≤ particles ≤ 10000000",
        )?;
        within(
            "phi",
            self.phi,
            self.phi > 0.0 && self.phi < 1.3,
            "0 < phi < 1.3 (coverage of the undeformed disks)",
        )?;
        within(
            "aspect",
            self.aspect,
            (0.1..=10.0).contains(&self.aspect),
            "0.1 ≤ aspect ≤ 10 (L_x / L_y)",
        )?;
        match &self.radii {
            Radii::Species(species) => {
                if species.is_empty() {
                    return range("species", "[]", "a list of at least one species");
                }
                for (k, s) in species.iter().enumerate() {
                    radius(&format!("species[{k}].radius"), s.radius)?;
                    within(
                        &format!("species[{k}].fraction"),
                        s.fraction,
                        s.fraction > 0.0 && s.fraction <= 1.0,
                        "0 < fraction ≤ 1 (share by number)",
                    )?;
                }
                let sum: f64 = species.iter().map(|s| s.fraction).sum();
                within(
                    "species: the sum of the fractions",
                    sum,
                    (sum - 1.0).abs() <= 1e-9,
                    "1 ± 1e-9",
                )?;
            }
            Radii::Spread { min, max } => {
                radius("spread.min", *min)?;
                radius("spread.max", *max)?;
                if min > max {
                    return range("spread.min", &min.to_string(), "min ≤ max");
                }
            }
        }
        if self.start == Start::Hexagonal && !self.particles.is_multiple_of(2) {
            return range(
                "particles",
                &self.particles.to_string(),
                "the even numbers that start = \"hexagonal\" needs to close its rows across the box edge",
            );
        }
        Ok(())
    }

    /// About how many bytes a run of `particles` particles needs at its peak, queue of the recorder included.
    #[must_use]
    pub fn memory_estimate(&self, particles: usize) -> u64 {
        // Measured (growth of the peak resident size from N = 20 000 to 40 000, every step recorded with 32 vertices, at
        // φ = 0.86 and 1.2): 1.3 and 2.7 kB a particle with metrics alone, 3.3 and 5.1 kB with contacts and state as well,
        // 5.2 and 6.7 kB with contours too. The estimate is half as much again and more: the queue may fill up.
        let vertices = if self.channels.contours.is_on() {
            self.contours.vertices as u64 + 8
        } else {
            0
        };
        let frames = self.channels.contacts.is_on() || self.channels.state.is_on();
        let n = particles as u64;
        let dense = if self.contact_solver == Method::GaussJordan {
            // The dense matrix of some 2.5 N contacts.
            n.saturating_mul(50).saturating_mul(n)
        } else {
            0
        };
        // With Newton's method 4.8 and 6.9 kB a particle more at N = 16 384 and 32 768 (φ = 0.95), most of it the Cholesky factor,
        // which grows with the logarithm of N.
        let newton = if self.minimizer == Minimizer::FireNewton {
            3_000 * u64::from(n.max(1).ilog2()).saturating_sub(11).max(1)
        } else {
            0
        };
        let each = 4_000 + 4_000 * u64::from(frames) + 24 * 4 * vertices + newton;
        let dense = dense.saturating_add(UNDER_WAY.min(n.saturating_mul(100_000)));
        n.saturating_mul(each).saturating_add(dense)
    }
}

fn range(field: &str, value: &str, allowed: &str) -> Result<(), SceneError> {
    Err(SceneError::Range {
        field: field.into(),
        value: value.into(),
        allowed: allowed.into(),
    })
}

fn within(field: &str, value: f64, holds: bool, allowed: &str) -> Result<(), SceneError> {
    if holds {
        Ok(())
    } else {
        range(field, &value.to_string(), allowed)
    }
}

fn positive(field: &str, value: f64) -> Result<(), SceneError> {
    let name = field.rsplit('.').next().unwrap_or(field);
    within(
        field,
        value,
        value.is_finite() && value > 0.0,
        &format!("0 < {name} < ∞"),
    )
}

fn radius(field: &str, value: f64) -> Result<(), SceneError> {
    within(
        field,
        value,
        (1e-6..=1e6).contains(&value),
        "1e-6 ≤ radius ≤ 1e6 (undeformed, length)",
    )
}
