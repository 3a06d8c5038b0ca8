//! The legend at the right of the packing: what colours and widths mean.

use super::Header;
use super::pictures::{MOST, MOST_PRESSURE, Network, Rgb, half_width, mean, pressure_color};
use rerun::{AsComponents, Color, LineStrips2D, Points2D, Radius, SerializedComponentBatch};
use std::io;

/// Pieces of a colour bar.
const PIECES: usize = 48;

/// Hands the legend's entities to `put`.
pub(super) fn write(
    header: &Header,
    mut put: impl FnMut(&str, &dyn AsComponents) -> io::Result<()>,
) -> io::Result<()> {
    let (packing, channels) = (&header.packing, &header.scene.channels);
    let l = packing.domain().lengths().map(|x| x as f32);
    let largest = packing.largest_radius() as f32;
    // What belongs to a particle in the box reaches no further than this beyond its edge.
    let margin = 2.2 * largest;
    // All of it has one height; the two parts stand above each other in the upper and in the lower half.
    let (height, left) = (0.34 * l.y, l.x + margin + 0.05 * l.y);
    let width = 0.035 * l.y;
    let (upper, lower) = (0.56 * l.y, 0.06 * l.y);
    // The view fits what there is: these two strokes, too small to be seen, keep it from fitting each frame anew.
    let (near, far) = ([-margin; 2], [left + 4.0 * width, l.y + margin]);
    let room = LineStrips2D::new([near, far].map(|[x, y]| [[x, y], [x, y + 1e-3 * l.y]]))
        .with_radii([Radius::new_ui_points(0.01)])
        .with_colors([Color::from_rgb(0, 0, 0)]);
    put("/world/legend/room", &room)?;
    if channels.contours.is_on() {
        let at = |k: usize| upper + height * k as f32 / PIECES as f32;
        let bar = LineStrips2D::new((0..PIECES).map(|k| [[left, at(k)], [left, at(k + 1)]]))
            .with_radii([0.5 * width])
            .with_colors((0..PIECES).map(|k| {
                color(pressure_color(
                    MOST_PRESSURE * (k as f64 + 0.5) / PIECES as f64,
                ))
            }));
        let marks = [("0", 0.0), ("1", 0.5), ("≥ 2", 1.0)];
        let scale = scale("p / mean", marks, [left, upper, width, height]);
        put("/world/legend/pressure", &both(&bar, &scale))?;
    }
    if channels.contacts.is_on() {
        let forces = [0.0, 0.5, 1.0, 1.5, 2.0, 2.5, 3.0];
        let mean_radius = mean(packing.radii());
        let lines = forces.map(|f| {
            let y = lower + height * (f / MOST) as f32;
            [[left - width, y], [left + width, y]]
        });
        let lines = LineStrips2D::new(lines)
            .with_radii(forces.map(|f| half_width(mean_radius, f) as f32))
            .with_colors(forces.map(|f| color(Network::color(f))));
        let marks = [("0", 0.0), ("1", 1.0 / 3.0), ("2", 2.0 / 3.0), ("≥ 3", 1.0)];
        let scale = scale("f / mean", marks, [left, lower, width, height]);
        put("/world/legend/force", &both(&lines, &scale))?;
    }
    Ok(())
}

/// A bar and its scale, which make one entity.
fn both(bar: &LineStrips2D, scale: &Points2D) -> Vec<SerializedComponentBatch> {
    let mut parts = bar.as_serialized_batches();
    parts.extend(scale.as_serialized_batches());
    parts
}

fn color([r, g, b]: Rgb) -> Color {
    Color::from_rgb(r, g, b)
}

/// A title above and marks beside a bar at `left`, from `bottom` on, half as wide as `width` and of `height`.
fn scale<const N: usize>(
    title: &str,
    marks: [(&str, f32); N],
    [left, bottom, width, height]: [f32; 4],
) -> Points2D {
    let mut places = vec![[left, bottom + 1.22 * height]];
    places.extend(marks.map(|(_, part)| [left + 2.2 * width, bottom + part * height]));
    let labels = core::iter::once(title).chain(marks.map(|(label, _)| label));
    Points2D::new(places)
        .with_labels(labels)
        .with_show_labels(true)
        .with_radii([Radius::new_ui_points(0.01)])
        .with_colors([color([200, 200, 200])])
}
