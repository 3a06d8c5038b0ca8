//! Contacts of droplets that keep their area, drawn as the films that they are.

use super::bar::Bar;
use super::legend::Legend;
use super::sheet::Sheet;
use crate::domain::Vec2;
use crate::models::droplet::contour::{Contours, FilmArc};
use svg::Node as _;
use svg::node::element::path::Data;
use svg::node::element::{Group, Path};

/// Pressures that differ by less (γ a mean radius) are equal.
const EQUAL: f64 = 1e-9;

/// The films of a packing, whose colour says how much the pressures on their two sides differ.
pub(super) struct Films {
    arcs: Vec<FilmArc>,
    /// The mean radius, by which a pressure times a length becomes a number (length).
    radius: f64,
    bar: Bar,
}

impl Films {
    /// Nothing where there is no film.
    pub fn of(contours: &Contours, radii: &[f64]) -> Option<Self> {
        let arcs = contours.films(radii);
        let radius = super::mean(radii);
        // What rounding makes of equal pressures is no range for colours.
        let differences = arcs.iter().map(|film| film.pressure * radius);
        let differences: Vec<f64> = differences
            .map(|d| if d < EQUAL { 0.0 } else { d })
            .collect();
        (!arcs.is_empty()).then(|| Self {
            arcs,
            radius,
            bar: Bar::of("|Δp| ⟨R⟩ / γ", &differences, None, shade),
        })
    }

    /// All films, in lines of this width (pixels).
    pub fn draw(&self, sheet: &Sheet, positions: &[Vec2], width: f64) -> Group {
        let mut group = Group::new()
            .set("fill", "none")
            .set("stroke-width", super::hundredths(width))
            // So that a weak contact is a dot.
            .set("stroke-linecap", "round");
        for film in &self.arcs {
            let center = positions[film.particle];
            let [first, second] = film.arc.halves().map(|half| half.ends.map(|v| v + center));
            for shift in sheet.images(&[first, second].concat()) {
                let start = Data::new().move_to(sheet.place(first[0] + shift));
                let path = sheet.follow(start, &film.arc, center + shift);
                let color = self.bar.shade(film.pressure * self.radius);
                group.append(Path::new().set("d", path).set("stroke", color));
            }
        }
        group
    }

    pub fn key(&self, legend: &mut Legend) {
        self.bar.draw(legend);
    }
}

/// From ink to orange, which no particle has.
fn shade(part: f64) -> String {
    let c = colorous::INFERNO.eval_continuous(0.05 + 0.7 * part);
    format!("#{:02x}{:02x}{:02x}", c.r, c.g, c.b)
}
