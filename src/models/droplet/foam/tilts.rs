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

use super::contact_problem::diagonal;
use super::lines::Lines;
use super::state::State;
use crate::domain::Vec2;
use core::f64::consts::PI;

/// The largest tilt, and the longest step (radians).
const LARGEST: f64 = 0.4;
const LONGEST: f64 = 0.1;

/// Turns the tilts of all lines by a step, from the state at the tilts before.
pub(super) fn step(lines: &Lines, state: &State, tilts: &mut [f64]) {
    let (count, loads) = (lines.len(), state.loads());
    let softness: Vec<f64> = (0..count)
        .map(|c| 1.0 / diagonal(lines, state, c))
        .collect();
    let mut stiffness = vec![[0.0; 2]; count];
    for p in 0..lines.droplets() {
        let sides = lines.sides(p);
        let outward = |line: usize, is_second: bool| {
            let n = lines.normals()[line];
            if is_second { -n } else { n }
        };
        let mut net = Vec2::zeros();
        for side in sides {
            let c = side.line as usize;
            net += outward(c, side.is_second) * loads[c];
        }
        let (first, r) = (lines.first_side(p), state.corners()[p]);
        let force = state.droplets()[p].force;
        for (k, side) in sides.iter().enumerate() {
            let c = side.line as usize;
            let f = loads[c];
            let along = net.dot(&outward(c, side.is_second));
            let curvature = (state.sides()[first + k].k - 3.0 * f / (4.0 * PI))
                - (force - f) / (2.0 * PI)
                - (along - f) / PI;
            let (_, slopes) = lines.rows(p, k);
            let mut answer = 0.0;
            for (slope, other) in slopes.iter().zip(sides) {
                let l = other.line as usize;
                if loads[l] > 0.0 {
                    answer += (r * slope) * (r * slope) * softness[l];
                }
            }
            stiffness[c][0] += r * curvature;
            stiffness[c][1] += answer;
        }
    }
    for (c, tilt) in tilts.iter_mut().enumerate() {
        let arm = state.moment_arm(lines, c);
        let [own, answer] = stiffness[c];
        let distance = lines.distances()[c];
        let k = (lines.along(c) + own).max(0.4 * distance) + 1.5 * loads[c] * answer;
        *tilt = (*tilt - (arm / k).clamp(-LONGEST, LONGEST)).clamp(-LARGEST, LARGEST);
    }
}
