//! The file formats of recordings, and the names that ask for them.

use super::RecordError;
use std::path::Path;

/// A file format of recordings.
///
/// ```
/// use softjam::record::Format;
/// assert_eq!(Format::of("run.mcap"), Format::Mcap);
/// assert_eq!(Format::of("run.rrd"), Format::Rrd);
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// For the rerun viewer.
    Rrd,
    /// For Foxglove and whatever else reads MCAP.
    Mcap,
}

impl Format {
    /// The format that a file to be read is taken for by its name: MCAP if it ends in `.mcap`, else rerun's.
    #[must_use]
    pub fn of(path: impl AsRef<Path>) -> Self {
        Self::named(path).unwrap_or(Self::Rrd)
    }

    /// The format that the name of a file to be written asks for: `.rrd` or `.mcap`, in either case of letters. What is there and no
    /// regular file (a device, a pipe) takes any; without `.mcap` it gets rerun's.
    ///
    /// # Errors
    ///
    /// [`RecordError::Name`] for any other name, and for one without an ending: neither the viewers nor a reader would know what is in
    /// the file.
    pub fn named(path: impl AsRef<Path>) -> Result<Self, RecordError> {
        let path = path.as_ref();
        let ends_in = |name: &str| {
            path.extension()
                .is_some_and(|x| x.eq_ignore_ascii_case(name))
        };
        match (ends_in("mcap"), ends_in("rrd")) {
            (true, _) => Ok(Self::Mcap),
            (_, true) => Ok(Self::Rrd),
            _ if is_special(path) => Ok(Self::Rrd),
            _ => Err(RecordError::Name {
                path: path.display().to_string(),
            }),
        }
    }

    /// Whether a file of this name may be written in this format: because the name says so, or since it is no regular file.
    #[must_use]
    pub fn suits(self, path: impl AsRef<Path>) -> bool {
        let path = path.as_ref();
        is_special(path) || matches!(Self::named(path), Ok(named) if named == self)
    }
}

/// Whether something is at a path that is neither a file nor a folder.
fn is_special(path: &Path) -> bool {
    std::fs::metadata(path).is_ok_and(|found| !found.is_file() && !found.is_dir())
}
