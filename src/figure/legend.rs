//! What is written under a packing: its numbers, what colours and lines mean, and in small print what to beware of.

use super::INK;
use super::shapes::{self, CHARACTER, hundredths};
use svg::Node;
use svg::node::element::{Group, Text};

/// Distance of lines (font sizes).
const LINE: f64 = 1.5;
/// Distance of items (font sizes).
const GAP: f64 = 1.4;

/// A column of text and items as wide as the picture above it.
pub(super) struct Legend {
    group: Group,
    font: f64,
    left: f64,
    width: f64,
    /// Where the next item begins; at `left` where its row is empty.
    x: f64,
    /// How far down the column reaches, but for the row that is being filled.
    y: f64,
    /// Height of that row.
    row: f64,
}

impl Legend {
    /// Below `top`, in a font of so many pixels.
    pub(super) fn new((left, top): (f64, f64), width: f64, font: f64) -> Self {
        Self {
            group: Group::new(),
            font,
            left,
            width,
            x: left,
            y: top,
            row: 0.0,
        }
    }

    pub(super) fn font(&self) -> f64 {
        self.font
    }

    /// Lines of text made of `pieces`, which are not broken, in a font of `part` of the usual size.
    pub(super) fn lines(&mut self, pieces: &[String], between: &str, part: f64) {
        self.end_row();
        let most = (self.width / (CHARACTER * part * self.font)) as usize;
        let mut lines: Vec<String> = Vec::new();
        for piece in pieces {
            match lines.last_mut() {
                Some(line)
                    if line.chars().count() + piece.chars().count() + between.len() <= most =>
                {
                    line.push_str(between);
                    line.push_str(piece);
                }
                _ => lines.push(piece.clone()),
            }
        }
        for line in lines {
            self.y += LINE * part * self.font;
            self.group.append(
                Text::new(line)
                    .set("x", hundredths(self.left))
                    .set("y", hundredths(self.y - 0.35 * part * self.font))
                    .set("font-size", hundredths(part * self.font)),
            );
        }
    }

    /// Room for an item of this size (font sizes): its left end, and the middle of its first line.
    pub(super) fn place(&mut self, (width, height): (f64, f64)) -> (f64, f64) {
        let width = width * self.font;
        if self.x > self.left && self.x + width > self.left + self.width {
            self.end_row();
        }
        let at = (self.x, self.y + 0.5 * LINE * self.font);
        self.x += width + GAP * self.font;
        self.row = self.row.max(height * self.font);
        at
    }

    /// A text whose middle is at this height.
    pub(super) fn write(&mut self, text: &str, (x, middle): (f64, f64), anchor: &str) {
        let at = (x, middle + 0.36 * self.font);
        self.group.append(shapes::text(text, at, anchor));
    }

    /// What belongs to the item at hand.
    pub(super) fn add(&mut self, item: impl Into<Box<dyn Node>>) {
        self.group.append(item);
    }

    fn end_row(&mut self) {
        if self.x > self.left {
            self.x = self.left;
            self.y += core::mem::take(&mut self.row);
        }
    }

    /// What was written, and where it ends.
    pub(super) fn end(mut self) -> (Group, f64) {
        self.end_row();
        let group = self
            .group
            .set("fill", INK)
            .set("font-size", hundredths(self.font));
        (group, self.y)
    }
}

/// The length of a name or a number, about (font sizes).
pub(super) fn length(text: &str) -> f64 {
    0.55 * text.chars().count() as f64
}
