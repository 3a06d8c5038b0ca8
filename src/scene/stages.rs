//! What is done to the box behind the first relaxation: the stages of a protocol.
//!
//! See the example of [`Stage`].

use super::SceneError;

/// One stage of a protocol: what is done, and how well each of its states is relaxed.
///
/// ```
/// use softjam::scene::{Act, Scene};
///
/// let scene = Scene::from_toml("[[protocol]]\nact = 'compress'\nphi = 0.9\n[[protocol]]\nact = 'shear'\nstrain = 0.01").unwrap();
/// assert!(matches!(scene.protocol[0].act, Act::Compress { .. }));
/// assert_eq!(scene.protocol[1].steps, 20_000);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stage {
    /// What is done.
    pub act: Act,
    /// Each state is relaxed until `f_max` (units of γ) is not above this; that of the scene where nothing is said, but 1e-11 for a search of φ_J.
    pub threshold: f64,
    /// A state that is not relaxed after so many steps ends the run.
    pub steps: u64,
}

/// What a stage does. See the example of [`Stage`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Act {
    /// Nothing but relax, as far as the stage says.
    Relax,
    /// Changes the coverage in steps, positions scaled with the box, and relaxes behind each.
    Compress {
        /// Where it ends.
        until: Until,
        /// How far a step goes.
        by: Increment,
    },
    /// Finds φ_J, the coverage at which this packing's pressure vanishes.
    Jam {
        /// How.
        way: Way,
        /// The search ends when the pressure (γ/length) is not above this, or, between a jammed and an unjammed state, when these are so
        /// near in coverage.
        end: f64,
    },
    /// Shears in steps, positions moved with the box, and relaxes behind each.
    Shear {
        /// Simple or pure.
        mode: Shear,
        /// How far (strain); to the other side if it is negative.
        strain: f64,
        /// How far a step goes (strain, positive).
        step: f64,
        /// How often it then goes back by twice the strain, and forth: 0 for one way only.
        cycles: u32,
    },
}

/// Where a compression ends; it is a decompression if that is below where it begins.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Until {
    /// At a coverage.
    Phi(f64),
    /// At a pressure (γ/length), to one part in a million.
    Pressure(f64),
}

/// How far a step of a compression goes (positive).
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Increment {
    /// By so much of coverage.
    Absolute(f64),
    /// By such a part of the coverage.
    Relative(f64),
}

/// How φ_J is looked for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Way {
    /// By decompressing so that the pressure halves, and extrapolation to none.
    #[default]
    Halving,
    /// By bisection, from jammed states.
    Above,
    /// By bisection, from unjammed states.
    Below,
}

/// The kinds of shear.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Shear {
    /// The upper period of the box moves along x: Lees and Edwards.
    #[default]
    Simple,
    /// The box becomes longer along x and shorter along y, by the exponential of the strain.
    Pure,
}

impl Act {
    /// Its word in scenes.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Relax => "relax",
            Self::Compress { .. } => "compress",
            Self::Jam { .. } => "jam",
            Self::Shear { .. } => "shear",
        }
    }
}

/// A table `[[protocol]]` of a scene file.
///
/// ```
/// let fields = softjam::scene::SceneFields::from_toml("[[protocol]]\nact = 'jam'").unwrap();
/// assert_eq!(fields.protocol.unwrap()[0].act.as_deref(), Some("jam"));
/// ```
#[derive(Clone, Debug, Default, PartialEq, serde::Deserialize)]
#[serde(default, deny_unknown_fields)]
#[expect(
    missing_docs,
    reason = "the fields are those of Stage and Act, where they are documented"
)]
pub struct StageFields {
    pub act: Option<String>,
    pub threshold: Option<f64>,
    pub steps: Option<u64>,
    pub phi: Option<f64>,
    pub pressure: Option<f64>,
    pub step: Option<f64>,
    pub relative_step: Option<f64>,
    pub way: Option<Way>,
    pub end: Option<f64>,
    pub mode: Option<Shear>,
    pub strain: Option<f64>,
    pub cycles: Option<u32>,
}

/// Steps that a state of a stage may take.
const STEPS: u64 = 20_000;

/// Stages that a protocol may have.
pub(super) const MOST: usize = 1000;

impl StageFields {
    /// The stage number `k`, counted from 1, of a scene whose threshold is given.
    pub(super) fn stage(&self, k: usize, threshold: f64) -> Result<Stage, SceneError> {
        let act = self.act.as_deref().unwrap_or_default();
        let field = |name: &str| format!("protocol.{name} of stage {k}");
        let missing = |name: &str, needs: &str| SceneError::Needs {
            field: field("act"),
            value: format!("\"{act}\""),
            needs: format!("{name}: {needs}"),
        };
        let found = match act {
            "relax" => Act::Relax,
            "compress" | "decompress" => {
                let until = match (self.phi, self.pressure) {
                    (Some(phi), None) => Until::Phi(phi),
                    (None, Some(pressure)) => Until::Pressure(pressure),
                    _ => {
                        return Err(missing(
                            "phi or pressure",
                            "the coverage or the pressure at which it ends",
                        ));
                    }
                };
                let by = match (self.step, self.relative_step) {
                    (step, None) => Increment::Absolute(step.unwrap_or(1e-3)),
                    (None, Some(step)) => Increment::Relative(step),
                    _ => {
                        return Err(missing(
                            "one step",
                            "step (of coverage) or relative_step, not both",
                        ));
                    }
                };
                Act::Compress { until, by }
            }
            "jam" => Act::Jam {
                way: self.way.unwrap_or_default(),
                end: self.end.unwrap_or(match self.way.unwrap_or_default() {
                    Way::Halving => 1e-5,
                    Way::Above | Way::Below => 1e-6,
                }),
            },
            "shear" => Act::Shear {
                mode: self.mode.unwrap_or_default(),
                strain: (self.strain).ok_or_else(|| missing("strain", "how far it goes"))?,
                step: self.step.unwrap_or(1e-3),
                cycles: self.cycles.unwrap_or(0),
            },
            other => {
                return Err(SceneError::Range {
                    field: field("act"),
                    value: format!("\"{other}\""),
                    allowed: "the acts that there are: \"relax\", \"compress\", \"decompress\", \"jam\", \"shear\"".into(),
                });
            }
        };
        let taken: &[&str] = match found {
            Act::Relax => &[],
            Act::Compress { .. } => &["phi", "pressure", "step", "relative_step"],
            Act::Jam { .. } => &["way", "end"],
            Act::Shear { .. } => &["mode", "strain", "step", "cycles"],
        };
        let given = [
            ("phi", self.phi.is_some()),
            ("pressure", self.pressure.is_some()),
            ("step", self.step.is_some()),
            ("relative_step", self.relative_step.is_some()),
            ("way", self.way.is_some()),
            ("end", self.end.is_some()),
            ("mode", self.mode.is_some()),
            ("strain", self.strain.is_some()),
            ("cycles", self.cycles.is_some()),
        ];
        if let Some((name, _)) = given.iter().find(|(name, is)| *is && !taken.contains(name)) {
            return Err(SceneError::Conflict {
                field: field(name),
                value: "…".into(),
                with: format!("act = \"{act}\""),
                why: format!(
                    "it has {}",
                    if taken.is_empty() {
                        "no field of its own".to_owned()
                    } else {
                        taken.join(", ")
                    }
                ),
            });
        }
        let threshold = self.threshold.unwrap_or(match found {
            Act::Jam { .. } => threshold.min(1e-11),
            Act::Relax | Act::Compress { .. } | Act::Shear { .. } => threshold,
        });
        let steps = self.steps.unwrap_or(match found {
            Act::Jam { .. } => 5 * STEPS,
            Act::Relax | Act::Compress { .. } | Act::Shear { .. } => STEPS,
        });
        let stage = Stage {
            act: found,
            threshold,
            steps,
        };
        stage.validate(k)?;
        Ok(stage)
    }
}

impl Stage {
    /// Whether it makes sense as stage `k`, counted from 1.
    pub(super) fn validate(&self, k: usize) -> Result<(), SceneError> {
        let within = |name: &str, value: f64, holds: bool, allowed: &str| {
            if holds {
                return Ok(());
            }
            Err(SceneError::Range {
                field: format!("protocol.{name} of stage {k}"),
                value: value.to_string(),
                allowed: allowed.into(),
            })
        };
        let positive = |x: f64| x > 0.0 && x.is_finite();
        within(
            "threshold",
            self.threshold,
            positive(self.threshold),
            "threshold > 0 (units of γ)",
        )?;
        within("steps", self.steps as f64, self.steps > 0, "steps ≥ 1")?;
        match self.act {
            Act::Relax => Ok(()),
            Act::Compress { until, by } => {
                match until {
                    Until::Phi(phi) => within(
                        "phi",
                        phi,
                        phi > 0.0 && phi < 1.3,
                        "0 < phi < 1.3 (coverage)",
                    )?,
                    Until::Pressure(p) => within(
                        "pressure",
                        p,
                        p >= 1e-9 && p.is_finite(),
                        "pressure ≥ 1e-9 (γ/length)",
                    )?,
                }
                match by {
                    Increment::Absolute(d) => within(
                        "step",
                        d,
                        (1e-9..=0.1).contains(&d),
                        "1e-9 ≤ step ≤ 0.1 (coverage)",
                    ),
                    Increment::Relative(d) => within(
                        "relative_step",
                        d,
                        (1e-9..=0.1).contains(&d),
                        "1e-9 ≤ relative_step ≤ 0.1",
                    ),
                }
            }
            Act::Jam { end, .. } => within(
                "end",
                end,
                (1e-9..=1e-2).contains(&end),
                "1e-9 ≤ end ≤ 1e-2 (γ/length, or coverage)",
            ),
            Act::Shear { strain, step, .. } => {
                within(
                    "strain",
                    strain,
                    strain != 0.0 && strain.abs() <= 1e3,
                    "a strain of 1e3 at most, not 0",
                )?;
                within(
                    "step",
                    step,
                    (1e-9..=0.1).contains(&step),
                    "1e-9 ≤ step ≤ 0.1 (strain)",
                )
            }
        }
    }
}
