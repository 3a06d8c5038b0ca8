//! Parts of one run, read as one recording.

use super::source::{Ending, Item, Problem, Source};
use super::{Event, ReadError, Recording};
use crate::BITS;
use crate::protocol::Relaxation;
use crate::record::Outcome;
use crate::scene::{Channels, Scene};
use crate::state::Frame;
use crate::text::shown;
use std::collections::{BTreeMap, VecDeque};

/// What was read at steps that the next part holds as well.
#[derive(Default)]
struct Held {
    states: BTreeMap<u64, [u8; 32]>,
    metrics: BTreeMap<(u64, &'static str), (i64, u64)>,
}

/// Bytes that it takes to hold a state's digest or a metric.
const HELD: u64 = 80;

/// Recordings of one run, one behind the other: each begins at a state that the ones before hold.
pub(super) struct Joined {
    parts: VecDeque<Recording>,
    scene: Scene,
    held: Held,
    /// The part that was read last, and the step of its last state.
    before: Option<(String, Option<u64>)>,
    /// The last state of the part at hand, if no schedule asks for it.
    off_schedule: Option<Frame>,
    /// The stage of the last state that was handed out.
    stage: Option<u32>,
    digests: blake3::Hasher,
    outcome: Option<Outcome>,
    ending: Option<Ending>,
}

impl Recording {
    /// Parts of one run as one recording, in the order of their first steps: what several hold must be the same to the last bit. It is
    /// what the run would have recorded that nobody interrupted, but for pictures: [`convert`](crate::convert::convert) draws them.
    ///
    /// # Errors
    ///
    /// [`ReadError::Join`] if they are not parts of one run with the same channels; a part that does not go on from the one before
    /// shows when it is read.
    ///
    /// ```
    /// use softjam::replay::Recording;
    /// # use softjam::{record, protocol::Relaxation, scene::Scene};
    /// # let path = std::env::temp_dir().join("softjam-joined-example.rrd");
    /// # let scene = Scene { particles: 32, phi: 0.9, ..Scene::default() };
    /// # let mut run = Relaxation::new(&scene).unwrap();
    /// # let writer = record::Writer::create(&path, true, record::Header::of(&scene, &run)).unwrap();
    /// # record::record(&mut run, vec![writer], &scene.channels, |_| true).unwrap();
    ///
    /// let parts = [&path, &path].map(|path| Recording::open(path).unwrap());
    /// let mut whole = Recording::joined(parts.into()).unwrap();
    /// while whole.next_state().unwrap().is_some() {}
    /// assert!(whole.outcome().unwrap().converged);
    /// # std::fs::remove_file(&path).unwrap();
    /// ```
    pub fn joined(parts: Vec<Self>) -> Result<Self, ReadError> {
        let nothing = || join("nothing", "there are no parts");
        let (first, last) = parts.first().zip(parts.last()).ok_or_else(nothing)?;
        for (before, part) in parts.iter().zip(&parts[1..]) {
            let problem = differs(first, part).or_else(|| {
                let (begins, earlier) = (part.from_step(), before.from_step());
                let name = shown(before.path());
                let (limit, longer) = (part.scene().steps, before.scene().steps);
                if begins < earlier {
                    Some(format!("it begins with step {begins}, before {name}, which begins with step {earlier}: name it earlier"))
                } else if begins == earlier && limit < longer {
                    Some(format!("it ends with step {limit} at the latest, and {name}, which begins where it does, goes on to {longer}: name it earlier"))
                } else {
                    None
                }
            });
            if let Some(problem) = problem {
                return Err(join(part.path(), problem));
            }
        }
        if !first.scene().channels.state.is_on() {
            let problem = "it holds no states, so nothing shows what goes on from where";
            return Err(join(first.path(), problem));
        }
        let names: Vec<String> = parts.iter().map(|part| shown(part.path())).collect();
        // A run that came to its step limit may have been given more steps.
        let longest = parts
            .iter()
            .max_by_key(|part| part.scene().steps)
            .unwrap_or(last);
        let (scene, mut header) = (longest.scene().clone(), first.source_header());
        header.scene = scene.clone();
        header.bits = last.bits();
        let (format, budget) = (first.format(), first.budget());
        let source = Joined {
            parts: parts.into(),
            scene,
            held: Held::default(),
            before: None,
            off_schedule: None,
            stage: None,
            digests: blake3::Hasher::new(),
            outcome: None,
            ending: None,
        };
        Ok(Self::of(
            names.join(" + "),
            format,
            Box::new(source),
            header,
            budget,
        ))
    }
}

fn join(path: &str, problem: impl Into<String>) -> ReadError {
    ReadError::Join {
        path: path.to_owned(),
        problem: problem.into(),
    }
}

/// How a recording cannot be of the run that another one is of.
fn differs(first: &Recording, part: &Recording) -> Option<String> {
    let name = shown(first.path());
    if let Some(other) = [first, part].iter().find(|part| !part.has_same_bits()) {
        let (bits, name) = (other.bits(), shown(other.path()));
        return Some(format!(
            "{name} was computed with bits {bits}, this program computes with bits {BITS}"
        ));
    }
    let text = |recording: &Recording| {
        let steps = first.scene().steps;
        let scene = recording.scene().clone();
        Scene { steps, ..scene }.to_toml()
    };
    let (ours, theirs) = (text(part), text(first));
    let line = ours.lines().zip(theirs.lines()).find(|(a, b)| a != b);
    let channels = |r: &Recording| {
        let Channels { redraw, .. } = r.scene().channels;
        (r.scene().channels.named(), redraw)
    };
    let way_out = if channels(first) == channels(part) {
        ""
    } else {
        "; `softjam convert` gives it other channels"
    };
    line.map(|(a, b)| {
        format!(
            "its scene has {}, that of {name} has {}{way_out}",
            shown(a),
            shown(b)
        )
    })
    .or_else(|| (ours != theirs).then(|| format!("its scene is not that of {name}")))
    .or_else(|| {
        let problem = "its scene was changed on the way otherwise than that of";
        (first.legs() != part.legs()).then(|| format!("{problem} {name}"))
    })
    .or_else(|| {
        let same = first.radii() == part.radii() && first.domain() == part.domain();
        (!same).then(|| format!("its radii or its box are not those of {name}"))
    })
}

impl Joined {
    /// What becomes of the next event of the part at hand.
    fn take(&mut self, event: Event, items: &mut Vec<Item>) -> Result<(), ReadError> {
        match event {
            Event::State(frame) => self.take_state(frame, items),
            Event::Metric {
                name,
                step,
                nanoseconds,
                value,
            } => {
                let found = (nanoseconds, value.to_bits());
                match self.held.metrics.get(&(step, name)) {
                    Some(held) if *held == found => return Ok(()),
                    Some(_) => return Err(self.conflict(&format!("{name} of step {step}"))),
                    None => {}
                }
                if self.is_shared(step) {
                    self.held.metrics.insert((step, name), found);
                }
                items.push(Item::Metric {
                    name,
                    step,
                    nanoseconds,
                    value,
                });
                Ok(())
            }
            Event::Drawn { .. } => Ok(()),
            Event::Result { outcome, .. } => {
                let part = self.parts.front();
                let limit = part.map_or(0, |part| part.scene().steps);
                if !outcome.converged && limit != self.scene.steps {
                    return Ok(());
                }
                // Those of 0.2.0 and before do not say whether it is a minimum.
                let known = |end: Outcome| (end.converged, end.steps, end.f_max.to_bits());
                match self.outcome.replace(outcome) {
                    Some(before) if known(before) != known(outcome) => Err(self.conflict("result")),
                    _ => Ok(()),
                }
            }
        }
    }

    fn take_state(&mut self, frame: Frame, items: &mut Vec<Item>) -> Result<(), ReadError> {
        let (step, digest) = (frame.step, frame.digest());
        match self.held.states.get(&step) {
            Some(held) if *held == digest => return Ok(()),
            Some(_) => return Err(self.conflict(&format!("state of step {step}"))),
            None => {}
        }
        if let (Some((before, last)), Some(part)) = (&self.before, self.parts.front())
            && step == part.from_step()
        {
            let name = shown(before);
            let problem = match last {
                Some(last) if *last >= step => {
                    format!("it begins with step {step}, of which {name} holds no state")
                }
                Some(last) => format!(
                    "it begins with step {step}, and {name} ends with that of step {last}: the steps between are missing"
                ),
                None => format!("{name} holds no state to go on from"),
            };
            return Err(join(part.path(), problem));
        }
        if self.is_shared(step) {
            self.held.states.insert(step, digest);
        }
        let schedule = self.scene.stage(frame.stage).channels.state;
        let begins_stage = self.stage != Some(frame.stage);
        if begins_stage || schedule.includes(step) || self.is_relaxed(&frame)? {
            self.hand_out(frame, items);
        } else {
            self.off_schedule = Some(frame);
        }
        Ok(())
    }

    /// Whether it is one of the states between which a protocol strains the box, which are recorded whatever the schedule.
    fn is_relaxed(&self, frame: &Frame) -> Result<bool, ReadError> {
        let part = self.parts.front();
        let Some(part) = part.filter(|_| !self.scene.protocol.is_empty()) else {
            return Ok(false);
        };
        let packing = part.packing(frame)?;
        let run = Relaxation::resume(&self.scene, packing, frame.clone());
        Ok(run.is_ok_and(|run| run.is_relaxed_state()))
    }

    fn hand_out(&mut self, frame: Frame, items: &mut Vec<Item>) {
        let digest = frame.digest();
        self.stage = Some(frame.stage);
        self.digests.update(&digest);
        items.push(Item::State(frame, digest.to_vec()));
    }

    /// Whether the next part holds this step, too.
    fn is_shared(&self, step: u64) -> bool {
        let next = self.parts.get(1);
        next.is_some_and(|next| step >= next.from_step())
    }

    fn conflict(&self, what: &str) -> ReadError {
        let path = self.parts.front().map_or("", Recording::path);
        let before = self
            .before
            .as_ref()
            .map_or(String::new(), |(name, _)| shown(name));
        join(
            path,
            format!("its {what} is not that of {before}: they are not parts of one run"),
        )
    }

    /// The end of a part: what its last state was depends on whether another goes on from it.
    fn end_part(&mut self, items: &mut Vec<Item>) {
        let Some(part) = self.parts.pop_front() else {
            return;
        };
        let frame = self.off_schedule.take();
        if let Some(frame) = frame.filter(|_| self.outcome.is_some() || self.parts.is_empty()) {
            self.hand_out(frame, items);
        }
        self.before = Some((part.path().to_owned(), part.intact()));
        if let Some(next) = self.parts.front().map(Recording::from_step) {
            self.held.states = self.held.states.split_off(&next);
            self.held.metrics = self.held.metrics.split_off(&(next, ""));
            return;
        }
        let closed = self.outcome.is_some() || part.is_closed();
        self.ending = Some(if closed {
            Ending::Closed
        } else {
            Ending::BreaksOff
        });
        if let Some(outcome) = self.outcome {
            items.push(Item::Result(outcome, *self.digests.finalize().as_bytes()));
        }
    }
}

impl Source for Joined {
    fn read_on(&mut self, items: &mut Vec<Item>) -> Result<bool, Problem> {
        let Some(part) = self.parts.front_mut() else {
            return Ok(false);
        };
        match part.next() {
            Some(event) => {
                let event = event.map_err(Problem::Other)?;
                self.take(event, items).map_err(Problem::Other)?;
                let held = (self.held.states.len() + self.held.metrics.len()) as u64;
                if let Some(part) = self.parts.front() {
                    let allowed = part.allow("what two parts hold both", HELD * held);
                    allowed.map_err(Problem::Other)?;
                }
            }
            None => self.end_part(items),
        }
        Ok(!self.parts.is_empty())
    }

    fn ending(&self) -> Option<Ending> {
        self.ending
    }

    fn is_of_softjam(&self) -> bool {
        true
    }
}
