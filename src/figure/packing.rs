//! A packing: particles as filled shapes, contacts as force chains.

use super::films::Films;
use super::legend::{Legend, length};
use super::shades::{PALE, Shades};
use super::shapes::{circle, hundredths, line, page, paper};
use super::sheet::Sheet;
use super::{INK, font_size, mean, power_of_ten, with_indices};
use crate::analysis::FrameForces;
use crate::contacts::{Contacts, FrameContacts};
use crate::domain::Vec2;
use crate::models::Kind;
use crate::models::droplet::contour::{Arc, ContourStyle, Contours, Placement};
use crate::scene::Scene;
use crate::state::Frame;
use crate::state::Packing;
use crate::text::counted;
use core::f64::consts::PI;
use svg::Node as _;
use svg::node::element::path::Data;
use svg::node::element::{Definitions, Group, Path};

/// What a particle is drawn as.
///
/// ```
/// assert_eq!(softjam::figure::Shape::default(), softjam::figure::Shape::Contour);
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Shape {
    /// Its contour `ρ_i(θ)`, which is made of arcs where a droplet keeps its area and is in balance; the disk where the model is one of disks.
    #[default]
    Contour,
    /// The undeformed disk of the same frame.
    Disk,
}

/// What the colour of a particle means.
///
/// ```
/// assert_eq!(softjam::figure::ColorBy::default(), softjam::figure::ColorBy::Pressure);
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum ColorBy {
    /// `p_i = Σ_j f_ij / 2πR_i`, relative to the mean over the particles that have a contact.
    #[default]
    Pressure,
    /// `max |ΔR_i| / R_i` of droplets; disks, which keep their shape, are all alike.
    Deformation,
    /// Nothing: all alike.
    Nothing,
}

/// How a packing is drawn.
///
/// ```
/// use softjam::figure::{Shape, Style};
/// let style = Style { shape: Shape::Disk, chains: false, ..Style::default() };
/// assert!(style.width > 0.0);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Style {
    /// What particles are drawn as.
    pub shape: Shape,
    /// What their colour means.
    pub color: ColorBy,
    /// Whether contacts are drawn, their width by the force.
    pub chains: bool,
    /// Whether contacts of droplets that keep their area are drawn as the films that they are, their colour by the difference of the
    /// pressures on their two sides; not with disks.
    pub films: bool,
    /// Width of the figure (pixels of the SVG, 96 an inch); text is 8 points in narrow figures and 10 in wide ones.
    pub width: f64,
    /// The values at the ends of the colour bar, ascending; without them round numbers around the values of all but the last
    /// fiftieth of the particles at either end.
    pub range: Option<[f64; 2]>,
}

impl Default for Style {
    fn default() -> Self {
        Self {
            shape: Shape::default(),
            color: ColorBy::default(),
            chains: true,
            films: false,
            width: 668.0,
            range: None,
        }
    }
}

/// How far the chords of a contour are off (pixels).
const CHORD: f64 = 0.05;
/// The width of a chain that bears the mean force: in mean radii, and at most in pixels.
const CHAIN: (f64, f64) = (0.08, 2.2);
/// The force above which chains become no wider (means).
const STRONGEST: f64 = 3.0;
/// The width of an outline, likewise.
const OUTLINE: (f64, f64) = (0.03, 1.2);
/// The width of a film, in those of an outline.
const FILM: f64 = 3.0;

/// Draws `frame` of a run of `scene`; `packing` gives radii and box.
///
/// Below the packing stand its numbers, what colours and lines mean, and, where more of the model is shown than positions, the
/// [warning](crate::models::droplet::validity::Validity::warning) of a packing that is beyond the model's range.
///
/// See the example of the [module](super).
#[must_use]
pub fn packing(packing: &Packing, frame: &Frame, scene: &Scene, style: &Style) -> String {
    let scene = &*scene.stage(frame.stage);
    let line_tension = scene.line_tension;
    let contacts = FrameContacts::of(packing, frame);
    let contacts = contacts.view();
    let sheet = Sheet::of(packing.domain(), style.width);
    let radius = mean(packing.radii());
    let smooth = ContourStyle {
        vertices: vertices(sheet.scale * radius),
        placement: Placement::Contacts,
    };
    let mut contours = scene.model.contours(smooth, line_tension);
    contours.tell(packing, frame);
    let mut caption = caption(packing, frame, scene);
    // Particles are drawn between the slanted sides of a sheared box.
    let positions = frame.positions.iter();
    let frame = &Frame {
        positions: positions.map(|x| packing.domain().seat(*x)).collect(),
        ..frame.clone()
    };
    contours.draw(packing.radii(), &frame.positions, &contacts, line_tension);
    // Disks keep their shape.
    let (shape, color) = match (scene.model, style.color) {
        (Kind::Disks, ColorBy::Deformation) => (Shape::Disk, ColorBy::Nothing),
        (Kind::Disks, color) => (Shape::Disk, color),
        (_, color) => (style.shape, color),
    };
    let coloring = (color, style.range);
    let shades = Shades::of(coloring, packing.radii(), frame, &contacts, &contours);

    let thin = hundredths((OUTLINE.0 * radius * sheet.scale).min(OUTLINE.1));
    let particles = particles(&sheet, (packing, frame), shape, &contours, &shades);
    let mut inside = Group::new()
        .set("clip-path", "url(#box)")
        .add(particles.set("stroke-width", thin));
    let as_films = style.films && shape == Shape::Contour;
    let films = Films::of(&contours, packing.radii()).filter(|_| as_films);
    if let Some(films) = &films {
        inside.append(films.draw(&sheet, &frame.positions, FILM * thin));
    }
    let chains = Chains::of(&sheet, radius, &contacts).filter(|_| style.chains);
    if let Some(chains) = &chains {
        inside.append(chains.draw(&sheet, frame, &contacts));
    }

    let (x, y, width, height) = sheet.frame();
    let mut legend = Legend::new((x, y + height + 6.0), width, font_size(style.width));
    let pieces = &mut caption;
    match (scene.model, shape) {
        (Kind::Disks, _) => pieces.push("disks".to_owned()),
        (_, Shape::Disk) => pieces.push("undeformed disks".to_owned()),
        (Kind::RoundedPolygon, Shape::Contour) => pieces.push("rounded polygons".to_owned()),
        (Kind::WetFoam, Shape::Contour) => pieces.push("wet foam".to_owned()),
        (Kind::MorseWitten, Shape::Contour) => {}
    }
    legend.lines(pieces, ", ", 1.0);
    shades.key(&mut legend);
    if let Some(films) = &films {
        films.key(&mut legend);
    }
    if let Some(chains) = &chains {
        chains.key(&mut legend);
    }
    if shades.rattlers() > 0 {
        rattlers(shades.rattlers(), thin, &mut legend);
    }
    let of_the_model = shape == Shape::Contour || chains.is_some() || color != ColorBy::Nothing;
    let validity = scene.model.validity(&contacts, packing.len(), line_tension);
    if let Some(warning) = validity.and_then(|v| v.warning()).filter(|_| of_the_model) {
        let words: Vec<String> = warning.split(' ').map(str::to_owned).collect();
        legend.lines(&words, " ", 0.75);
    }
    let (legend, end) = legend.end();

    let total = (hundredths(style.width), (end + 10.0).ceil());
    let svg = page(total)
        .add(Definitions::new().add(sheet.clip()))
        .add(paper())
        .add(inside)
        .add(sheet.edge())
        .add(legend)
        .to_string();
    symbols(&svg, font_size(style.width))
}

/// Physical quantities in italics, as they are printed.
fn symbols(svg: &str, size: f64) -> String {
    const QUANTITIES: [&str; 6] = [
        "N =",
        "φ =",
        "p / ⟨p⟩",
        "f / ⟨f⟩",
        "|ΔR| / R",
        "|Δp| ⟨R⟩ / γ",
    ];
    let italic = |text: &str| {
        let letter = |c: char| c.is_alphabetic() && c != 'Δ';
        let words = text.chars().map(|c| match c {
            c if letter(c) => format!("<tspan font-style=\"italic\">{c}</tspan>"),
            c => c.to_string(),
        });
        words.collect::<String>()
    };
    QUANTITIES
        .iter()
        .fold(with_indices(svg, size), |svg, quantity| {
            svg.replace(quantity, &italic(quantity))
        })
}

/// The particles, filled, with their outlines; of disks, which overlap, the outlines lie above all of them.
fn particles(
    sheet: &Sheet,
    (packing, frame): (&Packing, &Frame),
    shape: Shape,
    contours: &Contours,
    shades: &Shades,
) -> Group {
    let (mut particles, mut outlines) = (Group::new(), Group::new());
    for (p, (&center, &radius)) in frame.positions.iter().zip(packing.radii()).enumerate() {
        let fill = shades.fill(p);
        if shape == Shape::Contour {
            let outline = contours.polygon(p);
            let arcs = contours.arcs(p, radius);
            for shift in sheet.images(outline) {
                let path = match &arcs {
                    Some(arcs) => closed(sheet, arcs, center + shift),
                    None => polygon(outline.iter().map(|v| sheet.place(v + shift))),
                };
                particles.append(path.set("fill", fill.as_str()));
            }
        } else {
            let corners = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]];
            let around = corners.map(|[x, y]| center + radius * Vec2::new(x, y));
            for shift in sheet.images(&around) {
                let disk = circle(sheet.place(center + shift), sheet.pixels(radius));
                outlines.append(disk.clone());
                particles.append(disk.set("fill", fill.as_str()));
            }
        }
    }
    let drawn = |group: Group| group.set("stroke", INK).set("stroke-linejoin", "round");
    match shape {
        Shape::Contour => drawn(particles),
        Shape::Disk => {
            let outlines = drawn(outlines).set("fill", "none");
            Group::new().add(particles).add(outlines)
        }
    }
}

/// The colour that says of a particle that it rattles.
fn rattlers(count: usize, outline: f64, legend: &mut Legend) {
    let font = legend.font();
    let text = counted(count, "rattler");
    let (left, middle) = legend.place((length(&text) + 1.7, 1.8));
    let rattler = circle((left + 0.6 * font, middle), 0.6 * font).set("fill", PALE);
    legend.add(rattler.set("stroke", INK).set("stroke-width", outline));
    legend.write(&text, (left + 1.7 * font, middle), "start");
}

/// So many vertices that the chords of a circle of this radius (pixels) are off by no more than [`CHORD`].
fn vertices(radius: f64) -> usize {
    let sides = PI / (2.0 * CHORD / radius.max(1e-3)).sqrt();
    (sides as usize).clamp(16, 240)
}

/// A closed polygon, to a hundredth of a pixel.
fn polygon(points: impl Iterator<Item = (f64, f64)>) -> Path {
    let mut data = Data::new();
    for (k, point) in points.enumerate() {
        data = if k == 0 {
            data.move_to(point)
        } else {
            data.line_to(point)
        };
    }
    Path::new().set("d", data.close())
}

/// A closed contour of arcs around `center`, to a hundredth of a pixel.
fn closed(sheet: &Sheet, arcs: &[Arc], center: Vec2) -> Path {
    let first = arcs.first().map_or(center, |arc| center + arc.ends[0]);
    let data = arcs
        .iter()
        .fold(Data::new().move_to(sheet.place(first)), |path, arc| {
            sheet.follow(path, arc, center)
        });
    Path::new().set("d", data.close())
}

/// The force chains: lines between centres whose width goes with the force, up to [`STRONGEST`].
struct Chains {
    average: f64,
    /// Width of a line that bears the mean force (pixels).
    usual: f64,
    /// Whether a force is above [`STRONGEST`].
    beyond: bool,
}

impl Chains {
    /// Nothing where no contact bears a force.
    fn of(sheet: &Sheet, radius: f64, contacts: &Contacts<'_>) -> Option<Self> {
        let average = mean(contacts.forces);
        (average > 0.0).then(|| Self {
            average,
            usual: (CHAIN.0 * radius * sheet.scale).min(CHAIN.1),
            beyond: contacts.forces.iter().any(|f| *f > STRONGEST * average),
        })
    }

    fn draw(&self, sheet: &Sheet, frame: &Frame, contacts: &Contacts<'_>) -> Group {
        let mut group = Group::new()
            .set("stroke", INK)
            .set("stroke-linecap", "round");
        for (c, &[i, _]) in contacts.pairs.iter().enumerate() {
            let from = frame.positions[i as usize];
            let ends = [from, from - contacts.normals[c] * contacts.distances[c]];
            let relative = (contacts.forces[c] / self.average).clamp(0.0, STRONGEST);
            for shift in sheet.images(&ends) {
                let ends = ends.map(|v| sheet.place(v + shift));
                group.append(line(ends, self.usual * relative));
            }
        }
        group
    }

    /// Lines of three forces, with what they are in means.
    fn key(&self, legend: &mut Legend) {
        let (font, title) = (legend.font(), "f / ⟨f⟩");
        let most = if self.beyond { "≥ 3" } else { "3" };
        let samples = [(0.5, "0.5"), (1.0, "1"), (STRONGEST, most)];
        let (long, gap) = (2.0, 0.5);
        let mut x = length(title) + gap;
        let each = samples.map(|(_, label)| long + gap + length(label) + gap);
        let (left, middle) = legend.place((x + each.iter().sum::<f64>(), 1.8));
        legend.write(title, (left, middle), "start");
        for ((relative, label), room) in samples.into_iter().zip(each) {
            let at = |x: f64| (left + x * font, middle);
            let sample = line([at(x), at(x + long)], self.usual * relative);
            legend.add(sample.set("stroke", INK));
            legend.write(label, at(x + long + gap), "start");
            x += room;
        }
    }
}

/// What the picture is of.
fn caption(packing: &Packing, frame: &Frame, scene: &Scene) -> Vec<String> {
    let mut caption = vec![
        format!("N = {}", packing.len()),
        format!("φ = {:.3}", packing.coverage()),
        format!("step {}", frame.step),
    ];
    // The first number of a protocol.
    let strain = frame.protocol.first().filter(|strain| **strain != 0.0);
    caption.extend(strain.map(|strain| format!("strain {strain:.4}")));
    if let Ok(forces) = FrameForces::of(packing, frame, scene.model()) {
        let f_max = power_of_ten(forces.observables().f_max);
        caption.push(format!("f_max = {f_max} γ"));
    }
    caption
}
