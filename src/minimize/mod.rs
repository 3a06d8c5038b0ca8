//! Minimisers: what moves the particles towards balance. Each has its own numbers, which a frame carries under its name.
//!
//! See the example of [`fire::Fire`].

pub mod fire;
mod mover;
pub mod newton;

pub(crate) use mover::{Motion, Mover};

use crate::state::Numbers;
use fire::FireState;

/// The numbers of a minimiser as they were recorded, of the first format without a name; `None` if they are those of none.
#[cfg(feature = "recording")]
pub(crate) fn recorded(name: Option<&str>, values: &[f64]) -> Option<Numbers> {
    let numbers = FireState::from_values(values)?.numbers();
    name.is_none_or(|name| name == numbers.name())
        .then_some(numbers)
}

/// Time step and simulated time (time) in the numbers of a minimiser.
pub(crate) fn dt_and_time(numbers: &Numbers) -> (f64, f64) {
    FireState::of(numbers).map_or((0.0, 0.0), |state| (state.dt, state.time))
}

/// What number `k` of a minimiser is.
#[cfg(feature = "recording")]
pub(crate) fn name_of(k: usize) -> &'static str {
    FireState::NAMES.get(k).unwrap_or(&"value")
}
