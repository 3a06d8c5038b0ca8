//! What the colours of the particles mean: a quantity, its range, a colour bar.

use super::ColorBy;
use super::legend::{Legend, length};
use super::shapes::{hundredths, line, rectangle};
use crate::analysis::held;
use crate::contacts::Contacts;
use crate::models::droplet::contour::Contours;
use crate::state::Frame;
use core::f64::consts::PI;
use svg::Node as _;
use svg::node::element::Group;

/// The colour of a particle that nothing is said of.
const PLAIN: &str = "#cfdfe8";
/// The colour of a rattler.
pub(super) const PALE: &str = "#f4f4f4";
/// What part of the particles may lie beyond either end of a range that the packing itself gives.
const BEYOND: f64 = 0.02;
/// Steps of the colour bar.
const STEPS: usize = 64;

/// The colours of the particles.
pub(super) struct Shades {
    values: Vec<f64>,
    held: Vec<bool>,
    range: Range,
    title: &'static str,
}

/// The numbers at the ends of a colour bar, and those that are written at it.
struct Range {
    low: f64,
    high: f64,
    ticks: Vec<f64>,
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
        let range = match range {
            Some([low, high]) => Range {
                low,
                high,
                ticks: vec![low, 0.5 * (low + high), high],
            },
            None => Range::of(&values, &held),
        };
        Self {
            values,
            held,
            range,
            title,
        }
    }

    pub(super) fn fill(&self, p: usize) -> String {
        match self.values.get(p) {
            _ if !self.held[p] => PALE.to_owned(),
            Some(value) => self.shade(*value),
            None => PLAIN.to_owned(),
        }
    }

    /// How many particles rattle.
    pub(super) fn rattlers(&self) -> usize {
        self.held.iter().filter(|held| !**held).count()
    }

    /// The colour of a value: viridis, light enough for black chains on it.
    fn shade(&self, value: f64) -> String {
        let Range { low, high, .. } = self.range;
        let part = ((value - low) / (high - low)).clamp(0.0, 1.0);
        let c = colorous::VIRIDIS.eval_continuous(0.08 + 0.9 * part);
        let light = |part: u8| (0.62 * f64::from(part) + 0.38 * 255.0) as u8;
        format!("#{:02x}{:02x}{:02x}", light(c.r), light(c.g), light(c.b))
    }

    /// The colour bar, where colours mean something.
    pub(super) fn bar(&self, legend: &mut Legend) {
        if self.values.is_empty() {
            return;
        }
        let font = legend.font();
        let (before, long) = (length(self.title) + 1.0, 11.0);
        let (left, middle) = legend.place((before + long + 1.0, 2.6));
        let (before, across, thick) = (before * font, long * font, 0.85 * font);
        legend.write(self.title, (left, middle), "start");
        let (from, top) = (left + before, middle - 0.5 * thick);
        let mut bar = Group::new();
        let Range { low, high, .. } = self.range;
        for k in 0..STEPS {
            let step = across / STEPS as f64;
            let value = low + (high - low) * (k as f64 + 0.5) / STEPS as f64;
            // A little wider, so that no light shows between.
            let wide = if k + 1 < STEPS { step + 0.6 } else { step };
            let piece = rectangle((from + k as f64 * step, top), (wide, thick));
            bar.append(piece.set("fill", self.shade(value)));
        }
        legend.add(bar);
        let shown = self.values.iter().zip(&self.held).filter(|v| *v.1);
        let lower = shown.clone().any(|(v, _)| *v < low);
        let higher = shown.clone().any(|(v, _)| *v > high);
        let label = |value: f64| {
            let beyond = match value {
                _ if value == low && lower => "≤ ",
                _ if value == high && higher => "≥ ",
                _ => "",
            };
            format!("{beyond}{}", short(value))
        };
        let at = |value: f64| long * (value - low) / (high - low);
        // Numbers that others leave no room for are left out, those at the ends never.
        let half = |value: f64| 0.5 * length(&label(value)) + 0.25;
        let (mut taken, end) = (f64::MIN, at(high) - half(high));
        for &value in &self.range.ticks {
            let x = hundredths(from + font * at(value));
            let mark = line([(x, top + thick), (x, top + thick + 3.0)], 0.8);
            legend.add(mark.set("stroke", super::INK));
            let fits = at(value) - half(value) > taken && at(value) + half(value) < end;
            if fits || value == low || value == high {
                taken = at(value) + half(value);
                let below = top + thick + 3.0 + 0.62 * font;
                legend.write(&label(value), (x, below), "middle");
            }
        }
    }
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

impl Range {
    /// Round numbers around all but the least and the largest [`BEYOND`] of the values of those that are held: particles that
    /// differ by little differ in colour, too.
    fn of(values: &[f64], held: &[bool]) -> Self {
        let shown = values
            .iter()
            .zip(held)
            .filter(|(v, held)| **held && v.is_finite());
        let mut sorted: Vec<f64> = shown.map(|(v, _)| *v).collect();
        sorted.sort_by(f64::total_cmp);
        let at = |part: f64| {
            let place = libm::round(part * sorted.len().saturating_sub(1) as f64);
            sorted.get(place as usize).copied().unwrap_or(0.0)
        };
        let (low, high) = (at(BEYOND), at(1.0 - BEYOND));
        if high <= 0.0 {
            return Self::between(0.0, 2.0, 0.5);
        }
        // All alike are the colour of the middle.
        let least = 0.2 * high;
        let (middle, narrow) = (0.5 * (low + high), high - low < least);
        let low = if narrow { middle - 0.5 * least } else { low };
        let high = if narrow { middle + 0.5 * least } else { high };
        let step = super::axis::round_step((high - low) / 5.0);
        let low = (libm::floor(low / step + 1e-9) * step).max(0.0);
        Self::between(low, libm::ceil(high / step - 1e-9) * step, step)
    }

    fn between(low: f64, high: f64, step: f64) -> Self {
        let steps = libm::round((high - low) / step) as usize;
        // The last is the end itself, to the last bit.
        let ticks = (0..steps).map(|k| low + k as f64 * step).chain([high]);
        let ticks = ticks.collect();
        Self { low, high, ticks }
    }
}

/// A number without the digits that rounding has left behind its fourth.
fn short(x: f64) -> String {
    let text = format!("{x:.3e}");
    text.parse::<f64>()
        .map_or(text, |rounded| rounded.to_string())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_range_has_round_ends_around_what_it_shows() {
        let range = |values: &[f64]| {
            let range = Range::of(values, &vec![true; values.len()]);
            (short(range.low), short(range.high), range.ticks.len())
        };
        let spread = |low: f64, high: f64| -> Vec<f64> {
            (0..=100)
                .map(|k| low + (high - low) * f64::from(k) / 100.0)
                .collect()
        };
        let text = |low: &str, high: &str, ticks| (low.to_owned(), high.to_owned(), ticks);
        assert_eq!(range(&spread(0.0, 2.0)), text("0", "2", 5));
        assert_eq!(range(&spread(0.65, 1.33)), text("0.6", "1.4", 5));
        assert_eq!(range(&spread(0.002, 0.03)), text("0", "0.03", 4));
        // A crystal, nothing at all, and what is no number.
        assert_eq!(range(&[1.0; 7]), text("0.9", "1.1", 5));
        assert_eq!(range(&[]), text("0", "2", 5));
        assert_eq!(range(&[f64::NAN, f64::INFINITY]), text("0", "2", 5));
        assert_eq!(range(&[0.0; 3]), text("0", "2", 5));
    }
}
