//! The program at its process boundary: exit codes, files, messages.

mod cases;
mod convert;
mod figures;
#[cfg(unix)]
mod files;
mod help;
mod info;
mod live;
mod parts;
mod protocol;
mod replay;
mod strangers;

use crate::common::Folder;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

/// The program under test.
const SOFTJAM: &str = env!("CARGO_BIN_EXE_softjam");

fn folder() -> Folder {
    Folder::new()
}

/// Runs `softjam` with `arguments`; returns exit code, standard output and standard error.
fn run(folder: &Path, arguments: &[&str]) -> (Option<i32>, String, String) {
    let output = Command::new(SOFTJAM)
        .current_dir(folder)
        .args(arguments)
        .output()
        .expect("softjam starts");
    let text = |bytes: Vec<u8>| String::from_utf8(bytes).expect("UTF-8");
    (
        output.status.code(),
        text(output.stdout),
        text(output.stderr),
    )
}

fn record(folder: &Path, name: &str, more: &[&str]) -> PathBuf {
    let mut arguments = vec!["record", "-N", "64", "--phi", "0.9", "-o", name];
    arguments.extend_from_slice(more);
    let (code, _, errors) = run(folder, &arguments);
    assert_eq!(code, Some(0), "{errors}");
    folder.join(name)
}

#[test]
fn without_arguments_the_default_scene_ends_up_in_softjam_rrd() {
    let folder = folder();
    let (code, out, errors) = run(folder.path(), &["record"]);
    assert_eq!(code, Some(0), "{errors}");
    assert!(folder.path().join("softjam.rrd").exists());
    for word in [
        "converged in",
        "f_max",
        "Z  ",
        "rattlers",
        "pressure",
        "energy",
        "time",
        "rerun softjam.rrd",
    ] {
        assert!(out.contains(word), "the summary lacks {word}:\n{out}");
    }
    assert_eq!(errors, "", "no progress bar unless there is a terminal");
}

#[test]
fn figures_are_drawn_of_what_is_recorded_and_what_is_not_is_named() {
    let folder = folder();
    record(folder.path(), "a.rrd", &[]);
    record(folder.path(), "b.mcap", &["--seed", "2"]);
    record(folder.path(), "m.rrd", &["--channels", "metrics"]);
    let foam = ["--model", "wet-foam"];
    record(folder.path(), "foam.rrd", &foam);
    let drawn: [&[&str]; 8] = [
        &["foam.rrd", "--films", "--color", "nothing", "-o", "f.pdf"],
        &["a.rrd", "-o", "a.svg"],
        &[
            "a.rrd", "--width", "86mm", "--range", "0.5,1.5", "-o", "a.pdf",
        ],
        &["a.rrd", "--range", "-1..3", "--disks", "-o", "e.svg"],
        &["--fmax", "a.rrd", "--width", "12cm", "-o", "d.pdf"],
        &["b.mcap", "--step", "20", "--disks", "-o", "b.png"],
        &[
            "a.rrd",
            "--color",
            "deformation",
            "--no-chains",
            "-o",
            "c.svg",
        ],
        &["--fmax", "a.rrd", "b.mcap", "m.rrd", "-o", "d.svg"],
    ];
    for arguments in drawn {
        let (code, _, errors) = run(folder.path(), &[&["figure"], arguments].concat());
        assert_eq!(code, Some(0), "{arguments:?}: {errors}");
    }
    let text = std::fs::read_to_string(folder.path().join("d.svg")).expect("d.svg");
    assert!(
        text.contains("seed 2") && !text.contains("N = 64"),
        "only what differs"
    );
    let text = std::fs::read_to_string(folder.path().join("e.svg")).expect("e.svg");
    assert!(text.contains("undeformed disks"));
    // 86 mm are 243.78 points of 1/72 inch.
    let pdf = std::fs::read(folder.path().join("a.pdf")).expect("a.pdf");
    let page = b"/MediaBox [0 0 243.78 ";
    assert!(pdf.windows(page.len()).any(|bytes| bytes == page));
    let refused: [(&[&str], &str); 12] = [
        (
            &["a.rrd", "--films", "-o", "x.svg"],
            "--films is for rounded-polygon and wet-foam",
        ),
        (&["a.rrd", "-o", "a.svg"], "a.svg exists"),
        (&["a.rrd", "-o", "x.gif"], ".svg, .pdf or .png"),
        (&["a.rrd", "--range", "2..1", "-o", "x.svg"], "is empty"),
        (&["a.rrd", "--range", "nan,1", "-o", "x.svg"], "0.5,1.5"),
        (
            &[
                "a.rrd", "--range", "0..1", "--color", "nothing", "-o", "x.svg",
            ],
            "--range is for colours",
        ),
        (&["a.rrd", "--width", "3 apples", "-o", "x.svg"], "86mm"),
        (&["a.rrd", "--width", "1e9", "-o", "x.svg"], "is outside"),
        (
            &["--fmax", "a.rrd", "--range", "0..1", "-o", "x.svg"],
            "--range",
        ),
        (
            &["a.rrd", "--step", "13", "-o", "x.svg"],
            "the nearest before it is 10",
        ),
        (&["m.rrd", "-o", "x.svg"], "holds no state"),
        (&["a.rrd", "b.mcap", "-o", "x.svg"], "--fmax"),
    ];
    for (arguments, words) in refused {
        let (code, _, errors) = run(folder.path(), &[&["figure"], arguments].concat());
        assert_eq!(code, Some(2), "{arguments:?}: {errors}");
        assert!(errors.contains(words), "{arguments:?}: {errors}");
    }
}

#[test]
fn two_runs_of_a_scene_give_the_same_bytes() {
    let folder = folder();
    let a = std::fs::read(record(folder.path(), "a.rrd", &[])).expect("a.rrd");
    let b = std::fs::read(record(folder.path(), "b.rrd", &[])).expect("b.rrd");
    assert!(a == b, "{} and {} bytes differ", a.len(), b.len());
    let c = std::fs::read(record(folder.path(), "c.rrd", &["--seed", "2"])).expect("c.rrd");
    assert!(a != c);
}

#[test]
fn an_existing_file_is_kept_unless_forced() {
    let folder = folder();
    std::fs::write(folder.path().join("a.rrd"), "precious").expect("written");
    let (code, _, errors) = run(folder.path(), &["record", "-N", "32", "-o", "a.rrd"]);
    assert_eq!(code, Some(2));
    assert!(
        errors.contains("a.rrd exists") && errors.contains("--force"),
        "{errors}"
    );
    let kept = std::fs::read_to_string(folder.path().join("a.rrd")).expect("a.rrd");
    assert_eq!(kept, "precious");
    record(folder.path(), "a.rrd", &["--force"]);
}

#[test]
fn requests_that_make_no_sense_exit_with_2_and_name_field_value_and_range() {
    let folder = folder();
    let cases: [(&[&str], &[&str]); 14] = [
        (&["--phi", "1.7"], &["phi", "1.7", "0 < phi < 1.3"]),
        (&["--phi", "-0.1"], &["phi", "-0.1", "0 < phi < 1.3"]),
        (&["--phi", "nan"], &["phi", "NaN", "0 < phi < 1.3"]),
        (&["--phi", "inf"], &["phi", "inf", "0 < phi < 1.3"]),
        (&["--particles", "0"], &["particles", "0", "particles ≥ 1"]),
        (
            &["--particles", "-5"],
            &["particles", "-5", "particles ≥ 1"],
        ),
        (&["--particles", "4"], &["particles", "4", "largest radius"]),
        (
            &["--particles", "20000000"],
            &["particles", "20000000", "10000000"],
        ),
        (&["--aspect", "0"], &["aspect", "0", "0.1 ≤ aspect ≤ 10"]),
        (&["--threshold", "0"], &["threshold", "0 < threshold"]),
        (&["--steps", "-1"], &["steps", "-1", "steps ≥ 0"]),
        (&["--every", "0"], &["every", "0", "every ≥ 1"]),
        (
            &["--channels", "colours"],
            &["colours", "contours, contacts, metrics, state"],
        ),
        (&["--start", "cubic"], &["start", "cubic", "hexagonal"]),
    ];
    for (arguments, words) in cases {
        let mut all = vec!["record", "-o", "x.rrd"];
        all.extend_from_slice(arguments);
        let (code, _, errors) = run(folder.path(), &all);
        assert_eq!(code, Some(2), "{arguments:?}: {errors}");
        for word in words {
            assert!(
                errors.contains(word),
                "{arguments:?} does not say {word}: {errors}"
            );
        }
        assert!(
            !folder.path().join("x.rrd").exists(),
            "{arguments:?} left a file"
        );
    }
}

#[test]
fn a_scene_that_cannot_fit_in_memory_is_refused_before_it_is_built() {
    let folder = folder();
    // The largest number of particles and of vertices together ask for terabytes.
    let arguments = [
        "record",
        "-N",
        "10000000",
        "--vertices",
        "4096",
        "-o",
        "x.rrd",
    ];
    let start = Instant::now();
    let (code, _, errors) = run(folder.path(), &arguments);
    assert_eq!(code, Some(2), "{errors}");
    assert!(
        errors.contains("particles = 10000000") && errors.contains("MiB"),
        "{errors}"
    );
    assert!(start.elapsed() < Duration::from_secs(5));
}

#[test]
fn a_full_disk_is_reported_with_its_step_and_exit_code_1() {
    let folder = folder();
    let (code, _, errors) = run(
        folder.path(),
        &["record", "-N", "64", "-f", "-o", "/dev/full"],
    );
    assert_eq!(code, Some(1));
    assert!(
        errors.contains("step 0: cannot write /dev/full: No space left on device"),
        "{errors}"
    );
}

#[test]
fn a_path_that_cannot_be_written_exits_with_1() {
    let folder = folder();
    let (code, _, errors) = run(
        folder.path(),
        &["record", "-N", "32", "-o", "no/such/folder.rrd"],
    );
    assert_eq!(code, Some(1));
    assert!(
        errors.contains("cannot create no/such/folder.rrd"),
        "{errors}"
    );
    let (code, _, errors) = run(folder.path(), &["record", "missing.toml"]);
    assert_eq!(code, Some(1));
    assert!(errors.contains("cannot read missing.toml"), "{errors}");
}

#[test]
fn a_step_limit_that_comes_first_exits_with_3() {
    let folder = folder();
    let (code, out, _) = run(folder.path(), &["record", "-N", "64", "--steps", "10"]);
    assert_eq!(code, Some(3));
    assert!(out.contains("not converged within 10 steps"), "{out}");
    let (code, out, _) = run(folder.path(), &["info", "softjam.rrd"]);
    assert_eq!(code, Some(3));
    assert!(out.contains("not converged within 10 steps"), "{out}");
}

#[cfg(unix)]
#[test]
fn an_interrupted_run_leaves_a_readable_recording() {
    let folder = folder();
    for signal in ["INT", "TERM"] {
        let name = format!("{signal}.rrd");
        let mut child = Command::new(SOFTJAM)
            .current_dir(folder.path())
            .args(["record", "-N", "1024", "--threshold", "1e-300", "-o", &name])
            .stdout(Stdio::piped())
            .spawn()
            .expect("softjam starts");
        // Wait until the first batch has reached the file.
        let file = folder.path().join(&name);
        let start = Instant::now();
        while std::fs::metadata(&file).map_or(0, |m| m.len()) < 2_000_000 {
            assert!(
                start.elapsed() < Duration::from_mins(1),
                "the run does not write"
            );
            std::thread::sleep(Duration::from_millis(20));
        }
        let kill = Command::new("kill")
            .args(["-s", signal, &child.id().to_string()])
            .status();
        assert!(kill.expect("kill runs").success());
        let status = child.wait().expect("softjam ends");
        assert_eq!(status.code(), Some(1));
        let (code, out, errors) = run(folder.path(), &["info", &name]);
        assert_eq!(code, Some(3), "{errors}");
        assert!(out.contains("unfinished: the run was interrupted"), "{out}");
    }
}

#[test]
fn metrics_alone_cost_no_contour_and_no_state() {
    let folder = folder();
    let full = record(folder.path(), "full.rrd", &["--redraw", "0"]);
    let metrics = record(folder.path(), "metrics.rrd", &["--channels", "metrics"]);
    let size = |p: &Path| std::fs::metadata(p).expect("a file").len();
    assert!(size(&metrics) * 5 < size(&full));
    let (_, out, _) = run(folder.path(), &["info", "metrics.rrd", "--json"]);
    let info: serde_json::Value = serde_json::from_str(&out).expect("one JSON object");
    let channels = info["channels"].as_object().expect("channels");
    assert_eq!(channels.keys().collect::<Vec<_>>(), ["metrics"]);
    assert_eq!(info["converged"], true);
}

#[test]
fn channels_follow_their_schedules_and_always_hold_the_first_and_the_last_frame() {
    let folder = folder();
    let list = "metrics=every:7,state=log:4,contacts=every:1000000";
    record(folder.path(), "a.rrd", &["--channels", list]);
    let (_, out, _) = run(folder.path(), &["info", "a.rrd", "--json"]);
    let info: serde_json::Value = serde_json::from_str(&out).expect("one JSON object");
    let last = info["steps"].as_u64().expect("steps");
    for (channel, expected) in [
        ("contacts", 2),
        ("metrics", last / 7 + 1 + u64::from(!last.is_multiple_of(7))),
    ] {
        let found = &info["channels"][channel];
        assert_eq!(found["steps"], expected, "{channel}");
        assert_eq!((&found["first"], &found["last"]), (&0.into(), &last.into()));
    }
    assert!(info["channels"]["contours"].is_null());
    // --every thins all but the metrics.
    record(folder.path(), "b.rrd", &["--every", "50"]);
    let (_, out, _) = run(folder.path(), &["info", "b.rrd", "--json"]);
    let info: serde_json::Value = serde_json::from_str(&out).expect("one JSON object");
    let last = info["steps"].as_u64().expect("steps");
    assert_eq!(info["channels"]["metrics"]["steps"], last + 1);
    let thinned = last / 50 + 1 + u64::from(!last.is_multiple_of(50));
    assert_eq!(info["channels"]["state"]["steps"], thinned);
}

#[test]
fn a_printed_scene_is_the_scene() {
    let folder = folder();
    let flags = [
        "--phi",
        "0.91",
        "-N",
        "80",
        "--start",
        "hexagonal",
        "--every",
        "3",
    ];
    let mut arguments = vec!["scene"];
    arguments.extend_from_slice(&flags);
    let (code, text, _) = run(folder.path(), &arguments);
    assert_eq!(code, Some(0));
    std::fs::write(folder.path().join("scene.toml"), &text).expect("written");
    let (_, again, _) = run(folder.path(), &["scene", "scene.toml"]);
    assert_eq!(text, again);
    let (_, changed, _) = run(folder.path(), &["scene", "scene.toml", "--phi", "0.92"]);
    assert!(
        changed.contains("phi = 0.92") && changed.contains("every 3"),
        "flags win, the rest stays"
    );
}

#[test]
fn a_scene_file_with_a_misspelt_field_is_refused_by_name() {
    let folder = folder();
    std::fs::write(folder.path().join("s.toml"), "phi = 0.9\nparticle = 7\n").expect("written");
    let (code, _, errors) = run(folder.path(), &["record", "s.toml"]);
    assert_eq!(code, Some(2));
    assert!(
        errors.contains("s.toml") && errors.contains("unknown field `particle`"),
        "{errors}"
    );
}

#[test]
fn a_start_from_a_file_is_taken_as_it_is_and_pinned_by_its_hash() {
    let folder = folder();
    let mut csv = String::from("# box = 8, 8\nx,y,radius\n");
    for k in 0..49 {
        let (x, y) = (f64::from(k % 7), f64::from(k / 7));
        writeln!(csv, "{},{},0.6", x * 8.0 / 7.0, y * 8.0 / 7.0).expect("a String grows");
    }
    std::fs::write(folder.path().join("square.csv"), &csv).expect("written");
    let (code, out, errors) = run(
        folder.path(),
        &["record", "--file", "square.csv", "-o", "a.rrd"],
    );
    assert_eq!(code, Some(0), "{errors}");
    assert!(
        out.contains("converged in 0 steps"),
        "the square crystal is in balance as it stands: {out}"
    );
    let (_, out, _) = run(folder.path(), &["info", "a.rrd", "--json"]);
    let info: serde_json::Value = serde_json::from_str(&out).expect("one JSON object");
    let scene = info["scene"].as_str().expect("the scene");
    std::fs::write(folder.path().join("again.toml"), scene).expect("written");
    std::fs::write(
        folder.path().join("square.csv"),
        csv.replace("0.6\n", "0.61\n"),
    )
    .expect("written");
    let (code, _, errors) = run(folder.path(), &["record", "again.toml", "-o", "b.rrd"]);
    assert_eq!(code, Some(2));
    assert!(
        errors.contains("square.csv") && errors.contains("BLAKE3"),
        "{errors}"
    );
}

#[test]
fn help_names_every_verb_and_the_exit_codes() {
    let folder = folder();
    let (code, out, _) = run(folder.path(), &["--help"]);
    assert_eq!(code, Some(0));
    for word in ["record", "info", "scene", "Exit codes"] {
        assert!(out.contains(word), "{out}");
    }
}
