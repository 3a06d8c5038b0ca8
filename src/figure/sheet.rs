//! Where things lie on the sheet: the box, its points, and arcs in it.

use super::INK;
use super::shapes::{hundredths, rectangle};
use crate::domain::{Domain, Vec2};
use crate::models::droplet::contour::Arc;
use svg::Node;
use svg::node::element::path::Data;
use svg::node::element::{ClipPath, Element, Path};

/// The margin around the box (pixels).
pub(super) const MARGIN: f64 = 14.0;
/// By how much an arc may turn (radians).
const LONGEST: f64 = 2.0;
/// An arc that bulges by no more than this is a line (pixels).
const FLAT: f64 = 0.005;

/// Where the box lies on the sheet.
pub(super) struct Sheet {
    /// Pixels a length.
    pub scale: f64,
    domain: Domain,
    /// How far the upper side of a box that leans to the left stands out there (length).
    left: f64,
    height: f64,
}

impl Sheet {
    /// `width` is that of the whole figure.
    pub fn of(domain: Domain, width: f64) -> Self {
        let lengths = domain.lengths();
        let scale = (width - 2.0 * MARGIN) / (lengths.x + domain.tilt().abs());
        Self {
            scale,
            domain,
            left: (-domain.tilt()).max(0.0),
            height: scale * lengths.y + 2.0 * MARGIN,
        }
    }

    pub fn pixels(&self, length: f64) -> f64 {
        hundredths(self.scale * length)
    }

    /// Left, top, width and height of the box, what leans over included.
    pub fn frame(&self) -> (f64, f64, f64, f64) {
        let l = self.domain.lengths();
        let width = self.pixels(l.x + self.domain.tilt().abs());
        (MARGIN, MARGIN, width, self.pixels(l.y))
    }

    /// The area of the box, as what others are clipped by.
    pub fn clip(&self) -> ClipPath {
        let mut clip = ClipPath::new().set("id", "box");
        clip.append(self.outline());
        clip
    }

    /// The box as a line.
    pub fn edge(&self) -> Element {
        let mut edge = self.outline();
        edge.assign("fill", "none");
        edge.assign("stroke", INK);
        edge.assign("stroke-width", 1.2);
        edge
    }

    fn outline(&self) -> Element {
        if self.domain.tilt() == 0.0 {
            let (x, y, width, height) = self.frame();
            return rectangle((x, y), (width, height)).into();
        }
        let [first, rest @ ..] = self.domain.corners().map(|corner| self.place(corner));
        let data = rest[..3]
            .iter()
            .fold(Data::new().move_to(first), |data, &at| data.line_to(at));
        Path::new().set("d", data.close()).into()
    }

    /// A point of the packing, whose y points up.
    pub fn place(&self, v: Vec2) -> (f64, f64) {
        let y = self.height - MARGIN - self.scale * v.y;
        let x = MARGIN + self.scale * (v.x + self.left);
        (hundredths(x), hundredths(y))
    }

    /// The shifts by a period that bring a shape into the box.
    pub fn images(&self, points: &[Vec2]) -> Vec<Vec2> {
        let (mut least, mut most) = (Vec2::repeat(f64::MAX), Vec2::repeat(f64::MIN));
        // In the upright box that becomes this one when it is sheared.
        for p in points.iter().map(|p| self.domain.straightened(*p)) {
            least = least.inf(&p);
            most = most.sup(&p);
        }
        let l = self.domain.lengths();
        let meets = |shift: &Vec2| {
            let upright = self.domain.straightened(*shift);
            let (a, b) = (least + upright, most + upright);
            a.x < l.x && a.y < l.y && b.x > 0.0 && b.y > 0.0
        };
        self.domain.around().filter(meets).collect()
    }

    /// Goes on from the beginning of `arc`, moved by `shift`, to its end.
    pub fn follow(&self, path: Data, arc: &Arc, shift: Vec2) -> Data {
        // Where an arc turns by almost half a turn, its radius and its ends to a hundredth of a pixel say little of it.
        if arc.turn.abs() > LONGEST {
            let halves = arc.halves();
            return halves
                .iter()
                .fold(path, |path, half| self.follow(path, half, shift));
        }
        let [from, to] = arc.ends;
        let (x, y) = self.place(to + shift);
        let bulge = 0.5 * (to - from).norm() * libm::tan(0.25 * arc.turn);
        if (self.scale * bulge).abs() < FLAT {
            return path.line_to((x, y));
        }
        let radius = self.pixels(1.0 / arc.curvature().abs());
        let clockwise = u8::from(arc.turn < 0.0);
        path.elliptical_arc_to((radius, radius, 0, 0, clockwise, x, y))
    }
}
