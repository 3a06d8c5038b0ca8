//! A scene with gaps: what a file or the flags say, before defaults are filled in.

use super::{
    Channels, DiskParameters, Minimizer, Preparation, Radii, Scene, SceneError, Schedule, Species,
    StageFields, Start,
};
use crate::minimize::fire::Fire;
use crate::models::Kind;
use crate::models::droplet::Form;
use crate::models::droplet::contact::Rule;
use crate::models::droplet::contact::solver::Method;
use crate::models::droplet::contour::ContourStyle;
use std::io::Read as _;
use std::path::Path;

/// The fields of a scene file, each of which may be missing. Whole numbers are signed here, so that a negative one is
/// answered with the allowed range.
///
/// # Example
///
/// ```
/// use softjam::scene::SceneFields;
///
/// let file = SceneFields::from_toml("particles = 64\nphi = 0.9").unwrap();
/// let flags = SceneFields { phi: Some(0.95), ..SceneFields::default() };
/// let scene = file.overridden_by(flags).into_scene().unwrap();
/// assert_eq!((scene.particles, scene.phi), (64, 0.95));
/// ```
#[derive(Clone, Debug, Default, PartialEq, serde::Deserialize)]
#[serde(default, deny_unknown_fields)]
#[expect(
    missing_docs,
    reason = "the fields are those of Scene, where they are documented"
)]
pub struct SceneFields {
    pub particles: Option<i128>,
    pub phi: Option<f64>,
    pub aspect: Option<f64>,
    pub species: Option<Vec<Species>>,
    pub spread: Option<Spread>,
    pub start: Option<String>,
    pub file: Option<String>,
    pub file_blake3: Option<String>,
    pub separate: Option<bool>,
    pub seed: Option<u64>,
    pub line_tension: Option<f64>,
    pub threshold: Option<f64>,
    pub steps: Option<i128>,
    pub model: Option<Kind>,
    pub minimizer: Option<Minimizer>,
    pub forces: Option<Form>,
    pub dt_max: Option<f64>,
    pub contact_rule: Option<Rule>,
    pub contact_solver: Option<Method>,
    pub contact_tolerance: Option<f64>,
    pub fire: Option<Fire>,
    pub disks: Option<DiskFields>,
    pub contours: Option<ContourStyle>,
    pub channels: Option<Channels>,
    pub protocol: Option<Vec<StageFields>>,
}

/// A continuous spread of radii as a scene file has it.
///
/// ```
/// let spread = softjam::scene::SceneFields::from_toml("spread = { min = 0.4, max = 0.6 }").unwrap().spread;
/// assert_eq!(spread.map(|s| s.max), Some(0.6));
/// ```
#[derive(Clone, Copy, Debug, PartialEq, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Spread {
    /// Smallest radius (length).
    pub min: f64,
    /// Largest radius (length).
    pub max: f64,
}

/// The table `[disks]` of a scene file.
///
/// ```
/// let disks = softjam::scene::SceneFields::from_toml("disks.relax = true").unwrap().disks.unwrap();
/// assert_eq!((disks.relax, disks.steps), (Some(true), None));
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct DiskFields {
    /// Whether the disks of a start file are relaxed first; those of other starts always are.
    pub relax: Option<bool>,
    /// See [`DiskParameters::threshold`].
    pub threshold: Option<f64>,
    /// See [`DiskParameters::steps`].
    pub steps: Option<u64>,
    /// See [`DiskParameters::record`].
    pub record: Option<Schedule>,
}

impl DiskFields {
    fn overridden_by(self, flags: Self) -> Self {
        Self {
            relax: flags.relax.or(self.relax),
            threshold: flags.threshold.or(self.threshold),
            steps: flags.steps.or(self.steps),
            record: flags.record.or(self.record),
        }
    }

    fn parameters(self) -> DiskParameters {
        let default = DiskParameters::default();
        DiskParameters {
            threshold: self.threshold.unwrap_or(default.threshold),
            steps: self.steps.unwrap_or(default.steps),
            record: self.record.unwrap_or(default.record),
        }
    }
}

impl SceneFields {
    /// The fields that a TOML text names.
    ///
    /// # Errors
    ///
    /// [`SceneError::Toml`] for a field that does not exist or a value of the wrong kind.
    pub fn from_toml(text: &str) -> Result<Self, SceneError> {
        Ok(toml::from_str(text)?)
    }

    /// The fields that a scene file names. No more of it is read than a scene may have.
    ///
    /// # Errors
    ///
    /// [`SceneError::Read`] if there is no such file, [`SceneError::Text`] if it is too long or not UTF-8, [`SceneError::Toml`] as
    /// [`from_toml`](Self::from_toml).
    ///
    /// ```
    /// use softjam::scene::SceneFields;
    ///
    /// let path = std::env::temp_dir().join("softjam-scene-read-example.toml");
    /// std::fs::write(&path, "phi = 0.9").unwrap();
    /// assert_eq!(SceneFields::read(&path).unwrap().phi, Some(0.9));
    /// std::fs::write(&path, b"phi = \xff").unwrap();
    /// let error = SceneFields::read(&path).unwrap_err();
    /// assert_eq!(error.to_string(), "not a scene: line 1: byte 6 is not UTF-8 text");
    /// # std::fs::remove_file(&path).unwrap();
    /// ```
    pub fn read(path: impl AsRef<Path>) -> Result<Self, SceneError> {
        let mut bytes = Vec::new();
        std::fs::File::open(path.as_ref())
            .and_then(|file| file.take(LONGEST_SCENE as u64 + 1).read_to_end(&mut bytes))
            .map_err(|source| SceneError::Read {
                path: path.as_ref().display().to_string(),
                source,
            })?;
        check_length(bytes.len())?;
        let text = str::from_utf8(&bytes).map_err(|error| {
            let at = error.valid_up_to();
            let line = bytes[..at].split(|b| *b == b'\n').count();
            SceneError::Text {
                problem: format!("line {line}: byte {at} is not UTF-8 text"),
            }
        })?;
        Self::from_toml(text)
    }

    /// The fields of the scene in a recording; what is wrong with it is told in one line.
    #[cfg(feature = "recording")]
    pub(crate) fn from_recording(text: &str) -> Result<Self, SceneError> {
        check_length(text.len())?;
        toml::from_str(text).map_err(|error| {
            let start = error.span().map_or(0, |span| span.start);
            let line = 1 + text.bytes().take(start).filter(|b| *b == b'\n').count();
            SceneError::Text {
                problem: format!("line {line}: {}", error.message()),
            }
        })
    }

    /// These fields, each replaced where `flags` has a value. Radii and start are replaced as a whole.
    #[must_use]
    pub fn overridden_by(mut self, flags: Self) -> Self {
        if flags.species.is_some() || flags.spread.is_some() {
            self.species = None;
            self.spread = None;
        }
        if flags.start.is_some() || flags.file.is_some() {
            self.start = None;
            self.file = None;
            self.file_blake3 = None;
        }
        let mut disks = self.disks.unwrap_or_default();
        if flags.start.is_some() && flags.file.is_none() {
            // What is done to the packing of a file goes with the file.
            self.separate = None;
            disks.relax = None;
        }
        let of_flags = flags.disks.unwrap_or_default();
        disks = disks.overridden_by(of_flags);
        if flags.file.is_some() && disks.relax != Some(true) {
            disks = of_flags;
        }
        self.disks = Some(disks);
        if flags.file.is_some() {
            // A start file brings these with it.
            self.particles = None;
            self.phi = None;
            self.aspect = None;
            self.species = None;
            self.spread = None;
            self.seed = None;
        }
        macro_rules! first_of {
            ($($field:ident),*) => { Self { $($field: flags.$field.or(self.$field)),*, disks: self.disks } };
        }
        first_of!(
            particles,
            phi,
            aspect,
            species,
            spread,
            start,
            file,
            file_blake3,
            separate,
            seed,
            line_tension,
            threshold,
            steps,
            model,
            minimizer,
            forces,
            dt_max,
            contact_rule,
            contact_solver,
            contact_tolerance,
            fire,
            contours,
            channels,
            protocol
        )
    }

    /// The scene, gaps filled with the defaults. Validated.
    ///
    /// # Errors
    ///
    /// [`SceneError`] names the field, its value and what is allowed.
    pub fn into_scene(self) -> Result<Scene, SceneError> {
        let start = self.start()?;
        let radii = self.radii()?;
        let default = Scene::default();
        let threshold = self.threshold.unwrap_or(default.threshold);
        let protocol = self.protocol.unwrap_or_default();
        let stages = (1..)
            .zip(&protocol)
            .map(|(k, stage)| stage.stage(k, threshold));
        let protocol = stages.collect::<Result<Vec<_>, _>>()?;
        let scene = Scene {
            particles: count("particles", self.particles, default.particles as u64, 1)? as usize,
            phi: self.phi.unwrap_or(default.phi),
            aspect: self.aspect.unwrap_or(default.aspect),
            radii,
            start,
            seed: self.seed.unwrap_or(default.seed),
            line_tension: self.line_tension.unwrap_or(default.line_tension),
            threshold,
            steps: count("steps", self.steps, default.steps, 0)?,
            model: self.model.unwrap_or_default(),
            minimizer: self.minimizer.unwrap_or_default(),
            forces: self.forces.unwrap_or_default(),
            dt_max: self.dt_max,
            contact_rule: self.contact_rule.unwrap_or_default(),
            contact_solver: self.contact_solver.unwrap_or_default(),
            contact_tolerance: self.contact_tolerance.unwrap_or(default.contact_tolerance),
            fire: self.fire.unwrap_or_default(),
            disks: self.disks.unwrap_or_default().parameters(),
            contours: self.contours.unwrap_or(default.contours),
            channels: self.channels.unwrap_or(if protocol.is_empty() {
                Channels::default()
            } else {
                Channels::of_protocols()
            }),
            protocol,
        };
        scene.validate()?;
        Ok(scene)
    }

    fn start(&self) -> Result<Start, SceneError> {
        let kind = match (&self.start, &self.file) {
            (None, Some(_)) => "file",
            (None, None) => "random",
            (Some(kind), _) => kind.as_str(),
        };
        let conflict = |field: &str, value: String, why: &str| SceneError::Conflict {
            field: field.into(),
            value,
            with: format!("start = \"{kind}\""),
            why: why.into(),
        };
        if let (Some(hash), None) = (&self.file_blake3, &self.file) {
            return Err(conflict(
                "file_blake3",
                format!("\"{hash}\""),
                "there is no start file that could have this hash",
            ));
        }
        let relax = self.disks.and_then(|disks| disks.relax);
        match (kind, &self.file) {
            ("random" | "hexagonal", Some(file)) => Err(conflict(
                "file",
                format!("\"{file}\""),
                "only start = \"file\" reads a file",
            )),
            ("random" | "hexagonal", None) if self.separate == Some(true) => Err(conflict(
                "separate",
                "true".into(),
                "only particles of a start file stand on one point",
            )),
            ("random" | "hexagonal", None) if relax == Some(false) => Err(conflict(
                "disks.relax",
                "false".into(),
                "its disks are always relaxed; disks.steps = 0 leaves them where they are",
            )),
            ("random", None) => Ok(Start::Random),
            ("hexagonal", None) => Ok(Start::Hexagonal),
            ("file", Some(path)) => {
                let numbers = [
                    ("particles", self.particles.map(|n| n.to_string())),
                    ("phi", self.phi.map(|x| x.to_string())),
                    ("aspect", self.aspect.map(|x| x.to_string())),
                    ("seed", self.seed.map(|x| x.to_string())),
                    ("species", self.species.as_ref().map(|_| "[…]".to_owned())),
                    ("spread", self.spread.map(|_| "{…}".to_owned())),
                ];
                if let Some((field, value)) =
                    numbers.into_iter().find_map(|(n, v)| v.map(|v| (n, v)))
                {
                    let why = "particles, radii and box come from the file";
                    return Err(conflict(field, value, why));
                }
                let preparation = match (relax, self.separate) {
                    (Some(true), _) => Preparation::Relaxed,
                    (_, Some(true)) => Preparation::Separated,
                    _ => Preparation::AsItStands,
                };
                let disks = self.disks.unwrap_or_default().parameters();
                if preparation != Preparation::Relaxed && disks != DiskParameters::default() {
                    return Err(conflict(
                        "disks",
                        "{…}".into(),
                        "a packing from a file is taken as it stands; leave [disks] out, or have its disks relaxed first with \
                         relax = true in [disks] (--relax-disks)",
                    ));
                }
                Ok(Start::File {
                    path: path.clone(),
                    blake3: self.file_blake3.clone(),
                    preparation,
                })
            }
            ("file", None) => Err(SceneError::Needs {
                field: "start".into(),
                value: "\"file\"".into(),
                needs: "the file: file = \"PACKING.csv\" (--file PACKING.csv)".into(),
            }),
            (other, _) => Err(SceneError::Range {
                field: "start".into(),
                value: format!("\"{other}\""),
                allowed: "the starts that there are: \"random\", \"hexagonal\", \"file\"".into(),
            }),
        }
    }

    fn radii(&self) -> Result<Radii, SceneError> {
        match (&self.species, self.spread) {
            (Some(_), Some(_)) => Err(SceneError::Conflict {
                field: "spread".into(),
                value: "{…}".into(),
                with: "species".into(),
                why: "radii are either a mixture or a continuous spread".into(),
            }),
            (Some(species), None) => Ok(Radii::Species(species.clone())),
            (None, Some(Spread { min, max })) => Ok(Radii::Spread { min, max }),
            (None, None) => Ok(Radii::default()),
        }
    }
}

/// Bytes of the longest scene; one with every field written out has some five thousand.
const LONGEST_SCENE: usize = 1 << 20;

fn check_length(bytes: usize) -> Result<(), SceneError> {
    if bytes <= LONGEST_SCENE {
        return Ok(());
    }
    let problem = format!("longer than {LONGEST_SCENE} bytes, which no scene is");
    Err(SceneError::Text { problem })
}

/// A whole number that may be missing; `least` is its lower bound.
fn count(field: &str, value: Option<i128>, default: u64, least: u64) -> Result<u64, SceneError> {
    match value {
        None => Ok(default),
        Some(n) => u64::try_from(n)
            .ok()
            .filter(|n| *n >= least)
            .ok_or_else(|| SceneError::Range {
                field: field.into(),
                value: n.to_string(),
                allowed: format!("{field} ≥ {least}"),
            }),
    }
}
