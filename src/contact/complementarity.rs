//! The linear complementarity problem of the contact law, and the seed's drop-and-add rule.
//!
//! # The way to the answer
//!
//! A guess of the contact set gives forces by `A f = δ`. A contact with `f ≤ 0` ought to go; a pair outside the set
//! with a negative gap ought to come. [`Rule::Complementarity`] exchanges them all at once and solves again, which
//! takes one or two sweeps when the guess comes from the step before.
//!
//! Exchanging all at once can cycle. The safeguard is that of J. J. Júdice and F. M. Pires (Comput. Oper. Res. 21, 587
//! (1994)): when three sweeps have not lowered the number of offending pairs below its best, only the *first* offending
//! pair in the order of the list is exchanged, until the number falls below its best. With the first pair alone the
//! sequence is Murty's (K. G. Murty, Opsearch 11, 54 (1974)), which reaches the answer of a problem whose matrix is
//! positive definite in finitely many exchanges; so the best number falls again and again, down to zero.
//!
//! # Which pairs are looked at
//!
//! A pair that is not in the set can only have a negative gap if its bulges bridge the distance. A bulge is at most
//! `B_i = (R_i/2πγ) (g_max Σ_{f>0} f + 3/2 Σ_{f<0} |f|)`, so pairs with `r_ij ≥ R_i + R_j + B_i + B_j` are passed over,
//! by an exact comparison: how far the neighbour list reaches cannot change a bit of the answer.

use super::Contacts;
use super::list::ContactList;
use super::matrix::{ContactMatrix, Geometry};
use super::solver::{LinearSolver, Method, SolverError};
use crate::droplet::kernel::{G_AT_CONTACT, G_MAX};
use crate::neighbors::NeighborList;
use crate::packing::Packing;
use core::f64::consts::PI;

/// How the contact list follows the positions.
///
/// ```
/// assert_eq!(softjam::contact::Rule::default(), softjam::contact::Rule::Complementarity);
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Rule {
    /// The contact law is solved in every step: forces and gaps are ≥ 0 and the list depends on the positions alone.
    #[default]
    Complementarity,
    /// Saitoh 2.2.5: in every step solve, drop the contacts with `f < 0`, add the pairs with `Δ > 0`, solve once more. The
    /// list is then a matter of history and a force can be negative for a step. (`f = 0` is dropped too, and `Δ` has to
    /// exceed the solver's tolerance.)
    Seed,
}

/// Why the contact problem has no answer.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ContactError {
    /// `A f = δ` was not solved.
    #[error(transparent)]
    Solver(#[from] SolverError),
    /// A particle reaches so far that it could touch two images of the same neighbour.
    #[error(
        "particle {particle} reaches {reach:.4} (radius and largest bulge), more than a quarter of the box's shorter side \
         {shortest:.4}: it could touch two images of one neighbour; take more particles or a lower phi"
    )]
    BoxTooSmall {
        /// The particle.
        particle: usize,
        /// Its undeformed radius and the bound of its bulge (length).
        reach: f64,
        /// The shorter side of the box (length).
        shortest: f64,
    },
    /// The forces are so large that a contour would bulge by several radii.
    #[error(
        "particle {particle} of radius {radius} would bulge by up to {bulge:.3e}: the forces are absurd, \
         as after a step that was too long or in a start that overlaps far too much"
    )]
    Absurd {
        /// The particle.
        particle: usize,
        /// The bound of its bulge (length).
        bulge: f64,
        /// Its undeformed radius (length).
        radius: f64,
    },
    /// Exchanging contacts did not end. Only round-off can bring this about, at an exact tie.
    #[error(
        "the contact set did not settle: {offending} of {contacts} pairs still offend after {sweeps} sweeps"
    )]
    Unsettled {
        /// Pairs that still break the law.
        offending: usize,
        /// Contacts in the set.
        contacts: usize,
        /// Sweeps done.
        sweeps: usize,
    },
}

/// The contact law: a solver of the contact problem with its settings, its buffers and its last answer.
///
/// # Example
///
/// A particle pressed between two others bulges sideways and touches a fourth that no undeformed disk would reach:
///
/// ```
/// use softjam::contact::ContactLaw;
/// use softjam::domain::{Domain, Vec2};
/// use softjam::packing::Packing;
///
/// let packing = Packing::new(
///     Domain::new(9.0, 9.0).unwrap(),
///     vec![0.5; 4],
///     vec![Vec2::new(3.0, 3.0), Vec2::new(3.9, 3.0), Vec2::new(4.8, 3.0), Vec2::new(3.9, 4.005)],
/// ).unwrap();
/// let mut law = ContactLaw::default();
/// law.solve(&packing, &[], &[]).unwrap();
/// assert_eq!(law.contacts().pairs, [[0, 1], [1, 2], [1, 3]]);
/// assert!(law.contacts().overlaps[2] < 0.0 && law.contacts().forces[2] > 0.0);
/// assert!(law.residual() < 1e-12);
/// ```
#[derive(Clone, Debug)]
pub struct ContactLaw {
    rule: Rule,
    line_tension: f64,
    tolerance: f64,
    solver: LinearSolver,
    neighbors: NeighborList,
    list: ContactList,
    geometry: Geometry,
    matrix: ContactMatrix,
    pairs: Vec<[u32; 2]>,
    forces: Vec<f64>,
    image: Vec<f64>,
    bulges: Vec<f64>,
    offending: Vec<Offence>,
    next: (Vec<[u32; 2]>, Vec<f64>),
    residual: f64,
    work: Work,
}

/// What solving the contact problem has cost so far: counts for benches and tests, never part of a result.
///
/// ```
/// assert_eq!(softjam::contact::ContactLaw::default().work().solves, 0);
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Work {
    /// Contact problems solved.
    pub solves: u64,
    /// Linear systems set up and solved.
    pub sweeps: u64,
    /// Iterations of the linear solver.
    pub iterations: u64,
    /// Gaps evaluated of pairs outside the set.
    pub gaps: u64,
}

/// The widest bulge that candidates are looked for with, in units of the largest radius. At φ = 1.3 bulges are below one.
const WIDEST_BULGE: f64 = 5.0;

/// A pair that breaks the law.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Offence {
    /// Contact number `.0` pulls.
    Drop(usize, [u32; 2]),
    /// This pair overlaps and has no force; `.1` is a first guess of it.
    Add([u32; 2], f64),
}

impl Offence {
    fn pair(self) -> [u32; 2] {
        match self {
            Self::Drop(_, pair) | Self::Add(pair, _) => pair,
        }
    }
}

impl Default for ContactLaw {
    fn default() -> Self {
        Self::new(Rule::default(), Method::default(), 1.0, 1e-12)
    }
}

impl ContactLaw {
    /// A law with line tension γ (force, positive) and a `tolerance` on the residual relative to the largest overlap.
    ///
    /// ```
    /// use softjam::contact::{solver::Method, ContactLaw, Rule};
    /// let law = ContactLaw::new(Rule::Complementarity, Method::SparseCholesky, 1.0, 1e-12);
    /// assert!(law.contacts().pairs.is_empty());
    /// ```
    #[must_use]
    pub fn new(rule: Rule, method: Method, line_tension: f64, tolerance: f64) -> Self {
        Self {
            rule,
            line_tension,
            tolerance,
            solver: LinearSolver::new(method),
            neighbors: NeighborList::new(),
            list: ContactList::default(),
            geometry: Geometry::default(),
            matrix: ContactMatrix::default(),
            pairs: Vec::new(),
            forces: Vec::new(),
            image: Vec::new(),
            bulges: Vec::new(),
            offending: Vec::new(),
            next: (Vec::new(), Vec::new()),
            residual: 0.0,
            work: Work::default(),
        }
    }

    /// The contacts and forces found last.
    ///
    /// ```
    /// assert!(softjam::contact::ContactLaw::default().contacts().forces.is_empty());
    /// ```
    #[must_use]
    pub fn contacts(&self) -> Contacts<'_> {
        Contacts {
            pairs: &self.pairs,
            normals: self.geometry.normals(),
            distances: self.geometry.distances(),
            overlaps: self.geometry.overlaps(),
            forces: &self.forces,
        }
    }

    /// The matrix `A` of the contacts found last.
    ///
    /// ```
    /// assert!(softjam::contact::ContactLaw::default().matrix().is_empty());
    /// ```
    #[must_use]
    pub fn matrix(&self) -> &ContactMatrix {
        &self.matrix
    }

    /// Line tension γ (force).
    ///
    /// ```
    /// assert_eq!(softjam::contact::ContactLaw::default().line_tension(), 1.0);
    /// ```
    #[must_use]
    pub fn line_tension(&self) -> f64 {
        self.line_tension
    }

    /// Solves `A x = b` with the matrix found last, from the guess in `x`, to `max |A x − b| ≤ tolerance`.
    ///
    /// # Errors
    ///
    /// [`ContactError::Solver`].
    ///
    /// ```
    /// assert!(softjam::contact::ContactLaw::default().solve_linear(&[], &mut [], 0.0).is_ok());
    /// ```
    pub fn solve_linear(
        &mut self,
        b: &[f64],
        x: &mut [f64],
        tolerance: f64,
    ) -> Result<(), ContactError> {
        self.solver.solve(&self.matrix, b, x, tolerance)?;
        Ok(())
    }

    /// Takes contacts and forces as the answer at the positions of `packing`, without solving: for a run that goes on.
    pub(crate) fn restore(&mut self, packing: &Packing, pairs: &[[u32; 2]], forces: &[f64]) {
        self.pairs.clear();
        self.pairs.extend_from_slice(pairs);
        self.forces.clear();
        self.forces.extend_from_slice(forces);
        self.assemble(packing);
        self.inspect(packing);
    }

    /// How far the last answer is from the contact law, relative to the largest `|δ|` among the contacts: the largest
    /// of `|A f − δ|` on contacts, of `−gap` elsewhere and of `−f A_cc`.
    ///
    /// ```
    /// assert_eq!(softjam::contact::ContactLaw::default().residual(), 0.0);
    /// ```
    #[must_use]
    pub fn residual(&self) -> f64 {
        self.residual
    }

    /// The residual below which the law counts as fulfilled, in the same measure.
    ///
    /// Sixteen tolerances: a linear system solved to the tolerance leaves gaps and forces uncertain by about the
    /// condition number of `A`, some 6 of them.
    ///
    /// ```
    /// let law = softjam::contact::ContactLaw::default();
    /// assert!(law.residual() <= law.accepted_residual());
    /// ```
    #[must_use]
    pub fn accepted_residual(&self) -> f64 {
        16.0 * self.tolerance
    }

    /// What it has cost so far.
    ///
    /// ```
    /// assert_eq!(softjam::contact::ContactLaw::default().work(), Default::default());
    /// ```
    #[must_use]
    pub fn work(&self) -> Work {
        self.work
    }

    /// Solves the contact problem at the positions of `packing`, starting from contacts and forces of a step before.
    ///
    /// `pairs` ascend, `forces` are in the same order; both may be empty. With [`Rule::Complementarity`] the start
    /// decides only how fast the answer is found (and its last bits, within the tolerance).
    ///
    /// # Errors
    ///
    /// [`ContactError`]; the law's last answer is then of no use.
    ///
    /// # Panics
    ///
    /// If `pairs` names a particle that the packing lacks or the slices differ in length.
    ///
    /// See the example of [`ContactLaw`].
    pub fn solve(
        &mut self,
        packing: &Packing,
        pairs: &[[u32; 2]],
        forces: &[f64],
    ) -> Result<(), ContactError> {
        assert_eq!(pairs.len(), forces.len(), "one force a contact");
        self.pairs.clear();
        self.pairs.extend_from_slice(pairs);
        self.forces.clear();
        self.forces.extend_from_slice(forces);
        self.solve_again(packing)
    }

    /// [`solve`](Self::solve), starting from the contacts and forces found last.
    ///
    /// # Errors
    ///
    /// As [`solve`](Self::solve).
    ///
    /// ```
    /// # use softjam::contact::ContactLaw;
    /// # use softjam::{domain::{Domain, Vec2}, packing::Packing};
    /// # let at = |x| Vec2::new(x, 2.0);
    /// # let packing = Packing::new(Domain::new(8.0, 8.0).unwrap(), vec![0.5; 2], vec![at(1.0), at(1.9)]).unwrap();
    /// let mut law = ContactLaw::default();
    /// law.solve(&packing, &[], &[]).unwrap();
    /// let iterations = law.work().iterations;
    /// law.solve_again(&packing).unwrap();
    /// assert_eq!(law.work().iterations, iterations, "the answer is its own best guess");
    /// ```
    pub fn solve_again(&mut self, packing: &Packing) -> Result<(), ContactError> {
        self.work.solves += 1;
        match self.rule {
            Rule::Complementarity => self.settle(packing)?,
            Rule::Seed => {
                self.sweep(packing)?;
                self.exchange(self.offending.len());
                self.sweep(packing)?;
            }
        }
        // The forces of an unfinished exchange can be anything; only an answer is held against the box.
        if self.residual <= self.accepted_residual() {
            self.check_images(packing)?;
        }
        Ok(())
    }

    /// Exchanges contacts until none offends.
    fn settle(&mut self, packing: &Packing) -> Result<(), ContactError> {
        const PATIENCE: u32 = 3;
        let most = 1000 + 20 * packing.len();
        let mut best = usize::MAX;
        let mut patience = PATIENCE;
        for _ in 0..most {
            self.sweep(packing)?;
            let count = self.offending.len();
            if count == 0 {
                return Ok(());
            }
            if count < best {
                best = count;
                patience = PATIENCE;
                self.exchange(count);
            } else if patience > 0 {
                patience -= 1;
                self.exchange(count);
            } else {
                self.exchange(1);
            }
        }
        Err(ContactError::Unsettled {
            offending: self.offending.len(),
            contacts: self.pairs.len(),
            sweeps: most,
        })
    }

    /// Forces of the present set, and the pairs that offend, in the order of the list.
    fn sweep(&mut self, packing: &Packing) -> Result<(), ContactError> {
        self.work.sweeps += 1;
        let scale = self.assemble(packing);
        let iterations = self.solver.solve(
            &self.matrix,
            self.geometry.overlaps(),
            &mut self.forces,
            self.tolerance * scale,
        )?;
        self.work.iterations += iterations as u64;
        self.inspect(packing);
        Ok(())
    }

    /// Geometry and matrix of the present set; returns the largest `|δ|`, the scale of all residuals.
    fn assemble(&mut self, packing: &Packing) -> f64 {
        self.list.rebuild(packing.len(), &self.pairs);
        self.geometry.rebuild(packing, &self.list);
        self.matrix
            .rebuild(packing, &self.list, &self.geometry, self.line_tension);
        self.scale()
    }

    fn scale(&self) -> f64 {
        let overlaps = self.geometry.overlaps();
        overlaps.iter().fold(0.0, |m: f64, d| m.max(d.abs()))
    }

    /// Measures how far the present forces are from the contact law, and lists the pairs that offend.
    fn inspect(&mut self, packing: &Packing) {
        let scale = self.scale();
        self.image.resize(self.forces.len(), 0.0);
        self.matrix.multiply(&self.forces, &mut self.image);
        let mut worst: f64 = 0.0;
        for (q, d) in self.image.iter().zip(self.geometry.overlaps()) {
            worst = worst.max((q - d).abs());
        }
        self.bound_bulges(packing);
        worst = worst.max(self.find_offences(packing, self.accepted_residual() * scale));
        self.residual = if scale > 0.0 { worst / scale } else { worst };
    }

    /// `B_i`, and a neighbour list that covers the largest of them.
    fn bound_bulges(&mut self, packing: &Packing) {
        self.bulges.clear();
        self.bulges.resize(packing.len(), 0.0);
        for (&[i, j], &f) in self.pairs.iter().zip(&self.forces) {
            let bulge = if f > 0.0 { G_MAX * f } else { G_AT_CONTACT * f };
            self.bulges[i as usize] += bulge;
            self.bulges[j as usize] += bulge;
        }
        let mut largest: f64 = 0.0;
        for (bulge, radius) in self.bulges.iter_mut().zip(packing.radii()) {
            *bulge *= radius / (2.0 * PI * self.line_tension);
            largest = largest.max(*bulge);
        }
        // The forces of an unfinished exchange can be anything; pairs beyond this reach are left to a later sweep.
        let radius = packing.largest_radius();
        let margin = 2.0 * largest.min(WIDEST_BULGE * radius);
        let skin = 0.3 * radius;
        self.neighbors.update(packing, margin, skin + 0.5 * margin);
    }

    /// Two images of one neighbour are at least half a side apart: no particle may reach farther than a quarter.
    fn check_images(&self, packing: &Packing) -> Result<(), ContactError> {
        let shortest = packing.domain().shortest();
        for (particle, (bulge, radius)) in self.bulges.iter().zip(packing.radii()).enumerate() {
            if bulge.is_nan() || *bulge > WIDEST_BULGE * packing.largest_radius() {
                return Err(ContactError::Absurd {
                    particle,
                    bulge: *bulge,
                    radius: *radius,
                });
            }
            let reach = radius + bulge;
            if 4.0 * reach > shortest {
                return Err(ContactError::BoxTooSmall {
                    particle,
                    reach,
                    shortest,
                });
            }
        }
        Ok(())
    }

    /// Lists the pairs that offend by more than `tolerance` (length); returns the largest offence, below it or above.
    fn find_offences(&mut self, packing: &Packing, tolerance: f64) -> f64 {
        self.offending.clear();
        let (radii, positions) = (packing.radii(), packing.positions());
        let domain = packing.domain();
        let mut worst: f64 = 0.0;
        let mut contact = 0;
        let drop_before = |contact: &mut usize, pair: [u32; 2], out: &mut Vec<Offence>| -> f64 {
            let mut worst: f64 = 0.0;
            while *contact < self.pairs.len() && self.pairs[*contact] <= pair {
                let f = self.forces[*contact];
                if f <= 0.0 {
                    out.push(Offence::Drop(*contact, self.pairs[*contact]));
                    worst = worst.max(-f * self.matrix.diagonal()[*contact]);
                }
                *contact += 1;
            }
            worst
        };
        for &pair in self.neighbors.pairs() {
            // Contacts are walked through in step with the candidates; both ascend.
            worst = worst.max(drop_before(&mut contact, pair, &mut self.offending));
            if contact > 0 && self.pairs[contact - 1] == pair {
                continue;
            }
            let [i, j] = [pair[0] as usize, pair[1] as usize];
            let separation = domain.minimum_image(positions[i] - positions[j]);
            let reach = radii[i] + radii[j] + self.bulges[i] + self.bulges[j];
            if separation.norm_squared() >= reach * reach {
                continue;
            }
            self.work.gaps += 1;
            let gap = self
                .geometry
                .gap(packing, self.line_tension, &self.forces, i, j);
            worst = worst.max(-gap);
            if gap < -tolerance {
                let compliance =
                    -G_AT_CONTACT * (radii[i] + radii[j]) / (2.0 * PI * self.line_tension);
                self.offending.push(Offence::Add(pair, -gap / compliance));
            }
        }
        worst.max(drop_before(
            &mut contact,
            [u32::MAX; 2],
            &mut self.offending,
        ))
    }

    /// Exchanges the first `count` offending pairs between the two sides.
    fn exchange(&mut self, count: usize) {
        debug_assert!(self.offending.windows(2).all(|w| w[0].pair() < w[1].pair()));
        let (pairs, forces) = &mut self.next;
        pairs.clear();
        forces.clear();
        let mut kept = 0;
        for offence in &self.offending[..count] {
            let place = match *offence {
                Offence::Drop(contact, _) => contact,
                Offence::Add(pair, _) => self.pairs.partition_point(|p| *p < pair),
            };
            pairs.extend_from_slice(&self.pairs[kept..place]);
            forces.extend_from_slice(&self.forces[kept..place]);
            kept = place;
            match *offence {
                Offence::Drop(..) => kept += 1,
                Offence::Add(pair, guess) => {
                    pairs.push(pair);
                    forces.push(guess);
                }
            }
        }
        pairs.extend_from_slice(&self.pairs[kept..]);
        forces.extend_from_slice(&self.forces[kept..]);
        core::mem::swap(&mut self.pairs, pairs);
        core::mem::swap(&mut self.forces, forces);
    }
}
