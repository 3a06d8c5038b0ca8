//! Reading `.rrd` files: which entity gives what.

mod header;
mod stream;

use super::ReadError;
use super::source::{Ending, Header, Item, Problem, Source, guarded};
use crate::analysis::METRICS;
use crate::analysis::Stability;
use crate::budget::Budget;
use crate::domain::{Domain, Vec2};
use crate::minimize::recorded;
use crate::record::Outcome;
use crate::state::Frame;
use crate::text::shown;
use rerun::external::re_log_types::StoreId;
use rerun::log::Chunk;
use rerun::{Scalars, TimelineName};
use std::io::Read;
use stream::{Message, Stream};

/// What an `.rrd` file begins with.
pub(super) const MAGIC: &[u8] = &rerun::external::re_log_encoding::rrd::RRD_FOURCC;

/// An `.rrd` file that is being read.
pub(super) struct RrdSource {
    stream: Stream,
    store: StoreId,
    /// The id that its scene makes.
    scene: String,
    budget: Budget,
}

impl RrdSource {
    /// Reads up to the first frame of a source of `length` bytes.
    pub fn open(
        path: &str,
        source: Box<dyn Read + Send>,
        length: u64,
        budget: Budget,
    ) -> Result<(Self, Header), ReadError> {
        let mut stream =
            Stream::open(source, length, budget).map_err(|problem| not_rrd(path, problem))?;
        let (store, scene, header) = header::read(path, &mut stream)?;
        let source = Self {
            stream,
            store,
            scene,
            budget,
        };
        Ok((source, header))
    }
}

/// What the byte `at` belongs to, in words.
pub(super) fn place_of_byte(
    source: Box<dyn Read + Send>,
    length: u64,
    budget: Budget,
    at: u64,
) -> Option<String> {
    let mut stream = Stream::open(source, length, budget).ok()?;
    loop {
        let message = stream.next().ok()?;
        if stream.offset() <= at && message.is_some() {
            continue;
        }
        return Some(match message {
            None => "its list of chunks".to_owned(),
            Some(Message::Opens) => "where it opens".to_owned(),
            Some(Message::Layout) => "its layout".to_owned(),
            Some(Message::Chunk(_, chunk)) => {
                let entity = shown(&chunk.entity_path().to_string());
                match (steps(&chunk).min(), steps(&chunk).max()) {
                    (Some(first), Some(last)) => format!("{entity}, steps {first} … {last}"),
                    _ => entity,
                }
            }
        });
    }
}

fn not_rrd(path: &str, problem: String) -> ReadError {
    ReadError::Format {
        path: path.to_owned(),
        format: "a rerun recording",
        problem,
    }
}

impl RrdSource {
    /// What follows where another recording is opened: its scene tells.
    fn another(&mut self) -> Problem {
        while let Ok(Some(message)) = self.stream.next() {
            if let Message::Chunk(_, chunk) = message
                && let Some(scene) = header::scene_id(&chunk)
            {
                return self.of_scene(&scene);
            }
        }
        Problem::Several
    }

    /// What follows if it is of this scene.
    fn of_scene(&self, scene: &str) -> Problem {
        if scene == self.scene {
            Problem::Parts
        } else {
            Problem::Several
        }
    }
}

impl Source for RrdSource {
    fn read_on(&mut self, items: &mut Vec<Item>) -> Result<bool, Problem> {
        let Some(message) = self.stream.next()? else {
            return Ok(false);
        };
        match message {
            Message::Opens => return Err(self.another()),
            Message::Layout => {}
            Message::Chunk(store, _) if store != self.store => return Err(Problem::Several),
            Message::Chunk(_, chunk) => {
                if let Some(scene) = header::scene_id(&chunk) {
                    return Err(self.of_scene(&scene));
                }
                let size = (chunk.num_rows() * size_of::<Item>()) as u64;
                self.budget.allow_piece("a message of so many rows", size)?;
                guarded(|| take_apart(&chunk, items))?;
            }
        }
        Ok(true)
    }

    fn ending(&self) -> Option<Ending> {
        self.stream.ending()
    }

    fn is_of_softjam(&self) -> bool {
        self.stream.is_plain() && self.store.recording_id().as_str() == self.scene
    }
}

/// Takes the rows of an entity apart.
fn take_apart(chunk: &Chunk, items: &mut Vec<Item>) -> Result<(), String> {
    let entity = chunk.entity_path().to_string();
    match entity.as_str() {
        // The header has been read: what else is of it is there twice.
        "/particles" => return Err("it has two records of its particles".to_owned()),
        "/state" | "/metrics/f_max" if chunk.num_rows() > 0 && steps(chunk).next().is_none() => {
            return Err(format!(
                "rows of {entity} have no timeline `step`: it was taken out of them"
            ));
        }
        "/state" => read_states(chunk, items)?,
        "/result" => items.push(read_result(chunk).ok_or("its result is not whole")?),
        "/world/contours" | "/world/contacts" if !chunk.is_static() => {
            let channel = if entity == "/world/contours" {
                "contours"
            } else {
                "contacts"
            };
            items.extend(steps(chunk).map(|step| Item::Drawn { channel, step }));
        }
        _ => {
            let name = entity.strip_prefix("/metrics/");
            if let Some(name) = METRICS.into_iter().find(|known| Some(*known) == name) {
                let values = chunk.iter_slices::<f64>(Scalars::descriptor_scalars().component);
                let rows = steps(chunk).zip(times(chunk)).zip(values);
                items.extend(rows.filter_map(|((step, nanoseconds), value)| {
                    let &[value] = value else { return None };
                    Some(Item::Metric {
                        name,
                        step,
                        nanoseconds,
                        value,
                    })
                }));
            }
        }
    }
    Ok(())
}

fn read_states(chunk: &Chunk, items: &mut Vec<Item>) -> Result<(), String> {
    let vectors = |name: &'static str| {
        chunk
            .iter_slices::<[f64; 2]>(name.into())
            .map(|list| list.iter().map(|&[x, y]| Vec2::new(x, y)).collect())
            .collect::<Vec<Vec<Vec2>>>()
    };
    let numbers = |name: &'static str| {
        chunk
            .iter_slices::<f64>(name.into())
            .map(<[f64]>::to_vec)
            .collect::<Vec<_>>()
    };
    let mut positions = vectors("softjam.State:position").into_iter();
    let mut velocities = vectors("softjam.State:velocity").into_iter();
    let mut contacts = chunk
        .iter_slices::<[u32; 2]>("softjam.State:contact".into())
        .map(<[[u32; 2]]>::to_vec);
    let mut forces = numbers("softjam.State:force").into_iter();
    let mut minimizers = numbers("softjam.State:minimizer").into_iter();
    let mut digests = chunk
        .iter_slices::<u8>("softjam.State:digest".into())
        .map(<[u8]>::to_vec);
    let mut solvers = chunk.iter_slices::<String>("softjam.State:solver".into());
    let mut memories = numbers("softjam.State:memory").into_iter();
    let mut boxes = numbers("softjam.State:box").into_iter();
    let mut stages = chunk.iter_slices::<u32>("softjam.State:stage".into());
    let mut protocols = numbers("softjam.State:protocol").into_iter();
    for step in steps(chunk) {
        let missing = |what| format!("no {what} at step {step}");
        let name = solvers.next();
        let name = name.and_then(|names| names.first().map(ToString::to_string));
        let domain = match &*boxes.next().unwrap_or_default() {
            [] => None,
            values => Some(Domain::from_values(values).ok_or_else(|| missing("such box"))?),
        };
        let minimizer = minimizers
            .next()
            .and_then(|values| recorded(name.as_deref(), &values))
            .ok_or_else(|| missing("minimiser state"))?;
        let frame = Frame {
            step,
            positions: positions.next().ok_or_else(|| missing("positions"))?,
            velocities: velocities.next().ok_or_else(|| missing("velocities"))?,
            contacts: contacts.next().ok_or_else(|| missing("contacts"))?,
            forces: forces.next().ok_or_else(|| missing("forces"))?,
            minimizer,
            memory: memories.next().unwrap_or_default(),
            domain,
            stage: stages
                .next()
                .and_then(|list| list.first().copied())
                .unwrap_or(0),
            protocol: protocols.next().unwrap_or_default(),
        };
        let digest = digests.next().ok_or_else(|| missing("digest"))?;
        items.push(Item::State(frame, digest));
    }
    Ok(())
}

fn read_result(chunk: &Chunk) -> Option<Item> {
    let converged = chunk
        .iter_slices::<bool>("softjam.Result:converged".into())
        .next()
        .and_then(|list| list.iter().next())?;
    let mut steps = chunk.iter_slices::<u64>("softjam.Result:steps".into());
    let mut f_max = chunk.iter_slices::<f64>("softjam.Result:f_max".into());
    let mut digest = chunk.iter_slices::<u8>("softjam.Result:digest".into());
    let mut stability = chunk.iter_slices::<String>("softjam.Result:stability".into());
    let outcome = Outcome {
        converged,
        steps: steps.next()?.first().copied()?,
        f_max: f_max.next()?.first().copied()?,
        stability: match stability.next() {
            Some(names) => Some(Stability::from_name(names.first()?)?),
            None => None,
        },
    };
    Some(Item::Result(outcome, digest.next()?.try_into().ok()?))
}

/// The times of a chunk's rows on one of its timelines; nothing if it has no such timeline.
fn on(chunk: &Chunk, timeline: &'static str) -> std::vec::IntoIter<i64> {
    let timeline: TimelineName = timeline.into();
    let times = chunk.iter_indices(&timeline).map(|(time, _)| time.as_i64());
    times.collect::<Vec<_>>().into_iter()
}

fn steps(chunk: &Chunk) -> impl Iterator<Item = u64> {
    on(chunk, "step").map(|step| u64::try_from(step).unwrap_or(0))
}

/// Simulated times in nanoseconds; 0 where there are none.
fn times(chunk: &Chunk) -> impl Iterator<Item = i64> {
    on(chunk, "sim_time").chain(core::iter::repeat(0))
}
