//! Figures of protocols: what the flags draw is what was recorded.

use super::{folder, record, run};
use std::path::Path;

fn drawn(folder: &Path, arguments: &[&str]) -> String {
    let all = [&["figure"], arguments, &["-f", "-o", "x.svg"]].concat();
    let (code, _, errors) = run(folder, &all);
    assert_eq!(code, Some(0), "{arguments:?}: {errors}");
    std::fs::read_to_string(folder.join("x.svg")).expect("x.svg")
}

/// The numbers of points of each line that is drawn.
fn lines(svg: &str) -> Vec<usize> {
    let lines = svg.split(" points=\"").skip(1);
    let points = lines.map(|rest| rest[..rest.find('"').expect("a quote")].split(' ').count());
    points.collect()
}

#[test]
fn protocols_are_drawn_as_stress_against_strain_and_pressure_against_coverage() {
    let folder = folder();
    let folder = folder.path();
    let disks = ["--model", "disks", "--shear", "-0.02", "--compress-to"];
    record(folder, "a.rrd", &[&disks[..], &["0.905"]].concat());
    record(folder, "b.mcap", &[&disks[..], &["0.910"]].concat());
    let stress = drawn(folder, &["--stress-strain", "a.rrd", "b.mcap"]);
    // The state before the first step, and one behind each of twenty; called by the coverage at which it is sheared.
    assert_eq!(lines(&stress), [21, 21]);
    for word in ["φ = 0.905", "φ = 0.910", ">xy<", "strain", "−0.02"] {
        assert!(stress.replace('-', "−").contains(word), "no {word}");
    }
    let pressure = drawn(folder, &["--pressure-phi", "a.rrd", "b.mcap"]);
    assert_eq!(lines(&pressure), [6, 11]);
    // Both curves are of one start, and a dot stands for each state and in no legend.
    assert_eq!(pressure.matches("start at φ = 0.900").count(), 1);
    assert_eq!(pressure.matches("<circle").count(), 17);
}

#[test]
fn pure_shear_has_a_stress_of_its_own_and_searches_mark_what_they_found() {
    let folder = folder();
    let folder = folder.path();
    let scene = "[[protocol]]\nact = 'shear'\nmode = 'pure'\nstrain = 0.003\n[[protocol]]\nact = 'jam'\n[[protocol]]\nact = 'compress'\nphi = 0.86";
    std::fs::write(folder.join("pure.toml"), scene).expect("a scene");
    record(folder, "pure.rrd", &["pure.toml", "--model", "disks"]);
    let stress = drawn(folder, &["--stress-strain", "pure.rrd"]);
    assert!(stress.contains(">xx<") && stress.contains(">yy<"));
    assert_eq!(lines(&stress), [4]);
    // The φ_J that the run itself tells.
    let (code, out, errors) = run(
        folder,
        &[
            "record", "--jam", "-N", "32", "--model", "disks", "-o", "jam.rrd",
        ],
    );
    assert_eq!(code, Some(0), "{errors}");
    let told = out
        .lines()
        .find_map(|line| line.strip_prefix("φ_J "))
        .expect("φ_J");
    let phi_j: f64 = told
        .split_whitespace()
        .next()
        .expect("a number")
        .parse()
        .expect("a number");
    let found = format!("= {phi_j:.6}");
    assert!(
        drawn(folder, &["--pressure-phi", "jam.rrd"]).contains(&found),
        "{found}"
    );
    // Of a search in the middle of a protocol as well.
    assert!(drawn(folder, &["--pressure-phi", "pure.rrd"]).contains(">J<"));
}

#[test]
fn recordings_without_what_a_figure_shows_are_refused() {
    let folder = folder();
    let folder = folder.path();
    record(folder, "sheared.rrd", &["--shear", "0.002"]);
    let pure = "[[protocol]]\nact = 'shear'\nmode = 'pure'\nstrain = 0.002";
    std::fs::write(folder.join("pure.toml"), pure).expect("a scene");
    record(folder, "pure.rrd", &["pure.toml"]);
    record(folder, "jam.rrd", &["--jam", "--model", "disks"]);
    // The last state of a run that did not converge is not relaxed.
    let limited = "[[protocol]]\nact = 'shear'\nstrain = 0.01\nsteps = 1";
    std::fs::write(folder.join("limited.toml"), limited).expect("a scene");
    let (code, _, errors) = run(
        folder,
        &["record", "limited.toml", "-N", "32", "-o", "limited.rrd"],
    );
    assert_eq!(code, Some(3), "{errors}");

    record(folder, "still.rrd", &[]);
    record(
        folder,
        "states.rrd",
        &["--shear", "0.001", "--channels", "state"],
    );
    let refused: [(&[&str], &str); 8] = [
        (&["--stress-strain", "still.rrd"], "without a protocol"),
        (&["--pressure-phi", "still.rrd"], "without a protocol"),
        (&["--stress-strain", "jam.rrd"], "no sheared states"),
        (&["--stress-strain", "limited.rrd"], "no sheared states"),
        (
            &["--stress-strain", "sheared.rrd", "pure.rrd"],
            "simple and pure shear",
        ),
        (&["--pressure-phi", "states.rrd"], "holds no metrics"),
        (
            &["--stress-strain", "--pressure-phi", "a.rrd"],
            "cannot be used with",
        ),
        (
            &["--stress-strain", "jam.rrd", "--films"],
            "cannot be used with",
        ),
    ];
    for (arguments, words) in refused {
        let (code, _, errors) = run(folder, &[&["figure"], arguments, &["-o", "y.svg"]].concat());
        assert_eq!(code, Some(2), "{arguments:?}: {errors}");
        assert!(errors.contains(words), "{arguments:?}: {errors}");
        assert!(!folder.join("y.svg").exists());
    }
}
