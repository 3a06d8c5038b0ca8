//! Where two frames differ, told as a physicist would ask: which particle, by how much.

use crate::analysis::Stability;
use crate::domain::Vec2;
use crate::minimize::name_of;
use crate::state::Frame;
use crate::text::counted;
use core::fmt;

/// The first difference between a recorded frame and the one it is held against.
///
/// # Example
///
/// ```
/// use softjam::{state::Frame, replay::Difference};
///
/// let (a, mut b) = (Frame { forces: vec![0.5], ..Frame::default() }, Frame::default());
/// b.forces = vec![0.5_f64.next_up()];
/// let difference = Difference::between(&a, &b).unwrap();
/// assert_eq!(difference.to_string(), "step 0: force of contact 0: 0.5 here, 0.5000000000000001 there (1 ulp)");
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Difference {
    /// The step.
    pub step: u64,
    /// What differs.
    pub what: What,
}

/// What differs.
///
/// ```
/// use softjam::replay::What;
/// assert_ne!(What::Step(4), What::Step(3));
/// ```
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum What {
    /// A number.
    Value {
        /// Its name, such as `x of particle 7`.
        name: String,
        /// What was recorded.
        here: f64,
        /// What it is held against.
        there: f64,
    },
    /// The number of a list's entries.
    Count {
        /// What is counted, in the plural.
        name: &'static str,
        /// What was recorded.
        here: usize,
        /// What it is held against.
        there: usize,
    },
    /// A contact.
    Contact {
        /// Its number.
        contact: usize,
        /// The recorded pair.
        here: [u32; 2],
        /// The pair it is held against.
        there: [u32; 2],
    },
    /// The other side has another step.
    Step(u64),
    /// A row of the metrics that is missing, or one too many.
    Row {
        /// The metric.
        name: &'static str,
        /// What is wrong with it.
        row: Row,
    },
    /// The run ends at this step, where the recording goes on or names no result.
    Ends {
        /// Whether it has converged there; else it has reached its step limit.
        converged: bool,
    },
    /// The run does not end at this step, where the recording says that it did.
    GoesOn {
        /// Its `f_max` there (units of γ).
        f_max: f64,
    },
    /// The recorded result says something else of the end.
    Converged {
        /// Whether the run has converged there.
        there: bool,
    },
    /// The recorded result says something else of the balance.
    Stability {
        /// What it says.
        here: Option<Stability>,
        /// What the run's end is.
        there: Option<Stability>,
    },
    /// The recorded result names another number of steps than its last state.
    Steps {
        /// What it names.
        here: u64,
    },
}

/// What is wrong with a row.
///
/// ```
/// use softjam::replay::Row;
/// assert_eq!(Row::Missing.to_string(), "is missing");
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Row {
    /// The schedule asks for it.
    Missing,
    /// It stands there more than once.
    Twice,
    /// The schedule does not ask for it.
    NotAsked,
    /// It stands behind the end of the recorded run.
    BehindTheEnd,
}

impl fmt::Display for Row {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Missing => "is missing",
            Self::Twice => "stands there more than once",
            Self::NotAsked => "stands there and is not asked for by the scene",
            Self::BehindTheEnd => "stands behind the end of the run",
        })
    }
}

impl Difference {
    /// The first difference between a recorded frame and another, `None` if all their bits agree.
    ///
    /// Compared in this order: step, positions, velocities, contacts, forces, minimiser.
    #[must_use]
    pub fn between(recorded: &Frame, other: &Frame) -> Option<Self> {
        let step = recorded.step;
        what(recorded, other).map(|what| Self { step, what })
    }
}

fn what(a: &Frame, b: &Frame) -> Option<What> {
    if a.step != b.step {
        return Some(What::Step(b.step));
    }
    vectors(("x", "y"), &a.positions, &b.positions)
        .or_else(|| vectors(("v_x", "v_y"), &a.velocities, &b.velocities))
        .or_else(|| count("contacts", a.contacts.len(), b.contacts.len()))
        .or_else(|| {
            let pairs = a.contacts.iter().zip(&b.contacts);
            let (contact, (here, there)) = pairs.enumerate().find(|(_, (p, q))| p != q)?;
            Some(What::Contact {
                contact,
                here: *here,
                there: *there,
            })
        })
        .or_else(|| count("forces", a.forces.len(), b.forces.len()))
        .or_else(|| numbers(&a.forces, &b.forces, |c| format!("force of contact {c}")))
        .or_else(|| {
            numbers(a.minimizer.values(), b.minimizer.values(), |k| {
                format!("{} of the minimiser", name_of(k))
            })
        })
        .or_else(|| {
            let count_of = |frame: &Frame| frame.minimizer.values().len();
            count("values of the minimiser", count_of(a), count_of(b))
        })
        .or_else(|| count("values of the memory", a.memory.len(), b.memory.len()))
        .or_else(|| numbers(&a.memory, &b.memory, |k| format!("value {k} of the memory")))
        .or_else(|| {
            let values = |frame: &Frame| frame.domain.map_or([0.0; 3], |d| d.values());
            let name = |k: usize| ["L_x", "L_y", "tilt"][k].to_owned();
            numbers(&values(a), &values(b), name)
        })
        .or_else(|| count("stages before it", a.stage as usize, b.stage as usize))
}

pub(super) fn count(name: &'static str, here: usize, there: usize) -> Option<What> {
    (here != there).then_some(What::Count { name, here, there })
}

pub(super) fn numbers(a: &[f64], b: &[f64], name: impl Fn(usize) -> String) -> Option<What> {
    let mut pairs = a.iter().zip(b).enumerate();
    let (k, (here, there)) = pairs.find(|(_, (x, y))| x.to_bits() != y.to_bits())?;
    Some(What::Value {
        name: name(k),
        here: *here,
        there: *there,
    })
}

fn vectors(names: (&str, &str), a: &[Vec2], b: &[Vec2]) -> Option<What> {
    count("particles", a.len(), b.len()).or_else(|| {
        let flat = |v: &[Vec2]| v.iter().flat_map(|p| [p.x, p.y]).collect::<Vec<f64>>();
        numbers(&flat(a), &flat(b), |k| {
            let name = if k % 2 == 0 { names.0 } else { names.1 };
            format!("{name} of particle {}", k / 2)
        })
    })
}

impl fmt::Display for Difference {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "step {}: ", self.step)?;
        match &self.what {
            What::Value { name, here, there } => {
                let distance = ulps(*here, *there);
                let apart = counted(distance, "ulp");
                // Of a number of things a person expects a whole number.
                let counts = ["metric contacts", "metric rattlers"].contains(&&**name);
                if counts && here.fract() == 0.0 && there.fract() == 0.0 {
                    return write!(f, "{name}: {here} here, {there} there");
                }
                write!(f, "{name}: {here:?} here, {there:?} there ({apart})")
            }
            What::Count { name, here, there } => {
                write!(f, "{name}: {here} here, {there} there")
            }
            What::Contact {
                contact,
                here,
                there,
            } => write!(f, "contact {contact} is {here:?} here, {there:?} there"),
            What::Step(there) => write!(f, "step {there} there"),
            What::Row { name, row } => write!(f, "metric {name} {row}"),
            What::Ends { converged: true } => {
                write!(
                    f,
                    "the run converges here, and the recording says otherwise"
                )
            }
            What::Ends { converged: false } => write!(
                f,
                "the run reaches its step limit here, and the recording says otherwise"
            ),
            What::GoesOn { f_max } => write!(
                f,
                "the run does not end here (f_max = {f_max:e} γ), and the recording says that it did"
            ),
            What::Stability { here, there } => {
                let name = |s: &Option<Stability>| s.map_or("not in balance", Stability::name);
                let (here, there) = (name(here), name(there));
                write!(f, "the result calls it {here}, and the run ends {there}")
            }
            What::Converged { there } => {
                let word = if *there { "has" } else { "has not" };
                write!(
                    f,
                    "the run {word} converged here, and the result says otherwise"
                )
            }
            What::Steps { here } => write!(f, "the result names {}", counted(here, "step")),
        }
    }
}

/// Units in the last place between two numbers: how many floating-point numbers apart they are.
///
/// ```
/// use softjam::replay::ulps;
/// assert_eq!(ulps(1.0, 1.0_f64.next_up()), 1);
/// assert_eq!(ulps(-0.0, 0.0), 0);
/// assert_eq!(ulps(-f64::MIN_POSITIVE, f64::MIN_POSITIVE), 2 << 52);
/// ```
#[must_use]
pub fn ulps(a: f64, b: f64) -> u64 {
    // The bits of an f64, read as a number with its sign, ascend with the value.
    let place = |x: f64| {
        let bits = x.to_bits() as i64;
        if bits < 0 { i64::MIN - bits } else { bits }
    };
    place(a).abs_diff(place(b))
}
