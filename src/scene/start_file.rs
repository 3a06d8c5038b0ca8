//! A packing from a CSV file.

use super::start_table::{self, Complaint, RESOLVED, Size, Table, blurred};
use super::{Preparation, SceneError, Start};
use crate::budget::Budget;
use crate::domain::Vec2;
use crate::neighbors::crowding;
use crate::state::Packing;
use crate::text::shown;
use std::collections::BTreeMap;
use std::io::Read;
use std::path::Path;

/// A start file that was read: once, since it may be a pipe.
///
/// The header is `x,y,radius` or `x,y,diameter` (`d` for short), as a row of its own or as a comment, and one line a particle follows; a
/// comment line `# box = L_x, L_y` gives the sides of the periodic box. Lengths in one unit of your choice (the default mixture
/// uses the small diameter).
///
/// ```text
/// # box = 12.5, 12.5
/// x,y,radius
/// 0.31,7.25,0.5
/// 1.40,7.01,0.7
/// ```
///
/// # Example
///
/// ```
/// use softjam::scene::{Preparation, start::StartFile};
///
/// let path = std::env::temp_dir().join("softjam-start-file-example.csv");
/// std::fs::write(&path, "# box = 6, 6\nx,y,diameter\n1,1,1\n2,1,1.4\n").unwrap();
/// let file = StartFile::read(&path).unwrap();
/// let (packing, coincidences) = file.prepared(Preparation::AsItStands).unwrap();
/// assert_eq!(packing.radii(), [0.5, 0.7]);
/// assert!(coincidences.is_empty());
/// # std::fs::remove_file(&path).unwrap();
/// ```
#[derive(Clone, Debug)]
pub struct StartFile {
    /// As it may be shown.
    path: String,
    bytes: Vec<u8>,
}

/// A particle of a start file that stands where another does, up to a thousandth of the smallest radius.
///
/// ```
/// use softjam::scene::{Preparation, start::StartFile};
///
/// let path = std::env::temp_dir().join("softjam-coincidence-example.csv");
/// std::fs::write(&path, "# box = 6, 6\nx,y,radius\n0,1,0.5\n6,1,0.5\n").unwrap();
/// let (packing, coincidences) = StartFile::read(&path).unwrap().prepared(Preparation::Separated).unwrap();
/// assert_eq!(
///     coincidences[0].to_string(),
///     "particle 1 (line 4, at 6, 1) is the periodic copy of particle 0 (line 3, at 0, 1)"
/// );
/// assert!(packing.separation(0, 1).norm() > 0.8);
/// # std::fs::remove_file(&path).unwrap();
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Coincidence {
    /// The two particles, the one that comes first in the file first.
    pub particles: [usize; 2],
    /// Their lines, counted from 1.
    pub lines: [u64; 2],
    /// Their centres as they are written.
    pub positions: [Vec2; 2],
    /// Whether one stands on a periodic image of the other.
    pub periodic: bool,
}

impl core::fmt::Display for Coincidence {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        let stands = if self.periodic {
            "is the periodic copy of"
        } else {
            "stands on the point of"
        };
        let named = |k: usize| {
            let at = self.positions[k];
            let (particle, line) = (self.particles[k], self.lines[k]);
            format!("particle {particle} (line {line}, at {}, {})", at.x, at.y)
        };
        write!(f, "{} {stands} {}", named(1), named(0))
    }
}

impl StartFile {
    /// Reads a file; `-` is standard input.
    ///
    /// # Errors
    ///
    /// [`SceneError::Read`], or [`SceneError::StartFile`] for what is no text.
    pub fn read(path: impl AsRef<Path>) -> Result<Self, SceneError> {
        Self::read_within(path, Budget::of(u64::MAX))
    }

    /// [`read`](Self::read) of no more than a [piece](Budget::piece) of a budget.
    ///
    /// # Errors
    ///
    /// As [`read`](Self::read), and [`SceneError::StartFile`] if the file is longer.
    pub fn read_within(path: impl AsRef<Path>, budget: Budget) -> Result<Self, SceneError> {
        let path = path.as_ref();
        let mut file = Self {
            path: path.display().to_string(),
            bytes: Vec::new(),
        };
        let unreadable = |source| SceneError::Read {
            path: path.display().to_string(),
            source,
        };
        let mut stream: Box<dyn Read> = if path.as_os_str() == "-" {
            Box::new(std::io::stdin().lock())
        } else {
            let opened = std::fs::File::open(path).map_err(unreadable)?;
            let length = opened.metadata().map_or(0, |file| file.len());
            let allowed = budget.allow_piece("the text", length);
            allowed.map_err(|exceeded| file.wrong((0, exceeded.to_string())))?;
            Box::new(opened)
        };
        let most = LARGEST_FILE.min(budget.piece());
        // A device that never ends shows itself at once.
        for part in [BEGINNING, (most + 1).saturating_sub(BEGINNING)] {
            let read = stream.by_ref().take(part).read_to_end(&mut file.bytes);
            read.map_err(unreadable)?;
            let beginning = file.bytes.iter().take(BEGINNING as usize);
            if let Some(place) = beginning.copied().position(|byte| byte == 0) {
                let problem = format!("byte {place} is 0, which no text holds");
                return Err(file.wrong((file.line_of_byte(place), problem)));
            }
        }
        let length = file.bytes.len() as u64;
        let allowed = budget.allow_piece("the text", length);
        allowed.map_err(|exceeded| file.wrong((0, exceeded.to_string())))?;
        if length > LARGEST_FILE {
            return Err(file.wrong((0, format!("it is longer than {LARGEST_FILE} bytes"))));
        }
        Ok(file)
    }

    /// BLAKE3 of the file in hexadecimal.
    #[must_use]
    pub fn blake3(&self) -> String {
        blake3::hash(&self.bytes).to_hex().to_string()
    }

    /// The start of a run from this file, pinned by its BLAKE3. What of its name is no text (UTF-8) is replaced in it.
    ///
    /// # Errors
    ///
    /// [`SceneError::StartFile`] if it should have another `blake3`.
    pub fn start(
        &self,
        blake3: Option<&str>,
        preparation: Preparation,
    ) -> Result<Start, SceneError> {
        let found = self.blake3();
        if let Some(asked) = blake3
            && !asked.eq_ignore_ascii_case(&found)
        {
            let problem = format!(
                "its BLAKE3 is {found}, the scene asks for {}: this is not the file that the scene was made with",
                shown(asked)
            );
            return Err(self.wrong((0, problem)));
        }
        Ok(Start::File {
            path: self.path.clone(),
            blake3: Some(found),
            preparation,
        })
    }

    /// The packing in the file, whatever stands where.
    ///
    /// # Errors
    ///
    /// [`SceneError::StartFile`] names the line that is wrong and what stands there.
    pub fn packing(&self) -> Result<Packing, SceneError> {
        let (packing, _) = self.table().map_err(|complaint| self.wrong(complaint))?;
        Ok(packing)
    }

    /// The packing that a run can start from, its disks not yet relaxed, and which particles stand on one point.
    ///
    /// Such are refused unless they are to be separated: then those of one point are put around it as the seeds of a sunflower, in
    /// the order of the file. Particle `k` of them has the distance `√(Σ_{m<k} R_m² + R_k²/2)` from the point, so that each has the area
    /// of its disk, and the direction `k π (3 − √5)`.
    ///
    /// # Errors
    ///
    /// As [`packing`](Self::packing), and [`SceneError::StartFile`] if particles stand on one point, if more overlap one than memory
    /// is set aside for, or if one is wider than the box.
    ///
    /// See the examples of [`StartFile`] and [`Coincidence`].
    pub fn prepared(
        &self,
        preparation: Preparation,
    ) -> Result<(Packing, Vec<Coincidence>), SceneError> {
        let wrong = |complaint| self.wrong(complaint);
        let (mut packing, table) = self.table().map_err(wrong)?;
        let found = crowding::coincident(&packing);
        let coincidences: Vec<_> = found
            .iter()
            .map(|pair| coincidence(&table, &packing, *pair))
            .collect();
        if let Some(first) = coincidences.first() {
            if preparation == Preparation::AsItStands {
                let more = match coincidences.len() - 1 {
                    0 => String::new(),
                    more => format!(" (and {more} more such)"),
                };
                let problem = format!(
                    "{first}{more}, and nothing says in which direction they part: leave one of the two lines out, or have them put \
                     beside each other (--separate, or separate = true in the scene) or relaxed as disks (--relax-disks, or relax = \
                     true in [disks])"
                );
                return Err(self.wrong((first.lines[1], problem)));
            }
            separate(&mut packing, &found);
        }
        if let Err(crowd) = crowding::pairs(&packing) {
            let problem = format!(
                "{} particles overlap particle {}, where a packing has room for some dozens: nothing says in which direction they part; \
                 give each a place of its own",
                crowd.others, crowd.particle
            );
            return Err(self.wrong((table.lines[crowd.particle], problem)));
        }
        let l = packing.domain().lengths();
        let wide = |radius: &f64| 2.0 * radius > packing.domain().shortest();
        if let Some(particle) = packing.radii().iter().position(wide) {
            let problem = format!(
                "particle {particle} of radius {} is wider than the box of {:.4} × {:.4}: it overlaps its own image",
                packing.radii()[particle],
                l.x,
                l.y
            );
            return Err(self.wrong((table.lines[particle], problem)));
        }
        Ok((packing, coincidences))
    }

    /// What the file says, and the packing that it is.
    fn table(&self) -> Result<(Packing, Table), Complaint> {
        let text = str::from_utf8(&self.bytes).map_err(|error| {
            let place = error.valid_up_to();
            (
                self.line_of_byte(place),
                format!("byte {place} is not UTF-8 text"),
            )
        })?;
        let text = text.strip_prefix('\u{feff}').unwrap_or(text);
        let table = start_table::parse(text)?;
        let (radii, positions) = (table.radii.clone(), table.positions.clone());
        // Radii and positions have been looked at one by one.
        let packing = Packing::new(table.domain, radii, positions);
        let packing = packing.map_err(|error| (0, error.to_string()))?;
        check_box(&packing, table.size).map_err(|problem| (table.box_line, problem))?;
        Ok((packing, table))
    }

    /// The line on which a byte stands.
    fn line_of_byte(&self, byte: usize) -> u64 {
        let before = self.bytes.iter().take(byte);
        1 + before.filter(|byte| **byte == b'\n').count() as u64
    }

    fn wrong(&self, (line, problem): Complaint) -> SceneError {
        SceneError::StartFile {
            path: self.path.clone(),
            line,
            problem,
        }
    }
}

/// A packing from a CSV file as it stands there; see [`StartFile`]. With `blake3`, the file must have that BLAKE3 in hexadecimal.
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
    let file = StartFile::read(path)?;
    file.start(blake3, Preparation::AsItStands)?;
    file.packing()
}

/// A start file of the largest packing is about half as long.
const LARGEST_FILE: u64 = 1 << 30;

/// Bytes that are looked at before the rest is read.
const BEGINNING: u64 = 1 << 12;

/// The angle between two seeds of a sunflower that follow each other, π (3 − √5).
const GOLDEN_ANGLE: f64 = 2.399_963_229_728_653;

/// Puts the particles of one point around it; each pair is the first of them, and another.
fn separate(packing: &mut Packing, coincident: &[[usize; 2]]) {
    let mut groups: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
    for &[first, other] in coincident {
        groups
            .entry(first)
            .or_insert_with(|| vec![first])
            .push(other);
    }
    let domain = packing.domain();
    for (first, group) in groups {
        let point = packing.positions()[first];
        let mut within = 0.0;
        for (k, particle) in group.into_iter().enumerate() {
            let radius = packing.radii()[particle];
            let distance = (within + 0.5 * radius * radius).sqrt();
            within += radius * radius;
            let (sin, cos) = libm::sincos(k as f64 * GOLDEN_ANGLE);
            let seat = point + distance * Vec2::new(cos, sin);
            packing.positions_mut()[particle] = domain.wrap(seat);
        }
    }
}

fn coincidence(table: &Table, packing: &Packing, particles: [usize; 2]) -> Coincidence {
    let positions = particles.map(|k| table.positions[k]);
    let apart = positions[1] - positions[0];
    let l = packing.domain().lengths();
    Coincidence {
        particles,
        lines: particles.map(|k| table.lines[k]),
        positions,
        periodic: apart.x.abs() > 0.5 * l.x || apart.y.abs() > 0.5 * l.y,
    }
}

/// Whether a packing fits its box, and the box its particles.
fn check_box(packing: &Packing, size: Size) -> Result<(), String> {
    let (l, smallest) = (packing.domain().lengths(), packing.smallest_radius());
    let side = l.x.max(l.y);
    if blurred(side) > RESOLVED * smallest {
        return Err(format!(
            "numbers of the size of a side, {side:e}, are {:.1e} apart, which leaves no digits for particles of radius {smallest}",
            blurred(side)
        ));
    }
    let phi = packing.coverage();
    if phi > 0.0 && phi < 1.3 {
        return Ok(());
    }
    let halved = phi / 4.0;
    let hint = if size == Size::Radius && halved < 1.3 {
        format!("; if the column holds diameters, phi is {halved:.4}: call it `diameter`")
    } else {
        String::new()
    };
    Err(format!(
        "its phi = {phi} is outside 0 < phi < 1.3 (coverage of the undeformed disks in this box){hint}"
    ))
}
