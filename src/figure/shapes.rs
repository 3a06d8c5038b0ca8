//! The elements that figures are made of. Places and lengths are written to a hundredth of a pixel.

use super::{FONTS, INK};
use svg::Document;
use svg::node::element::{Circle, Line, Rectangle, Text};

/// Width of a character (font sizes), a little more than the mean of the typeface.
pub(super) const CHARACTER: f64 = 0.58;

pub(super) fn hundredths(x: f64) -> f64 {
    libm::round(100.0 * x) / 100.0
}

/// A figure of this width and height (pixels), still empty.
pub(super) fn page((width, height): (f64, f64)) -> Document {
    Document::new()
        .set("viewBox", (0, 0, width, height))
        .set("width", width)
        .set("height", height)
        .set("font-family", FONTS)
}

/// White over the whole figure, so that the ink can be read on a dark page too.
pub(super) fn paper() -> Rectangle {
    let paper = Rectangle::new().set("width", "100%").set("height", "100%");
    paper.set("fill", "white")
}

pub(super) fn rectangle((left, top): (f64, f64), (width, height): (f64, f64)) -> Rectangle {
    Rectangle::new()
        .set("x", hundredths(left))
        .set("y", hundredths(top))
        .set("width", hundredths(width))
        .set("height", hundredths(height))
}

/// The outline of a rectangle that something is drawn in.
pub(super) fn frame(rectangle: Rectangle, width: f64) -> Rectangle {
    let frame = rectangle.set("fill", "none").set("stroke", INK);
    frame.set("stroke-width", width)
}

pub(super) fn circle((x, y): (f64, f64), radius: f64) -> Circle {
    Circle::new()
        .set("cx", hundredths(x))
        .set("cy", hundredths(y))
        .set("r", hundredths(radius))
}

pub(super) fn line([from, to]: [(f64, f64); 2], width: f64) -> Line {
    Line::new()
        .set("x1", hundredths(from.0))
        .set("y1", hundredths(from.1))
        .set("x2", hundredths(to.0))
        .set("y2", hundredths(to.1))
        .set("stroke-width", hundredths(width))
}

pub(super) fn text(words: &str, (x, y): (f64, f64), anchor: &str) -> Text {
    Text::new(words)
        .set("x", hundredths(x))
        .set("y", hundredths(y))
        .set("text-anchor", anchor)
}
