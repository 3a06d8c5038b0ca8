//! `softjam record`: relaxes a scene and records it.

use super::flags::{RECORDING, SceneFlags};
use super::{Verdict, print};
use indicatif::{HumanBytes, ProgressBar, ProgressStyle};
use softjam::force::Observables;
use softjam::frame::Frame;
use softjam::packing::Packing;
use softjam::record::{self, Header, Summary, Writer};
use softjam::relax::Relaxation;
use softjam::replay::{Event, Recording};
use softjam::scene::{Scene, SceneError, SceneFields};
use std::fmt::Write as _;
use std::io::IsTerminal as _;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  softjam record                                    the default scene into softjam.rrd
  softjam record --particles 1024 --phi 0.9 --seed 7 -o run.rrd
  softjam record scene.toml --channels metrics,state -o small.rrd
  softjam record --from broken.rrd -o rest.rrd      finish a run that was interrupted
Open a recording with the rerun viewer (pip install rerun-sdk==0.36.3): rerun run.rrd")]
pub struct Arguments {
    #[command(flatten)]
    scene: SceneFlags,

    /// Go on from a recorded frame of an earlier run of the same scene, exactly as that run did or would have done.
    #[arg(
        long,
        value_name = "RUN.rrd",
        help_heading = "Continue",
        conflicts_with_all = [
            "scene", "particles", "phi", "aspect", "seed", "start", "file", "line_tension",
            "dt_max", "contact_rule", "contact_solver",
        ]
    )]
    from: Option<PathBuf>,

    /// The recorded step to go on from; by default the last.
    #[arg(long, value_name = "K", requires = "from", help_heading = "Continue")]
    step: Option<u64>,

    /// File to record into.
    #[arg(long, short, value_name = "RUN.rrd", default_value = "softjam.rrd", help_heading = RECORDING)]
    output: PathBuf,

    /// Replace an existing file.
    #[arg(long, short, help_heading = RECORDING)]
    force: bool,
}

pub fn run(arguments: &Arguments) -> anyhow::Result<Verdict> {
    let origin = match &arguments.from {
        None => Origin::Scene(arguments.scene.scene()?.pinned()?),
        Some(path) => recorded_frame(path, arguments)?,
    };
    let scene = origin.scene().clone();
    fits_in_memory(&scene)?;
    // Before minutes are spent on a packing that could not be written.
    if !arguments.force && arguments.output.exists() {
        return Err(record::RecordError::Exists {
            path: arguments.output.display().to_string(),
        }
        .into());
    }
    let interrupted = Arc::new(AtomicBool::new(false));
    let flag = Arc::clone(&interrupted);
    ctrlc::set_handler(move || {
        if flag.swap(true, Ordering::Relaxed) {
            // Asked twice: the user does not want to wait for the end of a step, or of the disks.
            std::process::exit(1);
        }
    })?;

    let start = Instant::now();
    let mut run = match origin {
        Origin::Scene(scene) => Relaxation::new(&scene)?,
        Origin::Frame(scene, packing, frame) => Relaxation::resume(&scene, packing, *frame)?,
    };
    let disks = start.elapsed();
    let writer = Writer::create(&arguments.output, arguments.force, Header::of(&scene, &run))?;
    let bar = Bar::new(&scene);
    let start = Instant::now();
    let recorded = record::record(&mut run, writer, &scene.channels, |run| {
        bar.show(run, start);
        !interrupted.load(Ordering::Relaxed)
    });
    bar.clear();
    let summary = recorded?;
    print(&report(
        &arguments.output,
        &scene,
        &run,
        &summary,
        (disks, start.elapsed()),
    ))?;
    Ok(match summary.outcome {
        None => Verdict::Interrupted,
        Some(outcome) if outcome.converged => Verdict::Good,
        Some(_) => Verdict::Bad,
    })
}

/// Where a run begins.
enum Origin {
    Scene(Scene),
    Frame(Scene, Packing, Box<Frame>),
}

impl Origin {
    fn scene(&self) -> &Scene {
        match self {
            Self::Scene(scene) | Self::Frame(scene, ..) => scene,
        }
    }
}

/// The frame to go on from, and its scene with what the flags change about its end and its recording.
fn recorded_frame(path: &Path, arguments: &Arguments) -> anyhow::Result<Origin> {
    let mut recording = Recording::open(path)?;
    let fields = SceneFields::from_toml(&recording.scene().to_toml())?;
    let scene = arguments.scene.scene_over(fields)?;
    let mut found = None;
    // Not consumed: the recording is asked for its packing afterwards.
    for event in recording.by_ref() {
        if let Event::State(frame) = event? {
            let step = frame.step;
            if arguments.step.is_none_or(|k| step <= k) {
                found = Some(frame);
            }
            if arguments.step.is_some_and(|k| step >= k) {
                break;
            }
        }
    }
    let last = found.as_ref().map(|frame| frame.step);
    match found {
        Some(frame) if arguments.step.is_none_or(|k| k == frame.step) => {
            let packing = recording.packing(&frame)?;
            Ok(Origin::Frame(scene, packing, Box::new(frame)))
        }
        _ => Err(SceneError::Range {
            field: "step".to_owned(),
            value: arguments.step.map_or("last".to_owned(), |k| k.to_string()),
            allowed: match last {
                Some(last) => format!("the recorded states; the nearest before it is {last}"),
                None => "the recorded states, of which there is none before it".to_owned(),
            },
        }
        .into()),
    }
}

/// Refuses a scene that would bring the machine down instead of relaxing.
fn fits_in_memory(scene: &Scene) -> Result<(), SceneError> {
    if !scene.starts_from_disks() {
        // A start file that fits in memory tells its own size.
        return Ok(());
    }
    let mut system = sysinfo::System::new();
    system.refresh_memory();
    let limit = system.cgroup_limits().map(|c| c.free_memory);
    let available = system.available_memory().min(limit.unwrap_or(u64::MAX));
    let needed = scene.memory_estimate(scene.particles);
    // Where the system does not tell, it is asked the hard way.
    if available > 0 && needed > available {
        return Err(SceneError::Memory {
            particles: scene.particles,
            needed_mib: needed >> 20,
            available_mib: available >> 20,
        });
    }
    Ok(())
}

/// The progress bar; none unless standard error is a terminal.
struct Bar {
    bar: Option<ProgressBar>,
    threshold: f64,
}

impl Bar {
    fn new(scene: &Scene) -> Self {
        let bar = std::io::stderr().is_terminal().then(|| {
            let bar = ProgressBar::new(1000);
            let style = ProgressStyle::with_template("{bar:24} {msg}");
            bar.set_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()));
            bar
        });
        Self {
            bar,
            threshold: scene.threshold,
        }
    }

    /// The bar follows the decades that f_max has still to fall.
    fn show(&self, run: &Relaxation, start: Instant) {
        let Some(bar) = &self.bar else { return };
        if !run.step().is_multiple_of(16) {
            return;
        }
        let decades = |x: f64| libm::log10(x.max(self.threshold) / self.threshold);
        let done = 1.0 - decades(run.f_max()) / decades(1.0).max(1.0);
        bar.set_position((1000.0 * done.clamp(0.0, 1.0)) as u64);
        let seconds = start.elapsed().as_secs_f64().max(1e-9);
        bar.set_message(format!(
            "step {}  f_max {:.2e}  contacts {}  {:.0} steps/s",
            run.step(),
            run.f_max(),
            run.contacts().pairs.len(),
            run.step() as f64 / seconds
        ));
    }

    fn clear(&self) {
        if let Some(bar) = &self.bar {
            bar.finish_and_clear();
        }
    }
}

/// What a physicist wants to read at the end.
fn report(
    path: &Path,
    scene: &Scene,
    run: &Relaxation,
    summary: &Summary,
    (disks_took, took): (Duration, Duration),
) -> String {
    let o: Observables = run.observables();
    let packing = run.packing();
    let l = packing.domain().lengths();
    let verdict = match summary.outcome {
        None => format!("interrupted at step {}", run.step()),
        Some(end) if end.converged => format!("converged in {} steps", end.steps),
        Some(end) => format!("not converged within {} steps", end.steps),
    };
    let mut text = String::new();
    let mut line = |name: &str, value: String| {
        // Writing to a String cannot fail.
        let _ = writeln!(text, "{name:<14} {value}");
    };
    line("result", verdict);
    line(
        "packing",
        format!(
            "N = {}, φ = {:.4}, box {:.3} × {:.3}, seed {}",
            packing.len(),
            packing.coverage(),
            l.x,
            l.y,
            scene.seed
        ),
    );
    if let Some(disks) = run.disks() {
        let ending = if disks.converged { "" } else { " (step limit)" };
        line(
            "disks",
            format!(
                "{} steps to f_max = {:.2e} γ, Z = {:.3}{ending}",
                disks.steps, disks.f_max, disks.coordination
            ),
        );
    }
    line(
        "f_max",
        format!("{:.3e} γ (threshold {:.1e} γ)", o.f_max, scene.threshold),
    );
    line(
        "Z",
        format!(
            "{:.4} ({} contacts, {} rattlers)",
            o.coordination(),
            o.contacts,
            o.rattlers
        ),
    );
    line("pressure", format!("{:.6e} γ/length", o.pressure()));
    line("energy", format!("{:.6e} γ·length", o.energy));
    line(
        "contact law",
        format!(
            "residual {:.1e} of the largest overlap",
            run.law().residual()
        ),
    );
    let rate = run.step() as f64 / took.as_secs_f64().max(1e-9);
    line(
        "time",
        format!(
            "{:.2} s disks, {:.2} s relaxation ({rate:.0} steps/s)",
            disks_took.as_secs_f64(),
            took.as_secs_f64()
        ),
    );
    line(
        "file",
        format!(
            "{} ({}, {} states)",
            path.display(),
            HumanBytes(summary.bytes),
            summary.states
        ),
    );
    line("open it with", format!("rerun {}", path.display()));
    text
}
