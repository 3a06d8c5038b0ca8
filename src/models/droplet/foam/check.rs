//! A frame of droplets held against their law: areas, gaps and midpoints, from positions, radii, forces, tilts and corner radii alone. Angles are
//! taken by `atan2`, the kernel is evaluated at each, and nothing is solved.

use super::{Films, Foam};
use crate::contacts::{Contacts, FrameContacts};
use crate::models::check::worse;
use crate::models::droplet::kernel::{dg, g};
use crate::models::{Check, Model};
use crate::neighbors::NeighborList;
use crate::state::{Frame, Packing};
use core::f64::consts::PI;

/// Pairs are looked at up to this distance (sums of radii).
const FAR: f64 = 1.6;

/// What a droplet is under its forces. Small differences are summed from small parts, so that nothing is lost where forces are weak.
#[derive(Default)]
struct Droplet {
    /// `R`, `d = R − r` and `r` (length).
    radius: f64,
    dent: f64,
    corner: f64,
    /// `F` (units of γ).
    force: f64,
    /// Direction and force (units of γ) of each contact.
    pushes: Vec<(f64, f64)>,
}

impl Droplet {
    /// `Σ f g(θ − θ_k)/2π`.
    fn bulge(&self, angle: f64) -> f64 {
        self.pushes
            .iter()
            .map(|(at, f)| f * g(angle - at))
            .sum::<f64>()
            / (2.0 * PI)
    }

    /// `R − ρ` in the direction `angle`, of a film bent by `bend` (length).
    fn hollow(&self, angle: f64, bend: f64) -> f64 {
        self.dent + self.corner * (fall(bend) - self.force / (2.0 * PI) - self.bulge(angle))
    }

    /// `m` of the contact in the direction `angle` (length).
    fn midpoint(&self, angle: f64) -> f64 {
        let slope = |(at, f): &(f64, f64)| {
            let between = libm::fmod(angle - at + 4.0 * PI, 2.0 * PI);
            if between.min(2.0 * PI - between) < 1e-9 {
                0.0
            } else {
                f * dg(between)
            }
        };
        self.corner * self.pushes.iter().map(slope).sum::<f64>() / (2.0 * PI)
    }

    /// `F²/4π − fᵀK/2`.
    fn second(&self) -> f64 {
        let work: f64 = self.pushes.iter().map(|(at, f)| f * self.bulge(*at)).sum();
        self.force * self.force / (4.0 * PI) + 0.5 * work
    }

    /// `Y − 1`.
    fn excess(&self) -> f64 {
        (self.force + self.second()) / PI
    }

    /// `π (Y r² − R²)`, to which films add (length²).
    fn area(&self) -> f64 {
        let r = self.corner;
        PI * (self.excess() * r * r - self.dent * (self.radius + r))
    }

    /// `r (F²/4π − fᵀK/2) + π d²/r` (γ·length).
    fn energy(&self) -> f64 {
        self.corner * self.second() + PI * self.dent * self.dent / self.corner
    }
}

/// `1 − cos` of an angle.
fn fall(angle: f64) -> f64 {
    let sin = libm::sin(0.5 * angle);
    2.0 * sin * sin
}

/// A frame's droplets with their contacts.
struct Seen<'a> {
    packing: &'a Packing,
    films: Films,
    line_tension: f64,
    /// The pairs that are near, and their tilts.
    tilts: Vec<([u32; 2], f64)>,
    /// `ε` (length/γ).
    give: f64,
    droplets: Vec<Droplet>,
}

impl<'a> Seen<'a> {
    /// What `run`, which has taken up a frame, says of it: tilts, dents and give; everything else is found here.
    fn of(run: &Foam, packing: &'a Packing, contacts: &Contacts<'_>) -> Self {
        let tilts = run
            .lines
            .pairs()
            .iter()
            .copied()
            .zip(run.tilts.iter().copied());
        let mut seen = Self {
            packing,
            films: run.films,
            line_tension: run.line_tension,
            tilts: tilts.collect(),
            give: run.state.give(),
            droplets: Vec::new(),
        };
        seen.droplets.resize_with(packing.len(), Droplet::default);
        for (&pair, f) in contacts.pairs.iter().zip(contacts.forces) {
            let (_, angle) = seen.line(pair, seen.tilt(pair));
            let load = f / seen.line_tension;
            for (p, angle) in [(pair[0], angle), (pair[1], angle + PI)] {
                let droplet = &mut seen.droplets[p as usize];
                droplet.pushes.push((angle, load));
                droplet.force += load;
            }
        }
        for (p, droplet) in seen.droplets.iter_mut().enumerate() {
            droplet.radius = packing.radii()[p];
            droplet.dent = match run.films {
                // R − R/√Y
                Films::Straight => {
                    let (y, root) = (droplet.excess(), (1.0 + droplet.excess()).sqrt());
                    droplet.radius * y / (root + root * root)
                }
                Films::Arcs => run.state.dents()[p],
            };
            droplet.corner = droplet.radius - droplet.dent;
        }
        seen
    }

    fn tilt(&self, pair: [u32; 2]) -> f64 {
        let place = self.tilts.binary_search_by(|(of, _)| of.cmp(&pair));
        place.map_or(0.0, |k| self.tilts[k].1)
    }

    /// The distance of a pair, and the angle of its line, turned by `tilt` (length, radians).
    fn line(&self, pair: [u32; 2], tilt: f64) -> (f64, f64) {
        let between = -self.packing.separation(pair[0] as usize, pair[1] as usize);
        (between.norm(), libm::atan2(between.y, between.x) + tilt)
    }

    /// `|Δx| − n·Δx` (length).
    fn turned(&self, pair: [u32; 2], tilt: f64) -> f64 {
        self.line(pair, tilt).0 * fall(tilt)
    }

    /// `R_i + R_j − n·Δx` (length).
    fn depth(&self, pair: [u32; 2], tilt: f64) -> f64 {
        let [i, j] = self.ends(pair).map(|droplet| droplet.radius);
        i + j - self.line(pair, tilt).0 + self.turned(pair, tilt)
    }

    fn ends(&self, pair: [u32; 2]) -> [&Droplet; 2] {
        pair.map(|p| &self.droplets[p as usize])
    }

    /// `δ` of a contact that bears `load` (units of γ).
    fn bend(&self, pair: [u32; 2], load: f64) -> f64 {
        let [i, j] = self.ends(pair).map(|droplet| droplet.corner);
        match self.films {
            Films::Straight => 0.0,
            Films::Arcs => libm::asin(0.5 * load * (j - i) / (j + i)),
        }
    }

    /// The gap of a pair that bears `load` (units of γ; length).
    fn gap(&self, pair: [u32; 2], tilt: f64, load: f64) -> f64 {
        let ((_, angle), bend) = (self.line(pair, tilt), self.bend(pair, load));
        let [i, j] = self.ends(pair);
        let hollows = i.hollow(angle, bend) + j.hollow(angle + PI, bend);
        hollows - self.depth(pair, tilt) + self.give * load
    }

    /// How far the contours of a pair without a force overlap: in whatever direction they overlap least (length).
    fn overlap(&self, pair: [u32; 2]) -> f64 {
        let known = -self.gap(pair, self.tilt(pair), 0.0);
        if known <= 0.0 || self.tilts.binary_search_by(|(of, _)| of.cmp(&pair)).is_ok() {
            return known;
        }
        let turns = (-60..=60).map(|k| 0.01 * f64::from(k));
        turns.fold(known, |least, tilt| least.min(-self.gap(pair, tilt, 0.0)))
    }

    /// `T` of a contact (length).
    fn moment_arm(&self, pair: [u32; 2], tilt: f64) -> f64 {
        let ((distance, angle), [i, j]) = (self.line(pair, tilt), self.ends(pair));
        distance * libm::sin(tilt) + i.midpoint(angle) + j.midpoint(angle + PI)
    }

    /// What an arc adds to a straight film: `C`, and `∂C/∂r` of both droplets.
    fn film(&self, pair: [u32; 2], load: f64) -> [f64; 3] {
        let bend = self.bend(pair, load);
        if bend == 0.0 {
            return [0.0; 3];
        }
        let [r_i, r_j] = self.ends(pair).map(|droplet| droplet.corner);
        let ratio = bend / libm::sin(bend);
        // (2δ − sin 2δ)/sin²δ loses its digits where it is 4δ/3.
        let h = if bend.abs() < 1e-4 {
            4.0 / 3.0 * bend
        } else {
            2.0 * (ratio - libm::cos(bend)) / libm::sin(bend)
        };
        let (even, odd) = (load * (ratio - 1.0), load * load * h / 8.0);
        let energy = (r_i + r_j) * load * (0.5 * (ratio + libm::cos(bend)) - 1.0);
        [energy, even + odd, even - odd]
    }
}

impl Foam {
    /// What the frame's forces are worth; see [`Model::check`].
    pub(super) fn check_frame(&self, packing: &Packing, frame: &Frame, threshold: f64) -> Check {
        let contacts = FrameContacts::of(packing, frame);
        let contacts = contacts.view();
        let (domain, gamma) = (packing.domain(), self.line_tension);
        let mut run = self.clone();
        if run.restore(packing, frame).is_err() {
            let nan = f64::NAN;
            return Check::of(&contacts, domain, gamma, (0.0, nan), (nan, nan));
        }
        let seen = Seen::of(&run, packing, &contacts);
        let mut areas: Vec<f64> = seen.droplets.iter().map(Droplet::area).collect();
        let mut energy: f64 = seen.droplets.iter().map(Droplet::energy).sum();
        let (mut residual, mut work) = (0.0_f64, 0.0);
        for (&pair, f) in contacts.pairs.iter().zip(contacts.forces) {
            let (load, tilt) = (f / gamma, seen.tilt(pair));
            residual = worse(residual, seen.gap(pair, tilt, load).abs());
            // The run's own midpoints decide on its moment; here they are what they should be.
            let line = run.lines.pairs().binary_search(&pair);
            let arm = line.map_or(f64::NAN, |c| run.state.moment_arm(&run.lines, c));
            residual = worse(residual, (seen.moment_arm(pair, tilt) - arm).abs());
            let [film, psi_i, psi_j] = seen.film(pair, load);
            work += load * (seen.line(pair, tilt).0 - seen.turned(pair, tilt));
            let dents: f64 = seen.ends(pair).iter().map(|droplet| droplet.dent).sum();
            let inner = seen.depth(pair, tilt) - dents - 0.5 * seen.give * load;
            energy += film + load * inner;
            for (p, psi) in pair.iter().zip([psi_i, psi_j]) {
                let corner = seen.droplets[*p as usize].corner;
                areas[*p as usize] += corner * corner * psi;
            }
        }
        // An area that is off by a part of itself is a radius that is off by half of that.
        for (area, droplet) in areas.iter().zip(&seen.droplets) {
            residual = worse(residual, (area / (2.0 * PI * droplet.radius)).abs());
        }
        let mut near = NeighborList::new();
        near.update(packing, 2.0 * (FAR - 1.0) * packing.largest_radius(), 0.0);
        let mut overlap = 0.0;
        for &pair in near.pairs() {
            // While contacts are soft, droplets may lie on others that no line of theirs leads to.
            let is_given = seen.give > 0.0 && run.lines.pairs().binary_search(&pair).is_err();
            if !is_given && contacts.pairs.binary_search(&pair).is_err() {
                overlap = worse(overlap, seen.overlap(pair));
            }
        }
        let promised = run.promised_residual(packing, threshold);
        let found = (residual, overlap);
        Check {
            moment: run.moment(),
            energy,
            pressure: work / (2.0 * domain.area()),
            ..Check::of(&contacts, domain, gamma, (promised, run.f_max()), found)
        }
    }
}
