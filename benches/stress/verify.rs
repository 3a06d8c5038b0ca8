//! The contact law and the balance of forces, computed anew from positions and forces.
//!
//! Nothing here is shared with the solver: own kernel, `std`'s mathematics, own images, all pairs. What is checked is the
//! law itself, `f ≥ 0`, `gap ≥ 0`, `f · gap = 0` with `gap = r − ρ_i − ρ_j` from the contours, over every pair *and every
//! periodic image*, a particle's own images included.

use std::f64::consts::PI;

/// A packing with forces, in plain numbers.
#[derive(Clone, Debug)]
pub struct Answer<'a> {
    pub sides: [f64; 2],
    pub radii: &'a [f64],
    pub centres: &'a [[f64; 2]],
    pub pairs: &'a [[u32; 2]],
    pub forces: &'a [f64],
    pub line_tension: f64,
    /// Whether the net forces are those of the gradient form, −∇U.
    pub gradient: bool,
}

/// i, j, `r_i − r_j`, and the force in units of γ.
type Contact = (usize, usize, [f64; 2], f64);

/// How far an answer is from what it ought to be.
#[derive(Clone, Copy, Debug)]
pub struct Check {
    /// The largest net force (units of γ).
    pub f_max: f64,
    /// The largest of `|gap|` at contacts and `−gap` elsewhere, nearest images (length).
    pub law: f64,
    /// What it is to be compared with: the largest `|δ|` among the contacts (length).
    pub overlap: f64,
    /// How well a gap can be known at all: 8 units in the last place of the longer side (length).
    pub round_off: f64,
    /// The smallest contact force (units of γ); infinite without a contact.
    pub least_force: f64,
    /// How deep the deepest overlap with a *second* image is, in units of the larger radius; 0 if there is none.
    pub second_image: f64,
    /// A bound of the widest bulge, in units of the largest radius.
    pub bulge: f64,
    /// The largest squeeze Σ f/2πγ of a particle.
    pub squeeze: f64,
    /// Pressure `(1/2V) Σ f r` (γ/length).
    pub pressure: f64,
    /// Whether all numbers are finite.
    pub finite: bool,
}

/// The kernel g(θ), even and 2π-periodic.
pub fn g(theta: f64) -> f64 {
    let t = theta.rem_euclid(2.0 * PI);
    (PI - t) * t.sin() - 0.5 * t.cos() - 1.0
}

/// Its derivative, odd; the two slopes of the cusp at 0 cancel.
pub fn slope(theta: f64) -> f64 {
    let t = theta.rem_euclid(2.0 * PI);
    if t == 0.0 {
        return 0.0;
    }
    (PI - t) * t.cos() - 0.5 * t.sin()
}

/// The largest g is 0.64076.
const LARGEST_G: f64 = 0.64077;

impl Answer<'_> {
    /// Checks every promise of the contact law, and the balance.
    pub fn check(&self) -> Check {
        let n = self.radii.len();
        let contacts: Vec<Contact> = self
            .pairs
            .iter()
            .zip(self.forces)
            .map(|(&[i, j], &f)| {
                let (i, j) = (i as usize, j as usize);
                (i, j, self.nearest(i, j), f / self.line_tension)
            })
            .collect();
        let mut around: Vec<Vec<(f64, f64)>> = vec![Vec::new(); n];
        let mut net = vec![[0.0; 2]; n];
        let mut overlap: f64 = 0.0;
        for &(i, j, d, f) in &contacts {
            around[i].push((toward(d), f));
            around[j].push((away(d), f));
            let r = d[0].hypot(d[1]);
            let unit = if r > 0.0 {
                [d[0] / r, d[1] / r]
            } else {
                [1.0, 0.0]
            };
            for k in 0..2 {
                net[i][k] += f * unit[k];
                net[j][k] -= f * unit[k];
            }
            overlap = overlap.max((self.radii[i] + self.radii[j] - r).abs());
        }
        if self.gradient {
            self.turn(&contacts, &around, &mut net);
        }
        let contour = |p: usize, angle: f64| {
            let sum: f64 = around[p].iter().map(|(a, f)| f * g(angle - a)).sum();
            self.radii[p] * (1.0 + sum / (2.0 * PI))
        };
        let reach: Vec<f64> = (0..n)
            .map(|p| {
                let bulge: f64 = around[p]
                    .iter()
                    .map(|(_, f)| if *f > 0.0 { LARGEST_G * f } else { -1.5 * f })
                    .sum();
                self.radii[p] * (1.0 + bulge / (2.0 * PI))
            })
            .collect();
        let (mut law, mut second): (f64, f64) = (0.0, 0.0);
        for &(i, j, d, _) in &contacts {
            let gap = d[0].hypot(d[1]) - contour(i, toward(d)) - contour(j, away(d));
            law = greater(law, gap.abs());
        }
        self.near(&reach, |i, j, d, nearest| {
            let is_contact = || {
                let pair = [i.min(j) as u32, i.max(j) as u32];
                self.pairs.binary_search(&pair).is_ok()
            };
            if nearest && is_contact() {
                return;
            }
            let depth = contour(i, toward(d)) + contour(j, away(d)) - d[0].hypot(d[1]);
            if nearest {
                law = greater(law, depth);
            } else {
                second = greater(second, depth / self.radii[i].max(self.radii[j]));
            }
        });
        let f_max = net.iter().map(|f| f[0].hypot(f[1])).fold(0.0, greater);
        let finite = self.centres.iter().flatten().all(|x| x.is_finite())
            && self.forces.iter().all(|f| f.is_finite())
            && f_max.is_finite()
            && law.is_finite();
        Check {
            f_max,
            law,
            overlap,
            round_off: 8.0 * f64::EPSILON * self.sides[0].max(self.sides[1]),
            least_force: contacts.iter().map(|c| c.3).fold(f64::INFINITY, f64::min),
            second_image: second,
            bulge: (0..n).map(|p| reach[p] - self.radii[p]).fold(0.0, greater)
                / self.radii.iter().copied().fold(0.0, f64::max),
            squeeze: around
                .iter()
                .map(|a| a.iter().map(|c| c.1).sum::<f64>() / (2.0 * PI))
                .fold(0.0, greater),
            pressure: contacts
                .iter()
                .map(|c| c.3 * c.2[0].hypot(c.2[1]))
                .sum::<f64>()
                / (2.0 * self.sides[0] * self.sides[1]),
            finite,
        }
    }

    /// What the gradient form adds to the net forces: with `U(r) = max over f of δᵀf − ½ fᵀA f`, at fixed `f` only the
    /// directions θ of the contacts change `A`, and a contact turns by `dθ = t·(dr_j − dr_i)/r`, `t` a quarter turn ahead of
    /// the direction from i to j.
    fn turn(&self, contacts: &[Contact], around: &[Vec<(f64, f64)>], net: &mut [[f64; 2]]) {
        for &(i, j, d, f) in contacts {
            let torque = |p: usize, angle: f64| -> f64 {
                let sum: f64 = around[p].iter().map(|(a, k)| k * slope(angle - a)).sum();
                self.radii[p] / (2.0 * PI) * f * sum
            };
            let (angle, r) = (toward(d), d[0].hypot(d[1]));
            // Coincident centres have no direction.
            if r > 0.0 {
                let per_length = (torque(i, angle) + torque(j, away(d))) / r;
                for (k, t) in [-angle.sin(), angle.cos()].into_iter().enumerate() {
                    net[i][k] += per_length * t;
                    net[j][k] -= per_length * t;
                }
            }
        }
    }

    /// `r_i − r_j` to the nearest image.
    pub fn nearest(&self, i: usize, j: usize) -> [f64; 2] {
        [0, 1].map(|k| {
            let d = self.centres[i][k] - self.centres[j][k];
            d - self.sides[k] * (d / self.sides[k]).round()
        })
    }

    /// Calls `visit(i, j, r_i − r_j, whether it is the nearest image)` for all `i ≤ j` and images closer than the sum of
    /// their reaches.
    fn near(&self, reach: &[f64], mut visit: impl FnMut(usize, usize, [f64; 2], bool)) {
        let widest = 2.0 * reach.iter().copied().fold(0.0, f64::max);
        let n = self.radii.len();
        let cells = self.sides.map(|l| (l / widest).floor());
        let mut test = |i: usize, j: usize, images: [i32; 2]| {
            let d = self.nearest(i, j);
            for x in -images[0]..=images[0] {
                for y in -images[1]..=images[1] {
                    let moved = [
                        d[0] + f64::from(x) * self.sides[0],
                        d[1] + f64::from(y) * self.sides[1],
                    ];
                    let here = x == 0 && y == 0;
                    if moved[0].hypot(moved[1]) < reach[i] + reach[j] && !(here && i == j) {
                        visit(i, j, moved, here);
                    }
                }
            }
        };
        if cells[0] < 5.0 || cells[1] < 5.0 || n < 500 {
            let images = self
                .sides
                .map(|l| (widest / l).ceil().clamp(1.0, 50.0) as i32);
            for i in 0..n {
                for j in i..n {
                    test(i, j, images);
                }
            }
            return;
        }
        // Five cells a side or more: a second image is farther than the widest reach.
        let cells = cells.map(|c| c.min(2000.0) as usize);
        let at = |p: usize| {
            [0, 1].map(|k| {
                let share = (self.centres[p][k] / self.sides[k]).rem_euclid(1.0);
                ((share * cells[k] as f64) as usize).min(cells[k] - 1)
            })
        };
        let mut bins: Vec<Vec<u32>> = vec![Vec::new(); cells[0] * cells[1]];
        for p in 0..n {
            let [x, y] = at(p);
            bins[y * cells[0] + x].push(p as u32);
        }
        for i in 0..n {
            let [x, y] = at(i);
            for dy in [cells[1] - 1, 0, 1] {
                for dx in [cells[0] - 1, 0, 1] {
                    let bin = (y + dy) % cells[1] * cells[0] + (x + dx) % cells[0];
                    for &j in bins[bin].iter().filter(|&&j| j as usize > i) {
                        test(i, j as usize, [0, 0]);
                    }
                }
            }
        }
    }
}

/// The direction from i to j, given `r_i − r_j`; for coincident centres the normal is +x by definition.
fn toward(d: [f64; 2]) -> f64 {
    if d == [0.0, 0.0] {
        PI
    } else {
        (-d[1]).atan2(-d[0])
    }
}

/// The direction from j to i.
fn away(d: [f64; 2]) -> f64 {
    if d == [0.0, 0.0] {
        0.0
    } else {
        d[1].atan2(d[0])
    }
}

/// The greater of two numbers; a NaN wins.
fn greater(a: f64, b: f64) -> f64 {
    if b <= a { a } else { b }
}
