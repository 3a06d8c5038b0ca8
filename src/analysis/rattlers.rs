//! Rattlers and the backbone: which particles are held by their contacts.

use crate::contacts::Contacts;
use crate::models::droplet::contact::ContactLaw;
use crate::numerics::wide::wide;

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
/// use softjam::analysis::backbone;
///
/// // Four particles that all touch each other, and a fifth that leans on two of them.
/// let pairs = [[0, 1], [0, 2], [0, 3], [1, 2], [1, 3], [2, 3], [2, 4], [3, 4]];
/// assert_eq!(backbone(5, &pairs), (1, 6));
/// ```
#[must_use]
pub fn backbone(particles: usize, pairs: &[[u32; 2]]) -> (usize, usize) {
    let (numbers, contacts) = held_contacts(numbers(particles, pairs), pairs);
    (numbers.iter().filter(|n| **n < 3).count(), contacts)
}

/// Which particles are held by their contacts, that is, which are no rattlers; see [`backbone`].
///
/// # Panics
///
/// If a pair names a particle that is not there.
///
/// ```
/// use softjam::analysis::held;
///
/// let pairs = [[0, 1], [0, 2], [0, 3], [1, 2], [1, 3], [2, 3], [2, 4], [3, 4]];
/// assert_eq!(held(5, &pairs), [true, true, true, true, false]);
/// ```
#[must_use]
pub fn held(particles: usize, pairs: &[[u32; 2]]) -> Vec<bool> {
    let (numbers, _) = held_contacts(numbers(particles, pairs), pairs);
    numbers.iter().map(|n| *n >= 3).collect()
}

/// Counts rattlers frame after frame, and counts anew only when contacts have come or gone that matter.
///
/// The particles that are held, and the contacts among them, are the largest set of contacts in which each particle has at
/// least three: it is a property of the contacts and not of the order in which others were taken away. It stays, but for the
/// contacts that come and go within it, as long as each of its particles keeps three and no contact comes that could belong to
/// a larger one: that would need three contacts of each of its particles.
///
/// ```
/// use softjam::{analysis::Backbone, protocol::Relaxation, scene::Scene};
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
    /// The contacts of the frame before that bore a force, where they are known by their pairs.
    pairs: Option<Vec<[u32; 2]>>,
    /// What a [`ContactLaw`] calls the set of them, where they are known by that.
    set: Option<u64>,
    /// Contacts of each particle.
    all: Vec<u32>,
    /// Contacts of each particle that is held with others that are; below 3 where it is not held.
    held: Vec<u32>,
    /// Contacts between particles that are held.
    contacts: usize,
    rattlers: usize,
    /// Contacts that came since the frame before, one of whose particles is not held.
    open: Vec<[u32; 2]>,
    room: Vec<[u32; 2]>,
    counts: u64,
}

impl Backbone {
    /// The rattlers among `particles` with `contacts`, and the number of contacts that bear a force between the others; see
    /// [`backbone`].
    ///
    /// # Panics
    ///
    /// If a contact names a particle that is not there.
    pub fn count(&mut self, particles: usize, contacts: &Contacts<'_>) -> (usize, usize) {
        let touching = contacts.forces.iter().filter(|f| **f > 0.0).count();
        self.count_touching(particles, contacts, touching)
    }

    /// [`count`](Self::count) of contacts of which `touching` bear a force.
    pub(super) fn count_touching(
        &mut self,
        particles: usize,
        contacts: &Contacts<'_>,
        touching: usize,
    ) -> (usize, usize) {
        self.count_bearing(particles, (contacts.pairs, contacts.forces), touching);
        (self.rattlers, self.contacts)
    }

    /// Goes on to pairs with these forces, of which `touching` are above 0.
    fn count_bearing(
        &mut self,
        particles: usize,
        (pairs, forces): (&[[u32; 2]], &[f64]),
        touching: usize,
    ) {
        self.set = None;
        if touching == pairs.len() {
            self.follow(particles, pairs);
        } else {
            let bearing = pairs.iter().zip(forces).filter(|(_, f)| **f > 0.0);
            let bearing: Vec<_> = bearing.map(|(pair, _)| *pair).collect();
            self.follow(particles, &bearing);
        }
    }

    /// Which of `particles` are held by contacts between `pairs` that bear `forces`; goes on from the frame before, as
    /// [`count`](Self::count) does.
    ///
    /// # Panics
    ///
    /// If a pair names a particle that is not there.
    pub fn held(&mut self, particles: usize, pairs: &[[u32; 2]], forces: &[f64]) -> Vec<bool> {
        let touching = forces.iter().filter(|f| **f > 0.0).count();
        self.count_bearing(particles, (pairs, forces), touching);
        self.held.iter().map(|n| *n >= 3).collect()
    }

    /// [`count`](Self::count) of the contacts of `law`, of which `touching` bear a force. Behind each of its solutions it is
    /// told only what has come and gone.
    pub(super) fn count_law(
        &mut self,
        particles: usize,
        law: &ContactLaw,
        touching: usize,
    ) -> (usize, usize) {
        let all_touch = touching == law.contact_count();
        let (before, after) = law.sets();
        if !all_touch
            || particles != self.all.len()
            || ![before, after].map(Some).contains(&self.set)
        {
            self.count_touching(particles, &law.contacts(), touching);
        } else if self.set != Some(after) {
            let mut stays = true;
            for &(pair, came) in law.changes() {
                stays &= self.change(pair, came);
            }
            if !(self.is_closed() && stays) {
                let numbered = law.numbered();
                let bearing = numbered.pairs.iter().zip(numbered.forces);
                let bearing = bearing.filter(|(_, f)| **f > 0.0).map(|(pair, _)| *pair);
                self.room.clear();
                self.room.extend(bearing);
                let pairs = core::mem::take(&mut self.room);
                self.count_anew(&pairs);
                self.room = pairs;
            }
            self.pairs = None;
        }
        self.set = all_touch.then_some(after);
        (self.rattlers, self.contacts)
    }

    /// Goes on to `pairs`.
    fn follow(&mut self, particles: usize, pairs: &[[u32; 2]]) {
        if particles == self.all.len()
            && let Some(old) = self.pairs.take()
        {
            let (mut stays, mut same) = (true, true);
            differences(&old, pairs, |pair, came| {
                same = false;
                stays &= self.change(pair, came);
            });
            if self.is_closed() && stays {
                let mut old = old;
                if !same {
                    old.clear();
                    old.extend_from_slice(pairs);
                }
                self.pairs = Some(old);
                return;
            }
        }
        self.all = numbers(particles, pairs);
        self.count_anew(pairs);
        self.pairs = Some(pairs.to_vec());
    }

    /// A contact has come, or is gone; says whether the particles that are held keep three contacts each.
    fn change(&mut self, pair: [u32; 2], came: bool) -> bool {
        let [i, j] = pair.map(|p| p as usize);
        let both = self.held[i] >= 3 && self.held[j] >= 3;
        let mut stays = true;
        for p in [i, j] {
            let change = |n: &mut u32| *n = if came { *n + 1 } else { n.saturating_sub(1) };
            change(&mut self.all[p]);
            if both {
                change(&mut self.held[p]);
                stays &= self.held[p] >= 3;
            }
        }
        match (both, came) {
            (true, true) => self.contacts += 1,
            (true, false) => self.contacts -= 1,
            (false, true) => self.open.push(pair),
            (false, false) => {}
        }
        stays
    }

    /// Whether none of the contacts that came could belong to a larger set that is held.
    fn is_closed(&mut self) -> bool {
        let (all, held) = (&self.all, &self.held);
        let weak = |p: u32| held[p as usize] < 3 && all[p as usize] < 3;
        let closed = self.open.iter().all(|&[i, j]| weak(i) || weak(j));
        self.open.clear();
        closed
    }

    /// Counts those of the contacts `pairs`, in any order, that are between particles that are held; `all` are counted.
    fn count_anew(&mut self, pairs: &[[u32; 2]]) {
        (self.held, self.contacts) = held_contacts(self.all.clone(), pairs);
        self.rattlers = self.held.iter().filter(|n| **n < 3).count();
        self.counts += 1;
        self.open.clear();
    }

    /// How often it was counted anew so far: a count of work.
    #[must_use]
    pub fn counts(&self) -> u64 {
        self.counts
    }
}

/// Tells `each` of the pairs that `old` has alone (`false`) and `new` has alone (`true`), both in ascending order.
fn differences(old: &[[u32; 2]], new: &[[u32; 2]], mut each: impl FnMut([u32; 2], bool)) {
    let (mut old, mut new) = (old, new);
    while !(old.is_empty() && new.is_empty()) {
        let same = common(old, new);
        (old, new) = (&old[same..], &new[same..]);
        match (old.split_first(), new.split_first()) {
            (_, Some((came, rest))) if old.first().is_none_or(|gone| came < gone) => {
                each(*came, true);
                new = rest;
            }
            (Some((gone, rest)), _) => {
                each(*gone, false);
                old = rest;
            }
            (None, _) => return,
        }
    }
}

/// How many pairs at the beginning of `a` and `b` are the same.
fn common(a: &[[u32; 2]], b: &[[u32; 2]]) -> usize {
    let (a16, b16) = (a.as_chunks::<16>().0, b.as_chunks::<16>().0);
    let mut start = 0;
    wide(
        #[inline(always)]
        || {
            for (a, b) in a16.iter().zip(b16) {
                let mut bits = 0;
                for k in 0..16 {
                    bits |= (a[k][0] ^ b[k][0]) | (a[k][1] ^ b[k][1]);
                }
                if bits != 0 {
                    break;
                }
                start += 16;
            }
        },
    );
    let rest = a[start..].iter().zip(&b[start..]);
    start + rest.take_while(|(a, b)| a == b).count()
}

/// The number of contacts of each particle.
fn numbers(particles: usize, pairs: &[[u32; 2]]) -> Vec<u32> {
    let mut numbers = vec![0; particles];
    for p in pairs.as_flattened() {
        numbers[*p as usize] += 1;
    }
    numbers
}

/// The number of contacts of each particle with others that are held, and the number of contacts between such; `contacts` are
/// those of each particle in `pairs`.
fn held_contacts(mut contacts: Vec<u32>, pairs: &[[u32; 2]]) -> (Vec<u32>, usize) {
    let (mut taken, mut left) = (vec![false; pairs.len()], pairs.len());
    loop {
        // Whoever loses its third contact has contacts that were passed.
        let mut passed = false;
        for (&[i, j], taken) in pairs.iter().zip(&mut taken) {
            let (i, j) = (i as usize, j as usize);
            if contacts[i] >= 3 && contacts[j] >= 3 || *taken {
                continue;
            }
            *taken = true;
            left -= 1;
            for k in [i, j] {
                passed |= contacts[k] == 3;
                contacts[k] -= 1;
            }
        }
        if !passed {
            return (contacts, left);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;

    /// Sparse and dense, so that contacts that matter and contacts that do not come and go.
    #[test]
    fn following_contacts_counts_what_counting_them_anew_does() {
        let mut bits = 1_u64;
        let mut random = |below: u32| {
            bits = bits.wrapping_mul(6_364_136_223_846_793_005);
            bits = bits.wrapping_add(1_442_695_040_888_963_407);
            ((bits >> 33) % u64::from(below)) as u32
        };
        let (mut anew, mut rattling, mut held) = (0, 0, 0);
        for particles in [5, 12, 40] {
            let mut backbone = Backbone::default();
            let mut pairs = BTreeSet::new();
            for step in 0..3000 {
                let most = 1 + particles * (1 + step / 1000);
                for _ in 0..random(3) {
                    let (i, j) = (random(particles), random(particles));
                    let pair = [i.min(j), i.max(j)];
                    if pairs.len() > most as usize || !(i != j && pairs.insert(pair)) {
                        pairs.remove(&pair);
                    }
                }
                if pairs.len() > most as usize {
                    pairs.pop_first();
                }
                let list: Vec<_> = pairs.iter().copied().collect();
                backbone.follow(particles as usize, &list);
                let (rattlers, contacts) = self::backbone(particles as usize, &list);
                assert_eq!((backbone.rattlers, backbone.contacts), (rattlers, contacts));
                rattling += rattlers;
                held += particles as usize - rattlers;
            }
            anew += backbone.counts();
        }
        assert!(anew < 3 * 3000 / 2, "{anew} counts");
        assert!(rattling > 10_000 && held > 10_000, "{rattling} {held}");
    }

    #[test]
    fn differences_are_what_one_list_has_alone() {
        let all: Vec<_> = (0..100).map(|k| [k / 7, k]).collect();
        let old: Vec<_> = all.iter().copied().filter(|p| p[1] % 17 != 3).collect();
        let new: Vec<_> = all.iter().copied().filter(|p| p[1] % 23 != 5).collect();
        let (mut gone, mut came) = (Vec::new(), Vec::new());
        differences(
            &old,
            &new,
            |[_, j], new| {
                if new { came.push(j) } else { gone.push(j) }
            },
        );
        assert_eq!(came, [3, 20, 37, 54, 71, 88]);
        assert_eq!(gone, [5, 28, 51, 74, 97]);
        differences(&new, &new, |_, _| panic!("the same"));
        differences(&[], &new[..2], |pair, came| assert!(came && pair[0] == 0));
        differences(&new[..2], &[], |pair, came| assert!(!came && pair[0] == 0));
    }
}
