//! Figures: what is drawn is what is there.

use softjam::domain::{Domain, Vec2};
use softjam::figure::{
    Axis, ColorBy, Curve, Fall, Shape, Style, chart, packing as draw, pdf, png, relaxation,
};
use softjam::models::Kind;
use softjam::models::droplet::contact::ContactLaw;
use softjam::protocol::{Relaxation, Status};
use softjam::scene::Scene;
use softjam::state::Frame;
use softjam::state::Packing;

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
            &Scene::default(),
            &Style {
                width: 1028.0,
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
fn a_sheared_packing_is_drawn_between_its_slanted_sides() {
    for tilt in [3.0, -3.0] {
        let domain = Domain::new(10.0, 8.0).unwrap().tilted(tilt).unwrap();
        let drawn = |x, y, shape| {
            let at = domain.wrap(Vec2::new(x, y));
            let packing = Packing::new(domain, vec![0.5], vec![at]).unwrap();
            let style = Style {
                shape,
                width: 1328.0,
                ..Style::default()
            };
            let frame = Frame {
                domain: Some(domain),
                ..frame_of(&packing)
            };
            draw(&packing, &frame, &Scene::default(), &style)
        };
        let centers = |x, y| {
            let shapes = paths(&drawn(x, y, Shape::Contour));
            // Without the outline of the box, which is the area that is seen and a line above it.
            let mut centers: Vec<[i64; 2]> = shapes[1..shapes.len() - 1]
                .iter()
                .map(|shape| {
                    let sum = shape.iter().fold([0.0; 2], |s, p| [s[0] + p.0, s[1] + p.1]);
                    sum.map(|x| (x / shape.len() as f64).round() as i64)
                })
                .collect();
            centers.sort_unstable();
            let disks = drawn(x, y, Shape::Disk).matches("<circle").count();
            // Each disk is filled, and has an outline above all of them; one more says in the legend that it rattles.
            assert_eq!(disks, 2 * centers.len() + 1);
            centers
        };
        // A hundred pixels a length, y upwards, the corners where the periods lead.
        let pixel = |x: f64, y: f64| {
            let left = 14.0 + 100.0 * (-tilt).max(0.0);
            [left + 100.0 * x, 814.0 - 100.0 * y].map(|x| x.round() as i64)
        };
        let corners = [[0.0, 0.0], [10.0, 0.0], [10.0 + tilt, 8.0], [tilt, 8.0]];
        let outline = &paths(&drawn(5.0, 4.0, Shape::Contour))[0];
        let at = |k: usize| [outline[k].0, outline[k].1].map(|x| x.round() as i64);
        assert_eq!([0, 1, 2, 3].map(at), corners.map(|[x, y]| pixel(x, y)));
        // In the middle, by the slanted side, across it, and across the upper side, where the image is displaced.
        let middle = 5.0 + 0.5 * tilt;
        assert_eq!(centers(middle, 4.0), [pixel(middle, 4.0)]);
        let right = 9.3 + 0.75 * tilt;
        assert_eq!(centers(right, 6.0), [pixel(right, 6.0)]);
        let across = 9.8 + 0.75 * tilt;
        let both = [pixel(across - 10.0, 6.0), pixel(across, 6.0)];
        assert_eq!(centers(across, 6.0), both);
        let mut above = [pixel(middle, 7.9), pixel(middle - tilt, -0.1)];
        above.sort_unstable();
        assert_eq!(centers(middle, 7.9), above);
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
            width: 1028.0,
            color: ColorBy::Nothing,
            ..Style::default()
        };
        draw(&packing_of_two, &frame, &Scene::default(), &style)
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
    let inside = svg
        .split("url(#box)")
        .nth(1)
        .and_then(|rest| rest.split("<text").next());
    let chains = inside.map(|inside| inside.matches("<line").count());
    assert_eq!(chains, Some(1), "one contact, one chain");
    assert!(
        svg.contains("x1=\"474\"") && svg.contains("x2=\"554\""),
        "{svg}"
    );
}

/// The arcs of a path: where each begins and ends, its radius, and whether it goes clockwise.
fn arcs(data: &str) -> Vec<([f64; 4], f64, bool)> {
    let mut at = vec![];
    let mut arcs = vec![];
    for word in data.split_whitespace() {
        let numbers: Vec<f64> = word[1..]
            .split(',')
            .filter_map(|n| n.parse().ok())
            .collect();
        if let [radius, _, _, _, sweep, x, y] = numbers[..] {
            arcs.push(([at[0], at[1], x, y], radius, sweep == 1.0));
        }
        if !numbers.is_empty() {
            at = numbers[numbers.len() - 2..].to_vec();
        }
    }
    arcs
}

#[test]
fn both_droplets_of_a_film_are_drawn_with_its_arc() {
    let scene = Scene {
        particles: 32,
        phi: 0.95,
        model: Kind::WetFoam,
        ..Scene::default()
    };
    let mut run = Relaxation::new(&scene).unwrap();
    while run.status() == Status::Running {
        run.advance().unwrap();
    }
    let style = |films| Style {
        films,
        ..Style::default()
    };
    let draw = |films| draw(run.packing(), &run.frame(), &scene, &style(films));
    let (plain, with_films) = (draw(false), draw(true));
    let all: Vec<_> = plain.split(" d=\"").skip(1).collect();
    let all = all
        .iter()
        .flat_map(|rest| arcs(rest.split('"').next().unwrap()));
    let all: Vec<_> = all.collect();
    // The larger of the two pressures pushes an arc into the other droplet: there it goes clockwise.
    let hollow = all.iter().filter(|arc| arc.2);
    let mut films: Vec<String> = vec![];
    for ([a, b, c, d], radius, _) in hollow {
        let back = all.iter().find(|arc| arc.0 == [*c, *d, *a, *b]);
        if let Some((_, of_back, clockwise)) = back {
            assert!(of_back == radius && !clockwise);
            films.push(format!("M{c},{d} A{radius},{radius},0,0,0,{a},{b}"));
        }
    }
    let contacts = run.contacts().pairs.len();
    assert!(films.len() > contacts * 9 / 10, "{} films", films.len());
    // Arcs of the film and of the contour are the same.
    let drawn = films.iter().filter(|film| with_films.contains(*film));
    assert!(drawn.count() > contacts * 9 / 10);
    assert!(with_films.contains('Δ') && !plain.contains('Δ'));
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
    let svg = draw(
        run.packing(),
        &run.frame(),
        &Scene::default(),
        &Style::default(),
    );
    let pale = svg.matches("#f4f4f4").count();
    assert!(rattlers > 0 && pale >= rattlers, "{pale} of {rattlers}");
    assert!(svg.contains("</tspan> / ⟨"));
    let key = format!("{rattlers} rattler");
    assert!(svg.contains(&key), "{key}");
}

fn drawn(phi: f64, style: &Style) -> String {
    let run = Relaxation::new(&Scene {
        particles: 100,
        phi,
        ..Scene::default()
    })
    .unwrap();
    draw(run.packing(), &run.frame(), &Scene::default(), style)
}

#[test]
fn disks_are_drawn_as_circles_which_no_colour_says_are_deformed() {
    let scene = Scene {
        particles: 32,
        model: softjam::models::Kind::Disks,
        ..Scene::default()
    };
    let run = Relaxation::new(&scene).unwrap();
    let style = Style {
        color: ColorBy::Deformation,
        ..Style::default()
    };
    let svg = draw(run.packing(), &run.frame(), &scene, &style);
    // Each is filled and has an outline.
    assert!(svg.matches("<circle").count() >= 2 * 32);
    assert!(svg.contains(", disks") && !svg.contains('Δ'));
}

#[test]
fn a_packing_beyond_the_range_of_the_model_says_so_where_more_than_positions_is_drawn() {
    let warned = |svg: &str| svg.contains("particles are squeezed beyond the range");
    assert!(!warned(&drawn(0.845, &Style::default())));
    assert!(warned(&drawn(1.0, &Style::default())));
    let plain = Style {
        color: ColorBy::Nothing,
        chains: false,
        ..Style::default()
    };
    assert!(warned(&drawn(1.0, &plain)));
    let shape = Shape::Disk;
    let disks = drawn(1.0, &Style { shape, ..plain });
    assert!(!warned(&disks) && disks.contains("undeformed disks"));
}

#[test]
fn particles_that_differ_differ_in_colour_and_a_given_range_is_kept() {
    let colors = |range| {
        let svg = drawn(
            1.0,
            &Style {
                range,
                ..Style::default()
            },
        );
        let inside = svg.split("url(#box)").nth(1).unwrap();
        let inside = inside.split("<text").next().unwrap().to_owned();
        let fills = inside.split("fill=\"#").skip(1).map(|rest| &rest[..6]);
        let green = fills.map(|rgb| u8::from_str_radix(&rgb[2..4], 16).unwrap());
        let green: Vec<u8> = green.collect();
        (
            svg,
            green.iter().max().unwrap() - green.iter().min().unwrap(),
        )
    };
    let (_, own) = colors(None);
    let (svg, wide) = colors(Some([0.0, 2.0]));
    assert!(
        own > 2 * wide - wide / 2,
        "{own} against {wide} from 0 to 2"
    );
    for number in ["\n0\n", "\n1\n", "\n2\n"] {
        assert!(svg.contains(number), "{number:?}");
    }
    let (svg, _) = colors(Some([0.9, 1.1]));
    assert!(svg.contains("\n≤ 0.9\n") && svg.contains("\n≥ 1.1\n"));
}

#[test]
fn a_pdf_is_a_page_of_the_size_of_the_figure_and_the_same_every_time() {
    let svg = drawn(
        0.9,
        &Style {
            width: 325.0,
            ..Style::default()
        },
    );
    let bytes = pdf(&svg).unwrap();
    assert!(bytes.starts_with(b"%PDF-") && bytes.ends_with(b"%%EOF"));
    assert_eq!(bytes, pdf(&svg).unwrap());
    let page = b"/MediaBox [0 0 243.75 ";
    assert!(bytes.windows(page.len()).any(|part| part == page));
    let image = "<svg xmlns='http://www.w3.org/2000/svg' width='9' height='9'><rect width='9' height='9' fill-opacity='.5'/></svg>";
    let refused = pdf(image).unwrap_err().to_string();
    assert!(refused.contains("seen through"), "{refused}");
}

#[test]
fn a_legend_lies_on_no_curve() {
    let curve = |label: &str, ys: [f64; 4]| Curve {
        label: label.to_owned(),
        points: (0..4).map(|k| (f64::from(k), ys[k as usize])).collect(),
        ..Curve::default()
    };
    let frame_and_key = |curves: &[Curve]| {
        let svg = chart(&Axis::default(), &Axis::default(), curves).unwrap();
        let number = |tag: &str, name: &str| -> f64 {
            let rest = tag.split(&format!(" {name}=\"")).nth(1).unwrap();
            rest[..rest.find('"').unwrap()].parse().unwrap()
        };
        let frame = svg.split("<rect").nth(2).unwrap();
        let frame_end = number(frame, "x") + number(frame, "width");
        let key = svg.split("<line").last().unwrap();
        (frame_end, number(key, "x1"), number(key, "y1"))
    };
    let (end, x, y) = frame_and_key(&[curve("down", [3.0, 1.0, 0.5, 0.0])]);
    assert!(
        x < end && x > 0.5 * end && y < 200.0,
        "upper right: {x} {y}"
    );
    let (end, x, y) = frame_and_key(&[curve("up", [0.0, 0.5, 1.0, 3.0])]);
    assert!(x < 0.5 * end && y < 200.0, "upper left: {x} {y}");
    let both = [
        curve("rising", [0.0, 1.0, 2.0, 3.0]),
        curve("falling", [3.0, 2.0, 1.0, 0.0]),
    ];
    let (end, x, _) = frame_and_key(&both);
    assert!(x > end, "beside the frame: {x} {end}");
}

#[test]
fn a_figure_is_a_picture_of_its_size() {
    let run = Relaxation::new(&Scene {
        particles: 32,
        ..Scene::default()
    })
    .unwrap();
    let svg = draw(
        run.packing(),
        &run.frame(),
        &Scene::default(),
        &Style::default(),
    );
    let bytes = png(&svg).unwrap();
    let size = |at: usize| u32::from_be_bytes(bytes[at..at + 4].try_into().unwrap());
    // 640 + two margins, 300 pixels an inch of 96.
    assert_eq!(size(16), (668 * 300_u32).div_ceil(96));
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
