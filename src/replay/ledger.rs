//! What the run gives, held against what the file holds: every row of the metrics once, and every byte.

use super::Metrics;
use super::balance::Worst;
use super::bytes::{self, Compared};
use super::difference::{Difference, Row, What};
use super::tolerance;
use super::walk::End;
use crate::analysis::{self, METRICS};
use crate::record::Snapshot;
use crate::scene::Schedule;
use std::collections::BTreeMap;
use std::sync::Arc;

/// Rows that the run has given and the file lacks are waited for up to so many: in a recording they come before the state that
/// follows them, and other tools that put them elsewhere do not tear them apart by more.
const MOST_AWAITED: usize = 1 << 17;

/// The values of a row that are still to be compared.
type Values = [Option<f64>; METRICS.len()];

/// Where run and file are held against each other, in the order of the steps.
pub(super) struct Ledger {
    schedule: Schedule,
    /// The last step that the run has given.
    given: Option<u64>,
    /// Rows that the file has and the run has not given yet.
    found: BTreeMap<u64, Values>,
    /// Rows that the run has given and the file has not had yet.
    awaited: BTreeMap<u64, Values>,
    /// Values that were compared.
    metrics: u64,
    difference: Option<Difference>,
    bytes: Option<bytes::Recording>,
    /// Behind this step rows may lack values: the file breaks off, maybe between the columns of a batch.
    broken_off_behind: u64,
    /// Of another revision of the bits: how far it is off at worst, and what is allowed at present.
    deviation: Option<(Worst, f64)>,
}

impl Ledger {
    /// Nothing given and nothing found; metrics are recorded by `schedule`.
    pub fn new(schedule: Schedule, bytes: Option<bytes::Recording>) -> Self {
        Self {
            schedule,
            given: None,
            found: BTreeMap::new(),
            awaited: BTreeMap::new(),
            metrics: 0,
            difference: None,
            bytes,
            broken_off_behind: u64::MAX,
            deviation: None,
        }
    }

    /// From here on values may be off by `allowed`.
    pub fn allow(&mut self, allowed: f64) {
        let worst = self.deviation().unwrap_or_default();
        self.deviation = Some((worst, allowed));
    }

    /// A state is off by so much.
    pub fn deviates(&mut self, value: f64, step: u64) {
        if let Some((worst, allowed)) = &mut self.deviation {
            worst.of(value, *allowed, step);
        }
    }

    /// The worst that another revision is off by.
    pub fn deviation(&self) -> Option<Worst> {
        self.deviation.map(|(worst, _)| worst)
    }

    /// The first difference so far.
    pub fn difference(&self) -> Option<&Difference> {
        self.difference.as_ref()
    }

    /// Values of metrics that were compared.
    pub fn metrics(&self) -> u64 {
        self.metrics
    }

    /// Notes a difference, if none is known that is earlier.
    pub fn differs(&mut self, difference: Option<Difference>) {
        let Some(new) = difference else { return };
        if self
            .difference
            .as_ref()
            .is_none_or(|old| new.step < old.step)
        {
            self.difference = Some(new);
        }
    }

    /// The file has these rows.
    pub fn find(&mut self, rows: Metrics) {
        for (step, values) in rows {
            for (name, value) in values {
                if let Some(k) = METRICS.iter().position(|known| *known == name) {
                    self.find_value(step, k, value);
                }
            }
        }
    }

    fn find_value(&mut self, step: u64, k: usize, value: f64) {
        if self.given.is_none_or(|given| step > given) {
            let before = self.found.entry(step).or_default()[k].replace(value);
            if before.is_some() {
                self.row(step, k, Row::Twice);
            }
            return;
        }
        let awaited = self.awaited.get_mut(&step);
        match awaited.and_then(|values| values[k].take()) {
            Some(expected) => self.compare(step, k, value, expected),
            None if self.schedule.includes(step) => self.row(step, k, Row::Twice),
            None => self.row(step, k, Row::NotAsked),
        }
        if self
            .awaited
            .get(&step)
            .is_some_and(|v| v.iter().all(Option::is_none))
        {
            self.awaited.remove(&step);
        }
    }

    /// The run gives what is recorded of a step; whether nothing differs yet.
    pub fn give(&mut self, snapshot: Arc<Snapshot>) -> bool {
        let step = snapshot.step;
        // Rows in front of it that are still there are of steps that have none.
        while let Some((&early, values)) = self.found.first_key_value()
            && early < step
        {
            let k = values.iter().position(Option::is_some).unwrap_or(0);
            self.row(early, k, Row::NotAsked);
            self.found.remove(&early);
        }
        let found = self.found.remove(&step).unwrap_or_default();
        let expected: analysis::Metrics = snapshot.metrics.unwrap_or_default();
        let mut missing = Values::default();
        for (k, (found, expected)) in found.into_iter().zip(expected).enumerate() {
            match (found, expected) {
                (Some(found), Some(expected)) => self.compare(step, k, found, expected),
                (Some(_), None) => self.row(step, k, Row::NotAsked),
                (None, expected) => missing[k] = expected,
            }
        }
        if missing.iter().any(Option::is_some) {
            self.awaited.insert(step, missing);
            if self.awaited.len() > MOST_AWAITED {
                self.miss();
            }
        }
        self.given = Some(step);
        if let Some(bytes) = &mut self.bytes {
            bytes.give(snapshot);
        }
        self.difference.is_none()
    }

    /// The step up to which the file has a row at each step behind `step` that asks for one; `step` if there is none.
    pub fn found_without_gap_from(&self, step: u64) -> u64 {
        let mut until = step;
        while let Some(next) = self.schedule.after(until)
            && self.found.contains_key(&next)
        {
            until = next;
        }
        until
    }

    /// The file breaks off, and this was its last state.
    pub fn breaks_off_behind(&mut self, step: u64) {
        self.broken_off_behind = step;
    }

    /// The end of both: nothing may be left.
    pub fn end(&mut self, end: End) -> Option<Compared> {
        self.miss();
        if let Some((&step, values)) = self.found.first_key_value() {
            let k = values.iter().position(Option::is_some).unwrap_or(0);
            self.row(step, k, Row::BehindTheEnd);
        }
        self.bytes.take().map(|bytes| bytes.end(end))
    }

    /// The first row that is awaited is missing.
    fn miss(&mut self) {
        if let Some((&step, values)) = self.awaited.first_key_value()
            && step <= self.broken_off_behind
        {
            let k = values.iter().position(Option::is_some).unwrap_or(0);
            self.row(step, k, Row::Missing);
        }
    }

    fn row(&mut self, step: u64, k: usize, row: Row) {
        let what = What::Row {
            name: METRICS[k],
            row,
        };
        self.differs(Some(Difference { step, what }));
    }

    fn compare(&mut self, step: u64, k: usize, here: f64, there: f64) {
        self.metrics += 1;
        if let Some((worst, allowed)) = &mut self.deviation {
            tolerance::note_metric(worst, METRICS[k], here, there, *allowed, step);
            return;
        }
        if here.to_bits() != there.to_bits() {
            let name = format!("metric {}", METRICS[k]);
            let what = What::Value { name, here, there };
            self.differs(Some(Difference { step, what }));
        }
    }
}
