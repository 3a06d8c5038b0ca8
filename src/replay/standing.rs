//! How a recorded run stood at the end of its file.

use core::fmt;

/// How a recorded run stood at the end of its file.
///
/// ```
/// use softjam::replay::Standing;
/// assert_eq!(Standing::StepLimit.to_string(), "step-limit");
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Standing {
    /// It has converged.
    Converged,
    /// It has come to its step limit.
    StepLimit,
    /// Its writer ended it in order, before the run had a result.
    Interrupted,
    /// The file breaks off, or has no result and was rewritten by another program: nobody knows what came behind it.
    BrokenOff,
}

impl Standing {
    /// The standing of a file with such an end.
    pub(super) fn of(closed: bool, of_softjam: bool, converged: Option<bool>) -> Self {
        match converged {
            _ if !closed => Self::BrokenOff,
            Some(true) => Self::Converged,
            Some(false) => Self::StepLimit,
            None if of_softjam => Self::Interrupted,
            // Programs that recover a file that was cut close it.
            None => Self::BrokenOff,
        }
    }
}

/// In one word, for scripts.
impl fmt::Display for Standing {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Converged => "converged",
            Self::StepLimit => "step-limit",
            Self::Interrupted => "interrupted",
            Self::BrokenOff => "broken-off",
        })
    }
}
