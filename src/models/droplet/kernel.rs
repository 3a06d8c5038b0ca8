//! The kernel `g(θ)` of the Morse–Witten model in two dimensions.
//!
//! A droplet of line tension `γ` is pushed inwards by a point force `f` at `θ = 0`; a uniform body force balances it,
//! its area is kept and its centre of mass stays at the origin. The linearised Young–Laplace equation
//!
//! ```text
//! g'' + g = 2π δ(θ) − 1 − 2 cos θ,        ΔR(θ) = (R f / 2πγ) g(θ)            Saitoh (2)
//! ```
//!
//! has the solution, for `0 ≤ θ ≤ 2π` and continued as an even, 2π-periodic function,
//!
//! ```text
//! g(θ)  = (π − θ) sin θ − ½ cos θ − 1
//! g'(θ) = (π − θ) cos θ − ½ sin θ             (0 < θ < 2π; a jump of 2π at the contact: the cusp)
//! ```
//!
//! with the Fourier series `g(θ) = −Σ_{m ≥ 2} 2/(m² − 1) cos mθ`. The derivation is in D. C. Morse and T. A. Witten,
//! EPL 22, 549 (1993), and F. F. Dunne et al., Phil. Mag. 99, 2303 (2019); the tests below check it independently.

pub(crate) use super::angle::{Angles, ROUND};
use core::f64::consts::PI;

/// `g(0)`: the dent under the contact itself.
pub const G_AT_CONTACT: f64 = -1.5;

/// An upper bound of `g` over all angles: its maximum is 0.640 759… at ±74.77°.
pub const G_MAX: f64 = 0.640_76;

/// `1/2πγ` (per force): with it, `g` and the radius, a force makes a length, Saitoh (3). One formula, and so one rounding.
#[inline(always)]
pub(super) fn per_radius(line_tension: f64) -> f64 {
    1.0 / (2.0 * PI * line_tension)
}

/// `g(θ)` for any angle θ in radians (dimensionless).
///
/// # Example
///
/// ```
/// use softjam::models::droplet::kernel::g;
/// use std::f64::consts::PI;
///
/// assert_eq!(g(0.0), -1.5);
/// assert!((g(PI) + 0.5).abs() < 1e-15);
/// assert!((g(PI / 2.0) - (PI / 2.0 - 1.0)).abs() < 1e-15);
/// assert_eq!(g(-1.0), g(1.0));
/// ```
#[must_use]
pub fn g(theta: f64) -> f64 {
    // `fmod` is exact, so the reduction adds no error of its own; the branch below 2π is the common one.
    let theta = theta.abs();
    let theta = if theta <= 2.0 * PI {
        theta
    } else {
        libm::fmod(theta, 2.0 * PI)
    };
    let (sin, cos) = libm::sincos(theta);
    g_of(theta, sin, cos)
}

/// `g'(θ)` for `0 < θ < 2π` (per radian).
///
/// # Example
///
/// ```
/// use softjam::models::droplet::kernel::dg;
/// use std::f64::consts::PI;
///
/// // The cusp: the slope jumps from −π to π at the contact.
/// assert!((dg(1e-12) - PI).abs() < 1e-11);
/// assert!((dg(2.0 * PI - 1e-12) + PI).abs() < 1e-11);
/// ```
#[must_use]
pub fn dg(theta: f64) -> f64 {
    let (sin, cos) = libm::sincos(theta);
    (PI - theta) * cos - 0.5 * sin
}

/// `g(θ)` from an angle `0 ≤ θ ≤ 2π` whose sine and cosine are already known.
///
/// # Example
///
/// ```
/// use softjam::models::droplet::kernel::{g, g_of};
///
/// assert_eq!(g_of(1.0, libm::sin(1.0), libm::cos(1.0)), g(1.0));
/// ```
#[must_use]
#[inline]
pub fn g_of(theta: f64, sin: f64, cos: f64) -> f64 {
    (PI - theta) * sin - 0.5 * cos - 1.0
}

/// A direction seen from a particle's centre, with its angle: what the kernel needs of a contact.
///
/// # Example
///
/// ```
/// use softjam::domain::Vec2;
/// use softjam::models::droplet::kernel::{g, Direction};
///
/// let east = Direction::of(Vec2::new(1.0, 0.0));
/// let north = Direction::of(Vec2::new(0.0, 1.0));
/// assert!((east.g_between(north) - g(std::f64::consts::FRAC_PI_2)).abs() < 1e-15);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Direction {
    /// Cosine of the angle to the x axis.
    pub cos: f64,
    /// Sine of the angle to the x axis.
    pub sin: f64,
    /// The angle to the x axis, in `[−π, π]`.
    pub angle: f64,
}

impl Direction {
    /// The direction of a *unit* vector.
    #[must_use]
    #[inline]
    pub fn of(unit: crate::domain::Vec2) -> Self {
        Self::with(Angles::new(), unit)
    }

    /// [`of`](Self::of), for many of them.
    #[inline(always)]
    pub(crate) fn with(angles: Angles, unit: crate::domain::Vec2) -> Self {
        Self {
            cos: unit.x,
            sin: unit.y,
            angle: angles.of(unit),
        }
    }

    /// The opposite direction: how the partner sees the same contact.
    #[must_use]
    #[inline(always)]
    pub fn opposite(self) -> Self {
        Self {
            cos: -self.cos,
            sin: -self.sin,
            angle: if self.angle > 0.0 {
                self.angle - PI
            } else {
                self.angle + PI
            },
        }
    }

    /// `g` of the angle between two directions; the same bits whichever of the two is named first.
    ///
    /// The angle is a difference of two angles to the x axis, its sine and cosine come from the vectors: no `acos`, which would
    /// lose half of the digits near 0 and π.
    #[must_use]
    #[inline(always)]
    pub fn g_between(self, other: Self) -> f64 {
        let difference = self.angle - other.angle; // in [−2π, 2π]
        let cross = self.sin * other.cos - self.cos * other.sin; // sine of the difference
        let cos = self.cos * other.cos + self.sin * other.sin;
        // (π − θ) sin θ with θ = |difference|; the two signs cancel without a branch.
        (PI.copysign(difference) - difference) * cross - 0.5 * cos - 1.0
    }

    /// How [`g_between`](Self::g_between) changes when this direction turns and the other stays, to first and to second
    /// order: `∂g/∂φ` and `∂²g/∂φ²` (per radian and per radian²).
    ///
    /// With `x` the angle of this direction less that of the other, `g'(x) = sign(x) (π − |x|) cos x − ½ sin x` and
    /// `g''(x) = −(π − |x|) |sin x| − (3/2) cos x`. The slope is odd: exchanging the two directions changes its sign and no
    /// other bit. It jumps from −π to π at `x = 0`, where it is given its mean, 0; two contacts of a particle never lie
    /// there.
    #[must_use]
    #[inline]
    pub fn slopes_between(self, other: Self) -> (f64, f64) {
        let difference = self.angle - other.angle; // in [−2π, 2π]
        let sin = self.sin * other.cos - self.cos * other.sin;
        let cos = self.cos * other.cos + self.sin * other.sin;
        let rest = PI - difference.abs();
        let sign = if difference > 0.0 {
            1.0
        } else if difference < 0.0 {
            -1.0
        } else {
            0.0
        };
        (
            sign * rest * cos - 0.5 * sin,
            -rest * (sign * sin) - 1.5 * cos,
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::domain::Vec2;
    use proptest::prelude::*;

    /// ∫₀^{2π} g(θ) cos mθ dθ / π by the midpoint rule, corrected for the kink at 0 by Richardson extrapolation.
    fn fourier(m: u32) -> f64 {
        let rule = |n: u32| -> f64 {
            let h = 2.0 * PI / f64::from(n);
            (0..n)
                .map(|k| (f64::from(k) + 0.5) * h)
                .map(|t| g(t) * libm::cos(f64::from(m) * t))
                .sum::<f64>()
                * h
                / PI
        };
        let (a, b, c) = (rule(4096), rule(8192), rule(16384));
        // The error is an even series in h.
        let (d, e) = ((4.0 * b - a) / 3.0, (4.0 * c - b) / 3.0);
        (16.0 * e - d) / 15.0
    }

    #[test]
    fn fourier_coefficients_are_minus_two_over_m_squared_minus_one() {
        assert!(fourier(0).abs() < 1e-12, "area is kept");
        assert!(fourier(1).abs() < 1e-12, "centre of mass is kept");
        for m in 2..=12u32 {
            let exact = -2.0 / f64::from(m * m - 1);
            assert!((fourier(m) - exact).abs() < 1e-11, "m = {m}");
        }
    }

    #[test]
    fn sums_over_regular_polygons_are_pi_cot_minus_n() {
        for n in 2..=64u32 {
            let sum: f64 = (0..n)
                .map(|k| g(2.0 * PI * f64::from(k) / f64::from(n)))
                .sum();
            let x = PI / f64::from(n);
            let exact = PI * libm::cos(x) / libm::sin(x) - f64::from(n);
            assert!(
                (sum - exact).abs() < 1e-12 * exact.abs().max(1.0),
                "n = {n}: {sum} against {exact}"
            );
        }
    }

    #[test]
    fn solves_the_linearised_young_laplace_equation() {
        let h = 1e-4;
        for k in 1..60 {
            let t = 0.1 * f64::from(k);
            let second = (g(t + h) - 2.0 * g(t) + g(t - h)) / (h * h);
            assert!((second + g(t) + 1.0 + 2.0 * libm::cos(t)).abs() < 1e-6);
            let first = (g(t + h) - g(t - h)) / (2.0 * h);
            assert!((first - dg(t)).abs() < 1e-7);
        }
        assert!(
            (dg(0.0) - dg(2.0 * PI) - 2.0 * PI).abs() < 1e-14,
            "jump 2π at the contact"
        );
    }

    #[test]
    fn bound_of_the_bulge_is_tight() {
        let max = (0..1_000_000)
            .map(|k| g(2.0 * PI * f64::from(k) / 1e6))
            .fold(f64::MIN, f64::max);
        assert!(max < G_MAX && G_MAX - max < 1e-6, "max g = {max}");
    }

    proptest! {
        #[test]
        fn directions_give_g_of_their_angle(a in -10.0..10.0f64, b in -10.0..10.0f64) {
            let unit = |t: f64| Vec2::new(libm::cos(t), libm::sin(t));
            let (u, v) = (unit(a), unit(b));
            let by_vectors = Direction::of(u).g_between(Direction::of(v));
            prop_assert!((by_vectors - g(a - b)).abs() < 2e-14);
            let seen_back = Direction::of(u).opposite().g_between(Direction::of(v).opposite());
            prop_assert!((by_vectors - seen_back).abs() < 4e-15);
        }

        #[test]
        fn directions_give_the_slopes_of_g_at_their_angle(a in -3.1..3.1f64, b in -3.1..3.1f64) {
            let unit = |t: f64| Direction::of(Vec2::new(libm::cos(t), libm::sin(t)));
            let x = a - b;
            prop_assume!(x.abs() > 1e-3 && x.abs() < 2.0 * PI - 1e-3);
            let (first, second) = unit(a).slopes_between(unit(b));
            prop_assert!((first - x.signum() * dg(x.abs())).abs() < 2e-14);
            let h = 1e-4;
            let centred = (unit(a + h).slopes_between(unit(b)).0 - unit(a - h).slopes_between(unit(b)).0) / (2.0 * h);
            prop_assert!((second - centred).abs() < 1e-7);
        }
    }
}
