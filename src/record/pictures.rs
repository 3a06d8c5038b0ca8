//! What the eye gets: contours and force network as rerun's line strips, with their colours and widths.

use crate::contact::Contacts;
use crate::domain::Vec2;
use crate::droplet::contour::Contours;
use core::f64::consts::PI;
use rerun::{Color, LineStrips2D, Radius};

/// Closed polygons, coloured by the pressure `Σ_j f_ij / 2πR_i` on the particle, relative to the mean over the frame.
pub(super) fn contour_strips(
    contours: &Contours,
    radii: &[f64],
    contacts: &Contacts<'_>,
) -> LineStrips2D {
    let mut pressure = vec![0.0; radii.len()];
    for (&[i, j], f) in contacts.pairs.iter().zip(contacts.forces) {
        pressure[i as usize] += f;
        pressure[j as usize] += f;
    }
    for (p, r) in pressure.iter_mut().zip(radii) {
        *p /= 2.0 * PI * r;
    }
    let mean = pressure.iter().sum::<f64>() / radii.len() as f64;
    let colors = pressure.iter().map(|&p| {
        if p > 0.0 {
            shade(colorous::VIRIDIS, 0.3 + 0.7 * (p / mean / 2.0).min(1.0))
        } else {
            Color::from_rgb(120, 120, 120)
        }
    });
    let colors: Vec<Color> = colors.collect();
    let strips = (0..contours.len()).map(|p| {
        let polygon = contours.polygon(p);
        let closed = polygon.iter().chain(polygon.first());
        closed
            .map(|v| [v.x as f32, v.y as f32])
            .collect::<Vec<[f32; 2]>>()
    });
    LineStrips2D::new(strips).with_colors(colors)
}

/// A segment a contact from the centre of `i` to the nearest image of `j`, width and colour by `f/⟨f⟩`.
pub(super) fn contact_strips(
    positions: &[Vec2],
    radii: &[f64],
    contacts: &Contacts<'_>,
) -> LineStrips2D {
    let number = contacts.forces.len().max(1) as f64;
    let mean = contacts.forces.iter().sum::<f64>() / number;
    let mean_radius = radii.iter().sum::<f64>() / radii.len() as f64;
    let relative: Vec<f64> = contacts
        .forces
        .iter()
        .map(|f| {
            if mean > 0.0 {
                (f / mean).clamp(0.0, 3.0)
            } else {
                0.0
            }
        })
        .collect();
    let strips = contacts.pairs.iter().enumerate().map(|(c, &[i, _])| {
        let from = positions[i as usize];
        let to = from - contacts.normals[c] * contacts.distances[c];
        [[from.x as f32, from.y as f32], [to.x as f32, to.y as f32]]
    });
    let widths = relative
        .iter()
        .map(|&r| Radius::new_scene_units((0.05 * mean_radius * (0.2 + r)) as f32));
    let colors = relative
        .iter()
        .map(|&r| shade(colorous::INFERNO, 0.45 + 0.5 * r / 3.0));
    LineStrips2D::new(strips)
        .with_radii(widths)
        .with_colors(colors)
}

fn shade(map: colorous::Gradient, at: f64) -> Color {
    let c = map.eval_continuous(at);
    Color::from_rgb(c.r, c.g, c.b)
}
