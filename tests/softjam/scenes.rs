//! Scenes that make no sense: each is refused with a message that names the field and its value, and none panics.

use softjam::relax::Relaxation;
use softjam::scene::start::read_csv;
use softjam::scene::{Radii, Scene, SceneError, Species, Start};
use std::path::Path;

/// Asserts that a scene text is refused and that the message holds all of `words`.
#[track_caller]
fn assert_refused(text: &str, words: &[&str]) {
    let message = match Scene::from_toml(text) {
        Ok(_) => panic!("`{text}` passed"),
        Err(error) => error.to_string(),
    };
    for word in words {
        assert!(
            message.contains(word),
            "`{text}`: no `{word}` in: {message}"
        );
    }
}

#[test]
fn numbers_out_of_range_are_named_with_their_value() {
    for (field, values) in [
        ("particles", &["0", "-5", "10000001"][..]),
        (
            "phi",
            &["0.0", "-0.1", "1.3", "1.7", "nan", "inf", "-inf", "5e-324"],
        ),
        ("aspect", &["0.0", "-1.0", "0.09", "10.1", "nan", "inf"]),
        ("line_tension", &["0.0", "-1.0", "nan", "inf"]),
        ("threshold", &["0.0", "-1e-10", "nan", "inf"]),
        ("steps", &["-1"]),
        ("dt_max", &["0.0", "-0.1", "nan", "inf"]),
        (
            "contact_tolerance",
            &["0.0", "1e-15", "1e-5", "-1e-12", "nan", "inf"],
        ),
        ("fire.increase", &["1.0", "0.5", "11.0", "nan", "inf"]),
        ("fire.decrease", &["0.0", "1.0", "-0.5", "nan"]),
        ("fire.mixing", &["0.0", "1.5", "-0.1", "nan"]),
        ("fire.mixing_decay", &["0.0", "1.1", "nan"]),
        ("fire.first_dt", &["0.0", "1.5", "-0.1", "nan"]),
        ("fire.least_dt", &["0.0", "0.2", "-0.1", "nan"]),
        ("disks.threshold", &["0.0", "-1.0", "nan", "inf"]),
        ("contours.vertices", &["0", "2", "5000"]),
    ] {
        for value in values {
            let number: f64 = value.parse().unwrap();
            let shown = number.to_string(); // as Rust prints it: NaN, inf, 0.00001
            let start = if field == "phi" && *value == "5e-324" {
                // Too small for a box of finite size, which shows when the box is made.
                let scene = Scene {
                    phi: number,
                    ..Scene::default()
                };
                let message = Relaxation::new(&scene).unwrap_err().to_string();
                assert!(
                    message.starts_with(&format!("phi = {shown} is outside")),
                    "{message}"
                );
                continue;
            } else {
                format!("{field} = {shown} is outside ")
            };
            assert_refused(&format!("{field} = {value}"), &[&start]);
        }
    }
}

#[test]
fn radii_that_make_no_mixture_are_named() {
    for (text, words) in [
        ("species = []", &["species = []"][..]),
        (
            "species = [{ radius = 0.0, fraction = 1.0 }]",
            &["species[0].radius = 0 "],
        ),
        (
            "species = [{ radius = -0.5, fraction = 1.0 }]",
            &["species[0].radius = -0.5"],
        ),
        (
            "species = [{ radius = nan, fraction = 1.0 }]",
            &["species[0].radius = NaN"],
        ),
        (
            "species = [{ radius = inf, fraction = 1.0 }]",
            &["species[0].radius = inf"],
        ),
        (
            "species = [{ radius = 1e7, fraction = 1.0 }]",
            &["species[0].radius = 10000000"],
        ),
        (
            "species = [{ radius = 0.5, fraction = 0.5 }, { radius = 0.7, fraction = 0.0 }]",
            &["species[1].fraction = 0 "],
        ),
        (
            "species = [{ radius = 0.5, fraction = -1.0 }]",
            &["species[0].fraction = -1"],
        ),
        (
            "species = [{ radius = 0.5, fraction = 1.5 }]",
            &["species[0].fraction = 1.5"],
        ),
        (
            "species = [{ radius = 0.5, fraction = nan }]",
            &["species[0].fraction = NaN"],
        ),
        (
            "species = [{ radius = 0.5, fraction = 0.75 }]",
            &["sum of the fractions = 0.75"],
        ),
        (
            "species = [{ radius = 0.5, fraction = 0.75 }, { radius = 0.7, fraction = 0.5 }]",
            &["sum of the fractions = 1.25"],
        ),
        ("species = [{ radius = 0.5 }]", &["species", "fraction"]),
        (
            "species = [{ radius = 0.5, fraction = 1.0, mass = 2.0 }]",
            &["mass"],
        ),
        ("species = 0.5", &["species = 0.5"]),
        ("spread = { min = 0.0, max = 0.5 }", &["spread.min = 0 "]),
        ("spread = { min = nan, max = 0.5 }", &["spread.min = NaN"]),
        ("spread = { min = 0.4, max = inf }", &["spread.max = inf"]),
        (
            "spread = { min = 0.6, max = 0.5 }",
            &["spread.min = 0.6", "min ≤ max"],
        ),
        ("spread = { min = 0.4 }", &["spread", "max"]),
        (
            "spread = { min = 0.4, max = 0.5 }\nspecies = [{ radius = 0.5, fraction = 1.0 }]",
            &["spread", "species", "cannot be given together"],
        ),
    ] {
        assert_refused(text, words);
    }
}

#[test]
fn fields_and_values_of_the_wrong_kind_are_shown() {
    for (text, words) in [
        ("coverage = 0.9", &["coverage", "unknown field"][..]),
        ("fire.speed = 1.0", &["speed", "unknown field"]),
        ("disks.phi = 1.0", &["phi", "unknown field"]),
        ("channels.video = \"off\"", &["video", "unknown field"]),
        ("contours.colour = \"red\"", &["colour", "unknown field"]),
        ("phi = \"high\"", &["phi = \"high\""]),
        ("phi = true", &["phi = true"]),
        ("particles = 1.5", &["particles = 1.5"]),
        ("particles = \"many\"", &["particles = \"many\""]),
        (
            "particles = 99999999999999999999",
            &["particles = 99999999999999999999"],
        ),
        ("seed = -1", &["seed = -1"]),
        ("seed = 0.5", &["seed = 0.5"]),
        ("steps = 1e6", &["steps = 1e6"]),
        ("fire.delay = -1", &["fire.delay = -1"]),
        ("fire.delay = 4294967296", &["fire.delay = 4294967296"]),
        ("fire = 3", &["fire = 3"]),
        ("disks.steps = -1", &["disks.steps = -1"]),
        ("contours.vertices = -3", &["contours.vertices = -3"]),
        ("contours.placement = \"corners\"", &["corners"]),
        ("minimizer = \"newton\"", &["minimizer = \"newton\""]),
        ("contact_rule = \"guess\"", &["contact_rule = \"guess\""]),
        ("contact_solver = \"lu\"", &["contact_solver = \"lu\""]),
        ("start = \"square\"", &["start = \"square\"", "hexagonal"]),
        ("start = 1", &["start = 1"]),
        ("phi =", &["phi ="]),
        ("phi = 0.9\nphi = 0.8", &["phi = 0.8", "duplicate key"]),
        ("[[[", &["[[["]),
    ] {
        assert_refused(text, words);
    }
}

#[test]
fn schedules_that_are_none_are_quoted() {
    for channel in ["contours", "contacts", "metrics", "state"] {
        for schedule in [
            "every 0",
            "every",
            "every -1",
            "every 1.5",
            "every 1 2",
            "log 0",
            "log 1001",
            "log",
            "often",
            "",
            "off 1",
            "Every 3",
        ] {
            let text = format!("channels.{channel} = \"{schedule}\"");
            assert_refused(&text, &[&text, &format!("`{schedule}` is not a schedule")]);
        }
        assert_refused(
            &format!("channels.{channel} = 5"),
            &[&format!("channels.{channel} = 5")],
        );
    }
}

#[test]
fn start_that_contradicts_other_fields_is_refused() {
    for (text, words) in [
        (
            "start = \"file\"",
            &["start = \"file\"", "file = \"PACKING.csv\""][..],
        ),
        (
            "start = \"random\"\nfile = \"a.csv\"",
            &["file = \"a.csv\"", "start = \"random\""],
        ),
        (
            "start = \"hexagonal\"\nfile = \"a.csv\"",
            &["file = \"a.csv\"", "start = \"hexagonal\""],
        ),
        (
            "file = \"a.csv\"\nparticles = 64",
            &["particles = 64", "start = \"file\""],
        ),
        (
            "file = \"a.csv\"\nphi = 0.9",
            &["phi = 0.9", "start = \"file\""],
        ),
        (
            "file = \"a.csv\"\naspect = 2.0",
            &["aspect = 2", "start = \"file\""],
        ),
        (
            "file = \"a.csv\"\nseed = 7",
            &["seed = 7", "start = \"file\""],
        ),
        (
            "file = \"a.csv\"\nspecies = [{ radius = 0.5, fraction = 1.0 }]",
            &["species", "start = \"file\""],
        ),
        (
            "file = \"a.csv\"\nspread = { min = 0.4, max = 0.5 }",
            &["spread", "start = \"file\""],
        ),
        (
            "start = \"hexagonal\"\nparticles = 65",
            &["particles = 65", "hexagonal"],
        ),
    ] {
        assert_refused(text, words);
    }
}

#[test]
fn hash_of_a_start_file_without_a_start_file_is_refused() {
    assert_refused("file_blake3 = \"00\"", &["file_blake3"]);
    assert_refused(
        "start = \"hexagonal\"\nfile_blake3 = \"00\"",
        &["file_blake3"],
    );
}

#[test]
fn box_too_small_for_the_minimum_image_is_refused_with_its_sides() {
    let refuse = |scene: Scene, words: &[&str]| {
        let message = Relaxation::new(&scene).unwrap_err().to_string();
        for word in words {
            assert!(message.contains(word), "no `{word}` in: {message}");
        }
    };
    let few = |particles, phi, aspect| Scene {
        particles,
        phi,
        aspect,
        ..Scene::default()
    };
    refuse(
        few(1, 0.86, 1.0),
        &["particles = 1 ", "phi = 0.86", "shorter side"],
    );
    refuse(
        few(4, 1.2, 1.0),
        &["particles = 4 ", "phi = 1.2", "largest radius 0.7"],
    );
    refuse(few(30, 0.86, 10.0), &["particles = 30 ", "aspect = 10"]);
    refuse(few(30, 0.86, 0.1), &["particles = 30 ", "aspect = 0.1"]);
    let one_giant = Scene {
        radii: Radii::Species(vec![
            Species {
                radius: 0.5,
                fraction: 0.99,
            },
            Species {
                radius: 50.0,
                fraction: 0.01,
            },
        ]),
        ..few(100, 0.86, 1.0)
    };
    refuse(one_giant, &["largest radius 50"]);
}

#[test]
fn values_that_never_were_a_text_are_validated_too() {
    let default = Scene::default;
    for (scene, start) in [
        (
            Scene {
                particles: 0,
                ..default()
            },
            "particles = 0 ",
        ),
        (
            Scene {
                particles: usize::MAX,
                ..default()
            },
            "particles = ",
        ),
        (
            Scene {
                phi: f64::NAN,
                ..default()
            },
            "phi = NaN ",
        ),
        (
            Scene {
                aspect: f64::INFINITY,
                ..default()
            },
            "aspect = inf ",
        ),
        (
            Scene {
                line_tension: -1.0,
                ..default()
            },
            "line_tension = -1 ",
        ),
        (
            Scene {
                threshold: f64::NAN,
                ..default()
            },
            "threshold = NaN ",
        ),
        (
            Scene {
                dt_max: Some(0.0),
                ..default()
            },
            "dt_max = 0 ",
        ),
        (
            Scene {
                contact_tolerance: 1.0,
                ..default()
            },
            "contact_tolerance = 1 ",
        ),
        (
            Scene {
                radii: Radii::Species(Vec::new()),
                ..default()
            },
            "species = [] ",
        ),
        (
            Scene {
                radii: Radii::Spread { min: 2.0, max: 1.0 },
                ..default()
            },
            "spread.min = 2 ",
        ),
    ] {
        let message = Relaxation::new(&scene).unwrap_err().to_string();
        assert!(message.starts_with(start), "{message}");
    }
}

#[test]
fn start_file_that_is_missing_is_named() {
    let scene = Scene::from_toml("file = \"no/such/packing.csv\"").unwrap();
    let error = Relaxation::new(&scene).unwrap_err().to_string();
    assert!(
        error.starts_with("cannot read no/such/packing.csv: "),
        "{error}"
    );
}

/// What `read_csv`, and a scene that starts from the file, say of these bytes.
fn complaint(folder: &Path, bytes: &[u8]) -> String {
    let path = folder.join("start.csv");
    std::fs::write(&path, bytes).unwrap();
    let start = Start::File {
        path: path.to_str().unwrap().into(),
        blake3: None,
    };
    let scene = Scene {
        start,
        ..Scene::default()
    };
    match Relaxation::new(&scene) {
        Ok(run) => panic!(
            "{} particles from {:?}",
            run.packing().len(),
            String::from_utf8_lossy(bytes)
        ),
        Err(error) => error.to_string(),
    }
}

#[test]
fn broken_start_files_are_refused_with_what_is_wrong() {
    const TWO: &str = "x,y,radius\n1,1,0.5\n3,1,0.5\n";
    let folder = tempfile::tempdir().unwrap();
    let boxed = |rows: &str| format!("# box = 6, 6\nx,y,radius\n{rows}");
    for (text, words) in [
        (String::new(), &["box"][..]),
        (TWO.into(), &["# box = L_x, L_y"]),
        (format!("# box = 6\n{TWO}"), &["line 1", "# box = 6"]),
        (
            format!("# box = -6, 6\n{TWO}"),
            &["line 1", "# box = -6, 6"],
        ),
        (format!("# box = 0, 6\n{TWO}"), &["line 1", "# box = 0, 6"]),
        (
            format!("# box = nan, 6\n{TWO}"),
            &["line 1", "# box = nan, 6"],
        ),
        (
            format!("# box = inf, 6\n{TWO}"),
            &["line 1", "# box = inf, 6"],
        ),
        (
            format!("# box = wide, high\n{TWO}"),
            &["line 1", "wide, high"],
        ),
        (format!("# box = 6, 6, 6\n{TWO}"), &["line 1", "6, 6, 6"]),
        (
            format!("# a packing\n# box = 6; 6\n{TWO}"),
            &["line 2", "6; 6"],
        ),
        ("# box = 6, 6\n".into(), &["x,y,radius"]),
        (
            "# box = 6, 6\nx,y,r\n1,1,0.5\n".into(),
            &["`x,y,r`", "x,y,radius"],
        ),
        ("# box = 6, 6\n1,1,0.5\n".into(), &["`1,1,0.5`"]),
        (boxed(""), &["0 particles"]),
        (boxed("1,1,0.5\n2,one,0.5\n"), &["line 4", "x,y,radius"]),
        (boxed("1,1,0.5\n2,,0.5\n"), &["line 4"]),
        (boxed("1,1,0.5\n2,1\n"), &["line 4"]),
        (boxed("1,1,0.5\n2,1,0.5,7\n"), &["line 4"]),
        (boxed("1,1,-0.5\n"), &["radius -0.5 of particle 0"]),
        (boxed("1,1,0.5\n3,1,0\n"), &["radius 0 of particle 1"]),
        (boxed("1,1,nan\n"), &["radius NaN of particle 0"]),
        (boxed("1,1,inf\n"), &["radius inf of particle 0"]),
        (
            boxed("1,1,0.5\n3,nan,0.5\n"),
            &["position (3, NaN) of particle 1"],
        ),
        (boxed("inf,1,0.5\n"), &["position (inf, 1) of particle 0"]),
        (boxed("1,1,4\n"), &["phi = 1.39", "0 < phi < 1.3"]),
        (
            boxed("1,1,1.5\n"),
            &["largest radius 1.5", "6.0000 × 6.0000"],
        ),
    ] {
        let message = complaint(folder.path(), text.as_bytes());
        for word in words {
            assert!(
                message.contains(word),
                "{text:?}: no `{word}` in: {message}"
            );
        }
    }
    let message = complaint(folder.path(), b"# box = 6, 6\nx,y,radius\n1,1,\xff\n");
    assert!(message.contains("UTF-8"), "{message}");
}

#[test]
fn box_comment_with_a_word_among_its_numbers_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    for sides in ["6, wide, 6", "6, 6, deep", "Lx, 6, 6"] {
        let text = format!("# box = {sides}\nx,y,radius\n1,1,0.5\n");
        let message = complaint(folder.path(), text.as_bytes());
        assert!(message.contains(sides), "{message}");
    }
}

#[test]
fn start_file_with_another_hash_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("start.csv");
    std::fs::write(&path, "# box = 6, 6\nx,y,radius\n1,1,0.5\n").unwrap();
    let path = path.to_str().unwrap();
    let error = read_csv(path, Some("00ff")).unwrap_err();
    assert!(matches!(error, SceneError::StartFile { .. }));
    assert!(
        error.to_string().contains("00ff") && error.to_string().contains(path),
        "{error}"
    );
}

#[test]
fn every_scene_survives_the_way_through_its_text() {
    for scene in [
        Scene {
            seed: u64::MAX,
            ..Scene::default()
        },
        Scene {
            seed: i64::MAX as u64 + 1,
            ..Scene::default()
        },
        Scene {
            phi: 0.1 + 0.2,
            aspect: 1.0 / 3.0,
            dt_max: Some(1e-300),
            ..Scene::default()
        },
        Scene {
            steps: u64::MAX,
            ..Scene::default()
        },
        Scene {
            radii: Radii::Spread { min: 0.1, max: 1e6 },
            start: Start::Hexagonal,
            ..Scene::default()
        },
        Scene {
            start: Start::File {
                path: "a \"quoted\"\\path\nof 'two' lines.csv".into(),
                blake3: Some("00".repeat(32)),
            },
            ..Scene::default()
        },
    ] {
        let text = scene.to_toml();
        match Scene::from_toml(&text) {
            Ok(back) => assert_eq!(back, scene),
            Err(error) => panic!("seed {}, steps {}: {error}", scene.seed, scene.steps),
        }
    }
}
