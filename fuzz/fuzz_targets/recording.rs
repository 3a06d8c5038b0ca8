//! Whatever a file holds, reading it as a recording ends, without a panic and without an allocation that the file claims.
#![no_main]

use libfuzzer_sys::fuzz_target;
use softjam::replay::{Event, Recording, reading_damaged_bytes};
use std::io::Cursor;
use std::sync::Once;

static HOOK: Once = Once::new();

fuzz_target!(|bytes: &[u8]| {
    // The fuzzer's own hook aborts at every panic; one of Arrow's that becomes an error is none.
    HOOK.call_once(|| {
        std::panic::set_hook(Box::new(|panic| {
            if !reading_damaged_bytes() {
                eprintln!("{panic}");
                std::process::abort();
            }
        }));
    });
    let source = Cursor::new(bytes.to_vec());
    let Ok(recording) = Recording::read("fuzz", source, bytes.len() as u64) else {
        return;
    };
    for event in recording {
        if let Ok(Event::State(frame)) = event {
            assert_eq!(frame.forces.len(), frame.contacts.len());
        }
    }
});
