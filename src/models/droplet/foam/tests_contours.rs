//! Contours in balance, as arcs: areas, films and overlaps, each found from the arcs alone.

use super::super::arc::Arc;
use super::*;
use crate::models::{AnyModel, Kind};
use crate::protocol::{Relaxation, Status};
use crate::scene::Scene;
use core::f64::consts::PI;

/// What is relaxed here.
fn relaxations() -> impl Iterator<Item = (Kind, f64)> {
    let models = [Kind::WetFoam, Kind::RoundedPolygon].into_iter();
    models.flat_map(|model| [0.86, 0.93, 0.98].map(|phi| (model, phi)))
}

/// A packing relaxed to an `f_max` of 1e-12 γ, and the contours of its droplets seen from their centres.
fn relaxed(model: Kind, phi: f64) -> (Packing, Foam, Vec<Vec<Arc>>) {
    let scene = Scene {
        particles: 30,
        phi,
        seed: 3,
        model,
        threshold: 1e-12,
        ..Scene::default()
    };
    let mut run = Relaxation::new(&scene).unwrap();
    while run.status() == Status::Running {
        run.advance().unwrap();
    }
    assert_eq!(run.status(), Status::Converged);
    assert!(run.observables().f_max <= 1e-12);
    let AnyModel::Foam(foam) = run.model() else {
        panic!("{model:?} is a foam");
    };
    let radii = run.packing().radii().iter().enumerate();
    let contours = radii.map(|(p, radius)| foam.arcs(p, *radius).unwrap());
    let contours = contours.collect();
    (run.packing().clone(), (**foam).clone(), contours)
}

/// The area between an arc and its chord: `(turn − sin turn)/2κ²`.
fn segment(arc: &Arc) -> f64 {
    let (turn, chord) = (arc.turn, (arc.ends[1] - arc.ends[0]).norm());
    let square = turn * turn;
    if turn.abs() < 1e-2 {
        // What is left out is below 1e-16.
        return chord * chord * turn / 12.0 * (1.0 + square / 30.0);
    }
    let sin = libm::sin(0.5 * turn);
    chord * chord * (turn - libm::sin(turn)) / (8.0 * sin * sin)
}

/// What an arc has of the area around the centre: a triangle and a segment.
fn area(arc: &Arc) -> f64 {
    0.5 * arc.ends[0].perp(&arc.ends[1]) + segment(arc)
}

/// The outward normal where an arc begins.
fn normal(arc: &Arc) -> Vec2 {
    let chord = (arc.ends[1] - arc.ends[0]).normalize();
    let (sin, cos) = libm::sincos(-0.5 * arc.turn);
    let outward = Vec2::new(chord.y, -chord.x);
    Vec2::new(
        outward.x * cos - outward.y * sin,
        outward.x * sin + outward.y * cos,
    )
}

/// How far `point` lies outside the circle or line that an arc is a part of: nothing is lost where the circle is large.
fn outside(arc: &Arc, point: Vec2) -> f64 {
    let (from, curvature) = (point - arc.ends[0], arc.curvature());
    let power = from.norm_squared() * curvature + 2.0 * from.dot(&normal(arc));
    power / (1.0 + (1.0 + curvature * power).max(0.0).sqrt())
}

/// The distance of `point` from an arc.
fn distance(arc: &Arc, point: Vec2) -> f64 {
    // The sector of the arc, between its normals; a straight line has a strip.
    let [from, to] = arc.ends;
    let before = normal(arc).perp(&(point - from)) < 0.0;
    let behind = normal(&back(arc)).perp(&(point - to)) < 0.0;
    if before || behind {
        (point - from).norm().min((point - to).norm())
    } else {
        outside(arc, point).abs()
    }
}

/// How deep `point` lies inside a contour, 0 outside: by the angle that the contour winds about it.
fn depth(contour: &[Arc], point: Vec2) -> f64 {
    let mut angle = 0.0;
    for arc in contour {
        let [from, to] = arc.ends.map(|end| end - point);
        angle += libm::atan2(from.perp(&to), from.dot(&to));
        // A point between chord and arc sees the arc pass on the other side.
        let beyond_chord = (arc.ends[1] - arc.ends[0]).perp(&-from) * arc.turn.signum() < 0.0;
        if beyond_chord && outside(arc, point) * arc.turn.signum() < 0.0 {
            angle += 2.0 * PI * arc.turn.signum();
        }
    }
    if angle < PI {
        return 0.0;
    }
    let distances = contour.iter().map(|arc| distance(arc, point));
    distances.fold(f64::INFINITY, f64::min)
}

/// Points along an arc, its ends among them.
fn points(arc: &Arc) -> Vec<Vec2> {
    let mut arcs = vec![*arc];
    for _ in 0..4 {
        arcs = arcs.iter().flat_map(Arc::halves).collect();
    }
    let ends = arcs.iter().map(|arc| arc.ends[0]);
    ends.chain([arc.ends[1]]).collect()
}

fn largest(values: impl Iterator<Item = f64>) -> f64 {
    values.fold(0.0, |m, d| if d > m || d.is_nan() { d } else { m })
}

/// The arc the other way round.
fn back(arc: &Arc) -> Arc {
    Arc {
        ends: [arc.ends[1], arc.ends[0]],
        turn: -arc.turn,
    }
}

#[test]
fn droplets_in_balance_are_closed_by_arcs_with_one_tangent_and_have_their_area() {
    for (model, phi) in relaxations() {
        let (packing, foam, contours) = relaxed(model, phi);
        let mut films = 0.0_f64;
        for (p, (contour, radius)) in contours.iter().zip(packing.radii()).enumerate() {
            let disk = PI * radius * radius;
            let area: f64 = contour.iter().map(area).sum();
            assert!((area / disk - 1.0).abs() < 1e-12, "{model:?} {phi}: {p}");
            let bulges = contour.iter().step_by(2).map(|film| segment(film) / disk);
            films = films.max(bulges.sum::<f64>().abs());
            // Free arcs lie between films.
            for arc in contour.iter().skip(1).step_by(2) {
                let part = arc.curvature() * foam.corners()[p];
                assert!((part - 1.0).abs() < 1e-12, "{model:?} {phi}: {p}");
            }
            for (arc, next) in contour.iter().zip(contour.iter().cycle().skip(1)) {
                assert!((arc.ends[1] - next.ends[0]).norm() == 0.0);
                // The normal of an arc that is followed back is that of its other side.
                let joint = normal(&back(arc)) + normal(next);
                assert!(joint.norm() < 1e-12, "{model:?} {phi}: {p}");
            }
        }
        // With chords for films the areas would be wrong.
        let bent = model == Kind::WetFoam;
        assert!((films > 1e-7) == bent && (films == 0.0) != bent);
    }
}

#[test]
fn both_droplets_of_a_film_have_one_arc_which_young_and_laplace_bend() {
    for phi in [0.86, 0.93, 0.98] {
        let (_, foam, contours) = relaxed(Kind::WetFoam, phi);
        let mut films = 0;
        for (c, pair) in foam.lines.pairs().iter().enumerate() {
            if foam.forces[c] == 0.0 {
                continue;
            }
            let [i, j] = pair.map(|p| p as usize);
            let between = foam.lines.between(c);
            let apart = |a: &Arc, b: &Arc| {
                let ends = a.ends.iter().zip(b.ends.iter().rev());
                largest(ends.map(|(a, b)| (a - b - between).norm()))
            };
            // Films stand before free arcs.
            let of_i = contours[i].iter().step_by(2);
            let couples = of_i.flat_map(|a| contours[j].iter().step_by(2).map(move |b| (a, b)));
            let shared = couples.min_by(|a, b| apart(a.0, a.1).total_cmp(&apart(b.0, b.1)));
            let (a, b) = shared.unwrap();
            assert!(apart(a, b) < 1e-12, "φ = {phi}: {:e}", apart(a, b));
            let off = largest(points(a).into_iter().map(|v| distance(b, v - between)));
            assert!(off < 1e-12, "φ = {phi}: {off:e}");
            let [r_i, r_j] = [i, j].map(|p| foam.corners()[p]);
            let curvature = 0.5 * (1.0 / r_i - 1.0 / r_j);
            assert!((a.curvature() - curvature).abs() < 1e-12);
            assert!((b.curvature() + curvature).abs() < 1e-12);
            films += 1;
        }
        assert!(films > 60);
    }
}

#[test]
fn no_droplet_in_balance_reaches_into_another() {
    for (model, phi) in relaxations() {
        let (_, foam, contours) = relaxed(model, phi);
        // The deepest of all points where neighbours are nearer by so much (length).
        let deepest = |nearer: f64| {
            let lines = foam.lines.pairs().iter().enumerate();
            let of_lines = lines.flat_map(|(c, pair)| {
                let between = foam.lines.between(c) - foam.lines.normals()[c] * nearer;
                let [i, j] = pair.map(|p| p as usize);
                [(i, j, between), (j, i, -between)]
            });
            largest(
                of_lines
                    .flat_map(|(p, q, between)| {
                        let points = contours[p].iter().flat_map(points);
                        points.map(move |v| (q, v - between))
                    })
                    .map(|(q, point)| depth(&contours[q], point)),
            )
        };
        assert!(deepest(0.0) < 1e-12, "{model:?} {phi}");
        assert!((deepest(1e-9) / 1e-9 - 1.0).abs() < 1e-2, "{model:?} {phi}");
    }
}

#[test]
fn contours_off_balance_are_no_arcs() {
    let scene = Scene {
        particles: 30,
        phi: 0.93,
        model: Kind::WetFoam,
        ..Scene::default()
    };
    let run = Relaxation::new(&scene).unwrap();
    let AnyModel::Foam(foam) = run.model() else {
        panic!("a foam");
    };
    let radii = run.packing().radii().iter().enumerate();
    let drawn = radii.filter(|(p, radius)| foam.arcs(*p, **radius).is_some());
    assert!(drawn.count() < 5);
}
