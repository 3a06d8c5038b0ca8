//! The `.rrd` recorder: which entity holds what, and when it is written.
//!
//! | entity | content |
//! | --- | --- |
//! | `/__properties` | what the viewer lists the recording as: number of particles, coverage and start |
//! | `/scene` | the scene as text; `softjam.Scene:toml`, `:format_version`, `:program`, `:from_step` |
//! | `/world`, `/world/box`, `/world/legend` | y up; the periodic box; what colours and widths mean |
//! | `/world/contours` | particle polygons, coloured by the pressure `p_i = Σ_j f_ij / 2πR_i` on the particle |
//! | `/world/contours/images` | those that cross an edge, at its other side; `softjam.Image:particle` is the particle |
//! | `/world/particles` | a point a particle; `softjam.Particle:numbers` says `p_i` (γ/length), the number of contacts `Z` with `f > 0`, its deepest dent `−min ΔR/R` at a contact, and whether it rattles |
//! | `/world/disks` | the undeformed disks of the frame, hidden until asked for |
//! | `/world/contacts` | a segment a contact between the centres, width and colour by the force; `softjam.Contact:pair`, `:force` (γ), `:overlap` (`δ_ij`, length) |
//! | `/world/contacts/images` | those that cross an edge, at its other side; `softjam.Image:contact` is the contact |
//! | `/metrics/*` | one scalar each |
//! | `/particles` | `softjam.Particles:radius`, `:box` (the sides) |
//! | `/state` | `softjam.State:position`, `:velocity`, `:contact`, `:force`, `:minimizer`, `:digest`, lossless |
//! | `/result` | `softjam.Result:converged`, `:steps`, `:f_max`, `:digest`; its absence means an unfinished run |
//!
//! Images, points and disks belong to the channel of the contours or contacts that they stand beside, which are instance by
//! instance the particles and the contacts of the state.
//!
//! Rows are gathered into chunks of about two megabytes, so that a viewer reads few of them; all channels of a batch of
//! steps are written together, the state last.

use super::columns::{Column, StripRows, array, lists};
use super::encode::Encoder;
use super::hover::{ContactRows, ParticleRows};
use super::images::{ImageRows, is_within, shifts_of_polygon, shifts_of_segment};
use super::pictures::{Network, Particles};
use super::states::StateRows;
use super::{Header, Outcome, Recorder, Snapshot, Written, blueprint, header, recording_id};
use crate::contact::{Contacts, FrameContacts};
use crate::droplet::contour::Contours;
use crate::force::{METRICS, Metrics};
use crate::frame::Frame;
use crate::packing::Packing;
use rerun::external::arrow::array::{BooleanArray, Float64Array, UInt8Array, UInt64Array};
use rerun::external::arrow::buffer::OffsetBuffer;
use rerun::external::re_log_types::StoreId;
use rerun::log::{Chunk, RowId};
use rerun::{DynamicArchetype, Scalars, TimeColumn, TimePoint};
use std::io::{self, Write};

/// A batch is written when it holds this many bytes or snapshots, or when it has come to span so many steps: a run that
/// is killed loses no more than a batch.
const BATCH_BYTES: usize = 1 << 24;
const BATCH_SNAPSHOTS: usize = 512;
const BATCH_SPAN: u64 = 2048;

/// Writes snapshots as an `.rrd` stream.
///
/// # Example
///
/// Two runs of one scene give the same bytes:
///
/// ```
/// use softjam::{record::{Header, Recorder as _, RrdRecorder, Snapshot}, relax::Relaxation, scene::Scene};
///
/// let scene = Scene { particles: 32, ..Scene::default() };
/// let record = || {
///     let mut run = Relaxation::new(&scene).unwrap();
///     let mut bytes = Vec::new();
///     let mut recorder = RrdRecorder::new(&mut bytes, Header::of(&scene, &run)).unwrap();
///     for _ in 0..20 {
///         if let Some(snapshot) = Snapshot::of(&run, &scene.channels, false) {
///             recorder.record(&snapshot).unwrap();
///         }
///         run.advance().unwrap();
///     }
///     recorder.finish(None).unwrap();
///     drop(recorder);
///     bytes
/// };
/// assert_eq!(record(), record());
/// ```
pub struct RrdRecorder<W> {
    encoder: Encoder<W>,
    store: StoreId,
    packing: Packing,
    line_tension: f64,
    contours: Contours,
    pending: Pending,
    intact: Option<u64>,
    states: u64,
    digests: blake3::Hasher,
}

/// Rows that wait to be written, by entity.
#[derive(Default)]
struct Pending {
    metrics: Vec<MetricRow>,
    contours: StripRows,
    contour_images: ImageRows,
    particles: ParticleRows,
    contacts: StripRows,
    contact_images: ImageRows,
    contact_numbers: ContactRows,
    states: StateRows,
    bytes: usize,
    snapshots: usize,
    first: Option<u64>,
    last: Option<u64>,
}

/// A step, its simulated time in nanoseconds and its metrics.
type MetricRow = (u64, i64, Metrics);

impl<W: Write> RrdRecorder<W> {
    /// Starts a recording: blueprint, scene, box, radii.
    ///
    /// # Errors
    ///
    /// Whatever `sink` fails with.
    ///
    /// See the example of [`RrdRecorder`].
    pub fn new(sink: W, header: Header) -> io::Result<Self> {
        let recording = recording_id(&header.scene);
        Self::start(Encoder::new(sink)?, header, &recording)
    }

    /// The same messages under another id, for a viewer that takes them as they come.
    pub(super) fn live(sink: W, header: Header, recording: &str) -> io::Result<Self> {
        Self::start(Encoder::unlisted(sink)?, header, recording)
    }

    fn start(mut encoder: Encoder<W>, header: Header, recording: &str) -> io::Result<Self> {
        blueprint::write(&mut encoder, recording)?;
        let store = StoreId::recording(env!("CARGO_PKG_NAME"), recording);
        encoder.open(&store)?;
        header::write(&mut encoder, &store, &header)?;
        Ok(Self {
            encoder,
            store,
            line_tension: header.scene.line_tension,
            contours: Contours::new(header.scene.contours),
            packing: header.packing,
            pending: Pending::default(),
            intact: None,
            states: 0,
            digests: blake3::Hasher::new(),
        })
    }

    fn record_frame(&mut self, snapshot: &Snapshot, frame: &Frame) {
        if snapshot.contours || snapshot.contacts {
            let contacts = FrameContacts::of(&self.packing, frame);
            if snapshot.contours {
                self.draw_particles(snapshot, frame, &contacts.view());
            }
            if snapshot.contacts {
                self.draw_contacts(snapshot, frame, &contacts.view());
            }
        }
        if snapshot.state {
            let digest = frame.digest();
            self.digests.update(&digest);
            self.states += 1;
            self.pending
                .states
                .row(snapshot.nanoseconds, frame, &digest);
            self.pending.bytes += 32 * frame.positions.len() + 16 * frame.contacts.len();
        }
    }

    fn draw_particles(&mut self, snapshot: &Snapshot, frame: &Frame, contacts: &Contacts<'_>) {
        let (step, nanoseconds) = (snapshot.step, snapshot.nanoseconds);
        let (domain, radii) = (self.packing.domain(), self.packing.radii());
        let seen = Particles::of(radii, contacts);
        let Pending {
            contours,
            contour_images: images,
            particles,
            ..
        } = &mut self.pending;
        let line_tension = self.line_tension;
        let drawing = (&mut self.contours, radii, frame, contacts, line_tension);
        let vertices = contours.contours(drawing, |p, polygon, extent| {
            let (color, centre) = (seen.color(p), frame.positions[p]);
            if !is_within(domain, centre, extent.reach) {
                shifts_of_polygon(domain, polygon, |shift| {
                    images.image(polygon, shift, color, p);
                });
            }
            particles.particle(
                (&seen, p),
                (centre, color),
                extent.deepest / radii[p],
                line_tension,
            );
            color
        });
        contours.end_row(step, nanoseconds);
        images.end_row(step, nanoseconds);
        particles.end_row();
        self.pending.bytes += 8 * vertices + 64 * radii.len();
    }

    fn draw_contacts(&mut self, snapshot: &Snapshot, frame: &Frame, contacts: &Contacts<'_>) {
        let (step, nanoseconds) = (snapshot.step, snapshot.nanoseconds);
        let network = Network::of(&frame.positions, self.packing.radii(), contacts);
        let domain = self.packing.domain();
        let Pending {
            contacts: rows,
            contact_images: images,
            contact_numbers: numbers,
            ..
        } = &mut self.pending;
        rows.network(&network);
        for (c, (segment, &relative)) in network.segments.iter().zip(&network.relative).enumerate()
        {
            shifts_of_segment(domain, segment, |shift| {
                let single = segment.map(|v| [v.x as f32, v.y as f32]);
                images.image(&single, shift, Network::color(relative), c);
                images.strips.half_width(network.half_width(relative));
            });
        }
        rows.end_row(step, nanoseconds);
        images.end_row(step, nanoseconds);
        numbers.row(contacts, self.line_tension);
        self.pending.bytes += 40 * contacts.pairs.len();
    }

    /// Whether no batch is at hand.
    pub(super) fn is_empty(&self) -> bool {
        self.pending.snapshots == 0
    }

    /// Writes the batch at hand.
    pub(super) fn flush(&mut self) -> io::Result<()> {
        let pending = core::mem::take(&mut self.pending);
        self.pending = Pending {
            contours: StripRows::with_room_of(&pending.contours),
            contour_images: ImageRows::with_room_of(&pending.contour_images),
            particles: ParticleRows::with_room_of(&pending.particles),
            contacts: StripRows::with_room_of(&pending.contacts),
            contact_images: ImageRows::with_room_of(&pending.contact_images),
            contact_numbers: ContactRows::with_room_of(&pending.contact_numbers),
            states: StateRows::with_room_of(&pending.states),
            ..Pending::default()
        };
        self.write_particles(pending.contours, pending.contour_images, pending.particles)?;
        self.write_contacts(
            pending.contacts,
            pending.contact_images,
            pending.contact_numbers,
        )?;
        self.write_metrics(&pending.metrics)?;
        let times = pending.states.times.clone();
        self.write_columns("/state", &times, pending.states.into_columns()?)?;
        self.intact = pending.last.or(self.intact);
        Ok(())
    }

    fn write_particles(
        &mut self,
        contours: StripRows,
        images: ImageRows,
        particles: ParticleRows,
    ) -> io::Result<()> {
        let times = contours.times.clone();
        let (points, disks) = particles.into_columns()?;
        self.write_columns("/world/contours", &times, contours.into_columns()?)?;
        let images = images.into_columns("softjam.Image:particle")?;
        self.write_columns("/world/contours/images", &times, images)?;
        self.write_columns("/world/particles", &times, points)?;
        self.write_columns("/world/disks", &times, disks)
    }

    fn write_contacts(
        &mut self,
        contacts: StripRows,
        images: ImageRows,
        numbers: ContactRows,
    ) -> io::Result<()> {
        let times = contacts.times.clone();
        let mut columns = contacts.into_columns()?;
        columns.extend(numbers.into_columns()?);
        self.write_columns("/world/contacts", &times, columns)?;
        let images = images.into_columns("softjam.Image:contact")?;
        self.write_columns("/world/contacts/images", &times, images)
    }

    fn write_metrics(&mut self, rows: &[MetricRow]) -> io::Result<()> {
        if rows.is_empty() {
            return Ok(());
        }
        let times: Vec<(u64, i64)> = rows.iter().map(|row| (row.0, row.1)).collect();
        for (k, name) in METRICS.into_iter().enumerate() {
            let values = Float64Array::from_iter_values(rows.iter().map(|r| r.2[k]));
            let each = OffsetBuffer::from_lengths(core::iter::repeat_n(1, rows.len()));
            let column = lists(each, array(values));
            let columns = vec![(Scalars::descriptor_scalars(), column)];
            self.write_columns(&format!("/metrics/{name}"), &times, columns)?;
        }
        Ok(())
    }

    /// Writes rows that have been gathered by component; `times` are steps and simulated times in nanoseconds.
    fn write_columns(
        &mut self,
        entity: &str,
        times: &[(u64, i64)],
        columns: Vec<Column>,
    ) -> io::Result<()> {
        if times.is_empty() {
            return Ok(());
        }
        let timelines = [
            TimeColumn::new_sequence("step", times.iter().map(|t| t.0 as i64)),
            TimeColumn::new_duration_nanos("sim_time", times.iter().map(|t| t.1)),
        ];
        let id = self.encoder.chunk_id();
        let row_ids: Vec<RowId> = times.iter().map(|_| self.encoder.row_id()).collect();
        let chunk = Chunk::from_native_row_ids(
            id,
            entity.into(),
            None,
            &row_ids,
            timelines
                .into_iter()
                .map(|t| (*t.timeline().name(), t))
                .collect(),
            columns.into_iter().collect(),
        );
        self.encoder
            .append(&self.store, &chunk.map_err(io::Error::other)?)
    }
}

impl<W: Write> Recorder for RrdRecorder<W> {
    /// Takes a snapshot, which reaches the sink with its batch.
    fn record(&mut self, snapshot: &Snapshot) -> io::Result<()> {
        let nanoseconds = snapshot.nanoseconds;
        if let Some(metrics) = snapshot.metrics {
            self.pending
                .metrics
                .push((snapshot.step, nanoseconds, metrics));
            self.pending.bytes += size_of::<Metrics>();
        }
        if let Some(frame) = &snapshot.frame {
            self.record_frame(snapshot, frame);
        }
        let pending = &mut self.pending;
        pending.snapshots += 1;
        pending.last = Some(snapshot.step);
        let first = *pending.first.get_or_insert(snapshot.step);
        if pending.bytes >= BATCH_BYTES
            || pending.snapshots >= BATCH_SNAPSHOTS
            || snapshot.step.saturating_sub(first) >= BATCH_SPAN
        {
            self.flush()?;
        }
        Ok(())
    }

    fn intact(&self) -> Option<u64> {
        self.intact
    }

    fn written(&self) -> u64 {
        self.encoder.written()
    }

    fn finish(&mut self, outcome: Option<Outcome>) -> io::Result<Written> {
        self.flush()?;
        if let Some(outcome) = outcome {
            let digest = *self.digests.finalize().as_bytes();
            let result = DynamicArchetype::new("softjam.Result")
                .with_component_from_data(
                    "converged",
                    array(BooleanArray::from(vec![outcome.converged])),
                )
                .with_component_from_data("steps", array(UInt64Array::from(vec![outcome.steps])))
                .with_component_from_data("f_max", array(Float64Array::from(vec![outcome.f_max])))
                .with_component_from_data("digest", array(UInt8Array::from(digest.to_vec())));
            self.encoder
                .single(&self.store, "/result", TimePoint::default(), &result)?;
        }
        self.encoder.finish()?;
        Ok(Written {
            bytes: self.encoder.written(),
            states: self.states,
        })
    }
}
