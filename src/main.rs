//! The program `softjam`: see `softjam --help`.

mod cli;

use std::process::ExitCode;

/// Frames are made in one thread and freed in another, several times a millisecond.
#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

fn main() -> ExitCode {
    cli::run()
}
