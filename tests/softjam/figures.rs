//! Figures: what is drawn is what is there.

use softjam::contact::ContactLaw;
use softjam::domain::{Domain, Vec2};
use softjam::figure::{ColorBy, Fall, Shape, Style, packing as draw, png, relaxation};
use softjam::frame::Frame;
use softjam::packing::Packing;
use softjam::relax::Relaxation;
use softjam::scene::Scene;

fn frame_of(packing: &Packing) -> Frame {
    let mut law = ContactLaw::default();
    law.solve(packing, &[], &[]).unwrap();
    Frame {
        positions: packing.positions().to_vec(),
        velocities: vec![Vec2::zeros(); packing.len()],
        contacts: law.contacts().pairs.to_vec(),
        forces: law.contacts().forces.to_vec(),
        ..Frame::default()
    }
}

/// The closed paths of a figure, each a list of points.
fn paths(svg: &str) -> Vec<Vec<(f64, f64)>> {
    svg.split(" d=\"")
        .skip(1)
        .map(|rest| {
            let numbers = rest[..rest.find('"').unwrap()]
                .split(|c: char| !(c.is_ascii_digit() || c == '.' || c == '-'))
                .filter(|word| !word.is_empty())
                .map(|word| word.parse::<f64>().unwrap());
            let numbers: Vec<f64> = numbers.collect();
            numbers.chunks(2).map(|p| (p[0], p[1])).collect()
        })
        .collect()
}

#[test]
fn a_particle_is_drawn_on_every_side_of_the_box_that_it_reaches() {
    let domain = Domain::new(10.0, 8.0).unwrap();
    let at = |x, y| {
        let packing = Packing::new(domain, vec![0.5], vec![Vec2::new(x, y)]).unwrap();
        let svg = draw(
            &packing,
            &frame_of(&packing),
            1.0,
            &Style {
                width: 1000.0,
                ..Style::default()
            },
        );
        paths(&svg)
    };
    assert_eq!(at(5.0, 4.0).len(), 1);
    assert_eq!(at(0.2, 4.0).len(), 2);
    assert_eq!(at(0.2, 7.9).len(), 4);
    // A hundred pixels a length, y upwards: the particle in the middle of the lower half.
    let circle = &at(5.0, 2.0)[0];
    let (x, y) = circle
        .iter()
        .fold((0.0, 0.0), |s, p| (s.0 + p.0, s.1 + p.1));
    let n = circle.len() as f64;
    assert!((x / n - (14.0 + 500.0)).abs() < 0.01, "{}", x / n);
    assert!((y / n - (14.0 + 600.0)).abs() < 0.01, "{}", y / n);
    for p in circle {
        let r = (p.0 - 514.0).hypot(p.1 - 614.0);
        assert!((r - 50.0).abs() < 0.02, "{r}");
    }
}

#[test]
fn contours_are_dented_where_disks_overlap_and_chains_join_centres() {
    let domain = Domain::new(10.0, 10.0).unwrap();
    let centers = vec![Vec2::new(4.6, 5.0), Vec2::new(5.4, 5.0)];
    let packing_of_two = Packing::new(domain, vec![0.5; 2], centers).unwrap();
    let frame = frame_of(&packing_of_two);
    let drawn = |shape| {
        let style = Style {
            shape,
            width: 1000.0,
            color: ColorBy::Nothing,
            ..Style::default()
        };
        draw(&packing_of_two, &frame, 1.0, &style)
    };
    let rightmost = |svg: &str| {
        let left = &paths(svg)[0];
        left.iter().fold(0.0, |m: f64, p| m.max(p.0))
    };
    // The line of contact lies in the middle; the bulges around it reach no farther than the linear model says.
    let contour = rightmost(&drawn(Shape::Contour));
    let disk = 14.0 + 510.0;
    let disks = drawn(Shape::Disk);
    let left = disks.matches("<circle cx=\"474\" cy=\"514\"").count();
    assert_eq!(left, 2, "a filled disk, and its outline above all disks");
    assert!(disks.contains("r=\"50\""), "{disks}");
    assert!(contour < disk - 5.0 && contour > 14.0 + 495.0, "{contour}");
    let svg = drawn(Shape::Contour);
    assert_eq!(svg.matches("<line").count(), 1, "one contact, one chain");
    assert!(
        svg.contains("x1=\"474\"") && svg.contains("x2=\"554\""),
        "{svg}"
    );
}

#[test]
fn rattlers_are_pale_and_the_pressed_are_coloured() {
    let run = Relaxation::new(&Scene {
        particles: 100,
        phi: 0.845,
        ..Scene::default()
    })
    .unwrap();
    let rattlers = run.observables().rattlers;
    let svg = draw(run.packing(), &run.frame(), 1.0, &Style::default());
    let pale = svg.matches("#f4f4f4").count();
    assert!(rattlers > 0 && pale >= rattlers, "{pale} of {rattlers}");
    assert!(svg.contains("p / ⟨p⟩"));
}

#[test]
fn a_figure_is_a_picture_of_its_size() {
    let run = Relaxation::new(&Scene {
        particles: 32,
        ..Scene::default()
    })
    .unwrap();
    let svg = draw(run.packing(), &run.frame(), 1.0, &Style::default());
    let bytes = png(&svg).unwrap();
    let size = |at: usize| u32::from_be_bytes(bytes[at..at + 4].try_into().unwrap());
    // 640 + two margins + the legend, in twice as many pixels.
    assert_eq!(size(16), 2 * (640 + 28 + 100));
    assert!(png("<svg").is_err());
}

#[test]
fn the_fall_of_f_max_keeps_zero_and_huge_runs_on_the_sheet() {
    let fall = |points| Fall {
        label: "a < b & c".to_owned(),
        points,
        threshold: None,
    };
    let long: Vec<(u64, f64)> = (0..100_000).map(|k| (k, 1.0 / (1.0 + k as f64))).collect();
    let svg = relaxation(&[fall(long), fall(vec![(0, 1.0), (5, 0.0)]), fall(vec![])]).unwrap();
    assert!(svg.len() < 400_000, "{} bytes", svg.len());
    assert!(svg.contains("a &lt; b &amp; c"));
    assert!(!svg.contains("NaN") && !svg.contains("inf"));
    png(&svg).unwrap();
}
