//! The `.rrd` recorder: which entity holds what, and when it is written.
//!
//! | entity | content |
//! | --- | --- |
//! | `/scene` | the scene as text; `softjam.Scene:toml`, `:format_version`, `:program`, `:from_step` |
//! | `/world`, `/world/box` | y up; the periodic box |
//! | `/world/contours` | particle polygons, coloured by the pressure on the particle |
//! | `/world/contacts` | a segment a contact between the centres, width and colour by the force |
//! | `/metrics/*` | one scalar each |
//! | `/particles` | `softjam.Particles:radius`, `:box` (the sides) |
//! | `/state` | `softjam.State:position`, `:velocity`, `:contact`, `:force`, `:minimizer`, `:digest`, lossless |
//! | `/result` | `softjam.Result:converged`, `:steps`, `:f_max`, `:digest`; its absence means an unfinished run |
//!
//! Rows are gathered into chunks of about two megabytes, so that a viewer reads few of them; all channels of a batch of
//! steps are written together, the state last.

use super::columns::{Column, StripRows, array, lists};
use super::encode::Encoder;
use super::pictures::Network;
use super::states::StateRows;
use super::{
    FORMAT_VERSION, Header, Outcome, PROGRAM, Recorder, Snapshot, Written, blueprint, recording_id,
};
use crate::contact::FrameContacts;
use crate::droplet::contour::Contours;
use crate::force::{METRICS, Metrics};
use crate::frame::Frame;
use crate::packing::Packing;
use rerun::external::arrow::array::{
    BooleanArray, Float64Array, StringArray, UInt8Array, UInt32Array, UInt64Array,
};
use rerun::external::arrow::buffer::OffsetBuffer;
use rerun::external::re_log_types::StoreId;
use rerun::log::{Chunk, RowId};
use rerun::{
    AsComponents, Color, DynamicArchetype, LineStrips2D, Radius, Scalars, TextDocument, TimeColumn,
    TimePoint, Transform3D,
};
use std::io::{self, Write};

/// A batch is written when it holds this many bytes or snapshots, or when it has come to span so many steps: a run that
/// is killed loses no more than a batch.
const BATCH_BYTES: usize = 1 << 21;
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
    contacts: StripRows,
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
        blueprint::write(&mut encoder, recording, header.packing.domain())?;
        let store = StoreId::recording(env!("CARGO_PKG_NAME"), recording);
        encoder.open(&store)?;
        write_header(&mut encoder, &store, &header)?;
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
            let contacts = contacts.view();
            let radii = self.packing.radii();
            if snapshot.contours {
                let rows = &mut self.pending.contours;
                let vertices = rows.contours(
                    &mut self.contours,
                    radii,
                    &frame.positions,
                    &contacts,
                    self.line_tension,
                );
                rows.end_row(snapshot.step, snapshot.nanoseconds);
                self.pending.bytes += 8 * vertices;
            }
            if snapshot.contacts {
                let rows = &mut self.pending.contacts;
                rows.network(&Network::of(&frame.positions, radii, &contacts));
                rows.end_row(snapshot.step, snapshot.nanoseconds);
                self.pending.bytes += 24 * contacts.pairs.len();
            }
        }
        if snapshot.state {
            let digest = frame.digest();
            self.digests.update(&digest);
            self.states += 1;
            self.pending
                .states
                .push(snapshot.nanoseconds, frame, &digest);
            self.pending.bytes += 32 * frame.positions.len() + 16 * frame.contacts.len();
        }
    }

    /// Whether no batch is at hand.
    pub(super) fn is_empty(&self) -> bool {
        self.pending.snapshots == 0
    }

    /// Writes the batch at hand.
    pub(super) fn flush(&mut self) -> io::Result<()> {
        let Pending {
            metrics,
            contours,
            contacts,
            states,
            last,
            ..
        } = core::mem::take(&mut self.pending);
        self.pending.contours = StripRows::with_room_of(&contours);
        self.pending.contacts = StripRows::with_room_of(&contacts);
        self.pending.states = StateRows::with_room_of(&states);
        self.write_strips("/world/contours", contours)?;
        self.write_strips("/world/contacts", contacts)?;
        self.write_metrics(&metrics)?;
        let times = states.times.clone();
        self.write_columns("/state", &times, states.into_columns()?)?;
        self.intact = last.or(self.intact);
        Ok(())
    }

    fn write_strips(&mut self, entity: &str, rows: StripRows) -> io::Result<()> {
        let times = rows.times.clone();
        self.write_columns(entity, &times, rows.into_columns()?)
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

/// Scene, axes, box and radii: what does not change.
fn write_header<W: Write>(
    encoder: &mut Encoder<W>,
    store: &StoreId,
    header: &Header,
) -> io::Result<()> {
    let packing = &header.packing;
    let toml = header.scene.to_toml();
    let l = packing.domain().lengths();
    let text = format!(
        "# Deformable particles\n\n\
         Morse–Witten model, recorded by {PROGRAM}.\n\n\
         | | |\n| --- | --- |\n\
         | particles | {} |\n| coverage φ | {:.6} |\n| box | {:.6} × {:.6} |\n| line tension γ | {} |\n| threshold on f_max | {:e} γ |\n\n\
         ```toml\n{toml}```\n",
        packing.len(),
        packing.coverage(),
        l.x,
        l.y,
        header.scene.line_tension,
        header.scene.threshold,
    );
    let document = TextDocument::from_markdown(text);
    let scene = DynamicArchetype::new("softjam.Scene")
        .with_component_from_data("toml", array(StringArray::from(vec![toml])))
        .with_component_from_data(
            "format_version",
            array(UInt32Array::from(vec![FORMAT_VERSION])),
        )
        .with_component_from_data("program", array(StringArray::from(vec![PROGRAM])))
        .with_component_from_data(
            "from_step",
            array(UInt64Array::from(vec![header.from_step])),
        );
    let particles = DynamicArchetype::new("softjam.Particles")
        .with_component_from_data(
            "radius",
            array(Float64Array::from(packing.radii().to_vec())),
        )
        .with_component_from_data("box", array(Float64Array::from(vec![l.x, l.y])));
    // Rerun's 2D views have y down, a packing has it up.
    let up = Transform3D::from_mat3x3([1.0, 0.0, 0.0, 0.0, -1.0, 0.0, 0.0, 0.0, 1.0]);
    let (x, y) = (l.x as f32, l.y as f32);
    let corners = [[0.0, 0.0], [x, 0.0], [x, y], [0.0, y], [0.0, 0.0]];
    let frame = LineStrips2D::new([corners])
        .with_colors([Color::from_rgb(140, 140, 140)])
        .with_radii([Radius::new_ui_points(1.0)]);
    let outline = LineStrips2D::update_fields().with_radii([Radius::new_ui_points(1.1)]);
    let graph = LineStrips2D::update_fields().with_draw_order(31.0);
    let everywhere: [(&str, &dyn AsComponents); 7] = [
        ("/scene", &document),
        ("/scene", &scene),
        ("/particles", &particles),
        ("/world", &up),
        ("/world/box", &frame),
        ("/world/contours", &outline),
        ("/world/contacts", &graph),
    ];
    for (entity, data) in everywhere {
        encoder.single(store, entity, TimePoint::default(), data)?;
    }
    Ok(())
}
