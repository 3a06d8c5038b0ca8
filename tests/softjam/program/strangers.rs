//! Files from strangers at the process boundary: what they say is shown as text and nothing else, what they claim is bounded.

use super::{folder, record, run};
use std::time::{Duration, Instant};

/// Characters that a terminal obeys instead of showing, line breaks apart.
fn is_quiet(text: &str) -> bool {
    let obeyed = |c: char| c.is_control() && c != '\n' || ('\u{202a}'..='\u{202e}').contains(&c);
    !text.contains(obeyed)
}

const NAME: &str = "a\nverdict        verified\u{1b}[2J\u{202e}";

#[test]
fn names_of_files_reach_neither_terminal_nor_json_nor_figures_as_they_are() {
    let folder = folder();
    let name = |ending: &str| format!("{NAME}.{ending}");
    let csv = "# box = 4, 4\nx,y,radius\n1,1,0.7\n2.3,1,0.7\n1,2.3,0.7\n";
    std::fs::write(folder.path().join(name("csv")), csv).expect("written");
    let (rrd, svg, csv) = (name("rrd"), name("svg"), name("csv"));
    let lines: [&[&str]; 11] = [
        &["record", "--file", &csv, "--steps", "9", "-o", &rrd],
        &["record", "--file", &csv, "--steps", "9", "-o", &rrd],
        &["info", &rrd],
        &["info", &rrd, "--json"],
        &["figure", &rrd, "-o", &svg],
        &["figure", "--fmax", &rrd, &rrd, "-o", &svg, "-f"],
        &["convert", &rrd, &name("mcap")],
        &["info", &svg],
        &["info", &name("none")],
        &["record", &svg],
        &["scene", "--file", &csv],
    ];
    for line in lines {
        let (_, out, errors) = run(folder.path(), line);
        assert!(!(out.clone() + &errors).is_empty(), "{line:?}");
        assert!(
            is_quiet(&out) && is_quiet(&errors),
            "{line:?}: {out}{errors}"
        );
        let forged = |text: &str| text.lines().any(|l| l.starts_with("verdict"));
        assert!(!forged(&out) && !forged(&errors), "{line:?}: {out}{errors}");
    }
    let svg = std::fs::read_to_string(folder.path().join(svg)).expect("drawn");
    assert!(is_quiet(&svg), "{svg}");
}

#[test]
fn scene_files_that_are_no_text_or_too_long_are_refused() {
    let folder = folder();
    let path = folder.path();
    std::fs::write(path.join("long.toml"), "# long\n".repeat(1 << 18)).expect("written");
    std::fs::write(path.join("latin.toml"), b"# Gr\xf6\xdfe\nphi = 0.9\n").expect("written");
    std::fs::write(path.join("escape.toml"), "phi = 0.9\nx\u{1b}[2J = 1\n").expect("written");
    let mut refused = vec![
        ("long.toml", "longer than 1048576 bytes"),
        ("latin.toml", "byte 4 is not UTF-8"),
        ("escape.toml", "line 2"),
    ];
    if cfg!(unix) {
        refused.push(("/dev/zero", "longer than 1048576 bytes"));
    }
    for (scene, words) in refused {
        let begin = Instant::now();
        let (code, _, errors) = run(path, &["record", scene, "-o", "x.rrd"]);
        assert_eq!(code, Some(2), "{scene}: {errors}");
        assert!(
            errors.contains(words) && errors.contains(scene),
            "{scene}: {errors}"
        );
        assert!(
            is_quiet(&errors) && errors.len() < 2000,
            "{scene}: {errors}"
        );
        assert!(begin.elapsed() < Duration::from_secs(2), "{scene}");
    }
}

#[test]
fn start_files_that_never_end_or_do_not_fit_are_refused() {
    let folder = folder();
    let path = folder.path();
    if cfg!(unix) {
        let (code, _, errors) = run(path, &["record", "--file", "/dev/zero", "-o", "x.rrd"]);
        assert_eq!(code, Some(2), "{errors}");
        assert!(errors.contains("byte 0 is 0"), "{errors}");
    }
    std::fs::write(path.join("a.csv"), "0,0,1\n".repeat(1000)).expect("written");
    let line = [
        "record", "--file", "a.csv", "--memory", "10K", "-o", "x.rrd",
    ];
    let (code, _, errors) = run(path, &line);
    assert_eq!(code, Some(2), "{errors}");
    assert!(errors.contains("1.2 KiB, of --memory"), "{errors}");
}

#[test]
fn every_verb_that_reads_keeps_to_the_memory_it_is_given() {
    let folder = folder();
    let path = folder.path();
    record(path, "a.rrd", &["--mcap", "a.mcap"]);
    for file in ["a.rrd", "a.mcap"] {
        let verbs: [&[&str]; 5] = [
            &["info", file],
            &["replay", file],
            &["convert", file, "b.rrd", "-f"],
            &["figure", file, "-o", "b.svg", "-f"],
            &["record", "--from", file, "-o", "c.rrd", "-f"],
        ];
        for verb in verbs {
            let little = [verb, &["--memory", "64K"]].concat();
            let (code, _, errors) = run(path, &little);
            assert_eq!(code, Some(1), "{little:?}: {errors}");
            assert!(
                errors.contains("8.0 KiB, of --memory")
                    || errors.contains("the 64.0 KiB of --memory"),
                "{little:?}: {errors}"
            );
            let enough = [verb, &["--memory", "1G"]].concat();
            let (code, _, errors) = run(path, &enough);
            assert_eq!(code, Some(0), "{enough:?}: {errors}");
        }
    }
    let (code, _, errors) = run(path, &["info", "a.rrd", "--memory", "much"]);
    assert_eq!(code, Some(2));
    assert!(errors.contains("such as 2G"), "{errors}");
    let (code, _, errors) = run(path, &["record", "--memory", "1M", "-o", "x.rrd"]);
    assert_eq!(code, Some(2));
    assert!(
        errors.contains("particles = 256") && errors.contains("1 MiB"),
        "{errors}"
    );
}
