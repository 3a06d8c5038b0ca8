//! Where the linear model ends: how far its forces are from those of a real droplet.
//!
//! The Morse–Witten model is the *linear* response of a droplet. What it neglects is measured by the squeeze of a particle,
//!
//! ```text
//! s_i = Σ_j f_ij / 2πγ
//! ```
//!
//! the pressure that its contacts exert on its contour, `Σ f / 2πR`, in units of the Laplace pressure `γ/R` of the free
//! droplet. A droplet between `n` equal walls on the sides of a regular n-gon has an exact answer (see the tests); at the
//! same wall distance the model's force falls short of it by
//!
//! ```text
//! n = 2 (two plates)        1 − 2s/((1 − s)⁻² − 1)     = 3/2 s + O(s²)
//! n → ∞                     1 − s/((1 − 2s)^(−1/2) − 1)  = 3/2 s + O(s²)
//! ```
//!
//! and the other `n` lie between the two: whatever the number of contacts, the force is short by 10 % where `s` is between
//! 0.0659 and 0.0675. Dents and forces have no such common measure: the 10 % are reached at a relative dent of 0.067 between
//! plates, of 0.006 in a hexagon. At `s = 1/2` the model has lost touch with the droplet altogether: it lets many walls squeeze
//! a droplet to a point with a finite force.

use crate::contacts::Contacts;
use crate::text::counted;

/// The squeeze at which the model's own error in the force passes 10 %, for the worst of all numbers of contacts.
pub const SQUEEZE_LIMIT: f64 = 0.0659;

/// By what part the model's forces on a particle of the given squeeze fall short of the droplet's (dimensionless, between
/// 0 and 1), from the exact answer for many equal walls, the worst case; 1 from `s = 1/2` on.
///
/// ```
/// use softjam::models::droplet::validity::model_error;
/// assert_eq!(model_error(0.0), 0.0);
/// assert!((model_error(1e-3) / 1.5e-3 - 1.0).abs() < 1e-2);
/// assert_eq!(model_error(0.7), 1.0);
/// ```
#[must_use]
pub fn model_error(squeeze: f64) -> f64 {
    if squeeze <= 0.0 {
        return 0.0;
    }
    // NaN is no number to trust either.
    if squeeze.is_nan() || squeeze >= 0.5 {
        return 1.0;
    }
    let root = (1.0 - 2.0 * squeeze).sqrt();
    // s/(1/root − 1) = s root (1 + root)/(1 − root²) = root (1 + root)/2, without the cancellation.
    1.0 - 0.5 * root * (1.0 + root)
}

/// How far a packing strains the linear model.
///
/// # Example
///
/// ```
/// use softjam::{models::droplet::validity::Validity, protocol::Relaxation, scene::Scene};
///
/// let run = |phi| Relaxation::new(&Scene { particles: 64, phi, ..Scene::default() }).unwrap();
/// let of = |run: &Relaxation| Validity::of(&run.contacts(), 64, 1.0);
/// assert_eq!(of(&run(0.85)).beyond, 0);
/// assert_eq!(of(&run(1.2)).beyond, 64);
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Validity {
    /// The largest squeeze of a particle (dimensionless).
    pub largest: f64,
    /// The particle that it belongs to.
    pub particle: usize,
    /// The mean over all particles.
    pub mean: f64,
    /// Number of particles whose squeeze is beyond [`SQUEEZE_LIMIT`].
    pub beyond: usize,
    /// Number of particles.
    pub particles: usize,
}

impl Validity {
    /// The squeeze of `particles` particles with `contacts`; `line_tension` is γ (force).
    ///
    /// # Panics
    ///
    /// If a contact names a particle that is not there.
    #[must_use]
    pub fn of(contacts: &Contacts<'_>, particles: usize, line_tension: f64) -> Self {
        let mut squeeze = vec![0.0; particles];
        for (pair, f) in contacts.pairs.iter().zip(contacts.forces) {
            for p in pair {
                squeeze[*p as usize] += f / (2.0 * core::f64::consts::PI * line_tension);
            }
        }
        let mut validity = Self {
            particles,
            ..Self::default()
        };
        for (particle, &s) in squeeze.iter().enumerate() {
            validity.mean += s / particles as f64;
            if s > validity.largest || s.is_nan() {
                validity.largest = s;
                validity.particle = particle;
            }
            validity.beyond += usize::from(s.is_nan() || s > SQUEEZE_LIMIT);
        }
        validity
    }

    /// What a physicist should know before the forces are used; `None` while no particle is beyond the limit.
    ///
    /// ```
    /// use softjam::models::droplet::validity::Validity;
    ///
    /// assert_eq!(Validity::default().warning(), None);
    /// let strained = Validity { largest: 0.21, mean: 0.08, beyond: 40, particles: 64, ..Validity::default() };
    /// assert_eq!(
    ///     strained.warning().unwrap(),
    ///     "40 of 64 particles are squeezed beyond the range of the linear model (Σf/2πγ up to 0.210, mean 0.080, limit 0.0659): \
    ///      its own forces are too small there by more than 10 %, by up to 33 %"
    /// );
    /// ```
    #[must_use]
    pub fn warning(&self) -> Option<String> {
        // A squeeze that no droplet survives is of no interest to three digits behind the point.
        let number = |squeeze: f64| match squeeze {
            s if s < 1000.0 => format!("{s:.3}"),
            s => format!("{s:.1e}"),
        };
        (self.beyond > 0).then(|| {
            let (count, all) = (self.beyond, counted(self.particles, "particle"));
            let are = if self.beyond == 1 { "is" } else { "are" };
            format!(
                "{count} of {all} {are} squeezed beyond the range of the linear model (Σf/2πγ up to {}, mean {}, \
                 limit {SQUEEZE_LIMIT}): its own forces are too small there by more than 10 %, by up to {:.0} %",
                number(self.largest),
                number(self.mean),
                100.0 * model_error(self.largest)
            )
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use core::f64::consts::PI;

    /// Squeeze in the model, and by what part its force is short, for a droplet between `n` walls at corner ratio `x`.
    ///
    /// Exact (Young–Laplace): with `t = n tan(π/n)`, `R²/r² = 1 + (2t/π) x + (t/π) x²`, inradius `a = r (1 + x)`, wall force
    /// `f = 2 x tan(π/n)`. The model's force at the same inradius follows from `R − a = (R f/2π)(n − π cot(π/n))`.
    fn polygon(n: u32, x: f64) -> (f64, f64) {
        let sides = f64::from(n);
        let slope = libm::tan(PI / sides);
        let b = sides * slope / PI;
        let radius = (1.0 + 2.0 * b * x + b * x * x).sqrt();
        // 1 − (1 + x)/radius, without the cancellation.
        let dent = (b - 1.0) * x * (2.0 + x) / (radius * (radius + 1.0 + x));
        let model = 2.0 * PI * dent / (sides - PI / slope);
        (sides * model / (2.0 * PI), 1.0 - model / (2.0 * x * slope))
    }

    /// The same between two plates at distance `2 R (1 − dent)`: `r/R = (1 + 2f/π)^(−1/2)` is half the distance.
    fn plates(dent: f64) -> (f64, f64) {
        let r = 1.0 - dent;
        let exact = 0.5 * PI * (1.0 / (r * r) - 1.0);
        let model = PI * dent;
        (model / PI, 1.0 - model / exact)
    }

    /// The squeeze at which a shortfall that grows along `of` passes 10 %.
    fn ten_per_cent(of: impl Fn(f64) -> (f64, f64)) -> f64 {
        let (mut low, mut high) = (1e-6, 0.5);
        for _ in 0..60 {
            let middle = 0.5 * (low + high);
            if of(middle).1 < 0.1 {
                low = middle;
            } else {
                high = middle;
            }
        }
        of(low).0
    }

    #[test]
    fn force_is_ten_per_cent_short_at_one_squeeze_whatever_the_number_of_walls() {
        let limit = ten_per_cent(plates);
        assert!((limit - 0.06745).abs() < 1e-5, "plates: {limit}");
        let mut last = limit;
        for n in 3..=200 {
            let limit = ten_per_cent(|x| polygon(n, x));
            assert!(limit < last && limit > 0.06588, "n = {n}: {limit}");
            last = limit;
        }
        // The constant is the limit n → ∞, rounded to what is worth saying.
        assert!((last - SQUEEZE_LIMIT).abs() < 2e-5, "{last}");
    }

    #[test]
    fn model_error_bounds_the_exact_shortfall_and_is_close_to_it() {
        for k in 1..=40 {
            let x = 0.005 * f64::from(k);
            for n in 3..=24 {
                let (squeeze, short) = polygon(n, x);
                let bound = model_error(squeeze);
                assert!(
                    short <= bound + 1e-12 && short > 0.9 * bound,
                    "n = {n}, x = {x}"
                );
            }
            let (squeeze, short) = plates(0.2 * x);
            assert!(short <= model_error(squeeze) && short > 0.9 * model_error(squeeze));
        }
    }

    #[test]
    fn shortfall_of_the_hexagonal_crystal_is_that_of_the_exact_foam() {
        // φ, shortfall of the force: the exact hexagonal crystal, π R² = φ 2√3 a².
        for (phi, expected) in [(0.908, 0.010), (0.915, 0.072), (0.930, 0.206)] {
            let inradius = (PI / (12f64.sqrt() * phi)).sqrt();
            let squeeze = 6.0 * (1.0 - inradius) / (6.0 - PI * 3f64.sqrt());
            assert!((model_error(squeeze) - expected).abs() < 0.003, "φ = {phi}");
        }
    }
}
