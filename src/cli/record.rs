//! `softjam record`: relaxes a scene and records it.

use super::flags::{RECORDING, RELAXATION, SceneFlags};
use super::lines::Lines;
use super::live::LiveFlags;
use super::memory::MemoryFlag;
use super::output::{Output, open_with};
use super::{Verdict, talks, warn};
use indicatif::{HumanBytes, ProgressBar, ProgressStyle};
use softjam::BITS;
use softjam::analysis::Observables;
use softjam::analysis::Stability;
use softjam::numerics::threads;
use softjam::protocol::{Relaxation, Status};
use softjam::record::{self, Header, Leg, RecordError, Summary, Writer};
use softjam::replay::{Event, Recording};
use softjam::scene::start::StartFile;
use softjam::scene::{Minimizer, Scene, SceneError, SceneFields, Start};
use softjam::state::Frame;
use softjam::state::Packing;
use softjam::text::{counted, length, shown};
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
    /// --minimizer or --forces from what these make of the frame.
    #[arg(
        long,
        value_name = "RUN.rrd",
        help_heading = "Continue",
        conflicts_with_all = [
            "scene", "particles", "phi", "aspect", "seed", "start", "file", "separate", "relax_disks", "line_tension",
            "dt_max", "contact_rule", "contact_solver",
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
    let (origin, outputs) = match &arguments.from {
        None => {
            let scene = arguments.scene.scene()?;
            // Before a start file is waited for, which may be a pipe.
            let outputs = outputs(arguments, &scene)?;
            (beginning(arguments, scene)?, outputs)
        }
        Some(path) => {
            let origin = recorded_frame(path, arguments)?;
            let outputs = outputs(arguments, origin.scene())?;
            (origin, outputs)
        }
    };
    let (scene, legs) = (origin.scene().clone(), origin.legs());
    fits_in_memory(&origin, &arguments.memory)?;
    // Newton's method carries the forces along with the positions; only round-off holds it up.
    let (least, reason) = match scene.minimizer {
        Minimizer::Fire => (
            scene.contact_tolerance,
            format!("contact_tolerance = {:e} resolves", scene.contact_tolerance),
        ),
        Minimizer::FireNewton => (1e-14, "round-off leaves".to_owned()),
    };
    if scene.threshold < least {
        warn(&format!(
            "threshold = {:e} is below what {reason}: the run may never converge",
            scene.threshold
        ));
    }
    let phase = Phase::watch_for_signals()?;
    // Whoever cannot have a file hears of it before the disks relax.
    let files = outputs.iter().map(|output| output.begin(arguments.force));
    let files = files.collect::<Result<Vec<_>, _>>()?;

    let start = Instant::now();
    let mut run = match origin {
        Origin::Scene(scene) => Relaxation::new(&scene)?,
        Origin::File(scene, packing) => Relaxation::of_start(&scene, packing)?,
        Origin::Frame(from) => from.run()?,
    };
    let disks = start.elapsed();
    let header = Header {
        legs,
        ..Header::of(&scene, &run)
    };
    let writers = outputs.iter().zip(files);
    let writers = writers.map(|(output, file)| Writer::start(output.format, file, header.clone()));
    let writers = writers.collect::<Result<Vec<_>, _>>()?;
    let live = arguments.live.start(&header);
    phase.recording();
    let from = run.step();
    let bar = Progress::new(&scene, from);
    let start = Instant::now();
    let recorded = record::record_live(&mut run, writers, live.view(), &scene.channels, |run| {
        bar.show(run, start);
        phase.goes_on()
    });
    bar.clear();
    let summary = recorded?;
    super::report(&report(
        &outputs,
        &scene,
        &run,
        &summary,
        from,
        (disks, start.elapsed()),
    ))?;
    live.finish(summary.outcome)?;
    let particles = run.packing().len();
    let validity = (scene.model).validity(&run.contacts(), particles, scene.line_tension);
    if let Some(warning) = validity.and_then(|v| v.warning()) {
        warn(&warning);
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

/// What Ctrl-C and SIGTERM find: nothing to lose while the disks relax, a recording to close afterwards.
#[derive(Clone)]
struct Phase {
    recording: Arc<AtomicBool>,
    interrupted: Arc<AtomicBool>,
}

impl Phase {
    fn watch_for_signals() -> anyhow::Result<Self> {
        let phase = Self {
            recording: Arc::default(),
            interrupted: Arc::default(),
        };
        let seen = phase.clone();
        ctrlc::set_handler(move || {
            let again = seen.interrupted.swap(true, Ordering::Relaxed);
            if again || !seen.recording.load(Ordering::Relaxed) {
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
        Ok(phase)
    }

    fn recording(&self) {
        self.recording.store(true, Ordering::Relaxed);
    }

    fn goes_on(&self) -> bool {
        !self.interrupted.load(Ordering::Relaxed)
    }
}

/// Where a run begins.
enum Origin {
    Scene(Scene),
    /// With the packing of a start file, its disks not yet relaxed.
    File(Scene, Packing),
    Frame(Box<Continuation>),
}

impl Origin {
    fn scene(&self) -> &Scene {
        match self {
            Self::Scene(scene) | Self::File(scene, _) => scene,
            Self::Frame(from) => &from.scene,
        }
    }

    fn legs(&self) -> Vec<Leg> {
        match self {
            Self::Frame(from) => from.legs.clone(),
            Self::Scene(_) | Self::File(..) => Vec::new(),
        }
    }
}

/// A recorded frame to go on from.
struct Continuation {
    scene: Scene,
    packing: Packing,
    frame: Frame,
    /// What the run went by before.
    legs: Vec<Leg>,
    /// Whether its scene is changed at the frame.
    changed: bool,
}

impl Continuation {
    fn new(recording: &Recording, scene: Scene, frame: Frame) -> anyhow::Result<Self> {
        let packing = recording.packing(&frame)?;
        let leg = Leg::of(recording.scene(), frame.step);
        let changed = leg.changes(&scene);
        let legs = recording.legs().iter().copied();
        let legs = legs.chain(changed.then_some(leg)).collect();
        if scene.steps < frame.step {
            return Err(SceneError::Range {
                field: "steps".to_owned(),
                value: scene.steps.to_string(),
                allowed: format!("steps ≥ {}, the step that the run goes on from", frame.step),
            }
            .into());
        }
        Ok(Self {
            scene,
            packing,
            frame,
            legs,
            changed,
        })
    }

    fn run(self) -> anyhow::Result<Relaxation> {
        let begin = if self.changed {
            Relaxation::take_over
        } else {
            Relaxation::resume
        };
        let run = begin(&self.scene, self.packing, self.frame)?;
        // Its replay would have nothing to run.
        if run.status() != Status::Running && self.scene.starts_from_file() {
            let step = run.step();
            return Err(SceneError::Needs {
                field: "from".to_owned(),
                value: format!("step {step}"),
                needs: "a run that goes on behind it: with this threshold and step limit it ends there; go on from an earlier --step"
                    .to_owned(),
            }
            .into());
        }
        Ok(run)
    }
}

/// Where a run of a scene begins; its start file is read here, and only here, since it may be a pipe.
fn beginning(arguments: &Arguments, scene: Scene) -> anyhow::Result<Origin> {
    let Start::File {
        path,
        blake3,
        preparation,
    } = &scene.start
    else {
        return Ok(Origin::Scene(scene));
    };
    // The name as it was given: no scene holds one that is not UTF-8.
    let path = arguments.scene.file().unwrap_or(Path::new(path));
    let file = StartFile::read_within(path, arguments.memory.budget())?;
    let start = file.start(blake3.as_deref(), *preparation)?;
    let (packing, coincidences) = file.prepared(*preparation)?;
    if let Some(first) = coincidences.first() {
        warn(&format!(
            "particles of one point are put beside each other, {} of {}; the first: {first}",
            coincidences.len(),
            packing.len()
        ));
    }
    Ok(Origin::File(Scene { start, ..scene }, packing))
}

/// The frame to go on from, and its scene with what the flags change about its end and its recording.
fn recorded_frame(path: &Path, arguments: &Arguments) -> anyhow::Result<Origin> {
    let mut recording = Recording::open_within(path, arguments.memory.budget())?;
    if !recording.has_same_bits() {
        return Err(SceneError::Needs {
            field: "from".to_owned(),
            value: path.display().to_string(),
            needs: format!(
                "a recording with bits {BITS}, as this program computes; it has bits {}, and {} can go on from it",
                recording.bits(),
                shown(recording.program())
            ),
        }
        .into());
    }
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
        Some(frame) if arguments.step.is_none_or(|k| k == frame.step) => Ok(Origin::Frame(
            Box::new(Continuation::new(&recording, scene, frame)?),
        )),
        _ if last.is_none() && arguments.step.is_none() => {
            let closed = recording.is_closed();
            Err(SceneError::Needs {
                field: "from".to_owned(),
                value: path.display().to_string(),
                needs: if closed {
                    "a recorded state, which only a recording with --channels state,… has"
                        .to_owned()
                } else {
                    "a recorded state, and breaks off before the first".to_owned()
                },
            }
            .into())
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
fn fits_in_memory(origin: &Origin, memory: &MemoryFlag) -> Result<(), SceneError> {
    let scene = origin.scene();
    let particles = match origin {
        Origin::Frame(from) => from.packing.len(),
        Origin::File(_, packing) => packing.len(),
        Origin::Scene(scene) => scene.particles,
    };
    let needed = scene.memory_estimate(particles);
    // Where the system does not tell, it is asked the hard way.
    match memory.free() {
        Some(available) if needed > available => Err(SceneError::Memory {
            particles,
            needed_mib: needed >> 20,
            available_mib: available >> 20,
        }),
        _ => Ok(()),
    }
}

/// The progress bar; none unless standard error is a terminal.
struct Progress {
    bar: Option<ProgressBar>,
    threshold: f64,
    /// The step that the run begins with.
    from: u64,
}

impl Progress {
    fn new(scene: &Scene, from: u64) -> Self {
        let bar = (talks() && std::io::stderr().is_terminal()).then(|| {
            let bar = ProgressBar::new(1000);
            let style = ProgressStyle::with_template("{bar:24} {msg}");
            bar.set_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()));
            bar
        });
        Self {
            bar,
            threshold: scene.threshold,
            from,
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
            (run.step() - self.from) as f64 / seconds
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
    outputs: &[Output],
    scene: &Scene,
    run: &Relaxation,
    summary: &Summary,
    from: u64,
    (start_took, took): (Duration, Duration),
) -> String {
    let o: Observables = run.observables();
    let packing = run.packing();
    let l = packing.domain().lengths();
    let verdict = match summary.outcome {
        None => format!("interrupted at step {}", run.step()),
        Some(end) if end.stability == Some(Stability::Saddle) => {
            format!("{end} (--minimizer fire+newton goes on from there)")
        }
        Some(end) => end.to_string(),
    };
    let mut lines = Lines::default();
    lines.line("result", verdict);
    let origin = match &scene.start {
        Start::File { path, .. } => format!("from {path}"),
        Start::Random | Start::Hexagonal => format!("seed {}", scene.seed),
    };
    lines.line(
        "packing",
        format!(
            "N = {}, φ = {:.4}, box {} × {}, {origin}",
            packing.len(),
            packing.coverage(),
            length(l.x),
            length(l.y)
        ),
    );
    if let Some(disks) = run.disks() {
        let ending = if disks.converged { "" } else { " (step limit)" };
        lines.line(
            "disks",
            format!(
                "{} to f_max = {:.2e} γ, Z = {:.3}{ending}",
                counted(disks.steps, "step"),
                disks.f_max,
                disks.coordination
            ),
        );
    }
    lines.line(
        "f_max",
        format!("{:.3e} γ (threshold {:.1e} γ)", o.f_max, scene.threshold),
    );
    lines.line(
        "Z",
        format!(
            "{:.4} ({} between particles that are held, {})",
            o.coordination(),
            counted(o.backbone_contacts, "contact"),
            counted(o.rattlers, "rattler")
        ),
    );
    lines.line("pressure", format!("{:.6e} γ/length", o.pressure()));
    lines.line("energy", format!("{:.6e} γ·length", o.energy));
    if let Some(law) = run.law() {
        let residual = law.residual();
        lines.line(
            "contact law",
            format!("residual {residual:.1e} of the largest overlap"),
        );
    }
    let rate = (run.step() - from) as f64 / took.as_secs_f64().max(1e-9);
    // Without disks it is the time of the first contact problem.
    let before = run.disks().map_or("start", |_| "disks");
    lines.line(
        "time",
        format!(
            "{:.2} s {before}, {:.2} s relaxation ({rate:.0} steps/s)",
            start_took.as_secs_f64(),
            took.as_secs_f64()
        ),
    );
    for (output, written) in outputs.iter().zip(&summary.files) {
        lines.line(
            "file",
            format!(
                "{} ({}, {})",
                output.path.display(),
                HumanBytes(written.bytes),
                counted(written.states, "state")
            ),
        );
        lines.line("open it with", open_with(&output.path, output.format));
    }
    lines.into_text()
}
