//! One contour between its contacts: the sums of [`contour`](super::contour), sector by sector.

use super::kernel::{Direction, G_MAX};
use crate::domain::Vec2;
use crate::numerics::wide::wide;
use core::f64::consts::PI;

/// Vertices that are computed at a time in single precision.
const LANES: usize = 8;

/// Equally spaced directions, by ascending angle in `(−π, π]`.
#[derive(Clone, Debug)]
pub(crate) struct Circle {
    pub directions: Vec<Direction>,
    /// [`LANES`] cosines, sines and angles from each direction on; behind the last they are 0.
    single: Vec<[[f32; LANES]; 3]>,
    /// The angles between −∞ and twice ∞.
    angles: Vec<f64>,
}

impl Circle {
    pub fn of(directions: Vec<Direction>) -> Self {
        let from = |k: usize, of: fn(&Direction) -> f64| {
            core::array::from_fn(|n| directions.get(k + n).map_or(0.0, of) as f32)
        };
        let from = |k| [from(k, |d| d.cos), from(k, |d| d.sin), from(k, |d| d.angle)];
        let angles = directions.iter().map(|d| d.angle);
        let below = core::iter::once(f64::NEG_INFINITY);
        Self {
            angles: below.chain(angles).chain([f64::INFINITY; 2]).collect(),
            single: (0..directions.len()).map(from).collect(),
            directions,
        }
    }

    /// How many directions have a smaller angle than `angle`.
    #[inline(always)]
    fn before(&self, angle: f64) -> usize {
        let turns = (angle - self.angles[1]) * (0.5 / PI);
        // A conversion saturates; what rounding has done to the guess, one too many or too few, is mended. The first of the
        // angles is below all others, the last above.
        let guess = ((turns * self.directions.len() as f64) as usize).min(self.directions.len());
        let around: &[f64] = &self.angles[guess..guess + 3];
        guess + usize::from(around[1] < angle) + usize::from(around[2] < angle)
            - usize::from(around[0] >= angle)
    }
}

/// A vertex in double precision, or in the single precision of a viewer.
pub(crate) trait Vertex: Copy {
    /// The vertex at the distance `rho` from `centre` in `direction` (length).
    fn at(centre: Vec2, direction: Direction, rho: f64) -> Self;
}

impl Vertex for Vec2 {
    #[inline(always)]
    fn at(centre: Vec2, direction: Direction, rho: f64) -> Self {
        Vec2::new(
            centre.x + direction.cos * rho,
            centre.y + direction.sin * rho,
        )
    }
}

impl Vertex for [f32; 2] {
    #[inline(always)]
    fn at(centre: Vec2, direction: Direction, rho: f64) -> Self {
        let v = <Vec2 as Vertex>::at(centre, direction, rho);
        [v.x as f32, v.y as f32]
    }
}

/// Vertices with a way of their own to draw the part of a contour between two contacts.
pub(crate) trait Stretch: Vertex {
    /// What all parts of a contour have in common.
    type Pen: Copy;

    fn pen(sector: &Sector) -> Self::Pen;

    /// Appends the vertices of `sector` in the directions `range` of `circle`.
    fn stretch(
        circle: &Circle,
        range: core::ops::Range<usize>,
        sector: &Sector,
        pen: Self::Pen,
        vertices: &mut Vec<Self>,
    );
}

impl Stretch for Vec2 {
    type Pen = ();

    #[inline(always)]
    fn pen(_: &Sector) -> Self::Pen {}

    #[inline(always)]
    fn stretch(
        circle: &Circle,
        range: core::ops::Range<usize>,
        sector: &Sector,
        (): Self::Pen,
        vertices: &mut Vec<Self>,
    ) {
        let directions = circle.directions[range].iter();
        vertices.extend(directions.map(|d| Self::at(sector.centre, *d, sector.rho(d))));
    }
}

/// A sector's centre, radius, `S_c` and `S_s`, and what single precision leaves of the centre.
#[derive(Clone, Copy)]
pub(crate) struct SinglePen {
    centre: [f32; 2],
    rest: [f32; 2],
    radius: f32,
    s_c: f32,
    s_s: f32,
}

/// `ρ` is off by some roundings of its own size, the vertex by one rounding of its place besides.
impl Stretch for [f32; 2] {
    type Pen = SinglePen;

    #[inline(always)]
    fn pen(sector: &Sector) -> Self::Pen {
        let centre = [sector.centre.x, sector.centre.y];
        SinglePen {
            centre: centre.map(|x| x as f32),
            rest: centre.map(|x| (x - f64::from(x as f32)) as f32),
            radius: sector.radius as f32,
            s_c: sector.s_c as f32,
            s_s: sector.s_s as f32,
        }
    }

    #[inline(always)]
    fn stretch(
        circle: &Circle,
        range: core::ops::Range<usize>,
        sector: &Sector,
        pen: Self::Pen,
        vertices: &mut Vec<Self>,
    ) {
        let (p, q) = (sector.p as f32, sector.q as f32);
        let length = vertices.len() + range.len();
        let mut k = range.start;
        while k < range.end {
            let [cos, sin, angle] = &circle.single[k];
            let mut some = [[0.0; 2]; LANES];
            for n in 0..LANES {
                let along = sin[n] * (p - angle[n] * pen.s_c) - cos[n] * (q - angle[n] * pen.s_s);
                let rho = pen.radius + along;
                some[n] = [
                    pen.centre[0] + (pen.rest[0] + cos[n] * rho),
                    pen.centre[1] + (pen.rest[1] + sin[n] * rho),
                ];
            }
            vertices.extend_from_slice(&some);
            k += LANES;
        }
        vertices.truncate(length);
    }
}

/// One particle that is being drawn.
pub(super) struct Outline {
    pub centre: Vec2,
    pub radius: f64,
    /// `R_i/2πγ` (length per force).
    pub scale: f64,
}

/// How far a contour is from a circle.
#[derive(Clone, Copy)]
#[cfg_attr(
    not(feature = "recording"),
    expect(dead_code, reason = "only recordings ask for it")
)]
pub(crate) struct Extent {
    /// The deepest dent at a contact, the largest `R_i − ρ_i` there (length).
    pub deepest: f64,
    /// No vertex is farther from the centre (length).
    pub reach: f64,
}

impl Outline {
    /// Appends the vertices on `circle` and, with `tips`, on the angles of the contacts, which ascend.
    pub fn draw<V: Stretch>(
        &self,
        circle: &Circle,
        contacts: &[(Direction, f64)],
        tips: bool,
        vertices: &mut Vec<V>,
    ) -> Extent {
        wide(
            #[inline(always)]
            || self.draw_here(circle, contacts, tips, vertices),
        )
    }

    #[inline(always)]
    fn draw_here<V: Stretch>(
        &self,
        circle: &Circle,
        contacts: &[(Direction, f64)],
        tips: bool,
        vertices: &mut Vec<V>,
    ) -> Extent {
        // The sums of the module's text, in units of length: f R_i/2πγ instead of f.
        let (mut s, mut s_c, mut s_s, mut a_c, mut a_s) = (0.0, 0.0, 0.0, 0.0, 0.0);
        for (d, f) in contacts {
            let f = self.scale * f;
            let (c, s_j) = (f * d.cos, f * d.sin);
            s += f;
            s_c += c;
            s_s += s_j;
            a_c += c * (d.angle - PI);
            a_s += s_j * (d.angle - PI);
        }
        let mut sector = Sector {
            centre: self.centre,
            radius: self.radius - s,
            p: a_c - 0.5 * s_s,
            q: a_s + 0.5 * s_c,
            s_c,
            s_s,
        };
        let pen = V::pen(&sector);
        // What is drawn at a time may reach beyond the end.
        vertices.reserve(circle.directions.len() + contacts.len() + LANES);
        let (mut drawn, mut deepest) = (0, 0.0_f64);
        for (contact, f) in contacts {
            let end = circle.before(contact.angle).max(drawn);
            V::stretch(circle, drawn..end, &sector, pen, vertices);
            let rho = sector.rho(contact);
            deepest = deepest.max(self.radius - rho);
            if tips {
                vertices.push(V::at(self.centre, *contact, rho));
            }
            drawn = end;
            let turn = 2.0 * PI * self.scale * f;
            sector.p += turn * contact.cos;
            sector.q += turn * contact.sin;
        }
        V::stretch(
            circle,
            drawn..circle.directions.len(),
            &sector,
            pen,
            vertices,
        );
        // Every f is at least 0, and rounding is far below a millionth.
        let reach = 1.000_001 * (self.radius + G_MAX * s);
        Extent { deepest, reach }
    }
}

/// A contour between two neighbouring contacts: `ρ(θ) = R − S + sin θ (P − θ S_c) − cos θ (Q − θ S_s)`, all in units of
/// length.
pub(crate) struct Sector {
    centre: Vec2,
    /// `R − S`.
    radius: f64,
    /// `A_c − ½ S_s`.
    p: f64,
    /// `A_s + ½ S_c`.
    q: f64,
    s_c: f64,
    s_s: f64,
}

impl Sector {
    #[inline(always)]
    fn rho(&self, d: &Direction) -> f64 {
        let along_sin = self.p - d.angle * self.s_c;
        let along_cos = self.q - d.angle * self.s_s;
        self.radius + (d.sin * along_sin - d.cos * along_cos)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn directions_before_an_angle_are_counted() {
        for n in [3, 4, 7, 32, 1000] {
            let below = n - (n / 2 + 1);
            let angle = |k: usize| 2.0 * PI * (k as f64 - below as f64) / n as f64;
            let directions = (0..n).map(|k| Direction {
                cos: 0.0,
                sin: 0.0,
                angle: angle(k),
            });
            let circle = Circle::of(directions.collect());
            let exact = (0..n).map(angle);
            let close = exact.clone().flat_map(|a| [a.next_down(), a.next_up()]);
            let spread = (0..5000).map(|k| PI * (f64::from(k) / 2500.0 - 1.0));
            for a in exact.clone().chain(close).chain(spread).chain([-PI, PI]) {
                let counted = (0..n).filter(|k| angle(*k) < a).count();
                assert_eq!(circle.before(a), counted, "{a} of {n}");
            }
        }
    }

    #[test]
    fn single_precision_is_as_good_as_double_precision_rounded() {
        let contacts: Vec<_> = [-2.9_f64, -1.0, 0.4, 0.41, 2.2]
            .map(|angle| {
                let (sin, cos) = libm::sincos(angle);
                (Direction { cos, sin, angle }, 0.2 + 0.1 * angle.abs())
            })
            .into();
        let circle = (0..32).map(|k| {
            let angle = 2.0 * PI * (f64::from(k) - 15.0) / 32.0;
            let (sin, cos) = libm::sincos(angle);
            Direction { cos, sin, angle }
        });
        let circle = Circle::of(circle.collect());
        let outline = Outline {
            centre: Vec2::new(31.234_567_89, 0.123_456_789),
            radius: 0.7,
            scale: 0.7 / (2.0 * PI),
        };
        let (mut double, mut single) = (Vec::<Vec2>::new(), Vec::<[f32; 2]>::new());
        let extent = outline.draw(&circle, &contacts, true, &mut double);
        outline.draw(&circle, &contacts, true, &mut single);
        assert_eq!((double.len(), single.len()), (37, 37));
        for (d, s) in double.iter().zip(&single) {
            let (x, y) = (f64::from(s[0]) - d.x, f64::from(s[1]) - d.y);
            // Half a unit in the last place of 31, and a few of 0.7.
            assert!(x.abs() < 1.2e-6 && y.abs() < 4e-7, "{x:e} {y:e}");
            assert!((d - outline.centre).norm() <= extent.reach);
        }
    }
}
