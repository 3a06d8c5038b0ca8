//! The figure: eight panels from the six tables.

use super::chart::{
    Axis, BLACK, BLUE, Bars, GREEN, Line, Marker, ORANGE, PINK, Panel, RED, SIZE, SKY, Series,
};
use super::laws;
use super::table::Table;
use std::fmt::Write as _;

/// The picture from the tables, in the order of the items.
pub fn draw(tables: &[Table]) -> String {
    let panels = [
        contact(&tables[0]),
        relaxation(&tables[1]),
        laws::model(&tables[2]),
        size(&tables[3]),
        recording(&tables[4]),
        contour(&tables[5]),
        laws::packings(&tables[2]),
        laws::time(&tables[2]),
    ];
    let (width, height) = (4.0 * SIZE.0, 2.0 * SIZE.1);
    let mut s = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width} {height}\" width=\"{width}\" height=\"{height}\" \
         font-family=\"Helvetica, Arial, 'DejaVu Sans', sans-serif\" font-size=\"15\">\n\
         <rect width=\"{width}\" height=\"{height}\" fill=\"white\"/>\n"
    );
    for (k, panel) in panels.iter().enumerate() {
        let (x, y) = ((k % 4) as f64 * SIZE.0, (k / 4) as f64 * SIZE.1);
        // Writing to a String cannot fail.
        let _ = writeln!(s, "<g transform=\"translate({x} {y})\">\n{panel}</g>");
    }
    s.push_str("</svg>\n");
    s
}

pub fn series(
    label: &str,
    points: Vec<(f64, f64)>,
    color: &'static str,
    marker: Marker,
    line: Line,
) -> Series {
    Series {
        label: label.into(),
        points,
        color,
        marker,
        line,
    }
}

/// The decades that hold all values.
fn decades<'a>(values: impl Iterator<Item = &'a f64>) -> (f64, f64) {
    let (mut a, mut b) = (f64::INFINITY, 0.0f64);
    for v in values.filter(|v| **v > 0.0) {
        a = a.min(*v);
        b = b.max(*v);
    }
    if a > b {
        return (0.1, 10.0);
    }
    let (low, high) = (10f64.powf(a.log10().floor()), 10f64.powf(b.log10().ceil()));
    (low, if high > low { high } else { 10.0 * low })
}

fn contact(table: &Table) -> String {
    let sizes = table.values("particles");
    let n = if sizes.iter().any(|s| s == "1024") {
        "1024"
    } else {
        "256"
    };
    let of = |method: &str| {
        let filter = [("particles", n), ("phi", "0.86"), ("method", method)];
        let mut points = table.points(&filter, "seconds", "residual");
        for p in &mut points {
            p.0 *= 1e3;
            p.1 = p.1.max(1e-16);
        }
        points
    };
    let series = vec![
        series("warm CG", of("warm CG"), BLUE, Marker::Circle, Line::Solid),
        series("cold CG", of("cold CG"), SKY, Marker::Square, Line::Solid),
        series(
            "sparse Cholesky",
            of("sparse Cholesky"),
            GREEN,
            Marker::Triangle,
            Line::None,
        ),
        series(
            "dense Gauss–Jordan",
            of("dense Gauss–Jordan"),
            RED,
            Marker::Diamond,
            Line::None,
        ),
    ];
    Panel {
        title: format!("a  Contact problem, N = {n}, φ = 0.86"),
        x: Axis::log(
            "time of one solution (ms)",
            decades(series.iter().flat_map(|s| &s.points).map(|p| &p.0)),
        ),
        y: Axis::log("residual / largest overlap", (1e-16, 1.0)),
        legend: (0.40, 0.10),
        notes: Vec::new(),
        series,
    }
    .svg()
}

fn relaxation(table: &Table) -> String {
    let sizes = table.values("particles");
    let n = if sizes.iter().any(|s| s == "1024") {
        "1024"
    } else {
        "64"
    };
    let phi = if n == "64" { "0.9" } else { "0.86" };
    let of = |variant: &str| {
        let filter = [("particles", n), ("phi", phi), ("variant", variant)];
        table.points(&filter, "seconds", "f_max")
    };
    let styles = [
        ("fire", "FIRE", BLUE, Marker::Circle, Line::Solid),
        (
            "fire + newton",
            "FIRE + Newton",
            RED,
            Marker::Diamond,
            Line::Solid,
        ),
        (
            "fire (gradient form)",
            "FIRE, gradient form",
            SKY,
            Marker::Open,
            Line::Solid,
        ),
        (
            "fire + newton (gradient form)",
            "+ Newton, gradient",
            ORANGE,
            Marker::Triangle,
            Line::Solid,
        ),
        (
            "fire (dt_max / 2)",
            "FIRE, dt / 2",
            PINK,
            Marker::None,
            Line::Dashed,
        ),
        (
            "fire (dt_max × 1.4)",
            "FIRE, dt × 1.4",
            GREEN,
            Marker::None,
            Line::Dashed,
        ),
        (
            "fire (dt_max × 2)",
            "FIRE, dt × 2",
            BLACK,
            Marker::None,
            Line::Dashed,
        ),
    ];
    let series: Vec<Series> = styles
        .into_iter()
        .map(|(name, label, color, marker, line)| series(label, of(name), color, marker, line))
        .filter(|s| !s.points.is_empty())
        .collect();
    let x = decades(series.iter().flat_map(|s| &s.points).map(|p| &p.0));
    Panel {
        title: format!("b  Relaxation, N = {n}, φ = {phi}"),
        // A decade on the left for the legend.
        x: Axis::log("wall time of both stages (s)", (0.1 * x.0, x.1)),
        y: Axis::log("largest net force (γ)", (1e-14, 1.0)),
        legend: (0.03, 0.52),
        notes: Vec::new(),
        series,
    }
    .svg()
}

fn size(table: &Table) -> String {
    let of = |phi: &str, column: &str| {
        let mut points = table.points(&[("phi", phi)], "particles", column);
        for p in &mut points {
            p.1 *= 1e-3;
        }
        points
    };
    let series = vec![
        series(
            "droplets, φ = 0.86",
            of("0.86", "ns_per_step_and_particle"),
            BLUE,
            Marker::Circle,
            Line::Solid,
        ),
        series(
            "droplets, φ = 0.95",
            of("0.95", "ns_per_step_and_particle"),
            RED,
            Marker::Diamond,
            Line::Solid,
        ),
        series(
            "φ = 0.86, two threads",
            of("0.86", "two_threads_ns_per_step_and_particle"),
            BLUE,
            Marker::Circle,
            Line::Dashed,
        ),
        series(
            "disks, φ = 0.86",
            of("0.86", "disks_ns_per_step_and_particle"),
            SKY,
            Marker::Square,
            Line::Solid,
        ),
    ];
    let y = decades(series.iter().flat_map(|s| &s.points).map(|p| &p.1));
    Panel {
        title: "d  Cost of a step".into(),
        x: Axis::log("particles N", (10.0, 1e5)),
        y: Axis::log("µs per step and particle", y),
        legend: (0.04, 0.60),
        notes: Vec::new(),
        series,
    }
    .svg()
}

fn recording(table: &Table) -> String {
    let bars: Vec<(String, f64, String)> = [
        ("none", "none", ""),
        ("metrics", "metrics", "0.01"),
        ("state", "state", "0.01"),
        ("contacts", "contacts", "0.01"),
        ("contours", "contours", "0.01"),
        ("all", "contours contacts metrics state", "0.01"),
        ("redraw 0", "contours contacts metrics state", "0"),
    ]
    .into_iter()
    .filter_map(|(name, channels, redraw)| {
        let filter = [("channels", channels), ("redraw", redraw)];
        let slow = table.points(&filter, "slowdown", "bytes_per_step");
        let rate = table.points(&filter, "steps_per_s", "bytes_per_step");
        let (&(slow, bytes), &(rate, _)) = (slow.first()?, rate.first()?);
        Some((
            name.into(),
            slow,
            format!("{rate:.0} steps/s, {:.1} kB a step", bytes / 1e3),
        ))
    })
    .collect();
    let n = table
        .values("particles")
        .first()
        .cloned()
        .unwrap_or_default();
    Bars {
        title: format!("e  Recording every step, N = {n}"),
        label: "time of a run / that without recording".into(),
        most: bars
            .iter()
            .fold(1.5, |m: f64, b| m.max((2.0 * b.1).ceil() / 2.0)),
        limit: None,
        rows: bars,
    }
    .svg()
}

fn contour(table: &Table) -> String {
    let of = |placement: &str, column: &str| {
        table.points(&[("placement", placement)], "vertices_per_particle", column)
    };
    let series = vec![
        series(
            "equal angles, largest",
            of("equal angles", "largest_error"),
            RED,
            Marker::Diamond,
            Line::Solid,
        ),
        series(
            "equal angles, rms",
            of("equal angles", "rms_error"),
            ORANGE,
            Marker::None,
            Line::Dashed,
        ),
        series(
            "and on contacts, largest",
            of("and on contacts", "largest_error"),
            BLUE,
            Marker::Circle,
            Line::Solid,
        ),
        series(
            "and on contacts, rms",
            of("and on contacts", "rms_error"),
            SKY,
            Marker::None,
            Line::Dashed,
        ),
    ];
    let y = decades(series.iter().flat_map(|s| &s.points).map(|p| &p.1));
    Panel {
        title: "f  Contours as polygons, φ = 0.90".into(),
        x: Axis::log("vertices a particle", (5.0, 3000.0)),
        y: Axis::log("distance from the contour (R)", y),
        legend: (0.03, 0.72),
        notes: Vec::new(),
        series,
    }
    .svg()
}
