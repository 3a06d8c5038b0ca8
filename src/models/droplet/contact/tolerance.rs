//! How exactly a frame's contact forces are solved for.

use crate::state::Packing;
use core::f64::consts::PI;

/// The tolerance of the contact forces that is due in a frame, relative to its `max |δ|` (`overlaps`, length): a function
/// of the frame alone. `tolerance` is the scene's, `f_max` the frame's (units of γ).
///
/// Far from balance there is no use in forces that are more exact than they are balanced. The residual `|A f − δ|` may be
/// as large as what changes the force of the stiffest contact on its own by a hundredth of `f_max`:
///
/// ```text
/// max(tolerance, min(3·10⁻⁴, 10⁻² f_max (3/2π) R_min / max |δ|))
/// ```
///
/// A frame whose `f_max` is not above the scene's threshold is solved to the full tolerance in any case, which is this
/// function at `f_max = 0`.
///
/// ```
/// use softjam::models::droplet::contact::due_tolerance;
/// use softjam::domain::{Domain, Vec2};
/// use softjam::state::Packing;
///
/// let packing = Packing::new(Domain::new(8.0, 8.0).unwrap(), vec![0.5], vec![Vec2::zeros()]).unwrap();
/// assert_eq!(due_tolerance(&packing, &[0.1], 0.0, 1e-12), 1e-12);
/// let due = due_tolerance(&packing, &[0.1], 1e-4, 1e-12);
/// assert!((due - 1e-6 * 0.75 / std::f64::consts::PI / 0.1).abs() < 1e-20);
/// ```
#[must_use]
pub fn due_tolerance(packing: &Packing, overlaps: &[f64], f_max: f64, tolerance: f64) -> f64 {
    let largest = overlaps.iter().fold(0.0, |m: f64, d| m.max(d.abs()));
    relative_tolerance(tolerance, slack(packing, f_max), largest)
}

/// How many tolerances a residual may have: see [`ContactLaw::accepted_residual`](super::ContactLaw::accepted_residual).
pub(crate) const ACCEPTED: f64 = 16.0;

/// The error of a contact force that is allowed far from balance, as a part of the largest net force.
///
/// Measured at N = 1024, φ = 0.86: 1e-3 takes two to three iterations more a step and as many steps; with 1e-1 FIRE takes
/// three times the steps.
const FORCE_ERROR: f64 = 1e-2;

/// The largest tolerance far from balance, relative to the largest `|δ|`.
///
/// It binds where `f_max` is far above what most particles have: in large packings, and in the first hundred steps. At N = 65 536 steps
/// 100 to 250 take 6.8 iterations with 1e-4, 5.7 with this and 5.0 with 1e-3, which takes as long, as more pairs come and go. Steps
/// to 1e-10, geometric means for 1e-4 and 1e-3: 2890 and 2973 at N = 1024, φ = 0.86 (24 seeds, which scatter by 5 %); 1343 and 1333,
/// 1040 and 1055, 743 and 748 at N = 256, φ = 0.86, 0.90 and 1.0 (40 seeds).
const LOOSEST: f64 = 3e-4;

/// `FORCE_ERROR f_max (3/2π) R_min`: what changes the force of the stiffest contact by that part of `f_max` (length).
pub(super) fn slack(packing: &Packing, f_max: f64) -> f64 {
    FORCE_ERROR * f_max * (1.5 / PI) * packing.smallest_radius()
}

/// The tolerance relative to the `largest` overlap (length), where a residual may be as large as `slack` (length).
pub(super) fn relative_tolerance(tolerance: f64, slack: f64, largest: f64) -> f64 {
    let loose = if largest > 0.0 { slack / largest } else { 0.0 };
    tolerance.max(loose.min(LOOSEST))
}
