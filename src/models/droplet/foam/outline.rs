//! The outline of a droplet: chords or arcs where it touches, arcs of its corner radius between them.
//!
//! With `ℓ` the chord of a contact on this side (`r f` where films are straight, `2 f r_i r_j/(r_i + r_j)` where they are arcs), the film goes
//! from `x + ρ n + (m − ℓ/2) t` to `x + ρ n + (m + ℓ/2) t`, bent by `δ`; a free arc goes from the normal angle `θ_k + δ_k` to
//! `θ_{k+1} − δ_{k+1}`. In balance the pieces meet with one tangent. On the way there the centre of a free arc drifts from where its first end
//! has it to where its last end has it.

use super::super::kernel::Direction;
use super::super::outline::{Extent, Stretch};
use super::{Films, Foam};
use crate::domain::Vec2;
use core::f64::consts::PI;

/// Where a droplet touches another.
struct Touch {
    /// The angle of the outward normal (radians).
    angle: f64,
    /// The bend of the film seen from this droplet (radians).
    bend: f64,
    /// The ends of the film, seen from the centre (length).
    ends: [Vec2; 2],
}

impl Foam {
    /// [`Contours::trace`](super::super::contour::Contours::trace) of the frame at hand; the number of vertices.
    pub(crate) fn trace<V: Stretch>(
        &self,
        radii: &[f64],
        positions: &[Vec2],
        spacing: usize,
        vertices: &mut Vec<V>,
        mut drawn: impl FnMut(&mut Vec<V>, usize, Extent),
    ) -> u64 {
        let (mut points, mut count) = (Vec::new(), 0);
        for (p, (&radius, &centre)) in radii.iter().zip(positions).enumerate() {
            points.clear();
            let deepest = self.outline(p, radius, spacing, &mut points);
            let reach = points.iter().map(Vec2::norm).fold(radius, f64::max);
            let start = vertices.len();
            vertices.extend(points.iter().map(|v| {
                // A vertex is told by its direction and its distance; any factor will do.
                let seen = Direction {
                    cos: v.x,
                    sin: v.y,
                    angle: 0.0,
                };
                V::at(centre, seen, 1.0)
            }));
            count += points.len() as u64;
            let reach = 1.000_001 * reach;
            drawn(vertices, start, Extent { deepest, reach });
        }
        count
    }

    /// The vertices of droplet `p`, seen from its centre, anticlockwise: both ends of each film, and others no farther apart along arcs than a
    /// `vertices`-th of a turn. How deep its deepest dent is below the undeformed circle (length).
    pub(crate) fn outline(
        &self,
        p: usize,
        radius: f64,
        vertices: usize,
        points: &mut Vec<Vec2>,
    ) -> f64 {
        let spacing = 2.0 * PI / vertices as f64;
        let r = self.state.corners()[p];
        let touches = self.touches(p, radius);
        let Some(first) = touches.first() else {
            points.extend((0..vertices).map(|k| at(k as f64 * spacing) * radius));
            return 0.0;
        };
        let next = touches.iter().skip(1).map(|touch| (touch, touch.angle));
        let next = next.chain([(first, first.angle + 2.0 * PI)]);
        for (touch, (after, angle)) in touches.iter().zip(next) {
            film(touch, spacing, points);
            // The free arc behind it.
            let (from, to) = (touch.angle + touch.bend, angle - after.bend);
            let centres = [touch.ends[1] - at(from) * r, after.ends[0] - at(to) * r];
            let pieces = ((to - from) / spacing).ceil();
            for k in 1..pieces.max(1.0) as usize {
                let share = k as f64 / pieces;
                let centre = centres[0] * (1.0 - share) + centres[1] * share;
                points.push(centre + at(from + share * (to - from)) * r);
            }
        }
        let dents = touches
            .iter()
            .flat_map(|touch| touch.ends)
            .map(|end| radius - end.norm());
        let middle = touches
            .iter()
            .map(|touch| radius - (touch.ends[0] + touch.ends[1]).norm() / 2.0);
        dents.chain(middle).fold(0.0, f64::max)
    }

    /// Where droplet `p` bears a force, anticlockwise from the angle −π.
    fn touches(&self, p: usize, radius: f64) -> Vec<Touch> {
        let mut touches = Vec::new();
        for side in self.lines.sides(p) {
            let (c, end) = (side.line as usize, usize::from(side.is_second));
            let load = self.state.loads()[c];
            if load <= 0.0 {
                continue;
            }
            let n = if side.is_second {
                -self.lines.normals()[c]
            } else {
                self.lines.normals()[c]
            };
            let t = Vec2::new(-n.y, n.x);
            let pair = self.lines.pairs()[c].map(|p| self.state.corners()[p as usize]);
            let (film, number) = (self.state.film(c), self.lines.sides_of(c)[end]);
            let half = match self.films {
                Films::Straight => 0.5 * pair[end] * load,
                Films::Arcs => load * pair[0] * pair[1] / (pair[0] + pair[1]),
            };
            let chord = radius - self.state.hollows(&self.lines, c)[end];
            let middle = n * chord + t * (pair[end] * self.state.sides()[number].m);
            touches.push(Touch {
                angle: libm::atan2(n.y, n.x),
                bend: film.bend()[end],
                ends: [middle - t * half, middle + t * half],
            });
        }
        touches.sort_by(|a, b| a.angle.total_cmp(&b.angle));
        touches
    }
}

/// The vertices of a film, its ends among them.
fn film(touch: &Touch, spacing: f64, points: &mut Vec<Vec2>) {
    let [from, to] = touch.ends;
    points.push(from);
    let pieces = (2.0 * touch.bend.abs() / spacing).ceil();
    if pieces > 1.0 {
        // An arc of radius |chord|/2 sin δ, whose normal turns by 2δ; its centre lies behind the chord where δ > 0.
        let radius = (to - from).norm() / (2.0 * libm::sin(touch.bend));
        let centre = from - at(touch.angle - touch.bend) * radius;
        for k in 1..pieces as usize {
            let angle = touch.angle + touch.bend * (2.0 * k as f64 / pieces - 1.0);
            points.push(centre + at(angle) * radius);
        }
    }
    points.push(to);
}

fn at(angle: f64) -> Vec2 {
    let (sin, cos) = libm::sincos(angle);
    Vec2::new(cos, sin)
}
