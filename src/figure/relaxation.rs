//! The fall of `f_max` with the number of steps: Saitoh's figure 6.

use super::{Axis, CHART_WIDTH, Curve, FigureError, Mark, Scale, chart_in};

/// The fall of `f_max` in one run.
///
/// ```
/// use softjam::figure::{Fall, relaxation};
///
/// let points = (0..200).map(|step| (step, 0.1 * 0.9_f64.powi(step as i32))).collect();
/// let svg = relaxation(&[Fall { label: "φ = 0.86".to_owned(), points, threshold: Some(1e-8) }]).unwrap();
/// assert!(svg.contains("φ = 0.86") && svg.contains("threshold"));
/// assert!(relaxation(&[]).is_err());
/// ```
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Fall {
    /// What it is called in the legend; runs of one name share a colour.
    pub label: String,
    /// Steps with their `f_max` (units of γ).
    pub points: Vec<(u64, f64)>,
    /// Where the run ends (units of γ), drawn as a dashed line; left out below 10⁻¹⁸, where no `f_max` is drawn either.
    pub threshold: Option<f64>,
}

/// The smallest `f_max` that is drawn; 0 has no place on a logarithmic axis.
const LEAST: f64 = 1e-18;

/// Draws `f_max` against step, on a logarithmic axis, with the thresholds as dashed lines.
///
/// # Errors
///
/// [`FigureError::Nothing`] if there is no point to draw.
///
/// See the example of [`Fall`].
pub fn relaxation(runs: &[Fall]) -> Result<String, FigureError> {
    relaxation_in(CHART_WIDTH, runs)
}

/// [`relaxation`] of the given width (pixels of the SVG, 96 an inch); text is 8 points in narrow figures and 10 in wide ones.
///
/// # Errors
///
/// As [`relaxation`].
///
/// ```
/// use softjam::figure::{Fall, relaxation_in};
///
/// let run = Fall { points: vec![(0, 1e-1), (9, 1e-9)], ..Fall::default() };
/// assert!(relaxation_in(325.0, &[run]).unwrap().contains("width=\"325\""));
/// ```
pub fn relaxation_in(width: f64, runs: &[Fall]) -> Result<String, FigureError> {
    let steps = runs.iter().flat_map(|run| run.points.iter().map(|p| p.0));
    let nothing = || FigureError::Nothing("there is no f_max to draw".to_owned());
    let last = steps.max().ok_or_else(nothing)?;
    let place = |&(step, f): &(u64, f64)| (step as f64, f.max(LEAST));
    let curve = |run: &Fall| Curve {
        label: run.label.clone(),
        points: run.points.iter().map(place).collect(),
        ..Curve::default()
    };
    let mut curves: Vec<Curve> = runs.iter().map(curve).collect();
    let thresholds = runs.iter().filter_map(|run| run.threshold);
    let mut thresholds: Vec<f64> = thresholds.filter(|f| *f >= LEAST).collect();
    thresholds.sort_by(f64::total_cmp);
    thresholds.dedup();
    curves.extend(thresholds.into_iter().map(|f| Curve {
        label: "threshold".to_owned(),
        points: vec![(0.0, f), (last.max(1) as f64, f)],
        mark: Mark::Dashes,
        ..Curve::default()
    }));
    let axis = |title: &str, scale| Axis {
        title: title.to_owned(),
        scale,
    };
    let (steps, falls) = (
        axis("step", Scale::Linear),
        axis("f_max / γ", Scale::Logarithmic),
    );
    chart_in(width, &steps, &falls, &curves)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn threshold_below_every_f_max_that_is_drawn_is_left_out() {
        let drawn = |threshold| {
            let points = vec![(0, 1e-2), (1, 1e-9)];
            let label = "run".to_owned();
            relaxation(&[Fall {
                label,
                points,
                threshold,
            }])
            .unwrap()
        };
        let without = drawn(None);
        for threshold in [1e-300, 0.0, -1.0, f64::NAN, 0.999 * LEAST] {
            assert_eq!(drawn(Some(threshold)), without, "{threshold}");
        }
        assert!(drawn(Some(LEAST)).contains("threshold"));
    }
}
