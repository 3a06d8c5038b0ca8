//! The linearised problem: how the net forces answer to displacements when the forces follow the contact law.
//!
//! At fixed contacts, with `x_c = dr_i − dr_j`, normals `n`, tangents `t` (the normal turned by a quarter), distances
//! `r`, `dd_c = n·x_c` and `dφ_c = t·x_c / r_c`, the derivative of `A f = δ` is
//!
//! ```text
//! A df = −dd − M dφ                                       (M: see force::turning)
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

use crate::contact::matrix::ContactMatrix;
use crate::contact::solver::ConjugateGradient;
use crate::contact::{ContactLaw, Contacts};
use crate::domain::Vec2;
use crate::force::turning::Turning;
use crate::force::{Form, tangent};
use crate::packing::Packing;

/// The buffers of the products.
#[derive(Clone, Debug, Default)]
pub(super) struct Linear {
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
pub(super) struct At<'a> {
    buffers: &'a mut Linear,
    form: Form,
    contacts: Contacts<'a>,
    matrix: &'a ContactMatrix,
}

impl Linear {
    /// The problem at the contacts that `law` found last.
    pub(super) fn at<'a>(
        &'a mut self,
        form: Form,
        law: &'a ContactLaw,
        packing: &Packing,
    ) -> At<'a> {
        let contacts = law.contacts();
        self.turning
            .rebuild(&contacts, packing, law.line_tension());
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
    pub(super) fn forces(&mut self, x: &[f64], tolerance: f64) -> bool {
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
        b.turning
            .add_m(self.contacts.forces, &b.turn, &mut b.right);
        let mut largest: f64 = 0.0;
        for (r, d) in b.right.iter_mut().zip(&b.stretch) {
            *r = -(*r + d);
            largest = largest.max(r.abs());
        }
        b.change.clear();
        b.change.resize(b.right.len(), 0.0);
        b.solver
            .solve(self.matrix, &b.right, &mut b.change, tolerance * largest)
            .is_ok()
    }

    /// The `df` that [`forces`](Self::forces) found last.
    pub(super) fn change(&self) -> &[f64] {
        &self.buffers.change
    }

    /// `y = J x`, the contact problem in it solved as by [`forces`](Self::forces).
    pub(super) fn product(&mut self, x: &[f64], y: &mut [f64], tolerance: f64) -> bool {
        if !self.forces(x, tolerance) {
            return false;
        }
        let b = &mut *self.buffers;
        let (forces, distances) = (self.contacts.forces, self.contacts.distances);
        b.along.clear();
        b.along.extend_from_slice(&b.change);
        b.across.clear();
        b.across.extend(
            (forces.iter().zip(distances).zip(&b.turn)).map(|((f, r), turn)| f * r * turn),
        );
        if self.form == Form::Gradient {
            b.turning
                .add_m_transposed(forces, &b.change, &mut b.across);
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

    /// Takes `−A⁻¹ (A f − δ)`, by which the forces at hand miss the contact problem, into account: subtracts what it does to
    /// the net forces from `right` and puts it into `miss`. `false` if it cannot be had.
    pub(super) fn correct(&mut self, right: &mut [f64], miss: &mut Vec<f64>) -> bool {
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
        let solved = b.solver.solve(self.matrix, &b.right, miss, 1e-3 * largest);
        if solved.is_err() {
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
