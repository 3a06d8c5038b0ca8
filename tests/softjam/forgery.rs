//! Forgeries with right digests: whatever of a recording is changed by somebody who writes it with softjam's own recorders, it is not
//! called verified.

use crate::common::Random;
use crate::files::{FORMATS, open, recorder};
use softjam::analysis::Stability;
use softjam::domain::Vec2;
use softjam::models::droplet::Form;
use softjam::protocol::{Relaxation, Status};
use softjam::record::{Format, Header, Leg, Outcome, Snapshot};
use softjam::replay::{Balance, Bytes, Event, Recording, Way, determinism};
use softjam::scene::{Minimizer, Scene, Schedule};
use std::io::Cursor;

fn scene() -> Scene {
    let mut scene = Scene {
        particles: 24,
        phi: 0.92,
        threshold: 1e-6,
        ..Scene::default()
    };
    scene.channels.redraw = 0.0;
    scene
}

/// A run as its snapshots, which a forger may change before they are recorded.
struct Run {
    header: Header,
    snapshots: Vec<Snapshot>,
    outcome: Option<Outcome>,
}

impl Run {
    fn honest() -> Self {
        let scene = scene();
        let mut run = Relaxation::new(&scene).expect("a valid scene");
        let header = Header::of(&scene, &run);
        let mut snapshots = Vec::new();
        loop {
            let last = run.status() != Status::Running;
            let edge = last || run.step() == 0;
            snapshots.extend(Snapshot::of(&run, &scene.channels, edge));
            if last {
                break;
            }
            run.advance().expect("a step");
        }
        let outcome = Outcome::of(&run);
        Self {
            header,
            snapshots,
            outcome,
        }
    }

    /// The file, with all digests made right by its recorder; `None` if it cannot even be written.
    fn write(&self, format: Format) -> Option<Vec<u8>> {
        let mut bytes = Vec::new();
        let mut recorder = recorder(format, &mut bytes, self.header.clone()).ok()?;
        for snapshot in &self.snapshots {
            recorder.record(snapshot).ok()?;
        }
        recorder.finish(self.outcome).ok()?;
        drop(recorder);
        Some(bytes)
    }

    /// One of the snapshots that have what `is_wanted` asks for.
    fn any(&self, random: &mut Random, is_wanted: impl Fn(&Snapshot) -> bool) -> usize {
        let wanted: Vec<usize> = (0..self.snapshots.len())
            .filter(|k| is_wanted(&self.snapshots[*k]))
            .collect();
        wanted[random.below(wanted.len())]
    }
}

/// Whether a replay of the bytes, one way or the other, finds nothing against them.
fn is_verified(bytes: &[u8], way: Way) -> bool {
    let Ok(mut recording) = open(bytes) else {
        return false;
    };
    let mut balance = Balance::new(recording.scene());
    let file = Box::new(Cursor::new(bytes.to_vec()));
    let found = determinism(&mut recording, way, Some(file), |state| {
        let metrics = state.metrics.get(&state.frame.step);
        let metrics = metrics.map_or(&[][..], Vec::as_slice);
        balance.check(&state.packing, &state.frame, metrics);
    });
    found.is_ok_and(|found| {
        found.difference.is_none()
            && matches!(found.bytes, Bytes::Same(_) | Bytes::LaidOutOtherwise)
            && balance.agrees()
            && recording
                .outcome()
                .is_some_and(|end| balance.bears_out(&end, 0.0))
    })
}

type Forge = fn(&mut Run, &mut Random);

/// What is forged of the metrics.
const METRIC: [(&str, Forge); 5] = [
    ("a value by its last bit", |run, random| {
        let k = random.below(run.snapshots.len());
        let metrics = run.snapshots[k]
            .metrics
            .as_mut()
            .expect("every step has them");
        // The first ones are those that every run has.
        let metric = random.below(metrics.iter().flatten().count());
        metrics[metric] = metrics[metric].map(f64::next_up);
    }),
    ("its time", |run, random| {
        let k = random.below(run.snapshots.len());
        run.snapshots[k].nanoseconds += 1;
    }),
    ("a row left out", |run, random| {
        let k = random.below(run.snapshots.len());
        run.snapshots[k].metrics = None;
    }),
    ("a row twice", |run, random| {
        let k = random.below(run.snapshots.len());
        let row = row_of(&run.snapshots[k]);
        run.snapshots.insert(k, row);
    }),
    ("a row behind the end", |run, _| {
        let mut row = row_of(run.snapshots.last().expect("a snapshot"));
        row.step += 1;
        run.snapshots.push(row);
    }),
];

/// The metrics of a snapshot alone.
fn row_of(snapshot: &Snapshot) -> Snapshot {
    Snapshot {
        frame: None,
        contours: false,
        contacts: false,
        state: false,
        ..snapshot.clone()
    }
}

/// What is forged of the pictures; the states stay.
const PICTURE: [(&str, Forge); 4] = [
    ("a moved particle", |run, random| {
        picture(run, random, |snapshot, random| {
            let frame = snapshot.frame.as_mut().expect("a frame");
            let particle = random.below(frame.positions.len());
            let at = &mut frame.positions[particle];
            *at = Vec2::new(at.x * 0.5, at.y);
        });
    }),
    ("a stronger force", |run, random| {
        picture(run, random, |snapshot, random| {
            let frame = snapshot.frame.as_mut().expect("a frame");
            let contact = random.below(frame.forces.len());
            frame.forces[contact] *= 3.0;
        });
    }),
    ("contours left out", |run, random| {
        let k = run.any(random, |s| s.contours);
        run.snapshots[k].contours = false;
    }),
    ("contacts left out", |run, random| {
        let k = run.any(random, |s| s.contacts);
        run.snapshots[k].contacts = false;
    }),
];

/// Draws one picture of a frame that `change` tampers with, beside the state that is true.
fn picture(run: &mut Run, random: &mut Random, change: impl Fn(&mut Snapshot, &mut Random)) {
    let k = run.any(random, |s| s.contours && s.contacts && s.state);
    let mut drawn = run.snapshots[k].clone();
    (drawn.state, drawn.metrics) = (false, None);
    change(&mut drawn, random);
    let state = &mut run.snapshots[k];
    (state.contours, state.contacts) = (false, false);
    run.snapshots.insert(k, drawn);
}

/// What is forged of the states.
const STATE: [(&str, Forge); 4] = [
    ("a position by its last bit", |run, random| {
        let k = run.any(random, |s| s.state);
        let frame = run.snapshots[k].frame.as_mut().expect("a frame");
        let particle = random.below(frame.positions.len());
        frame.positions[particle].x = frame.positions[particle].x.next_down();
    }),
    ("a state left out", |run, random| {
        let k = run.any(random, |s| s.state);
        run.snapshots[k].state = false;
    }),
    ("two states exchanged", |run, random| {
        let k = run.any(random, |s| s.state && s.step > 0);
        run.snapshots.swap(0, k);
    }),
    ("another run's end", |run, random| {
        let k = run.any(random, |s| s.state && s.step > 0 && !s.edge);
        run.snapshots.truncate(k + 1);
        let last = run.snapshots.last_mut().expect("a snapshot");
        last.edge = true;
        let f_max = last
            .metrics
            .and_then(|m| m[0])
            .expect("every step has them");
        run.outcome = Some(Outcome {
            converged: random.below(2) == 0,
            steps: last.step,
            f_max,
            stability: None,
        });
    }),
];

/// What is forged of the result.
const RESULT: [(&str, Forge); 5] = [
    ("converged", |run, _| {
        result(run, |end| end.converged = false);
    }),
    ("steps", |run, _| result(run, |end| end.steps += 1)),
    ("f_max", |run, _| {
        result(run, |end| end.f_max = end.f_max.next_down());
    }),
    ("stability", |run, _| {
        result(run, |end| end.stability = Some(Stability::Saddle));
    }),
    ("no result", |run, _| run.outcome = None),
];

fn result(run: &mut Run, change: impl Fn(&mut Outcome)) {
    change(run.outcome.as_mut().expect("a result"));
}

/// What is forged of the scene that the recording claims to be of.
const SCENE: [(&str, Forge); 15] = [
    ("seed", |run, random| {
        run.header.scene.seed += 1 + random.below(9) as u64;
    }),
    ("phi", |run, random| {
        run.header.scene.phi *= random.within(0.9, 0.999);
    }),
    ("aspect", |run, random| {
        run.header.scene.aspect *= random.within(1.01, 1.2);
    }),
    ("particles", |run, _| run.header.scene.particles += 1),
    ("threshold, smaller", |run, _| {
        run.header.scene.threshold = 1e-10;
    }),
    ("threshold, larger", |run, _| {
        run.header.scene.threshold = 1e-3;
    }),
    ("step limit", |run, random| {
        let steps = run.outcome.expect("a result").steps as usize;
        run.header.scene.steps = random.below(steps - 1) as u64;
    }),
    ("line tension", |run, _| run.header.scene.line_tension = 2.0),
    ("forces", |run, _| run.header.scene.forces = Form::Gradient),
    ("minimiser", |run, _| {
        run.header.scene.minimizer = Minimizer::FireNewton;
    }),
    ("schedule of the metrics", |run, random| {
        run.header.scene.channels.metrics = Schedule::Every(2 + random.below(5) as u64);
    }),
    ("schedule of the states", |run, _| {
        run.header.scene.channels.state = Schedule::Every(5);
    }),
    ("mixing of FIRE", |run, random| {
        run.header.scene.fire.mixing = random.within(0.11, 0.5);
    }),
    ("first step", |run, random| {
        run.header.from_step = 1 + random.below(20) as u64;
    }),
    ("another scene before", |run, random| {
        let gradient = Scene {
            forces: Form::Gradient,
            ..scene()
        };
        run.snapshots.retain(|s| s.step >= 20);
        run.header.from_step = 20;
        run.header.legs = vec![Leg::of(&gradient, 1 + random.below(19) as u64)];
    }),
];

#[test]
fn forgeries_with_right_digests_are_not_called_verified() {
    let mut random = Random::new(16);
    for format in FORMATS {
        let honest = Run::honest().write(format).expect("a recording");
        for way in [Way::Whole, Way::Segments(2)] {
            assert!(
                is_verified(&honest, way),
                "{format:?}: the honest recording"
            );
        }
        let kinds = METRIC.iter().chain(&PICTURE).chain(&STATE).chain(&RESULT);
        let mut forged = 0;
        for (what, forge) in kinds.chain(&SCENE) {
            for attempt in 0..9 {
                let mut run = Run::honest();
                forge(&mut run, &mut random);
                let Some(bytes) = run.write(format) else {
                    continue;
                };
                assert!(bytes != honest, "{what}: nothing was forged");
                forged += 1;
                let way = [Way::Whole, Way::Segments(2)][attempt % 2];
                assert!(!is_verified(&bytes, way), "{format:?}, {what}, {way:?}");
            }
        }
        assert!(forged >= 250, "{forged} forgeries of {format:?}");
        println!("{forged} forgeries of {format:?}: none verified");
    }
}

#[test]
fn a_flipped_bit_anywhere_in_a_finished_file_is_found() {
    let mut random = Random::new(17);
    for format in FORMATS {
        let mut bytes = Run::honest().write(format).expect("a recording");
        for flip in 0..400 {
            let (place, bit) = (random.below(bytes.len()), 1 << random.below(8));
            bytes[place] ^= bit;
            let way = [Way::Whole, Way::Segments(2)][flip % 2];
            assert!(
                !is_verified(&bytes, way),
                "{format:?}, byte {place}, bit {bit}"
            );
            bytes[place] ^= bit;
        }
        assert!(is_verified(&bytes, Way::Whole));
    }
}

#[test]
fn another_revision_of_the_bits_is_compared_within_tolerances() {
    let forged = |bits, off: f64| {
        let mut run = Run::honest();
        run.header.bits = bits;
        for snapshot in run.snapshots.iter_mut().skip(1) {
            if let Some(frame) = &mut snapshot.frame {
                frame.positions[3].x += off;
            }
        }
        run.write(Format::Rrd).expect("a recording")
    };
    let replay = |bytes: &[u8]| {
        let mut recording = open(bytes).expect("a recording");
        determinism(&mut recording, Way::Whole, None, |_| {}).expect("a verdict")
    };
    let own = replay(&forged(softjam::BITS, 1e-13));
    assert!(own.difference.is_some() && own.deviation.is_none());
    for (off, agrees) in [(0.0, true), (1e-13, true), (0.01, false)] {
        let found = replay(&forged(softjam::BITS + 1, off));
        assert_eq!(found.difference, None, "no damage");
        let worst = found.deviation.expect("another revision");
        assert_eq!(worst.agrees(), agrees, "{off:e}: {worst:?}");
    }
}

/// Two parts of one run, the second one forged.
fn joined(forge: impl FnOnce(&mut Run)) -> Result<usize, String> {
    let whole = Run::honest();
    let mut rest = Run::honest();
    rest.snapshots.retain(|s| s.step >= 20);
    rest.header.from_step = 20;
    forge(&mut rest);
    let parts = [whole, rest].map(|run| {
        let bytes = run.write(Format::Rrd).expect("a recording");
        open(&bytes).expect("a header")
    });
    let whole = Recording::joined(parts.into()).map_err(|error| error.to_string())?;
    let states = whole.filter_map(|event| match event {
        Ok(Event::State(_)) => Some(Ok(())),
        Ok(_) => None,
        Err(error) => Some(Err(error.to_string())),
    });
    Ok(states.collect::<Result<Vec<()>, _>>()?.len())
}

#[test]
fn parts_whose_common_steps_differ_by_a_bit_are_not_of_one_run() {
    let honest = Run::honest();
    let states = honest.snapshots.iter().filter(|s| s.state).count();
    assert_eq!(joined(|_| {}), Ok(states));
    let at = |run: &mut Run, step: u64| {
        run.snapshots
            .iter()
            .position(|s| s.step == step)
            .expect("it")
    };
    let error = joined(|run| {
        let k = at(run, 30);
        let frame = run.snapshots[k].frame.as_mut().expect("a frame");
        frame.positions[3].x = frame.positions[3].x.next_up();
    });
    let said = error.expect_err("found");
    assert!(
        said.contains("its state of step 30 is not that of test"),
        "{said}"
    );
    let error = joined(|run| {
        let k = at(run, 31);
        let metrics = run.snapshots[k].metrics.as_mut().expect("metrics");
        metrics[3] = metrics[3].map(f64::next_up);
    });
    let said = error.expect_err("found");
    assert!(
        said.contains("its pressure of step 31 is not that of test"),
        "{said}"
    );
    let error = joined(|run| run.header.bits += 1);
    let said = error.expect_err("found");
    assert!(said.contains("this program computes with bits"), "{said}");
    let error = joined(|run| {
        let k = at(run, 20);
        run.snapshots[k].metrics = None;
        run.snapshots[k].step = 17;
        run.snapshots[k].frame.as_mut().expect("a frame").step = 17;
        run.header.from_step = 17;
    });
    let said = error.expect_err("found");
    assert!(
        said.contains("begins with step 17, of which test holds no state"),
        "{said}"
    );
}
