//! A table with named columns, as a CSV file.

use std::error::Error;
use std::path::Path;

/// Rows of text under named columns; no field holds a comma.
#[derive(Clone, Debug, Default)]
pub struct Table {
    columns: Vec<String>,
    rows: Vec<Vec<String>>,
}

impl Table {
    pub fn new(columns: &[&str]) -> Self {
        Self {
            columns: columns.iter().map(|c| (*c).to_owned()).collect(),
            rows: Vec::new(),
        }
    }

    /// Adds a row and shows it.
    pub fn push(&mut self, row: Vec<String>) {
        assert_eq!(row.len(), self.columns.len(), "one field a column");
        assert!(row.iter().all(|f| !f.contains(',')), "a comma in {row:?}");
        let shown: Vec<String> = self
            .columns
            .iter()
            .zip(&row)
            .filter(|f| !f.1.is_empty())
            .map(|(c, f)| format!("{c} {f}"))
            .collect();
        eprintln!("  {}", shown.join(", "));
        self.rows.push(row);
    }

    /// Adds a row of fields under their columns and shows it; other fields stay empty.
    pub fn add(&mut self, fields: &[(&str, &str)]) {
        let known = |name: &str| self.columns.iter().any(|column| column == name);
        assert!(fields.iter().all(|f| known(f.0)), "columns of {fields:?}");
        let of = |column: &String| fields.iter().find(|f| f.0 == column).map_or("", |f| f.1);
        self.push(self.columns.iter().map(|c| of(c).to_owned()).collect());
    }

    pub fn write(&self, path: &Path) -> Result<(), Box<dyn Error>> {
        let mut text = self.columns.join(",");
        for row in &self.rows {
            text.push('\n');
            text.push_str(&row.join(","));
        }
        text.push('\n');
        Ok(std::fs::write(path, text)?)
    }

    pub fn read(path: &Path) -> Result<Self, Box<dyn Error>> {
        let text = std::fs::read_to_string(path)?;
        let mut lines = text
            .lines()
            .map(|l| l.split(',').map(str::to_owned).collect());
        Ok(Self {
            columns: lines.next().unwrap_or_default(),
            rows: lines.collect(),
        })
    }

    /// The points `(x, y)` of two columns in the rows where the given columns have the given texts.
    pub fn points(&self, filter: &[(&str, &str)], x: &str, y: &str) -> Vec<(f64, f64)> {
        let at = |name: &str| self.columns.iter().position(|c| c == name);
        let (Some(x), Some(y)) = (at(x), at(y)) else {
            return Vec::new();
        };
        self.rows
            .iter()
            .filter(|row| {
                filter
                    .iter()
                    .all(|(column, text)| at(column).is_some_and(|c| row[c] == *text))
            })
            .filter_map(|row| Some((row[x].parse().ok()?, row[y].parse().ok()?)))
            .collect()
    }

    /// The different texts of a column, in the order in which they come.
    pub fn values(&self, column: &str) -> Vec<String> {
        let Some(c) = self.columns.iter().position(|name| name == column) else {
            return Vec::new();
        };
        let mut values: Vec<String> = Vec::new();
        for row in &self.rows {
            if !values.contains(&row[c]) {
                values.push(row[c].clone());
            }
        }
        values
    }
}

/// The median; NaN of nothing.
pub fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    match values.len() {
        0 => f64::NAN,
        n if n % 2 == 1 => values[n / 2],
        n => 0.5 * (values[n / 2 - 1] + values[n / 2]),
    }
}

/// A number with four digits.
pub fn digits(x: f64) -> String {
    format!("{x:.3e}")
}
