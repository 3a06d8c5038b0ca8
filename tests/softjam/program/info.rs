//! `softjam info`: exit codes for scripts, numbers as numbers, tables; and `--quiet`.

use super::{folder, record, run};
use crate::common::Random;
use crate::hostile::mcap_record;
use crate::mcap::mcap_records;
use serde_json::Value;
use softjam::protocol::Relaxation;
use softjam::record::{Header, Writer, record as record_run};
use softjam::scene::Scene;
use std::fs;
use std::path::Path;

/// A recording for each way to end, of either format, with its exit code and its status.
fn one_of_each(folder: &Path) -> Vec<(String, i32, &'static str)> {
    let mut files = Vec::new();
    for format in ["rrd", "mcap"] {
        let name = |kind: &str| format!("{kind}.{format}");
        let whole = record(folder, &name("converged"), &["--every", "1"]);
        let bytes = fs::read(whole).expect("bytes");
        fs::write(folder.join(name("cut")), &bytes[..bytes.len() * 2 / 3]).expect("written");
        let limited = [
            "record",
            "-N",
            "64",
            "--steps",
            "10",
            "-o",
            &name("limited"),
        ];
        assert_eq!(run(folder, &limited).0, Some(3));
        let scene = Scene {
            particles: 64,
            phi: 0.9,
            ..Scene::default()
        };
        let mut relaxation = Relaxation::new(&scene).expect("a scene");
        let header = Header::of(&scene, &relaxation);
        let path = folder.join(name("interrupted"));
        let writer = Writer::create(path, false, header).expect("a file");
        let goes_on = |run: &Relaxation| run.step() < 53;
        record_run(&mut relaxation, vec![writer], &scene.channels, goes_on).expect("a run");
        files.extend([
            (name("converged"), 0, "converged"),
            (name("limited"), 3, "step-limit"),
            (name("interrupted"), 3, "interrupted"),
            (name("cut"), 3, "broken-off"),
        ]);
    }
    files
}

#[test]
fn info_tells_scripts_how_a_run_ended_by_its_exit_code_and_in_one_word() {
    let folder = folder();
    for (name, expected, status) in one_of_each(folder.path()) {
        let (code, out, errors) = run(folder.path(), &["info", &name, "--json"]);
        assert_eq!(code, Some(expected), "{name}: {errors}");
        let info: Value = serde_json::from_str(&out).expect("one JSON object");
        assert_eq!(info["status"], status, "{name}");
        let (code, _, _) = run(folder.path(), &["info", &name]);
        assert_eq!(code, Some(expected), "{name}");
    }
}

#[test]
fn info_gives_numbers_as_numbers() {
    let folder = folder();
    record(folder.path(), "a.rrd", &["--seed", "18446744073709551615"]);
    let (_, out, _) = run(folder.path(), &["info", "a.rrd", "--json"]);
    let info: Value = serde_json::from_str(&out).expect("one JSON object");
    assert_eq!(info["seed"].as_u64(), Some(u64::MAX));
    assert_eq!(info["particles"].as_u64(), Some(64));
    assert!((info["phi"].as_f64().expect("a number") - 0.9).abs() < 1e-12);
    assert_eq!(info["model"], "morse-witten");
    assert_eq!(info["file"], "a.rrd");
    let csv = "# box = 6, 6\nx,y,radius\n1,1,0.5\n2,1,0.5\n";
    fs::write(folder.path().join("p.csv"), csv).expect("written");
    let (code, _, errors) = run(folder.path(), &["record", "--file", "p.csv", "-o", "b.rrd"]);
    assert_eq!(code, Some(0), "{errors}");
    let (_, out, _) = run(folder.path(), &["info", "b.rrd", "--json"]);
    let info: Value = serde_json::from_str(&out).expect("one JSON object");
    assert!(info["seed"].is_null(), "a start from a file has none");
}

#[test]
fn info_of_several_files_is_a_table_and_a_bad_one_stops_no_other() {
    let folder = folder();
    record(folder.path(), "a.rrd", &[]);
    record(folder.path(), "b, the second.mcap", &["--seed", "7"]);
    fs::write(folder.path().join("bad.rrd"), "no recording").expect("written");
    let limited = ["record", "-N", "32", "--steps", "10", "-o", "c.rrd"];
    assert_eq!(run(folder.path(), &limited).0, Some(3));
    let files = ["info", "a.rrd", "bad.rrd", "b, the second.mcap", "c.rrd"];
    let (code, out, errors) = run(folder.path(), &files);
    assert_eq!(code, Some(1));
    assert!(errors.contains("bad.rrd is not a recording"), "{errors}");
    let lines: Vec<&str> = out.lines().collect();
    assert_eq!(lines.len(), 5, "{out}");
    for (line, words) in lines.iter().zip([
        &["file", "status", "phi", "f_max"][..],
        &["a.rrd", "converged", "0.9000"],
        &["bad.rrd", "unreadable"],
        &["b, the second.mcap", "converged", " 7 "],
        &["c.rrd", "step-limit", " 10 "],
    ]) {
        for word in words {
            assert!(line.contains(word), "no {word} in {line}");
        }
    }
    let widths = lines.iter().map(|line| line.chars().count());
    assert_eq!(widths.clone().min(), widths.max(), "{out}");
    // As CSV with every digit, as JSON with everything.
    let (code, csv, _) = run(folder.path(), &[&files[..], &["--csv"]].concat());
    assert_eq!(code, Some(1));
    let rows: Vec<&str> = csv.lines().collect();
    assert!(
        rows[0].starts_with("file,status,stability,model,particles,phi,seed,steps,f_max"),
        "{csv}"
    );
    assert_eq!(rows[2], "bad.rrd,unreadable,,,,,,,,,,,");
    assert!(rows[3].starts_with("\"b, the second.mcap\",converged,minimum,morse-witten,64,"));
    let (code, json, _) = run(folder.path(), &[&files[..], &["--json"]].concat());
    assert_eq!(code, Some(1));
    let all: Value = serde_json::from_str(&json).expect("an array");
    assert_eq!(all.as_array().map(Vec::len), Some(4));
    assert!(
        all[1]["damage"]
            .as_str()
            .is_some_and(|text| text.contains("bad.rrd"))
    );
    let cells: Vec<&str> = rows[1].split(',').collect();
    let energy = format!("\"energy\": {}", cells[11]);
    assert!(json.contains(&energy), "every digit: {energy}");
    // Nothing bad, but not all of them converged.
    let (code, _, _) = run(folder.path(), &["info", "a.rrd", "c.rrd"]);
    assert_eq!(code, Some(3));
    let (code, out, _) = run(folder.path(), &["info", "a.rrd", "a.rrd", "--csv"]);
    assert_eq!((code, out.lines().count()), (Some(0), 3));
    let (code, out, _) = run(folder.path(), &["info", "a.rrd", "--csv"]);
    assert_eq!((code, out.lines().count()), (Some(0), 2));
}

#[test]
fn a_quiet_program_tells_results_and_errors_alone() {
    let folder = folder();
    // It would warn of the squeeze of its particles.
    let lines: [&[&str]; 5] = [
        &["record", "-q", "-N", "64", "--phi", "0.9", "-o", "a.rrd"],
        &["--quiet", "convert", "a.rrd", "a.mcap"],
        &["join", "a.rrd", "a.mcap", "-o", "b.rrd", "--quiet"],
        &["figure", "a.rrd", "-o", "a.svg", "-q"],
        &["manual", "--pages", "pages", "-q"],
    ];
    for line in lines {
        let (code, out, errors) = run(folder.path(), line);
        assert_eq!((code, &*out, &*errors), (Some(0), "", ""), "{line:?}");
    }
    for line in [
        &["info", "-q", "a.rrd"][..],
        &["replay", "-q", "a.rrd"],
        &["scene", "-q"],
    ] {
        let (code, out, errors) = run(folder.path(), line);
        assert_eq!((code, &*errors), (Some(0), ""), "{line:?}");
        assert!(!out.is_empty(), "{line:?}");
    }
    let (code, out, errors) = run(folder.path(), &["record", "-q", "-o", "a.rrd"]);
    assert_eq!((code, &*out), (Some(2), ""));
    assert!(errors.starts_with("error: a.rrd exists"), "{errors}");
    let (_, _, errors) = run(folder.path(), &["record", "-N", "64", "--phi", "0.9"]);
    assert!(errors.starts_with("warning: "), "{errors}");
}

#[test]
fn a_scene_file_that_is_no_text_makes_no_sense_and_its_line_is_named() {
    let folder = folder();
    fs::write(folder.path().join("s.toml"), b"phi = 0.9\n# caf\xe9\n").expect("written");
    for verb in ["record", "scene"] {
        let (code, _, errors) = run(folder.path(), &[verb, "s.toml"]);
        assert_eq!(code, Some(2), "{errors}");
        assert!(
            errors.contains("s.toml") && errors.contains("line 2"),
            "{errors}"
        );
    }
}

/// What a program makes of an MCAP file that was cut, when it recovers what is whole: closed, with its own name in it.
fn recovered(bytes: &[u8]) -> Vec<u8> {
    const MAGIC: &[u8] = b"\x89MCAP0\r\n";
    let records = mcap_records(bytes);
    let (first, whole) = (records[1], records[records.len() - 1]);
    let header = [&[0; 4], &9_u32.to_le_bytes()[..], b"recoverer"].concat();
    [
        MAGIC,
        &mcap_record(1, &header),
        &bytes[first..whole],
        &mcap_record(15, &[0; 4]),
        &mcap_record(2, &[0; 20]),
        MAGIC,
    ]
    .concat()
}

#[test]
fn an_mcap_file_that_was_cut_and_recovered_is_incomplete_as_the_cut_one_is() {
    let folder = folder();
    let whole = record(folder.path(), "whole.mcap", &["--every", "1"]);
    let bytes = fs::read(whole).expect("bytes");
    let cut = &bytes[..bytes.len() * 2 / 3];
    fs::write(folder.path().join("cut.mcap"), cut).expect("written");
    fs::write(folder.path().join("recovered.mcap"), recovered(cut)).expect("written");
    for name in ["cut.mcap", "recovered.mcap"] {
        let (code, out, errors) = run(folder.path(), &["replay", name]);
        assert_eq!(code, Some(1), "{out}{errors}");
        assert!(out.contains("verified as far as it goes"), "{out}");
        let (code, out, _) = run(folder.path(), &["info", name, "--json"]);
        assert_eq!(code, Some(3));
        assert!(out.contains("\"status\": \"broken-off\""), "{out}");
    }
    let (_, out, _) = run(folder.path(), &["replay", "recovered.mcap"]);
    assert!(out.contains("incomplete: no result behind step"), "{out}");
}

#[test]
fn what_is_left_of_an_mcap_file_is_the_runs_wherever_it_was_cut() {
    let folder = folder();
    let whole = record(folder.path(), "whole.mcap", &["--every", "1"]);
    let bytes = fs::read(whole).expect("bytes");
    let mut random = Random::new(23);
    for _ in 0..12 {
        let length = bytes.len() / 4 + random.below(bytes.len() * 3 / 4 - 1);
        fs::write(folder.path().join("cut.mcap"), &bytes[..length]).expect("written");
        let (code, out, errors) = run(folder.path(), &["replay", "cut.mcap"]);
        assert_eq!(code, Some(1), "{length}: {out}{errors}");
        assert!(
            out.contains("verified as far as it goes"),
            "{length}: {out}"
        );
    }
}
