//! `softjam replay`: lets a recording prove itself.

use super::memory::MemoryFlag;
use super::{Verdict, print};
use clap::ValueEnum;
use softjam::record::Outcome;
use softjam::replay::{
    Balance, Comparison, Determinism, Recording, ReplayError, State, Way, Worst, compare,
    determinism,
};
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::sync::mpsc::sync_channel;

#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  softjam replay run.rrd                       both questions, by one run from the scene
  softjam replay run.rrd --segments            the same verdict, on all cores
  softjam replay run.rrd --only balance        forces and contacts alone, without running again
  softjam replay run.rrd --against other.rrd   two recordings, frame by frame

Exit codes: 0 verified, 1 could not be done (a damaged file, no state in it) or the file breaks off, 2 a bad flag, 3 not verified")]
pub struct Arguments {
    /// The recording, .rrd or .mcap.
    #[arg(value_name = "RUN.rrd")]
    file: PathBuf,

    /// Ask one question only [default: both].
    #[arg(long, value_name = "QUESTION")]
    only: Option<Question>,

    /// Run from each recorded frame to the next, in parallel, instead of from the scene to the end.
    #[arg(long)]
    segments: bool,

    /// Threads for --segments, 1 … 1024; the verdict does not depend on it [default: one a core].
    #[arg(long, value_name = "N", requires = "segments", value_parser = clap::value_parser!(u16).range(1..=1024))]
    threads: Option<u16>,

    /// Compare with another recording instead.
    #[arg(long, value_name = "OTHER.rrd", conflicts_with_all = ["only", "segments"])]
    against: Option<PathBuf>,

    /// Print one JSON object instead of lines.
    #[arg(long)]
    json: bool,

    #[command(flatten)]
    memory: MemoryFlag,
}

/// What can be asked of a recording.
#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Question {
    /// Is the trajectory what the scene gives, bit for bit?
    Determinism,
    /// Do the frames fulfil the contact law, and does the last one balance?
    Balance,
}

/// What was found out.
struct Findings {
    determinism: Option<Determinism>,
    balance: Option<Balance>,
    result: Option<Outcome>,
    closed: bool,
    last: Option<u64>,
}

pub fn run(arguments: &Arguments) -> anyhow::Result<Verdict> {
    if let Some(other) = &arguments.against {
        return against(&arguments.file, other, arguments.json);
    }
    let found = examine(arguments)?;
    let good = found.good();
    print(&if arguments.json {
        found.json(&arguments.file)
    } else {
        found.text(&arguments.file)
    })?;
    Ok(if !good {
        Verdict::Bad
    } else if found.closed {
        Verdict::Good
    } else {
        Verdict::Interrupted
    })
}

fn examine(arguments: &Arguments) -> Result<Findings, ReplayError> {
    let mut recording = Recording::open_within(&arguments.file, arguments.memory.budget())?;
    let wanted = |question| arguments.only.is_none_or(|only| only == question);
    let balance = wanted(Question::Balance).then(|| Balance::new(recording.scene()));
    let way = if arguments.segments {
        let cores = std::thread::available_parallelism().map_or(1, usize::from);
        Way::Segments(arguments.threads.map_or(cores, usize::from))
    } else {
        Way::Whole
    };
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
            if wanted(Question::Balance) {
                // The judge hangs up only by panicking, which is passed on below.
                let _ = queue.send(state.clone());
            }
        };
        let found = if wanted(Question::Determinism) {
            let file = std::fs::File::open(&arguments.file).ok();
            let file = file.map(|file| Box::new(std::io::BufReader::new(file)) as Box<dyn std::io::Read + Send>);
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
    Ok(Findings {
        determinism: found,
        balance,
        result: recording.outcome(),
        closed: recording.is_closed(),
        last: recording.intact(),
    })
}

/// Frames that may wait for the judge before the run does.
const FRAMES_WAITING: usize = 8;

impl Findings {
    fn good(&self) -> bool {
        let same = self
            .determinism
            .as_ref()
            .is_none_or(|d| d.difference.is_none());
        let balanced = self
            .balance
            .as_ref()
            .is_none_or(|b| b.agrees() && self.result.is_none_or(|end| b.bears_out(&end)));
        same && balanced
    }

    /// What the file lacks, if it lacks something.
    fn lacks(&self) -> Option<String> {
        let last = self.last.unwrap_or(0);
        match (self.result, self.closed) {
            (Some(_), true) => None,
            (None, true) => Some(format!("the run was interrupted behind step {last}")),
            (Some(_), false) => Some("the file breaks off behind its result: no footer".to_owned()),
            (None, false) => Some(format!("the file breaks off behind step {last}: no result")),
        }
    }

    fn text(&self, path: &Path) -> String {
        let mut text = String::new();
        let mut line = |name: &str, value: String| {
            // Writing to a String cannot fail.
            let _ = writeln!(text, "{name:<14} {value}");
        };
        line("file", path.display().to_string());
        if let Some(d) = &self.determinism {
            let (first, last) = d.steps.unwrap_or_default();
            line(
                "determinism",
                match &d.difference {
                    None => format!(
                        "{} states and {} metrics, steps {first} … {last}: the same to the last bit",
                        d.states, d.metrics
                    ),
                    Some(difference) => format!("differs: {difference} (here: the file)"),
                },
            );
        }
        if let Some(b) = &self.balance {
            // The contact problem is solved to what f_max makes sensible, so a frame far from balance is off by more.
            let at = |w: &Worst| match w.value {
                0.0 => "none".to_owned(),
                value if w.allowed > 0.0 => format!(
                    "{value:.1e} at step {} (allowed there: {:.1e})",
                    w.step, w.allowed
                ),
                value => format!("{value:.1e} at step {}", w.step),
            };
            line(
                "equation (4)",
                format!(
                    "{:.1e} of the largest overlap at the last state; {} at worst",
                    b.last_equation_4,
                    at(&b.equation_4)
                ),
            );
            line("gaps", format!("overlap elsewhere: {}", at(&b.overlap)));
            line(
                "forces",
                format!(
                    "against those found anew, of the largest force: {}",
                    at(&b.forces)
                ),
            );
            line(
                "observables",
                format!(
                    "energy and pressure, relative: {}",
                    at(&b.energy_and_pressure)
                ),
            );
            if b.pull.value > 0.0 {
                line("pulls", at(&b.pull));
            }
            if b.contacts.value > 0.0 {
                let (n, step) = (b.contacts.value, b.contacts.step);
                line(
                    "contacts",
                    format!("{n} pairs on one side only (step {step})"),
                );
            }
            if let Some((step, error)) = &b.failed {
                line("contact law", format!("step {step}: {error}"));
            }
            if let Some((step, f_max)) = b.last {
                line(
                    "f_max",
                    format!("{f_max:.3e} γ at step {step}, from positions alone"),
                );
            }
        }
        if let Some(end) = self.result {
            let word = if end.converged {
                "converged"
            } else {
                "not converged"
            };
            line(
                "result",
                format!("{word}, {} steps, f_max = {:.3e} γ", end.steps, end.f_max),
            );
        }
        if let Some(lacks) = self.lacks() {
            line("unfinished", lacks);
        }
        if let Some(d) = &self.determinism { line("bytes", format!("{:?} {:?} run {}", d.bytes, d.origin, d.run)); }
        let verdict = match (self.good(), self.lacks()) {
            (true, None) => "verified",
            (true, Some(_)) => "verified as far as it goes",
            (false, _) => "NOT VERIFIED",
        };
        line("verdict", verdict.to_owned());
        text
    }

    fn json(&self, path: &Path) -> String {
        let worst = |w: &Worst| serde_json::json!({ "value": w.value, "allowed": w.allowed, "step": w.step });
        let determinism = self.determinism.as_ref().map(|d| {
            serde_json::json!({
                "states": d.states,
                "metrics": d.metrics,
                "first": d.steps.map(|s| s.0),
                "last": d.steps.map(|s| s.1),
                "difference": d.difference.as_ref().map(ToString::to_string),
                "difference_step": d.difference.as_ref().map(|d| d.step),
            })
        });
        let balance = self.balance.as_ref().map(|b| {
            serde_json::json!({
                "frames": b.frames,
                "equation_4": worst(&b.equation_4),
                "last_equation_4": b.last_equation_4,
                "overlap": worst(&b.overlap),
                "pull": worst(&b.pull),
                "forces": worst(&b.forces),
                "energy_and_pressure": worst(&b.energy_and_pressure),
                "contacts": worst(&b.contacts),
                "f_max": b.last.map(|l| l.1),
                "failed": b.failed.as_ref().map(|(step, e)| format!("step {step}: {e}")),
            })
        });
        let value = serde_json::json!({
            "file": path.display().to_string(),
            "determinism": determinism,
            "balance": balance,
            "converged": self.result.map(|r| r.converged),
            "unfinished": self.lacks(),
            "verified": self.good(),
        });
        format!("{value:#}\n")
    }
}

fn against(here: &Path, there: &Path, json: bool) -> anyhow::Result<Verdict> {
    let (mut a, mut b) = (Recording::open(here)?, Recording::open(there)?);
    let found: Comparison = compare(&mut a, &mut b)?;
    let same = found.difference.is_none() && found.common > 0;
    let difference = found.difference.as_ref().map(ToString::to_string);
    print(&if json {
        let value = serde_json::json!({
            "here": here.display().to_string(),
            "there": there.display().to_string(),
            "common": found.common,
            "only_here": found.only_here,
            "only_there": found.only_there,
            "difference": difference,
            "same": same,
        });
        format!("{value:#}\n")
    } else {
        let verdict = match difference {
            Some(difference) => format!("differ: {difference}"),
            None if found.common == 0 => "no step is recorded in both".to_owned(),
            None => "the same to the last bit".to_owned(),
        };
        format!(
            "common steps   {}\nonly here      {}\nonly there     {}\nverdict        {verdict}\n",
            found.common, found.only_here, found.only_there
        )
    })?;
    Ok(if same { Verdict::Good } else { Verdict::Bad })
}
