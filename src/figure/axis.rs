//! Axes: where a number lies, and which numbers are written.

use super::FigureError;
use core::ops::Range;

/// How the numbers of an axis are spaced.
///
/// See the example of [`chart`](super::chart).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Scale {
    /// Evenly.
    #[default]
    Linear,
    /// By decades; what is not positive is left out.
    Logarithmic,
}

/// An axis of a [`chart`](super::chart).
///
/// See the example of [`chart`](super::chart).
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Axis {
    /// What it shows, with its unit; `f_max` is printed with its index.
    pub title: String,
    /// How its numbers are spaced.
    pub scale: Scale,
}

impl Scale {
    /// Where a number lies on the axis; `None` if it has no place there.
    pub(super) fn place(self, value: f64) -> Option<f64> {
        let at = match self {
            Self::Linear => value,
            Self::Logarithmic if value > 0.0 => libm::log10(value),
            Self::Logarithmic => return None,
        };
        at.is_finite().then_some(at)
    }
}

/// The numbers along an axis: its ends, and where its marks are, both as [`Scale::place`] counts.
pub(super) struct Ruler {
    scale: Scale,
    ends: Range<f64>,
    step: f64,
}

impl Ruler {
    pub(super) fn over(
        scale: Scale,
        values: impl Iterator<Item = f64>,
    ) -> Result<Self, FigureError> {
        let places = values.filter_map(|v| scale.place(v));
        let (least, most) = places.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), v| {
            (a.min(v), b.max(v))
        });
        if least > most {
            let problem = "there is no point to draw".to_owned();
            return Err(FigureError::Nothing(problem));
        }
        let (ends, step) = match scale {
            Scale::Linear => linear(least, most)?,
            Scale::Logarithmic => {
                let from = libm::floor(least);
                let to = libm::ceil(most).max(from + 1.0);
                (from..to, libm::ceil((to - from) / 14.0))
            }
        };
        Ok(Self { scale, ends, step })
    }

    /// Where a number lies between the ends, 0 to 1.
    pub(super) fn part(&self, value: f64) -> Option<f64> {
        self.scale.place(value).map(|at| self.part_of_place(at))
    }

    fn part_of_place(&self, at: f64) -> f64 {
        (at - self.ends.start) / (self.ends.end - self.ends.start)
    }

    /// Where marks with a number are, 0 to 1, and the numbers.
    pub(super) fn labels(&self) -> Vec<(f64, String)> {
        let first = libm::ceil(self.ends.start / self.step - 1e-9);
        let last = libm::floor(self.ends.end / self.step + 1e-9);
        (first as i64..=last as i64)
            .map(|k| k as f64 * self.step)
            .map(|at| (self.part_of_place(at), self.label(at)))
            .collect()
    }

    fn label(&self, at: f64) -> String {
        match self.scale {
            Scale::Linear => {
                let digits = (-libm::floor(libm::log10(self.step) + 1e-9)).max(0.0) as usize;
                // No minus sign before zero.
                format!("{:.digits$}", at + 0.0)
            }
            Scale::Logarithmic => super::decade(libm::round(at) as i32),
        }
    }

    /// Where marks without a number are, 0 to 1: 2 to 9 within decades that are all numbered, decades in between where not.
    pub(super) fn minor(&self) -> Vec<f64> {
        let decades = || libm::round(self.ends.start) as i64..libm::round(self.ends.end) as i64;
        let places: Vec<f64> = match self.scale {
            Scale::Linear => Vec::new(),
            Scale::Logarithmic if self.step > 1.0 => decades().map(|k| k as f64).collect(),
            Scale::Logarithmic if decades().count() > MOST_DIVIDED => Vec::new(),
            Scale::Logarithmic => decades()
                .flat_map(|k| (2..=9).map(move |m| k as f64 + libm::log10(f64::from(m))))
                .collect(),
        };
        let parts = places.into_iter().map(|at| self.part_of_place(at));
        parts.collect()
    }
}

/// Decades that are divided at most.
const MOST_DIVIDED: usize = 6;

/// The least of 1, 2 and 5 times a power of ten that is not below `rough`.
pub(super) fn round_step(rough: f64) -> f64 {
    let decade = libm::exp10(libm::floor(libm::log10(rough)));
    let fits = |m: &f64| m * decade >= 0.999 * rough;
    let step = [1.0, 2.0, 5.0].into_iter().find(fits);
    step.map_or(10.0 * decade, |m| m * decade)
}

/// Ends and step of an axis of evenly spaced numbers.
fn linear(least: f64, most: f64) -> Result<(Range<f64>, f64), FigureError> {
    let step_of = |width: f64| round_step(width / 6.0);
    let (mut width, mut step) = (most - least, step_of(most - least));
    if !(step > 0.0 && step.is_finite()) {
        // One number, or numbers as good as one.
        width = most.abs().max(1.0);
        step = step_of(width);
    }
    // An axis that starts at zero starts there.
    let air = 0.04 * width;
    let from = if least == 0.0 { 0.0 } else { least - air };
    let to = most + air;
    if !(to - from).is_finite() {
        let problem = format!("{least:e} and {most:e} do not go on one axis");
        return Err(FigureError::Draw(problem));
    }
    Ok((from..to, step))
}
