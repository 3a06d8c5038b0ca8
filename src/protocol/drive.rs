//! What a protocol does next: a function of its stage, of what a frame says of the way so far, and of the relaxed packing.

use crate::domain::{Domain, Vec2};
use crate::scene::{Act, Increment, Shear, Until, Way};
use crate::state::Packing;

/// How far a stage has come: its part of a frame.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Progress {
    /// The strain of all stages so far.
    pub strain: f64,
    /// Steps of the stage.
    pub count: u64,
    /// The step at which the present state began to relax.
    pub began: u64,
    /// Strain and coverage at the beginning of the stage.
    strain_before: f64,
    phi_before: f64,
    /// The box then: its sides and its tilt.
    sides: [f64; 2],
    tilt: f64,
    /// What a search knows.
    known: Vec<f64>,
}

/// Numbers that every stage has.
const OF_ALL: usize = 8;

impl Progress {
    /// A stage that begins at `step` with a packing that was strained so far.
    pub fn begin(strain: f64, packing: &Packing, step: u64) -> Self {
        let [x, y, tilt] = packing.domain().values();
        Self {
            strain,
            count: 0,
            began: step,
            strain_before: strain,
            phi_before: packing.coverage(),
            sides: [x, y],
            tilt,
            known: Vec::new(),
        }
    }

    /// The same way in a run of another model, of which a search knows nothing.
    pub fn forgotten(self) -> Self {
        let known = Vec::new();
        Self { known, ..self }
    }

    /// As a frame has them.
    pub fn values(&self) -> Vec<f64> {
        let [x, y] = self.sides;
        let of_all: [f64; OF_ALL] = [
            self.strain,
            self.count as f64,
            self.began as f64,
            self.strain_before,
            self.phi_before,
            x,
            y,
            self.tilt,
        ];
        of_all.iter().chain(&self.known).copied().collect()
    }

    /// What a frame of so many particles has; `None` if no stage has such numbers.
    pub fn from_values(values: &[f64], act: Act, particles: usize) -> Option<Self> {
        let (of_all, known) = values.split_first_chunk::<OF_ALL>()?;
        let &[strain, count, began, strain_before, phi_before, x, y, tilt] = of_all;
        let whole = |n: f64| ((0.0..9e15).contains(&n) && n == libm::floor(n)).then_some(n as u64);
        let lengths: &[usize] = match act {
            Act::Compress {
                until: Until::Pressure(_),
                ..
            } => &[0, 5],
            Act::Jam { .. } => &[0, 6, 6 + 2 * particles],
            Act::Relax | Act::Compress { .. } | Act::Shear { .. } => &[0],
        };
        let sensible = lengths.contains(&known.len())
            && Domain::new(x, y)?.tilted(tilt).is_some()
            && strain.abs() < 1e6
            && strain_before.abs() < 1e6
            && phi_before > 0.0
            && phi_before < 10.0;
        Some(Self {
            strain,
            count: whole(count)?,
            began: whole(began)?,
            strain_before,
            phi_before,
            sides: [x, y],
            tilt,
            known: known.to_vec(),
        })
        .filter(|_| sensible)
    }
}

/// What comes behind a relaxed state.
#[derive(Clone, Debug)]
pub(crate) enum Next {
    /// The packing in another box, and how far the stage has come with it.
    Strained(Box<Packing>, Progress),
    /// The stage is at its end.
    Over,
    /// The stage cannot come to its end, and why.
    Impossible(&'static str),
}

/// Below this pressure, times the smallest diameter over γ, a packing bears none, if its `f_max` is 1e-11 or less; a search by bisection asks for a
/// tenth of its interval.
const NO_PRESSURE: f64 = 1e-9;

/// The first step of a search (coverage).
const SEARCH: f64 = 0.004;

/// The slope `dp/dφ` (γ/length) that is taken for granted at first, the least one that steps are made with, and the least one that is believed.
const SLOPE: f64 = 1.5;
const LEAST_SLOPE: f64 = 1.0;
const FLATTEST: f64 = 0.3;

/// A pressure is met to this part of it.
const MET: f64 = 1e-6;

/// The slopes of the last two pairs of states agree to this where no particles have rearranged.
const AGREES: f64 = 0.02;

/// A step of a search that leaves less than this part of the pressure has lost the network.
const LOST: f64 = 0.01;

/// A network that breaks under a pressure is followed to so near before it breaks, in units of the pressure at which a search ends (coverage).
const NEAREST: f64 = 1e-3;

/// Most steps of a search, of a compression to a pressure between the two states on either side of it.
const LONGEST: u64 = 300;

/// Coverages beyond which nothing is compressed.
const DENSEST: f64 = 1.3;

/// What `act` does with a relaxed packing under this pressure (γ/length).
pub(crate) fn next(act: Act, progress: &Progress, packing: &Packing, pressure: f64) -> Next {
    match act {
        Act::Relax => Next::Over,
        Act::Compress {
            until: Until::Phi(end),
            by,
        } => match coverage(progress, end, by) {
            Some(phi) => compressed(progress, packing, phi, Vec::new()),
            None => Next::Over,
        },
        Act::Compress {
            until: Until::Pressure(end),
            by,
        } => to_pressure(progress, packing, (pressure, end), by),
        Act::Jam {
            way: Way::Halving,
            end,
        } => halve(progress, packing, pressure, end),
        Act::Jam { way, end } => bisect(progress, packing, pressure, (way, end)),
        Act::Shear {
            mode,
            strain,
            step,
            cycles,
        } => match path(progress.count + 1, strain, step, cycles) {
            Some(strain) => sheared(progress, packing, mode, strain),
            None => Next::Over,
        },
    }
}

/// The coverage behind the next step of a compression to `end`; `None` if it is there.
fn coverage(progress: &Progress, end: f64, by: Increment) -> Option<f64> {
    let begin = progress.phi_before;
    let steps = match by {
        Increment::Absolute(step) => (end - begin).abs() / step,
        Increment::Relative(step) => libm::log(end / begin).abs() / libm::log1p(step),
    };
    // A last step of next to nothing is left out.
    let steps = libm::ceil(steps - 1e-6).max(0.0);
    let k = (progress.count + 1) as f64;
    if k > steps {
        return None;
    }
    let part = k / steps;
    Some(if k == steps {
        end
    } else {
        match by {
            Increment::Absolute(_) => begin + (end - begin) * part,
            Increment::Relative(_) => begin * libm::exp(libm::log(end / begin) * part),
        }
    })
}

/// The packing at another coverage, from the positions it has.
fn compressed(progress: &Progress, packing: &Packing, phi: f64, known: Vec<f64>) -> Next {
    let scale = (progress.phi_before / phi).sqrt();
    let sides = progress.sides.map(|side| side * scale);
    let domain = Domain::new(sides[0], sides[1]).and_then(|d| d.tilted(progress.tilt * scale));
    let progress = Progress {
        count: progress.count + 1,
        known,
        ..progress.clone()
    };
    strained(packing, domain, progress, |x, [across, along]| {
        Vec2::new(x.x * across, x.y * along)
    })
}

/// The packing in another box, each particle moved as `affine` says by the ratios of the sides.
fn strained(
    packing: &Packing,
    domain: Option<Domain>,
    progress: Progress,
    affine: impl Fn(&Vec2, [f64; 2]) -> Vec2,
) -> Next {
    let Some(domain) = domain else {
        return Next::Impossible(NO_BOX);
    };
    let (new, old) = (domain.lengths(), packing.domain().lengths());
    let ratios = [new.x / old.x, new.y / old.y];
    let positions = packing.positions().iter();
    let positions = positions.map(|x| domain.wrap(affine(x, ratios))).collect();
    match Packing::new(domain, packing.radii().to_vec(), positions) {
        Ok(packing) => Next::Strained(Box::new(packing), progress),
        Err(_) => Next::Impossible(NO_BOX),
    }
}

const NO_BOX: &str = "its next box would have a side that is none; let it end before";

/// The strain of step `k` of a shear by `strain` and back and forth; `None` behind its end.
fn path(k: u64, strain: f64, step: f64, cycles: u32) -> Option<f64> {
    let leg = libm::ceil(strain.abs() / step - 1e-6).max(1.0) as u64;
    if k <= leg {
        return Some(strain * (k as f64 / leg as f64));
    }
    // Each cycle goes to the other side and comes again, four legs long.
    let k = k - leg;
    let (cycle, k) = ((k - 1) / (4 * leg), (k - 1) % (4 * leg) + 1);
    if cycle >= u64::from(cycles) {
        return None;
    }
    let part = k as f64 / leg as f64;
    Some(strain * if k <= 2 * leg { 1.0 - part } else { part - 3.0 })
}

fn sheared(progress: &Progress, packing: &Packing, mode: Shear, strain: f64) -> Next {
    let [x, y] = progress.sides;
    let total = progress.strain_before + strain;
    let more = total - progress.strain;
    let then = Progress {
        strain: total,
        count: progress.count + 1,
        ..progress.clone()
    };
    match mode {
        Shear::Simple => {
            let tilt = progress.tilt + (total - progress.strain_before) * y;
            let domain = Domain::new(x, y).and_then(|domain| domain.tilted(tilt));
            strained(packing, domain, then, |at, _| {
                Vec2::new(at.x + more * at.y, at.y)
            })
        }
        Shear::Pure => {
            let stretch = libm::exp(total - progress.strain_before);
            let domain = Domain::new(x * stretch, y / stretch);
            let domain = domain.and_then(|domain| domain.tilted(progress.tilt * stretch));
            strained(packing, domain, then, |at, [across, along]| {
                Vec2::new(at.x * across, at.y * along)
            })
        }
    }
}

/// Steps until the pressure has been passed, then between the states on either side of it.
fn to_pressure(
    progress: &Progress,
    packing: &Packing,
    (pressure, end): (f64, f64),
    by: Increment,
) -> Next {
    let phi = packing.coverage();
    if (pressure - end).abs() <= MET * end {
        return Next::Over;
    }
    // Coverage and pressure of the last state below and the last one above, a pressure of −1 if there is none, and the steps before there were both.
    let mut known = match progress.known[..] {
        [a, b, c, d, e] => [a, b, c, d, e],
        _ => [0.0, -1.0, 0.0, -1.0, 0.0],
    };
    let side = if pressure < end { 0 } else { 2 };
    (known[side], known[side + 1]) = (phi, pressure);
    let [low, below, high, above, before] = known;
    let then = if below < 0.0 || above < 0.0 {
        known[4] = progress.count as f64;
        let step = match by {
            Increment::Absolute(step) => step,
            Increment::Relative(step) => step * phi,
        };
        if pressure < end {
            phi + step
        } else {
            phi - step
        }
    } else {
        let part = ((end - below) / (above - below)).clamp(0.02, 0.98);
        low + (high - low) * part
    };
    if then == phi || progress.count as f64 - before >= LONGEST as f64 {
        return Next::Impossible(
            "no relaxed state that it comes to has this pressure: particles rearrange there",
        );
    }
    if then <= 0.0 || then >= DENSEST {
        return Next::Impossible("its pressure is not met at any coverage below 1.3");
    }
    compressed(progress, packing, then, known.to_vec())
}

/// What a search of φ_J knows beside the present state: six numbers, and the positions of the state that it goes back to.
struct Search {
    /// Coverage and pressure of that state; a pressure of −1 if there is none.
    phi: f64,
    pressure: f64,
    /// The slope there and the one before.
    slope: f64,
    slope_before: f64,
    /// What a step is made by: of bisection its length, of halving the part of the way to φ_J.
    step: f64,
    /// How often a step went too far.
    failed: f64,
}

impl Search {
    fn of(progress: &Progress, step: f64) -> Self {
        match progress.known.first_chunk() {
            Some(&[phi, pressure, slope, slope_before, step, failed]) => Self {
                phi,
                pressure,
                slope,
                slope_before,
                step,
                failed,
            },
            None => Self {
                phi: 0.0,
                pressure: -1.0,
                slope: SLOPE,
                slope_before: 0.0,
                step,
                failed: 0.0,
            },
        }
    }

    /// The packing to go back to.
    fn kept(&self, progress: &Progress, packing: &Packing) -> Option<Packing> {
        let scale = (progress.phi_before / self.phi).sqrt();
        let [x, y] = progress.sides.map(|side| side * scale);
        let domain = Domain::new(x, y)?.tilted(progress.tilt * scale)?;
        let numbers = progress.known.get(6..)?.as_chunks::<2>().0;
        let positions = numbers.iter().map(|[x, y]| domain.wrap(Vec2::new(*x, *y)));
        Packing::new(domain, packing.radii().to_vec(), positions.collect()).ok()
    }

    /// The step to `phi` from `packing`, to which the search goes back if it fails.
    fn from(&self, progress: &Progress, packing: &Packing, phi: f64) -> Next {
        let mut known = vec![
            self.phi,
            self.pressure,
            self.slope,
            self.slope_before,
            self.step,
            self.failed,
        ];
        if self.pressure >= 0.0 {
            known.extend(packing.positions().iter().flat_map(|x| [x.x, x.y]));
        }
        compressed(progress, packing, phi, known)
    }

    /// Notes the state that a pressure is that of.
    fn arrive(&mut self, phi: f64, pressure: f64) {
        if self.pressure >= 0.0 {
            let slope = (self.pressure - pressure) / (self.phi - phi);
            if slope >= FLATTEST {
                self.slope_before = self.slope;
                self.slope = slope;
            } else {
                self.slope_before = 0.0;
            }
        }
        (self.phi, self.pressure) = (phi, pressure);
    }
}

/// Halves the pressure, step by step.
fn halve(progress: &Progress, packing: &Packing, pressure: f64, end: f64) -> Next {
    let phi = packing.coverage();
    let mut search = Search::of(progress, 0.5);
    let diameter = 2.0 * packing.smallest_radius();
    let bears = pressure * diameter > NO_PRESSURE && pressure > LOST * search.pressure;
    if bears && search.step == 0.0 {
        return Next::Over;
    }
    if progress.count >= LONGEST {
        return Next::Impossible(TOO_LONG);
    }
    if bears {
        search.arrive(phi, pressure);
        if is_extrapolated(&search, end) {
            return Next::Over;
        }
        let then = phi - search.step * pressure / search.slope.max(LEAST_SLOPE);
        return search.from(progress, packing, then);
    }
    if search.pressure < 0.0 {
        // Not jammed at the start of the search.
        return search.from(progress, packing, phi + SEARCH);
    }
    search.step *= 0.5;
    search.failed += 1.0;
    let mut back = search.step * search.pressure / search.slope.max(LEAST_SLOPE);
    if back < NEAREST * end {
        // The network breaks under a pressure: the search ends with the last state before.
        (search.step, back) = (0.0, 0.0);
    }
    match search.kept(progress, packing) {
        Some(kept) => search.from(progress, &kept, search.phi - back),
        None => Next::Impossible(NO_BOX),
    }
}

const TOO_LONG: &str = "no φ_J within 300 relaxed states; let it start nearer to it";

/// Whether a line through the last two states leads to φ_J.
fn is_extrapolated(search: &Search, end: f64) -> bool {
    let agrees = (search.slope - search.slope_before).abs() <= AGREES * search.slope;
    search.pressure <= end && (agrees || search.pressure <= 0.01 * end)
}

/// Goes on from jammed states downwards, or from unjammed ones upwards, and back by half of the step where it comes to the other side.
fn bisect(progress: &Progress, packing: &Packing, pressure: f64, (way, end): (Way, f64)) -> Next {
    let phi = packing.coverage();
    let mut search = Search::of(progress, SEARCH);
    if progress.count >= LONGEST {
        return Next::Impossible(TOO_LONG);
    }
    let bears = pressure * 2.0 * packing.smallest_radius() > 0.1 * end;
    let stays = bears == (way == Way::Above);
    let sign = if way == Way::Above { -1.0 } else { 1.0 };
    if stays {
        (search.phi, search.pressure) = (phi, pressure.max(0.0));
        if search.step <= end {
            return Next::Over;
        }
        return search.from(progress, packing, phi + sign * search.step);
    }
    if search.pressure < 0.0 {
        // On the other side from the start.
        return search.from(progress, packing, phi - sign * SEARCH);
    }
    search.step *= 0.5;
    search.failed += 1.0;
    // The last state of the search is on the side that it comes from.
    let then = if search.step <= end {
        search.phi
    } else {
        search.phi + sign * search.step
    };
    match search.kept(progress, packing) {
        Some(kept) => search.from(progress, &kept, then),
        None => Next::Impossible(NO_BOX),
    }
}

/// What a search of φ_J has come to.
///
/// ```
/// use softjam::{protocol::{Relaxation, Status}, scene::Scene};
///
/// let scene = Scene::from_toml("particles = 32\nmodel = 'disks'\n[[protocol]]\nact = 'jam'\nend = 1e-4").unwrap();
/// let mut run = Relaxation::new(&scene).unwrap();
/// while run.status() == Status::Running {
///     run.advance().unwrap();
/// }
/// let found = run.jamming().unwrap();
/// assert!(found.phi_j > 0.75 && found.phi_j < run.packing().coverage());
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Jamming {
    /// φ_J.
    pub phi_j: f64,
    /// The slope `dp/dφ` there (γ/length), by the last two jammed states; `None` of a bisection, and where the network breaks at a pressure
    /// above the `end` of the search: φ_J is where it does then.
    pub slope: Option<f64>,
    /// How many steps went too far and were taken back.
    pub failed: u64,
}

/// What a stage of a protocol, or the relaxation in front of it, has come to at its last state.
///
/// ```
/// use softjam::{protocol::{Relaxation, Status}, scene::Scene};
///
/// let scene = Scene::from_toml("particles = 32\nmodel = 'disks'\n[[protocol]]\nact = 'shear'\nstrain = 0.002").unwrap();
/// let mut run = Relaxation::new(&scene).unwrap();
/// while run.status() == Status::Running {
///     run.advance().unwrap();
/// }
/// let end = run.stage_end().unwrap();
/// assert_eq!((end.act, end.strain), ("shear", 0.002));
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StageEnd {
    /// The stage, counted from 0, and what it does.
    pub stage: u32,
    /// Its word in scenes.
    pub act: &'static str,
    /// Coverage of the undeformed disks.
    pub phi: f64,
    /// Strain of all stages so far.
    pub strain: f64,
    /// Pressure (γ/length).
    pub pressure: f64,
    /// Stress `(σ_xx, σ_xy, σ_yy)`, tension positive (γ/length).
    pub stress: [f64; 3],
    /// Mean coordination of the particles that are held.
    pub coordination: f64,
    /// What a search of φ_J has found.
    pub jamming: Option<Jamming>,
}

/// What a search of φ_J has come to at a relaxed packing under this pressure (γ/length); `None` of another act.
pub(crate) fn jamming(
    act: Act,
    progress: &Progress,
    packing: &Packing,
    pressure: f64,
) -> Option<Jamming> {
    let Act::Jam { way, .. } = act else {
        return None;
    };
    let phi = packing.coverage();
    let mut search = Search::of(progress, 0.5);
    let (phi_j, slope) = match way {
        Way::Halving if search.step == 0.0 => (phi, None),
        Way::Halving => {
            search.arrive(phi, pressure);
            (phi - pressure / search.slope, Some(search.slope))
        }
        // Half of the last step, which was too far.
        Way::Above => (phi - 0.5 * search.step, None),
        Way::Below => (phi + 0.5 * search.step, None),
    };
    Some(Jamming {
        phi_j,
        slope,
        failed: search.failed as u64,
    })
}
