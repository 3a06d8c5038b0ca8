//! What the eye gets, whatever the file: colours of the contours, the force network.

use crate::contact::Contacts;
use crate::domain::Vec2;
use core::f64::consts::PI;
use std::sync::LazyLock;

/// Red, green, blue.
pub(super) type Rgb = [u8; 3];

/// A colour a particle: the pressure `Σ_j f_ij / 2πR_i` on it, relative to the mean over the frame; gray where there is none.
pub(super) fn particle_colors(radii: &[f64], contacts: &Contacts<'_>) -> Vec<Rgb> {
    let mut pressure = vec![0.0; radii.len()];
    for (&[i, j], f) in contacts.pairs.iter().zip(contacts.forces) {
        pressure[i as usize] += f;
        pressure[j as usize] += f;
    }
    for (p, r) in pressure.iter_mut().zip(radii) {
        *p /= 2.0 * PI * r;
    }
    let mean = pressure.iter().sum::<f64>() / radii.len() as f64;
    let color = |&p: &f64| {
        if p > 0.0 {
            VIRIDIS.at(0.3 + 0.7 * (p / mean / 2.0).min(1.0))
        } else {
            [120, 120, 120]
        }
    };
    pressure.iter().map(color).collect()
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
        let mean = contacts.forces.iter().sum::<f64>() / number;
        let relative = |f: &f64| {
            if mean > 0.0 {
                (f / mean).clamp(0.0, MOST)
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
            mean_radius: radii.iter().sum::<f64>() / radii.len() as f64,
        }
    }

    /// Half the width of the line of a contact with the relative force `r` (length).
    pub fn half_width(&self, r: f64) -> f64 {
        0.05 * self.mean_radius * (0.2 + r)
    }

    /// The colour of a contact with the relative force `r`.
    pub fn color(r: f64) -> Rgb {
        INFERNO.at(0.45 + 0.5 * r / MOST)
    }
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
