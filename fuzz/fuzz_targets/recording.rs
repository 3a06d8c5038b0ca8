//! Whatever a file holds, reading it as a recording ends, without a panic and without an allocation that the file claims.
#![no_main]

use libfuzzer_sys::fuzz_target;
use softjam::replay::{Event, Recording};
use std::io::Cursor;

fuzz_target!(|bytes: &[u8]| {
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
