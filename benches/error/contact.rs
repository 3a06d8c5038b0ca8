//! (a) The contact problem: time of one solution against its residual.
//!
//! Consecutive frames of a relaxation on its way (f_max below 1e-3) are solved by each method through `ContactLaw`, so that
//! every time includes the assembly of `A` and the search for violating pairs. *Warm* starts from the forces of the frame
//! before, *cold* from zero forces on the right contacts. Sparse Cholesky keeps its symbolic part while the contacts stay.

use super::table::{Table, digits, median};
use softjam::models::droplet::contact::solver::Method;
use softjam::models::droplet::contact::{ContactLaw, Rule};
use softjam::protocol::Relaxation;
use softjam::scene::Scene;
use softjam::state::Packing;
use std::error::Error;
use std::time::Instant;

pub fn measure(quick: bool) -> Result<Table, Box<dyn Error>> {
    let mut table = Table::new(&[
        "particles",
        "phi",
        "method",
        "tolerance",
        "residual",
        "seconds",
        "iterations",
        "contacts",
    ]);
    let mut samples: Vec<(usize, f64)> = vec![(64, 0.86), (256, 0.86)];
    if !quick {
        samples.extend([0.845, 0.86, 0.90, 0.95].map(|phi| (1024, phi)));
        samples.extend([4096, 16_384, 65_536].map(|n| (n, 0.86)));
    }
    for (particles, phi) in samples {
        sample(&mut table, particles, phi)?;
    }
    Ok(table)
}

fn sample(table: &mut Table, particles: usize, phi: f64) -> Result<(), Box<dyn Error>> {
    let count = (200_000 / particles).clamp(5, 60);
    let frames = frames(particles, phi, count)?;
    let mut row =
        |method: &str, tolerance: f64, seconds: f64, law: &ContactLaw, iterations: f64| {
            table.push(vec![
                particles.to_string(),
                phi.to_string(),
                method.into(),
                format!("{tolerance:e}"),
                digits(law.residual()),
                digits(seconds),
                format!("{iterations:.1}"),
                law.contacts().pairs.len().to_string(),
            ]);
        };
    let mut decades: Vec<f64> = (1..=13).map(|k| 10f64.powi(-k)).collect();
    if particles > 1024 {
        decades = vec![1e-4, 1e-7, 1e-10, 1e-13];
    }
    for tolerance in decades {
        // In turn, so that a disturbance of the machine meets both.
        let mut warm = law(Method::ConjugateGradient, tolerance);
        let mut cold = law(Method::ConjugateGradient, tolerance);
        warm.solve(&frames[0], &[], &[])?;
        let (mut warm_times, mut cold_times) = (Vec::new(), Vec::new());
        let (before_warm, mut warm_solves) = (warm.work(), 0);
        let mut cold_iterations = 0;
        for frame in &frames[1..] {
            let clock = Instant::now();
            warm.solve_again(frame)?;
            warm_times.push(clock.elapsed().as_secs_f64());
            warm_solves += 1;
            let pairs = warm.contacts().pairs.to_vec();
            let zeros = vec![0.0; pairs.len()];
            let before = cold.work().iterations;
            let clock = Instant::now();
            cold.solve(frame, &pairs, &zeros)?;
            cold_times.push(clock.elapsed().as_secs_f64());
            cold_iterations += cold.work().iterations - before;
        }
        let per = |iterations: u64| iterations as f64 / f64::from(warm_solves);
        let warm_iterations = per(warm.work().iterations - before_warm.iterations);
        row(
            "warm CG",
            tolerance,
            median(warm_times),
            &warm,
            warm_iterations,
        );
        row(
            "cold CG",
            tolerance,
            median(cold_times),
            &cold,
            per(cold_iterations),
        );
    }
    // The direct methods know one residual: round-off.
    let mut cholesky = law(Method::SparseCholesky, 1e-13);
    cholesky.solve(&frames[0], &[], &[])?;
    let mut times = Vec::new();
    for frame in &frames[1..] {
        let clock = Instant::now();
        cholesky.solve_again(frame)?;
        times.push(clock.elapsed().as_secs_f64());
    }
    row("sparse Cholesky", 1e-13, median(times), &cholesky, 0.0);
    // What is left of any method when nothing is to be solved: assembly, one product, the search.
    let mut nothing = Vec::new();
    let mut done = law(Method::ConjugateGradient, 1e-10);
    for frame in &frames {
        done.solve_again(frame)?;
        let clock = Instant::now();
        done.solve_again(frame)?;
        nothing.push(clock.elapsed().as_secs_f64());
    }
    row("assembly and search", 1e-10, median(nothing), &done, 0.0);
    if particles <= 1024 {
        let mut dense = law(Method::GaussJordan, 1e-13);
        let (pairs, forces) = (
            cholesky.contacts().pairs.to_vec(),
            cholesky.contacts().forces.to_vec(),
        );
        let mut times = Vec::new();
        let last = &frames[frames.len() - 1];
        for _ in 0..(if particles > 256 { 1 } else { 3 }) {
            let clock = Instant::now();
            dense.solve(last, &pairs, &forces)?;
            times.push(clock.elapsed().as_secs_f64());
        }
        row("dense Gauss–Jordan", 1e-13, median(times), &dense, 0.0);
    }
    Ok(())
}

fn law(method: Method, tolerance: f64) -> ContactLaw {
    ContactLaw::new(Rule::Complementarity, method, 1.0, tolerance)
}

/// Consecutive frames of a relaxation on its way. Large packings begin from disks that are not fully relaxed.
fn frames(particles: usize, phi: f64, count: usize) -> Result<Vec<Packing>, Box<dyn Error>> {
    let mut scene = Scene {
        particles,
        phi,
        ..Scene::default()
    };
    scene.disks.steps = if particles > 4096 { 1500 } else { 20_000 };
    let mut run = Relaxation::new(&scene)?;
    while run.f_max() > 1e-3 && run.step() < 300 {
        run.advance()?;
    }
    let mut frames = Vec::new();
    for _ in 0..count {
        run.advance()?;
        frames.push(run.packing().clone());
    }
    Ok(frames)
}
