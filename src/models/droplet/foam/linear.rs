//! The linearised problem: how the net forces answer to displacements when forces, normals and corner radii follow.
//!
//! The Lagrangian `𝓛(x, θ, f, r)` of [`state`](super::state) is stationary in all of them in balance. Its second derivatives are, with γ = 1,
//! `k ≠ l` sides of one droplet, `t` the normal turned by a quarter, `D_k` as in [`tilts`](super::tilts) and `C` the film,
//!
//! ```text
//! 𝓛_xx = 0             𝓛_{x_i θ} = f t, 𝓛_{x_j θ} = −f t          𝓛_{x_i f} = n, 𝓛_{x_j f} = −n
//! 𝓛_{f_k f_l} = r (1/2π − Â_kl)                                   𝓛_{f_k f_k} = Σ_p r (1/2π − Â_kk) + C_ff − ε
//! 𝓛_{θ_k f_l} = f_k r G_kl                                        𝓛_{θ_k f_k} = T_k
//! 𝓛_{θ_k θ_l} = −f_k f_l r g''_kl/2π                              𝓛_{θ_k θ_k} = f_k ( n·Δx + Σ_p r D_k )
//! 𝓛_{r f_k} = u_k = F/2π − K_k + 1 + C_fr                         𝓛_{r θ_k} = f_k M_k
//! 𝓛_{r_i r_i} = 2πR²/r³ + Σ_c C_ii                                𝓛_{r_i r_j} = C_ij
//! ```
//!
//! where `g''/2π = Â − 1/2π − cos/π`. With `z = (√f θ, f, r)`, in which no row vanishes with a force, a displacement `dx` changes the net forces
//! by `J dx = 𝓛_xz 𝓛_zz⁻¹ 𝓛_zx dx`, and `−J` is the Hessian of the energy. `𝓛_zz` is symmetric and, as a maximum in `f` and a minimum in the
//! others, indefinite: it is solved by GMRES, scaled by its diagonal.

use super::Foam;
use super::compliance::Compliance;
use super::sides::Side;
use crate::domain::Vec2;
use crate::models::droplet::linear::Linearised;
use crate::models::droplet::tangent;
use crate::numerics::gmres::Gmres;
use crate::numerics::simplicial::Simplicial;
use core::f64::consts::PI;

/// Products with `𝓛_zz` for one answer.
const MOST_PRODUCTS: usize = 200;

/// What two sides of a droplet have to do with each other: `𝓛` by `f_k f_l`, `θ_k f_l`, `f_k θ_l`, `θ_k θ_l`, each `θ` over the root of its force.
type Block = [f64; 4];

/// What one contact has beside its droplets.
#[derive(Clone, Copy, Debug)]
struct OfContact {
    pair: [usize; 2],
    /// `n`, outward from the first droplet, and `√f t`.
    normal: Vec2,
    across: Vec2,
    /// `n·Δx + Σ r D` (length), `T/√f`, `C_ff − ε`, `C_ij`.
    turn: f64,
    arm: f64,
    give: f64,
    coupling: f64,
    /// `√f`.
    root: f64,
}

/// The linearised problem at one state, and its buffers. Contacts are counted among those that it was made of.
#[derive(Clone, Debug, Default)]
pub(crate) struct Linear {
    contacts: Vec<OfContact>,
    /// The sides of each droplet, their blocks, and `u` and `√f M` of each side.
    first: Vec<usize>,
    sides: Vec<Side>,
    blocks: Vec<Block>,
    by_radius: Vec<[f64; 2]>,
    /// `𝓛_rr` on its diagonal.
    stiffness: Vec<f64>,
    compliances: Vec<f64>,
    /// What the state lacks to be stationary: `√f T`, `−gap`, and nothing for the areas.
    rest: Vec<f64>,
    right: Vec<f64>,
    answer: Vec<f64>,
    scratch: Vec<f64>,
    gmres: Gmres,
    factor: Simplicial<2, true>,
    pairs: Vec<f64>,
    line_tension: f64,
}

impl Linear {
    /// The problem at the state of `foam`, with those of its contacts whose numbers, ascending, are in `kept`.
    pub(crate) fn set(&mut self, foam: &Foam, kept: &[usize]) -> bool {
        let (lines, state) = (&foam.lines, &foam.state);
        let mut given = Compliance::default();
        given.find(lines, state);
        self.line_tension = foam.line_tension;
        let mut place = vec![u32::MAX; lines.len()];
        let bearing = (0..lines.len()).filter(|c| state.loads()[*c] > 0.0);
        let kept: Vec<usize> = {
            let bearing: Vec<usize> = bearing.collect();
            kept.iter()
                .filter_map(|k| bearing.get(*k).copied())
                .collect()
        };
        self.contacts.clear();
        self.compliances.clear();
        self.rest.clear();
        for (number, &c) in (0..).zip(&kept) {
            place[c] = number;
            let load = state.loads()[c];
            let (root, film) = (load.sqrt(), state.film(c));
            let compliance = given.diagonal()[c];
            let normal = lines.normals()[c];
            let [_, coupling, _] = film.second();
            let arm = state.moment_arm(lines, c);
            self.contacts.push(OfContact {
                pair: lines.pairs()[c].map(|p| p as usize),
                normal,
                across: tangent(normal) * root,
                turn: lines.distances()[c] - lines.shorter()[c],
                arm: arm / root,
                give: -film.softness() - state.give(),
                coupling,
                root,
            });
            self.compliances.push(compliance / self.line_tension);
            self.rest.push(root * arm);
        }
        self.rest.extend(kept.iter().map(|&c| -state.gaps()[c]));
        self.rest
            .resize(2 * kept.len() + state.corners().len(), 0.0);
        self.stiffness.clear();
        (self.stiffness).extend(state.droplets().iter().map(|droplet| droplet.stiffness));
        self.set_sides(foam, &place, given.weights().as_flattened());
        self.factorize()
    }

    /// Factorises what `𝓛_zz` is for turns and forces when each corner radius follows on its own: a matrix with positive rows for turns and negative
    /// ones for forces.
    fn factorize(&mut self) -> bool {
        let mut columns = vec![Vec::new(); self.contacts.len()];
        for (c, contact) in self.contacts.iter().enumerate() {
            let own = [[contact.turn, contact.arm], [contact.arm, contact.give]];
            columns[c].push((c as u32, own));
        }
        let mut block = 0;
        for (p, stiffness) in self.stiffness.iter().enumerate() {
            let sides = self.first[p]..self.first[p + 1];
            for k in sides.clone() {
                let (c, [by_force, by_turn]) = (self.sides[k].line, self.by_radius[k]);
                for l in sides.clone() {
                    let (other, [force, turn]) = (self.sides[l].line, self.by_radius[l]);
                    let [ff, tf, ft, tt] = self.blocks[block];
                    block += 1;
                    // Column `other`, row `c`.
                    let added = [
                        [
                            tt - by_turn * turn / stiffness,
                            ft - by_force * turn / stiffness,
                        ],
                        [
                            tf - by_turn * force / stiffness,
                            ff - by_force * force / stiffness,
                        ],
                    ];
                    let column = &mut columns[other as usize];
                    if c > other {
                        column.push((c, added));
                    } else if c == other {
                        for (sum, x) in column[0]
                            .1
                            .as_flattened_mut()
                            .iter_mut()
                            .zip(added.as_flattened())
                        {
                            *sum += x;
                        }
                    }
                }
            }
        }
        let (mut pointers, mut rows, mut blocks) = (vec![0], Vec::new(), Vec::new());
        for column in &mut columns {
            column.sort_unstable_by_key(|(row, _)| *row);
            rows.extend(column.iter().map(|(row, _)| *row));
            blocks.extend(column.iter().map(|(_, block)| *block));
            pointers.push(rows.len() as u32);
        }
        self.factor.factorize(&pointers, &rows, &blocks).is_ok()
    }

    /// The sides that bear the kept contacts, and their blocks. Row `k` of a droplet holds what its side `k` has to do with each.
    fn set_sides(&mut self, foam: &Foam, place: &[u32], weights: &[f64]) {
        let (lines, state) = (&foam.lines, &foam.state);
        self.first.clear();
        self.sides.clear();
        self.blocks.clear();
        self.by_radius.clear();
        for p in 0..state.corners().len() {
            self.first.push(self.sides.len());
            let sides = lines.sides(p);
            let bears = |k: &usize| place[sides[*k].line as usize] != u32::MAX;
            let bearing: Vec<usize> = (0..sides.len()).filter(bears).collect();
            let r = state.corners()[p];
            let of_droplet = state.droplets()[p];
            let outward = |k: usize| {
                let n = lines.normals()[sides[k].line as usize];
                if sides[k].is_second { -n } else { n }
            };
            let load = |k: usize| state.loads()[sides[k].line as usize];
            let net = bearing
                .iter()
                .fold(Vec2::zeros(), |sum, &k| sum + outward(k) * load(k));
            for &k in &bearing {
                let line = sides[k].line as usize;
                let end = usize::from(sides[k].is_second);
                let contact = place[line];
                let (f, of_side) = (load(k), state.side(lines.sides_of(line)[end]));
                let root = f.sqrt();
                let curvature = (of_side.k - 3.0 * f / (4.0 * PI))
                    - (of_droplet.force - f) / (2.0 * PI)
                    - (net.dot(&outward(k)) - f) / PI;
                self.contacts[contact as usize].turn += r * curvature;
                self.by_radius
                    .push([weights[lines.sides_of(line)[end]], root * of_side.m]);
                self.sides.push(Side {
                    line: contact,
                    is_second: sides[k].is_second,
                });
                let (kernel, slopes) = lines.rows(p, k);
                for &l in &bearing {
                    let other = load(l).sqrt();
                    let by_forces = r * (0.5 / PI - kernel[l]);
                    self.blocks.push(if l == k {
                        [by_forces, 0.0, 0.0, 0.0]
                    } else {
                        let cos = outward(k).dot(&outward(l));
                        let bent = kernel[l] - 0.5 / PI - cos / PI;
                        [
                            by_forces,
                            root * r * slopes[l],
                            -other * r * slopes[l],
                            -root * other * r * bent,
                        ]
                    });
                }
            }
        }
        self.first.push(self.sides.len());
    }

    /// `1/B_cc` of each contact is its stiffness on its own: the `B_cc` (length/force).
    pub(crate) fn compliances(&self) -> &[f64] {
        &self.compliances
    }

    /// `y = 𝓛_zz z`.
    fn multiply(&self, z: &[f64], y: &mut [f64]) {
        let count = self.contacts.len();
        let (turns, rest) = z.split_at(count);
        let (forces, radii) = rest.split_at(count);
        for (c, contact) in self.contacts.iter().enumerate() {
            y[c] = contact.turn * turns[c] + contact.arm * forces[c];
            y[count + c] = contact.give * forces[c] + contact.arm * turns[c];
        }
        for (p, stiffness) in self.stiffness.iter().enumerate() {
            y[2 * count + p] = stiffness * radii[p];
        }
        for contact in &self.contacts {
            let [i, j] = contact.pair;
            y[2 * count + i] += contact.coupling * radii[j];
            y[2 * count + j] += contact.coupling * radii[i];
        }
        let mut block = 0;
        for p in 0..self.stiffness.len() {
            let sides = self.first[p]..self.first[p + 1];
            for k in sides.clone() {
                let c = self.sides[k].line as usize;
                let [by_force, by_turn] = self.by_radius[k];
                y[2 * count + p] += by_force * forces[c] + by_turn * turns[c];
                let mut turn = by_turn * radii[p];
                let mut force = by_force * radii[p];
                for l in sides.clone() {
                    let other = self.sides[l].line as usize;
                    let [ff, tf, ft, tt] = self.blocks[block];
                    block += 1;
                    turn += tf * forces[other] + tt * turns[other];
                    force += ff * forces[other] + ft * turns[other];
                }
                y[c] += turn;
                y[count + c] += force;
            }
        }
    }

    /// `𝓛_zz z = right` into `answer`, to `tolerance` (relative); `false` if that cannot be had.
    fn solve(&mut self, tolerance: f64) -> bool {
        let mut gmres = core::mem::take(&mut self.gmres);
        let right = core::mem::take(&mut self.right);
        let mut answer = core::mem::take(&mut self.answer);
        let mut scratch = core::mem::take(&mut self.scratch);
        answer.resize(right.len(), 0.0);
        scratch.resize(right.len(), 0.0);
        let solved = if right.iter().all(|x| *x == 0.0) {
            answer.fill(0.0);
            true
        } else {
            let report = gmres.solve(&right, &mut answer, tolerance, MOST_PRODUCTS, |v, w, _| {
                scratch.copy_from_slice(v);
                self.precondition(&mut scratch);
                self.multiply(&scratch, w);
                true
            });
            self.precondition(&mut answer);
            report.is_some_and(|report| report.residual <= tolerance)
        };
        (self.gmres, self.right, self.answer, self.scratch) = (gmres, right, answer, scratch);
        solved
    }

    /// Solves in place as if corner radii did not know of each other.
    fn precondition(&mut self, z: &mut [f64]) {
        let count = self.contacts.len();
        let (of_contacts, radii) = z.split_at_mut(2 * count);
        self.pairs.clear();
        for c in 0..count {
            self.pairs.extend([of_contacts[c], of_contacts[count + c]]);
        }
        for (p, stiffness) in self.stiffness.iter().enumerate() {
            for k in self.first[p]..self.first[p + 1] {
                let (c, [by_force, by_turn]) = (self.sides[k].line as usize, self.by_radius[k]);
                self.pairs[2 * c] -= by_turn * radii[p] / stiffness;
                self.pairs[2 * c + 1] -= by_force * radii[p] / stiffness;
            }
        }
        self.factor.solve(&mut self.pairs);
        for (p, stiffness) in self.stiffness.iter().enumerate() {
            for k in self.first[p]..self.first[p + 1] {
                let (c, [by_force, by_turn]) = (self.sides[k].line as usize, self.by_radius[k]);
                radii[p] -= by_turn * self.pairs[2 * c] + by_force * self.pairs[2 * c + 1];
            }
            radii[p] /= stiffness;
        }
        for c in 0..count {
            [of_contacts[c], of_contacts[count + c]] = [self.pairs[2 * c], self.pairs[2 * c + 1]];
        }
    }

    /// Adds `scale` times the change of the net forces that the answer makes: `−𝓛_xz dz`.
    fn add_forces(&self, scale: f64, y: &mut [f64]) {
        let count = self.contacts.len();
        for (c, contact) in self.contacts.iter().enumerate() {
            let [i, j] = contact.pair.map(|p| 2 * p);
            let change = contact.across * self.answer[c] + contact.normal * self.answer[count + c];
            let change = change * scale;
            y[i] -= change.x;
            y[i + 1] -= change.y;
            y[j] += change.x;
            y[j + 1] += change.y;
        }
    }

    /// What `dz` turns contact `c` by (radians) and changes its force by (units of γ).
    pub(super) fn change_of_contact(&self, change: &[f64], c: usize) -> [f64; 2] {
        let count = self.contacts.len();
        [change[c] / self.contacts[c].root, change[count + c]]
    }

    /// What `dz` changes the corner radii by (length).
    pub(super) fn change_of_radii<'a>(&self, change: &'a [f64]) -> &'a [f64] {
        &change[2 * self.contacts.len()..]
    }
}

impl Linearised for Linear {
    /// What follows is `dz`.
    fn follow(&mut self, x: &[f64], tolerance: f64) -> bool {
        let count = self.contacts.len();
        self.right.clear();
        self.right.resize(2 * count + self.stiffness.len(), 0.0);
        for (c, contact) in self.contacts.iter().enumerate() {
            let [i, j] = contact.pair.map(|p| 2 * p);
            let apart = Vec2::new(x[i] - x[j], x[i + 1] - x[j + 1]);
            self.right[c] = -contact.across.dot(&apart);
            self.right[count + c] = -contact.normal.dot(&apart);
        }
        self.solve(tolerance)
    }

    fn product(&mut self, x: &[f64], y: &mut [f64], tolerance: f64) -> bool {
        y.fill(0.0);
        self.follow(x, tolerance) && {
            self.add_forces(self.line_tension, y);
            true
        }
    }

    fn correct(&mut self, right: &mut [f64], miss: &mut Vec<f64>) -> bool {
        self.right.clear();
        self.right.extend(self.rest.iter().map(|g| -g));
        if !self.solve(1e-6) {
            return false;
        }
        self.answer.clone_into(miss);
        self.add_forces(-self.line_tension, right);
        true
    }

    fn change(&self) -> &[f64] {
        &self.answer
    }
}
