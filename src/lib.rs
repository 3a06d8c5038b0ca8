//! softjam
pub mod contact;
pub mod disks;
pub mod domain;
pub mod droplet;
pub mod force;
pub mod frame;
pub mod neighbors;
pub mod packing;
#[cfg(feature = "rrd")]
pub mod record;
pub mod relax;
#[cfg(feature = "rrd")]
pub mod replay;
pub mod scene;
