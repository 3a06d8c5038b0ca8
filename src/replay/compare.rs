//! Two recordings, frame by frame.

use super::difference::{Difference, What};
use super::{ReadError, Recording, State};
use std::collections::BTreeMap;

/// What a comparison of two recordings found.
///
/// See the example of [`compare`].
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Comparison {
    /// Steps recorded on both sides.
    pub common: u64,
    /// Steps recorded in the first only.
    pub only_here: u64,
    /// Steps recorded in the second only.
    pub only_there: u64,
    /// Metrics recorded on both sides.
    pub metrics: u64,
    /// The first common step whose states or metrics differ.
    pub difference: Option<Difference>,
}

/// Compares the states and metrics of two recordings at the steps that both have.
///
/// # Errors
///
/// [`ReadError`] if one of them is damaged.
///
/// # Example
///
/// ```
/// use softjam::replay::{compare, Recording};
/// # use softjam::{record, protocol::Relaxation, scene::Scene};
/// # let path = std::env::temp_dir().join("softjam-compare-example.rrd");
/// # let scene = Scene { particles: 32, phi: 0.9, ..Scene::default() };
/// # let mut run = Relaxation::new(&scene).unwrap();
/// # let writer = record::Writer::create(&path, true, record::Header::of(&scene, &run)).unwrap();
/// # record::record(&mut run, vec![writer], &scene.channels, |_| true).unwrap();
///
/// let (mut a, mut b) = (Recording::open(&path).unwrap(), Recording::open(&path).unwrap());
/// let found = compare(&mut a, &mut b).unwrap();
/// assert!(found.common > 0 && found.difference.is_none());
/// # std::fs::remove_file(&path).unwrap();
/// ```
pub fn compare(here: &mut Recording, there: &mut Recording) -> Result<Comparison, ReadError> {
    let mut found = Comparison::default();
    let (mut ours, mut theirs) = (Rows::default(), Rows::default());
    let (mut a, mut b) = (next(here, &mut ours)?, next(there, &mut theirs)?);
    loop {
        match (&a, &b) {
            (None, None) => break,
            (Some(x), Some(y)) if x.frame.step == y.frame.step => {
                found.common += 1;
                found.differs(Difference::between(&x.frame, &y.frame));
                found.match_rows(&mut ours, &mut theirs, x.frame.step);
                a = next(here, &mut ours)?;
                b = next(there, &mut theirs)?;
            }
            (Some(x), y) if y.as_ref().is_none_or(|y| x.frame.step < y.frame.step) => {
                found.only_here += 1;
                a = next(here, &mut ours)?;
            }
            _ => {
                found.only_there += 1;
                b = next(there, &mut theirs)?;
            }
        }
    }
    ours.add(here.rows_left());
    theirs.add(there.rows_left());
    found.match_rows(&mut ours, &mut theirs, u64::MAX);
    Ok(found)
}

/// Metrics of steps that have not been compared.
#[derive(Default)]
struct Rows(BTreeMap<u64, Vec<(&'static str, f64)>>);

impl Rows {
    fn add(&mut self, rows: super::Metrics) {
        for (step, values) in rows {
            self.0.entry(step).or_default().extend(values);
        }
    }
}

fn next(recording: &mut Recording, rows: &mut Rows) -> Result<Option<State>, ReadError> {
    let mut state = recording.next_state()?;
    if let Some(state) = &mut state {
        rows.add(core::mem::take(&mut state.metrics));
    }
    Ok(state)
}

impl Comparison {
    fn differs(&mut self, new: Option<Difference>) {
        let old = self.difference.as_ref();
        if let Some(new) = new
            && old.is_none_or(|old| new.step < old.step)
        {
            self.difference = Some(new);
        }
    }

    /// Compares the metrics of the steps up to `last` that both sides have; the others are gone.
    fn match_rows(&mut self, ours: &mut Rows, theirs: &mut Rows, last: u64) {
        while let Some(entry) = ours.0.first_entry()
            && *entry.key() <= last
        {
            let (step, values) = entry.remove_entry();
            for (name, there) in theirs.0.remove(&step).into_iter().flatten() {
                for (_, here) in values.iter().filter(|(here, _)| *here == name) {
                    self.metrics += 1;
                    let (name, here) = (format!("metric {name}"), *here);
                    let what = What::Value { name, here, there };
                    let differs = here.to_bits() != there.to_bits();
                    self.differs(differs.then_some(Difference { step, what }));
                }
            }
        }
        theirs.0.retain(|step, _| *step > last);
    }
}
