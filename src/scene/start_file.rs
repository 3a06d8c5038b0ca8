//! A packing from a CSV file.

use super::start::is_small;
use super::{SceneError, Start};
use crate::crowding;
use crate::domain::{Domain, Vec2};
use crate::packing::{Packing, PackingError};
use crate::text::shown;
use std::io::Read as _;
use std::path::Path;

/// The packing that a scene starts from, if it starts from a file.
///
/// # Errors
///
/// As [`read_csv`], and [`SceneError::StartFile`] if the box is too small to be periodic or particles lie on each other.
pub(super) fn of_scene(path: &Path, blake3: Option<&str>) -> Result<Packing, SceneError> {
    packing_of(path, &read_file(path)?, blake3)
}

/// A start from a file, and its packing. The file is pinned by its BLAKE3, so any name will do: what of it is no text (UTF-8) is
/// replaced in the scene's.
///
/// # Errors
///
/// As [`read_csv`], and [`SceneError::StartFile`] if the box is too small to be periodic.
///
/// ```
/// use softjam::scene::{Start, start};
///
/// let path = std::env::temp_dir().join("softjam-start-from-file-example.csv");
/// std::fs::write(&path, "# box = 6, 6\nx,y,radius\n1,1,0.5\n2,1,0.7\n").unwrap();
/// let (start, packing) = start::from_file(&path).unwrap();
/// assert!(matches!(start, Start::File { blake3: Some(_), .. }));
/// assert_eq!(packing.len(), 2);
/// # std::fs::remove_file(&path).unwrap();
/// ```
pub fn from_file(path: impl AsRef<Path>) -> Result<(Start, Packing), SceneError> {
    let path = path.as_ref();
    let bytes = read_file(path)?;
    let packing = packing_of(path, &bytes, None)?;
    let start = Start::File {
        path: path.to_string_lossy().into_owned(),
        blake3: Some(blake3::hash(&bytes).to_hex().to_string()),
    };
    Ok((start, packing))
}

/// The packing in a file of these bytes, if it can be started from.
fn packing_of(path: &Path, bytes: &[u8], blake3: Option<&str>) -> Result<Packing, SceneError> {
    let packing = checked(path, bytes, blake3)?;
    if is_small(&packing) {
        let l = packing.domain().lengths();
        let problem = format!(
            "its box of {:.4} × {:.4} has a shorter side of less than 5 times the largest radius {}: nearest images would be \
             ambiguous; give a larger box with more particles",
            l.x,
            l.y,
            packing.largest_radius()
        );
        return Err(SceneError::StartFile {
            path: path.display().to_string(),
            line: 0,
            problem,
        });
    }
    if let Err(crowd) = crowding::pairs(&packing) {
        let problem = format!(
            "{} particles overlap particle {}, where a packing has room for some dozens: nothing says in which direction they part; \
             give each a place of its own",
            crowd.others, crowd.particle
        );
        let path = path.display().to_string();
        return Err(SceneError::StartFile {
            path,
            line: 0,
            problem,
        });
    }
    Ok(packing)
}

/// A packing from a CSV file.
///
/// The header is `x,y,radius`, one line a particle follows; a comment line `# box = L_x, L_y` gives the sides of the
/// periodic box. Lengths in one unit of your choice (the default mixture uses the small diameter). With `blake3`, the
/// file must have that BLAKE3 in hexadecimal.
///
/// ```text
/// # box = 12.5, 12.5
/// x,y,radius
/// 0.31,7.25,0.5
/// 1.40,7.01,0.7
/// ```
///
/// # Errors
///
/// [`SceneError::Read`] if the file cannot be read, [`SceneError::StartFile`] names the line that is wrong.
///
/// # Example
///
/// ```
/// use softjam::scene::start::read_csv;
///
/// let path = std::env::temp_dir().join("softjam-read-csv-example.csv");
/// std::fs::write(&path, "# box = 6, 6\nx,y,radius\n1,1,0.5\n2,1,0.7\n").unwrap();
/// let packing = read_csv(&path, None).unwrap();
/// assert_eq!(packing.radii(), [0.5, 0.7]);
/// # std::fs::remove_file(&path).unwrap();
/// ```
pub fn read_csv(path: impl AsRef<Path>, blake3: Option<&str>) -> Result<Packing, SceneError> {
    let path = path.as_ref();
    checked(path, &read_file(path)?, blake3)
}

/// The packing in a file of these bytes, which must have the BLAKE3 that is asked for.
fn checked(path: &Path, bytes: &[u8], blake3: Option<&str>) -> Result<Packing, SceneError> {
    let wrong = |line: u64, problem: String| SceneError::StartFile {
        path: path.display().to_string(),
        line,
        problem,
    };
    if bytes.len() as u64 > LARGEST_FILE {
        return Err(wrong(0, format!("it is longer than {LARGEST_FILE} bytes")));
    }
    let found = blake3::hash(bytes).to_hex();
    if let Some(asked) = blake3
        && !asked.eq_ignore_ascii_case(&found)
    {
        return Err(wrong(
            0,
            format!(
                "its BLAKE3 is {found}, the scene asks for {}: this is not the file that the scene was made with",
                shown(asked)
            ),
        ));
    }
    let text = str::from_utf8(bytes).map_err(|e| wrong(0, format!("not UTF-8 text: {e}")))?;
    let text = text.strip_prefix('\u{feff}').unwrap_or(text);
    parse(text).map_err(|(line, problem)| wrong(line, problem))
}

/// The packing that is written in `text`, or the line that is wrong (0 for the whole) and what is wrong with it.
fn parse(text: &str) -> Result<Packing, (u64, String)> {
    let domain = csv_box(text)?;
    let mut reader = reader(text);
    let header = reader.headers().map_err(|e| (0, e.to_string()))?;
    if header != ["x", "y", "radius"].as_slice() {
        return Err(match row(text, header.position()) {
            (_, "") => (0, "there is no header `x,y,radius`".into()),
            (line, row) => (
                line,
                format!("{} is not the header `x,y,radius`", quote(row)),
            ),
        });
    }
    let (mut positions, mut radii) = (Vec::new(), Vec::new());
    for record in reader.deserialize::<(f64, f64, f64)>() {
        let (x, y, radius) = record.map_err(|error| match row(text, error.position()) {
            (line, "") => (line, "there are not three numbers x,y,radius".into()),
            (line, row) => (
                line,
                format!("{} is not three numbers x,y,radius", quote(row)),
            ),
        })?;
        positions.push(Vec2::new(x, y));
        radii.push(radius);
    }
    let packing = Packing::new(domain, radii, positions).map_err(|error| {
        let line = match error {
            PackingError::Radius { particle, .. } | PackingError::Position { particle, .. } => {
                line_of(text, particle)
            }
            _ => 0,
        };
        (line, error.to_string())
    })?;
    let phi = packing.coverage();
    if !(phi > 0.0 && phi < 1.3) {
        let problem = "is outside 0 < phi < 1.3 (coverage of the undeformed disks)";
        return Err((0, format!("its phi = {phi} {problem}")));
    }
    Ok(packing)
}

fn reader(text: &str) -> csv::Reader<&[u8]> {
    csv::ReaderBuilder::new()
        .comment(Some(b'#'))
        .trim(csv::Trim::All)
        .from_reader(text.as_bytes())
}

/// A start file of the largest packing is about half as long.
const LARGEST_FILE: u64 = 1 << 30;

/// Bytes that are looked at before the rest is read.
const BEGINNING: u64 = 1 << 12;

/// The bytes of a start file, one more than [`LARGEST_FILE`] at most.
pub(super) fn read_file(path: &Path) -> Result<Vec<u8>, SceneError> {
    let name = || path.display().to_string();
    let unreadable = |source| SceneError::Read {
        path: name(),
        source,
    };
    let mut bytes = Vec::new();
    let mut file = std::fs::File::open(path).map_err(unreadable)?;
    // A device that never ends shows itself at once.
    for most in [BEGINNING, LARGEST_FILE + 1 - BEGINNING] {
        let read = file.by_ref().take(most).read_to_end(&mut bytes);
        read.map_err(unreadable)?;
        let beginning = bytes.iter().take(BEGINNING as usize);
        if let Some(place) = beginning.copied().position(|byte| byte == 0) {
            return Err(SceneError::StartFile {
                path: name(),
                line: 0,
                problem: format!("byte {place} is 0, which no text holds"),
            });
        }
    }
    Ok(bytes)
}

/// The first line of the row that the reader began to look for at `position`, without the blanks around it, and the
/// number of that line: as the reader does, it passes over line ends and comments.
fn row<'a>(text: &'a str, position: Option<&csv::Position>) -> (u64, &'a str) {
    let begin = position.and_then(|p| text.get(p.byte() as usize..));
    let Some(mut rest) = begin else {
        return (0, "");
    };
    loop {
        rest = rest.trim_start_matches(['\r', '\n']);
        if !rest.starts_with('#') {
            break;
        }
        rest = rest.split_once('\n').map_or("", |(_, after)| after);
    }
    let before = &text[..text.len() - rest.len()];
    let line = 1 + before.matches('\n').count() as u64;
    let end = rest.find(['\r', '\n']).unwrap_or(rest.len());
    (line, rest[..end].trim())
}

/// The line on which a particle stands.
fn line_of(text: &str, particle: usize) -> u64 {
    let record = reader(text).into_records().nth(particle);
    let record = record.and_then(Result::ok);
    row(text, record.as_ref().and_then(|r| r.position())).0
}

/// The beginning of a line.
fn quote(line: &str) -> String {
    format!("`{}`", shown(line))
}

/// The sides of the box from the comment `# box = L_x, L_y`.
fn csv_box(text: &str) -> Result<Domain, (u64, String)> {
    for (number, line) in (1..).zip(text.lines()) {
        let Some(comment) = line.trim().strip_prefix('#') else {
            continue;
        };
        let Some((name, value)) = comment.split_once('=') else {
            continue;
        };
        if name.trim() != "box" {
            continue;
        }
        let sides: Result<Vec<f64>, _> = value.split(',').map(|s| s.trim().parse()).collect();
        return match sides.as_deref() {
            Ok([x, y]) => Domain::new(*x, *y),
            _ => None,
        }
        .ok_or_else(|| {
            let problem = format!("{} does not give two positive sides", quote(line.trim()));
            (number, problem)
        });
    }
    Err((
        0,
        "no comment `# box = L_x, L_y` gives the periodic box".into(),
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

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
    fn quotes_are_short_and_without_control_characters() {
        let long = "7".repeat(5_000_000);
        let escape = "\u{1b}]0;title\u{7}\u{202e}";
        for text in [long.as_str(), escape, &"é\u{1b}".repeat(1000)] {
            for file in [
                format!("# box = 6, 6\n{text}\n1,1,0.5\n"),
                format!("# box = 6, 6\nx,y,radius\n{text}\n"),
                format!("# box = 6, 6\nx,y,radius\n1,1,{text}x\n"),
                format!("# box = {text}, wide\nx,y,radius\n1,1,0.5\n"),
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
