//! Files that a verb writes: whether they can be, before minutes are spent on what to write.

use softjam::record::{Format, RecordError};
use std::io;
use std::path::{Path, PathBuf};

/// A file to write.
pub struct Output {
    pub path: PathBuf,
    pub format: Format,
}

impl Output {
    /// A file whose name says its format.
    pub fn named(path: &Path) -> Self {
        Self {
            path: path.to_owned(),
            format: Format::of(path),
        }
    }

    /// Refuses a file that cannot be created, that is one of `inputs`, or that exists without `force`.
    pub fn check(&self, inputs: &[Option<&Path>], force: bool) -> Result<(), RecordError> {
        let path = self.path.display().to_string();
        let create = |kind, reason: String| RecordError::Create {
            path: path.clone(),
            source: io::Error::new(kind, reason),
        };
        if self.path.is_dir() {
            return Err(create(
                io::ErrorKind::IsADirectory,
                "it is a folder; name a file in it".to_owned(),
            ));
        }
        let folder = self.path.parent().filter(|p| !p.as_os_str().is_empty());
        if let Some(folder) = folder.filter(|folder| !folder.is_dir()) {
            let problem = format!("there is no folder {}", folder.display());
            return Err(create(io::ErrorKind::NotFound, problem));
        }
        if !self.path.exists() {
            return Ok(());
        }
        let mut inputs = inputs.iter().flatten();
        if inputs.any(|input| same(input, &self.path)) {
            return Err(RecordError::Input { path });
        }
        if force {
            Ok(())
        } else {
            Err(RecordError::Exists { path })
        }
    }
}

/// Whether two names are of one file.
pub fn same(a: &Path, b: &Path) -> bool {
    a == b || matches!((a.canonicalize(), b.canonicalize()), (Ok(a), Ok(b)) if a == b)
}

/// How to look at a file.
pub fn open_with(path: &Path, format: Format) -> String {
    let path = path.display();
    match format {
        Format::Rrd => format!("rerun {path}"),
        Format::Mcap => format!("Foxglove with examples/foxglove-layout.json, or rerun {path}"),
    }
}
