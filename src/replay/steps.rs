//! Which states a recording must hold, and in which order.

use crate::scene::{Scene, Schedule};

/// The order of the recorded states: what the schedule asks for, and one last frame that need not be on it.
pub(super) struct Steps {
    /// Of the first stage, and of those behind it.
    schedules: [Schedule; 2],
    first: u64,
    /// Step and stage of the last state that was accepted.
    last: Option<(u64, u32)>,
    off_schedule: bool,
    /// Whether there is a protocol, whose relaxed states are recorded at whatever step they are.
    any: bool,
}

impl Steps {
    /// Those of a recording of `scene` that begins with step `first`.
    pub fn new(scene: &Scene, first: u64) -> Self {
        Self {
            schedules: [scene.stage(0).channels.state, scene.channels.state],
            first,
            last: None,
            off_schedule: false,
            any: !scene.protocol.is_empty(),
        }
    }

    /// The step of the last state that was accepted.
    pub fn last(&self) -> Option<u64> {
        self.last.map(|(step, _)| step)
    }

    /// The next step that is asked for behind `step`, in the stage of the last state.
    fn after(&self, step: u64) -> Option<u64> {
        let stage = self.last.map_or(0, |(_, stage)| stage);
        self.schedules[stage.min(1) as usize].after(step)
    }

    /// Takes the state of a step, if it may come next.
    pub fn accept(&mut self, step: u64, stage: u32) -> Result<(), String> {
        let Some((last, before)) = self.last else {
            return if step == self.first {
                self.last = Some((step, stage));
                Ok(())
            } else {
                Err(format!(
                    "the first state is that of step {step}, not {}",
                    self.first
                ))
            };
        };
        if self.off_schedule || step <= last {
            return Err(format!("step {step} follows step {last}"));
        }
        let expected = self.after(last);
        if expected.is_some_and(|expected| step > expected) {
            return Err(format!(
                "the states between step {last} and step {step} are missing"
            ));
        }
        // The first state of a stage is on no schedule.
        self.off_schedule = expected != Some(step) && stage == before && !self.any;
        self.last = Some((step, stage));
        Ok(())
    }

    /// What is wrong with the order, by the steps of all states behind the last that was accepted; nothing if some are missing.
    pub fn order_behind(&self, mut steps: Vec<u64>) -> Option<String> {
        let (first, begins) = (steps.first().copied()?, self.first);
        let out_of_order = match self.last() {
            Some(last) => format!("its states are out of order: step {first} follows step {last}"),
            None => {
                format!(
                    "its states are out of order: the first is that of step {first}, not {begins}"
                )
            }
        };
        steps.sort_unstable();
        let all = steps.len();
        steps.dedup();
        let end = *steps.last()?;
        let mut expected = self.last().map_or(Some(begins), |last| self.after(last));
        while let Some(step) = expected.filter(|step| *step < end) {
            steps.binary_search(&step).ok()?;
            expected = self.after(step);
        }
        let seen = |step: &u64| self.last().is_some_and(|last| *step <= last);
        let twice = steps.len() < all || steps.iter().any(seen);
        Some(if twice {
            format!(
                "it holds several parts of one run, states of some steps more than once ({first} follows {}): give the files that it was \
                 made of to `softjam join`",
                self.last().unwrap_or(begins)
            )
        } else {
            out_of_order
        })
    }
}
