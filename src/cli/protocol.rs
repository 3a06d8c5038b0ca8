//! The common protocols as flags.

use clap::Args;
use softjam::scene::StageFields;

const PROTOCOL: &str = "Protocol";

/// What is done behind the relaxation, in this order. Scenes have all of it, in any order: `softjam scene --jam` shows how.
#[derive(Args)]
pub struct ProtocolFlags {
    /// Compress to this coverage, or decompress, in steps of 0.001 with a relaxation behind each.
    #[arg(long, value_name = "PHI", allow_negative_numbers = true, value_parser = super::flags::real, help_heading = PROTOCOL)]
    compress_to: Option<f64>,

    /// Find φ_J: decompress so that the pressure halves, and extrapolate to none. Where the search starts from (--phi) is part of the answer.
    #[arg(long, help_heading = PROTOCOL)]
    jam: bool,

    /// Shear (simple, quasi-static) by this strain, or to the other side if it is negative. Central forces do net work on closed loops of
    /// strain: take --forces gradient or another model for energies.
    #[arg(long, value_name = "STRAIN", allow_negative_numbers = true, value_parser = super::flags::real, help_heading = PROTOCOL)]
    shear: Option<f64>,

    /// How far a step of --shear goes (strain) [default: 0.001].
    #[arg(long, value_name = "STRAIN", allow_negative_numbers = true, value_parser = super::flags::real, requires = "shear", help_heading = PROTOCOL)]
    strain_step: Option<f64>,
}

impl ProtocolFlags {
    /// The stages; `None` if no flag asks for one.
    pub fn fields(&self) -> Option<Vec<StageFields>> {
        let act = |name: &str| StageFields {
            act: Some(name.to_owned()),
            ..StageFields::default()
        };
        let compress = self.compress_to.map(|phi| StageFields {
            phi: Some(phi),
            ..act("compress")
        });
        let jam = self.jam.then(|| act("jam"));
        let shear = self.shear.map(|strain| StageFields {
            strain: Some(strain),
            step: self.strain_step,
            ..act("shear")
        });
        let stages: Vec<_> = [compress, jam, shear].into_iter().flatten().collect();
        (!stages.is_empty()).then_some(stages)
    }
}
