//! Reading `.rrd` files.

use super::{Event, ReadError};
use crate::domain::{Domain, Vec2};
use crate::frame::Frame;
use crate::packing::coverage;
use crate::record::{FORMAT_VERSION, Outcome};
use crate::relax::fire::FireState;
use crate::scene::Scene;
use rerun::external::re_log_encoding::rrd::{DecoderApp, DecoderIterator};
use rerun::external::re_log_types::{LogMsg, StoreId, StoreKind};
use rerun::log::Chunk;
use rerun::{Scalars, TimelineName};
use std::collections::VecDeque;
use std::fs::File;
use std::io::BufReader;
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
/// let writer = record::Writer::create(&path, true, &scene, run.packing()).unwrap();
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
    messages: Messages,
    header: Header,
    /// What has been read and not yet handed out; an error is the last of it.
    events: VecDeque<Result<Event, ReadError>>,
    intact: Option<u64>,
    failed: bool,
}

type Messages = DecoderIterator<LogMsg, BufReader<File>>;

/// What a recording says of itself before its first frame.
struct Header {
    store: StoreId,
    scene: Scene,
    radii: Vec<f64>,
    domain: Domain,
    program: String,
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
        let file = File::open(path.as_ref()).map_err(|source| ReadError::Open {
            path: name.clone(),
            source,
        })?;
        let mut messages =
            DecoderApp::decode_eager(BufReader::new(file)).map_err(|e| ReadError::NotRrd {
                path: name.clone(),
                problem: e.to_string(),
            })?;
        let header = read_header(&name, &mut messages)?;
        Ok(Self {
            path: name,
            messages,
            header,
            events: VecDeque::new(),
            intact: None,
            failed: false,
        })
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

    /// Whether the file was closed by its writer: a footer follows the last message. Known when the end is reached.
    ///
    /// See the example of [`Recording`].
    #[must_use]
    pub fn is_closed(&self) -> bool {
        self.messages
            .rrd_manifests()
            .is_ok_and(|manifests| !manifests.is_empty())
    }

    fn damaged(&self, problem: &impl ToString) -> ReadError {
        ReadError::Damaged {
            path: self.path.clone(),
            problem: problem.to_string(),
            intact: self.intact,
        }
    }

    /// Takes a message apart into events.
    fn read(&mut self, message: &LogMsg) -> Result<(), ReadError> {
        let LogMsg::ArrowMsg(store, arrow) = message else {
            return Ok(());
        };
        if *store != self.header.store {
            return Ok(());
        }
        let chunk = Chunk::from_arrow_msg(arrow).map_err(|e| self.damaged(&e))?;
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
            let minimizer = minimizers
                .next()
                .and_then(|values| FireState::from_values(&values))
                .ok_or_else(|| self.damaged(&format!("no minimiser state at step {step}")))?;
            let missing = |what| self.damaged(&format!("no {what} at step {step}"));
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
                    intact: self.intact,
                });
            }
            frame
                .validate(self.header.radii.len(), self.header.domain)
                .map_err(|source| ReadError::Frame {
                    path: self.path.clone(),
                    step,
                    source,
                    intact: self.intact,
                })?;
            self.intact = Some(step);
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
            return Err(self.damaged(&"its result is not whole"));
        };
        self.events.push_back(Ok(Event::Result {
            outcome: Outcome {
                converged,
                steps,
                f_max,
            },
            digest,
        }));
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
            if self.failed {
                return None;
            }
            let read = match self.messages.next()? {
                Ok(message) => self.read(&message),
                Err(error) => Err(self.damaged(&error)),
            };
            if let Err(error) = read {
                self.failed = true;
                self.events.push_back(Err(error));
            }
        }
    }
}

/// Reads messages until scene and radii are known.
fn read_header(path: &str, messages: &mut Messages) -> Result<Header, ReadError> {
    let missing = |missing| ReadError::NotSoftjam {
        path: path.to_owned(),
        missing,
    };
    let (mut scene, mut program) = (None, String::new());
    for message in messages {
        let message = message.map_err(|e| ReadError::NotRrd {
            path: path.to_owned(),
            problem: e.to_string(),
        })?;
        let LogMsg::ArrowMsg(store, arrow) = &message else {
            continue;
        };
        if store.kind() != StoreKind::Recording {
            continue;
        }
        let chunk = Chunk::from_arrow_msg(arrow).map_err(|e| ReadError::NotRrd {
            path: path.to_owned(),
            problem: e.to_string(),
        })?;
        match chunk.entity_path().to_string().as_str() {
            "/scene" => {
                let text = |name: &'static str| {
                    let mut texts = chunk.iter_slices::<String>(name.into());
                    texts
                        .next()
                        .and_then(|list| list.first().map(ToString::to_string))
                };
                let mut versions = chunk.iter_slices::<u32>("softjam.Scene:format_version".into());
                if let Some(&[found]) = versions.next()
                    && found > FORMAT_VERSION
                {
                    return Err(ReadError::Newer {
                        path: path.to_owned(),
                        found,
                        known: FORMAT_VERSION,
                    });
                }
                if let Some(toml) = text("softjam.Scene:toml") {
                    scene = Some(Scene::from_toml(&toml).map_err(|source| ReadError::Scene {
                        path: path.to_owned(),
                        source,
                    })?);
                    program = text("softjam.Scene:program").unwrap_or_default();
                }
            }
            "/particles" => {
                let list = |name: &'static str| {
                    let mut lists = chunk.iter_slices::<f64>(name.into());
                    lists.next().map(<[f64]>::to_vec)
                };
                let radii = list("softjam.Particles:radius").ok_or(missing("radii"))?;
                let sides = list("softjam.Particles:box").ok_or(missing("box"))?;
                let domain = match sides.as_slice() {
                    &[x, y] => Domain::new(x, y),
                    _ => None,
                };
                let domain = domain.ok_or(missing("box of two positive sides"))?;
                if radii.iter().any(|r| !(r.is_finite() && *r > 0.0)) {
                    return Err(missing("radii that are positive and finite"));
                }
                return Ok(Header {
                    store: store.clone(),
                    scene: scene.ok_or(missing("scene"))?,
                    radii,
                    domain,
                    program,
                });
            }
            _ => {}
        }
    }
    Err(missing(if scene.is_some() { "radii" } else { "scene" }))
}

fn steps(chunk: &Chunk) -> impl Iterator<Item = u64> + '_ {
    let step: TimelineName = "step".into();
    chunk
        .iter_indices(&step)
        .map(|(time, _)| u64::try_from(time.as_i64()).unwrap_or(0))
        .collect::<Vec<_>>()
        .into_iter()
}
