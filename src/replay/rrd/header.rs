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
    program: String,
    bits: u32,
    from_step: u64,
    legs: Vec<Leg>,
}

/// Reads messages until scene and radii are known.
pub(super) fn read(path: &str, stream: &mut Stream) -> Result<(StoreId, Header), ReadError> {
    let missing = |missing| ReadError::NotSoftjam {
        path: path.to_owned(),
        missing,
    };
    let mut about = None;
    loop {
        let message = stream.next();
        let message =
            message.map_err(|problem| problem.at_start(path, |damage| not_rrd(path, damage)))?;
        let Some(message) = message else {
            return Err(missing(if about.is_some() { "radii" } else { "scene" }));
        };
        let Message::Chunk(store, chunk) = message else {
            continue;
        };
        let damaged = |problem| not_rrd(path, problem);
        match chunk.entity_path().to_string().as_str() {
            "/scene" => {
                let read = guarded(|| Ok(read_about(path, &chunk)));
                about = read.map_err(damaged)??.or(about);
            }
            "/particles" => {
                let About {
                    scene,
                    id,
                    program,
                    bits,
                    from_step,
                    legs,
                } = about.ok_or(missing("scene"))?;
                if store.recording_id().as_str() != id {
                    return Err(ReadError::Changed {
                        path: path.to_owned(),
                        found: store.recording_id().as_str().to_owned(),
                        expected: id,
                    });
                }
                let read = guarded(|| Ok(read_particles(&chunk)));
                let (radii, domain) = read.map_err(damaged)?.map_err(missing)?;
                let header = Header {
                    scene,
                    radii,
                    domain,
                    program,
                    bits,
                    from_step,
                    legs,
                };
                return Ok((store, header));
            }
            entity
                if entity == "/state" || entity == "/result" || entity.starts_with("/metrics/") =>
            {
                return Err(damaged(format!(
                    "rows of {} stand in front of its scene and radii",
                    shown(entity)
                )));
            }
            _ => {}
        }
    }
}

fn read_about(path: &str, chunk: &Chunk) -> Result<Option<About>, ReadError> {
    let text = |name: &'static str| {
        let mut texts = chunk.iter_slices::<String>(name.into());
        texts
            .next()
            .and_then(|list| list.first().map(ToString::to_string))
    };
    let mut versions = chunk.iter_slices::<u32>("softjam.Scene:format_version".into());
    if let Some(&[found]) = versions.next() {
        check_version(path, found)?;
    }
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
