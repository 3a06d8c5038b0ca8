//! What a replay finds out about a recording.

use super::progress::Progress;
use super::told::{bytes, difference, tell_balance};
use super::{Arguments, Question};
use crate::cli::lines::Lines;
use serde_json::json;
use softjam::BITS;
use softjam::record::PROGRAM;
use softjam::replay::{
    Balance, Bytes, Determinism, Origin, Recording, ReplayError, Standing, State, Way, Worst,
    determinism,
};
use softjam::text::{counted, shown};
use std::fs::File;
use std::io::{BufReader, Read};
use std::path::Path;
use std::sync::mpsc::sync_channel;

/// What was found out.
pub(super) struct Findings {
    pub(super) determinism: Option<Determinism>,
    pub(super) balance: Option<Balance>,
    pub(super) recording: Recording,
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
    let (queue, frames) = sync_channel(FRAMES_WAITING);
    let (found, balance) = std::thread::scope(|scope| {
        let judge = scope.spawn(move || {
            let mut balance = balance?;
            for (packing, frame, metrics) in frames {
                let metrics: Vec<_> = metrics;
                balance.check(&packing, &frame, &metrics);
            }
            Some(balance)
        });
        let post = move |state: &State| {
            let step = state.frame.step;
            progress.towards(step);
            if wanted(Question::Balance) {
                let metrics = state.metrics.get(&step).cloned().unwrap_or_default();
                // The judge hangs up only by panicking, which is passed on below.
                let _ = queue.send((state.packing.clone(), state.frame.clone(), metrics));
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
        let balance = judge.join();
        let balance = balance.unwrap_or_else(|panic| std::panic::resume_unwind(panic));
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
    Ok(Findings {
        determinism: found,
        balance,
        recording,
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
        // What `f_max` may be off by between revisions of the bits: the rounding of its sums.
        let same_bits = self.recording.has_same_bits();
        let tolerance = if same_bits { 0.0 } else { 1e-14 };
        let end = self.recording.outcome();
        let balanced = self
            .balance
            .as_ref()
            .is_none_or(|b| b.agrees() && end.is_none_or(|end| b.bears_out(&end, tolerance)));
        same && balanced
    }

    /// What the file lacks, if it lacks something.
    fn lacks(&self) -> Option<String> {
        let last = self.recording.intact().unwrap_or(0);
        let broken_off = self.recording.standing() == Standing::BrokenOff;
        match (self.recording.outcome(), self.recording.is_closed()) {
            (Some(_), true) => None,
            (None, true) if broken_off => Some(format!(
                "incomplete: no result behind step {last}; the file was cut or the run interrupted, before another program rewrote it"
            )),
            (None, true) => Some(format!("the run was interrupted behind step {last}")),
            (Some(_), false) => Some("the file breaks off behind its result: no footer".to_owned()),
            (None, false) => Some(format!("the file breaks off behind step {last}: no result")),
        }
    }

    /// The verdict in a few words.
    fn verdict(&self) -> &'static str {
        let by_content =
            |d: &Determinism| d.bytes == Bytes::LaidOutOtherwise || d.deviation.is_some();
        match (self.good(), self.lacks()) {
            (false, _) => "NOT VERIFIED",
            (true, Some(_)) => "verified as far as it goes",
            (true, None) if self.determinism.as_ref().is_some_and(by_content) => {
                "verified by content"
            }
            (true, None) => "verified",
        }
    }

    pub fn text(&self, path: &Path) -> String {
        let (mut lines, recording) = (Lines::default(), &self.recording);
        lines.line("file", path.display());
        if let Some(d) = &self.determinism {
            if !recording.has_same_bits() {
                let (bits, program) = (recording.bits(), recording.program());
                let revision = format!(
                    "bits {bits} of {program}, not {BITS}: that program can check the bits"
                );
                lines.line("revision", revision);
            }
            lines.line("determinism", difference(d));
            if let Some(bytes) = bytes(d, path) {
                lines.line("bytes", bytes);
            }
        }
        if let Some(b) = &self.balance {
            tell_balance(b, recording.scene().model, &mut lines);
        }
        if let Some(end) = recording.outcome() {
            let not = if end.converged { "" } else { "not " };
            let (steps, f_max) = (counted(end.steps, "step"), end.f_max);
            let result = format!("{not}converged, {steps}, f_max = {f_max:.3e} γ");
            lines.line("result", result);
        }
        if let Some(lacks) = self.lacks() {
            lines.line("unfinished", lacks);
        }
        lines.line("verdict", self.verdict());
        lines.say("checked", &self.checked());
        lines.into_text()
    }

    pub fn json(&self, path: &Path) -> String {
        let worst = |w: &Worst| json!({ "value": w.value, "allowed": w.allowed, "step": w.step });
        let determinism = self.determinism.as_ref().map(|d| {
            json!({
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
            json!({
                "frames": b.frames,
                "equation_4": worst(&b.equation_4),
                "last_equation_4": b.last_equation_4,
                "overlap": worst(&b.overlap),
                "pull": worst(&b.pull),
                "energy_and_pressure": worst(&b.energy_and_pressure),
                "relaxed": worst(&b.relaxed),
                "f_max": b.last.map(|l| l.1),
            })
        });
        let value = json!({
            "file": shown(&path.display().to_string()),
            "program": self.recording.program(),
            "bits": self.recording.bits(),
            "checked_by": PROGRAM,
            "checked_bits": BITS,
            "determinism": determinism,
            "balance": balance,
            "converged": self.recording.outcome().map(|r| r.converged),
            "unfinished": self.lacks(),
            "verified": self.good(),
            "verdict": self.verdict(),
            "checked": self.checked(),
        });
        format!("{value:#}\n")
    }
}

/// Whether the recorded states were compared with themselves alone.
pub(super) fn nothing_was_run(d: &Determinism) -> bool {
    d.origin == Origin::Frame && d.run == 0
}
