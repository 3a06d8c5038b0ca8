//! Start files as people have them (`tests/softjam/cases/`), and names of files that say no format.

use super::{SOFTJAM, folder, record, run};
use std::io::Write as _;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

/// A start file by its name in `cases/`.
fn case(name: &str) -> String {
    format!(
        "{}/tests/softjam/cases/{name}.csv",
        env!("CARGO_MANIFEST_DIR")
    )
}

/// Records a case with more flags into `a.rrd`; exit code, standard output, standard error.
fn start(folder: &Path, name: &str, more: &[&str]) -> (Option<i32>, String, String) {
    let file = case(name);
    let line = ["record", "--file", &file, "-f", "-o", "a.rrd"];
    run(folder, &[&line, more].concat())
}

/// Replays `a.rrd`, which must be what its scene gives.
#[track_caller]
fn verify(folder: &Path) {
    let (code, out, errors) = run(folder, &["replay", "a.rrd"]);
    assert_eq!(code, Some(0), "{out}{errors}");
}

#[test]
fn start_files_that_say_two_things_are_refused_with_both_lines() {
    let folder = folder();
    for (name, words) in [
        (
            "two-boxes",
            "line 2: two boxes, `# box = 18.388844696149878, 18.388844696149878` on line 1 and `# box = 9.194422348074939, \
             9.194422348074939` on line 2",
        ),
        (
            "one-particle-twice",
            "line 67: particle 64 (line 67, at 8.253627061359698, 7.762216719128302) stands on the point of particle 7 (line 10, ",
        ),
        (
            "both-edges",
            "line 11: particle 8 (line 11, at 8, 0) is the periodic copy of particle 0 (line 3, at 0, 0) (and 16 more such)",
        ),
        (
            "eight-at-one-point",
            "line 4: particle 1 (line 4, at 0, 0) stands on the point of particle 0 (line 3, at 0, 0) (and 6 more such), and \
             nothing says in which direction they part",
        ),
    ] {
        let begin = Instant::now();
        let (code, _, errors) = start(folder.path(), name, &[]);
        assert_eq!(code, Some(2), "{name}: {errors}");
        assert!(errors.contains(words), "{name}: {errors}");
        assert!(
            errors.contains("--separate") || name == "two-boxes",
            "{errors}"
        );
        assert!(begin.elapsed() < Duration::from_secs(5), "{name}");
        assert!(!folder.path().join("a.rrd").exists());
    }
}

#[test]
fn particles_on_one_point_are_separated_or_relaxed_on_request_and_replayed() {
    let folder = folder();
    for (name, moved) in [
        ("eight-at-one-point", "7 of 8"),
        ("both-edges", "17 of 81"),
        ("one-particle-twice", "1 of 65"),
    ] {
        for flag in ["--separate", "--relax-disks"] {
            let (code, out, errors) = start(folder.path(), name, &[flag]);
            assert_eq!(code, Some(0), "{name} {flag}: {errors}");
            assert!(out.contains("converged in"), "{out}");
            assert!(errors.contains(moved), "whoever asked is told: {errors}");
            let bytes = std::fs::read(folder.path().join("a.rrd")).expect("a.rrd");
            verify(folder.path());
            // The scene in the recording gives the recording.
            let (_, out, _) = run(folder.path(), &["info", "a.rrd", "--json"]);
            let info: serde_json::Value = serde_json::from_str(&out).expect("one JSON object");
            let scene = info["scene"].as_str().expect("the scene");
            let relaxed = format!("relax = {}", flag == "--relax-disks");
            assert!(
                scene.contains("separate = true") && scene.contains(&relaxed),
                "{scene}"
            );
            std::fs::write(folder.path().join("again.toml"), scene).expect("written");
            let (code, _, errors) = run(
                folder.path(),
                &["record", "again.toml", "-f", "-o", "b.rrd"],
            );
            assert_eq!(code, Some(0), "{errors}");
            assert!(std::fs::read(folder.path().join("b.rrd")).expect("b.rrd") == bytes);
        }
    }
}

#[test]
fn start_that_overlaps_too_far_names_the_way_out_and_the_way_leads_out() {
    let folder = folder();
    let (code, _, errors) = start(folder.path(), "power-law-radii", &[]);
    assert_eq!(code, Some(1), "{errors}");
    assert!(
        errors.contains("the forces diverged") && errors.contains("--relax-disks"),
        "{errors}"
    );
    let more = ["--relax-disks", "--every", "1000"];
    let (code, out, errors) = start(folder.path(), "power-law-radii", &more);
    assert_eq!(code, Some(0), "{errors}");
    assert!(
        out.contains("converged in") && out.contains("\ndisks "),
        "{out}"
    );
    verify(folder.path());
}

#[test]
fn commented_header_of_numpy_is_a_header() {
    let folder = folder();
    let (code, out, errors) = start(folder.path(), "numpy-savetxt", &[]);
    assert_eq!(code, Some(0), "{errors}");
    assert!(
        out.contains("N = 64, φ = 0.8800, box 9.194 × 9.194"),
        "{out}"
    );
    verify(folder.path());
}

#[test]
fn narrow_box_and_intruder_are_accepted_since_no_pair_meets_twice() {
    let folder = folder();
    let (code, out, errors) = start(folder.path(), "narrow-box", &[]);
    assert_eq!(code, Some(0), "{errors}");
    assert!(
        out.contains("N = 9, φ = 0.1473, box 20.000 × 2.400"),
        "{out}"
    );
    verify(folder.path());
    let more = ["--relax-disks", "--steps", "30"];
    let (code, out, errors) = start(folder.path(), "intruder", &more);
    assert_eq!(code, Some(3), "{errors}");
    assert!(out.contains("N = 401"), "{out}");
    verify(folder.path());
}

#[cfg(unix)]
#[test]
fn start_file_may_come_through_a_pipe() {
    let folder = folder();
    let text = std::fs::read(case("numpy-savetxt")).expect("a case");
    let (code, _, errors) = start(folder.path(), "numpy-savetxt", &[]);
    assert_eq!(code, Some(0), "{errors}");
    for name in ["-", "/dev/stdin"] {
        let mut child = Command::new(SOFTJAM)
            .current_dir(folder.path())
            .args(["record", "--file", name, "-f", "-o", "a.rrd"])
            .stdin(Stdio::piped())
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .spawn()
            .expect("softjam starts");
        let mut pipe = child.stdin.take().expect("a pipe");
        pipe.write_all(&text).expect("read to its end");
        drop(pipe);
        assert_eq!(child.wait().expect("softjam ends").code(), Some(0));
        verify(folder.path());
        let (_, out, _) = run(folder.path(), &["info", "a.rrd", "--json"]);
        let info: serde_json::Value = serde_json::from_str(&out).expect("one JSON object");
        let scene = info["scene"].as_str().expect("the scene");
        assert!(scene.contains(&format!("file = \"{name}\"")), "{scene}");
        let hash = "file_blake3 = \"427676c3c424654fd";
        assert!(scene.contains(hash), "{scene}");
    }
}

#[test]
fn flags_for_a_start_file_without_one_are_refused() {
    let folder = folder();
    record(folder.path(), "a.rrd", &[]);
    let cases: [(&[&str], &str); 3] = [
        (
            &["record", "--separate", "-o", "x.rrd"],
            "start = \"random\"",
        ),
        (
            &["record", "--from", "a.rrd", "--separate", "-o", "x.rrd"],
            "cannot be used with",
        ),
        (
            &["record", "--from", "a.rrd", "--relax-disks", "-o", "x.rrd"],
            "cannot be used with",
        ),
    ];
    for (line, words) in cases {
        let (code, _, errors) = run(folder.path(), line);
        assert_eq!(code, Some(2), "{line:?}: {errors}");
        assert!(errors.contains(words), "{line:?}: {errors}");
    }
}

#[test]
fn names_that_say_no_format_or_another_are_refused_before_anything_runs() {
    let folder = folder();
    record(folder.path(), "a.rrd", &[]);
    let both = "the name of a recording ends in .rrd (rerun) or .mcap (Foxglove)";
    let mcap = "the name of an MCAP file ends in .mcap; .rrd files are for -o";
    let figure = "a figure's name ends in .svg, .pdf or .png";
    // What would run takes minutes.
    let long = ["-N", "100000", "--threshold", "1e-300"];
    let record_into = |more: &[&'static str]| [&["record"], &long[..], more].concat();
    let cases = [
        (record_into(&["-o", "x.csv"]), both),
        (record_into(&["-o", "x"]), both),
        (record_into(&["-o", ".rrd"]), both),
        (record_into(&["-o", "x.rrd.gz"]), both),
        (record_into(&["-o", "x.csv", "--mcap", "x.mcap"]), both),
        (record_into(&["--mcap", "x.rrd"]), mcap),
        (record_into(&["--mcap", "x"]), mcap),
        (record_into(&["-o", "x.rrd", "--mcap", "x.csv"]), mcap),
        (vec!["record", "--file", "-", "-o", "x.csv"], both),
        (vec!["record", "--from", "a.rrd", "-o", "x.csv"], both),
        (vec!["convert", "a.rrd", "final.csv"], both),
        (vec!["convert", "a.rrd", "final"], both),
        (vec!["convert", "-f", "a.rrd", "final.svg"], both),
        (vec!["figure", "a.rrd", "-o", "x.rrd"], figure),
        (vec!["figure", "a.rrd", "-o", "x"], figure),
    ];
    for (line, words) in cases {
        let begin = Instant::now();
        let (code, out, errors) = run(folder.path(), &line);
        assert_eq!(code, Some(2), "{line:?}: {errors}");
        assert!(
            errors.contains(words) && out.is_empty(),
            "{line:?}: {errors}"
        );
        assert!(begin.elapsed() < Duration::from_secs(5), "{line:?}");
    }
    let files = std::fs::read_dir(folder.path()).expect("a folder").count();
    assert_eq!(files, 1, "nothing was written");
    for name in ["B.RRD", "B.MCAP", "c.mcap"] {
        record(folder.path(), name, &["--steps", "200000"]);
        let (code, _, errors) = run(folder.path(), &["replay", name]);
        assert_eq!(code, Some(0), "{errors}");
    }
    if cfg!(unix) {
        record(folder.path(), "/dev/null", &["-f"]);
        record(folder.path(), "d.rrd", &["-f", "--mcap", "/dev/null"]);
    }
}

#[test]
fn what_stands_by_symmetry_alone_is_called_a_saddle_and_left_on_request() {
    let folder = folder();
    for (name, end) in [
        ("unstable-column", "not jammed: no contact bears a force"),
        ("unstable-square", "not jammed: no contact bears a force"),
    ] {
        let (code, out, errors) = start(folder.path(), name, &[]);
        assert_eq!(code, Some(0), "{name}: {errors}");
        assert!(
            out.contains("converged in 0 steps on a saddle: balanced, but not stable"),
            "{out}"
        );
        let (_, json, _) = run(folder.path(), &["info", "a.rrd", "--json"]);
        assert!(json.contains("\"stability\": \"saddle\""), "{json}");

        let (code, out, errors) = start(folder.path(), name, &["--minimizer", "fire+newton"]);
        assert_eq!(code, Some(0), "{name}: {errors}");
        assert!(out.contains(end), "{name}: {out}");
        verify(folder.path());
    }
}

#[test]
fn below_jamming_the_result_says_so() {
    let folder = folder();
    let (code, out, errors) = run(
        folder.path(),
        &["record", "-N", "64", "--phi", "0.7", "-o", "a.rrd"],
    );
    assert_eq!(code, Some(0), "{errors}");
    assert!(
        out.contains(", not jammed: no contact bears a force"),
        "{out}"
    );
    let (_, info, _) = run(folder.path(), &["info", "a.rrd"]);
    assert!(
        info.contains("not jammed: no contact bears a force"),
        "{info}"
    );
    verify(folder.path());
}
