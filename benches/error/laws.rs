//! The panels on the errors of the laws.

use super::chart::{Axis, BLACK, BLUE, GREEN, Line, Marker, ORANGE, PINK, Panel, RED, SKY, Series};
use super::figure::series;
use super::table::Table;

/// The least error that is shown; exact laws lie there.
const LEAST: f64 = 1e-5;

/// Laws that are not exact: name in scenes, label, colour and marker.
const LAWS: [(&str, &str, &str, Marker); 3] = [
    ("disks", "undeformed disks", SKY, Marker::Square),
    ("morse-witten", "Morse–Witten", BLUE, Marker::Circle),
    (
        "rounded-polygon",
        "rounded polygons",
        GREEN,
        Marker::Triangle,
    ),
];

/// Two columns of the packings of a law, errors without their sign.
fn packings_of(table: &Table, law: &str, x: &str, y: &str) -> Vec<(f64, f64)> {
    let points = table.points(&[("geometry", "packing"), ("law", law)], x, y);
    points
        .iter()
        .map(|(x, y)| (*x, y.abs().max(LEAST)))
        .collect()
}

/// Forces over the squeeze: the linear model between walls, and packings.
pub fn model(table: &Table) -> String {
    let of = |geometry: &str| {
        let filter = [("geometry", geometry), ("law", "morse-witten")];
        table.points(&filter, "squeeze", "model_error")
    };
    let lines = [
        ("between two plates", "two plates", ORANGE, Line::Solid),
        ("within a hexagon", "hexagon", RED, Line::Dashed),
    ];
    let mut all: Vec<Series> = lines
        .into_iter()
        .map(|(label, name, color, line)| series(label, of(name), color, Marker::None, line))
        .collect();
    let crystal = of("hexagonal crystal");
    all.push(series(
        "hexagonal crystal",
        crystal,
        BLACK,
        Marker::Open,
        Line::None,
    ));
    for (law, label, color, marker) in &LAWS[1..] {
        let points = packings_of(table, law, "squeeze", "force_rms");
        all.push(series(
            &format!("packings, {label}"),
            points,
            color,
            *marker,
            Line::None,
        ));
    }
    let limit = vec![(1e-3, 0.1), (10.0, 0.1)];
    all.push(series("", limit, PINK, Marker::None, Line::Dashed));
    Panel {
        title: "c  Error of the model itself".into(),
        x: Axis::log("squeeze Σf / 2πγ", (1e-3, 10.0)),
        y: Axis::log("error of the forces (relative)", (1e-4, 100.0)),
        legend: (0.04, 0.06),
        notes: vec![(1e-3, 0.1, "10 %".into())],
        series: all,
    }
    .svg()
}

/// Osmotic pressure and forces of packings over φ.
pub fn packings(table: &Table) -> String {
    let of = |column: &str, law: &str| packings_of(table, law, "phi", column);
    let mut all = Vec::new();
    for (law, label, color, marker) in LAWS {
        all.push(series(
            label,
            of("pressure_error", law),
            color,
            marker,
            Line::Solid,
        ));
        all.push(series(
            "",
            of("force_rms", law),
            color,
            Marker::None,
            Line::Dashed,
        ));
    }
    all.push(series(
        "rms of the forces",
        Vec::new(),
        BLACK,
        Marker::None,
        Line::Dashed,
    ));
    Panel {
        title: "g  Packings against wet foam, N = 64".into(),
        x: Axis {
            label: "coverage φ".into(),
            range: (0.85, 1.0),
            log: false,
        },
        y: Axis::log("error of the osmotic pressure (relative)", (LEAST, 10.0)),
        legend: (0.40, 0.74),
        notes: Vec::new(),
        series: all,
    }
    .svg()
}

/// The same against the time from a random start to f_max = 1e-10.
pub fn time(table: &Table) -> String {
    let of = |law: &str| {
        let mut points = packings_of(table, law, "seconds", "pressure_error");
        for p in &mut points {
            p.0 *= 1e3;
        }
        points
    };
    let mut all: Vec<Series> = LAWS
        .into_iter()
        .map(|(law, label, color, marker)| series(label, of(law), color, marker, Line::Solid))
        .collect();
    all.push(series(
        "wet foam, exact",
        of("wet-foam"),
        RED,
        Marker::Diamond,
        Line::Solid,
    ));
    let ends = [0, all[1].points.len().saturating_sub(1)];
    let ends = ends.iter().filter_map(|k| all[1].points.get(*k));
    let notes = ends
        .zip(["φ = 0.86", "φ = 0.98"])
        .map(|((x, y), note)| (*x, *y, note.to_owned()))
        .collect();
    Panel {
        title: "h  Error against time to relax, N = 64".into(),
        x: Axis::log("random start to f_max = 1e-10 γ (ms)", (0.1, 1000.0)),
        y: Axis::log("error of the osmotic pressure (relative)", (LEAST, 10.0)),
        legend: (0.04, 0.72),
        notes,
        series: all,
    }
    .svg()
}
