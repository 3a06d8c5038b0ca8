//! What can be read as a recording, and what its bytes are.

use crate::budget::Budget;
use crate::record::Format;
use crate::replay::rrd;
use std::fs::File;
use std::io::BufReader;
use std::path::Path;

/// What a byte of a recording belongs to, in words; `None` if nobody can tell.
///
/// ```
/// assert_eq!(softjam::replay::place_of_byte("/nowhere/run.rrd", 100), None);
/// ```
#[must_use]
pub fn place_of_byte(path: impl AsRef<Path>, at: u64) -> Option<String> {
    let file = File::open(&path).ok()?;
    let length = file.metadata().ok()?.len();
    let source = Box::new(BufReader::new(file));
    match Format::of(&path) {
        Format::Rrd => rrd::place_of_byte(source, length, Budget::default(), at),
        // Whatever was changed in an MCAP file shows in its checksums.
        Format::Mcap => None,
    }
}

/// Refuses what has no length that could be relied on.
pub(super) fn is_regular(kind: std::fs::FileType) -> std::io::Result<()> {
    if kind.is_file() {
        return Ok(());
    }
    let what = if kind.is_dir() {
        "it is a folder; name a file in it"
    } else if is_pipe(kind) {
        "it is a pipe, and a recording is read from a file; save it first, as with `cat > run.rrd`"
    } else {
        "it is a device, and a recording is read from a file"
    };
    Err(std::io::Error::new(std::io::ErrorKind::InvalidInput, what))
}

#[cfg(unix)]
fn is_pipe(kind: std::fs::FileType) -> bool {
    use std::os::unix::fs::FileTypeExt as _;
    kind.is_fifo() || kind.is_socket()
}

#[cfg(not(unix))]
fn is_pipe(_: std::fs::FileType) -> bool {
    false
}
