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

use super::film::{Arcs, Film};
use super::gaps::{find_gaps, find_hollows, pairs_of};
use super::lines::Lines;
use super::sides::{LANES, Lanes, combine, product, total, with_width};
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
#[derive(Clone, Copy, Debug)]
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
    pub second: f64,
    /// `𝓛_rr` on the diagonal, `2πR²/r³ + Σ C_ii` (force/length).
    pub stiffness: f64,
}

/// See the [module](self).
#[derive(Clone, Debug, Default)]
pub(super) struct State {
    films: Option<Films>,
    /// The forces (units of γ), by lines and by sides.
    loads: Vec<f64>,
    pushes: Vec<Lanes>,
    /// `d = R − r` and `r` (length).
    dents: Vec<f64>,
    corners: Vec<f64>,
    droplets: Vec<OfDroplet>,
    /// By sides: `K`, `M`, and `r (K − F/2π) + d` (length), what `R − ρ` has beside the film.
    kernel: Vec<Lanes>,
    midpoints: Vec<Lanes>,
    hollows: Vec<Lanes>,
    /// Arcs, and by sides what a film adds to `∂ρ/∂r`; empty where films are straight.
    arcs: Arcs,
    chords: Vec<Lanes>,
    /// `−C_ff` by lines (length/force).
    softness: Vec<f64>,
    gaps: Vec<f64>,
    lagrangian: f64,
    /// `ε` (length/γ).
    give: f64,
    /// Room: `ψ` and `C_ii` by sides, and the steps of the corner radii (length).
    psi: Vec<Lanes>,
    second: Vec<Lanes>,
    steps: Vec<f64>,
}

impl State {
    /// Evaluates droplets of `radii` under `forces`; `false` if there are none. Corner radii are found to `tolerance` (relative), from those that
    /// are at hand; with an infinite one they stay. Midpoints are those of the state before until they are [found](Self::find_midpoints).
    pub fn evaluate(
        &mut self,
        (lines, radii): (&Lines, &[f64]),
        (forces, line_tension): (&[f64], f64),
        films: Films,
        tolerance: f64,
    ) -> bool {
        self.films = Some(films);
        self.loads.resize(forces.len(), 0.0);
        self.gaps.resize(forces.len(), 0.0);
        self.softness.resize(forces.len(), 0.0);
        self.droplets.resize(radii.len(), OfDroplet::default());
        let follows = films == Films::Straight || self.dents.len() != radii.len();
        self.dents.resize(radii.len(), 0.0);
        self.corners.resize(radii.len(), 0.0);
        self.steps.resize(radii.len(), 0.0);
        for column in [&mut self.kernel, &mut self.hollows] {
            column.resize(lines.layout().groups(), [0.0; LANES]);
        }
        wide(
            #[inline(always)]
            || {
                for (load, f) in self.loads.iter_mut().zip(forces) {
                    *load = f / line_tension;
                }
                let loads = self.loads.iter().map(|f| [*f; 2]);
                lines.layout().scatter(&mut self.pushes, loads);
                self.load_droplets(lines, radii, follows)
                    && (films == Films::Straight || self.find_corners(lines, radii, tolerance))
                    && self.find_gaps(lines)
            },
        )
    }

    /// `F`, `K` and `Y` of all droplets, and corner radii without films where these are straight or unknown; `false` if there are none with such
    /// contacts.
    #[inline(always)]
    fn load_droplets(&mut self, lines: &Lines, radii: &[f64], follows: bool) -> bool {
        let (pushes, kernel) = (&self.pushes[..], &mut self.kernel[..]);
        let (dents, corners) = (&mut self.dents[..radii.len()], &mut self.corners[..]);
        let droplets = &mut self.droplets[..];
        for place in lines.layout().places() {
            let p = place.droplet();
            let (pushes, rows) = (&pushes[place.groups()], &lines.kernel()[place.rows()]);
            let kernel = &mut kernel[place.groups()];
            let (force, work) = with_width(
                place.width(),
                #[inline(always)]
                |width| {
                    let (mut force, mut work) = (0.0, 0.0);
                    for g in 0..width {
                        // Row l is column l: the kernel is even.
                        let each = pushes.as_flattened().iter().copied();
                        let sum = combine(rows, (g, width), each);
                        force += total(pushes[g]);
                        work += total(product(&pushes[g], &sum));
                        kernel[g] = sum;
                    }
                    (force, work)
                },
            );
            let (radius, droplet) = (radii[p], &mut droplets[p]);
            let share = force * (0.5 / PI);
            let second = 0.5 * (force * share - work);
            let y = (force + second) * (1.0 / PI);
            if y.is_nan() || 1.0 + y <= LEAST_Y * (1.0 + share) * (1.0 + share) {
                if follows {
                    self.dents.clear();
                }
                return false;
            }
            (droplet.force, droplet.y, droplet.second) = (force, y, second);
            if follows {
                // R − R/√Y
                let root = (1.0 + y).sqrt();
                dents[p] = radius * y / (root * (1.0 + root));
            }
            let r = radius - dents[p];
            corners[p] = r;
            droplet.stiffness = 2.0 * PI * radius * radius / (r * r * r);
        }
        true
    }

    /// The corner radii at which each droplet has its area, with the films between them.
    #[inline(always)]
    fn find_corners(&mut self, lines: &Lines, radii: &[f64], tolerance: f64) -> bool {
        let layout = lines.layout();
        for _ in 0..PASSES {
            if !self.arcs.find(&self.loads, &self.corners, lines.pairs()) {
                // The next try begins without films.
                self.dents.clear();
                return false;
            }
            let psi = self.arcs.each(
                &self.loads,
                #[inline(always)]
                |film| film.psi(),
            );
            layout.scatter(&mut self.psi, pairs_of(psi));
            let second = self.arcs.each(
                &self.loads,
                #[inline(always)]
                |film| {
                    let [own, _, other] = film.second();
                    [own, other]
                },
            );
            layout.scatter(&mut self.second, pairs_of(second));
            // What is told of films belongs to the corner radii that stay.
            let mut off: f64 = 0.0;
            let (dents, corners) = (&self.dents[..], &self.corners[..]);
            let (droplets, steps) = (&mut self.droplets[..], &mut self.steps[..]);
            for place in layout.places() {
                let p = place.droplet();
                let (radius, dent, r, droplet) = (radii[p], dents[p], corners[p], &mut droplets[p]);
                // Y − R²/r²
                let mut area = PI * (droplet.y - dent * (radius + r) / (r * r));
                let mut stiffness = 2.0 * PI * radius * radius / (r * r * r);
                for g in place.groups() {
                    area += total(self.psi[g]);
                    stiffness += total(self.second[g]);
                }
                droplet.stiffness = stiffness;
                steps[p] = area / stiffness;
                let x = (steps[p] / r).abs();
                off = if x > off || x.is_nan() { x } else { off };
            }
            if off <= tolerance {
                self.find_chords(lines);
                return true;
            }
            let droplets = self
                .dents
                .iter_mut()
                .zip(&mut self.corners)
                .zip(&self.steps);
            for (((dent, r), step), radius) in droplets.zip(radii) {
                *dent += step.clamp(-STEP * *r, STEP * *r);
                *r = radius - *dent;
            }
        }
        false
    }

    /// What the films add to `∂ρ/∂r`.
    #[inline(always)]
    fn find_chords(&mut self, lines: &Lines) {
        let chords = self.arcs.each(
            &self.loads,
            #[inline(always)]
            |film| {
                let [first, second] = film.tilt();
                [film.cos() + first, film.cos() + second]
            },
        );
        lines.layout().scatter(&mut self.chords, pairs_of(chords));
        let [softness, _] = self.arcs.each(
            &self.loads,
            #[inline(always)]
            |film| [film.softness(), 0.0],
        );
        self.softness.copy_from_slice(softness);
    }

    #[inline(always)]
    fn find_gaps(&mut self, lines: &Lines) -> bool {
        let hollows = &mut self.hollows[..];
        let droplets = (&self.droplets[..], &self.dents[..], &self.corners[..]);
        let places = lines.layout().places();
        let mut lagrangian = find_hollows(places, droplets, &self.kernel, hollows);
        let depths = (lines.overlaps(), lines.shorter());
        let sides = (lines.layout().of_lines(), hollows.as_flattened());
        let loads = (&self.loads[..], self.give);
        lagrangian += find_gaps(depths, sides, loads, &mut self.gaps);
        if self.films == Some(Films::Arcs) {
            let [falls, energies] = self.arcs.each(
                &self.loads,
                #[inline(always)]
                |film| [film.sum() * film.fall(), film.energy()],
            );
            for ((gap, fall), energy) in self.gaps.iter_mut().zip(falls).zip(energies) {
                *gap += fall;
                lagrangian += energy;
            }
        }
        self.lagrangian = lagrangian;
        lagrangian.is_finite()
    }

    /// `M` of all sides.
    pub fn find_midpoints(&mut self, lines: &Lines) {
        self.midpoints.resize(lines.layout().groups(), [0.0; LANES]);
        wide(
            #[inline(always)]
            || {
                let (pushes, slopes) = (&self.pushes[..], lines.slopes());
                let midpoints = &mut self.midpoints[..];
                for place in lines.layout().places() {
                    let (pushes, rows) = (&pushes[place.groups()], &slopes[place.rows()]);
                    let midpoints = &mut midpoints[place.groups()];
                    with_width(
                        place.width(),
                        #[inline(always)]
                        |width| {
                            for (g, midpoints) in midpoints.iter_mut().enumerate().take(width) {
                                // Row l is column l with the other sign: the slope is odd.
                                let each = pushes.as_flattened().iter().map(|f| -f);
                                *midpoints = combine(rows, (g, width), each);
                            }
                        },
                    );
                }
            },
        );
    }

    /// The forces (units of γ).
    #[inline(always)]
    pub fn loads(&self) -> &[f64] {
        &self.loads
    }

    /// The forces by sides (units of γ).
    #[inline(always)]
    pub fn pushes(&self) -> &[Lanes] {
        &self.pushes
    }

    /// `r` of each droplet (length).
    #[inline(always)]
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
    #[inline(always)]
    pub fn give(&self) -> f64 {
        self.give
    }

    /// Makes contacts soft by `ε` (length/γ).
    pub fn set_give(&mut self, give: f64) {
        self.give = give;
    }

    /// `K` and `M` of a side.
    pub fn side(&self, side: usize) -> OfSide {
        OfSide {
            k: self.kernel.as_flattened()[side],
            m: self.midpoints.as_flattened()[side],
        }
    }

    /// `K` by sides.
    #[inline(always)]
    pub fn kernel_sums(&self) -> &[Lanes] {
        &self.kernel
    }

    #[inline(always)]
    pub fn droplets(&self) -> &[OfDroplet] {
        &self.droplets
    }

    /// The film of a line.
    #[inline(always)]
    pub fn film(&self, line: usize) -> Film {
        if self.films == Some(Films::Arcs) {
            self.arcs.film(line, self.loads[line])
        } else {
            Film::STRAIGHT
        }
    }

    /// What films add to `∂ρ/∂r` of a group of sides.
    #[inline(always)]
    pub fn chords(&self, group: usize) -> Lanes {
        if self.films == Some(Films::Arcs) {
            self.chords[group]
        } else {
            [1.0; LANES]
        }
    }

    /// `−C_ff` of each line (length/force), 0 where films are straight.
    #[inline(always)]
    pub fn softness(&self) -> &[f64] {
        &self.softness
    }

    /// `M` by sides.
    #[inline(always)]
    pub fn midpoints(&self) -> &[Lanes] {
        &self.midpoints
    }

    /// Each line's gap (length).
    #[inline(always)]
    pub fn gaps(&self) -> &[f64] {
        &self.gaps
    }

    /// `𝓛` (γ·length).
    pub fn lagrangian(&self) -> f64 {
        self.lagrangian
    }

    /// `R_i − ρ_i` and `R_j − ρ_j` of a line (length).
    pub fn hollows(&self, lines: &Lines, line: usize) -> [f64; 2] {
        let (fall, pair) = (self.film(line).fall(), lines.pairs()[line]);
        core::array::from_fn(|end| {
            let hollow = self.hollows.as_flattened()[lines.sides_of(line)[end]];
            hollow + self.corners[pair[end] as usize] * fall
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
    #[inline(always)]
    pub fn moment_arm(&self, lines: &Lines, line: usize) -> f64 {
        let (midpoints, [a, b]) = (self.midpoints.as_flattened(), lines.sides_of(line));
        let [i, j] = lines.pairs()[line].map(|p| self.corners[p as usize]);
        lines.across()[line] + i * midpoints[a] + j * midpoints[b]
    }
}
