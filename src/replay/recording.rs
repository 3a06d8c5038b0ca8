//! A recording, read event by event.

mod facts;
mod file;
mod limits;

pub use file::place_of_byte;

use super::mcap::McapSource;
use super::rrd::RrdSource;
use super::source::{Header, Item, Problem, Source};
use super::steps::Steps;
use super::{Event, ReadError, mcap, rrd};
use crate::analysis::METRICS;
use crate::budget::Budget;
use crate::neighbors::crowding::{self, Crowd};
use crate::record::{Format, Outcome};
use crate::state::{Frame, FrameError, Packing};
use crate::text::counted;
use std::collections::{BTreeMap, VecDeque};
use std::fs::File;
use std::io::{BufReader, Cursor, Read};
use std::path::Path;

/// A recording of either format that is being read: an iterator of what it holds behind its header.
///
/// # Example
///
/// ```
/// use softjam::{record, protocol::Relaxation, replay::{Event, Recording}, scene::Scene};
///
/// let path = std::env::temp_dir().join("softjam-recording-example.rrd");
/// let scene = Scene { particles: 32, phi: 0.9, ..Scene::default() };
/// let mut run = Relaxation::new(&scene).unwrap();
/// let writer = record::Writer::create(&path, true, record::Header::of(&scene, &run)).unwrap();
/// record::record(&mut run, vec![writer], &scene.channels, |_| true).unwrap();
///
/// let recording = Recording::open(&path).unwrap();
/// assert_eq!(recording.scene(), &scene);
/// let last = recording
///     .filter_map(|event| match event.unwrap() { Event::State(frame) => Some(frame), _ => None })
///     .last()
///     .unwrap();
/// assert_eq!(last, run.frame());
/// # std::fs::remove_file(&path).unwrap();
/// ```
pub struct Recording {
    path: String,
    format: Format,
    source: Box<dyn Source>,
    header: Header,
    /// What has been read and not yet handed out; an error is the last of it.
    events: VecDeque<Result<Event, ReadError>>,
    steps: Steps,
    digests: blake3::Hasher,
    outcome: Option<Outcome>,
    ended: bool,
    /// Metrics of steps that no state has been handed out for yet.
    metrics: Metrics,
    budget: Budget,
}

/// Metrics by step: names and values.
pub type Metrics = BTreeMap<u64, Vec<(&'static str, f64)>>;

/// A recorded state, with what was recorded on the way to it.
///
/// See the example of [`Recording::next_state`].
#[derive(Clone, Debug)]
pub struct State {
    /// The frame.
    pub frame: Frame,
    /// The packing at it.
    pub packing: Packing,
    /// The metrics of the steps behind the state before, up to and with this one.
    pub metrics: Metrics,
}

impl Recording {
    /// Opens a recording and reads its header.
    ///
    /// # Errors
    ///
    /// [`ReadError`] says what is wrong with the file.
    pub fn open(path: impl AsRef<Path>) -> Result<Self, ReadError> {
        Self::open_within(path, Budget::default())
    }

    /// [`open`](Self::open) with a budget for what the file may take.
    ///
    /// # Errors
    ///
    /// [`ReadError`] says what is wrong with the file, or what does not fit.
    pub fn open_within(path: impl AsRef<Path>, budget: Budget) -> Result<Self, ReadError> {
        let name = path.as_ref().display().to_string();
        let open = |path: &Path| {
            // Before it is opened: a pipe would wait for its other end.
            let found = std::fs::metadata(path)?;
            file::is_regular(found.file_type())?;
            let file = File::open(path)?;
            let length = file.metadata()?.len();
            Ok((file, length))
        };
        let (file, length) = open(path.as_ref()).map_err(|source| ReadError::Open {
            path: name.clone(),
            source,
        })?;
        Self::read_within(&name, BufReader::new(file), length, budget)
    }

    /// Reads a recording of `length` bytes from any source; errors call it `name`.
    ///
    /// # Errors
    ///
    /// [`ReadError`] says what is wrong with it.
    pub fn read(
        name: &str,
        source: impl Read + Send + 'static,
        length: u64,
    ) -> Result<Self, ReadError> {
        Self::read_within(name, source, length, Budget::default())
    }

    /// [`read`](Self::read) with a budget for what the recording may take.
    ///
    /// # Errors
    ///
    /// [`ReadError`] says what is wrong with it, or what does not fit.
    pub fn read_within(
        name: &str,
        source: impl Read + Send + 'static,
        length: u64,
        budget: Budget,
    ) -> Result<Self, ReadError> {
        let mut source = source;
        let mut start = Vec::new();
        let looked_at = source.by_ref().take(8).read_to_end(&mut start);
        let unknown = |problem: String| ReadError::Format {
            path: name.to_owned(),
            format: "a recording (.rrd or .mcap)",
            problem,
        };
        looked_at.map_err(|error| unknown(error.to_string()))?;
        let format = if start.starts_with(rrd::MAGIC) {
            Format::Rrd
        } else if start.starts_with(mcap::MAGIC) {
            Format::Mcap
        } else {
            return Err(unknown(match start.len() {
                0 => "the file is empty".to_owned(),
                8 => "it begins like neither".to_owned(),
                n => format!("it has only {}", counted(n, "byte")),
            }));
        };
        let whole = Box::new(Cursor::new(start).chain(source));
        let (source, header): (Box<dyn Source>, Header) = match format {
            Format::Rrd => {
                let (source, header) = RrdSource::open(name, whole, length, budget)?;
                (Box::new(source), header)
            }
            Format::Mcap => {
                let (source, header) = McapSource::open(name, whole, length, budget)?;
                (Box::new(source), header)
            }
        };
        header.check(name)?;
        Ok(Self::of(name.to_owned(), format, source, header, budget))
    }

    /// A recording whose header has been read.
    pub(super) fn of(
        path: String,
        format: Format,
        source: Box<dyn Source>,
        header: Header,
        budget: Budget,
    ) -> Self {
        Self {
            path,
            format,
            source,
            steps: Steps::new(&header.scene, header.from_step),
            header,
            events: VecDeque::new(),
            digests: blake3::Hasher::new(),
            outcome: None,
            ended: false,
            metrics: Metrics::new(),
            budget,
        }
    }

    /// What the file says of itself.
    pub(super) fn source_header(&self) -> Header {
        self.header.clone()
    }

    /// What the file may take.
    pub(super) fn budget(&self) -> Budget {
        self.budget
    }

    /// The next recorded state; `None` at the end.
    ///
    /// # Errors
    ///
    /// [`ReadError`] at damage.
    ///
    /// ```
    /// use softjam::replay::Recording;
    /// # use softjam::{record, protocol::Relaxation, scene::Scene};
    /// # let path = std::env::temp_dir().join("softjam-next-state-example.rrd");
    /// # let scene = Scene { particles: 32, phi: 0.9, ..Scene::default() };
    /// # let mut run = Relaxation::new(&scene).unwrap();
    /// # let writer = record::Writer::create(&path, true, record::Header::of(&scene, &run)).unwrap();
    /// # record::record(&mut run, vec![writer], &scene.channels, |_| true).unwrap();
    ///
    /// let mut recording = Recording::open(&path).unwrap();
    /// while let Some(state) = recording.next_state().unwrap() {
    ///     assert_eq!(state.packing.positions(), state.frame.positions);
    /// }
    /// # std::fs::remove_file(&path).unwrap();
    /// ```
    pub fn next_state(&mut self) -> Result<Option<State>, ReadError> {
        while let Some(event) = self.next() {
            match event? {
                Event::State(frame) => {
                    let later = self.metrics.split_off(&(frame.step + 1));
                    return Ok(Some(State {
                        packing: self.packing(&frame)?,
                        metrics: core::mem::replace(&mut self.metrics, later),
                        frame,
                    }));
                }
                Event::Metric {
                    name, step, value, ..
                } => {
                    // Without states there is nobody to give them to.
                    if self.header.scene.channels.state.is_on() {
                        let row = self.metrics.entry(step);
                        let row = row.or_insert_with(|| Vec::with_capacity(METRICS.len()));
                        // Twice is enough to know that a row stands there more than once.
                        if row.len() < 2 * METRICS.len() {
                            row.push((name, value));
                        }
                        self.allow_waiting_metrics()?;
                    }
                }
                Event::Drawn { .. } | Event::Result { .. } => {}
            }
        }
        Ok(None)
    }

    fn damaged(&self, problem: impl Into<String>) -> ReadError {
        ReadError::Damaged {
            path: self.path.clone(),
            problem: problem.into(),
            intact: self.steps.last(),
        }
    }

    /// Checks what was found.
    fn check(&mut self, item: Item) -> Result<Event, ReadError> {
        Ok(match item {
            Item::State(frame, digest) => self.check_state(frame, &digest)?,
            Item::Metric {
                name,
                step,
                nanoseconds,
                value,
            } => Event::Metric {
                name,
                step,
                nanoseconds,
                value,
            },
            Item::Drawn { channel, step } => Event::Drawn { channel, step },
            Item::Result(outcome, digest) => self.check_result(outcome, digest)?,
        })
    }

    fn check_state(&mut self, frame: Frame, digest: &[u8]) -> Result<Event, ReadError> {
        let step = frame.step;
        let intact = self.steps.last();
        if frame.digest() != digest {
            return Err(ReadError::Digest {
                path: self.path.clone(),
                step,
                intact,
            });
        }
        frame
            .validate(self.header.radii.len(), self.header.domain)
            .map_err(|source| ReadError::Frame {
                path: self.path.clone(),
                step,
                source,
                intact,
            })?;
        if let Some(Crowd { particle, others }) =
            crowding::contacts(&self.header.radii, &frame.contacts)
        {
            return Err(ReadError::Frame {
                path: self.path.clone(),
                step,
                source: FrameError::Crowded {
                    particle,
                    contacts: others,
                },
                intact,
            });
        }
        if let Err(problem) = self.steps.accept(step, frame.stage) {
            return Err(ReadError::Steps {
                path: self.path.clone(),
                problem: self.steps_behind(step).unwrap_or(problem),
                intact,
            });
        }
        self.digests.update(digest);
        Ok(Event::State(frame))
    }

    /// What a look at the rest of the file tells of a state that is not the next, the one of `step`.
    fn steps_behind(&mut self, step: u64) -> Option<String> {
        let (mut steps, mut items) = (vec![step], Vec::new());
        // Whatever is wrong there, it is not the first that is.
        while let Ok(true) = self.source.read_on(&mut items) {
            steps.extend(items.drain(..).filter_map(|item| match item {
                Item::State(frame, _) => Some(frame.step),
                _ => None,
            }));
        }
        self.steps.order_behind(steps)
    }

    fn check_result(&mut self, outcome: Outcome, digest: [u8; 32]) -> Result<Event, ReadError> {
        if self.steps.last().is_none() && self.header.scene.channels.state.is_on() {
            return Err(ReadError::Steps {
                path: self.path.clone(),
                problem: "its scene records states, and it holds none: they were taken out of it"
                    .to_owned(),
                intact: None,
            });
        }
        let wrong = |problem: String| ReadError::Result {
            path: self.path.clone(),
            problem,
            intact: self.steps.last(),
        };
        if digest != *self.digests.finalize().as_bytes() {
            return Err(wrong(
                "its digest is not that of the states before it".to_owned(),
            ));
        }
        if self.steps.last().is_some_and(|last| last != outcome.steps) {
            return Err(wrong(format!(
                "it names {}",
                counted(outcome.steps, "step")
            )));
        }
        if self.outcome.is_some() {
            return Err(wrong("it is there twice".to_owned()));
        }
        self.outcome = Some(outcome);
        Ok(Event::Result { outcome, digest })
    }
}

/// The events, until the end or the first damage.
impl Iterator for Recording {
    type Item = Result<Event, ReadError>;

    fn next(&mut self) -> Option<Self::Item> {
        loop {
            if let Some(event) = self.events.pop_front() {
                return Some(event);
            }
            if self.ended {
                return None;
            }
            let mut items = Vec::new();
            let read = self.source.read_on(&mut items);
            // What was whole in front of the damage counts.
            for item in items {
                let event = self.check(item);
                self.ended = event.is_err();
                self.events.push_back(event);
                if self.ended {
                    break;
                }
            }
            let problem = match read {
                _ if self.ended => continue,
                Ok(goes_on) => {
                    self.ended = !goes_on;
                    continue;
                }
                Err(problem) => problem,
            };
            self.ended = true;
            self.events.push_back(Err(match problem {
                Problem::Damage(problem) => self.damaged(problem),
                Problem::Budget(problem) => ReadError::Budget {
                    path: self.path.clone(),
                    problem,
                },
                Problem::Several => ReadError::Several {
                    path: self.path.clone(),
                    intact: self.steps.last(),
                },
                Problem::Parts => ReadError::Parts {
                    path: self.path.clone(),
                    intact: self.steps.last(),
                },
                Problem::Other(error) => error,
            }));
        }
    }
}
