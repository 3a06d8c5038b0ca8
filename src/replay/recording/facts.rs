//! What a recording says of itself, and how far it has been read.

use super::{Metrics, Recording};
use crate::domain::{Domain, Vec2};
use crate::record::{Format, Leg, Outcome};
use crate::replay::ReadError;
use crate::replay::source::Ending;
use crate::replay::standing::Standing;
use crate::replay::walk::End;
use crate::scene::{Minimizer, Scene};
use crate::state::coverage;

impl Recording {
    /// The scene that was run.
    #[must_use]
    pub fn scene(&self) -> &Scene {
        &self.header.scene
    }

    /// The undeformed radii `R_i`, one a particle.
    #[must_use]
    pub fn radii(&self) -> &[f64] {
        &self.header.radii
    }

    /// The periodic box.
    #[must_use]
    pub fn domain(&self) -> Domain {
        self.header.domain
    }

    /// The coverage of the undeformed disks `φ`.
    #[must_use]
    pub fn coverage(&self) -> f64 {
        coverage(&self.header.radii, self.header.domain)
    }

    /// The program that recorded it, as `softjam 0.1.0`.
    #[must_use]
    pub fn program(&self) -> &str {
        &self.header.program
    }

    /// Whether this program gives the bits of the run that was recorded, whatever version that was.
    #[must_use]
    pub fn has_same_bits(&self) -> bool {
        // Revision 2 changed Newton's method alone.
        let legs = self.legs().iter().map(|leg| leg.minimizer);
        let mut minimizers = legs.chain([self.scene().minimizer]);
        let unchanged = self.header.bits == 1 && minimizers.all(|m| m == Minimizer::Fire);
        self.header.bits == crate::BITS || unchanged
    }

    /// The version of the layout.
    #[must_use]
    pub fn format_version(&self) -> u32 {
        self.header.format
    }

    /// The [revision of the bits](crate::BITS) that it was recorded with.
    #[must_use]
    pub fn bits(&self) -> u32 {
        self.header.bits
    }

    /// The header of a recording like this one.
    ///
    /// # Errors
    ///
    /// [`ReadError::Damaged`] if its radii and box make no packing.
    pub fn header(&self) -> Result<crate::record::Header, ReadError> {
        // Radii and box are all that a header has of a packing.
        let corner = vec![Vec2::zeros(); self.header.radii.len()];
        let packing = self.packing_anywhere(self.header.domain, corner)?;
        Ok(crate::record::Header {
            scene: self.header.scene.clone(),
            packing,
            from_step: self.header.from_step,
            legs: self.header.legs.clone(),
            format: self.header.format,
            program: self.header.program.clone(),
            bits: self.header.bits,
        })
    }

    /// The step that the recording begins with; not 0 if its run went on from another recording.
    #[must_use]
    pub fn from_step(&self) -> u64 {
        self.header.from_step
    }

    /// How the run came to its first step, where not as a run of the scene would: what it went by before, in order.
    #[must_use]
    pub fn legs(&self) -> &[Leg] {
        &self.header.legs
    }

    /// The name of the file.
    #[must_use]
    pub fn path(&self) -> &str {
        &self.path
    }

    /// The format of the file.
    #[must_use]
    pub fn format(&self) -> Format {
        self.format
    }

    /// Whether the file was closed by its writer; if not, it breaks off. Known when the end is reached.
    #[must_use]
    pub fn is_closed(&self) -> bool {
        self.source.ending() == Some(Ending::Closed)
    }

    /// How the run stood at the end of the file. Known when the end is reached.
    #[must_use]
    pub fn standing(&self) -> Standing {
        let converged = self.outcome.map(|end| end.converged);
        Standing::of(self.is_closed(), self.source.is_of_softjam(), converged)
    }

    /// The last step whose state has been read in full.
    #[must_use]
    pub fn intact(&self) -> Option<u64> {
        self.steps.last()
    }

    /// The rows of the metrics that no state has taken along.
    pub(in crate::replay) fn rows_left(&mut self) -> Metrics {
        core::mem::take(&mut self.metrics)
    }

    /// How the file ends, once its end is reached.
    pub(in crate::replay) fn end(&self) -> End {
        End {
            closed: self.is_closed(),
            outcome: self.outcome,
        }
    }

    /// Whether the file claims to be laid out by softjam, and not by another program that rewrote it.
    #[must_use]
    pub fn is_laid_out_by_softjam(&self) -> bool {
        self.source.is_of_softjam()
    }

    /// How the run ended, as far as it has been read.
    #[must_use]
    pub fn outcome(&self) -> Option<Outcome> {
        self.outcome
    }
}
