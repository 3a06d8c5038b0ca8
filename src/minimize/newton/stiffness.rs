//! The preconditioner: the stiffness of contacts that do not know of each other.
//!
//! `K̃ = Σ_c (1/A_cc) n_c n_cᵀ − s (f_c/r_c) t_c t_cᵀ + μ I`. With `s = 0` it is spectrally equivalent to the stiffness `B A⁻¹ Bᵀ`
//! within the condition number of `A`, about 6 whatever the number of particles; the second term is the part `s` of the
//! prestress. `μ` holds rattlers and the two translations.

use crate::contacts::Contacts;
use crate::domain::Vec2;
use crate::models::droplet::tangent;
use crate::numerics::simplicial::{NotPositive, Simplicial};

/// `μ` in units of the stiffest contact's `1/A_cc`.
const MU: f64 = 1e-4;

type Block = [[f64; 2]; 2];

/// `K̃` and its factor.
#[derive(Clone, Debug, Default)]
pub(crate) struct Stiffness {
    pointers: Vec<u32>,
    rows: Vec<u32>,
    blocks: Vec<Block>,
    factor: Simplicial<2>,
}

impl Stiffness {
    /// Builds and factorises `K̃` of `contacts` among `particles` particles; `compliances` are the `A_cc`, `prestress` is `s`.
    pub(crate) fn rebuild(
        &mut self,
        contacts: &Contacts<'_>,
        compliances: &[f64],
        particles: usize,
        prestress: f64,
    ) -> Result<(), NotPositive> {
        let stiffest = compliances.iter().fold(0.0, |m: f64, a| m.max(1.0 / a));
        let mu = MU * stiffest;
        self.pointers.clear();
        self.rows.clear();
        self.blocks.clear();
        self.pointers.push(0);
        let block_of = |c: usize| {
            let n = contacts.normals[c];
            let stiffness = outer(n, 1.0 / compliances[c]);
            if prestress == 0.0 {
                return stiffness;
            }
            let pull = prestress * contacts.forces[c] / contacts.distances[c];
            let turned = outer(tangent(n), pull);
            [0, 1].map(|k| [0, 1].map(|m| stiffness[k][m] - turned[k][m]))
        };
        let mut c = 0;
        // Pairs ascend: those of particle i as the lower one are consecutive, their partners ascending.
        for i in 0..particles as u32 {
            self.rows.push(i);
            self.blocks.push([[mu, 0.0], [0.0, mu]]);
            while c < contacts.pairs.len() && contacts.pairs[c][0] == i {
                self.rows.push(contacts.pairs[c][1]);
                self.blocks
                    .push(block_of(c).map(|column| column.map(|x| -x)));
                c += 1;
            }
            self.pointers.push(self.rows.len() as u32);
        }
        for (c, &[i, j]) in contacts.pairs.iter().enumerate() {
            let block = block_of(c);
            for p in [i, j] {
                let diagonal = &mut self.blocks[self.pointers[p as usize] as usize];
                for k in 0..2 {
                    for m in 0..2 {
                        diagonal[k][m] += block[k][m];
                    }
                }
            }
        }
        self.factor
            .factorize(&self.pointers, &self.rows, &self.blocks)
    }

    /// `x ← K̃⁻¹ x`.
    pub(crate) fn solve(&self, x: &mut [f64]) {
        self.factor.solve(x);
    }
}

fn outer(n: Vec2, k: f64) -> Block {
    [
        [k * n.x * n.x, k * n.x * n.y],
        [k * n.x * n.y, k * n.y * n.y],
    ]
}
