//! A file in the making: it stands beside its place until it is fit to take it.
//!
//! The bytes go to `NAME.part` in the folder of `NAME`, which is locked (`flock`) by the one who writes it, so that two
//! programs never write one file. Until [`NewFile::publish`] the file of that name, if there is one, is as it was; then the new one
//! takes its place in one step. The lock belongs to the open file: it stays while the file is written on under its own name.
//!
//! Nothing is left of a file that is dropped before it was published. A process that is killed (`kill -9`) leaves its
//! `NAME.part`, which the next one takes over.

use super::RecordError;
use std::fs::{self, File, OpenOptions, TryLockError};
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};

/// What is added to the name of a file in the making.
const PART: &str = ".part";

/// How often a part is looked for that nobody else takes away in between.
const ATTEMPTS: usize = 16;

/// Links that are followed from a name to its file, as many as Linux follows.
const LINKS: usize = 40;

/// The parts that this process has begun and not published.
static PARTS: Mutex<Vec<PathBuf>> = Mutex::new(Vec::new());

fn parts() -> MutexGuard<'static, Vec<PathBuf>> {
    // A panic elsewhere leaves the list as it is.
    PARTS.lock().unwrap_or_else(PoisonError::into_inner)
}

/// A file that takes its place when it is fit to: see [`publish`](Self::publish).
///
/// What is no regular file (a device, a pipe) is written to straight away, and without a lock.
///
/// ```
/// use softjam::record::NewFile;
/// use std::io::Write as _;
///
/// let path = std::env::temp_dir().join("softjam-new-file-example.txt");
/// std::fs::write(&path, "old").unwrap();
/// let mut file = NewFile::create(&path, true).unwrap();
/// file.write_all(b"new").unwrap();
/// assert_eq!(std::fs::read_to_string(&path).unwrap(), "old");
/// let another = NewFile::create(&path, true).unwrap_err();
/// assert!(another.to_string().contains("is being written"), "{another}");
/// file.publish().unwrap();
/// assert_eq!(std::fs::read_to_string(&path).unwrap(), "new");
/// # std::fs::remove_file(&path).unwrap();
/// ```
#[derive(Debug)]
pub struct NewFile {
    /// Holds the lock.
    file: File,
    /// As it was named.
    path: PathBuf,
    /// The file that the name means.
    place: PathBuf,
    /// Where the bytes go until they are published; `None` for what is no regular file.
    part: Option<PathBuf>,
    replace: bool,
}

impl NewFile {
    /// Begins a file; an existing one is replaced only if `replace` says so, and not before [`publish`](Self::publish).
    ///
    /// # Errors
    ///
    /// [`RecordError::Exists`], [`RecordError::Busy`] if somebody else is writing it, [`RecordError::Create`].
    pub fn create(path: impl AsRef<Path>, replace: bool) -> Result<Self, RecordError> {
        let path = path.as_ref();
        let old = match fs::metadata(path) {
            Ok(old) => Some(old),
            Err(error) if error.kind() == io::ErrorKind::NotFound => None,
            Err(error) => return Err(cannot_create(path, error)),
        };
        if old.is_some() && !replace {
            return Err(exists(path));
        }
        if old.is_some_and(|old| !old.is_file()) {
            let file = OpenOptions::new().write(true).open(path);
            return Ok(Self {
                file: file.map_err(|error| cannot_create(path, error))?,
                path: path.to_owned(),
                place: path.to_owned(),
                part: None,
                replace,
            });
        }
        let place = place_of(path).map_err(|error| cannot_create(path, error))?;
        let part = part_beside(&place);
        // Held until the part is in the list, so that whoever abandons what is in it finds this one too.
        let mut parts = parts();
        let file = begin(&part, path)?;
        parts.push(part.clone());
        drop(parts);
        let new = Self {
            file,
            path: path.to_owned(),
            place,
            part: Some(part),
            replace,
        };
        new.claim()?;
        Ok(new)
    }

    /// Whether the file at its place may be replaced: nobody is writing it, and nobody protects it from being written.
    fn claim(&self) -> Result<(), RecordError> {
        let old = match fs::metadata(&self.place) {
            Ok(old) if self.replace => old,
            Ok(_) => return Err(exists(&self.path)),
            Err(_) => return Ok(()),
        };
        let file = OpenOptions::new().write(true).open(&self.place);
        let file = file.map_err(|error| cannot_create(&self.path, error))?;
        // Given back at once, when the file is closed.
        if matches!(try_lock(&file), Err(TryLockError::WouldBlock)) {
            return Err(busy(&self.path, &self.place));
        }
        // Who could read the old file can read the new one; a file system may know no permissions.
        drop(self.file.set_permissions(old.permissions()));
        Ok(())
    }

    /// The name of the file, as it was given.
    ///
    /// ```
    /// let path = std::env::temp_dir().join("softjam-new-file-path-example.txt");
    /// let file = softjam::record::NewFile::create(&path, true).unwrap();
    /// assert_eq!(file.path(), path);
    /// drop(file);
    /// assert!(!path.exists(), "nothing is left of what is not published");
    /// ```
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Brings what was written to the disk and lets the file take its place, with the one that was there gone. It can be
    /// written on, and published again to no effect.
    ///
    /// # Errors
    ///
    /// Of kind [`AlreadyExists`](io::ErrorKind::AlreadyExists) if a file has come there meanwhile that is not to be replaced, or
    /// whatever the system says.
    pub fn publish(&self) -> io::Result<()> {
        let Some(part) = &self.part else {
            return Ok(());
        };
        if self.is_published() {
            return Ok(());
        }
        self.file.sync_data()?;
        let mut parts = parts();
        // It is not there if everything has been abandoned.
        if let Some(place) = parts.iter().position(|other| other == part) {
            if self.replace {
                fs::rename(part, &self.place)?;
            } else {
                put_where_nothing_is(part, &self.place)?;
            }
            parts.swap_remove(place);
        }
        Ok(())
    }

    /// Whether the file is at its place.
    pub(crate) fn is_published(&self) -> bool {
        self.part
            .as_ref()
            .is_none_or(|part| !parts().contains(part))
    }

    /// The open file, for a thread of its own.
    pub(crate) fn open_file(&self) -> io::Result<File> {
        self.file.try_clone()
    }
}

impl Write for NewFile {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.file.write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.file.flush()
    }
}

/// Nothing is left of a file that was not published.
impl Drop for NewFile {
    fn drop(&mut self) {
        let mut parts = parts();
        if let Some(place) = parts.iter().position(|p| Some(p) == self.part.as_ref()) {
            remove(&parts.swap_remove(place));
        }
    }
}

/// Removes what this process has begun and not published, and does `then` before anything else can be begun or published: what a
/// process does that ends at once.
///
/// ```no_run
/// softjam::record::abandon_new_files(|| std::process::exit(1));
/// ```
pub fn abandon_new_files(then: impl FnOnce()) {
    let mut parts = parts();
    for part in parts.drain(..) {
        remove(&part);
    }
    then();
}

/// What cannot be removed is taken over by the next who writes the file.
fn remove(part: &Path) {
    drop(fs::remove_file(part));
}

/// The name under which [`NewFile`] writes the file `path` until it is published.
///
/// ```
/// use softjam::record::part_of;
/// let path = std::env::temp_dir().join("run.rrd");
/// assert!(part_of(path).ends_with("run.rrd.part"));
/// ```
#[must_use]
pub fn part_of(path: impl AsRef<Path>) -> PathBuf {
    let path = path.as_ref();
    part_beside(&place_of(path).unwrap_or_else(|_| path.to_owned()))
}

/// Whether two names are of one file, whatever the names are; a file need not be there yet.
///
/// ```
/// use softjam::record::same_file;
/// assert!(same_file("run.rrd", "./run.rrd"));
/// assert!(!same_file("run.rrd", "run.mcap"));
/// ```
#[must_use]
pub fn same_file(a: impl AsRef<Path>, b: impl AsRef<Path>) -> bool {
    let (a, b) = (a.as_ref(), b.as_ref());
    match (identity(a), identity(b)) {
        (Some(a), Some(b)) => a == b,
        (None, None) => matches!((place_of(a), place_of(b)), (Ok(a), Ok(b)) if a == b),
        _ => false,
    }
}

/// What two names of one existing file have in common.
#[cfg(unix)]
fn identity(path: &Path) -> Option<(u64, u64)> {
    fs::metadata(path).ok().map(|file| number(&file))
}

#[cfg(not(unix))]
fn identity(path: &Path) -> Option<PathBuf> {
    path.canonicalize().ok()
}

/// Device and inode.
#[cfg(unix)]
fn number(file: &fs::Metadata) -> (u64, u64) {
    use std::os::unix::fs::MetadataExt as _;
    (file.dev(), file.ino())
}

/// The file that a name means: folder and links followed, the file itself need not be there.
fn place_of(path: &Path) -> io::Result<PathBuf> {
    let mut path = path.to_owned();
    for _ in 0..LINKS {
        let named = path.as_os_str().as_encoded_bytes();
        let name = match path.file_name() {
            Some(name) if !named.ends_with(b"/") && !named.ends_with(b"/.") => name,
            _ => {
                let problem = "it is a folder; name a file in it";
                return Err(io::Error::new(io::ErrorKind::IsADirectory, problem));
            }
        };
        let folder = path.parent().filter(|p| !p.as_os_str().is_empty());
        let folder = folder.unwrap_or(Path::new(".")).canonicalize()?;
        let place = folder.join(name);
        match fs::read_link(&place) {
            Ok(link) => path = folder.join(link),
            Err(_) => return Ok(place),
        }
    }
    Err(io::Error::other("its links lead nowhere"))
}

/// The part of a file; a name that is as long as names can be is cut.
fn part_beside(place: &Path) -> PathBuf {
    const LONGEST: usize = 255;
    let name = place.file_name().unwrap_or_default();
    let room = LONGEST - PART.len();
    let name = if name.len() > room {
        cut(name, room)
    } else {
        name.to_owned()
    };
    let mut part = name;
    part.push(PART);
    place.with_file_name(part)
}

#[cfg(unix)]
fn cut(name: &std::ffi::OsStr, bytes: usize) -> std::ffi::OsString {
    use std::os::unix::ffi::OsStrExt as _;
    std::ffi::OsStr::from_bytes(&name.as_bytes()[..bytes]).to_owned()
}

#[cfg(not(unix))]
fn cut(name: &std::ffi::OsStr, _: usize) -> std::ffi::OsString {
    name.to_owned()
}

/// A new and empty part, locked; `path` is the file that it is for.
fn begin(part: &Path, path: &Path) -> Result<File, RecordError> {
    let fails = |error| cannot_create(part, error);
    for _ in 0..ATTEMPTS {
        if fs::symlink_metadata(part).is_ok_and(|other| !other.is_file()) {
            return Err(fails(io::Error::new(
                io::ErrorKind::AlreadyExists,
                "what has this name is no file; rename it, or name another file to write",
            )));
        }
        let mut options = OpenOptions::new();
        let created = options.write(true).create_new(true).open(part);
        let (file, is_new) = match created {
            Ok(file) => (file, true),
            Err(error) if error.kind() == io::ErrorKind::AlreadyExists => {
                match OpenOptions::new().write(true).open(part) {
                    Ok(file) => (file, false),
                    // Somebody else has just published or removed it.
                    Err(error) if error.kind() == io::ErrorKind::NotFound => continue,
                    Err(error) => return Err(fails(error)),
                }
            }
            Err(error) => return Err(fails(error)),
        };
        match try_lock(&file) {
            Err(TryLockError::WouldBlock) => return Err(busy(path, part)),
            // Between opening and locking it may have been published or removed: it is no part any more.
            Ok(()) if !is_at(&file, part) => {}
            // Where a file system has no locks, what is new is nobody else's all the same.
            Ok(()) | Err(TryLockError::Error(_)) if is_new => return Ok(file),
            // What a killed process has left. It is not emptied, for it may be the published file by a second name.
            Ok(()) => fs::remove_file(part).map_err(fails)?,
            Err(TryLockError::Error(_)) => {
                return Err(fails(io::Error::new(
                    io::ErrorKind::AlreadyExists,
                    "it is there already, and this file system has no locks to tell whether it is being written; remove it \
                     if no softjam is running",
                )));
            }
        }
    }
    Err(busy(path, part))
}

/// Locks a file against other programs that do the same, until it is closed.
#[cfg(unix)]
fn try_lock(file: &File) -> Result<(), TryLockError> {
    file.try_lock()
}

/// Elsewhere a lock would keep others from reading.
#[cfg(not(unix))]
fn try_lock(_: &File) -> Result<(), TryLockError> {
    Err(TryLockError::Error(io::ErrorKind::Unsupported.into()))
}

/// Whether `path` is the name of this open file.
#[cfg(unix)]
fn is_at(file: &File, path: &Path) -> bool {
    match (file.metadata(), fs::symlink_metadata(path)) {
        (Ok(file), Ok(there)) => number(&file) == number(&there),
        _ => false,
    }
}

#[cfg(not(unix))]
fn is_at(_: &File, _: &Path) -> bool {
    true
}

/// Gives a file another name, where nothing has it.
fn put_where_nothing_is(part: &Path, place: &Path) -> io::Result<()> {
    match fs::hard_link(part, place) {
        Ok(()) => {
            remove(part);
            Ok(())
        }
        Err(error) if error.kind() == io::ErrorKind::AlreadyExists => Err(error),
        Err(_) if fs::symlink_metadata(place).is_ok() => Err(io::ErrorKind::AlreadyExists.into()),
        // A file system without hard links.
        Err(_) => fs::rename(part, place),
    }
}

fn cannot_create(path: &Path, source: io::Error) -> RecordError {
    RecordError::Create {
        path: path.display().to_string(),
        source,
    }
}

fn exists(path: &Path) -> RecordError {
    RecordError::Exists {
        path: path.display().to_string(),
    }
}

fn busy(path: &Path, locked: &Path) -> RecordError {
    RecordError::Busy {
        path: path.display().to_string(),
        locked: locked.display().to_string(),
    }
}
