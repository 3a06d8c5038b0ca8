//! The `.rrd` recorder: which entity holds what, and when it is written.
//!
//! | entity | content |
//! | --- | --- |
//! | `/__properties` | what the viewer lists the recording as: number of particles, coverage and start |
//! | `/scene` | the scene as text; `softjam.Scene:toml`, `:format_version`, `:program`, `:bits`, `:from_step`, and `:legs` where the run was changed on its way |
//! | `/world`, `/world/box`, `/world/legend` | y up; the periodic box; what colours and widths mean |
//! | `/world/contours` | particle polygons, coloured by the pressure `p_i = Σ_j f_ij / 2πR_i` on the particle |
//! | `/world/contours/images` | those that cross an edge, at its other side; `softjam.Image:particle` is the particle |
//! | `/world/particles` | a point a particle; `softjam.Particle:numbers` says `p_i` (γ/length), the number of contacts `Z` with `f > 0`, its deepest dent `−min ΔR/R` at a contact, and whether it rattles |
//! | `/world/disks` | the undeformed disks of the frame, hidden until asked for |
//! | `/world/contacts` | a segment a contact between the centres, width and colour by the force; `softjam.Contact:pair`, `:force` (γ), `:overlap` (`δ_ij`, length) |
//! | `/world/contacts/images` | those that cross an edge, at its other side; `softjam.Image:contact` is the contact |
//! | `/metrics/*` | one scalar each |
//! | `/protocol` | what each finished stage of a protocol has come to: `softjam.Protocol:act`, `:phi`, `:strain`, `:pressure`, `:stress`, `:coordination`, `:phi_j` |
//! | `/particles` | `softjam.Particles:radius`, `:box` (the sides) |
//! | `/state` | `softjam.State:position`, `:velocity`, `:contact`, `:force`, `:minimizer`, `:digest`, lossless; `:memory`, `:box`, `:stage`, `:protocol` where a run has them |
//! | `/result` | `softjam.Result:converged`, `:steps`, `:f_max`, `:digest`; its absence means an unfinished run |
//!
//! Images, points and disks belong to the channel of the contours or contacts that they stand beside, which are instance by
//! instance the particles and the contacts of the state.
//!
//! Rows are gathered into chunks of some megabytes, so that a viewer reads few of them; all channels of a batch of
//! steps are written together, the state last.

use super::columns::{Column, StripRows, array, lists};
use super::encode::Encoder;
use super::header::EDGE;
use super::hover::{ContactRows, ParticleRows};
use super::images::ImageRows;
use super::rows::{Batch, MetricRow, Rows};
use super::{Header, Outcome, Recorder, Snapshot, Written, blueprint, header, id_of, legs_to_text};
use crate::analysis::METRICS;
use crate::domain::Domain;
use crate::protocol::StageEnd;
use rerun::external::arrow::array::{
    BooleanArray, Float64Array, StringArray, UInt8Array, UInt64Array,
};
use rerun::external::arrow::buffer::OffsetBuffer;
use rerun::external::re_log_types::StoreId;
use rerun::log::{Chunk, RowId};
use rerun::{DynamicArchetype, Scalars, TimeColumn, TimePoint, Timeline};
use std::io::{self, Write};

/// Writes snapshots as an `.rrd` stream.
///
/// # Example
///
/// Two runs of one scene give the same bytes:
///
/// ```
/// use softjam::{record::{Header, Recorder as _, RrdRecorder, Snapshot}, protocol::Relaxation, scene::Scene};
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
    rows: Rows,
    chunks: Chunks<W>,
}

impl<W: Write> RrdRecorder<W> {
    /// Starts a recording: blueprint, scene, box, radii.
    ///
    /// # Errors
    ///
    /// Whatever `sink` fails with.
    pub fn new(sink: W, header: Header) -> io::Result<Self> {
        let legs = legs_to_text(&header.legs)?;
        let recording = id_of(header.digest(), legs.as_deref());
        Self::start(Encoder::new(sink)?, header, &recording)
    }

    /// The same messages under another id, for a viewer that takes them as they come.
    pub(super) fn live(sink: W, header: Header, recording: &str) -> io::Result<Self> {
        Self::start(Encoder::unlisted(sink)?, header, recording)
    }

    fn start(mut encoder: Encoder<W>, header: Header, recording: &str) -> io::Result<Self> {
        blueprint::write(&mut encoder, recording, &header.scene)?;
        let store = StoreId::recording(env!("CARGO_PKG_NAME"), recording);
        encoder.open(&store)?;
        encoder.number_from(header.from_step);
        header::write(&mut encoder, &store, &header)?;
        Ok(Self {
            rows: Rows::new(header),
            chunks: Chunks {
                encoder,
                store,
                intact: None,
            },
        })
    }

    /// What draws, and what writes what was drawn.
    pub(super) fn split(self) -> (Rows, Chunks<W>) {
        (self.rows, self.chunks)
    }

    /// Whether no batch is at hand.
    pub(super) fn is_empty(&self) -> bool {
        self.rows.is_empty()
    }

    /// Writes the batch at hand.
    pub(super) fn flush(&mut self) -> io::Result<()> {
        self.chunks.write(self.rows.batch())
    }
}

/// Writes batches of rows as chunks.
pub(super) struct Chunks<W> {
    encoder: Encoder<W>,
    store: StoreId,
    intact: Option<u64>,
}

impl<W: Write> Chunks<W> {
    /// The last step that the sink holds in full.
    pub fn intact(&self) -> Option<u64> {
        self.intact
    }

    /// Bytes of whole messages.
    pub fn written(&self) -> u64 {
        self.encoder.written()
    }

    /// Writes a batch, the states last.
    pub fn write(&mut self, batch: Batch) -> io::Result<()> {
        self.write_particles(batch.contours, batch.contour_images, batch.particles)?;
        self.write_contacts(batch.contacts, batch.contact_images, batch.contact_numbers)?;
        self.write_metrics(&batch.metrics)?;
        self.write_boxes(&batch.boxes)?;
        self.write_stages(&batch.stages)?;
        let times = batch.states.times.clone();
        self.write_columns("/state", &times, batch.states.into_columns()?)?;
        self.intact = batch.last.or(self.intact);
        Ok(())
    }

    /// Writes the outcome, unless there is none, and the end; `states` were recorded.
    pub fn finish(
        &mut self,
        outcome: Option<Outcome>,
        (states, digest): (u64, [u8; 32]),
    ) -> io::Result<Written> {
        if let Some(outcome) = outcome {
            let mut result = DynamicArchetype::new("softjam.Result")
                .with_component_from_data(
                    "converged",
                    array(BooleanArray::from(vec![outcome.converged])),
                )
                .with_component_from_data("steps", array(UInt64Array::from(vec![outcome.steps])))
                .with_component_from_data("f_max", array(Float64Array::from(vec![outcome.f_max])))
                .with_component_from_data("digest", array(UInt8Array::from(digest.to_vec())));
            if let Some(stability) = outcome.stability {
                let name = array(StringArray::from(vec![stability.name()]));
                result = result.with_component_from_data("stability", name);
            }
            self.encoder
                .single(&self.store, "/result", TimePoint::default(), &result)?;
        }
        self.encoder.finish()?;
        Ok(Written {
            bytes: self.encoder.written(),
            states,
        })
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
        for (k, name) in METRICS.into_iter().enumerate() {
            let of_metric = rows
                .iter()
                .filter_map(|row| Some((row.0, row.1, row.2[k]?)));
            let times: Vec<(u64, i64)> = of_metric.clone().map(|row| (row.0, row.1)).collect();
            if times.is_empty() {
                continue;
            }
            let values = Float64Array::from_iter_values(of_metric.map(|row| row.2));
            let each = OffsetBuffer::from_lengths(core::iter::repeat_n(1, times.len()));
            let column = lists(each, array(values));
            let columns = vec![(Scalars::descriptor_scalars(), column)];
            self.write_columns(&format!("/metrics/{name}"), &times, columns)?;
        }
        Ok(())
    }

    /// Writes what finished stages have come to.
    fn write_stages(&mut self, stages: &[(u64, i64, StageEnd)]) -> io::Result<()> {
        for (step, nanoseconds, end) in stages {
            let number = |x: f64| array(Float64Array::from(vec![x]));
            let act = array(StringArray::from(vec![end.act]));
            let mut row = DynamicArchetype::new("softjam.Protocol")
                .with_component_from_data("act", act)
                .with_component_from_data("phi", number(end.phi))
                .with_component_from_data("strain", number(end.strain))
                .with_component_from_data("pressure", number(end.pressure))
                .with_component_from_data("coordination", number(end.coordination))
                .with_component_from_data("stress", array(Float64Array::from(end.stress.to_vec())));
            if let Some(jamming) = end.jamming {
                row = row.with_component_from_data("phi_j", number(jamming.phi_j));
            }
            let time = TimePoint::default()
                .with(Timeline::new_sequence("step"), *step as i64)
                .with(Timeline::new_duration("sim_time"), *nanoseconds);
            self.encoder.single(&self.store, "/protocol", time, &row)?;
        }
        Ok(())
    }

    /// Writes the boxes of a recording whose box changes.
    fn write_boxes(&mut self, boxes: &[(u64, i64, Domain)]) -> io::Result<()> {
        let times: Vec<(u64, i64)> = boxes.iter().map(|row| (row.0, row.1)).collect();
        let mut rows = StripRows::default();
        for (step, nanoseconds, domain) in boxes {
            let corners = domain.corners().map(|v| [v.x as f32, v.y as f32]);
            rows.strip(corners, EDGE);
            rows.end_row(*step, *nanoseconds);
        }
        self.write_columns("/world/box", &times, rows.into_columns()?)
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
        match self.rows.take(snapshot) {
            Some(batch) => self.chunks.write(batch),
            None => Ok(()),
        }
    }

    fn intact(&self) -> Option<u64> {
        self.chunks.intact()
    }

    fn written(&self) -> u64 {
        self.chunks.written()
    }

    fn finish(&mut self, outcome: Option<Outcome>) -> io::Result<Written> {
        self.flush()?;
        self.chunks.finish(outcome, self.rows.states())
    }
}
