//! A packing from a CSV file.

use super::SceneError;
use super::start::is_small;
use crate::domain::{Domain, Vec2};
use crate::packing::{Packing, PackingError};
use std::io::Read as _;

/// The packing that a scene starts from, if it starts from a file.
///
/// # Errors
///
/// As [`read_csv`], and [`SceneError::StartFile`] if the box is too small to be periodic.
pub(super) fn of_scene(path: &str, blake3: Option<&str>) -> Result<Packing, SceneError> {
    let packing = read_csv(path, blake3)?;
    if is_small(&packing) {
        let l = packing.domain().lengths();
        let problem = format!(
            "its box of {:.4} × {:.4} has a shorter side of less than 5 times the largest radius {}: nearest images would be \
             ambiguous; give a larger box with more particles",
            l.x,
            l.y,
            packing.largest_radius()
        );
        let path = path.into();
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
/// let packing = read_csv(path.to_str().unwrap(), None).unwrap();
/// assert_eq!(packing.radii(), [0.5, 0.7]);
/// # std::fs::remove_file(&path).unwrap();
/// ```
pub fn read_csv(path: &str, blake3: Option<&str>) -> Result<Packing, SceneError> {
    let bytes = read_file(path)?;
    let wrong = |line: u64, problem: String| SceneError::StartFile {
        path: path.into(),
        line,
        problem,
    };
    if bytes.len() as u64 > LARGEST_FILE {
        return Err(wrong(0, format!("it is longer than {LARGEST_FILE} bytes")));
    }
    let found = blake3::hash(&bytes).to_hex();
    if let Some(asked) = blake3
        && !asked.eq_ignore_ascii_case(&found)
    {
        return Err(wrong(
            0,
            format!(
                "its BLAKE3 is {found}, the scene asks for {asked}: this is not the file that the scene was made with"
            ),
        ));
    }
    let text = str::from_utf8(&bytes).map_err(|e| wrong(0, format!("not UTF-8 text: {e}")))?;
    let text = text.strip_prefix('\u{feff}').unwrap_or(text);
    let domain = csv_box(text).map_err(|(line, problem)| wrong(line, problem))?;
    let mut reader = csv::ReaderBuilder::new()
        .comment(Some(b'#'))
        .trim(csv::Trim::All)
        .from_reader(text.as_bytes());
    let quoted =
        |(line, row): (u64, &str), problem: &str| wrong(line, format!("`{row}` {problem}"));
    let header = reader.headers().map_err(|e| wrong(0, e.to_string()))?;
    if header != ["x", "y", "radius"].as_slice() {
        return Err(match row(text, 0) {
            (0, _) => wrong(0, "there is no header `x,y,radius`".into()),
            other => quoted(other, "is not the header `x,y,radius`"),
        });
    }
    let (mut positions, mut radii) = (Vec::new(), Vec::new());
    for record in reader.deserialize::<(f64, f64, f64)>() {
        let Ok((x, y, radius)) = record else {
            let row = row(text, radii.len() + 1);
            return Err(quoted(row, "is not three numbers x,y,radius"));
        };
        positions.push(Vec2::new(x, y));
        radii.push(radius);
    }
    let packing = Packing::new(domain, radii, positions).map_err(|error| {
        let line = match error {
            PackingError::Radius { particle, .. } | PackingError::Position { particle, .. } => {
                row(text, particle + 1).0
            }
            _ => 0,
        };
        wrong(line, error.to_string())
    })?;
    let phi = packing.coverage();
    if !(phi > 0.0 && phi < 1.3) {
        return Err(wrong(
            0,
            format!("its phi = {phi} is outside 0 < phi < 1.3 (coverage of the undeformed disks)"),
        ));
    }
    Ok(packing)
}

/// A start file of the largest packing is about half as long.
const LARGEST_FILE: u64 = 1 << 30;

/// The bytes of a start file, one more than [`LARGEST_FILE`] at most.
pub(super) fn read_file(path: &str) -> Result<Vec<u8>, SceneError> {
    let mut bytes = Vec::new();
    std::fs::File::open(path)
        .and_then(|file| file.take(LARGEST_FILE + 1).read_to_end(&mut bytes))
        .map_err(|source| SceneError::Read {
            path: path.into(),
            source,
        })?;
    Ok(bytes)
}

/// The `k`-th line that is neither blank nor a comment, with its number: 0 is the header, `k` particle `k − 1`.
fn row(text: &str, k: usize) -> (u64, &str) {
    let rows = (1..).zip(text.lines());
    let mut rows = rows.filter(|(_, line)| !line.is_empty() && !line.starts_with('#'));
    rows.nth(k).unwrap_or((0, ""))
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
            let problem = format!("`{}` does not give two positive sides", line.trim());
            (number, problem)
        });
    }
    Err((
        0,
        "no comment `# box = L_x, L_y` gives the periodic box".into(),
    ))
}
