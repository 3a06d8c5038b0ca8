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
//! They were derived for this program, and are tested against numbers of 40 digits. All come from `cos δ` and `a = (δ/sin δ − 1)/sin² δ`, which are
//! found for all films of a packing at once: `δ/sin δ − 1 = a z²`, `1 − cos δ = z²/(1 + cos δ)` and `h = 2z (a + 1/(1 + cos δ))` for `z = sin δ`.

/// The sine of `δ` beyond which there is no film.
const STEEPEST: f64 = 0.95;

/// Up to this sine `a` is a quotient of polynomials in `z²`, that of fdlibm's `asin`, whose error is below 2e-18.
const QUOTIENT: f64 = 0.5;

/// A film, by its force (units of γ) and the corner radii of its two droplets (length).
#[derive(Clone, Copy, Debug)]
pub(super) struct Film {
    /// `f` (units of γ).
    force: f64,
    /// `r_i + r_j` (length).
    sum: f64,
    /// `s`, seen from the first droplet.
    slope: f64,
    /// `cos δ` and `a`.
    cos: f64,
    arc: f64,
}

/// `cos δ` and `a` of a film whose sine is no larger than [`QUOTIENT`].
#[inline(always)]
fn bend(z: f64) -> (f64, f64) {
    const P: [f64; 6] = [
        0.166_666_666_666_666_66,
        -0.325_565_818_622_400_9,
        0.201_212_532_134_862_93,
        -0.040_055_534_500_679_41,
        0.000_791_534_994_289_814_5,
        3.479_331_075_960_212e-05,
    ];
    const Q: [f64; 5] = [
        1.0,
        -2.403_394_911_734_414,
        2.020_945_760_233_505_7,
        -0.688_283_971_605_453_3,
        0.077_038_150_555_901_94,
    ];
    let z2 = z * z;
    let mut p = P[5];
    for k in (0..5).rev() {
        p = P[k] + z2 * p;
    }
    let mut q = Q[4];
    for k in (0..4).rev() {
        q = Q[k] + z2 * q;
    }
    ((1.0 - z2).sqrt(), p / q)
}

/// `a` of any film.
fn arc(z: f64) -> f64 {
    if z.abs() <= QUOTIENT {
        bend(z).1
    } else {
        (libm::asin(z) / z - 1.0) / (z * z)
    }
}

impl Film {
    /// The film between droplets of corner radii `[r_i, r_j]`, which bears `force`; `None` if that bends it too far.
    #[cfg(test)]
    pub fn of(force: f64, corners: [f64; 2]) -> Option<Self> {
        let mut arcs = Arcs::default();
        let found = arcs.find(&[force], &corners, &[[0, 1]]);
        found.then(|| arcs.film(0, force))
    }

    /// A straight film, whatever it bears: nothing is added.
    pub const STRAIGHT: Self = Self {
        force: 0.0,
        sum: 1.0,
        slope: 0.0,
        cos: 1.0,
        arc: 0.0,
    };

    /// `sin δ`.
    #[inline(always)]
    fn sin(&self) -> f64 {
        0.5 * self.slope * self.force
    }

    /// `C` (force·length).
    #[inline(always)]
    pub fn energy(&self) -> f64 {
        let square = self.sin() * self.sin();
        0.5 * self.sum * self.force * (self.arc * square - self.fall())
    }

    /// `cos δ`: a chord is so much of a corner radius farther from the centre, `C_f = −(r_i + r_j)(1 − cos δ)`.
    #[inline(always)]
    pub fn cos(&self) -> f64 {
        self.cos
    }

    /// `1 − cos δ`.
    #[inline(always)]
    pub fn fall(&self) -> f64 {
        self.sin() * self.sin() / (1.0 + self.cos)
    }

    /// `r_i + r_j` (length).
    #[inline(always)]
    pub fn sum(&self) -> f64 {
        self.sum
    }

    /// `δ` and `−δ`: how the film is bent seen from its first droplet, and from its second (radians).
    pub fn bend(&self) -> [f64; 2] {
        let bend = libm::asin(self.sin());
        [bend, -bend]
    }

    /// `h/2 sin δ`.
    #[inline(always)]
    fn half_h(&self) -> f64 {
        self.arc + 1.0 / (1.0 + self.cos)
    }

    /// `ψ_i` and `ψ_j` (force).
    #[inline(always)]
    pub fn psi(&self) -> [f64; 2] {
        let z = self.sin();
        let even = self.force * self.arc * (z * z);
        let odd = 0.25 * self.force * self.force * z * self.half_h();
        [even + odd, even - odd]
    }

    /// `−C_ff` (length/force), not negative.
    #[inline(always)]
    pub fn softness(&self) -> f64 {
        self.sum * self.slope * self.slope * self.force / (4.0 * self.cos)
    }

    /// `½ f (1 + s) tan δ` of the first droplet, `−½ f (1 − s) tan δ` of the second: what `C_f,r` has beside `cos δ − 1`.
    #[inline(always)]
    pub fn tilt(&self) -> [f64; 2] {
        let half = 0.5 * self.force * self.sin() / self.cos;
        [half * (1.0 + self.slope), -half * (1.0 - self.slope)]
    }

    /// `[C_ii, C_ij, C_jj]` (force/length).
    #[inline(always)]
    pub fn second(&self) -> [f64; 3] {
        let cube = self.force * self.force * self.force;
        let gamma = cube * (self.half_h() * self.cos - 1.0) / (4.0 * (self.cos * self.sum));
        let (p, m) = (1.0 + self.slope, 1.0 - self.slope);
        [gamma * p * p, -gamma * p * m, gamma * m * m]
    }
}

/// The films of a packing, one a line.
#[derive(Clone, Debug, Default)]
pub(super) struct Arcs {
    sums: Vec<f64>,
    slopes: Vec<f64>,
    cosines: Vec<f64>,
    bends: Vec<f64>,
    /// Room for what films have.
    first: Vec<f64>,
    second: Vec<f64>,
}

impl Arcs {
    /// The films between the droplets of `pairs` of such corner radii (length) under `loads` (units of γ); `false` if one is bent too far.
    #[inline(always)]
    pub fn find(&mut self, loads: &[f64], corners: &[f64], pairs: &[[u32; 2]]) -> bool {
        for column in [
            &mut self.sums,
            &mut self.slopes,
            &mut self.cosines,
            &mut self.bends,
            &mut self.first,
            &mut self.second,
        ] {
            column.resize(loads.len(), 0.0);
        }
        let columns = self.sums.iter_mut().zip(&mut self.slopes);
        for ((sum, slope), pair) in columns.zip(pairs) {
            let [i, j] = pair.map(|p| corners[p as usize]);
            (*sum, *slope) = (i + j, j - i);
        }
        quotients(&mut self.slopes, &self.sums);
        bends(loads, &self.slopes, &mut self.cosines, &mut self.bends);
        let steepest = steepest(loads, &self.slopes);
        if steepest > QUOTIENT {
            for ((arc, slope), f) in self.bends.iter_mut().zip(&self.slopes).zip(loads) {
                *arc = self::arc(0.5 * slope * f);
            }
        }
        steepest < STEEPEST
    }

    /// Two numbers of each film, which bear such loads (units of γ).
    #[inline(always)]
    pub fn each(&mut self, loads: &[f64], of: impl Fn(Film) -> [f64; 2]) -> [&[f64]; 2] {
        let given = (&self.sums[..], &self.slopes[..]);
        let given = (given, (&self.cosines[..], &self.bends[..]), loads);
        columns(given, (&mut self.first, &mut self.second), of);
        [&self.first, &self.second]
    }

    /// That of a line, which bears `force` (units of γ).
    #[inline(always)]
    pub fn film(&self, line: usize, force: f64) -> Film {
        Film {
            force,
            sum: self.sums[line],
            slope: self.slopes[line],
            cos: self.cosines[line],
            arc: self.bends[line],
        }
    }
}

/// Sums and differences of the corner radii, `cos δ` and `a`, and the loads of films.
type Columns<'a> = ((&'a [f64], &'a [f64]), (&'a [f64], &'a [f64]), &'a [f64]);

/// Numbers of films, several at once.
#[inline(always)]
fn columns(
    ((sums, slopes), (cosines, arcs), loads): Columns<'_>,
    (first, second): (&mut [f64], &mut [f64]),
    of: impl Fn(Film) -> [f64; 2],
) {
    let films = sums
        .iter()
        .zip(slopes)
        .zip(cosines.iter().zip(arcs))
        .zip(loads);
    let films = films.map(|(((sum, slope), (cos, arc)), force)| Film {
        force: *force,
        sum: *sum,
        slope: *slope,
        cos: *cos,
        arc: *arc,
    });
    for ((first, second), film) in first.iter_mut().zip(second).zip(films) {
        [*first, *second] = of(film);
    }
}

#[inline(always)]
fn quotients(a: &mut [f64], b: &[f64]) {
    for (a, b) in a.iter_mut().zip(b) {
        *a /= b;
    }
}

#[inline(always)]
fn bends(loads: &[f64], slopes: &[f64], cosines: &mut [f64], arcs: &mut [f64]) {
    let films = loads.iter().zip(slopes);
    for ((f, s), (cos, arc)) in films.zip(cosines.iter_mut().zip(arcs)) {
        (*cos, *arc) = bend(0.5 * s * f);
    }
}

/// The largest `|sin δ|`, infinite if one is no number.
#[inline(always)]
fn steepest(loads: &[f64], slopes: &[f64]) -> f64 {
    let (loads, last_loads) = loads.as_chunks::<8>();
    let (slopes, last_slopes) = slopes.as_chunks::<8>();
    // A NaN hides behind comparisons, not behind a sum.
    let (mut most, mut sums) = ([0.0; 8], [0.0; 8]);
    for (f, s) in loads.iter().zip(slopes) {
        for k in 0..8 {
            let z = (0.5 * s[k] * f[k]).abs();
            most[k] = if z > most[k] { z } else { most[k] };
            sums[k] += z;
        }
    }
    for (k, (f, s)) in last_loads.iter().zip(last_slopes).enumerate() {
        let z = (0.5 * s * f).abs();
        most[k] = if z > most[k] { z } else { most[k] };
        sums[k] += z;
    }
    let sum: f64 = sums.iter().sum();
    if sum.is_nan() {
        return f64::INFINITY;
    }
    most.into_iter().fold(0.0, f64::max)
}
