//! Rattlers and the backbone: which particles are held by their contacts.

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
    let (numbers, contacts) = held_contacts(particles, pairs.to_vec());
    (numbers.iter().filter(|n| **n == 0).count(), contacts)
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
    let (numbers, _) = held_contacts(particles, pairs.to_vec());
    numbers.iter().map(|n| *n > 0).collect()
}

/// The pairs that bear a force; `forces` has one for each.
pub(crate) fn bearing(pairs: &[[u32; 2]], forces: &[f64]) -> Vec<[u32; 2]> {
    let bearing = pairs.iter().zip(forces).filter(|(_, f)| **f > 0.0);
    bearing.map(|(pair, _)| *pair).collect()
}

/// The number of contacts of each particle with others that are held, 0 for a rattler, and the number of contacts between
/// held particles.
fn held_contacts(particles: usize, mut pairs: Vec<[u32; 2]>) -> (Vec<u32>, usize) {
    let mut numbers = vec![0_u32; particles];
    for p in pairs.as_flattened() {
        numbers[*p as usize] += 1;
    }
    // A particle that loses its third contact may have some that were passed already.
    while numbers.iter().any(|n| *n == 1 || *n == 2) {
        pairs.retain(|pair| {
            let [i, j] = pair.map(|p| p as usize);
            let stays = numbers[i] >= 3 && numbers[j] >= 3;
            if !stays {
                numbers[i] -= 1;
                numbers[j] -= 1;
            }
            stays
        });
    }
    (numbers, pairs.len())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// By the definition: particles are taken away one at a time.
    fn peeled(particles: u32, pairs: &[[u32; 2]]) -> (usize, usize) {
        let (mut left, mut there): (Vec<_>, Vec<_>) = (pairs.to_vec(), (0..particles).collect());
        let of = |left: &[[u32; 2]], p| left.iter().filter(|pair| pair.contains(&p)).count();
        while let Some(at) = there.iter().rposition(|p| of(&left, *p) < 3) {
            let gone = there.remove(at);
            left.retain(|pair| !pair.contains(&gone));
        }
        (particles as usize - there.len(), left.len())
    }

    #[test]
    fn rattlers_are_what_is_taken_away_one_at_a_time() {
        let mut bits = 1_u64;
        let mut random = |below: u32| {
            bits = bits.wrapping_mul(6_364_136_223_846_793_005);
            bits = bits.wrapping_add(1_442_695_040_888_963_407);
            ((bits >> 33) % u64::from(below)) as u32
        };
        let (mut rattling, mut holding) = (0, 0);
        for particles in [5, 12, 40] {
            for round in 0..300 {
                let mut pairs = Vec::new();
                for _ in 0..particles * (4 + round / 100) / 2 {
                    let (i, j) = (random(particles), random(particles));
                    if i != j {
                        pairs.push([i.min(j), i.max(j)]);
                    }
                }
                pairs.sort_unstable();
                pairs.dedup();
                let (rattlers, contacts) = backbone(particles as usize, &pairs);
                assert_eq!((rattlers, contacts), peeled(particles, &pairs));
                rattling += rattlers;
                holding += particles as usize - rattlers;
            }
        }
        assert!(rattling > 1000 && holding > 1000, "{rattling} {holding}");
    }

    #[test]
    fn contacts_without_a_force_hold_nobody() {
        let pairs = [[0, 1], [0, 2], [1, 2]];
        assert_eq!(bearing(&pairs, &[0.1, 0.0, -0.1]), [[0, 1]]);
    }
}
