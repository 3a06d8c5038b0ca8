//! What a replay finds out about a recording, and how it is told.

use super::progress::Progress;
use super::{Arguments, Question};
use crate::cli::lines::Lines;
use softjam::BITS;
use softjam::record::{Leg, Outcome, PROGRAM};
use softjam::replay::{
    Balance, Bytes, Determinism, Origin, Recording, ReplayError, Standing, State, Way, Worst,
    determinism, place_of_byte,
};
use softjam::text::{counted, shown};
use std::fs::File;
use std::io::{BufReader, Read};
use std::path::Path;
use std::sync::mpsc::sync_channel;

/// What was found out.
pub(super) struct Findings {
    determinism: Option<Determinism>,
    balance: Option<Balance>,
    result: Option<Outcome>,
    pub standing: Standing,
    closed: bool,
    last: Option<u64>,
    from_step: u64,
    legs: Vec<Leg>,
    program: String,
    bits: u32,
    /// Whether this program gives the recorded bits.
    same_bits: bool,
    /// What the file does not record.
    without: Vec<&'static str>,
}

/// Frames that may wait for the judge before the run does.
const FRAMES_WAITING: usize = 8;

/// Asks the questions.
pub(super) fn examine(arguments: &Arguments) -> Result<Findings, ReplayError> {
    let mut recording = Recording::open_within(&arguments.file, arguments.memory.budget())?;
    let wanted = |question| arguments.only.is_none_or(|only| only == question);
    let balance = wanted(Question::Balance).then(|| Balance::new(recording.scene()));
    let way = if arguments.segments {
        Way::Segments(arguments.threads.map_or(usize::MAX, usize::from))
    } else {
        Way::Whole
    };
    let progress = Progress::of(&recording);
    // Frames are judged on a thread of their own while the run goes on.
    let (queue, frames) = sync_channel::<State>(FRAMES_WAITING);
    let (found, balance) = std::thread::scope(|scope| {
        let judge = scope.spawn(move || {
            balance.map(|mut balance| {
                for State {
                    frame,
                    packing,
                    metrics,
                } in frames
                {
                    let metrics = metrics.get(&frame.step).map_or(&[][..], Vec::as_slice);
                    balance.check(&packing, &frame, metrics);
                }
                balance
            })
        });
        let post = move |state: &State| {
            progress.towards(state.frame.step);
            if wanted(Question::Balance) {
                // The judge hangs up only by panicking, which is passed on below.
                let step = state.frame.step;
                let metrics = state.metrics.get_key_value(&step).into_iter();
                let _ = queue.send(State {
                    frame: state.frame.clone(),
                    packing: state.packing.clone(),
                    metrics: metrics.map(|(step, row)| (*step, row.clone())).collect(),
                });
            }
        };
        let found = if wanted(Question::Determinism) {
            let file = File::open(&arguments.file).ok();
            let file = file.map(|f| Box::new(BufReader::new(f)) as Box<dyn Read + Send>);
            determinism(&mut recording, way, file, post).map(Some)
        } else {
            let end = loop {
                match recording.next_state() {
                    Ok(Some(state)) => post(&state),
                    Ok(None) => break Ok(None),
                    Err(error) => break Err(error.into()),
                }
            };
            // The judge waits for the end of the queue.
            drop(post);
            end
        };
        let balance = judge
            .join()
            .unwrap_or_else(|panic| std::panic::resume_unwind(panic));
        (found, balance)
    });
    let found = found?;
    let states = balance.as_ref().map_or(0, |b| b.frames) + found.as_ref().map_or(0, |d| d.states);
    if states == 0 {
        return Err(ReplayError::NoState {
            path: arguments.file.display().to_string(),
            closed: recording.is_closed(),
        });
    }
    let channels = recording.scene().channels.named();
    Ok(Findings {
        determinism: found,
        balance,
        result: recording.outcome(),
        standing: recording.standing(),
        closed: recording.is_closed(),
        last: recording.intact(),
        from_step: recording.from_step(),
        legs: recording.legs().to_vec(),
        program: recording.program().to_owned(),
        bits: recording.bits(),
        same_bits: recording.has_same_bits(),
        without: channels
            .iter()
            .filter_map(|(name, schedule)| (!schedule.is_on()).then_some(*name))
            .collect(),
    })
}

impl Findings {
    /// Whether nothing speaks against the recording.
    pub fn good(&self) -> bool {
        let same = self.determinism.as_ref().is_none_or(|d| {
            d.difference.is_none()
                && !matches!(d.bytes, Bytes::Differ { .. })
                && !nothing_was_run(d)
                && d.deviation.is_none_or(|worst| worst.agrees())
        });
        let balanced = self.balance.as_ref().is_none_or(|b| {
            b.agrees()
                && self
                    .result
                    .is_none_or(|end| b.bears_out(&end, self.tolerance()))
        });
        same && balanced
    }

    /// What `f_max` may be off by between revisions of the bits: the rounding of its sums.
    fn tolerance(&self) -> f64 {
        if self.same_bits { 0.0 } else { 1e-14 }
    }

    /// What the file lacks, if it lacks something.
    fn lacks(&self) -> Option<String> {
        let last = self.last.unwrap_or(0);
        match (self.result, self.closed) {
            (Some(_), true) => None,
            (None, true) if self.standing == Standing::BrokenOff => Some(format!(
                "incomplete: no result behind step {last}; the file was cut or the run interrupted, before another program rewrote it"
            )),
            (None, true) => Some(format!("the run was interrupted behind step {last}")),
            (Some(_), false) => Some("the file breaks off behind its result: no footer".to_owned()),
            (None, false) => Some(format!("the file breaks off behind step {last}: no result")),
        }
    }

    /// The verdict in a few words.
    fn verdict(&self) -> &'static str {
        let by_content = self
            .determinism
            .as_ref()
            .is_some_and(|d| d.bytes == Bytes::LaidOutOtherwise || d.deviation.is_some());
        match (self.good(), self.lacks()) {
            (false, _) => "NOT VERIFIED",
            (true, Some(_)) => "verified as far as it goes",
            (true, None) if by_content => "verified by content",
            (true, None) => "verified",
        }
    }

    /// What was checked, what was not, and with which versions, in words.
    fn checked(&self) -> String {
        let (mut checked, mut not) = (Vec::new(), Vec::new());
        match &self.determinism {
            None => not.push(
                "whether the scene gives this run (--only balance): nothing was run".to_owned(),
            ),
            Some(d) => self.tell_determinism(d, &mut checked, &mut not),
        }
        match &self.balance {
            None => not
                .push("the contact law and the balance of forces (--only determinism)".to_owned()),
            Some(b) => checked.push(format!(
                "contacts, forces and balance, by the contours alone, of {}",
                counted(b.frames, "state")
            )),
        }
        let not = if not.is_empty() {
            String::new()
        } else {
            format!(" Not checked: {}.", not.join("; "))
        };
        let own = format!("{PROGRAM} (bits {BITS})");
        let recorded = format!("{} (bits {})", self.program, self.bits);
        let versions = if recorded == own {
            format!("Recorded and checked by {own}.")
        } else {
            format!("Recorded by {recorded}, checked by {own}.")
        };
        let checked = if checked.is_empty() {
            "nothing".to_owned()
        } else {
            checked.join("; ")
        };
        format!("{checked}.{not} {versions}")
    }

    fn tell_determinism(&self, d: &Determinism, checked: &mut Vec<String>, not: &mut Vec<String>) {
        let steps = counted(d.run, "step");
        let begin = match d.origin {
            Origin::Scene => "the scene run again from its start",
            Origin::Positions => "the scene run again from the first recorded positions",
            Origin::Frame => "the scene run again from the first recorded state",
        };
        let legs = self.legs.iter().filter(|_| d.origin == Origin::Scene);
        let legs = legs.map(|leg| {
            let (until, threshold) = (leg.until, leg.threshold);
            format!(
                " (to step {until} with the threshold {threshold:e}, the minimiser and the forces of before)"
            )
        });
        let legs = legs.collect::<Vec<_>>().concat();
        let begin = format!("{begin}{legs}");
        if nothing_was_run(d) {
            not.push("anything of the run: no step leads to the only recorded state".to_owned());
            return;
        }
        let rows = format!(
            "{} and {}",
            counted(d.states, "state"),
            counted(d.metrics, "metric")
        );
        checked.push(match d.deviation {
            None => {
                let end = if self.result.is_some() {
                    ", and where the run ends"
                } else {
                    ""
                };
                format!("{begin}, {steps}: {rows}, by their bits{end}")
            }
            Some(_) => {
                format!("{steps} from recorded state to recorded state, within tolerances: {rows}")
            }
        });
        match d.origin {
            Origin::Scene => {}
            Origin::Positions => {
                not.push("whether the start file leads to these positions and radii".to_owned());
            }
            Origin::Frame => not.push(format!(
                "how the run came to step {}, which is in the recording that this one goes on from",
                self.from_step
            )),
        }
        let pictures = "pictures, layout and names";
        match d.bytes {
            _ if d.difference.is_some() => {
                not.push(format!("what comes behind the difference; {pictures}"));
            }
            Bytes::Same(bytes) => checked.push(format!(
                "all {bytes} bytes of the file, {pictures} with them"
            )),
            Bytes::SameUpTo(bytes) => checked.push(format!(
                "the first {bytes} bytes of the file, which breaks off"
            )),
            Bytes::LaidOutOtherwise if self.program == PROGRAM => {
                not.push(format!(
                    "{pictures}: another program has rewritten the file"
                ));
            }
            Bytes::LaidOutOtherwise => not.push(format!(
                "{pictures}, which {} may lay out otherwise",
                self.program
            )),
            Bytes::Differ { .. } => {}
            _ => not.push(pictures.to_owned()),
        }
        if !self.without.is_empty() {
            let missing = self.without.join(", ");
            not.push(format!("{missing}, which the scene switches off"));
        }
    }

    pub fn text(&self, path: &Path) -> String {
        let mut lines = Lines::default();
        lines.line("file", path.display());
        if let Some(d) = &self.determinism {
            if !self.same_bits {
                let (theirs, program) = (self.bits, &self.program);
                lines.line(
                    "revision",
                    format!(
                        "bits {theirs} of {program}, not {BITS}: that program can check the bits"
                    ),
                );
            }
            lines.line("determinism", tell_difference(d));
            if let Some(bytes) = tell_bytes(d, path) {
                lines.line("bytes", bytes);
            }
        }
        if let Some(b) = &self.balance {
            tell_balance(b, &mut lines);
        }
        if let Some(end) = self.result {
            let word = if end.converged {
                "converged"
            } else {
                "not converged"
            };
            let (steps, f_max) = (counted(end.steps, "step"), end.f_max);
            lines.line("result", format!("{word}, {steps}, f_max = {f_max:.3e} γ"));
        }
        if let Some(lacks) = self.lacks() {
            lines.line("unfinished", lacks);
        }
        lines.line("verdict", self.verdict());
        lines.say("checked", &self.checked());
        lines.into_text()
    }

    pub fn json(&self, path: &Path) -> String {
        let worst = |w: &Worst| serde_json::json!({ "value": w.value, "allowed": w.allowed, "step": w.step });
        let determinism = self.determinism.as_ref().map(|d| {
            serde_json::json!({
                "states": d.states,
                "metrics": d.metrics,
                "first": d.steps.map(|s| s.0),
                "last": d.steps.map(|s| s.1),
                "run": d.run,
                "difference": d.difference.as_ref().map(ToString::to_string),
                "difference_step": d.difference.as_ref().map(|d| d.step),
                "deviation": d.deviation.as_ref().map(worst),
                "bytes": match d.bytes {
                    Bytes::Same(_) => "same",
                    Bytes::SameUpTo(_) => "same as far as they go",
                    Bytes::LaidOutOtherwise => "laid out otherwise",
                    Bytes::Differ { .. } => "differ",
                    _ => "not compared",
                },
                "bytes_differ_at": match d.bytes { Bytes::Differ { at } => Some(at), _ => None },
            })
        });
        let balance = self.balance.as_ref().map(|b| {
            serde_json::json!({
                "frames": b.frames,
                "equation_4": worst(&b.equation_4),
                "last_equation_4": b.last_equation_4,
                "overlap": worst(&b.overlap),
                "pull": worst(&b.pull),
                "energy_and_pressure": worst(&b.energy_and_pressure),
                "f_max": b.last.map(|l| l.1),
            })
        });
        let value = serde_json::json!({
            "file": shown(&path.display().to_string()),
            "program": self.program,
            "bits": self.bits,
            "checked_by": PROGRAM,
            "checked_bits": BITS,
            "determinism": determinism,
            "balance": balance,
            "converged": self.result.map(|r| r.converged),
            "unfinished": self.lacks(),
            "verified": self.good(),
            "verdict": self.verdict(),
            "checked": self.checked(),
        });
        format!("{value:#}\n")
    }
}

/// Whether the recorded states were compared with themselves alone.
fn nothing_was_run(d: &Determinism) -> bool {
    d.origin == Origin::Frame && d.run == 0
}

fn tell_difference(d: &Determinism) -> String {
    let (first, last) = d.steps.unwrap_or_default();
    if let Some(difference) = &d.difference {
        return format!("differs: {difference} (here: the file)");
    }
    if nothing_was_run(d) {
        return "nothing was run: the only recorded state is where the recording begins".to_owned();
    }
    let what = format!(
        "{} and {}, steps {first} … {last}",
        counted(d.states, "state"),
        counted(d.metrics, "metric")
    );
    match d.deviation {
        None => format!("{what}: the same to the last bit"),
        Some(worst) => {
            let word = if worst.agrees() {
                "agrees"
            } else {
                "does not agree"
            };
            format!(
                "{what}: {word} to {:.1e} at step {} (allowed there: {:.1e}), other revision of the bits",
                worst.value, worst.step, worst.allowed
            )
        }
    }
}

fn tell_bytes(d: &Determinism, path: &Path) -> Option<String> {
    Some(match d.bytes {
        Bytes::Same(bytes) => format!("all {bytes} are the run's"),
        Bytes::SameUpTo(bytes) => format!("the first {bytes} are the run's"),
        Bytes::LaidOutOtherwise => {
            "laid out by another program or version: compared by what they hold".to_owned()
        }
        Bytes::Differ { at } => {
            let place =
                place_of_byte(path, at).map_or(String::new(), |place| format!(" ({place})"));
            format!("differ from byte {at} on{place}: damaged or changed after it was written")
        }
        _ => return None,
    })
}

fn tell_balance(b: &Balance, lines: &mut Lines) {
    // The contact problem is solved to what f_max makes sensible, so a frame far from balance is off by more.
    let at = |w: &Worst| match w.value {
        0.0 => "none".to_owned(),
        value if w.allowed > 0.0 => format!(
            "{value:.1e} at step {} (allowed there: {:.1e})",
            w.step, w.allowed
        ),
        value => format!("{value:.1e} at step {}", w.step),
    };
    lines.line(
        "equation (4)",
        format!(
            "{:.1e} of the largest overlap at the last state; {} at worst",
            b.last_equation_4,
            at(&b.equation_4)
        ),
    );
    lines.line("gaps", format!("overlap elsewhere: {}", at(&b.overlap)));
    lines.line(
        "observables",
        format!(
            "energy and pressure, relative: {}",
            at(&b.energy_and_pressure)
        ),
    );
    if b.pull.value > 0.0 {
        lines.line("pulls", at(&b.pull));
    }
    if let Some((step, f_max)) = b.last {
        lines.line(
            "f_max",
            format!("{f_max:.3e} γ at step {step}, from positions alone"),
        );
    }
}
