//! Whatever a scene file holds, it is a scene that survives its own text, or it is refused.
#![no_main]

use libfuzzer_sys::fuzz_target;
use softjam::scene::Scene;

fuzz_target!(|text: &str| {
    if let Ok(scene) = Scene::from_toml(text) {
        assert_eq!(Scene::from_toml(&scene.to_toml()).expect("its own text"), scene);
    }
});
