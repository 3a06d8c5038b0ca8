//! Pictures that would look like the ones before them are left out, and only they.

use crate::files::{FORMATS, open, record_as};
use softjam::protocol::Relaxation;
use softjam::record::Format;
use softjam::replay::Event;
use softjam::scene::{Channels, Scene, Schedule};
use softjam::state::Frame;
use softjam::state::Packing;
use std::collections::BTreeMap;
use std::f64::consts::PI;

fn scene(redraw: f64) -> Scene {
    Scene {
        particles: 64,
        phi: 0.85,
        seed: 5,
        line_tension: 2.5,
        channels: Channels {
            contours: Schedule::Every(1),
            contacts: Schedule::Every(2),
            metrics: Schedule::Every(1),
            state: Schedule::Every(1),
            redraw,
        },
        ..Scene::default()
    }
}

/// The steps at which contours and contacts were drawn, and all frames.
fn read(bytes: &[u8]) -> ([Vec<u64>; 2], Vec<Frame>) {
    let (mut drawn, mut frames) = ([Vec::new(), Vec::new()], Vec::new());
    for event in open(bytes).expect("a recording") {
        match event.expect("undamaged") {
            Event::Drawn { channel, step } => drawn[usize::from(channel == "contacts")].push(step),
            Event::State(frame) => frames.push(frame),
            _ => {}
        }
    }
    (drawn, frames)
}

/// The farthest that a particle is from where it was (mean radii).
fn moved(packing: &Packing, a: &Frame, b: &Frame) -> f64 {
    let sides = packing.domain().lengths();
    let nearest = |d: f64, side: f64| d - side * (d / side).round();
    let distances = a.positions.iter().zip(&b.positions).map(|(a, b)| {
        let (x, y) = (nearest(a.x - b.x, sides.x), nearest(a.y - b.y, sides.y));
        x.hypot(y)
    });
    let mean = packing.radii().iter().sum::<f64>() / packing.len() as f64;
    distances.fold(0.0, f64::max) / mean
}

/// Pressure on each particle, their mean over those that are pressed, and who rattles.
fn pressures(packing: &Packing, frame: &Frame) -> (Vec<f64>, f64, Vec<bool>) {
    let mut pressure = vec![0.0; packing.len()];
    for (pair, f) in frame.contacts.iter().zip(&frame.forces) {
        for p in pair {
            let p = *p as usize;
            pressure[p] += f / (2.0 * PI * packing.radii()[p]);
        }
    }
    let pressed: Vec<f64> = pressure.iter().copied().filter(|p| *p > 0.0).collect();
    let mean = pressed.iter().sum::<f64>() / pressed.len() as f64;
    let mut rattles = vec![false; packing.len()];
    loop {
        let counts = (0..packing.len()).map(|p| {
            let mine = |pair: &&[u32; 2]| {
                pair.contains(&(p as u32)) && !pair.iter().any(|q| rattles[*q as usize])
            };
            frame.contacts.iter().filter(mine).count()
        });
        let next: Vec<bool> = counts.map(|n| n < 3).collect();
        if next == rattles {
            return (pressure, mean, rattles);
        }
        rattles = next;
    }
}

/// The most that a force changed, in means of the forces of `b`.
fn force_change(a: &Frame, b: &Frame) -> f64 {
    let mut change: BTreeMap<[u32; 2], f64> = BTreeMap::new();
    for (frame, sign) in [(a, -1.0), (b, 1.0)] {
        for (pair, f) in frame.contacts.iter().zip(&frame.forces) {
            *change.entry(*pair).or_default() += sign * f;
        }
    }
    let mean = b.forces.iter().sum::<f64>() / b.forces.len() as f64;
    change.values().fold(0.0, |m: f64, d| m.max(d.abs())) / mean
}

/// By how many of what it may be off the picture of the contours, or the contacts, of `a` is wrong at `b`.
fn off(packing: &Packing, channel: usize, redraw: f64, a: &Frame, b: &Frame) -> f64 {
    let moved = moved(packing, a, b) / redraw;
    if channel == 1 {
        return moved.max(force_change(a, b) / (10.0 * redraw));
    }
    let ((p, _, rattle), (q, mean, rattles)) = (pressures(packing, a), pressures(packing, b));
    let changes = p.iter().zip(&q).map(|(p, q)| (p - q).abs() / mean);
    let change = changes.fold(0.0, f64::max) / (10.0 * redraw);
    let other = if rattle == rattles {
        0.0
    } else {
        f64::INFINITY
    };
    moved.max(change).max(other)
}

#[test]
fn a_picture_is_as_right_as_the_scene_says_and_none_is_drawn_that_need_not_be() {
    for (format, redraw) in [
        (Format::Rrd, 0.01),
        (Format::Mcap, 0.01),
        (Format::Rrd, 0.003),
    ] {
        let scene = scene(redraw);
        let run = Relaxation::new(&scene).expect("a valid scene");
        let (drawn, frames) = read(&record_as(format, &scene, |_| {}));
        let last = frames.last().expect("a frame").step;
        for (channel, drawn) in drawn.iter().enumerate() {
            assert_eq!((drawn[0], drawn[drawn.len() - 1]), (0, last), "both ends");
            let of = |step: u64| &frames[step as usize];
            let off = |a: u64, b: u64| off(run.packing(), channel, redraw, of(a), of(b));
            let scheduled = |step: &u64| channel == 0 || step.is_multiple_of(2);
            for pair in drawn.windows(2) {
                for step in (pair[0] + 1..pair[1]).filter(scheduled) {
                    let off = off(pair[0], step);
                    assert!(off <= 1.0 + 1e-12, "{channel}: step {step} is {off} off");
                }
                if pair[1] < last {
                    let off = off(pair[0], pair[1]);
                    assert!(
                        off > 1.0 - 1e-12,
                        "{channel}: step {} in vain, {off}",
                        pair[1]
                    );
                }
            }
            let steps = (0..=last).filter(scheduled).count();
            println!("{redraw}, {channel}: {} of {steps} drawn", drawn.len());
            assert!(4 * drawn.len() < 3 * steps, "{} of {steps}", drawn.len());
        }
    }
}

#[test]
fn at_nought_every_picture_is_drawn_and_nothing_else_differs() {
    for format in FORMATS {
        let (all, frames) = read(&record_as(format, &scene(0.0), |_| {}));
        assert_eq!(all[0].len(), frames.len());
        let last = frames.len() as u64 - 1;
        let even = (0..=last).filter(|s| s % 2 == 0 || *s == last);
        assert_eq!(all[1], even.collect::<Vec<_>>());
        let (few, same) = read(&record_as(format, &scene(0.01), |_| {}));
        assert!(few[0].len() < all[0].len());
        assert!(same == frames, "the states know nothing of pictures");
    }
}

#[test]
fn pictures_of_no_contacts_and_of_one_particle_are_drawn_at_both_ends() {
    for (particles, phi) in [(1, 0.05), (64, 0.5)] {
        let scene = Scene {
            particles,
            phi,
            ..scene(0.01)
        };
        for format in FORMATS {
            let (drawn, frames) = read(&record_as(format, &scene, |_| {}));
            let last = frames[frames.len() - 1].step;
            for drawn in drawn {
                assert_eq!((drawn[0], drawn[drawn.len() - 1]), (0, last));
            }
        }
    }
}
