//! Protocols at the process boundary: parts of a run, runs that go on, and what cannot be done.

use super::{folder, record, run};

const SHEAR: [&str; 4] = ["--model", "disks", "--shear", "0.02"];

fn digest(folder: &std::path::Path, name: &str) -> String {
    let (_, out, _) = run(folder, &["info", name]);
    let line = out.lines().find(|line| line.starts_with("digest"));
    line.expect("a digest").to_owned()
}

#[test]
fn parts_of_a_shear_are_joined_to_the_bytes_of_the_whole() {
    let folder = folder();
    for name in ["whole.rrd", "whole.mcap"] {
        record(folder.path(), name, &SHEAR);
        let extension = &name[5..];
        let [part, rest, joined] = ["part", "rest", "joined"].map(|n| format!("{n}{extension}"));
        let whole = std::fs::read(folder.path().join(name)).expect("a file");
        // As much as a killed run leaves.
        std::fs::write(folder.path().join(&part), &whole[..whole.len() * 2 / 3]).expect("written");
        for arguments in [
            ["record", "--from", &part, "-o", &rest].as_slice(),
            &["join", &part, &rest, "-o", &joined],
        ] {
            let (code, _, errors) = run(folder.path(), arguments);
            assert_eq!(code, Some(0), "{arguments:?}: {errors}");
        }
        assert_eq!(digest(folder.path(), &rest), digest(folder.path(), name));
        assert!(std::fs::read(folder.path().join(joined)).expect("a file") == whole);
    }
}

#[test]
fn runs_that_lean_by_half_a_side_are_read_and_verified() {
    let folder = folder();
    let more = ["--model", "disks", "--shear", "0.6", "--strain-step", "0.1"];
    record(folder.path(), "a.rrd", &more);
    for arguments in [
        ["replay", "a.rrd"].as_slice(),
        &["replay", "--segments", "a.rrd"],
    ] {
        let (code, out, errors) = run(folder.path(), arguments);
        assert_eq!(code, Some(0), "{out}{errors}");
    }
}

#[test]
fn another_protocol_is_refused_behind_what_was_done_by_one() {
    let folder = folder();
    record(folder.path(), "a.rrd", &SHEAR);
    for other in [
        ["--jam", "-q"],
        ["--shear", "0.03"],
        ["--compress-to", "0.92"],
    ] {
        let arguments = [&["record", "--from", "a.rrd", "-o", "b.rrd"], &other[..]].concat();
        let (code, _, errors) = run(folder.path(), &arguments);
        assert_eq!(code, Some(2), "{other:?}: {errors}");
        assert!(
            errors.contains("the protocol that its run has followed"),
            "{errors}"
        );
    }
    // In front of it there is nothing to differ from.
    let arguments = [
        "record", "--from", "a.rrd", "--step", "0", "--jam", "-o", "b.rrd",
    ];
    let (code, _, errors) = run(folder.path(), &arguments);
    assert_eq!(code, Some(0), "{errors}");
    let (code, out, _) = run(folder.path(), &["replay", "b.rrd"]);
    assert_eq!(code, Some(0), "{out}");
}

#[test]
fn a_state_that_does_not_relax_is_told_with_its_stage() {
    let folder = folder();
    let scene = "particles = 32\nphi = 0.9\n[[protocol]]\nact = 'shear'\nstrain = 0.01\nsteps = 5";
    std::fs::write(folder.path().join("a.toml"), scene).expect("written");
    let (code, out, _) = run(folder.path(), &["record", "a.toml", "-o", "a.rrd"]);
    assert_eq!(code, Some(3), "{out}");
    assert!(
        out.contains("the stage \"shear\" is not relaxed after the 5 steps"),
        "{out}"
    );
    let (code, out, _) = run(folder.path(), &["replay", "a.rrd"]);
    assert_eq!(code, Some(0), "{out}");
}
