//! `softjam record`: relaxes a scene and records it.

mod origin;
mod report;

use super::flags::{RECORDING, RELAXATION, SceneFlags};
use super::live::LiveFlags;
use super::memory::MemoryFlag;
use super::output::Output;
use super::{Verdict, bar, warn};
use indicatif::ProgressBar;
use origin::Origin;
use softjam::numerics::threads;
use softjam::protocol::Relaxation;
use softjam::record::{self, Header, RecordError, Writer};
use softjam::scene::{Minimizer, Scene, SceneFields, Start};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  softjam record                                    the default scene into softjam.rrd
  softjam record --particles 1024 --phi 0.9 --seed 7 -o run.rrd
  softjam record scene.toml --channels metrics,state -o small.rrd
  softjam record --from broken.rrd -o rest.rrd      finish a run that was interrupted
  softjam record --mcap run.mcap                    for Foxglove; beside the .rrd with -o run.rrd
  softjam record --particles 1024 --spawn           and look on
  softjam record --file mine.csv -o mine.rrd        a packing of your own, relaxed as it stands
  make-packing | softjam record --file - --relax-disks -o mine.rrd
                                                    one strewn at random, its disks relaxed first, through a pipe
Open a recording with the rerun viewer (pip install rerun-sdk): rerun run.rrd

RUN.rrd is written as RUN.rrd.part until it holds its first state, and then takes its place: from then on it can be read, and gone
on from with --from if the run is killed, which loses a second or less. What a run that was killed before (kill -9) has left as
RUN.rrd.part the next one takes over.

Exit codes: 0 converged, 1 could not be done or interrupted (the file is readable up to the last step), 2 the request makes no
sense, 3 not converged within --steps")]
pub struct Arguments {
    #[command(flatten)]
    scene: SceneFlags,

    /// Go on from a recorded frame of an earlier run, exactly as that run did or would have done; with another --threshold,
    /// --minimizer or --forces from what these make of the frame, with another --model from its positions.
    #[arg(
        long,
        value_name = "RUN.rrd",
        help_heading = "Continue",
        conflicts_with_all = [
            "scene", "particles", "phi", "aspect", "seed", "start", "file", "separate", "relax_disks", "record_disks",
            "line_tension", "dt_max", "contact_rule", "contact_solver",
        ]
    )]
    from: Option<PathBuf>,

    /// The recorded step to go on from [default: the last].
    #[arg(long, value_name = "K", requires = "from", help_heading = "Continue")]
    step: Option<u64>,

    /// File to record into; its name ends in .rrd or .mcap [default: softjam.rrd, if no MCAP is asked for].
    #[arg(long, short, value_name = "RUN.rrd", help_heading = RECORDING)]
    output: Option<PathBuf>,

    /// File to record into as MCAP, alone or beside the one of -o; its name ends in .mcap.
    #[arg(long, value_name = "RUN.mcap", help_heading = RECORDING)]
    mcap: Option<PathBuf>,

    /// Threads that relax, 1 or 2: the same bits, sooner for one packing of some 7000 particles or more. For many runs, start
    /// several at a time instead.
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u8).range(1..=2), help_heading = RELAXATION)]
    threads: u8,

    /// Replace an existing file, as soon as the first state is recorded: until then it is as it was, and a run that fails before
    /// leaves it so.
    #[arg(long, short, help_heading = RECORDING)]
    force: bool,

    #[command(flatten)]
    live: LiveFlags,

    #[command(flatten)]
    memory: MemoryFlag,
}

pub fn run(arguments: &Arguments) -> anyhow::Result<Verdict> {
    threads::with(arguments.threads.into(), || relax_and_record(arguments))?
}

fn relax_and_record(arguments: &Arguments) -> anyhow::Result<Verdict> {
    let budget = arguments.memory.budget();
    let (origin, outputs) = match &arguments.from {
        None => {
            let scene = arguments.scene.scene()?;
            // Before a start file is waited for, which may be a pipe.
            let outputs = outputs(arguments, &scene)?;
            let file = arguments.scene.file();
            (Origin::of_scene(scene, file, budget)?, outputs)
        }
        Some(path) => {
            let over = |fields: SceneFields| arguments.scene.scene_over(fields);
            let origin = Origin::of_recording(path, arguments.step, over, budget)?;
            let outputs = outputs(arguments, &origin.scene)?;
            (origin, outputs)
        }
    };
    origin.fits_in_memory(&arguments.memory)?;
    let (scene, legs) = (origin.scene.clone(), origin.legs.clone());
    warn_of_threshold(&scene);
    watch_for_signals()?;
    // Whoever cannot have a file hears of it before the disks relax.
    let files = outputs.iter().map(Output::begin);
    let files = files.collect::<Result<Vec<_>, _>>()?;

    let start = Instant::now();
    let mut run = origin.run()?;
    let before = start.elapsed();
    let header = Header {
        legs,
        ..Header::of(&scene, &run)
    };
    let writers = outputs.iter().zip(files);
    let writers = writers.map(|(output, file)| Writer::start(output.format, file, header.clone()));
    let writers = writers.collect::<Result<Vec<_>, _>>()?;
    let live = arguments.live.start(&header);
    RECORDING_BEGUN.store(true, Ordering::Relaxed);
    let (from, start) = (run.step(), Instant::now());
    let bar = bar("{bar:24} {msg}");
    let recorded = record::record_live(&mut run, writers, live.view(), &scene.channels, |run| {
        show(&bar, run, scene.threshold, (from, start));
        !INTERRUPTED.load(Ordering::Relaxed)
    });
    bar.finish_and_clear();
    let summary = recorded?;
    let steps = (run.step() - from, start.elapsed());
    super::report(&report::of(&outputs, &scene, &run, &summary, before, steps))?;
    live.finish(summary.outcome)?;
    let particles = run.packing().len();
    let model = scene.stage(run.stage()).model;
    let validity = model.validity(&run.contacts(), particles, scene.line_tension);
    if let Some(warning) = validity.and_then(|v| v.warning()) {
        warn(&format!("{warning}; --model wet-foam has no such range"));
    }
    Ok(match summary.outcome {
        None => Verdict::Incomplete,
        Some(outcome) if outcome.converged => Verdict::Good,
        Some(_) => Verdict::Bad,
    })
}

/// The files to write, which can be written.
fn outputs(arguments: &Arguments, scene: &Scene) -> Result<Vec<Output>, RecordError> {
    let start = match &scene.start {
        Start::File { path, .. } => arguments.scene.file().or(Some(Path::new(path))),
        Start::Random | Start::Hexagonal => None,
    };
    let inputs = [arguments.from.as_deref(), start, arguments.scene.path()];
    let force = arguments.force;
    let (named, mcap) = (arguments.output.as_deref(), arguments.mcap.as_deref());
    if let (Some(one), Some(other)) = (named, mcap)
        && record::same_file(one, other)
    {
        let path = other.display().to_string();
        return Err(RecordError::Twice { path });
    }
    // Without a name for either it is this.
    let named = named.or_else(|| mcap.is_none().then_some(Path::new("softjam.rrd")));
    let named = named.map(|path| Output::named(path, &inputs, force));
    let mcap = mcap.map(|path| Output::mcap(path, &inputs, force));
    named.into_iter().chain(mcap).collect()
}

/// Warns of a threshold below what the forces are exact to.
fn warn_of_threshold(scene: &Scene) {
    // Newton's method carries the forces along with the positions; only round-off holds it up.
    let (least, reason) = match scene.minimizer {
        Minimizer::Fire => {
            let least = scene.contact_tolerance;
            (least, format!("contact_tolerance = {least:e} resolves"))
        }
        Minimizer::FireNewton => (1e-14, "round-off leaves".to_owned()),
    };
    let threshold = scene.threshold;
    if threshold < least {
        warn(&format!(
            "threshold = {threshold:e} is below what {reason}: the run may never converge"
        ));
    }
}

/// Whether there is a recording to close; before, an interruption loses nothing.
static RECORDING_BEGUN: AtomicBool = AtomicBool::new(false);

/// Whether Ctrl-C or SIGTERM has come.
static INTERRUPTED: AtomicBool = AtomicBool::new(false);

fn watch_for_signals() -> anyhow::Result<()> {
    ctrlc::set_handler(|| {
        let again = INTERRUPTED.swap(true, Ordering::Relaxed);
        if again || !RECORDING_BEGUN.load(Ordering::Relaxed) {
            record::abandon_new_files(|| {
                warn(if again {
                    "aborted"
                } else {
                    "interrupted before the first frame; no file was made or replaced"
                });
                std::process::exit(1);
            });
        }
        warn(
            "ending behind this step; once more to abort, which may leave the file without its last steps",
        );
    })?;
    Ok(())
}

/// The bar follows the decades that f_max has still to fall; `from` is the step and the time at which the run began.
fn show(bar: &ProgressBar, run: &Relaxation, threshold: f64, from: (u64, Instant)) {
    if bar.is_hidden() || !run.step().is_multiple_of(16) {
        return;
    }
    let decades = |x: f64| libm::log10(x.max(threshold) / threshold);
    let (step, f_max, contacts) = (run.step(), run.f_max(), run.contacts().pairs.len());
    let done = 1.0 - decades(f_max) / decades(1.0).max(1.0);
    bar.set_position((1000.0 * done.clamp(0.0, 1.0)) as u64);
    let rate = rate(step - from.0, from.1.elapsed());
    bar.set_message(format!(
        "step {step}  f_max {f_max:.2e}  contacts {contacts}  {rate:.0} steps/s"
    ));
}

/// Steps a second.
fn rate(steps: u64, took: Duration) -> f64 {
    steps as f64 / took.as_secs_f64().max(1e-9)
}
