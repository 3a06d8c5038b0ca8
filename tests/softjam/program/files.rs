//! No file is lost: what was there stays until something better is whole, and nobody writes on what another writes.

use super::{SOFTJAM, folder, record, run};
use crate::common::Random;
use softjam::record::NewFile;
use std::ffi::OsStr;
use std::fmt::Write as _;
use std::fs;
use std::os::unix::ffi::OsStrExt as _;
use std::os::unix::fs::symlink;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};

const FORMATS: [&str; 2] = ["rrd", "mcap"];

/// A run that ends by its step limit alone, some tenths of a second later.
const LONG: [&str; 6] = ["-N", "64", "--threshold", "1e-300", "--steps", "30000"];

/// A run that does not end.
const ENDLESS: [&str; 6] = [
    "-N",
    "256",
    "--threshold",
    "1e-300",
    "--steps",
    "1000000000",
];

fn start(folder: &Path, arguments: &[&str]) -> Child {
    Command::new(SOFTJAM)
        .current_dir(folder)
        .args(arguments)
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("softjam starts")
}

/// Waits until there is a file of this name.
fn wait_for(path: &Path) {
    let begin = Instant::now();
    while !path.exists() {
        assert!(begin.elapsed().as_secs() < 60, "no {}", path.display());
        sleep(Duration::from_micros(200));
    }
}

fn interrupt(child: &mut Child) -> Option<i32> {
    let kill = Command::new("kill")
        .args(["-s", "INT", &child.id().to_string()])
        .stderr(Stdio::null())
        .status();
    kill.expect("kill runs");
    child.wait().expect("softjam ends").code()
}

/// The digest of the last state, as `info` prints it.
fn digest(folder: &Path, name: &str) -> String {
    let (_, out, errors) = run(folder, &["info", name]);
    let line = out.lines().find(|line| line.starts_with("digest"));
    line.unwrap_or_else(|| panic!("{name} holds no state: {errors}"))
        .to_owned()
}

fn parts(folder: &Path) -> Vec<String> {
    let names = fs::read_dir(folder).expect("a folder");
    let names = names.map(|entry| entry.expect("an entry").file_name().display().to_string());
    names.filter(|name| name.contains(".part")).collect()
}

#[track_caller]
fn assert_kept(folder: &Path, name: &str) {
    let kept = fs::read_to_string(folder.join(name)).expect(name);
    assert_eq!(kept, "precious", "{name}");
    assert!(parts(folder).is_empty(), "{:?}", parts(folder));
}

#[test]
fn of_two_writers_of_one_file_one_is_refused_and_the_file_is_the_others() {
    let folder = folder();
    for k in 0..20 {
        let name = format!("{k}.{}", FORMATS[k % 2]);
        if k % 4 > 1 {
            // What a killed run has left is in nobody's way.
            fs::write(folder.path().join(format!("{name}.part")), "left").expect("written");
        }
        let arguments = ["record", "-N", "128", "-o", &name];
        let both = [0; 2].map(|_| start(folder.path(), &arguments));
        let both = both.map(|child| child.wait_with_output().expect("softjam ends"));
        let mut codes = [&both[0], &both[1]].map(|output| output.status.code());
        codes.sort_unstable();
        assert_eq!(codes, [Some(0), Some(2)], "{both:?}");
        let refused = both.iter().find(|output| output.status.code() == Some(2));
        let errors = String::from_utf8_lossy(&refused.expect("one").stderr);
        assert!(
            errors.contains("another file") && errors.contains(&name),
            "{errors}"
        );
        let (code, out, _) = run(folder.path(), &["replay", &name]);
        assert_eq!(code, Some(0), "{name}: {out}");
    }
    assert!(parts(folder.path()).is_empty());
}

#[test]
fn a_file_that_is_being_written_is_not_replaced_even_if_forced() {
    let folder = folder();
    record(folder.path(), "source.rrd", &[]);
    let tried: [&[&str]; 3] = [
        &["record", "-f", "-N", "32", "-o"],
        &["convert", "-f", "source.rrd"],
        &["figure", "-f", "source.rrd", "-o"],
    ];
    for (verb, name) in tried.iter().zip(["a.mcap", "b.rrd", "c.svg"]) {
        // Before it takes its place, and while it is written on behind that.
        let file = NewFile::create(folder.path().join(name), false).expect("a new file");
        for locked in [
            format!("{name}.part is locked"),
            format!("{name} is locked"),
        ] {
            let (code, _, errors) = run(folder.path(), &[verb, &[name][..]].concat());
            assert_eq!(code, Some(2), "{errors}");
            let said = format!("{name} is being written by another softjam");
            assert!(
                errors.contains(&said) && errors.contains(&locked),
                "{errors}"
            );
            file.publish().expect("published");
        }
    }
    assert!(parts(folder.path()).is_empty());
}

#[test]
fn a_killed_run_leaves_a_state_that_it_can_go_on_from_to_the_same_end() {
    let folder = folder();
    let mut random = Random::new(9);
    let whole = [&["record", "-o", "whole.rrd"], &LONG[..]].concat();
    let begin = Instant::now();
    assert_eq!(run(folder.path(), &whole).0, Some(3));
    let took = begin.elapsed().as_secs_f64();
    let end = digest(folder.path(), "whole.rrd");
    for k in 0..10 {
        let name = format!("{k}.{}", FORMATS[k % 2]);
        // At a random moment of the run, or the moment it appears.
        let moment = if k < 2 { 0.0 } else { random.within(0.0, took) };
        let mut child = start(
            folder.path(),
            &[&["record", "-o", &name], &LONG[..]].concat(),
        );
        wait_for(&folder.path().join(&name));
        sleep(Duration::from_secs_f64(moment));
        child.kill().expect("killed");
        child.wait().expect("gone");
        let rest = format!("rest.{name}");
        let (code, _, errors) = run(folder.path(), &["record", "--from", &name, "-o", &rest]);
        assert_eq!(code, Some(3), "{name}: {errors}");
        assert_eq!(digest(folder.path(), &rest), end, "{name}");
    }
}

#[test]
fn an_old_file_outlives_a_recording_that_fails_before_its_first_state() {
    let folder = folder();
    let least = ["-N", "256", "--redraw", "0", "--every", "1"];
    for format in FORMATS {
        let name = format!("old.{format}");
        fs::write(folder.path().join(&name), "precious").expect("written");
        // A disk that is full is a file that may not grow. In blocks of 512 bytes: less than a header, more than a state.
        for (blocks, first) in [(8, false), (1200, true)] {
            let script = format!(
                "trap '' XFSZ; ulimit -f {blocks}; exec '{SOFTJAM}' record -f -o {name} {}",
                least.join(" ")
            );
            let output = Command::new("sh")
                .current_dir(folder.path())
                .args(["-c", &script])
                .output()
                .expect("sh runs");
            let errors = String::from_utf8_lossy(&output.stderr);
            assert_eq!(output.status.code(), Some(1), "{errors}");
            assert!(errors.contains(&format!("cannot write {name}")), "{errors}");
            if first {
                assert!(errors.contains("is whole up to step"), "{errors}");
                digest(folder.path(), &name);
            } else {
                assert!(errors.contains("no file was made or replaced"), "{errors}");
                assert_kept(folder.path(), &name);
            }
        }
        assert!(parts(folder.path()).is_empty());
    }
    // A run that cannot begin: not a packing, and an interruption while the disks relax.
    fs::write(folder.path().join("old.rrd"), "precious").expect("written");
    fs::write(folder.path().join("no.csv"), "x,y\n").expect("written");
    let bad = ["record", "-f", "--file", "no.csv", "-o", "old.rrd"];
    assert_eq!(run(folder.path(), &bad).0, Some(2));
    assert_kept(folder.path(), "old.rrd");
    let mut child = start(
        folder.path(),
        &["record", "-f", "-N", "200000", "-o", "old.rrd"],
    );
    wait_for(&folder.path().join("old.rrd.part"));
    assert_eq!(interrupt(&mut child), Some(1));
    assert_kept(folder.path(), "old.rrd");
}

#[test]
fn a_forced_recording_replaces_the_old_file_with_its_first_state_and_goes_on_in_it() {
    let folder = folder();
    let path = folder.path().join("a.rrd");
    fs::write(&path, "precious").expect("written");
    let mut child = start(
        folder.path(),
        &[&["record", "-f", "-o", "a.rrd"], &ENDLESS[..]].concat(),
    );
    let begin = Instant::now();
    loop {
        let found = fs::read(&path).expect("there is always a file");
        if found != b"precious" {
            digest(folder.path(), "a.rrd");
            if found.len() > 2_000_000 {
                break;
            }
        }
        assert!(begin.elapsed().as_secs() < 60, "the run does not write");
    }
    let mine = [&["record", "-f", "-o", "./a.rrd"], &ENDLESS[..]].concat();
    let (code, _, errors) = run(folder.path(), &mine);
    assert_eq!(code, Some(2), "{errors}");
    assert!(errors.contains("is being written"), "{errors}");
    assert_eq!(interrupt(&mut child), Some(1));
    let (code, out, _) = run(folder.path(), &["replay", "--only", "balance", "a.rrd"]);
    assert!(out.contains("interrupted"), "{code:?} {out}");
    assert!(parts(folder.path()).is_empty());
}

#[test]
fn an_interrupted_conversion_or_figure_leaves_the_old_file_and_nothing_else() {
    let folder = folder();
    let flags = ["-N", "1024", "--channels", "metrics,state=every:1"];
    let (code, _, errors) = run(
        folder.path(),
        &[&["record", "-o", "a.rrd"], &flags[..]].concat(),
    );
    assert_eq!(code, Some(0), "{errors}");
    let lines: [(&str, &[&str]); 2] = [
        (
            "old.mcap",
            &[
                "convert",
                "-f",
                "a.rrd",
                "old.mcap",
                "--redraw",
                "0",
                "--channels",
                "contours",
            ],
        ),
        ("old.png", &["figure", "-f", "a.rrd", "-o", "old.png"]),
    ];
    for (name, line) in lines {
        // A machine that is busy elsewhere may come too late for a figure.
        let interrupted = (0..10).any(|_| {
            fs::write(folder.path().join(name), "precious").expect("written");
            let mut child = start(folder.path(), line);
            let part = folder.path().join(format!("{name}.part"));
            while !part.exists() && child.try_wait().expect("a child").is_none() {
                sleep(Duration::from_micros(200));
            }
            interrupt(&mut child) == Some(1)
        });
        assert!(interrupted, "{name} is never interrupted");
        assert_kept(folder.path(), name);
    }
}

#[test]
fn one_file_is_one_file_by_whatever_name() {
    let folder = folder();
    let at = |name: &str| folder.path().join(name);
    record(folder.path(), "a.rrd", &[]);
    fs::write(at("s.toml"), "particles = 32\n").expect("written");
    fs::write(at("p.csv"), "# box = 6, 6\nx,y,radius\n1,1,0.5\n").expect("written");
    fs::create_dir(at("sub")).expect("a folder");
    symlink(".", at("here")).expect("a link");
    symlink("new.rrd", at("dangling.rrd")).expect("a link");
    for name in ["a.rrd", "s.toml", "p.csv"] {
        fs::hard_link(at(name), at(&format!("hard.{name}"))).expect("a link");
        symlink(name, at(&format!("soft.{name}"))).expect("a link");
    }
    fs::hard_link(at("a.rrd"), at("hard.svg")).expect("a link");
    let before = fs::read(at("a.rrd")).expect("a.rrd");
    let is_input = "is what is read from";
    let twice = "is named twice";
    let record_over = |from: &'static str, input: &'static str, output: &'static str| {
        vec!["record", "-f", from, input, "-o", output]
    };
    let cases = [
        (record_over("--from", "a.rrd", "./a.rrd"), is_input),
        (record_over("--from", "a.rrd", "hard.a.rrd"), is_input),
        (record_over("--from", "soft.a.rrd", "a.rrd"), is_input),
        (record_over("--file", "p.csv", "hard.p.csv"), is_input),
        (
            record_over("--file", "here/p.csv", "sub/../p.csv"),
            is_input,
        ),
        (
            vec!["record", "-f", "s.toml", "-o", "soft.s.toml"],
            is_input,
        ),
        (
            vec!["record", "-f", "s.toml", "-o", "hard.s.toml"],
            is_input,
        ),
        (vec!["convert", "-f", "a.rrd", "hard.a.rrd"], is_input),
        (vec!["convert", "-f", "soft.a.rrd", "here/a.rrd"], is_input),
        (vec!["figure", "-f", "a.rrd", "-o", "hard.svg"], is_input),
        (vec!["record", "-o", "x.rrd", "--mcap", "./x.rrd"], twice),
        (
            vec!["record", "-o", "x.rrd", "--mcap", "here/sub/../x.rrd"],
            twice,
        ),
        (
            vec!["record", "-o", "new.rrd", "--mcap", "dangling.rrd"],
            twice,
        ),
        (
            vec!["record", "-f", "-o", "a.rrd", "--mcap", "hard.a.rrd"],
            twice,
        ),
    ];
    for (line, words) in cases {
        let (code, _, errors) = run(folder.path(), &line);
        assert_eq!(code, Some(2), "{line:?}: {errors}");
        assert!(errors.contains(words), "{line:?}: {errors}");
    }
    assert!(fs::read(at("a.rrd")).expect("a.rrd") == before);
    assert!(!at("x.rrd").exists() && !at("new.rrd").exists());
    assert!(parts(folder.path()).is_empty());
    // A link that leads somewhere else stays a link.
    record(folder.path(), "soft.a.rrd", &["-f", "--seed", "2"]);
    assert!(at("soft.a.rrd").is_symlink());
    assert!(fs::read(at("a.rrd")).expect("a.rrd") != before);
    assert!(
        fs::read(at("hard.a.rrd")).expect("hard.a.rrd") == before,
        "another name of the old file"
    );
    record(folder.path(), "dangling.rrd", &[]);
    assert!(at("dangling.rrd").is_symlink() && at("new.rrd").exists());
}

#[test]
fn what_a_killed_run_has_left_is_taken_over_and_never_a_way_to_lose_the_file() {
    let folder = folder();
    let at = |name: &str| folder.path().join(name);
    record(folder.path(), "a.rrd", &[]);
    let before = fs::read(at("a.rrd")).expect("a.rrd");
    // Killed between its second name and the loss of its first: the part is the file.
    fs::hard_link(at("a.rrd"), at("a.rrd.part")).expect("a link");
    let script = format!("trap '' XFSZ; ulimit -f 8; exec '{SOFTJAM}' record -f -o a.rrd");
    let failed = Command::new("sh")
        .current_dir(folder.path())
        .args(["-c", &script])
        .output()
        .expect("sh runs");
    assert_eq!(failed.status.code(), Some(1), "{failed:?}");
    assert!(fs::read(at("a.rrd")).expect("a.rrd") == before);
    assert!(parts(folder.path()).is_empty());
    // It can be read, but not while it is written over.
    fs::rename(at("a.rrd"), at("a.rrd.part")).expect("renamed");
    let over = ["convert", "-f", "a.rrd.part", "a.rrd"];
    let (code, _, errors) = run(folder.path(), &over);
    assert_eq!(code, Some(2), "{errors}");
    assert!(errors.contains("is what is read from"), "{errors}");
    let (code, _, errors) = run(folder.path(), &["convert", "a.rrd.part", "b.rrd"]);
    assert_eq!(code, Some(0), "{errors}");
    // What is in the way of a part and none itself stays.
    fs::remove_file(at("a.rrd.part")).expect("removed");
    fs::create_dir(at("a.rrd.part")).expect("a folder");
    let (code, _, errors) = run(folder.path(), &["record", "-N", "32", "-o", "a.rrd"]);
    assert_eq!(code, Some(1), "{errors}");
    assert!(
        errors.contains("a.rrd.part") && errors.contains("another file"),
        "{errors}"
    );
}

#[test]
fn what_is_no_file_is_written_to_straight_away_and_not_read_as_a_recording() {
    let folder = folder();
    let name = record(folder.path(), "a.rrd", &[]);
    let (code, _, errors) = run(
        folder.path(),
        &["record", "-N", "32", "-f", "-o", "/dev/null"],
    );
    assert_eq!(code, Some(0), "{errors}");
    assert!(!Path::new("/dev/null.part").exists());
    let piped = |script: String| {
        let output = Command::new("sh")
            .current_dir(folder.path())
            .args(["-c", &script])
            .output()
            .expect("sh runs");
        let errors = String::from_utf8_lossy(&output.stderr).into_owned();
        (output.status.code(), errors)
    };
    let (code, errors) = piped(format!(
        "'{SOFTJAM}' convert -f a.rrd /dev/stdout | cat >b.rrd"
    ));
    assert_eq!(code, Some(0), "{errors}");
    let copy = fs::read(folder.path().join("b.rrd")).expect("b.rrd");
    assert!(copy.starts_with(&fs::read(name).expect("a.rrd")));
    for reader in ["info", "replay", "convert -f", "record -f -o b.rrd --from"] {
        let output = if reader.starts_with("convert") {
            "b.rrd"
        } else {
            ""
        };
        let script = format!("cat a.rrd | '{SOFTJAM}' {reader} /dev/stdin {output}");
        let (code, errors) = piped(script);
        assert_eq!(code, Some(1), "{reader}: {errors}");
        assert!(
            errors.contains("cannot read /dev/stdin: it is a pipe") && errors.contains("cat >"),
            "{errors}"
        );
    }
    let (code, _, errors) = run(folder.path(), &["info", "."]);
    assert_eq!(code, Some(1));
    assert!(errors.contains("it is a folder"), "{errors}");
}

#[test]
fn names_need_not_be_text() {
    let folder = folder();
    let [csv, rrd, svg] =
        [&b"caf\xe9.csv"[..], b"caf\xe9.rrd", b"caf\xe9.svg"].map(OsStr::from_bytes);
    let mut text = String::from("# box = 8, 8\nx,y,radius\n");
    for k in 0..49 {
        let (x, y) = (f64::from(k % 7) + 0.1 * f64::from(k % 3), f64::from(k / 7));
        writeln!(text, "{},{},0.62", x * 8.0 / 7.0, y * 8.0 / 7.0).expect("a String grows");
    }
    fs::write(folder.path().join(csv), &text).expect("written");
    fs::write(folder.path().join("plain.csv"), &text).expect("written");
    let softjam = |arguments: &[&OsStr]| {
        let output = Command::new(SOFTJAM)
            .current_dir(folder.path())
            .args(arguments)
            .output()
            .expect("softjam starts");
        let errors = String::from_utf8_lossy(&output.stderr).into_owned();
        (output.status.code(), errors)
    };
    let word = OsStr::new;
    let line = [word("record"), word("--file"), csv, word("-o"), rrd];
    let (code, errors) = softjam(&line);
    assert_eq!(code, Some(0), "{errors}");
    let (code, errors) = softjam(&[word("replay"), rrd]);
    assert_eq!(code, Some(0), "{errors}");
    let (code, errors) = softjam(&[word("figure"), rrd, word("-o"), svg]);
    assert_eq!(code, Some(0), "{errors}");
    // The file is known for what it is.
    let over = [
        word("record"),
        word("-f"),
        word("--file"),
        csv,
        word("-o"),
        csv,
    ];
    let (code, errors) = softjam(&over);
    assert_eq!(code, Some(2), "{errors}");
    assert!(errors.contains("is what is read from"), "{errors}");
    let (code, errors) = softjam(&[word("scene"), word("--file"), csv]);
    assert_eq!(code, Some(2), "{errors}");
    assert!(errors.contains("UTF-8"), "{errors}");
    // The same run as from the same file by another name.
    let (code, _, errors) = run(
        folder.path(),
        &["record", "--file", "plain.csv", "-o", "plain.rrd"],
    );
    assert_eq!(code, Some(0), "{errors}");
    fs::rename(folder.path().join(rrd), folder.path().join("cafe.rrd")).expect("renamed");
    assert_eq!(
        digest(folder.path(), "cafe.rrd"),
        digest(folder.path(), "plain.rrd")
    );
}
