//! `softjam replay`: lets a recording prove itself.

mod against;
mod progress;
mod told;
mod verdict;

use super::memory::MemoryFlag;
use super::{Verdict, print};
use clap::ValueEnum;
use softjam::replay::Standing;
use std::path::PathBuf;
use verdict::examine;

#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  softjam replay run.rrd                       both questions, by one run from the scene that is recorded again
  softjam replay run.rrd --segments            the same verdict, on all cores
  softjam replay run.rrd --only balance        forces and contacts alone, without running again
  softjam replay run.rrd --against other.rrd   two recordings, frame by frame; byte by byte if they are of one scene and format

The last line says in words what was checked and what was not. A finished file is compared byte for byte with what its scene
gives; one that another program has rewritten, or another version has written, by what it holds.

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

    /// Threads for --segments, 1 … 256, no more than there are cores; the verdict does not depend on it [default: one a core].
    #[arg(long, value_name = "N", requires = "segments", value_parser = clap::value_parser!(u16).range(1..=256))]
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
    /// Do contacts and forces follow the law of the model in each frame, and does the last one balance?
    Balance,
}

pub fn run(arguments: &Arguments) -> anyhow::Result<Verdict> {
    if let Some(other) = &arguments.against {
        return against::against(&arguments.file, other, arguments);
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
    } else if found.recording.standing() != Standing::BrokenOff {
        Verdict::Good
    } else {
        Verdict::Incomplete
    })
}
