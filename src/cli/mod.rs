//! The command line: parsing, dispatch, exit codes. One file a verb.
//!
//! Results go to standard output, diagnostics and the progress bar to standard error.

mod convert;
mod figure;
mod flags;
mod info;
mod join;
mod lines;
mod live;
mod manual;
mod memory;
mod output;
mod protocol;
mod record;
mod replay;
mod scene;

use clap::{CommandFactory as _, Parser, Subcommand};
use indicatif::{ProgressBar, ProgressStyle};
use softjam::BITS;
use softjam::convert::ConvertError;
use softjam::figure::FigureError;
use softjam::protocol::RelaxError;
use softjam::record::{FORMAT_VERSION, RecordError};
use softjam::replay::{Event, ReadError, Recording};
use softjam::scene::SceneError;
use softjam::state::Frame;
use std::fmt::Display;
use std::io::Write as _;
use std::process::ExitCode;
use std::sync::OnceLock;
use std::sync::atomic::{AtomicBool, Ordering};

const EXIT_CODES: &str = "\
Exit codes:
  0  done, and the verdict is good (converged; replay agrees)
  1  could not be done: I/O, a damaged file, a numerical failure, an interruption
  2  the request makes no sense: a bad flag, an invalid scene, a name that says no format, a file that is in the way or is
     being written
  3  done, and the verdict is bad (not converged within the step limit; info: not converged, for whatever reason; replay differs;
     forces out of balance)";

/// Relaxes packings of soft particles, droplets (the Morse–Witten model) or disks, to mechanical equilibrium and records how.
#[derive(Parser)]
#[command(version = version(), about, long_about = None, after_help = EXIT_CODES, propagate_version = true)]
struct Cli {
    #[command(subcommand)]
    verb: Verb,

    /// Tell nothing but results and errors: no warnings, no progress, no report on the files that were written. What info,
    /// replay, scene and manual print is their result.
    #[arg(long, short, global = true)]
    quiet: bool,
}

/// Name, version, and what a recording says of its own: the revision of the bits and the layout.
fn version() -> &'static str {
    static TEXT: OnceLock<String> = OnceLock::new();
    let version = env!("CARGO_PKG_VERSION");
    TEXT.get_or_init(|| format!("{version} (bits {BITS}, recording format {FORMAT_VERSION})"))
}

#[derive(Subcommand)]
enum Verb {
    /// Relax a scene and record it.
    Record(record::Arguments),
    /// Check a recording: is it what its scene gives, bit for bit, and is it in force balance?
    Replay(replay::Arguments),
    /// Say what a recording holds.
    Info(info::Arguments),
    /// Convert a recording: .rrd ⇄ .mcap, with more channels or fewer.
    Convert(convert::Arguments),
    /// Join the parts of a run that was interrupted to the recording that it would have been.
    Join(join::Arguments),
    /// Draw a packing, or the fall of f_max, as SVG, PDF or PNG.
    Figure(figure::Arguments),
    /// Write the manual pages, or print the completions of a shell.
    Manual(manual::Arguments),
    /// Print a scene file: the default one, or a file and flags with every field filled in.
    Scene(scene::Arguments),
}

/// How a verb ended well, or at least in order.
enum Verdict {
    Good,
    Bad,
    /// It was not brought to its end: the user ended it, the file breaks off, or some of several files could not be read.
    Incomplete,
}

impl Verdict {
    /// Bad, unless it is worse already.
    fn worsen(&mut self) {
        if matches!(self, Self::Good) {
            *self = Self::Bad;
        }
    }
}

/// Whether only results and errors are told.
static QUIET: AtomicBool = AtomicBool::new(false);

/// Whether what is no result may be told: warnings, progress, reports on files that were written.
fn talks() -> bool {
    !QUIET.load(Ordering::Relaxed)
}

pub fn run() -> ExitCode {
    let cli = Cli::parse();
    QUIET.store(cli.quiet, Ordering::Relaxed);
    // A decoder's panic over a damaged file is told as an error; anything else is a fault of ours and speaks up.
    let speak_up = std::panic::take_hook();
    std::panic::set_hook(Box::new(move |panic| {
        if !softjam::replay::reading_damaged_bytes() {
            speak_up(panic);
        }
    }));
    let result = match cli.verb {
        Verb::Record(arguments) => record::run(&arguments),
        Verb::Replay(arguments) => replay::run(&arguments),
        Verb::Info(arguments) => info::run(&arguments),
        Verb::Convert(arguments) => convert::run(&arguments),
        Verb::Join(arguments) => join::run(&arguments),
        Verb::Figure(arguments) => figure::run(&arguments),
        Verb::Manual(arguments) => manual::run(&arguments, &Cli::command()),
        Verb::Scene(arguments) => scene::run(&arguments),
    };
    match result {
        Ok(Verdict::Good) => ExitCode::SUCCESS,
        Ok(Verdict::Bad) => ExitCode::from(3),
        Ok(Verdict::Incomplete) => ExitCode::from(1),
        Err(error) => {
            complain(&error);
            ExitCode::from(exit_code(&error))
        }
    }
}

/// Tells an error.
fn complain(error: &anyhow::Error) {
    // Nobody is left to tell if standard error is closed too.
    let _ = writeln!(std::io::stderr(), "error: {}", message(error));
}

/// The chain of causes, without those that the error before them has already quoted.
fn message(error: &anyhow::Error) -> String {
    error.chain().fold(String::new(), |text, cause| {
        let cause = softjam::text::lines(&cause.to_string());
        match text.as_str() {
            "" => cause,
            said if said.contains(cause.trim_end()) => text,
            _ => format!("{text}: {cause}"),
        }
    })
}

/// 2 for a request that makes no sense, 1 for one that could not be met.
fn exit_code(error: &anyhow::Error) -> u8 {
    let scene = |e: &SceneError| !matches!(e, SceneError::Read { .. });
    let file = |e: &RecordError| {
        matches!(
            e,
            RecordError::Exists { .. }
                | RecordError::Busy { .. }
                | RecordError::Input { .. }
                | RecordError::Name { .. }
                | RecordError::NotMcap { .. }
                | RecordError::Twice { .. }
        )
    };
    let convert = |e: &ConvertError| match e {
        ConvertError::Write(e) => file(e),
        e => matches!(e, ConvertError::NoState { .. } | ConvertError::Scene(_)),
    };
    let figure = |e: &FigureError| match e {
        FigureError::File(e) => file(e),
        e => matches!(e, FigureError::Name { .. } | FigureError::Nothing(_)),
    };
    let read = |e: &ReadError| matches!(e, ReadError::Join { .. });
    let relax = |e: &RelaxError| matches!(e, RelaxError::Scene(e) if scene(e));
    let makes_no_sense = error.downcast_ref().is_some_and(scene)
        || error.downcast_ref().is_some_and(file)
        || error.downcast_ref().is_some_and(convert)
        || error.downcast_ref().is_some_and(figure)
        || error.downcast_ref().is_some_and(read)
        || error.downcast_ref().is_some_and(relax);
    if makes_no_sense { 2 } else { 1 }
}

/// The refusal of a value.
fn out_of_range(field: &str, value: impl Display, allowed: String) -> anyhow::Error {
    let (field, value) = (field.to_owned(), value.to_string());
    let error = SceneError::Range {
        field,
        value,
        allowed,
    };
    error.into()
}

/// The refusal of a value that needs something.
fn needs(field: &str, value: impl Display, needs: String) -> anyhow::Error {
    let (field, value) = (field.to_owned(), value.to_string());
    let error = SceneError::Needs {
        field,
        value,
        needs,
    };
    error.into()
}

/// The recorded state of a step, or of the nearest before it; without a step the last.
fn state_at(recording: &mut Recording, step: Option<u64>) -> Result<Option<Frame>, ReadError> {
    let mut found = None;
    // Not consumed: the recording is asked for its packing afterwards.
    for event in recording.by_ref() {
        if let Event::State(frame) = event? {
            let at = frame.step;
            if step.is_none_or(|k| at <= k) {
                found = Some(frame);
            }
            if step.is_some_and(|k| at >= k) {
                break;
            }
        }
    }
    Ok(found)
}

/// A progress bar on standard error; it is hidden where nobody would see it move.
fn bar(template: &str) -> ProgressBar {
    let bar = if talks() {
        ProgressBar::new(1000)
    } else {
        ProgressBar::hidden()
    };
    let style = ProgressStyle::with_template(template);
    bar.with_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()))
}

fn warn(text: &str) {
    if !talks() {
        return;
    }
    // A warning that nobody can read is no failure.
    let _ = writeln!(std::io::stderr(), "warning: {}", softjam::text::lines(text));
}

/// Writes a report on what was done to standard output.
fn report(text: &str) -> anyhow::Result<()> {
    if talks() { print(text) } else { Ok(()) }
}

/// Writes a result to standard output; a closed pipe (`| head`) is no failure.
fn print(text: &str) -> anyhow::Result<()> {
    match std::io::stdout().write_all(text.as_bytes()) {
        Err(e) if e.kind() == std::io::ErrorKind::BrokenPipe => Ok(()),
        other => Ok(other?),
    }
}
