//! Where a run begins: at a scene, at the packing of a start file, or at a recorded frame.

use crate::cli::memory::MemoryFlag;
use crate::cli::{needs, out_of_range, state_at, warn};
use softjam::BITS;
use softjam::budget::Budget;
use softjam::protocol::{Relaxation, Status};
use softjam::record::Leg;
use softjam::replay::Recording;
use softjam::scene::start::StartFile;
use softjam::scene::{Scene, SceneError, SceneFields, Start};
use softjam::state::{Frame, Packing};
use softjam::text::shown;
use std::path::Path;

/// Where a run begins.
pub(super) struct Origin {
    pub(super) scene: Scene,
    /// What a run that goes on went by before.
    pub(super) legs: Vec<Leg>,
    first: First,
}

/// What a run begins with.
enum First {
    /// What the scene gives.
    Scene,
    /// The packing of a start file, its disks not yet relaxed.
    File(Packing),
    /// A recorded frame.
    Frame {
        packing: Packing,
        frame: Box<Frame>,
        /// The scene before, if it is changed at the frame.
        before: Option<Box<Scene>>,
    },
}

impl Origin {
    /// Where a run of a scene begins; its start file is read here, and only here, since it may be a pipe. `file` is the name
    /// of the start file as it was given: no scene holds one that is not UTF-8.
    pub(super) fn of_scene(
        scene: Scene,
        file: Option<&Path>,
        budget: Budget,
    ) -> anyhow::Result<Self> {
        let begins = |scene, first| Self {
            scene,
            legs: Vec::new(),
            first,
        };
        let Start::File {
            path,
            blake3,
            preparation,
        } = &scene.start
        else {
            return Ok(begins(scene, First::Scene));
        };
        let file = StartFile::read_within(file.unwrap_or(Path::new(path)), budget)?;
        let start = file.start(blake3.as_deref(), *preparation)?;
        let (packing, coincidences) = file.prepared(*preparation)?;
        if let Some(first) = coincidences.first() {
            let (count, of) = (coincidences.len(), packing.len());
            warn(&format!(
                "particles of one point are put beside each other, {count} of {of}; the first: {first}"
            ));
        }
        Ok(begins(Scene { start, ..scene }, First::File(packing)))
    }

    /// The recorded frame to go on from, the last unless a step is named; `over` changes its scene.
    pub(super) fn of_recording(
        path: &Path,
        step: Option<u64>,
        over: impl FnOnce(SceneFields) -> anyhow::Result<Scene>,
        budget: Budget,
    ) -> anyhow::Result<Self> {
        let mut recording = Recording::open_within(path, budget)?;
        let from = |what: String| needs("from", path.display(), what);
        if !recording.has_same_bits() {
            let (bits, program) = (recording.bits(), shown(recording.program()));
            return Err(from(format!(
                "a recording with bits {BITS}, as this program computes; it has bits {bits}, and {program} can go on from it"
            )));
        }
        let scene = over(SceneFields::from_toml(&recording.scene().to_toml())?)?;
        let frame = state_at(&mut recording, step)?;
        match (frame, step) {
            (Some(frame), step) if step.is_none_or(|k| k == frame.step) => {
                Self::of_frame(&recording, scene, frame)
            }
            (None, None) if recording.is_closed() => Err(from(
                "a recorded state, which only a recording with --channels state,… has".to_owned(),
            )),
            (None, None) => Err(from(
                "a recorded state, and breaks off before the first".to_owned(),
            )),
            (found, step) => {
                let allowed = match found {
                    Some(last) => {
                        format!(
                            "the recorded states; the nearest before it is {}",
                            last.step
                        )
                    }
                    None => "the recorded states, of which there is none before it".to_owned(),
                };
                Err(out_of_range("step", step.unwrap_or_default(), allowed))
            }
        }
    }

    fn of_frame(recording: &Recording, scene: Scene, frame: Frame) -> anyhow::Result<Self> {
        let packing = recording.packing(&frame)?;
        let leg = Leg::of(recording.scene(), frame.step);
        let changed = leg.changes(&scene);
        let legs = recording
            .legs()
            .iter()
            .map(|leg| leg.of_model(recording.scene().model));
        let legs = legs.chain(changed.then_some(leg)).collect();
        let done = frame.stage.saturating_sub(u32::from(scene.records_disks()));
        let of = |scene: &Scene| scene.protocol.get(..done as usize).map(<[_]>::to_vec);
        if of(&scene) != of(recording.scene()) {
            let what = format!(
                "the protocol that its run has followed to step {}: go on without flags of another, or from a --step in front of it",
                frame.step
            );
            return Err(needs("from", shown(recording.path()), what));
        }
        if scene.steps < frame.step && done == 0 {
            let allowed = format!("steps ≥ {}, the step that the run goes on from", frame.step);
            return Err(out_of_range("steps", scene.steps, allowed));
        }
        let frame = Box::new(frame);
        let first = First::Frame {
            packing,
            frame,
            before: changed.then(|| Box::new(recording.scene().clone())),
        };
        Ok(Self { scene, legs, first })
    }

    /// Refuses a scene that would bring the machine down instead of relaxing.
    pub(super) fn fits_in_memory(&self, memory: &MemoryFlag) -> Result<(), SceneError> {
        let particles = match &self.first {
            First::File(packing) | First::Frame { packing, .. } => packing.len(),
            First::Scene => self.scene.particles,
        };
        let needed = self.scene.memory_estimate(particles);
        // Where the system does not tell, it is asked the hard way.
        match memory.free() {
            Some(available) if needed > available => Err(SceneError::Memory {
                particles,
                needed_mib: needed >> 20,
                available_mib: available >> 20,
            }),
            _ => Ok(()),
        }
    }

    pub(super) fn run(self) -> anyhow::Result<Relaxation> {
        let scene = &self.scene;
        let (packing, frame, before) = match self.first {
            First::Scene => return Ok(Relaxation::new(scene)?),
            First::File(packing) => return Ok(Relaxation::of_start(scene, packing)?),
            First::Frame {
                packing,
                frame,
                before,
            } => (packing, *frame, before),
        };
        let run = match before {
            Some(before) => Relaxation::take_over(&before, scene, packing, frame)?,
            None => Relaxation::resume(scene, packing, frame)?,
        };
        // Its replay would have nothing to run.
        if run.status() != Status::Running && scene.starts_from_file() {
            let what = "a run that goes on behind it: with this threshold and step limit it ends there; go on from an earlier --step";
            return Err(needs(
                "from",
                format!("step {}", run.step()),
                what.to_owned(),
            ));
        }
        Ok(run)
    }
}
