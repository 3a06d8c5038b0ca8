//! What the colours of the particles mean.

use super::ColorBy;
use super::bar::Bar;
use super::legend::Legend;
use crate::analysis::held;
use crate::contacts::Contacts;
use crate::models::droplet::contour::Contours;
use crate::state::Frame;
use core::f64::consts::PI;

/// The colour of a particle that nothing is said of.
const PLAIN: &str = "#cfdfe8";
/// The colour of a rattler.
pub(super) const PALE: &str = "#f4f4f4";

/// The colours of the particles.
pub(super) struct Shades {
    values: Vec<f64>,
    held: Vec<bool>,
    bar: Bar,
}

impl Shades {
    pub(super) fn of(
        (color, range): (ColorBy, Option<[f64; 2]>),
        radii: &[f64],
        frame: &Frame,
        contacts: &Contacts<'_>,
        contours: &Contours,
    ) -> Self {
        let held = held(radii.len(), contacts.pairs);
        let (values, title) = match color {
            ColorBy::Pressure => (pressures(radii, contacts), "p / ⟨p⟩"),
            ColorBy::Deformation => {
                let deformation = |p: usize| {
                    let off = contours
                        .polygon(p)
                        .iter()
                        .map(|v| ((v - frame.positions[p]).norm() / radii[p] - 1.0).abs());
                    off.fold(0.0, f64::max)
                };
                ((0..radii.len()).map(deformation).collect(), "max |ΔR| / R")
            }
            ColorBy::Nothing => (Vec::new(), ""),
        };
        let shown = values.iter().zip(&held).filter(|(_, held)| **held);
        let shown: Vec<f64> = shown.map(|(value, _)| *value).collect();
        let bar = Bar::of(title, &shown, range, shade);
        Self { values, held, bar }
    }

    pub(super) fn fill(&self, p: usize) -> String {
        match self.values.get(p) {
            _ if !self.held[p] => PALE.to_owned(),
            Some(value) => self.bar.shade(*value),
            None => PLAIN.to_owned(),
        }
    }

    /// How many particles rattle.
    pub(super) fn rattlers(&self) -> usize {
        self.held.iter().filter(|held| !**held).count()
    }

    /// The colour bar, where colours mean something.
    pub(super) fn key(&self, legend: &mut Legend) {
        if !self.values.is_empty() {
            self.bar.draw(legend);
        }
    }
}

/// Viridis, light enough for black chains on it.
fn shade(part: f64) -> String {
    let c = colorous::VIRIDIS.eval_continuous(0.08 + 0.9 * part);
    let light = |part: u8| (0.62 * f64::from(part) + 0.38 * 255.0) as u8;
    format!("#{:02x}{:02x}{:02x}", light(c.r), light(c.g), light(c.b))
}

/// The pressure on each particle, `p_i = Σ_j f_ij / 2πR_i`, over its mean over the particles that have a contact.
fn pressures(radii: &[f64], contacts: &Contacts<'_>) -> Vec<f64> {
    let mut pressure = vec![0.0; radii.len()];
    for (&[i, j], f) in contacts.pairs.iter().zip(contacts.forces) {
        pressure[i as usize] += f / (2.0 * PI * radii[i as usize]);
        pressure[j as usize] += f / (2.0 * PI * radii[j as usize]);
    }
    let pressed = pressure.iter().filter(|p| **p > 0.0).count().max(1);
    let average = pressure.iter().sum::<f64>() / pressed as f64;
    if average > 0.0 {
        for p in &mut pressure {
            *p /= average;
        }
    }
    pressure
}
