//! Whether a packing in balance is a minimum: where net forces vanish, there may still be a way down.
//!
//! Small displacements `u` change the net forces by `−K u`, the contact problem solved inside (`linear.rs` of the droplets). With the
//! gradient form `K` is the Hessian of the stored energy; with the central form it departs from symmetry by O(f). The
//! packing is stable if no eigenvalue of `K` has a negative real part.
//!
//! Displacements are measured by `K̃`, the stiffness of contacts that do not know of each other (`stiffness.rs` of the minimisers). The
//! eigenvalues of `K u = λ K̃ u` lie in a band around 1, whatever the number of particles, but for the soft modes below it; as
//! many are negative as of `K` where that is symmetric (Sylvester's law of inertia), and one is 0 only where one of `K` is. The
//! lowest is found by Arnoldi's method in the scalar product of `K̃` (Lanczos's where `K` is symmetric; Y. Saad, *Numerical
//! Methods for Large Eigenvalue Problems*, 2nd ed. (2011), chapter 6). A Ritz value θ whose residual is below |θ|/2 decides, a
//! positive one when it has done so at four looks in a row: an eigenvalue lies within the residual of θ. That a negative one is
//! proves a saddle (of the gradient form); that the lowest is positive is likely and not proved, since a mode of few particles
//! among many thousands has a small part in any first vector.
//!
//! *Which particles.* Contacts of rattlers that bear no more force than the balance leaves undecided are left out. A
//! particle without contacts then has nothing to say. A particle that two contacts of some force hold between them is no
//! rattler but a saddle.

use crate::analysis::held;
use crate::contacts::{Contacts, FrameContacts};
use crate::domain::Vec2;
use crate::minimize::newton::Stiffness;
use crate::models::droplet::Form;
use crate::models::droplet::contact::ContactLaw;
use crate::models::droplet::linear::{Linear, Linearised};
use crate::models::{AnyModel, Model, disks, droplet};
use crate::numerics::folded;
use crate::numerics::gmres::dot;
use crate::state::Packing;
use nalgebra::{DMatrix, DVector};

/// What a packing is whose net forces have vanished.
///
/// ```
/// use softjam::protocol::{Relaxation, Status};
/// use softjam::analysis::Stability;
/// use softjam::scene::Scene;
///
/// let mut run = Relaxation::new(&Scene { particles: 64, phi: 0.9, ..Scene::default() }).unwrap();
/// assert_eq!(run.stability(), None);
/// while run.status() == Status::Running {
///     run.advance().unwrap();
/// }
/// assert_eq!(run.stability(), Some(Stability::Minimum));
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stability {
    /// Every small displacement is driven back.
    Minimum,
    /// Some small displacement grows by itself.
    Saddle,
    /// No contact bears a force: there is nothing that could be stable.
    NotJammed,
    /// It could not be told: the forces are not balanced well enough, or the lowest eigenvalue is too close to 0.
    NotJudged,
}

impl Stability {
    /// All of them.
    const ALL: [Self; 4] = [
        Self::Minimum,
        Self::Saddle,
        Self::NotJammed,
        Self::NotJudged,
    ];

    /// The word that stands for it in recordings.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Minimum => "minimum",
            Self::Saddle => "saddle",
            Self::NotJammed => "not jammed",
            Self::NotJudged => "not judged",
        }
    }

    /// What a word of a recording stands for.
    #[must_use]
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|s| s.name() == name)
    }
}

/// A contact bears a force if that is above this multiple of `f_max`: less may be left of what has come apart.
const BORNE: f64 = 10.0;

/// A packing is judged if the mean force that is borne is this multiple of `f_max` or more: eigenvalues are off by about ten times
/// the net forces.
const BALANCED: f64 = 1e3;

/// The most products with `K`, and how many are made between two looks at the Ritz values.
const MOST: usize = 96;
const PERIOD: usize = 4;

/// The part of the prestress that the metric has, where it leaves it positive: the nearer `K̃` is to `K`, the fewer products are
/// needed. From 0 to 0.9 those until a first look decides fall from 28 to 16 at φ = 1.00, from 20 to 12 at 0.90 and from 12 to 8 at 0.86
/// (medians, N = 1024).
const PRESTRESS: f64 = 0.9;

/// What the forces inside a product are right to.
const ACCURACY: f64 = 1e-2;

/// Above this `f_max` (units of γ) forces no larger than it may hold a packing as well as not.
const ROUGH: f64 = 1e-6;

/// What is left of a product behind this length is rounding: products of unit vectors are of length 1, about.
const NOTHING: f64 = 1e-8;

/// Eigenvalues of this size are 0 but for rounding: pieces of a packing that do not touch each other can be moved apart.
const ZERO: f64 = 1e-7;

/// A Ritz value counts when its residual is this part of it, or less.
const DECIDED: f64 = 0.5;

/// A positive Ritz value has to count at so many looks in a row: a mode of few particles has a small part in the first vector
/// and comes out a few products later than the modes of all. With one look, a buckled strut among 1292 particles was missed.
const LOOKS: usize = 4;

/// What [`judge`] found.
#[derive(Clone, Debug)]
pub(crate) struct Judgement {
    pub(crate) stability: Stability,
    /// Of a saddle, the displacements of the particles that grow, up to a factor.
    pub(crate) way_down: Vec<Vec2>,
}

impl From<Stability> for Judgement {
    fn from(stability: Stability) -> Self {
        Self {
            stability,
            way_down: Vec::new(),
        }
    }
}

/// Judges the packing that `model` has the contacts and forces of.
pub(crate) fn judge(packing: &Packing, model: &AnyModel) -> Judgement {
    let contacts = model.contacts(packing);
    let net = model.f_max() * model.line_tension();
    let borne: Vec<bool> = contacts.forces.iter().map(|f| *f > BORNE * net).collect();
    let bearing = contacts.forces.iter().zip(&borne).filter(|(_, b)| **b);
    let (number, sum) = bearing.fold((0.0, 0.0), |(n, s), (f, _)| (n + 1.0, s + f));
    if number == 0.0 {
        // Far from balance it does not show who bears a force.
        let told = model.f_max() <= ROUGH;
        let stability = if told {
            Stability::NotJammed
        } else {
            Stability::NotJudged
        };
        return stability.into();
    }
    if sum < BALANCED * net * number || contacts.distances.contains(&0.0) {
        return Stability::NotJudged.into();
    }
    let held = held(packing.len(), contacts.pairs);
    let counts = |&c: &usize| {
        let [i, j] = contacts.pairs[c];
        borne[c] || (held[i as usize] && held[j as usize])
    };
    let kept: Vec<_> = (0..borne.len()).filter(counts).map(|c| c..c + 1).collect();
    let part;
    let contacts = if kept.len() == borne.len() {
        contacts
    } else {
        part = FrameContacts::picked(&contacts, &kept);
        part.view()
    };
    let judged = match model {
        AnyModel::MorseWitten(droplets) if kept.len() == borne.len() => {
            lowest_of_droplets(packing, droplets.law(), droplets.form())
        }
        AnyModel::MorseWitten(droplets) => {
            let mut law = droplets.law().clone();
            law.restore(packing, contacts.pairs, contacts.forces);
            lowest_of_droplets(packing, &law, droplets.form())
        }
        AnyModel::Foam(droplets) => {
            let mut linear = droplet::foam::linear::Linear::default();
            let numbers: Vec<usize> = kept.iter().map(|c| c.start).collect();
            let is_set = linear.set(droplets, &numbers);
            let compliances = linear.compliances().to_vec();
            let product = |x: &[f64], y: &mut [f64]| linear.product(x, y, ACCURACY);
            is_set
                .then(|| lowest(packing.len(), &contacts, &compliances, product))
                .flatten()
        }
        AnyModel::Disks(_) => {
            let compliances = disks::compliances(packing, contacts.pairs, model.line_tension());
            lowest(packing.len(), &contacts, &compliances, |x, y| {
                disks::answer(&contacts, &compliances, x, y);
                true
            })
        }
    };
    judged.unwrap_or(Stability::NotJudged.into())
}

fn lowest_of_droplets(packing: &Packing, law: &ContactLaw, form: Form) -> Option<Judgement> {
    let mut linear = Linear::default();
    let mut linear = linear.at(form, law, packing);
    let compliances = law.matrix().diagonal();
    lowest(packing.len(), &law.contacts(), compliances, |x, y| {
        linear.product(x, y, ACCURACY)
    })
}

/// The sign of the lowest eigenvalue of `K u = λ K̃ u`; `None` where it does not show. `product` makes `−K x` of its first argument
/// (two numbers a particle) in its second and says whether it could.
fn lowest(
    particles: usize,
    contacts: &Contacts<'_>,
    compliances: &[f64],
    mut product: impl FnMut(&[f64], &mut [f64]) -> bool,
) -> Option<Judgement> {
    let mut metric = Stiffness::default();
    let mut rebuild = |prestress| metric.rebuild(contacts, compliances, particles, prestress);
    rebuild(PRESTRESS).or_else(|_| rebuild(0.0)).ok()?;
    let mut basis = vec![Displacement::first(particles, contacts.pairs, &metric)?];
    // The products in the basis: h_kl = v_k·K v_l.
    let mut h = DMatrix::zeros(MOST + 1, MOST);
    // Looks in a row at which a positive Ritz value had decided.
    let mut positive = 0;
    // Displacements of the particles that have contacts, but for the two translations: there are no more directions.
    let mut touched = vec![false; particles];
    for &[i, j] in contacts.pairs {
        (touched[i as usize], touched[j as usize]) = (true, true);
    }
    let whole = (2 * touched.iter().filter(|t| **t).count()).saturating_sub(2);
    for k in 0..MOST {
        let mut next = Displacement::default();
        next.force.resize(2 * particles, 0.0);
        if !product(&basis[k].shift, &mut next.force) {
            return None;
        }
        for f in &mut next.force {
            *f = -*f;
        }
        next.answer(&metric);
        for (row, v) in basis.iter().enumerate() {
            h[(row, k)] = dot(&v.shift, &next.force);
            next.subtract(h[(row, k)], v);
        }
        let size = k + 1;
        let length = if size < whole {
            next.normalize(NOTHING)
        } else {
            0.0
        };
        h[(size, k)] = length;
        if size % PERIOD == 0 || length == 0.0 {
            let (theta, vector) = lowest_ritz(&h.view((0, 0), (size, size)).into_owned());
            let residual = length * vector[k].abs();
            let decided = residual < DECIDED * theta.abs();
            positive = if decided && theta > 0.0 {
                positive + 1
            } else {
                0
            };
            if decided && (theta < 0.0 || positive == LOOKS || length == 0.0) {
                return Some(Judgement {
                    stability: if theta > 0.0 {
                        Stability::Minimum
                    } else {
                        Stability::Saddle
                    },
                    way_down: Displacement::sum(&basis, &vector),
                });
            }
            if length == 0.0 {
                break;
            }
        }
        basis.push(next);
    }
    None
}

/// The lowest real part of an eigenvalue of `h` that is not 0, and a vector of unit length that belongs to it.
fn lowest_ritz(h: &DMatrix<f64>) -> (f64, DVector<f64>) {
    let n = h.nrows();
    let values = h.complex_eigenvalues();
    let parts = values.iter().map(|z| z.re).filter(|re| re.abs() > ZERO);
    let theta = parts.fold(f64::INFINITY, f64::min);
    // Inverse iteration, from as near as leaves the matrix regular.
    let shift = theta - 1e-10 * values.iter().fold(0.0, |m: f64, z| m.max(z.re.abs()));
    let factors = (h - DMatrix::identity(n, n) * shift).lu();
    let mut vector = DVector::from_element(n, 1.0);
    for _ in 0..3 {
        if let Some(next) = factors.solve(&vector) {
            vector = next.normalize();
        }
    }
    (theta, vector)
}

/// Displacements `u` and the forces `K̃ u` that they stand for, two numbers a particle.
#[derive(Default)]
struct Displacement {
    shift: Vec<f64>,
    force: Vec<f64>,
}

impl Displacement {
    /// What fixed forces bring about, equal and opposite at the two ends of each contact; soft modes have the largest part in
    /// it. `None` if there is no contact.
    fn first(particles: usize, pairs: &[[u32; 2]], metric: &Stiffness) -> Option<Self> {
        let mut first = Self {
            shift: Vec::new(),
            force: vec![0.0; 2 * particles],
        };
        for (c, &[i, j]) in pairs.iter().enumerate() {
            for axis in 0..2 {
                let x = folded(2 * c + axis + 1);
                first.force[2 * i as usize + axis] += x;
                first.force[2 * j as usize + axis] -= x;
            }
        }
        first.answer(metric);
        (first.normalize(0.0) > 0.0).then_some(first)
    }

    /// The displacements of the forces. These have no total, up to rounding, which `K̃` would make much of.
    fn answer(&mut self, metric: &Stiffness) {
        let pairs = self.force.as_chunks_mut::<2>().0;
        let total = pairs
            .iter()
            .fold([0.0; 2], |t, f| [t[0] + f[0], t[1] + f[1]]);
        let mean = total.map(|t| t / pairs.len() as f64);
        for f in pairs {
            *f = [f[0] - mean[0], f[1] - mean[1]];
        }
        self.shift.clear();
        self.shift.extend_from_slice(&self.force);
        metric.solve(&mut self.shift);
    }

    fn subtract(&mut self, part: f64, other: &Self) {
        for (x, y) in self.shift.iter_mut().zip(&other.shift) {
            *x -= part * y;
        }
        for (x, y) in self.force.iter_mut().zip(&other.force) {
            *x -= part * y;
        }
    }

    /// Gives it the length 1, measured by `K̃`, and returns what it was; 0 if that is not more than `least`.
    fn normalize(&mut self, least: f64) -> f64 {
        let length = dot(&self.shift, &self.force).sqrt();
        if length.is_nan() || length <= least {
            return 0.0;
        }
        for x in self.shift.iter_mut().chain(&mut self.force) {
            *x /= length;
        }
        length
    }

    /// The displacements that `vector` stands for in `basis`.
    fn sum(basis: &[Self], vector: &DVector<f64>) -> Vec<Vec2> {
        let mut sum = vec![Vec2::zeros(); basis[0].shift.len() / 2];
        for (v, c) in basis.iter().zip(vector.iter()) {
            for (s, x) in sum.iter_mut().zip(v.shift.as_chunks::<2>().0) {
                *s += Vec2::new(x[0], x[1]) * *c;
            }
        }
        sum
    }
}
