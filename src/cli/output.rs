//! Files that a verb writes: whether they can be, before minutes are spent on what to write.

use super::warn;
use softjam::record::{self, Format, NewFile, RecordError};
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
        let part = record::part_of(&self.path);
        for input in inputs.iter().flatten() {
            if record::same_file(input, &self.path) {
                return Err(RecordError::Input { path });
            }
            // What a killed process has left would be overwritten while it is read.
            if record::same_file(input, &part) {
                let path = part.display().to_string();
                return Err(RecordError::Input { path });
            }
        }
        if force || !self.path.exists() {
            Ok(())
        } else {
            Err(RecordError::Exists { path })
        }
    }

    /// Begins the file: nobody else can write it from now on.
    pub fn begin(&self, force: bool) -> Result<NewFile, RecordError> {
        NewFile::create(&self.path, force)
    }
}

/// Ctrl-C and SIGTERM end the process and leave nothing of a file that is not whole.
pub fn end_when_interrupted() -> anyhow::Result<()> {
    ctrlc::set_handler(|| {
        record::abandon_new_files(|| {
            warn("interrupted; no file was made or replaced");
            std::process::exit(1);
        });
    })?;
    Ok(())
}

/// How to look at a file.
pub fn open_with(path: &Path, format: Format) -> String {
    let path = path.display();
    match format {
        Format::Rrd => format!("rerun {path}"),
        Format::Mcap => format!("Foxglove with examples/foxglove-layout.json, or rerun {path}"),
    }
}
