//! `softjam info`: says what a recording holds.

use super::lines::Lines;
use super::memory::MemoryFlag;
use super::{Verdict, print};
use softjam::contact::FrameContacts;
use softjam::droplet::validity::{SQUEEZE_LIMIT, Validity};
use softjam::frame::Frame;
use softjam::record::Outcome;
use softjam::relax::Stability;
use softjam::replay::{Event, ReadError, Recording};
use std::collections::BTreeMap;
use std::path::PathBuf;

#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  softjam info run.rrd                        what was run, how it ended, what is recorded
  softjam info run.rrd --json | jq .f_max     one object for scripts: phi, box, converged, metrics, squeeze, …

The squeeze of a particle is Σf/2πγ over its contacts, at the last state: beyond 0.0659 the model's own forces are too small
by more than 10 %.

Exit codes: 0 read to its end, 1 damaged or not a recording (what comes before the damage is told), 2 a bad flag")]
pub struct Arguments {
    /// The recording, .rrd or .mcap.
    #[arg(value_name = "RUN.rrd")]
    file: PathBuf,

    /// Print one JSON object instead of lines.
    #[arg(long)]
    json: bool,

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
            let steps = found
                .channels
                .entry(channel.to_owned())
                .or_insert((0, step, step));
            *steps = (steps.0 + 1, steps.1.min(step), steps.2.max(step));
        }
        found
    }

    /// How far the last state strains the linear model; nothing if it is no state of this packing.
    fn squeeze(&self, recording: &Recording) -> Option<Validity> {
        let last = self.last.as_ref()?;
        let packing = recording.packing(last).ok()?;
        let contacts = FrameContacts::of(&packing, last);
        let line_tension = recording.scene().line_tension;
        Some(Validity::of(&contacts.view(), packing.len(), line_tension))
    }
}

pub fn run(arguments: &Arguments) -> anyhow::Result<Verdict> {
    let mut recording = Recording::open_within(&arguments.file, arguments.memory.budget())?;
    let found = Findings::of(&mut recording);
    let closed = recording.is_closed();
    if arguments.json {
        print(&json(&recording, &found, closed))?;
    } else {
        print(&text(
            &arguments.file.display().to_string(),
            &recording,
            &found,
            closed,
        ))?;
    }
    match found.damage {
        Some(error) => Err(error.into()),
        None => Ok(Verdict::Good),
    }
}

fn state_of(found: &Findings, closed: bool) -> String {
    match (found.result, closed) {
        (Some(end), _) => format!("{end}, f_max = {:.3e} γ", end.f_max),
        (None, true) => "unfinished: the run was interrupted or failed".to_owned(),
        (None, false) => "unfinished: the file breaks off".to_owned(),
    }
}

fn text(path: &str, recording: &Recording, found: &Findings, closed: bool) -> String {
    let mut lines = Lines::default();
    let l = recording.domain().lengths();
    let scene = recording.scene();
    lines.line("file", path.to_owned());
    lines.line(
        "recorded by",
        format!("{} (bits {})", recording.program(), recording.bits()),
    );
    lines.line("result", state_of(found, closed));
    lines.line(
        "packing",
        format!(
            "N = {}, φ = {:.4}, box {:.3} × {:.3}, γ = {}",
            recording.radii().len(),
            recording.coverage(),
            l.x,
            l.y,
            scene.line_tension
        ),
    );
    for (channel, (count, first, last)) in &found.channels {
        let pictures =
            scene.channels.redraw > 0.0 && ["contours", "contacts"].contains(&&**channel);
        let where_drawn = if pictures {
            ", drawn where they look different"
        } else {
            ""
        };
        lines.line(
            channel,
            format!("{count} steps, {first} … {last}{where_drawn}"),
        );
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
        lines.line(
            "squeeze",
            format!(
                "mean {:.4}, largest {:.4} (particle {}); {} of {} particles beyond {SQUEEZE_LIMIT}",
                squeeze.mean, squeeze.largest, squeeze.particle, squeeze.beyond, squeeze.particles
            ),
        );
    }
    for (name, value) in &found.metrics {
        lines.line(name, format!("{value:.6e}"));
    }
    lines.into_text()
}

/// BLAKE3 in hexadecimal, as `b3sum` writes it.
fn hex(digest: [u8; 32]) -> String {
    blake3::Hash::from_bytes(digest).to_hex().to_string()
}

fn json(recording: &Recording, found: &Findings, closed: bool) -> String {
    let l = recording.domain().lengths();
    let channels: serde_json::Map<String, serde_json::Value> = found
        .channels
        .iter()
        .map(|(name, (count, first, last))| {
            let value = serde_json::json!({ "steps": count, "first": first, "last": last });
            (name.clone(), value)
        })
        .collect();
    let value = serde_json::json!({
        "program": recording.program(),
        "bits": recording.bits(),
        "particles": recording.radii().len(),
        "phi": recording.coverage(),
        "box": [l.x, l.y],
        "closed": closed,
        "converged": found.result.map(|r| r.converged),
        "stability": found.result.and_then(|r| r.stability).map(Stability::name),
        "steps": found.result.map(|r| r.steps),
        "f_max": found.result.map(|r| r.f_max),
        "channels": channels,
        "digest": found.last.as_ref().map(|last| hex(last.digest())),
        "squeeze": found.squeeze(recording).map(|s| serde_json::json!({
            "mean": s.mean,
            "largest": s.largest,
            "particle": s.particle,
            "beyond": s.beyond,
            "limit": SQUEEZE_LIMIT,
        })),
        "metrics": found.metrics,
        "damage": found.damage.as_ref().map(ToString::to_string),
        "scene": recording.scene().to_toml(),
    });
    format!("{value:#}\n")
}
