//! The cases, by what they try.

use super::hand_made;
use super::outcome::{Outcome, of_scene, pressure_of};
use super::random::Random;
use softjam::scene::{Radii, Scene, Species};
use std::sync::OnceLock;

/// What all scenes have in common; by default the default scene.
pub static COMMON: OnceLock<Scene> = OnceLock::new();

/// The same as lines of a scene file.
pub static COMMON_LINES: OnceLock<String> = OnceLock::new();

/// The scene that all cases start from.
pub fn common() -> Scene {
    COMMON.get().cloned().unwrap_or_default()
}

/// A case: its name, and how to run it.
pub type Case = (String, Box<dyn FnOnce() -> Outcome>);

/// Cases of one kind.
pub struct Family {
    /// A short name, to pick it on the command line.
    pub name: &'static str,
    /// What is tried.
    pub what: &'static str,
    /// Makes the cases; those of a long list are taken at even distances where few are enough.
    pub cases: fn() -> Vec<Case>,
}

/// All families, in the order of the report.
pub fn all() -> Vec<Family> {
    let family = |name, what, cases| Family { name, what, cases };
    vec![
        family(
            "random",
            "1000 random packings, N = 64, φ uniform in 0.5–1.1, size ratio log-uniform in 1–10, half of them 50:50 mixtures, half continuous spreads",
            random,
        ),
        family(
            "few",
            "N = 1, 2, 3, 5 from random starts, φ = 0.05–1.2, 20 seeds each",
            few,
        ),
        family(
            "tight box",
            "N = 1, 2, 3, 5 of radius 1/2 at random in square boxes of side 1–3 (2–6 radii)",
            hand_made::tight_boxes,
        ),
        family(
            "same angle",
            "a particle with two neighbours at angles 0–1e-3 rad apart (1e-12 among them), with and without four more around it",
            hand_made::same_angle,
        ),
        family(
            "threshold",
            "contacts exactly at the threshold and a unit in the last place beside it: undeformed pairs, chains, crystals at φ_c, and a pair that only bulges bring together",
            hand_made::threshold,
        ),
        family(
            "coincident",
            "2–12 coincident centres, alone and amid others, taken as they stand and with the disks relaxed first",
            hand_made::coincident,
        ),
        family(
            "lattice",
            "square, hexagonal and bidisperse hexagonal lattices, φ = 0.70–1.25: exact ties everywhere",
            hand_made::lattices,
        ),
        family(
            "dense",
            "φ = 1.2, 1.25, 1.29, 1.2999999, N = 64 with 5 seeds, N = 256 with 2, at most 20 000 steps",
            || dense(None),
        ),
        family(
            "dense, short steps",
            "the same with dt_max = 0.04, about a quarter of the default",
            || dense(Some(0.04)),
        ),
        family(
            "large",
            "N = 100 000, φ = 0.86: 300 steps of the disks, then 100 steps",
            large,
        ),
        family(
            "jamming",
            "φ within 1e-4 of where a sample jams, found by bisection, on both sides of it: N = 64, 6 seeds; N = 256, 2 seeds",
            jamming,
        ),
        family(
            "extremes",
            "every scene field at the ends of its allowed range",
            extremes,
        ),
    ]
}

/// A case from a scene.
pub fn case(name: String, scene: Scene) -> Case {
    (name, Box::new(move || of_scene(&scene)))
}

fn random() -> Vec<Case> {
    let mut random = Random::new(1);
    (0..1000)
        .map(|k| {
            let phi = random.within(0.5, 1.1);
            let ratio = 10f64.powf(random.within(0.0, 1.0));
            let radii = if k % 2 == 0 {
                let species = [0.5, 0.5 * ratio].map(|radius| Species {
                    radius,
                    fraction: 0.5,
                });
                Radii::Species(species.to_vec())
            } else {
                Radii::Spread {
                    min: 0.5,
                    max: 0.5 * ratio,
                }
            };
            let scene = Scene {
                particles: 64,
                phi,
                radii,
                seed: k,
                ..common()
            };
            case(format!("seed {k}, φ = {phi:.4}, ratio {ratio:.2}"), scene)
        })
        .collect()
}

fn few() -> Vec<Case> {
    let mut cases = Vec::new();
    for particles in [1, 2, 3, 5] {
        for phi in [0.05, 0.15, 0.25, 0.4, 0.6, 0.86, 1.2] {
            for seed in 1..=20 {
                let scene = Scene {
                    particles,
                    phi,
                    seed,
                    ..common()
                };
                cases.push(case(
                    format!("N = {particles}, φ = {phi}, seed {seed}"),
                    scene,
                ));
            }
        }
    }
    cases
}

fn dense(dt_max: Option<f64>) -> Vec<Case> {
    let mut cases = Vec::new();
    for (particles, seeds) in [(64, 5), (256, 2)] {
        for phi in [1.2, 1.25, 1.29, 1.299_999_9] {
            for seed in 1..=seeds {
                let scene = Scene {
                    particles,
                    phi,
                    seed,
                    dt_max,
                    steps: 20_000,
                    ..common()
                };
                cases.push(case(
                    format!("N = {particles}, φ = {phi}, seed {seed}"),
                    scene,
                ));
            }
        }
    }
    cases
}

fn large() -> Vec<Case> {
    let mut scene = Scene {
        particles: 100_000,
        steps: 100,
        ..common()
    };
    scene.disks.steps = 300;
    vec![case("N = 100000".into(), scene)]
}

fn jamming() -> Vec<Case> {
    (1..=6)
        .map(|seed| (64, seed))
        .chain([(256, 1), (256, 2)])
        .flat_map(|(particles, seed)| jamming_of(particles, seed))
        .collect()
}

/// Both sides of where a sample jams, 1e-4 apart at most, and between them.
pub fn jamming_of(particles: usize, seed: u64) -> Vec<Case> {
    let at = |phi: f64| Scene {
        particles,
        phi,
        seed,
        ..common()
    };
    // From random starts jammed and unjammed coverages interleave; bisection ends at one of the borders.
    let (mut loose, mut jammed) = (0.80, 0.88);
    while jammed - loose > 1e-4 {
        let middle = 0.5 * (loose + jammed);
        if pressure_of(&at(middle)) > 1e-6 {
            jammed = middle;
        } else {
            loose = middle;
        }
    }
    [loose, 0.5 * (loose + jammed), jammed]
        .into_iter()
        .map(|phi| {
            case(
                format!("N = {particles}, seed {seed}, φ = {phi:.6}"),
                at(phi),
            )
        })
        .collect()
}

/// Lines of a scene file over `particles = 64`, `phi = 0.9`.
fn extremes() -> Vec<Case> {
    const NEVER: &str = "steps = 2000"; // no scene with this line can converge, or only by luck
    let mut lines: Vec<String> = Vec::new();
    for field in ["line_tension", "threshold", "dt_max", "disks.threshold"] {
        for value in [
            "5e-324",
            "1e-100",
            "1e-99",
            "1e99",
            "1e100",
            "1.7976931348623157e308",
        ] {
            lines.push(format!("{field} = {value}\n{NEVER}\ndisks.steps = 2000"));
        }
    }
    // A stage of disks that must end by its own limit, and one that is not there.
    lines.push("disks.threshold = 5e-324\ndisks.steps = 300".into());
    lines.push("disks.steps = 0".into());
    for solver in ["conjugate-gradient", "sparse-cholesky", "gauss-jordan"] {
        for rule in ["complementarity", "saitoh"] {
            for tolerance in ["1e-14", "1e-12", "1e-6"] {
                lines.push(format!(
                    "contact_solver = \"{solver}\"\ncontact_rule = \"{rule}\"\ncontact_tolerance = {tolerance}\nsteps = 20000"
                ));
            }
        }
    }
    for fire in [
        "increase = 1.0000000000000002",
        "increase = 10",
        "decrease = 5e-324",
        "decrease = 0.9999999999999999",
        "mixing = 5e-324",
        "mixing = 1",
        "mixing_decay = 5e-324",
        "mixing_decay = 1",
        "first_dt = 5e-324\nfire.least_dt = 5e-324",
        "first_dt = 1",
        "least_dt = 5e-324",
        "least_dt = 0.1",
        "delay = 0",
        "delay = 4294967295",
    ] {
        lines.push(format!("fire.{fire}\nsteps = 20000"));
    }
    for line in [
        "contours.vertices = 3",
        "contours.vertices = 4096",
        "steps = 0",
        "seed = 0",
        "seed = 9223372036854775807",
        "particles = 1",
        "phi = 5e-324",
        "phi = 1e-300",
        "phi = 1.2999999999999998\nsteps = 3000",
        "aspect = 0.1",
        "aspect = 10",
        "particles = 256\naspect = 0.1",
        "particles = 256\naspect = 10",
        "start = \"hexagonal\"\naspect = 10",
        "species = [{ radius = 1e-6, fraction = 1 }]",
        "species = [{ radius = 1e6, fraction = 1 }]",
        "species = [{ radius = 1e-6, fraction = 0.5 }, { radius = 1e6, fraction = 0.5 }]\nsteps = 2000",
        "species = [{ radius = 0.5, fraction = 5e-324 }, { radius = 0.7, fraction = 1 }]",
        "spread = { min = 1e-6, max = 1e-6 }",
        "spread = { min = 1e-6, max = 1e6 }",
        "spread = { min = 1e6, max = 1e6 }",
        "species = [{ radius = 1e6, fraction = 1 }]\nline_tension = 1e100",
        "species = [{ radius = 1e-6, fraction = 1 }]\nline_tension = 1e-100",
    ] {
        lines.push(line.into());
    }
    lines
        .into_iter()
        .map(|line| {
            let name = line.replace('\n', ", ");
            let text = COMMON_LINES
                .get()
                .map(String::as_str)
                .into_iter()
                .chain(["particles = 64", "phi = 0.9"])
                .filter(|default| {
                    let field = default.split(' ').next().unwrap_or_default();
                    !line.lines().any(|l| l.starts_with(field))
                })
                .chain([line.as_str()])
                .collect::<Vec<_>>()
                .join("\n");
            let run = move || match Scene::from_toml(&text) {
                Ok(scene) => of_scene(&scene),
                Err(error) => Outcome::refused(&error),
            };
            (name, Box::new(run) as Box<dyn FnOnce() -> Outcome>)
        })
        .collect()
}
