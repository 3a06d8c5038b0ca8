//! The layout that a recording opens with: the packing at the left; the fall of `f_max`, the metrics and the scene at the
//! right. It is the same for all recordings but those of a protocol, which have a row of plots more.

use super::encode::Encoder;
use crate::scene::Scene;
use rerun::datatypes::{TimeRange, TimeRangeBoundary};
use rerun::external::re_log_types::{StoreId, StoreKind};
use rerun::external::re_sdk_types::blueprint::archetypes::{
    ContainerBlueprint, EntityBehavior, PanelBlueprint, PlotLegend, TimeAxis, TimePanelBlueprint,
    ViewBlueprint, ViewContents, ViewportBlueprint,
};
use rerun::external::re_sdk_types::blueprint::components::{
    ContainerKind, LinkAxis, PanelState, PlayState, RootContainer,
};
use rerun::{AsComponents, Color, SeriesLines, TimePoint, Timeline};
use std::io::{self, Write};

/// A view: its number, its kind, its title, and the entities it shows.
struct View {
    number: u8,
    class: &'static str,
    title: &'static str,
    origin: &'static str,
    contents: &'static [&'static str],
    /// The colour of its curve, if it plots one.
    curve: [u8; 3],
}

const PACKING: View = View {
    number: 1,
    class: "2D",
    title: "Packing: pressure on the particles, force chains",
    origin: "/",
    contents: &["+ /world/**"],
    curve: [0; 3],
};

/// The plot above, and those that stand side by side below it.
const PLOTS: [View; 4] = [
    View {
        number: 2,
        class: "TimeSeries",
        title: "log₁₀ of f_max / γ, over steps",
        origin: "/metrics",
        contents: &["+ /metrics/log10_f_max"],
        curve: [255, 170, 60],
    },
    View {
        number: 4,
        class: "TimeSeries",
        title: "Z",
        origin: "/metrics",
        contents: &["+ /metrics/coordination"],
        curve: [100, 190, 255],
    },
    View {
        number: 3,
        class: "TimeSeries",
        title: "Pressure (γ/length)",
        origin: "/metrics",
        contents: &["+ /metrics/pressure"],
        curve: [80, 220, 120],
    },
    View {
        number: 6,
        class: "TimeSeries",
        title: "Energy (γ·length)",
        origin: "/metrics",
        contents: &["+ /metrics/energy"],
        curve: [250, 220, 80],
    },
];

/// What a protocol has beside them.
const PROTOCOL: [View; 3] = [
    View {
        number: 7,
        class: "TimeSeries",
        title: "φ",
        origin: "/metrics",
        contents: &["+ /metrics/phi"],
        curve: [220, 150, 255],
    },
    View {
        number: 8,
        class: "TimeSeries",
        title: "Strain",
        origin: "/metrics",
        contents: &["+ /metrics/strain"],
        curve: [90, 220, 210],
    },
    View {
        number: 9,
        class: "TimeSeries",
        title: "σ_xy (γ/length)",
        origin: "/metrics",
        contents: &["+ /metrics/stress_xy"],
        curve: [255, 120, 120],
    },
];

const SCENE: View = View {
    number: 5,
    class: "TextDocument",
    title: "Scene",
    origin: "/scene",
    contents: &["+ /scene"],
    curve: [0; 3],
};

impl View {
    fn path(&self) -> String {
        format!("view/{}", uuid(self.number))
    }
}

/// Fixed identifiers: a random one would change the bytes of the file.
fn uuid(number: u8) -> rerun::external::uuid::Uuid {
    rerun::external::uuid::Uuid::from_u128(
        0x736f_6674_6a61_6d00_8000_0000_0000_0000 + u128::from(number),
    )
}

/// Writes the blueprint of the recording `recording` of a run of `scene` and makes it the one shown.
pub(super) fn write<W: Write>(
    encoder: &mut Encoder<W>,
    recording: &str,
    scene: &Scene,
) -> io::Result<()> {
    let protocol: &[View] = if scene.protocol.is_empty() {
        &[]
    } else {
        &PROTOCOL
    };
    let plots = || PLOTS.iter().chain(protocol);
    let store = StoreId::new(
        StoreKind::Blueprint,
        env!("CARGO_PKG_NAME"),
        format!("{recording}-blueprint"),
    );
    let store = &store;
    encoder.open(store)?;
    let mut log = |entity: &str, data: &dyn AsComponents| {
        let time = TimePoint::default().with(Timeline::new_sequence("blueprint"), 0);
        encoder.single(store, entity, time, data)
    };
    for view in plots().chain([&PACKING, &SCENE]) {
        let path = view.path();
        log(
            &format!("{path}/ViewContents"),
            &ViewContents::new(view.contents.iter().copied()),
        )?;
        let blueprint = ViewBlueprint::new(view.class)
            .with_display_name(view.title)
            .with_space_origin(view.origin);
        log(&path, &blueprint)?;
    }
    write_plots(&mut log, plots())?;
    // No bounds are said: the view fits what there is. A blueprint holds for all recordings that are open, whatever the
    // sizes of their boxes.
    let of = |entity: &str| {
        format!(
            "{}/ViewContents/overrides/{entity}/visualizers",
            PACKING.path()
        )
    };
    log(
        &of("world/disks"),
        &EntityBehavior::new().with_visible(false),
    )?;
    for still in ["world/box", "world/legend"] {
        log(&of(still), &EntityBehavior::new().with_interactive(false))?;
    }
    let container = |number: u8| format!("container/{}", uuid(number));
    let (row, side, root) = (container(10), container(11), container(12));
    let [fall, rest @ ..] = &PLOTS;
    log(
        &row,
        &ContainerBlueprint::new(ContainerKind::Horizontal)
            .with_contents(rest.iter().map(View::path)),
    )?;
    let (mut below, mut shares) = (vec![fall.path(), row.clone()], vec![5.0, 3.5]);
    if !protocol.is_empty() {
        let second = container(13);
        log(
            &second,
            &ContainerBlueprint::new(ContainerKind::Horizontal)
                .with_contents(protocol.iter().map(View::path)),
        )?;
        below.push(second);
        shares.push(3.5);
    }
    below.push(SCENE.path());
    shares.push(if protocol.is_empty() { 5.0 } else { 3.0 });
    log(
        &side,
        &ContainerBlueprint::new(ContainerKind::Vertical)
            .with_display_name("Relaxation")
            .with_contents(below)
            .with_row_shares(shares),
    )?;
    log(
        &root,
        &ContainerBlueprint::new(ContainerKind::Horizontal)
            .with_contents([PACKING.path(), side.clone()])
            .with_col_shares([6.0, 5.0]),
    )?;
    log(
        "viewport",
        &ViewportBlueprint::new()
            .with_root_container(RootContainer(uuid(12).into()))
            .with_auto_layout(false)
            .with_auto_views(false),
    )?;
    write_panels(&mut log)?;
    encoder.activate(store)
}

/// The axes and curves of plots.
fn write_plots<'a>(
    log: &mut impl FnMut(&str, &dyn AsComponents) -> io::Result<()>,
    plots: impl Iterator<Item = &'a View>,
) -> io::Result<()> {
    // The whole run on every plot, wherever the time cursor is.
    let everything = TimeRange {
        start: TimeRangeBoundary::Infinite,
        end: TimeRangeBoundary::Infinite,
    };
    for plot in plots {
        log(
            &format!("{}/TimeAxis", plot.path()),
            &TimeAxis::new()
                .with_link(LinkAxis::Independent)
                .with_view_range(everything),
        )?;
        let [r, g, b] = plot.curve;
        let curve = SeriesLines::new()
            .with_colors([Color::from_rgb(r, g, b)])
            .with_widths([2.0]);
        log(&format!("{}/defaults", plot.path()), &curve)?;
        // One curve a plot, whose title names it.
        log(
            &format!("{}/PlotLegend", plot.path()),
            &PlotLegend::new().with_visible(false),
        )?;
    }
    Ok(())
}

/// What stands around the views.
fn write_panels(log: &mut impl FnMut(&str, &dyn AsComponents) -> io::Result<()>) -> io::Result<()> {
    let folded = PanelBlueprint::new().with_state(PanelState::Collapsed);
    log("blueprint_panel", &folded)?;
    log("selection_panel", &folded)?;
    log(
        "time_panel",
        &TimePanelBlueprint::new()
            .with_state(PanelState::Collapsed)
            .with_timeline("step")
            // A recording opens on its last frame, the packing in balance.
            .with_play_state(PlayState::Following),
    )
}
