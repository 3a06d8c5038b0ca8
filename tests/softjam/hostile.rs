//! Recordings made to exhaust or to deceive: refused by name, before anything of the size they claim is read, built or run.

use crate::common::{Folder, monodisperse};
use crate::files::{FORMATS, open, record_all, record_as, recorder};
use softjam::budget::Budget;
use softjam::convert;
use softjam::domain::{Domain, Vec2};
use softjam::protocol::Relaxation;
use softjam::record::{Format, Header, Snapshot, Writer};
use softjam::replay::{Event, ReadError, Recording};
use softjam::scene::{
    Channels, Preparation, Scene, SceneError, SceneFields, Schedule, Start, start,
};
use softjam::state::FrameError;
use softjam::state::Packing;
use std::io::{Cursor, Read};
use std::time::{Duration, Instant};

fn scene() -> Scene {
    Scene {
        particles: 150,
        phi: 0.88,
        steps: 40,
        ..Scene::default()
    }
}

/// What `work` gives, which it has to within a moment.
fn soon<T>(work: impl FnOnce() -> T) -> T {
    let begin = Instant::now();
    let result = work();
    let took = begin.elapsed();
    assert!(took < Duration::from_secs(2), "{took:?}");
    result
}

/// A recording of `scene` with another header, and frames that `change` tampers with.
fn forged(
    format: Format,
    scene: &Scene,
    header: impl FnOnce(&mut Header),
    change: impl FnMut(&mut Snapshot),
) -> Vec<u8> {
    let mut run = Relaxation::new(scene).expect("a valid scene");
    let mut bytes = Vec::new();
    let mut head = Header::of(scene, &run);
    header(&mut head);
    let mut recorder = recorder(format, &mut bytes, head).expect("a header");
    record_all(recorder.as_mut(), &mut run, scene, change).expect("recorded");
    drop(recorder);
    bytes
}

fn first_error(bytes: &[u8]) -> ReadError {
    let mut recording = open(bytes).expect("a header");
    loop {
        match recording.next_state() {
            Ok(Some(_)) => {}
            Ok(None) => panic!("nothing is refused"),
            Err(error) => return error,
        }
    }
}

#[test]
fn particles_on_one_point_are_refused_before_a_pair_is_listed() {
    for format in FORMATS {
        let bytes = record_as(format, &scene(), |snapshot| {
            if let Some(frame) = snapshot.frame.as_mut().filter(|f| f.step == 10) {
                frame.positions.fill(Vec2::new(1.0, 1.0));
                frame.contacts.clear();
                frame.forces.clear();
            }
        });
        let error = soon(|| first_error(&bytes));
        let text = error.to_string();
        assert!(
            matches!(
                error,
                ReadError::Crowded {
                    step: 10,
                    others: 149,
                    ..
                }
            ),
            "{text}"
        );
        assert!(
            text.contains("step 10") && text.contains("149 particles overlap particle 0"),
            "{text}"
        );
        // What says only what is there says it.
        let states = open(&bytes)
            .expect("a header")
            .filter(|event| matches!(event, Ok(Event::State(_))));
        assert_eq!(states.count(), 5);
    }
}

#[test]
fn more_contacts_than_fit_around_a_particle_are_refused() {
    let bytes = record_as(Format::Mcap, &scene(), |snapshot| {
        if let Some(frame) = snapshot.frame.as_mut().filter(|f| f.step == 10) {
            let pairs = (0..150_u32).flat_map(|i| (i + 1..150).map(move |j| [i, j]));
            frame.contacts = pairs.collect();
            frame.forces = vec![1e-3; frame.contacts.len()];
        }
    });
    let error = soon(|| first_error(&bytes));
    let source = FrameError::Crowded {
        particle: 0,
        contacts: 149,
    };
    assert!(
        matches!(&error, ReadError::Frame { step: 10, source: found, .. } if *found == source),
        "{error}"
    );
}

#[test]
fn radii_that_the_scene_cannot_have_are_refused_when_the_file_is_opened() {
    for format in FORMATS {
        let many = forged(
            format,
            &scene(),
            |header| header.scene.particles = 10_000_000,
            |_| {},
        );
        let error = soon(|| open(&many)).err().expect("refused").to_string();
        assert!(
            error.contains("10000000 particles") && error.contains("radii of 150"),
            "{error}"
        );
        for radius in [1e8, 1e-9] {
            let thick = |header: &mut Header| {
                let (domain, at) = (header.packing.domain(), header.packing.positions().to_vec());
                header.packing =
                    Packing::new(domain, vec![radius; at.len()], at).expect("a packing");
            };
            let bytes = forged(format, &scene(), thick, |_| {});
            let opened = soon(|| open(&bytes));
            if radius > 1.0 {
                let error = opened.err().expect("refused").to_string();
                assert!(
                    error.contains("0 < φ < 1.3") && error.contains("e16"),
                    "{error}"
                );
            } else {
                assert!(opened.is_ok(), "thin, but a packing");
            }
        }
    }
}

/// A file that goes on with zeros behind `bytes`, as far as its length says: a sparse one.
fn sparse(bytes: Vec<u8>, length: u64) -> Result<Recording, ReadError> {
    let zeros = std::io::repeat(0).take(length - bytes.len() as u64);
    Recording::read("sparse", Cursor::new(bytes).chain(zeros), length)
}

#[test]
fn a_message_of_a_terabyte_is_refused_unread() {
    let length = 1_u64 << 40;
    let claims = |format, start: &[u8]| {
        let mut bytes = start.to_vec();
        if format == Format::Rrd {
            // Rows, and their length.
            bytes.extend([2, 0, 0, 0, 0, 0, 0, 0]);
        } else {
            // A message of a private kind.
            bytes.push(0x90);
        }
        bytes.extend((length - 4096).to_le_bytes());
        bytes
    };
    for (format, start) in [(Format::Rrd, 12), (Format::Mcap, 8)] {
        let whole = record_as(format, &scene(), |_| {});
        let error = soon(|| sparse(claims(format, &whole[..start]), length)).err();
        let error = error.expect("refused").to_string();
        assert!(
            error.contains("1024.0 GiB") && error.contains("--memory"),
            "{error}"
        );
    }
}

/// An MCAP record.
pub fn mcap_record(opcode: u8, body: &[u8]) -> Vec<u8> {
    [&[opcode][..], &(body.len() as u64).to_le_bytes(), body].concat()
}

/// An MCAP chunk that claims to hold so many bytes.
fn mcap_chunk(claimed: u64, packed: &[u8]) -> Vec<u8> {
    let mut body = vec![0; 16];
    body.extend(claimed.to_le_bytes());
    body.extend([0; 4]);
    body.extend(4_u32.to_le_bytes());
    body.extend(b"zstd");
    body.extend((packed.len() as u64).to_le_bytes());
    body.extend(packed);
    mcap_record(6, &body)
}

#[test]
fn a_chunk_is_judged_by_its_size_and_not_by_how_well_it_packs() {
    let whole = record_as(Format::Mcap, &scene(), |_| {});
    // Zeros of a private kind, packed ten thousand times.
    let zeros = mcap_record(0x90, &vec![0; 64 << 20]);
    let packed = zstd::encode_all(&zeros[..], 1).expect("packed");
    assert!(packed.len() * 5000 < zeros.len());
    let put_in = |chunk: &[u8]| [&whole[..8], chunk, &whole[8..]].concat();
    let honest = put_in(&mcap_chunk(zeros.len() as u64, &packed));
    let mut recording = open(&honest).expect("a header");
    assert!(recording.next_state().expect("a state").is_some());
    let liar = put_in(&mcap_chunk(1 << 40, &packed));
    let error = soon(|| open(&liar)).err().expect("refused");
    assert!(matches!(error, ReadError::Budget { .. }), "{error}");
    let length = honest.len() as u64;
    let little = Recording::read_within("test", Cursor::new(honest), length, Budget::of(64 << 20));
    let error = little.err().expect("refused").to_string();
    assert!(
        error.contains("64.0 MiB, more than an eighth, 8.0 MiB"),
        "{error}"
    );
}

#[test]
fn dense_systems_too_large_to_solve_are_not_run() {
    let scene = Scene {
        particles: 3600,
        phi: 0.95,
        radii: monodisperse(),
        start: Start::Hexagonal,
        steps: 2,
        channels: Channels {
            state: Schedule::Every(2),
            metrics: Schedule::Off,
            contours: Schedule::Off,
            contacts: Schedule::Off,
            ..Channels::default()
        },
        threshold: 1e-300,
        ..Scene::default()
    };
    let dense = |header: &mut Header| {
        header.scene.contact_solver =
            softjam::models::droplet::contact::solver::Method::GaussJordan;
    };
    let bytes = forged(Format::Rrd, &scene, dense, |_| {});
    let mut recording = open(&bytes).expect("a header");
    let first = recording.next_state().expect("a state").expect("a state");
    let error = recording
        .check_run(&first.frame)
        .expect_err("refused")
        .to_string();
    assert!(
        error.contains("10800 unknowns") && error.contains("--only balance"),
        "{error}"
    );

    let folder = Folder::new();
    let fine = Channels {
        state: Schedule::Every(1),
        ..recording.scene().channels
    };
    let mut recording = open(&bytes).expect("a header");
    let header = convert::header(&recording, fine).expect("a header");
    let writer = Writer::create(folder.path().join("fine.rrd"), false, header).expect("a file");
    let error = soon(|| convert::convert(&mut recording, writer, &fine)).expect_err("refused");
    assert!(error.to_string().contains("10800 unknowns"), "{error}");
}

#[test]
fn conversion_of_many_metrics_between_two_states_is_the_recording_of_the_run() {
    // More steps than wait for a state.
    let channels = Channels {
        state: Schedule::Every(10_000_000),
        contours: Schedule::Off,
        contacts: Schedule::Off,
        ..Channels::default()
    };
    let scene = Scene {
        particles: 16,
        phi: 0.9,
        threshold: 1e-300,
        steps: 150_000,
        channels,
        ..Scene::default()
    };
    let bytes = record_as(Format::Mcap, &scene, |_| {});
    let folder = Folder::new();
    let path = folder.path().join("again.mcap");
    let mut recording = open(&bytes).expect("a header");
    let header = convert::header(&recording, channels).expect("a header");
    let writer = Writer::create(&path, false, header).expect("a file");
    let converted = convert::convert(&mut recording, writer, &channels).expect("converted");
    assert_eq!(converted.rebuilt, 149_999);
    assert!(std::fs::read(path).expect("a file") == bytes);
}

#[test]
fn what_a_file_says_comes_out_as_one_line_without_escapes() {
    let bytes = record_as(Format::Mcap, &scene(), |_| {});
    let program = softjam::record::PROGRAM.as_bytes();
    let place = bytes
        .windows(program.len())
        .position(|w| w == program)
        .expect("the program");
    let mut spoof = bytes.clone();
    spoof[place..place + 6].copy_from_slice(b"a\n\x1b[2J");
    let recording = open(&spoof).expect("its checksum is that of the end");
    assert!(
        recording.program().starts_with(r"a\n\u{1b}[2J"),
        "{}",
        recording.program()
    );

    let name = "a\nverdict        verified\u{1b}[2J\u{202e}.rrd";
    let error = Recording::read(name, &b"RRF2"[..], 4)
        .err()
        .expect("refused")
        .to_string();
    assert!(
        error.starts_with(r"a\nverdict        verified\u{1b}[2J\u{202e}.rrd is not"),
        "{error}"
    );

    let escape =
        SceneFields::from_toml("start = \"\\u001b]0;\\n\"").and_then(SceneFields::into_scene);
    let error = escape.expect_err("no start").to_string();
    assert!(error.starts_with(r#"start = "\u{1b}]0;\n" is"#), "{error}");
}

#[test]
fn a_start_file_with_any_name_goes_into_the_scene_and_comes_back() {
    for (path, line) in [
        ("φ/粒子 é.csv", r#"file = "φ/粒子 é.csv""#),
        (
            "a\"\n\u{202e}\\.csv",
            r#"file = "a\"\U0000000A\U0000202E\\.csv""#,
        ),
    ] {
        let start = Start::File {
            path: path.to_owned(),
            blake3: None,
            preparation: Preparation::AsItStands,
        };
        let scene = Scene {
            start,
            ..Scene::default()
        };
        let text = scene.to_toml();
        assert!(text.lines().any(|l| l == line), "{text}");
        let read = Scene::from_toml(&text).expect("a scene");
        assert_eq!(read.start, scene.start);
    }
}

#[test]
fn start_files_with_particles_on_one_point_are_refused_by_name() {
    let folder = Folder::new();
    let path = folder.path().join("coincident.csv");
    // On one point, and so near to it that each has a direction.
    let on_one_point = |_| "7,7,0.5\n".to_owned();
    let nearly = |k: u32| {
        let [x, y] = [k / 20, k % 20].map(|n| 7.0 + 0.001 * f64::from(n));
        format!("{x},{y},0.5\n")
    };
    let cases: [(String, &str); 2] = [
        (
            (0..300).map(on_one_point).collect(),
            "line 5: particle 2 (line 5, at 7, 7) stands on the point of particle 1 (line 4, at 7, 7) (and 298 more such)",
        ),
        (
            (0..300).map(nearly).collect(),
            "line 4: 299 particles overlap particle 1",
        ),
    ];
    for (rows, words) in cases {
        let text = format!("# box = 60, 60\nx,y,radius\n20,20,0.5\n{rows}");
        std::fs::write(&path, text).expect("written");
        let file = Start::File {
            path: path.display().to_string(),
            blake3: None,
            preparation: Preparation::AsItStands,
        };
        let scene = Scene {
            start: file,
            ..Scene::default()
        };
        let error = soon(|| start::packing(&scene)).expect_err("refused");
        let told = error.to_string();
        assert!(matches!(error, SceneError::StartFile { .. }), "{told}");
        assert!(
            told.contains(words) && told.contains("in which direction they part"),
            "{told}"
        );
    }
}

#[test]
fn looking_for_crowds_costs_little() {
    let scene = Scene {
        particles: 1024,
        phi: 0.9,
        ..scene()
    };
    let mut channels = scene.channels;
    channels.state = Schedule::Every(1);
    let bytes = record_as(
        Format::Rrd,
        &Scene {
            channels,
            steps: 1,
            ..scene
        },
        |_| {},
    );
    let mut recording = open(&bytes).expect("a header");
    let frame = recording
        .next_state()
        .expect("whole")
        .expect("a state")
        .frame;
    let begin = Instant::now();
    for _ in 0..1000 {
        recording.packing(&frame).expect("a packing");
    }
    let each = begin.elapsed() / 1000;
    println!("packing of 1024 particles, looked through for crowds: {each:?}");
    assert!(each < Duration::from_millis(2));
}

#[cfg(feature = "figure")]
#[test]
fn a_figure_of_whatever_opens_is_drawn_with_numbers_or_refused() {
    use softjam::figure::{self, ColorBy, Shape, Style};
    let run = Relaxation::new(&scene()).expect("a valid scene");
    let (frame, packing) = (run.frame(), run.packing());
    let lengths = packing.domain().lengths();
    let folder = Folder::new();
    for scale in [1e-320, 1e-200, 1e-100, 1.0, 1e100, 1e150, 1e300] {
        for (stretch, force) in [(1.0, 1.0), (1e3, 1e300), (1e9, 1e-300), (1.0, f64::MAX)] {
            let Some(domain) = Domain::new(lengths.x * scale, lengths.y * scale * stretch) else {
                continue;
            };
            let mut frame = frame.clone();
            for p in &mut frame.positions {
                *p = domain.wrap(*p * scale);
            }
            for f in &mut frame.forces {
                *f = force;
            }
            let radii = packing.radii().iter().map(|r| r * scale).collect();
            let Ok(packing) = Packing::new(domain, radii, frame.positions.clone()) else {
                continue;
            };
            // Others do not open.
            if !(packing.coverage() > 0.0 && packing.coverage() < 1.3) {
                continue;
            }
            for color in [ColorBy::Pressure, ColorBy::Deformation, ColorBy::Nothing] {
                for shape in [Shape::Contour, Shape::Disk] {
                    let svg = figure::packing(
                        &packing,
                        &frame,
                        &Scene::default(),
                        &Style {
                            color,
                            shape,
                            ..Style::default()
                        },
                    );
                    for name in ["a.svg", "a.png", "a.pdf"] {
                        let path = folder.path().join(name);
                        let written = figure::write(&path, &svg);
                        assert!(
                            scale != 1.0 || stretch > 1.0 || force > 1.0 || written.is_ok(),
                            "{written:?}"
                        );
                        if written.is_ok() && name == "a.svg" {
                            let text = std::fs::read_to_string(&path).expect("written");
                            let odd = text.find("NaN").or(text.find("inf "));
                            let around = odd.map(|at| text[at.saturating_sub(99)..].lines().next());
                            assert_eq!(around, None, "{scale:e} {stretch:e} {force:e}");
                        }
                    }
                    if color == ColorBy::Nothing && scale == 1.0 && stretch > 1e6 {
                        assert!(figure::png(&svg).is_err());
                    }
                }
            }
        }
    }
}
