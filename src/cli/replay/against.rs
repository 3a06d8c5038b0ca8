//! `softjam replay --against`: two recordings held against each other.

use super::Arguments;
use crate::cli::lines::Lines;
use crate::cli::{Verdict, print};
use softjam::replay::{Comparison, Recording, compare, place_of_byte};
use softjam::text::counted;
use softjam::text::shown;
use std::fs::File;
use std::io::{self, BufReader, Read};
use std::path::Path;

pub(super) fn against(here: &Path, there: &Path, arguments: &Arguments) -> anyhow::Result<Verdict> {
    let budget = arguments.memory.budget();
    let mut a = Recording::open_within(here, budget)?;
    let mut b = Recording::open_within(there, budget)?;
    let found: Comparison = compare(&mut a, &mut b)?;
    // Two finished recordings of one scene by one version are the same file.
    let alike = a.scene() == b.scene()
        && (a.from_step(), a.program(), a.format()) == (b.from_step(), b.program(), b.format())
        && a.is_laid_out_by_softjam() == b.is_laid_out_by_softjam()
        && a.is_closed()
        && b.is_closed();
    let byte = alike.then(|| first_difference(here, there)).transpose()?;
    let difference = found.difference.as_ref().map(ToString::to_string);
    let difference = difference.or_else(|| {
        let at = byte.flatten()?;
        let place = place_of_byte(here, at).map_or(String::new(), |place| format!(" ({place})"));
        Some(format!("byte {at} of the files{place}"))
    });
    let same = difference.is_none() && found.common > 0;
    let verdict = match &difference {
        Some(difference) => format!("differ: {difference}"),
        None if found.common == 0 => "no step is recorded in both".to_owned(),
        None => "the same to the last bit".to_owned(),
    };
    let (states, metrics) = (
        counted(found.common, "common step"),
        counted(found.metrics, "metric"),
    );
    let beyond = if alike {
        ", and all bytes of the two files. Not checked: whether their scene gives them."
    } else {
        ". Not checked: pictures, layout and names; whether their scenes give them."
    };
    let checked = format!("states at {states} and {metrics}{beyond}");
    print(&if arguments.json {
        let value = serde_json::json!({
            "here": shown(&here.display().to_string()),
            "there": shown(&there.display().to_string()),
            "common": found.common,
            "only_here": found.only_here,
            "only_there": found.only_there,
            "metrics": found.metrics,
            "difference": difference,
            "same": same,
            "checked": checked,
        });
        format!("{value:#}\n")
    } else {
        let mut lines = Lines::default();
        lines.line("common steps", found.common);
        lines.line("only here", found.only_here);
        lines.line("only there", found.only_there);
        lines.line("verdict", verdict);
        lines.say("checked", &checked);
        lines.into_text()
    })?;
    Ok(if same { Verdict::Good } else { Verdict::Bad })
}

/// The first byte that two files do not share, the end of the shorter one included.
fn first_difference(here: &Path, there: &Path) -> io::Result<Option<u64>> {
    let bytes = |path| Ok::<_, io::Error>(BufReader::new(File::open(path)?).bytes());
    let (mut ours, mut theirs) = (bytes(here)?, bytes(there)?);
    let mut at = 0;
    loop {
        match (ours.next().transpose()?, theirs.next().transpose()?) {
            (None, None) => return Ok(None),
            (a, b) if a != b => return Ok(Some(at)),
            _ => at += 1,
        }
    }
}
