//! softjam
pub mod contact;
pub mod disks;
pub mod domain;
pub mod droplet;
pub mod force;
pub mod frame;
pub mod neighbors;
pub mod packing;
pub mod relax;
pub mod scene;
