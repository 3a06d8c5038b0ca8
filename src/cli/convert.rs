//! `softjam convert`: from one format to the other, with more channels or fewer.

use super::flags::ChannelFlags;
use super::lines::Lines;
use super::memory::MemoryFlag;
use super::output::{Output, end_when_interrupted};
use super::{Verdict, report};
use softjam::convert::{self, ConvertError};
use softjam::record::Writer;
use softjam::replay::{ReadError, Recording};
use softjam::scene::Channels;
use softjam::text::{counted, shown};
use std::path::PathBuf;

#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  softjam convert run.rrd run.mcap                          the same recording for Foxglove
  softjam convert run.rrd small.rrd --channels state        the small file to share
  softjam convert small.rrd run.rrd --channels contours,contacts,metrics,state
                                                            everything else, rebuilt from it
  softjam convert run.rrd fine.rrd --channels state,metrics,contours=every:1
                                                            steps that run.rrd lacks are computed again
States, metrics, scene and result go over as they are; contours and contacts are drawn anew from the states. OUT is written as
OUT.part and takes its place when it is whole: until then an existing OUT is as it was. What a killed convert (kill -9) has left as
OUT.part the next one takes over.

Exit codes: 0 converted, 1 could not be done, or the recording is damaged or breaks off (what came before is converted), 2 the
request makes no sense")]
pub struct Arguments {
    /// The recording to convert, .rrd or .mcap.
    #[arg(value_name = "IN")]
    input: PathBuf,

    /// The file to write; its name ends in .rrd or .mcap.
    #[arg(value_name = "OUT")]
    output: PathBuf,

    #[command(flatten)]
    channels: ChannelFlags,

    /// Replace an existing file, when the new one is whole.
    #[arg(long, short)]
    force: bool,

    #[command(flatten)]
    memory: MemoryFlag,
}

pub fn run(arguments: &Arguments) -> anyhow::Result<Verdict> {
    let inputs = [Some(arguments.input.as_path())];
    let output = Output::named(&arguments.output, &inputs, arguments.force)?;
    end_when_interrupted()?;
    let mut recording = Recording::open_within(&arguments.input, arguments.memory.budget())?;
    let held = recording.scene().channels;
    let channels = arguments.channels.over(held)?.unwrap_or(held);
    write(&mut recording, &output, channels)
}

/// Writes what `channels` ask of a recording, and says what came of it.
pub(super) fn write(
    recording: &mut Recording,
    output: &Output,
    channels: Channels,
) -> anyhow::Result<Verdict> {
    let header = convert::header(recording, channels)?;
    let writer = Writer::start_conversion(output.format, output.begin()?, header)?;
    let converted = convert::convert(recording, writer, &channels);
    let without_states = !recording.scene().channels.state.is_on();
    let converted = converted.map_err(|error| match error {
        ConvertError::Read(error) => {
            let path = shown(&output.path.display().to_string());
            let joined = !matches!(error, ReadError::Join { .. });
            let error = anyhow::Error::new(error);
            if joined && (without_states || recording.intact().is_some()) {
                error.context(format!("{path} holds what came before the damage"))
            } else {
                error.context(format!("{path} was not made or replaced"))
            }
        }
        other => other.into(),
    })?;
    let mut lines = Lines::default();
    output.tell(&converted.written, &mut lines);
    if converted.rebuilt > 0 {
        let steps = counted(converted.rebuilt, "step");
        let rebuilt = format!("{steps} computed again, in agreement with the recorded states");
        lines.line("rebuilt", rebuilt);
    }
    report(&lines.into_text())?;
    if recording.is_closed() {
        return Ok(Verdict::Good);
    }
    let intact = recording
        .intact()
        .map_or("no state".to_owned(), |step| format!("step {step}"));
    let path = shown(&output.path.display().to_string());
    anyhow::bail!(
        "{} breaks off; {path} is whole up to {intact} and names no result",
        shown(recording.path()),
    )
}
