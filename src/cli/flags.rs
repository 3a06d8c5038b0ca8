//! The flags that describe a scene. Each has a field of the same name in the scene file, over which it wins.

use super::protocol::ProtocolFlags;
use anyhow::Context as _;
use clap::Args;
use softjam::scene::{Channels, DiskFields, Scene, SceneError, SceneFields, Schedule};
use softjam::text::shown;
use std::path::{Path, PathBuf};

#[derive(Args)]
pub struct SceneFlags {
    /// Scene file (TOML), in which each of these flags has a field; flags win over it. `softjam scene` prints one. Without
    /// it, the default scene.
    #[arg(value_name = "SCENE.toml")]
    scene: Option<PathBuf>,

    /// Number of particles N, 1 … 10000000 [default: 256].
    #[arg(long, short = 'N', value_name = "N", value_parser = whole, allow_negative_numbers = true, help_heading = PACKING)]
    particles: Option<i128>,

    /// Coverage φ = Σ πR² / (L_x L_y) of the undeformed disks, 0 < φ < 1.3 [default: 0.86].
    #[arg(long, value_name = "PHI", value_parser = real, allow_negative_numbers = true, help_heading = PACKING)]
    phi: Option<f64>,

    /// Aspect L_x / L_y of the periodic box, 0.1 … 10 [default: 1].
    #[arg(long, value_name = "RATIO", value_parser = real, allow_negative_numbers = true, help_heading = PACKING)]
    aspect: Option<f64>,

    /// Seed of the random start: another seed, another sample [default: 1].
    #[arg(long, short = 's', value_name = "SEED", value_parser = seed, allow_negative_numbers = true, help_heading = PACKING)]
    seed: Option<u64>,

    /// Where the centres come from: random, hexagonal (an even N) or file [default: random].
    #[arg(long, value_name = "START", help_heading = PACKING)]
    start: Option<String>,

    /// Start from a CSV file with the header x,y,radius (or x,y,diameter) and a comment `# box = L_x, L_y`, `-` for standard
    /// input; N, φ and radii are the file's, and the packing is taken as it stands.
    #[arg(long, value_name = "PACKING.csv", help_heading = PACKING)]
    file: Option<PathBuf>,

    /// Put particles of the start file that stand on one point, or on a periodic image of it, beside each other instead of
    /// refusing them.
    #[arg(long, help_heading = PACKING)]
    separate: bool,

    /// Relax the undeformed disks of the start file first, those on one point put beside each other, for a packing that
    /// overlaps too far for the model.
    #[arg(long, help_heading = PACKING)]
    relax_disks: bool,

    /// Record the disks of the start, too, as the first stage of the recording: contours, contacts and state by this schedule
    /// (every:K or log:K), metrics by their own. Steps count from the start of the disks then.
    #[arg(long, value_name = "SCHEDULE", help_heading = RECORDING)]
    record_disks: Option<Schedule>,

    /// Line tension γ, the unit of force, 1e-100 … 1e100; disks have the stiffness k = 4πγ / 3(R_i + R_j) [default: 1].
    #[arg(long, value_name = "GAMMA", value_parser = real, allow_negative_numbers = true, help_heading = PACKING)]
    line_tension: Option<f64>,

    /// Converged when the largest net force f_max (units of γ) is not above this [default: 1e-10].
    #[arg(long, value_name = "F_MAX", value_parser = real, allow_negative_numbers = true, help_heading = RELAXATION)]
    threshold: Option<f64>,

    /// End at this step in any case [default: 200000].
    #[arg(long, value_name = "STEPS", value_parser = whole, allow_negative_numbers = true, help_heading = RELAXATION)]
    steps: Option<i128>,

    /// Model of the particles: morse-witten (droplets, linear in the forces), rounded-polygon and wet-foam (droplets that keep their area,
    /// between straight films and exactly), or disks (undeformed, f = k δ) [default: morse-witten].
    #[arg(long, value_name = "MODEL", value_parser = named::<softjam::models::Kind>, help_heading = PACKING)]
    model: Option<softjam::models::Kind>,

    /// Minimiser: fire, or fire+newton (FIRE through the rearrangements, then Newton's method) [default: fire].
    #[arg(long, value_name = "MINIMIZER", value_parser = named::<softjam::scene::Minimizer>, help_heading = RELAXATION)]
    minimizer: Option<softjam::scene::Minimizer>,

    /// Forces between droplets: central (along the lines of centres) or gradient (of the stored energy) [default: central].
    #[arg(long, value_name = "FORM", value_parser = named::<softjam::models::droplet::Form>, help_heading = RELAXATION)]
    forces: Option<softjam::models::droplet::Form>,

    /// Upper bound of the time step, in √(mass·length/γ) with mass 1 [default: 1.2/ω_max, from the largest frequency of the
    /// start].
    #[arg(long, value_name = "DT", value_parser = real, allow_negative_numbers = true, help_heading = RELAXATION)]
    dt_max: Option<f64>,

    /// How the contacts of droplets follow the positions: complementarity (solved for in every step) or saitoh (one drop-and-add a
    /// step, as in the paper) [default: complementarity].
    #[arg(long, value_name = "RULE", value_parser = named::<softjam::models::droplet::contact::Rule>, help_heading = RELAXATION)]
    contact_rule: Option<softjam::models::droplet::contact::Rule>,

    /// How the equations A f = δ of droplets are solved: conjugate-gradient, sparse-cholesky or gauss-jordan [default: conjugate-gradient].
    #[arg(long, value_name = "SOLVER", value_parser = named::<softjam::models::droplet::contact::solver::Method>, help_heading = RELAXATION)]
    contact_solver: Option<softjam::models::droplet::contact::solver::Method>,

    #[command(flatten)]
    protocol: ProtocolFlags,

    #[command(flatten)]
    channels: ChannelFlags,

    /// Vertices of a contour or a disk, 3 … 4096, beside those on the contacts [default: 32].
    #[arg(long, value_name = "N", allow_negative_numbers = true, help_heading = RECORDING)]
    vertices: Option<usize>,
}

/// The flags that say what a recording holds.
#[derive(Args)]
pub struct ChannelFlags {
    /// What to record: a list of contours, contacts, metrics, state, each as it is scheduled in the scene or with a
    /// schedule of its own, as in `metrics,state=every:10,contours=log:20` (log:K is K steps a decade); what is not named is
    /// off [default: as in the scene or the recording; in the default scene metrics at every step, the others at every 10th].
    #[arg(long, value_name = "LIST", value_parser = channel_list, help_heading = RECORDING)]
    channels: Option<ChannelList>,

    /// Record contours, contacts and state at every K-th step, unless --channels gives them a schedule (metrics are small
    /// and keep theirs).
    #[arg(long, value_name = "K", allow_negative_numbers = true, help_heading = RECORDING)]
    every: Option<i64>,

    /// Draw contours and contacts anew when a particle has moved by more than this (mean radii), or a pressure or force has
    /// changed by more than ten times this (means); 0 draws them whenever they are scheduled [default: as in the scene or the
    /// recording; 0.01 in the default scene].
    #[arg(long, value_name = "X", allow_negative_numbers = true, value_parser = real, help_heading = RECORDING)]
    redraw: Option<f64>,
}

const PACKING: &str = "Packing";
pub const RELAXATION: &str = "Relaxation";
pub const RECORDING: &str = "Recording";

/// The place of the metrics among the channels.
const METRICS: usize = 2;

/// The channels of `--channels`, with a schedule where one is given.
type ChannelList = Vec<(usize, Option<Schedule>)>;

impl SceneFlags {
    /// The scene: defaults, overridden by the file, overridden by the flags.
    pub fn scene(&self) -> anyhow::Result<Scene> {
        self.scene_over(match &self.scene {
            None => SceneFields::default(),
            Some(path) => {
                let name = shown(&path.display().to_string());
                match SceneFields::read(path) {
                    Err(error @ SceneError::Read { .. }) => return Err(error.into()),
                    read => read.with_context(|| format!("scene file {name}"))?,
                }
            }
        })
    }

    /// The scene file, if one is named.
    pub fn path(&self) -> Option<&Path> {
        self.scene.as_deref()
    }

    /// The start file that a flag names.
    pub fn file(&self) -> Option<&Path> {
        self.file.as_deref()
    }

    /// The start file whose name no scene can hold, since it is not UTF-8.
    pub fn file_unlike_text(&self) -> Option<&Path> {
        self.file().filter(|path| path.to_str().is_none())
    }

    /// The scene of these fields, overridden by the flags.
    pub fn scene_over(&self, mut file: SceneFields) -> anyhow::Result<Scene> {
        if self.model.is_some_and(|model| Some(model) != file.model) {
            // The form of the forces is that of a model.
            file.forces = None;
        }
        let channels = self.channels.over(file.channels.unwrap_or_default())?;
        let contours = self.vertices.map(|vertices| {
            let mut style = file.contours.unwrap_or_default();
            style.vertices = vertices;
            style
        });
        let flags = SceneFields {
            particles: self.particles,
            phi: self.phi,
            aspect: self.aspect,
            seed: self.seed,
            start: self.start.clone(),
            // A scene is text. What of a name is none is replaced in it; see `file_unlike_text`.
            file: (self.file.as_ref()).map(|path| path.to_string_lossy().into_owned()),
            separate: self.separate.then_some(true),
            disks: Some(DiskFields {
                relax: self.relax_disks.then_some(true),
                record: self.record_disks,
                ..DiskFields::default()
            }),
            line_tension: self.line_tension,
            threshold: self.threshold,
            steps: self.steps,
            model: self.model,
            minimizer: self.minimizer,
            forces: self.forces,
            dt_max: self.dt_max,
            contact_rule: self.contact_rule,
            contact_solver: self.contact_solver,
            contours,
            channels,
            protocol: self.protocol.fields(),
            ..SceneFields::default()
        };
        Ok(file.overridden_by(flags).into_scene()?)
    }
}

impl ChannelFlags {
    /// The channels of `scheduled` as the flags change them; `None` if no flag does.
    pub fn over(&self, scheduled: Channels) -> Result<Option<Channels>, SceneError> {
        let mut channels = scheduled;
        if let Some(list) = &self.channels {
            channels = Channels {
                contours: Schedule::Off,
                contacts: Schedule::Off,
                metrics: Schedule::Off,
                state: Schedule::Off,
                ..scheduled
            };
            for &(k, schedule) in list {
                // A channel that the scene switches off and the flag names goes by its default.
                let in_scene = scheduled.named()[k].1;
                let default = Channels::default().named()[k].1;
                let usual = if in_scene.is_on() { in_scene } else { default };
                *channel(&mut channels, k) = schedule.unwrap_or(usual);
            }
        }
        if let Some(k) = self.every {
            let every = u64::try_from(k).ok().filter(|k| *k >= 1);
            let explicit = |k: usize| {
                let mut list = self.channels.iter().flatten();
                list.any(|(channel, schedule)| *channel == k && schedule.is_some())
            };
            let every = every.ok_or_else(|| SceneError::Range {
                field: "every".to_owned(),
                value: k.to_string(),
                allowed: "every ≥ 1 (steps)".to_owned(),
            })?;
            for (k, (_, schedule)) in channels.named().into_iter().enumerate() {
                if k != METRICS && schedule.is_on() && !explicit(k) {
                    *channel(&mut channels, k) = Schedule::Every(every);
                }
            }
        }
        if let Some(redraw) = self.redraw {
            channels.redraw = redraw;
        }
        let changed = self.channels.is_some() || self.every.is_some() || self.redraw.is_some();
        Ok(changed.then_some(channels))
    }
}

fn channel(channels: &mut Channels, k: usize) -> &mut Schedule {
    match k {
        0 => &mut channels.contours,
        1 => &mut channels.contacts,
        2 => &mut channels.metrics,
        _ => &mut channels.state,
    }
}

/// A unit variant by its name in the scene file.
pub fn named<T: serde::de::DeserializeOwned>(text: &str) -> Result<T, String> {
    let value = serde::de::value::StrDeserializer::<serde::de::value::Error>::new(text);
    T::deserialize(value).map_err(|e| e.to_string().replace("unknown variant", "there is no"))
}

/// A number; whether it is in range is for the scene to say.
pub(super) fn real(text: &str) -> Result<f64, String> {
    text.parse()
        .map_err(|_| "a number is expected, such as 0.9 or 1e-10".to_owned())
}

/// A whole number; whether it is in range is for the scene to say.
fn whole(text: &str) -> Result<i128, String> {
    text.parse()
        .map_err(|_| "a whole number is expected".to_owned())
}

fn seed(text: &str) -> Result<u64, String> {
    text.parse()
        .map_err(|_| format!("a whole number from 0 to {} is expected", u64::MAX))
}

fn channel_list(text: &str) -> Result<ChannelList, String> {
    let names = Channels::default().named().map(|(name, _)| name);
    text.split(',')
        .map(|word| {
            let (name, schedule) = match word.trim().split_once('=') {
                Some((name, schedule)) => (name.trim(), Some(schedule.parse()?)),
                None => (word.trim(), None),
            };
            let place = names.iter().position(|n| *n == name);
            let place = place.ok_or_else(|| {
                format!(
                    "`{name}` is not a channel; the channels are {}",
                    names.join(", ")
                )
            })?;
            Ok((place, schedule))
        })
        .collect()
}
