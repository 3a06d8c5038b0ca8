//! Curves over linear or logarithmic axes, in a frame with marks and without a grid.

use super::axis::{Axis, Ruler};
use super::keys::{self, COLORS, Key, keys, legend};
use super::shapes::{CHARACTER, frame, hundredths, line, page, paper, rectangle, text};
use super::{FigureError, INK, font_size, with_indices};
use svg::Node as _;
use svg::node::element::{Group, Polyline, Text};

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

/// How many curves of a [`chart`] have a colour of their own; from there on colours come again, with dashes.
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

/// The width of a chart (pixels of the SVG, 96 an inch), where no other is asked for.
pub const CHART_WIDTH: f64 = 720.0;

/// Height over width.
const SHAPE: f64 = 0.64;

/// Points of a curve beyond this number add bytes and nothing to the picture.
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
///     points: (0..=314).map(|k| f64::from(k) / 100.0).map(|t| (t, softjam::models::droplet::kernel::g(t))).collect(),
///     ..Curve::default()
/// };
/// let svg = chart(&axis("θ (radians)", Scale::Linear), &axis("g(θ)", Scale::Linear), &[kernel]).unwrap();
/// assert!(svg.contains("θ (radians)"));
/// let none = Curve { mark: Mark::Dots, ..Curve::default() };
/// assert!(chart(&Axis::default(), &Axis::default(), &[none]).is_err());
/// ```
pub fn chart(x: &Axis, y: &Axis, curves: &[Curve]) -> Result<String, FigureError> {
    chart_in(CHART_WIDTH, x, y, curves)
}

/// [`chart`] of the given width (pixels of the SVG, 96 an inch); text is 8 points in narrow figures and 10 in wide ones.
///
/// # Errors
///
/// As [`chart`].
///
/// ```
/// use softjam::figure::{Axis, CHART_WIDTH, Curve, chart, chart_in};
///
/// let curve = [Curve { points: vec![(0.0, 0.0), (1.0, 2.0)], ..Curve::default() }];
/// let axis = Axis::default();
/// let svg = chart_in(325.0, &axis, &axis, &curve).unwrap();
/// assert!(svg.contains("width=\"325\""));
/// assert_eq!(chart_in(CHART_WIDTH, &axis, &axis, &curve).unwrap(), chart(&axis, &axis, &curve).unwrap());
/// ```
pub fn chart_in(width: f64, x: &Axis, y: &Axis, curves: &[Curve]) -> Result<String, FigureError> {
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
    let (width, height) = (hundredths(width), hundredths(SHAPE * width));
    let font = font_size(width);
    let keys = keys(curves);
    let room = keys::size(&keys, font);
    let mut sheet = Sheet::of((width, height), font, across, up);
    let corner = sheet.free_corner(curves, room);
    if corner.is_none() {
        sheet.right -= room.0 + 0.8 * font;
    }
    // Where no corner is free the legend lies beside the frame.
    let corner = corner.unwrap_or((sheet.right + 0.9 * font, sheet.top));
    let svg = page((width, height))
        .set("font-size", hundredths(font))
        .set("fill", INK)
        .add(paper())
        .add(sheet.axes((&x.title, &y.title), (width, height)))
        .add(sheet.curves(curves, &keys))
        .add(legend(&keys, font, corner))
        .to_string();
    Ok(with_indices(&svg, 1.1 * font))
}

/// The frame that curves are drawn in.
struct Sheet {
    font: f64,
    left: f64,
    right: f64,
    top: f64,
    bottom: f64,
    across: Ruler,
    up: Ruler,
}

impl Sheet {
    fn of((width, height): (f64, f64), font: f64, across: Ruler, up: Ruler) -> Self {
        let numbers = up.labels();
        let longest = numbers.iter().map(|(_, label)| label.chars().count()).max();
        Self {
            font,
            // The title, the numbers, and air between the three.
            left: font * (2.6 + CHARACTER * longest.unwrap_or(0) as f64),
            right: width - 1.2 * font,
            top: 0.8 * font,
            bottom: height - 3.6 * font,
            across,
            up,
        }
    }

    fn x(&self, part: f64) -> f64 {
        self.left + part * (self.right - self.left)
    }

    fn y(&self, part: f64) -> f64 {
        self.bottom - part * (self.bottom - self.top)
    }

    fn place(&self, (x, y): (f64, f64)) -> Option<(f64, f64)> {
        Some((self.x(self.across.part(x)?), self.y(self.up.part(y)?)))
    }

    /// Frame, marks on all four sides, numbers and titles.
    fn axes(&self, (x_title, y_title): (&str, &str), (width, height): (f64, f64)) -> Group {
        let (font, long, short) = (self.font, 0.45 * self.font, 0.25 * self.font);
        let (left, right, top, bottom) = (self.left, self.right, self.top, self.bottom);
        let inside = rectangle((left, top), (right - left, bottom - top));
        let mut group = Group::new().add(frame(inside, 1.0));
        let mut mark = |from, to| group.append(line([from, to], 0.8).set("stroke", INK));
        let marks = |ruler: &Ruler| {
            let labels = ruler.labels().into_iter().map(|(at, _)| (at, long));
            labels.chain(ruler.minor().into_iter().map(|at| (at, short)))
        };
        for (x, length) in marks(&self.across).map(|(at, length)| (self.x(at), length)) {
            mark((x, bottom), (x, bottom - length));
            mark((x, top), (x, top + length));
        }
        for (y, length) in marks(&self.up).map(|(at, length)| (self.y(at), length)) {
            mark((left, y), (left + length, y));
            mark((right, y), (right - length, y));
        }
        for (at, label) in self.across.labels() {
            let place = (self.x(at), bottom + 1.3 * font);
            group.append(text(&label, place, "middle"));
        }
        for (at, label) in self.up.labels() {
            let place = (left - 0.5 * font, self.y(at) + 0.36 * font);
            group.append(text(&label, place, "end"));
        }
        let size = hundredths(1.1 * font);
        let at = ((0.5 * (left + right)).min(width), height - 0.8 * font);
        group.append(text(x_title, at, "middle").set("font-size", size));
        let (x, y) = (hundredths(1.4 * font), hundredths(0.5 * (top + bottom)));
        group.append(
            Text::new(y_title)
                .set("transform", format!("translate({x} {y}) rotate(-90)"))
                .set("text-anchor", "middle")
                .set("font-size", size),
        );
        group
    }

    fn curves(&self, curves: &[Curve], keys: &[Key]) -> Group {
        let mut group = Group::new();
        for curve in curves {
            let Some(key) = keys.iter().find(|key| key.label == curve.label) else {
                continue;
            };
            for (&(x, y), error) in curve.points.iter().zip(&curve.errors) {
                let ends = [self.place((x, y - error)), self.place((x, y + error))];
                if let [Some(a), Some(b)] = ends {
                    group.append(line([a, b], 1.5).set("stroke", key.color));
                }
            }
            let points = self.points(curve);
            if curve.mark == Mark::Dots {
                for point in points {
                    group.append(key.dot(point, self.font));
                }
                continue;
            }
            let place = |&(x, y): &(f64, f64)| format!("{},{}", hundredths(x), hundredths(y));
            let points: Vec<String> = points.iter().map(place).collect();
            let mut curve = Polyline::new()
                .set("points", points.join(" "))
                .set("fill", "none")
                .set("stroke-width", 1.4)
                .set("stroke-linejoin", "round");
            key.paint(&mut curve, self.font);
            group.append(curve);
        }
        group
    }

    /// The points of a curve that are drawn.
    fn points(&self, curve: &Curve) -> Vec<(f64, f64)> {
        let every = curve.points.len().div_ceil(POINTS).max(1);
        let end = curve.points.len().saturating_sub(1);
        let shown = (0..curve.points.len()).filter(|k| k % every == 0 || *k == end);
        shown.filter_map(|k| self.place(curve.points[k])).collect()
    }

    /// Where a legend of this size lies in a corner of the frame and on no curve: its upper left corner.
    fn free_corner(&self, curves: &[Curve], (width, height): (f64, f64)) -> Option<(f64, f64)> {
        let (air, around) = (0.9 * self.font, 0.4 * self.font);
        let (left, right) = (self.left + air, self.right - air - width);
        let (top, bottom) = (self.top + air, self.bottom - air - height);
        let lines: Vec<Vec<(f64, f64)>> = curves.iter().map(|curve| self.points(curve)).collect();
        let is_free = |&(left, top): &(f64, f64)| {
            let within = |(x, y): (f64, f64)| {
                x > left - around
                    && x < left + width + around
                    && y > top - around
                    && y < top + height + around
            };
            !lines.iter().any(|line| trodden(line).any(within))
        };
        let corners = [(right, top), (left, top), (right, bottom), (left, bottom)];
        corners.into_iter().find(is_free)
    }
}

/// Points along a line, every few pixels.
fn trodden(line: &[(f64, f64)]) -> impl Iterator<Item = (f64, f64)> {
    const STEP: f64 = 4.0;
    let pairs = line.windows(2).flat_map(|ends| {
        let (a, b) = (ends[0], ends[1]);
        let steps = (libm::hypot(b.0 - a.0, b.1 - a.1) / STEP) as usize;
        (1..=steps).map(move |k| {
            let part = k as f64 / (steps + 1) as f64;
            (a.0 + part * (b.0 - a.0), a.1 + part * (b.1 - a.1))
        })
    });
    line.iter().copied().chain(pairs)
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
