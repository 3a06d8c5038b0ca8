//! The programs in `examples/`: each runs, draws its picture, and says what is so.

use crate::common::{Folder, assert_at_most, assert_within};
use std::f64::consts::PI;
use std::path::{Path, PathBuf};
use std::process::Command;

/// Runs an example in `folder`; returns what it prints.
fn run(name: &str, folder: &Path, arguments: &[&str]) -> String {
    let program = Path::new(env!("CARGO_BIN_EXE_softjam"))
        .with_file_name("examples")
        .join(name);
    let output = Command::new(&program)
        .current_dir(folder)
        .args(arguments)
        .output()
        .unwrap_or_else(|e| {
            panic!(
                "{}: {e}; cargo build --release --examples",
                program.display()
            )
        });
    let errors = String::from_utf8_lossy(&output.stderr).into_owned();
    assert!(output.status.success(), "{name}: {errors}");
    String::from_utf8(output.stdout).expect("UTF-8")
}

/// The numbers of each line that begins with one; signs of per cent and words are passed over.
fn rows(text: &str) -> Vec<Vec<f64>> {
    let numbers = |line: &str| -> Vec<f64> {
        line.split([' ', ',', '%'])
            .filter_map(|word| word.parse().ok())
            .collect()
    };
    text.lines()
        .map(numbers)
        .filter(|row| row.len() > 1)
        .collect()
}

fn in_repository(path: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(path)
}

/// The picture that lies in `docs/figures/` is the one that the example makes, byte for byte.
fn is_the_committed_one(folder: &Path, name: &str) {
    let made = std::fs::read_to_string(folder.join(name)).expect("the picture");
    let kept = std::fs::read_to_string(in_repository("docs/figures").join(name)).expect("kept");
    assert!(made.starts_with("<svg"));
    assert!(
        made == kept,
        "{name} is not that of docs/figures: the example with that folder as its argument makes it anew"
    );
}

#[test]
fn figure5_shows_disks_that_overlap_and_particles_that_do_not() {
    let folder = Folder::new();
    run("figure5", folder.path(), &[]);
    is_the_committed_one(folder.path(), "figure5a.svg");
    is_the_committed_one(folder.path(), "figure5b.svg");
    let disks = std::fs::read_to_string(folder.path().join("figure5a.svg")).expect("disks");
    let value = |tag: &str, name: &str| -> f64 {
        let rest = tag.split(&format!("{name}=\"")).nth(1).expect(name);
        rest[..rest.find('"').expect("a quote")]
            .parse()
            .expect("a number")
    };
    // Each disk once: the outlines have no fill of their own.
    let circles: Vec<[f64; 3]> = disks
        .split("<circle")
        .skip(1)
        .map(|rest| &rest[..rest.find("/>").expect("the end")])
        .filter(|tag| tag.contains("fill="))
        .map(|tag| ["cx", "cy", "r"].map(|name| value(tag, name)))
        .collect();
    assert!(circles.len() > 100, "{} with images", circles.len());
    let mut overlaps = 0;
    for (k, a) in circles.iter().enumerate() {
        for b in &circles[..k] {
            let gap = (a[0] - b[0]).hypot(a[1] - b[1]) - a[2] - b[2];
            overlaps += usize::from(gap < -0.5);
        }
    }
    assert!(
        overlaps > 100,
        "{overlaps} overlaps of half a pixel and more"
    );
}

#[test]
fn figure5_can_be_had_of_a_recording() {
    let folder = Folder::new();
    run("figure5", folder.path(), &[]);
    let softjam = |arguments: &[&str]| {
        let status = Command::new(env!("CARGO_BIN_EXE_softjam"))
            .current_dir(folder.path())
            .args(arguments)
            .status();
        assert!(status.expect("softjam starts").success(), "{arguments:?}");
    };
    let plain = ["--color", "nothing", "--no-chains"];
    softjam(&[
        "record", "-N", "100", "--phi", "0.9", "--seed", "1", "-o", "r.rrd",
    ]);
    let a = ["figure", "r.rrd", "--step", "0", "--disks", "-o", "a.svg"];
    softjam(&[&a[..], &plain].concat());
    softjam(&[&["figure", "r.rrd", "-o", "b.svg"][..], &plain].concat());
    for (made, kept) in [("a.svg", "figure5a.svg"), ("b.svg", "figure5b.svg")] {
        let read = |name: &str| std::fs::read(folder.path().join(name)).expect("a picture");
        assert!(read(made) == read(kept), "{made} is not {kept}");
    }
}

#[test]
fn figure6_falls_to_the_threshold_in_as_many_steps_as_the_program_takes() {
    let folder = Folder::new();
    let table = rows(&run("figure6", folder.path(), &[]));
    is_the_committed_one(folder.path(), "figure6.svg");
    let points = std::fs::read_to_string(folder.path().join("figure6.csv")).expect("the numbers");
    let points = rows(&points);
    assert_eq!(table.len(), 12);
    for run in &table {
        let curve: Vec<&Vec<f64>> = points.iter().filter(|p| p[..2] == run[..2]).collect();
        assert_eq!(curve.len(), run[2] as usize + 1, "every step of {run:?}");
        let (last, before) = curve.split_last().expect("points");
        assert!(last[3] <= 1e-10, "{last:?}");
        assert!(before.iter().all(|p| p[3] > 1e-10));
    }
    let scene = ["-N", "256", "--phi", "0.88", "--seed", "3"];
    let output = Command::new(env!("CARGO_BIN_EXE_softjam"))
        .current_dir(folder.path())
        .args([&["record", "--channels", "metrics"][..], &scene].concat())
        .output()
        .expect("softjam starts");
    let said = String::from_utf8(output.stdout).expect("UTF-8");
    let run = table.iter().find(|run| run[..2] == [0.88, 3.0]);
    let steps = run.expect("the run")[2];
    assert!(
        said.contains(&format!("converged in {steps} steps")),
        "{said}"
    );
}

#[test]
fn foam_pushes_harder_than_its_linear_model() {
    let folder = Folder::new();
    let table = rows(&run("foam", folder.path(), &[]));
    is_the_committed_one(folder.path(), "models.svg");
    is_the_committed_one(folder.path(), "foam.svg");
    let [disks, linear, foam, dry] = &table[..] else {
        panic!("{table:?}")
    };
    assert!([disks, linear, foam].iter().all(|row| row[0] == 0.95));
    // 45 % below the foam.
    assert_within("linear over exact", linear[2] / foam[2], 0.5, 0.6);
    // Few gaps are left: almost all vertices join three droplets, and then Z is 6.
    assert_within("Z at φ = 0.99", dry[1], 5.9, 6.0);
}

#[test]
fn squeeze_meets_the_exact_droplet_in_the_linear_range_and_leaves_it_as_known() {
    let folder = Folder::new();
    let table = rows(&run("squeeze", folder.path(), &[]));
    is_the_committed_one(folder.path(), "squeeze.svg");
    assert_eq!(table.len(), 7);
    let t = 6.0 * (PI / 6.0).tan();
    for row in &table {
        let [phi, indentation, exact, model, _] = row[..] else {
            panic!("{row:?}")
        };
        let a = 1.0 - indentation / 100.0;
        // A hexagonal cell of inradius a about a disk of radius 1.
        assert_at_most("coverage", (PI / (t * a * a) - phi).abs(), 2e-6);
        // The area of the rounded hexagon with this force: corners of radius r, sides at a.
        let x = exact / (2.0 * (PI / 6.0).tan());
        let r = a / (1.0 + x);
        let area = PI * r * r * (1.0 + 2.0 * t * x / PI + t * x * x / PI);
        assert_at_most("area kept", (area / PI - 1.0).abs(), 2e-5);
        // The linear model: a = 1 − 0.088904 f.
        assert_at_most(
            "linear",
            (model * 0.088904 * 100.0 - indentation).abs(),
            2e-4,
        );
        assert!(model < exact);
    }
    // From the exact droplet and the linear model by hand, at six coverages.
    let errors: Vec<f64> = table.iter().map(|row| row[4]).collect();
    assert_eq!(errors, [-1.0, -2.8, -7.2, -11.6, -20.6, -29.6, -48.0]);
}

#[test]
fn jamming_is_where_coordination_falls_to_that_of_an_isostatic_packing() {
    let folder = Folder::new();
    let table = rows(&run("jamming", folder.path(), &[]));
    is_the_committed_one(folder.path(), "jamming.svg");
    assert_eq!(table.len(), 8);
    for row in &table {
        let (phi, z) = (row[0], row[1]);
        // Undeformed disks, O'Hern et al. 2003. Near the transition shapes matter little; beyond, bulges find neighbours.
        let disks = 4.0 + 3.6 * (phi - 0.842).sqrt();
        let most = if phi < 0.865 { 0.15 } else { 0.6 };
        // The mean of five samples may be off by three times its standard error.
        let low = -3.0 * row[2];
        assert_within("Z above that of disks", z - disks, low, most);
    }
    let rises = |k: usize| table.windows(2).all(|w| w[0][k] < w[1][k]);
    assert!(rises(1) && rises(3), "Z and p rise with φ: {table:?}");
    // The pressure vanishes at the transition: a line through the first points meets zero near φ = 0.842.
    let (a, b) = (&table[0], &table[2]);
    let zero = a[0] - a[3] * (b[0] - a[0]) / (b[3] - a[3]);
    assert_within("φ where p = 0", zero, 0.835, 0.845);
}

#[test]
fn approach_finds_one_threshold_for_both_models_in_the_mean() {
    let folder = Folder::new();
    let table = rows(&run("approach", folder.path(), &[]));
    is_the_committed_one(folder.path(), "approach.svg");
    let [disks, droplets] = [&table[..4], &table[4..]];
    assert_eq!(droplets.len(), 4);
    let mean = |rows: &[Vec<f64>]| rows.iter().map(|row| row[1]).sum::<f64>() / 4.0;
    // Of 30 starts from φ = 0.86 and 0.90 at N = 128: 0.8405(4) and 0.8430(5), one packing off by 0.0023.
    for found in [disks, droplets].map(mean) {
        assert_within("φ_J", found, 0.838, 0.846);
    }
    // On one network p = B (φ − φ_J) with B between 1.2 and 1.8.
    for row in &table {
        assert_within("dp/dφ", row[2], 1.1, 1.9);
        assert_within("relaxed states", row[3], 10.0, 20.0);
    }
}

#[test]
fn shear_yields_again_and_again_at_a_stress_that_stays() {
    let folder = Folder::new();
    let table = rows(&run("shear", folder.path(), &[]));
    for name in ["shear.svg", "sheared.svg"] {
        is_the_committed_one(folder.path(), name);
    }
    for row in &table {
        let [states, events, stress, _] = row[..] else {
            panic!("{row:?}")
        };
        assert_eq!(states, 301.0);
        // Stress drops 130 to 140 times a unit strain by more than 1e-4, of which these are the larger ones.
        assert_within("events", events, 8.0, 45.0);
        // The plateau of disks is 0.0066(7), of droplets 0.011 at the slowest flow that was measured; so short a way has not forgotten its start.
        assert_within("stress", stress, 0.001, 0.03);
    }
    assert_eq!(table.len(), 2);
}

#[test]
fn compression_stiffens_foam_beyond_its_linear_model_and_both_beyond_disks() {
    let folder = Folder::new();
    let table = rows(&run("compression", folder.path(), &[]));
    for name in [
        "compression.svg",
        "compression-a.svg",
        "compression-b.svg",
        "compression-c.svg",
    ] {
        is_the_committed_one(folder.path(), name);
    }
    let [disks, linear, foam] = [0, 1, 2].map(|k| &table[7 * k..7 * (k + 1)]);
    assert_eq!(table.len(), 21);
    for (k, row) in foam.iter().enumerate().skip(1) {
        assert!(
            disks[k][2] < linear[k][2] && linear[k][2] < row[2],
            "{row:?}"
        );
        assert!(row[2] > foam[k - 1][2], "p rises: {row:?}");
    }
    // Few gaps are left: almost all vertices join three droplets, and then Z is 6.
    assert_within("Z at φ = 0.98", foam[6][1], 5.8, 6.0);
}

#[test]
fn compress_does_the_work_that_is_stored_or_dissipated() {
    let folder = Folder::new();
    let table = rows(&run("compress", folder.path(), &[]));
    is_the_committed_one(folder.path(), "compress.svg");
    assert_eq!(table.len(), 41);
    for (a, b) in table.iter().zip(&table[1..]) {
        let (stored, work) = (b[3] - a[3], b[4] - a[4]);
        // The trapezoids are off by 3e-5 where nothing rearranges; a rearrangement takes energy away, and never gives.
        assert!(work > stored * (1.0 - 1e-3), "{a:?} {b:?}");
        // The trapezoids themselves, from coverage and pressure: V = Σ π R² / φ, radii 0.5 and 0.7 in equal parts.
        let volume = |phi: f64| 50.0 * PI * (0.25 + 0.49) / phi;
        let by_hand = 0.5 * (a[2] + b[2]) * (volume(a[0]) - volume(b[0]));
        assert_at_most("work", (by_hand - work).abs(), 1e-7);
    }
    let (first, last) = (&table[0], &table[40]);
    let lost = (last[4] - (last[3] - first[3])) / last[4];
    // How much goes in rearrangements is the sample's; most is stored.
    assert_within("share that is dissipated", lost, 0.0, 0.1);
}

#[test]
fn forms_differ_at_second_order_in_the_forces() {
    let folder = Folder::new();
    let table = rows(&run("forms", folder.path(), &["3"]));
    assert_eq!(table.len(), 4);
    for row in &table {
        let (phi, rms, energy, pressure) = (row[0], row[2], row[6], row[7]);
        // Other packings, and from the same start ones of lower energy: the gradient's end is a minimum, the other's not.
        assert!(rms > 1e-4 && energy < 1e-3, "{row:?}");
        assert_within("pressure of one over the other", 1.0 + pressure, 0.97, 1.03);
        assert!(phi > 0.9 || rms < 0.02, "{row:?}");
    }
    let first = table[0][2] / table[2][2];
    assert!(first < 0.5, "less at lower coverage: {first}");
}

#[test]
fn read_recording_counts_what_info_counts() {
    let folder = Folder::new();
    std::fs::create_dir(folder.path().join("recordings")).expect("a folder");
    // The path is the name of the curve.
    let file = "recordings/jammed.rrd";
    std::fs::copy(in_repository(file), folder.path().join(file)).expect("a copy");
    let said = run("read_recording", folder.path(), &[file, "forces.svg"]);
    is_the_committed_one(folder.path(), "forces.svg");
    let output = Command::new(env!("CARGO_BIN_EXE_softjam"))
        .current_dir(folder.path())
        .args(["info", "--json", file])
        .output()
        .expect("softjam starts");
    let info: serde_json::Value = serde_json::from_slice(&output.stdout).expect("JSON");
    let count = |channel: &str| {
        info["channels"][channel]["steps"]
            .as_u64()
            .expect("a count")
    };
    let first = format!(
        "{} states, {} steps of metrics",
        count("state"),
        count("metrics")
    );
    assert!(said.starts_with(&first), "{said}");
    let total: f64 = said
        .lines()
        .filter(|line| line.contains('-') && line.as_bytes()[0].is_ascii_digit())
        .filter_map(|line| line.split_whitespace().nth(1)?.parse::<f64>().ok())
        .sum();
    assert_within("all contacts", total, 0.995, 1.005);
}
