//! Runs in parts: `softjam record --from` with whatever can be changed there, and `softjam join`.

use super::{folder, record, run};
use std::fmt::Write as _;
use std::fs;
use std::path::Path;

/// What can be changed where a run is taken up.
const CHANGES: [&[&str]; 16] = [
    &[],
    &["--threshold", "1e-12"],
    &["--threshold", "1e-4"],
    &["--threshold", "1e-1"],
    &["--minimizer", "fire+newton"],
    &["--minimizer", "fire+newton", "--threshold", "1e-13"],
    &["--minimizer", "fire"],
    &["--forces", "gradient"],
    &["--forces", "gradient", "--threshold", "1e-6"],
    &["--steps", "100"],
    &["--every", "7"],
    &["--channels", "state=every:3,contours", "--redraw", "0"],
    &["--vertices", "12"],
    &["--model", "wet-foam"],
    &["--model", "rounded-polygon", "--minimizer", "fire+newton"],
    &["--model", "disks", "--minimizer", "fire"],
];

#[track_caller]
fn assert_verified(folder: &Path, name: &str, what: &str) {
    for way in [&["replay", name][..], &["replay", name, "--segments"]] {
        let (code, out, errors) = run(folder, way);
        assert_eq!(code, Some(0), "{what}: {out}{errors}");
    }
}

#[test]
fn whatever_is_changed_where_a_run_is_taken_up_its_recording_verifies() {
    let folder = folder();
    record(folder.path(), "fire.rrd", &[]);
    let newton = ["--minimizer", "fire+newton", "--threshold", "1e-13"];
    record(folder.path(), "newton.mcap", &newton);
    for from in ["fire.rrd", "newton.mcap"] {
        for step in [&["--step", "100"][..], &[]] {
            for (k, change) in CHANGES.iter().enumerate() {
                let name = ["x.rrd", "x.mcap"][k % 2];
                let line = [&["record", "-f", "--from", from, "-o", name], step, change];
                let what = format!("{:?}", line.concat());
                let (code, _, errors) = run(folder.path(), &line.concat());
                if step.is_empty() && change.contains(&"--steps") {
                    assert_eq!(code, Some(2), "{what}");
                    assert!(errors.contains("steps = 100 is outside"), "{errors}");
                } else {
                    assert!(matches!(code, Some(0 | 3)), "{what}: {errors}");
                    assert_verified(folder.path(), name, &what);
                }
            }
        }
    }
}

#[test]
fn a_run_that_is_changed_twice_on_its_way_is_verified_from_its_start_and_survives_conversion() {
    let folder = folder();
    record(folder.path(), "a.rrd", &[]);
    let steps: [&[&str]; 4] = [
        &[
            "record", "--from", "a.rrd", "--step", "60", "--forces", "gradient", "-o", "b.rrd",
        ],
        &[
            "record",
            "--from",
            "b.rrd",
            "--step",
            "120",
            "--minimizer",
            "fire+newton",
            "-o",
            "c.rrd",
        ],
        &["record", "--from", "c.rrd", "--step", "150", "-o", "d.mcap"],
        &["convert", "c.rrd", "c.mcap"],
    ];
    for line in steps {
        let (code, _, errors) = run(folder.path(), line);
        assert_eq!(code, Some(0), "{line:?}: {errors}");
    }
    let back = ["convert", "c.mcap", "back.rrd"];
    assert_eq!(run(folder.path(), &back).0, Some(0));
    let bytes = |name: &str| fs::read(folder.path().join(name)).expect(name);
    assert!(bytes("c.rrd") == bytes("back.rrd"));
    for name in ["b.rrd", "c.rrd", "c.mcap", "d.mcap"] {
        assert_verified(folder.path(), name, name);
    }
    let (_, out, _) = run(folder.path(), &["replay", "c.rrd"]);
    for words in ["from its start (to step 60", "(to step 120"] {
        assert!(out.contains(words), "{out}");
    }
    let (_, out, _) = run(folder.path(), &["info", "c.rrd", "--json"]);
    let info: serde_json::Value = serde_json::from_str(&out).expect("one JSON object");
    assert_eq!(
        (&info["from_step"], &info["legs"][1]["until"]),
        (&120.into(), &120.into())
    );
    assert_eq!(info["legs"][0]["forces"], "central");
    // It is no run of its scene alone.
    let line = [
        "record",
        "-N",
        "64",
        "--phi",
        "0.9",
        "--forces",
        "gradient",
        "-o",
        "plain.rrd",
    ];
    assert_eq!(run(folder.path(), &line).0, Some(0));
    let (code, out, _) = run(
        folder.path(),
        &["replay", "plain.rrd", "--against", "b.rrd"],
    );
    assert_eq!(code, Some(3), "{out}");
}

#[test]
fn a_run_from_a_file_is_not_taken_up_where_its_replay_would_have_nothing_to_run() {
    let folder = folder();
    let mut csv = "# box = 8, 8\nx,y,radius\n".to_owned();
    for k in 0..49 {
        let (x, y) = (f64::from(k % 7) * 8.0 / 7.0, f64::from(k / 7) * 8.0 / 7.0);
        writeln!(csv, "{},{y},0.62", x + 0.1 * f64::from(k % 3)).expect("a String grows");
    }
    fs::write(folder.path().join("mine.csv"), csv).expect("written");
    let line = ["record", "--file", "mine.csv", "-o", "a.rrd"];
    assert_eq!(run(folder.path(), &line).0, Some(0));
    for change in [&[][..], &["--threshold", "1e-4"]] {
        let line = ["record", "-f", "--from", "a.rrd", "-o", "x.rrd"];
        let (code, _, errors) = run(folder.path(), &[&line, change].concat());
        assert_eq!(code, Some(2), "{errors}");
        assert!(errors.contains("an earlier --step"), "{errors}");
        assert!(!folder.path().join("x.rrd").exists());
    }
    for change in [&["--threshold", "1e-12"][..], &["--forces", "gradient"]] {
        let line = ["record", "-f", "--from", "a.rrd", "-o", "x.rrd"];
        let (code, _, errors) = run(folder.path(), &[&line, change].concat());
        assert_eq!(code, Some(0), "{errors}");
        assert_verified(folder.path(), "x.rrd", "a start from a file");
    }
}

/// A run whose pictures are not at the steps of its states, in both formats, and what is left of it when it is cut.
fn whole_and_cut(folder: &Path, disks: &[&str], share: usize) {
    let channels = "metrics,state=every:4,contours=every:3,contacts=every:6";
    let flags = [
        "--redraw",
        "0",
        "--channels",
        channels,
        "--mcap",
        "whole.mcap",
    ];
    record(folder, "whole.rrd", &[&flags, disks].concat());
    for format in ["rrd", "mcap"] {
        let bytes = fs::read(folder.join(format!("whole.{format}"))).expect("bytes");
        let cut = bytes.len() * share / 10;
        fs::write(folder.join(format!("killed.{format}")), &bytes[..cut]).expect("written");
    }
}

#[test]
fn what_is_left_of_a_killed_run_and_its_rest_are_joined_to_the_bytes_of_the_whole() {
    let folder = folder();
    whole_and_cut(folder.path(), &[], 9);
    let bytes = |name: &str| fs::read(folder.path().join(name)).expect(name);
    let good = |line: &[&str]| {
        let (code, _, errors) = run(folder.path(), line);
        assert_eq!(code, Some(0), "{line:?}: {errors}");
    };
    for format in ["rrd", "mcap"] {
        let (killed, rest) = (format!("killed.{format}"), format!("rest.{format}"));
        good(&["record", "--from", &killed, "-o", &rest]);
        for name in ["whole.rrd", "whole.mcap"] {
            let joined = format!("joined-{format}-{name}");
            good(&["join", &killed, &rest, "-o", &joined]);
            assert!(bytes(&joined) == bytes(name), "{joined}");
        }
    }
    // Three parts that hold much in common, of both formats; a whole one with itself.
    good(&[
        "join",
        "whole.rrd",
        "killed.mcap",
        "rest.rrd",
        "-o",
        "three.rrd",
    ]);
    good(&["join", "whole.mcap", "whole.rrd", "-o", "twice.rrd"]);
    assert!(bytes("three.rrd") == bytes("whole.rrd") && bytes("twice.rrd") == bytes("whole.rrd"));
    // A run that is given more steps than it had.
    let channels = "metrics,state=every:4,contours=every:3,contacts=every:6";
    let flags = [
        "-N",
        "64",
        "--phi",
        "0.9",
        "--redraw",
        "0",
        "--channels",
        channels,
    ];
    let limited = [
        &["record", "--steps", "301", "-o", "limited.rrd"],
        &flags[..],
    ]
    .concat();
    assert_eq!(run(folder.path(), &limited).0, Some(3));
    good(&[
        "record",
        "--from",
        "limited.rrd",
        "--steps",
        "200000",
        "-o",
        "more.rrd",
    ]);
    good(&["join", "limited.rrd", "more.rrd", "-o", "long.rrd"]);
    assert!(bytes("long.rrd") == bytes("whole.rrd"));
    let order = ["join", "whole.rrd", "limited.rrd", "-o", "other.rrd"];
    let (code, _, errors) = run(folder.path(), &order);
    assert_eq!(code, Some(2), "{errors}");
    assert!(
        errors.contains("it ends with step 301 at the latest"),
        "{errors}"
    );
    assert!(!folder.path().join("other.rrd").exists());
}

#[test]
fn a_run_killed_among_its_recorded_disks_and_its_rest_are_joined_to_the_bytes_of_the_whole() {
    let folder = folder();
    // Cut in the first stage, and in the second.
    for share in [2, 8] {
        whole_and_cut(folder.path(), &["-f", "--record-disks", "every:7"], share);
        for format in ["rrd", "mcap"] {
            let (killed, rest) = (format!("killed.{format}"), format!("rest.{format}"));
            for line in [
                ["record", "-f", "--from", &killed, "-o", &rest],
                ["join", "-f", &killed, &rest, "-o", "joined.rrd"],
            ] {
                let (code, _, errors) = run(folder.path(), &line);
                assert_eq!(code, Some(0), "{line:?}: {errors}");
            }
            let bytes = |name: &str| fs::read(folder.path().join(name)).expect(name);
            assert!(
                bytes("joined.rrd") == bytes("whole.rrd"),
                "{format}, {share}"
            );
        }
    }
}

#[test]
fn an_interrupted_run_and_its_rest_are_joined_to_the_bytes_of_the_whole() {
    use softjam::record::{Header, Writer, record};
    use softjam::{protocol::Relaxation, scene::Scene};
    let folder = folder();
    let at = |name: &str| folder.path().join(name);
    let scene = Scene {
        particles: 64,
        phi: 0.9,
        ..Scene::default()
    };
    for (name, until) in [("whole.rrd", u64::MAX), ("interrupted.rrd", 103)] {
        let mut run = Relaxation::new(&scene).expect("a scene");
        let writer = Writer::create(at(name), false, Header::of(&scene, &run)).expect("a file");
        record(&mut run, vec![writer], &scene.channels, |run| {
            run.step() < until
        })
        .expect("a run");
    }
    // It ends with a state of a step that no schedule asks for, which the whole does not hold.
    let lines: [&[&str]; 2] = [
        &["record", "--from", "interrupted.rrd", "-o", "rest.rrd"],
        &["join", "interrupted.rrd", "rest.rrd", "-o", "joined.rrd"],
    ];
    for line in lines {
        let (code, _, errors) = run(folder.path(), line);
        assert_eq!(code, Some(0), "{errors}");
    }
    let bytes = |name: &str| fs::read(at(name)).expect(name);
    assert!(bytes("joined.rrd") == bytes("whole.rrd"));
}

#[test]
fn what_is_not_the_next_part_of_a_run_is_named_and_nothing_is_written() {
    let folder = folder();
    whole_and_cut(folder.path(), &[], 9);
    let from = |name: &str, more: &[&str]| {
        let line = ["record", "--from", "whole.rrd", "-o", name];
        let (code, _, errors) = run(folder.path(), &[&line, more].concat());
        assert_eq!(code, Some(0), "{errors}");
    };
    from("late.rrd", &["--step", "592"]);
    from("rest.rrd", &["--step", "200"]);
    from("exact.rrd", &["--step", "100", "--threshold", "1e-12"]);
    from("state.rrd", &["--step", "100", "--channels", "state"]);
    record(folder.path(), "other.rrd", &["--seed", "3"]);
    record(folder.path(), "m.rrd", &["--channels", "metrics"]);
    let whole = fs::read(folder.path().join("whole.rrd")).expect("bytes");
    fs::write(folder.path().join("half.rrd"), &whole[..whole.len() / 2]).expect("written");
    let cases: [(&[&str], i32, &str); 8] = [
        (
            &["rest.rrd", "killed.rrd"],
            2,
            "begins with step 0, before rest.rrd",
        ),
        (
            &["half.rrd", "late.rrd"],
            2,
            "the steps between are missing",
        ),
        (
            &["whole.rrd", "exact.rrd"],
            2,
            "threshold = 1e-12, that of whole.rrd has threshold = 1e-10",
        ),
        (&["whole.rrd", "state.rrd"], 2, "softjam convert"),
        (&["killed.rrd", "other.rrd"], 2, "seed = 3"),
        (&["m.rrd", "m.rrd"], 2, "holds no states"),
        (&["whole.rrd", "none.rrd"], 1, "cannot read none.rrd"),
        (&["whole.rrd"], 2, "2 values"),
    ];
    for (parts, expected, words) in cases {
        let line = [&["join"], parts, &["-o", "x.rrd"]].concat();
        let (code, _, errors) = run(folder.path(), &line);
        assert_eq!(code, Some(expected), "{parts:?}: {errors}");
        assert!(errors.contains(words), "{parts:?}: {errors}");
        assert!(!folder.path().join("x.rrd").exists(), "{parts:?}");
    }
    let line = ["join", "whole.rrd", "rest.rrd", "-f", "-o", "rest.rrd"];
    let (code, _, errors) = run(folder.path(), &line);
    assert_eq!(code, Some(2));
    assert!(errors.contains("is what is read from"), "{errors}");
}
