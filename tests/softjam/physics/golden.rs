//! The golden scenes end in the golden bits: in every build, on every machine, with or without recordings.

use softjam::protocol::Relaxation;
use softjam::scene::Scene;

#[test]
fn golden_scenes_give_the_golden_digests() {
    let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("recordings");
    let digests = std::fs::read_to_string(folder.join("digests.txt")).expect("digests.txt");
    let mut scenes = 0;
    for line in digests.lines() {
        let words: Vec<&str> = line.split(' ').collect();
        let [name, step, digest] = words[..] else {
            panic!("{line}");
        };
        let text = std::fs::read_to_string(folder.join(name).with_extension("toml")).expect(name);
        let scene = Scene::from_toml(&text).expect(name);
        let run = Relaxation::new(&scene).expect(name);
        let last = run.last().expect("a frame").expect("no failure");
        assert_eq!(last.step.to_string(), step, "{name}");
        let found = blake3::Hash::from_bytes(last.digest()).to_hex();
        assert_eq!(found.as_str(), digest, "{name}");
        scenes += 1;
    }
    assert_eq!(scenes, 9);
}
