//! The periodic box.
//!
//! A packing lives on a torus of sides `L_x` × `L_y` (lengths, in units of the small diameter). Positions are kept
//! wrapped into `0 ≤ x < L_x`, `0 ≤ y < L_y`; the separation of two particles is taken to the nearest image.
//!
//! See the example of [`Domain`].

use nalgebra::Vector2;

/// A point or a vector in the plane.
pub type Vec2 = Vector2<f64>;

/// A periodic rectangle with its corner at the origin.
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
}

impl Domain {
    /// A box of sides `length_x` × `length_y`; `None` unless both are positive and finite.
    #[must_use]
    pub fn new(length_x: f64, length_y: f64) -> Option<Self> {
        let valid = |l: f64| l.is_finite() && l > 0.0;
        (valid(length_x) && valid(length_y)).then_some(Self {
            lengths: Vec2::new(length_x, length_y),
        })
    }

    /// The sides `(L_x, L_y)`.
    #[must_use]
    pub fn lengths(&self) -> Vec2 {
        self.lengths
    }

    /// The shorter side.
    #[must_use]
    pub fn shortest(&self) -> f64 {
        self.lengths.x.min(self.lengths.y)
    }

    /// The area `V = L_x L_y`.
    #[must_use]
    pub fn area(&self) -> f64 {
        self.lengths.x * self.lengths.y
    }

    /// The image of `position` with `0 ≤ x < L_x` and `0 ≤ y < L_y`.
    #[must_use]
    #[inline]
    pub fn wrap(&self, position: Vec2) -> Vec2 {
        Vec2::new(
            wrap(position.x, self.lengths.x),
            wrap(position.y, self.lengths.y),
        )
    }

    /// The nearest image of the difference of two *wrapped* positions, each component in `[−L/2, L/2]`.
    ///
    /// `minimum_image(−d) = −minimum_image(d)` holds to the last bit, so a pair's two particles see opposite vectors.
    #[must_use]
    #[inline]
    pub fn minimum_image(&self, difference: Vec2) -> Vec2 {
        Vec2::new(
            nearest(difference.x, self.lengths.x),
            nearest(difference.y, self.lengths.y),
        )
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

/// The nearest image of a difference of two coordinates in `[0, length)`.
#[inline]
pub(crate) fn nearest(d: f64, length: f64) -> f64 {
    let half = 0.5 * length;
    // Selections instead of branches.
    let above = if d > half { length } else { 0.0 };
    let below = if d < -half { length } else { 0.0 };
    d - above + below
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
    }
}
