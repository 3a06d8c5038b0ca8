//! (e) What recording costs: steps a second and bytes a step, with each channel off and on.
//!
//! Runs the program itself, `softjam record`, for a fixed number of steps, and beside it the same steps in the library with no
//! recorder at all; in turn, medians of several rounds. The program is `target/release/softjam`, or what `SOFTJAM` names.

use super::table::{Table, digits, median};
use softjam::disks;
use softjam::relax::Relaxation;
use softjam::scene::{Scene, start};
use std::error::Error;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Instant;

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
    let (particles, steps, rounds) = if quick { (64, 50, 1) } else { (1024, 2000, 3) };
    let mut alone = Vec::new();
    let mut recorded: Vec<Vec<(f64, f64)>> = vec![Vec::new(); CHANNELS.len()];
    for _ in 0..rounds {
        alone.push(without(particles, steps)?);
        for (list, channels) in recorded.iter_mut().zip(CHANNELS) {
            list.push(with(&program, particles, steps, channels)?);
        }
    }
    let base = median(alone);
    // What a file holds whatever its length: scene, radii, blueprint.
    let mut fixed = Vec::new();
    for channels in CHANNELS {
        fixed.push(with(&program, particles, 0, channels)?.1);
    }
    let mut row = |channels: &str, rate: f64, bytes: f64| {
        table.push(vec![
            particles.to_string(),
            channels.replace(',', " "),
            steps.to_string(),
            format!("{rate:.0}"),
            format!("{:.3}", base / rate),
            digits(bytes),
        ]);
    };
    row("none", base, 0.0);
    for ((list, channels), fixed) in recorded.iter().zip(CHANNELS).zip(fixed) {
        let rate = median(list.iter().map(|r| r.0).collect());
        row(channels, rate, (list[0].1 - fixed) / steps as f64);
    }
    Ok(table)
}

/// Steps a second of the library alone.
fn without(particles: usize, steps: u64) -> Result<f64, Box<dyn Error>> {
    let scene = Scene {
        particles,
        threshold: 1e-300,
        steps,
        ..Scene::default()
    };
    let mut packing = start::packing(&scene)?;
    disks::relax(&mut packing, &scene.disks, scene.line_tension);
    let mut run = Relaxation::of_packing(&scene, packing)?;
    let clock = Instant::now();
    for _ in 0..steps {
        run.advance()?;
    }
    Ok(steps as f64 / clock.elapsed().as_secs_f64())
}

/// Steps a second as the program reports them, and the bytes of the file.
fn with(
    program: &Path,
    particles: usize,
    steps: u64,
    channels: &str,
) -> Result<(f64, f64), Box<dyn Error>> {
    let file = std::env::temp_dir().join(format!("softjam-benchmark-{}.rrd", std::process::id()));
    let every: Vec<String> = channels
        .split(',')
        .map(|c| format!("{c}=every:1"))
        .collect();
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
    Ok((rate, bytes))
}
