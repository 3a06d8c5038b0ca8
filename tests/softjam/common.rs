//! What several themes need: random numbers of the tests' own, packings to work on, and bounds that show their value.

use softjam::domain::{Domain, Vec2};
use softjam::minimize::fire::FireState;
use softjam::models::droplet::contact::solver::Method;
use softjam::models::droplet::contact::{ContactLaw, Rule};
use softjam::protocol::relax_disks;
use softjam::protocol::{Relaxation, Status};
use softjam::scene::DiskParameters;
use softjam::scene::{Radii, Scene, Species};
use softjam::state::{Frame, Packing};
use std::f64::consts::PI;
use std::sync::atomic::{AtomicU32, Ordering};

/// SplitMix64 (Steele, Lea, Flood 2014): random enough for a test, and not the crate's generator.
pub struct Random(u64);

impl Random {
    pub fn new(seed: u64) -> Self {
        Self(seed)
    }

    pub fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// A number in `[least, most)`.
    pub fn within(&mut self, least: f64, most: f64) -> f64 {
        least + (most - least) * (self.bits() >> 11) as f64 * 2f64.powi(-53)
    }

    pub fn below(&mut self, n: usize) -> usize {
        (self.bits() % n as u64) as usize
    }

    pub fn shuffle<T>(&mut self, items: &mut [T]) {
        for k in (1..items.len()).rev() {
            items.swap(k, self.below(k + 1));
        }
    }
}

/// Asserts `value ≤ bound`; with `--nocapture` the value shows.
#[track_caller]
pub fn assert_at_most(what: &str, value: f64, bound: f64) {
    println!("{what}: {value:.3e} (bound {bound:.1e})");
    assert!(value <= bound, "{what}: {value:e} exceeds {bound:e}");
}

/// Asserts `least ≤ value ≤ most`; with `--nocapture` the value shows.
#[track_caller]
pub fn assert_within(what: &str, value: f64, least: f64, most: f64) {
    println!("{what}: {value:.6} (within {least}…{most})");
    assert!(
        (least..=most).contains(&value),
        "{what}: {value} is not within {least}…{most}"
    );
}

/// The default bidisperse mixture.
pub fn scene(particles: usize, phi: f64, seed: u64) -> Scene {
    Scene {
        particles,
        phi,
        seed,
        ..Scene::default()
    }
}

/// Particles all of radius 1/2.
pub fn monodisperse() -> Radii {
    Radii::Species(vec![Species {
        radius: 0.5,
        fraction: 1.0,
    }])
}

/// The packing of frame 0: disks in balance, Morse–Witten forces not.
pub fn relaxed_disks(particles: usize, phi: f64, seed: u64) -> Packing {
    let run = Relaxation::new(&scene(particles, phi, seed)).unwrap();
    run.packing().clone()
}

/// Random centres and radii between 1/2 and `ratio`/2, followed by `disk_steps` steps of the relaxation of disks: enough
/// to take the worst overlaps away, not enough for balance.
pub fn random_packing(
    random: &mut Random,
    particles: usize,
    phi: f64,
    ratio: f64,
    disk_steps: u64,
) -> Packing {
    let radii: Vec<f64> = (0..particles)
        .map(|_| 0.5 * random.within(1.0, ratio.max(1.0 + 1e-9)))
        .collect();
    let side = (radii.iter().map(|r| PI * r * r).sum::<f64>() / phi).sqrt();
    let positions = (0..particles)
        .map(|_| Vec2::new(random.within(0.0, side), random.within(0.0, side)))
        .collect();
    let mut packing = Packing::new(Domain::new(side, side).unwrap(), radii, positions).unwrap();
    let parameters = DiskParameters {
        steps: disk_steps,
        ..DiskParameters::default()
    };
    relax_disks(&mut packing, &parameters, 1.0).unwrap();
    packing
}

/// A run to its end, which must be equilibrium.
pub fn converged(scene: &Scene) -> Relaxation {
    let mut run = Relaxation::new(scene).unwrap();
    while run.status() == Status::Running {
        run.advance().unwrap();
    }
    assert_eq!(run.status(), Status::Converged, "f_max = {:e}", run.f_max());
    run
}

/// The contact law with γ = 1 and the default tolerance.
pub fn law(rule: Rule, method: Method) -> ContactLaw {
    ContactLaw::new(rule, method, 1.0, 1e-12)
}

/// The default law, solved from nothing.
pub fn solved(packing: &Packing) -> ContactLaw {
    let mut law = ContactLaw::default();
    law.solve(packing, &[], &[]).unwrap();
    law
}

/// Contacts with their forces, for comparisons.
pub fn answer(law: &ContactLaw) -> Vec<([u32; 2], f64)> {
    let contacts = law.contacts();
    contacts
        .pairs
        .iter()
        .copied()
        .zip(contacts.forces.iter().copied())
        .collect()
}

/// The largest difference of two lists of forces that belong to the same contacts.
#[track_caller]
pub fn largest_difference(a: &[([u32; 2], f64)], b: &[([u32; 2], f64)]) -> f64 {
    let pairs = |list: &[([u32; 2], f64)]| list.iter().map(|c| c.0).collect::<Vec<_>>();
    assert_eq!(pairs(a), pairs(b), "the same contacts");
    a.iter()
        .zip(b)
        .fold(0.0, |m: f64, (x, y)| m.max((x.1 - y.1).abs()))
}

/// The median of an odd number of values.
pub fn median(mut values: Vec<u64>) -> u64 {
    values.sort_unstable();
    values[values.len() / 2]
}

/// A folder of the test's own, gone when it is dropped.
pub struct Folder(std::path::PathBuf);

impl Folder {
    pub fn new() -> Self {
        static NUMBER: AtomicU32 = AtomicU32::new(0);
        let number = NUMBER.fetch_add(1, Ordering::Relaxed);
        let name = format!("softjam-test-{}-{number}", std::process::id());
        let path = std::env::temp_dir().join(name);
        std::fs::create_dir(&path).expect("a temporary folder");
        Self(path)
    }

    pub fn path(&self) -> &std::path::Path {
        &self.0
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        // What cannot be removed is left to the system's own cleaning.
        drop(std::fs::remove_dir_all(&self.0));
    }
}

/// The state of FIRE in a frame.
pub fn fire(frame: &Frame) -> FireState {
    FireState::of(&frame.minimizer).expect("numbers of FIRE")
}
