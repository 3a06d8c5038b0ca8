//! The outline of a droplet: chords or arcs where it touches, arcs of its corner radius between them.
//!
//! With `ℓ` the chord of a contact on this side (`r f` where films are straight, `2 f r_i r_j/(r_i + r_j)` where they are arcs), the film goes
//! from `x + ρ n + (m − ℓ/2) t` to `x + ρ n + (m + ℓ/2) t`, bent by `δ`; a free arc goes from the normal angle `θ_k + δ_k` to
//! `θ_{k+1} − δ_{k+1}`. In balance the pieces meet with one tangent, and both droplets of a bent film have the same arc. On the way there the centre
//! of a free arc drifts from where its first end has it to where its last end has it, and contours are polygons.

use super::super::arc::{Arc, FilmArc};
use super::super::kernel::Direction;
use super::super::outline::{Extent, Stretch};
use super::sides::Side;
use super::{Films, Foam};
use crate::domain::Vec2;
use core::f64::consts::PI;

/// A contour whose arcs have their centres in one place to this part of the corner radius is drawn with arcs.
const CLOSED: f64 = 1e-3;

/// Where a droplet touches another.
struct Touch {
    /// The angle of the outward normal (radians).
    angle: f64,
    /// The film, seen from the centre (length).
    film: Arc,
}

impl Touch {
    /// `δ`, the bend of the film seen from this droplet (radians).
    fn bend(&self) -> f64 {
        0.5 * self.film.turn
    }
}

/// A free arc between two films.
struct Free {
    /// The arc, seen from the droplet's centre (length).
    arc: Arc,
    /// The angle of the normal where it begins (radians).
    from: f64,
    /// The centres that an arc of the corner radius has by its first and by its last end (length).
    centres: [Vec2; 2],
}

/// The free arcs of corner radius `r` behind each of the touches.
fn free_arcs(touches: &[Touch], r: f64) -> impl Iterator<Item = Free> {
    let first = touches.first();
    let next = touches.iter().skip(1).map(|touch| (touch, touch.angle));
    let next = next.chain(first.map(|touch| (touch, touch.angle + 2.0 * PI)));
    touches.iter().zip(next).map(move |(touch, (next, angle))| {
        let (from, to) = (touch.angle + touch.bend(), angle - next.bend());
        let ends = [touch.film.ends[1], next.film.ends[0]];
        Free {
            arc: Arc {
                ends,
                turn: to - from,
            },
            from,
            centres: [ends[0] - at(from) * r, ends[1] - at(to) * r],
        }
    })
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
        if touches.is_empty() {
            points.extend((0..vertices).map(|k| at(k as f64 * spacing) * radius));
            return 0.0;
        }
        for (touch, free) in touches.iter().zip(free_arcs(&touches, r)) {
            film(touch, spacing, points);
            let (turn, centres) = (free.arc.turn, free.centres);
            let pieces = (turn / spacing).ceil();
            for k in 1..pieces.max(1.0) as usize {
                let share = k as f64 / pieces;
                let centre = centres[0] * (1.0 - share) + centres[1] * share;
                points.push(centre + at(free.from + share * turn) * r);
            }
        }
        let dents = touches
            .iter()
            .flat_map(|touch| touch.film.ends)
            .map(|end| radius - end.norm());
        let middle = touches
            .iter()
            .map(|touch| radius - (touch.film.ends[0] + touch.film.ends[1]).norm() / 2.0);
        dents.chain(middle).fold(0.0, f64::max)
    }

    /// The contour of droplet `p` as arcs, anticlockwise and seen from its centre; `None` on the way to balance, where arcs do not join with one
    /// tangent.
    pub(crate) fn arcs(&self, p: usize, radius: f64) -> Option<Vec<Arc>> {
        let (r, touches) = (self.state.corners()[p], self.touches(p, radius));
        if touches.is_empty() {
            let [east, west] = [Vec2::new(radius, 0.0), Vec2::new(-radius, 0.0)];
            let half = |ends| Arc { ends, turn: PI };
            return Some(vec![half([east, west]), half([west, east])]);
        }
        let mut arcs = Vec::new();
        for (touch, free) in touches.iter().zip(free_arcs(&touches, r)) {
            let [a, b] = free.centres;
            if !((a - b).norm() <= CLOSED * r && free.arc.turn > 0.0) {
                return None;
            }
            arcs.extend([touch.film, free.arc]);
        }
        Some(arcs)
    }

    /// The contacts that bear a force, between droplets of these undeformed `radii`, in the order of their pairs.
    pub(crate) fn film_arcs(&self, radii: &[f64]) -> Vec<FilmArc> {
        let corners = self.state.corners();
        let of_line = |(c, pair): (usize, &[u32; 2])| {
            let [i, j] = pair.map(|p| p as usize);
            let is_second = corners[j] < corners[i];
            let (particle, other) = if is_second { (j, i) } else { (i, j) };
            let line = c as u32;
            let touch = self.touch(Side { line, is_second }, radii[particle])?;
            Some(FilmArc {
                particle,
                arc: touch.film,
                pressure: 1.0 / corners[particle] - 1.0 / corners[other],
            })
        };
        let pairs = self.lines.pairs().iter().enumerate();
        pairs.filter_map(of_line).collect()
    }

    /// Where droplet `p` bears a force, anticlockwise from the angle −π.
    fn touches(&self, p: usize, radius: f64) -> Vec<Touch> {
        let sides = self.lines.sides(p).iter();
        let mut touches: Vec<Touch> = sides.filter_map(|side| self.touch(*side, radius)).collect();
        touches.sort_by(|a, b| a.angle.total_cmp(&b.angle));
        touches
    }

    /// Where a droplet of undeformed `radius` bears a force on this side.
    fn touch(&self, side: Side, radius: f64) -> Option<Touch> {
        let (c, end) = (side.line as usize, usize::from(side.is_second));
        let load = self.state.loads()[c];
        if load <= 0.0 {
            return None;
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
        let middle = n * chord + t * (pair[end] * self.state.side(number).m);
        Some(Touch {
            angle: libm::atan2(n.y, n.x),
            film: Arc {
                ends: [middle - t * half, middle + t * half],
                turn: 2.0 * film.bend()[end],
            },
        })
    }
}

/// The vertices of a film, its ends among them.
fn film(touch: &Touch, spacing: f64, points: &mut Vec<Vec2>) {
    let ([from, to], bend) = (touch.film.ends, touch.bend());
    points.push(from);
    let pieces = (2.0 * bend.abs() / spacing).ceil();
    if pieces > 1.0 {
        // An arc of radius |chord|/2 sin δ, whose normal turns by 2δ; its centre lies behind the chord where δ > 0.
        let radius = (to - from).norm() / (2.0 * libm::sin(bend));
        let centre = from - at(touch.angle - bend) * radius;
        for k in 1..pieces as usize {
            let angle = touch.angle + bend * (2.0 * k as f64 / pieces - 1.0);
            points.push(centre + at(angle) * radius);
        }
    }
    points.push(to);
}

fn at(angle: f64) -> Vec2 {
    let (sin, cos) = libm::sincos(angle);
    Vec2::new(cos, sin)
}
