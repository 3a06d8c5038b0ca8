//! The periodic box: the only place that knows how images are found.
//!
//! A packing lives on a torus whose lattice has the periods `(L_x, 0)` and `(tilt, L_y)` (lengths, in units of the small diameter);
//! the tilt is what a simple shear makes of an upright box. Positions are kept wrapped into `0 ≤ x < L_x`, `0 ≤ y < L_y`, and what
//! leaves through the top comes in at the bottom, displaced by `−tilt`.
//!
//! See the example of [`Domain`].

use nalgebra::Vector2;

/// A point or a vector in the plane.
pub type Vec2 = Vector2<f64>;

/// A periodic box with its corner at the origin.
///
/// # Example
///
/// ```
/// use softjam::domain::{Domain, Vec2};
///
/// let domain = Domain::new(10.0, 8.0).unwrap();
/// assert_eq!(domain.area(), 80.0);
/// assert_eq!(domain.wrap(Vec2::new(-1.0, 8.5)), Vec2::new(9.0, 0.5));
/// let across = domain.minimum_image(Vec2::new(9.5, 0.0) - Vec2::new(0.5, 0.0));
/// assert_eq!(across, Vec2::new(-1.0, 0.0));
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Domain {
    lengths: Vec2,
    /// Between `−L_x/2` and `L_x/2`.
    tilt: f64,
}

impl Domain {
    /// An upright box of sides `length_x` × `length_y`; `None` unless both are positive and finite.
    #[must_use]
    pub fn new(length_x: f64, length_y: f64) -> Option<Self> {
        let valid = |l: f64| l.is_finite() && l > 0.0;
        (valid(length_x) && valid(length_y)).then_some(Self {
            lengths: Vec2::new(length_x, length_y),
            tilt: 0.0,
        })
    }

    /// The box whose upper period is `(tilt, L_y)`: of the tilts that differ by whole `L_x`, which are one lattice, the smallest.
    /// `None` unless it is finite.
    #[must_use]
    pub fn tilted(self, tilt: f64) -> Option<Self> {
        let side = self.lengths.x;
        let smaller = |tilt: f64| tilt - side * libm::rint(tilt / side);
        // Twice: rounding may leave a little more than half a side. Half a side stays as it is, so that this is its own smallest tilt.
        let tilt = smaller(smaller(tilt));
        tilt.is_finite().then_some(Self { tilt, ..self })
    }

    /// `L_x`, `L_y` and the tilt, as they are recorded.
    #[must_use]
    pub fn values(&self) -> [f64; 3] {
        [self.lengths.x, self.lengths.y, self.tilt]
    }

    /// The box of recorded [`values`](Self::values); `None` if there is no such box.
    #[must_use]
    pub fn from_values(values: &[f64]) -> Option<Self> {
        let &[length_x, length_y, tilt] = values else {
            return None;
        };
        let domain = Self::new(length_x, length_y)?.tilted(tilt)?;
        // A tilt beyond half a side would be another lattice's name for this one.
        (domain.tilt.to_bits() == tilt.to_bits()).then_some(domain)
    }

    /// The sides `(L_x, L_y)`.
    #[must_use]
    pub fn lengths(&self) -> Vec2 {
        self.lengths
    }

    /// How far the upper period leans (length), between `−L_x/2` and `L_x/2`.
    #[must_use]
    pub fn tilt(&self) -> f64 {
        self.tilt
    }

    /// The shorter side. No image but the [nearest](Self::minimum_image) is nearer than half of it.
    #[must_use]
    pub fn shortest(&self) -> f64 {
        self.lengths.x.min(self.lengths.y)
    }

    /// The area `V = L_x L_y`.
    #[must_use]
    pub fn area(&self) -> f64 {
        self.lengths.x * self.lengths.y
    }

    /// Whether a position is wrapped.
    #[must_use]
    #[inline]
    pub fn contains(&self, position: Vec2) -> bool {
        (0.0..self.lengths.x).contains(&position.x) && (0.0..self.lengths.y).contains(&position.y)
    }

    /// The image of `position` with `0 ≤ x < L_x` and `0 ≤ y < L_y`.
    #[must_use]
    #[inline]
    pub fn wrap(&self, position: Vec2) -> Vec2 {
        let (l_x, l_y) = (self.lengths.x, self.lengths.y);
        let y = wrap(position.y, l_y);
        let mut x = position.x;
        if self.tilt != 0.0 {
            x -= self.tilt * libm::round((position.y - y) / l_y);
        }
        Vec2::new(wrap(x, l_x), y)
    }

    /// The image of the difference of two *wrapped* positions with `|x| ≤ L_x/2` and `|y| ≤ L_y/2`: the nearest, if any is nearer
    /// than half the [shorter side](Self::shortest).
    ///
    /// `minimum_image(−d) = −minimum_image(d)` holds to the last bit, so a pair's two particles see opposite vectors.
    #[must_use]
    #[inline]
    pub fn minimum_image(&self, difference: Vec2) -> Vec2 {
        let [x, y] = self.fold([difference.x, difference.y]);
        Vec2::new(x, y)
    }

    /// [`minimum_image`](Self::minimum_image) for loops that are compiled for wide vectors: selections instead of branches.
    #[inline(always)]
    pub(crate) fn fold(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        let (l_x, l_y) = (self.lengths.x, self.lengths.y);
        // The same for all: a loop is compiled once with a tilt and once without.
        let x = if self.tilt == 0.0 {
            x
        } else {
            less(x, y, l_y, self.tilt)
        };
        [nearest(x, l_x), nearest(y, l_y)]
    }

    /// [`minimum_image`](Self::minimum_image) of as many differences as the columns have: one simple loop a component, so that each
    /// is done for several at once.
    #[inline(always)]
    pub(crate) fn fold_columns(&self, x: &mut [f64], y: &mut [f64]) {
        let (l_x, l_y) = (self.lengths.x, self.lengths.y);
        if self.tilt != 0.0 {
            for (x, y) in x.iter_mut().zip(&*y) {
                *x = less(*x, *y, l_y, self.tilt);
            }
        }
        for x in x {
            *x = nearest(*x, l_x);
        }
        for y in y {
            *y = nearest(*y, l_y);
        }
    }

    /// The vector of `columns` periods `(L_x, 0)` and `rows` periods `(tilt, L_y)`.
    #[must_use]
    pub fn period(&self, columns: i32, rows: i32) -> Vec2 {
        let (columns, rows) = (f64::from(columns), f64::from(rows));
        Vec2::new(
            columns * self.lengths.x + rows * self.tilt,
            rows * self.lengths.y,
        )
    }

    /// The box itself (no shift) and the eight around it, by the periods that lead to them.
    #[cfg(any(feature = "recording", feature = "figure"))]
    pub(crate) fn around(&self) -> impl Iterator<Item = Vec2> + use<> {
        let domain = *self;
        [0, -1, 1]
            .into_iter()
            .flat_map(move |columns| [0, -1, 1].map(|rows| domain.period(columns, rows)))
    }

    /// Where a wrapped position is in the upright box that becomes this one when it is sheared: what a grid of cells sorts by.
    #[inline]
    pub(crate) fn upright(&self, position: Vec2) -> Vec2 {
        if self.tilt == 0.0 {
            return position;
        }
        let x = position.x - self.tilt * (position.y / self.lengths.y);
        Vec2::new(wrap(x, self.lengths.x), position.y)
    }

    /// Where a point of the sheared box would be in the upright one.
    #[cfg(any(feature = "recording", feature = "figure"))]
    pub(crate) fn straightened(&self, point: Vec2) -> Vec2 {
        if self.tilt == 0.0 {
            return point;
        }
        Vec2::new(point.x - self.tilt * (point.y / self.lengths.y), point.y)
    }

    /// The image of a wrapped position that lies between the slanted sides of the box: where it is drawn.
    #[cfg(any(feature = "recording", feature = "figure"))]
    pub(crate) fn seat(&self, position: Vec2) -> Vec2 {
        let upright = self.straightened(position).x;
        let turns = libm::floor(upright / self.lengths.x);
        if turns == 0.0 {
            return position;
        }
        Vec2::new(position.x - turns * self.lengths.x, position.y)
    }

    /// The corners of the box, once around, the first again at the end.
    #[cfg(any(feature = "recording", feature = "figure"))]
    pub(crate) fn corners(&self) -> [Vec2; 5] {
        [(0, 0), (1, 0), (1, 1), (0, 1), (0, 0)].map(|(columns, rows)| self.period(columns, rows))
    }

    /// The distances between opposite sides of the sheared box.
    pub(crate) fn heights(&self) -> Vec2 {
        let (l_x, l_y) = (self.lengths.x, self.lengths.y);
        if self.tilt == 0.0 {
            return self.lengths;
        }
        let slanted = (self.tilt * self.tilt + l_y * l_y).sqrt();
        Vec2::new(l_x * (l_y / slanted), l_y)
    }
}

#[inline]
fn wrap(x: f64, length: f64) -> f64 {
    if (0.0..length).contains(&x) {
        x
    } else {
        wrap_outside(x, length)
    }
}

#[cold]
fn wrap_outside(x: f64, length: f64) -> f64 {
    // In the loop of a relaxation a coordinate leaves the box by a fraction of a radius, so the first two
    // arms are the common ones; they are rounded once.
    let wrapped = if x >= length && x < 2.0 * length {
        x - length
    } else if x < 0.0 && x >= -length {
        x + length
    } else {
        x - length * libm::floor(x / length)
    };
    // Rounding may land on the far edge itself.
    if (0.0..length).contains(&wrapped) {
        wrapped
    } else {
        0.0
    }
}

/// A coordinate `d` less the period that stands beyond half of `length`.
#[inline(always)]
fn nearest(d: f64, length: f64) -> f64 {
    less(d, d, length, length)
}

/// `x` less `shift` where `d` is above half of `length`, and with it where `d` is below `−length/2`.
#[inline(always)]
fn less(x: f64, d: f64, length: f64, shift: f64) -> f64 {
    let half = 0.5 * length;
    let above = if d > half { shift } else { 0.0 };
    let below = if d < -half { shift } else { 0.0 };
    x - above + below
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn wrapped_positions_lie_in_the_box_on_an_image_of_the_point(x in -1e3..1e3f64, y in -1e3..1e3f64) {
            let domain = Domain::new(7.3, 0.9).unwrap();
            let p = domain.wrap(Vec2::new(x, y));
            prop_assert!((0.0..7.3).contains(&p.x) && (0.0..0.9).contains(&p.y));
            let turns = (Vec2::new(x, y) - p).component_div(&domain.lengths());
            prop_assert!((turns.x - turns.x.round()).abs() < 1e-9);
            prop_assert!((turns.y - turns.y.round()).abs() < 1e-9);
        }

        #[test]
        fn minimum_image_is_the_shortest_of_all_images(a in 0.0..7.3f64, b in 0.0..7.3f64, c in 0.0..0.9f64, d in 0.0..0.9f64) {
            let domain = Domain::new(7.3, 0.9).unwrap();
            let diff = Vec2::new(a - b, c - d);
            let shortest = (-2..=2)
                .flat_map(|m| (-2..=2).map(move |n| Vec2::new(f64::from(m) * 7.3, f64::from(n) * 0.9)))
                .map(|shift| (diff + shift).norm())
                .fold(f64::INFINITY, f64::min);
            let nearest = domain.minimum_image(diff);
            prop_assert!((nearest.norm() - shortest).abs() < 1e-12);
            prop_assert_eq!(domain.minimum_image(-diff), -nearest);
        }

        #[test]
        fn images_in_a_tilted_box_are_those_of_its_lattice(
            tilt in -30.0..30.0f64,
            a in (-20.0..20.0f64, -20.0..20.0f64),
            b in (-20.0..20.0f64, -20.0..20.0f64),
        ) {
            let domain = Domain::new(5.0, 4.0).unwrap().tilted(tilt).unwrap();
            prop_assert!(domain.tilt().abs() <= 2.5);
            let is_period = |v: Vec2| {
                let rows = v.y / 4.0;
                let columns = (v.x - rows.round() * tilt) / 5.0;
                (rows - rows.round()).abs() < 1e-9 && (columns - columns.round()).abs() < 1e-9
            };
            let [a, b] = [a, b].map(|(x, y)| Vec2::new(x, y));
            let [p, q] = [a, b].map(|v| domain.wrap(v));
            prop_assert!(domain.contains(p) && is_period(a - p));
            let nearest = domain.minimum_image(p - q);
            prop_assert!(is_period(a - b - nearest));
            prop_assert!(nearest.x.abs() <= 2.5 && nearest.y.abs() <= 2.0);
            let shortest = (-3..=3)
                .flat_map(|m| (-3..=3).map(move |n| domain.period(m, n)))
                .map(|shift| (p - q + shift).norm())
                .fold(f64::INFINITY, f64::min);
            if shortest < 2.0 {
                prop_assert!((nearest.norm() - shortest).abs() < 1e-9);
            }
        }
    }

    #[test]
    fn recorded_boxes_come_back_whatever_their_tilt() {
        let side = 9.3;
        let domain = Domain::new(side, 8.0).unwrap();
        let halves = (-9..=9).map(|k| 0.5 * f64::from(k) * side);
        let near = |x: f64| [x.next_down(), x, x.next_up(), x + 0.1];
        for tilt in halves.flat_map(near) {
            let tilted = domain.tilted(tilt).unwrap();
            assert!(tilted.tilt().abs() <= 0.5 * side);
            assert_eq!(
                Domain::from_values(&tilted.values()),
                Some(tilted),
                "{tilt}"
            );
        }
    }

    #[test]
    fn image_that_rounds_to_the_far_edge_is_put_on_the_near_one() {
        let domain = Domain::new(3.0, 2.0).unwrap();
        assert_eq!(domain.wrap(Vec2::new(-1e-30, 2.0)), Vec2::zeros());
        assert!(Domain::new(1.0, f64::NAN).is_none() && domain.tilted(f64::INFINITY).is_none());
    }
}
