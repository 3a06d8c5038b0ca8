//! The undeformed disks that droplets start from.

use super::{RelaxError, Relaxation, Status};
use crate::scene::{DiskParameters, Scene};
use crate::state::Packing;

/// How the disks relaxed.
///
/// See the example of [`relax_disks`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DiskReport {
    /// Steps made.
    pub steps: u64,
    /// The largest net force at the end (units of γ).
    pub f_max: f64,
    /// Whether `f_max` is not above the threshold.
    pub converged: bool,
    /// Mean coordination number of the disks that are held; see
    /// [`Observables::coordination`](crate::analysis::Observables::coordination).
    pub coordination: f64,
    /// Rattlers among the disks.
    pub rattlers: usize,
}

/// Relaxes the disks of `packing` in place, by FIRE with its own parameters; `line_tension` is γ (force, positive).
///
/// # Errors
///
/// [`RelaxError::Scene`] if the threshold or γ is out of the range that a scene allows.
///
/// # Example
///
/// ```
/// use softjam::domain::{Domain, Vec2};
/// use softjam::protocol::relax_disks;
/// use softjam::scene::DiskParameters;
/// use softjam::state::Packing;
///
/// let at = |x| Vec2::new(x, 2.0);
/// let mut packing = Packing::new(Domain::new(8.0, 8.0).unwrap(), vec![0.5; 2], vec![at(1.0), at(1.7)]).unwrap();
/// let report = relax_disks(&mut packing, &DiskParameters::default(), 1.0).unwrap();
/// assert!(report.converged && report.f_max <= 1e-6);
/// assert!(packing.separation(0, 1).norm() > 1.0 - 1e-6);
/// ```
pub fn relax_disks(
    packing: &mut Packing,
    parameters: &DiskParameters,
    line_tension: f64,
) -> Result<DiskReport, RelaxError> {
    let scene = Scene {
        disks: *parameters,
        line_tension,
        ..Scene::default()
    };
    scene.validate()?;
    let mut run = Relaxation::begin(&scene.of_disks(), packing.clone(), (0, 0.0))?;
    while run.status() == Status::Running {
        run.advance()?;
    }
    let report = run.disk_report();
    *packing = run.packing;
    Ok(report)
}

impl Relaxation {
    /// How disks that have come to their end have relaxed.
    pub(super) fn disk_report(&self) -> DiskReport {
        let observables = self.observables();
        DiskReport {
            steps: self.step,
            f_max: observables.f_max,
            converged: self.is_balanced(),
            coordination: observables.coordination(),
            rattlers: observables.rattlers,
        }
    }
}
