//! [`ContactError`].

use super::solver::SolverError;
use crate::text::counted;

/// Why the contact problem has no answer.
///
/// ```
/// use softjam::models::droplet::contact::{ContactError, ContactLaw};
/// use softjam::domain::{Domain, Vec2};
/// use softjam::state::Packing;
///
/// // A disk that is wider than its box touches its own image.
/// let domain = Domain::new(0.9, 3.0).unwrap();
/// let packing = Packing::new(domain, vec![0.5], vec![Vec2::new(0.4, 1.0)]).unwrap();
/// let error = ContactLaw::default().solve(&packing, &[], &[]).unwrap_err();
/// assert!(matches!(error, ContactError::BoxTooSmall { particle: 0, other: 0, .. }));
/// ```
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ContactError {
    /// `A f = δ` was not solved.
    #[error(transparent)]
    Solver(#[from] SolverError),
    /// A particle touches two images of the same neighbour, or of itself.
    #[error(
        "particle {particle} touches particle {other} across more than one side of the box, whose shorter side is \
         {shortest:.4} (it reaches up to {reach:.4}); take more particles or a lower phi"
    )]
    BoxTooSmall {
        /// The particle.
        particle: usize,
        /// The particle of which it touches two images; itself where it touches its own.
        other: usize,
        /// Undeformed radius of the first and the bound of its bulge (length).
        reach: f64,
        /// The shorter side of the box (length).
        shortest: f64,
    },
    /// The forces are so large that a contour would bulge by several radii.
    #[error(
        "particle {particle} of radius {radius} would bulge by up to {bulge:.3e}: the forces diverged, as after a step that was too \
         long or in a start that overlaps far too much; a start from a file can have its disks relaxed first (--relax-disks, or relax \
         = true in [disks])"
    )]
    Diverged {
        /// The particle.
        particle: usize,
        /// The bound of its bulge (length).
        bulge: f64,
        /// Its undeformed radius (length).
        radius: f64,
    },
    /// There is no room for a droplet that keeps its area.
    #[error(
        "droplets {particle} and {other} have no room for their areas (they press on each other with {force:.3e} γ): a cell became smaller than \
         its droplet, as after a step that was too long or in a start that overlaps far too much; start from relaxed disks (--relax-disks \
         for a file), or take a lower phi"
    )]
    NoRoom {
        /// A droplet.
        particle: usize,
        /// The one that it presses on most.
        other: usize,
        /// Their force (units of γ).
        force: f64,
    },
    /// Exchanging contacts did not end. Only round-off can bring this about, at an exact tie.
    #[error(
        "the contact set did not settle: {violating} of {} still break the contact law after {}", counted(.contacts, "pair"), counted(.sweeps, "sweep")
    )]
    Unsettled {
        /// Pairs that still break the law.
        violating: usize,
        /// Contacts in the set.
        contacts: usize,
        /// Sweeps done.
        sweeps: usize,
    },
}
