//! Net forces and what is read off them: balance, energy, pressure, stress, coordination.
//!
//! Central form, Saitoh 2.2.3: `F_i = Σ_j f_ij n_ij`. It is not the gradient of the energy below (the two differ by
//! O(f²)), so nothing here is used to search for a minimum.

use crate::contact::Contacts;
use crate::domain::{Domain, Vec2};

/// The recorded metrics by name; a recording has one scalar each under `/metrics/`.
///
/// `log10_f_max` is there because the viewer has no logarithmic axis; below 1e-18 it stays at −18.
///
/// ```
/// assert_eq!(softjam::force::METRICS.len(), 9);
/// ```
pub const METRICS: [&str; 9] = [
    "f_max",
    "log10_f_max",
    "energy",
    "pressure",
    "coordination",
    "contacts",
    "rattlers",
    "dt",
    "stress_xy",
];

/// The values of [`METRICS`].
pub type Metrics = [f64; METRICS.len()];

/// Net forces of the contacts on each particle, `F_i = Σ_j f_ij n_ij` (force), summed in the order of the contact list.
///
/// # Panics
///
/// If a contact names a particle beyond `net`.
///
/// # Example
///
/// ```
/// use softjam::contact::Contacts;
/// use softjam::domain::Vec2;
/// use softjam::force::net_forces;
///
/// let contacts = Contacts {
///     pairs: &[[0, 1]],
///     normals: &[Vec2::new(-1.0, 0.0)],
///     distances: &[0.9],
///     overlaps: &[0.1],
///     forces: &[0.4],
/// };
/// let mut net = vec![Vec2::zeros(); 2];
/// net_forces(&contacts, &mut net);
/// assert_eq!(net, [Vec2::new(-0.4, 0.0), Vec2::new(0.4, 0.0)]);
/// ```
pub fn net_forces(contacts: &Contacts<'_>, net: &mut [Vec2]) {
    net.fill(Vec2::zeros());
    for ((&[i, j], n), &f) in contacts
        .pairs
        .iter()
        .zip(contacts.normals)
        .zip(contacts.forces)
    {
        let force = n * f;
        net[i as usize] += force;
        net[j as usize] -= force;
    }
}

/// `f_max`, the largest magnitude of a net force (force): the seed's measure of equilibrium, Saitoh 2.4.
///
/// # Example
///
/// ```
/// use softjam::{domain::Vec2, force::largest_force};
/// assert_eq!(largest_force(&[Vec2::new(3.0, 4.0), Vec2::new(1.0, 0.0)]), 5.0);
/// ```
#[must_use]
pub fn largest_force(net: &[Vec2]) -> f64 {
    let (net4, rest) = net.as_chunks::<4>();
    // A NaN must not hide behind a comparison.
    let larger = |m: f64, s: f64| if s <= m { m } else { s };
    let mut most = [0.0; 4];
    for f in net4 {
        for k in 0..4 {
            most[k] = larger(most[k], f[k].norm_squared());
        }
    }
    let squared = most.into_iter().fold(0.0, larger);
    let squared = rest.iter().map(Vec2::norm_squared).fold(squared, larger);
    squared.sqrt()
}

/// What a frame is worth in numbers, all in units of the line tension γ: they do not depend on its value.
///
/// # Example
///
/// ```
/// use softjam::{relax::Relaxation, scene::Scene};
///
/// let relaxation = Relaxation::new(&Scene { particles: 64, phi: 0.9, ..Scene::default() }).unwrap();
/// let o = relaxation.observables();
/// assert!(o.coordination() > 4.0);
/// assert!((o.pressure() + 0.5 * (o.stress[0] + o.stress[2])).abs() < 1e-15);
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Observables {
    /// Number of particles `N`.
    pub particles: usize,
    /// Largest net force `f_max` (units of γ).
    pub f_max: f64,
    /// Stored energy of the contact problem `U = ½ Σ_c δ_c f_c` (γ·length).
    pub energy: f64,
    /// Stress `(σ_xx, σ_xy, σ_yy)`, tension positive: `σ_αβ = −(1/V) Σ_c f_c r_c n_α n_β` (γ/length).
    pub stress: [f64; 3],
    /// Number of contacts with `f > 0`.
    pub contacts: usize,
    /// Number of contacts among the particles that are held.
    pub backbone_contacts: usize,
    /// Number of rattlers: particles with fewer than three contacts with `f > 0`, not counting contacts with rattlers.
    ///
    /// Without friction two contacts hold a particle only if they face each other exactly. Until the last digit is
    /// relaxed a rattler rests on a neighbour with some force below `f_max`; counting contacts alone would miss it.
    pub rattlers: usize,
    /// The minimiser's time step.
    pub dt: f64,
}

impl Observables {
    /// Observables of contacts in `domain` at line tension γ (force), with `f_max` in units of γ and the time step `dt`.
    ///
    /// # Panics
    ///
    /// If a contact names a particle of index ≥ `particles`.
    ///
    /// ```
    /// use softjam::{contact::Contacts, domain::{Domain, Vec2}, force::Observables};
    ///
    /// let contacts = Contacts {
    ///     pairs: &[[0, 1]],
    ///     normals: &[Vec2::new(-1.0, 0.0)],
    ///     distances: &[0.9],
    ///     overlaps: &[0.1],
    ///     forces: &[0.4],
    /// };
    /// let o = Observables::of(&contacts, Domain::new(6.0, 6.0).unwrap(), 3, 1.0, (0.4, 0.1));
    /// assert_eq!((o.contacts, o.rattlers, o.coordination()), (1, 3, 0.0), "one contact holds nobody");
    /// assert_eq!(o.energy, 0.5 * 0.1 * 0.4);
    /// assert!((o.pressure() - 0.4 * 0.9 / 72.0).abs() < 1e-16);
    /// ```
    #[must_use]
    pub fn of(
        contacts: &Contacts<'_>,
        domain: Domain,
        particles: usize,
        line_tension: f64,
        (f_max, dt): (f64, f64),
    ) -> Self {
        let mut o = Self {
            particles,
            f_max,
            dt,
            ..Self::default()
        };
        for (c, &f) in contacts.forces.iter().enumerate() {
            let n = contacts.normals[c];
            let moment = f * contacts.distances[c];
            o.energy += 0.5 * contacts.overlaps[c] * f;
            o.stress[0] -= moment * n.x * n.x;
            o.stress[1] -= moment * n.x * n.y;
            o.stress[2] -= moment * n.y * n.y;
            o.contacts += usize::from(f > 0.0);
        }
        o.energy /= line_tension;
        for s in &mut o.stress {
            *s /= domain.area() * line_tension;
        }
        let touching = contacts.pairs.iter().zip(contacts.forces);
        let touching: Vec<[u32; 2]> = touching
            .filter(|(_, f)| **f > 0.0)
            .map(|(p, _)| *p)
            .collect();
        (o.rattlers, o.backbone_contacts) = backbone(particles, &touching);
        o
    }

    /// The metrics as they are recorded, in the order of [`METRICS`].
    ///
    /// ```
    /// # use softjam::force::{METRICS, Observables};
    /// let metrics = Observables { f_max: 0.01, ..Observables::default() }.metrics();
    /// assert_eq!(METRICS[..2], ["f_max", "log10_f_max"]);
    /// assert_eq!(metrics[..2], [0.01, -2.0]);
    /// ```
    #[must_use]
    pub fn metrics(&self) -> Metrics {
        [
            self.f_max,
            libm::log10(self.f_max.max(1e-18)),
            self.energy,
            self.pressure(),
            self.coordination(),
            self.contacts as f64,
            self.rattlers as f64,
            self.dt,
            self.stress[1],
        ]
    }

    /// Pressure `p = −tr σ/2 = (1/2V) Σ_c f_c r_c` (γ/length).
    ///
    /// ```
    /// # use softjam::force::Observables;
    /// let o = Observables { stress: [-0.2, 0.0, -0.4], ..Observables::default() };
    /// assert!((o.pressure() - 0.3).abs() < 1e-15);
    /// ```
    #[must_use]
    pub fn pressure(&self) -> f64 {
        // Adding 0 makes the pressure of no contacts 0 and not −0.
        -0.5 * (self.stress[0] + self.stress[2]) + 0.0
    }

    /// Mean coordination number of the particles that are held, `Z = 2 N_c / (N − N_rattlers)`, `N_c` the contacts
    /// among them; 0 when all rattle.
    ///
    /// ```
    /// # use softjam::force::Observables;
    /// let o = Observables { particles: 10, rattlers: 2, backbone_contacts: 16, ..Observables::default() };
    /// assert_eq!(o.coordination(), 4.0);
    /// ```
    #[must_use]
    pub fn coordination(&self) -> f64 {
        mean_coordination(self.backbone_contacts, self.particles - self.rattlers)
    }
}

/// `Z = 2 N_c / N` of `held` particles with `contacts` among them; 0 where there is none.
pub(crate) fn mean_coordination(contacts: usize, held: usize) -> f64 {
    if held == 0 {
        0.0
    } else {
        2.0 * contacts as f64 / held as f64
    }
}

/// Rattlers, and the contacts left among the other particles: particles with fewer than three contacts are taken away
/// with their contacts, until none is left or each has three.
///
/// `pairs` are the contacts that bear a force, among particles `0..particles`.
///
/// # Panics
///
/// If a pair names a particle that is not there.
///
/// # Example
///
/// ```
/// use softjam::force::backbone;
///
/// // Four particles that all touch each other, and a fifth that leans on two of them.
/// let pairs = [[0, 1], [0, 2], [0, 3], [1, 2], [1, 3], [2, 3], [2, 4], [3, 4]];
/// assert_eq!(backbone(5, &pairs), (1, 6));
/// ```
#[must_use]
pub fn backbone(particles: usize, pairs: &[[u32; 2]]) -> (usize, usize) {
    let (numbers, contacts) = held_contacts(particles, pairs);
    (numbers.iter().filter(|n| **n < 3).count(), contacts)
}

/// Which particles are held by their contacts, that is, which are no rattlers; see [`backbone`].
///
/// # Panics
///
/// If a pair names a particle that is not there.
///
/// ```
/// use softjam::force::held;
///
/// let pairs = [[0, 1], [0, 2], [0, 3], [1, 2], [1, 3], [2, 3], [2, 4], [3, 4]];
/// assert_eq!(held(5, &pairs), [true, true, true, true, false]);
/// ```
#[must_use]
pub fn held(particles: usize, pairs: &[[u32; 2]]) -> Vec<bool> {
    let (numbers, _) = held_contacts(particles, pairs);
    numbers.iter().map(|n| *n >= 3).collect()
}

/// The number of contacts of each particle with others that are held, and the number of contacts between such.
fn held_contacts(particles: usize, pairs: &[[u32; 2]]) -> (Vec<u32>, usize) {
    let mut contacts = vec![0u32; particles];
    for p in pairs.iter().flatten() {
        contacts[*p as usize] += 1;
    }
    let mut left: Vec<[u32; 2]> = pairs.to_vec();
    loop {
        let before = left.len();
        left.retain(|&[i, j]| {
            let (i, j) = (i as usize, j as usize);
            let held = contacts[i] >= 3 && contacts[j] >= 3;
            if !held {
                contacts[i] -= 1;
                contacts[j] -= 1;
            }
            held
        });
        if left.len() == before {
            return (contacts, left.len());
        }
    }
}
