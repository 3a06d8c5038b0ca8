//! Both laws against numbers of 30 and 40 digits, closed forms, and differences of their own energy.

use super::film::Film;
use super::*;
use crate::domain::Domain;
use crate::models::{Goal, Model};
use crate::state::Frame;
use core::f64::consts::PI;
use serde::Deserialize;

#[derive(Deserialize)]
struct Numbers {
    droplet: Vec<Single>,
    film: Vec<std::collections::BTreeMap<String, f64>>,
    channel: Vec<Pair>,
    checkerboard: Vec<Pair>,
    straight: Vec<Given>,
    arcs: Vec<Given>,
}

#[derive(Deserialize)]
struct Single {
    name: String,
    #[serde(rename = "R")]
    radius: f64,
    r: f64,
    #[serde(rename = "Y")]
    y: f64,
    theta: Vec<f64>,
    f: Vec<f64>,
    #[serde(rename = "K")]
    k: Vec<f64>,
    #[serde(rename = "M")]
    m: Vec<f64>,
    rho: Vec<f64>,
}

#[derive(Deserialize)]
struct Pair {
    #[serde(rename = "R1")]
    large: f64,
    #[serde(rename = "R2")]
    other: f64,
    d: f64,
    f: f64,
    r1: f64,
    r2: f64,
    #[serde(rename = "U_pair")]
    energy: f64,
}

#[derive(Deserialize)]
struct Given {
    r#box: [f64; 2],
    #[serde(rename = "R")]
    radii: Vec<f64>,
    x: Vec<[f64; 2]>,
    r: Vec<f64>,
    force: Vec<[f64; 2]>,
    #[serde(rename = "U")]
    energy: f64,
    #[serde(rename = "Pi")]
    pressure: f64,
    /// i, j, f, τ.
    contacts: Vec<[f64; 4]>,
}

impl Given {
    fn packing(&self) -> Packing {
        let domain = Domain::new(self.r#box[0], self.r#box[1]).unwrap();
        let at = |x: &[f64; 2]| domain.wrap(Vec2::new(x[0], x[1]));
        Packing::new(domain, self.radii.clone(), self.x.iter().map(at).collect()).unwrap()
    }
}

fn numbers() -> Numbers {
    toml::from_str(include_str!("numbers.toml")).unwrap()
}

fn largest(differences: impl Iterator<Item = f64>) -> f64 {
    differences.fold(0.0, |m, d| {
        if d.abs() > m || d.is_nan() {
            d.abs()
        } else {
            m
        }
    })
}

fn settled(films: Films, packing: &Packing) -> Foam {
    let mut foam = Foam::new(films, 1.0, 1e-13);
    foam.solve(packing, Goal::EXACT).unwrap();
    assert!(foam.moment() < 1e-12 && foam.state.give() == 0.0);
    foam
}

/// The slope at 0, by differences of fourth order.
fn derivative(of: &impl Fn(f64) -> f64, h: f64) -> f64 {
    (8.0 * (of(h) - of(-h)) - (of(2.0 * h) - of(-2.0 * h))) / (12.0 * h)
}

#[test]
fn films_are_those_of_forty_digits() {
    for n in numbers().film {
        let film = Film::of(n["f"], [n["r_i"], n["r_j"]]).unwrap();
        let ([psi_i, psi_j], [c_ii, c_ij, c_jj]) = (film.psi(), film.second());
        let [tilt_i, tilt_j] = film.tilt();
        let sum = n["r_i"] + n["r_j"];
        for (name, found) in [
            ("C", film.energy()),
            ("C_f", -sum * film.fall()),
            ("C_ff", -film.softness()),
            ("C_ri", psi_i),
            ("C_rj", psi_j),
            ("C_f_ri", tilt_i - film.fall()),
            ("C_f_rj", tilt_j - film.fall()),
            ("C_ri_ri", c_ii),
            ("C_ri_rj", c_ij),
            ("C_rj_rj", c_jj),
        ] {
            let off = (found / n[name] - 1.0).abs();
            assert!(
                off < 1e-12,
                "{name} at f = {}: {found:e}, off by {off:e}",
                n["f"]
            );
        }
        assert!((film.cos() - 1.0 + film.fall()).abs() < 1e-15);
    }
    assert!(Film::of(10.0, [0.1, 0.9]).is_none() && Film::of(f64::NAN, [0.5, 0.7]).is_none());
}

#[test]
fn single_droplets_are_those_of_thirty_digits() {
    for n in numbers().droplet {
        // A neighbour in each direction, none of which bears another force.
        let centre = Vec2::new(10.0, 10.0);
        let mut positions = vec![centre];
        positions.extend(n.theta.iter().map(|t| {
            let (sin, cos) = libm::sincos(*t);
            centre + Vec2::new(cos, sin) * (1.1 * (n.radius + 0.6))
        }));
        let mut radii = vec![0.6; positions.len()];
        radii[0] = n.radius;
        let packing = Packing::new(Domain::new(20.0, 20.0).unwrap(), radii, positions).unwrap();
        let mut foam = Foam::new(Films::Straight, 1.0, 1e-12);
        foam.set_lines(&packing, f64::INFINITY);
        foam.lines.turn(&foam.tilts);
        let of = |c: usize| foam.lines.pairs()[c];
        let forces: Vec<f64> = (0..foam.lines.len())
            .map(|c| {
                if of(c)[0] == 0 {
                    n.f[of(c)[1] as usize - 1]
                } else {
                    0.0
                }
            })
            .collect();
        let given = (&foam.lines, packing.radii());
        assert!(
            foam.state
                .evaluate(given, (&forces, 1.0), Films::Straight, 1e-14)
        );
        foam.state.find_midpoints(&foam.lines);
        let state = &foam.state;
        assert!((state.corners()[0] / n.r - 1.0).abs() < 1e-14, "{}", n.name);
        assert!((state.droplets()[0].y + 1.0 - n.y).abs() < 1e-14);
        for (c, &[i, j]) in foam.lines.pairs().iter().enumerate() {
            if i == 0 {
                let k = j as usize - 1;
                let side = state.side(foam.lines.sides_of(c)[0]);
                assert!((side.k - n.k[k]).abs() < 1e-14, "{}", n.name);
                assert!((side.m - n.m[k]).abs() < 1e-14, "{}", n.name);
                let chord = n.radius - state.hollows(&foam.lines, c)[0];
                assert!((chord - n.rho[k]).abs() < 1e-14, "{}", n.name);
            }
        }
    }
}

#[test]
fn packings_at_given_positions_are_those_of_the_reference() {
    let numbers = numbers();
    for (films, given) in [
        (Films::Straight, numbers.straight),
        (Films::Arcs, numbers.arcs),
    ] {
        for given in given {
            let packing = given.packing();
            let foam = settled(films, &packing);
            let contacts = foam.contacts.view();
            assert_eq!(contacts.pairs.len(), given.contacts.len());
            let tilt =
                |pair: &[u32; 2]| foam.tilts[foam.lines.pairs().binary_search(pair).unwrap()];
            let found = contacts.pairs.iter().zip(contacts.forces);
            let mut expected = given.contacts.clone();
            expected.sort_by(|a, b| a.partial_cmp(b).unwrap());
            for ((pair, f), [i, j, force, turned]) in found.zip(&expected) {
                assert_eq!(pair.map(f64::from), [*i, *j]);
                assert!((f - force).abs() < 2e-12, "{pair:?}: {f}, not {force}");
                assert!((tilt(pair) - turned).abs() < 1e-12, "{pair:?}");
            }
            let corners = foam.corners().iter().zip(&given.r);
            assert!(largest(corners.map(|(a, b)| a - b)) < 1e-12);
            let net = foam.net.iter().zip(&given.force);
            assert!(largest(net.flat_map(|(a, b)| [a.x - b[0], a.y - b[1]])) < 2e-12);
            assert!((foam.energy() - given.energy).abs() < 1e-13);
            let [xx, _, yy] = foam.moments();
            let pressure = (xx + yy) / (2.0 * packing.domain().area());
            assert!((pressure - given.pressure).abs() < 1e-12);
        }
    }
}

#[test]
fn rows_and_checkerboards_are_those_of_the_closed_form() {
    let numbers = numbers();
    for (rows, pairs) in [(1, numbers.channel), (4, numbers.checkerboard)] {
        for pair in pairs {
            let at = |k: usize| Vec2::new((k % 4) as f64 + 0.5, (k / 4) as f64 + 0.5) * pair.d;
            let height = if rows == 1 { 4.0 } else { 4.0 * pair.d };
            let count = 4 * rows;
            let radii = (0..count)
                .map(|k| {
                    if (k % 4 + k / 4) % 2 == 0 {
                        pair.large
                    } else {
                        pair.other
                    }
                })
                .collect();
            let domain = Domain::new(4.0 * pair.d, height).unwrap();
            let packing = Packing::new(domain, radii, (0..count).map(at).collect()).unwrap();
            let foam = settled(Films::Arcs, &packing);
            let contacts = foam.contacts.view();
            assert_eq!(contacts.forces.len(), if rows == 1 { 4 } else { 32 });
            assert!(largest(contacts.forces.iter().map(|f| f - pair.f)) < 1e-12);
            let expected = |k: usize| {
                if packing.radii()[k] == pair.large {
                    pair.r1
                } else {
                    pair.r2
                }
            };
            let corners = foam.corners().iter().enumerate();
            assert!(largest(corners.map(|(k, r)| r - expected(k))) < 1e-13);
            assert!((foam.energy() - 0.5 * count as f64 * pair.energy).abs() < 1e-12);
            assert!(foam.f_max() < 1e-13);
        }
    }
}

#[test]
fn hexagonal_crystals_are_hexagons_with_round_corners() {
    for phi in [0.92, 0.95, 0.97, 0.99] {
        // R²/r² = 1 + (2t/π) x + (t/π) x² with t = n tan(π/n) and the inradius a = r (1 + x); f = 2 x tan(π/n).
        let (radius, n) = (0.5, 6.0);
        let spacing = radius * (2.0 * PI / (3.0_f64.sqrt() * phi)).sqrt();
        let (a, tan) = (0.5 * spacing, libm::tan(PI / n));
        let t = n * tan;
        // In r: R² = r² + (2t/π) r (a − r) + (t/π) (a − r)².
        let residual = |r: f64| {
            r * r + 2.0 * t / PI * r * (a - r) + t / PI * (a - r) * (a - r) - radius * radius
        };
        let (mut low, mut high) = (1e-6, a);
        for _ in 0..200 {
            let middle = 0.5 * (low + high);
            if (residual(middle) > 0.0) == (residual(low) > 0.0) {
                low = middle;
            } else {
                high = middle;
            }
        }
        let f = 2.0 * (a / low - 1.0) * tan;
        let step = Vec2::new(spacing, spacing * 0.75_f64.sqrt());
        let domain = Domain::new(4.0 * step.x, 4.0 * step.y).unwrap();
        let at = |k: usize| {
            let (column, row) = (k % 4, k / 4);
            let shift = 0.5 * (row % 2) as f64;
            Vec2::new((column as f64 + shift) * step.x, row as f64 * step.y)
        };
        let packing = Packing::new(domain, vec![radius; 16], (0..16).map(at).collect()).unwrap();
        for films in [Films::Straight, Films::Arcs] {
            let foam = settled(films, &packing);
            let contacts = foam.contacts.view();
            assert_eq!(contacts.forces.len(), 48, "φ = {phi}");
            assert!(
                largest(contacts.forces.iter().map(|x| x - f)) < 1e-10,
                "φ = {phi}"
            );
            assert!(largest(foam.corners().iter().map(|r| r - low)) < 1e-10);
        }
    }
}

#[test]
fn net_forces_are_the_slope_of_the_energy_and_pressure_that_of_the_volume() {
    let numbers = numbers();
    for (films, given) in [
        (Films::Straight, numbers.straight),
        (Films::Arcs, numbers.arcs),
    ] {
        let packing = given[2].packing();
        let foam = settled(films, &packing);
        let h = 1e-5;
        for p in [0, 5] {
            for along in [Vec2::new(1.0, 0.0), Vec2::new(0.0, 1.0)] {
                let energy = |by: f64| {
                    let mut moved = packing.clone();
                    let to = moved.domain().wrap(moved.positions()[p] + along * by);
                    moved.positions_mut()[p] = to;
                    settled(films, &moved).energy()
                };
                let slope = derivative(&energy, h);
                assert!((foam.net[p].dot(&along) + slope).abs() < 2e-8, "{films:?}");
            }
        }
        let energy = |by: f64| {
            let domain = packing.domain();
            let [x, y] = [domain.lengths().x, domain.lengths().y].map(|l| l * (1.0 + by));
            let scaled = packing.positions().iter().map(|p| p * (1.0 + by)).collect();
            let domain = Domain::new(x, y).unwrap();
            let packing = Packing::new(domain, packing.radii().to_vec(), scaled).unwrap();
            settled(films, &packing).energy()
        };
        let slope = derivative(&energy, h) / (2.0 * packing.domain().area());
        let [xx, _, yy] = foam.moments();
        let pressure = (xx + yy) / (2.0 * packing.domain().area());
        assert!(
            (pressure + slope).abs() < 1e-8,
            "{films:?}: {pressure}, {slope}"
        );
    }
}

#[test]
fn the_unit_of_force_is_the_line_tension() {
    let given = &numbers().arcs[0];
    let packing = given.packing();
    let one = settled(Films::Arcs, &packing);
    let mut other = Foam::new(Films::Arcs, 3.05e-3, 1e-13);
    other.solve(&packing, Goal::EXACT).unwrap();
    let forces = one.forces.iter().zip(&other.forces);
    assert!(largest(forces.map(|(a, b)| a - b / 3.05e-3)) < 1e-12);
    assert!((one.energy() - other.energy()).abs() < 1e-13);
}

#[test]
fn contours_in_balance_close_keep_their_area_and_share_their_films() {
    // The last packing of arcs is in balance.
    let given = numbers().arcs.pop().unwrap();
    let packing = given.packing();
    let foam = settled(Films::Arcs, &packing);
    assert!(foam.f_max() < 1e-12);
    let mut outlines = Vec::new();
    for (p, &radius) in packing.radii().iter().enumerate() {
        let mut points = Vec::new();
        foam.outline(p, radius, 4096, &mut points);
        let next = points.iter().cycle().skip(1);
        let area: f64 = points
            .iter()
            .zip(next.clone())
            .map(|(a, b)| 0.5 * a.perp(b))
            .sum();
        // A chord of an arc cuts off a part of θ²/12 of its sector, at most.
        let spacing = 2.0 * PI / 4096.0;
        let cut = spacing * spacing;
        assert!(
            (area / (PI * radius * radius) - 1.0).abs() < cut,
            "droplet {p}"
        );
        let longest = points
            .iter()
            .zip(next)
            .map(|(a, b)| (b - a).norm())
            .fold(0.0, f64::max);
        assert!(longest < 1.0);
        outlines.push(points);
    }
    // Each end of a film is a vertex of both droplets.
    for (c, &[i, j]) in foam.lines.pairs().iter().enumerate() {
        if foam.forces[c] == 0.0 {
            continue;
        }
        let between = foam.lines.between(c);
        let [i, j] = [i as usize, j as usize];
        let shared = outlines[i]
            .iter()
            .filter(|a| {
                outlines[j]
                    .iter()
                    .any(|b| (between + b - *a).norm() < 1e-11)
            })
            .count();
        assert!(shared >= 2, "{shared} vertices in common");
    }
}

#[test]
fn droplets_without_room_have_soft_contacts_that_a_frame_remembers() {
    for films in [Films::Straight, Films::Arcs] {
        // More area than the box has.
        let given = &numbers().arcs[2];
        let domain = Domain::new(0.92 * given.r#box[0], 0.92 * given.r#box[1]).unwrap();
        let at = |x: &[f64; 2]| domain.wrap(Vec2::new(x[0], x[1]) * 0.92);
        let positions = given.x.iter().map(at).collect();
        let packing = Packing::new(domain, given.radii.clone(), positions).unwrap();
        assert!(packing.coverage() > 1.05);
        let mut foam = Foam::new(films, 1.0, 1e-12);
        foam.solve(&packing, Goal::EXACT).unwrap();
        assert!(foam.state.give() > 0.0 && foam.accepted_residual() < 0.0);
        assert!(foam.residual() <= 1e-12);
        let mut frame = Frame {
            positions: packing.positions().to_vec(),
            ..Frame::default()
        };
        foam.copy_memory(&mut frame.memory);
        foam.copy_contacts(&packing, &mut frame.contacts, &mut frame.forces);
        let mut again = Foam::new(films, 1.0, 1e-12);
        again.restore(&packing, &frame).unwrap();
        assert_eq!(again.net, foam.net);
        assert_eq!(again.state.give().to_bits(), foam.state.give().to_bits());
        let found = again.check(&packing, &frame, 1e-10);
        assert!(found.residual < 1e-11, "{films:?}: {found:?}");
    }
}

#[test]
fn droplets_that_touch_two_images_of_one_are_refused() {
    // Itself across the box; and in a row of two, the other on both sides.
    for (side, count) in [(0.9, 1), (1.8, 2)] {
        let at = |k: usize| Vec2::new(0.9 * k as f64 + 0.1, 1.0);
        let domain = Domain::new(side, 4.0).unwrap();
        let packing = Packing::new(domain, vec![0.5; count], (0..count).map(at).collect()).unwrap();
        for films in [Films::Straight, Films::Arcs] {
            let error = Foam::new(films, 1.0, 1e-12).solve(&packing, Goal::EXACT);
            let refused = matches!(error, Err(ContactError::BoxTooSmall { particle: 0, .. }));
            assert!(refused, "{error:?}");
        }
    }
    // Three in a row have each other once.
    let at = |k: usize| Vec2::new(0.9 * k as f64 + 0.1, 1.0);
    let domain = Domain::new(2.7, 4.0).unwrap();
    let packing = Packing::new(domain, vec![0.5; 3], (0..3).map(at).collect()).unwrap();
    let foam = settled(Films::Arcs, &packing);
    assert_eq!(foam.contacts.view().forces.len(), 3);
}
