//! `softjam replay` and `softjam record --from` at the process boundary.

use super::{SOFTJAM, folder, record, run};
use std::process::{Command, Stdio};
use std::time::Duration;

#[test]
fn replay_verifies_a_recording_and_says_so_in_words_and_in_json() {
    let folder = folder();
    record(folder.path(), "a.rrd", &[]);
    for more in [
        &[][..],
        &["--segments"],
        &["--segments", "--threads", "1"],
        &["--only", "balance"],
    ] {
        let mut arguments = vec!["replay", "a.rrd"];
        arguments.extend_from_slice(more);
        let (code, out, errors) = run(folder.path(), &arguments);
        assert_eq!(code, Some(0), "{errors}");
        assert!(out.contains("verdict        verified\n"), "{out}");
    }
    let (_, out, _) = run(folder.path(), &["replay", "a.rrd", "--json"]);
    let found: serde_json::Value = serde_json::from_str(&out).expect("one JSON object");
    assert_eq!(found["verified"], true);
    assert!(found["determinism"]["difference"].is_null() && found["unfinished"].is_null());
    assert!(
        found["balance"]["f_max"]
            .as_f64()
            .is_some_and(|f| f <= 1e-10)
    );
}

#[test]
fn replay_of_what_is_damaged_cut_or_without_state_is_no_success() {
    let folder = folder();
    let path = record(folder.path(), "a.rrd", &["--every", "1"]);
    let bytes = std::fs::read(&path).expect("bytes");
    std::fs::write(folder.path().join("cut.rrd"), &bytes[..bytes.len() - 5000]).expect("written");
    let (code, out, errors) = run(folder.path(), &["replay", "cut.rrd"]);
    assert_eq!(code, Some(1), "{errors}");
    assert!(out.contains("the file breaks off"), "{out}");
    std::fs::write(
        folder.path().join("twice.rrd"),
        [bytes.clone(), bytes].concat(),
    )
    .expect("written");
    let (code, _, errors) = run(folder.path(), &["replay", "twice.rrd"]);
    assert_eq!(code, Some(1));
    assert!(errors.contains("several files in one?"), "{errors}");
    record(folder.path(), "m.rrd", &["--channels", "metrics"]);
    let (code, _, errors) = run(folder.path(), &["replay", "m.rrd"]);
    assert_eq!(code, Some(1));
    assert!(errors.contains("holds no state"), "{errors}");
}

#[test]
fn minimiser_and_forces_are_flags_and_their_recordings_verify() {
    let folder = folder();
    record(
        folder.path(),
        "a.rrd",
        &[
            "--minimizer",
            "fire+newton",
            "--forces",
            "gradient",
            "--threshold",
            "1e-13",
        ],
    );
    let (code, out, errors) = run(folder.path(), &["replay", "a.rrd", "--json"]);
    assert_eq!(code, Some(0), "{out}{errors}");
    let found: serde_json::Value = serde_json::from_str(&out).expect("one JSON object");
    assert!(
        found["balance"]["f_max"]
            .as_f64()
            .is_some_and(|f| f <= 1e-13)
    );
    let (code, _, errors) = run(folder.path(), &["record", "--minimizer", "newton"]);
    assert_eq!(code, Some(2));
    assert!(errors.contains("fire+newton"), "{errors}");
}

#[test]
fn a_continued_run_is_the_run_that_never_stopped() {
    let folder = folder();
    record(folder.path(), "whole.rrd", &["--every", "20"]);
    let (code, _, errors) = run(
        folder.path(),
        &[
            "record",
            "--from",
            "whole.rrd",
            "--step",
            "100",
            "-o",
            "rest.rrd",
        ],
    );
    assert_eq!(code, Some(0), "{errors}");
    let (code, out, _) = run(
        folder.path(),
        &["replay", "whole.rrd", "--against", "rest.rrd"],
    );
    assert_eq!(code, Some(0), "{out}");
    assert!(
        out.contains("only here      5\nonly there     0\n"),
        "{out}"
    );
    for more in [&[][..], &["--segments"]] {
        let mut arguments = vec!["replay", "rest.rrd"];
        arguments.extend_from_slice(more);
        let (code, out, errors) = run(folder.path(), &arguments);
        assert_eq!(code, Some(0), "{out}{errors}");
        assert!(out.contains("steps 100 …"), "{out}");
    }
    let (code, _, errors) = run(
        folder.path(),
        &[
            "record",
            "--from",
            "whole.rrd",
            "--step",
            "99",
            "-o",
            "x.rrd",
        ],
    );
    assert_eq!(code, Some(2));
    assert!(
        errors.contains("step = 99") && errors.contains("80"),
        "{errors}"
    );
    let (code, _, _) = run(
        folder.path(),
        &[
            "record",
            "--from",
            "whole.rrd",
            "--phi",
            "0.8",
            "-o",
            "x.rrd",
        ],
    );
    assert_eq!(code, Some(2), "a recorded frame has its coverage");
}

#[test]
fn two_different_recordings_are_told_apart() {
    let folder = folder();
    record(folder.path(), "a.rrd", &[]);
    record(folder.path(), "b.rrd", &["--dt-max", "0.1"]);
    let (code, out, _) = run(folder.path(), &["replay", "a.rrd", "--against", "b.rrd"]);
    assert_eq!(code, Some(3));
    assert!(out.contains("differ: step 0: dt of the minimiser"), "{out}");
}

#[cfg(unix)]
#[test]
fn a_killed_run_is_verified_as_far_as_it_goes_and_can_be_finished() {
    let folder = folder();
    let flags = ["-N", "256", "--phi", "0.9", "--every", "1"];
    let whole = [&["record", "-o", "whole.rrd"][..], &flags].concat();
    assert_eq!(run(folder.path(), &whole).0, Some(0));
    let mut child = Command::new(SOFTJAM)
        .current_dir(folder.path())
        .args(["record", "-o", "killed.rrd"])
        .args(flags)
        .stdout(Stdio::null())
        .spawn()
        .expect("softjam starts");
    let file = folder.path().join("killed.rrd");
    // The first batch is in the file, with its states, and more to come.
    while std::fs::metadata(&file).map_or(0, |m| m.len()) < 20_000_000 {
        std::thread::sleep(Duration::from_millis(1));
    }
    child.kill().expect("killed");
    child.wait().expect("gone");
    let (code, out, errors) = run(folder.path(), &["replay", "killed.rrd"]);
    assert_eq!(code, Some(1), "{out}{errors}");
    assert!(out.contains("verified as far as it goes"), "{out}");
    let (code, _, errors) = run(
        folder.path(),
        &["record", "--from", "killed.rrd", "-o", "rest.rrd"],
    );
    assert_eq!(code, Some(0), "{errors}");
    let (code, out, _) = run(
        folder.path(),
        &["replay", "whole.rrd", "--against", "rest.rrd"],
    );
    assert_eq!(code, Some(0), "{out}");
    assert!(
        out.contains("only there     0"),
        "the end is the same: {out}"
    );
}
