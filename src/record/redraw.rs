//! Which pictures would look like the ones before them, and need not be drawn again.
//!
//! Near balance nothing moves that an eye could see, and pictures are most of a recording's bytes. So a picture is left out
//! as long as the one before it is right to [`Channels::redraw`](crate::scene::Channels::redraw); the viewers show the
//! latest one. The states are untouched by it. What is left out depends on the scheduled frames alone, so two runs of a
//! scene and a conversion leave out the same.

use super::pictures::{Particles, mean};
use super::{Header, Snapshot};
use crate::analysis::Backbone;
use crate::domain::{Domain, Vec2};
use crate::numerics::exact_sum::sum_of_forces;
use crate::numerics::wide::wide;
use crate::state::Frame;

/// How much more a pressure or a force may change, in means, than a particle may move, in mean radii: at the default of 0.01
/// this is less than four hundredths of a colour map, and moves the edge of a line by half a hundredth of a radius.
const SHARE: f64 = 10.0;

/// Decides for each frame, in order, which of its pictures are drawn.
pub(super) struct Redraw {
    domain: Domain,
    radii: Vec<f64>,
    /// How far a particle may have moved (length).
    distance: f64,
    /// By how much a pressure or a force may have changed (means).
    share: f64,
    backbone: Backbone,
    particles: Option<DrawnParticles>,
    contacts: Option<DrawnContacts>,
}

/// What the last picture of the particles shows.
struct DrawnParticles {
    positions: Vec<Vec2>,
    pressure: Vec<f64>,
    held: Vec<bool>,
}

/// What the last picture of the contacts shows.
struct DrawnContacts {
    positions: Vec<Vec2>,
    pairs: Vec<[u32; 2]>,
    forces: Vec<f64>,
}

impl Redraw {
    /// For the recording that `header` begins.
    pub fn new(header: &Header) -> Self {
        let (packing, redraw) = (&header.packing, header.scene.channels.redraw);
        Self {
            domain: packing.domain(),
            radii: packing.radii().to_vec(),
            distance: redraw * mean(packing.radii()),
            share: SHARE * redraw,
            backbone: Backbone::default(),
            particles: None,
            contacts: None,
        }
    }

    /// Pictures of another box are drawn anew.
    pub fn enter(&mut self, domain: Domain) {
        if domain != self.domain {
            (self.domain, self.particles, self.contacts) = (domain, None, None);
        }
    }

    /// What is seen of the particles of `frame`, if they have to be drawn for `snapshot`.
    pub fn particles(&mut self, snapshot: &Snapshot, frame: &Frame) -> Option<Particles> {
        if !snapshot.contours {
            return None;
        }
        let now = Particles::of(&self.radii, frame, &mut self.backbone);
        let stays = self.particles.as_ref().is_some_and(|before| {
            let most = self.share * now.mean;
            before.held == now.held
                && within(&before.pressure, &now.pressure, most)
                && self.stand(&before.positions, &frame.positions)
        });
        if stays && !snapshot.edge {
            return None;
        }
        self.particles = Some(DrawnParticles {
            positions: frame.positions.clone(),
            pressure: now.pressure.clone(),
            held: now.held.clone(),
        });
        Some(now)
    }

    /// Whether the contacts of `frame` have to be drawn for `snapshot`.
    pub fn contacts(&mut self, snapshot: &Snapshot, frame: &Frame) -> bool {
        if !snapshot.contacts {
            return false;
        }
        let stays = self.contacts.as_ref().is_some_and(|before| {
            let number = frame.forces.len().max(1) as f64;
            let most = self.share * sum_of_forces(&frame.forces).1 / number;
            self.stand(&before.positions, &frame.positions) && before.bears_as(frame, most)
        });
        if stays && !snapshot.edge {
            return false;
        }
        self.contacts = Some(DrawnContacts {
            positions: frame.positions.clone(),
            pairs: frame.contacts.clone(),
            forces: frame.forces.clone(),
        });
        true
    }

    /// Whether no particle has moved too far.
    fn stand(&self, before: &[Vec2], now: &[Vec2]) -> bool {
        let (domain, most) = (self.domain, self.distance * self.distance);
        // At 0 a picture is left out for no reason, however alike.
        self.distance > 0.0
            && all(
                before,
                now,
                #[inline(always)]
                |a: &Vec2, b: &Vec2| {
                    let [x, y] = domain.fold([b.x - a.x, b.y - a.y]);
                    x * x + y * y <= most
                },
            )
    }
}

impl DrawnContacts {
    /// Whether the forces of `frame` differ by no more than `most`; a pair without a contact bears none.
    fn bears_as(&self, frame: &Frame, most: f64) -> bool {
        if self.pairs == frame.contacts {
            return within(&self.forces, &frame.forces, most);
        }
        let mut before = self.pairs.iter().zip(&self.forces).peekable();
        for (pair, force) in frame.contacts.iter().zip(&frame.forces) {
            while let Some((_, gone)) = before.next_if(|(p, _)| *p < pair) {
                if *gone > most {
                    return false;
                }
            }
            let same = before.next_if(|(p, _)| *p == pair);
            if (force - same.map_or(0.0, |(_, f)| *f)).abs() > most {
                return false;
            }
        }
        before.all(|(_, gone)| *gone <= most)
    }
}

/// Whether numbers differ by no more than `most`.
fn within(a: &[f64], b: &[f64], most: f64) -> bool {
    all(
        a,
        b,
        #[inline(always)]
        |a: &f64, b: &f64| (a - b).abs() <= most,
    )
}

/// Whether all are `near` their counterparts: piece after piece, each without a branch.
fn all<T>(a: &[T], b: &[T], near: impl Fn(&T, &T) -> bool) -> bool {
    let mut pieces = a.chunks(64).zip(b.chunks(64));
    pieces.all(|(a, b)| {
        wide(
            #[inline(always)]
            || a.iter().zip(b).fold(true, |all, (a, b)| all & near(a, b)),
        )
    })
}
