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

    /// What is wrong with the order, by the steps of all states behind the last that was accepted; nothing if some are missing.
    pub fn order_behind(&self, mut steps: Vec<u64>) -> Option<String> {
        let (first, begins) = (steps.first().copied()?, self.first);
        let out_of_order = match self.last {
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
        let mut expected = self
            .last
            .map_or(Some(begins), |last| self.schedule.after(last));
        while let Some(step) = expected.filter(|step| *step < end) {
            steps.binary_search(&step).ok()?;
            expected = self.schedule.after(step);
        }
        let seen = |step: &u64| self.last.is_some_and(|last| *step <= last);
        let twice = steps.len() < all || steps.iter().any(seen);
        Some(if twice {
            format!(
                "it holds several parts of one run, states of some steps more than once ({first} follows {}): give the files that it was \
                 made of to `softjam join`",
                self.last.unwrap_or(begins)
            )
        } else {
            out_of_order
        })
    }
}
