//! What a frame is worth in numbers: balance, energy, pressure, stress, coordination.

use super::{Backbone, sums::Sums};
use crate::contacts::Contacts;
use crate::domain::Domain;
#[cfg(feature = "recording")]
use crate::models::Kind;
use crate::models::droplet::contact::ContactLaw;
use crate::models::{AnyModel, Model};
use crate::state::Packing;

/// The recorded metrics by name; a recording has one scalar each under `/metrics/`.
///
/// `log10_f_max` is there because the viewer has no logarithmic axis; below 1e-18 it stays at −18.
pub const METRICS: [&str; 14] = [
    "f_max",
    "log10_f_max",
    "energy",
    "pressure",
    "coordination",
    "contacts",
    "rattlers",
    "dt",
    "stress_xy",
    "moment",
    "phi",
    "strain",
    "stress_xx",
    "stress_yy",
];

/// The values of [`METRICS`]; none where a model has no such number.
pub type Metrics = [Option<f64>; METRICS.len()];

/// Which of the [`METRICS`] a model has, in a run whose box a protocol changes or in another.
#[cfg(feature = "recording")]
pub(crate) fn metrics_of(model: Kind, is_strained: bool) -> [bool; METRICS.len()] {
    METRICS.map(|name| match name {
        "moment" => model.balances_moments(),
        "phi" | "strain" | "stress_xx" | "stress_yy" => is_strained,
        _ => true,
    })
}

/// What a frame is worth in numbers, all in units of the line tension γ: they do not depend on its value.
///
/// # Example
///
/// ```
/// use softjam::{protocol::Relaxation, scene::Scene};
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
    /// Stress `(σ_xx, σ_xy, σ_yy)`, tension positive (γ/length); see the [module](super#stress).
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
    /// The largest moment `f |T|` of a contact (γ·length), where moments are balanced beside forces.
    pub moment: Option<f64>,
    /// Coverage `φ` of the undeformed disks, and the strain so far, where a protocol changes the box.
    pub phi_and_strain: Option<[f64; 2]>,
}

impl Observables {
    /// Observables of contacts in `domain` at line tension γ (force), with `f_max` in units of γ and the time step `dt`.
    ///
    /// # Panics
    ///
    /// If a contact names a particle of index ≥ `particles`.
    ///
    /// ```
    /// use softjam::{contacts::Contacts, domain::{Domain, Vec2}, analysis::Observables};
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

    /// Observables of what `model` found last, with the time step `dt` and a counter of rattlers that remembers the frame before.
    pub(crate) fn of_model(
        model: &AnyModel,
        packing: &Packing,
        dt: f64,
        backbone: &mut Backbone,
    ) -> Self {
        let (domain, particles) = (packing.domain(), packing.len());
        let (gamma, f_max) = (model.line_tension(), model.f_max());
        let AnyModel::MorseWitten(droplets) = model else {
            let contacts = model.contacts(packing);
            let o = Self::counted(&contacts, domain, particles, gamma, (f_max, dt), backbone);
            let AnyModel::Foam(foam) = model else {
                return o;
            };
            let scale = domain.area() * gamma;
            return Self {
                energy: foam.energy(),
                stress: foam.moments().map(|sum| (0.0 - sum) / scale),
                moment: Some(foam.moment()),
                ..o
            };
        };
        let law = droplets.law();
        let o = Self::of_law(law, packing, (f_max, dt), backbone);
        if model.torques().is_empty() {
            return o;
        }
        o.with_torques(&law.contacts(), domain, gamma, model.torques())
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
    /// normal turned by a quarter. It belongs to the [gradient form](crate::models::droplet::Form::Gradient) and has no trace: energy and pressure
    /// are those of the central form.
    ///
    /// ```
    /// use softjam::{contacts::Contacts, domain::{Domain, Vec2}, analysis::Observables};
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
    #[must_use]
    pub fn metrics(&self) -> Metrics {
        [
            Some(self.f_max),
            Some(libm::log10(self.f_max.max(1e-18))),
            Some(self.energy),
            Some(self.pressure()),
            Some(self.coordination()),
            Some(self.contacts as f64),
            Some(self.rattlers as f64),
            Some(self.dt),
            Some(self.stress[1]),
            self.moment,
            self.phi_and_strain.map(|[phi, _]| phi),
            self.phi_and_strain.map(|[_, strain]| strain),
            self.phi_and_strain.map(|_| self.stress[0]),
            self.phi_and_strain.map(|_| self.stress[2]),
        ]
    }

    /// `σ_xx` (γ/length), tension positive: negative in a compressed packing.
    #[must_use]
    pub fn stress_xx(&self) -> f64 {
        self.stress[0]
    }

    /// `σ_xy = σ_yx` (γ/length).
    #[must_use]
    pub fn stress_xy(&self) -> f64 {
        self.stress[1]
    }

    /// `σ_yy` (γ/length), tension positive.
    #[must_use]
    pub fn stress_yy(&self) -> f64 {
        self.stress[2]
    }

    /// Pressure `p = −tr σ/2 = (1/2V) Σ_c f_c r_c` (γ/length).
    #[must_use]
    pub fn pressure(&self) -> f64 {
        // Adding 0 makes the pressure of no contacts 0 and not −0.
        -0.5 * (self.stress[0] + self.stress[2]) + 0.0
    }

    /// Mean coordination number of the particles that are held, `Z = 2 N_c / (N − N_rattlers)`, `N_c` the contacts
    /// among them; 0 when all rattle.
    #[must_use]
    pub fn coordination(&self) -> f64 {
        mean_coordination(self.backbone_contacts, self.particles - self.rattlers)
    }
}

/// `Z = 2 N_c / N` of `held` particles with `contacts` among them; 0 where there is none.
fn mean_coordination(contacts: usize, held: usize) -> f64 {
    if held == 0 {
        0.0
    } else {
        2.0 * contacts as f64 / held as f64
    }
}
