//! What is said of several recordings: a line each.

use super::Findings;
use softjam::replay::Recording;
use softjam::scene::Start;
use softjam::text::shown;
use std::fmt::Write as _;

/// The columns, each with the metric that it shows, if it shows one.
const COLUMNS: [(&str, Option<&str>); 13] = [
    ("file", None),
    ("status", None),
    ("stability", None),
    ("model", None),
    ("particles", None),
    ("phi", None),
    ("seed", None),
    ("steps", None),
    ("f_max", Some("f_max")),
    ("coordination", Some("coordination")),
    ("pressure", Some("pressure")),
    ("energy", Some("energy")),
    ("rattlers", Some("rattlers")),
];

/// What is in a cell.
enum Cell {
    Nothing,
    Text(String),
    Whole(u64),
    Real(f64),
}

/// What is said of a file, a cell a column.
pub(super) struct Row([Cell; COLUMNS.len()]);

/// The seed of a recorded run; a start from a file has none.
pub(super) fn seed(recording: &Recording) -> Option<u64> {
    let scene = recording.scene();
    (!matches!(scene.start, Start::File { .. })).then_some(scene.seed)
}

impl Row {
    pub fn of(file: &str, recording: &Recording, found: &Findings) -> Self {
        let steps = found.result.map(|end| end.steps);
        Self(COLUMNS.map(|(name, metric)| {
            match (name, metric) {
                ("file", _) => Cell::Text(file.to_owned()),
                ("status", _) => Cell::Text(found.standing(recording).to_string()),
                ("stability", _) => {
                    let stability = found.result.and_then(|end| end.stability);
                    stability.map_or(Cell::Nothing, |s| Cell::Text(s.name().to_owned()))
                }
                ("model", _) => Cell::Text(recording.scene().model.name().to_owned()),
                ("particles", _) => Cell::Whole(recording.radii().len() as u64),
                ("phi", _) => Cell::Real(recording.coverage()),
                ("seed", _) => seed(recording).map_or(Cell::Nothing, Cell::Whole),
                ("steps", _) => steps
                    .or(recording.intact())
                    .map_or(Cell::Nothing, Cell::Whole),
                (_, metric) => {
                    let value = metric.and_then(|name| found.metrics.get(name));
                    value.map_or(Cell::Nothing, |value| Cell::Real(*value))
                }
            }
        }))
    }

    /// Of a file that could not be read.
    pub fn unreadable(file: &str) -> Self {
        Self(COLUMNS.map(|(name, _)| match name {
            "file" => Cell::Text(file.to_owned()),
            "status" => Cell::Text("unreadable".to_owned()),
            _ => Cell::Nothing,
        }))
    }
}

/// As comma-separated values with a header, every digit of the numbers (RFC 4180).
pub(super) fn csv(rows: &[Row]) -> String {
    let mut text = COLUMNS.map(|(name, _)| name).join(",");
    for row in rows {
        text.push('\n');
        let cells = row.0.each_ref().map(|cell| match cell {
            Cell::Nothing => String::new(),
            Cell::Text(text) => {
                let text = shown(text);
                if text.contains([',', '"']) {
                    format!("\"{}\"", text.replace('"', "\"\""))
                } else {
                    text
                }
            }
            Cell::Whole(number) => number.to_string(),
            Cell::Real(number) => format!("{number:?}"),
        });
        text.push_str(&cells.join(","));
    }
    text.push('\n');
    text
}

/// As a table for people, its columns aligned.
pub(super) fn text(rows: &[Row]) -> String {
    let shown = |(column, cell): ((&str, Option<&str>), &Cell)| match cell {
        Cell::Nothing => "–".to_owned(),
        Cell::Text(text) => shown(text),
        Cell::Whole(number) => number.to_string(),
        Cell::Real(number) if ["phi", "coordination"].contains(&column.0) => {
            format!("{number:.4}")
        }
        Cell::Real(number) if column.0 == "rattlers" => number.to_string(),
        Cell::Real(number) => format!("{number:.3e}"),
    };
    let head: Vec<String> = COLUMNS.map(|(name, _)| name.to_owned()).into();
    let lines = rows.iter().map(|row| {
        let cells = COLUMNS.into_iter().zip(&row.0);
        cells.map(shown).collect::<Vec<String>>()
    });
    let lines: Vec<Vec<String>> = core::iter::once(head).chain(lines).collect();
    let widths: Vec<usize> = (0..COLUMNS.len())
        .map(|k| {
            let cells = lines.iter().map(|line| line[k].chars().count());
            cells.max().unwrap_or(0)
        })
        .collect();
    let mut text = String::new();
    for line in lines {
        for (k, (cell, width)) in line.iter().zip(&widths).enumerate() {
            let gap = if k == 0 { "" } else { "  " };
            // Writing to a String cannot fail. The first columns are words, the others numbers.
            let _ = if k < 4 {
                write!(text, "{gap}{cell:<width$}")
            } else {
                write!(text, "{gap}{cell:>width$}")
            };
        }
        text.push('\n');
    }
    text
}
