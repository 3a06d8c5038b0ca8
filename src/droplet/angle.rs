//! The angle of a unit vector, without a division.
//!
//! Both components of a unit vector are known, so its angle needs no general `atan2`: with `a` the smaller and `b` the
//! larger of `|cos|`, `|sin|`, the angle `φ ≤ π/4` whose sine is `a` lies within 0.011 of an angle `φ_k = asin(k/64)` of a
//! table, and the difference follows from
//!
//! ```text
//! sin(φ − φ_k) = a cos φ_k − b sin φ_k,      asin x = x + x³/6 + 3x⁵/40 + 5x⁷/112 + …
//! ```
//!
//! The first term left out is below 1e-17 (0.011⁹·35/1152). Additions and multiplications alone, so the same bits on
//! every CPU.

use crate::domain::Vec2;
use core::f64::consts::{FRAC_PI_2, PI};
use std::sync::LazyLock;

/// `cos φ_k` and `φ_k` of `sin φ_k = k/64`, up to beyond 45°.
static TABLE: LazyLock<[[f64; 2]; 64]> = LazyLock::new(|| {
    core::array::from_fn(|k| {
        let sin = k as f64 / 64.0;
        [(1.0 - sin * sin).sqrt(), libm::asin(sin)]
    })
});

/// The angle in the upper half plane is `turn + sign φ`: by whether `cos < 0` and whether `|sin| > |cos|`.
const OCTANTS: [[f64; 2]; 4] = [[0.0, 1.0], [FRAC_PI_2, -1.0], [PI, -1.0], [FRAC_PI_2, 1.0]];

/// What angles are computed with; to be had once for many of them.
#[derive(Clone, Copy)]
pub(crate) struct Angles(&'static [[f64; 2]; 64]);

impl Angles {
    pub(crate) fn new() -> Self {
        Self(&TABLE)
    }

    /// The angle of a *unit* vector to the x axis, in `[−π, π]` (radians); its error is below 9e-16.
    #[inline(always)]
    pub(crate) fn of(self, unit: Vec2) -> f64 {
        let (x, y) = (unit.x.abs(), unit.y.abs());
        let (a, b) = (x.min(y), x.max(y));
        // A conversion saturates, and sends NaN to 0.
        let k = (64.0 * a + 0.5) as i32 & 63;
        let [cos, angle] = self.0[k as usize];
        let sine = a * cos - b * (f64::from(k) * (1.0 / 64.0));
        let s = sine * sine;
        let phi = angle + (sine + sine * s * (1.0 / 6.0 + s * (3.0 / 40.0 + s * (5.0 / 112.0))));
        let octant = 2 * usize::from(unit.x < 0.0) + usize::from(y > x);
        let [turn, sign] = OCTANTS[octant];
        (turn + sign * phi).copysign(unit.y)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn angles_are_those_of_atan2() {
        let angles = Angles::new();
        let mut worst: f64 = 0.0;
        for k in 0..400_000 {
            let angle = (f64::from(k) / 200_000.0 - 1.0) * PI;
            let (sin, cos) = libm::sincos(angle);
            worst = worst.max((angles.of(Vec2::new(cos, sin)) - libm::atan2(sin, cos)).abs());
        }
        assert!(worst < 9e-16, "{worst:e}");
        for (x, y, angle) in [
            (1.0, 0.0, 0.0),
            (0.0, 1.0, FRAC_PI_2),
            (-1.0, 0.0, PI),
            (0.0, -1.0, -FRAC_PI_2),
        ] {
            assert_eq!(angles.of(Vec2::new(x, y)), angle);
        }
        let nan = Vec2::new(f64::NAN, f64::NAN);
        assert!(angles.of(nan).is_nan());
    }
}
