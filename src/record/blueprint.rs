//! The layout that a recording opens with: the packing at the left, the fall of `f_max` and the metrics at the right.

use super::encode::Encoder;
use crate::domain::Domain;
use rerun::datatypes::{TimeRange, TimeRangeBoundary};
use rerun::external::re_log_types::{StoreId, StoreKind};
use rerun::external::re_sdk_types::blueprint::archetypes::{
    ContainerBlueprint, PanelBlueprint, TimeAxis, TimePanelBlueprint, ViewBlueprint, ViewContents,
    ViewportBlueprint, VisualBounds2D,
};
use rerun::external::re_sdk_types::blueprint::components::{
    ContainerKind, LinkAxis, PanelState, PlayState, RootContainer,
};
use rerun::{AsComponents, TimePoint, Timeline};
use std::io::{self, Write};

/// A view: its number, its kind, its title, and the entities it shows.
struct View {
    number: u8,
    class: &'static str,
    title: &'static str,
    origin: &'static str,
    contents: &'static [&'static str],
}

const PACKING: View = View {
    number: 1,
    class: "2D",
    title: "Packing: contours and force chains",
    origin: "/",
    contents: &["+ /world/**"],
};

const PLOTS: [View; 3] = [
    View {
        number: 2,
        class: "TimeSeries",
        title: "log₁₀ f_max / γ",
        origin: "/metrics",
        contents: &["+ /metrics/log10_f_max"],
    },
    View {
        number: 3,
        class: "TimeSeries",
        title: "Pressure and energy",
        origin: "/metrics",
        contents: &["+ /metrics/pressure", "+ /metrics/energy"],
    },
    View {
        number: 4,
        class: "TimeSeries",
        title: "Coordination number Z",
        origin: "/metrics",
        contents: &["+ /metrics/coordination"],
    },
];

const SCENE: View = View {
    number: 5,
    class: "TextDocument",
    title: "Scene",
    origin: "/scene",
    contents: &["+ /scene"],
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

/// Writes the blueprint of the recording `recording` and makes it the one shown.
pub(super) fn write<W: Write>(
    encoder: &mut Encoder<W>,
    recording: &str,
    domain: Domain,
) -> io::Result<()> {
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
    for view in PLOTS.iter().chain([&PACKING, &SCENE]) {
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
    // The whole run on every plot, wherever the time cursor is.
    let everything = TimeRange {
        start: TimeRangeBoundary::Infinite,
        end: TimeRangeBoundary::Infinite,
    };
    for plot in &PLOTS {
        log(
            &format!("{}/TimeAxis", plot.path()),
            &TimeAxis::new()
                .with_link(LinkAxis::Independent)
                .with_view_range(everything),
        )?;
    }
    // In the view y points down; the packing is mirrored into y < 0.
    let l = domain.lengths();
    let margin = 0.03 * l.norm();
    log(
        &format!("{}/VisualBounds2D", PACKING.path()),
        &VisualBounds2D::new(rerun::datatypes::Range2D {
            x_range: [-margin, l.x + margin].into(),
            y_range: [-l.y - margin, margin].into(),
        }),
    )?;
    let container = |number: u8| format!("container/{}", uuid(number));
    let (plots, side, root) = (container(10), container(11), container(12));
    let paths: Vec<String> = PLOTS.iter().map(View::path).collect();
    log(
        &plots,
        &ContainerBlueprint::new(ContainerKind::Vertical)
            .with_display_name("Relaxation")
            .with_contents(paths),
    )?;
    log(
        &side,
        &ContainerBlueprint::new(ContainerKind::Tabs)
            .with_contents([plots.clone(), SCENE.path()])
            .with_active_tab(plots.as_str()),
    )?;
    log(
        &root,
        &ContainerBlueprint::new(ContainerKind::Horizontal)
            .with_contents([PACKING.path(), side.clone()])
            .with_col_shares([2.0, 1.0]),
    )?;
    log(
        "viewport",
        &ViewportBlueprint::new()
            .with_root_container(RootContainer(uuid(12).into()))
            .with_auto_layout(false)
            .with_auto_views(false),
    )?;
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
    )?;
    encoder.activate(store)
}
