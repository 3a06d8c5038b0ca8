//! Figures for papers and talks: a packing with its force chains, the fall of `f_max`, stress against strain and pressure against coverage,
//! curves of what you like.
//!
//! A figure is SVG text; [`write()`] makes a PDF or a PNG of it where the file's name asks for one, with a font of its own, so
//! that a picture is the same on every machine. A length of 96 in the SVG is an inch on paper.
//!
//! ```
//! use softjam::{figure::{Style, packing}, protocol::Relaxation, scene::Scene};
//!
//! let scene = Scene { particles: 32, phi: 0.95, ..Scene::default() };
//! let run = Relaxation::new(&scene).unwrap();
//! let svg = packing(run.packing(), &run.frame(), &scene, &Style::default());
//! assert!(svg.starts_with("<svg"));
//! let path = std::env::temp_dir().join("softjam-figure-example.png");
//! softjam::figure::write(&path, &svg).unwrap();
//! # std::fs::remove_file(&path).unwrap();
//! ```

mod axis;
mod bar;
mod chart;
mod course;
mod films;
mod keys;
mod legend;
mod packing;
mod pdf;
mod relaxation;
mod shades;
mod shapes;
mod sheet;

pub use axis::{Axis, Scale};
pub use chart::{CHART_WIDTH, CURVE_COLORS, Curve, Mark, chart, chart_in};
pub use course::{Course, RelaxedState, pressure_phi, stress_strain};
pub use packing::{ColorBy, Shape, Style, packing};
pub use relaxation::{Fall, relaxation, relaxation_in};

use crate::record::{NewFile, RecordError};
use crate::replay::guarded;
use crate::text::{lines, shown};
use resvg::tiny_skia::{Color, Pixmap, Transform};
use resvg::usvg::{Options, Tree};
use shapes::hundredths;
use std::io::Write as _;
use std::path::Path;

/// The typeface of all figures.
const FONT: &str = "DejaVu Sans";

/// What a browser takes: it has the same metrics where the typeface is missing.
const FONTS: &str = "DejaVu Sans, Verdana, sans-serif";

/// The colour of lines and text.
const INK: &str = "#1c1c1c";

/// Pixels of a PNG for each unit of the SVG: 300 an inch.
const PIXELS: f32 = 3.125;

/// Why a figure could not be made.
///
/// ```
/// use softjam::figure::{FigureError, png, relaxation};
/// assert!(matches!(relaxation(&[]), Err(FigureError::Nothing(_))));
/// assert!(matches!(png("no picture"), Err(FigureError::Draw(_))));
/// ```
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum FigureError {
    /// The file's name ends in none of `.svg`, `.pdf` and `.png`.
    #[error("{}: a figure's name ends in .svg, .pdf or .png", shown(.path))]
    Name {
        /// Path of the file.
        path: String,
    },
    /// The file could not be written.
    #[error("cannot write {}: {source}", shown(.path))]
    Write {
        /// Path of the file.
        path: String,
        /// The system's reason.
        source: std::io::Error,
    },
    /// The file could not be begun.
    #[error(transparent)]
    File(#[from] RecordError),
    /// The picture could not be drawn.
    #[error("the figure cannot be drawn: {}", shown(.0))]
    Draw(String),
    /// There is nothing to draw.
    #[error("{}", lines(.0))]
    Nothing(String),
}

/// Whether `path` names a figure that can be written.
///
/// # Errors
///
/// [`FigureError::Name`] if it ends in none of `.svg`, `.pdf` and `.png`.
///
/// ```
/// assert!(softjam::figure::check_name("packing.pdf").is_ok());
/// assert!(softjam::figure::check_name("packing.gif").is_err());
/// ```
pub fn check_name(path: impl AsRef<Path>) -> Result<(), FigureError> {
    Kind::of(path.as_ref()).map(drop)
}

/// What a figure is written as.
#[derive(Clone, Copy)]
enum Kind {
    Svg,
    Pdf,
    Png,
}

impl Kind {
    fn of(path: &Path) -> Result<Self, FigureError> {
        let named = |e: &str| path.extension().is_some_and(|x| x.eq_ignore_ascii_case(e));
        let kinds = [("svg", Self::Svg), ("pdf", Self::Pdf), ("png", Self::Png)];
        let kind = kinds.into_iter().find(|(e, _)| named(e));
        kind.map(|(_, kind)| kind).ok_or_else(|| FigureError::Name {
            path: path.display().to_string(),
        })
    }
}

/// Writes a figure as its name says, `.svg`, `.pdf` or `.png`; an existing file is replaced when the new one is whole.
///
/// # Errors
///
/// [`FigureError`]; an existing file is then as it was.
///
/// See the example of the [module](self).
pub fn write(path: impl AsRef<Path>, svg: &str) -> Result<(), FigureError> {
    check_name(&path)?;
    write_into(NewFile::create(path, true)?, svg)
}

/// [`write()`] into a file that has been begun.
///
/// # Errors
///
/// [`FigureError`]; nothing is left of the file then.
///
/// ```
/// use softjam::{figure, record::NewFile};
///
/// let path = std::env::temp_dir().join("softjam-figure-write-into-example.svg");
/// let file = NewFile::create(&path, true).unwrap();
/// figure::write_into(file, "<svg xmlns='http://www.w3.org/2000/svg' width='10' height='10'/>").unwrap();
/// assert!(path.exists());
/// # std::fs::remove_file(&path).unwrap();
/// ```
pub fn write_into(mut file: NewFile, svg: &str) -> Result<(), FigureError> {
    let path = file.path().to_owned();
    let bytes = match Kind::of(&path)? {
        Kind::Png => png(svg)?,
        Kind::Pdf => pdf(svg)?,
        Kind::Svg => {
            check_numbers(svg)?;
            svg.as_bytes().to_vec()
        }
    };
    let written = file.write_all(&bytes).and_then(|()| file.publish());
    let path = path.display().to_string();
    written.map_err(|source| match source.kind() {
        // It has come there since the file was begun.
        std::io::ErrorKind::AlreadyExists => RecordError::Exists { path }.into(),
        _ => FigureError::Write { path, source },
    })
}

/// A figure as PDF, one page of its size; text is drawn as outlines.
///
/// # Errors
///
/// [`FigureError::Draw`] if `svg` is no picture, or has what no figure of this module has: images, gradients, filters, masks, and
/// what can be seen through.
///
/// ```
/// let pdf = softjam::figure::pdf("<svg xmlns='http://www.w3.org/2000/svg' width='96' height='48'/>").unwrap();
/// assert!(pdf.starts_with(b"%PDF-"));
/// // An inch is 72 points.
/// assert!(pdf.windows(23).any(|bytes| bytes == b"/MediaBox [0 0 72 36]\n "));
/// ```
pub fn pdf(svg: &str) -> Result<Vec<u8>, FigureError> {
    let tree = tree(svg)?;
    let problem = |what| FigureError::Draw(format!("a PDF of softjam cannot hold {what}"));
    pdf::pdf(&tree).map_err(problem)
}

/// A figure as PNG, 300 pixels an inch.
///
/// # Errors
///
/// [`FigureError::Draw`] if `svg` is no picture.
///
/// ```
/// let png = softjam::figure::png("<svg xmlns='http://www.w3.org/2000/svg' width='10' height='10'/>").unwrap();
/// assert!(png.starts_with(b"\x89PNG"));
/// ```
pub fn png(svg: &str) -> Result<Vec<u8>, FigureError> {
    let tree = tree(svg)?;
    let draw = |e: &dyn std::fmt::Display| FigureError::Draw(e.to_string());
    let (width, height) = (tree.size().width(), tree.size().height());
    if width.max(height) > LONGEST_SIDE {
        return Err(draw(&format!(
            "{width:.0} × {height:.0} is too long for a PNG; name a file that ends in .svg or .pdf"
        )));
    }
    let size = tree.size().to_int_size().scale_by(PIXELS);
    let pixels = size.and_then(|size| Pixmap::new(size.width(), size.height()));
    let mut pixels = pixels.ok_or_else(|| draw(&"it has no size"))?;
    pixels.fill(Color::WHITE);
    // It panics at some shapes that are far larger than the sheet.
    guarded(|| {
        let scale = Transform::from_scale(PIXELS, PIXELS);
        resvg::render(&tree, scale, &mut pixels.as_mut());
        Ok(())
    })
    .map_err(|e| draw(&e))?;
    pixels.encode_png().map_err(|e| draw(&e))
}

/// The shapes of a figure, its text in our typeface.
fn tree(svg: &str) -> Result<Tree, FigureError> {
    check_numbers(svg)?;
    let mut options = Options {
        font_family: FONT.to_owned(),
        ..Options::default()
    };
    let fonts = options.fontdb_mut();
    for font in [dejavu::sans::regular(), dejavu::sans::oblique()] {
        fonts.load_font_data(font.to_vec());
    }
    fonts.set_sans_serif_family(FONT);
    Tree::from_str(svg, &options).map_err(|e| FigureError::Draw(e.to_string()))
}

/// Units of the longest side of a PNG.
const LONGEST_SIDE: f32 = 12_800.0;

/// Refuses a figure with places or sizes that are no numbers, or with such a force or squeeze in what stands below it: forces or
/// lengths beyond what a number can hold.
fn check_numbers(svg: &str) -> Result<(), FigureError> {
    let none = |text: &str, [before, behind]: [&str; 2]| {
        let mut words = ["NaN", "inf"].into_iter();
        words.any(|word| text.contains(&[before, word, behind].concat()))
    };
    let said = |text: &str| {
        let around = [["= ", " γ"], ["up to ", ","], ["mean ", ","]];
        around.into_iter().any(|around| none(text, around))
    };
    let mut parts = svg
        .split('<')
        .map(|part| part.split_once('>').unwrap_or((part, "")));
    if parts.any(|(tag, text)| none(tag, ["", ""]) || said(text)) {
        let problem = "forces or lengths are beyond what a number can hold".to_owned();
        return Err(FigureError::Draw(problem));
    }
    Ok(())
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len().max(1) as f64
}

/// A number as `9.6·10⁻¹¹`.
fn power_of_ten(x: f64) -> String {
    let text = format!("{x:.1e}");
    match text.split_once('e') {
        Some((digits, exponent)) => format!("{digits}·10{}", superscript(exponent)),
        None => text,
    }
}

/// A power of ten.
fn decade(k: i32) -> String {
    format!("10{}", superscript(&k.to_string()))
}

/// The size of text in a figure of this width (pixels): 8 points in one column of a journal, 10 in two.
fn font_size(width: f64) -> f64 {
    (width / 50.0).clamp(8.0 / 0.75, 10.0 / 0.75)
}

/// Quantities that are printed with an index, and the index.
const INDEXED: [(&str, &str); 5] = [
    ("f", "max"),
    ("φ", "J"),
    ("σ", "xx"),
    ("σ", "xy"),
    ("σ", "yy"),
];

/// Each `f_max`, `σ_xy` and the like of an SVG as it is printed, in text of the given font size.
fn with_indices(svg: &str, size: f64) -> String {
    let (small, down) = (hundredths(0.7 * size), hundredths(0.2 * size));
    INDEXED.iter().fold(svg.to_owned(), |svg, (letter, index)| {
        let name = format!("{letter}_{index}");
        let printed = |behind: &str| {
            format!(
                "<tspan font-style=\"italic\">{letter}</tspan><tspan font-size=\"{small}\" dy=\"{down}\">{index}</tspan><tspan dy=\"-{down}\">{behind}</tspan>"
            )
        };
        // What stands behind it goes back to the line; a space that no reader collapses, or a hair's breadth.
        svg.replace(&format!("{name} "), &printed("\u{a0}"))
            .replace(&name, &printed("\u{200a}"))
    })
}

/// A whole number as an exponent.
fn superscript(text: &str) -> String {
    let raised = |c| match c {
        '-' => '⁻',
        '1' => '¹',
        '2' => '²',
        '3' => '³',
        digit => char::from_u32('⁰' as u32 + digit as u32 - '0' as u32).unwrap_or(digit),
    };
    text.chars().map(raised).collect()
}
