//! How the curves of a chart are called and drawn, and the legend that says so.

use super::chart::{Curve, Mark};
use super::shapes::{CHARACTER, circle, hundredths, line, text};
use svg::Node;
use svg::node::element::{Circle, Group};

/// The colours of M. Okabe and K. Ito (2008), which the colour-blind can tell apart.
pub(super) const COLORS: [&str; 6] = [
    "#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9",
];

/// The colour of what is dashed.
const GREY: &str = "#3c3c3c";

/// Of thresholds and theories.
const DASHES: [f64; 2] = [0.4, 0.3];

/// Of curves whose color another has already.
const LONG_DASHES: [f64; 2] = [0.9, 0.2];

/// Height of a line of the legend (font sizes).
const LINE: f64 = 1.45;

/// A line of the legend, and how curves of that name are drawn.
pub(super) struct Key {
    pub(super) label: String,
    pub(super) color: &'static str,
    mark: Mark,
    /// Dash and gap (font sizes), where the line is not drawn through.
    dash: Option<[f64; 2]>,
}

impl Key {
    /// A dot of its colour.
    pub(super) fn dot(&self, center: (f64, f64), font: f64) -> Circle {
        circle(center, 0.3 * font).set("fill", self.color)
    }

    /// Draws a line in its colour, with its dashes.
    pub(super) fn paint(&self, line: &mut impl Node, font: f64) {
        line.assign("stroke", self.color);
        if let Some(dash) = self.dash {
            let [dash, gap] = dash.map(|length| hundredths(length * font));
            line.assign("stroke-dasharray", format!("{dash} {gap}"));
        }
    }
}

/// A key for each name, in the order in which they come.
pub(super) fn keys(curves: &[Curve]) -> Vec<Key> {
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
pub(super) fn size(keys: &[Key], font: f64) -> (f64, f64) {
    let longest = keys.iter().map(|key| key.label.chars().count()).max();
    let text = CHARACTER * font * longest.unwrap_or(0) as f64;
    (text + 2.6 * font, LINE * font * keys.len() as f64)
}

/// The legend with its upper left corner there.
pub(super) fn legend(keys: &[Key], font: f64, (left, top): (f64, f64)) -> Group {
    let mut group = Group::new();
    let named = |(_, key): &(usize, &Key)| !key.label.is_empty();
    for (k, key) in keys.iter().enumerate().filter(named) {
        let y = top + LINE * font * (k as f64 + 0.5);
        if key.mark == Mark::Dots {
            group.append(key.dot((left + font, y), font));
        } else {
            let mut sample = line([(left, y), (left + 2.0 * font, y)], 1.8);
            key.paint(&mut sample, font);
            group.append(sample);
        }
        let at = (left + 2.6 * font, y + 0.36 * font);
        group.append(text(&key.label, at, "start"));
    }
    group
}
