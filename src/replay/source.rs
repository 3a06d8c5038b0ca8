//! What a recording gives before it is checked, whatever its format.

use super::ReadError;
use crate::budget::Exceeded;
use crate::domain::Domain;
use crate::record::{FORMAT_VERSION, Leg, Outcome};
use crate::scene::{Scene, SceneFields};
use crate::state::Frame;
use crate::state::coverage;
use crate::text::counted;
use crate::text::shown;
use std::cell::Cell;
use std::panic::AssertUnwindSafe;

/// A file that is being read: its header has been, the rest comes in pieces.
pub(super) trait Source: Send {
    /// Reads on and appends what was found; `false` at the end.
    fn read_on(&mut self, items: &mut Vec<Item>) -> Result<bool, Problem>;

    /// How the file ended; `None` before its end.
    fn ending(&self) -> Option<Ending>;

    /// Whether the file is laid out as softjam does it, as far as its format says so.
    fn is_of_softjam(&self) -> bool;
}

/// Something that was found.
pub(super) enum Item {
    /// A state with the digest that was recorded with it.
    State(Frame, Vec<u8>),
    /// A scalar.
    Metric {
        name: &'static str,
        step: u64,
        nanoseconds: i64,
        value: f64,
    },
    /// Contours or contacts of a step.
    Drawn { channel: &'static str, step: u64 },
    /// How the run ended.
    Result(Outcome, [u8; 32]),
}

/// Why reading cannot go on.
pub(super) enum Problem {
    /// The file is damaged.
    Damage(String),
    /// It claims to need more memory than there may be.
    Budget(String),
    /// Another recording follows in the same file.
    Several,
    /// Another part of the same run follows in the same file.
    Parts,
    /// It is told already.
    Other(ReadError),
}

impl Problem {
    /// As an error in front of the first frame; damage is what `damaged` makes of it.
    pub fn at_start(self, path: &str, damaged: impl FnOnce(String) -> ReadError) -> ReadError {
        let path = path.to_owned();
        match self {
            Self::Damage(problem) => damaged(problem),
            Self::Budget(problem) => ReadError::Budget { path, problem },
            Self::Several => ReadError::Several { path, intact: None },
            Self::Parts => ReadError::Parts { path, intact: None },
            Self::Other(error) => error,
        }
    }
}

impl From<Exceeded> for Problem {
    fn from(exceeded: Exceeded) -> Self {
        Self::Budget(exceeded.to_string())
    }
}

impl From<String> for Problem {
    fn from(problem: String) -> Self {
        Self::Damage(problem)
    }
}

/// How a file ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Ending {
    /// As its writer meant it.
    Closed,
    /// It breaks off.
    BreaksOff,
}

/// What a file says of itself before its first frame.
#[derive(Clone)]
pub(super) struct Header {
    pub scene: Scene,
    pub radii: Vec<f64>,
    pub domain: Domain,
    /// The version of the layout.
    pub format: u32,
    pub program: String,
    /// The revision of the bits; the first did not say so.
    pub bits: u32,
    /// The step that the recording begins with; not 0 if its run went on from another recording.
    pub from_step: u64,
    /// How its run came to that step, where not as a run of its scene would.
    pub legs: Vec<Leg>,
}

impl Header {
    /// Whether radii and box can be those of the scene, before anything is built of what the scene claims.
    pub fn check(&self, path: &str) -> Result<(), ReadError> {
        let (claimed, held) = (self.scene.particles, self.radii.len());
        let phi = coverage(&self.radii, self.domain);
        let problem = if !self.scene.starts_from_file() && claimed != held {
            let claimed = counted(claimed, "particle");
            format!("the scene has {claimed}, the file holds radii of {held}")
        } else if phi > 0.0 && phi < 1.3 + 1e-9 {
            return Ok(());
        } else {
            format!("the coverage of its radii is φ = {phi:e}, that of a scene is 0 < φ < 1.3")
        };
        let path = path.to_owned();
        Err(ReadError::Particles { path, problem })
    }
}

/// What is said of bytes behind the end of a recording.
pub(super) fn more_behind(bytes: u64) -> String {
    let follow = if bytes == 1 { "follows" } else { "follow" };
    let bytes = counted(bytes, "byte");
    format!("{bytes} {follow} the end of the recording: several files in one?")
}

/// Refuses a layout that was made after this program.
pub(super) fn check_version(path: &str, found: u32) -> Result<(), ReadError> {
    if found > FORMAT_VERSION {
        return Err(ReadError::Newer {
            path: path.to_owned(),
            found,
            known: FORMAT_VERSION,
        });
    }
    Ok(())
}

/// The scene in a file, and the BLAKE3 of its text as it stands there: a version that prints scenes otherwise reads on.
///
/// A recording that does not say when pictures are drawn anew has every one of them.
pub(super) fn read_scene(path: &str, toml: &str) -> Result<(Scene, [u8; 32]), ReadError> {
    let scene = SceneFields::from_recording(toml).and_then(SceneFields::into_scene);
    let mut scene = scene.map_err(|source| ReadError::Scene {
        path: path.to_owned(),
        source,
    })?;
    let table = toml.parse::<toml::Table>().unwrap_or_default();
    let channels = table.get("channels");
    if channels.and_then(|named| named.get("redraw")).is_none() {
        scene.channels.redraw = 0.0;
    }
    Ok((scene, *blake3::hash(toml.as_bytes()).as_bytes()))
}

/// Radii and box, or what is missing of them.
pub(super) fn particles(
    radii: Vec<f64>,
    sides: Option<Vec<f64>>,
) -> Result<(Vec<f64>, Domain), &'static str> {
    if radii.is_empty() || radii.iter().any(|r| !(r.is_finite() && *r > 0.0)) {
        return Err("radii that are positive and finite");
    }
    let domain = match *sides.ok_or("box")? {
        [x, y] => Domain::new(x, y),
        _ => None,
    };
    Ok((radii, domain.ok_or("box of two positive sides")?))
}

thread_local! {
    static GUARDED: Cell<bool> = const { Cell::new(false) };
}

/// Runs the decoding of somebody else's bytes. Decoders panic at some that are damaged; here that is an error like others.
pub(crate) fn guarded<T>(decode: impl FnOnce() -> Result<T, String>) -> Result<T, String> {
    let before = GUARDED.replace(true);
    let result = std::panic::catch_unwind(AssertUnwindSafe(decode));
    GUARDED.set(before);
    result.unwrap_or_else(|panic| {
        let text = panic.downcast_ref::<String>().map(String::as_str);
        let text = text.or_else(|| panic.downcast_ref::<&str>().copied());
        Err(shown(text.unwrap_or("it cannot be decoded")))
    })
}

/// Whether a panic on this thread would only mean that a file is damaged, and is turned into a
/// [`ReadError`](super::ReadError): what a program's panic hook may want to know, to keep quiet.
///
/// ```
/// assert!(!softjam::replay::reading_damaged_bytes());
/// ```
#[must_use]
pub fn reading_damaged_bytes() -> bool {
    GUARDED.get()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn recordings_that_do_not_say_when_pictures_are_drawn_have_all_of_them() {
        let text = Scene::default().to_toml();
        let redraw = |text: &str| read_scene("test", text).unwrap().0.channels.redraw;
        assert_eq!(redraw(&text), Scene::default().channels.redraw);
        let lines = text.lines().filter(|line| !line.starts_with("redraw"));
        let before: Vec<&str> = lines.collect();
        assert_eq!(before.len() + 1, text.lines().count());
        assert_eq!(redraw(&before.join("\n")), 0.0);
        assert_eq!(redraw("particles = 64"), 0.0);
    }
}
