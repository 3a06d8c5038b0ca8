//! The largest vibrational frequency of a packing, which bounds the time step.
//!
//! With the contacts held fixed and to first order in the displacements, the stiffness of a Morse–Witten packing is
//! `K = B A⁻¹ Bᵀ`: `Bᵀ` turns displacements into overlaps, `A⁻¹` overlaps into forces, `B` forces into net forces. The
//! mass is 1, so `ω_max² = λ_max(K)`. Beyond `dt = 2/ω_max` semi-implicit Euler is unstable; FIRE survives that, but at
//! several times the steps. Prestress, turning contacts and the torques of the gradient form are left out: at φ = 0.86, 0.95
//! and 1.1 the whole linear problem has 1.004, 0.99 and 0.97 times this `ω_max` with central and 1.003, 0.98 and 0.94 times
//! with gradient forces (N = 48, twenty iterations; a test of `linear.rs`).
//!
//! See the example of [`largest_frequency`].

use crate::contacts::net_forces;
use crate::domain::Vec2;
use crate::models::droplet::contact::{ContactError, ContactLaw};
use crate::numerics::folded;
use crate::state::Packing;
use core::f64::consts::PI;

/// An estimate of `ω_max` (1/time) from `iterations` power iterations at the contacts that `law` found last.
///
/// The start vector is fixed, so the estimate is a function of the packing. It approaches `ω_max` from below, to a few
/// per cent after 20 iterations. A packing with few contacts is given the frequency of a particle held by six of its
/// stiffest contacts on their own, since it may yet come to have them.
///
/// # Errors
///
/// [`ContactError`] if a linear system is not solved.
///
/// # Example
///
/// ```
/// use softjam::{models::droplet::contact::ContactLaw, models::droplet::frequency::largest_frequency, protocol::Relaxation, scene::Scene};
///
/// let run = Relaxation::new(&Scene { particles: 64, phi: 0.9, ..Scene::default() }).unwrap();
/// let mut law = ContactLaw::default();
/// law.solve(run.packing(), &[], &[]).unwrap();
/// let omega = largest_frequency(run.packing(), &mut law, 20).unwrap();
/// assert!((4.0..12.0).contains(&omega), "ω_max = {omega}");
/// ```
pub fn largest_frequency(
    packing: &Packing,
    law: &mut ContactLaw,
    iterations: usize,
) -> Result<f64, ContactError> {
    let least = packing.smallest_radius();
    // A contact alone has k = 4πγ/3(R_i + R_j); six of them around a particle give it K = 3k.
    let floor = 3.0 * 4.0 * PI * law.line_tension() / (3.0 * 2.0 * least);
    let contacts = law.contacts();
    let (pairs, normals) = (contacts.pairs.to_vec(), contacts.normals.to_vec());
    let distances = contacts.distances.to_vec();
    let mut u: Vec<Vec2> = (0..packing.len())
        .map(|p| Vec2::new(folded(2 * p + 1), folded(2 * p + 2)))
        .collect();
    let mut image = vec![Vec2::zeros(); packing.len()];
    let mut forces = vec![0.0; pairs.len()];
    let mut largest: f64 = 0.0;
    for _ in 0..iterations {
        let norm = u.iter().map(Vec2::norm_squared).sum::<f64>().sqrt();
        if norm == 0.0 || pairs.is_empty() {
            break;
        }
        for v in &mut u {
            *v /= norm;
        }
        // Bᵀu: how fast each overlap grows.
        let overlaps: Vec<f64> = pairs
            .iter()
            .zip(&normals)
            .map(|(&[i, j], n)| -n.dot(&(u[i as usize] - u[j as usize])))
            .collect();
        let scale = overlaps.iter().fold(0.0, |m: f64, d| m.max(d.abs()));
        law.solve_linear(&overlaps, &mut forces, 1e-4 * scale)?;
        net_forces(
            &crate::contacts::Contacts {
                pairs: &pairs,
                normals: &normals,
                distances: &distances,
                overlaps: &overlaps,
                forces: &forces,
            },
            &mut image,
        );
        // K is positive: the restoring force is −K u.
        let rayleigh: f64 = -u.iter().zip(&image).map(|(a, b)| a.dot(b)).sum::<f64>();
        largest = largest.max(rayleigh);
        core::mem::swap(&mut u, &mut image);
    }
    Ok(largest.max(floor).sqrt())
}
