//! The film between two droplets: what their contact adds to the energy beyond a straight line.
//!
//! A film between droplets of pressure `1/r_i` and `1/r_j` (γ = 1) is an arc of curvature `κ = (1/r_i − 1/r_j)/2`. Its force `f` is the mean
//! pressure times its *chord*, so that with `s = (r_j − r_i)/(r_j + r_i)` seen from `i`, and `−s` from `j`,
//!
//! ```text
//! sin δ = s f/2,        chord = 2 f r_i r_j/(r_i + r_j),        arc = chord δ/sin δ
//! C = (r_i + r_j) f [ ½(δ/sin δ + cos δ) − 1 ]  ≈  −(r_i − r_j)² f³ / 24(r_i + r_j)
//! ```
//!
//! where `δ > 0` bulges out of `i`. `C` is all that tells wet foam from rounded polygons, whose films are straight: `C = 0`. Its derivatives,
//! with `S = r_i + r_j` and `h = (2δ − sin 2δ)/sin² δ`, are
//!
//! ```text
//! C_f  = −S (1 − cos δ),                              C_ff = −S s² f / 4 cos δ
//! C_ri = ψ_i = f (δ/sin δ − 1) + f² h/8,              C_rj = ψ_j = f (δ/sin δ − 1) − f² h/8
//! C_f,ri = cos δ − 1 + ½ f (1 + s) tan δ,             C_f,rj = cos δ − 1 − ½ f (1 − s) tan δ
//! C_ii = Γ (1 + s)²/S,   C_ij = −Γ (1 − s²)/S,   C_jj = Γ (1 − s)²/S,       Γ = −f³ (4 − 2 h cot δ) / 16 cos δ
//! ```
//!
//! They were derived for this program, and are tested against numbers of 40 digits.

/// The sine of `δ` beyond which there is no film.
const STEEPEST: f64 = 0.95;

/// Below this `sin² δ` the functions of `δ` are taken from their series; what is left out is below 1e-16.
const FLAT: f64 = 1e-3;

/// A film, by its force (units of γ) and the corner radii of its two droplets (length).
#[derive(Clone, Copy, Debug)]
pub(super) struct Film {
    /// `f` (units of γ).
    force: f64,
    /// `r_i + r_j` (length).
    sum: f64,
    /// `s`, seen from the first droplet.
    slope: f64,
    /// `cos δ` and `tan δ`.
    cos: f64,
    tan: f64,
    /// `δ/sin δ − 1`.
    longer: f64,
    /// `½(δ/sin δ + cos δ) − 1`.
    energy: f64,
    /// `h` and `h cot δ`.
    h: f64,
    h_cot: f64,
}

impl Film {
    /// The film between droplets of corner radii `[r_i, r_j]`, which bears `force`; `None` if that bends it too far.
    pub fn of(force: f64, [r_i, r_j]: [f64; 2]) -> Option<Self> {
        let sum = r_i + r_j;
        let slope = (r_j - r_i) / sum;
        let z = 0.5 * slope * force;
        if z.is_nan() || z.abs() >= STEEPEST {
            return None;
        }
        let z2 = z * z;
        let cos = (1.0 - z2).sqrt();
        let (longer, energy, h, h_cot);
        if z2 < FLAT {
            // asin z = z + z³/6 + 3z⁵/40 + 15z⁷/336 + 105z⁹/3456 + …, cos δ = 1 − z²/2 − z⁴/8 − z⁶/16 − 5z⁸/128 − …
            let arc = [
                1.0 / 6.0,
                3.0 / 40.0,
                15.0 / 336.0,
                105.0 / 3456.0,
                945.0 / 42240.0,
            ];
            let fall = [1.0 / 2.0, 1.0 / 8.0, 1.0 / 16.0, 5.0 / 128.0, 7.0 / 256.0];
            let series = |a: f64| {
                let terms = arc.iter().zip(&fall).rev();
                terms.fold(0.0, |sum, (arc, fall)| sum * z2 + (arc + a * fall))
            };
            longer = z2 * series(0.0);
            energy = 0.5 * z2 * series(-1.0);
            // 2δ − sin 2δ = 2 z (δ/sin δ − cos δ).
            h = 2.0 * z * series(1.0);
            h_cot = 2.0 * series(1.0) * cos;
        } else {
            let ratio = libm::asin(z) / z;
            longer = ratio - 1.0;
            energy = 0.5 * (ratio + cos) - 1.0;
            h = 2.0 * (ratio - cos) / z;
            h_cot = h * cos / z;
        }
        Some(Self {
            force,
            sum,
            slope,
            cos,
            tan: z / cos,
            longer,
            energy,
            h,
            h_cot,
        })
    }

    /// A straight film, whatever it bears: nothing is added.
    pub const STRAIGHT: Self = Self {
        force: 0.0,
        sum: 1.0,
        slope: 0.0,
        cos: 1.0,
        tan: 0.0,
        longer: 0.0,
        energy: 0.0,
        h: 0.0,
        h_cot: 0.0,
    };

    /// `C` (force·length).
    pub fn energy(&self) -> f64 {
        self.sum * self.force * self.energy
    }

    /// `cos δ`: a chord is so much of a corner radius farther from the centre, `C_f = −(r_i + r_j)(1 − cos δ)`.
    pub fn cos(&self) -> f64 {
        self.cos
    }

    /// `1 − cos δ`.
    pub fn fall(&self) -> f64 {
        let sin = self.tan * self.cos;
        sin * sin / (1.0 + self.cos)
    }

    /// `δ` and `−δ`: how the film is bent seen from its first droplet, and from its second (radians).
    pub fn bend(&self) -> [f64; 2] {
        let bend = libm::asin(self.tan * self.cos);
        [bend, -bend]
    }

    /// `ψ_i` and `ψ_j` (force).
    pub fn psi(&self) -> [f64; 2] {
        let even = self.force * self.longer;
        let odd = self.force * self.force * self.h / 8.0;
        [even + odd, even - odd]
    }

    /// `−C_ff` (length/force), not negative.
    pub fn softness(&self) -> f64 {
        self.sum * self.slope * self.slope * self.force / (4.0 * self.cos)
    }

    /// `½ f (1 + s) tan δ` of the first droplet, `−½ f (1 − s) tan δ` of the second: what `C_f,r` has beside `cos δ − 1`.
    pub fn tilt(&self) -> [f64; 2] {
        let half = 0.5 * self.force * self.tan;
        [half * (1.0 + self.slope), -half * (1.0 - self.slope)]
    }

    /// `[C_ii, C_ij, C_jj]` (force/length).
    pub fn second(&self) -> [f64; 3] {
        let cube = self.force * self.force * self.force;
        let gamma = -cube * (4.0 - 2.0 * self.h_cot) / (16.0 * self.cos) / self.sum;
        let (p, m) = (1.0 + self.slope, 1.0 - self.slope);
        [gamma * p * p, -gamma * p * m, gamma * m * m]
    }
}
