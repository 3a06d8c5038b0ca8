//! The report, in Markdown: numbers from this run and no others.

use super::families::Family;
use super::outcome::Outcome;
use softjam::analysis::Stability;
use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::time::{SystemTime, UNIX_EPOCH};

/// What has become of a family of cases.
pub struct Row {
    name: &'static str,
    what: &'static str,
    cases: usize,
    converged: usize,
    wrong: Vec<String>,
    /// Converged cases that are a minimum, a saddle, not jammed, not judged.
    judged: [usize; 4],
    /// Reasons other than convergence: how often, and the first case with its message.
    reasons: BTreeMap<&'static str, (usize, String)>,
    f_max: f64,
    law: f64,
    steps: u64,
    squeeze: f64,
    /// Cases whose largest squeeze is beyond the model's range.
    strained: usize,
    /// Wall-clock time of the family (seconds).
    pub seconds: f64,
}

impl Row {
    pub fn new(family: &Family) -> Self {
        Self {
            name: family.name,
            what: family.what,
            cases: 0,
            converged: 0,
            wrong: Vec::new(),
            judged: [0; 4],
            reasons: BTreeMap::new(),
            f_max: 0.0,
            law: 0.0,
            steps: 0,
            squeeze: 0.0,
            strained: 0,
            seconds: 0.0,
        }
    }

    pub fn count(&mut self, name: String, outcome: Outcome) {
        self.cases += 1;
        self.steps = self.steps.max(outcome.steps);
        if let Some(c) = outcome.check.filter(|_| outcome.end == "converged") {
            self.f_max = self.f_max.max(c.f_max);
            // Where contacts only touch, an overlap is all round-off and no measure.
            if c.overlap > 1e-5 {
                self.law = self.law.max(c.law / c.overlap);
            }
            self.squeeze = self.squeeze.max(c.squeeze);
            self.strained +=
                usize::from(c.squeeze > softjam::models::droplet::validity::SQUEEZE_LIMIT);
        }
        if let Some(wrong) = outcome.wrong {
            self.wrong.push(format!("{name}: {wrong}"));
        } else if outcome.end == "converged" {
            self.converged += 1;
            match outcome.stability {
                Some(Stability::Minimum) => self.judged[0] += 1,
                Some(Stability::Saddle) => self.judged[1] += 1,
                Some(Stability::NotJammed) => self.judged[2] += 1,
                Some(Stability::NotJudged) | None => self.judged[3] += 1,
            }
        } else {
            let first = match outcome.check {
                _ if !outcome.message.is_empty() => {
                    format!("{name}: \"{}\"", shortened(&outcome.message))
                }
                Some(c) => format!(
                    "{name}: f_max = {:.1e} γ after {} steps",
                    c.f_max, outcome.steps
                ),
                None => name,
            };
            self.reasons.entry(outcome.end).or_insert((0, first)).0 += 1;
        }
    }

    /// Whether every case ended with an answer or a reason that is true.
    pub fn good(&self) -> bool {
        self.wrong.is_empty()
    }

    /// The row in one line, for a terminal.
    pub fn line(&self) -> String {
        let reasons: Vec<String> = self
            .reasons
            .iter()
            .map(|(k, v)| format!("{} {k}", v.0))
            .collect();
        format!(
            "{} of {} converged, {} wrong{}{} ({:.1} s)",
            self.converged,
            self.cases,
            self.wrong.len(),
            if reasons.is_empty() { "" } else { "; " },
            reasons.join(", "),
            self.seconds
        )
    }
}

fn shortened(text: &str) -> String {
    let line = text.lines().next().unwrap_or_default();
    if line.chars().count() <= 240 {
        return line.into();
    }
    line.chars().take(240).chain("…".chars()).collect()
}

/// The whole report.
pub fn markdown(rows: &[Row], lines: &str) -> String {
    let mut text = String::from(HEAD);
    if !lines.is_empty() {
        let _ = writeln!(text, "All scenes with:\n\n```toml\n{lines}```\n");
    }
    let cases: usize = rows.iter().map(|r| r.cases).sum();
    let wrong: usize = rows.iter().map(|r| r.wrong.len()).sum();
    let seconds: f64 = rows.iter().map(|r| r.seconds).sum();
    // Writing to a String cannot fail.
    let _ = writeln!(
        text,
        "{}, {}: {cases} cases in {seconds:.0} s on one thread, {wrong} wrong.\n",
        date(),
        processor()
    );
    text.push_str(
        "| family | cases | converged | minimum, saddle, not jammed, not judged | other ends, each with its reason | wrong | f_max, at most | law broken by at most | steps, at most | squeeze, at most | s |\n\
         | --- | ---: | ---: | --- | --- | ---: | ---: | ---: | ---: | ---: | ---: |\n",
    );
    for r in rows {
        let reasons: Vec<String> = r
            .reasons
            .iter()
            .map(|(k, v)| format!("{} {k}", v.0))
            .collect();
        let _ = writeln!(
            text,
            "| {} | {} | {} | {} | {} | {} | {:.1e} | {:.1e} | {} | {:.3} | {:.1} |",
            r.name,
            r.cases,
            r.converged,
            r.judged.map(|n| n.to_string()).join(", "),
            if reasons.is_empty() {
                "–".into()
            } else {
                reasons.join(", ")
            },
            r.wrong.len(),
            r.f_max,
            r.law,
            r.steps,
            r.squeeze,
            r.seconds
        );
    }
    text.push_str("\n## What was tried, and what was not an answer\n");
    for r in rows {
        let _ = writeln!(text, "\n**{}**: {}.", r.name, r.what);
        if r.strained > 0 {
            let _ = writeln!(
                text,
                "\n- {} of {} packings have particles beyond the range of the linear model, up to a squeeze of {:.3}, where \
                 its own forces are too small by {:.0} %: `softjam record` warns.",
                r.strained,
                r.cases,
                r.squeeze,
                100.0 * softjam::models::droplet::validity::model_error(r.squeeze)
            );
        }
        for (reason, (count, first)) in &r.reasons {
            let _ = writeln!(text, "- {count} × {reason}; the first is {first}");
        }
        for wrong in &r.wrong {
            let _ = writeln!(text, "- **wrong**: {wrong}");
        }
    }
    text
}

const HEAD: &str = "\
# Stress

Written by `cargo bench --no-default-features --bench stress -- --write docs/stress.md`; every number is of that run.

Every case ends in one of three ways: converged, at its step limit, or with an error that names its reason. What it ends with is
checked by code that shares nothing with the solver (`benches/stress/verify.rs`: own kernel, the standard library's mathematics,
all pairs and all periodic images): the contact law `f > 0`, `gap = 0` at contacts, `gap ≥ 0` elsewhere; the net forces against
the threshold; that no second image of a neighbour touches. A step limit counts only if `f_max` is above the threshold; an
error only if its reason is found to hold (a box is called too small only where a second image does overlap, forces are called
diverged only where a bulge is bound by more than five radii). Of packings of up to 130 particles all eigenvalues of the stiffness
have to bear out that they are a minimum or a saddle (`benches/stress/stiffness.rs`). *Wrong* is whatever fails this, a panic or a NaN.

`f_max` in units of γ, of converged cases. *Law broken by*: largest gap at a contact or overlap elsewhere, relative to the largest
overlap of the undeformed disks (packings whose overlaps are all below 1e-5 are checked to round-off and left out here).
*Squeeze*: `Σ f/2πγ` of a particle; beyond 0.0659 the linear model's own forces are too small by more than 10 %
(`droplet::validity`).

";

/// Today, UTC, as 2026-01-31; from the days since 1970 by H. Hinnant's civil_from_days.
fn date() -> String {
    let seconds = SystemTime::now()
        .duration_since(UNIX_EPOCH)
        .map_or(0, |d| d.as_secs());
    let z = (seconds / 86_400) as i64 + 719_468;
    let era = z / 146_097;
    let day_of_era = z % 146_097;
    let year_of_era =
        (day_of_era - day_of_era / 1_460 + day_of_era / 36_524 - day_of_era / 146_096) / 365;
    let day_of_year = day_of_era - (365 * year_of_era + year_of_era / 4 - year_of_era / 100);
    let month = (5 * day_of_year + 2) / 153;
    let day = day_of_year - (153 * month + 2) / 5 + 1;
    let month = if month < 10 { month + 3 } else { month - 9 };
    let year = year_of_era + era * 400 + i64::from(month <= 2);
    format!("{year}-{month:02}-{day:02}")
}

fn processor() -> String {
    std::fs::read_to_string("/proc/cpuinfo")
        .ok()
        .and_then(|text| {
            let line = text.lines().find(|l| l.starts_with("model name"))?;
            Some(line.split_once(':')?.1.trim().to_owned())
        })
        .unwrap_or_else(|| std::env::consts::ARCH.into())
}
