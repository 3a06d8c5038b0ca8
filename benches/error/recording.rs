//! (e) What recording costs: whole runs to the scene's threshold with each channel off and on, at every step.
//!
//! Runs the program itself, `softjam record`, and compares each run with one of the same seed right before it that records nothing
//! but the metrics of the first and the last step. The time is that from the first step until the file is closed. Pictures
//! are drawn where they would look different (`redraw`), so what a run costs depends on how long it rearranges: medians over
//! seeds. The program is `target/release/softjam`, or what `SOFTJAM` names; files go to the folder for temporary files.

use super::table::{Table, digits, median};
use std::error::Error;
use std::path::{Path, PathBuf};
use std::process::Command;

/// All channels.
const EVERYTHING: &str = "contours contacts metrics state";

/// Channels at every step, or the scene's own schedules, and whether every picture is drawn.
const CASES: [(&str, bool); 11] = [
    (EVERYTHING, false),
    (EVERYTHING, true),
    ("contacts metrics state", false),
    ("contours metrics state", false),
    ("contours contacts state", false),
    ("contours contacts metrics", false),
    ("metrics", false),
    ("state", false),
    ("contours", false),
    ("contacts", false),
    ("as in the default scene", false),
];

pub fn measure(quick: bool) -> Result<Table, Box<dyn Error>> {
    let mut table = Table::new(&[
        "particles",
        "channels",
        "redraw",
        "runs",
        "steps",
        "steps_per_s",
        "slowdown",
        "least_slowdown",
        "largest_slowdown",
        "bytes_per_step",
    ]);
    let program = std::env::var_os("SOFTJAM")
        .map_or_else(|| PathBuf::from("target/release/softjam"), PathBuf::from);
    if !program.exists() {
        eprintln!(
            "  left out: there is no {}; build it with `cargo build --release`",
            program.display()
        );
        return Ok(table);
    }
    let (particles, seeds, rounds) = if quick { (64, 1, 1) } else { (1024, 5, 3) };
    let mut measured: Vec<Vec<[Run; 2]>> = vec![Vec::new(); CASES.len()];
    for round in 0..rounds {
        for seed in 1..=seeds {
            for (list, (channels, all)) in measured.iter_mut().zip(CASES) {
                // What costs a few per cent takes more runs to see than what costs half of the run; what has everything is worth them.
                if round > 0 && channels.contains("cont") && (channels != EVERYTHING || all) {
                    continue;
                }
                let bare = record(&program, particles, seed, "none", false)?;
                list.push([bare, record(&program, particles, seed, channels, all)?]);
            }
        }
    }
    let mut row = |channels: &str, redraw: &str, runs: &[[Run; 2]], of: usize| {
        let each = |f: &dyn Fn(&Run) -> f64| median(runs.iter().map(|r| f(&r[of])).collect());
        let slowdown = || runs.iter().map(|r| r[of].seconds / r[0].seconds);
        table.push(vec![
            particles.to_string(),
            channels.to_owned(),
            redraw.to_owned(),
            runs.len().to_string(),
            format!("{:.0}", each(&|r| r.steps)),
            format!("{:.0}", each(&|r| r.steps / r.seconds)),
            format!("{:.3}", median(slowdown().collect())),
            format!("{:.3}", slowdown().fold(f64::INFINITY, f64::min)),
            format!("{:.3}", slowdown().fold(0.0, f64::max)),
            digits(each(&|r| r.bytes / r.steps)),
        ]);
    };
    row("none", "", &measured.concat(), 0);
    for (runs, (channels, all)) in measured.iter().zip(CASES) {
        row(channels, if all { "0" } else { "0.01" }, runs, 1);
    }
    Ok(table)
}

/// What a run took and left behind.
#[derive(Clone, Copy)]
struct Run {
    steps: f64,
    seconds: f64,
    bytes: f64,
}

fn record(
    program: &Path,
    particles: usize,
    seed: u64,
    channels: &str,
    every_picture: bool,
) -> Result<Run, Box<dyn Error>> {
    let file = std::env::temp_dir().join(format!("softjam-benchmark-{}.rrd", std::process::id()));
    let every = match channels {
        "none" => format!("metrics=every:{}", u32::MAX),
        some => {
            let each: Vec<_> = some.split(' ').map(|c| format!("{c}=every:1")).collect();
            each.join(",")
        }
    };
    let mut command = Command::new(program);
    command.args(["record", "--force"]);
    command.args(["--particles", &particles.to_string()]);
    command.args(["--seed", &seed.to_string()]);
    if !channels.starts_with("as in") {
        command.args(["--channels", &every]);
    }
    if every_picture {
        command.args(["--redraw", "0"]);
    }
    let output = command.arg("--output").arg(&file).output()?;
    let bytes = std::fs::metadata(&file)?.len() as f64;
    std::fs::remove_file(&file)?;
    // `result         converged in 2307 steps to a minimum` and
    // `time           0.02 s disks, 0.53 s relaxation (3942 steps/s)`
    let text = String::from_utf8(output.stdout)?;
    let line = |start: &str| text.lines().find(|line| line.starts_with(start));
    let number = |word: Option<&str>| word?.parse::<f64>().ok();
    let steps = line("result").and_then(|l| number(l.split(" in ").nth(1)?.split(' ').next()));
    let rate = line("time").and_then(|l| number(l.rsplit_once('(')?.1.split(' ').next()));
    let (steps, rate) = steps
        .zip(rate)
        .ok_or_else(|| format!("no steps or no rate in: {text}"))?;
    Ok(Run {
        steps,
        seconds: steps / rate,
        bytes,
    })
}
