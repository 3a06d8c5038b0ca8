//! Droplets whose area is kept exactly: rounded polygons, right to one per cent of wet foam, and the wet foam itself.
//!
//! Three laws share Morse and Witten's kernel, and differ in little. A droplet of radius `R` under forces `f` has free arcs of the *corner
//! radius* `r`, and
//!
//! ```text
//! Morse–Witten        r = R           linear in the forces: 10 % off where Σf/2πγ is 0.066
//! rounded polygons    r = R/√Y        straight films, C = 0: the area πR² is kept, balanced droplets are exact polygons with round corners
//! wet foam            𝓛_r = 0         films are arcs, C(f, r_i, r_j): nothing is left out
//! ```
//!
//! with `Y` and `𝓛` as in `state`. A contact pushes along the normal of its chord, which is the line of centres turned by a *tilt* `τ`: so that
//! both droplets have the chord's midpoint in one place. Then the net force is `−∂U/∂x`, each droplet's torque vanishes, and balance of forces is
//! balance of everything.
//!
//! For straight films forces and contact set are unique at given positions and tilts (Brunn–Minkowski). For arcs, and for the tilts, that was
//! found wherever it was looked for, and is not proved.
//!
//! ```
//! use softjam::models::Kind;
//! use softjam::protocol::{Relaxation, Status};
//! use softjam::scene::Scene;
//!
//! let scene = Scene { particles: 64, phi: 0.92, model: Kind::WetFoam, ..Scene::default() };
//! let mut run = Relaxation::new(&scene).unwrap();
//! while run.status() == Status::Running {
//!     run.advance().unwrap();
//! }
//! assert_eq!(run.status(), Status::Converged);
//! // The stress is that of wet foam, where the linear model falls short by a quarter.
//! assert!(run.observables().pressure() > 0.3);
//! ```

mod check;
mod compliance;
mod contact_problem;
mod correction;
mod coupling;
mod film;
mod gaps;
pub(crate) mod linear;
mod lines;
mod model;
mod outline;
mod sides;
mod state;
#[cfg(test)]
mod tests;
#[cfg(test)]
mod tests_contours;
mod tilts;

pub use state::Films;

use super::contact::second_image::farther_images;
use super::contact::{ContactError, due_tolerance};
use super::kernel::Direction;
use crate::contacts::{FrameContacts, largest_force};
use crate::domain::Vec2;
use crate::neighbors::NeighborList;
use crate::state::{Packing, unit_and_length};
use contact_problem::Steps;
use linear::Linear;
use lines::{Lines, REACH};
use state::State;
use tilts::{LARGEST, Tilting};

/// How soft contacts are made where droplets have no room (largest radii a γ), how often that is doubled, and the `f_max` (units of γ) below which
/// they are made hard again.
const SOFT: f64 = 0.05;
const SOFTER: usize = 12;
const HARDENS: f64 = 1e-2;

/// The least violation of the contact law, relative to the largest `|δ|`, that is asked for: what rounding leaves of gaps.
const LEAST_TOLERANCE: f64 = 1e-13;

/// What the list of near pairs has beyond those that get a line (largest radii).
const SKIN: f64 = 0.2;

/// Sweeps over all tilts that a start may take; each takes a contact problem.
const SWEEPS: usize = 200;

/// `dt_max √(2 k)`, `k` the largest sum of the stiffnesses of a droplet's contacts.
const DT_MAX: f64 = 1.3;

/// Droplets that keep their area, by straight films or by arcs.
///
/// See the example of the [module](self).
#[derive(Clone, Debug)]
pub struct Foam {
    films: Films,
    /// γ (force).
    line_tension: f64,
    /// Violation of the contact law to which it is solved in balance, relative to the largest `|δ|`.
    tolerance: f64,
    near: NeighborList,
    lines: Lines,
    /// Tilt (radians) and force of each line.
    tilts: Vec<f64>,
    forces: Vec<f64>,
    state: State,
    steps: Steps,
    tilting: Tilting,
    contacts: FrameContacts,
    net: Vec<Vec2>,
    /// The largest net force (units of γ).
    f_max: f64,
}

impl Foam {
    /// Droplets of line tension γ (force) with such films, whose contact law is solved to `tolerance` (relative to the largest `|δ|`, not below
    /// 1e-13) in balance.
    #[must_use]
    pub fn new(films: Films, line_tension: f64, tolerance: f64) -> Self {
        Self {
            films,
            line_tension,
            tolerance: tolerance.max(LEAST_TOLERANCE),
            near: NeighborList::new(),
            lines: Lines::default(),
            tilts: Vec::new(),
            forces: Vec::new(),
            state: State::default(),
            steps: Steps::default(),
            tilting: Tilting::default(),
            contacts: FrameContacts::default(),
            net: Vec::new(),
            f_max: 0.0,
        }
    }

    /// What the films are.
    #[must_use]
    pub fn films(&self) -> Films {
        self.films
    }

    /// `Σ perimeter − 2πR`, in balance: the energy (γ·length).
    #[must_use]
    pub fn energy(&self) -> f64 {
        self.state.lagrangian()
    }

    /// The corner radius `r` of each droplet, whose pressure is `γ/r` (length).
    #[must_use]
    pub fn corners(&self) -> &[f64] {
        self.state.corners()
    }

    /// `Σ_c f_c n_c⊗Δx_c` as xx, xy, yy (force·length), which is symmetric where moments vanish and is made so elsewhere.
    #[must_use]
    pub fn moments(&self) -> [f64; 3] {
        let mut sums = [0.0; 3];
        for (c, f) in self.forces.iter().enumerate().filter(|(_, f)| **f > 0.0) {
            let (n, between) = (self.lines.normals()[c], self.lines.between(c));
            sums[0] += f * n.x * between.x;
            sums[1] += 0.5 * f * (n.x * between.y + n.y * between.x);
            sums[2] += f * n.y * between.y;
        }
        sums
    }

    /// The lines at new positions, none of which has moved by more than `moved` (length); what was known of a pair stays with it.
    fn set_lines(&mut self, packing: &Packing, moved: f64) {
        let margin = 2.0 * (REACH - 1.0) * packing.largest_radius();
        let skin = SKIN * packing.largest_radius();
        self.near.update_after(packing, margin, skin, moved);
        let known = [&mut self.tilts, &mut self.forces];
        self.lines.set(packing, self.near.pairs(), known);
    }

    /// Forces at the lines and tilts at hand, to `tolerance` (length); soft ones where droplets have no room.
    fn find_forces(&mut self, packing: &Packing, tolerance: f64) -> Result<(), ContactError> {
        self.lines.turn(&self.tilts);
        let given = (&self.lines, packing.radii());
        for _ in 0..=SOFTER {
            let forces = (&mut self.forces[..], self.line_tension);
            if self
                .steps
                .solve(given, &mut self.state, forces, self.films, tolerance)
            {
                self.state.find_midpoints(&self.lines);
                return self.has_one_image(packing, tolerance);
            }
            let give = (2.0 * self.state.give()).max(SOFT * packing.largest_radius());
            self.state.set_give(give);
        }
        let loads = self.forces.iter().map(|f| f / self.line_tension);
        let (line, strongest) =
            (0..).zip(loads).fold(
                (0, 0.0),
                |most, (c, f)| if f > most.1 { (c, f) } else { most },
            );
        let [particle, other] =
            (self.lines.pairs().get(line as usize)).map_or([0, 0], |p| p.map(|p| p as usize));
        Err(ContactError::NoRoom {
            particle,
            other,
            force: strongest,
        })
    }

    /// Fails if a droplet touches a second image of a neighbour or one of itself, for which there is no line.
    fn has_one_image(&self, packing: &Packing, tolerance: f64) -> Result<(), ContactError> {
        let shortest = packing.domain().shortest();
        if shortest > 4.0 * REACH * packing.largest_radius() {
            return Ok(());
        }
        let own = (0..packing.len()).map(|p| [p, p]);
        let pairs = self
            .lines
            .pairs()
            .iter()
            .map(|pair| pair.map(|p| p as usize));
        for [particle, other] in own.chain(pairs) {
            let sum = packing.radii()[particle] + packing.radii()[other];
            for separation in farther_images(packing, particle, other, REACH * sum) {
                let (normal, distance) = unit_and_length(separation);
                let toward = Direction::of(-normal);
                let reach = self.state.reach(&self.lines, particle, toward);
                let gap =
                    distance - reach - self.state.reach(&self.lines, other, toward.opposite());
                if gap.is_nan() || gap < -tolerance {
                    return Err(ContactError::BoxTooSmall {
                        particle,
                        other,
                        reach,
                        shortest,
                    });
                }
            }
        }
        Ok(())
    }

    /// Contacts and net forces of the answer at hand.
    fn balance(&mut self, packing: &Packing) {
        self.contacts.clear();
        self.net.clear();
        self.net.resize(packing.len(), Vec2::zeros());
        for (c, &pair) in self.lines.pairs().iter().enumerate() {
            let f = self.forces[c];
            if f > 0.0 {
                let normal = -self.lines.normals()[c];
                let place = (normal, self.lines.distances()[c]);
                self.contacts.add(packing, pair, place, f);
                self.net[pair[0] as usize] += normal * f;
                self.net[pair[1] as usize] -= normal * f;
            }
        }
        self.f_max = largest_force(&self.net) / self.line_tension;
    }

    /// The largest `|δ|` among contacts (length), or among overlapping pairs where there is none yet.
    fn scale(&self, packing: &Packing) -> f64 {
        let largest = |m: f64, d: f64| m.max(d.abs());
        let overlaps = self.contacts.view().overlaps;
        if !overlaps.is_empty() {
            return overlaps.iter().copied().fold(0.0, largest);
        }
        let radii = packing.radii();
        let depths = self.lines.pairs().iter().zip(self.lines.distances());
        depths
            .map(|([i, j], d)| radii[*i as usize] + radii[*j as usize] - d)
            .filter(|depth| *depth > 0.0)
            .fold(0.0, largest)
    }

    /// The violation that is due at an `f_max` (length).
    fn due(&self, packing: &Packing, f_max: f64) -> f64 {
        let scale = self.scale(packing).max(1e-9 * packing.smallest_radius());
        scale * due_tolerance(packing, &[scale], f_max, self.tolerance)
    }

    /// Forces and tilts together, from those at hand: a sweep over the tilts after each contact problem, until no midpoints are apart.
    fn settle(&mut self, packing: &Packing) -> Result<(), ContactError> {
        self.set_lines(packing, f64::INFINITY);
        for sweep in 0..SWEEPS {
            if sweep > 0 {
                self.tilting.step(&self.lines, &self.state, &mut self.tilts);
            }
            let tolerance = self.due(packing, 0.0);
            self.find_forces(packing, tolerance)?;
            self.balance(packing);
            if self.midpoints_apart() <= tolerance {
                break;
            }
        }
        Ok(())
    }

    /// Whether contacts were made soft.
    pub(crate) fn is_soft(&self) -> bool {
        self.state.give() > 0.0
    }

    /// The moments `f T` of the contacts, which vanish in balance (γ·length).
    pub(crate) fn moments_left(&self) -> impl Iterator<Item = f64> {
        let bearing = self.state.loads().iter().enumerate();
        bearing
            .filter(|(_, load)| **load > 0.0)
            .map(|(c, load)| load * self.state.moment_arm(&self.lines, c))
    }

    /// Moves on to the positions of `packing`, a part of the way that `change` leads by the linearised problem, and solves the contact problem
    /// there unless the forces fulfil it as they come.
    pub(crate) fn follow(
        &mut self,
        packing: &Packing,
        linear: &Linear,
        change: &[f64],
        part: f64,
    ) -> Result<(), ContactError> {
        let before = self.lines.clone();
        let mut turned = self.tilts.clone();
        self.tilting.step(&self.lines, &self.state, &mut self.tilts);
        let bearing = self.forces.iter().enumerate().filter(|(_, f)| **f > 0.0);
        let bearing: Vec<usize> = bearing.map(|(c, _)| c).collect();
        for (number, &c) in bearing.iter().enumerate() {
            let [turn, load] = linear.change_of_contact(change, number);
            turned[c] += part * turn;
            let f = self.forces[c] + part * load * self.line_tension;
            self.forces[c] = f.max(0.0);
        }
        let dents = self
            .state
            .dents()
            .iter()
            .zip(linear.change_of_radii(change));
        let dents: Vec<f64> = dents.map(|(d, r)| d - part * r).collect();
        self.state.set_dents(&dents);
        self.set_lines(packing, f64::INFINITY);
        for c in bearing {
            // The normal is what was changed: the tilt is what it has beside the line of centres.
            if let Ok(now) = self.lines.pairs().binary_search(&before.pairs()[c]) {
                let (old, new) = (before.between(c), self.lines.between(now));
                let tilt = turned[c] - libm::atan2(old.perp(&new), old.dot(&new));
                self.tilts[now] = tilt.clamp(-LARGEST, LARGEST);
            }
        }
        let tolerance = self.due(packing, 0.0);
        self.find_forces(packing, tolerance)?;
        self.balance(packing);
        Ok(())
    }

    /// The largest `|T|` (length).
    fn midpoints_apart(&self) -> f64 {
        let arms = (0..self.lines.len()).map(|c| self.state.moment_arm(&self.lines, c).abs());
        arms.fold(0.0, f64::max)
    }
}
