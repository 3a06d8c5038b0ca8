//! Minimum or saddle, by all eigenvalues of a dense matrix.
//!
//! The stiffness `K`, the negative derivative of the net forces by the positions with the contact problem solved inside, is
//! put together from its formulas as full matrices. With `x_c = u_i − u_j`, the unit vector `n` from j to i, `t` a quarter turn
//! ahead of it and `l` the distance, the rows of `N` are `n·x_c`, those of `P` `t·x_c/l`; with `G = ∂A/∂φ`, `Γ = ∂²A/∂φ²`,
//! `M` and `S` what turning does to `A f` and to the torques `τ = f (G f)`, and `L = N + M P`:
//!
//! ```text
//! central   K = Nᵀ A⁻¹ L − Pᵀ (f l) P
//! gradient  K = Lᵀ A⁻¹ L − Pᵀ S P − Pᵀ (f l) P + Nᵀ (τ/l) P + Pᵀ (τ/l) N
//! ```
//!
//! Nothing is shared with the crate: own kernel, `std`'s mathematics, no preconditioner, no iteration but the eigenvalues'.

use super::verify::{Answer, g, slope};
use faer::{Mat, Side};
use softjam::analysis::Stability;
use softjam::analysis::held;
use softjam::models::droplet::Form;
use softjam::protocol::Relaxation;
use std::f64::consts::PI;

/// What the eigenvalues of `K` say.
#[derive(Clone, Copy, Debug)]
pub struct Spectrum {
    /// The lowest real part that is not zero (force per length, γ = 1).
    pub lowest: f64,
    /// Eigenvalues with a negative real part.
    pub negative: usize,
}

/// Real parts below this multiple of the largest are zero.
const ZERO: f64 = 1e-9;

/// The second derivative of the kernel, even; no two contacts of a particle lie at its cusp, θ = 0.
fn curvature(theta: f64) -> f64 {
    let t = theta.rem_euclid(2.0 * PI);
    -(PI - t) * t.sin() - 1.5 * t.cos()
}

impl Spectrum {
    /// Of a run in balance. Contacts of rattlers that bear no more than ten times `f_max` are left out.
    pub fn of_run(run: &Relaxation, form: Form) -> Self {
        let contacts = run.contacts();
        let held = held(run.packing().len(), contacts.pairs);
        let kept = |c: &usize| {
            let [i, j] = contacts.pairs[*c];
            (held[i as usize] && held[j as usize]) || contacts.forces[*c] > 10.0 * run.f_max()
        };
        let kept: Vec<usize> = (0..contacts.pairs.len()).filter(kept).collect();
        let l = run.packing().domain().lengths();
        let positions = run.packing().positions().iter();
        Self::of(&Answer {
            sides: [l.x, l.y],
            radii: run.packing().radii(),
            centres: &positions.map(|x| [x.x, x.y]).collect::<Vec<_>>(),
            pairs: &kept.iter().map(|&c| contacts.pairs[c]).collect::<Vec<_>>(),
            forces: &kept.iter().map(|&c| contacts.forces[c]).collect::<Vec<_>>(),
            line_tension: run.law().unwrap().line_tension(),
            gradient: form == Form::Gradient,
        })
    }

    /// Whether it bears out what a run says of its end.
    pub fn bears_out(&self, run: &Relaxation) -> bool {
        let most = run
            .contacts()
            .forces
            .iter()
            .fold(0.0, |m: f64, f| m.max(*f));
        let most = most / run.law().unwrap().line_tension();
        match run.stability() {
            Some(Stability::Minimum) => self.negative == 0,
            Some(Stability::Saddle) => self.negative > 0,
            // What the parts of a packing that has come apart still press on each other with, at thresholds of 1e-10; and a little more.
            Some(Stability::NotJammed) => most <= 10.0 * run.f_max(),
            Some(Stability::NotJudged) => most <= 1e4 * run.f_max() || self.lowest.abs() < 1e-4,
            None => false,
        }
    }

    /// Of the contacts and forces of `answer`, all of which are taken to matter.
    pub fn of(answer: &Answer<'_>) -> Self {
        let (n, m) = (2 * answer.radii.len(), answer.pairs.len());
        let gamma = answer.line_tension;
        let f = |c: usize| answer.forces[c] / gamma;
        let zeros = |rows, columns| Mat::<f64>::zeros(rows, columns);
        let (mut stretch, mut turn) = (zeros(m, n), zeros(m, n));
        let mut length = vec![0.0; m];
        // The contacts of each particle, with the angle of their directions there.
        let mut around = vec![Vec::new(); answer.radii.len()];
        for (c, &[i, j]) in answer.pairs.iter().enumerate() {
            let (i, j) = (i as usize, j as usize);
            let d = answer.nearest(i, j);
            let l = d[0].hypot(d[1]);
            let unit = [d[0] / l, d[1] / l];
            let ahead = [-unit[1], unit[0]];
            for k in 0..2 {
                stretch[(c, 2 * i + k)] = unit[k];
                stretch[(c, 2 * j + k)] = -unit[k];
                turn[(c, 2 * i + k)] = ahead[k] / l;
                turn[(c, 2 * j + k)] = -ahead[k] / l;
            }
            length[c] = l;
            around[i].push((c, (-d[1]).atan2(-d[0])));
            around[j].push((c, d[1].atan2(d[0])));
        }
        let (mut a, mut big_m, mut s) = (zeros(m, m), zeros(m, m), zeros(m, m));
        let mut torque = vec![0.0; m];
        for (p, contacts) in around.iter().enumerate() {
            let scale = -answer.radii[p] / (2.0 * PI);
            for &(c, here) in contacts {
                for &(d, there) in contacts {
                    a[(c, d)] += scale * g(here - there);
                    if c == d {
                        continue;
                    }
                    let (big_g, gamma) =
                        (scale * slope(here - there), scale * curvature(here - there));
                    big_m[(c, c)] += big_g * f(d);
                    big_m[(c, d)] -= big_g * f(d);
                    s[(c, c)] += f(c) * gamma * f(d);
                    s[(c, d)] -= f(c) * gamma * f(d);
                    torque[c] += f(c) * big_g * f(d);
                }
            }
        }
        let l = &stretch + &big_m * &turn;
        let response = faer::linalg::solvers::Solve::solve(&a.partial_piv_lu(), &l);
        let weighted = |w: &dyn Fn(usize) -> f64, rows: &Mat<f64>| {
            Mat::from_fn(m, n, |c, k| w(c) * rows[(c, k)])
        };
        let prestress = turn.transpose() * weighted(&|c| f(c) * length[c], &turn);
        let eigenvalues: Vec<f64> = if answer.gradient {
            let mixed = stretch.transpose() * weighted(&|c| torque[c] / length[c], &turn);
            let k = l.transpose() * &response - turn.transpose() * &s * &turn - prestress
                + &mixed
                + mixed.transpose();
            k.self_adjoint_eigenvalues(Side::Lower)
                .expect("eigenvalues of a finite matrix")
        } else {
            let k = stretch.transpose() * &response - prestress;
            let values = k.eigenvalues().expect("eigenvalues of a finite matrix");
            values.iter().map(|z| z.re).collect()
        };
        let zero = ZERO * eigenvalues.iter().fold(0.0, |m: f64, x| m.max(x.abs()));
        Self {
            lowest: eigenvalues
                .iter()
                .copied()
                .filter(|x| x.abs() > zero)
                .fold(f64::INFINITY, f64::min),
            negative: eigenvalues.iter().filter(|x| **x < -zero).count(),
        }
    }
}
