//! The pictures as Foxglove draws them without a plugin: contours and contacts as lines, the vertices as a point cloud.

use super::messages::STEP_NANOSECONDS;
use super::pictures::{MOST, Network, Rgb};
use crate::domain::Vec2;
use crate::models::droplet::contour::Contours;
use foxglove::messages::line_primitive::Type;
use foxglove::messages::packed_element_field::NumericType;
use foxglove::messages::{
    Color, LinePrimitive, PackedElementField, Point3, PointCloud, Pose, Quaternion, SceneEntity,
    SceneUpdate, Timestamp, Vector3,
};

/// The frame of reference that everything is drawn in.
const FRAME: &str = "world";
/// Width of an outline (pixels).
const OUTLINE: f64 = 1.5;
/// Contacts lie above the contours (length).
const ABOVE: f64 = 0.01;
/// A line has one width in Foxglove, so contacts are gathered by their force into this many lines.
const WIDTHS: usize = 12;

/// The log time of a step as a time of day.
fn timestamp(step: u64) -> Option<Timestamp> {
    let nanoseconds = step.saturating_mul(STEP_NANOSECONDS);
    let seconds = u32::try_from(nanoseconds / 1_000_000_000).unwrap_or(u32::MAX);
    Timestamp::new_checked(seconds, (nanoseconds % 1_000_000_000) as u32)
}

/// One entity whose lines replace those of the step before.
fn update(step: u64, id: &str, lines: Vec<LinePrimitive>) -> SceneUpdate {
    SceneUpdate {
        deletions: Vec::new(),
        entities: vec![SceneEntity {
            timestamp: timestamp(step),
            frame_id: FRAME.to_owned(),
            id: id.to_owned(),
            lines,
            ..SceneEntity::default()
        }],
    }
}

/// A picture needs no more than single precision, and the zeros behind it pack well.
fn point(v: Vec2, z: f64) -> Point3 {
    Point3 {
        x: f64::from(v.x as f32),
        y: f64::from(v.y as f32),
        z,
    }
}

fn color([r, g, b]: Rgb) -> Color {
    let part = |c: u8| f64::from(c) / 255.0;
    Color {
        r: part(r),
        g: part(g),
        b: part(b),
        a: 1.0,
    }
}

/// The particles, a closed line each.
pub(super) fn contour_lines(step: u64, contours: &Contours, colors: &[Rgb]) -> SceneUpdate {
    let lines = colors.iter().enumerate().map(|(p, &rgb)| LinePrimitive {
        r#type: Type::LineLoop.into(),
        thickness: OUTLINE,
        scale_invariant: true,
        points: contours.polygon(p).iter().map(|v| point(*v, 0.0)).collect(),
        color: Some(color(rgb)),
        ..LinePrimitive::default()
    });
    update(step, "contours", lines.collect())
}

/// The contact graph, a list of segments for each width.
pub(super) fn contact_lines(step: u64, network: &Network) -> SceneUpdate {
    let mut lines: Vec<LinePrimitive> = (0..WIDTHS)
        .map(|k| {
            let middle = (k as f64 + 0.5) * MOST / WIDTHS as f64;
            LinePrimitive {
                r#type: Type::LineList.into(),
                thickness: 2.0 * network.half_width(middle),
                ..LinePrimitive::default()
            }
        })
        .collect();
    for (segment, &relative) in network.segments.iter().zip(&network.relative) {
        let k = (relative / MOST * WIDTHS as f64) as usize;
        let line = &mut lines[k.min(WIDTHS - 1)];
        line.points.extend(segment.map(|v| point(v, ABOVE)));
        line.colors.extend([color(Network::color(relative)); 2]);
    }
    lines.retain(|line| !line.points.is_empty());
    update(step, "contacts", lines)
}

/// The vertices of all contours: what the rerun viewer draws of an MCAP file.
pub(super) fn vertex_cloud(step: u64, contours: &Contours, colors: &[Rgb]) -> PointCloud {
    let field = |name: &str, offset, r#type: NumericType| PackedElementField {
        name: name.to_owned(),
        offset,
        r#type: r#type.into(),
    };
    let mut data = Vec::with_capacity(16 * contours.vertices());
    for (p, &[r, g, b]) in colors.iter().enumerate() {
        for v in contours.polygon(p) {
            for x in [v.x as f32, v.y as f32, 0.0] {
                data.extend_from_slice(&x.to_le_bytes());
            }
            data.extend_from_slice(&[r, g, b, 255]);
        }
    }
    PointCloud {
        timestamp: timestamp(step),
        frame_id: FRAME.to_owned(),
        pose: Some(Pose {
            position: Some(Vector3::default()),
            orientation: Some(Quaternion {
                w: 1.0,
                ..Quaternion::default()
            }),
        }),
        point_stride: 16,
        fields: vec![
            field("x", 0, NumericType::Float32),
            field("y", 4, NumericType::Float32),
            field("z", 8, NumericType::Float32),
            field("red", 12, NumericType::Uint8),
            field("green", 13, NumericType::Uint8),
            field("blue", 14, NumericType::Uint8),
            field("alpha", 15, NumericType::Uint8),
        ],
        data: data.into(),
    }
}
