//! `softjam join`: the parts of a run as one recording.

use super::memory::MemoryFlag;
use super::output::{Output, end_when_interrupted};
use super::{Verdict, convert};
use softjam::replay::Recording;
use std::path::PathBuf;

#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  softjam record --from killed.rrd -o rest.rrd         finish a run that was interrupted
  softjam join killed.rrd rest.rrd -o whole.rrd        the bytes of the run that nobody interrupted
  softjam join a.rrd b.rrd c.mcap -o whole.mcap        as many parts as there are, of either format

Parts are named in the order of their first steps, and each begins at a state that one before it holds. They are of one scene, but for
its step limit, and have the same channels. What two of them hold has to be the same to the last bit; pictures are drawn anew. OUT
takes its place when it is whole or, where the last part breaks off, as far as it goes.

Exit codes: 0 joined, 1 could not be done, or the last part breaks off (what came before is joined), 2 the request makes no sense, or
these are not parts of one run")]
pub struct Arguments {
    /// The parts, .rrd or .mcap, in their order.
    #[arg(value_name = "PART.rrd", required = true, num_args = 2..)]
    parts: Vec<PathBuf>,

    /// The file to write; a name that ends in .mcap gives MCAP.
    #[arg(long, short, value_name = "OUT.rrd")]
    output: PathBuf,

    /// Replace an existing file, when the new one is whole.
    #[arg(long, short)]
    force: bool,

    #[command(flatten)]
    memory: MemoryFlag,
}

pub fn run(arguments: &Arguments) -> anyhow::Result<Verdict> {
    let inputs: Vec<_> = arguments.parts.iter().map(|p| Some(p.as_path())).collect();
    let output = Output::named(&arguments.output, &inputs, arguments.force)?;
    end_when_interrupted()?;
    let budget = arguments.memory.budget();
    let parts = arguments.parts.iter();
    let parts = parts.map(|path| Recording::open_within(path, budget));
    let mut whole = Recording::joined(parts.collect::<Result<_, _>>()?)?;
    let channels = whole.scene().channels;
    convert::write(&mut whole, &output, channels)
}
