//! What the eye gets, whatever the file: colours of the contours, the force network.

use crate::analysis::Backbone;
use crate::contacts::Contacts;
use crate::domain::Vec2;
use crate::models::droplet::contour::Contours;
use crate::scene::Scene;
use crate::state::{Frame, Packing};
use core::f64::consts::PI;
use std::sync::LazyLock;

/// Red, green, blue.
pub(super) type Rgb = [u8; 3];

/// A colour made darker by the factor `brightness`.
pub(super) fn dimmed(rgb: Rgb, brightness: f64) -> Rgb {
    rgb.map(|part| (brightness * f64::from(part) + 0.5) as u8)
}

/// Contours of the model that each stage of a run has.
pub(super) struct StageContours {
    scene: Scene,
    stage: u32,
    contours: Contours,
}

impl StageContours {
    /// Of a run of `scene`.
    pub fn of(scene: &Scene) -> Self {
        Self {
            scene: scene.clone(),
            stage: 0,
            contours: (scene.stage(0).model).contours(scene.contours, scene.line_tension),
        }
    }

    /// Those for `frame`, with the radii and the box of `packing`.
    pub fn at(&mut self, packing: &Packing, frame: &Frame) -> &mut Contours {
        if frame.stage != self.stage {
            let scene = self.scene.stage(frame.stage);
            let contours = scene.model.contours(scene.contours, scene.line_tension);
            (self.stage, self.contours) = (frame.stage, contours);
        }
        self.contours.tell(packing, frame);
        &mut self.contours
    }
}

/// What is seen of each particle beside its contour.
pub(super) struct Particles {
    /// The pressure `p_i = Σ_j f_ij / 2πR_i` on it (force/length).
    pub pressure: Vec<f64>,
    /// Number of contacts with `f > 0`.
    pub contacts: Vec<u32>,
    /// Whether it is held by its contacts, that is, no rattler.
    pub held: Vec<bool>,
    /// Mean pressure over the particles that have a contact with `f > 0` (force/length).
    pub mean: f64,
}

impl Particles {
    /// The particles of `radii` in `frame`; `backbone` remembers the one before.
    pub fn of(radii: &[f64], frame: &Frame, backbone: &mut Backbone) -> Self {
        let number = radii.len();
        let (mut pressure, mut counts) = (vec![0.0; number], vec![0; number]);
        for (pair, &f) in frame.contacts.iter().zip(&frame.forces) {
            for p in pair.map(|p| p as usize) {
                pressure[p] += f;
                counts[p] += u32::from(f > 0.0);
            }
        }
        for (p, r) in pressure.iter_mut().zip(radii) {
            *p /= 2.0 * PI * r;
        }
        let pressed = counts.iter().filter(|n| **n > 0).count().max(1);
        Self {
            mean: pressure.iter().sum::<f64>() / pressed as f64,
            held: backbone.held(number, &frame.contacts, &frame.forces),
            contacts: counts,
            pressure,
        }
    }

    /// The colour of particle `p`: its pressure relative to the mean; gray if it rattles.
    pub fn color(&self, p: usize) -> Rgb {
        if self.held[p] && self.mean > 0.0 {
            pressure_color(self.pressure[p] / self.mean)
        } else {
            RATTLER
        }
    }

    /// The colours of all particles.
    pub fn colors(&self) -> Vec<Rgb> {
        (0..self.held.len()).map(|p| self.color(p)).collect()
    }
}

/// The largest pressure that colours tell apart, in means.
pub(super) const MOST_PRESSURE: f64 = 2.0;

/// The colour of rattlers, which is not on the colour maps.
pub(super) const RATTLER: Rgb = [170, 170, 170];

/// The colour of a pressure in means: viridis without its darkest quarter, which a black ground swallows.
pub(super) fn pressure_color(relative: f64) -> Rgb {
    VIRIDIS.at(0.25 + 0.75 * (relative / MOST_PRESSURE).clamp(0.0, 1.0))
}

/// The largest force that widths and colours tell apart, in means.
pub(super) const MOST: f64 = 3.0;

/// The contact graph: one segment a contact.
pub(super) struct Network {
    /// From the centre of `i` to the nearest image of `j` (length).
    pub segments: Vec<[Vec2; 2]>,
    /// `f/⟨f⟩`, from 0 to [`MOST`].
    pub relative: Vec<f64>,
    /// Mean undeformed radius (length).
    mean_radius: f64,
}

impl Network {
    /// The network of `contacts` between particles at `positions`.
    pub fn of(positions: &[Vec2], radii: &[f64], contacts: &Contacts<'_>) -> Self {
        let number = contacts.forces.len().max(1) as f64;
        let average = contacts.forces.iter().sum::<f64>() / number;
        let relative = |f: &f64| {
            if average > 0.0 {
                (f / average).clamp(0.0, MOST)
            } else {
                0.0
            }
        };
        let segment = |(c, &[i, _]): (usize, &[u32; 2])| {
            let from = positions[i as usize];
            [from, from - contacts.normals[c] * contacts.distances[c]]
        };
        Self {
            segments: contacts.pairs.iter().enumerate().map(segment).collect(),
            relative: contacts.forces.iter().map(relative).collect(),
            mean_radius: mean(radii),
        }
    }

    /// Half the width of the line of a contact with the relative force `r` (length).
    pub fn half_width(&self, r: f64) -> f64 {
        half_width(self.mean_radius, r)
    }

    /// The colour of a contact with the relative force `r`.
    pub fn color(r: f64) -> Rgb {
        INFERNO.at(0.45 + 0.5 * r / MOST)
    }
}

/// Mean of numbers of which there is at least one.
pub(super) fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

/// Half the width of the line of a contact with the relative force `r`, among particles of `mean_radius` (length).
pub(super) fn half_width(mean_radius: f64, r: f64) -> f64 {
    0.05 * mean_radius * (0.2 + r)
}

/// A colour map in 256 steps: evaluating its spline for every particle and contact of a frame would cost more than
/// drawing them.
struct Shades(LazyLock<[Rgb; 256]>);

impl Shades {
    const fn of(make: fn() -> [Rgb; 256]) -> Self {
        Self(LazyLock::new(make))
    }

    /// The colour at a place between 0 and 1.
    fn at(&self, place: f64) -> Rgb {
        // A conversion saturates.
        self.0[usize::from((255.0 * place + 0.5) as u8)]
    }
}

fn shades(map: colorous::Gradient) -> [Rgb; 256] {
    core::array::from_fn(|k| {
        let c = map.eval_continuous(k as f64 / 255.0);
        [c.r, c.g, c.b]
    })
}

static VIRIDIS: Shades = Shades::of(|| shades(colorous::VIRIDIS));
static INFERNO: Shades = Shades::of(|| shades(colorous::INFERNO));
