//! Rows of all entities, gathered from snapshots until they make a batch.

use super::columns::StripRows;
use super::hover::{ContactRows, ParticleRows};
use super::images::{ImageRows, is_within, seats, shifts_of_polygon, shifts_of_segment};
use super::patience::Patience;
use super::pictures::{Network, Particles, StageContours};
use super::redraw::Redraw;
use super::states::StateRows;
use super::{Header, Snapshot};
use crate::analysis::Metrics;
use crate::contacts::{Contacts, FrameContacts};
use crate::domain::Domain;
use crate::protocol::StageEnd;
use crate::state::Frame;
use crate::state::Packing;

/// A batch is written when it holds this many bytes (twice as many if they are but a few snapshots, for each chunk costs time whatever
/// it holds) or snapshots, when it has come to span so many steps, or when the steps up to the next snapshot come to so many moves of
/// a particle, which is some 0.4 s: a run that is killed loses no more than two batches and what waits for them. The first
/// snapshot is a batch of its own, so that from then on there is a state to go on from.
const BATCH_BYTES: usize = 1 << 22;
const FEW_SNAPSHOTS: usize = 16;
const BATCH_SNAPSHOTS: usize = 512;
const BATCH_SPAN: u64 = 2048;
const BATCH_MOVES: u64 = 4_000_000;

/// Turns snapshots into batches of rows.
pub(super) struct Rows {
    packing: Packing,
    line_tension: f64,
    format: u32,
    contours: StageContours,
    redraw: Redraw,
    /// Whether the box is drawn where it changes, and the one drawn last.
    draws_boxes: bool,
    drawn_box: Option<Domain>,
    patience: Patience,
    /// Whether there was a batch.
    begun: bool,
    pending: Batch,
    states: u64,
    digests: blake3::Hasher,
}

/// Rows that wait to be written, by entity.
#[derive(Default)]
pub(super) struct Batch {
    pub metrics: Vec<MetricRow>,
    /// Step, simulated time in nanoseconds and end of each finished stage of a protocol.
    pub stages: Vec<(u64, i64, StageEnd)>,
    /// Step, simulated time in nanoseconds and box, where it changes.
    pub boxes: Vec<(u64, i64, Domain)>,
    pub contours: StripRows,
    pub contour_images: ImageRows,
    pub particles: ParticleRows,
    pub contacts: StripRows,
    pub contact_images: ImageRows,
    pub contact_numbers: ContactRows,
    pub states: StateRows,
    bytes: usize,
    snapshots: usize,
    first: Option<u64>,
    /// The last step.
    pub last: Option<u64>,
}

/// What a row of metrics counts as among the bytes of a batch.
const METRICS_BYTES: usize = 72;

/// A step, its simulated time in nanoseconds and its metrics.
pub(super) type MetricRow = (u64, i64, Metrics);

impl Rows {
    /// Of the recording that `header` begins.
    pub fn new(header: Header) -> Self {
        Self {
            line_tension: header.scene.line_tension,
            format: header.format,
            contours: StageContours::of(&header.scene),
            redraw: Redraw::new(&header),
            draws_boxes: !header.scene.protocol.is_empty(),
            drawn_box: None,
            patience: Patience::of(&header, BATCH_MOVES),
            begun: false,
            packing: header.packing,
            pending: Batch::default(),
            states: 0,
            digests: blake3::Hasher::new(),
        }
    }

    /// Adds a snapshot; the batch if that makes it whole.
    pub fn take(&mut self, snapshot: &Snapshot) -> Option<Batch> {
        let nanoseconds = snapshot.nanoseconds;
        if let Some(metrics) = snapshot.metrics {
            self.pending
                .metrics
                .push((snapshot.step, nanoseconds, metrics));
            self.pending.bytes += METRICS_BYTES;
        }
        let at = |end| (snapshot.step, nanoseconds, end);
        let end = snapshot.stage.as_deref().copied();
        self.pending.stages.extend(end.map(at));
        if let Some(frame) = &snapshot.frame {
            self.record_frame(snapshot, frame);
        }
        let pending = &mut self.pending;
        pending.snapshots += 1;
        pending.last = Some(snapshot.step);
        let first = *pending.first.get_or_insert(snapshot.step);
        let few = pending.snapshots < FEW_SNAPSHOTS;
        let whole = !self.begun
            || pending.bytes >= BATCH_BYTES * if few { 2 } else { 1 }
            || pending.snapshots >= BATCH_SNAPSHOTS
            || snapshot.step.saturating_sub(first) >= BATCH_SPAN
            || self.patience.ends(first, snapshot.step);
        self.begun = true;
        whole.then(|| self.batch())
    }

    /// The batch at hand, which ends with it.
    pub fn batch(&mut self) -> Batch {
        // One batch is like the next, and contours are half of it.
        let next = Batch {
            contours: StripRows::with_room_for(self.pending.contours.vertices()),
            ..Batch::default()
        };
        core::mem::replace(&mut self.pending, next)
    }

    /// Whether no batch is at hand.
    pub fn is_empty(&self) -> bool {
        self.pending.snapshots == 0
    }

    /// How many states were recorded so far, and the digest of their digests.
    pub fn states(&self) -> (u64, [u8; 32]) {
        (self.states, *self.digests.finalize().as_bytes())
    }

    fn record_frame(&mut self, snapshot: &Snapshot, frame: &Frame) {
        if let Some(domain) = frame.domain {
            self.packing.set_domain(domain);
            self.redraw.enter(domain);
        }
        let domain = self.packing.domain();
        if self.draws_boxes && self.drawn_box != Some(domain) {
            let row = (snapshot.step, snapshot.nanoseconds, domain);
            self.pending.boxes.push(row);
            self.drawn_box = Some(domain);
        }
        let particles = self.redraw.particles(snapshot, frame);
        let network = self.redraw.contacts(snapshot, frame);
        if particles.is_some() || network {
            let contacts = FrameContacts::of(&self.packing, frame);
            if let Some(particles) = particles {
                self.draw_particles(snapshot, frame, &particles, &contacts.view());
            }
            if network {
                self.draw_contacts(snapshot, frame, &contacts.view());
            }
        }
        if snapshot.state {
            let digest = frame.digest();
            self.digests.update(&digest);
            self.states += 1;
            self.pending
                .states
                .row(snapshot.nanoseconds, frame, &digest, self.format);
            self.pending.bytes += frame.bytes();
        }
    }

    fn draw_particles(
        &mut self,
        snapshot: &Snapshot,
        frame: &Frame,
        seen: &Particles,
        contacts: &Contacts<'_>,
    ) {
        let (step, nanoseconds) = (snapshot.step, snapshot.nanoseconds);
        let (domain, radii) = (self.packing.domain(), self.packing.radii());
        let positions = &*seats(domain, &frame.positions);
        let Batch {
            contours,
            contour_images: images,
            particles,
            ..
        } = &mut self.pending;
        let line_tension = self.line_tension;
        let drawing = (
            self.contours.at(&self.packing, frame),
            radii,
            positions,
            contacts,
            line_tension,
        );
        let vertices = contours.contours(drawing, |p, polygon, extent| {
            let (color, centre) = (seen.color(p), positions[p]);
            if !is_within(domain, centre, extent.reach) {
                shifts_of_polygon(domain, polygon, |shift| {
                    images.image(polygon, shift, color, p);
                });
            }
            particles.particle(
                (seen, p),
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
        let domain = self.packing.domain();
        let positions = seats(domain, &frame.positions);
        let network = Network::of(&positions, self.packing.radii(), contacts);
        let Batch {
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
}
