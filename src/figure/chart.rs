//! Curves over linear or logarithmic axes, in a frame with marks and without a grid.

use super::axis::{Axis, Ruler};
use super::shades::hundredths;
use super::{FONTS, FigureError, INK, font_size, with_f_max};
use std::collections::BTreeMap;
use svg::node::element::{Circle, Group, Line, Polyline, Rectangle, Text};
use svg::{Document, Node as _};

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
const COLORS: [&str; 6] = [
    "#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9",
];

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

/// The colour of what is dashed.
const GREY: &str = "#3c3c3c";

/// The width of a chart (pixels of the SVG, 96 an inch), where no other is asked for.
pub const CHART_WIDTH: f64 = 720.0;

/// Height over width.
const SHAPE: f64 = 0.64;

/// Points of a curve beyond this number add bytes and nothing to the picture.
const POINTS: usize = 4000;

/// Width of a character (font sizes), a little more than the mean of the typeface.
const CHARACTER: f64 = 0.58;

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
    let mut sheet = Sheet::of((width, height), font, across, up);
    let corner = sheet.free_corner(curves, &keys);
    if corner.is_none() {
        sheet.right -= key_size(&keys, font).0 + 0.8 * font;
    }
    let svg = Document::new()
        .set("viewBox", (0, 0, width, height))
        .set("width", width)
        .set("height", height)
        .set("font-family", FONTS)
        .set("font-size", hundredths(font))
        .set("fill", INK)
        .add(
            Rectangle::new()
                .set("width", "100%")
                .set("height", "100%")
                .set("fill", "white"),
        )
        .add(sheet.axes((&x.title, &y.title), (width, height)))
        .add(sheet.curves(curves, &keys))
        .add(legend(&keys, font, sheet.legend_at(corner, &keys)))
        .to_string();
    Ok(with_f_max(&svg, 1.1 * font))
}

/// A line of the legend, and how curves of that name are drawn.
struct Key {
    label: String,
    color: &'static str,
    mark: Mark,
    /// Dash and gap (font sizes), where the line is not drawn through.
    dash: Option<[f64; 2]>,
}

/// Of thresholds and theories.
const DASHES: [f64; 2] = [0.4, 0.3];

/// Of curves whose color another has already.
const LONG_DASHES: [f64; 2] = [0.9, 0.2];

/// A key for each name, in the order in which they come.
fn keys(curves: &[Curve]) -> Vec<Key> {
    let mut keys: Vec<Key> = Vec::new();
    for curve in curves {
        if keys.iter().any(|key| key.label == curve.label) {
            continue;
        }
        let colored = keys.iter().filter(|key| key.color != GREY).count();
        let (color, dash) = match curve.mark {
            Mark::Dashes => (GREY, Some(DASHES)),
            Mark::Line | Mark::Dots => (
                COLORS[colored % COLORS.len()],
                (colored >= COLORS.len()).then_some(LONG_DASHES),
            ),
        };
        keys.push(Key {
            label: curve.label.clone(),
            color,
            mark: curve.mark,
            dash,
        });
    }
    keys
}

/// Width and height of a legend.
fn key_size(keys: &[Key], font: f64) -> (f64, f64) {
    let longest = keys.iter().map(|key| key.label.chars().count()).max();
    let text = CHARACTER * font * longest.unwrap_or(0) as f64;
    (text + 2.6 * font, 1.45 * font * keys.len() as f64)
}

/// The legend with its upper left corner there.
fn legend(keys: &[Key], font: f64, (left, top): (f64, f64)) -> Group {
    let mut group = Group::new();
    for (k, key) in keys
        .iter()
        .enumerate()
        .filter(|(_, key)| !key.label.is_empty())
    {
        let y = top + 1.45 * font * (k as f64 + 0.5);
        match key.mark {
            Mark::Dots => group.append(dot((left + font, y), key.color, font)),
            Mark::Line | Mark::Dashes => {
                let line = segment([(left, y), (left + 2.0 * font, y)], key.color, 1.8);
                group.append(match dashes(key, font) {
                    Some(dashes) => line.set("stroke-dasharray", dashes),
                    None => line,
                });
            }
        }
        group.append(text(
            &key.label,
            (left + 2.6 * font, y + 0.36 * font),
            "start",
        ));
    }
    group
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
        let mut group = Group::new().add(
            Rectangle::new()
                .set("x", hundredths(self.left))
                .set("y", hundredths(self.top))
                .set("width", hundredths(self.right - self.left))
                .set("height", hundredths(self.bottom - self.top))
                .set("fill", "none")
                .set("stroke", INK)
                .set("stroke-width", 1),
        );
        let mut mark =
            |from: (f64, f64), to: (f64, f64)| group.append(segment([from, to], INK, 0.8));
        let marks = |ruler: &Ruler| -> Vec<(f64, f64)> {
            let labels = ruler.labels().into_iter().map(|(at, _)| (at, long));
            labels
                .chain(ruler.minor().into_iter().map(|at| (at, short)))
                .collect()
        };
        for (at, length) in marks(&self.across) {
            let x = self.x(at);
            mark((x, self.bottom), (x, self.bottom - length));
            mark((x, self.top), (x, self.top + length));
        }
        for (at, length) in marks(&self.up) {
            let y = self.y(at);
            mark((self.left, y), (self.left + length, y));
            mark((self.right, y), (self.right - length, y));
        }
        for (at, label) in self.across.labels() {
            group.append(text(
                &label,
                (self.x(at), self.bottom + 1.3 * font),
                "middle",
            ));
        }
        for (at, label) in self.up.labels() {
            let place = (self.left - 0.5 * font, self.y(at) + 0.36 * font);
            group.append(text(&label, place, "end"));
        }
        let middle = (0.5 * (self.left + self.right)).min(width);
        let title = text(x_title, (middle, height - 0.8 * font), "middle");
        group.append(title.set("font-size", hundredths(1.1 * font)));
        let at = (1.4 * font, 0.5 * (self.top + self.bottom));
        let turned = format!(
            "translate({} {}) rotate(-90)",
            hundredths(at.0),
            hundredths(at.1)
        );
        group.append(
            Text::new(y_title)
                .set("transform", turned)
                .set("text-anchor", "middle")
                .set("font-size", hundredths(1.1 * font)),
        );
        group
    }

    fn curves(&self, curves: &[Curve], keys: &[Key]) -> Group {
        let mut group = Group::new();
        let keys: BTreeMap<&str, &Key> = keys.iter().map(|k| (k.label.as_str(), k)).collect();
        for curve in curves {
            let Some(key) = keys.get(curve.label.as_str()) else {
                continue;
            };
            for (&(x, y), error) in curve.points.iter().zip(&curve.errors) {
                let ends = [self.place((x, y - error)), self.place((x, y + error))];
                if let [Some(a), Some(b)] = ends {
                    group.append(segment([a, b], key.color, 1.5));
                }
            }
            let points = self.points(curve);
            if curve.mark == Mark::Dots {
                for point in points {
                    group.append(dot(point, key.color, self.font));
                }
                continue;
            }
            let points = points
                .iter()
                .map(|(x, y)| format!("{},{}", hundredths(*x), hundredths(*y)));
            let line = Polyline::new()
                .set("points", points.collect::<Vec<_>>().join(" "))
                .set("fill", "none")
                .set("stroke", key.color)
                .set("stroke-width", 1.4)
                .set("stroke-linejoin", "round");
            group.append(match dashes(key, self.font) {
                Some(dashes) => line.set("stroke-dasharray", dashes),
                None => line,
            });
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

    /// The corner in which a legend lies on no curve.
    fn free_corner(&self, curves: &[Curve], keys: &[Key]) -> Option<Corner> {
        let (width, height) = key_size(keys, self.font);
        let lines: Vec<Vec<(f64, f64)>> = curves.iter().map(|curve| self.points(curve)).collect();
        Corner::ALL.into_iter().find(|corner| {
            let (left, top) = self.corner(*corner, (width, height));
            let around = 0.4 * self.font;
            let within = |(x, y): (f64, f64)| {
                x > left - around
                    && x < left + width + around
                    && y > top - around
                    && y < top + height + around
            };
            !lines.iter().any(|line| trodden(line).any(within))
        })
    }

    /// Where the upper left corner of something of this size is in a corner of the frame.
    fn corner(&self, corner: Corner, (width, height): (f64, f64)) -> (f64, f64) {
        let air = 0.9 * self.font;
        let x = if corner.right {
            self.right - air - width
        } else {
            self.left + air
        };
        let y = if corner.top {
            self.top + air
        } else {
            self.bottom - air - height
        };
        (x, y)
    }

    /// Where the legend lies: in its corner, or beside the frame.
    fn legend_at(&self, corner: Option<Corner>, keys: &[Key]) -> (f64, f64) {
        match corner {
            Some(corner) => self.corner(corner, key_size(keys, self.font)),
            None => (self.right + 0.9 * self.font, self.top),
        }
    }
}

#[derive(Clone, Copy)]
struct Corner {
    right: bool,
    top: bool,
}

impl Corner {
    /// The first of those that are free is taken.
    const ALL: [Self; 4] = [
        Self::of(true, true),
        Self::of(false, true),
        Self::of(true, false),
        Self::of(false, false),
    ];

    const fn of(right: bool, top: bool) -> Self {
        Self { right, top }
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

fn text(words: &str, (x, y): (f64, f64), anchor: &str) -> Text {
    Text::new(words)
        .set("x", hundredths(x))
        .set("y", hundredths(y))
        .set("text-anchor", anchor)
}

fn segment([from, to]: [(f64, f64); 2], color: &str, width: f64) -> Line {
    Line::new()
        .set("x1", hundredths(from.0))
        .set("y1", hundredths(from.1))
        .set("x2", hundredths(to.0))
        .set("y2", hundredths(to.1))
        .set("stroke", color)
        .set("stroke-width", width)
}

fn dot((x, y): (f64, f64), color: &str, font: f64) -> Circle {
    Circle::new()
        .set("cx", hundredths(x))
        .set("cy", hundredths(y))
        .set("r", hundredths(0.3 * font))
        .set("fill", color)
}

/// Dashes and the gaps between them (pixels).
fn dashes(key: &Key, font: f64) -> Option<String> {
    let [dash, gap] = key.dash?;
    Some(format!(
        "{} {}",
        hundredths(dash * font),
        hundredths(gap * font)
    ))
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
