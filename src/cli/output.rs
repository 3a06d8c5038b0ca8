//! Files that a verb writes: whether they can be, before minutes are spent on what to write.

use super::lines::Lines;
use super::warn;
use indicatif::HumanBytes;
use softjam::record::{self, Format, NewFile, RecordError, Written};
use softjam::text::counted;
use std::io;
use std::path::{Path, PathBuf};

/// A recording to write.
pub struct Output {
    pub path: PathBuf,
    pub format: Format,
    /// Whether it may replace another file.
    force: bool,
}

impl Output {
    /// A recording whose name says its format; it has to be none of `inputs`, and may replace another only with `force`.
    pub fn named(path: &Path, inputs: &[Option<&Path>], force: bool) -> Result<Self, RecordError> {
        Self::of(path, Format::named(path), inputs, force)
    }

    /// [`named`](Self::named) of an MCAP file.
    pub fn mcap(path: &Path, inputs: &[Option<&Path>], force: bool) -> Result<Self, RecordError> {
        let format = Format::Mcap.suits(path).then_some(Format::Mcap);
        let format = format.ok_or_else(|| RecordError::NotMcap {
            path: path.display().to_string(),
        });
        Self::of(path, format, inputs, force)
    }

    fn of(
        path: &Path,
        format: Result<Format, RecordError>,
        inputs: &[Option<&Path>],
        force: bool,
    ) -> Result<Self, RecordError> {
        check_place(path, inputs)?;
        let format = format?;
        check_absent(path, force)?;
        Ok(Self {
            path: path.to_owned(),
            format,
            force,
        })
    }

    /// Begins the file: nobody else can write it from now on.
    pub fn begin(&self) -> Result<NewFile, RecordError> {
        NewFile::create(&self.path, self.force)
    }

    /// Says what was written, and how to look at it.
    pub fn tell(&self, written: &Written, lines: &mut Lines) {
        let (path, size) = (self.path.display(), HumanBytes(written.bytes));
        let states = counted(written.states, "state");
        lines.line("file", format!("{path} ({size}, {states})"));
        let rerun = format!("rerun {path}");
        lines.line(
            "open it with",
            match self.format {
                Format::Rrd => rerun,
                Format::Mcap => format!("Foxglove with examples/foxglove-layout.json, or {rerun}"),
            },
        );
    }
}

/// Refuses a file that cannot be created, or that is one of `inputs`.
pub fn check_place(path: &Path, inputs: &[Option<&Path>]) -> Result<(), RecordError> {
    let create = |kind, reason: String| RecordError::Create {
        path: path.display().to_string(),
        source: io::Error::new(kind, reason),
    };
    if path.is_dir() {
        return Err(create(
            io::ErrorKind::IsADirectory,
            "it is a folder; name a file in it".to_owned(),
        ));
    }
    let folder = path.parent().filter(|p| !p.as_os_str().is_empty());
    if let Some(folder) = folder.filter(|folder| !folder.is_dir()) {
        let problem = format!("there is no folder {}", folder.display());
        return Err(create(io::ErrorKind::NotFound, problem));
    }
    let part = record::part_of(path);
    for input in inputs.iter().flatten() {
        // What a killed process has left would be overwritten while it is read.
        for output in [path, part.as_path()] {
            if record::same_file(input, output) {
                let path = output.display().to_string();
                return Err(RecordError::Input { path });
            }
        }
    }
    Ok(())
}

/// Refuses a file that exists without `force`.
pub fn check_absent(path: &Path, force: bool) -> Result<(), RecordError> {
    if force || !path.exists() {
        return Ok(());
    }
    Err(RecordError::Exists {
        path: path.display().to_string(),
    })
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
