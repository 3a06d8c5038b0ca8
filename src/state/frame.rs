//! A frame: everything that the next frame follows from.

use crate::domain::{Domain, Vec2};
use crate::text::counted;

/// The state *before* move `step`: positions and velocities, the contact forces solved at these positions, and the
/// minimiser's own state. Together with the scene it determines the next frame to the last bit.
///
/// A frame is the only thing that crosses from the simulation to a recording, and what comes back out of one.
///
/// # Example
///
/// ```
/// use softjam::{protocol::Relaxation, scene::Scene};
///
/// let scene = Scene { particles: 32, ..Scene::default() };
/// let mut run = Relaxation::new(&scene).unwrap();
/// for _ in 0..10 { run.advance().unwrap(); }
/// // A run that goes on from a frame walks the same bits as the one that never stopped.
/// let mut resumed = Relaxation::resume(&scene, run.packing().clone(), run.frame()).unwrap();
/// run.advance().unwrap();
/// resumed.advance().unwrap();
/// assert_eq!(run.frame().digest(), resumed.frame().digest());
/// ```
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Frame {
    /// Number of moves made so far.
    pub step: u64,
    /// Centres `r_i`, wrapped into the box; one a particle (length).
    pub positions: Vec<Vec2>,
    /// Velocities; one a particle (length/time, mass 1).
    pub velocities: Vec<Vec2>,
    /// Contacts `[i, j]`, `i < j`, ascending.
    pub contacts: Vec<[u32; 2]>,
    /// Contact forces `f_ij` in the order of `contacts` (force).
    pub forces: Vec<f64>,
    /// What the minimiser carries from one move to the next.
    pub minimizer: Numbers,
    /// The model's own numbers that the next solution depends on, beside the contact forces; most models have none.
    pub memory: Vec<f64>,
    /// The box, where a run changes it.
    pub domain: Option<Domain>,
    /// The stage of the run, counted from 0; a run of one stage has 0 throughout.
    pub stage: u32,
    /// How far the stage of a protocol has come; none in others.
    pub protocol: Vec<f64>,
}

/// The numbers of a minimiser, under its name.
///
/// ```
/// use softjam::state::Numbers;
/// let numbers = Numbers::new("fire", vec![0.1, 0.2]);
/// assert_eq!((numbers.name(), numbers.values()), ("fire", &[0.1, 0.2][..]));
/// ```
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Numbers {
    name: &'static str,
    values: Vec<f64>,
}

impl Numbers {
    /// The numbers of the minimiser called `name`.
    #[must_use]
    pub fn new(name: &'static str, values: Vec<f64>) -> Self {
        Self { name, values }
    }

    /// The minimiser's name.
    #[must_use]
    pub fn name(&self) -> &'static str {
        self.name
    }

    /// Its numbers, in an order of its own.
    #[must_use]
    pub fn values(&self) -> &[f64] {
        &self.values
    }
}

/// Why a frame cannot belong to a packing of the given size and box.
///
/// ```
/// use softjam::{domain::Domain, state::Frame};
/// let error = Frame::default().validate(2, Domain::new(8.0, 8.0).unwrap()).unwrap_err();
/// assert!(error.to_string().contains('2'), "{error}");
/// ```
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum FrameError {
    /// Not one entry a particle.
    #[error("{} for {}", counted(.found, .what), counted(.particles, "particle"))]
    Particles {
        /// What is counted, in the singular.
        what: &'static str,
        /// How many there are.
        found: usize,
        /// How many there should be.
        particles: usize,
    },
    /// Not one force a contact.
    #[error("{} for {}", counted(.forces, "force"), counted(.contacts, "contact"))]
    Forces {
        /// Number of forces.
        forces: usize,
        /// Number of contacts.
        contacts: usize,
    },
    /// The contacts are not pairs `i < j < N` in strictly ascending order.
    #[error("contact {contact} is [{i}, {j}]: pairs must ascend with i < j < {particles}")]
    Contacts {
        /// The contact's number.
        contact: usize,
        /// Its lower particle.
        i: u32,
        /// Its higher particle.
        j: u32,
        /// Number of particles.
        particles: usize,
    },
    /// More contacts of a particle than any packing has room for.
    #[error(
        "particle {particle} has {}, where a packing has room for some dozens", counted(.contacts, "contact")
    )]
    Crowded {
        /// The particle.
        particle: usize,
        /// Number of its contacts.
        contacts: usize,
    },
    /// The minimiser's numbers are not those of the scene's minimiser.
    #[error("{} of the minimiser {minimizer:?}, which the scene's has no use for", counted(.count, "number"))]
    Minimizer {
        /// Its name.
        minimizer: &'static str,
        /// How many numbers there are.
        count: usize,
    },
    /// It has something that no run of the scene has.
    #[error("it has {what}, which no run of the scene has")]
    Foreign {
        /// What it is.
        what: &'static str,
    },
    /// A position lies outside the box, or a number is not finite.
    #[error("{what} {index} is {value}, which no run can give")]
    Value {
        /// What it is.
        what: &'static str,
        /// Which one.
        index: usize,
        /// Its value.
        value: f64,
    },
}

impl Frame {
    /// BLAKE3 over the frame's own step and state, so that two recordings can be compared frame by frame whatever
    /// else they hold.
    ///
    /// Hashed, in little-endian bytes: `step` u64, `N` u64, the positions and then the velocities (x, y as f64 each),
    /// `N_c` u64, the contacts (i, j as u32 each), the forces (f64 each), the length of the minimiser's list u64 and its
    /// values (f64 each).
    ///
    /// What a frame has beyond that follows under a name of its own, and only where there is something: `solver` and the
    /// minimiser's name unless it is `fire` or `fire+newton`, which the number of values tells apart; `memory`, its length u64
    /// and the values (f64); `box` and `L_x`, `L_y`, tilt (f64); `stage` (u32); `protocol`, its length u64 and the values (f64).
    #[must_use]
    pub fn digest(&self) -> [u8; 32] {
        let minimizer = self.minimizer.values();
        let mut buffer = Vec::with_capacity(
            32 + 32 * self.positions.len() + 16 * self.contacts.len() + 8 * minimizer.len(),
        );
        let count = |n: usize| (n as u64).to_le_bytes();
        let vector = |v: &Vec2| [v.x.to_le_bytes(), v.y.to_le_bytes()];
        let pair = |[i, j]: &[u32; 2]| [i.to_le_bytes(), j.to_le_bytes()];
        buffer.extend_from_slice(&self.step.to_le_bytes());
        buffer.extend_from_slice(&count(self.positions.len()));
        append(&mut buffer, self.positions.iter().map(vector));
        append(&mut buffer, self.velocities.iter().map(vector));
        buffer.extend_from_slice(&count(self.contacts.len()));
        append(&mut buffer, self.contacts.iter().map(pair));
        append(&mut buffer, self.forces.iter().map(|f| [f.to_le_bytes()]));
        buffer.extend_from_slice(&count(minimizer.len()));
        append(&mut buffer, minimizer.iter().map(|x| [x.to_le_bytes()]));
        let name = self.minimizer.name();
        if !["", "fire", "fire+newton"].contains(&name) {
            buffer.extend_from_slice(b"solver");
            buffer.extend_from_slice(name.as_bytes());
        }
        if !self.memory.is_empty() {
            buffer.extend_from_slice(b"memory");
            buffer.extend_from_slice(&count(self.memory.len()));
            append(&mut buffer, self.memory.iter().map(|x| [x.to_le_bytes()]));
        }
        if let Some(domain) = self.domain {
            buffer.extend_from_slice(b"box");
            append(
                &mut buffer,
                domain.values().iter().map(|x| [x.to_le_bytes()]),
            );
        }
        if self.stage > 0 {
            buffer.extend_from_slice(b"stage");
            buffer.extend_from_slice(&self.stage.to_le_bytes());
        }
        if !self.protocol.is_empty() {
            buffer.extend_from_slice(b"protocol");
            buffer.extend_from_slice(&count(self.protocol.len()));
            append(&mut buffer, self.protocol.iter().map(|x| [x.to_le_bytes()]));
        }
        *blake3::hash(&buffer).as_bytes()
    }

    /// The bytes of its columns.
    #[cfg(feature = "recording")]
    pub(crate) fn bytes(&self) -> usize {
        32 * self.positions.len()
            + 16 * self.contacts.len()
            + 8 * (self.memory.len() + self.protocol.len())
    }

    /// Checks that the frame can belong to `particles` particles in `domain`: lengths, order of contacts, positions in
    /// the box, everything finite. A frame from a file is hostile until it has passed.
    ///
    /// # Errors
    ///
    /// [`FrameError`] names the first entry that is wrong.
    pub fn validate(&self, particles: usize, domain: Domain) -> Result<(), FrameError> {
        for (what, found) in [
            ("position", self.positions.len()),
            ("velocity vector", self.velocities.len()),
        ] {
            if found != particles {
                return Err(FrameError::Particles {
                    what,
                    found,
                    particles,
                });
            }
        }
        if self.forces.len() != self.contacts.len() {
            return Err(FrameError::Forces {
                forces: self.forces.len(),
                contacts: self.contacts.len(),
            });
        }
        let mut last = None;
        for (contact, &[i, j]) in self.contacts.iter().enumerate() {
            if i >= j || j as usize >= particles || last.is_some_and(|l| l >= [i, j]) {
                return Err(FrameError::Contacts {
                    contact,
                    i,
                    j,
                    particles,
                });
            }
            last = Some([i, j]);
        }
        let finite = |what, values: &mut dyn Iterator<Item = f64>| {
            values
                .enumerate()
                .find(|(_, v)| !v.is_finite())
                .map_or(Ok(()), |(index, value)| {
                    Err(FrameError::Value { what, index, value })
                })
        };
        finite(
            "velocity component",
            &mut self.velocities.iter().flat_map(|v| [v.x, v.y]),
        )?;
        finite("force", &mut self.forces.iter().copied())?;
        finite(
            "minimiser value",
            &mut self.minimizer.values().iter().copied(),
        )?;
        finite("value of the memory", &mut self.memory.iter().copied())?;
        finite("number of the protocol", &mut self.protocol.iter().copied())?;
        let domain = self.domain.unwrap_or(domain);
        let outside = |(_, p): &(usize, &Vec2)| !domain.contains(**p);
        if let Some((index, p)) = self.positions.iter().enumerate().find(outside) {
            let value = if (0.0..domain.lengths().x).contains(&p.x) {
                p.y
            } else {
                p.x
            };
            return Err(FrameError::Value {
                what: "position of particle",
                index,
                value,
            });
        }
        Ok(())
    }
}

/// Appends cells of `W` numbers of `B` bytes each; with sizes that are known it is a copy in memory.
fn append<const B: usize, const W: usize>(
    bytes: &mut Vec<u8>,
    cells: impl ExactSizeIterator<Item = [[u8; B]; W]>,
) {
    let start = bytes.len();
    bytes.resize(start + cells.len() * W * B, 0);
    let rows = bytes[start..].as_chunks_mut::<B>().0.as_chunks_mut::<W>();
    for (row, cell) in rows.0.iter_mut().zip(cells) {
        *row = cell;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn digest_of_a_known_frame_is_the_hash_of_its_documented_bytes() {
        let frame = Frame {
            step: 3,
            positions: vec![Vec2::new(1.0, 2.0), Vec2::new(3.0, 4.0)],
            velocities: vec![Vec2::new(0.5, -0.5), Vec2::new(-0.0, 0.0)],
            contacts: vec![[0, 1]],
            forces: vec![0.25],
            minimizer: Numbers::new("fire", vec![0.0; 6]),
            ..Frame::default()
        };
        // b3sum of the bytes written down by hand from the documentation of `digest`.
        let mut bytes = vec![3, 0, 0, 0, 0, 0, 0, 0, 2, 0, 0, 0, 0, 0, 0, 0];
        let doubles: [u64; 8] = [
            0x3ff0_0000_0000_0000,
            0x4000_0000_0000_0000,
            0x4008_0000_0000_0000,
            0x4010_0000_0000_0000,
            0x3fe0_0000_0000_0000,
            0xbfe0_0000_0000_0000,
            0x8000_0000_0000_0000,
            0,
        ];
        bytes.extend(doubles.iter().flat_map(|d| d.to_le_bytes()));
        bytes.extend([1, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 1, 0, 0, 0]);
        bytes.extend(0x3fd0_0000_0000_0000_u64.to_le_bytes());
        bytes.extend([6, 0, 0, 0, 0, 0, 0, 0]);
        bytes.extend([0; 48]);
        assert_eq!(frame.digest(), *blake3::hash(&bytes).as_bytes());
    }
}
