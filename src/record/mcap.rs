//! The `.mcap` recorder: which topic holds what, and when it is written.
//!
//! | topic | schema | content |
//! | --- | --- | --- |
//! | `/particles` | `softjam.v1.Particles` | undeformed radii, sides of the box; once, first |
//! | `/world/contours` | `foxglove.SceneUpdate` | particle polygons, coloured by the pressure on the particle |
//! | `/world/vertices` | `foxglove.PointCloud` | their vertices, which the rerun viewer draws |
//! | `/world/contacts` | `foxglove.SceneUpdate` | a segment a contact between the centres, width and colour by the force |
//! | `/metrics` | `softjam.v1.Metrics` | the scalars of a step |
//! | `/protocol` | `softjam.v1.Protocol` | what each finished stage of a protocol has come to |
//! | `/state` | `softjam.v1.State` | lossless |
//!
//! The metadata record `softjam` (format version, program, digest of the scene, first step, legs if it was changed on its way) and the attachment `scene.toml`
//! come first, the metadata record `softjam.result` last; its absence means an unfinished run. Log time is the step in
//! milliseconds, since MCAP wants a clock and the steps are the only one that two machines agree on.
//!
//! Messages are gathered into chunks of whole steps; a chunk is compressed and has a checksum, and so has the whole file.

use super::images::seats;
use super::messages::{
    ABOUT, MetricsMessage, ParticlesMessage, ProtocolMessage, RESULT, SCENE, STEP_NANOSECONDS,
    StateMessage, descriptors, topic,
};
use super::patience::Patience;
use super::pictures::{Network, StageContours};
use super::redraw::Redraw;
use super::scene_update::{contact_lines, contour_lines, vertex_cloud};
use super::sink::Sink;
use super::{Header, Outcome, Recorder, Snapshot, Written, legs_to_text};
use crate::contacts::FrameContacts;
use crate::state::Frame;
use crate::state::Packing;
use foxglove::Encode;
use foxglove::messages::{PointCloud, SceneUpdate};
use mcap::records::{MessageHeader, Metadata};
use mcap::write::NoSeek;
use mcap::{Attachment, McapError, WriteOptions};
use prost::Message;
use std::borrow::Cow;
use std::collections::BTreeMap;
use std::io::{self, Write};

/// A chunk is closed when it holds this many bytes or snapshots, or when the steps up to the next snapshot come to so many moves of
/// a particle: some 40 ms, whatever is recorded, and the same in every run. The first snapshot has a chunk of its own.
const CHUNK_BYTES: usize = 1 << 20;
const CHUNK_SNAPSHOTS: usize = 512;
const CHUNK_MOVES: u64 = 400_000;

/// Foxglove and most others refuse messages of 2 GiB.
const LONGEST_MESSAGE: usize = i32::MAX as usize;

/// Level 1 costs 1.4 % more bytes than the default level 3 and takes 60 % of its time.
const ZSTD_LEVEL: u32 = 1;

/// Writes snapshots as an MCAP file.
///
/// # Example
///
/// ```
/// use softjam::{record::{Header, McapRecorder, Recorder as _, Snapshot}, protocol::Relaxation, scene::Scene};
///
/// let scene = Scene { particles: 32, ..Scene::default() };
/// let run = Relaxation::new(&scene).unwrap();
/// let mut bytes = Vec::new();
/// let mut recorder = McapRecorder::new(&mut bytes, Header::of(&scene, &run)).unwrap();
/// recorder.record(&Snapshot::of(&run, &scene.channels, true).unwrap()).unwrap();
/// recorder.finish(None).unwrap();
/// drop(recorder);
/// assert!(bytes.starts_with(b"\x89MCAP0\r\n") && bytes.ends_with(b"\x89MCAP0\r\n"));
/// ```
pub struct McapRecorder<W: Write> {
    writer: mcap::Writer<NoSeek<Sink<W>>>,
    sink: Sink<W>,
    topics: Topics,
    packing: Packing,
    line_tension: f64,
    format: u32,
    contours: StageContours,
    redraw: Redraw,
    patience: Patience,
    message: Vec<u8>,
    chunk: Chunk,
    intact: Option<u64>,
    states: u64,
    digests: blake3::Hasher,
}

/// What the open chunk holds.
#[derive(Default)]
struct Chunk {
    bytes: usize,
    snapshots: usize,
    first: Option<u64>,
    last: Option<u64>,
}

/// The numbers of the topics that are recorded.
#[derive(Default)]
struct Topics {
    particles: u16,
    contours: u16,
    vertices: u16,
    contacts: u16,
    metrics: u16,
    state: u16,
    protocol: u16,
}

impl<W: Write> McapRecorder<W> {
    /// Starts a recording: what it is, its scene, the radii and the box.
    ///
    /// # Errors
    ///
    /// Whatever `sink` fails with.
    pub fn new(sink: W, header: Header) -> io::Result<Self> {
        let sink = Sink::new(sink);
        let mut writer = WriteOptions::new()
            .library(header.program.replace(' ', "/"))
            .compression(Some(mcap::Compression::Zstd))
            .compression_level(ZSTD_LEVEL)
            // More threads would give other bytes on another machine.
            .compression_threads(0)
            .chunk_size(None)
            .disable_seeking(true)
            .create(NoSeek::new(sink.clone()))
            .map_err(io_error)?;
        let log_time = header.from_step.saturating_mul(STEP_NANOSECONDS);
        let about = [
            ("format_version", header.format.to_string()),
            ("program", header.program.clone()),
            ("bits", header.bits.to_string()),
            ("scene_digest", hex(header.digest())),
            ("from_step", header.from_step.to_string()),
        ];
        let legs = legs_to_text(&header.legs)?.map(|legs| ("legs", legs));
        writer
            .write_metadata(&metadata(ABOUT, about.into_iter().chain(legs)))
            .map_err(io_error)?;
        writer
            .attach(&Attachment {
                log_time,
                create_time: 0,
                name: SCENE.to_owned(),
                media_type: "application/toml".to_owned(),
                data: Cow::Owned(header.toml().into_bytes()),
            })
            .map_err(io_error)?;
        let topics = Topics::open(&mut writer, &header.scene, header.format).map_err(io_error)?;
        let particles = ParticlesMessage::of(header.packing.radii(), header.packing.domain());
        let mut recorder = Self {
            writer,
            sink,
            line_tension: header.scene.line_tension,
            format: header.format,
            contours: StageContours::of(&header.scene),
            redraw: Redraw::new(&header),
            patience: Patience::of(&header, CHUNK_MOVES),
            packing: header.packing,
            topics,
            message: Vec::new(),
            chunk: Chunk::default(),
            intact: None,
            states: 0,
            digests: blake3::Hasher::new(),
        };
        recorder.send(recorder.topics.particles, header.from_step, &particles)?;
        recorder.flush()?;
        Ok(recorder)
    }

    fn record_frame(&mut self, snapshot: &Snapshot, frame: &Frame) -> io::Result<()> {
        let step = snapshot.step;
        if let Some(domain) = frame.domain {
            self.packing.set_domain(domain);
            self.redraw.enter(domain);
        }
        let positions = seats(self.packing.domain(), &frame.positions);
        let particles = self.redraw.particles(snapshot, frame);
        let network = self.redraw.contacts(snapshot, frame);
        if particles.is_some() || network {
            let contacts = FrameContacts::of(&self.packing, frame);
            let contacts = contacts.view();
            if let Some(particles) = particles {
                let radii = self.packing.radii();
                let contours = self.contours.at(&self.packing, frame);
                contours.draw(radii, &positions, &contacts, self.line_tension);
                let colors = particles.colors();
                let lines = contour_lines(step, contours, &colors);
                let cloud = vertex_cloud(step, contours, &colors);
                self.send(self.topics.contours, step, &lines)?;
                self.send(self.topics.vertices, step, &cloud)?;
            }
            if network {
                let network = Network::of(&positions, self.packing.radii(), &contacts);
                let lines = contact_lines(step, &network);
                self.send(self.topics.contacts, step, &lines)?;
            }
        }
        Ok(())
    }

    /// Puts a message into the open chunk.
    fn send(&mut self, topic: u16, step: u64, message: &impl Message) -> io::Result<()> {
        self.message.clear();
        message
            .encode(&mut self.message)
            .map_err(io::Error::other)?;
        if self.message.len() > LONGEST_MESSAGE {
            return Err(io::Error::new(
                io::ErrorKind::InvalidInput,
                format!(
                    "a message of {} bytes at step {step} is longer than MCAP readers accept (2 GiB); record fewer channels",
                    self.message.len()
                ),
            ));
        }
        let log_time = step.saturating_mul(STEP_NANOSECONDS);
        let header = MessageHeader {
            channel_id: topic,
            sequence: step as u32,
            log_time,
            publish_time: log_time,
        };
        self.chunk.bytes += self.message.len();
        self.writer
            .write_to_known_channel(&header, &self.message)
            .map_err(io_error)
    }

    /// Closes the open chunk and brings it to the sink.
    fn flush(&mut self) -> io::Result<()> {
        self.writer.flush().map_err(io_error)?;
        self.intact = self.chunk.last.or(self.intact);
        self.chunk = Chunk::default();
        Ok(())
    }
}

impl<W: Write> Recorder for McapRecorder<W> {
    fn record(&mut self, snapshot: &Snapshot) -> io::Result<()> {
        let step = snapshot.step;
        if let Some(frame) = &snapshot.frame {
            self.record_frame(snapshot, frame)?;
        }
        if let Some(metrics) = snapshot.metrics {
            let message = MetricsMessage::of(step, snapshot.nanoseconds, metrics);
            self.send(self.topics.metrics, step, &message)?;
        }
        if let Some(end) = &snapshot.stage {
            let message = ProtocolMessage::of(step, end);
            self.send(self.topics.protocol, step, &message)?;
        }
        if let Some(frame) = snapshot.frame.as_ref().filter(|_| snapshot.state) {
            let digest = frame.digest();
            self.digests.update(&digest);
            self.states += 1;
            self.send(
                self.topics.state,
                step,
                &StateMessage::of(frame, &digest, self.format),
            )?;
        }
        let chunk = &mut self.chunk;
        chunk.snapshots += 1;
        chunk.last = Some(step);
        let first = *chunk.first.get_or_insert(step);
        if self.intact.is_none()
            || chunk.bytes >= CHUNK_BYTES
            || chunk.snapshots >= CHUNK_SNAPSHOTS
            || self.patience.ends(first, step)
        {
            self.flush()?;
        }
        Ok(())
    }

    fn intact(&self) -> Option<u64> {
        self.intact
    }

    fn written(&self) -> u64 {
        self.sink.written()
    }

    fn finish(&mut self, outcome: Option<Outcome>) -> io::Result<Written> {
        self.flush()?;
        if let Some(outcome) = outcome {
            let stability = outcome
                .stability
                .map(|s| ("stability", s.name().to_owned()));
            let result = [
                ("converged", outcome.converged.to_string()),
                ("steps", outcome.steps.to_string()),
                // The shortest decimal that gives the same bits back.
                ("f_max", format!("{:e}", outcome.f_max)),
                ("digest", hex(*self.digests.finalize().as_bytes())),
            ];
            let result = result.into_iter().chain(stability);
            self.writer
                .write_metadata(&metadata(RESULT, result))
                .map_err(io_error)?;
            self.writer.flush().map_err(io_error)?;
        }
        self.sink.hold();
        self.writer.finish().map_err(io_error)?;
        self.sink.close()?;
        Ok(Written {
            bytes: self.sink.written(),
            states: self.states,
        })
    }
}

impl Topics {
    /// Names the topics that the channels of `scene` switch on; the others keep the number 0, which no message is sent under.
    fn open<W: Write + io::Seek>(
        writer: &mut mcap::Writer<W>,
        scene: &crate::scene::Scene,
        format: u32,
    ) -> Result<Self, McapError> {
        let channels = &scene.channels;
        let mut open = |on: bool, topic: &str, schema: (&str, &str, &[u8])| {
            if !on {
                return Ok(0);
            }
            let schema = writer.add_schema(schema.0, schema.1, schema.2)?;
            writer.add_channel(schema, topic, "protobuf", &BTreeMap::new())
        };
        let own = |name| (name, "protobuf", descriptors(format));
        let lines = SceneUpdate::get_schema().ok_or_else(no_schema)?;
        let lines = (&*lines.name, &*lines.encoding, &*lines.data);
        let cloud = PointCloud::get_schema().ok_or_else(no_schema)?;
        let cloud = (&*cloud.name, &*cloud.encoding, &*cloud.data);
        let contours = channels.contours.is_on();
        Ok(Self {
            particles: open(true, topic::PARTICLES, own("softjam.v1.Particles"))?,
            contours: open(contours, topic::CONTOURS, lines)?,
            vertices: open(contours, topic::VERTICES, cloud)?,
            contacts: open(channels.contacts.is_on(), topic::CONTACTS, lines)?,
            metrics: open(
                channels.metrics.is_on(),
                topic::METRICS,
                own("softjam.v1.Metrics"),
            )?,
            state: open(
                channels.state.is_on(),
                topic::STATE,
                own("softjam.v1.State"),
            )?,
            protocol: open(
                !scene.protocol.is_empty(),
                topic::PROTOCOL,
                own("softjam.v1.Protocol"),
            )?,
        })
    }
}

fn no_schema() -> McapError {
    io::Error::other("a Foxglove message has no schema").into()
}

fn metadata<'a>(name: &str, pairs: impl IntoIterator<Item = (&'a str, String)>) -> Metadata {
    let pairs = pairs.into_iter();
    Metadata {
        name: name.to_owned(),
        metadata: pairs.map(|(key, value)| (key.to_owned(), value)).collect(),
    }
}

fn hex(digest: [u8; 32]) -> String {
    blake3::Hash::from_bytes(digest).to_hex().to_string()
}

/// The system's own reason, where there is one.
fn io_error(error: McapError) -> io::Error {
    match error {
        McapError::Io(source) => source,
        other => io::Error::other(other),
    }
}
