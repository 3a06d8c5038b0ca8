//! A colour bar: which colour a value has, and the numbers written at it.

use super::legend::{Legend, length};
use super::shapes::{hundredths, line, rectangle};
use svg::Node as _;
use svg::node::element::Group;

/// What part of the values may lie beyond either end of a range that they themselves give.
const BEYOND: f64 = 0.02;
/// Steps of the colour bar.
const STEPS: usize = 64;

/// The colours of values.
pub(super) struct Bar {
    title: &'static str,
    range: Range,
    /// Whether there are values below and above the range.
    beyond: [bool; 2],
    /// The colour of a part of the range, 0 to 1.
    color: fn(f64) -> String,
}

/// The numbers at the ends of a colour bar, and those that are written at it.
struct Range {
    low: f64,
    high: f64,
    ticks: Vec<f64>,
}

impl Bar {
    /// For the values that are `shown`, from one end of `range` to the other, or between round numbers around the values.
    pub(super) fn of(
        title: &'static str,
        shown: &[f64],
        range: Option<[f64; 2]>,
        color: fn(f64) -> String,
    ) -> Self {
        let range = match range {
            Some([low, high]) => Range {
                low,
                high,
                ticks: vec![low, 0.5 * (low + high), high],
            },
            None => Range::of(shown),
        };
        let lower = shown.iter().any(|v| *v < range.low);
        let higher = shown.iter().any(|v| *v > range.high);
        Self {
            title,
            range,
            beyond: [lower, higher],
            color,
        }
    }

    pub(super) fn shade(&self, value: f64) -> String {
        let Range { low, high, .. } = self.range;
        (self.color)(((value - low) / (high - low)).clamp(0.0, 1.0))
    }

    pub(super) fn draw(&self, legend: &mut Legend) {
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
        let [lower, higher] = self.beyond;
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

impl Range {
    /// Round numbers around all but the least and the largest [`BEYOND`] of the values: what differs by little differs in
    /// colour, too.
    fn of(values: &[f64]) -> Self {
        let shown = values.iter().filter(|v| v.is_finite());
        let mut sorted: Vec<f64> = shown.copied().collect();
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
            let range = Range::of(values);
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
