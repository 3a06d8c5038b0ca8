//! One contour between its contacts: the sums of [`contour`](super::contour), sector by sector.

use super::kernel::Direction;
use crate::domain::Vec2;
use core::f64::consts::PI;

/// A vertex in double precision, or in the single precision of a viewer.
pub(crate) trait Vertex: Copy {
    /// The vertex at the distance `rho` from `centre` in `direction` (length).
    fn at(centre: Vec2, direction: Direction, rho: f64) -> Self;
}

impl Vertex for Vec2 {
    #[inline]
    fn at(centre: Vec2, direction: Direction, rho: f64) -> Self {
        Vec2::new(
            centre.x + direction.cos * rho,
            centre.y + direction.sin * rho,
        )
    }
}

impl Vertex for [f32; 2] {
    #[inline]
    fn at(centre: Vec2, direction: Direction, rho: f64) -> Self {
        let v = <Vec2 as Vertex>::at(centre, direction, rho);
        [v.x as f32, v.y as f32]
    }
}

/// One particle that is being drawn.
pub(super) struct Outline {
    pub centre: Vec2,
    pub radius: f64,
    /// `R_i/2πγ` (length per force).
    pub scale: f64,
}

impl Outline {
    /// Appends the vertices on `circle` and, with `tips`, on the angles of the contacts; both ascend by angle. Gives the
    /// deepest dent at a contact (length).
    pub fn draw<V: Vertex>(
        &self,
        circle: &[Direction],
        contacts: &[(Direction, f64)],
        tips: bool,
        vertices: &mut Vec<V>,
    ) -> f64 {
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
        let (mut drawn, mut deepest) = (0, 0.0_f64);
        for (contact, f) in contacts {
            let end = before(circle, contact.angle).max(drawn);
            vertices.extend(
                circle[drawn..end]
                    .iter()
                    .map(move |d| sector.vertex::<V>(d)),
            );
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
        vertices.extend(circle[drawn..].iter().map(move |d| sector.vertex::<V>(d)));
        deepest
    }
}

/// A contour between two neighbouring contacts: `ρ(θ) = R − S + sin θ (P − θ S_c) − cos θ (Q − θ S_s)`, all in units of
/// length.
#[derive(Clone, Copy)]
struct Sector {
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

    #[inline(always)]
    fn vertex<V: Vertex>(&self, d: &Direction) -> V {
        V::at(self.centre, *d, self.rho(d))
    }
}

/// How many directions of a circle of equally spaced ones have a smaller angle than `angle`.
fn before(circle: &[Direction], angle: f64) -> usize {
    let n = circle.len();
    let turns = (angle - circle[0].angle) / (2.0 * PI);
    // A conversion saturates; what rounding has done to the guess is mended.
    let mut k = ((turns * n as f64) as usize).min(n);
    while k > 0 && circle[k - 1].angle >= angle {
        k -= 1;
    }
    while k < n && circle[k].angle < angle {
        k += 1;
    }
    k
}
