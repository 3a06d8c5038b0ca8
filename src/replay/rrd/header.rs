//! What a recording says of itself before its first frame.

use super::not_rrd;
use super::stream::{Message, Stream};
use crate::domain::Domain;
use crate::record::{Leg, id_of, legs_from_text};
use crate::replay::ReadError;
use crate::replay::source::{Header, check_version, guarded, particles, read_scene};
use crate::scene::Scene;
use crate::text::shown;
use rerun::external::re_log_types::StoreId;
use rerun::log::Chunk;

/// What `/scene` holds.
struct About {
    scene: Scene,
    /// The recording's id, as its scene makes it.
    id: String,
    format: u32,
    program: String,
    bits: u32,
    from_step: u64,
    legs: Vec<Leg>,
}

/// Reads messages until scene and radii are known: the store, the id that the scene makes, and the header.
pub(super) fn read(
    path: &str,
    stream: &mut Stream,
) -> Result<(StoreId, String, Header), ReadError> {
    let damaged = |problem| not_rrd(path, problem);
    let (mut about, mut radii): (Option<About>, Option<(Vec<f64>, Domain)>) = (None, None);
    // Rows in front of scene and radii: the first entity that has some, and their first step.
    let mut early: Option<(String, u64)> = None;
    loop {
        let message = stream.next();
        let message = message.map_err(|problem| problem.at_start(path, damaged))?;
        let Some(message) = message else {
            let missing = if about.is_some() { "radii" } else { "scene" };
            let path = path.to_owned();
            return Err(ReadError::NotSoftjam { path, missing });
        };
        let Message::Chunk(store, chunk) = message else {
            continue;
        };
        let name = store.recording_id().as_str();
        let piece = || ReadError::Piece {
            path: path.to_owned(),
        };
        if is_piece(name) {
            return Err(piece());
        }
        match chunk.entity_path().to_string().as_str() {
            "/scene" => {
                let read = guarded(|| Ok(read_about(path, &chunk)));
                about = read.map_err(damaged)??.or(about);
            }
            "/particles" => {
                let read = guarded(|| Ok(read_particles(&chunk)));
                radii = Some(read.map_err(damaged)?.map_err(|missing| {
                    // Cut apart, scene and radii come behind and component by component.
                    if early.is_some() && !is_id(name) {
                        return piece();
                    }
                    let path = path.to_owned();
                    ReadError::NotSoftjam { path, missing }
                })?);
            }
            entity
                if entity == "/state" || entity == "/result" || entity.starts_with("/metrics/") =>
            {
                let step = super::steps(&chunk).min().unwrap_or(u64::MAX);
                let (_, first) = early.get_or_insert_with(|| (shown(entity), step));
                *first = step.min(*first);
            }
            _ => {}
        }
        let Some(((radii, domain), about)) = radii.clone().zip(about.take_if(|_| radii.is_some()))
        else {
            continue;
        };
        match early {
            // Of two headers the later is left.
            Some((_, first)) if first < about.from_step => {
                let path = path.to_owned();
                return Err(ReadError::Parts { path, intact: None });
            }
            Some((entity, _)) => {
                let problem = format!("rows of {entity} stand in front of its scene and radii");
                return Err(damaged(problem));
            }
            // Another program may give it any other name, but not that of another scene.
            None if name != about.id && is_id(name) => {
                return Err(ReadError::Changed {
                    path: path.to_owned(),
                    found: name.to_owned(),
                    expected: about.id,
                });
            }
            None => {}
        }
        let header = Header {
            scene: about.scene,
            radii,
            domain,
            format: about.format,
            program: about.program,
            bits: about.bits,
            from_step: about.from_step,
            legs: about.legs,
        };
        return Ok((store, about.id, header));
    }
}

/// Whether it looks like an id that a scene makes.
fn is_id(name: &str) -> bool {
    let hexadecimal = |b: u8| b.is_ascii_digit() || (b'a'..=b'f').contains(&b);
    name.len() == 32 && name.bytes().all(hexadecimal)
}

/// Whether it looks like the name of a piece of a recording with such an id.
fn is_piece(name: &str) -> bool {
    let parts = name.split_once('-');
    parts.is_some_and(|(id, number)| is_id(id) && number.bytes().all(|b| b.is_ascii_digit()))
}

/// The id that the scene in a chunk makes, if there is one.
pub(super) fn scene_id(chunk: &Chunk) -> Option<String> {
    let is_scene = chunk.entity_path().to_string() == "/scene"
        && chunk
            .components()
            .contains_component("softjam.Scene:toml".into());
    let read = || guarded(|| Ok(read_about("", chunk)));
    // One that cannot be read is some other scene.
    is_scene.then(|| match read() {
        Ok(Ok(Some(about))) => about.id,
        _ => String::new(),
    })
}

fn read_about(path: &str, chunk: &Chunk) -> Result<Option<About>, ReadError> {
    let text = |name: &'static str| {
        let mut texts = chunk.iter_slices::<String>(name.into());
        texts
            .next()
            .and_then(|list| list.first().map(ToString::to_string))
    };
    let mut versions = chunk.iter_slices::<u32>("softjam.Scene:format_version".into());
    let format = versions.next().and_then(|list| list.first().copied());
    let format = format.unwrap_or(1);
    check_version(path, format)?;
    let Some(toml) = text("softjam.Scene:toml") else {
        return Ok(None);
    };
    let (scene, digest) = read_scene(path, &toml)?;
    let mut from_steps = chunk.iter_slices::<u64>("softjam.Scene:from_step".into());
    let from_step = from_steps.next().and_then(|l| l.first().copied());
    let from_step = from_step.unwrap_or(0);
    let legs = text("softjam.Scene:legs");
    let mut bits = chunk.iter_slices::<u32>("softjam.Scene:bits".into());
    Ok(Some(About {
        scene,
        id: id_of(digest, legs.as_deref()),
        format,
        program: shown(&text("softjam.Scene:program").unwrap_or_default()),
        bits: bits.next().and_then(|l| l.first().copied()).unwrap_or(1),
        from_step,
        legs: legs
            .map_or(Ok(Vec::new()), |legs| legs_from_text(&legs, from_step))
            .map_err(|problem| not_rrd(path, problem))?,
    }))
}

fn read_particles(chunk: &Chunk) -> Result<(Vec<f64>, Domain), &'static str> {
    let list = |name: &'static str| {
        let mut lists = chunk.iter_slices::<f64>(name.into());
        lists.next().map(<[f64]>::to_vec)
    };
    let radii = list("softjam.Particles:radius").ok_or("radii")?;
    particles(radii, list("softjam.Particles:box"))
}
