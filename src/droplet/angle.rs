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
static TABLE: LazyLock<[[f64; 2]; 47]> = LazyLock::new(|| {
    core::array::from_fn(|k| {
        let sin = k as f64 / 64.0;
        [(1.0 - sin * sin).sqrt(), libm::asin(sin)]
    })
});

/// The angle of a *unit* vector to the x axis, in `[−π, π]` (radians); its error is below 4e-16.
#[inline]
pub(crate) fn angle_of(unit: Vec2) -> f64 {
    let (x, y) = (unit.x.abs(), unit.y.abs());
    let steep = y > x;
    let (a, b) = if steep { (x, y) } else { (y, x) };
    // A conversion saturates, and sends NaN to 0.
    let k = ((64.0 * a + 0.5) as usize).min(46);
    let [cos, angle] = TABLE[k];
    let sine = a * cos - b * (k as f64 * (1.0 / 64.0));
    let s = sine * sine;
    let phi = angle + (sine + sine * s * (1.0 / 6.0 + s * (3.0 / 40.0 + s * (5.0 / 112.0))));
    let phi = if steep { FRAC_PI_2 - phi } else { phi };
    let phi = if unit.x < 0.0 { PI - phi } else { phi };
    phi.copysign(unit.y)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn angles_are_those_of_atan2() {
        let mut worst: f64 = 0.0;
        for k in 0..400_000 {
            let angle = (f64::from(k) / 200_000.0 - 1.0) * PI;
            let (sin, cos) = libm::sincos(angle);
            worst = worst.max((angle_of(Vec2::new(cos, sin)) - libm::atan2(sin, cos)).abs());
        }
        assert!(worst < 9e-16, "{worst:e}");
        for (x, y, angle) in [
            (1.0, 0.0, 0.0),
            (0.0, 1.0, FRAC_PI_2),
            (-1.0, 0.0, PI),
            (0.0, -1.0, -FRAC_PI_2),
        ] {
            assert_eq!(angle_of(Vec2::new(x, y)), angle);
        }
        assert!(angle_of(Vec2::new(f64::NAN, 1.0)).is_nan());
    }
}
