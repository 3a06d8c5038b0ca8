//! What is recorded, and at which steps.
//!
//! See the example of [`Schedule`].

use core::fmt;
use core::str::FromStr;

/// The steps at which a channel is recorded. The first and the last frame are recorded in any case, unless it is off.
///
/// # Example
///
/// ```
/// use softjam::scene::Schedule;
///
/// let schedule: Schedule = "every 10".parse().unwrap();
/// assert!(schedule.includes(20) && !schedule.includes(21));
/// let log: Schedule = "log 2".parse().unwrap();
/// let steps: Vec<u64> = (0..200).filter(|s| log.includes(*s)).collect();
/// assert_eq!(steps, [0, 1, 4, 10, 32, 100]);
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Schedule {
    /// Never: neither recorded nor computed.
    Off,
    /// Every `k`-th step, `k` ≥ 1.
    Every(u64),
    /// About this many steps a decade, 1…1000, equally spaced in the logarithm.
    Log(u32),
    /// The states of a protocol, relaxed: the last frame of each step of its strain.
    Relaxed,
}

impl Schedule {
    /// Whether `step` is one of the schedule's.
    #[must_use]
    pub fn includes(self, step: u64) -> bool {
        match self {
            Self::Off | Self::Relaxed => false,
            Self::Every(k) => step.is_multiple_of(k.max(1)),
            Self::Log(per_decade) => {
                // A step is the first one behind a mark 10^(m/n). The small shift keeps whole powers of ten on
                // their own side of rounding.
                let mark =
                    |s: u64| libm::floor(f64::from(per_decade) * libm::log10(s as f64) + 1e-9);
                step <= 1 || mark(step) > mark(step - 1)
            }
        }
    }

    /// The first step of the schedule behind `step`; `None` if there is none.
    #[must_use]
    pub fn after(self, step: u64) -> Option<u64> {
        match self {
            Self::Off | Self::Relaxed => None,
            Self::Every(k) => (step / k.max(1)).checked_add(1)?.checked_mul(k.max(1)),
            Self::Log(_) if step == 0 => Some(1),
            Self::Log(per_decade) => {
                // From just below the next mark; a step so large that marks are no whole steps has no successor.
                let n = f64::from(per_decade);
                let mark = libm::floor(n * libm::log10(step.max(1) as f64) + 1e-9);
                let next = libm::exp10((mark + 1.0) / n) as u64;
                let from = step.checked_add(1)?.max(next.saturating_sub(2));
                (from..from.saturating_add(1000)).find(|s| self.includes(*s))
            }
        }
    }

    /// Whether anything is recorded at all.
    #[must_use]
    pub fn is_on(self) -> bool {
        self != Self::Off
    }
}

impl fmt::Display for Schedule {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Off => write!(f, "off"),
            Self::Relaxed => write!(f, "relaxed"),
            Self::Every(k) => write!(f, "every {k}"),
            Self::Log(n) => write!(f, "log {n}"),
        }
    }
}

impl FromStr for Schedule {
    type Err = String;

    /// Reads `off`, `relaxed`, `every K` or `log K`; a colon may stand for the space.
    fn from_str(text: &str) -> Result<Self, String> {
        let allowed = || {
            format!(
                "`{text}` is not a schedule: write off, every K (K ≥ 1), log K (K a decade, 1…1000) or relaxed (the states of a protocol)"
            )
        };
        let mut words = text.split([' ', ':']).filter(|w| !w.is_empty());
        let schedule = match (words.next(), words.next(), words.next()) {
            (Some("off"), None, None) => Some(Self::Off),
            (Some("relaxed"), None, None) => Some(Self::Relaxed),
            (Some("every"), Some(k), None) => k.parse().ok().filter(|&k| k >= 1).map(Self::Every),
            (Some("log"), Some(n), None) => n
                .parse()
                .ok()
                .filter(|n| (1..=1000).contains(n))
                .map(Self::Log),
            _ => None,
        };
        schedule.ok_or_else(allowed)
    }
}

impl serde::Serialize for Schedule {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

impl<'de> serde::Deserialize<'de> for Schedule {
    fn deserialize<D: serde::Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let text = String::deserialize(deserializer)?;
        text.parse().map_err(serde::de::Error::custom)
    }
}

/// A schedule for each of the four channels, and when a picture would look like the one before.
///
/// # Example
///
/// ```
/// use softjam::scene::{Channels, Schedule};
///
/// let channels = Channels::default();
/// assert_eq!(channels.metrics, Schedule::Every(1));
/// ```
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Channels {
    /// Particle polygons.
    pub contours: Schedule,
    /// The contact graph with its forces.
    pub contacts: Schedule,
    /// `f_max`, energy, pressure, coordination, contacts, rattlers, time step.
    pub metrics: Schedule,
    /// The lossless state, without which a recording can be looked at but not replayed.
    pub state: Schedule,
    /// A picture that its schedule asks for is left out as long as the one before it is right to this: no particle has moved
    /// by more than `redraw` mean radii since, no pressure on a particle or force has changed by more than `10 redraw` of
    /// their mean, and none has begun or ceased to rattle. 0 … 1; at 0 none is left out.
    pub redraw: f64,
}

impl Default for Channels {
    fn default() -> Self {
        Self {
            contours: Schedule::Every(10),
            contacts: Schedule::Every(10),
            metrics: Schedule::Every(1),
            state: Schedule::Every(10),
            redraw: 0.01,
        }
    }
}

impl Channels {
    /// What a protocol records where nothing is said: its relaxed states alone, which may be thousands of steps apart.
    #[must_use]
    pub fn of_protocols() -> Self {
        Self {
            contours: Schedule::Relaxed,
            contacts: Schedule::Relaxed,
            metrics: Schedule::Relaxed,
            state: Schedule::Relaxed,
            redraw: 0.0,
        }
    }

    /// Each channel with its name.
    #[must_use]
    pub fn named(&self) -> [(&'static str, Schedule); 4] {
        [
            ("contours", self.contours),
            ("contacts", self.contacts),
            ("metrics", self.metrics),
            ("state", self.state),
        ]
    }

    /// These channels in the stage of recorded disks: contours, contacts and state that are on follow `record`.
    #[must_use]
    pub fn of_disks(&self, record: Schedule) -> Self {
        let scheduled = |channel: Schedule| if channel.is_on() { record } else { channel };
        Self {
            contours: scheduled(self.contours),
            contacts: scheduled(self.contacts),
            state: scheduled(self.state),
            ..*self
        }
    }

    /// Which of the channels, in the order of [`named`](Self::named), are recorded at `step`. At an `edge`, the first or
    /// the last frame of a recording, every channel is that is on.
    #[must_use]
    pub fn at(&self, step: u64, edge: bool) -> [bool; 4] {
        let recorded = |s: Schedule| s.includes(step) || (edge && s.is_on());
        self.named().map(|(_, schedule)| recorded(schedule))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_step_after_another_is_the_next_that_the_schedule_includes() {
        let schedules = [1, 2, 7, 20, 100, 1000].map(Schedule::Log);
        for schedule in schedules.into_iter().chain([1, 3, 10].map(Schedule::Every)) {
            let steps: Vec<u64> = (0..20_000).filter(|s| schedule.includes(*s)).collect();
            for pair in steps.windows(2) {
                for step in [pair[0], pair[1] - 1] {
                    assert_eq!(
                        schedule.after(step),
                        Some(pair[1]),
                        "{schedule}, step {step}"
                    );
                }
            }
        }
        assert_eq!(Schedule::Log(20).after(u64::MAX - 1), None);
        assert_eq!(Schedule::Every(3).after(u64::MAX - 1), Some(u64::MAX));
        assert_eq!(Schedule::Every(10).after(u64::MAX - 1), None);
    }
}
