//! Reading `.mcap` files: which topic gives what.

mod stream;

use super::ReadError;
use super::source::{Ending, Header, Item, Problem, Source, check_version, particles, read_scene};
use crate::analysis::METRICS;
use crate::analysis::Stability;
use crate::budget::Budget;
use crate::domain::{Domain, Vec2};
use crate::minimize::recorded;
use crate::record::messages::{
    ABOUT, MetricsMessage, ParticlesMessage, RESULT, SCENE, STEP_NANOSECONDS, StateMessage, topic,
};
use crate::record::{Leg, Outcome, legs_from_text};
use crate::scene::Scene;
use crate::state::Frame;
use crate::text::shown;
use mcap::records::{Channel, MessageHeader, Record};
use prost::Message;
use std::collections::BTreeMap;
use std::io::Read;
use stream::Stream;

/// What an MCAP file begins with.
pub(super) const MAGIC: &[u8] = mcap::MAGIC;

/// An MCAP file that is being read.
pub(super) struct McapSource {
    stream: Stream,
    topics: Topics,
    /// Whether its library is softjam's.
    of_softjam: bool,
    /// How the run ended. Other writers may put it in front of the states, so it is kept for the end.
    result: Option<Item>,
    about: About,
}

/// The topics by their numbers.
#[derive(Default)]
struct Topics(BTreeMap<u16, String>);

impl Topics {
    fn add(&mut self, channel: Channel) -> Result<(), String> {
        let Channel { id, topic, .. } = channel;
        let topic = shown(&topic);
        match self.0.insert(id, topic) {
            Some(before) if before != self.0[&id] => {
                Err(format!("topic {id} is {before} and then {}", self.0[&id]))
            }
            _ => Ok(()),
        }
    }

    fn of(&self, message: &MessageHeader) -> &str {
        self.0.get(&message.channel_id).map_or("", String::as_str)
    }
}

/// What the metadata record says of the file.
#[derive(Clone)]
struct About {
    format: u32,
    program: String,
    scene_digest: String,
    bits: u32,
    from_step: u64,
    legs: Vec<Leg>,
}

impl About {
    /// What follows where a file says of itself once more what it is.
    fn another(&self, metadata: &BTreeMap<String, String>) -> Problem {
        if metadata.get("scene_digest") == Some(&self.scene_digest) {
            Problem::Parts
        } else {
            Problem::Several
        }
    }
}

impl McapSource {
    /// Reads up to the first frame of a source of `length` bytes.
    pub fn open(
        path: &str,
        source: Box<dyn Read + Send>,
        length: u64,
        budget: Budget,
    ) -> Result<(Self, Header), ReadError> {
        let not_mcap = |problem| ReadError::Format {
            path: path.to_owned(),
            format: "an MCAP file",
            problem,
        };
        let missing = |missing| ReadError::NotSoftjam {
            path: path.to_owned(),
            missing,
        };
        let mut stream = Stream::open(source, length, budget);
        let mut topics = Topics::default();
        let mut about: Option<About> = None;
        let mut toml: Option<String> = None;
        let mut packing: Option<(Vec<f64>, Domain)> = None;
        let mut result = None;
        let mut of_softjam = false;
        loop {
            if let (Some(about), Some(toml), Some((radii, domain))) = (&about, &toml, &packing) {
                let header = Header {
                    scene: checked_scene(path, about, toml)?,
                    radii: radii.clone(),
                    domain: *domain,
                    format: about.format,
                    program: about.program.clone(),
                    bits: about.bits,
                    from_step: about.from_step,
                    legs: about.legs.clone(),
                };
                let source = Self {
                    stream,
                    topics,
                    of_softjam,
                    result,
                    about: about.clone(),
                };
                return Ok((source, header));
            }
            let record = stream.next();
            match record.map_err(|problem| problem.at_start(path, not_mcap))? {
                Some(Record::Metadata(data)) if data.name == ABOUT => {
                    if let Some(about) = &about {
                        return Err(about.another(&data.metadata).at_start(path, not_mcap));
                    }
                    about =
                        Some(read_about(path, &data.metadata)?.ok_or(missing("format version"))?);
                }
                Some(Record::Attachment { header, data, .. }) if header.name == SCENE => {
                    let text = String::from_utf8(data.into_owned());
                    toml = Some(text.map_err(|e| not_mcap(format!("its scene: {e}")))?);
                }
                Some(Record::Metadata(data)) if data.name == RESULT => {
                    result = Some(read_result(&data.metadata).map_err(not_mcap)?);
                }
                Some(Record::Channel(channel)) => topics.add(channel).map_err(not_mcap)?,
                Some(Record::Header(file)) => of_softjam = file.library.starts_with("softjam/"),
                Some(Record::Message { header, data })
                    if topics.of(&header) == topic::PARTICLES =>
                {
                    let message = ParticlesMessage::decode(&*data)
                        .map_err(|e| not_mcap(format!("its particles: {e}")))?;
                    let read = particles(message.radius, Some(message.sides));
                    packing = Some(read.map_err(missing)?);
                }
                Some(Record::Message { header, .. })
                    if [topic::STATE, topic::METRICS].contains(&topics.of(&header)) =>
                {
                    let topic = topics.of(&header);
                    return Err(not_mcap(format!(
                        "messages of {topic} stand in front of its scene and radii"
                    )));
                }
                Some(_) => {}
                None => {
                    return Err(missing(match (about, toml) {
                        (None, _) => "metadata `softjam`",
                        (_, None) => "scene",
                        _ => "radii",
                    }));
                }
            }
        }
    }
}

fn read_about(path: &str, metadata: &BTreeMap<String, String>) -> Result<Option<About>, ReadError> {
    let text = |key: &str| metadata.get(key).cloned().unwrap_or_default();
    let Ok(format) = text("format_version").parse() else {
        return Ok(None);
    };
    check_version(path, format)?;
    let from_step = text("from_step").parse().unwrap_or(0);
    let legs = metadata.get("legs");
    let legs = legs.map_or(Ok(Vec::new()), |legs| legs_from_text(legs, from_step));
    Ok(Some(About {
        format,
        program: shown(&text("program")),
        scene_digest: text("scene_digest"),
        bits: text("bits").parse().unwrap_or(1),
        from_step,
        legs: legs.map_err(|problem| ReadError::Format {
            path: path.to_owned(),
            format: "an MCAP file",
            problem,
        })?,
    }))
}

/// The scene, which has to be the one that the recording was made of.
fn checked_scene(path: &str, about: &About, toml: &str) -> Result<Scene, ReadError> {
    let (scene, digest) = read_scene(path, toml)?;
    let expected = blake3::Hash::from_bytes(digest).to_hex();
    if about.scene_digest == expected.as_str() {
        Ok(scene)
    } else {
        Err(ReadError::Changed {
            path: path.to_owned(),
            found: about.scene_digest.clone(),
            expected: expected.to_string(),
        })
    }
}

impl Source for McapSource {
    fn read_on(&mut self, items: &mut Vec<Item>) -> Result<bool, Problem> {
        let Some(record) = self.stream.next()? else {
            items.extend(self.result.take());
            return Ok(false);
        };
        match record {
            Record::Channel(channel) => self.topics.add(channel)?,
            Record::Message { header, data } => {
                let step = header.log_time / STEP_NANOSECONDS;
                let topic = self.topics.of(&header);
                let at = |problem: String| format!("{topic} at step {step}: {problem}");
                match topic {
                    topic::STATE => items.push(read_state(&data).map_err(at)?),
                    topic::PARTICLES => {
                        return Err("it has two records of its particles".to_owned().into());
                    }
                    topic::METRICS => read_metrics(&data, items).map_err(at)?,
                    topic::CONTOURS => items.push(Item::Drawn {
                        channel: "contours",
                        step,
                    }),
                    topic::CONTACTS => items.push(Item::Drawn {
                        channel: "contacts",
                        step,
                    }),
                    _ => {}
                }
            }
            Record::Metadata(data) if data.name == RESULT => {
                let result = read_result(&data.metadata)?;
                if self.result.replace(result).is_some() {
                    return Err("it has two results".to_owned().into());
                }
            }
            Record::Metadata(data) if data.name == ABOUT => {
                return Err(self.about.another(&data.metadata));
            }
            _ => {}
        }
        Ok(true)
    }

    fn ending(&self) -> Option<Ending> {
        self.stream.ending()
    }

    fn is_of_softjam(&self) -> bool {
        self.of_softjam
    }
}

fn read_state(bytes: &[u8]) -> Result<Item, String> {
    let message = StateMessage::decode(bytes).map_err(|e| e.to_string())?;
    let vectors = |flat: Vec<f64>, what: &str| {
        let (pairs, rest) = flat.as_chunks::<2>();
        if rest.is_empty() {
            Ok(pairs.iter().map(|&[x, y]| Vec2::new(x, y)).collect())
        } else {
            Err(format!("a {what} has no y"))
        }
    };
    let (contacts, rest) = message.contact.as_chunks::<2>();
    if !rest.is_empty() {
        return Err("a contact has no j".to_owned());
    }
    let name = Some(message.solver.as_str()).filter(|name| !name.is_empty());
    let minimizer = recorded(name, &message.minimizer);
    let domain = match &*message.r#box {
        [] => None,
        values => Some(Domain::from_values(values).ok_or("its box is none")?),
    };
    let frame = Frame {
        step: message.step,
        positions: vectors(message.position, "position")?,
        velocities: vectors(message.velocity, "velocity")?,
        contacts: contacts.to_vec(),
        forces: message.force,
        minimizer: minimizer.ok_or("no minimiser state")?,
        memory: message.memory,
        domain,
        stage: message.stage,
        protocol: message.protocol,
    };
    Ok(Item::State(frame, message.digest))
}

fn read_metrics(bytes: &[u8], items: &mut Vec<Item>) -> Result<(), String> {
    let message = MetricsMessage::decode(bytes).map_err(|e| e.to_string())?;
    let named = METRICS.into_iter().zip(message.values());
    items.extend(named.filter_map(|(name, value)| {
        Some(Item::Metric {
            name,
            step: message.step,
            nanoseconds: message.sim_time_ns.unwrap_or(0),
            value: value?,
        })
    }));
    Ok(())
}

fn read_result(metadata: &BTreeMap<String, String>) -> Result<Item, String> {
    let read = || {
        let text = |key: &str| metadata.get(key).map(String::as_str);
        let outcome = Outcome {
            converged: text("converged")?.parse().ok()?,
            steps: text("steps")?.parse().ok()?,
            f_max: text("f_max")?.parse().ok()?,
            stability: match text("stability") {
                Some(name) => Some(Stability::from_name(name)?),
                None => None,
            },
        };
        let digest = blake3::Hash::from_hex(text("digest")?).ok()?;
        Some(Item::Result(outcome, *digest.as_bytes()))
    };
    read().ok_or_else(|| "its result is not whole".to_owned())
}
