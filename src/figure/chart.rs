//! Curves over linear or logarithmic axes.

use super::{FONT, FigureError};
use core::ops::Range;
use plotters::chart::ChartContext;
use plotters::coord::Shift;
use plotters::coord::cartesian::Cartesian2d;
use plotters::coord::ranged1d::{KeyPointHint, NoDefaultFormatting, Ranged, ValueFormatter};
use plotters::element::DashedPathElement;
use plotters::prelude::{
    ChartBuilder, Circle, DashedLineSeries, DrawingArea, IntoDrawingArea, PathElement, SVGBackend,
    SeriesLabelPosition,
};
use plotters::series::LineSeries;
use plotters::style::{BLACK, Color, RGBColor, ShapeStyle, WHITE};
use std::collections::BTreeSet;

/// How the numbers of an axis are spaced.
///
/// See the example of [`chart`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Scale {
    /// Evenly.
    #[default]
    Linear,
    /// By decades; what is not positive is left out.
    Logarithmic,
}

/// An axis of a [`chart`].
///
/// See the example of [`chart`].
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Axis {
    /// What it shows, with its unit; `f_max` is printed with its index.
    pub title: String,
    /// How its numbers are spaced.
    pub scale: Scale,
}

/// How a [`Curve`] is drawn.
///
/// See the example of [`chart`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Mark {
    /// A line through the points.
    #[default]
    Line,
    /// A dashed line, in grey: a threshold, a theory.
    Dashes,
    /// A dot at each point.
    Dots,
}

/// Points that belong together.
///
/// See the example of [`chart`].
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Curve {
    /// What it is called in the legend; curves of one name share a colour and a line of the legend.
    pub label: String,
    /// The points `(x, y)`.
    pub points: Vec<(f64, f64)>,
    /// Half the length of the bar on each point (units of y); empty for no bars.
    pub errors: Vec<f64>,
    /// How it is drawn.
    pub mark: Mark,
}

/// The colours of M. Okabe and K. Ito (2008), which the colour-blind can tell apart.
const COLORS: [RGBColor; 6] = [
    RGBColor(0, 114, 178),
    RGBColor(213, 94, 0),
    RGBColor(0, 158, 115),
    RGBColor(204, 121, 167),
    RGBColor(230, 159, 0),
    RGBColor(86, 180, 233),
];

/// How many curves of a [`chart`] have a colour of their own; from there on colours come again.
///
/// ```
/// use softjam::figure::{Axis, CURVE_COLORS, Curve, chart};
///
/// let curve = |k: usize| Curve { label: format!("curve {k}"), points: vec![(0.0, 0.0), (1.0, k as f64)], ..Curve::default() };
/// let curves: Vec<Curve> = (0..=CURVE_COLORS).map(curve).collect();
/// let colors = |n: usize| {
///     let svg = chart(&Axis::default(), &Axis::default(), &curves[..n]).unwrap();
///     let lines = svg.split("<polyline").skip(1).filter_map(|line| line.split("stroke=\"").nth(1)?.split('"').next());
///     lines.map(str::to_owned).collect::<std::collections::BTreeSet<_>>().len()
/// };
/// assert_eq!(colors(CURVE_COLORS), colors(CURVE_COLORS - 1) + 1);
/// assert_eq!(colors(CURVE_COLORS + 1), colors(CURVE_COLORS));
/// ```
pub const CURVE_COLORS: usize = COLORS.len();

/// The colour of what is dashed.
const GREY: RGBColor = RGBColor(60, 60, 60);

const SIZE: (u32, u32) = (720, 460);

/// The backend knows whole units only; in quarters of a pixel curves are smooth.
const FINE: u32 = 4;

/// Points beyond this number add bytes and nothing to the picture.
const POINTS: usize = 4000;

/// Draws curves as SVG.
///
/// # Errors
///
/// [`FigureError::Nothing`] if there is no point to draw, [`FigureError::Draw`] if points lie farther from each other than
/// the largest number.
///
/// ```
/// use softjam::figure::{Axis, Curve, Mark, Scale, chart};
///
/// let axis = |title: &str, scale| Axis { title: title.to_owned(), scale };
/// let kernel = Curve {
///     label: "g".to_owned(),
///     points: (0..=314).map(|k| f64::from(k) / 100.0).map(|t| (t, softjam::droplet::kernel::g(t))).collect(),
///     ..Curve::default()
/// };
/// let svg = chart(&axis("θ (radians)", Scale::Linear), &axis("g(θ)", Scale::Linear), &[kernel]).unwrap();
/// assert!(svg.contains("θ (radians)"));
/// let none = Curve { mark: Mark::Dots, ..Curve::default() };
/// assert!(chart(&Axis::default(), &Axis::default(), &[none]).is_err());
/// ```
pub fn chart(x: &Axis, y: &Axis, curves: &[Curve]) -> Result<String, FigureError> {
    let reach = |c: &Curve, k: usize| {
        let (x, y) = c.points[k];
        let error = c.errors.get(k).copied().unwrap_or(0.0);
        [(x, y - error), (x, y), (x, y + error)]
    };
    let points = || {
        curves
            .iter()
            .flat_map(|c| (0..c.points.len()).flat_map(|k| reach(c, k)))
    };
    let shown = |&(a, b): &(f64, f64)| x.scale.place(a).is_some() && y.scale.place(b).is_some();
    let across = Ruler::over(x.scale, points().filter(shown).map(|p| p.0))?;
    let up = Ruler::over(y.scale, points().filter(shown).map(|p| p.1))?;
    let mut svg = String::new();
    let area =
        SVGBackend::with_string(&mut svg, (SIZE.0 * FINE, SIZE.1 * FINE)).into_drawing_area();
    draw(&area, (x, across), (y, up), curves).map_err(|e| FigureError::Draw(e.to_string()))?;
    drop(area);
    let of_size = |(width, height): (u32, u32)| format!("width=\"{width}\" height=\"{height}\"");
    let svg = svg.replacen(&of_size((SIZE.0 * FINE, SIZE.1 * FINE)), &of_size(SIZE), 1);
    Ok(svg.replace("f_max", &super::f_max(16 * FINE)))
}

impl Scale {
    /// Where a number lies on the axis; `None` if it has no place there.
    fn place(self, value: f64) -> Option<f64> {
        let at = match self {
            Self::Linear => value,
            Self::Logarithmic if value > 0.0 => libm::log10(value),
            Self::Logarithmic => return None,
        };
        at.is_finite().then_some(at)
    }
}

/// The numbers along an axis: its ends, and where its marks are, both as [`Scale::place`] counts.
#[derive(Clone)]
struct Ruler {
    scale: Scale,
    ends: Range<f64>,
    step: f64,
}

impl Ruler {
    fn over(scale: Scale, values: impl Iterator<Item = f64>) -> Result<Self, FigureError> {
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
}

/// Ends and step of an axis of evenly spaced numbers.
fn linear(least: f64, most: f64) -> Result<(Range<f64>, f64), FigureError> {
    let step_of = |width: f64| {
        let rough = width / 6.0;
        let decade = libm::exp10(libm::floor(libm::log10(rough)));
        let fits = |m: &f64| m * decade >= 0.999 * rough;
        let step = [1.0, 2.0, 5.0].into_iter().find(fits);
        step.map_or(10.0 * decade, |m| m * decade)
    };
    let (mut width, mut step) = (most - least, step_of(most - least));
    if !(step > 0.0 && step.is_finite()) {
        // One number, or numbers as good as one.
        width = most.abs().max(1.0);
        step = step_of(width);
    }
    // An axis that starts at zero starts there.
    let from = if least == 0.0 {
        0.0
    } else {
        least - 0.04 * width
    };
    let to = most + 0.04 * width;
    if !(to - from).is_finite() {
        let problem = format!("{least:e} and {most:e} do not go on one axis");
        return Err(FigureError::Draw(problem));
    }
    Ok((from..to, step))
}

impl Ranged for Ruler {
    type FormatOption = NoDefaultFormatting;
    type ValueType = f64;

    fn map(&self, value: &f64, limit: (i32, i32)) -> i32 {
        let part = (value - self.ends.start) / (self.ends.end - self.ends.start);
        limit.0 + libm::round(part * f64::from(limit.1 - limit.0)) as i32
    }

    fn key_points<Hint: KeyPointHint>(&self, _: Hint) -> Vec<f64> {
        let first = libm::ceil(self.ends.start / self.step - 1e-9);
        let last = libm::floor(self.ends.end / self.step + 1e-9);
        (first as i64..=last as i64)
            .map(|k| k as f64 * self.step)
            .collect()
    }

    fn range(&self) -> Range<f64> {
        self.ends.clone()
    }
}

impl ValueFormatter<f64> for Ruler {
    fn format_ext(&self, at: &f64) -> String {
        match self.scale {
            Scale::Linear => {
                let digits = (-libm::floor(libm::log10(self.step) + 1e-9)).max(0.0) as usize;
                // No minus sign before zero.
                format!("{:.digits$}", at + 0.0)
            }
            Scale::Logarithmic => super::decade(libm::round(*at) as i32),
        }
    }
}

type Problem = Box<dyn std::error::Error>;
type Sheet<'a, 'b> = ChartContext<'a, SVGBackend<'b>, Cartesian2d<Ruler, Ruler>>;

fn draw(
    area: &DrawingArea<SVGBackend<'_>, Shift>,
    (x, across): (&Axis, Ruler),
    (y, up): (&Axis, Ruler),
    curves: &[Curve],
) -> Result<(), Problem> {
    area.fill(&WHITE)?;
    let labels = (across.clone(), up.clone());
    let corner = emptiest(&across, &up, curves);
    let mut sheet = ChartBuilder::on(area)
        .margin(14 * FINE)
        .margin_right(24 * FINE)
        .x_label_area_size(46 * FINE)
        .y_label_area_size(74 * FINE)
        .build_cartesian_2d(across, up)?;
    sheet
        .configure_mesh()
        .x_desc(&x.title)
        .y_desc(&y.title)
        .x_label_formatter(&|v| labels.0.format_ext(v))
        .y_label_formatter(&|v| labels.1.format_ext(v))
        .light_line_style(WHITE.mix(0.0))
        .bold_line_style(BLACK.mix(0.08).stroke_width(FINE))
        .axis_style(BLACK.mix(0.75).stroke_width(FINE))
        .label_style((FONT, 14 * FINE))
        .axis_desc_style((FONT, 16 * FINE))
        .draw()?;
    let mut names: Vec<(&str, RGBColor)> = Vec::new();
    for curve in curves {
        let known = names.iter().find(|(name, _)| *name == curve.label);
        let colored = names.iter().filter(|(_, color)| *color != GREY).count();
        let color = match (known, curve.mark) {
            (Some((_, color)), _) => *color,
            (_, Mark::Dashes) => GREY,
            _ => COLORS[colored % COLORS.len()],
        };
        let legend = known.is_none().then_some(curve.label.as_str());
        if let Some(name) = legend {
            names.push((name, color));
        }
        one(&mut sheet, (x.scale, y.scale), curve, color, legend)?;
    }
    sheet
        .configure_series_labels()
        .position(corner)
        .margin(10 * FINE)
        .background_style(WHITE.mix(0.85))
        .label_font((FONT, 14 * FINE))
        .legend_area_size(30 * FINE)
        .draw()?;
    area.present()?;
    Ok(())
}

/// The corner in which a legend hides the fewest points.
fn emptiest(across: &Ruler, up: &Ruler, curves: &[Curve]) -> SeriesLabelPosition {
    // What a legend takes of the sheet, and a little more.
    let labels: BTreeSet<&str> = curves.iter().map(|c| c.label.as_str()).collect();
    let longest = labels.iter().map(|l| l.chars().count()).max().unwrap_or(0);
    let width = (60.0 + 8.0 * longest as f64) / f64::from(SIZE.0 - 100);
    let height = (20.0 + 20.0 * labels.len() as f64) / f64::from(SIZE.1 - 60);
    let part = |ruler: &Ruler, value| {
        let at = ruler.scale.place(value)? - ruler.ends.start;
        Some(at / (ruler.ends.end - ruler.ends.start))
    };
    let points = || curves.iter().flat_map(|c| &c.points);
    let hidden = |right: bool, top: bool| {
        let beside = |x: f64| if right { x > 1.0 - width } else { x < width };
        let level = |y: f64| if top { y > 1.0 - height } else { y < height };
        points()
            .filter(|p| part(across, p.0).is_some_and(beside) && part(up, p.1).is_some_and(level))
            .count()
    };
    let corners = [
        (SeriesLabelPosition::UpperRight, hidden(true, true)),
        (SeriesLabelPosition::UpperLeft, hidden(false, true)),
        (SeriesLabelPosition::LowerRight, hidden(true, false)),
        (SeriesLabelPosition::LowerLeft, hidden(false, false)),
    ];
    // The first of equals.
    let [first, others @ ..] = corners;
    let best = others.into_iter().fold(
        first,
        |best, other| if other.1 < best.1 { other } else { best },
    );
    best.0
}

fn one(
    sheet: &mut Sheet<'_, '_>,
    (x, y): (Scale, Scale),
    curve: &Curve,
    color: RGBColor,
    legend: Option<&str>,
) -> Result<(), Problem> {
    let place = |(a, b): (f64, f64)| Some((x.place(a)?, y.place(b)?));
    let every = curve.points.len().div_ceil(POINTS).max(1);
    let end = curve.points.len().saturating_sub(1);
    let shown = (0..curve.points.len()).filter(|k| k % every == 0 || *k == end);
    let points: Vec<(f64, f64)> = shown.filter_map(|k| place(curve.points[k])).collect();
    let thin: ShapeStyle = color.stroke_width(3 * FINE / 2);
    let bars = curve.points.iter().zip(&curve.errors);
    let bars = bars.filter_map(|(&(a, b), e)| Some([place((a, b - e))?, place((a, b + e))?]));
    sheet.draw_series(bars.map(|ends| PathElement::new(ends, thin)))?;
    let (dash, gap, wide) = (5 * FINE, 4 * FINE, 22 * FINE as i32);
    let series = match curve.mark {
        Mark::Line => sheet.draw_series(LineSeries::new(points, thin))?,
        Mark::Dashes => sheet.draw_series(DashedLineSeries::new(points, dash, gap, thin))?,
        Mark::Dots => sheet.draw_series(
            points
                .into_iter()
                .map(|p| Circle::new(p, 4 * FINE, color.filled())),
        )?,
    };
    let Some(label) = legend else { return Ok(()) };
    let series = series.label(label);
    let key = color.stroke_width(5 * FINE / 2);
    match curve.mark {
        Mark::Line => {
            series.legend(move |(x, y)| PathElement::new([(x, y), (x + wide, y)], key));
        }
        Mark::Dashes => {
            series.legend(move |(x, y)| {
                let ends = [(x, y), (x + wide, y)].into_iter();
                DashedPathElement::new(ends, dash, gap, key)
            });
        }
        Mark::Dots => {
            series.legend(move |(x, y)| Circle::new((x + wide / 2, y), 4 * FINE, color.filled()));
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn drawn(ys: &[f64]) -> Result<String, FigureError> {
        let points = ys.iter().enumerate().map(|(k, y)| (k as f64, *y)).collect();
        let curve = Curve {
            points,
            ..Curve::default()
        };
        chart(&Axis::default(), &Axis::default(), &[curve])
    }

    #[test]
    fn numbers_too_near_each_other_for_a_step_are_drawn_as_one() {
        let tiny = f64::from_bits(1);
        for ys in [[-tiny, tiny], [0.0, tiny], [-3.0 * tiny, 2.0 * tiny]] {
            let svg = drawn(&ys).unwrap();
            assert!(!svg.contains("NaN") && svg.len() < 20_000, "{ys:?}: {svg}");
            assert!(svg.contains("\n0.0\n"), "{ys:?}: {svg}");
        }
    }

    #[test]
    fn numbers_too_far_from_each_other_for_an_axis_are_refused() {
        for ys in [[-1e308, 1e308], [0.0, f64::MAX], [f64::MAX, f64::MAX]] {
            let error = drawn(&ys).unwrap_err().to_string();
            assert!(error.contains("do not go on one axis"), "{ys:?}: {error}");
        }
        let svg = drawn(&[-8e307, 8e307]).unwrap();
        assert!(!svg.contains("NaN") && !svg.contains("inf"));
    }
}
