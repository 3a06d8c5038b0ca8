//! `softjam figure`: pictures for papers and talks.

mod runs;

use super::lines::Lines;
use super::memory::MemoryFlag;
use super::output::{check_absent, check_place, end_when_interrupted};
use super::{Verdict, report, state_at};
use softjam::figure::{self, CHART_WIDTH, ColorBy, FigureError, Shape, Style};
use softjam::models::Kind;
use softjam::record::NewFile;
use softjam::replay::Recording;
use softjam::text::shown;
use std::path::{Path, PathBuf};

/// The flags that say how a packing is drawn.
const OF_A_PACKING: [&str; 6] = ["step", "disks", "color", "range", "no_chains", "films"];

#[derive(clap::Args)]
#[expect(clippy::struct_excessive_bools, reason = "a flag is a bool")]
#[command(after_help = "\
Examples:
  softjam figure run.rrd -o packing.svg                   the last state: particles and force chains
  softjam figure run.rrd --step 0 --disks -o disks.png    the undeformed disks of step 0
  softjam figure run.rrd --width 86mm -o column.pdf       for one column of a journal
  softjam figure run.rrd --range 0..2 -o same-scale.svg   a colour scale that several figures share
  softjam figure run.rrd --color deformation --no-chains -o shapes.svg
  softjam figure foam.rrd --films --color nothing --no-chains -o films.svg      droplets that keep their area, and the films between
  softjam figure --fmax a.rrd b.rrd c.rrd -o fall.svg     f_max against step, a curve a run
  softjam figure --stress-strain sheared.rrd -o stress.svg     a shear: stress against strain, with its yield events
  softjam figure --pressure-phi jam.rrd -o pressure.svg        a compression, or the search of φ_J
  softjam figure run.rrd --step 0 --disks --color nothing --no-chains -o figure5a.svg      the paper's figures 5(a)
  softjam figure run.rrd --color nothing --no-chains -o figure5b.svg                       and 5(b)

Exit codes: 0 drawn, 1 could not be done (a damaged file, a folder that is not there), 2 the request makes no sense (a step that is
not recorded, a file that is in the way)")]
pub struct Arguments {
    /// The recording, .rrd or .mcap; with --fmax, --stress-strain and --pressure-phi, as many as there are curves.
    #[arg(value_name = "RUN.rrd", required = true)]
    files: Vec<PathBuf>,

    /// File to write; its name ends in .svg, .pdf or .png (300 pixels an inch).
    #[arg(long, short, value_name = "FIGURE.svg")]
    output: PathBuf,

    /// Draw f_max (units of γ) against step instead of a packing, with the thresholds as dashed lines.
    #[arg(long, conflicts_with_all = OF_A_PACKING)]
    fmax: bool,

    /// Draw the shear stress (γ/length) of the relaxed states of a protocol against its strain: σ_xy of simple shear, σ_xx − σ_yy of pure
    /// shear. A dot is the state before a yield event: a step that loses energy (more than 3 γ a small diameter, times area and
    /// strain²; not with central forces, which have none to lose), or in which the stress falls by more than 1 γ a small diameter times the strain.
    #[arg(long, conflicts_with_all = OF_A_PACKING, conflicts_with = "fmax")]
    stress_strain: bool,

    /// Draw the pressure (γ/length) of the relaxed states against their coverage, through compression and the search of φ_J; that is a
    /// dashed line where the recording holds states.
    #[arg(long, conflicts_with_all = OF_A_PACKING, conflicts_with_all = ["fmax", "stress_strain"])]
    pressure_phi: bool,

    /// The recorded step to draw: a number or `last`.
    #[arg(long, value_name = "K", default_value = "last", value_parser = step)]
    step: Step,

    /// Draw the undeformed disks of the step instead of the contours of droplets.
    #[arg(long)]
    disks: bool,

    /// What the colour of a particle means: pressure (Σf/2πR relative to its mean), deformation (max |ΔR|/R of a droplet) or
    /// nothing.
    #[arg(long, value_name = "QUANTITY", default_value = "pressure", value_parser = super::flags::named::<ColorBy>)]
    color: ColorBy,

    /// The numbers at the ends of the colour bar, in units of the quantity that is shown [default: round numbers around the values
    /// of all but the last fiftieth of the particles at either end].
    #[arg(long, value_name = "LOW..HIGH", value_parser = range, allow_hyphen_values = true)]
    range: Option<[f64; 2]>,

    /// Leave out the force chains: lines between centres, as wide as the force.
    #[arg(long)]
    no_chains: bool,

    /// Draw the contacts of droplets that keep their area (rounded-polygon, wet-foam) as the films that they are, coloured by how much
    /// the pressures on their two sides differ: |1/r_i − 1/r_j| in units of γ and the mean radius.
    #[arg(long, conflicts_with = "disks")]
    films: bool,

    /// Width of the figure, in mm, cm, in, pt or px (96 an inch): 86mm is one column of many journals, 178mm two. Text is 8
    /// points in narrow figures and 10 in wide ones [default: 668px, of curves 720px].
    #[arg(long, value_name = "WIDTH", value_parser = width)]
    width: Option<f64>,

    /// Replace an existing file, when the new one is whole.
    #[arg(long, short)]
    force: bool,

    #[command(flatten)]
    memory: MemoryFlag,
}

/// A recorded step, or the last.
type Step = Option<u64>;

fn step(text: &str) -> Result<Step, String> {
    let number = (text != "last").then(|| text.parse()).transpose();
    number.map_err(|_| "a step is a whole number, or `last`".to_owned())
}

/// Two numbers, ascending, between which `..` or a comma stands.
fn range(text: &str) -> Result<[f64; 2], String> {
    let ends = text.split_once("..").or_else(|| text.split_once(','));
    let number = |end: &str| end.trim().parse().ok().filter(|x: &f64| x.is_finite());
    let ends = ends.and_then(|(low, high)| Some([number(low)?, number(high)?]));
    let ends = ends.ok_or("a range is two numbers, as 0..2 or 0.5,1.5")?;
    let wide = ends[0] < ends[1] && (ends[1] - ends[0]).is_finite();
    let refused = || format!("the range {text} is empty: the first number is to be the lower one");
    wide.then_some(ends).ok_or_else(refused)
}

/// The narrowest and the widest figure (pixels).
const WIDTHS: core::ops::RangeInclusive<f64> = 150.0..=8000.0;

/// A length, in pixels of 96 an inch.
fn width(text: &str) -> Result<f64, String> {
    let digits = text.trim_end_matches(|c: char| c.is_ascii_alphabetic());
    let pixels = match &text[digits.len()..] {
        "" | "px" => Some(1.0),
        "mm" => Some(96.0 / 25.4),
        "cm" => Some(96.0 / 2.54),
        "in" => Some(96.0),
        "pt" => Some(96.0 / 72.0),
        _ => None,
    };
    let number: Option<f64> = digits.trim().parse().ok();
    let width = pixels.zip(number).map(|(pixels, number)| pixels * number);
    let width = width.ok_or("a width is a number in mm, cm, in, pt or px, such as 86mm")?;
    let refused = || format!("the width {text} is outside 40 … 2100 mm (150 … 8000 px)");
    WIDTHS.contains(&width).then_some(width).ok_or_else(refused)
}

pub fn run(arguments: &Arguments) -> anyhow::Result<Verdict> {
    let output = &arguments.output;
    figure::check_name(output)?;
    if arguments.range.is_some() && arguments.color == ColorBy::Nothing {
        let problem = "--range is for colours, of which --color nothing has none".to_owned();
        return Err(FigureError::Nothing(problem).into());
    }
    let inputs: Vec<Option<&Path>> = arguments.files.iter().map(|f| Some(f.as_path())).collect();
    check_place(output, &inputs)?;
    check_absent(output, arguments.force)?;
    end_when_interrupted()?;
    let file = NewFile::create(output, arguments.force)?;
    let budget = arguments.memory.budget();
    let width = arguments.width.unwrap_or(CHART_WIDTH);
    let files = arguments.files.as_slice();
    let svg = if arguments.fmax {
        figure::relaxation_in(width, &runs::falls(files, budget)?)?
    } else if arguments.stress_strain {
        figure::stress_strain(width, &runs::sheared(files, budget)?)?
    } else if arguments.pressure_phi {
        figure::pressure_phi(width, &runs::compressed(files, budget)?)?
    } else {
        let [path] = files else {
            let problem = "a packing is drawn of one recording; several are for --fmax, --stress-strain and --pressure-phi";
            return Err(FigureError::Nothing(problem.to_owned()).into());
        };
        packing(path, arguments)?
    };
    figure::write_into(file, &svg)?;
    let mut lines = Lines::default();
    lines.line("figure", output.display());
    report(&lines.into_text())?;
    Ok(Verdict::Good)
}

fn packing(path: &Path, arguments: &Arguments) -> anyhow::Result<String> {
    let mut recording = Recording::open_within(path, arguments.memory.budget())?;
    let found = state_at(&mut recording, arguments.step)?;
    let (shown, scene) = (shown(recording.path()), recording.scene());
    let problem = match (found, arguments.step) {
        (Some(frame), step) if step.is_none_or(|k| k == frame.step) => {
            let style = Style {
                shape: if arguments.disks {
                    Shape::Disk
                } else {
                    Shape::Contour
                },
                color: arguments.color,
                chains: !arguments.no_chains,
                films: arguments.films,
                width: arguments.width.unwrap_or(Style::default().width),
                range: arguments.range,
            };
            let model = scene.stage(frame.stage).model;
            if style.color == ColorBy::Deformation && model == Kind::Disks {
                format!(
                    "step {} of {shown} is of disks, which keep their shape: --color deformation has nothing to show",
                    frame.step
                )
            } else if style.films && !matches!(model, Kind::RoundedPolygon | Kind::WetFoam) {
                format!(
                    "step {} of {shown} is of the model {}: --films is for rounded-polygon and wet-foam, whose droplets keep their area",
                    frame.step,
                    model.name()
                )
            } else {
                let packing = recording.packing(&frame)?;
                return Ok(figure::packing(&packing, &frame, scene, &style));
            }
        }
        (Some(frame), Some(k)) => format!(
            "{shown} holds no state of step {k}; the nearest before it is {}. `softjam convert` with \
             --channels state=every:1 brings it back",
            frame.step
        ),
        (None, Some(k)) if recording.scene().channels.state.is_on() => {
            format!("{shown} holds no state of step {k}, nor one before it")
        }
        _ => format!("{shown} holds no state to draw; record it with --channels state,…"),
    };
    Err(FigureError::Nothing(problem).into())
}
