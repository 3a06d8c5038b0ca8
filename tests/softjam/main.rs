//! Integration tests, one module a theme.

#![expect(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    clippy::print_stdout,
    reason = "a test fails by panicking, and prints what it measured"
)]
#![expect(
    clippy::disallowed_methods,
    reason = "the tests' own formulas use the standard library on purpose: nothing is shared with the crate"
)]

mod common;
#[cfg(feature = "recording")]
mod damage;
#[cfg(feature = "cli")]
mod examples;
#[cfg(feature = "figure")]
mod figures;
#[cfg(feature = "recording")]
mod files;
#[cfg(feature = "recording")]
mod forgery;
#[cfg(feature = "recording")]
mod formats;
#[cfg(feature = "recording")]
mod hostile;
mod layers;
#[cfg(feature = "recording")]
mod mcap;
mod physics;
#[cfg(feature = "cli")]
mod program;
#[cfg(feature = "recording")]
mod rearranged;
#[cfg(feature = "recording")]
mod recording;
#[cfg(feature = "recording")]
mod redraw;
#[cfg(feature = "recording")]
mod replay;
mod scenes;
#[cfg(feature = "recording")]
mod stages;
#[cfg(feature = "recording")]
mod viewer;
