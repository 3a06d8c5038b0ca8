//! What a recorded frame is worth, found from positions, radii, contacts and forces alone.

use crate::contacts::Contacts;
use crate::domain::Domain;

/// What a model says of a frame without solving it; see [`Model::check`](super::Model::check).
///
/// Lengths are relative to the largest `|δ|` among the frame's contacts, forces to the largest of them.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Check {
    /// The residual that the frame may have at its own `f_max`.
    pub promised: f64,
    /// The largest residual of the law of the contacts: of droplets `A f = δ`, Saitoh (4), of disks `f = k δ`.
    pub residual: f64,
    /// The deepest overlap among pairs that are no contacts.
    pub overlap: f64,
    /// The largest pull `−f`; 0 where all forces push.
    pub pull: f64,
    /// The largest net force (units of γ).
    pub f_max: f64,
    /// The largest moment of a contact that is not balanced (γ·length); 0 with models that have none.
    pub moment: f64,
    /// `½ Σ_c δ_c f_c`, or what the model's energy is (γ·length).
    pub energy: f64,
    /// `(1/2V) Σ_c f_c r_c` (γ/length).
    pub pressure: f64,
}

impl Check {
    /// Of `contacts`, with what a model adds: residual and overlap are lengths, in which `promised` is relative.
    pub(super) fn of(
        contacts: &Contacts<'_>,
        domain: Domain,
        line_tension: f64,
        (promised, f_max): (f64, f64),
        (residual, overlap): (f64, f64),
    ) -> Self {
        let largest = |values: &[f64]| values.iter().fold(0.0, |m: f64, x| m.max(x.abs()));
        let over = |x: f64, scale: f64| if scale > 0.0 { x / scale } else { x };
        let scale = largest(contacts.overlaps);
        let sum = |a: &[f64]| {
            a.iter()
                .zip(contacts.forces)
                .map(|(a, f)| a * f)
                .sum::<f64>()
        };
        let pull = contacts.forces.iter().fold(0.0, |m: f64, f| m.max(-f));
        Self {
            promised,
            residual: over(residual, scale),
            overlap: over(overlap, scale),
            pull: over(pull, largest(contacts.forces)),
            f_max,
            moment: 0.0,
            energy: 0.5 * sum(contacts.overlaps) / line_tension,
            pressure: 0.5 * sum(contacts.distances) / (domain.area() * line_tension),
        }
    }
}

/// The larger of two numbers; a NaN is larger than any.
pub(super) fn worse(m: f64, x: f64) -> f64 {
    if x > m || x.is_nan() { x } else { m }
}
