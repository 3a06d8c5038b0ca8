//! What is drawn of several runs as curves.

use softjam::budget::Budget;
use softjam::figure::{CURVE_COLORS, Course, Fall, FigureError, RelaxedState};
use softjam::models::Kind;
use softjam::models::droplet::Form;
use softjam::protocol::Relaxation;
use softjam::replay::{Event, Recording};
use softjam::scene::{Act, Shear, Start};
use softjam::state::Frame;
use softjam::text::shown;
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

/// What tells runs apart: coverage, number of particles, seed or start file, and model.
type Names = [String; 4];

/// The place of the seed among them.
const SEED: usize = 2;

/// The fall of `f_max` in each run.
pub fn falls(files: &[PathBuf], budget: Budget) -> anyhow::Result<Vec<Fall>> {
    let runs = files.iter().map(|path| fall(path, budget));
    Ok(named(
        runs.collect::<anyhow::Result<_>>()?,
        |fall, label| {
            fall.label = label;
        },
    ))
}

/// The relaxed states of each run, which is called by the coverage at which it is sheared.
pub fn sheared(files: &[PathBuf], budget: Budget) -> anyhow::Result<Vec<Course>> {
    let runs = files.iter().map(|path| {
        let (mut names, course, modes) = course(path, budget)?;
        if modes.contains(&Shear::Simple) && course.pure {
            let problem =
                "has simple and pure shear, whose stresses are not the same: record two runs";
            return Err(nothing(path, problem).into());
        }
        let pairs = course.states.windows(2);
        let mut sheared = pairs.filter(|pair| pair[0].strain != pair[1].strain);
        let before = sheared.next().ok_or_else(|| {
            nothing(
                path,
                "has no sheared states; record it with --shear, or a stage `shear` in its scene",
            )
        })?;
        names[0] = format!("φ = {:.3}", before[0].phi);
        Ok((names, course))
    });
    Ok(named(
        runs.collect::<anyhow::Result<_>>()?,
        |course, label| {
            course.label = label;
        },
    ))
}

/// The relaxed states of each run, which is called by the coverage that it starts from.
pub fn compressed(files: &[PathBuf], budget: Budget) -> anyhow::Result<Vec<Course>> {
    let runs = files.iter().map(|path| {
        let (mut names, course, _) = course(path, budget)?;
        names[0] = format!("start at {}", names[0]);
        Ok((names, course))
    });
    Ok(named(
        runs.collect::<anyhow::Result<_>>()?,
        |course, label| {
            course.label = label;
        },
    ))
}

/// Each curve is called by its coverage and by what else is not the same in all of them; samples of one coverage share
/// a name, and with it a colour, where names could not be told apart by their colours.
fn named<T>(runs: Vec<(Names, T)>, name: impl Fn(&mut T, String)) -> Vec<T> {
    let differs = |k: usize| runs.iter().any(|(names, _)| names[k] != runs[0].0[k]);
    let all: Vec<usize> = (0..4).filter(|k| *k == 0 || differs(*k)).collect();
    let label = |names: &Names, shown: &[usize]| {
        let shown = shown.iter().map(|k| names[*k].as_str());
        shown.collect::<Vec<_>>().join(", ")
    };
    let distinct: BTreeSet<String> = runs.iter().map(|(names, _)| label(names, &all)).collect();
    let without_seed: Vec<usize> = all.iter().copied().filter(|k| *k != SEED).collect();
    let shown = if distinct.len() > CURVE_COLORS {
        without_seed
    } else {
        all
    };
    let named = |(names, mut run): (Names, T)| {
        name(&mut run, label(&names, &shown));
        run
    };
    runs.into_iter().map(named).collect()
}

fn names(recording: &Recording) -> Names {
    let scene = recording.scene();
    [
        format!("φ = {:.3}", recording.coverage()),
        format!("N = {}", recording.radii().len()),
        match &scene.start {
            Start::File { path, .. } => {
                let name = Path::new(path).file_name().unwrap_or_default();
                format!("from {}", shown(&name.display().to_string()))
            }
            Start::Random | Start::Hexagonal => format!("seed {}", scene.seed),
        },
        scene.model.name().to_owned(),
    ]
}

fn nothing(path: &Path, what: &str) -> FigureError {
    let path = path.display().to_string();
    FigureError::Nothing(format!("{} {what}", shown(&path)))
}

const NO_METRICS: &str = "holds no metrics; record it with --channels metrics,…";

fn fall(path: &Path, budget: Budget) -> anyhow::Result<(Names, Fall)> {
    let mut recording = Recording::open_within(path, budget)?;
    let mut points = Vec::new();
    for event in recording.by_ref() {
        if let Event::Metric {
            name: "f_max",
            step,
            value,
            ..
        } = event?
        {
            points.push((step, value));
        }
    }
    if points.is_empty() {
        return Err(nothing(path, NO_METRICS).into());
    }
    points.sort_by_key(|p| p.0);
    let fall = Fall {
        label: String::new(),
        points,
        threshold: Some(recording.scene().threshold),
    };
    Ok((names(&recording), fall))
}

/// The metrics of a relaxed state.
const OF_A_STATE: [&str; 6] = [
    "strain",
    "phi",
    "energy",
    "stress_xx",
    "stress_xy",
    "stress_yy",
];

/// The relaxed states of a protocol, and what its shears are.
fn course(path: &Path, budget: Budget) -> anyhow::Result<(Names, Course, Vec<Shear>)> {
    let mut recording = Recording::open_within(path, budget)?;
    if recording.scene().protocol.is_empty() {
        let problem =
            "is of a scene without a protocol; record it with --shear, --compress-to or --jam";
        return Err(nothing(path, problem).into());
    }
    let (mut rows, mut last) = (BTreeMap::<u64, [f64; 6]>::new(), None::<Frame>);
    let mut phi_j = Vec::new();
    while let Some(event) = recording.next() {
        match event? {
            Event::Metric {
                name, step, value, ..
            } => {
                if let Some(k) = OF_A_STATE.iter().position(|of| *of == name) {
                    rows.entry(step).or_insert([f64::NAN; 6])[k] = value;
                }
            }
            Event::State(frame) => {
                let ended = last.replace(frame);
                let stage = last.as_ref().map(|frame| frame.stage);
                if let Some(ended) = ended.filter(|frame| Some(frame.stage) != stage) {
                    phi_j.extend(jamming(&recording, ended)?);
                }
            }
            Event::Drawn { .. } | Event::Result { .. } => {}
        }
    }
    let converged = recording.outcome().is_some_and(|outcome| outcome.converged);
    if let Some(last) = last.filter(|_| converged) {
        phi_j.extend(jamming(&recording, last)?);
    }
    // Disks before the relaxation have neither strain nor coverage.
    let rows: Vec<[f64; 6]> = rows.into_values().filter(|row| !row[0].is_nan()).collect();
    if rows.is_empty() {
        return Err(nothing(path, NO_METRICS).into());
    }
    // The last step in a box is the relaxed state; that of a run which did not converge is none.
    let mut boxes: Vec<&[[f64; 6]]> = rows.chunk_by(|a, b| a[..2] == b[..2]).collect();
    if !converged {
        boxes.pop();
    }
    let area = recording.coverage() * recording.domain().area();
    let state = |&[strain, phi, energy, xx, xy, yy]: &[f64; 6]| RelaxedState {
        strain,
        phi,
        area: area / phi,
        energy,
        stress: [xx, xy, yy],
    };
    let scene = recording.scene();
    let shear = scene.protocol.iter().filter_map(|stage| match stage.act {
        Act::Shear { mode, .. } => Some(mode),
        Act::Relax | Act::Compress { .. } | Act::Jam { .. } => None,
    });
    let modes: Vec<Shear> = shear.collect();
    let smallest = recording
        .radii()
        .iter()
        .copied()
        .fold(f64::INFINITY, f64::min);
    let course = Course {
        label: String::new(),
        states: boxes
            .iter()
            .filter_map(|rows| rows.last())
            .map(state)
            .collect(),
        pure: modes.contains(&Shear::Pure),
        has_potential: scene.model != Kind::MorseWitten || scene.forces == Form::Gradient,
        diameter: 2.0 * smallest,
        phi_j,
    };
    Ok((names(&recording), course, modes))
}

/// What the search of φ_J has come to of which this is the last state; `None` of another stage.
fn jamming(recording: &Recording, frame: Frame) -> anyhow::Result<Option<f64>> {
    let scene = recording.scene();
    let stage = scene.stage_of_protocol(frame.stage);
    if !stage.is_some_and(|stage| matches!(stage.act, Act::Jam { .. })) {
        return Ok(None);
    }
    recording.check_run(&frame)?;
    let packing = recording.packing(&frame)?;
    let run = Relaxation::resume(scene, packing, frame)?;
    Ok(run.jamming().map(|found| found.phi_j))
}
