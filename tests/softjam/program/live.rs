//! The live view without a viewer: whatever is at the other end, or nothing, the run writes the same file in time.
//! `tests/independent/live.py` does the same with rerun's own programs.

use super::{SOFTJAM, folder, run};
use std::io::Read as _;
use std::net::TcpListener;
use std::path::Path;
use std::process::Command;
use std::thread;
use std::time::{Duration, Instant};

/// 2000 frames of 18 kB each, twice as many as may wait for a viewer.
const RUN: [&str; 4] = ["-N", "256", "--channels", "metrics,state=every:1"];

/// What a viewer may cost at the end of a run.
const FLUSH: Duration = Duration::from_secs(2);

struct Recorded {
    bytes: Vec<u8>,
    out: String,
    errors: String,
    took: Duration,
}

fn recorded(folder: &Path, more: &[&str]) -> Recorded {
    let start = Instant::now();
    let arguments = [&["record", "-f", "-o", "run.rrd"], &RUN[..], more].concat();
    let (code, out, errors) = run(folder, &arguments);
    let took = start.elapsed();
    println!("{more:?}: {took:?} {errors}");
    assert_eq!(code, Some(0), "{errors}");
    let bytes = std::fs::read(folder.join("run.rrd")).expect("run.rrd");
    Recorded {
        bytes,
        out,
        errors,
        took,
    }
}

/// A listener at a port of its own, and the flag that connects to it.
fn listener() -> (TcpListener, String) {
    let listener = TcpListener::bind(("127.0.0.1", 0)).expect("a port");
    let port = listener.local_addr().expect("an address").port();
    let flag = format!("--connect=rerun+http://127.0.0.1:{port}/proxy");
    (listener, flag)
}

/// The same file, and no more time than a viewer may cost; other tests run at the same time, hence the factor.
#[track_caller]
fn assert_undisturbed(live: &Recorded, alone: &Recorded, bound: Duration) {
    assert!(live.bytes == alone.bytes, "the file differs");
    let limit = 3 * alone.took + bound;
    assert!(live.took < limit, "{:?}, allowed {limit:?}", live.took);
    assert!(!live.out.contains("live view"), "{}", live.out);
    assert_eq!(live.errors.lines().count(), 1, "{}", live.errors);
}

#[test]
fn a_viewer_that_is_absent_silent_or_gone_changes_nothing() {
    let folder = folder();
    let alone = recorded(folder.path(), &[]);
    assert_eq!(alone.errors, "");

    // Nobody listens at a port that has just been given back.
    let (nobody, flag) = listener();
    drop(nobody);
    let absent = recorded(folder.path(), &[&flag]);
    assert_undisturbed(&absent, &alone, Duration::from_secs(1));
    assert!(
        absent
            .errors
            .contains("no viewer came up at rerun+http://127.0.0.1:")
    );

    // Connections are made, and nothing is ever read.
    let (silent, flag) = listener();
    let slow = recorded(folder.path(), &[&flag]);
    drop(silent);
    assert_undisturbed(&slow, &alone, FLUSH + Duration::from_secs(1));
    assert!(slow.took > FLUSH, "it gets its time");
    assert!(
        slow.errors.contains("was too slow: 0 of "),
        "{}",
        slow.errors
    );

    // Something is read, then the connection is cut.
    let (leaver, flag) = listener();
    let visit = thread::spawn(move || {
        let (mut stream, _) = leaver.accept().expect("a connection");
        stream.read_exact(&mut vec![0; 20_000]).expect("20 kB");
    });
    let left = recorded(folder.path(), &[&flag]);
    visit.join().expect("the viewer that leaves");
    assert_undisturbed(&left, &alone, Duration::from_secs(1));
    assert!(left.errors.contains("was lost: "), "{}", left.errors);

    // What listens speaks another language.
    let (stranger, flag) = listener();
    let visit = thread::spawn(move || {
        let (mut stream, _) = stranger.accept().expect("a connection");
        std::io::Write::write_all(&mut stream, b"HTTP/1.1 400 Bad Request\r\n\r\n").expect("said");
        // Read on, so that what was said is not reset.
        drop(stream.read_to_end(&mut Vec::new()));
    });
    let misunderstood = recorded(folder.path(), &[&flag]);
    visit.join().expect("the stranger");
    assert_undisturbed(&misunderstood, &alone, Duration::from_secs(1));
    assert!(misunderstood.errors.contains("was lost: "));
}

#[test]
fn a_viewer_that_cannot_be_started_is_missed_and_nothing_else() {
    let folder = folder();
    let alone = recorded(folder.path(), &[]);
    let record = |path: &Path, port: u16| {
        let output = Command::new(SOFTJAM)
            .current_dir(folder.path())
            .env("PATH", path)
            .args(["record", "-o", "spawn.rrd", "-f"])
            .args(RUN)
            .arg(format!("--spawn={port}"))
            .output()
            .expect("softjam starts");
        let errors = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(0), "{errors}");
        let bytes = std::fs::read(folder.path().join("spawn.rrd")).expect("spawn.rrd");
        assert!(bytes == alone.bytes, "the file differs");
        errors
    };
    let (closed, _) = listener();
    let port = closed.local_addr().expect("an address").port();
    drop(closed);
    let errors = record(folder.path(), port);
    assert!(errors.contains("pip install rerun-sdk"), "{errors}");
    // What listens already is used, and no program is looked for.
    let (silent, _) = listener();
    let port = silent.local_addr().expect("an address").port();
    let errors = record(folder.path(), port);
    assert!(errors.contains("was too slow"), "{errors}");
    // A program that ends without having listened is not waited for.
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        let program = folder.path().join("rerun");
        std::fs::write(&program, "#!/bin/sh\nexit 1\n").expect("a program");
        std::fs::set_permissions(&program, PermissionsExt::from_mode(0o755)).expect("rights");
        let (closed, _) = listener();
        let port = closed.local_addr().expect("an address").port();
        drop(closed);
        let start = Instant::now();
        let errors = record(folder.path(), port);
        assert!(errors.contains("no viewer came up"), "{errors}");
        assert!(start.elapsed() < 3 * alone.took + Duration::from_secs(2));
    }
}

#[test]
fn what_is_no_address_is_refused_before_anything_is_written() {
    let folder = folder();
    for address in [
        "scene.toml",
        "http://127.0.0.1:9876",
        "rerun+http://127.0.0.1:9876",
        "rerun+http://127.0.0.1:99999/proxy",
        "rerun+https://127.0.0.1:9876/proxy",
        "",
    ] {
        let (code, _, errors) = run(folder.path(), &["record", "--connect", address]);
        assert_eq!(code, Some(2), "{address}: {errors}");
        let expected = "rerun+http://127.0.0.1:9876/proxy";
        assert!(address.is_empty() || errors.contains(expected), "{errors}");
    }
    for flags in [
        &["--spawn", "--connect"][..],
        &["--spawn=0"],
        &["--spawn=x"],
    ] {
        let (code, _, errors) = run(folder.path(), &[&["record"], flags].concat());
        assert_eq!(code, Some(2), "{flags:?}: {errors}");
    }
    assert!(!folder.path().join("softjam.rrd").exists());
}
