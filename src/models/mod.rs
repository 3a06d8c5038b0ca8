//! Models of particles: what contacts there are at given positions, and what forces they exert.

pub mod disks;
pub mod droplet;
