//! A packing: particles as filled contours, contacts as force chains.

use super::{FONT, f_max, power_of_ten};
use crate::contact::{Contacts, FrameContacts};
use crate::domain::{Domain, Vec2};
use crate::droplet::contour::{ContourStyle, Contours, Placement};
use crate::force::{held, largest_force, net_forces};
use crate::frame::Frame;
use crate::packing::Packing;
use core::f64::consts::PI;
use svg::node::element::path::Data;
use svg::node::element::{Circle, ClipPath, Definitions, Group, Line, Path, Rectangle, Text};
use svg::{Document, Node};

/// What a particle is drawn as.
///
/// ```
/// assert_eq!(softjam::figure::Shape::default(), softjam::figure::Shape::Contour);
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Shape {
    /// Its contour `ρ_i(θ)`.
    #[default]
    Contour,
    /// The undeformed disk of the same frame.
    Disk,
}

/// What the colour of a particle means.
///
/// ```
/// assert_eq!(softjam::figure::ColorBy::default(), softjam::figure::ColorBy::Pressure);
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum ColorBy {
    /// `p_i = Σ_j f_ij / 2πR_i`, relative to the mean over the particles that have a contact.
    #[default]
    Pressure,
    /// `max |ΔR_i| / R_i`.
    Deformation,
    /// Nothing: all alike.
    Nothing,
}

/// How a packing is drawn.
///
/// ```
/// use softjam::figure::{Shape, Style};
/// let style = Style { shape: Shape::Disk, chains: false, ..Style::default() };
/// assert!(style.width > 0.0);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Style {
    /// What particles are drawn as.
    pub shape: Shape,
    /// What their colour means.
    pub color: ColorBy,
    /// Whether contacts are drawn, their width by the force.
    pub chains: bool,
    /// Width of the box (pixels of the SVG).
    pub width: f64,
}

impl Default for Style {
    fn default() -> Self {
        Self {
            shape: Shape::default(),
            color: ColorBy::default(),
            chains: true,
            width: 640.0,
        }
    }
}

/// How far the chords of a contour are off (pixels).
const CHORD: f64 = 0.05;
const INK: &str = "#1c1c1c";
const MARGIN: f64 = 14.0;

/// Draws `frame`; `packing` gives radii and box, `line_tension` is γ (force).
///
/// See the example of the [module](super).
#[must_use]
pub fn packing(packing: &Packing, frame: &Frame, line_tension: f64, style: &Style) -> String {
    let contacts = FrameContacts::of(packing, frame);
    let contacts = contacts.view();
    let sheet = Sheet::of(packing.domain(), style.width);
    let mut contours = Contours::new(ContourStyle {
        vertices: vertices(sheet.scale * mean(packing.radii())),
        placement: Placement::Contacts,
    });
    contours.draw(packing.radii(), &frame.positions, &contacts, line_tension);
    let shades = Shades::of(style.color, packing.radii(), frame, &contacts, &contours);

    let thin = sheet.pixels(0.03 * mean(packing.radii()));
    let (mut particles, mut outlines) = (Group::new(), Group::new());
    for (p, (&center, &radius)) in frame.positions.iter().zip(packing.radii()).enumerate() {
        match style.shape {
            Shape::Contour => {
                let outline = contours.polygon(p);
                for shift in sheet.images(outline) {
                    let points = outline.iter().map(|v| sheet.place(v + shift));
                    particles.append(polygon(points).set("fill", shades.fill(p)));
                }
            }
            // Disks overlap: the outlines lie above all of them, so that the overlaps can be seen.
            Shape::Disk => {
                let corner = Vec2::repeat(radius);
                for shift in sheet.images(&[center - corner, center + corner]) {
                    let (x, y) = sheet.place(center + shift);
                    let disk = Circle::new()
                        .set("cx", x)
                        .set("cy", y)
                        .set("r", sheet.pixels(radius));
                    outlines.append(disk.clone());
                    particles.append(disk.set("fill", shades.fill(p)));
                }
            }
        }
    }
    let drawn = |group: Group| {
        group
            .set("stroke", INK)
            .set("stroke-width", thin)
            .set("stroke-linejoin", "round")
    };
    let particles = match style.shape {
        Shape::Contour => drawn(particles),
        Shape::Disk => Group::new()
            .add(particles)
            .add(drawn(outlines).set("fill", "none")),
    };
    let mut inside = Group::new().set("clip-path", "url(#box)").add(particles);
    if style.chains && !contacts.forces.is_empty() {
        inside.append(chains(&sheet, frame, packing.radii(), &contacts));
    }
    let (x, y, width, height) = sheet.frame();
    let outline = || {
        Rectangle::new()
            .set("x", x)
            .set("y", y)
            .set("width", width)
            .set("height", height)
    };
    let clip = ClipPath::new().set("id", "box").add(outline());
    let total = (sheet.width + shades.room(), sheet.height + 26.0);
    let document = Document::new()
        .set("viewBox", (0, 0, total.0.ceil(), total.1.ceil()))
        .set("width", total.0.ceil())
        .set("height", total.1.ceil())
        .set("font-family", FONT)
        .set("font-size", 13)
        .set("fill", INK)
        .add(Definitions::new().add(clip))
        // Paper, so that the ink can be read on a dark page too.
        .add(
            Rectangle::new()
                .set("width", "100%")
                .set("height", "100%")
                .set("fill", "white"),
        )
        .add(inside)
        .add(
            outline()
                .set("fill", "none")
                .set("stroke", INK)
                .set("stroke-width", 1.2),
        )
        .add(
            Text::new(caption(packing, frame, &contacts, line_tension))
                .set("x", x)
                .set("y", y + height + 22.0),
        );
    let svg = shades.legend(document, &sheet).to_string();
    svg.replace("f_max", &f_max(13))
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len().max(1) as f64
}

/// So many vertices that the chords of a circle of this radius (pixels) are off by no more than [`CHORD`].
fn vertices(radius: f64) -> usize {
    let sides = PI / (2.0 * CHORD / radius.max(1e-3)).sqrt();
    (sides as usize).clamp(16, 240)
}

/// A closed polygon, to a hundredth of a pixel.
fn polygon(points: impl Iterator<Item = (f64, f64)>) -> Path {
    let mut data = Data::new();
    for (k, point) in points.enumerate() {
        data = if k == 0 {
            data.move_to(point)
        } else {
            data.line_to(point)
        };
    }
    Path::new().set("d", data.close())
}

/// Widths go with the force, up to three means.
fn chains(sheet: &Sheet, frame: &Frame, radii: &[f64], contacts: &Contacts<'_>) -> Group {
    let strongest = 3.0;
    let average = mean(contacts.forces);
    let widest = sheet.pixels(0.08 * mean(radii));
    let mut group = Group::new()
        .set("stroke", INK)
        .set("stroke-linecap", "round");
    for (c, &[i, _]) in contacts.pairs.iter().enumerate() {
        let from = frame.positions[i as usize];
        let ends = [from, from - contacts.normals[c] * contacts.distances[c]];
        let relative = (contacts.forces[c] / average).clamp(0.0, strongest);
        for shift in sheet.images(&ends) {
            let [(x1, y1), (x2, y2)] = ends.map(|v| sheet.place(v + shift));
            group.append(
                Line::new()
                    .set("x1", x1)
                    .set("y1", y1)
                    .set("x2", x2)
                    .set("y2", y2)
                    .set("stroke-width", hundredths(widest * relative)),
            );
        }
    }
    group
}

fn caption(packing: &Packing, frame: &Frame, contacts: &Contacts<'_>, line_tension: f64) -> String {
    let mut net = vec![Vec2::zeros(); packing.len()];
    net_forces(contacts, &mut net);
    let largest = largest_force(&net) / line_tension;
    format!(
        "N = {}, φ = {:.3}, step {}, f_max = {} γ",
        packing.len(),
        packing.coverage(),
        frame.step,
        power_of_ten(largest)
    )
}

/// Where the box lies on the sheet.
struct Sheet {
    scale: f64,
    lengths: Vec2,
    width: f64,
    height: f64,
}

impl Sheet {
    fn of(domain: Domain, width: f64) -> Self {
        let lengths = domain.lengths();
        let scale = width / lengths.x;
        Self {
            scale,
            lengths,
            width: width + 2.0 * MARGIN,
            height: scale * lengths.y + 2.0 * MARGIN,
        }
    }

    fn pixels(&self, length: f64) -> f64 {
        hundredths(self.scale * length)
    }

    /// Left, top, width and height of the box.
    fn frame(&self) -> (f64, f64, f64, f64) {
        let l = self.lengths;
        (MARGIN, MARGIN, self.pixels(l.x), self.pixels(l.y))
    }

    /// A point of the packing, whose y points up.
    fn place(&self, v: Vec2) -> (f64, f64) {
        let y = self.height - MARGIN - self.scale * v.y;
        (hundredths(MARGIN + self.scale * v.x), hundredths(y))
    }

    /// The shifts by a period that bring a shape into the box.
    fn images(&self, points: &[Vec2]) -> Vec<Vec2> {
        let (mut least, mut most) = (Vec2::repeat(f64::MAX), Vec2::repeat(f64::MIN));
        for p in points {
            least = least.inf(p);
            most = most.sup(p);
        }
        let l = self.lengths;
        let mut shifts = Vec::new();
        for x in [0.0, -l.x, l.x] {
            for y in [0.0, -l.y, l.y] {
                let shift = Vec2::new(x, y);
                let (a, b) = (least + shift, most + shift);
                if a.x < l.x && a.y < l.y && b.x > 0.0 && b.y > 0.0 {
                    shifts.push(shift);
                }
            }
        }
        shifts
    }
}

fn hundredths(x: f64) -> f64 {
    libm::round(100.0 * x) / 100.0
}

/// The colours of the particles and what they mean.
struct Shades {
    values: Vec<f64>,
    held: Vec<bool>,
    most: f64,
    title: &'static str,
    percent: bool,
}

impl Shades {
    fn of(
        color: ColorBy,
        radii: &[f64],
        frame: &Frame,
        contacts: &Contacts<'_>,
        contours: &Contours,
    ) -> Self {
        let held = held(radii.len(), contacts.pairs);
        let (values, most, title, percent) = match color {
            ColorBy::Pressure => {
                let mut pressure = vec![0.0; radii.len()];
                for (&[i, j], f) in contacts.pairs.iter().zip(contacts.forces) {
                    pressure[i as usize] += f / (2.0 * PI * radii[i as usize]);
                    pressure[j as usize] += f / (2.0 * PI * radii[j as usize]);
                }
                let pressed = pressure.iter().filter(|p| **p > 0.0).count().max(1);
                let average = pressure.iter().sum::<f64>() / pressed as f64;
                if average > 0.0 {
                    for p in &mut pressure {
                        *p /= average;
                    }
                }
                (pressure, 2.0, "p / ⟨p⟩", false)
            }
            ColorBy::Deformation => {
                let deformation = |p: usize| {
                    let off = contours
                        .polygon(p)
                        .iter()
                        .map(|v| ((v - frame.positions[p]).norm() / radii[p] - 1.0).abs());
                    off.fold(0.0, f64::max)
                };
                let values: Vec<f64> = (0..radii.len()).map(deformation).collect();
                let most = values.iter().fold(0.0, |m: f64, v| m.max(*v));
                (values, most.max(1e-12), "max |ΔR| / R", true)
            }
            ColorBy::Nothing => (Vec::new(), 1.0, "", false),
        };
        Self {
            values,
            held,
            most,
            title,
            percent,
        }
    }

    /// The colour of a value between 0 and `most`: viridis, light enough for black chains on it.
    fn shade(&self, value: f64) -> String {
        let c = colorous::VIRIDIS.eval_continuous(0.08 + 0.9 * (value / self.most).clamp(0.0, 1.0));
        let light = |part: u8| (0.62 * f64::from(part) + 0.38 * 255.0) as u8;
        format!("#{:02x}{:02x}{:02x}", light(c.r), light(c.g), light(c.b))
    }

    fn fill(&self, p: usize) -> String {
        match self.values.get(p) {
            _ if !self.held[p] => "#f4f4f4".to_owned(),
            Some(value) => self.shade(*value),
            None => "#cfdfe8".to_owned(),
        }
    }

    /// Width that the legend takes.
    fn room(&self) -> f64 {
        if self.values.is_empty() { 0.0 } else { 100.0 }
    }

    /// A colour bar at the right.
    fn legend(&self, document: Document, sheet: &Sheet) -> Document {
        const STEPS: usize = 64;
        if self.values.is_empty() {
            return document;
        }
        let (_, top, _, box_height) = sheet.frame();
        let (left, height) = (sheet.width + 6.0, 0.6 * box_height);
        let top = top + 0.2 * box_height;
        let mut bar = Group::new();
        for k in 0..STEPS {
            let value = self.most * (k as f64 + 0.5) / STEPS as f64;
            let step = height / STEPS as f64;
            bar.append(
                Rectangle::new()
                    .set("x", left)
                    .set("y", hundredths(top + height - (k + 1) as f64 * step))
                    .set("width", 16)
                    // A little more, so that no light shows between.
                    .set("height", hundredths(step + 0.6))
                    .set("fill", self.shade(value)),
            );
        }
        for part in [0.0, 0.5, 1.0] {
            let value = self.most * part;
            let label = if self.percent {
                format!("{:.1} %", 100.0 * value)
            } else {
                let beyond = part == 1.0 && self.values.iter().any(|v| *v > self.most);
                format!("{}{value}", if beyond { "≥ " } else { "" })
            };
            bar.append(
                Text::new(label)
                    .set("x", left + 22.0)
                    .set("y", hundredths(top + height * (1.0 - part) + 4.5)),
            );
        }
        bar.append(
            Text::new(self.title)
                .set("x", left)
                .set("y", hundredths(top - 12.0)),
        );
        document.add(bar)
    }
}
