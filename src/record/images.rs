//! What crosses the edge of the periodic box, drawn whole on the other side as well.
//!
//! A shape that reaches over an edge has images in the neighbouring boxes, and one of them reaches into this box from the
//! other side. Without it the box has holes along two of its edges. Images are entities of their own, so that particle
//! `i` stays instance `i` of `/world/contours` and contact `c` instance `c` of `/world/contacts`.

use super::cells::{Cells, own};
use super::columns::{Column, StripRows};
use super::pictures::{Rgb, dimmed};
use crate::domain::{Domain, Vec2};
use std::borrow::Cow;
use std::io;

/// Where the particles are drawn: between the slanted sides of a sheared box.
pub(super) fn seats(domain: Domain, positions: &[Vec2]) -> Cow<'_, [Vec2]> {
    if domain.tilt() == 0.0 {
        return Cow::Borrowed(positions);
    }
    Cow::Owned(positions.iter().map(|x| domain.seat(*x)).collect())
}

/// Whether nothing that is no farther than `reach` from `centre` crosses an edge of the box, rounding to single precision
/// included.
pub(super) fn is_within(domain: Domain, centre: Vec2, reach: f64) -> bool {
    let l = domain.lengths();
    let reach = reach + 1e-6 * (l.x + l.y);
    // A slanted side is nearer than it is along x.
    let slant = l.x / domain.heights().x;
    let inside = |x: f64, l: f64, reach: f64| x >= reach && x + reach <= l;
    inside(domain.straightened(centre).x, l.x, reach * slant) && inside(centre.y, l.y, reach)
}

/// The shifts by a period that bring at least one of `vertices` into the open box, but for none at all: none for most
/// shapes, one for a shape across an edge, up to three for one across a corner.
pub(super) fn shifts_of_polygon(domain: Domain, vertices: &[[f32; 2]], mut each: impl FnMut(Vec2)) {
    let l = domain.lengths();
    // Comparisons rather than minima: the loop is run for every vertex of every frame.
    let (mut least, mut most) = ([f32::INFINITY; 2], [f32::NEG_INFINITY; 2]);
    let slope = domain.tilt() / l.y;
    for &[x, y] in vertices {
        let v = [x - (slope * f64::from(y)) as f32, y];
        for k in 0..2 {
            least[k] = if v[k] < least[k] { v[k] } else { least[k] };
            most[k] = if v[k] > most[k] { v[k] } else { most[k] };
        }
    }
    let double = |&[x, y]: &[f32; 2]| Vec2::new(x.into(), y.into());
    let (least, most) = (double(&least), double(&most));
    around(domain, least, most, |shift, upright| {
        let inside = |v: &[f32; 2]| {
            let v = domain.straightened(double(v)) + upright;
            let (x, y) = (v.x, v.y);
            x > 0.0 && x < l.x && y > 0.0 && y < l.y
        };
        if vertices.iter().any(inside) {
            each(shift);
        }
    });
}

/// The shifts by a period that bring a part of `segment` into the open box, but for none at all.
pub(super) fn shifts_of_segment(domain: Domain, &[a, b]: &[Vec2; 2], mut each: impl FnMut(Vec2)) {
    let l = domain.lengths();
    let [a, b] = [a, b].map(|end| domain.straightened(end));
    around(domain, a.inf(&b), a.sup(&b), |shift, upright| {
        // Two convex shapes are apart if one of their sides separates them: for the sides of the box `around` has asked.
        let middle = 0.5 * (a + b) + upright - 0.5 * l;
        let half = 0.5 * (b - a);
        let reach = 0.5 * (l.x * half.y.abs() + l.y * half.x.abs());
        if half.perp(&middle).abs() < reach {
            each(shift);
        }
    });
}

/// The shifts by a period that bring the rectangle between `least` and `most` into the open box, but for none at all: rectangle and second shift in
/// the upright box that becomes this one when it is sheared.
fn around(domain: Domain, least: Vec2, most: Vec2, mut each: impl FnMut(Vec2, Vec2)) {
    let l = domain.lengths();
    if least.x >= 0.0 && least.y >= 0.0 && most.x <= l.x && most.y <= l.y {
        return;
    }
    for shift in domain.around().skip(1) {
        let upright = domain.straightened(shift);
        let (a, b) = (least + upright, most + upright);
        if a.x < l.x && a.y < l.y && b.x > 0.0 && b.y > 0.0 {
            each(shift, upright);
        }
    }
}

/// How bright an image is beside what it is the image of.
const BRIGHTNESS: f64 = 0.65;

/// Rows of images in the making.
#[derive(Default)]
pub(super) struct ImageRows {
    pub strips: StripRows,
    /// What each is the image of: the number of a particle or of a contact.
    pub of: Cells<u32, 1>,
}

impl ImageRows {
    /// Adds the image of `points` of number `of`, moved by `shift`; `points` have the colour `rgb`.
    pub fn image(&mut self, points: &[[f32; 2]], shift: Vec2, rgb: Rgb, of: usize) {
        let moved = |&[x, y]: &[f32; 2]| {
            [
                (f64::from(x) + shift.x) as f32,
                (f64::from(y) + shift.y) as f32,
            ]
        };
        self.strips
            .strip(points.iter().map(moved), dimmed(rgb, BRIGHTNESS));
        self.of.push([of as u32]);
    }

    /// Closes the row at hand.
    pub fn end_row(&mut self, step: u64, nanoseconds: i64) {
        self.strips.end_row(step, nanoseconds);
        self.of.end_row();
    }

    /// The components of all rows; the numbers of what they are images of are the component `of`.
    pub fn into_columns(self, of: &'static str) -> io::Result<Vec<Column>> {
        let of = self.of.into_column(own(of))?;
        let mut columns = self.strips.into_columns()?;
        columns.push(of);
        Ok(columns)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn domain() -> Domain {
        Domain::new(10.0, 6.0).unwrap()
    }

    fn square(x: f32, y: f32) -> [[f32; 2]; 4] {
        [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]].map(|[a, b]| [x + a, y + b])
    }

    fn polygon(x: f32, y: f32) -> Vec<[f64; 2]> {
        let mut shifts = Vec::new();
        shifts_of_polygon(domain(), &square(x, y), |s| shifts.push([s.x, s.y]));
        shifts
    }

    #[test]
    fn a_shape_has_as_many_images_as_it_crosses_edges_and_corners() {
        assert!(polygon(5.0, 3.0).is_empty());
        assert!(
            polygon(9.0, 3.0).is_empty(),
            "to touch the edge is not to cross it"
        );
        assert_eq!(polygon(9.5, 3.0), [[-10.0, 0.0]]);
        assert_eq!(polygon(5.0, 0.2), [[0.0, 6.0]]);
        assert_eq!(polygon(0.1, 5.9), [[0.0, -6.0], [10.0, 0.0], [10.0, -6.0]]);
    }

    #[test]
    fn a_segment_has_an_image_in_every_box_that_it_passes() {
        let images = |a: [f64; 2], b: [f64; 2]| {
            let mut shifts = Vec::new();
            shifts_of_segment(domain(), &[a.into(), b.into()], |s| shifts.push([s.x, s.y]));
            shifts
        };
        assert!(images([1.0, 1.0], [2.0, 5.0]).is_empty());
        assert_eq!(images([9.5, 3.0], [10.5, 3.0]), [[-10.0, 0.0]]);
        // Past the corner, through the box at the right or through the one above.
        assert_eq!(
            images([9.5, 5.0], [10.5, 6.1]),
            [[-10.0, 0.0], [-10.0, -6.0]]
        );
        assert_eq!(
            images([9.0, 5.5], [10.1, 6.5]),
            [[0.0, -6.0], [-10.0, -6.0]]
        );
    }
}
