//! FIRE 2.0, the minimiser of both stages.
//!
//! J. Guénolé et al., Comput. Mater. Sci. 175, 109584 (2020), after E. Bitzek et al., Phys. Rev. Lett. 97, 170201
//! (2006): damped dynamics that turns the velocity towards the force while the power `P = F·v` is positive, and stops
//! and steps back half a move when it is not. Mass 1; semi-implicit Euler; the mixing comes before the move.
//!
//! See the example of [`Fire`].

use crate::domain::{Domain, Vec2};
use crate::minimize::newton::Turns;
use crate::numerics::wide::wide;
use crate::state::Numbers;

/// FIRE's parameters; the defaults are those of the paper.
///
/// # Example
///
/// ```
/// use softjam::minimize::fire::Fire;
/// assert_eq!(Fire::default().delay, 20);
/// ```
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Fire {
    /// `N_delay`: moves with `P > 0` before the time step grows.
    pub delay: u32,
    /// `f_inc` > 1: growth of the time step.
    pub increase: f64,
    /// `f_dec`, between 0 and 1: its cut when `P ≤ 0`.
    pub decrease: f64,
    /// `α_start`, between 0 and 1: the mixing after a stop. Bitzek's 0.1 takes fewer steps here than the 0.25 of FIRE 2.0, for
    /// disks and for droplets, and bears a longer time step.
    pub mixing: f64,
    /// `f_α`, between 0 and 1: decay of the mixing.
    pub mixing_decay: f64,
    /// The time step starts at this fraction of `dt_max`, between 0 and 1.
    pub first_dt: f64,
    /// The time step is cut no further than this fraction of `dt_max`, between 0 and 1.
    pub least_dt: f64,
}

impl Default for Fire {
    fn default() -> Self {
        Self {
            delay: 20,
            increase: 1.1,
            decrease: 0.5,
            mixing: 0.1,
            mixing_decay: 0.99,
            first_dt: 0.1,
            least_dt: 0.002,
        }
    }
}

/// What FIRE carries from one move to the next.
///
/// # Example
///
/// ```
/// use softjam::minimize::fire::{Fire, FireState};
///
/// let state = FireState::start(&Fire::default(), 0.2);
/// assert_eq!(FireState::from_values(&state.values()), Some(state));
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FireState {
    /// Time step (time).
    pub dt: f64,
    /// Upper bound of the time step (time), from the largest frequency at the start.
    pub dt_max: f64,
    /// Mixing of velocity and force, dimensionless.
    pub alpha: f64,
    /// Moves since `P` was last ≤ 0.
    pub downhill: u32,
    /// Moves made in all.
    pub moves: u32,
    /// Simulated time, the sum of the time steps (time).
    pub time: f64,
    /// How FIRE and Newton's method take turns; nothing but zeros unless Newton's method was tried.
    pub turns: Turns,
}

impl FireState {
    /// The names of the recorded [`values`](Self::values), in their order.
    pub const NAMES: [&str; 9] = [
        "dt",
        "dt_max",
        "alpha",
        "downhill",
        "moves",
        "time",
        "newton_moves",
        "newton_failures",
        "newton_wait",
    ];

    /// The state at the start of a relaxation with the given bound of the time step.
    #[must_use]
    pub fn start(fire: &Fire, dt_max: f64) -> Self {
        Self {
            dt: fire.first_dt * dt_max,
            dt_max,
            alpha: fire.mixing,
            downhill: 0,
            moves: 0,
            time: 0.0,
            turns: Turns::default(),
        }
    }

    /// FIRE from rest: time step and mixing as at the start, the counts go on.
    pub(crate) fn restart(&mut self, fire: &Fire) {
        self.dt = fire.first_dt * self.dt_max;
        self.alpha = fire.mixing;
        self.downhill = 0;
    }

    /// The state as it is recorded: `dt`, `dt_max`, `alpha`, `downhill`, `moves`, `time`; and, once Newton's method was
    /// tried, the three numbers of its [`Turns`]: `moves`, `failures`, `wait`.
    #[must_use]
    pub fn values(&self) -> Vec<f64> {
        let mut values = vec![
            self.dt,
            self.dt_max,
            self.alpha,
            f64::from(self.downhill),
            f64::from(self.moves),
            self.time,
        ];
        if self.turns != Turns::default() {
            let Turns {
                moves,
                failures,
                wait,
            } = self.turns;
            values.extend([moves, failures, wait].map(f64::from));
        }
        values
    }

    /// [`values`](Self::values) under the name of the minimiser.
    #[must_use]
    pub fn numbers(&self) -> Numbers {
        let values = self.values();
        let name = if values.len() == 6 {
            "fire"
        } else {
            "fire+newton"
        };
        Numbers::new(name, values)
    }

    /// The state in the numbers of a frame; `None` if they are another minimiser's.
    #[must_use]
    pub fn of(numbers: &Numbers) -> Option<Self> {
        let state = Self::from_values(numbers.values())?;
        (state.numbers().name() == numbers.name()).then_some(state)
    }

    /// The state from its recorded values; `None` if there are neither six nor nine, if a count is not a whole
    /// number, or if the last three are all zero.
    #[must_use]
    pub fn from_values(values: &[f64]) -> Option<Self> {
        let &[dt, dt_max, alpha, downhill, moves, time, ref rest @ ..] = values else {
            return None;
        };
        let count = |x: f64| {
            let n = x as u32; // saturates; the comparison catches whatever was not a count
            (f64::from(n).to_bits() == x.to_bits()).then_some(n)
        };
        let turns = match *rest {
            [] => Turns::default(),
            [moves, failures, wait] => Some(Turns {
                moves: count(moves)?,
                failures: count(failures)?,
                wait: count(wait)?,
            })
            .filter(|turns| *turns != Turns::default())?,
            _ => return None,
        };
        Some(Self {
            dt,
            dt_max,
            alpha,
            downhill: count(downhill)?,
            moves: count(moves)?,
            time,
            turns,
        })
    }
}

impl Fire {
    /// One move: changes state, velocities and positions; the positions end wrapped into `domain`.
    ///
    /// All slices have one entry a particle. Velocities start from zero. What is returned is no less than the distance
    /// (length) by which any particle has moved, at most √2 times as much; infinite after a step back, or if a velocity is no number.
    ///
    /// # Example
    ///
    /// A particle on a spring comes to rest:
    ///
    /// ```
    /// use softjam::domain::{Domain, Vec2};
    /// use softjam::minimize::fire::{Fire, FireState};
    ///
    /// let (fire, domain) = (Fire::default(), Domain::new(10.0, 10.0).unwrap());
    /// let (mut x, mut v) = (vec![Vec2::new(6.0, 4.0)], vec![Vec2::zeros()]);
    /// let mut state = FireState::start(&fire, 0.5);
    /// let home = Vec2::new(5.0, 5.0);
    /// for _ in 0..300 {
    ///     let (before, force) = (x[0], [home - x[0]]);
    ///     let moved = fire.advance(&mut state, &force, &mut v, &mut x, domain);
    ///     assert!((x[0] - before).norm() <= moved + 1e-14);
    /// }
    /// assert!((x[0] - home).norm() < 1e-10);
    /// ```
    pub fn advance(
        &self,
        state: &mut FireState,
        forces: &[Vec2],
        velocities: &mut [Vec2],
        positions: &mut [Vec2],
        domain: Domain,
    ) -> f64 {
        wide(
            #[inline(always)]
            || self.advance_here(state, forces, velocities, positions, domain),
        )
    }

    #[inline(always)]
    fn advance_here(
        &self,
        state: &mut FireState,
        forces: &[Vec2],
        velocities: &mut [Vec2],
        positions: &mut [Vec2],
        domain: Domain,
    ) -> f64 {
        let power = power(forces, velocities);
        let mut back = 0.0;
        if power > 0.0 {
            state.downhill = state.downhill.saturating_add(1);
            if state.downhill > self.delay {
                state.dt = (state.dt * self.increase).min(state.dt_max);
                state.alpha *= self.mixing_decay;
            }
        } else {
            state.downhill = 0;
            // The first moves are given time to find their way.
            if state.moves >= self.delay {
                state.dt = (state.dt * self.decrease).max(self.least_dt * state.dt_max);
                state.alpha = self.mixing;
            }
            back = -0.5 * state.dt;
        }
        let kept = if power > 0.0 { 1.0 } else { 0.0 };
        if back != 0.0 {
            for (x, v) in positions.iter_mut().zip(&*velocities) {
                *x += v * back;
            }
        }
        // Sums by component: two chains each, in one order.
        let (mut vv, mut ff) = (Vec2::zeros(), Vec2::zeros());
        for (v, f) in velocities.iter_mut().zip(forces) {
            *v = *v * kept + f * state.dt;
            vv += v.component_mul(v);
            ff += f.component_mul(f);
        }
        let (vv, ff) = (vv.x + vv.y, ff.x + ff.y);
        let towards = if ff > 0.0 {
            state.alpha * (vv / ff).sqrt()
        } else {
            0.0
        };
        let keep = 1.0 - state.alpha;
        let dt = state.dt;
        let mut reached = Reached::default();
        let (x2, x_rest) = positions.as_chunks_mut::<2>();
        let (v2, v_rest) = velocities.as_chunks_mut::<2>();
        let (f2, f_rest) = forces.as_chunks::<2>();
        for ((x, v), f) in x2.iter_mut().zip(v2).zip(f2) {
            for k in 0..2 {
                v[k] = v[k] * keep + f[k] * towards;
                x[k] += v[k] * dt;
            }
            reached.add(x, v);
        }
        for ((x, v), f) in x_rest.iter_mut().zip(v_rest).zip(f_rest) {
            *v = *v * keep + f * towards;
            *x += *v * dt;
            reached.add(&[*x; 2], &[*v; 2]);
        }
        let numbers = (vv + ff).is_finite();
        if !(numbers && reached.within(domain)) {
            for x in positions {
                *x = domain.wrap(*x);
            }
        }
        state.moves = state.moves.saturating_add(1);
        state.time += dt;
        if back == 0.0 && numbers {
            // Something for the rounding.
            reached.speed() * dt * (1.0 + 1e-12)
        } else {
            f64::INFINITY
        }
    }
}

/// The extremes of coordinates and of the components of velocities, two particles at a time. A NaN is passed over.
#[derive(Default)]
struct Reached {
    lowest: [Vec2; 2],
    highest: [Vec2; 2],
    fastest: [Vec2; 2],
}

impl Reached {
    #[inline(always)]
    fn add(&mut self, positions: &[Vec2; 2], velocities: &[Vec2; 2]) {
        let lower = |m: f64, x: f64| if x < m { x } else { m };
        let higher = |m: f64, x: f64| if x > m { x } else { m };
        for k in 0..2 {
            let (m, x) = (&mut self.lowest[k], positions[k]);
            *m = Vec2::new(lower(m.x, x.x), lower(m.y, x.y));
            let m = &mut self.highest[k];
            *m = Vec2::new(higher(m.x, x.x), higher(m.y, x.y));
            let (m, v) = (&mut self.fastest[k], velocities[k]);
            *m = Vec2::new(higher(m.x, v.x.abs()), higher(m.y, v.y.abs()));
        }
    }

    /// Whether all positions lie in the box.
    fn within(&self, domain: Domain) -> bool {
        let lowest = self.lowest[0].inf(&self.lowest[1]);
        let highest = self.highest[0].sup(&self.highest[1]);
        domain.contains(lowest) && domain.contains(highest)
    }

    /// A speed that no particle exceeds, at most √2 times the largest.
    fn speed(&self) -> f64 {
        self.fastest[0].sup(&self.fastest[1]).norm()
    }
}

/// `P = F·v`, summed in one fixed order, four particles wide.
#[inline(always)]
fn power(forces: &[Vec2], velocities: &[Vec2]) -> f64 {
    let (f4, f_rest) = forces.as_chunks::<4>();
    let (v4, v_rest) = velocities.as_chunks::<4>();
    let mut sums = [Vec2::zeros(); 4];
    for (f, v) in f4.iter().zip(v4) {
        for k in 0..4 {
            sums[k] += f[k].component_mul(&v[k]);
        }
    }
    let rest: f64 = f_rest.iter().zip(v_rest).map(|(f, v)| f.dot(v)).sum();
    total(&sums) + rest
}

/// Not inlined: the compiler would arrange the loop before for what is done once behind it.
#[inline(never)]
fn total(sums: &[Vec2; 4]) -> f64 {
    let [a, b, c, d] = sums.map(|s| s.x + s.y);
    (a + b) + (c + d)
}
