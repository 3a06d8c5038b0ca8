//! The linearised problem: how the net forces answer to displacements when the forces follow the contact law.
//!
//! At fixed contacts, with `x_c = dr_i − dr_j`, normals `n`, tangents `t` (the normal turned by a quarter), distances
//! `r`, `dd_c = n·x_c` and `dφ_c = t·x_c / r_c`, the derivative of `A f = δ` is
//!
//! ```text
//! A df = −dd − M dφ                                       (M: see turning.rs)
//! ```
//!
//! and that of the net forces `F = B f` of the central form, `F = B f + Tᵀ τ` of the gradient form,
//!
//! ```text
//! J dr = B df + Tᵀ (f r dφ)                                                                 central
//!      + Tᵀ (Mᵀ df + S dφ − τ dd/r) − B (τ dφ/r)                                            gradient
//! ```
//!
//! where `B` puts `n_c` and `Tᵀ` puts `t_c/r_c` on `i`, their opposites on `j`. The second term is the prestress. For
//! the gradient form `−J` is the Hessian of the energy, symmetric; for the central form it departs from symmetry by
//! O(f).

use crate::contacts::Contacts;
use crate::domain::Vec2;
use crate::models::droplet::contact::ContactLaw;
use crate::models::droplet::contact::matrix::ContactMatrix;
use crate::models::droplet::contact::solver::ConjugateGradient;
use crate::models::droplet::turning::Turning;
use crate::models::droplet::{Form, tangent};
use crate::state::Packing;

/// A linearised problem: how net forces answer to displacements, two numbers a particle, when all else follows.
pub(crate) trait Linearised {
    /// Subtracts from `right` what the net forces change by when what follows is put right where it is, and puts that correction into `miss`;
    /// `false` if it cannot be had.
    fn correct(&mut self, right: &mut [f64], miss: &mut Vec<f64>) -> bool;

    /// `y = J x`, right to `accuracy` (relative); `false` if it cannot be had.
    fn product(&mut self, x: &[f64], y: &mut [f64], accuracy: f64) -> bool;

    /// By how much what follows changes with displacements `x`, right to `accuracy` (relative); `false` if it cannot be had.
    fn follow(&mut self, x: &[f64], accuracy: f64) -> bool;

    /// What [`follow`](Self::follow) found last.
    fn change(&self) -> &[f64];
}

/// The buffers of the products.
#[derive(Clone, Debug, Default)]
pub(crate) struct Linear {
    turning: Turning,
    torques: Vec<f64>,
    /// `dd`, `dφ`, the right-hand side and `df`, one entry a contact.
    stretch: Vec<f64>,
    turn: Vec<f64>,
    right: Vec<f64>,
    change: Vec<f64>,
    /// What acts along the normals and along the tangents.
    along: Vec<f64>,
    across: Vec<f64>,
    solver: ConjugateGradient,
}

/// The linearised problem at one frame.
pub(crate) struct At<'a> {
    buffers: &'a mut Linear,
    form: Form,
    contacts: Contacts<'a>,
    matrix: &'a ContactMatrix,
}

impl Linear {
    /// The problem at the contacts that `law` found last.
    pub(crate) fn at<'a>(
        &'a mut self,
        form: Form,
        law: &'a ContactLaw,
        packing: &Packing,
    ) -> At<'a> {
        let contacts = law.contacts();
        self.turning.rebuild(&contacts, packing, law.line_tension());
        self.turning.torques(contacts.forces, &mut self.torques);
        At {
            buffers: self,
            form,
            contacts,
            matrix: law.matrix(),
        }
    }
}

impl At<'_> {
    /// `df` of the displacements `x` (two a particle), with `A df` right to `tolerance` times its largest entry; `false`
    /// if that cannot be had.
    fn forces(&mut self, x: &[f64], tolerance: f64) -> bool {
        let b = &mut *self.buffers;
        b.stretch.clear();
        b.turn.clear();
        for (c, &[i, j]) in self.contacts.pairs.iter().enumerate() {
            let (i, j) = (2 * i as usize, 2 * j as usize);
            let x = Vec2::new(x[i] - x[j], x[i + 1] - x[j + 1]);
            let n = self.contacts.normals[c];
            b.stretch.push(n.dot(&x));
            b.turn.push(tangent(n).dot(&x) / self.contacts.distances[c]);
        }
        b.right.clear();
        b.right.resize(b.stretch.len(), 0.0);
        b.turning.add_m(self.contacts.forces, &b.turn, &mut b.right);
        let mut largest: f64 = 0.0;
        for (r, d) in b.right.iter_mut().zip(&b.stretch) {
            *r = -(*r + d);
            largest = largest.max(r.abs());
        }
        b.change.clear();
        b.change.resize(b.right.len(), 0.0);
        solve(
            &mut b.solver,
            self.matrix,
            (&b.right, &mut b.change),
            tolerance,
            largest,
        )
    }

    /// Adds `sign` times what acts along the normals and across them to the particles.
    fn add_forces(&self, sign: f64, y: &mut [f64]) {
        let b = &*self.buffers;
        for (c, &[i, j]) in self.contacts.pairs.iter().enumerate() {
            let (i, j) = (2 * i as usize, 2 * j as usize);
            let n = self.contacts.normals[c];
            let f = n * b.along[c] + tangent(n) * (b.across[c] / self.contacts.distances[c]);
            let f = f * sign;
            y[i] += f.x;
            y[i + 1] += f.y;
            y[j] -= f.x;
            y[j + 1] -= f.y;
        }
    }
}

impl Linearised for At<'_> {
    fn product(&mut self, x: &[f64], y: &mut [f64], tolerance: f64) -> bool {
        if !self.forces(x, tolerance) {
            return false;
        }
        let b = &mut *self.buffers;
        let (forces, distances) = (self.contacts.forces, self.contacts.distances);
        b.along.clear();
        b.along.extend_from_slice(&b.change);
        b.across.clear();
        b.across
            .extend((forces.iter().zip(distances).zip(&b.turn)).map(|((f, r), turn)| f * r * turn));
        if self.form == Form::Gradient {
            b.turning.add_m_transposed(forces, &b.change, &mut b.across);
            b.turning.add_s(forces, &b.turn, &mut b.across);
            for (c, torque) in b.torques.iter().enumerate() {
                let per_length = torque / distances[c];
                b.across[c] -= per_length * b.stretch[c];
                b.along[c] -= per_length * b.turn[c];
            }
        }
        y.fill(0.0);
        self.add_forces(1.0, y);
        true
    }

    /// What follows is forces: those at hand miss the contact problem by `−A⁻¹ (A f − δ)`.
    fn correct(&mut self, right: &mut [f64], miss: &mut Vec<f64>) -> bool {
        let b = &mut *self.buffers;
        let forces = self.contacts.forces;
        b.right.clear();
        b.right.resize(forces.len(), 0.0);
        self.matrix.multiply(forces, &mut b.right);
        let mut largest: f64 = 0.0;
        for (r, d) in b.right.iter_mut().zip(self.contacts.overlaps) {
            *r = d - *r;
            largest = largest.max(r.abs());
        }
        miss.clear();
        miss.resize(forces.len(), 0.0);
        if !solve(&mut b.solver, self.matrix, (&b.right, miss), 1e-3, largest) {
            return false;
        }
        b.along.clear();
        b.along.extend_from_slice(miss);
        b.across.clear();
        b.across.resize(forces.len(), 0.0);
        if self.form == Form::Gradient {
            b.turning.add_m_transposed(forces, miss, &mut b.across);
        }
        self.add_forces(-1.0, right);
        true
    }

    fn follow(&mut self, x: &[f64], accuracy: f64) -> bool {
        self.forces(x, accuracy)
    }

    fn change(&self) -> &[f64] {
        &self.buffers.change
    }
}

/// `A x = b` from the guess in `x`, right to `tolerance` times the `largest` entry of `b`; `false` if that cannot be had.
fn solve(
    solver: &mut ConjugateGradient,
    matrix: &ContactMatrix,
    (b, x): (&[f64], &mut [f64]),
    tolerance: f64,
    largest: f64,
) -> bool {
    let solved = if tolerance >= FAR_ABOVE_ROUND_OFF {
        solver.solve_loosely(matrix, b, x, tolerance * largest)
    } else {
        solver.solve(matrix, b, x, tolerance * largest)
    };
    solved.is_ok()
}

/// A tolerance at which the residual need not be computed anew from the solution.
const FAR_ABOVE_ROUND_OFF: f64 = 1e-9;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::models::droplet::NetForces;
    use crate::models::droplet::frequency::largest_frequency;
    use crate::protocol::Relaxation;
    use crate::scene::Scene;

    /// A packing that is not in balance, with its contacts.
    fn packing(phi: f64) -> (Packing, ContactLaw) {
        let scene = Scene {
            particles: 48,
            phi,
            contact_tolerance: 1e-14,
            ..Scene::default()
        };
        let packing = Relaxation::new(&scene).unwrap().packing().clone();
        let mut law = scene.contact_law();
        law.solve(&packing, &[], &[]).unwrap();
        (packing, law)
    }

    fn net(law: &ContactLaw, packing: &Packing, form: Form) -> Vec<f64> {
        let mut net = vec![Vec2::zeros(); packing.len()];
        NetForces::new(form).evaluate(&law.contacts(), packing, 1.0, &mut net);
        net.iter().flat_map(|f| [f.x, f.y]).collect()
    }

    /// Displacements of length 1 at most, with a part of every mode.
    fn displacements(particles: usize, salt: f64) -> Vec<f64> {
        (0..2 * particles)
            .map(|k| libm::sin(salt * (k + 1) as f64))
            .collect()
    }

    #[test]
    fn products_are_the_derivative_of_the_net_forces() {
        for form in [Form::Central, Form::Gradient] {
            for phi in [0.88, 1.0] {
                let (packing, law) = packing(phi);
                let x = displacements(packing.len(), 0.7);
                let mut product = vec![0.0; x.len()];
                assert!(Linear::default().at(form, &law, &packing).product(
                    &x,
                    &mut product,
                    1e-13
                ));
                let moved = |h: f64| {
                    let mut moved = packing.clone();
                    let shifts = x.as_chunks::<2>().0;
                    for (p, s) in moved.positions_mut().iter_mut().zip(shifts) {
                        *p = packing.domain().wrap(*p + Vec2::new(s[0], s[1]) * h);
                    }
                    let mut there = law.clone();
                    there.solve_again(&moved).unwrap();
                    assert_eq!(there.contacts().pairs, law.contacts().pairs, "h = {h}");
                    net(&there, &moved, form)
                };
                // Five points: the error is O(h⁴).
                let h = 1e-5;
                let samples = [moved(-2.0 * h), moved(-h), moved(h), moved(2.0 * h)];
                let largest = product.iter().fold(0.0, |m: f64, y| m.max(y.abs()));
                for (k, y) in product.iter().enumerate() {
                    let centred = (samples[0][k] - samples[3][k]
                        + 8.0 * (samples[2][k] - samples[1][k]))
                        / (12.0 * h);
                    assert!(
                        (centred - y).abs() < 1e-7 * largest,
                        "{form:?}, φ = {phi}, component {k}: {y} against {centred}"
                    );
                }
            }
        }
    }

    #[test]
    fn linear_problem_is_symmetric_with_the_gradient_form_only() {
        let (packing, law) = packing(0.95);
        let (x, y) = (displacements(48, 0.7), displacements(48, 1.3));
        let asymmetry = |form| {
            let mut linear = Linear::default();
            let mut at = linear.at(form, &law, &packing);
            let (mut jx, mut jy) = (vec![0.0; 96], vec![0.0; 96]);
            assert!(at.product(&x, &mut jx, 1e-13) && at.product(&y, &mut jy, 1e-13));
            let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
            (dot(&y, &jx) - dot(&x, &jy)).abs() / dot(&x, &jx).abs()
        };
        assert!(asymmetry(Form::Gradient) < 1e-11);
        assert!(asymmetry(Form::Central) > 1e-4);
    }

    /// `ω_max` of the whole linear problem, by its own power iteration.
    fn true_frequency(law: &ContactLaw, packing: &Packing, form: Form) -> f64 {
        let mut linear = Linear::default();
        let mut at = linear.at(form, law, packing);
        let mut x = displacements(packing.len(), 0.7);
        let mut y = vec![0.0; x.len()];
        let mut eigenvalue = 0.0;
        for _ in 0..200 {
            let norm = x.iter().map(|v| v * v).sum::<f64>().sqrt();
            for v in &mut x {
                *v /= norm;
            }
            assert!(at.product(&x, &mut y, 1e-8));
            eigenvalue = -x.iter().zip(&y).map(|(a, b)| a * b).sum::<f64>();
            core::mem::swap(&mut x, &mut y);
        }
        eigenvalue.sqrt()
    }

    #[test]
    fn estimate_of_the_largest_frequency_holds_for_both_forms() {
        for form in [Form::Central, Form::Gradient] {
            for phi in [0.86, 0.95, 1.1] {
                let (packing, mut law) = packing(phi);
                let whole = true_frequency(&law, &packing, form);
                let estimate = largest_frequency(&packing, &mut law, 20).unwrap();
                // dt_max ω_max = 1 by the estimate; 2 is the limit of stability.
                assert!(
                    whole < 1.25 * estimate,
                    "{form:?}, φ = {phi}: ω_max = {whole}, estimated as {estimate}"
                );
            }
        }
    }
}
