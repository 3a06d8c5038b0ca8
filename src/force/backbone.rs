//! Rattlers and the backbone: which particles are held by their contacts.

use crate::contact::Contacts;

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

/// Counts rattlers frame after frame, and counts anew only when the contacts have changed.
///
/// ```
/// use softjam::{force::Backbone, relax::Relaxation, scene::Scene};
///
/// let mut run = Relaxation::new(&Scene { particles: 64, phi: 0.9, ..Scene::default() }).unwrap();
/// let mut backbone = Backbone::default();
/// for _ in 0..100 {
///     assert_eq!(run.observables_counted(&mut backbone), run.observables());
///     run.advance().unwrap();
/// }
/// assert!(backbone.counts() < 100);
/// ```
#[derive(Clone, Debug, Default)]
pub struct Backbone {
    particles: usize,
    /// The contacts of the last count, if all of them bore a force.
    pairs: Option<Vec<[u32; 2]>>,
    /// Rattlers, and contacts between the others.
    last: (usize, usize),
    counts: u64,
}

impl Backbone {
    /// The rattlers among `particles` with `contacts`, and the number of contacts that bear a force between the others; see
    /// [`backbone`].
    ///
    /// # Panics
    ///
    /// If a contact names a particle that is not there.
    ///
    /// See the example of [`Backbone`].
    pub fn count(&mut self, particles: usize, contacts: &Contacts<'_>) -> (usize, usize) {
        let all = contacts.forces.iter().all(|f| *f > 0.0);
        let same = particles == self.particles && self.pairs.as_deref() == Some(contacts.pairs);
        if all && same {
            return self.last;
        }
        self.last = if all {
            backbone(particles, contacts.pairs)
        } else {
            let touching = contacts.pairs.iter().zip(contacts.forces);
            let touching = touching.filter(|(_, f)| **f > 0.0).map(|(p, _)| *p);
            backbone(particles, &touching.collect::<Vec<_>>())
        };
        self.particles = particles;
        self.pairs = all.then(|| contacts.pairs.to_vec());
        self.counts += 1;
        self.last
    }

    /// How often it was counted so far: a count of work.
    ///
    /// See the example of [`Backbone`].
    #[must_use]
    pub fn counts(&self) -> u64 {
        self.counts
    }
}

/// The number of contacts of each particle with others that are held, and the number of contacts between such.
fn held_contacts(particles: usize, pairs: &[[u32; 2]]) -> (Vec<u32>, usize) {
    let mut contacts = vec![0u32; particles];
    for &[i, j] in pairs {
        contacts[i as usize] += 1;
        contacts[j as usize] += 1;
    }
    // Takes a contact away unless both of its particles have three. Whoever loses its third has contacts that were passed.
    let mut passed = false;
    let mut stays = |&[i, j]: &[u32; 2], passed: &mut bool| {
        let (i, j) = (i as usize, j as usize);
        let held = contacts[i] >= 3 && contacts[j] >= 3;
        if !held {
            for k in [i, j] {
                *passed |= contacts[k] == 3;
                contacts[k] -= 1;
            }
        }
        held
    };
    let all = pairs.iter().copied();
    let mut left: Vec<[u32; 2]> = all.filter(|pair| stays(pair, &mut passed)).collect();
    while core::mem::take(&mut passed) {
        left.retain(|pair| stays(pair, &mut passed));
    }
    (contacts, left.len())
}
