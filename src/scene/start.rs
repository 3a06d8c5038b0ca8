//! The first packing of a scene: random, hexagonal or from a file.
//!
//! Random numbers come from the ChaCha8 generator (D. J. Bernstein), keyed with the seed in little-endian bytes followed
//! by zeros; a number in `[0, 1)` is the upper 53 bits of one 64-bit word. That is part of what a seed means: the same
//! seed gives the same start on every platform and in every version.
//!
//! In a random start radii and positions are drawn first, in this order; then the particles are numbered along Morton's
//! curve (G. M. Morton, IBM Ltd., 1966), so that particles near each other have numbers near each other and stand near
//! each other in memory. Numbers mean nothing to the physics.
//!
//! See the example of [`packing()`].

pub use super::start_file::{Coincidence, StartFile, read_csv};

use super::{Radii, Scene, SceneError, Species, Start};
use crate::domain::{Domain, Vec2};
use crate::state::Packing;
use core::f64::consts::PI;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};

/// The packing that a scene starts from, its disks not yet relaxed.
///
/// # Errors
///
/// [`SceneError::BoxTooSmall`], or whatever is wrong with the start file.
///
/// # Example
///
/// ```
/// use softjam::scene::{start, Scene};
///
/// let packing = start::packing(&Scene { particles: 100, phi: 0.84, ..Scene::default() }).unwrap();
/// assert_eq!(packing.len(), 100);
/// assert!((packing.coverage() - 0.84).abs() < 1e-12);
/// ```
pub fn packing(scene: &Scene) -> Result<Packing, SceneError> {
    let (packing, aspect) = match &scene.start {
        Start::File {
            path,
            blake3,
            preparation,
        } => {
            let file = StartFile::read(path)?;
            file.start(blake3.as_deref(), *preparation)?;
            let (packing, _) = file.prepared(*preparation)?;
            return Ok(packing);
        }
        Start::Random => {
            let mut random = Random::new(scene.seed);
            let radii = radii(scene, &mut random);
            let domain = domain(scene, &radii, scene.aspect)?;
            let l = domain.lengths();
            let positions = (0..radii.len()).map(|_| {
                let x = random.uniform();
                Vec2::new(x * l.x, random.uniform() * l.y)
            });
            let mut particles: Vec<(u64, Vec2, f64)> = positions
                .zip(radii)
                .map(|(p, radius)| (along_curve(p, domain), p, radius))
                .collect();
            // A stable sort: the same numbers everywhere, whatever lies in one square.
            particles.sort_by_key(|(place, ..)| *place);
            let radii = particles.iter().map(|(_, _, radius)| *radius).collect();
            let positions = particles.iter().map(|(_, p, _)| *p).collect();
            (make(domain, radii, positions)?, scene.aspect)
        }
        Start::Hexagonal => {
            let mut random = Random::new(scene.seed);
            let mut radii = radii(scene, &mut random);
            if radii.iter().any(|r| *r != radii[0]) {
                random.shuffle(&mut radii);
            }
            let (columns, rows) = hexagonal_shape(radii.len(), scene.aspect);
            let aspect = columns as f64 / (rows as f64 * 0.75_f64.sqrt());
            let domain = domain(scene, &radii, aspect)?;
            let l = domain.lengths();
            let (dx, dy) = (l.x / columns as f64, l.y / rows as f64);
            let positions = (0..radii.len())
                .map(|p| {
                    let (column, row) = (p % columns, p / columns);
                    let shift = if row % 2 == 0 { 0.25 } else { 0.75 };
                    Vec2::new((column as f64 + shift) * dx, (row as f64 + 0.5) * dy)
                })
                .collect();
            (make(domain, radii, positions)?, l.x / l.y)
        }
    };
    let (l, largest_radius) = (packing.domain().lengths(), packing.largest_radius());
    if is_small(&packing) {
        return Err(SceneError::BoxTooSmall {
            particles: packing.len(),
            phi: scene.phi,
            aspect,
            length_x: l.x,
            length_y: l.y,
            largest_radius,
        });
    }
    Ok(packing)
}

/// Whether two undeformed disks could touch two images of each other, or one its own, wherever they stand. What contours do shows in
/// each step of a run.
fn is_small(packing: &Packing) -> bool {
    let mut largest = [0.0; 2];
    for &radius in packing.radii() {
        if radius > largest[0] {
            largest = [radius, largest[0]];
        } else if radius > largest[1] {
            largest[1] = radius;
        }
    }
    let shortest = packing.domain().shortest();
    2.0 * (largest[0] + largest[1]) > shortest || 2.0 * largest[0] > shortest
}

/// The place of a point of the box along Morton's curve through 2¹⁶ × 2¹⁶ squares: the bits of the square's column and
/// row in turn.
fn along_curve(p: Vec2, domain: Domain) -> u64 {
    let spread = |x: f64, length: f64| {
        let mut bits = u64::from((x / length * 65536.0) as u16); // saturates
        for (shift, mask) in [
            (8, 0x00ff_00ff),
            (4, 0x0f0f_0f0f),
            (2, 0x3333_3333),
            (1, 0x5555_5555),
        ] {
            bits = (bits | (bits << shift)) & mask;
        }
        bits
    };
    let l = domain.lengths();
    spread(p.x, l.x) | (spread(p.y, l.y) << 1)
}

fn make(domain: Domain, radii: Vec<f64>, positions: Vec<Vec2>) -> Result<Packing, SceneError> {
    Packing::new(domain, radii, positions).map_err(|error| SceneError::Range {
        field: "scene".into(),
        value: error.to_string(),
        allowed: "what a packing can be".into(),
    })
}

fn domain(scene: &Scene, radii: &[f64], aspect: f64) -> Result<Domain, SceneError> {
    let area = radii.iter().map(|r| PI * r * r).sum::<f64>() / scene.phi;
    Domain::new((area * aspect).sqrt(), (area / aspect).sqrt()).ok_or_else(|| SceneError::Range {
        field: "phi".into(),
        value: scene.phi.to_string(),
        allowed: "what gives a box of finite size".into(),
    })
}

/// Columns and (even) rows of a hexagonal lattice of `n` sites whose box has the aspect nearest to `aspect`.
fn hexagonal_shape(n: usize, aspect: f64) -> (usize, usize) {
    let distance = |rows: usize| {
        let columns = (n / rows) as f64;
        libm::log(columns / (rows as f64 * 0.75_f64.sqrt()) / aspect).abs()
    };
    let mut best = 2;
    for rows in (2..=n).step_by(2).filter(|r| n.is_multiple_of(*r)) {
        if distance(rows) < distance(best) {
            best = rows;
        }
    }
    (n / best, best)
}

fn radii(scene: &Scene, random: &mut Random) -> Vec<f64> {
    match &scene.radii {
        Radii::Spread { min, max } => (0..scene.particles)
            .map(|_| min + (max - min) * random.uniform())
            .collect(),
        Radii::Species(species) => species
            .iter()
            .zip(numbers(species, scene.particles))
            .flat_map(|(s, n)| core::iter::repeat_n(s.radius, n))
            .collect(),
    }
}

/// Whole numbers of particles that sum to `n`: the floor of each share, and one more for the largest remainders.
fn numbers(species: &[Species], n: usize) -> Vec<usize> {
    let share = |s: &Species| s.fraction * n as f64;
    let mut numbers: Vec<usize> = species
        .iter()
        .map(|s| libm::floor(share(s)) as usize)
        .collect();
    let mut order: Vec<usize> = (0..species.len()).collect();
    let remainder = |k: usize| share(&species[k]) - libm::floor(share(&species[k]));
    order.sort_by(|&a, &b| remainder(b).total_cmp(&remainder(a)).then(a.cmp(&b)));
    // Fractions sum to 1 within 1e-9, so at most one particle a species is missing, or a few too many in huge packings.
    let mut missing = n as i64 - numbers.iter().sum::<usize>() as i64;
    for &k in order.iter().cycle().take(2 * species.len() + 64) {
        if missing > 0 {
            numbers[k] += 1;
            missing -= 1;
        } else if missing < 0 && numbers[k] > 0 {
            numbers[k] -= 1;
            missing += 1;
        }
    }
    numbers
}

struct Random(ChaCha8Rng);

impl Random {
    fn new(seed: u64) -> Self {
        let mut key = [0; 32];
        key[..8].copy_from_slice(&seed.to_le_bytes());
        Self(ChaCha8Rng::from_seed(key))
    }

    /// A number in `[0, 1)`.
    fn uniform(&mut self) -> f64 {
        (self.0.next_u64() >> 11) as f64 * (1.0 / (1u64 << 53) as f64)
    }

    /// Fisher and Yates.
    fn shuffle(&mut self, items: &mut [f64]) {
        for k in (1..items.len()).rev() {
            let other = (self.uniform() * (k + 1) as f64) as usize;
            items.swap(k, other.min(k));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn generator_is_chacha8_of_the_seed() {
        // The first block of ChaCha8 for an all-zero 256-bit key and IV (draft-strombergson-chacha-test-vectors, TC1).
        let mut zero = Random::new(0);
        assert_eq!(
            zero.0.next_u64().to_le_bytes(),
            [0x3e, 0x00, 0xef, 0x2f, 0x89, 0x5f, 0x40, 0xd6]
        );
        assert_eq!(
            zero.0.next_u64().to_le_bytes(),
            [0x7f, 0x5b, 0xb8, 0xe8, 0x1f, 0x09, 0xa5, 0xa1]
        );
    }

    #[test]
    fn particle_numbers_follow_the_fractions_and_sum_up() {
        let species = |fractions: &[f64]| -> Vec<Species> {
            let radius = 0.5;
            fractions
                .iter()
                .map(|&fraction| Species { radius, fraction })
                .collect()
        };
        assert_eq!(numbers(&species(&[0.5, 0.5]), 7), [4, 3]);
        assert_eq!(numbers(&species(&[0.1, 0.2, 0.7]), 10), [1, 2, 7]);
        assert_eq!(
            numbers(&species(&[1.0 / 3.0; 3]), 8).iter().sum::<usize>(),
            8
        );
    }

    #[test]
    fn hexagonal_start_is_the_perfect_lattice() {
        let scene = Scene {
            particles: 120,
            phi: 0.92,
            radii: Radii::Species(vec![Species {
                radius: 0.5,
                fraction: 1.0,
            }]),
            start: Start::Hexagonal,
            ..Scene::default()
        };
        let packing = packing(&scene).unwrap();
        let spacing = (PI * 0.25 / 0.92 / 0.75_f64.sqrt()).sqrt();
        for i in 0..120 {
            let near = (0..120)
                .filter(|&j| j != i)
                .map(|j| packing.separation(i, j).norm())
                .filter(|r| (r - spacing).abs() < 1e-12)
                .count();
            assert_eq!(near, 6);
        }
    }
}
