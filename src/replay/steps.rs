//! Which states a recording must hold, and in which order.

use crate::scene::Schedule;

/// The order of the recorded states: what the schedule asks for, and one last frame that need not be on it.
pub(super) struct Steps {
    pub schedule: Schedule,
    pub first: u64,
    pub last: Option<u64>,
    pub off_schedule: bool,
}

impl Steps {
    /// Whether `step` may come next.
    pub fn accept(&mut self, step: u64) -> Result<(), String> {
        let Some(last) = self.last else {
            return if step == self.first {
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
        let expected = self.schedule.after(last);
        if expected.is_some_and(|expected| step > expected) {
            return Err(format!(
                "the states between step {last} and step {step} are missing"
            ));
        }
        self.off_schedule = expected != Some(step);
        Ok(())
    }
}
