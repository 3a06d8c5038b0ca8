//! MCAP and `softjam convert` at the process boundary.

use super::{folder, record, run};

#[test]
fn a_conversion_to_channels_out_of_range_makes_no_sense() {
    let folder = folder();
    let (code, _, errors) = run(folder.path(), &["record", "-N", "16", "-o", "a.rrd"]);
    assert_eq!(code, Some(0), "{errors}");
    for redraw in ["2", "-1", "nan"] {
        let line = ["convert", "a.rrd", "b.rrd", "--redraw", redraw];
        let (code, _, errors) = run(folder.path(), &line);
        assert_eq!(code, Some(2), "{errors}");
        assert!(errors.contains("0 ≤ redraw ≤ 1"), "{errors}");
        assert!(!folder.path().join("b.rrd").exists());
    }
}

#[test]
fn one_run_writes_either_format_or_both() {
    let folder = folder();
    record(folder.path(), "a.rrd", &["--mcap", "a.mcap"]);
    record(folder.path(), "b.mcap", &[]);
    let bytes = |name: &str| std::fs::read(folder.path().join(name)).expect(name);
    assert!(bytes("a.mcap") == bytes("b.mcap"));
    let (code, out, _) = run(folder.path(), &["record", "-N", "32", "--mcap", "c.mcap"]);
    assert_eq!(code, Some(0));
    assert!(
        out.contains("c.mcap (") && out.contains("Foxglove"),
        "{out}"
    );
    assert!(!folder.path().join("softjam.rrd").exists());
    let both = ["record", "-o", "d.mcap", "--mcap", "d.mcap"];
    let (code, _, errors) = run(folder.path(), &both);
    assert_eq!(code, Some(2));
    assert!(errors.contains("d.mcap is named twice"), "{errors}");
}

#[test]
fn every_verb_takes_either_format() {
    let folder = folder();
    record(folder.path(), "a.rrd", &["--mcap", "a.mcap"]);
    let (code, out, errors) = run(folder.path(), &["replay", "a.mcap"]);
    assert_eq!(code, Some(0), "{errors}");
    assert!(out.contains("verdict        verified\n"), "{out}");
    let across = ["replay", "a.mcap", "--against", "a.rrd"];
    let (code, out, _) = run(folder.path(), &across);
    assert_eq!(code, Some(0), "{out}");
    let info = |name: &str| {
        let (code, out, _) = run(folder.path(), &["info", name, "--json"]);
        assert_eq!(code, Some(0));
        out.replace(name, "NAME")
    };
    assert_eq!(info("a.rrd"), info("a.mcap"));
    let on = ["record", "--from", "a.mcap", "--step", "100", "-o", "b.rrd"];
    let (code, _, errors) = run(folder.path(), &on);
    assert_eq!(code, Some(0), "{errors}");
    let (code, out, _) = run(folder.path(), &["replay", "a.mcap", "--against", "b.rrd"]);
    assert_eq!(code, Some(0), "{out}");
}

#[test]
fn convert_goes_there_and_back_slims_and_rebuilds() {
    let folder = folder();
    record(folder.path(), "a.rrd", &[]);
    let steps: [&[&str]; 5] = [
        &["a.rrd", "b.mcap"],
        &["b.mcap", "c.rrd"],
        &["a.rrd", "small.rrd", "--channels", "state"],
        &[
            "small.rrd",
            "d.rrd",
            "--channels",
            "contours,contacts,metrics,state",
        ],
        &["d.rrd", "d.rrd.bak.mcap", "--every", "50"],
    ];
    for step in steps {
        let mut arguments = vec!["convert"];
        arguments.extend_from_slice(step);
        let (code, out, errors) = run(folder.path(), &arguments);
        assert_eq!(code, Some(0), "{step:?}: {errors}");
        assert!(out.contains(step[1]), "{out}");
    }
    let bytes = |name: &str| std::fs::read(folder.path().join(name)).expect(name);
    assert!(bytes("a.rrd") == bytes("c.rrd"));
    assert!(bytes("a.rrd") == bytes("d.rrd"));
    assert!(bytes("small.rrd").len() * 3 < bytes("a.rrd").len());
    for name in ["small.rrd", "d.rrd.bak.mcap"] {
        let (code, out, _) = run(folder.path(), &["replay", name]);
        assert_eq!(code, Some(0), "{name}: {out}");
    }
}

#[test]
fn what_convert_cannot_do_is_said_before_a_file_is_made() {
    let folder = folder();
    record(folder.path(), "a.rrd", &[]);
    record(folder.path(), "m.rrd", &["--channels", "metrics,contours"]);
    std::fs::write(folder.path().join("text.rrd"), "not a recording").expect("written");
    let cases: [(&[&str], i32, &str); 6] = [
        (&["a.rrd", "a.rrd"], 2, "is what is read from"),
        (&["a.rrd", "m.rrd"], 2, "m.rrd exists"),
        (&["m.rrd", "x.mcap"], 2, "--channels metrics"),
        (&["text.rrd", "x.mcap"], 1, "is not a recording"),
        (&["none.rrd", "x.mcap"], 1, "cannot read none.rrd"),
        (&["a.rrd", "none/x.mcap"], 1, "cannot create none/x.mcap"),
    ];
    for (names, expected, words) in cases {
        let mut arguments = vec!["convert"];
        arguments.extend_from_slice(names);
        let (code, _, errors) = run(folder.path(), &arguments);
        assert_eq!(code, Some(expected), "{names:?}: {errors}");
        assert!(errors.contains(words), "{names:?}: {errors}");
        assert!(!folder.path().join("x.mcap").exists(), "{names:?}");
    }
}

#[test]
fn a_file_that_breaks_off_is_converted_with_a_word_about_it() {
    let folder = folder();
    let path = record(folder.path(), "a.mcap", &["--every", "1"]);
    let bytes = std::fs::read(&path).expect("bytes");
    std::fs::write(folder.path().join("cut.mcap"), &bytes[..bytes.len() / 2]).expect("written");
    let (code, out, errors) = run(folder.path(), &["convert", "cut.mcap", "whole.rrd"]);
    assert_eq!(code, Some(1), "{out}");
    assert!(
        errors.contains("cut.mcap breaks off; whole.rrd is whole up to step"),
        "{errors}"
    );
    let (code, out, _) = run(folder.path(), &["replay", "whole.rrd"]);
    assert_eq!(code, Some(0), "{out}");
}
