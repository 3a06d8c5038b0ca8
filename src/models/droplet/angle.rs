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
        from_node(unit.x, unit.y, self.node(unit.x, unit.y))
    }

    /// The angles of unit vectors by their components; `nodes` is room. All slices have one length.
    ///
    /// In three passes, since what is read from the table stands in the way of computing several angles at a time.
    #[inline(always)]
    pub(crate) fn of_columns(
        self,
        (x, y): (&[f64], &[f64]),
        nodes: &mut Vec<[f64; 2]>,
        angles: &mut [f64],
    ) {
        for ((k, x), y) in angles.iter_mut().zip(x).zip(y) {
            *k = f64::from_bits(place(*x, *y));
        }
        nodes.clear();
        nodes.extend(angles.iter().map(|k| self.0[(k.to_bits() & 63) as usize]));
        for ((angle, node), (x, y)) in angles.iter_mut().zip(&*nodes).zip(x.iter().zip(y)) {
            *angle = from_node(*x, *y, *node);
        }
    }

    #[inline(always)]
    fn node(self, x: f64, y: f64) -> [f64; 2] {
        self.0[(place(x, y) & 63) as usize]
    }
}

/// 1.5·2⁵²: a small number added to it is rounded to a whole one, which stands in the last bits of the sum.
pub(crate) const ROUND: f64 = 6_755_399_441_055_744.0;

/// The number of the node nearest to the smaller component, in the last six bits.
#[inline(always)]
fn place(x: f64, y: f64) -> u64 {
    (64.0 * x.abs().min(y.abs()) + ROUND).to_bits()
}

/// The angle, from the node's cosine and angle.
#[inline(always)]
fn from_node(x: f64, y: f64, [cos, angle]: [f64; 2]) -> f64 {
    let (right, up) = (x.abs(), y.abs());
    let (a, b) = (right.min(up), right.max(up));
    let k = (64.0 * a + ROUND) - ROUND;
    let sine = a * cos - b * (k * (1.0 / 64.0));
    let s = sine * sine;
    let phi = angle + (sine + sine * s * (1.0 / 6.0 + s * (3.0 / 40.0 + s * (5.0 / 112.0))));
    // In the upper half plane the angle is φ, π/2 − φ, π/2 + φ or π − φ. Selections instead of branches.
    let turn = if x < 0.0 { PI } else { 0.0 };
    let turn = if up > right { FRAC_PI_2 } else { turn };
    let sign = if x < 0.0 { -1.0 } else { 1.0 };
    let sign = if up > right { -sign } else { sign };
    (turn + sign * phi).copysign(y)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn angles_are_those_of_atan2() {
        let angles = Angles::new();
        let mut worst: f64 = 0.0;
        let (mut columns, mut one_by_one) = ((Vec::new(), Vec::new()), Vec::new());
        for k in 0..400_000 {
            let angle = (f64::from(k) / 200_000.0 - 1.0) * PI;
            let (sin, cos) = libm::sincos(angle);
            let of = angles.of(Vec2::new(cos, sin));
            worst = worst.max((of - libm::atan2(sin, cos)).abs());
            columns.0.push(cos);
            columns.1.push(sin);
            one_by_one.push(of);
        }
        assert!(worst < 9e-16, "{worst:e}");
        let mut together = vec![0.0; one_by_one.len()];
        angles.of_columns((&columns.0, &columns.1), &mut Vec::new(), &mut together);
        assert_eq!(together, one_by_one);
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
