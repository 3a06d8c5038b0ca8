//! The state of a run: a packing (radii, box, positions) and the frame that the next one follows from.
//!
//! See the example of [`Packing`].

mod frame;
mod packing;

pub use frame::{Frame, FrameError, Numbers};
pub use packing::*;
