//! The scene: everything that a run depends on, as a TOML file and as a value.
//!
//! A scene that names nothing is the default one. Every field has a default, a documented range and, on the command
//! line, a flag of the same name that wins over the file. [`Scene::to_toml`] writes every field out with its comment;
//! that text is what a recording carries.
//!
//! ```
//! use softjam::scene::Scene;
//!
//! let scene = Scene::from_toml("particles = 1024\nphi = 0.9").unwrap();
//! assert_eq!((scene.particles, scene.phi, scene.seed), (1024, 0.9, 1));
//! assert_eq!(Scene::from_toml(&scene.to_toml()).unwrap(), scene);
//!
//! let error = Scene::from_toml("phi = 1.7").unwrap_err();
//! assert_eq!(error.to_string(), "phi = 1.7 is outside 0 < phi < 1.3 (coverage of the undeformed disks)");
//! ```

mod disks;
mod fields;
mod print;
pub mod schedule;
mod stages;
pub mod start;
mod start_file;
mod start_table;
mod validate;

pub use disks::DiskParameters;
pub use fields::{DiskFields, SceneFields};
pub use schedule::{Channels, Schedule};
pub use stages::{Act, Increment, Shear, Stage, StageFields, Until, Way};

use crate::minimize::fire::Fire;
use crate::models::disks::Disks;
use crate::models::droplet::contact::solver::Method;
use crate::models::droplet::contact::{ContactLaw, Rule};
use crate::models::droplet::contour::ContourStyle;
use crate::models::droplet::foam::{Films, Foam};
use crate::models::droplet::{Form, MorseWitten};
use crate::models::{AnyModel, Kind};
use crate::text::{lines, shown};

/// One kind of particle in a mixture.
///
/// ```
/// let small = softjam::scene::Species { radius: 0.5, fraction: 0.5 };
/// assert_eq!(small.radius, 0.5);
/// ```
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Species {
    /// Undeformed radius (length), positive.
    pub radius: f64,
    /// Share of the particles by number, between 0 and 1; the fractions of a mixture sum to 1.
    pub fraction: f64,
}

/// How the undeformed radii are distributed.
///
/// ```
/// use softjam::scene::Radii;
/// assert!(matches!(Radii::default(), Radii::Species(mixture) if mixture.len() == 2));
/// ```
#[derive(Clone, Debug, PartialEq)]
pub enum Radii {
    /// A mixture. Particle numbers are rounded to the fractions, the largest remainders first; particles are numbered
    /// species by species.
    Species(Vec<Species>),
    /// A continuous spread, uniform between two radii (length).
    Spread {
        /// Smallest radius.
        min: f64,
        /// Largest radius.
        max: f64,
    },
}

impl Default for Radii {
    /// The 50:50 mixture of radii 0.5 and 0.7, whose packings do not crystallise.
    fn default() -> Self {
        Self::Species(vec![
            Species {
                radius: 0.5,
                fraction: 0.5,
            },
            Species {
                radius: 0.7,
                fraction: 0.5,
            },
        ])
    }
}

/// Where the centres come from.
///
/// ```
/// assert_eq!(softjam::scene::Start::default(), softjam::scene::Start::Random);
/// ```
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub enum Start {
    /// Uniformly random centres, then relaxed as undeformed disks.
    #[default]
    Random,
    /// A hexagonal lattice that fits the box exactly, its aspect the nearest possible to the one asked for.
    Hexagonal,
    /// A CSV file; see [`start::read_csv`]. It brings radii and box with it.
    File {
        /// Path of the file; `-` is standard input.
        path: String,
        /// BLAKE3 of the file in hexadecimal; if given, the file must match.
        blake3: Option<String>,
        /// What is done to its packing before the run.
        preparation: Preparation,
    },
}

/// What is done to the packing of a start file before its run.
///
/// ```
/// use softjam::scene::{Preparation, Scene, Start};
/// let scene = Scene::from_toml("file = \"mine.csv\"\ndisks.relax = true").unwrap();
/// assert!(matches!(scene.start, Start::File { preparation: Preparation::Relaxed, .. }));
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Preparation {
    /// Nothing: the run begins with the packing as it stands, and particles that stand on one point are refused.
    #[default]
    AsItStands,
    /// Particles that stand on one point are put beside each other; see [`start::StartFile::prepared`].
    Separated,
    /// So are they here, and then the undeformed disks are relaxed, as those of a random start.
    Relaxed,
}

/// Which minimiser relaxes the packing.
///
/// ```
/// assert_eq!(softjam::scene::Minimizer::default(), softjam::scene::Minimizer::Fire);
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Minimizer {
    /// FIRE 2.0, see [`crate::minimize::fire`].
    #[default]
    Fire,
    /// FIRE through the rearrangements, then Newton's method, see [`crate::minimize::newton`].
    #[serde(rename = "fire+newton")]
    FireNewton,
}

/// Everything that a run depends on.
///
/// # Example
///
/// ```
/// use softjam::scene::{Radii, Scene, Species};
///
/// let scene = Scene {
///     particles: 100,
///     radii: Radii::Species(vec![Species { radius: 0.5, fraction: 1.0 }]),
///     ..Scene::default()
/// };
/// scene.validate().unwrap();
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Scene {
    /// Number of particles `N`, 1…10 000 000. Default 256. Not used by a start from a file.
    pub particles: usize,
    /// Coverage `φ = Σ π R_i² / (L_x L_y)` of the *undeformed* disks, `0 < φ < 1.3`. Default 0.86. Not used by a start
    /// from a file.
    pub phi: f64,
    /// Aspect `L_x / L_y` of the box, 0.1…10. Default 1. Not used by a start from a file.
    pub aspect: f64,
    /// Undeformed radii. Not used by a start from a file.
    pub radii: Radii,
    /// Where the centres come from. Default random.
    pub start: Start,
    /// Seed of the ChaCha8 generator behind random starts and continuous radii, any u64. Default 1.
    pub seed: u64,
    /// Line tension γ (force), 1e-100…1e100. Default 1, which makes γ the unit of force.
    pub line_tension: f64,
    /// The run has converged when `f_max` (in units of γ) is not above this; positive. Default 1e-10. FIRE alone comes down to
    /// about 1e-12, [`Minimizer::FireNewton`] to 1e-13 and below, both at the default contact tolerance.
    pub threshold: f64,
    /// The run ends at this step in any case. Default 200 000.
    pub steps: u64,
    /// The model of the particles. Default Morse–Witten droplets.
    pub model: Kind,
    /// The minimiser.
    pub minimizer: Minimizer,
    /// The forces that move the particles. Default central.
    pub forces: Form,
    /// Upper bound of the minimiser's time step (time, mass 1), positive. Default: from the largest frequency at the
    /// start.
    pub dt_max: Option<f64>,
    /// How the contact list follows the positions.
    pub contact_rule: Rule,
    /// How `A f = δ` is solved.
    pub contact_solver: Method,
    /// Residual `max |A f − δ|` relative to the largest overlap to which it is solved, 1e-14…1e-6. Default 1e-12.
    pub contact_tolerance: f64,
    /// Parameters of FIRE.
    pub fire: Fire,
    /// The relaxation of the undeformed disks.
    pub disks: DiskParameters,
    /// How contours become polygons.
    pub contours: ContourStyle,
    /// What is recorded, and at which steps.
    pub channels: Channels,
    /// What is done to the box behind the relaxation. Default nothing.
    pub protocol: Vec<Stage>,
}

impl Default for Scene {
    fn default() -> Self {
        Self {
            particles: 256,
            phi: 0.86,
            aspect: 1.0,
            radii: Radii::default(),
            start: Start::default(),
            seed: 1,
            line_tension: 1.0,
            threshold: 1e-10,
            steps: 200_000,
            model: Kind::default(),
            minimizer: Minimizer::default(),
            forces: Form::default(),
            dt_max: None,
            contact_rule: Rule::default(),
            contact_solver: Method::default(),
            contact_tolerance: 1e-12,
            fire: Fire::default(),
            disks: DiskParameters::default(),
            contours: ContourStyle::default(),
            channels: Channels::default(),
            protocol: Vec::new(),
        }
    }
}

/// Why a scene makes no sense.
///
/// ```
/// use softjam::scene::{Scene, SceneError};
/// let error = Scene { phi: 1.7, ..Scene::default() }.validate().unwrap_err();
/// assert!(matches!(&error, SceneError::Range { field, .. } if field == "phi"));
/// assert!(error.to_string().starts_with("phi = 1.7 is outside"), "{error}");
/// ```
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SceneError {
    /// A field is out of its range.
    #[error("{} = {} is outside {allowed}", shown(.field), shown(.value))]
    Range {
        /// The field, as it is called in the scene file.
        field: String,
        /// Its value.
        value: String,
        /// What is allowed, and what the field means.
        allowed: String,
    },
    /// Two fields contradict each other.
    #[error("{field} = {} cannot be given together with {}: {why}", shown(.value), shown(.with))]
    Conflict {
        /// The field.
        field: String,
        /// Its value.
        value: String,
        /// The other field.
        with: String,
        /// Why not.
        why: String,
    },
    /// A field makes no sense without another.
    #[error("{field} = {} needs {needs}", shown(.value))]
    Needs {
        /// The field.
        field: String,
        /// Its value.
        value: String,
        /// What it needs.
        needs: String,
    },
    /// The text is not a scene: a misspelt field, a value of the wrong kind, broken TOML.
    #[error("not a scene:\n{}", each_line(.0))]
    Toml(#[from] toml::de::Error),
    /// It is no text that could be a scene.
    #[error("not a scene: {}", shown(.problem))]
    Text {
        /// What is wrong with it.
        problem: String,
    },
    /// The box is so small that disks could touch two images of each other.
    #[error(
        "particles = {particles} with phi = {phi} and aspect = {aspect} give a box of {length_x:.4} × {length_y:.4}, \
         in which disks of the largest radius {largest_radius} could touch two images of each other; take more particles, a \
         lower phi or an aspect nearer to 1"
    )]
    BoxTooSmall {
        /// Number of particles.
        particles: usize,
        /// Coverage.
        phi: f64,
        /// Aspect.
        aspect: f64,
        /// Side `L_x`.
        length_x: f64,
        /// Side `L_y`.
        length_y: f64,
        /// Largest undeformed radius.
        largest_radius: f64,
    },
    /// The scene would need more memory than there is.
    #[error(
        "particles = {particles} needs about {needed_mib} MiB of memory, of which {available_mib} MiB are available: take fewer particles"
    )]
    Memory {
        /// Number of particles.
        particles: usize,
        /// Estimate of the memory needed, in MiB.
        needed_mib: u64,
        /// Memory available, in MiB.
        available_mib: u64,
    },
    /// The start file is not a packing.
    #[error("start file {}{}: {}", shown(.path), at_line(*line), lines(.problem))]
    StartFile {
        /// Path of the file.
        path: String,
        /// Line in the file, counted from 1; 0 for the file as a whole.
        line: u64,
        /// What is wrong and what is expected.
        problem: String,
    },
    /// A file could not be read.
    #[error("cannot read {}: {source}", shown(.path))]
    Read {
        /// Path of the file.
        path: String,
        /// The system's reason.
        source: std::io::Error,
    },
}

/// The lines of a message that quotes a file.
fn each_line(error: &toml::de::Error) -> String {
    let text = error.to_string();
    let lines: Vec<String> = text.lines().map(shown).collect();
    lines.join("\n")
}

fn at_line(line: u64) -> String {
    if line == 0 {
        String::new()
    } else {
        format!(", line {line}")
    }
}

impl Scene {
    /// The scene that a TOML text describes; what it does not name has its default. Validated.
    ///
    /// # Errors
    ///
    /// [`SceneError`] names the first field that is wrong, its value and what is allowed.
    pub fn from_toml(text: &str) -> Result<Self, SceneError> {
        SceneFields::from_toml(text)?.into_scene()
    }

    /// The scene with the BLAKE3 of its start file filled in, so that it names its content and not only its path.
    ///
    /// # Errors
    ///
    /// [`SceneError::Read`] if the start file cannot be read.
    pub fn pinned(mut self) -> Result<Self, SceneError> {
        if let Start::File {
            path,
            blake3: hash @ None,
            ..
        } = &mut self.start
        {
            *hash = Some(start::StartFile::read(&*path)?.blake3());
        }
        Ok(self)
    }

    /// Whether particles, radii and box come from a file.
    #[must_use]
    pub fn starts_from_file(&self) -> bool {
        matches!(self.start, Start::File { .. })
    }

    /// The model that the scene asks for, with nothing solved yet.
    #[must_use]
    pub fn model(&self) -> AnyModel {
        match self.model {
            Kind::Disks => AnyModel::Disks(Box::new(Disks::new(self.line_tension))),
            Kind::RoundedPolygon => self.foam(Films::Straight),
            Kind::WetFoam => self.foam(Films::Arcs),
            Kind::MorseWitten => {
                AnyModel::MorseWitten(Box::new(MorseWitten::new(self.contact_law(), self.forces)))
            }
        }
    }

    fn foam(&self, films: Films) -> AnyModel {
        let foam = Foam::new(films, self.line_tension, self.contact_tolerance);
        AnyModel::Foam(Box::new(foam))
    }

    /// The contact law of droplets that the scene asks for.
    #[must_use]
    pub fn contact_law(&self) -> ContactLaw {
        ContactLaw::new(
            self.contact_rule,
            self.contact_solver,
            self.line_tension,
            self.contact_tolerance,
        )
    }

    /// BLAKE3 of [`to_toml`](Self::to_toml): the identity of the scene.
    #[must_use]
    pub fn digest(&self) -> [u8; 32] {
        *blake3::hash(self.to_toml().as_bytes()).as_bytes()
    }
}
