//! The fall of `f_max` with the number of steps: the seed's figure 6.

use super::{FONT, FigureError};
use plotters::prelude::{
    ChartBuilder, IntoDrawingArea, IntoLogRange, PathElement, SVGBackend, SeriesLabelPosition,
};
use plotters::series::LineSeries;
use plotters::style::{BLACK, Color, RGBColor, WHITE};

/// The fall of `f_max` in one run.
///
/// ```
/// use softjam::figure::{Fall, relaxation};
///
/// let points = (0..200).map(|step| (step, 0.1 * 0.9_f64.powi(step as i32))).collect();
/// let svg = relaxation(&[Fall { label: "φ = 0.86".to_owned(), points }]).unwrap();
/// assert!(svg.contains("φ = 0.86"));
/// assert!(relaxation(&[]).is_err());
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Fall {
    /// What it is called in the legend.
    pub label: String,
    /// Steps with their `f_max` (units of γ).
    pub points: Vec<(u64, f64)>,
}

/// The colours of M. Okabe and K. Ito (2008), which the colour-blind can tell apart.
const COLORS: [RGBColor; 7] = [
    RGBColor(0, 114, 178),
    RGBColor(213, 94, 0),
    RGBColor(0, 158, 115),
    RGBColor(204, 121, 167),
    RGBColor(230, 159, 0),
    RGBColor(86, 180, 233),
    RGBColor(60, 60, 60),
];

const SIZE: (u32, u32) = (720, 460);

/// The backend knows whole units only; in quarters of a pixel curves are smooth.
const FINE: u32 = 4;

/// The smallest `f_max` that is drawn; 0 has no place on a logarithmic axis.
const LEAST: f64 = 1e-18;

/// Points beyond this number add bytes and nothing to the picture.
const POINTS: usize = 4000;

/// Draws `f_max` against step, on a logarithmic axis.
///
/// # Errors
///
/// [`FigureError::Nothing`] if there is no point to draw.
///
/// See the example of [`Fall`].
pub fn relaxation(runs: &[Fall]) -> Result<String, FigureError> {
    let values = || runs.iter().flat_map(|run| &run.points);
    let nothing = || FigureError::Nothing("there is no f_max to draw".to_owned());
    let last = values().map(|p| p.0).max().ok_or_else(nothing)?.max(1);
    let drawn = |f: f64| f.max(LEAST);
    let least = values().map(|p| drawn(p.1)).fold(f64::MAX, f64::min);
    let most = values().map(|p| drawn(p.1)).fold(LEAST, f64::max);
    let decade = |x: f64| libm::exp10(x);
    let range = decade(libm::floor(libm::log10(least)))
        ..decade(libm::ceil(libm::log10(most)).max(libm::floor(libm::log10(least)) + 1.0));
    let mut svg = String::new();
    draw(&mut svg, runs, last, range).map_err(|e| FigureError::Draw(e.to_string()))?;
    let (fine, size) = ((SIZE.0 * FINE, SIZE.1 * FINE), SIZE);
    let of_size = |(width, height): (u32, u32)| format!("width=\"{width}\" height=\"{height}\"");
    let svg = svg.replacen(&of_size(fine), &of_size(size), 1);
    Ok(svg.replace("f_max", &super::f_max(16 * FINE)))
}

fn draw(
    svg: &mut String,
    runs: &[Fall],
    last: u64,
    range: core::ops::Range<f64>,
) -> Result<(), Box<dyn std::error::Error>> {
    let area = SVGBackend::with_string(svg, (SIZE.0 * FINE, SIZE.1 * FINE)).into_drawing_area();
    area.fill(&WHITE)?;
    let mut chart = ChartBuilder::on(&area)
        .margin(14 * FINE)
        .margin_right(24 * FINE)
        .x_label_area_size(46 * FINE)
        .y_label_area_size(74 * FINE)
        .build_cartesian_2d(0..last, range.log_scale())?;
    chart
        .configure_mesh()
        .x_desc("step")
        .y_desc("f_max / γ")
        .x_labels(6)
        .y_labels(12)
        .y_label_formatter(&|f| super::decade(libm::round(libm::log10(*f)) as i32))
        .light_line_style(WHITE.mix(0.0))
        .bold_line_style(BLACK.mix(0.08).stroke_width(FINE))
        .axis_style(BLACK.mix(0.75).stroke_width(FINE))
        .label_style((FONT, 14 * FINE))
        .axis_desc_style((FONT, 16 * FINE))
        .draw()?;
    for (run, color) in runs.iter().zip(COLORS.iter().cycle()) {
        let every = run.points.len().div_ceil(POINTS).max(1);
        let points = run.points.iter().enumerate();
        let end = run.points.len().saturating_sub(1);
        let shown = points.filter(|(k, _)| k % every == 0 || *k == end);
        let line = shown.map(|(_, &(step, f))| (step, f.max(LEAST)));
        chart
            .draw_series(LineSeries::new(line, color.stroke_width(3 * FINE / 2)))?
            .label(&run.label)
            .legend(|(x, y)| {
                PathElement::new(
                    [(x, y), (x + 22 * FINE as i32, y)],
                    color.stroke_width(3 * FINE),
                )
            });
    }
    chart
        .configure_series_labels()
        .position(SeriesLabelPosition::UpperRight)
        .margin(10 * FINE)
        .background_style(WHITE.mix(0.85))
        .label_font((FONT, 14 * FINE))
        .legend_area_size(30 * FINE)
        .draw()?;
    area.present()?;
    Ok(())
}
