//! Net forces and what is read off them: balance, energy, pressure, stress, coordination.
//!
//! # Two forms of the net force
//!
//! *Central*, Saitoh 2.2.3: `F_i = Σ_j f_ij n_ij`. It acts along the lines of centres and is not the gradient of anything:
//! no energy need fall on the way to balance, and none is searched for.
//!
//! *Gradient*: `F_i = −∂U/∂r_i` of the stored energy of the contact problem (force times length),
//!
//! ```text
//! U(r) = max over f ≥ 0 of  δᵀf − ½ fᵀA f  =  ½ Σ_c δ_c f_c .
//! ```
//!
//! At the maximum a change of `f` does not change `U` (where the contact set changes, `f = 0` there), so only the explicit
//! dependence on the positions counts: `−∂U/∂r = −(∂δ/∂r)ᵀ f + ½ fᵀ (∂A/∂r) f`. With `δ_c = R_i + R_j − r_c` the first
//! term is the central form. `A` depends on the positions through the angles `φ_c` of its contacts only,
//!
//! ```text
//! A_cc' = −Σ_p (R_p/2πγ) g(φ_c − φ_c'),        G_cc' = ∂A_cc'/∂φ_c = −(R_p/2πγ) g'(φ_c − φ_c') = −G_c'c
//! ½ fᵀ dA f = ½ Σ_cc' f_c f_c' G_cc' (dφ_c − dφ_c') = Σ_c τ_c dφ_c,        τ_c = f_c Σ_c' G_cc' f_c'
//! ```
//!
//! (`G`: length per force and radian, `τ`: force times length), where the last step uses that `G` is odd: every pair occurs
//! twice, with the same value. A contact turns by `dφ_c = t_c·(dr_i − dr_j)/r_c`, `t_c` being `n_c` turned by a quarter.
//! Hence
//!
//! ```text
//! F_i = Σ_j ( f_ij n_ij + (τ_ij / r_ij) t_ij ),
//! ```
//!
//! a tangential force at each contact that depends on the other contacts of its two particles: a three-body force, O(f²).
//! What one contact of a couple gains in torque the other loses, so `Σ τ_c = 0`: no total force, no total torque. `g'` jumps
//! from −π to π at angle 0, where no two contacts of a particle lie. `U` is continuous with its first derivatives, also where
//! contacts open and close. An isotropic rescaling turns no contact: `p = −dU/dV` holds with both forms.
//!
//! # Stress
//!
//! The stress that the contacts exert, averaged over the box of area `V = L_x L_y`, *tension positive*: a compressed packing has
//! negative `σ_xx` and `σ_yy`, and `p = −(σ_xx + σ_yy)/2` is positive. From the derivative of `U` with an affine strain, `V σ_αβ =
//! ∂U/∂ε_αβ` at fixed contact forces,
//!
//! ```text
//! central:   σ_αβ = −(1/V) Σ_c f_c r_c n_α n_β
//! gradient:  σ_αβ = −(1/V) Σ_c ( f_c r_c n_α n_β + τ_c (t_α n_β + n_α t_β)/2 )
//! ```
//!
//! (γ/length), with `n` from one particle of the contact to the other (either way) and `t` turned from it by a quarter,
//! counter-clockwise. The second term has no trace and is symmetric because `Σ τ_c = 0`. The share of the contours' own line
//! tension and of the pressure in the droplets is not in it: it is isotropic in a free droplet and no contact's doing.
//!
//! `σ_xy` is a recorded metric, `stress_xy`; all three come from a recorded state by [`FrameForces`], `softjam info` and
//! `softjam info --json`.
//!
//! # How far apart their packings lie
//!
//! N = 256, 15 random starts each, relaxed to `f_max ≤ 1e-12` γ. Medians of the root mean square and the largest displacement
//! (lengths; rattlers left out, the common translation taken off) between the packings that central and gradient forces
//! make of the same start, and between the central packing and what gradient forces make of *that*; of the relative change of energy
//! and pressure from the central packing to that of the gradient form; and of Z in both
//! (`cargo run --release --example forms`):
//!
//! | φ | same start: rms | largest | onward: rms | largest | energy | pressure | Z central | Z gradient |
//! | --- | --- | --- | --- | --- | --- | --- | --- | --- |
//! | 0.86 | 0.0015 | 0.0062 | 0.0014 | 0.0043 | −0.009 % | −0.19 % | 4.598 | 4.601 |
//! | 0.90 | 0.0084 | 0.041 | 0.0060 | 0.026 | −0.039 % | −0.47 % | 5.180 | 5.195 |
//! | 0.95 | 0.015 | 0.082 | 0.011 | 0.050 | −0.076 % | −0.50 % | 5.625 | 5.633 |
//! | 1.00 | 0.076 | 0.38 | 0.021 | 0.095 | −0.028 % | −0.50 % | 5.938 | 5.969 |

mod backbone;
mod form;
mod frame;
mod sums;
pub(crate) mod turning;

pub use backbone::{Backbone, backbone, held};
pub(crate) use form::tangent;
pub use form::{Form, NetForces};
pub use frame::FrameForces;

use crate::contact::{ContactLaw, Contacts};
use crate::domain::{Domain, Vec2};
use crate::packing::Packing;
use crate::wide::wide;
use sums::Sums;
pub(crate) use sums::sum_of_forces;

/// The recorded metrics by name; a recording has one scalar each under `/metrics/`.
///
/// `log10_f_max` is there because the viewer has no logarithmic axis; below 1e-18 it stays at −18.
///
/// ```
/// assert_eq!(softjam::force::METRICS.len(), 9);
/// ```
pub const METRICS: [&str; 9] = [
    "f_max",
    "log10_f_max",
    "energy",
    "pressure",
    "coordination",
    "contacts",
    "rattlers",
    "dt",
    "stress_xy",
];

/// The values of [`METRICS`].
///
/// See the example of [`Observables::metrics`].
pub type Metrics = [f64; METRICS.len()];

/// Net forces of the contacts on each particle, `F_i = Σ_j f_ij n_ij` (force), summed in the order of the contact list.
///
/// # Panics
///
/// If a contact names a particle beyond `net`.
///
/// # Example
///
/// ```
/// use softjam::contact::Contacts;
/// use softjam::domain::Vec2;
/// use softjam::force::net_forces;
///
/// let contacts = Contacts {
///     pairs: &[[0, 1]],
///     normals: &[Vec2::new(-1.0, 0.0)],
///     distances: &[0.9],
///     overlaps: &[0.1],
///     forces: &[0.4],
/// };
/// let mut net = vec![Vec2::zeros(); 2];
/// net_forces(&contacts, &mut net);
/// assert_eq!(net, [Vec2::new(-0.4, 0.0), Vec2::new(0.4, 0.0)]);
/// ```
pub fn net_forces(contacts: &Contacts<'_>, net: &mut [Vec2]) {
    net.fill(Vec2::zeros());
    let forces = contacts.normals.iter().zip(contacts.forces);
    let Some(&[mut first, _]) = contacts.pairs.first() else {
        return;
    };
    // Contacts of one particle follow each other: its sum stays out of memory until they end.
    let mut sum_of_first = Vec2::zeros();
    for (&[i, j], (n, &f)) in contacts.pairs.iter().zip(forces) {
        let force = n * f;
        if i != first {
            net[first as usize] = sum_of_first;
            (first, sum_of_first) = (i, net[i as usize]);
        }
        sum_of_first += force;
        net[j as usize] -= force;
    }
    net[first as usize] = sum_of_first;
}

/// `f_max`, the largest magnitude of a net force (force): the measure of equilibrium, Saitoh 2.4.
///
/// # Example
///
/// ```
/// use softjam::{domain::Vec2, force::largest_force};
/// assert_eq!(largest_force(&[Vec2::new(3.0, 4.0), Vec2::new(1.0, 0.0)]), 5.0);
/// assert!(largest_force(&[Vec2::new(f64::NAN, 4.0), Vec2::new(1.0, 0.0)]).is_nan());
/// ```
#[must_use]
pub fn largest_force(net: &[Vec2]) -> f64 {
    let (net4, rest) = net.as_chunks::<4>();
    let larger = |m: f64, s: f64| if s > m { s } else { m };
    let (most, sums) = wide(
        #[inline(always)]
        || {
            // A NaN hides behind comparisons, not behind a sum.
            let (mut most, mut sums) = ([0.0; 4], [0.0; 4]);
            for f in net4 {
                for k in 0..4 {
                    let squared = f[k].x * f[k].x + f[k].y * f[k].y;
                    most[k] = larger(most[k], squared);
                    sums[k] += squared;
                }
            }
            (most, sums)
        },
    );
    let rest = rest.iter().map(Vec2::norm_squared);
    let sum: f64 = sums.into_iter().chain(rest.clone()).sum();
    let most = most.into_iter().chain(rest).fold(0.0, larger);
    if sum.is_nan() { sum } else { most.sqrt() }
}

/// What a frame is worth in numbers, all in units of the line tension γ: they do not depend on its value.
///
/// # Example
///
/// ```
/// use softjam::{relax::Relaxation, scene::Scene};
///
/// let relaxation = Relaxation::new(&Scene { particles: 64, phi: 0.9, ..Scene::default() }).unwrap();
/// let o = relaxation.observables();
/// assert!(o.coordination() > 4.0);
/// assert!((o.pressure() + 0.5 * (o.stress[0] + o.stress[2])).abs() < 1e-15);
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Observables {
    /// Number of particles `N`.
    pub particles: usize,
    /// Largest net force `f_max` (units of γ).
    pub f_max: f64,
    /// Stored energy of the contact problem `U = ½ Σ_c δ_c f_c` (γ·length).
    pub energy: f64,
    /// Stress `(σ_xx, σ_xy, σ_yy)`, tension positive (γ/length); see the [module](self#stress).
    pub stress: [f64; 3],
    /// Number of contacts with `f > 0`.
    pub contacts: usize,
    /// Number of contacts among the particles that are held.
    pub backbone_contacts: usize,
    /// Number of rattlers: particles with fewer than three contacts with `f > 0`, not counting contacts with rattlers.
    ///
    /// Without friction two contacts hold a particle only if they face each other exactly. Until the last digit is
    /// relaxed a rattler rests on a neighbour with some force below `f_max`; counting contacts alone would miss it.
    pub rattlers: usize,
    /// The minimiser's time step.
    pub dt: f64,
}

impl Observables {
    /// Observables of contacts in `domain` at line tension γ (force), with `f_max` in units of γ and the time step `dt`.
    ///
    /// # Panics
    ///
    /// If a contact names a particle of index ≥ `particles`.
    ///
    /// ```
    /// use softjam::{contact::Contacts, domain::{Domain, Vec2}, force::Observables};
    ///
    /// let contacts = Contacts {
    ///     pairs: &[[0, 1]],
    ///     normals: &[Vec2::new(-1.0, 0.0)],
    ///     distances: &[0.9],
    ///     overlaps: &[0.1],
    ///     forces: &[0.4],
    /// };
    /// let o = Observables::of(&contacts, Domain::new(6.0, 6.0).unwrap(), 3, 1.0, (0.4, 0.1));
    /// assert_eq!((o.contacts, o.rattlers, o.coordination()), (1, 3, 0.0), "one contact holds nobody");
    /// assert_eq!(o.energy, 0.5 * 0.1 * 0.4);
    /// assert!((o.pressure() - 0.4 * 0.9 / 72.0).abs() < 1e-16);
    /// ```
    #[must_use]
    pub fn of(
        contacts: &Contacts<'_>,
        domain: Domain,
        particles: usize,
        line_tension: f64,
        (f_max, dt): (f64, f64),
    ) -> Self {
        let counter = &mut Backbone::default();
        Self::counted(
            contacts,
            domain,
            particles,
            line_tension,
            (f_max, dt),
            counter,
        )
    }

    /// [`of`](Self::of) with a counter of rattlers that remembers the frame before.
    ///
    /// # Panics
    ///
    /// If a contact names a particle of index ≥ `particles`.
    ///
    /// See the example of [`Backbone`].
    #[must_use]
    pub fn counted(
        contacts: &Contacts<'_>,
        domain: Domain,
        particles: usize,
        line_tension: f64,
        (f_max, dt): (f64, f64),
        backbone: &mut Backbone,
    ) -> Self {
        let mut o = Self::summed(contacts, domain, line_tension);
        (o.particles, o.f_max, o.dt) = (particles, f_max, dt);
        (o.rattlers, o.backbone_contacts) =
            backbone.count_touching(particles, contacts, o.contacts);
        o
    }

    /// [`counted`](Self::counted) with the contacts that `law` found last: the same bits, and the contacts need not be put in
    /// order for it.
    pub(crate) fn of_law(
        law: &ContactLaw,
        packing: &Packing,
        (f_max, dt): (f64, f64),
        backbone: &mut Backbone,
    ) -> Self {
        let particles = packing.len();
        let mut o = Self::summed(&law.numbered(), packing.domain(), law.line_tension());
        (o.particles, o.f_max, o.dt) = (particles, f_max, dt);
        (o.rattlers, o.backbone_contacts) = backbone.count_law(particles, law, o.contacts);
        o
    }

    /// What is summed over contacts, in whatever order.
    fn summed(contacts: &Contacts<'_>, domain: Domain, line_tension: f64) -> Self {
        let sums = Sums::of(contacts);
        let scale = domain.area() * line_tension;
        Self {
            energy: 0.5 * sums.work / line_tension,
            stress: sums.moments.map(|sum| (0.0 - sum) / scale),
            contacts: sums.touching,
            ..Self::default()
        }
    }

    /// These observables with the stress of the torques added: `σ_αβ −= (1/V) Σ_c τ_c ½ (t_α n_β + t_β n_α)`, with `t` the
    /// normal turned by a quarter. It belongs to the [gradient form](Form::Gradient) and has no trace: energy and pressure
    /// are those of the central form.
    ///
    /// ```
    /// use softjam::{contact::Contacts, domain::{Domain, Vec2}, force::Observables};
    ///
    /// let contacts = Contacts {
    ///     pairs: &[[0, 1]],
    ///     normals: &[Vec2::new(-1.0, 0.0)],
    ///     distances: &[0.9],
    ///     overlaps: &[0.1],
    ///     forces: &[0.4],
    /// };
    /// let domain = Domain::new(6.0, 6.0).unwrap();
    /// let o = Observables::default().with_torques(&contacts, domain, 1.0, &[0.36]);
    /// assert_eq!(o.stress, [0.0, -0.36 / 72.0, 0.0]);
    /// ```
    #[must_use]
    pub fn with_torques(
        mut self,
        contacts: &Contacts<'_>,
        domain: Domain,
        line_tension: f64,
        torques: &[f64],
    ) -> Self {
        let mut sums = [0.0; 2];
        for (n, torque) in contacts.normals.iter().zip(torques) {
            sums[0] += torque * n.x * n.y;
            sums[1] += 0.5 * torque * (n.x * n.x - n.y * n.y);
        }
        let scale = domain.area() * line_tension;
        self.stress[0] += sums[0] / scale;
        self.stress[1] -= sums[1] / scale;
        self.stress[2] -= sums[0] / scale;
        self
    }

    /// The metrics as they are recorded, in the order of [`METRICS`].
    ///
    /// ```
    /// # use softjam::force::{METRICS, Observables};
    /// let metrics = Observables { f_max: 0.01, ..Observables::default() }.metrics();
    /// assert_eq!(METRICS[..2], ["f_max", "log10_f_max"]);
    /// assert_eq!(metrics[..2], [0.01, -2.0]);
    /// ```
    #[must_use]
    pub fn metrics(&self) -> Metrics {
        [
            self.f_max,
            libm::log10(self.f_max.max(1e-18)),
            self.energy,
            self.pressure(),
            self.coordination(),
            self.contacts as f64,
            self.rattlers as f64,
            self.dt,
            self.stress[1],
        ]
    }

    /// `σ_xx` (γ/length), tension positive: negative in a compressed packing.
    ///
    /// ```
    /// # use softjam::force::Observables;
    /// let o = Observables { stress: [-0.2, 0.1, -0.4], ..Observables::default() };
    /// assert_eq!((o.stress_xx(), o.stress_xy(), o.stress_yy()), (-0.2, 0.1, -0.4));
    /// ```
    #[must_use]
    pub fn stress_xx(&self) -> f64 {
        self.stress[0]
    }

    /// `σ_xy = σ_yx` (γ/length).
    ///
    /// See the example of [`stress_xx`](Self::stress_xx).
    #[must_use]
    pub fn stress_xy(&self) -> f64 {
        self.stress[1]
    }

    /// `σ_yy` (γ/length), tension positive.
    ///
    /// See the example of [`stress_xx`](Self::stress_xx).
    #[must_use]
    pub fn stress_yy(&self) -> f64 {
        self.stress[2]
    }

    /// Pressure `p = −tr σ/2 = (1/2V) Σ_c f_c r_c` (γ/length).
    ///
    /// ```
    /// # use softjam::force::Observables;
    /// let o = Observables { stress: [-0.2, 0.0, -0.4], ..Observables::default() };
    /// assert!((o.pressure() - 0.3).abs() < 1e-15);
    /// ```
    #[must_use]
    pub fn pressure(&self) -> f64 {
        // Adding 0 makes the pressure of no contacts 0 and not −0.
        -0.5 * (self.stress[0] + self.stress[2]) + 0.0
    }

    /// Mean coordination number of the particles that are held, `Z = 2 N_c / (N − N_rattlers)`, `N_c` the contacts
    /// among them; 0 when all rattle.
    ///
    /// ```
    /// # use softjam::force::Observables;
    /// let o = Observables { particles: 10, rattlers: 2, backbone_contacts: 16, ..Observables::default() };
    /// assert_eq!(o.coordination(), 4.0);
    /// ```
    #[must_use]
    pub fn coordination(&self) -> f64 {
        mean_coordination(self.backbone_contacts, self.particles - self.rattlers)
    }
}

/// `Z = 2 N_c / N` of `held` particles with `contacts` among them; 0 where there is none.
pub(crate) fn mean_coordination(contacts: usize, held: usize) -> f64 {
    if held == 0 {
        0.0
    } else {
        2.0 * contacts as f64 / held as f64
    }
}
