//! Protocols: states of quasi-static shear and of a network near jamming against numbers of an independent program, closed loops of strain, and that a
//! frame determines the next one wherever it stands.

use crate::common::scene;
use serde::Deserialize;
use softjam::domain::{Domain, Vec2};
use softjam::models::Kind;
use softjam::models::droplet::Form;
use softjam::protocol::{Relaxation, Status};
use softjam::scene::{Act, Increment, Minimizer, Scene, Shear, Stage, Until, Way};
use softjam::state::{Frame, Packing};

#[derive(Deserialize)]
struct Numbers {
    quasistatic: Vec<QuasiStatic>,
    network: Network,
}

#[derive(Deserialize)]
struct QuasiStatic {
    form: String,
    r#box: [f64; 2],
    positions: Vec<[f64; 2]>,
    states: Vec<[f64; 5]>,
}

#[derive(Deserialize)]
struct Network {
    r#box: [f64; 2],
    positions: Vec<[f64; 2]>,
    phi_j: f64,
    disks: Vec<[f64; 3]>,
    mw_central: Vec<[f64; 3]>,
    mw_gradient: Vec<[f64; 3]>,
}

fn numbers() -> Numbers {
    toml::from_str(include_str!("protocol.toml")).unwrap()
}

fn packing([x, y]: [f64; 2], positions: &[[f64; 2]]) -> Packing {
    let domain = Domain::new(x, y).unwrap();
    let radii = (0..positions.len()).map(|i| if i % 2 == 0 { 0.5 } else { 0.7 });
    let at = |x: &[f64; 2]| domain.wrap(Vec2::new(x[0], x[1]));
    Packing::new(domain, radii.collect(), positions.iter().map(at).collect()).unwrap()
}

fn of_form(form: &str) -> Scene {
    let (model, forces) = match form {
        "disks" => (Kind::Disks, Form::Central),
        "mw-central" => (Kind::MorseWitten, Form::Central),
        "mw-gradient" => (Kind::MorseWitten, Form::Gradient),
        other => panic!("{other}"),
    };
    Scene {
        model,
        forces,
        threshold: 1e-13,
        contact_tolerance: 1e-14,
        ..Scene::default()
    }
}

fn stage(act: Act) -> Stage {
    Stage {
        act,
        threshold: 1e-13,
        steps: 100_000,
    }
}

fn shear(strain: f64, step: f64) -> Act {
    Act::Shear {
        mode: Shear::Simple,
        strain,
        step,
        cycles: 0,
    }
}

/// What a relaxed state is worth: strain, φ, U, V, σ_xx, σ_xy, σ_yy.
#[derive(Clone, Copy, Debug)]
struct State {
    strain: f64,
    phi: f64,
    energy: f64,
    area: f64,
    stress: [f64; 3],
    contacts: usize,
}

/// The relaxed states of a run.
fn states(mut run: Relaxation) -> Vec<State> {
    let mut states = Vec::new();
    loop {
        if run.is_relaxed_state() {
            let o = run.observables();
            let [phi, strain] = o.phi_and_strain.unwrap();
            let (energy, stress) = (o.energy, o.stress);
            let area = run.packing().domain().area();
            states.push(State {
                strain,
                phi,
                energy,
                area,
                stress,
                contacts: o.contacts,
            });
        }
        match run.status() {
            Status::Running => run.advance().unwrap(),
            Status::Converged => return states,
            other => panic!("{other:?} at step {}", run.step()),
        }
    }
}

#[test]
fn quasi_static_states_are_those_of_an_independent_program() {
    for case in numbers().quasistatic {
        let steps = case.states.len() - 1;
        let strain = case.states[steps][0];
        let scene = Scene {
            protocol: vec![stage(shear(strain, strain / steps as f64))],
            ..of_form(&case.form)
        };
        let packing = packing(case.r#box, &case.positions);
        let found = states(Relaxation::of_packing(&scene, packing).unwrap());
        assert_eq!(found.len(), case.states.len(), "{}", case.form);
        for (a, b) in found.iter().zip(&case.states) {
            let here = [a.strain, a.energy, a.stress[0], a.stress[1], a.stress[2]];
            for (x, y) in here.iter().zip(b) {
                assert!((x - y).abs() < 1e-11, "{}: {here:?} for {b:?}", case.form);
            }
        }
    }
}

#[test]
fn a_network_near_jamming_has_one_phi_j_whatever_the_model() {
    let numbers = numbers().network;
    let branches = [
        ("disks", numbers.disks),
        ("mw-central", numbers.mw_central),
        ("mw-gradient", numbers.mw_gradient),
    ];
    for (form, branch) in branches {
        let step = branch[0][0] - branch[1][0];
        let until = branch[branch.len() - 1][0];
        let scene = Scene {
            protocol: vec![stage(Act::Compress {
                until: Until::Phi(until),
                by: Increment::Absolute(step),
            })],
            ..of_form(form)
        };
        let start = packing(numbers.r#box, &numbers.positions);
        let found = states(Relaxation::of_packing(&scene, start).unwrap());
        assert_eq!(found.len(), branch.len());
        for (a, [phi, p, energy]) in found.iter().zip(&branch) {
            let pressure = -0.5 * (a.stress[0] + a.stress[2]);
            assert!((a.phi - phi).abs() < 1e-13, "{form}: {} for {phi}", a.phi);
            assert!((pressure - p).abs() < 1e-11, "{form}: {pressure} for {p}");
            assert!((a.energy - energy).abs() < 1e-12, "{form}");
        }
    }
    for (form, model) in [
        ("disks", Kind::Disks),
        ("mw-central", Kind::MorseWitten),
        ("mw-gradient", Kind::MorseWitten),
        ("disks", Kind::RoundedPolygon),
        ("disks", Kind::WetFoam),
    ] {
        let scene = Scene {
            protocol: vec![stage(Act::Jam {
                way: Way::Halving,
                end: 1e-7,
            })],
            model,
            ..of_form(form)
        };
        let start = packing(numbers.r#box, &numbers.positions);
        let mut run = Relaxation::of_packing(&scene, start).unwrap();
        while run.status() == Status::Running {
            run.advance().unwrap();
        }
        assert_eq!(run.status(), Status::Converged);
        let found = run.jamming().unwrap();
        let off = found.phi_j - numbers.phi_j;
        println!(
            "{model:?} {form}: φ_J off by {off:e} after {} steps",
            run.step()
        );
        assert!(off.abs() < 1e-12, "{model:?} {form}: {off:e}");
    }
}

/// Simple shear, pure shear, both back, and what tilt is left taken away: the work, trapezoid by trapezoid, over V a².
/// Beside it the change of energy; `None` if contacts have come and gone.
fn work_of_a_loop(scene: &Scene, start: &Packing, a: f64) -> Option<(f64, f64)> {
    let of = |mode, strain: f64, steps: f64| {
        stage(Act::Shear {
            mode,
            strain,
            step: strain.abs() / steps,
            cycles: 0,
        })
    };
    let left = a * (1.0 - (-2.0 * a).exp());
    let scene = Scene {
        protocol: vec![
            of(Shear::Simple, a, 20.0),
            of(Shear::Pure, a, 20.0),
            of(Shear::Simple, -a, 20.0),
            of(Shear::Pure, -a, 20.0),
            of(Shear::Simple, -left, 20.0),
        ],
        ..scene.clone()
    };
    let found = states(Relaxation::of_packing(&scene, start.clone()).unwrap());
    assert_eq!(found.len(), 101);
    let mut work = 0.0;
    for (k, pair) in found.windows(2).enumerate() {
        let force = |s: &State| {
            s.area
                * match k / 20 {
                    1 | 3 => s.stress[0] - s.stress[2],
                    _ => s.stress[1],
                }
        };
        work += 0.5 * (force(&pair[0]) + force(&pair[1])) * (pair[1].strain - pair[0].strain);
    }
    let (first, last) = (found[0], found[100]);
    let is_elastic = found.iter().all(|s| s.contacts == first.contacts);
    is_elastic.then(|| (work / (first.area * a * a), last.energy - first.energy))
}

/// The central form does net work on a closed loop of elastic strain; what has an energy does not.
#[test]
fn closed_loops_of_strain_take_no_work_where_there_is_an_energy() {
    let a = 5e-4;
    for (form, model) in [
        ("disks", Kind::Disks),
        ("mw-gradient", Kind::MorseWitten),
        ("disks", Kind::RoundedPolygon),
        ("disks", Kind::WetFoam),
        ("mw-central", Kind::MorseWitten),
    ] {
        let base = Scene {
            model,
            ..of_form(form)
        };
        let mut elastic = 0;
        for seed in 1..=8 {
            let mut run = Relaxation::new(&Scene {
                particles: 16,
                phi: 0.9,
                seed,
                ..base.clone()
            })
            .unwrap();
            while run.status() == Status::Running {
                run.advance().unwrap();
            }
            let area = run.packing().domain().area();
            let Some((work, energy)) = work_of_a_loop(&base, run.packing(), a) else {
                continue;
            };
            elastic += 1;
            println!("{model:?} {form} {seed}: W/V a² = {work:e}, ΔU = {energy:e}");
            assert!(energy.abs() < 1e-11, "{model:?} {form}: {energy:e}");
            if form == "mw-central" {
                assert!(work.abs() > 1e-4, "{work:e}");
            } else {
                let work = work * area * a * a;
                assert!(work.abs() < 1e-11, "{model:?} {form}: {work:e}");
            }
        }
        assert!(elastic >= 2, "{model:?} {form}: {elastic} elastic loops");
    }
}

/// Disks of this sample are rigid under 1.6e-3 γ/length, and break below without a softer state in between.
#[test]
fn a_network_that_breaks_under_a_pressure_ends_the_search_there() {
    let scene = Scene {
        model: Kind::Disks,
        protocol: vec![Stage {
            threshold: 1e-11,
            ..stage(Act::Jam {
                way: Way::Halving,
                end: 1e-5,
            })
        }],
        ..scene(64, 0.70, 1)
    };
    let mut run = Relaxation::new(&scene).unwrap();
    let mut relaxed = 0;
    while run.status() == Status::Running {
        relaxed += u32::from(run.is_relaxed_state());
        run.advance().unwrap();
    }
    let found = run.jamming().unwrap();
    let pressure = run.observables().pressure();
    println!("{found:?} under {pressure:e} after {relaxed} relaxed states");
    assert_eq!(run.status(), Status::Converged);
    assert!(found.slope.is_none() && pressure > 1e-3 && relaxed < 70);
    let under = Scene {
        protocol: vec![stage(Act::Compress {
            until: Until::Phi(found.phi_j - 1e-6),
            by: Increment::Absolute(0.1),
        })],
        ..of_form("disks")
    };
    let end = states(Relaxation::of_packing(&under, run.packing().clone()).unwrap());
    assert!(end[1].stress[0].abs() < 1e-9, "{:?}", end[1].stress);
}

#[test]
fn a_pressure_that_is_not_met_is_an_error_and_no_end() {
    let scene = Scene {
        model: Kind::Disks,
        protocol: vec![stage(Act::Compress {
            until: Until::Pressure(50.0),
            by: Increment::Absolute(0.1),
        })],
        ..scene(32, 0.9, 1)
    };
    let error = Relaxation::new(&scene).unwrap().find_map(Result::err);
    let error = error.unwrap().to_string();
    assert!(
        error.contains("not met at any coverage below 1.3"),
        "{error}"
    );
}

#[test]
fn a_run_goes_on_with_its_protocol_under_another_model() {
    let before = Scene {
        model: Kind::Disks,
        protocol: vec![stage(shear(0.02, 0.01)), stage(shear(-0.01, 0.01))],
        ..scene(32, 0.9, 1)
    };
    let mut run = Relaxation::new(&before).unwrap();
    while run.stage() == 0 {
        run.advance().unwrap();
    }
    let after = Scene {
        model: Kind::MorseWitten,
        ..before.clone()
    };
    let packing = run.packing().clone();
    let run = Relaxation::take_over(&before, &after, packing, run.frame()).unwrap();
    // The first stage begins with relaxing further, since it asks for more than the relaxation in front of it.
    let strains: Vec<f64> = states(run).iter().map(|state| state.strain).collect();
    assert_eq!(strains, [0.0, 0.01, 0.02, 0.01]);
}

/// The slope of the stress is found by central differences about a state whose contacts stay.
#[test]
fn the_slope_of_the_stress_does_not_depend_on_the_strain_step() {
    for (form, model) in [
        ("disks", Kind::Disks),
        ("mw-central", Kind::MorseWitten),
        ("mw-gradient", Kind::MorseWitten),
        ("disks", Kind::RoundedPolygon),
        ("disks", Kind::WetFoam),
    ] {
        let base = Scene {
            model,
            particles: 32,
            phi: 0.9,
            ..of_form(form)
        };
        let mut compared = 0;
        for seed in 1..=4 {
            let run = crate::common::converged(&Scene {
                seed,
                ..base.clone()
            });
            let slope = |step: f64| {
                let at = |strain: f64| {
                    let protocol = vec![stage(shear(strain, step))];
                    let scene = Scene {
                        protocol,
                        ..base.clone()
                    };
                    let found =
                        states(Relaxation::of_packing(&scene, run.packing().clone()).unwrap());
                    (
                        found[1].stress[1],
                        found.iter().all(|s| s.contacts == found[0].contacts),
                    )
                };
                let ((up, same), (down, too)) = (at(step), at(-step));
                (same && too).then_some((up - down) / (2.0 * step))
            };
            if let [Some(fine), Some(coarse)] = [1e-6, 1e-5].map(slope) {
                compared += 1;
                let off = (fine / coarse - 1.0).abs();
                println!("{model:?} {form} {seed}: {fine} {coarse}, apart by {off:e}");
                assert!(off < 1e-4, "{model:?} {form} {seed}: {fine} {coarse}");
            }
        }
        assert!(
            compared >= 2,
            "{model:?} {form}: {compared} samples without events"
        );
    }
}

#[test]
fn a_turn_of_the_lattice_changes_nothing() {
    let start = Relaxation::new(&scene(48, 0.9, 3))
        .unwrap()
        .packing()
        .clone();
    for model in [Kind::Disks, Kind::MorseWitten, Kind::WetFoam] {
        let solved = |strain: f64| {
            let l = start.domain().lengths();
            let domain = start.domain().tilted(strain * l.y).unwrap();
            let positions = start.positions().to_vec();
            let packing = Packing::new(domain, start.radii().to_vec(), positions).unwrap();
            let scene = Scene {
                model,
                contact_tolerance: 1e-14,
                ..Scene::default()
            };
            let run = Relaxation::of_packing(&scene, packing).unwrap();
            (run.observables(), run.net_forces().to_vec())
        };
        let (a, forces) = solved(0.3);
        for strain in [-0.7, 1.3] {
            let (b, others) = solved(strain);
            let change = (a.energy - b.energy).abs();
            assert!(change < 1e-13 * a.energy.max(1.0), "{model:?}: {change:e}");
            for (f, g) in forces.iter().zip(&others) {
                assert!((f - g).norm() < 1e-11, "{model:?}: {f} {g}");
            }
        }
    }
}

#[test]
fn a_protocol_taken_up_at_any_frame_walks_the_same_bits() {
    let protocol = vec![
        Stage {
            threshold: 1e-8,
            ..stage(Act::Compress {
                until: Until::Phi(0.91),
                by: Increment::Absolute(4e-3),
            })
        },
        Stage {
            threshold: 1e-8,
            ..stage(Act::Shear {
                mode: Shear::Simple,
                strain: 0.04,
                step: 0.02,
                cycles: 1,
            })
        },
        stage(Act::Relax),
        Stage {
            threshold: 1e-8,
            ..stage(Act::Shear {
                mode: Shear::Pure,
                strain: -0.02,
                step: 0.01,
                cycles: 0,
            })
        },
        Stage {
            threshold: 1e-9,
            ..stage(Act::Compress {
                until: Until::Pressure(0.1),
                by: Increment::Relative(0.01),
            })
        },
        Stage {
            threshold: 1e-10,
            ..stage(Act::Jam {
                way: Way::Halving,
                end: 1e-3,
            })
        },
        Stage {
            threshold: 1e-10,
            ..stage(Act::Jam {
                way: Way::Above,
                end: 1e-3,
            })
        },
    ];
    for (model, minimizer) in [
        (Kind::Disks, Minimizer::Fire),
        (Kind::MorseWitten, Minimizer::Fire),
        (Kind::MorseWitten, Minimizer::FireNewton),
        (Kind::WetFoam, Minimizer::Fire),
        (Kind::RoundedPolygon, Minimizer::FireNewton),
    ] {
        let scene = Scene {
            model,
            minimizer,
            threshold: 1e-8,
            protocol: protocol.clone(),
            ..scene(24, 0.9, 2)
        };
        let run = Relaxation::new(&scene).unwrap();
        let packing = run.packing().clone();
        let frames: Vec<Frame> = run.map(Result::unwrap).collect();
        let last = frames.len() - 1;
        assert_eq!(frames[last].stage, 7, "{model:?}");
        let begins =
            (1..=last).filter(|&k| frames[k].protocol.get(1) != frames[k - 1].protocol.get(1));
        let mut from: Vec<usize> = begins.flat_map(|k| [k - 1, k]).collect();
        from.extend((0..last).step_by(last / 20));
        println!("{model:?}: {last} steps, {} taken up", from.len());
        for k in from {
            let resumed = Relaxation::resume(&scene, packing.clone(), frames[k].clone());
            let rest = resumed.unwrap().map(Result::unwrap);
            for (a, b) in rest.zip(&frames[k..]).take(300) {
                assert_eq!(a.digest(), b.digest(), "{model:?} from {k} at {}", b.step);
            }
        }
    }
}
