//! What a verb says: lines of a name and a value.

use softjam::domain::Domain;
use softjam::models::Kind;
use softjam::scene::Scene;
use softjam::text::{length, lines, shown};
use std::fmt::{Display, Write as _};

/// Lines of a name and a value; values pass through [`shown`], since many are text from a file.
#[derive(Default)]
pub struct Lines {
    text: String,
}

impl Lines {
    pub fn line(&mut self, name: &str, value: impl Display) {
        // Writing to a String cannot fail.
        let _ = writeln!(self.text, "{name:<14} {}", shown(&value.to_string()));
    }

    /// The packing of a run of `scene`, and what else there is to say of it.
    pub fn packing(&mut self, scene: &Scene, n: usize, phi: f64, domain: Domain, more: &str) {
        // Droplets are what a packing is of unless it is said.
        let disks = match scene.model {
            Kind::MorseWitten => "",
            Kind::RoundedPolygon => " rounded polygons",
            Kind::WetFoam => " droplets of wet foam",
            Kind::Disks => " disks",
        };
        let [x, y] = [domain.lengths().x, domain.lengths().y].map(length);
        let packing = format!("N = {n}{disks}, φ = {phi:.4}, box {x} × {y}, {more}");
        self.line("packing", packing);
    }

    /// What is said at the end, in whole sentences that may be long.
    pub fn say(&mut self, name: &str, sentences: &str) {
        let _ = writeln!(self.text, "{name:<14} {}", lines(sentences));
    }

    pub fn into_text(self) -> String {
        self.text
    }
}
