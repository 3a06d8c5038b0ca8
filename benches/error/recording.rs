//! (e) What recording costs: time a step and bytes a step, with each channel off and on.
//!
//! Runs the program itself, `softjam record`, for two numbers of steps in turn: what the longer run takes beyond the shorter
//! is the cost of its steps, the rest is fixed: the file opened, begun, ended and brought to the disk. Without a channel
//! nothing is recorded but the metrics of the first and the last step. The run of seed 1 at N = 1024 takes 3070 steps to `f_max` of
//! 1e-10. The program is `target/release/softjam`, or what `SOFTJAM` names; files go to the folder for temporary files.

use super::table::{Table, digits, median};
use std::error::Error;
use std::path::{Path, PathBuf};
use std::process::Command;

const CHANNELS: [&str; 9] = [
    "contours,contacts,metrics,state",
    "contacts,metrics,state",
    "contours,metrics,state",
    "contours,contacts,state",
    "contours,contacts,metrics",
    "metrics",
    "state",
    "contours",
    "contacts",
];

pub fn measure(quick: bool) -> Result<Table, Box<dyn Error>> {
    let mut table = Table::new(&[
        "particles",
        "channels",
        "steps",
        "steps_per_s",
        "slowdown",
        "fixed_ms",
        "slowdown_of_the_run",
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
    let (particles, few, steps, rounds) = if quick {
        (64, 10, 50, 1)
    } else {
        (1024, 400, 2000, 15)
    };
    let run = |steps: u64, channels: &str| record(&program, particles, steps, channels);
    let mut measured: Vec<Vec<Times>> = vec![Vec::new(); CHANNELS.len()];
    for round in 0..rounds {
        for (list, channels) in measured.iter_mut().zip(CHANNELS) {
            // What costs a few per cent takes more rounds to see than what costs as much as the run.
            if round >= 3 && channels.contains("cont") {
                continue;
            }
            // What is compared is measured right before.
            let bare = (run(few, "none")?.0, run(steps, "none")?.0);
            let (short, less) = run(few, channels)?;
            let (long, bytes) = run(steps, channels)?;
            list.push(Times {
                bare,
                recorded: (short, long),
                bytes: (bytes - less) / (steps - few) as f64,
            });
        }
    }
    let more = (steps - few) as f64;
    let of = |list: &[Times], f: &dyn Fn(&Times) -> f64| median(list.iter().map(f).collect());
    let a_step = |(short, long): (f64, f64)| (long - short) / more;
    let mut row = |channels: &str, list: &[Times], pick: fn(&Times) -> (f64, f64), bytes: f64| {
        let each = of(list, &|t| a_step(pick(t)));
        let slowdown = of(list, &|t| a_step(pick(t)) / a_step(t.bare));
        let fixed = of(list, &|t| pick(t).1 - steps as f64 * a_step(pick(t)));
        let whole = of(list, &|t| pick(t).1 / t.bare.1);
        table.push(vec![
            particles.to_string(),
            channels.replace(',', " "),
            steps.to_string(),
            format!("{:.0}", 1.0 / each),
            format!("{slowdown:.3}"),
            format!("{:.1}", 1e3 * fixed),
            format!("{whole:.3}"),
            digits(bytes),
        ]);
    };
    row("none", &measured.concat(), |t| t.bare, 0.0);
    for (list, channels) in measured.iter().zip(CHANNELS) {
        row(channels, list, |t| t.recorded, list[0].bytes);
    }
    Ok(table)
}

/// What a run of few steps and one of many take (s), without and with a channel, and the bytes of a step.
#[derive(Clone, Copy)]
struct Times {
    bare: (f64, f64),
    recorded: (f64, f64),
    bytes: f64,
}

/// The time of a run (s), from its first step until its file is closed, and the bytes of the file.
fn record(
    program: &Path,
    particles: usize,
    steps: u64,
    channels: &str,
) -> Result<(f64, f64), Box<dyn Error>> {
    let file = std::env::temp_dir().join(format!("softjam-benchmark-{}.rrd", std::process::id()));
    let every: Vec<String> = match channels {
        "none" => vec![format!("metrics=every:{}", u32::MAX)],
        some => some.split(',').map(|c| format!("{c}=every:1")).collect(),
    };
    let output = Command::new(program)
        .args(["record", "--force", "--threshold", "1e-300"])
        .args([
            "--particles",
            &particles.to_string(),
            "--steps",
            &steps.to_string(),
        ])
        .args(["--channels", &every.join(",")])
        .arg("--output")
        .arg(&file)
        .output()?;
    let bytes = std::fs::metadata(&file)?.len() as f64;
    std::fs::remove_file(&file)?;
    // `time   0.02 s disks, 0.53 s relaxation (3942 steps/s)`
    let text = String::from_utf8(output.stdout)?;
    let rate = text
        .lines()
        .find(|l| l.starts_with("time"))
        .and_then(|l| l.rsplit_once('(')?.1.split(' ').next()?.parse::<f64>().ok())
        .ok_or_else(|| format!("no rate in: {text}"))?;
    Ok((steps as f64 / rate, bytes))
}
