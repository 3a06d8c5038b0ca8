//! What a scene does not need and what not doing it saves: measures, and writes `docs/nothing-in-vain.md`.
//!
//! ```sh
//! cargo bench --no-default-features --bench nothing_in_vain -- --write docs/nothing-in-vain.md
//! ```
//!
//! The rows about files need the program (`cargo build --release`, or its path in `SOFTJAM`).

#![expect(
    clippy::print_stdout,
    reason = "a program that prints what it measured"
)]
#![expect(
    clippy::unwrap_used,
    reason = "every run of it is one of droplets, which have a contact law"
)]

use softjam::analysis::Backbone;
use softjam::models::droplet::contact::solver::Method;
use softjam::models::droplet::contact::{ContactLaw, Rule};
use softjam::models::droplet::contour::{ContourStyle, Contours};
use softjam::neighbors::NeighborList;
use softjam::protocol::relax_disks;
use softjam::protocol::{Relaxation, Status};
use softjam::scene::DiskParameters;
use softjam::scene::{Scene, start};
use softjam::state::Packing;
use std::error::Error;
use std::fmt::Write as _;
use std::hint::black_box;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Instant;

/// A line of the table: asked for, skipped, saved, held by.
type Row = [String; 4];

fn main() -> Result<(), Box<dyn Error>> {
    let mut file = None;
    let mut arguments = std::env::args().skip(1);
    while let Some(argument) = arguments.next() {
        if argument == "--write" {
            file = arguments.next();
        }
    }
    let scene = Scene {
        particles: 1024,
        ..Scene::default()
    };
    let mut rows = stages(&scene)?;
    rows.extend(steps(&scene)?);
    rows.extend(pictures(&scene)?);
    rows.extend(files()?);
    let mut text = String::from(HEAD);
    text.push_str(
        "| a scene asks for | skipped | saving | held by the test |\n| --- | --- | --- | --- |\n",
    );
    for [asked, skipped, saved, test] in rows {
        let test = if test.is_empty() {
            "–".to_owned()
        } else {
            format!("`{test}`")
        };
        writeln!(text, "| {asked} | {skipped} | {saved} | {test} |")?;
    }
    match file {
        Some(path) => std::fs::write(path, text)?,
        None => println!("{text}"),
    }
    Ok(())
}

const HEAD: &str = "\
# Nothing in vain

Written by `cargo bench --no-default-features --bench nothing_in_vain -- --write docs/nothing-in-vain.md`; every number is of that
run: N = 1024, φ = 0.86, seed 1, one thread, medians. The tests count work, not seconds, and fail when
skipped work comes back.

";

fn row(asked: &str, skipped: &str, saved: String, test: &str) -> Row {
    [asked.into(), skipped.into(), saved, test.into()]
}

/// Seconds that `work` takes, the median of `times`.
fn seconds(times: usize, mut work: impl FnMut()) -> f64 {
    let mut all: Vec<f64> = (0..times)
        .map(|_| {
            let clock = Instant::now();
            work();
            clock.elapsed().as_secs_f64()
        })
        .collect();
    all.sort_by(f64::total_cmp);
    all[all.len() / 2]
}

fn micro(seconds: f64) -> String {
    if seconds < 1e-3 {
        format!("{:.0} µs", 1e6 * seconds)
    } else {
        format!("{:.1} ms", 1e3 * seconds)
    }
}

/// The disks.
fn stages(scene: &Scene) -> Result<Vec<Row>, Box<dyn Error>> {
    let begin = start::packing(scene)?;
    let relax = |threshold: f64| {
        let mut packing = begin.clone();
        let clock = Instant::now();
        let parameters = DiskParameters {
            threshold,
            ..scene.disks
        };
        let report = relax_disks(&mut packing, &parameters, 1.0).unwrap();
        (clock.elapsed().as_secs_f64(), report.steps)
    };
    let (enough, far) = (relax(scene.disks.threshold), relax(1e-12));
    Ok(vec![
        row(
            "a start from a file, or from a recorded frame",
            "the relaxation of the disks",
            format!("{} ({} steps of the disks)", micro(enough.0), enough.1),
            "run_that_starts_from_a_file_or_a_frame_relaxes_no_disks",
        ),
        row(
            "a random start",
            "disks in better balance than a start needs",
            format!(
                "{:.0} % of their steps: {} to f_max = {:.0e}, {} to 1e-12",
                100.0 - 100.0 * enough.1 as f64 / far.1 as f64,
                enough.1,
                scene.disks.threshold,
                far.1
            ),
            "",
        ),
    ])
}

/// What a step leaves out.
#[expect(
    clippy::too_many_lines,
    reason = "one run of a hundred steps feeds all rows"
)]
fn steps(scene: &Scene) -> Result<Vec<Row>, Box<dyn Error>> {
    let mut run = Relaxation::new(scene)?;
    while run.f_max() > 1e-3 {
        run.advance()?;
    }
    let before = run.law().unwrap().work();
    let first = run.step();
    let (mut frames, mut tolerances, mut times): (Vec<Packing>, Vec<f64>, Vec<f64>) =
        Default::default();
    for _ in 0..100 {
        let clock = Instant::now();
        run.advance()?;
        times.push(clock.elapsed().as_secs_f64());
        frames.push(run.packing().clone());
        tolerances.push(run.law().unwrap().tolerance_at(run.packing(), run.f_max()));
    }
    times.sort_by(f64::total_cmp);
    let step = times[50];
    tolerances.sort_by(f64::total_cmp);
    let due = tolerances[50];
    let work = run.law().unwrap().work();
    let steps = (run.step() - first) as f64;
    let per_step = |a: u64, b: u64| (a - b) as f64 / steps;
    // Each stands for two places.
    let entries = run.law().unwrap().matrix().off_diagonals() as f64 / 2.0;

    let through = |method: Method, tolerance: f64| -> Result<(f64, f64), Box<dyn Error>> {
        let mut law = ContactLaw::new(Rule::Complementarity, method, 1.0, tolerance);
        law.solve(&frames[0], &[], &[])?;
        let iterations = law.work().iterations;
        let mut times = Vec::new();
        for frame in &frames[1..] {
            let clock = Instant::now();
            law.solve_again(frame)?;
            times.push(clock.elapsed().as_secs_f64());
        }
        times.sort_by(f64::total_cmp);
        let mean = (law.work().iterations - iterations) as f64 / times.len() as f64;
        Ok((times[times.len() / 2], mean))
    };
    let (full, full_iterations) = through(Method::ConjugateGradient, scene.contact_tolerance)?;
    let (loose, loose_iterations) = through(Method::ConjugateGradient, due)?;

    // The same frame again and again: with everything kept, and with a law that has nothing.
    let last = run.packing().clone();
    let contacts = run.contacts();
    let (pairs, forces) = (contacts.pairs.to_vec(), contacts.forces.to_vec());
    let mut kept = ContactLaw::new(Rule::Complementarity, Method::ConjugateGradient, 1.0, 1e-4);
    kept.solve(&last, &pairs, &forces)?;
    let with = seconds(50, || drop(kept.solve_again(&last)));
    let without = seconds(50, || {
        let mut law = ContactLaw::new(Rule::Complementarity, Method::ConjugateGradient, 1.0, 1e-4);
        drop(law.solve(&last, &pairs, &forces));
    });
    let list = seconds(20, || {
        NeighborList::new().update(&last, 0.2, 0.3);
    });
    let mut cholesky = ContactLaw::new(Rule::Complementarity, Method::SparseCholesky, 1.0, 1e-12);
    cholesky.solve(&last, &pairs, &forces)?;
    let numeric = seconds(20, || drop(cholesky.solve_again(&last)));
    let symbolic = seconds(20, || {
        let mut law = ContactLaw::new(Rule::Complementarity, Method::SparseCholesky, 1.0, 1e-12);
        drop(law.solve(&last, &pairs, &forces));
    });
    let mut candidates = NeighborList::new();
    candidates.update(&last, 2.0 * 0.7, 0.0);
    Ok(vec![
        row(
            "a step far from balance",
            "forces more exact than they are balanced: the tolerance follows f_max",
            format!(
                "{} of {} a solution ({loose_iterations:.1} iterations instead of {full_iterations:.1}, at f_max ≈ 1e-3)",
                micro(full - loose),
                micro(full)
            ),
            "forces_far_from_balance_take_few_iterations",
        ),
        row(
            "a step with the contacts of the step before, or some others",
            "lists, places in A, neighbour list, buffers",
            format!(
                "{} of {} a solution; the structure was built in {:.1} % of the steps",
                micro(without - with),
                micro(without),
                100.0 * per_step(work.structures, before.structures)
            ),
            "contacts_come_and_go_without_a_new_structure",
        ),
        row(
            "a step",
            "a neighbour list of its own",
            format!(
                "{} a list; {} in {} steps so far",
                micro(list),
                work.neighbor_lists,
                run.step()
            ),
            "neighbour_list_serves_many_steps",
        ),
        row(
            "a step",
            "gaps of pairs that no bulge can bring together",
            format!(
                "{:.0} gaps a step out of {} pairs within two radii that are not in contact ({:.0} distances)",
                per_step(work.gaps, before.gaps),
                candidates.pairs().len() - pairs.len(),
                per_step(work.distances, before.distances)
            ),
            "gaps_are_computed_of_pairs_that_could_touch_and_of_no_other",
        ),
        row(
            "a step far from balance",
            "entries of A in double precision",
            format!(
                "{:.0} of {:.0} kB of entries a step; computed in {} of {steps} steps",
                8e-3 * entries,
                12e-3 * entries,
                (work.assemblies - before.assemblies) - (work.singles - before.singles)
            ),
            "entries_in_double_precision_are_made_near_balance",
        ),
        row(
            "conjugate gradients (default)",
            "symbolic and numerical factorisation",
            format!("{} a solution", micro(numeric - full)),
            "symbolic_factorisation_is_made_by_the_cholesky_alone_and_once_a_structure",
        ),
        row(
            "`contact_solver = \"sparse-cholesky\"`",
            "the symbolic factorisation while the contacts stay",
            format!(
                "{} of {} a solution",
                micro(symbolic - numeric),
                micro(symbolic)
            ),
            "symbolic_factorisation_is_made_by_the_cholesky_alone_and_once_a_structure",
        ),
        row(
            "nothing to be recorded (library)",
            "writer thread, copies of frames, digests",
            format!(
                "{} threads in this process after {} steps; a step takes {}",
                threads(),
                run.step(),
                micro(step)
            ),
            "",
        ),
    ])
}

/// Threads of this process, where the system tells.
fn threads() -> String {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find_map(|l| l.strip_prefix("Threads:"));
    line.map_or("?".to_owned(), |n| n.trim().to_owned())
}

/// What a frame costs that nobody records.
fn pictures(scene: &Scene) -> Result<Vec<Row>, Box<dyn Error>> {
    let mut run = Relaxation::new(scene)?;
    while run.status() == Status::Running {
        run.advance()?;
    }
    let (packing, contacts) = (run.packing(), run.contacts());
    let draw = |contours: &mut Contours| {
        contours.draw(packing.radii(), packing.positions(), &contacts, 1.0);
    };
    let mut contours = Contours::new(ContourStyle::default());
    let drawing = seconds(20, || draw(&mut contours));
    let mut lonely = vec![true; packing.len()];
    for p in contacts.pairs.iter().flatten() {
        lonely[*p as usize] = false;
    }
    let lonely = lonely.iter().filter(|l| **l).count();
    let digest = seconds(20, || {
        black_box(run.frame().digest());
    });
    let observables = seconds(20, || {
        black_box(run.observables());
    });
    let mut backbone = Backbone::default();
    let same_contacts = seconds(20, || {
        black_box(run.observables_counted(&mut backbone));
    });
    let fixed = 8 * packing.len() + 16 + scene.to_toml().len();
    Ok(vec![
        row(
            "no contours",
            "the drawing of polygons",
            format!("{} a frame", micro(drawing)),
            "metrics_alone_cost_no_contour_and_no_state",
        ),
        row(
            "contours of particles without a contact",
            "the evaluation: they are their circle, turned once",
            format!(
                "{lonely} of {} particles at the end of this run",
                packing.len()
            ),
            "a_contact_free_particle_costs_no_evaluation",
        ),
        row(
            "no state",
            "the copy of the frame and its BLAKE3",
            format!("{} a frame", micro(digest)),
            "metrics_alone_cost_no_contour_and_no_state",
        ),
        row(
            "no metrics",
            "energy, stress, coordination, rattlers",
            format!("{} a frame", micro(observables)),
            "",
        ),
        row(
            "metrics of a frame with the contacts of the one before",
            "the search for rattlers",
            format!(
                "{} of {} a frame",
                micro(observables - same_contacts),
                micro(observables)
            ),
            "rattlers_are_counted_again_only_when_contacts_change_that_matter",
        ),
        row(
            "any recording",
            "geometry that never changes: radii, box and scene are written once",
            format!("{:.1} kB a frame", fixed as f64 / 1e3),
            "",
        ),
    ])
}

/// Whole recordings.
fn files() -> Result<Vec<Row>, Box<dyn Error>> {
    let program = std::env::var_os("SOFTJAM")
        .map_or_else(|| PathBuf::from("target/release/softjam"), PathBuf::from);
    if !program.exists() {
        return Ok(Vec::new());
    }
    let every = |channels: &str| {
        let each: Vec<_> = channels
            .split(',')
            .map(|c| format!("{c}=every:1"))
            .collect();
        each.join(",")
    };
    let mut bytes = Vec::new();
    for channels in [ALL, "contacts,metrics,state", "state", "metrics"] {
        let of = |steps: &str| length(&program, steps, &every(channels), "0");
        bytes.push((of("400")? - of("200")?) / 200.0);
    }
    let kb = |k: usize| format!("{:.1}", bytes[k] / 1e3);
    let whole = |redraw: &str| length(&program, "3000", &every(ALL), redraw);
    let (drawn, seen) = (whole("0")?, whole("0.01")?);
    Ok(vec![
        row(
            "a picture that is right to a hundredth of a radius (`redraw = 0.01`)",
            "drawing it again, and its bytes",
            format!(
                "{:.0} of {:.0} MB of a run of 3000 steps with everything at every step",
                (drawn - seen) / 1e6,
                drawn / 1e6
            ),
            "a_picture_is_as_right_as_the_scene_says_and_none_is_drawn_that_need_not_be",
        ),
        row(
            "`--channels contacts,metrics,state`",
            "contours in the file: they follow from the state",
            format!(
                "{} of {} kB a step",
                kb_difference(bytes[0], bytes[1]),
                kb(0)
            ),
            "",
        ),
        row(
            "`--channels state`",
            "all pictures; the file can still be replayed",
            format!(
                "{} of {} kB a step",
                kb_difference(bytes[0], bytes[2]),
                kb(0)
            ),
            "",
        ),
        row(
            "`--channels metrics`",
            "everything but nine numbers a step",
            format!(
                "{} of {} kB a step",
                kb_difference(bytes[0], bytes[3]),
                kb(0)
            ),
            "",
        ),
    ])
}

fn kb_difference(a: f64, b: f64) -> String {
    format!("{:.1}", (a - b) / 1e3)
}

const ALL: &str = "contours,contacts,metrics,state";

/// The length of a recording of so many steps (bytes).
fn length(
    program: &Path,
    steps: &str,
    channels: &str,
    redraw: &str,
) -> Result<f64, Box<dyn Error>> {
    let file = std::env::temp_dir().join(format!("softjam-vain-{}.rrd", std::process::id()));
    let status = Command::new(program)
        .args([
            "record",
            "--force",
            "--threshold",
            "1e-300",
            "--particles",
            "1024",
        ])
        .args(["--steps", steps, "--channels", channels])
        .args(["--redraw", redraw, "--output"])
        .arg(&file)
        .output()?;
    // 3: not converged within the step limit, which is what was asked for.
    if status.status.code() != Some(3) {
        return Err(String::from_utf8_lossy(&status.stderr).into());
    }
    let bytes = std::fs::metadata(&file)?.len() as f64;
    std::fs::remove_file(&file)?;
    Ok(bytes)
}
