//! Scenes that make no sense: each is refused with a message that names the field and its value, and none panics.

mod start_file;

use softjam::protocol::Relaxation;
use softjam::scene::DiskParameters;
use softjam::scene::{Preparation, Radii, Scene, Schedule, Species, Start};

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

/// A table with a scene a line: its text, ` / ` for the end of a line, then `=>`, then what the message must hold, ` & `
/// between the parts.
#[track_caller]
fn assert_all_refused(table: &str) {
    let mut rows = 0;
    for row in table.lines().filter(|row| !row.trim().is_empty()) {
        let (text, words) = row.split_once("=>").expect("a row has two columns");
        let words: Vec<&str> = words.split(" & ").map(str::trim).collect();
        assert_refused(&text.trim().replace(" / ", "\n"), &words);
        rows += 1;
    }
    assert!(rows > 0);
}

#[test]
fn numbers_out_of_range_are_named_with_their_value() {
    for (field, values) in [
        ("particles", "0 -5 10000001"),
        ("phi", "0.0 -0.1 1.3 1.7 nan inf -inf"),
        ("aspect", "0.0 -1.0 0.09 10.1 nan inf"),
        ("line_tension", "0.0 -1.0 9.9e-101 1.1e100 nan inf"),
        ("threshold", "0.0 -1e-10 nan inf"),
        ("steps", "-1"),
        ("dt_max", "0.0 -0.1 nan inf"),
        ("contact_tolerance", "0.0 1e-15 1e-5 -1e-12 nan inf"),
        ("fire.increase", "1.0 0.5 11.0 nan inf"),
        ("fire.decrease", "0.0 1.0 -0.5 nan"),
        ("fire.mixing", "0.0 1.5 -0.1 nan"),
        ("fire.mixing_decay", "0.0 1.1 nan"),
        ("fire.first_dt", "0.0 1.5 -0.1 nan"),
        ("fire.least_dt", "0.0 0.2 -0.1 nan"),
        ("disks.threshold", "0.0 -1.0 nan inf"),
        ("contours.vertices", "0 2 5000"),
    ] {
        for value in values.split(' ') {
            let number: f64 = value.parse().unwrap();
            // The message shows the number as Rust prints it: NaN, inf, 0.00001.
            let start = format!("{field} = {number} is outside ");
            assert_refused(&format!("{field} = {value}"), &[&start]);
        }
    }
}

#[test]
fn radii_that_make_no_mixture_are_named() {
    assert_all_refused(
        "
        species = []                                              => species = []
        species = [{ radius = 0.0, fraction = 1.0 }]              => species[0].radius = 0 is
        species = [{ radius = -0.5, fraction = 1.0 }]             => species[0].radius = -0.5 is
        species = [{ radius = nan, fraction = 1.0 }]              => species[0].radius = NaN is
        species = [{ radius = inf, fraction = 1.0 }]              => species[0].radius = inf is
        species = [{ radius = 1e7, fraction = 1.0 }]              => species[0].radius = 10000000 is
        species = [{ radius = 0.5, fraction = -1.0 }]             => species[0].fraction = -1 is
        species = [{ radius = 0.5, fraction = 1.5 }]              => species[0].fraction = 1.5 is
        species = [{ radius = 0.5, fraction = nan }]              => species[0].fraction = NaN is
        species = [{ radius = 0.5, fraction = 0.5 }, { radius = 0.7, fraction = 0.0 }]  => species[1].fraction = 0 is
        species = [{ radius = 0.5, fraction = 0.75 }, { radius = 0.7, fraction = 0.5 }] => sum of the fractions = 1.25
        species = [{ radius = 0.5, fraction = 0.75 }]             => sum of the fractions = 0.75
        species = [{ radius = 0.5 }]                              => species & missing field `fraction`
        species = [{ radius = 0.5, fraction = 1.0, mass = 2.0 }]  => mass = 2.0 & unknown field `mass`
        species = 0.5                                             => species = 0.5
        spread = { min = 0.0, max = 0.5 }                         => spread.min = 0 is
        spread = { min = nan, max = 0.5 }                         => spread.min = NaN is
        spread = { min = 0.4, max = inf }                         => spread.max = inf is
        spread = { min = 0.6, max = 0.5 }                         => spread.min = 0.6 is & min ≤ max
        spread = { min = 0.4 }                                    => spread & missing field `max`
        spread = { min = 0.4, max = 0.5 } / species = [{ radius = 0.5, fraction = 1.0 }] => spread & together with species
        ",
    );
}

#[test]
fn fields_and_values_of_the_wrong_kind_are_shown() {
    assert_all_refused(
        r#"
        coverage = 0.9                      => coverage = 0.9 & unknown field `coverage`
        fire.speed = 1.0                    => fire.speed = 1.0 & unknown field `speed`
        disks.phi = 1.0                     => disks.phi = 1.0 & unknown field `phi`
        channels.video = "off"              => channels.video = "off" & unknown field `video`
        contours.colour = "red"             => contours.colour = "red" & unknown field `colour`
        phi = "high"                        => phi = "high"
        phi = true                          => phi = true
        particles = 1.5                     => particles = 1.5
        particles = "many"                  => particles = "many"
        particles = 99999999999999999999    => particles = 99999999999999999999
        seed = -1                           => seed = -1
        seed = 0.5                          => seed = 0.5
        steps = 1e6                         => steps = 1e6
        fire.delay = -1                     => fire.delay = -1
        fire.delay = 4294967296             => fire.delay = 4294967296
        fire = 3                            => fire = 3
        disks.steps = -1                    => disks.steps = -1
        contours.vertices = -3              => contours.vertices = -3
        contours.placement = "corners"      => contours.placement = "corners"
        minimizer = "newton"                => minimizer = "newton" & fire+newton
        forces = "radial"                   => forces = "radial" & gradient
        contact_rule = "guess"              => contact_rule = "guess"
        contact_solver = "lu"               => contact_solver = "lu"
        start = "square"                    => start = "square" & hexagonal
        start = 1                           => start = 1
        phi =                               => phi =
        phi = 0.9 / phi = 0.8               => phi = 0.8 & duplicate key
        [[[                                 => [[[
        "#,
    );
}

#[test]
fn schedules_that_are_none_are_quoted() {
    const WRONG: &str =
        "|every|every 0|every -1|every 1.5|every 1 2|log|log 0|log 1001|often|off 1|Every 3";
    for channel in ["contours", "contacts", "metrics", "state"] {
        for schedule in WRONG.split('|') {
            let text = format!("channels.{channel} = \"{schedule}\"");
            let reason = format!("`{schedule}` is not a schedule");
            assert_refused(&text, &[&text, &reason]);
        }
        let text = format!("channels.{channel} = 5");
        assert_refused(&text, &[&text]);
    }
}

#[test]
fn start_that_contradicts_other_fields_is_refused() {
    assert_all_refused(
        r#"
        start = "file"                          => start = "file" & file = "PACKING.csv"
        start = "random" / file = "a.csv"       => file = "a.csv" cannot & start = "random"
        start = "hexagonal" / file = "a.csv"    => file = "a.csv" cannot & start = "hexagonal"
        file = "a.csv" / particles = 64         => particles = 64 cannot & start = "file"
        file = "a.csv" / phi = 0.9              => phi = 0.9 cannot & start = "file"
        file = "a.csv" / aspect = 2.0           => aspect = 2 cannot & start = "file"
        file = "a.csv" / seed = 7               => seed = 7 cannot & start = "file"
        file = "a.csv" / species = [{ radius = 0.5, fraction = 1.0 }] => species & start = "file"
        file = "a.csv" / spread = { min = 0.4, max = 0.5 }            => spread & start = "file"
        start = "hexagonal" / particles = 65    => particles = 65 is & hexagonal
        file = "a.csv" / disks.steps = 7        => disks = {…} cannot & start = "file" & relax = true in [disks]
        file = "a.csv" / disks.relax = false / disks.threshold = 1e-4 => disks = {…} cannot
        separate = true                         => separate = true cannot & start = "random"
        start = "hexagonal" / disks.relax = false => disks.relax = false cannot & disks.steps = 0
        "#,
    );
}

#[test]
fn what_is_done_to_a_start_file_comes_from_the_file_or_the_flags() {
    use softjam::scene::{DiskFields, SceneFields};
    let preparation = |text: &str, flags: &SceneFields| {
        let fields = SceneFields::from_toml(text).unwrap();
        match fields.overridden_by(flags.clone()).into_scene().unwrap() {
            Scene {
                start: Start::File { preparation, .. },
                disks,
                ..
            } => Some((preparation, disks.steps)),
            _ => None,
        }
    };
    let default = DiskParameters::default().steps;
    let none = SceneFields::default();
    let file = SceneFields {
        file: Some("b.csv".into()),
        ..SceneFields::default()
    };
    let relax = SceneFields {
        disks: Some(DiskFields {
            relax: Some(true),
            ..DiskFields::default()
        }),
        ..file.clone()
    };
    let start = SceneFields {
        start: Some("random".into()),
        ..SceneFields::default()
    };
    let separate = "file = \"a.csv\"\nseparate = true";
    let steps = "[disks]\nsteps = 9";
    let relaxed = "file = \"a.csv\"\n[disks]\nrelax = true\nsteps = 9";
    for (text, flags, expected) in [
        (
            "file = \"a.csv\"",
            &none,
            Some((Preparation::AsItStands, default)),
        ),
        (separate, &none, Some((Preparation::Separated, default))),
        (relaxed, &none, Some((Preparation::Relaxed, 9))),
        (relaxed, &file, Some((Preparation::Relaxed, 9))),
        // Parameters of the disks of a random start are not for the file that takes its place, unless its disks are relaxed.
        (steps, &file, Some((Preparation::AsItStands, default))),
        (steps, &relax, Some((Preparation::Relaxed, 9))),
        (separate, &relax, Some((Preparation::Relaxed, default))),
        (separate, &start, None),
        ("file = \"a.csv\"\ndisks.relax = false", &start, None),
    ] {
        assert_eq!(preparation(text, flags), expected, "{text}");
    }
}

#[test]
fn hash_of_a_start_file_without_a_start_file_is_refused() {
    assert_all_refused(
        r#"
        file_blake3 = "00"                          => file_blake3 & 00
        start = "hexagonal" / file_blake3 = "00"    => file_blake3 & 00
        "#,
    );
}

#[test]
fn box_too_small_for_the_minimum_image_is_refused_with_its_sides() {
    let refuse = |particles, phi, aspect, words: &[&str]| {
        let scene = Scene {
            particles,
            phi,
            aspect,
            ..Scene::default()
        };
        let message = Relaxation::new(&scene).unwrap_err().to_string();
        for word in words {
            assert!(message.contains(word), "no `{word}` in: {message}");
        }
    };
    refuse(1, 0.86, 1.0, &["particles = 1 ", "0.9556 × 0.9556"]);
    refuse(4, 1.2, 1.0, &["particles = 4 ", "largest radius 0.7"]);
    refuse(16, 0.86, 4.0, &["particles = 16 ", "9.3007 × 2.3252"]);
    refuse(16, 0.86, 0.25, &["particles = 16 ", "2.3252 × 9.3007"]);
}

#[test]
fn box_too_small_message_repeats_the_numbers_that_were_asked_for() {
    for (phi, aspect) in [(0.86, 10.0), (0.86, 0.1), (1.1, 0.3), (0.9, 0.2)] {
        let scene = Scene {
            particles: 12,
            phi,
            aspect,
            ..Scene::default()
        };
        let message = Relaxation::new(&scene).unwrap_err().to_string();
        let asked = format!("particles = 12 with phi = {phi} and aspect = {aspect} give");
        assert!(message.starts_with(&asked), "no `{asked}` in: {message}");
    }
}

#[test]
fn values_that_never_were_a_text_are_validated_too() {
    type Spoil = fn(&mut Scene);
    let cases: [(Spoil, &str); 12] = [
        (|s| s.particles = 0, "particles = 0 "),
        (|s| s.particles = usize::MAX, "particles = "),
        (|s| s.phi = f64::NAN, "phi = NaN "),
        (|s| s.phi = 5e-324, "phi = 0.000"), // too small for a box of finite size
        (|s| s.aspect = f64::INFINITY, "aspect = inf "),
        (|s| s.line_tension = -1.0, "line_tension = -1 "),
        (|s| s.threshold = f64::NAN, "threshold = NaN "),
        (|s| s.dt_max = Some(0.0), "dt_max = 0 "),
        (|s| s.fire.least_dt = 0.5, "fire.least_dt = 0.5 "),
        (|s| s.contours.vertices = 0, "contours.vertices = 0 "),
        (|s| s.radii = Radii::Species(Vec::new()), "species = [] "),
        (
            |s| s.radii = Radii::Spread { min: 2.0, max: 1.0 },
            "spread.min = 2 ",
        ),
    ];
    for (spoil, start) in cases {
        let mut scene = Scene::default();
        spoil(&mut scene);
        let message = Relaxation::new(&scene).unwrap_err().to_string();
        assert!(message.starts_with(start), "no `{start}` in: {message}");
    }
}

#[test]
fn every_scene_survives_the_way_through_its_text() {
    type Change = fn(&mut Scene);
    let cases: [Change; 8] = [
        |s| {
            s.start = Start::File {
                path: "a.csv".into(),
                blake3: None,
                preparation: Preparation::Separated,
            }
        },
        |s| {
            s.disks.steps = 77;
            s.start = Start::File {
                path: "-".into(),
                blake3: None,
                preparation: Preparation::Relaxed,
            }
        },
        |s| s.seed = u64::MAX,
        |s| (s.phi, s.aspect, s.dt_max) = (0.1 + 0.2, 1.0 / 3.0, Some(1e-300)),
        |s| {
            s.disks = DiskParameters {
                threshold: 1e-300,
                steps: u64::MAX,
                record: Schedule::Log(7),
            }
        },
        |s| (s.radii, s.start) = (Radii::Spread { min: 0.1, max: 1e6 }, Start::Hexagonal),
        |s| {
            let third = Species {
                radius: 0.7,
                fraction: 1.0 / 3.0,
            };
            s.radii = Radii::Species(vec![third; 3]);
        },
        |s| {
            s.start = Start::File {
                path: "a \"quoted\"\\path\nof 'two' lines.csv".into(),
                blake3: Some("00".repeat(32)),
                preparation: Preparation::AsItStands,
            }
        },
    ];
    for change in cases {
        let mut scene = Scene::default();
        change(&mut scene);
        assert_eq!(Scene::from_toml(&scene.to_toml()).unwrap(), scene);
    }
}

#[test]
fn scene_without_a_step_limit_survives_the_way_through_its_text() {
    // `validate` lets every u64 pass, so its text must be readable.
    let scene = Scene {
        steps: u64::MAX,
        ..Scene::default()
    };
    scene.validate().unwrap();
    assert_eq!(Scene::from_toml(&scene.to_toml()).unwrap(), scene);
}

#[test]
fn the_name_that_saitohs_rule_had_until_version_0_2_is_read() {
    for name in ["saitoh", "seed"] {
        let scene = Scene::from_toml(&format!("contact_rule = \"{name}\"")).unwrap();
        assert_eq!(
            scene.contact_rule,
            softjam::models::droplet::contact::Rule::Saitoh
        );
        assert!(scene.to_toml().contains("contact_rule = \"saitoh\""));
    }
}
