//! Models of particles: which particles touch at given positions, and what forces that takes.
//!
//! A model is asked for the forces of a packing by [`Model::solve`], and tells its contacts and net forces. What drives it
//! (minimisers, protocols, analyses, recorders) goes by [`Model`], and asks which one it is only where models differ in kind.
//! [`AnyModel`] is the one that a scene names.
//!
//! ```
//! use softjam::domain::{Domain, Vec2};
//! use softjam::models::{Goal, Kind, Model};
//! use softjam::scene::Scene;
//! use softjam::state::Packing;
//!
//! let at = |x| Vec2::new(x, 2.0);
//! let packing = Packing::new(Domain::new(8.0, 8.0).unwrap(), vec![0.5; 2], vec![at(1.0), at(1.9)]).unwrap();
//! for model in [Kind::MorseWitten, Kind::Disks] {
//!     let mut model = Scene { model, ..Scene::default() }.model();
//!     model.solve(&packing, Goal::EXACT).unwrap();
//!     // A contact on its own is a spring of stiffness 4πγ / 3 (R_i + R_j) in either.
//!     let force = model.contacts(&packing).forces[0];
//!     assert!((force - 0.1 * 4.0 * std::f64::consts::PI / 3.0).abs() < 1e-13);
//! }
//! ```

mod check;
pub mod disks;
pub mod droplet;

use crate::contacts::Contacts;
use crate::domain::Vec2;
use crate::state::{Frame, FrameError, Packing};
pub use check::Check;
use disks::Disks;
use droplet::MorseWitten;
use droplet::contact::ContactError;
use droplet::contour::{ContourStyle, Contours};
use droplet::foam::{Films, Foam};
use droplet::validity::Validity;

/// What a model has to give.
///
/// See the example of the [module](self).
pub trait Model {
    /// Line tension γ, the unit of force.
    fn line_tension(&self) -> f64;

    /// Contacts and net forces at the positions of `packing`, as exactly as `goal` asks.
    ///
    /// # Errors
    ///
    /// [`ContactError`] if there is no answer; what the model tells is then of no use.
    fn solve(&mut self, packing: &Packing, goal: Goal) -> Result<(), ContactError>;

    /// Takes contacts and forces of a frame as the answer at the positions of `packing`, without solving: the same net
    /// forces, to the last bit, as in the run that the frame is from.
    ///
    /// # Errors
    ///
    /// [`FrameError::Foreign`] if the frame has a memory or forces that no frame of the model has.
    fn restore(&mut self, packing: &Packing, frame: &Frame) -> Result<(), FrameError>;

    /// The model's own numbers that the next solution depends on beside the contact forces, in the place of others.
    fn copy_memory(&self, memory: &mut Vec<f64>) {
        memory.clear();
    }

    /// The net force on each particle (force).
    fn net_forces(&self) -> &[Vec2];

    /// The largest net force (units of γ).
    fn f_max(&self) -> f64;

    /// The largest moment of a contact that its model has still to balance (γ·length).
    fn moment(&self) -> f64 {
        0.0
    }

    /// The contacts, in the order of their pairs; `packing` is the one solved last.
    fn contacts<'a>(&'a self, packing: &Packing) -> Contacts<'a>;

    /// Pairs and forces of [`contacts`](Self::contacts), copied to where others were.
    fn copy_contacts(&self, packing: &Packing, pairs: &mut Vec<[u32; 2]>, forces: &mut Vec<f64>) {
        let contacts = self.contacts(packing);
        contacts.pairs.clone_into(pairs);
        contacts.forces.clone_into(forces);
    }

    /// The torque of each contact (force·length), where contacts push aside as well as away; otherwise empty.
    fn torques(&self) -> &[f64] {
        &[]
    }

    /// How far the answer is from the law of the contacts, relative to the largest `|δ|`.
    fn residual(&self) -> f64;

    /// The residual that a frame in balance may have.
    fn accepted_residual(&self) -> f64;

    /// The residual that a frame may have whose balance is asked for to `threshold` (units of γ).
    fn promised_residual(&self, packing: &Packing, threshold: f64) -> f64;

    /// The upper bound of the minimiser's time step (time, mass 1) at the contacts found last.
    ///
    /// # Errors
    ///
    /// [`ContactError`] if a linear system is not solved.
    fn longest_time_step(&mut self, packing: &Packing) -> Result<f64, ContactError>;

    /// Whether that bound changes so much on the way that it is to be asked for again.
    fn stiffens(&self) -> bool {
        false
    }

    /// The residual, relative to its largest `|δ|`, that a frame promises whose balance is asked for to `threshold` (units of γ).
    ///
    /// `packing` has the positions of `frame` here and in [`check`](Self::check).
    fn promise(&self, packing: &Packing, frame: &Frame, threshold: f64) -> f64;

    /// What a frame's contacts and forces are worth. It shares nothing with [`solve`](Self::solve) but the formulas of the paper, and
    /// does not look at what was solved before.
    fn check(&self, packing: &Packing, frame: &Frame, threshold: f64) -> Check;
}

/// How exactly a model is to be solved.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Goal {
    /// `f_max` of the frame before (units of γ): far from balance forces need not be more exact than they are balanced.
    pub f_max: f64,
    /// `f_max` (units of γ) at which a run ends; a frame below it is solved as exactly as the scene asks.
    pub threshold: f64,
    /// No particle has moved by more than this (length) since the solution before.
    pub moved: f64,
}

impl Goal {
    /// As exactly as the scene asks, wherever the particles are.
    pub const EXACT: Self = Self {
        f_max: 0.0,
        threshold: 0.0,
        moved: f64::INFINITY,
    };

    /// [`due`] at this goal's threshold.
    pub(crate) fn due(&self, f_max: f64) -> f64 {
        due(f_max, self.threshold)
    }

    /// What a solution to the tolerance of `due` has to be tightened to, where its forces give `f_max`; `None` if it is good enough:
    /// if it has the full tolerance, or keeps its promise in a frame that cannot be the last.
    pub(crate) fn tighter(
        &self,
        due: f64,
        f_max: f64,
        keeps_promise: impl FnOnce() -> bool,
    ) -> Option<f64> {
        if due == 0.0 || (self.due(f_max) > 0.0 && keeps_promise()) {
            return None;
        }
        Some(if f_max < due {
            self.due(0.5 * f_max)
        } else {
            0.0
        })
    }
}

/// The `f_max` that a tolerance follows (units of γ): 0, for the full tolerance, in a frame that might be the last.
pub(crate) fn due(f_max: f64, threshold: f64) -> f64 {
    if f_max > threshold { f_max } else { 0.0 }
}

/// The models by the names that scenes have for them.
///
/// ```
/// assert_eq!(softjam::models::Kind::default().name(), "morse-witten");
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Kind {
    /// Droplets that dent and bulge: Saitoh 2.2.
    #[default]
    MorseWitten,
    /// Undeformed disks that repel with `f = k δ`: Saitoh 2.2.1.
    Disks,
    /// Droplets that keep their area, between straight films: [`droplet::foam`].
    RoundedPolygon,
    /// Droplets that keep their area, between films that their pressures bend: the exact wet foam, [`droplet::foam`].
    WetFoam,
}

impl Kind {
    /// The films of droplets that keep their area.
    fn films(self) -> Option<Films> {
        match self {
            Self::RoundedPolygon => Some(Films::Straight),
            Self::WetFoam => Some(Films::Arcs),
            Self::MorseWitten | Self::Disks => None,
        }
    }

    /// Whether frames of the model have a memory.
    pub(crate) fn has_memory(self) -> bool {
        self.films().is_some()
    }

    /// Whether moments of contacts have to be balanced beside forces.
    #[cfg(feature = "recording")]
    pub(crate) fn balances_moments(self) -> bool {
        self.films().is_some()
    }

    /// The name in scenes.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::MorseWitten => "morse-witten",
            Self::Disks => "disks",
            Self::RoundedPolygon => "rounded-polygon",
            Self::WetFoam => "wet-foam",
        }
    }

    /// The contours that particles of this model have: those of disks stay circles.
    #[must_use]
    pub fn contours(self, style: ContourStyle, line_tension: f64) -> Contours {
        match (self, self.films()) {
            (_, Some(films)) => Contours::of_foam(style, Foam::new(films, line_tension, 0.0)),
            (Self::Disks, None) => Contours::circles(style),
            (_, None) => Contours::new(style),
        }
    }

    /// How far these contacts strain a model that is linear in its forces; `None` for disks, whose law is meant as it stands.
    #[must_use]
    pub fn validity(
        self,
        contacts: &Contacts<'_>,
        particles: usize,
        line_tension: f64,
    ) -> Option<Validity> {
        (self == Self::MorseWitten).then(|| Validity::of(contacts, particles, line_tension))
    }
}

/// The model that a scene names.
///
/// See the example of the [module](self).
#[derive(Clone, Debug)]
pub enum AnyModel {
    /// Droplets.
    MorseWitten(Box<MorseWitten>),
    /// Undeformed disks.
    Disks(Box<Disks>),
    /// Droplets that keep their area.
    Foam(Box<Foam>),
}

macro_rules! each {
    ($self:ident, $model:ident => $call:expr) => {
        match $self {
            Self::MorseWitten($model) => $call,
            Self::Disks($model) => $call,
            Self::Foam($model) => $call,
        }
    };
}

impl Model for AnyModel {
    fn line_tension(&self) -> f64 {
        each!(self, model => model.line_tension())
    }

    fn solve(&mut self, packing: &Packing, goal: Goal) -> Result<(), ContactError> {
        each!(self, model => model.solve(packing, goal))
    }

    fn restore(&mut self, packing: &Packing, frame: &Frame) -> Result<(), FrameError> {
        each!(self, model => model.restore(packing, frame))
    }

    fn copy_memory(&self, memory: &mut Vec<f64>) {
        each!(self, model => model.copy_memory(memory));
    }

    fn moment(&self) -> f64 {
        each!(self, model => model.moment())
    }

    fn stiffens(&self) -> bool {
        each!(self, model => model.stiffens())
    }

    fn net_forces(&self) -> &[Vec2] {
        each!(self, model => model.net_forces())
    }

    fn f_max(&self) -> f64 {
        each!(self, model => model.f_max())
    }

    fn contacts<'a>(&'a self, packing: &Packing) -> Contacts<'a> {
        each!(self, model => model.contacts(packing))
    }

    fn copy_contacts(&self, packing: &Packing, pairs: &mut Vec<[u32; 2]>, forces: &mut Vec<f64>) {
        each!(self, model => model.copy_contacts(packing, pairs, forces));
    }

    fn torques(&self) -> &[f64] {
        each!(self, model => model.torques())
    }

    fn residual(&self) -> f64 {
        each!(self, model => model.residual())
    }

    fn accepted_residual(&self) -> f64 {
        each!(self, model => model.accepted_residual())
    }

    fn promised_residual(&self, packing: &Packing, threshold: f64) -> f64 {
        each!(self, model => model.promised_residual(packing, threshold))
    }

    fn longest_time_step(&mut self, packing: &Packing) -> Result<f64, ContactError> {
        each!(self, model => model.longest_time_step(packing))
    }

    fn promise(&self, packing: &Packing, frame: &Frame, threshold: f64) -> f64 {
        each!(self, model => model.promise(packing, frame, threshold))
    }

    fn check(&self, packing: &Packing, frame: &Frame, threshold: f64) -> Check {
        each!(self, model => model.check(packing, frame, threshold))
    }
}
