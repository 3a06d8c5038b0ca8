//! A packing: the box, the undeformed radii and the centres.

use crate::domain::{Domain, Vec2};
use crate::text::counted;
use core::f64::consts::PI;
use std::sync::Arc;

/// `N` particles of fixed undeformed radii in a periodic box.
///
/// Lengths are in the unit of the radii, whichever that is: with the default mixture the diameter of the small particle.
///
/// # Example
///
/// ```
/// use softjam::domain::{Domain, Vec2};
/// use softjam::state::Packing;
///
/// let packing = Packing::new(
///     Domain::new(10.0, 10.0).unwrap(),
///     vec![0.5, 0.7],
///     vec![Vec2::new(9.8, 5.0), Vec2::new(0.9, 5.0)],
/// ).unwrap();
/// assert_eq!(packing.len(), 2);
/// // The pair overlaps across the box edge: δ = 0.5 + 0.7 − 1.1.
/// let separation = packing.separation(0, 1);
/// assert!((separation.norm() - 1.1).abs() < 1e-14);
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Packing {
    domain: Domain,
    /// Shared by the copies of a packing, since they never change.
    radii: Arc<[f64]>,
    /// The smallest, the largest and the mean of them, which every step asks for.
    sizes: [f64; 3],
    positions: Vec<Vec2>,
}

/// Why a packing cannot be made.
///
/// ```
/// use softjam::{domain::{Domain, Vec2}, state::{Packing, PackingError}};
/// let domain = Domain::new(8.0, 8.0).unwrap();
/// let error = Packing::new(domain, vec![-0.5], vec![Vec2::new(1.0, 1.0)]).unwrap_err();
/// assert!(error.to_string().contains("-0.5"), "{error}");
/// ```
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum PackingError {
    /// A radius is not positive and finite.
    #[error("radius {radius} of particle {particle} is not a positive, finite length")]
    Radius {
        /// The particle.
        particle: usize,
        /// Its radius.
        radius: f64,
    },
    /// A position is not finite.
    #[error("position ({x}, {y}) of particle {particle} is not finite")]
    Position {
        /// The particle.
        particle: usize,
        /// Its abscissa.
        x: f64,
        /// Its ordinate.
        y: f64,
    },
    /// Radii and positions do not have the same number.
    #[error("radii: {radii}, positions: {positions}; a packing needs one radius a particle")]
    Count {
        /// Number of radii.
        radii: usize,
        /// Number of positions.
        positions: usize,
    },
    /// A packing has at least one and at most `u32::MAX` particles.
    #[error("{}: a packing has between 1 and 4294967295", counted(.0, "particle"))]
    Number(usize),
}

impl Packing {
    /// A packing of particles with `radii` at `positions`, which are wrapped into the box.
    ///
    /// # Errors
    ///
    /// [`PackingError`] when a radius is not positive and finite, a position is not finite, the two lists differ in
    /// length or there is no particle.
    pub fn new(
        domain: Domain,
        radii: Vec<f64>,
        mut positions: Vec<Vec2>,
    ) -> Result<Self, PackingError> {
        if radii.len() != positions.len() {
            return Err(PackingError::Count {
                radii: radii.len(),
                positions: positions.len(),
            });
        }
        if radii.is_empty() || u32::try_from(radii.len()).is_err() {
            return Err(PackingError::Number(radii.len()));
        }
        for (particle, &radius) in radii.iter().enumerate() {
            if !(radius.is_finite() && radius > 0.0) {
                return Err(PackingError::Radius { particle, radius });
            }
        }
        for (particle, p) in positions.iter_mut().enumerate() {
            if !(p.x.is_finite() && p.y.is_finite()) {
                return Err(PackingError::Position {
                    particle,
                    x: p.x,
                    y: p.y,
                });
            }
            *p = domain.wrap(*p);
        }
        let smallest = radii.iter().copied().fold(f64::INFINITY, f64::min);
        let largest = radii.iter().copied().fold(0.0, f64::max);
        let mean = radii.iter().sum::<f64>() / radii.len() as f64;
        Ok(Self {
            domain,
            radii: radii.into(),
            sizes: [smallest, largest, mean],
            positions,
        })
    }

    /// Number of particles `N`.
    #[must_use]
    #[expect(clippy::len_without_is_empty, reason = "a packing is never empty")]
    pub fn len(&self) -> usize {
        self.radii.len()
    }

    /// The periodic box.
    #[must_use]
    pub fn domain(&self) -> Domain {
        self.domain
    }

    /// The undeformed radii `R_i`.
    #[must_use]
    pub fn radii(&self) -> &[f64] {
        &self.radii
    }

    /// The largest undeformed radius.
    #[must_use]
    pub fn largest_radius(&self) -> f64 {
        self.sizes[1]
    }

    /// The smallest undeformed radius.
    pub(crate) fn smallest_radius(&self) -> f64 {
        self.sizes[0]
    }

    /// The largest radius, or twice the mean where that is less: what the skin of a neighbour list is measured by. By a particle much
    /// larger than the others it would hold a crowd of pairs for each of them.
    pub(crate) fn ample_radius(&self) -> f64 {
        let [_, largest, mean] = self.sizes;
        largest.min(2.0 * mean)
    }

    /// The centres `r_i`, wrapped into the box.
    #[must_use]
    pub fn positions(&self) -> &[Vec2] {
        &self.positions
    }

    /// Puts the particles into another box, whose corner stays where it is; positions are the caller's to wrap.
    pub(crate) fn set_domain(&mut self, domain: Domain) {
        self.domain = domain;
    }

    /// The centres, to be moved; whoever moves them keeps them wrapped and finite.
    pub(crate) fn positions_mut(&mut self) -> &mut Vec<Vec2> {
        &mut self.positions
    }

    /// Whether the box and the radii are those of `other`; for copies of one packing without a look at the radii.
    pub(crate) fn same_particles(&self, other: &Self) -> bool {
        self.domain == other.domain
            && (Arc::ptr_eq(&self.radii, &other.radii) || self.radii == other.radii)
    }

    /// The vector from particle `j` to the nearest image of particle `i`.
    ///
    /// # Panics
    ///
    /// If `i` or `j` is not below [`len`](Self::len).
    #[must_use]
    #[inline]
    pub fn separation(&self, i: usize, j: usize) -> Vec2 {
        self.domain
            .minimum_image(self.positions[i] - self.positions[j])
    }

    /// The coverage of the undeformed disks, `φ = Σ π R_i² / (L_x L_y)`.
    #[must_use]
    pub fn coverage(&self) -> f64 {
        coverage(&self.radii, self.domain)
    }
}

/// `φ = Σ π R_i² / (L_x L_y)`.
pub(crate) fn coverage(radii: &[f64], domain: Domain) -> f64 {
    radii.iter().map(|r| PI * r * r).sum::<f64>() / domain.area()
}

/// The unit vector and the length of a separation; coincident centres are told apart along x, by definition.
///
/// Two centres on the very same point have no direction. They are given one, +x for the particle of lower index, so
/// that forces stay finite and a replay takes the same way.
#[inline]
pub(crate) fn unit_and_length(separation: Vec2) -> (Vec2, f64) {
    let r = (separation.x * separation.x + separation.y * separation.y).sqrt();
    if r > 0.0 {
        (separation * (1.0 / r), r)
    } else {
        (Vec2::new(1.0, 0.0), 0.0)
    }
}
