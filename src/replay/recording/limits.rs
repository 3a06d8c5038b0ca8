//! What is made of a recording only within limits: packings that could be ones, runs that fit in memory.

use super::{ReadError, Recording};
use crate::domain::{Domain, Vec2};
use crate::models::droplet::contact::solver::Method;
use crate::neighbors::crowding;
use crate::neighbors::crowding::Crowd;
use crate::state::Frame;
use crate::state::Packing;
use crate::text::counted;

/// Bytes that the metrics of a step take while they wait for a state.
const WAITING_METRICS: u64 = 800;

/// Unknowns of the largest dense system of equations that a recording may ask for: a minute each.
const LARGEST_DENSE: usize = 10_000;

impl Recording {
    /// The packing at a recorded frame.
    ///
    /// # Errors
    ///
    /// [`ReadError::Damaged`] if the frame is not one of this recording, [`ReadError::Crowded`] if particles lie on each other as
    /// in no packing.
    pub fn packing(&self, frame: &Frame) -> Result<Packing, ReadError> {
        self.packing_and_overlaps(frame).map(|(packing, _)| packing)
    }

    /// The packing at a frame, and the number of pairs of its disks that overlap.
    fn packing_and_overlaps(&self, frame: &Frame) -> Result<(Packing, usize), ReadError> {
        let domain = frame.domain.unwrap_or(self.header.domain);
        let packing = self.packing_anywhere(domain, frame.positions.clone())?;
        match crowding::pairs(&packing) {
            Ok(overlaps) => Ok((packing, overlaps)),
            Err(Crowd { particle, others }) => Err(ReadError::Crowded {
                path: self.path.clone(),
                step: frame.step,
                particle,
                others,
            }),
        }
    }

    /// The particles at any positions in a box.
    pub(super) fn packing_anywhere(
        &self,
        domain: Domain,
        positions: Vec<Vec2>,
    ) -> Result<Packing, ReadError> {
        let radii = self.header.radii.clone();
        Packing::new(domain, radii, positions).map_err(|error| self.damaged(error.to_string()))
    }

    /// Whether the scene can be run from `frame` on within the budget: to be asked before it is.
    ///
    /// # Errors
    ///
    /// [`ReadError::Budget`] names what takes too much and the way out.
    pub fn check_run(&self, frame: &Frame) -> Result<(), ReadError> {
        let (_, overlaps) = self.packing_and_overlaps(frame)?;
        let (scene, particles) = (self.scene(), self.header.radii.len());
        let name = format!("a run of its scene with {}", counted(particles, "particle"));
        self.allow(name, scene.memory_estimate(particles))?;
        let unknowns = overlaps.max(frame.contacts.len());
        if scene.contact_solver != Method::GaussJordan {
            return Ok(());
        }
        let unknown = counted(unknowns, "unknown");
        let name = format!("its contact_solver \"gauss-jordan\" with {unknown}");
        self.allow(&name, (unknowns as u64).saturating_pow(2).saturating_mul(8))?;
        if unknowns <= LARGEST_DENSE {
            return Ok(());
        }
        Err(ReadError::Budget {
            path: self.path.clone(),
            problem: format!(
                "{name} takes longer than anyone waits, more than {LARGEST_DENSE} are not run; `softjam replay --only balance` \
                 does without a run"
            ),
        })
    }

    /// Refuses what takes more memory than there may be.
    pub(crate) fn allow(&self, what: impl core::fmt::Display, bytes: u64) -> Result<(), ReadError> {
        let allowed = self.budget.allow(what, bytes);
        allowed.map_err(|exceeded| ReadError::Budget {
            path: self.path.clone(),
            problem: exceeded.to_string(),
        })
    }

    pub(super) fn allow_waiting_metrics(&self) -> Result<(), ReadError> {
        let steps = self.metrics.len() as u64;
        let name = format!(
            "the metrics of {} between two states",
            counted(steps, "step")
        );
        let allowed = self.budget.allow_piece(name, WAITING_METRICS * steps);
        allowed.map_err(|exceeded| ReadError::Budget {
            path: self.path.clone(),
            problem: exceeded.to_string(),
        })
    }
}
