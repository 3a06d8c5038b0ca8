//! What a replay found, in words.

use super::verdict::{Findings, nothing_was_run};
use crate::cli::lines::Lines;
use softjam::BITS;
use softjam::models::Kind;
use softjam::record::PROGRAM;
use softjam::replay::{Balance, Bytes, Determinism, Origin, Worst, place_of_byte};
use softjam::text::counted;
use std::path::Path;

impl Findings {
    /// What was checked, what was not, and with which versions.
    pub(super) fn checked(&self) -> String {
        let (mut checked, mut not) = (Vec::new(), Vec::new());
        let (law, shapes) = match self.recording.scene().model {
            Kind::MorseWitten => ("contact law", "contours"),
            Kind::RoundedPolygon | Kind::WetFoam => ("contact law and the areas", "contours"),
            Kind::Disks => ("law of the forces", "disks"),
        };
        match &self.determinism {
            None => not.push(
                "whether the scene gives this run (--only balance): nothing was run".to_owned(),
            ),
            Some(d) => self.tell_determinism(d, &mut checked, &mut not),
        }
        match &self.balance {
            None => not.push(format!(
                "the {law} and the balance of forces (--only determinism)"
            )),
            Some(b) => checked.push(format!(
                "contacts, forces and balance, by the {shapes} alone, of {}",
                counted(b.frames, "state")
            )),
        }
        let checked = if checked.is_empty() {
            "nothing".to_owned()
        } else {
            checked.join("; ")
        };
        let not = if not.is_empty() {
            String::new()
        } else {
            format!(" Not checked: {}.", not.join("; "))
        };
        let own = format!("{PROGRAM} (bits {BITS})");
        let (program, bits) = (self.recording.program(), self.recording.bits());
        let recorded = format!("{program} (bits {bits})");
        let versions = if recorded == own {
            format!("Recorded and checked by {own}.")
        } else {
            format!("Recorded by {recorded}, checked by {own}.")
        };
        format!("{checked}.{not} {versions}")
    }

    fn tell_determinism(&self, d: &Determinism, checked: &mut Vec<String>, not: &mut Vec<String>) {
        if nothing_was_run(d) {
            not.push("anything of the run: no step leads to the only recorded state".to_owned());
            return;
        }
        let recording = &self.recording;
        let begin = match d.origin {
            Origin::Scene => "its start",
            Origin::Positions => "the first recorded positions",
            Origin::Frame => "the first recorded state",
        };
        let legs = recording
            .legs()
            .iter()
            .filter(|_| d.origin == Origin::Scene);
        let legs = legs.map(|leg| {
            let (until, threshold) = (leg.until, leg.threshold);
            format!(
                " (to step {until} with the threshold {threshold:e}, the model, minimiser and forces of before)"
            )
        });
        let legs = legs.collect::<Vec<_>>().concat();
        let (steps, rows) = (counted(d.run, "step"), rows(d));
        let end = recording
            .outcome()
            .map_or("", |_| ", and where the run ends");
        checked.push(match d.deviation {
            None => {
                format!(
                    "the scene run again from {begin}{legs}, {steps}: {rows}, by their bits{end}"
                )
            }
            Some(_) => {
                format!("{steps} from recorded state to recorded state, within tolerances: {rows}")
            }
        });
        match d.origin {
            Origin::Scene => {}
            Origin::Positions => {
                not.push("whether the start file leads to these positions and radii".to_owned());
            }
            Origin::Frame => not.push(format!(
                "how the run came to step {}, which is in the recording that this one goes on from",
                recording.from_step()
            )),
        }
        let (pictures, program) = ("pictures, layout and names", recording.program());
        match d.bytes {
            _ if d.difference.is_some() => {
                not.push(format!("what comes behind the difference; {pictures}"));
            }
            Bytes::Same(bytes) => checked.push(format!(
                "all {bytes} bytes of the file, {pictures} with them"
            )),
            Bytes::SameUpTo(bytes) => checked.push(format!(
                "the first {bytes} bytes of the file, which breaks off"
            )),
            Bytes::LaidOutOtherwise if program == PROGRAM => {
                not.push(format!(
                    "{pictures}: another program has rewritten the file"
                ));
            }
            Bytes::LaidOutOtherwise => {
                not.push(format!("{pictures}, which {program} may lay out otherwise"));
            }
            Bytes::Differ { .. } => {}
            _ => not.push(pictures.to_owned()),
        }
        let channels = recording.scene().channels.named().into_iter();
        let off = channels.filter_map(|(name, schedule)| (!schedule.is_on()).then_some(name));
        let off: Vec<&str> = off.collect();
        if !off.is_empty() {
            not.push(format!("{}, which the scene switches off", off.join(", ")));
        }
    }
}

/// How much was compared.
fn rows(d: &Determinism) -> String {
    format!(
        "{} and {}",
        counted(d.states, "state"),
        counted(d.metrics, "metric")
    )
}

/// How the run that was made again differs from the recorded one.
pub(super) fn difference(d: &Determinism) -> String {
    let (first, last) = d.steps.unwrap_or_default();
    if let Some(difference) = &d.difference {
        return format!("differs: {difference} (here: the file)");
    }
    if nothing_was_run(d) {
        return "nothing was run: the only recorded state is where the recording begins".to_owned();
    }
    let what = format!("{}, steps {first} … {last}", rows(d));
    match d.deviation {
        None => format!("{what}: the same to the last bit"),
        Some(worst) => {
            let word = if worst.agrees() {
                "agrees"
            } else {
                "does not agree"
            };
            let worst = at(&worst);
            format!("{what}: {word} to {worst}, other revision of the bits")
        }
    }
}

/// How the bytes of the file compare with those that the run writes; nothing if they were not compared.
pub(super) fn bytes(d: &Determinism, path: &Path) -> Option<String> {
    Some(match d.bytes {
        Bytes::Same(bytes) => format!("all {bytes} are the run's"),
        Bytes::SameUpTo(bytes) => format!("the first {bytes} are the run's"),
        Bytes::LaidOutOtherwise => {
            "laid out by another program or version: compared by what they hold".to_owned()
        }
        Bytes::Differ { at } => {
            let place = place_of_byte(path, at);
            let place = place.map_or(String::new(), |place| format!(" ({place})"));
            format!("differ from byte {at} on{place}: damaged or changed after it was written")
        }
        _ => return None,
    })
}

/// A residual, and what is allowed where it is worst.
///
/// A contact problem is solved to what `f_max` makes sensible, so a frame far from balance is off by more.
fn at(worst: &Worst) -> String {
    let (value, step, allowed) = (worst.value, worst.step, worst.allowed);
    if allowed > 0.0 {
        format!("{value:.1e} at step {step} (allowed there: {allowed:.1e})")
    } else {
        format!("{value:.1e} at step {step}")
    }
}

pub(super) fn tell_balance(b: &Balance, model: Kind, lines: &mut Lines) {
    let at = |w: &Worst| {
        if w.value == 0.0 {
            "none".to_owned()
        } else {
            at(w)
        }
    };
    let law = match model {
        Kind::MorseWitten => "equation (4)",
        Kind::RoundedPolygon | Kind::WetFoam => "contact law",
        Kind::Disks => "f = k δ",
    };
    let (last, worst) = (b.last_equation_4, at(&b.equation_4));
    let residual = format!("{last:.1e} of the largest overlap at the last state; {worst} at worst");
    lines.line(law, residual);
    lines.line("gaps", format!("overlap elsewhere: {}", at(&b.overlap)));
    let observables = at(&b.energy_and_pressure);
    lines.line(
        "observables",
        format!("energy and pressure, relative: {observables}"),
    );
    if b.relaxed.value > 0.0 {
        lines.line(
            "states",
            format!("f_max of relaxed states: {}", at(&b.relaxed)),
        );
    }
    if b.pull.value > 0.0 {
        lines.line("pulls", at(&b.pull));
    }
    if let Some((step, f_max)) = b.last {
        let f_max = format!("{f_max:.3e} γ at step {step}, from positions alone");
        lines.line("f_max", f_max);
    }
}
