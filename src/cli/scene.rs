//! `softjam scene`: prints a scene file.

use super::{Verdict, flags::SceneFlags, out_of_range, print};

#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  softjam scene > scene.toml              the default scene, every field with its meaning
  softjam scene --phi 0.9 -N 1024         the same with two fields changed
  softjam scene mine.toml                 checks a file and fills in what it leaves out

Exit codes: 0 a scene that can be run, 1 the file cannot be read, 2 a bad flag or an invalid scene")]
pub struct Arguments {
    #[command(flatten)]
    scene: SceneFlags,
}

pub fn run(arguments: &Arguments) -> anyhow::Result<Verdict> {
    if let Some(path) = arguments.scene.file_unlike_text() {
        let allowed = "a name in UTF-8, since a scene file is text; rename the file".to_owned();
        return Err(out_of_range("file", path.display(), allowed));
    }
    print(&arguments.scene.scene()?.to_toml())?;
    Ok(Verdict::Good)
}
