//! Contours as polygons, Saitoh (1), (3) and 2.3.
//!
//! A vertex at angle θ lies at `r_i + ρ_i(θ)(cos θ, sin θ)` with `ρ_i(θ) = R_i + (R_i/2πγ) Σ_j f_ij g(θ − θ_j)`. The
//! contour has a cusp at each contact. Vertices at equal angles, as in Saitoh's figures, cut the cusps off; with
//! [`Placement::Contacts`] one more vertex stands on each contact angle, so that the contour is drawn to its tip.
//!
//! Between two neighbouring contacts the contour is one elementary function: with `g(θ) = (π − θ) sin θ − ½ cos θ − 1` and
//! the addition theorems
//!
//! ```text
//! Σ_j f_j g(θ − θ_j) = sin θ (A_c − ½ S_s) − cos θ (A_s + ½ S_c) − θ (sin θ S_c − cos θ S_s) − S
//! S = Σ f_j,  S_c = Σ f_j cos θ_j,  S_s = Σ f_j sin θ_j,  A_c = Σ f_j α_j cos θ_j,  A_s = Σ f_j α_j sin θ_j
//! ```
//!
//! where `α_j = θ_j + π` for the contacts that lie before θ and `θ_j − π` for those behind it, all angles in `(−π, π]`. So a
//! vertex costs the same however many contacts the particle has.
//!
//! Near a contact the notches of the two particles overlap in a thin lens of half-width `f R_eff/γ` and depth
//! `f² R_eff/4γ²`, `R_eff = 2 R_i R_j/(R_i + R_j)`: that is what the linear model says, and it is drawn as it is.

pub use super::arc::{Arc, FilmArc};
use super::foam::Foam;
use super::kernel::{Angles, Direction};
use super::outline::{Circle, Outline};
pub(crate) use super::outline::{Extent, Stretch};
use crate::contacts::{Contacts, FrameContacts};
use crate::domain::Vec2;
use crate::models::Model;
use crate::numerics::wide::wide;
use crate::state::{Frame, Packing};
use core::f64::consts::PI;

/// How a contour becomes a polygon.
///
/// ```
/// use softjam::models::droplet::contour::{ContourStyle, Placement};
/// assert_eq!(ContourStyle::default(), ContourStyle { vertices: 32, placement: Placement::Contacts });
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ContourStyle {
    /// Vertices at equally spaced angles `2πk/n`, at least 3.
    pub vertices: usize,
    /// Where vertices stand.
    pub placement: Placement,
}

impl Default for ContourStyle {
    fn default() -> Self {
        Self {
            vertices: 32,
            placement: Placement::default(),
        }
    }
}

/// Where the vertices of a contour stand.
///
/// ```
/// use softjam::models::droplet::contour::Placement;
/// assert_eq!(Placement::default(), Placement::Contacts);
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Placement {
    /// Equally spaced angles, as in Saitoh's figures.
    Equal,
    /// Equally spaced angles and one vertex on each contact angle.
    #[default]
    Contacts,
}

/// The polygons of all particles of a frame, in one row.
///
/// # Example
///
/// ```
/// use softjam::models::droplet::contour::{ContourStyle, Contours};
/// use softjam::{protocol::Relaxation, scene::Scene};
///
/// let run = Relaxation::new(&Scene { particles: 64, phi: 0.9, ..Scene::default() }).unwrap();
/// let mut contours = Contours::new(ContourStyle::default());
/// let packing = run.packing();
/// contours.draw(packing.radii(), packing.positions(), &run.contacts(), 1.0);
/// assert_eq!(contours.len(), 64);
/// // The area is kept to first order in the forces.
/// let area = |p: &[softjam::domain::Vec2]| -> f64 {
///     p.iter().zip(p.iter().cycle().skip(1)).map(|(a, b)| 0.5 * a.perp(b)).sum()
/// };
/// let disk = std::f64::consts::PI * packing.radii()[0].powi(2);
/// assert!((area(contours.polygon(0)) / disk - 1.0).abs() < 0.02);
/// ```
#[derive(Clone, Debug)]
pub struct Contours {
    style: ContourStyle,
    circle: Circle,
    /// How many of them come before angle 0.
    below: usize,
    /// Polygon `p` is `vertices[first[p]..first[p + 1]]`.
    first: Vec<usize>,
    vertices: Vec<Vec2>,
    /// The contacts of each particle: `contacts[entry[p]..entry[p + 1]]` are its directions and forces.
    entry: Vec<usize>,
    contacts: Vec<(Direction, f64)>,
    /// The unit vectors from `i` to `j` of all contacts, by their components, and their angles.
    toward: [Vec<f64>; 3],
    nodes: Vec<[f64; 2]>,
    evaluations: u64,
    /// Whether forces are passed over.
    circles: bool,
    /// Droplets that keep their area.
    foam: Option<Box<Foam>>,
}

impl Contours {
    /// An empty drawing in the given style.
    #[must_use]
    pub fn new(style: ContourStyle) -> Self {
        let n = style.vertices;
        let below = n - (n / 2 + 1);
        let circle = (0..n)
            .map(|k| (k + n - below) % n)
            .map(|k| 2.0 * PI * k as f64 / n as f64)
            .map(|angle| Direction {
                cos: libm::cos(angle),
                sin: libm::sin(angle),
                angle: if angle > PI { angle - 2.0 * PI } else { angle },
            })
            .collect();
        Self {
            style,
            circle: Circle::of(circle),
            below,
            first: vec![0],
            vertices: Vec::new(),
            entry: Vec::new(),
            contacts: Vec::new(),
            toward: Default::default(),
            nodes: Vec::new(),
            evaluations: 0,
            circles: false,
            foam: None,
        }
    }

    /// Contours of droplets that keep their area, each of which is [told](Self::tell) its frame before it is drawn.
    pub(crate) fn of_foam(style: ContourStyle, foam: Foam) -> Self {
        Self {
            foam: Some(Box::new(foam)),
            ..Self::new(style)
        }
    }

    /// What is drawn next is `frame`, with the radii and the box of `packing`. Droplets with forces that none can bear are drawn as circles.
    pub fn tell(&mut self, packing: &Packing, frame: &Frame) {
        if let Some(foam) = &mut self.foam {
            let mut at = packing.clone();
            frame.positions.clone_into(at.positions_mut());
            self.circles = foam.restore(&at, frame).is_err();
        }
    }

    /// Circles, whatever the forces.
    #[must_use]
    pub fn circles(style: ContourStyle) -> Self {
        Self {
            circles: true,
            ..Self::new(style)
        }
    }

    /// Draws the contours of particles of `radii` at `positions` with `contacts`; `line_tension` is γ.
    ///
    /// A particle without a contact is its circle; nothing is computed for it.
    ///
    /// # Panics
    ///
    /// If a contact names a particle that is not there, or the slices differ in length.
    pub fn draw(
        &mut self,
        radii: &[f64],
        positions: &[Vec2],
        contacts: &Contacts<'_>,
        line_tension: f64,
    ) {
        let mut vertices = core::mem::take(&mut self.vertices);
        let mut first = core::mem::take(&mut self.first);
        vertices.clear();
        first.clear();
        first.push(0);
        self.trace(
            (radii, positions, contacts, line_tension),
            &mut vertices,
            |all, _, _| first.push(all.len()),
        );
        (self.vertices, self.first) = (vertices, first);
    }

    /// Appends the polygons of [`draw`](Self::draw) to `vertices`, in double or in a viewer's single precision; `drawn` is
    /// called after each of them with all vertices so far, the place of its first, and how far it is from a circle.
    pub(crate) fn trace<V: Stretch>(
        &mut self,
        (radii, positions, contacts, line_tension): (&[f64], &[Vec2], &Contacts<'_>, f64),
        vertices: &mut Vec<V>,
        mut drawn: impl FnMut(&mut Vec<V>, usize, Extent),
    ) {
        assert_eq!(radii.len(), positions.len(), "one radius a particle");
        if let Some(foam) = self.foam.as_deref().filter(|_| !self.circles) {
            self.evaluations += foam.trace(radii, positions, self.style.vertices, vertices, drawn);
            return;
        }
        if self.circles {
            self.gather(radii.len(), &FrameContacts::default().view());
        } else {
            self.gather(radii.len(), contacts);
        }
        for (p, (&radius, &centre)) in radii.iter().zip(positions).enumerate() {
            let contacts = &mut self.contacts[self.entry[p]..self.entry[p + 1]];
            let start = vertices.len();
            let mut extent = Extent {
                deepest: 0.0,
                reach: 1.000_001 * radius,
            };
            if contacts.is_empty() {
                let point = |d: &Direction| V::at(centre, *d, radius);
                vertices.extend(self.circle.directions.iter().map(point));
            } else {
                contacts.sort_unstable_by(|a, b| a.0.angle.total_cmp(&b.0.angle));
                let outline = Outline {
                    centre,
                    radius,
                    scale: radius / (2.0 * PI * line_tension),
                };
                let tips = self.style.placement == Placement::Contacts;
                extent = outline.draw(&self.circle, contacts, tips, vertices);
                self.evaluations += (vertices.len() - start) as u64;
            }
            // Equal angles are counted from 0; with vertices on the contacts any of them may be the first.
            if contacts.is_empty() || self.style.placement == Placement::Equal {
                vertices[start..].rotate_left(self.below);
            }
            drawn(vertices, start, extent);
        }
    }

    /// Directions and forces of the contacts, particle by particle.
    fn gather(&mut self, particles: usize, contacts: &Contacts<'_>) {
        self.entry.clear();
        self.entry.resize(particles + 2, 0);
        for p in contacts.pairs.iter().flatten() {
            self.entry[*p as usize + 2] += 1;
        }
        for p in 2..self.entry.len() {
            self.entry[p] += self.entry[p - 1];
        }
        let nowhere = Direction {
            cos: 1.0,
            sin: 0.0,
            angle: 0.0,
        };
        self.contacts
            .resize(2 * contacts.pairs.len(), (nowhere, 0.0));
        let [x, y, angles] = &mut self.toward;
        x.clear();
        x.extend(contacts.normals.iter().map(|n| -n.x));
        y.clear();
        y.extend(contacts.normals.iter().map(|n| -n.y));
        angles.resize(x.len(), 0.0);
        let nodes = &mut self.nodes;
        wide(
            #[inline(always)]
            || Angles::new().of_columns((x, y), nodes, angles),
        );
        // `entry[p + 1]` runs through the places of p and ends where those of p + 1 begin.
        let rows = contacts.pairs.iter().zip(contacts.forces);
        let toward = x.iter().zip(&*y).zip(&*angles);
        for ((&[i, j], &f), ((&cos, &sin), &angle)) in rows.zip(toward) {
            let to_j = Direction { cos, sin, angle };
            for (p, direction) in [(i, to_j), (j, to_j.opposite())] {
                let place = &mut self.entry[p as usize + 1];
                self.contacts[*place] = (direction, f);
                *place += 1;
            }
        }
        self.entry.pop();
    }

    /// Number of polygons drawn last.
    #[must_use]
    pub fn len(&self) -> usize {
        self.first.len() - 1
    }

    /// Whether nothing has been drawn.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The vertices of particle `p`, anticlockwise, not closed; around its wrapped centre, so that a contour may reach
    /// over the edge of the box.
    ///
    /// # Panics
    ///
    /// If there is no particle `p`.
    #[must_use]
    pub fn polygon(&self, p: usize) -> &[Vec2] {
        &self.vertices[self.first[p]..self.first[p + 1]]
    }

    /// The contour of particle `p`, of undeformed `radius`, as arcs, anticlockwise and seen from its centre. `None` for models that do not keep the
    /// area, and on the way to balance.
    ///
    /// # Panics
    ///
    /// If there is no particle `p`.
    #[must_use]
    pub fn arcs(&self, p: usize, radius: f64) -> Option<Vec<Arc>> {
        self.foam_told()?.arcs(p, radius)
    }

    /// The contacts of particles of undeformed `radii`, in the order of their pairs; none for models that do not keep their area.
    ///
    /// ```
    /// use softjam::{models::{Kind, droplet::contour::ContourStyle}, protocol::{Relaxation, Status}, scene::Scene};
    ///
    /// let scene = Scene { particles: 32, phi: 0.92, model: Kind::WetFoam, ..Scene::default() };
    /// let mut run = Relaxation::new(&scene).unwrap();
    /// while run.status() == Status::Running {
    ///     run.advance().unwrap();
    /// }
    /// let mut contours = Kind::WetFoam.contours(ContourStyle::default(), 1.0);
    /// contours.tell(run.packing(), &run.frame());
    /// // Young and Laplace: a film has two sides.
    /// let films = contours.films(run.packing().radii());
    /// assert_eq!(films.len(), run.contacts().pairs.len());
    /// assert!(films.iter().all(|film| (film.arc.curvature() - 0.5 * film.pressure).abs() < 1e-12));
    /// ```
    #[must_use]
    pub fn films(&self, radii: &[f64]) -> Vec<FilmArc> {
        let foam = self.foam_told();
        foam.map_or_else(Vec::new, |foam| foam.film_arcs(radii))
    }

    fn foam_told(&self) -> Option<&Foam> {
        self.foam.as_deref().filter(|_| !self.circles)
    }

    /// Number of vertices of all polygons.
    #[must_use]
    pub fn vertices(&self) -> usize {
        self.vertices.len()
    }

    /// How many vertices of particles with a contact were computed so far: a count of work.
    #[must_use]
    pub fn evaluations(&self) -> u64 {
        self.evaluations
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::models::droplet::kernel::g;

    /// One particle at the origin pushed from the given angles.
    fn squeezed(style: ContourStyle, angles: &[f64], force: f64) -> Vec<Vec2> {
        let n = angles.len();
        let pairs: Vec<_> = (0..n).map(|k| [0, k as u32 + 1]).collect();
        let normals: Vec<_> = angles
            .iter()
            .map(|t| -Vec2::new(libm::cos(*t), libm::sin(*t)))
            .collect();
        let contacts = Contacts {
            pairs: &pairs,
            normals: &normals,
            distances: &vec![1.0; n],
            overlaps: &vec![0.0; n],
            forces: &vec![force; n],
        };
        let mut contours = Contours::new(style);
        contours.draw(
            &vec![0.5; n + 1],
            &vec![Vec2::zeros(); n + 1],
            &contacts,
            2.0,
        );
        contours.polygon(0).to_vec()
    }

    #[test]
    fn every_vertex_lies_on_rho_of_its_angle() {
        let angles = [0.3, 2.0, -1.9];
        for placement in [Placement::Equal, Placement::Contacts] {
            let style = ContourStyle {
                vertices: 40,
                placement,
            };
            let polygon = squeezed(style, &angles, 0.3);
            assert_eq!(
                polygon.len(),
                if placement == Placement::Equal {
                    40
                } else {
                    43
                }
            );
            for v in &polygon {
                let theta = libm::atan2(v.y, v.x);
                let rho: f64 =
                    0.5 + 0.5 / (4.0 * PI) * angles.iter().map(|a| 0.3 * g(theta - a)).sum::<f64>();
                assert!((v.norm() - rho).abs() < 1e-14);
            }
        }
    }

    #[test]
    fn vertices_on_contact_angles_reach_the_tip_of_the_cusp() {
        let style = ContourStyle {
            vertices: 16,
            placement: Placement::Contacts,
        };
        let tip = 0.5 + 0.5 / (4.0 * PI) * 0.3 * (g(0.0) + g(2.0));
        let polygon = squeezed(style, &[0.5, 2.5], 0.3);
        let least = polygon.iter().map(Vec2::norm).fold(1.0, f64::min);
        assert!((least - tip).abs() < 1e-14);
    }

    #[test]
    fn polygons_run_anticlockwise() {
        let polygon = squeezed(ContourStyle::default(), &[0.1, 3.0], 0.2);
        for (a, b) in polygon.iter().zip(polygon.iter().cycle().skip(1)) {
            assert!(a.perp(b) > 0.0);
        }
    }

    #[test]
    fn a_contact_free_particle_costs_no_evaluation() {
        let mut contours = Contours::new(ContourStyle::default());
        let none = Contacts {
            pairs: &[],
            normals: &[],
            distances: &[],
            overlaps: &[],
            forces: &[],
        };
        contours.draw(&[0.7], &[Vec2::new(2.0, 1.0)], &none, 1.0);
        assert_eq!(contours.evaluations(), 0);
        for v in contours.polygon(0) {
            assert!(((v - Vec2::new(2.0, 1.0)).norm() - 0.7).abs() < 1e-15);
        }
    }
}
