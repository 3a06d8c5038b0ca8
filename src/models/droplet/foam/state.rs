//! Droplets under forces: corner radii, gaps and the Lagrangian at given lines, tilts and forces.
//!
//! With γ = 1, `F = Σ f`, `K = Â f`, `M = G f` over the sides of a droplet (see [`Lines`]) and the [`Film`] of each contact,
//!
//! ```text
//! y     = Y − 1 = (F/2π)(2 + F/2π) − fᵀK/2π
//! 𝓛     = Σ_p π [ r y + (R − r)²/r ]  +  Σ_c C_c  −  Σ_c f_c n_c·Δx_c
//! 0     = ∂𝓛/∂r_i = πY_i − πR²/r² + Σ_c ψ_c                 the area of droplet i is πR²
//! ρ_k   = r ( F/2π − K_k + cos δ_k ),   m_k = r M_k           the chord of side k: its distance, and its midpoint along t_k
//! gap_c = −∂𝓛/∂f_c = n_c·Δx_c − ρ_i − ρ_j,                   T_c = |Δx| sin τ + m_i + m_j
//! ```
//!
//! What is small stays exact where forces are small: `r` is known by its dent `d = R − r`, and gaps are summed from overlaps and dents. A *give*
//! `ε` (length/γ), which starts without room for their droplets have, makes contacts soft: `gap += ε f`, `𝓛 −= ½ ε f²`.
//!
//! Straight films (`C = 0`, `r = R/√Y`) make rounded polygons, arcs the exact wet foam. Morse and Witten's linear model has the same `Â` with
//! `r = R`: there `ρ = R (1 − K)`. The law is derived in [`softjam::model`](crate::model).

use super::film::Film;
use super::lines::Lines;
use crate::models::droplet::kernel::Direction;
use crate::numerics::wide::wide;
use core::f64::consts::PI;

/// What the films between droplets are.
///
/// ```
/// use softjam::models::droplet::foam::{Films, Foam};
/// assert_eq!(Foam::new(Films::Arcs, 1.0, 1e-12).films(), Films::Arcs);
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Films {
    /// Straight lines, whatever the pressures: rounded polygons.
    Straight,
    /// Arcs that the pressures bend: wet foam.
    Arcs,
}

/// Below this `Y/(1 + F/2π)²` there is no droplet that has these contacts.
const LEAST_Y: f64 = 1e-6;

/// Passes that the corner radii may take, and the longest step of a pass, in corner radii.
const PASSES: usize = 100;
const STEP: f64 = 0.3;

/// What one side of a droplet has.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct OfSide {
    /// `K` and `M` (dimensionless).
    pub k: f64,
    pub m: f64,
}

/// What one droplet has.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct OfDroplet {
    /// `F` (units of γ).
    pub force: f64,
    /// `Y − 1`.
    pub y: f64,
    /// `F²/4π − fᵀK/2`: what `πy` has beside `F`.
    second: f64,
    /// `𝓛_rr` on the diagonal, `2πR²/r³ + Σ C_ii` (force/length).
    pub stiffness: f64,
}

/// See the [module](self).
#[derive(Clone, Debug, Default)]
pub(super) struct State {
    /// The forces (units of γ).
    loads: Vec<f64>,
    /// `d = R − r` and `r` (length).
    dents: Vec<f64>,
    corners: Vec<f64>,
    sides: Vec<OfSide>,
    droplets: Vec<OfDroplet>,
    films: Vec<Film>,
    gaps: Vec<f64>,
    lagrangian: f64,
    /// `ε` (length/γ).
    give: f64,
    /// Room for the residuals of the areas.
    areas: Vec<f64>,
}

impl State {
    /// Evaluates droplets of `radii` under `forces`; `false` if there are none. Corner radii are found to `tolerance` (relative), from those that
    /// are at hand; with an infinite one they stay.
    pub fn evaluate(
        &mut self,
        (lines, radii): (&Lines, &[f64]),
        (forces, line_tension): (&[f64], f64),
        films: Films,
        tolerance: f64,
    ) -> bool {
        self.loads.clear();
        self.loads.extend(forces.iter().map(|f| f / line_tension));
        self.sides.resize(2 * lines.len(), OfSide::default());
        self.droplets.resize(radii.len(), OfDroplet::default());
        if !wide(
            #[inline(always)]
            || self.load_droplets(lines, radii.len()),
        ) {
            return false;
        }
        self.find_corners((lines, radii), films, tolerance) && self.find_gaps(lines)
    }

    /// `F`, `K`, `M` and `Y` of all droplets; `false` if there are none with such contacts.
    #[inline(always)]
    fn load_droplets(&mut self, lines: &Lines, droplets: usize) -> bool {
        for p in 0..droplets {
            let sides = lines.sides(p);
            let first = lines.first_side(p);
            let of_sides = &mut self.sides[first..first + sides.len()];
            of_sides.fill(OfSide::default());
            let mut force = 0.0;
            for (l, side) in sides.iter().enumerate() {
                let f = self.loads[side.line as usize];
                if f > 0.0 {
                    force += f;
                    // Row l is column l: the kernel is even, its slope odd.
                    let (kernel, slopes) = lines.rows(p, l);
                    for ((of_side, a), g) in of_sides.iter_mut().zip(kernel).zip(slopes) {
                        of_side.k += a * f;
                        of_side.m -= g * f;
                    }
                }
            }
            let mut work = 0.0;
            for (of_side, side) in of_sides.iter().zip(sides) {
                work += self.loads[side.line as usize] * of_side.k;
            }
            let share = force / (2.0 * PI);
            let second = 0.5 * (force * share - work);
            let y = (force + second) / PI;
            self.droplets[p] = OfDroplet {
                force,
                y,
                second,
                stiffness: 0.0,
            };
            if y.is_nan() || 1.0 + y <= LEAST_Y * (1.0 + share) * (1.0 + share) {
                return false;
            }
        }
        true
    }

    /// The corner radii at which each droplet has its area, with the films between them.
    fn find_corners(
        &mut self,
        (lines, radii): (&Lines, &[f64]),
        films: Films,
        tolerance: f64,
    ) -> bool {
        let free = |(droplet, radius): (&OfDroplet, &f64)| {
            // R − R/√Y
            let root = (1.0 + droplet.y).sqrt();
            radius * droplet.y / (root * (1.0 + root))
        };
        if films == Films::Straight || self.dents.len() != radii.len() {
            self.dents.clear();
            let dents = self.droplets.iter().zip(radii).map(free);
            self.dents.extend(dents);
        }
        self.follow_dents(radii);
        self.films.clear();
        if films == Films::Straight {
            for ((droplet, r), radius) in self.droplets.iter_mut().zip(&self.corners).zip(radii) {
                droplet.stiffness = 2.0 * PI * radius * radius / (r * r * r);
            }
            return true;
        }
        for _ in 0..PASSES {
            self.films.clear();
            self.areas.clear();
            let droplets = self.droplets.iter_mut().zip(&self.dents);
            for ((droplet, dent), (r, radius)) in droplets.zip(self.corners.iter().zip(radii)) {
                droplet.stiffness = 2.0 * PI * radius * radius / (r * r * r);
                // Y − R²/r²
                self.areas
                    .push(PI * (droplet.y - dent * (radius + r) / (r * r)));
            }
            for (&pair, &f) in lines.pairs().iter().zip(&self.loads) {
                let Some(film) = Film::of(f, corners_of(&self.corners, pair)) else {
                    // The next try begins without films.
                    self.dents.clear();
                    return false;
                };
                if f > 0.0 {
                    let [i, j] = pair.map(|p| p as usize);
                    let ([psi_i, psi_j], [c_ii, _, c_jj]) = (film.psi(), film.second());
                    self.areas[i] += psi_i;
                    self.areas[j] += psi_j;
                    self.droplets[i].stiffness += c_ii;
                    self.droplets[j].stiffness += c_jj;
                }
                self.films.push(film);
            }
            // What is told of films and areas belongs to the corner radii that stay.
            let steps = self.areas.iter().zip(&self.droplets).zip(&self.corners);
            let off = steps.map(|((area, droplet), r)| (area / (droplet.stiffness * r)).abs());
            if off.fold(
                0.0,
                |most: f64, x| if x > most || x.is_nan() { x } else { most },
            ) <= tolerance
            {
                return true;
            }
            let droplets = self.droplets.iter().zip(&self.corners);
            for ((dent, area), (droplet, r)) in self.dents.iter_mut().zip(&self.areas).zip(droplets)
            {
                *dent += (area / droplet.stiffness).clamp(-STEP * r, STEP * r);
            }
            self.follow_dents(radii);
        }
        false
    }

    /// `r = R − d`.
    fn follow_dents(&mut self, radii: &[f64]) {
        self.corners.clear();
        let corners = radii.iter().zip(&self.dents);
        self.corners
            .extend(corners.map(|(radius, dent)| radius - dent));
    }

    fn find_gaps(&mut self, lines: &Lines) -> bool {
        self.gaps.clear();
        self.lagrangian = 0.0;
        for ((droplet, r), dent) in self.droplets.iter().zip(&self.corners).zip(&self.dents) {
            self.lagrangian += r * droplet.second + PI * dent * dent / r;
        }
        for (c, &load) in self.loads.iter().enumerate() {
            let [i, j] = self.hollows(lines, c);
            let depth = lines.depth(c);
            self.gaps.push(i + j - depth + self.give * load);
            if load > 0.0 {
                // r_i + r_j − n·Δx
                let [d_i, d_j] = lines.pairs()[c].map(|p| self.dents[p as usize]);
                let inner = depth - d_i - d_j - 0.5 * self.give * load;
                self.lagrangian += self.film(c).energy() + load * inner;
            }
        }
        self.lagrangian.is_finite()
    }

    /// The forces (units of γ).
    pub fn loads(&self) -> &[f64] {
        &self.loads
    }

    /// `r` of each droplet (length).
    pub fn corners(&self) -> &[f64] {
        &self.corners
    }

    /// `d = R − r` of each droplet (length).
    pub fn dents(&self) -> &[f64] {
        &self.dents
    }

    /// Dents to begin with.
    pub fn set_dents(&mut self, dents: &[f64]) {
        dents.clone_into(&mut self.dents);
    }

    /// `ε` (length/γ).
    pub fn give(&self) -> f64 {
        self.give
    }

    /// Makes contacts soft by `ε` (length/γ).
    pub fn set_give(&mut self, give: f64) {
        self.give = give;
    }

    /// `K` and `M` of each side.
    pub fn sides(&self) -> &[OfSide] {
        &self.sides
    }

    pub fn droplets(&self) -> &[OfDroplet] {
        &self.droplets
    }

    /// The film of a line.
    pub fn film(&self, line: usize) -> &Film {
        self.films.get(line).unwrap_or(&Film::STRAIGHT)
    }

    /// Each line's gap (length).
    pub fn gaps(&self) -> &[f64] {
        &self.gaps
    }

    /// `𝓛` (γ·length).
    pub fn lagrangian(&self) -> f64 {
        self.lagrangian
    }

    /// `R_i − ρ_i` and `R_j − ρ_j` of a line (length).
    pub fn hollows(&self, lines: &Lines, line: usize) -> [f64; 2] {
        let fall = self.film(line).fall();
        let pair = lines.pairs()[line];
        core::array::from_fn(|end| {
            let (p, side) = (pair[end] as usize, lines.sides_of(line)[end]);
            let bulge = self.droplets[p].force / (2.0 * PI) - self.sides[side].k;
            self.dents[p] + self.corners[p] * (fall - bulge)
        })
    }

    /// The support function `h` of droplet `p`, how far its contour reaches in a direction (length): `r (1 + F/2π + Σ f g/2π)`.
    pub fn reach(&self, lines: &Lines, p: usize, toward: Direction) -> f64 {
        let mut sum = self.droplets[p].force;
        for side in lines.sides(p) {
            let (c, at) = (side.line as usize, lines.direction(*side));
            sum += self.loads[c] * toward.g_between(at);
        }
        self.corners[p] * (1.0 + sum / (2.0 * PI))
    }

    /// `T` of a line (length).
    pub fn moment_arm(&self, lines: &Lines, line: usize) -> f64 {
        let [i, j] = lines.pairs()[line].map(|p| self.corners[p as usize]);
        let [a, b] = lines.sides_of(line).map(|side| self.sides[side].m);
        lines.across(line) + i * a + j * b
    }

    /// `∂ρ/∂r` of a line's two sides, `ρ/r` and what the film adds: `u` of the matrix.
    pub fn weights(&self, lines: &Lines, line: usize) -> [f64; 2] {
        let (film, pair) = (self.film(line), lines.pairs()[line]);
        let tilt = film.tilt();
        core::array::from_fn(|end| {
            let (p, side) = (pair[end] as usize, lines.sides_of(line)[end]);
            self.droplets[p].force / (2.0 * PI) - self.sides[side].k + film.cos() + tilt[end]
        })
    }
}

fn corners_of(corners: &[f64], pair: [u32; 2]) -> [f64; 2] {
    pair.map(|p| corners[p as usize])
}
