//! `softjam info`: says what a recording holds.

mod table;

use super::lines::Lines;
use super::memory::MemoryFlag;
use super::{Verdict, complain, print};
use serde_json::{Map, Value, json};
use softjam::analysis::FrameForces;
use softjam::analysis::Observables;
use softjam::analysis::Stability;
use softjam::budget::Budget;
use softjam::contacts::FrameContacts;
use softjam::models::droplet::validity::{SQUEEZE_LIMIT, Validity};
use softjam::record::Outcome;
use softjam::replay::{Event, ReadError, Recording, Standing};
use softjam::state::{Frame, Packing};
use softjam::text::{counted, shown};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  softjam info run.rrd                        what was run, how it ended, what is recorded
  softjam info run.rrd --json | jq .f_max     one object for scripts: status, particles, phi, seed, metrics, squeeze, …
  softjam info a.rrd b.rrd c.mcap             a table, a line a file; with --csv for other programs, with --json an array
  softjam info run.rrd > what.txt && echo converged

The status of a recording is one word: converged, step-limit (it ended by its step limit), interrupted (its writer closed it before
the run had a result) or broken-off (the file was cut, or cut and then mended by another program).

The squeeze of a droplet is Σf/2πγ over its contacts, at the last state: beyond 0.0659 the model's own forces are too small
by more than 10 %. Disks, whose law is meant as it stands, have none.

Exit codes: 0 converged, 1 damaged or not a recording (what comes before the damage is told; others are told all the same), 2 a bad
flag, 3 not converged: step-limit, interrupted or broken-off")]
pub struct Arguments {
    /// The recordings, .rrd or .mcap; of several there is a table.
    #[arg(value_name = "RUN.rrd", required = true)]
    files: Vec<PathBuf>,

    /// Print one JSON object instead of lines, an array of them for several files.
    #[arg(long)]
    json: bool,

    /// Print the table as CSV, with all digits: file, status, stability, model, particles, phi, seed, steps, f_max,
    /// coordination, pressure, energy, rattlers.
    #[arg(long, conflicts_with = "json")]
    csv: bool,

    #[command(flatten)]
    memory: MemoryFlag,
}

/// What a pass over the file finds.
#[derive(Default)]
struct Findings {
    /// Recorded steps of each channel: how many, the first and the last.
    channels: BTreeMap<String, (u64, u64, u64)>,
    /// The last value of each metric.
    metrics: BTreeMap<&'static str, f64>,
    /// The last state.
    last: Option<Frame>,
    /// The first recorded step of the droplets, where their disks are recorded before them.
    droplets_from: Option<u64>,
    result: Option<Outcome>,
    damage: Option<ReadError>,
}

impl Findings {
    fn of(recording: &mut Recording) -> Self {
        let mut found = Self::default();
        for event in recording {
            let (channel, step) = match event {
                Ok(Event::State(frame)) => {
                    let step = frame.step;
                    if frame.stage > 0 {
                        found.droplets_from.get_or_insert(step);
                    }
                    found.last = Some(frame);
                    ("state", step)
                }
                Ok(Event::Drawn { channel, step }) => (channel, step),
                Ok(Event::Metric {
                    name, step, value, ..
                }) => {
                    let first_seen = name == "f_max";
                    found.metrics.insert(name, value);
                    if !first_seen {
                        continue;
                    }
                    ("metrics", step)
                }
                Ok(Event::Result { outcome, .. }) => {
                    found.result = Some(outcome);
                    continue;
                }
                Err(error) => {
                    found.damage = Some(error);
                    break;
                }
            };
            let steps = found.channels.entry(channel.to_owned());
            let steps = steps.or_insert((0, step, step));
            *steps = (steps.0 + 1, steps.1.min(step), steps.2.max(step));
        }
        found
    }

    /// How the run stood, as far as it was read.
    fn standing(&self, recording: &Recording) -> Standing {
        match self.damage {
            Some(_) => Standing::BrokenOff,
            None => recording.standing(),
        }
    }

    /// The last state and its packing; nothing if it is no state of this packing.
    fn state(&self, recording: &Recording) -> Option<(Packing, &Frame)> {
        let last = self.last.as_ref()?;
        Some((recording.packing(last).ok()?, last))
    }

    /// Stress of the last state.
    fn observables(&self, recording: &Recording) -> Option<Observables> {
        let (packing, last) = self.state(recording)?;
        let model = recording.scene().stage(last.stage).model();
        let forces = FrameForces::of(&packing, last, model).ok()?;
        Some(*forces.observables())
    }

    /// How far the last state strains a linear model.
    fn squeeze(&self, recording: &Recording) -> Option<Validity> {
        let (packing, last) = self.state(recording)?;
        let scene = recording.scene().stage(last.stage);
        let contacts = FrameContacts::of(&packing, last);
        (scene.model).validity(&contacts.view(), packing.len(), scene.line_tension)
    }
}

pub fn run(arguments: &Arguments) -> anyhow::Result<Verdict> {
    let budget = arguments.memory.budget();
    if let [file] = arguments.files.as_slice()
        && !arguments.csv
    {
        let (recording, found) = read(file, budget)?;
        let name = file.display().to_string();
        let standing = found.standing(&recording);
        print(&if arguments.json {
            format!("{:#}\n", json(&name, &recording, &found))
        } else {
            text(&name, &recording, &found)
        })?;
        return match found.damage {
            Some(error) => Err(error.into()),
            None if standing == Standing::Converged => Ok(Verdict::Good),
            None => Ok(Verdict::Bad),
        };
    }
    let mut objects = Vec::new();
    let mut verdict = Verdict::Good;
    for file in &arguments.files {
        let name = file.display().to_string();
        let (object, damage) = match read(file, budget) {
            Ok((recording, found)) => {
                if found.standing(&recording) != Standing::Converged {
                    verdict.worsen();
                }
                (json(&name, &recording, &found), found.damage)
            }
            Err(error) => {
                let (file, damage) = (shown(&name), error.to_string());
                let object = json!({ "file": file, "status": "unreadable", "damage": damage });
                (object, Some(error))
            }
        };
        objects.push(object);
        if let Some(error) = damage {
            complain(&error.into());
            verdict = Verdict::Incomplete;
        }
    }
    print(&if arguments.json {
        format!("{:#}\n", Value::Array(objects))
    } else if arguments.csv {
        table::csv(&objects)
    } else {
        table::text(&objects)
    })?;
    Ok(verdict)
}

/// A recording read to its end, and what it holds.
fn read(file: &Path, budget: Budget) -> Result<(Recording, Findings), ReadError> {
    let mut recording = Recording::open_within(file, budget)?;
    let found = Findings::of(&mut recording);
    Ok((recording, found))
}

fn state_of(recording: &Recording, found: &Findings) -> String {
    let ended = found
        .result
        .map(|end| format!("{end}, f_max = {:.3e} γ", end.f_max));
    match (found.standing(recording), ended) {
        (Standing::Converged | Standing::StepLimit, Some(ended)) => ended,
        (Standing::BrokenOff, Some(ended)) => format!("{ended}; the file breaks off behind it"),
        (Standing::BrokenOff, None) if recording.is_closed() => {
            "unfinished: cut off or interrupted, and then rewritten by another program".to_owned()
        }
        (Standing::BrokenOff, None) => "unfinished: the file breaks off".to_owned(),
        _ => "unfinished: the run was interrupted or failed".to_owned(),
    }
}

fn text(path: &str, recording: &Recording, found: &Findings) -> String {
    let closed = recording.is_closed();
    let mut lines = Lines::default();
    let scene = recording.scene();
    lines.line("file", path.to_owned());
    let (program, bits) = (recording.program(), recording.bits());
    lines.line("recorded by", format!("{program} (bits {bits})"));
    lines.line("result", state_of(recording, found));
    let (n, phi) = (recording.radii().len(), recording.coverage());
    let gamma = format!("γ = {}", scene.line_tension);
    lines.packing(scene, n, phi, recording.domain(), &gamma);
    if let Some(step) = found.droplets_from {
        lines.line(
            "stages",
            format!("undeformed disks, then droplets from step {step}"),
        );
    }
    let from = recording.from_step();
    if from > 0 {
        let changed = recording.legs().iter().any(|leg| leg.changes(scene));
        let how = if changed {
            ", there or before with another model, threshold, minimiser or forces"
        } else {
            ""
        };
        let goes_on = format!("from step {from} of another recording{how}");
        lines.line("goes on", goes_on);
    }
    for (channel, (count, first, last)) in &found.channels {
        let pictures = ["contours", "contacts"].contains(&channel.as_str());
        let drawn = if pictures && scene.channels.redraw > 0.0 {
            ", drawn where they look different"
        } else {
            ""
        };
        let steps = counted(count, "step");
        lines.line(channel, format!("{steps}, {first} … {last}{drawn}"));
    }
    if !found.channels.contains_key("state") {
        let none = if scene.channels.state.is_on() && closed {
            "none, though the scene asks for them"
        } else if scene.channels.state.is_on() {
            "none: the file breaks off before the first"
        } else {
            "none: the recording can be looked at, not replayed"
        };
        lines.line("state", none.to_owned());
    }
    if let Some(last) = &found.last {
        let digest = hex(last.digest());
        lines.line("digest", format!("{digest} (state of step {})", last.step));
    }
    if let Some(squeeze) = found.squeeze(recording) {
        let (mean, largest, particle) = (squeeze.mean, squeeze.largest, squeeze.particle);
        let (beyond, of) = (squeeze.beyond, counted(squeeze.particles, "particle"));
        let squeeze = format!(
            "mean {mean:.4}, largest {largest:.4} (particle {particle}); {beyond} of {of} beyond {SQUEEZE_LIMIT}"
        );
        lines.line("squeeze", squeeze);
    }
    if let Some(o) = found.observables(recording) {
        let (xx, yy, xy) = (o.stress_xx(), o.stress_yy(), o.stress_xy());
        let stress =
            format!("σ_xx {xx:.6e}, σ_yy {yy:.6e}, σ_xy {xy:.6e} γ/length (tension positive)");
        lines.line("stress", stress);
    }
    for (name, value) in &found.metrics {
        let counts = ["contacts", "rattlers"].contains(name);
        lines.line(
            name,
            if counts {
                value.to_string()
            } else {
                format!("{value:.6e}")
            },
        );
    }
    lines.into_text()
}

/// BLAKE3 in hexadecimal, as `b3sum` writes it.
fn hex(digest: [u8; 32]) -> String {
    blake3::Hash::from_bytes(digest).to_hex().to_string()
}

fn json(path: &str, recording: &Recording, found: &Findings) -> Value {
    let (scene, l) = (recording.scene(), recording.domain().lengths());
    let channels: Map<String, Value> = found
        .channels
        .iter()
        .map(|(name, (count, first, last))| {
            let value = json!({ "steps": count, "first": first, "last": last });
            (name.clone(), value)
        })
        .collect();
    json!({
        "file": shown(path),
        "program": recording.program(),
        "bits": recording.bits(),
        "model": scene.model.name(),
        "droplets_from": found.droplets_from,
        "particles": recording.radii().len(),
        "phi": recording.coverage(),
        "seed": (!scene.starts_from_file()).then_some(scene.seed),
        "box": [l.x, l.y],
        "status": found.standing(recording).to_string(),
        "from_step": recording.from_step(),
        "legs": recording.legs(),
        "intact": recording.intact(),
        "closed": recording.is_closed(),
        "converged": found.result.map(|r| r.converged),
        "stability": found.result.and_then(|r| r.stability).map(Stability::name),
        "steps": found.result.map(|r| r.steps),
        "f_max": found.result.map(|r| r.f_max),
        "channels": channels,
        "digest": found.last.as_ref().map(|last| hex(last.digest())),
        "squeeze": found.squeeze(recording).map(|s| json!({
            "mean": s.mean,
            "largest": s.largest,
            "particle": s.particle,
            "beyond": s.beyond,
            "limit": SQUEEZE_LIMIT,
        })),
        "stress": found.observables(recording).map(|o| json!({
            "xx": o.stress_xx(),
            "yy": o.stress_yy(),
            "xy": o.stress_xy(),
        })),
        "metrics": found.metrics,
        "damage": found.damage.as_ref().map(ToString::to_string),
        "scene": scene.to_toml(),
    })
}
