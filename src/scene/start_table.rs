//! The text of a start file as numbers: one row a particle, with the line that it stands on.

use crate::domain::{Domain, Vec2};
use crate::text::shown;

/// What a start file says, before it is known whether that is a packing.
#[derive(Debug)]
pub(super) struct Table {
    pub(super) domain: Domain,
    /// The line of the box.
    pub(super) box_line: u64,
    /// What the third column holds.
    pub(super) size: Size,
    /// Undeformed radii (length), positive and finite.
    pub(super) radii: Vec<f64>,
    /// Centres as they were written, finite and not wrapped.
    pub(super) positions: Vec<Vec2>,
    /// The line of each particle, counted from 1.
    pub(super) lines: Vec<u64>,
}

/// A line (0 for the file as a whole) and what is wrong with it.
pub(super) type Complaint = (u64, String);

/// What the third column of a start file holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Size {
    Radius,
    Diameter,
}

impl Size {
    /// Of a header with these columns.
    fn of<'a>(columns: impl Iterator<Item = &'a str>) -> Option<Self> {
        match columns.collect::<Vec<_>>().as_slice() {
            ["x", "y", "radius"] => Some(Self::Radius),
            ["x", "y", "diameter" | "d"] => Some(Self::Diameter),
            _ => None,
        }
    }

    fn name(self) -> &'static str {
        match self {
            Self::Radius => "radius",
            Self::Diameter => "diameter",
        }
    }
}

/// Rounding may move a centre by this much (radii of its particle) and no more.
pub(super) const RESOLVED: f64 = 1e-6;

/// The numbers that are written in `text`.
pub(super) fn parse(text: &str) -> Result<Table, Complaint> {
    let (box_line, domain) = find_box(text)?;
    let mut reader = csv::ReaderBuilder::new()
        .comment(Some(b'#'))
        .trim(csv::Trim::All)
        .has_headers(false)
        .from_reader(text.as_bytes());
    let mut places = Places {
        text,
        byte: 0,
        line: 1,
    };
    let mut begun = false;
    let mut table = Table {
        domain,
        box_line,
        size: Size::Radius,
        radii: Vec::new(),
        positions: Vec::new(),
        lines: Vec::new(),
    };
    for record in reader.records() {
        let position = match &record {
            Ok(record) => record.position(),
            Err(error) => error.position(),
        };
        let before = places.byte;
        let (line, row) = places.row(position);
        if !begun {
            let first = record.as_ref().ok();
            let named = first.and_then(|record| Size::of(record.iter()));
            let comments = &text[before..places.byte];
            table.size = header(comments, named, (line, row))?;
            begun = true;
            if named.is_some() {
                continue;
            }
        }
        let number = |k: usize| record.as_ref().ok()?.get(k)?.parse::<f64>().ok();
        let three = record.as_ref().is_ok_and(|record| record.len() == 3);
        let (true, Some(x), Some(y), Some(width)) = (three, number(0), number(1), number(2)) else {
            let numbers = format!("three numbers x,y,{}", table.size.name());
            let problem = match row {
                "" => format!("there are not {numbers}"),
                row => format!("{} is not {numbers}", quote(row)),
            };
            return Err((line, problem));
        };
        let particle = table.radii.len();
        let radius = check(particle, Vec2::new(x, y), (table.size, width));
        table.radii.push(radius.map_err(|problem| (line, problem))?);
        table.positions.push(Vec2::new(x, y));
        table.lines.push(line);
    }
    if !begun {
        let problem = "there is no header `x,y,radius` with a particle below it";
        return Err((0, problem.into()));
    }
    Ok(table)
}

/// The radius of a particle, if it and the centre are such as a particle can have.
fn check(particle: usize, at: Vec2, (size, width): (Size, f64)) -> Result<f64, String> {
    if !(width.is_finite() && width > 0.0) {
        return Err(format!(
            "{} {width} of particle {particle} is not a positive, finite length",
            size.name()
        ));
    }
    if !(at.x.is_finite() && at.y.is_finite()) {
        return Err(format!(
            "position ({}, {}) of particle {particle} is not finite",
            at.x, at.y
        ));
    }
    let radius = match size {
        Size::Radius => width,
        Size::Diameter => 0.5 * width,
    };
    for (name, x) in [("x", at.x), ("y", at.y)] {
        if blurred(x) > RESOLVED * radius {
            return Err(format!(
                "{name} = {x:e} of particle {particle} has no digits left for a place in the box: numbers of that size are {:.1e} \
                 apart, and its radius is {radius}; write where it is in the box, or lengths in another unit",
                blurred(x)
            ));
        }
    }
    Ok(radius)
}

/// How far apart numbers of the size of `x` are, or a little less.
pub(super) fn blurred(x: f64) -> f64 {
    f64::EPSILON * x.abs()
}

/// What the third column holds, from the first row if that names the columns, and from the comments before it. `first` is the row and
/// its line.
fn header(comments: &str, named: Option<Size>, first: (u64, &str)) -> Result<Size, Complaint> {
    let mut found = named.map(|size| (first.0, size, first.1));
    let begin = first.0 - comments.matches('\n').count() as u64;
    for (line, comment) in (begin..)
        .zip(comments.lines())
        .collect::<Vec<_>>()
        .into_iter()
        .rev()
    {
        let columns = comment.strip_prefix('#').unwrap_or_default();
        let columns = columns.trim_start_matches('#').split(',');
        let Some(size) = Size::of(columns.map(str::trim)) else {
            continue;
        };
        match found {
            Some((behind, other, header)) if other != size => {
                let problem = format!(
                    "{} here and {} on line {behind} name different columns; leave one of the two",
                    quote(comment),
                    quote(header)
                );
                return Err((line, problem));
            }
            Some(_) => {}
            None => found = Some((line, size, comment)),
        }
    }
    match found {
        Some((_, size, _)) => Ok(size),
        None => Err((
            first.0,
            format!(
                "{} is not the header `x,y,radius` (or `x,y,diameter`)",
                quote(first.1)
            ),
        )),
    }
}

/// Rows of a text, in order.
struct Places<'a> {
    text: &'a str,
    /// Where the last row begins, and its line.
    byte: usize,
    line: u64,
}

impl<'a> Places<'a> {
    /// The first line of the row that the reader began to look for at `position`, without the blanks around it, and the
    /// number of that line: as the reader does, it passes over line ends and comments.
    fn row(&mut self, position: Option<&csv::Position>) -> (u64, &'a str) {
        let begin = position.map_or(self.byte, |p| p.byte() as usize);
        let mut rest = self.text.get(begin..).unwrap_or_default();
        loop {
            rest = rest.trim_start_matches(['\r', '\n']);
            if !rest.starts_with('#') {
                break;
            }
            rest = rest.split_once('\n').map_or("", |(_, after)| after);
        }
        let begin = self.text.len() - rest.len();
        let before = self.text.get(self.byte..begin).unwrap_or_default();
        self.line += before.matches('\n').count() as u64;
        self.byte = begin;
        let end = rest.find(['\r', '\n']).unwrap_or(rest.len());
        (self.line, rest[..end].trim())
    }
}

/// The beginning of a line.
fn quote(line: &str) -> String {
    format!("`{}`", shown(line))
}

/// The sides of the box from the comment `# box = L_x, L_y`, with its line.
fn find_box(text: &str) -> Result<(u64, Domain), Complaint> {
    let mut found: Option<(u64, &str, Domain)> = None;
    for (number, line) in (1..).zip(text.lines().map(str::trim)) {
        let named = line
            .strip_prefix('#')
            .and_then(|comment| comment.split_once('='));
        let Some((_, value)) = named.filter(|(name, _)| name.trim() == "box") else {
            continue;
        };
        if let Some((first, other, _)) = found {
            let (other, line) = (quote(other), quote(line));
            let problem = format!(
                "two boxes, {other} on line {first} and {line} on line {number}: a packing has one"
            );
            return Err((number, problem));
        }
        let sides: Result<Vec<f64>, _> = value.split(',').map(|s| s.trim().parse()).collect();
        let domain = match sides.as_deref() {
            Ok([x, y]) => Domain::new(*x, *y),
            _ => None,
        };
        let problem = || format!("{} does not give two positive sides", quote(line));
        found = Some((number, line, domain.ok_or_else(|| (number, problem()))?));
    }
    let (number, _, domain) = found.ok_or_else(|| {
        let problem = "no comment `# box = L_x, L_y` gives the periodic box";
        (0, problem.to_owned())
    })?;
    Ok((number, domain))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn complaint(rows: &str) -> (u64, String) {
        parse(&format!("# box = 6, 6\nx,y,radius\n{rows}")).unwrap_err()
    }

    #[test]
    fn line_is_that_of_the_row_that_the_reader_refuses() {
        for (rows, line, shown) in [
            ("1,1,0.5\n2,one,0.5\n", 4, "`2,one,0.5` is not"),
            // A lone return ends a row, but no line.
            ("1,1,0.5\r2,one,0.5\r", 3, "`2,one,0.5` is not"),
            (
                "1,1,0.5\r\n\r\n# two\r\n2,one,0.5\r\n",
                6,
                "`2,one,0.5` is not",
            ),
            ("\"1\n\",1,0.5\n2,one,0.5\n", 5, "`2,one,0.5` is not"),
            ("\"1\n\",1,0.5\n2,1,-0.5\n", 5, "radius -0.5 of particle 1"),
            (
                "1,1,0.5\n# two\n\n2,nan,0.5\n",
                6,
                "position (2, NaN) of particle 1",
            ),
            ("1,1,0.5\n   \n", 4, "there are not three numbers"),
            // Only what begins its line is a comment.
            ("1,1,0.5\n # two\n", 4, "`# two` is not"),
            ("1,1,0.5\n# two\n2,é", 5, "`2,é` is not"),
        ] {
            let (at, problem) = complaint(rows);
            assert!(
                at == line && problem.starts_with(shown),
                "{rows:?}: {at}: {problem}"
            );
        }
        for (text, line, shown) in [
            (
                "\n# box = 6, 6\n\n\nx,y\n1,1\n",
                5,
                "`x,y` is not the header",
            ),
            ("# box = 6, 6\n\n", 0, "there is no header"),
        ] {
            let (at, problem) = parse(text).unwrap_err();
            assert!(
                at == line && problem.starts_with(shown),
                "{text:?}: {at}: {problem}"
            );
        }
    }

    #[test]
    fn particles_know_their_lines() {
        let text = "# box = 6, 6\n\n# x,y,radius\r\n1,1,0.5\r\n# two\n\n2,1,0.5\n3,1,0.5";
        assert_eq!(parse(text).unwrap().lines, [4, 7, 8]);
        let text = "# box = 6, 6\nx,y,radius\n\n1,1,0.5\n2,1,0.5\n# end\n";
        assert_eq!(parse(text).unwrap().lines, [4, 5]);
    }

    proptest! {
        #[test]
        fn whatever_a_file_says_is_a_table_or_a_complaint(
            pieces in prop::collection::vec(
                prop::sample::select(vec![
                    "# box = 6, 6", "#", "x,y,radius", "x,y,d", "1,2,0.5", "\n", "\r", "\r\n", "\"", ",", " ", "é", "1e17",
                    "nan", "\u{feff}", "-", "\0",
                ]),
                0..30,
            ),
        ) {
            let text = pieces.concat();
            match parse(&text) {
                Ok(table) => {
                    let lines = text.matches('\n').count() as u64 + 1;
                    prop_assert!(table.lines.iter().all(|line| (1..=lines).contains(line)));
                    prop_assert!(table.lines.is_sorted());
                    prop_assert_eq!(table.lines.len(), table.radii.len());
                }
                Err((_, problem)) => prop_assert!(!problem.is_empty()),
            }
        }
    }

    #[test]
    fn quotes_are_short_and_without_control_characters() {
        let long = "7".repeat(5_000_000);
        let escape = "\u{1b}]0;title\u{7}\u{202e}";
        for text in [long.as_str(), escape, &"é\u{1b}".repeat(1000)] {
            for file in [
                format!("# box = 6, 6\n{text}\n1,1,0.5\n"),
                format!("# box = 6, 6\nx,y,radius\n{text}\n"),
                format!("# box = 6, 6\nx,y,radius\n1,1,{text}x\n"),
                format!("# box = {text}, wide\nx,y,radius\n1,1,0.5\n"),
                format!("# box = 6, 6\n# box = {text}\nx,y,radius\n1,1,0.5\n"),
            ] {
                let (line, problem) = parse(&file).unwrap_err();
                assert!((1..=3).contains(&line), "{line}: {problem}");
                assert!(problem.len() < 600 && problem.contains('`'), "{problem}");
                let plain = |c: char| c == '…' || c == 'é' || c == ' ' || c.is_ascii_graphic();
                assert!(problem.chars().all(plain), "{problem:?}");
            }
        }
    }
}
