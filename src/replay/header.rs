//! What a recording says of itself before its first frame.

use super::ReadError;
use super::stream::{Message, Stream, guarded};
use crate::domain::Domain;
use crate::record::{FORMAT_VERSION, recording_id};
use crate::scene::Scene;
use rerun::external::re_log_types::StoreId;
use rerun::log::Chunk;

/// Scene, radii and box.
pub(super) struct Header {
    pub store: StoreId,
    pub scene: Scene,
    pub radii: Vec<f64>,
    pub domain: Domain,
    pub program: String,
    /// The step that the recording begins with; not 0 if its run went on from another recording.
    pub from_step: u64,
}

/// What `/scene` holds.
struct About {
    scene: Scene,
    program: String,
    from_step: u64,
}

impl Header {
    /// Reads messages until scene and radii are known.
    pub fn read(path: &str, stream: &mut Stream) -> Result<Self, ReadError> {
        let missing = |missing| ReadError::NotSoftjam {
            path: path.to_owned(),
            missing,
        };
        let mut about = None;
        loop {
            let message = stream.next().map_err(|problem| ReadError::NotRrd {
                path: path.to_owned(),
                problem,
            })?;
            let Some(message) = message else {
                return Err(missing(if about.is_some() { "radii" } else { "scene" }));
            };
            let Message::Chunk(store, chunk) = message else {
                continue;
            };
            let damaged = |problem| ReadError::NotRrd {
                path: path.to_owned(),
                problem,
            };
            match chunk.entity_path().to_string().as_str() {
                "/scene" => {
                    let read = guarded(|| Ok(read_about(path, &chunk)));
                    about = read.map_err(damaged)??.or(about);
                }
                "/particles" => {
                    let About {
                        scene,
                        program,
                        from_step,
                    } = about.ok_or(missing("scene"))?;
                    let id = recording_id(&scene);
                    if store.recording_id().as_str() != id {
                        return Err(ReadError::Changed {
                            path: path.to_owned(),
                            found: store.recording_id().as_str().to_owned(),
                            expected: id,
                        });
                    }
                    let read = guarded(|| Ok(particles(&chunk)));
                    let (radii, domain) = read.map_err(damaged)?.map_err(missing)?;
                    return Ok(Self {
                        store,
                        scene,
                        radii,
                        domain,
                        program,
                        from_step,
                    });
                }
                _ => {}
            }
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
    if let Some(&[found]) = versions.next()
        && found > FORMAT_VERSION
    {
        return Err(ReadError::Newer {
            path: path.to_owned(),
            found,
            known: FORMAT_VERSION,
        });
    }
    let Some(toml) = text("softjam.Scene:toml") else {
        return Ok(None);
    };
    let scene = Scene::from_toml(&toml).map_err(|source| ReadError::Scene {
        path: path.to_owned(),
        source,
    })?;
    let mut from_steps = chunk.iter_slices::<u64>("softjam.Scene:from_step".into());
    Ok(Some(About {
        scene,
        program: text("softjam.Scene:program").unwrap_or_default(),
        from_step: from_steps
            .next()
            .and_then(|l| l.first().copied())
            .unwrap_or(0),
    }))
}

/// Radii and box, or what is missing of them.
fn particles(chunk: &Chunk) -> Result<(Vec<f64>, Domain), &'static str> {
    let list = |name: &'static str| {
        let mut lists = chunk.iter_slices::<f64>(name.into());
        lists.next().map(<[f64]>::to_vec)
    };
    let radii = list("softjam.Particles:radius").ok_or("radii")?;
    if radii.is_empty() || radii.iter().any(|r| !(r.is_finite() && *r > 0.0)) {
        return Err("radii that are positive and finite");
    }
    let sides = list("softjam.Particles:box").ok_or("box")?;
    let domain = match sides.as_slice() {
        &[x, y] => Domain::new(x, y),
        _ => None,
    };
    Ok((radii, domain.ok_or("box of two positive sides")?))
}
