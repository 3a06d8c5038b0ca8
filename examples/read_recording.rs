//! Reads a recording, `.rrd` or `.mcap`: the fall of `f_max`, and the distribution of forces in its last state.
//!
//! ```text
//! cargo run --release --example read_recording -- recordings/jammed.rrd [FORCES.svg [BITS]]
//! ```
//!
//! `FORCES.svg` is a picture of that distribution (`-` for none). With a third file name it writes every number that it reads there as little-endian bytes, in the order of
//! `examples/python/plot.py`, so that readers in other languages can be compared with this one.

use softjam::analysis::METRICS;
use softjam::figure::{Axis, Curve, Mark, Scale, chart, write};
use softjam::replay::{Event, Recording};
use std::collections::BTreeMap;
use std::error::Error;
use std::io::{self, Write};

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let path = arguments
        .next()
        .unwrap_or("recordings/jammed.rrd".to_owned());
    let mut metrics: BTreeMap<u64, [Option<f64>; METRICS.len()]> = BTreeMap::new();
    let mut states = Vec::new();
    for event in Recording::open(&path)? {
        match event? {
            Event::Metric {
                name, step, value, ..
            } => {
                let row = metrics.entry(step).or_default();
                for (place, known) in METRICS.iter().enumerate() {
                    if *known == name {
                        row[place] = Some(value);
                    }
                }
            }
            Event::State(frame) => states.push(frame),
            _ => {}
        }
    }

    let mut out = io::stdout().lock();
    writeln!(
        out,
        "{} states, {} steps of metrics",
        states.len(),
        metrics.len()
    )?;
    writeln!(out, "\n    step  f_max")?;
    let every = metrics.len().div_ceil(12).max(1);
    for (step, row) in metrics.iter().step_by(every) {
        writeln!(out, "{step:8}  {:.3e}", row[0].unwrap_or(f64::NAN))?;
    }
    let mut distribution = Curve {
        label: path,
        mark: Mark::Dots,
        ..Curve::default()
    };
    if let Some(last) = states.last().filter(|last| !last.forces.is_empty()) {
        let mean = last.forces.iter().sum::<f64>() / last.forces.len() as f64;
        writeln!(
            out,
            "\n  f/<f>   share of the contacts at step {}",
            last.step
        )?;
        let width = 0.25;
        for bin in 0..16 {
            let (from, to) = (width * f64::from(bin), width * f64::from(bin + 1));
            let within = |f: &&f64| (from..to).contains(&(**f / mean));
            let share = last.forces.iter().filter(within).count() as f64 / last.forces.len() as f64;
            let bar = "#".repeat((100.0 * share).round() as usize);
            writeln!(out, "{from:.2}-{to:.2}  {share:7.4} {bar}")?;
            let density = share / width;
            distribution.points.push((0.5 * (from + to), density));
        }
    }
    // `-` draws nothing.
    if let Some(picture) = arguments.next().filter(|name| name != "-") {
        let axis = |title: &str| Axis {
            title: title.to_owned(),
            scale: Scale::Linear,
        };
        let (x, y) = (axis("f / ⟨f⟩"), axis("probability density"));
        write(picture, &chart(&x, &y, &[distribution])?)?;
    }

    if let Some(path) = arguments.next() {
        let mut bits = io::BufWriter::new(std::fs::File::create(path)?);
        for (step, row) in &metrics {
            bits.write_all(&step.to_le_bytes())?;
            row.iter()
                .flatten()
                .try_for_each(|x| bits.write_all(&x.to_le_bytes()))?;
        }
        for frame in &states {
            bits.write_all(&frame.step.to_le_bytes())?;
            for v in frame.positions.iter().chain(&frame.velocities) {
                bits.write_all(&v.x.to_le_bytes())?;
                bits.write_all(&v.y.to_le_bytes())?;
            }
            for k in frame.contacts.iter().flatten() {
                bits.write_all(&k.to_le_bytes())?;
            }
            for x in frame.forces.iter().chain(frame.minimizer.values()) {
                bits.write_all(&x.to_le_bytes())?;
            }
        }
        bits.flush()?;
    }
    Ok(())
}
