//! The two forms of the net force.

use super::turning::Turning;
use crate::contacts::Contacts;
use crate::contacts::net_forces;
use crate::domain::Vec2;
use crate::models::droplet::contact::ContactLaw;
use crate::state::Packing;

/// Which forces move the particles; see the [module](super) for what the two mean.
///
/// ```
/// assert_eq!(softjam::models::droplet::Form::default(), softjam::models::droplet::Form::Central);
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Form {
    /// `F_i = Σ_j f_ij n_ij`, Saitoh 2.2.3: along the lines of centres, not the gradient of an energy.
    #[default]
    Central,
    /// `F_i = −∂U/∂r_i`: the central form and, at each contact, a tangential force of O(f²).
    Gradient,
}

/// The net forces of one form, with the buffers that they need.
///
/// # Example
///
/// Three particles around a fourth, unevenly: its contacts push aside as well as away, and no total force or torque is left.
///
/// ```
/// use softjam::models::droplet::contact::ContactLaw;
/// use softjam::domain::{Domain, Vec2};
/// use softjam::models::droplet::{Form, NetForces};
/// use softjam::state::Packing;
///
/// let positions = [(4.0, 4.0), (4.95, 4.0), (4.2, 4.9), (3.3, 3.4)].map(|(x, y)| Vec2::new(x, y));
/// let packing = Packing::new(Domain::new(9.0, 9.0).unwrap(), vec![0.5; 4], positions.to_vec()).unwrap();
/// let mut law = ContactLaw::default();
/// law.solve(&packing, &[], &[]).unwrap();
///
/// let mut forces = NetForces::new(Form::Gradient);
/// let mut net = vec![Vec2::zeros(); 4];
/// forces.evaluate(&law.contacts(), &packing, 1.0, &mut net);
/// let total: Vec2 = net.iter().sum();
/// let torque: f64 = net.iter().zip(&positions).map(|(f, r)| r.x * f.y - r.y * f.x).sum();
/// assert!(total.norm() < 1e-15 && torque.abs() < 1e-15);
/// assert!(forces.torques().iter().any(|t| t.abs() > 1e-3));
/// ```
#[derive(Clone, Debug, Default)]
pub struct NetForces {
    form: Form,
    turning: Turning,
    torques: Vec<f64>,
}

impl NetForces {
    /// Of the given form.
    #[must_use]
    pub fn new(form: Form) -> Self {
        Self {
            form,
            ..Self::default()
        }
    }

    /// The form.
    #[must_use]
    pub fn form(&self) -> Form {
        self.form
    }

    /// The net force on each particle into `net` (force). `packing` gives the radii, `line_tension` is γ (force).
    ///
    /// Sums run in the order of the contact list, so the bits depend on the contacts alone.
    ///
    /// # Panics
    ///
    /// If a contact names a particle beyond the packing or `net`.
    pub fn evaluate(
        &mut self,
        contacts: &Contacts<'_>,
        packing: &Packing,
        line_tension: f64,
        net: &mut [Vec2],
    ) {
        net_forces(contacts, net);
        if self.form == Form::Central {
            return;
        }
        self.turning.rebuild(contacts, packing, line_tension);
        self.turning.torques(contacts.forces, &mut self.torques);
        for (c, &[i, j]) in contacts.pairs.iter().enumerate() {
            if contacts.distances[c] == 0.0 {
                // Coincident centres have no direction that could turn.
                continue;
            }
            let push = tangent(contacts.normals[c]) * (self.torques[c] / contacts.distances[c]);
            net[i as usize] += push;
            net[j as usize] -= push;
        }
    }

    /// [`evaluate`](Self::evaluate) with the contacts that `law` found last; the same bits, and the contacts need not be put in
    /// order for it.
    pub(crate) fn evaluate_law(&mut self, law: &ContactLaw, packing: &Packing, net: &mut [Vec2]) {
        if self.form == Form::Gradient {
            self.evaluate(&law.contacts(), packing, law.line_tension(), net);
        } else {
            law.sum_forces(net);
        }
    }

    /// The torques `τ_c` of the contacts evaluated last (force times length); empty for the central form.
    #[must_use]
    pub fn torques(&self) -> &[f64] {
        &self.torques
    }
}

/// The normal turned by a quarter: the way in which `r_i − r_j` moves when the contact turns.
#[inline]
pub(crate) fn tangent(normal: Vec2) -> Vec2 {
    Vec2::new(-normal.y, normal.x)
}
