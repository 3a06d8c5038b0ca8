//! Saitoh's figure 5: a packing of undeformed disks (a), and the deformable particles that relax from it (b).
//!
//! `cargo run --release --example figure5 -- [FOLDER]` writes `figure5a.svg` and `figure5b.svg`. The disks of (a) overlap where
//! they touch; the particles of (b) give way to each other.

use softjam::figure::{ColorBy, Shape, Style, packing, write};
use softjam::protocol::{Relaxation, Status};
use softjam::scene::Scene;
use std::error::Error;
use std::path::PathBuf;

fn main() -> Result<(), Box<dyn Error>> {
    let folder = PathBuf::from(std::env::args().nth(1).unwrap_or(".".to_owned()));
    let scene = Scene {
        particles: 100,
        phi: 0.9,
        seed: 1,
        ..Scene::default()
    };
    let plain = Style {
        color: ColorBy::Nothing,
        chains: false,
        ..Style::default()
    };
    let mut run = Relaxation::new(&scene)?;

    // (a) Frame 0: the disks are in balance, the Morse–Witten forces are not.
    let disks = Style {
        shape: Shape::Disk,
        ..plain
    };
    let a = packing(run.packing(), &run.frame(), &scene, &disks);
    write(folder.join("figure5a.svg"), &a)?;

    // (b) The packing in mechanical equilibrium.
    while run.status() == Status::Running {
        run.advance()?;
    }
    let b = packing(run.packing(), &run.frame(), &scene, &plain);
    write(folder.join("figure5b.svg"), &b)?;
    Ok(())
}
