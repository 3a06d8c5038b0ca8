//! What the viewer gets beside the state: held against the recorded states by formulas of the tests' own.

use crate::files::{record_as, states};
use rerun::external::re_log_encoding::Decoder;
use rerun::external::re_log_types::LogMsg;
use rerun::log::Chunk;
use softjam::contacts::{Contacts, FrameContacts};
use softjam::domain::Vec2;
use softjam::models::droplet::contour::Contours;
use softjam::protocol::Relaxation;
use softjam::record::Format;
use softjam::scene::{Channels, Scene, Schedule};
use softjam::state::Frame;
use softjam::state::Packing;
use std::collections::BTreeMap;
use std::f64::consts::PI;
use std::io::Cursor;

/// A small box, so that much crosses its edges, in units in which γ is not 1; loose enough for rattlers.
fn scene() -> Scene {
    Scene {
        particles: 40,
        phi: 0.845,
        seed: 3,
        steps: 40,
        line_tension: 2.5,
        channels: Channels {
            contours: Schedule::Every(20),
            contacts: Schedule::Every(20),
            state: Schedule::Every(20),
            ..Channels::default()
        },
        ..Scene::default()
    }
}

/// The chunks of a recording by entity.
fn chunks(bytes: &[u8]) -> BTreeMap<String, Vec<Chunk>> {
    let mut chunks: BTreeMap<String, Vec<Chunk>> = BTreeMap::new();
    for message in Decoder::<LogMsg>::decode_eager(Cursor::new(bytes)).expect("a stream") {
        if let LogMsg::ArrowMsg(store, message) = message.expect("a message")
            && store.is_recording()
        {
            let chunk = Chunk::from_arrow_msg(&message).expect("a chunk");
            let entity = chunk.entity_path().to_string();
            chunks.entry(entity).or_default().push(chunk);
        }
    }
    chunks
}

/// All rows of a component that change with time.
macro_rules! rows {
    ($chunks:expr, $entity:literal, $component:literal, $of:ty) => {{
        let all = $chunks[$entity].iter().filter(|chunk| !chunk.is_static());
        all.flat_map(|chunk| chunk.iter_slices::<$of>($component.into()))
            .map(|row| row.to_vec())
            .collect::<Vec<_>>()
    }};
}

/// Every recorded frame with the packing it belongs to and its contacts.
fn frames(scene: &Scene, bytes: &[u8]) -> (Packing, Vec<(Frame, FrameContacts)>) {
    let packing = Relaxation::new(scene).expect("a run").packing().clone();
    let frames: Vec<_> = states(bytes)
        .into_iter()
        .map(|frame| {
            let contacts = FrameContacts::of(&packing, &frame);
            (frame, contacts)
        })
        .collect();
    assert_eq!(frames.len(), 3);
    (packing, frames)
}

fn rounded(v: Vec2) -> Vec2 {
    let [x, y] = single(v);
    Vec2::new(x.into(), y.into())
}

fn single(v: Vec2) -> [f32; 2] {
    [v.x as f32, v.y as f32]
}

/// The eight shifts by a period.
fn shifts(packing: &Packing) -> impl Iterator<Item = Vec2> {
    let l = packing.domain().lengths();
    let steps = [-1.0, 0.0, 1.0];
    steps
        .into_iter()
        .flat_map(move |x| steps.map(|y| Vec2::new(x * l.x, y * l.y)))
        .filter(|shift| *shift != Vec2::zeros())
}

/// Liang and Barsky (1984): whether a piece of the segment lies in the open box.
fn clipped(packing: &Packing, [a, b]: [Vec2; 2]) -> bool {
    let l = packing.domain().lengths();
    let d = b - a;
    let (mut from, mut to) = (0.0_f64, 1.0_f64);
    for (p, q) in [(-d.x, a.x), (d.x, l.x - a.x), (-d.y, a.y), (d.y, l.y - a.y)] {
        if p < 0.0 {
            from = from.max(q / p);
        } else if p > 0.0 {
            to = to.min(q / p);
        } else if q <= 0.0 {
            return false;
        }
    }
    from < to
}

/// Images in an order of their own: number and points.
fn sorted(mut images: Vec<(u32, Vec<[f32; 2]>)>) -> Vec<(u32, Vec<[f32; 2]>)> {
    images.sort_by(|a, b| a.partial_cmp(b).expect("finite"));
    images
}

#[test]
fn what_crosses_an_edge_is_drawn_at_its_other_side_and_nothing_else() {
    let scene = scene();
    let bytes = record_as(Format::Rrd, &scene, |_| {});
    let (packing, frames) = frames(&scene, &bytes);
    let chunks = chunks(&bytes);
    let of = rows!(
        chunks,
        "/world/contours/images",
        "softjam.Image:particle",
        u32
    );
    let strips = rows!(
        chunks,
        "/world/contours/images",
        "LineStrips2D:strips",
        &[[f32; 2]]
    );
    let contact_of = rows!(
        chunks,
        "/world/contacts/images",
        "softjam.Image:contact",
        u32
    );
    let segments = rows!(
        chunks,
        "/world/contacts/images",
        "LineStrips2D:strips",
        &[[f32; 2]]
    );
    let recorded = rows!(
        chunks,
        "/world/contours",
        "LineStrips2D:strips",
        &[[f32; 2]]
    );
    assert_eq!(of.len(), frames.len());
    let l = packing.domain().lengths();
    let inside = |v: Vec2| v.x > 0.0 && v.x < l.x && v.y > 0.0 && v.y < l.y;
    let mut contours = Contours::new(scene.contours);
    let mut corners = 0;
    for (k, (frame, contacts)) in frames.iter().enumerate() {
        let contacts = contacts.view();
        contours.draw(
            packing.radii(),
            &frame.positions,
            &contacts,
            scene.line_tension,
        );
        let mut expected = Vec::new();
        for (p, recorded) in recorded[k].iter().enumerate() {
            // What is recorded is the contour in single precision, and images are those of what is recorded.
            let polygon = recorded
                .iter()
                .map(|[x, y]| Vec2::new((*x).into(), (*y).into()));
            let mut polygon: Vec<Vec2> = polygon.collect();
            assert_eq!(polygon.pop(), polygon.first().copied(), "closed");
            assert_eq!(polygon.len(), contours.polygon(p).len());
            for (v, exact) in polygon.iter().zip(contours.polygon(p)) {
                assert!((v - exact).amax() < 1.5e-6, "{v} {exact}");
            }
            let before = expected.len();
            for shift in shifts(&packing) {
                if polygon.iter().any(|v| inside(v + shift)) {
                    let closed = polygon.iter().chain(polygon.first());
                    expected.push((p as u32, closed.map(|v| single(v + shift)).collect()));
                }
            }
            corners += usize::from(expected.len() - before == 3);
        }
        let found = of[k].iter().zip(&strips[k]);
        let found = found.map(|(p, strip)| (*p, strip.to_vec())).collect();
        assert_eq!(sorted(found), sorted(expected), "step {}", frame.step);

        let mut expected = Vec::new();
        for (c, segment) in lines(frame, &contacts).into_iter().enumerate() {
            for shift in shifts(&packing) {
                let moved = segment.map(|v| rounded(v) + shift);
                if clipped(&packing, moved) {
                    expected.push((c as u32, moved.map(single).to_vec()));
                }
            }
        }
        let found = contact_of[k].iter().zip(&segments[k]);
        let found = found.map(|(c, strip)| (*c, strip.to_vec())).collect();
        assert_eq!(sorted(found), sorted(expected), "step {}", frame.step);
    }
    assert!(of[0].len() > 8 && contact_of[0].len() > 8, "much crosses");
    assert!(corners > 0, "no contour lies across a corner");
}

/// From the centre of `i` to the nearest image of `j`.
fn lines(frame: &Frame, contacts: &Contacts<'_>) -> Vec<[Vec2; 2]> {
    let line = |(c, &[i, _]): (usize, &[u32; 2])| {
        let from = frame.positions[i as usize];
        [from, from - contacts.normals[c] * contacts.distances[c]]
    };
    contacts.pairs.iter().enumerate().map(line).collect()
}

#[test]
fn undeformed_disks_stand_at_the_positions_of_the_frame() {
    let scene = scene();
    let bytes = record_as(Format::Rrd, &scene, |_| {});
    let (packing, frames) = frames(&scene, &bytes);
    let chunks = chunks(&bytes);
    let centers = rows!(chunks, "/world/disks", "Ellipses2D:centers", [f32; 2]);
    let points = rows!(chunks, "/world/particles", "Points2D:positions", [f32; 2]);
    let expected: Vec<Vec<[f32; 2]>> = frames
        .iter()
        .map(|(frame, _)| frame.positions.iter().map(|v| single(*v)).collect())
        .collect();
    assert_eq!(centers, expected);
    assert_eq!(points, expected);
    let radii: Vec<[f32; 2]> = chunks["/world/disks"]
        .iter()
        .filter(|chunk| chunk.is_static())
        .flat_map(|chunk| chunk.iter_slices::<[f32; 2]>("Ellipses2D:half_sizes".into()))
        .flat_map(<[_]>::to_vec)
        .collect();
    let expected: Vec<[f32; 2]> = packing.radii().iter().map(|r| [*r as f32; 2]).collect();
    assert_eq!(radii, expected);
}

/// Whether `text` gives `value` to three digits.
fn gives(text: &str, value: f64) -> bool {
    let printed: f64 = text.parse().expect("a number");
    (printed - value).abs() <= 0.005_01 * value
}

#[test]
fn particles_and_contacts_carry_their_numbers() {
    let scene = scene();
    let bytes = record_as(Format::Rrd, &scene, |_| {});
    let (packing, frames) = frames(&scene, &bytes);
    let chunks = chunks(&bytes);
    let numbers = rows!(
        chunks,
        "/world/particles",
        "softjam.Particle:numbers",
        String
    );
    let pairs = rows!(chunks, "/world/contacts", "softjam.Contact:pair", [u32; 2]);
    let forces = rows!(chunks, "/world/contacts", "softjam.Contact:force", f32);
    let overlaps = rows!(chunks, "/world/contacts", "softjam.Contact:overlap", f32);
    let mut rattlers = 0;
    for (k, (_, contacts)) in frames.iter().enumerate() {
        let contacts = contacts.view();
        assert_eq!(pairs[k], contacts.pairs);
        for (c, f) in contacts.forces.iter().enumerate() {
            assert_eq!(forces[k][c], (f / 2.5) as f32);
            assert_eq!(overlaps[k][c], contacts.overlaps[c] as f32);
        }
        // Rattlers: one particle at a time is taken away, in any order.
        let mut held = vec![true; packing.len()];
        let number = |held: &[bool], p: usize| {
            let bears = |pair: &&[u32; 2]| {
                pair.contains(&(p as u32)) && pair.iter().all(|q| held[*q as usize])
            };
            contacts.pairs.iter().filter(bears).count()
        };
        while let Some(p) = (0..packing.len()).find(|&p| held[p] && number(&held, p) < 3) {
            held[p] = false;
        }
        assert_eq!(numbers[k].len(), packing.len());
        for (p, text) in numbers[k].iter().enumerate() {
            let radius = packing.radii()[p];
            let mine = |pair: &[u32; 2]| pair.contains(&(p as u32));
            // Forces, and the angles towards the partners.
            let around: Vec<(f64, f64)> = (0..contacts.pairs.len())
                .filter(|c| mine(&contacts.pairs[*c]))
                .map(|c| {
                    let away = contacts.normals[c];
                    let to = if contacts.pairs[c][0] as usize == p {
                        -away
                    } else {
                        away
                    };
                    (contacts.forces[c], to.y.atan2(to.x))
                })
                .collect();
            let sum: f64 = around.iter().map(|(f, _)| f).sum();
            // −ΔR/R where it is deepest, at a contact.
            let dent = |angle: f64| {
                let part = |(f, other): &(f64, f64)| {
                    let t = (angle - other).abs();
                    -f * ((PI - t) * t.sin() - 0.5 * t.cos() - 1.0) / (2.0 * PI * 2.5)
                };
                around.iter().map(part).sum::<f64>()
            };
            let deepest = around.iter().map(|(_, a)| dent(*a)).fold(0.0, f64::max);
            let parts: Vec<&str> = text
                .as_str()
                .split([' ', ','])
                .filter(|s| !s.is_empty())
                .collect();
            let ["p", pressure, "Z", z, "dent", printed, ref rest @ ..] = parts[..] else {
                panic!("{text}");
            };
            assert!(gives(pressure, sum / (2.0 * PI * radius) / 2.5), "{text}");
            assert_eq!(z, around.len().to_string());
            assert!(gives(printed, deepest), "{text}");
            assert_eq!(rest.contains(&"rattler"), !held[p], "{text}");
            rattlers += usize::from(!held[p]);
        }
    }
    assert!(rattlers > 0, "there are rattlers");
}

#[test]
fn what_no_channel_asks_for_is_not_drawn() {
    let only = |contours, contacts| {
        let channels = Channels {
            contours,
            contacts,
            ..scene().channels
        };
        let scene = Scene {
            channels,
            ..scene()
        };
        let bytes = record_as(Format::Rrd, &scene, |_| {});
        let entities: Vec<String> = chunks(&bytes)
            .into_keys()
            .filter(|entity| entity.starts_with("/world/") && !entity.contains("/legend"))
            .collect();
        entities
    };
    let every = Schedule::Every(20);
    assert_eq!(only(Schedule::Off, Schedule::Off), ["/world/box"]);
    assert_eq!(
        only(Schedule::Off, every),
        ["/world/box", "/world/contacts", "/world/contacts/images"]
    );
    assert_eq!(
        only(every, Schedule::Off),
        [
            "/world/box",
            "/world/contours",
            "/world/contours/images",
            "/world/disks",
            "/world/particles"
        ]
    );
}
