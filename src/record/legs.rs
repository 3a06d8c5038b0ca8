//! What a run went by before its scene was changed on the way.

use crate::models::Kind;
use crate::models::droplet::Form;
use crate::scene::{Minimizer, Scene};

/// A stretch of a run up to a step at which it was taken up with another model, threshold, minimiser or form of the forces.
///
/// ```
/// use softjam::{record::Leg, scene::Scene};
///
/// let rough = Scene { threshold: 1e-4, ..Scene::default() };
/// let leg = Leg::of(&rough, 300);
/// assert!(leg.changes(&Scene::default()));
/// assert_eq!(leg.scene(&Scene::default()).threshold, 1e-4);
/// ```
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Leg {
    /// The step at which the next one begins.
    pub until: u64,
    /// Its threshold (units of γ).
    pub threshold: f64,
    /// Its minimiser.
    pub minimizer: Minimizer,
    /// Its forces.
    pub forces: Form,
    /// Its model; that of the scene where none is named.
    pub model: Option<Kind>,
}

impl Leg {
    /// The stretch of a run of `scene` up to a step.
    #[must_use]
    pub fn of(scene: &Scene, until: u64) -> Self {
        Self {
            until,
            threshold: scene.threshold,
            minimizer: scene.minimizer,
            forces: scene.forces,
            model: Some(scene.model),
        }
    }

    /// The leg in a run whose scene was of `model` so far.
    #[must_use]
    pub fn of_model(self, model: Kind) -> Self {
        Self {
            model: self.model.or(Some(model)),
            ..self
        }
    }

    /// Whether a run of `scene` has other frames.
    #[must_use]
    pub fn changes(&self, scene: &Scene) -> bool {
        self.of_model(scene.model) != Self::of(scene, self.until)
    }

    /// The scene of the stretch in a run that ends as one of `scene`, without its step limit.
    #[must_use]
    pub fn scene(&self, scene: &Scene) -> Scene {
        Scene {
            threshold: self.threshold,
            minimizer: self.minimizer,
            forces: self.forces,
            model: self.model.unwrap_or(scene.model),
            steps: u64::MAX,
            ..scene.clone()
        }
    }
}

/// The stretches as they stand in a file.
#[derive(serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
struct Text {
    leg: Vec<Leg>,
}

/// More than anybody changes a run; each takes as long as a step.
const MOST: usize = 1000;

/// The stretches as TOML; nothing if there are none.
pub(crate) fn to_text(legs: &[Leg]) -> std::io::Result<Option<String>> {
    if legs.is_empty() {
        return Ok(None);
    }
    let leg = legs.to_vec();
    let text = toml::to_string(&Text { leg }).map_err(std::io::Error::other)?;
    Ok(Some(text))
}

/// The stretches that a file names, of a recording that begins with step `from_step`, or what is wrong with them.
pub(crate) fn from_text(text: &str, from_step: u64) -> Result<Vec<Leg>, String> {
    let Text { leg: legs } = toml::from_str(text).map_err(|e| e.message().to_owned())?;
    let ends = legs.iter().map(|leg| leg.until).chain([from_step]);
    let sensible = |leg: &Leg| leg.threshold.is_finite() && leg.threshold > 0.0;
    if legs.len() > MOST {
        return Err(format!(
            "its scene was changed {} times, which no run is",
            legs.len()
        ));
    }
    if !ends.is_sorted() || !legs.iter().all(sensible) {
        return Err("its earlier scenes are out of order or range".to_owned());
    }
    Ok(legs)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn legs_come_back_as_they_went_and_none_that_no_run_can_have() {
        let scene = Scene {
            threshold: 0.1 + 0.2,
            minimizer: Minimizer::FireNewton,
            ..Scene::default()
        };
        let legs = [
            Leg::of(&Scene::default(), 7),
            Leg::of(&scene, 7),
            Leg::of(&scene, 9),
        ];
        let text = to_text(&legs).unwrap().unwrap();
        assert_eq!(from_text(&text, 9), Ok(legs.to_vec()));
        // Those of older recordings name no model.
        let older = text.replace("model = \"morse-witten\"\n", "");
        let read = from_text(&older, 9).unwrap();
        assert!(read[0].model.is_none() && read[0].of_model(Kind::MorseWitten) == legs[0]);
        assert_eq!(read[1].scene(&scene).model, scene.model);
        assert_eq!(to_text(&[]).unwrap(), None);
        assert!(from_text(&text, 8).is_err(), "behind the first step");
        let swapped = to_text(&[legs[2], legs[0]]).unwrap().unwrap();
        assert!(from_text(&swapped, 9).is_err(), "not in order");
        for threshold in [f64::NAN, -1.0, 0.0, f64::INFINITY] {
            let bad = Leg {
                threshold,
                ..legs[0]
            };
            let text = to_text(&[bad]).unwrap().unwrap();
            assert!(from_text(&text, 9).is_err(), "{threshold}");
        }
        assert!(from_text("leg = 3", 9).is_err());
        let many = to_text(&vec![legs[0]; MOST + 1]).unwrap().unwrap();
        assert!(from_text(&many, 9).is_err());
    }
}
