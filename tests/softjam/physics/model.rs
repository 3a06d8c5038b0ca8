//! The Morse–Witten model a second time: dense, slow, straight from the formulas.
//!
//! Minimum images are looked for among all nine, gaps are taken between a particle and *every* image of another, `A` is
//! a full matrix and solved by a dense Cholesky factorisation.

use softjam::domain::Vec2;
use softjam::models::droplet::contact::matrix::ContactMatrix;
use softjam::state::Packing;
use std::f64::consts::PI;

/// `g(θ)`, eq. (2), of the angle between two vectors, `0 ≤ θ ≤ π`.
pub fn g_between(u: Vec2, v: Vec2) -> f64 {
    let theta = (u.x * v.y - u.y * v.x).abs().atan2(u.x * v.x + u.y * v.y);
    (PI - theta) * theta.sin() - 0.5 * theta.cos() - 1.0
}

/// The shortest of the nine vectors from the images of particle `j` to particle `i`.
pub fn separation(packing: &Packing, i: usize, j: usize) -> Vec2 {
    let direct = packing.positions()[i] - packing.positions()[j];
    images(packing)
        .map(|shift| direct + shift)
        .min_by(|a, b| a.norm().total_cmp(&b.norm()))
        .unwrap()
}

fn images(packing: &Packing) -> impl Iterator<Item = Vec2> {
    let sides = packing.domain().lengths();
    [-1.0, 0.0, 1.0]
        .into_iter()
        .flat_map(move |m| [-1.0, 0.0, 1.0].map(|n| Vec2::new(m * sides.x, n * sides.y)))
}

/// A packing with contacts and forces on them.
pub struct Model<'a> {
    packing: &'a Packing,
    line_tension: f64,
    pairs: &'a [[u32; 2]],
    forces: &'a [f64],
    /// For each particle the unit vectors to its partners and the forces.
    around: Vec<Vec<(Vec2, f64)>>,
}

impl<'a> Model<'a> {
    pub fn new(
        packing: &'a Packing,
        pairs: &'a [[u32; 2]],
        forces: &'a [f64],
        line_tension: f64,
    ) -> Self {
        let mut around = vec![Vec::new(); packing.len()];
        for (&[i, j], &f) in pairs.iter().zip(forces) {
            let (i, j) = (i as usize, j as usize);
            let n = separation(packing, i, j).normalize();
            around[i].push((-n, f));
            around[j].push((n, f));
        }
        Self {
            packing,
            line_tension,
            pairs,
            forces,
            around,
        }
    }

    /// `ρ_p` in the direction of `u`, eqs. (1) and (3).
    fn contour(&self, p: usize, u: Vec2) -> f64 {
        let sum: f64 = self.around[p]
            .iter()
            .map(|(v, f)| f * g_between(u, *v))
            .sum();
        self.packing.radii()[p] * (1.0 + sum / (2.0 * PI * self.line_tension))
    }

    /// Between the deformed contours of `i` and of the image of `j` from which `separation` leads to `i`.
    fn gap(&self, i: usize, j: usize, separation: Vec2) -> f64 {
        separation.norm() - self.contour(i, -separation) - self.contour(j, separation)
    }

    /// The largest `|gap|` of a contact.
    pub fn largest_gap_at_contacts(&self) -> f64 {
        self.pairs.iter().fold(0.0, |m: f64, &[i, j]| {
            let (i, j) = (i as usize, j as usize);
            m.max(self.gap(i, j, separation(self.packing, i, j)).abs())
        })
    }

    /// The smallest gap between any two particles and all their images, contacts left out; own images included.
    pub fn smallest_gap_elsewhere(&self) -> f64 {
        let mut smallest = f64::INFINITY;
        for i in 0..self.packing.len() {
            for j in i..self.packing.len() {
                let direct = self.packing.positions()[i] - self.packing.positions()[j];
                let nearest = separation(self.packing, i, j);
                let contact = self.pairs.contains(&[i as u32, j as u32]);
                for shift in images(self.packing) {
                    let d = direct + shift;
                    let itself = i == j && shift == Vec2::zeros();
                    if !(itself || contact && d == nearest) {
                        smallest = smallest.min(self.gap(i, j, d));
                    }
                }
            }
        }
        smallest
    }

    /// `δ_ij` of each contact.
    pub fn overlaps(&self) -> Vec<f64> {
        let overlap = |p: &[u32; 2]| {
            let (i, j) = (p[0] as usize, p[1] as usize);
            let radii = self.packing.radii();
            radii[i] + radii[j] - separation(self.packing, i, j).norm()
        };
        self.pairs.iter().map(overlap).collect()
    }

    /// The matrix `A`, eqs. (4)–(6): every pair of contacts looked at.
    pub fn matrix(&self) -> Dense {
        let n = self.pairs.len();
        let mut a = Dense::zero(n);
        let toward = |p: u32, pair: [u32; 2]| {
            let other = if pair[0] == p { pair[1] } else { pair[0] };
            separation(self.packing, other as usize, p as usize)
        };
        for (c, &pair) in self.pairs.iter().enumerate() {
            for (d, &other) in self.pairs.iter().enumerate() {
                for p in pair {
                    if other.contains(&p) {
                        let angle = g_between(toward(p, pair), toward(p, other));
                        let radius = self.packing.radii()[p as usize];
                        a.entries[c * n + d] -= radius * angle / (2.0 * PI * self.line_tension);
                    }
                }
            }
        }
        a
    }

    /// `F_i = Σ_j f_ij n_ij`.
    pub fn net_forces(&self) -> Vec<Vec2> {
        let push = |c: &Vec<(Vec2, f64)>| -c.iter().map(|(v, f)| v * *f).sum::<Vec2>();
        self.around.iter().map(push).collect()
    }

    pub fn largest_net_force(&self) -> f64 {
        self.net_forces()
            .iter()
            .fold(0.0, |m: f64, f| m.max(f.norm()))
    }

    /// `U = ½ Σ δ f`.
    pub fn energy(&self) -> f64 {
        let halves = self
            .overlaps()
            .into_iter()
            .zip(self.forces)
            .map(|(d, f)| 0.5 * d * f);
        halves.sum()
    }

    /// `p = (1/2V) Σ f r`.
    pub fn pressure(&self) -> f64 {
        let sides = self.packing.domain().lengths();
        let moment = |(&[i, j], &f): (&[u32; 2], &f64)| {
            f * separation(self.packing, i as usize, j as usize).norm()
        };
        let sum: f64 = self.pairs.iter().zip(self.forces).map(moment).sum();
        sum / (2.0 * sides.x * sides.y)
    }
}

/// A square matrix by rows.
#[derive(Clone)]
pub struct Dense {
    pub n: usize,
    pub entries: Vec<f64>,
}

impl Dense {
    pub fn zero(n: usize) -> Self {
        Self {
            n,
            entries: vec![0.0; n * n],
        }
    }

    /// The crate's sparse matrix, written out.
    pub fn of(matrix: &ContactMatrix) -> Self {
        let n = matrix.len();
        let mut dense = Self::zero(n);
        for c in 0..n {
            dense.entries[c * n + c] = matrix.diagonal()[c];
            for (k, v) in matrix.row(c) {
                assert_eq!(dense.entries[c * n + k], 0.0, "entry ({c}, {k}) comes once");
                dense.entries[c * n + k] = v;
            }
        }
        dense
    }

    pub fn at(&self, row: usize, column: usize) -> f64 {
        self.entries[row * self.n + column]
    }

    pub fn multiply(&self, x: &[f64]) -> Vec<f64> {
        let rows = self.entries.chunks_exact(self.n.max(1));
        rows.map(|row| row.iter().zip(x).map(|(a, b)| a * b).sum())
            .collect()
    }

    /// The lower factor of `L Lᵀ`; `None` unless every pivot is positive, that is, unless the matrix is positive definite.
    pub fn cholesky(mut self) -> Option<Cholesky> {
        let n = self.n;
        for c in 0..n {
            for k in 0..=c {
                let (row, above) = (
                    &self.entries[c * n..c * n + k],
                    &self.entries[k * n..k * n + k],
                );
                let dot: f64 = row.iter().zip(above).map(|(a, b)| a * b).sum();
                let rest = self.at(c, k) - dot;
                if k < c {
                    self.entries[c * n + k] = rest / self.at(k, k);
                } else if rest > 0.0 {
                    self.entries[c * n + c] = rest.sqrt();
                } else {
                    return None;
                }
            }
        }
        Some(Cholesky(self))
    }
}

/// A dense Cholesky factor.
pub struct Cholesky(Dense);

impl Cholesky {
    pub fn solve(&self, b: &[f64]) -> Vec<f64> {
        let l = &self.0;
        let mut x = b.to_vec();
        for r in 0..l.n {
            let dot: f64 = (0..r).map(|k| l.at(r, k) * x[k]).sum();
            x[r] = (x[r] - dot) / l.at(r, r);
        }
        for r in (0..l.n).rev() {
            x[r] /= l.at(r, r);
            let y = x[r];
            for (k, above) in x[..r].iter_mut().enumerate() {
                *above -= l.at(r, k) * y;
            }
        }
        x
    }
}
