//! Tilts: each line turns until both halves of its contact have one midpoint, `T = 0`.
//!
//! One diagonal step of Newton's method a call, for lines without a force, too: their gap is then the true one of the two contours.
//!
//! ```text
//! τ −= clamp(T/k, ±0.1),     |τ| ≤ 0.4
//! k_c = max( n·Δx + Σ_p r_p D_c, 0.4 |Δx| )  +  1.5 f_c Σ_p Σ_l (r_p G_cl)²/B_ll          l: sides that bear a force
//! D_c = Σ_{l≠c} f_l g''_cl/2π = (K_c − 3f_c/4π) − (F − f_c)/2π − (F⃗·n_c − f_c)/π          n_c outward, F⃗ = Σ f n
//! ```
//!
//! The last term of `k` is the answer of the forces; without it steps overshoot where forces are strong.

use super::compliance::Compliance;
use super::lines::Lines;
use super::sides::{LANES, Lanes, product, total, with_width};
use super::state::State;
use crate::numerics::wide::wide;
use core::f64::consts::PI;

/// The largest tilt, and the longest step (radians).
pub(super) const LARGEST: f64 = 0.4;
const LONGEST: f64 = 0.1;

/// Sine and cosine of half a tilt, right to the last bit or its neighbour up to [`LARGEST`]: what their series leave out there is below 1e-17.
#[inline(always)]
pub(super) fn half_turn(tilt: f64) -> (f64, f64) {
    const SIN: [f64; 6] = [
        1.0,
        -1.0 / 6.0,
        1.0 / 120.0,
        -1.0 / 5040.0,
        1.0 / 362_880.0,
        -1.0 / 39_916_800.0,
    ];
    const COS: [f64; 7] = [
        1.0,
        -1.0 / 2.0,
        1.0 / 24.0,
        -1.0 / 720.0,
        1.0 / 40_320.0,
        -1.0 / 3_628_800.0,
        1.0 / 479_001_600.0,
    ];
    let half = 0.5 * tilt;
    let square = half * half;
    let mut sin = SIN[5];
    for k in (1..5).rev() {
        sin = SIN[k] + square * sin;
    }
    let mut cos = COS[6];
    for k in (0..6).rev() {
        cos = COS[k] + square * cos;
    }
    (half + half * (square * sin), cos)
}

/// Room for a step.
#[derive(Clone, Debug, Default)]
pub(super) struct Tilting {
    compliance: Compliance,
    /// By sides: `1/B_ll` where there is a force; `r D`; and `r² Σ_l G²/B_ll`.
    yielding: Vec<Lanes>,
    curvatures: Vec<Lanes>,
    answers: Vec<Lanes>,
    /// By sides: `r M` (length).
    arms: Vec<Lanes>,
}

impl Tilting {
    /// Turns the tilts of all lines by a step, from the state at the tilts before.
    pub fn step(&mut self, lines: &Lines, state: &State, tilts: &mut [f64]) {
        self.compliance.find(lines, state);
        wide(
            #[inline(always)]
            || {
                self.prepare(lines, state);
                self.turn(lines, state, tilts);
            },
        );
    }

    #[inline(always)]
    fn prepare(&mut self, lines: &Lines, state: &State) {
        let layout = lines.layout();
        let yields = self.compliance.diagonal().iter().zip(state.loads());
        let yields = yields.map(|(b, load)| [if *load > 0.0 { 1.0 / b } else { 0.0 }; 2]);
        layout.scatter(&mut self.yielding, yields);
        self.curvatures.resize(layout.groups(), [0.0; LANES]);
        self.answers.resize(layout.groups(), [0.0; LANES]);
        self.arms.resize(layout.groups(), [0.0; LANES]);
        let columns = [&mut self.curvatures, &mut self.answers, &mut self.arms];
        let columns = columns.map(|column| &mut column[..]);
        find_stiffness(lines, state, &self.yielding, columns);
    }

    #[inline(always)]
    fn turn(&self, lines: &Lines, state: &State, tilts: &mut [f64]) {
        let columns = [&self.curvatures, &self.answers, &self.arms];
        let [curvatures, answers, arms] = columns.map(|column| column.as_flattened());
        let (loads, sides) = (state.loads(), lines.layout().of_lines());
        let given = sides.iter().zip(loads).zip(lines.distances());
        let given = given.zip(lines.shorter().iter().zip(lines.across()));
        for (tilt, (((sides, load), distance), (shorter, across))) in tilts.iter_mut().zip(given) {
            let [a, b] = sides.map(|side| side as usize);
            let own = curvatures[a] + curvatures[b];
            let answer = answers[a] + answers[b];
            let arm = across + arms[a] + arms[b];
            let k = ((distance - shorter) + own).max(0.4 * distance) + 1.5 * load * answer;
            let step = (arm / k).clamp(-LONGEST, LONGEST);
            *tilt = (*tilt - step).clamp(-LARGEST, LARGEST);
        }
    }
}

/// `r D`, `r² Σ_l G²/B_ll` and `r M` of all sides.
#[inline(always)]
fn find_stiffness(
    lines: &Lines,
    state: &State,
    yielding: &[Lanes],
    [curvatures, answers, arms]: [&mut [Lanes]; 3],
) {
    let ([x, y], slopes) = (lines.outward(), lines.slopes());
    let (pushes, kernel) = (state.pushes(), state.kernel_sums());
    for place in lines.layout().places() {
        let groups = place.groups();
        let (droplet, r) = (
            &state.droplets()[place.droplet()],
            state.corners()[place.droplet()],
        );
        let (mut net_x, mut net_y) = (0.0, 0.0);
        for g in groups.clone() {
            net_x += total(product(&x[g], &pushes[g]));
            net_y += total(product(&y[g], &pushes[g]));
        }
        let rows = &slopes[place.rows()];
        let yielding = yielding[groups.clone()].as_flattened();
        with_width(
            place.width(),
            #[inline(always)]
            |width| {
                for at in 0..width {
                    let mut answer = [0.0; LANES];
                    for (row, yielding) in rows[at..].chunks(width).zip(yielding) {
                        for l in 0..LANES {
                            answer[l] += row[0][l] * row[0][l] * yielding;
                        }
                    }
                    answers[groups.start + at] = answer;
                }
            },
        );
        for g in groups {
            let (f, kernel, x, y) = (&pushes[g], &kernel[g], &x[g], &y[g]);
            let mut answer = answers[g];
            let (mut curvature, mut arm) = ([0.0; LANES], state.midpoints()[g]);
            for k in 0..LANES {
                let along = net_x * x[k] + net_y * y[k];
                curvature[k] = r
                    * ((kernel[k] - 0.75 / PI * f[k])
                        - 0.5 / PI * (droplet.force - f[k])
                        - 1.0 / PI * (along - f[k]));
                answer[k] *= r * r;
                arm[k] *= r;
            }
            (curvatures[g], answers[g], arms[g]) = (curvature, answer, arm);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn half_turns_are_right_to_the_last_bit_or_its_neighbour() {
        for k in -4000..=4000 {
            let tilt = LARGEST * f64::from(k) / 4000.0;
            let ((sin, cos), (s, c)) = (half_turn(tilt), libm::sincos(0.5 * tilt));
            assert!((sin - s).abs() <= f64::EPSILON * s.abs(), "{tilt}");
            assert!((cos - c).abs() <= f64::EPSILON, "{tilt}");
        }
    }
}
