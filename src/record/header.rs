//! What does not change in a recording: scene, axes, box, radii, and how things look.

use super::columns::array;
use super::encode::Encoder;
use super::pictures::Rgb;
use super::{Header, legend, legs_to_text};
use crate::models::Kind;
use crate::models::droplet::validity::SQUEEZE_LIMIT;
use crate::scene::{Scene, Start};
use crate::text::{counted, length, shown};
use rerun::external::arrow::array::{Float64Array, StringArray, UInt32Array, UInt64Array};
use rerun::external::re_log_types::StoreId;
use rerun::{
    AsComponents, Color, DynamicArchetype, Ellipses2D, LineStrips2D, Points2D, Radius,
    RecordingInfo, TextDocument, TimePoint, Transform3D,
};
use std::io::{self, Write};

/// The radius of what fills a particle, in its undeformed radius: inside the contour but for the deepest dents, and dark enough not
/// to be taken for a particle of its own.
const FILLED: f64 = 0.92;

/// The colour of the periodic box.
pub(super) const EDGE: Rgb = [200, 200, 200];

/// Half the width of an outline among `particles`, in points of the screen: lines no wider than leave the shapes to be seen.
fn outline_width(particles: usize) -> f32 {
    (22.0 / (particles as f32).sqrt()).clamp(0.4, 1.3)
}

/// Writes the header into a store.
pub(super) fn write<W: Write>(
    encoder: &mut Encoder<W>,
    store: &StoreId,
    header: &Header,
) -> io::Result<()> {
    let mut put = |entity: &str, data: &dyn AsComponents| {
        encoder.single(store, entity, TimePoint::default(), data)
    };
    let (packing, channels) = (&header.packing, &header.scene.channels);
    let l = packing.domain().lengths();
    // What the viewer lists the recording as.
    let name = format!(
        "N = {}, φ = {:.3}, {}",
        packing.len(),
        packing.coverage(),
        start(&header.scene, "seed")
    );
    put("/__properties", &RecordingInfo::new().with_name(name))?;
    put("/scene", &TextDocument::from_markdown(text(header)))?;
    put("/scene", &scene(header)?)?;
    let particles = DynamicArchetype::new("softjam.Particles")
        .with_component_from_data(
            "radius",
            array(Float64Array::from(packing.radii().to_vec())),
        )
        .with_component_from_data("box", array(Float64Array::from(vec![l.x, l.y])));
    put("/particles", &particles)?;
    // Rerun's 2D views have y down, a packing has it up.
    let up = Transform3D::from_mat3x3([1.0, 0.0, 0.0, 0.0, -1.0, 0.0, 0.0, 0.0, 1.0]);
    put("/world", &up)?;
    // A box that changes is drawn where it does.
    let edge = if header.scene.protocol.is_empty() {
        let (x, y) = (l.x as f32, l.y as f32);
        let corners = [[0.0, 0.0], [x, 0.0], [x, y], [0.0, y], [0.0, 0.0]];
        let [r, g, b] = EDGE;
        LineStrips2D::new([corners]).with_colors([Color::from_rgb(r, g, b)])
    } else {
        LineStrips2D::update_fields()
    };
    let edge = edge
        .with_radii([Radius::new_ui_points(1.0)])
        .with_draw_order(40.0);
    put("/world/box", &edge)?;
    let outline = |width: f32, order: f32| {
        LineStrips2D::update_fields()
            .with_radii([Radius::new_ui_points(width)])
            .with_draw_order(order)
    };
    if channels.contours.is_on() {
        let width = outline_width(packing.len());
        put("/world/contours", &outline(width, 20.0))?;
        put("/world/contours/images", &outline(0.7 * width, 15.0))?;
        let points = Points2D::update_fields()
            .with_radii(packing.radii().iter().map(|r| (FILLED * r) as f32))
            .with_draw_order(10.0);
        put("/world/particles", &points)?;
        let radii = packing.radii().iter().map(|r| [*r as f32; 2]);
        let disks = Ellipses2D::update_fields()
            .with_half_sizes(radii)
            .with_colors([Color::from_rgb(255, 255, 255)])
            .with_line_radii([Radius::new_ui_points(0.8)])
            .with_draw_order(25.0);
        put("/world/disks", &disks)?;
    }
    if channels.contacts.is_on() {
        let order = |order: f32| LineStrips2D::update_fields().with_draw_order(order);
        put("/world/contacts", &order(31.0))?;
        put("/world/contacts/images", &order(30.0))?;
    }
    legend::write(header, put)
}

fn scene(header: &Header) -> io::Result<DynamicArchetype> {
    let toml = header.toml();
    let scene = DynamicArchetype::new("softjam.Scene")
        .with_component_from_data("toml", array(StringArray::from(vec![toml])))
        .with_component_from_data(
            "format_version",
            array(UInt32Array::from(vec![header.format])),
        )
        .with_component_from_data(
            "program",
            array(StringArray::from(vec![header.program.as_str()])),
        )
        .with_component_from_data("bits", array(UInt32Array::from(vec![header.bits])))
        .with_component_from_data(
            "from_step",
            array(UInt64Array::from(vec![header.from_step])),
        );
    Ok(match legs_to_text(&header.legs)? {
        None => scene,
        Some(legs) => scene.with_component_from_data("legs", array(StringArray::from(vec![legs]))),
    })
}

/// What a scene starts from, in words; those before the number of a random start are `seed`.
fn start(scene: &Scene, seed: &str) -> String {
    match &scene.start {
        Start::Random => format!("{seed} {}", scene.seed),
        Start::Hexagonal => "a hexagonal crystal".to_owned(),
        Start::File { path, .. } => format!("the packing in `{}`", shown(path)),
    }
}

/// A model in words, what its particles are called, and what φ is of them.
fn described(model: Kind) -> (&'static str, &'static str, &'static str) {
    match model {
        Kind::MorseWitten => (
            "Morse–Witten model",
            "deformable particle",
            ", the coverage of their undeformed disks",
        ),
        Kind::RoundedPolygon => (
            "Rounded polygons: droplets that keep their area, between straight films",
            "droplet",
            ", the coverage of their undeformed disks",
        ),
        Kind::WetFoam => (
            "Wet foam: droplets that keep their area, between films that their pressures bend",
            "droplet",
            ", the coverage of their undeformed disks",
        ),
        Kind::Disks => (
            "Undeformed disks, f = k δ with k = 4πγ / 3(R_i + R_j)",
            "disk",
            "",
        ),
    }
}

/// What a person who opens the recording reads beside the pictures.
fn text(header: &Header) -> String {
    let (scene, packing) = (&header.scene, &header.packing);
    let l = packing.domain().lengths();
    let start = start(scene, "a random start, seed");
    let first = match header.from_step {
        0 => String::new(),
        step => format!(
            " The recording begins with step {step}{}.",
            if header.legs.is_empty() {
                ""
            } else {
                ", to which another model, threshold, minimiser or form of the forces led"
            }
        ),
    };
    let (model, particle, coverage) = described(scene.model);
    let disks = if scene.records_disks() {
        format!(
            " Its first stage are the undeformed disks, to f_max ≤ {:e} γ.",
            scene.disks.threshold
        )
    } else {
        String::new()
    };
    let mut parts = vec![format!(
        "**{} at φ = {:.4}**{coverage}, in a periodic box of \
         {} × {}. {model}, line tension γ = {}; from {start} to f_max ≤ {:e} γ.{disks}{first} Recorded by \
         {}.\n\n",
        counted(packing.len(), particle),
        packing.coverage(),
        length(l.x),
        length(l.y),
        scene.line_tension,
        scene.threshold,
        header.program,
    )];
    let channels = &scene.channels;
    let missing: Vec<&str> = [
        ("contours", channels.contours),
        ("contacts", channels.contacts),
        ("metrics", channels.metrics),
    ]
    .into_iter()
    .filter_map(|(name, schedule)| (!schedule.is_on()).then_some(name))
    .collect();
    if !missing.is_empty() {
        let how = if channels.state.is_on() {
            ": `softjam convert THIS.rrd WHOLE.rrd --channels contours,contacts,metrics,state` brings them back from the states"
        } else {
            ""
        };
        let missing = missing.join(", no ");
        parts.push(format!("**This recording has no {missing}**{how}.\n\n"));
    }
    if channels.contours.is_on() || channels.contacts.is_on() {
        parts.push("| in the picture | |\n| --- | --- |\n".to_owned());
    }
    if channels.contours.is_on() {
        let [outline, dent, disks] = match scene.model {
            Kind::RoundedPolygon | Kind::WetFoam => [
                "contour of a droplet",
                ", deepest dent −ΔR/R",
                "| `/world/disks` | undeformed disks: a click on the eye in the blueprint panel shows them |\n",
            ],
            Kind::MorseWitten => [
                "contour ρ(θ) of a particle",
                ", deepest dent −ΔR/R",
                "| `/world/disks` | undeformed disks: a click on the eye in the blueprint panel shows them |\n",
            ],
            Kind::Disks => ["edge of a disk", "", ""],
        };
        parts.push(format!(
            "| outline | {outline}; thin and dim: periodic image of one that crosses the edge |\n\
             | its colour | pressure on the particle, p = Σ f / 2πR, over the mean (viridis, 0 to 2) |\n\
             | gray | rattler: fewer than three contacts that bear a force |\n\
             | what fills it | hover it for its number, p (γ/length), number of contacts Z{dent} |\n{disks}"
        ));
    }
    if channels.contacts.is_on() {
        parts.push("| line | contact; width and colour: force f over the mean (inferno, 0 to 3); click it for its pair, f (γ) and overlap δ |\n".to_owned());
    }
    if scene.model == Kind::MorseWitten {
        parts.push(format!(
        "\n**Validity.** The model is linear in the forces: on a particle that is squeezed beyond Σ f / 2πγ = {SQUEEZE_LIMIT} they fall short of a \
         real droplet's by more than 10 %. In mixtures that begins near φ = 0.86; `softjam info` tells how many particles are beyond it.\n"
    ));
    }
    parts.push(format!(
        "\nThe whole scene:\n\n```toml\n{}```\n",
        header.toml()
    ));
    parts.concat()
}
