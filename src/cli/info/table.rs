//! What is said of several recordings: a line each.

use serde_json::Value;
use std::fmt::Write as _;

/// The columns: fields of the object that is said of a file, or of its metrics.
const COLUMNS: [&str; 13] = [
    "file",
    "status",
    "stability",
    "model",
    "particles",
    "phi",
    "seed",
    "steps",
    "f_max",
    "coordination",
    "pressure",
    "energy",
    "rattlers",
];

/// The columns from here on are metrics.
const METRICS: usize = 8;

/// The cells of a file.
fn cells(file: &Value) -> [&Value; COLUMNS.len()] {
    core::array::from_fn(|k| match COLUMNS[k] {
        name if k >= METRICS => &file["metrics"][name],
        // Where a run has no end it is known how far it came.
        "steps" if file["steps"].is_null() => &file["intact"],
        name => &file[name],
    })
}

/// As comma-separated values with a header, every digit of the numbers (RFC 4180).
pub(super) fn csv(files: &[Value]) -> String {
    let mut text = COLUMNS.join(",");
    for file in files {
        text.push('\n');
        let cells = cells(file).map(|cell| match cell {
            Value::Null => String::new(),
            Value::String(text) if text.contains([',', '"']) => {
                format!("\"{}\"", text.replace('"', "\"\""))
            }
            Value::String(text) => text.clone(),
            number => number.to_string(),
        });
        text.push_str(&cells.join(","));
    }
    text.push('\n');
    text
}

/// As a table for people, its columns aligned.
pub(super) fn text(files: &[Value]) -> String {
    let row = |file| {
        let mut column = COLUMNS.into_iter();
        cells(file).map(|cell| {
            let name = column.next();
            match (cell, cell.as_f64()) {
                (Value::Null, _) => "–".to_owned(),
                (Value::String(text), _) => text.clone(),
                (_, Some(number)) if cell.is_f64() => match name {
                    Some("phi" | "coordination") => format!("{number:.4}"),
                    Some("rattlers") => number.to_string(),
                    _ => format!("{number:.3e}"),
                },
                _ => cell.to_string(),
            }
        })
    };
    let head = COLUMNS.map(str::to_owned);
    let lines: Vec<_> = core::iter::once(head)
        .chain(files.iter().map(row))
        .collect();
    let mut text = String::new();
    for line in &lines {
        for (k, cell) in line.iter().enumerate() {
            let gap = if k == 0 { "" } else { "  " };
            let widths = lines.iter().map(|line| line[k].chars().count());
            let width = widths.max().unwrap_or(0);
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
