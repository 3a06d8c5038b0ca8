//! Arcs of circles, which the contours of droplets that keep their area are made of.

use crate::domain::Vec2;

/// An arc of a circle or a straight line, a part of a contour that is followed anticlockwise.
///
/// ```
/// use softjam::domain::Vec2;
/// use softjam::models::droplet::contour::Arc;
/// use std::f64::consts::PI;
///
/// let half = Arc { ends: [Vec2::new(2.0, 0.0), Vec2::new(-2.0, 0.0)], turn: PI };
/// assert!((half.curvature() - 0.5).abs() < 1e-15);
/// assert!((half.halves()[0].ends[1] - Vec2::new(0.0, 2.0)).norm() < 1e-15);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Arc {
    /// Where it begins and where it ends (length).
    pub ends: [Vec2; 2],
    /// How far its normal turns anticlockwise on the way (radians, between −2π and 2π): positive where the droplet bulges, 0 on a straight line.
    pub turn: f64,
}

impl Arc {
    /// `2 sin(turn/2)/chord` (1/length).
    #[must_use]
    pub fn curvature(&self) -> f64 {
        2.0 * libm::sin(0.5 * self.turn) / (self.ends[1] - self.ends[0]).norm()
    }

    /// Its two halves.
    #[must_use]
    pub fn halves(&self) -> [Self; 2] {
        let [from, to] = self.ends;
        let chord = to - from;
        let outward = Vec2::new(chord.y, -chord.x);
        let middle = (from + to) * 0.5 + outward * (0.5 * libm::tan(0.25 * self.turn));
        [[from, middle], [middle, to]].map(|ends| Self {
            ends,
            turn: 0.5 * self.turn,
        })
    }
}

/// A contact between two droplets that keep their area.
///
/// See the example of [`Contours::films`](super::contour::Contours::films).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FilmArc {
    /// The droplet of the smaller corner radius, out of which the film bulges.
    pub particle: usize,
    /// The film, seen from the centre of that droplet (length).
    pub arc: Arc,
    /// How much larger the pressure is in that droplet, `1/r_i − 1/r_j` (γ/length).
    pub pressure: f64,
}
