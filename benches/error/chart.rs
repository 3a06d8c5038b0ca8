//! A panel of a figure, as SVG: lines on logarithmic or linear axes, or bars.

use std::fmt::Write as _;

/// The colours of M. Okabe and K. Ito (2008), which the colour-blind can tell apart.
pub const BLUE: &str = "#0072B2";
pub const RED: &str = "#D55E00";
pub const GREEN: &str = "#009E73";
pub const PINK: &str = "#CC79A7";
pub const ORANGE: &str = "#E69F00";
pub const SKY: &str = "#56B4E9";
pub const BLACK: &str = "#222222";

const INK: &str = "#222222";
/// Length of the marks on the frame, which point inwards.
const TICK: f64 = 6.0;
/// Distance of lines in a legend.
const PITCH: f64 = 18.0;
/// The plot area within a panel: left, top, width, height.
const AREA: (f64, f64, f64, f64) = (74.0, 46.0, 330.0, 285.0);
/// What a panel takes.
pub const SIZE: (f64, f64) = (440.0, 400.0);

/// One line, or its points alone.
#[derive(Clone, Debug)]
pub struct Series {
    pub label: String,
    pub points: Vec<(f64, f64)>,
    pub color: &'static str,
    pub marker: Marker,
    pub line: Line,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Marker {
    None,
    Circle,
    Square,
    Triangle,
    Diamond,
    Open,
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Line {
    None,
    Solid,
    Dashed,
}

#[derive(Clone, Debug)]
pub struct Axis {
    pub label: String,
    pub range: (f64, f64),
    pub log: bool,
}

impl Axis {
    pub fn log(label: &str, range: (f64, f64)) -> Self {
        Self {
            label: label.into(),
            range,
            log: true,
        }
    }

    /// Where a value lies between 0 and 1.
    fn place(&self, value: f64) -> f64 {
        let (a, b) = self.range;
        if self.log {
            (value / a).log10() / (b / a).log10()
        } else {
            (value - a) / (b - a)
        }
    }

    /// Ticks with their labels.
    fn ticks(&self) -> Vec<(f64, String)> {
        let (a, b) = self.range;
        if !self.log {
            let digits = if b - a < 0.5 { 2 } else { 1 };
            return (0..=5)
                .map(|k| a + (b - a) * f64::from(k) / 5.0)
                .map(|v| (v, format!("{v:.digits$}")))
                .collect();
        }
        let (first, last) = (a.log10().floor() as i32, b.log10().ceil() as i32);
        let every = ((last - first) / 6 + 1).max(1);
        // Where there are few decades, 2 and 5 help, and plain numbers; an axis has one way of writing them.
        let plain = b / a < 150.0;
        let within: &[f64] = if plain { &[1.0, 2.0, 5.0] } else { &[1.0] };
        let written = |k: i32, m: f64| {
            if plain {
                format!("{:.*}", (-k).max(0) as usize, m * 10f64.powi(k))
            } else {
                format!("10^{k}").replace('-', "−")
            }
        };
        (first..=last)
            .filter(|k| (k - first) % every == 0)
            .flat_map(|k| within.iter().map(move |m| (k, *m)))
            .map(|(k, m)| (m * 10f64.powi(k), written(k, m)))
            .filter(|t| (-1e-9..=1.0 + 1e-9).contains(&self.place(t.0)))
            .collect()
    }
}

/// A label of an axis; an exponent is a text of its own, which every renderer places alike.
fn tick(s: &mut String, (x, y): (f64, f64), anchor: &str, label: &str) {
    let Some((base, exponent)) = label.split_once('^') else {
        text(s, (x, y), anchor, label);
        return;
    };
    let width = 6.6 * exponent.chars().count() as f64;
    let between = if anchor == "end" {
        x - width
    } else {
        x + 8.0 - 0.5 * width
    };
    text(s, (between, y), "end", base);
    let _ = writeln!(
        s,
        "<text x=\"{:.1}\" y=\"{:.1}\" font-size=\"11\" fill=\"{INK}\">{exponent}</text>",
        between + 0.5,
        y - 6.0
    );
}

/// A panel with axes.
#[derive(Clone, Debug)]
pub struct Panel {
    pub title: String,
    pub x: Axis,
    pub y: Axis,
    pub series: Vec<Series>,
    /// Where the legend begins, between 0 and 1 from the left and from the top of the plot area.
    pub legend: (f64, f64),
    /// Texts that begin right below values of x and y.
    pub notes: Vec<(f64, f64, String)>,
}

impl Panel {
    pub fn svg(&self) -> String {
        let (left, top, width, height) = AREA;
        let mut s = title(&self.title);
        let at = |x: f64, y: f64| {
            (
                left + width * self.x.place(x),
                top + height * (1.0 - self.y.place(y)),
            )
        };
        for (value, label) in self.x.ticks() {
            let x = at(value, self.y.range.0).0;
            line(&mut s, (x, top), (x, top + TICK), INK);
            line(&mut s, (x, top + height), (x, top + height - TICK), INK);
            tick(&mut s, (x, top + height + 20.0), "middle", &label);
        }
        for (value, label) in self.y.ticks() {
            let y = at(self.x.range.0, value).1;
            line(&mut s, (left, y), (left + TICK, y), INK);
            line(&mut s, (left + width, y), (left + width - TICK, y), INK);
            tick(&mut s, (left - 8.0, y + 5.0), "end", &label);
        }
        frame(&mut s, &self.x.label, Some(&self.y.label));
        let inside = |(x, y): (f64, f64)| {
            let within = |axis: &Axis, v: f64| (-1e-9..=1.0 + 1e-9).contains(&axis.place(v));
            within(&self.x, x) && within(&self.y, y)
        };
        for series in &self.series {
            let points: Vec<(f64, f64)> = series
                .points
                .iter()
                .copied()
                .filter(|p| inside(*p))
                .map(|p| at(p.0, p.1))
                .collect();
            stroke(&mut s, &points, series);
            for p in &points {
                mark(&mut s, *p, series);
            }
        }
        for (x, y, note) in &self.notes {
            let (x, y) = at(*x, *y);
            text(&mut s, (x + 9.0, y + 13.0), "start", note);
        }
        let (x, mut y) = (left + width * self.legend.0, top + height * self.legend.1);
        for series in self.series.iter().filter(|s| !s.label.is_empty()) {
            stroke(&mut s, &[(x, y), (x + 26.0, y)], series);
            mark(&mut s, (x + 13.0, y), series);
            text(&mut s, (x + 33.0, y + 5.0), "start", &series.label);
            y += PITCH;
        }
        s
    }
}

/// Horizontal bars, each with a label before it and a remark behind it.
#[derive(Clone, Debug)]
pub struct Bars {
    pub title: String,
    pub label: String,
    pub most: f64,
    pub rows: Vec<(String, f64, String)>,
    /// A vertical line, and what it says.
    pub limit: Option<(f64, String)>,
}

impl Bars {
    pub fn svg(&self) -> String {
        let (left, top, width, height) = AREA;
        let mut s = title(&self.title);
        let x = |value: f64| left + width * value / self.most;
        let pitch = height / self.rows.len().max(1) as f64;
        let (mut at, every) = (0.0, if self.most > 2.0 { 1.0 } else { 0.5 });
        while at <= self.most {
            text(
                &mut s,
                (x(at), top + height + 19.0),
                "middle",
                &format!("{at}"),
            );
            line(
                &mut s,
                (x(at), top + height),
                (x(at), top + height - TICK),
                INK,
            );
            at += every;
        }
        for (k, (name, value, remark)) in self.rows.iter().enumerate() {
            let y = top + pitch * (k as f64 + 0.16);
            let _ = write!(
                s,
                "<rect x=\"{left}\" y=\"{y:.1}\" width=\"{:.1}\" height=\"{:.1}\" fill=\"{SKY}\"/>",
                x(*value) - left,
                0.68 * pitch
            );
            let middle = y + 0.34 * pitch + 5.0;
            text(&mut s, (left - 6.0, middle), "end", name);
            // Behind a short bar, in a long one.
            let behind = if *value < 0.4 * self.most {
                x(*value)
            } else {
                left
            };
            text(&mut s, (behind + 8.0, middle), "start", remark);
        }
        frame(&mut s, &self.label, None);
        if let Some((value, note)) = &self.limit {
            let _ = write!(
                s,
                "<line x1=\"{0:.1}\" y1=\"{top}\" x2=\"{0:.1}\" y2=\"{1}\" stroke=\"{RED}\" stroke-width=\"1.6\" stroke-dasharray=\"6 4\"/>",
                x(*value),
                top + height
            );
            text(&mut s, (x(*value) + 5.0, top + 16.0), "start", note);
        }
        s
    }
}

fn title(title: &str) -> String {
    format!(
        "<text x=\"10\" y=\"24\" font-size=\"16\" font-weight=\"bold\" fill=\"{INK}\">{title}</text>\n"
    )
}

fn frame(s: &mut String, x_label: &str, y_label: Option<&str>) {
    let (left, top, width, height) = AREA;
    let _ = writeln!(
        s,
        "<rect x=\"{left}\" y=\"{top}\" width=\"{width}\" height=\"{height}\" fill=\"none\" stroke=\"{INK}\" stroke-width=\"1.2\"/>"
    );
    text(
        s,
        (left + 0.5 * width, top + height + 43.0),
        "middle",
        x_label,
    );
    if let Some(label) = y_label {
        let _ = writeln!(
            s,
            "<text transform=\"translate(20 {}) rotate(-90)\" text-anchor=\"middle\" fill=\"{INK}\">{label}</text>",
            top + 0.5 * height
        );
    }
}

fn text(s: &mut String, (x, y): (f64, f64), anchor: &str, text: &str) {
    let _ = writeln!(
        s,
        "<text x=\"{x:.1}\" y=\"{y:.1}\" text-anchor=\"{anchor}\" fill=\"{INK}\">{text}</text>"
    );
}

fn line(s: &mut String, a: (f64, f64), b: (f64, f64), color: &str) {
    let _ = writeln!(
        s,
        "<line x1=\"{:.1}\" y1=\"{:.1}\" x2=\"{:.1}\" y2=\"{:.1}\" stroke=\"{color}\"/>",
        a.0, a.1, b.0, b.1
    );
}

fn stroke(s: &mut String, points: &[(f64, f64)], series: &Series) {
    if series.line == Line::None || points.len() < 2 {
        return;
    }
    let path: Vec<String> = points
        .iter()
        .map(|p| format!("{:.1},{:.1}", p.0, p.1))
        .collect();
    let dash = if series.line == Line::Dashed {
        " stroke-dasharray=\"6 4\""
    } else {
        ""
    };
    let _ = writeln!(
        s,
        "<polyline points=\"{}\" fill=\"none\" stroke=\"{}\" stroke-width=\"2\" stroke-linejoin=\"round\"{dash}/>",
        path.join(" "),
        series.color
    );
}

fn mark(s: &mut String, (x, y): (f64, f64), series: &Series) {
    let color = series.color;
    let _ = match series.marker {
        Marker::None => Ok(()),
        Marker::Circle => writeln!(
            s,
            "<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"4\" fill=\"{color}\"/>"
        ),
        Marker::Open => writeln!(
            s,
            "<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"4\" fill=\"white\" stroke=\"{color}\" stroke-width=\"1.8\"/>"
        ),
        Marker::Square => writeln!(
            s,
            "<rect x=\"{:.1}\" y=\"{:.1}\" width=\"7.4\" height=\"7.4\" fill=\"{color}\"/>",
            x - 3.7,
            y - 3.7
        ),
        Marker::Triangle => writeln!(
            s,
            "<path d=\"M{:.1} {:.1}l4.8 8.4h-9.6z\" fill=\"{color}\"/>",
            x,
            y - 5.2
        ),
        Marker::Diamond => writeln!(
            s,
            "<path d=\"M{:.1} {:.1}l5 5l-5 5l-5 -5z\" fill=\"{color}\"/>",
            x,
            y - 5.0
        ),
    };
}
