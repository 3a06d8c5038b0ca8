//! What a protocol does to a packing: stress against strain, and pressure against coverage.

use super::{Axis, Curve, FigureError, Mark, chart_in};

/// A relaxed state of a protocol.
///
/// See the example of [`Course`].
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct RelaxedState {
    /// The strain so far.
    pub strain: f64,
    /// The coverage.
    pub phi: f64,
    /// The area of the box (length²).
    pub area: f64,
    /// The stored energy (γ·length).
    pub energy: f64,
    /// The stress `(σ_xx, σ_xy, σ_yy)`, tension positive (γ/length).
    pub stress: [f64; 3],
}

/// The relaxed states of one run of a protocol.
///
/// ```
/// use softjam::figure::{CHART_WIDTH, Course, RelaxedState, pressure_phi, stress_strain};
///
/// let states = [0.010, 0.011, 0.003, 0.004].iter().enumerate().map(|(k, &shear)| RelaxedState {
///     strain: 0.001 * k as f64,
///     phi: 0.86,
///     area: 100.0,
///     stress: [-0.03, shear, -0.03],
///     ..RelaxedState::default()
/// });
/// let course = Course { label: "φ = 0.86".to_owned(), states: states.collect(), diameter: 1.0, ..Course::default() };
/// assert_eq!(course.yields().collect::<Vec<_>>(), [1]);
/// let svg = stress_strain(CHART_WIDTH, &[course.clone()]).unwrap();
/// assert!(svg.contains("yield event"));
/// // Nothing was compressed.
/// assert!(pressure_phi(CHART_WIDTH, &[course]).is_err());
/// ```
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Course {
    /// What it is called in the legend; runs of one name share a colour.
    pub label: String,
    /// The states, in order.
    pub states: Vec<RelaxedState>,
    /// Whether the shear is a pure one, whose stress is `σ_xx − σ_yy` and not `σ_xy`.
    pub pure: bool,
    /// Whether the forces are the gradient of the energy, so that what a step loses of energy says where particles rearrange.
    pub has_potential: bool,
    /// The smallest diameter (length).
    pub diameter: f64,
    /// What its searches found for φ_J.
    pub phi_j: Vec<f64>,
}

/// A step that loses more energy than this, per area and strain² and in γ a diameter, is a yield event: in elastic steps it is below 1.
const LOST: f64 = 3.0;

/// And so is one in which the stress falls by more than this times the strain (γ a diameter), which is steeper than it ever rises.
const FALLS: f64 = 1.0;

/// Each state is a dot in pressure against coverage unless there are more.
const DOTS: usize = 200;

impl Course {
    /// The numbers of the states behind which particles rearrange in a step of shear.
    ///
    /// Those are steps in which the stress falls steeply or, where the forces have a potential, the work is more than what the energy rises by.
    pub fn yields(&self) -> impl Iterator<Item = usize> + '_ {
        let pairs = self.states.windows(2).enumerate();
        pairs.filter_map(|(k, pair)| {
            let (before, behind) = (&pair[0], &pair[1]);
            let step = behind.strain - before.strain;
            let [from, to] = [before, behind].map(|state| self.shear_stress(state));
            let stored = (behind.energy - before.energy) / before.area;
            let lost = (0.5 * (from + to) * step - stored) / (step * step);
            let falls = self.diameter * (from - to) / step > FALLS;
            let loses = self.has_potential && self.diameter * lost > LOST;
            (step != 0.0 && (falls || loses)).then_some(k)
        })
    }

    /// The stress that does work in the shear.
    fn shear_stress(&self, state: &RelaxedState) -> f64 {
        let [xx, xy, yy] = state.stress;
        if self.pure { xx - yy } else { xy }
    }

    /// The stretches of states between which the strain changes, or else between which it does not.
    fn stretches(&self, sheared: bool) -> impl Iterator<Item = &[RelaxedState]> {
        let together = move |a: &RelaxedState, b: &RelaxedState| {
            let is_sheared = a.strain.to_bits() != b.strain.to_bits();
            is_sheared == sheared
        };
        self.states
            .chunk_by(together)
            .filter(|stretch| stretch.len() > 1)
    }

    fn curves(&self, sheared: bool, point: impl Fn(&RelaxedState) -> (f64, f64)) -> Vec<Curve> {
        let curve = |stretch: &[RelaxedState]| Curve {
            label: self.label.clone(),
            points: stretch.iter().map(&point).collect(),
            ..Curve::default()
        };
        self.stretches(sheared).map(curve).collect()
    }
}

/// Draws shear stress against strain in a figure of this width (pixels of the SVG, 96 an inch), with a dot at the state before each
/// [yield event](Course::yields).
///
/// # Errors
///
/// [`FigureError::Nothing`] if nothing is sheared, or one run by simple and another by pure shear.
///
/// See the example of [`Course`].
pub fn stress_strain(width: f64, runs: &[Course]) -> Result<String, FigureError> {
    let nothing = |problem: &str| Err(FigureError::Nothing(problem.to_owned()));
    let (mut curves, mut events) = (Vec::new(), Vec::new());
    for run in runs {
        let place = |state: &RelaxedState| (state.strain, run.shear_stress(state));
        curves.extend(run.curves(true, place));
        events.extend(run.yields().map(|k| place(&run.states[k])));
    }
    let pure = runs.iter().any(|run| run.pure);
    if runs.iter().any(|run| run.pure != pure) {
        return nothing(
            "simple and pure shear have stresses of their own: draw one figure of each",
        );
    }
    if curves.is_empty() {
        return nothing("there is no shear to draw");
    }
    if !events.is_empty() {
        curves.push(Curve {
            label: "yield event".to_owned(),
            points: events,
            mark: Mark::Dots,
            ..Curve::default()
        });
    }
    let stress = if pure {
        "σ_xx − σ_yy (γ/length)"
    } else {
        "σ_xy (γ/length)"
    };
    chart_in(width, &axis("strain"), &axis(stress), &curves)
}

/// Draws pressure against coverage in a figure of this width (pixels of the SVG, 96 an inch), each state a dot if they are not too many, and φ_J as
/// a dashed line.
///
/// # Errors
///
/// [`FigureError::Nothing`] if the coverage does not change.
///
/// See the example of [`Course`].
pub fn pressure_phi(width: f64, runs: &[Course]) -> Result<String, FigureError> {
    let pressure = |state: &RelaxedState| -0.5 * (state.stress[0] + state.stress[2]);
    let mut curves = Vec::new();
    for run in runs {
        curves.extend(run.curves(false, |state| (state.phi, pressure(state))));
    }
    let points = || curves.iter().flat_map(|curve: &Curve| &curve.points);
    let highest = points().map(|point| point.1).fold(0.0, f64::max);
    if curves.is_empty() {
        let problem = "there is no change of coverage to draw".to_owned();
        return Err(FigureError::Nothing(problem));
    }
    if points().count() <= DOTS {
        let dots = |curve: &Curve| Curve {
            mark: Mark::Dots,
            ..curve.clone()
        };
        curves.extend(curves.iter().map(dots).collect::<Vec<_>>());
    }
    let found: Vec<f64> = runs.iter().flat_map(|run| &run.phi_j).copied().collect();
    let label = match found[..] {
        [phi_j] => format!("φ_J = {phi_j:.6}"),
        _ => "φ_J".to_owned(),
    };
    curves.extend(found.iter().map(|&phi_j| Curve {
        label: label.clone(),
        points: vec![(phi_j, 0.0), (phi_j, highest)],
        mark: Mark::Dashes,
        ..Curve::default()
    }));
    let coverage = axis("coverage φ of the undeformed disks");
    chart_in(width, &coverage, &axis("pressure (γ/length)"), &curves)
}

fn axis(title: &str) -> Axis {
    Axis {
        title: title.to_owned(),
        ..Axis::default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sheared(stress: [f64; 3], energies: [f64; 3], has_potential: bool) -> Course {
        let states = stress.iter().zip(energies).enumerate();
        let states = states.map(|(k, (&xy, energy))| RelaxedState {
            strain: -0.001 * k as f64,
            area: 100.0,
            energy,
            stress: [0.0, xy, 0.0],
            ..RelaxedState::default()
        });
        Course {
            states: states.collect(),
            has_potential,
            diameter: 1.0,
            ..Course::default()
        }
    }

    #[test]
    fn a_step_that_loses_energy_yields_and_a_softer_one_does_not() {
        // Backwards, so that stress falls where it builds up. The work of a step is 100 · 0.001 times the mean stress.
        let stress = [-0.010, -0.012, -0.011_95];
        let elastic = [0.0, 0.0011, 0.0011 + 0.001_197_5];
        let yields = |course: Course| course.yields().collect::<Vec<_>>();
        assert!(yields(sheared(stress, elastic, true)).is_empty());
        let lossy = [0.0, 0.0011, 0.0011 + 0.000_8];
        assert_eq!(yields(sheared(stress, lossy, true)), [1]);
        assert!(yields(sheared(stress, lossy, false)).is_empty());
        let drop = [-0.010, -0.012, -0.0109];
        assert_eq!(yields(sheared(drop, elastic, false)), [1]);
    }
}
