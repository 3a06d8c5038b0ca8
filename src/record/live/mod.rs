//! The live view: a run streamed to a rerun viewer while it is recorded.
//!
//! The viewer gets the messages that the file gets, from the same [recorder](super::RrdRecorder), over gRPC and ten times a
//! second. It is a guest: whatever it does, the run and its files go on. Between the run and the thread that encodes and
//! sends is a queue of at most 16 MiB of snapshots; when it is full, every other frame in it is dropped. At the end the
//! viewer has two seconds to take what is left, one that was started for this run ten seconds to come up before.

mod queue;
mod stream;

use super::{Header, Outcome, Snapshot};
use queue::{Closing, Queue};
use rerun::external::re_uri::{ProxyUri, Scheme};
use std::fmt;
use std::net::{Ipv4Addr, SocketAddr, TcpStream};
use std::process::{Child, Command, Stdio};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// What a viewer gets at the end of a run to take what is left.
const FLUSH: Duration = Duration::from_secs(2);

/// What a viewer that was started for the run gets to come up, counted from the end of the run.
const STARTUP: Duration = Duration::from_secs(10);

/// How long it may take to find out whether a viewer listens on this machine.
const KNOCK: Duration = Duration::from_millis(200);

/// Where a run is looked at.
///
/// ```
/// use softjam::record::Viewer;
///
/// assert_eq!(Viewer::at(Viewer::URL).unwrap().to_string(), Viewer::URL);
/// let error = Viewer::at("scene.toml").unwrap_err();
/// assert!(error.to_string().starts_with("`scene.toml` is not the address of a rerun viewer"));
/// ```
#[derive(Clone, Debug)]
pub struct Viewer {
    uri: ProxyUri,
    /// The program, if it was started for this run.
    started: Option<Arc<Mutex<Child>>>,
}

impl Viewer {
    /// Where a viewer on this machine listens, unless it is told otherwise.
    pub const URL: &str = "rerun+http://127.0.0.1:9876/proxy";

    /// The port of [`URL`](Self::URL).
    pub const PORT: u16 = 9876;

    /// A viewer that listens at `url`.
    ///
    /// # Errors
    ///
    /// [`LiveError::Url`] for what is no address of a viewer.
    pub fn at(url: &str) -> Result<Self, LiveError> {
        let wrong = || LiveError::Url {
            url: url.to_owned(),
        };
        let uri: ProxyUri = url.parse().map_err(|_| wrong())?;
        // There is nobody to test encryption against.
        match uri.origin.scheme {
            Scheme::RerunHttp => Ok(Self { uri, started: None }),
            Scheme::RerunHttps => Err(wrong()),
        }
    }

    /// Starts the viewer `rerun` that is on the `PATH`, listening at `port` of this machine; if something listens there
    /// already, it is taken for a viewer. The viewer outlives the program.
    ///
    /// # Errors
    ///
    /// [`LiveError::Missing`] or [`LiveError::Start`].
    pub fn start(port: u16) -> Result<Self, LiveError> {
        let mut viewer = Self::at(&format!("rerun+http://127.0.0.1:{port}/proxy"))?;
        let address = SocketAddr::from((Ipv4Addr::LOCALHOST, port));
        if TcpStream::connect_timeout(&address, KNOCK).is_ok() {
            return Ok(viewer);
        }
        let mut command = Command::new("rerun");
        command
            .arg(format!("--port={port}"))
            .arg("--expect-data-soon")
            // Who reads our output through a pipe does not wait for the viewer to be closed.
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .stderr(Stdio::null());
        // Ctrl-C in our terminal is not meant for the viewer.
        #[cfg(unix)]
        std::os::unix::process::CommandExt::process_group(&mut command, 0);
        match command.spawn() {
            Ok(child) => {
                viewer.started = Some(Arc::new(Mutex::new(child)));
                Ok(viewer)
            }
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => Err(LiveError::Missing),
            Err(source) => Err(LiveError::Start { source }),
        }
    }
}

impl Viewer {
    /// Whether it was started for this run and may still come up. A program that hands over to another one ends with
    /// success.
    fn comes_up(&self) -> bool {
        self.started.as_ref().is_some_and(|child| {
            let mut child = child.lock().unwrap_or_else(PoisonError::into_inner);
            !matches!(child.try_wait(), Ok(Some(status)) if !status.success())
        })
    }
}

impl fmt::Display for Viewer {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.uri.fmt(f)
    }
}

/// Why there is no live view.
///
/// See the example of [`Viewer`].
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum LiveError {
    /// What was given is not an address.
    #[error(
        "`{url}` is not the address of a rerun viewer, which looks like {}",
        Viewer::URL
    )]
    Url {
        /// What was given.
        url: String,
    },
    /// There is no viewer to start.
    #[error("there is no program `rerun` on the PATH; `pip install rerun-sdk` brings it")]
    Missing,
    /// The viewer, or the thread that would feed it, could not be started.
    #[error("cannot start the live view: {source}")]
    Start {
        /// The system's reason.
        source: std::io::Error,
    },
}

/// A run on its way to a viewer.
///
/// # Example
///
/// A viewer that is not there is no obstacle:
///
/// ```
/// use softjam::record::{self, Ended, Header, Live, Viewer, Writer};
/// use softjam::{protocol::Relaxation, scene::Scene};
///
/// let path = std::env::temp_dir().join("softjam-live-example.rrd");
/// let scene = Scene { particles: 32, phi: 0.9, ..Scene::default() };
/// let mut run = Relaxation::new(&scene).unwrap();
/// let header = Header::of(&scene, &run);
/// let live = Live::start(Viewer::at("rerun+http://127.0.0.1:1/proxy").unwrap(), header.clone()).unwrap();
/// let files = vec![Writer::create(&path, true, header).unwrap()];
/// let summary = record::record_live(&mut run, files, Some(&live), &scene.channels, |_| true).unwrap();
/// let shown = live.finish(summary.outcome);
/// assert_eq!((shown.ended, shown.sent), (Ended::Absent, 0));
/// assert_eq!(shown.of, run.step() + 1);
/// # std::fs::remove_file(&path).unwrap();
/// ```
#[derive(Debug)]
pub struct Live {
    queue: Arc<Queue>,
    thread: Option<JoinHandle<(Ended, u64)>>,
}

/// What a viewer was shown.
///
/// See the example of [`Live`].
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Shown {
    /// Snapshots that were sent with all that was recorded of them.
    pub sent: u64,
    /// Snapshots of the run.
    pub of: u64,
    /// How it ended.
    pub ended: Ended,
}

/// How a live view ended.
///
/// See the example of [`Live`].
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Ended {
    /// The viewer has confirmed all that was sent.
    Complete,
    /// No viewer was there.
    Absent,
    /// The viewer did not take what was left within the time that it is given.
    Late,
    /// The viewer, or the way to it, went away: why.
    Lost(String),
}

impl Live {
    /// Starts to stream to `viewer`, whether it is there or not.
    ///
    /// # Errors
    ///
    /// [`LiveError::Start`] if the system gives no thread.
    pub fn start(viewer: Viewer, header: Header) -> Result<Self, LiveError> {
        let queue = Arc::new(Queue::new());
        let shared = Arc::clone(&queue);
        let thread = std::thread::Builder::new()
            .name("softjam-live".to_owned())
            .spawn(move || stream::run(&shared, &viewer, header))
            .map_err(|source| LiveError::Start { source })?;
        Ok(Self {
            queue,
            thread: Some(thread),
        })
    }

    /// Shows a snapshot, some time; never waits for the viewer.
    pub fn send(&self, snapshot: impl Into<Arc<Snapshot>>) {
        if self.thread.as_ref().is_some_and(|t| !t.is_finished()) {
            self.queue.push(snapshot.into());
        } else {
            self.queue.pass();
        }
    }

    /// Gives the viewer two seconds to take what is left, or ten to come up if it was started for this run, and ends.
    #[must_use]
    pub fn finish(mut self, outcome: Option<Outcome>) -> Shown {
        let (ended, sent) = self.close(outcome, false);
        Shown {
            sent,
            of: self.queue.offered(),
            ended,
        }
    }

    fn close(&mut self, outcome: Option<Outcome>, abandoned: bool) -> (Ended, u64) {
        self.queue.close(Closing {
            at: Instant::now(),
            outcome,
            abandoned,
        });
        let result = self.thread.take().map(JoinHandle::join);
        // A panic in there is bad, but no reason to lose a run.
        let failed = || (Ended::Lost("the live view failed".to_owned()), 0);
        result.and_then(Result::ok).unwrap_or_else(failed)
    }
}

/// A live view that is dropped without [`Live::finish`] ends at once.
impl Drop for Live {
    fn drop(&mut self) {
        if self.thread.is_some() {
            self.close(None, true);
        }
    }
}
