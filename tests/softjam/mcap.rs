//! MCAP: the same recording in another container, which defends itself on its own, and conversions both ways.

use crate::common::{Folder, Random};
use crate::files::{FORMATS, open, record_as, recorder, states};
use softjam::convert::{self, ConvertError};
use softjam::protocol::{Relaxation, Status};
use softjam::record::{Format, Header, Snapshot, Writer};
use softjam::replay::{Event, Recording, Way, compare, determinism};
use softjam::scene::{Channels, Scene, Schedule};
use std::path::{Path, PathBuf};

fn scene() -> Scene {
    Scene {
        particles: 48,
        phi: 0.88,
        channels: Channels {
            state: Schedule::Every(20),
            ..Channels::default()
        },
        ..Scene::default()
    }
}

#[test]
fn both_formats_hold_the_same_events_and_verify_the_same_way() {
    let scene = scene();
    let [rrd, mcap] = FORMATS.map(|format| record_as(format, &scene, |_| {}));
    assert!(
        record_as(Format::Mcap, &scene, |_| {}) == mcap,
        "the same bytes every time"
    );
    // What a batch holds comes in another order.
    let sorted = |bytes: &[u8]| {
        let recording = open(bytes).expect("a recording");
        let events = recording.map(|event| format!("{:?}", event.expect("undamaged")));
        let mut events: Vec<String> = events.collect();
        events.sort();
        events
    };
    assert_eq!(sorted(&rrd), sorted(&mcap));
    for way in [Way::Whole, Way::Segments(2)] {
        let verdicts = [&rrd, &mcap].map(|bytes| {
            determinism(&mut open(bytes).expect("a recording"), way, None, |_| {})
                .expect("a verdict")
        });
        assert_eq!(verdicts[0].difference, None);
        assert_eq!(verdicts[0], verdicts[1]);
    }
    let [mut here, mut there] = [&rrd, &mcap].map(|bytes| open(bytes).expect("a recording"));
    let comparison = compare(&mut here, &mut there).expect("both are whole");
    assert_eq!(comparison.difference, None);
}

#[test]
fn a_flipped_bit_anywhere_in_an_mcap_file_is_noticed() {
    let scene = Scene {
        steps: 200,
        ..scene()
    };
    let bytes = record_as(Format::Mcap, &scene, |_| {});
    let mut random = Random::new(11);
    for attempt in 0..1000 {
        let mut copy = bytes.clone();
        let place = random.below(copy.len());
        copy[place] ^= 1 << random.below(8);
        let noticed = match open(&copy) {
            Err(_) => true,
            Ok(mut recording) => {
                let failed = recording.by_ref().any(|event| event.is_err());
                failed || !recording.is_closed()
            }
        };
        assert!(
            noticed,
            "attempt {attempt}: byte {place} of {}",
            bytes.len()
        );
    }
}

#[test]
fn an_mcap_file_cut_anywhere_is_read_up_to_its_last_whole_step_and_says_so() {
    let bytes = record_as(Format::Mcap, &scene(), |_| {});
    let whole = states(&bytes);
    let mut random = Random::new(12);
    let mut most = 0;
    for _ in 0..200 {
        let length = random.below(bytes.len());
        let Ok(mut recording) = open(&bytes[..length]) else {
            continue;
        };
        let events: Vec<Event> = recording
            .by_ref()
            .map(|event| event.expect("what is there is whole"))
            .collect();
        assert!(!recording.is_closed());
        let frames = events.iter().filter_map(|event| match event {
            Event::State(frame) => Some(frame),
            _ => None,
        });
        let count = frames.clone().count();
        // A cut in the indexes behind the data leaves the result.
        assert!(recording.outcome().is_none() || count == whole.len());
        assert!(frames.zip(&whole).all(|(a, b)| a == b));
        assert_eq!(
            recording.intact(),
            count.checked_sub(1).map(|last| whole[last].step)
        );
        most = most.max(count);
    }
    assert!(most > 2, "no cut left a state: the test tests nothing");
}

/// A file that Python's writer has made of a recording: chunks neither packed nor with checksums, the result in front of
/// the messages.
const PLAIN: &[u8] = include_bytes!("../../fuzz/corpus/recording/plain.mcap");

#[test]
fn a_file_that_another_writer_has_rewritten_verifies() {
    let mut recording = open(PLAIN).expect("a recording");
    let verdict = determinism(&mut recording, Way::Whole, None, |_| {}).expect("a verdict");
    assert_eq!((verdict.difference, verdict.steps), (None, Some((0, 3))));
    assert!(recording.is_closed());
    assert!(recording.outcome().is_some_and(|end| end.steps == 3));
}

#[test]
fn flipped_bits_that_no_checksum_covers_never_panic_and_never_change_a_state() {
    let whole = states(PLAIN);
    let mut random = Random::new(13);
    let mut unnoticed = 0;
    for _ in 0..20_000 {
        let mut copy = PLAIN.to_vec();
        for _ in 0..=random.below(3) {
            let place = random.below(copy.len());
            copy[place] ^= 1 << random.below(8);
        }
        let Ok(recording) = open(&copy) else { continue };
        let mut frames = whole.iter();
        for event in recording {
            match event {
                Ok(Event::State(frame)) => assert_eq!(Some(&frame), frames.next()),
                Ok(_) => {}
                Err(_) => break,
            }
        }
        unnoticed += u32::from(frames.next().is_none());
    }
    println!("all states came out whole in {unnoticed} of 20000 files");
}

#[test]
fn lengths_that_a_file_only_claims_are_not_believed() {
    let scene = Scene {
        particles: 32,
        steps: 0,
        ..scene()
    };
    let bytes = record_as(Format::Mcap, &scene, |_| {});
    // A chunk: operation code 6, its length, start and end time, and then the length that it claims to unpack to.
    let chunk = mcap_records(&bytes)
        .into_iter()
        .find(|start| bytes[*start] == 6)
        .expect("a chunk");
    for (place, claim) in [(chunk + 1, u64::MAX >> 1), (chunk + 9 + 16, 1 << 40)] {
        let mut copy = bytes.clone();
        copy[place..place + 8].copy_from_slice(&claim.to_le_bytes());
        let text = match open(&copy) {
            Err(error) => error.to_string(),
            Ok(mut recording) => {
                if let Some(error) = recording.find_map(Result::err) {
                    error.to_string()
                } else {
                    assert!(!recording.is_closed());
                    "breaks off".to_owned()
                }
            }
        };
        assert!(
            ["more than an eighth", "breaks off", "has no radii"]
                .iter()
                .any(|part| text.contains(part)),
            "{text}"
        );
    }
}

/// Where the records of an MCAP file begin.
pub fn mcap_records(bytes: &[u8]) -> Vec<usize> {
    let (mut start, mut starts) = (8, Vec::new());
    while start + 9 < bytes.len() {
        starts.push(start);
        let length = bytes[start + 1..start + 9].try_into().expect("eight bytes");
        start += 9 + u64::from_le_bytes(length) as usize;
    }
    starts
}

#[test]
fn a_killed_run_loses_at_most_the_steps_of_one_chunk() {
    // The bound is a number of moves of a particle, so it holds for any size of a packing and any channels.
    let channels = Channels {
        contours: Schedule::Off,
        contacts: Schedule::Off,
        state: Schedule::Off,
        metrics: Schedule::Every(1),
        ..Channels::default()
    };
    for particles in [64, 1024] {
        let scene = Scene {
            particles,
            channels,
            threshold: 1e-300,
            ..scene()
        };
        let mut run = Relaxation::new(&scene).expect("a valid scene");
        let mut bytes = Vec::new();
        let header = Header::of(&scene, &run);
        let mut recorder = recorder(Format::Mcap, &mut bytes, header).expect("a header");
        let mut longest = 0;
        for step in 0..1200 {
            let snapshot = Snapshot::of(&run, &scene.channels, false).expect("metrics");
            recorder.record(&snapshot).expect("recorded");
            longest = longest.max(step - recorder.intact().unwrap_or(0));
            run.advance().expect("a step");
        }
        let bound = (400_000 / particles as u64).min(512);
        assert!(longest <= bound, "{particles}: {longest} steps");
        assert!(longest >= bound / 2, "{particles}: {longest} steps");
    }
}

/// Writes a recording into a folder by way of a file.
fn convert_file(from: &Path, to: &Path, channels: Option<Channels>) -> Result<u64, ConvertError> {
    let mut recording = Recording::open(from).expect("a recording");
    let channels = channels.unwrap_or(recording.scene().channels);
    let header = convert::header(&recording, channels)?;
    let writer = Writer::create(to, true, header).expect("a file");
    convert::convert(&mut recording, writer, &channels).map(|done| done.rebuilt)
}

struct Files(Folder);

impl Files {
    fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    fn write(&self, name: &str, bytes: &[u8]) -> PathBuf {
        let path = self.path(name);
        std::fs::write(&path, bytes).expect("written");
        path
    }

    fn read(&self, name: &str) -> Vec<u8> {
        std::fs::read(self.path(name)).expect("a file")
    }
}

#[test]
fn there_and_back_gives_the_same_bytes_whatever_is_recorded() {
    let files = Files(Folder::new());
    let usual = scene().channels;
    let off = Schedule::Off;
    let cases = [
        usual,
        // Contours at steps that have no state.
        Channels {
            contours: Schedule::Every(3),
            metrics: off,
            ..usual
        },
        Channels {
            contours: off,
            contacts: Schedule::Log(7),
            state: Schedule::Log(5),
            metrics: Schedule::Every(9),
            ..Channels::default()
        },
        Channels {
            contours: off,
            contacts: off,
            state: off,
            metrics: Schedule::Every(2),
            ..Channels::default()
        },
        Channels {
            contours: off,
            contacts: off,
            state: Schedule::Every(1),
            metrics: off,
            ..Channels::default()
        },
    ];
    for channels in cases {
        let scene = Scene {
            channels,
            ..scene()
        };
        for (format, [a, b, c]) in [
            (Format::Rrd, ["a.rrd", "b.mcap", "c.rrd"]),
            (Format::Mcap, ["a.mcap", "b.rrd", "c.mcap"]),
        ] {
            let other = if format == Format::Rrd {
                Format::Mcap
            } else {
                Format::Rrd
            };
            let first = record_as(format, &scene, |_| {});
            files.write(a, &first);
            convert_file(&files.path(a), &files.path(b), None).expect("converted");
            convert_file(&files.path(b), &files.path(c), None).expect("converted back");
            assert!(files.read(c) == first, "{format:?}, {channels:?}");
            assert!(
                files.read(b) == record_as(other, &scene, |_| {}),
                "a conversion is what the run itself would have written: {channels:?}"
            );
        }
    }
}

#[test]
fn everything_can_be_rebuilt_from_the_states() {
    let files = Files(Folder::new());
    let scene = scene();
    let whole = record_as(Format::Rrd, &scene, |_| {});
    files.write("whole.rrd", &whole);
    let small = Channels {
        contours: Schedule::Off,
        contacts: Schedule::Off,
        metrics: Schedule::Off,
        state: scene.channels.state,
        ..Channels::default()
    };
    let paths = ["whole.rrd", "small.mcap", "again.rrd"].map(|name| files.path(name));
    assert_eq!(
        convert_file(&paths[0], &paths[1], Some(small)).expect("slimmed"),
        0,
        "nothing is computed to leave something out"
    );
    let rebuilt = convert_file(&paths[1], &paths[2], Some(scene.channels)).expect("rebuilt");
    assert!(rebuilt > 0);
    assert!(files.read("again.rrd") == whole);
    let sizes = [
        files.read("whole.rrd").len(),
        files.read("small.mcap").len(),
    ];
    assert!(sizes[1] * 8 < sizes[0], "{sizes:?}");
}

#[test]
fn without_states_only_the_metrics_go_over() {
    let files = Files(Folder::new());
    let mut scene = scene();
    scene.channels.state = Schedule::Off;
    let from = files.write("a.rrd", &record_as(Format::Rrd, &scene, |_| {}));
    let error = convert_file(&from, &files.path("b.mcap"), None).expect_err("refused");
    assert!(error.to_string().contains("--channels metrics"), "{error}");
    assert!(!files.path("b.mcap").exists(), "nothing is left behind");
    let metrics = Channels {
        contours: Schedule::Off,
        contacts: Schedule::Off,
        ..scene.channels
    };
    convert_file(&from, &files.path("b.mcap"), Some(metrics)).expect("converted");
    let lean = Scene {
        channels: metrics,
        ..scene
    };
    assert!(files.read("b.mcap") == record_as(Format::Mcap, &lean, |_| {}));
}

#[test]
fn a_file_that_breaks_off_is_converted_up_to_its_last_whole_state() {
    let files = Files(Folder::new());
    // With all pictures, so that the file has several batches.
    let mut scene = Scene {
        particles: 200,
        ..scene()
    };
    scene.channels.redraw = 0.0;
    for format in FORMATS {
        let bytes = record_as(format, &scene, |_| {});
        let from = files.write("cut", &bytes[..bytes.len() * 2 / 3]);
        let mut recording = Recording::open(&from).expect("a header");
        recording
            .by_ref()
            .for_each(|event| drop(event.expect("whole")));
        let intact = recording.intact().expect("a state");
        convert_file(&from, &files.path("whole.mcap"), None).expect("converted");
        let mut converted = Recording::open(files.path("whole.mcap")).expect("a recording");
        converted
            .by_ref()
            .for_each(|event| drop(event.expect("whole")));
        assert!(converted.is_closed() && converted.outcome().is_none());
        assert_eq!(converted.intact(), Some(intact));
    }
}

#[test]
fn a_forged_state_does_not_pass_a_rebuild() {
    let files = Files(Folder::new());
    let forged = record_as(Format::Mcap, &scene(), |snapshot| {
        if let Some(frame) = snapshot.frame.as_mut().filter(|frame| frame.step == 40) {
            frame.velocities[3].x = frame.velocities[3].x.next_up();
        }
    });
    let from = files.write("forged.mcap", &forged);
    let wanted = Channels {
        state: Schedule::Every(10),
        ..scene().channels
    };
    let error = convert_file(&from, &files.path("b.rrd"), Some(wanted)).expect_err("found");
    assert!(
        matches!(
            error,
            ConvertError::Differs {
                from: 20,
                step: 40,
                ..
            }
        ),
        "{error}"
    );
}

#[test]
fn a_run_that_goes_on_from_an_unscheduled_step_records_it_first() {
    let scene = scene();
    let mut run = Relaxation::new(&scene).expect("a valid scene");
    for _ in 0..33 {
        run.advance().expect("a step");
    }
    for format in FORMATS {
        let mut run = run.clone();
        let mut bytes = Vec::new();
        let mut recorder =
            recorder(format, &mut bytes, Header::of(&scene, &run)).expect("a header");
        crate::files::record_all(recorder.as_mut(), &mut run, &scene, |_| {}).expect("recorded");
        drop(recorder);
        assert_eq!(run.status(), Status::Converged);
        let steps: Vec<u64> = states(&bytes).iter().map(|frame| frame.step).collect();
        assert_eq!(steps[..3], [33, 40, 60]);
        let mut recording = open(&bytes).expect("a recording");
        let verdict = determinism(&mut recording, Way::Whole, None, |_| {}).expect("a verdict");
        assert_eq!(verdict.difference, None);
    }
}
