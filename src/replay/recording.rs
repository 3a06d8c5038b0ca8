//! A recording, read event by event.

use super::header::Header;
use super::steps::Steps;
use super::stream::{Ending, Message, Stream, guarded};
use super::{Event, ReadError};
use crate::domain::{Domain, Vec2};
use crate::frame::Frame;
use crate::packing::{Packing, coverage};
use crate::record::Outcome;
use crate::relax::fire::FireState;
use crate::scene::Scene;
use rerun::log::Chunk;
use rerun::{Scalars, TimelineName};
use std::collections::{BTreeMap, VecDeque};
use std::fs::File;
use std::io::{BufReader, Read};
use std::path::Path;

/// A recording that is being read: an iterator of what it holds behind its header.
///
/// # Example
///
/// ```
/// use softjam::{record, relax::Relaxation, replay::{Event, Recording}, scene::Scene};
///
/// let path = std::env::temp_dir().join("softjam-recording-example.rrd");
/// let scene = Scene { particles: 32, phi: 0.9, ..Scene::default() };
/// let mut run = Relaxation::new(&scene).unwrap();
/// let writer = record::Writer::create(&path, true, record::Header::of(&scene, &run)).unwrap();
/// record::record(&mut run, writer, &scene.channels, |_| true).unwrap();
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
    stream: Stream,
    header: Header,
    /// What has been read and not yet handed out; an error is the last of it.
    events: VecDeque<Result<Event, ReadError>>,
    steps: Steps,
    digests: blake3::Hasher,
    outcome: Option<Outcome>,
    ended: bool,
    /// Metrics of steps that no state has been handed out for yet.
    metrics: Metrics,
}

/// Metrics by step: names and values.
pub type Metrics = BTreeMap<u64, Vec<(String, f64)>>;

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
    ///
    /// ```
    /// let error = softjam::replay::Recording::open("/nowhere/run.rrd").err().unwrap();
    /// assert!(error.to_string().starts_with("cannot read /nowhere/run.rrd"));
    /// ```
    pub fn open(path: impl AsRef<Path>) -> Result<Self, ReadError> {
        let name = path.as_ref().display().to_string();
        let open = |path: &Path| {
            let file = File::open(path)?;
            let length = file.metadata()?.len();
            Ok((file, length))
        };
        let (file, length) = open(path.as_ref()).map_err(|source| ReadError::Open {
            path: name.clone(),
            source,
        })?;
        Self::read(&name, BufReader::new(file), length)
    }

    /// Reads a recording of `length` bytes from any source; errors call it `name`.
    ///
    /// # Errors
    ///
    /// [`ReadError`] says what is wrong with it.
    ///
    /// ```
    /// let error = softjam::replay::Recording::read("nothing", &[][..], 0).err().unwrap();
    /// assert_eq!(error.to_string(), "nothing is not a rerun recording: the file is empty");
    /// ```
    pub fn read(
        name: &str,
        source: impl Read + Send + 'static,
        length: u64,
    ) -> Result<Self, ReadError> {
        let path = name.to_owned();
        let mut stream =
            Stream::open(Box::new(source), length).map_err(|problem| ReadError::NotRrd {
                path: path.clone(),
                problem,
            })?;
        let header = Header::read(name, &mut stream)?;
        Ok(Self {
            path,
            stream,
            steps: Steps {
                schedule: header.scene.channels.state,
                first: header.from_step,
                last: None,
                off_schedule: false,
            },
            header,
            events: VecDeque::new(),
            digests: blake3::Hasher::new(),
            outcome: None,
            ended: false,
            metrics: Metrics::new(),
        })
    }

    /// The next recorded state; `None` at the end.
    ///
    /// # Errors
    ///
    /// [`ReadError`] at damage.
    ///
    /// ```
    /// use softjam::replay::Recording;
    /// # use softjam::{record, relax::Relaxation, scene::Scene};
    /// # let path = std::env::temp_dir().join("softjam-next-state-example.rrd");
    /// # let scene = Scene { particles: 32, phi: 0.9, ..Scene::default() };
    /// # let mut run = Relaxation::new(&scene).unwrap();
    /// # let writer = record::Writer::create(&path, true, record::Header::of(&scene, &run)).unwrap();
    /// # record::record(&mut run, writer, &scene.channels, |_| true).unwrap();
    ///
    /// let mut recording = Recording::open(&path).unwrap();
    /// while let Some(state) = recording.next_state().unwrap() {
    ///     assert_eq!(state.packing.positions(), state.frame.positions);
    /// }
    /// # std::fs::remove_file(&path).unwrap();
    /// ```
    pub fn next_state(&mut self) -> Result<Option<State>, ReadError> {
        // More steps than any batch holds: what keeps memory bounded in a recording of metrics alone.
        const MOST: usize = 1 << 16;
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
                Event::Metric { name, step, value } => {
                    if self.header.scene.channels.state.is_on() || self.metrics.len() < MOST {
                        self.metrics.entry(step).or_default().push((name, value));
                    }
                }
                Event::Drawn { .. } | Event::Result { .. } => {}
            }
        }
        Ok(None)
    }

    /// The scene that was run.
    ///
    /// See the example of [`Recording`].
    #[must_use]
    pub fn scene(&self) -> &Scene {
        &self.header.scene
    }

    /// The undeformed radii `R_i`, one a particle.
    ///
    /// See the example of [`Recording`].
    #[must_use]
    pub fn radii(&self) -> &[f64] {
        &self.header.radii
    }

    /// The periodic box.
    ///
    /// See the example of [`Recording`].
    #[must_use]
    pub fn domain(&self) -> Domain {
        self.header.domain
    }

    /// The coverage of the undeformed disks `φ`.
    ///
    /// See the example of [`Recording`].
    #[must_use]
    pub fn coverage(&self) -> f64 {
        coverage(&self.header.radii, self.header.domain)
    }

    /// The program that recorded it, as `softjam 0.1.0`.
    ///
    /// See the example of [`Recording`].
    #[must_use]
    pub fn program(&self) -> &str {
        &self.header.program
    }

    /// The step that the recording begins with; not 0 if its run went on from another recording.
    ///
    /// See the example of [`Recording`].
    #[must_use]
    pub fn from_step(&self) -> u64 {
        self.header.from_step
    }

    /// The name of the file.
    ///
    /// See the example of [`Recording`].
    #[must_use]
    pub fn path(&self) -> &str {
        &self.path
    }

    /// Whether the file was closed by its writer; if not, it breaks off. Known when the end is reached.
    ///
    /// See the example of [`Recording`].
    #[must_use]
    pub fn is_closed(&self) -> bool {
        self.stream.ending() == Some(Ending::Closed)
    }

    /// The last step whose state has been read in full.
    ///
    /// See the example of [`Recording`].
    #[must_use]
    pub fn intact(&self) -> Option<u64> {
        self.steps.last
    }

    /// The packing at a recorded frame.
    ///
    /// # Errors
    ///
    /// [`ReadError::Damaged`] if the frame is not one of this recording.
    ///
    /// See the example of [`Recording`].
    pub fn packing(&self, frame: &Frame) -> Result<Packing, ReadError> {
        let radii = self.header.radii.clone();
        Packing::new(self.header.domain, radii, frame.positions.clone())
            .map_err(|error| self.damaged(error.to_string()))
    }

    /// How the run ended, as far as it has been read.
    ///
    /// See the example of [`Recording`].
    #[must_use]
    pub fn outcome(&self) -> Option<Outcome> {
        self.outcome
    }

    fn damaged(&self, problem: impl Into<String>) -> ReadError {
        ReadError::Damaged {
            path: self.path.clone(),
            problem: problem.into(),
            intact: self.steps.last,
        }
    }

    /// Takes a message apart into events.
    fn take_apart(&mut self, message: Message) -> Result<(), ReadError> {
        let (store, chunk) = match message {
            Message::Opens => {
                return Err(ReadError::Several {
                    path: self.path.clone(),
                    intact: self.steps.last,
                });
            }
            Message::Layout => return Ok(()),
            Message::Chunk(store, chunk) => (store, chunk),
        };
        if store != self.header.store {
            return Err(self.damaged(format!("rows of another recording, {store:?}")));
        }
        let entity = chunk.entity_path().to_string();
        match entity.as_str() {
            "/state" => self.read_states(&chunk),
            "/result" => self.read_result(&chunk),
            "/world/contours" | "/world/contacts" if !chunk.is_static() => {
                let channel = if entity == "/world/contours" {
                    "contours"
                } else {
                    "contacts"
                };
                let steps = steps(&chunk);
                self.events
                    .extend(steps.map(|step| Ok(Event::Drawn { channel, step })));
                Ok(())
            }
            _ => {
                if let Some(name) = entity.strip_prefix("/metrics/") {
                    let values = chunk.iter_slices::<f64>(Scalars::descriptor_scalars().component);
                    for (step, value) in steps(&chunk).zip(values) {
                        if let [value] = *value {
                            self.events.push_back(Ok(Event::Metric {
                                name: name.to_owned(),
                                step,
                                value,
                            }));
                        }
                    }
                }
                Ok(())
            }
        }
    }

    fn read_states(&mut self, chunk: &Chunk) -> Result<(), ReadError> {
        let vectors = |name: &'static str| {
            chunk
                .iter_slices::<[f64; 2]>(name.into())
                .map(|list| list.iter().map(|&[x, y]| Vec2::new(x, y)).collect())
                .collect::<Vec<Vec<Vec2>>>()
        };
        let numbers = |name: &'static str| {
            chunk
                .iter_slices::<f64>(name.into())
                .map(<[f64]>::to_vec)
                .collect::<Vec<_>>()
        };
        let steps: Vec<u64> = steps(chunk).collect();
        let mut positions = vectors("softjam.State:position").into_iter();
        let mut velocities = vectors("softjam.State:velocity").into_iter();
        let mut contacts = chunk
            .iter_slices::<[u32; 2]>("softjam.State:contact".into())
            .map(<[[u32; 2]]>::to_vec);
        let mut forces = numbers("softjam.State:force").into_iter();
        let mut minimizers = numbers("softjam.State:minimizer").into_iter();
        let mut digests = chunk
            .iter_slices::<u8>("softjam.State:digest".into())
            .map(<[u8]>::to_vec);
        for step in steps {
            let missing = |what| self.damaged(format!("no {what} at step {step}"));
            let minimizer = minimizers
                .next()
                .and_then(|values| FireState::from_values(&values))
                .ok_or_else(|| missing("minimiser state"))?;
            let frame = Frame {
                step,
                positions: positions.next().ok_or_else(|| missing("positions"))?,
                velocities: velocities.next().ok_or_else(|| missing("velocities"))?,
                contacts: contacts.next().ok_or_else(|| missing("contacts"))?,
                forces: forces.next().ok_or_else(|| missing("forces"))?,
                minimizer,
            };
            let digest = digests.next().ok_or_else(|| missing("digest"))?;
            if frame.digest() != digest.as_slice() {
                return Err(ReadError::Digest {
                    path: self.path.clone(),
                    step,
                    intact: self.steps.last,
                });
            }
            frame
                .validate(self.header.radii.len(), self.header.domain)
                .map_err(|source| ReadError::Frame {
                    path: self.path.clone(),
                    step,
                    source,
                    intact: self.steps.last,
                })?;
            self.steps
                .accept(step)
                .map_err(|problem| ReadError::Steps {
                    path: self.path.clone(),
                    problem,
                    intact: self.steps.last,
                })?;
            self.steps.last = Some(step);
            self.digests.update(&digest);
            self.events.push_back(Ok(Event::State(frame)));
        }
        Ok(())
    }

    fn read_result(&mut self, chunk: &Chunk) -> Result<(), ReadError> {
        let converged = chunk
            .iter_slices::<bool>("softjam.Result:converged".into())
            .next()
            .and_then(|list| list.iter().next());
        let mut steps = chunk.iter_slices::<u64>("softjam.Result:steps".into());
        let steps = steps.next().and_then(|list| list.first().copied());
        let mut f_max = chunk.iter_slices::<f64>("softjam.Result:f_max".into());
        let f_max = f_max.next().and_then(|list| list.first().copied());
        let digest = chunk
            .iter_slices::<u8>("softjam.Result:digest".into())
            .next()
            .and_then(|bytes| bytes.try_into().ok());
        let (Some(converged), Some(steps), Some(f_max), Some(digest)) =
            (converged, steps, f_max, digest)
        else {
            return Err(self.damaged("its result is not whole"));
        };
        let outcome = Outcome {
            converged,
            steps,
            f_max,
        };
        let wrong = |problem: String| ReadError::Result {
            path: self.path.clone(),
            problem,
            intact: self.steps.last,
        };
        if digest != self.digests.finalize().as_bytes().as_slice() {
            return Err(wrong(
                "its digest is not that of the states before it".to_owned(),
            ));
        }
        if self.steps.last.is_some_and(|last| last != steps) {
            return Err(wrong(format!("it names {steps} steps")));
        }
        if self.outcome.replace(outcome).is_some() {
            return Err(wrong("it is there twice".to_owned()));
        }
        self.events.push_back(Ok(Event::Result { outcome, digest }));
        Ok(())
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
            let read = match self.stream.next() {
                Ok(Some(message)) => {
                    let mut read = Ok(());
                    let decoded = guarded(|| {
                        read = self.take_apart(message);
                        Ok(())
                    });
                    decoded.map_err(|problem| self.damaged(problem)).and(read)
                }
                Ok(None) => {
                    self.ended = true;
                    Ok(())
                }
                Err(problem) => Err(self.damaged(problem)),
            };
            if let Err(error) = read {
                self.ended = true;
                self.events.push_back(Err(error));
            }
        }
    }
}

fn steps(chunk: &Chunk) -> impl Iterator<Item = u64> + '_ {
    let step: TimelineName = "step".into();
    chunk
        .iter_indices(&step)
        .map(|(time, _)| u64::try_from(time.as_i64()).unwrap_or(0))
        .collect::<Vec<_>>()
        .into_iter()
}
