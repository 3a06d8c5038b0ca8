//! The seed's figure 5: a packing of undeformed disks, and the deformable particles that relax from it.
//!
//! `cargo run --release --example figure5 [FOLDER]` writes `figure5a.svg` and `figure5b.svg`.

use softjam::figure::{Shape, Style, packing, write};
use softjam::relax::{Relaxation, Status};
use softjam::scene::Scene;
use std::error::Error;
use std::path::PathBuf;

fn main() -> Result<(), Box<dyn Error>> {
    let folder = PathBuf::from(std::env::args().nth(1).unwrap_or(".".to_owned()));
    let scene = Scene {
        particles: 200,
        phi: 0.92,
        seed: 3,
        ..Scene::default()
    };
    let mut run = Relaxation::new(&scene)?;

    // (a) Frame 0: the disks are in balance, the Morse–Witten forces are not.
    let disks = Style {
        shape: Shape::Disk,
        ..Style::default()
    };
    let a = packing(run.packing(), &run.frame(), scene.line_tension, &disks);
    write(folder.join("figure5a.svg"), &a)?;

    // (b) The packing in mechanical equilibrium.
    while run.status() == Status::Running {
        run.advance()?;
    }
    let b = packing(
        run.packing(),
        &run.frame(),
        scene.line_tension,
        &Style::default(),
    );
    write(folder.join("figure5b.svg"), &b)?;
    Ok(())
}
