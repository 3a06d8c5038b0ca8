//! What a physicist wants to read at the end of a run.

use crate::cli::lines::Lines;
use crate::cli::output::Output;
use softjam::analysis::Stability;
use softjam::protocol::Relaxation;
use softjam::record::Summary;
use softjam::scene::{Act, Scene, Start, Way};
use softjam::text::counted;
use std::time::Duration;

/// The report on a run that was prepared for so long and made so many steps in such a time.
pub(super) fn of(
    outputs: &[Output],
    scene: &Scene,
    run: &Relaxation,
    summary: &Summary,
    before: Duration,
    (steps, took): (u64, Duration),
) -> String {
    let (packing, found) = (run.packing(), run.observables());
    let mut lines = Lines::default();
    let result = match summary.outcome {
        None => format!("interrupted at step {}", run.step()),
        Some(end) if end.stability == Some(Stability::Saddle) => {
            format!("{end} (--minimizer fire+newton goes on from there)")
        }
        Some(end) => match scene.stage_of_protocol(run.stage()) {
            Some(stage) if !end.converged => format!(
                "{end}: a state of the stage \"{}\" is not relaxed after the {} that protocol.steps allows it",
                stage.act.name(),
                counted(stage.steps, "step")
            ),
            _ => end.to_string(),
        },
    };
    lines.line("result", result);
    let origin = match &scene.start {
        Start::File { path, .. } => format!("from {path}"),
        Start::Random | Start::Hexagonal => format!("seed {}", scene.seed),
    };
    let (domain, coverage) = (packing.domain(), packing.coverage());
    lines.packing(scene, packing.len(), coverage, domain, &origin);
    if let Some(disks) = run.disks() {
        let (steps, f_max) = (counted(disks.steps, "step"), disks.f_max);
        let ending = if disks.converged { "" } else { " (step limit)" };
        let z = disks.coordination;
        let disks = format!("{steps} to f_max = {f_max:.2e} γ, Z = {z:.3}{ending}");
        lines.line("disks", disks);
    }
    let (f_max, threshold) = (found.f_max, scene.threshold);
    lines.line(
        "f_max",
        format!("{f_max:.3e} γ (threshold {threshold:.1e} γ)"),
    );
    let contacts = counted(found.backbone_contacts, "contact");
    let (z, rattlers) = (found.coordination(), counted(found.rattlers, "rattler"));
    let z = format!("{z:.4} ({contacts} between particles that are held, {rattlers})");
    lines.line("Z", z);
    lines.line("pressure", format!("{:.6e} γ/length", found.pressure()));
    lines.line("energy", format!("{:.6e} γ·length", found.energy));
    if let Some([_, strain]) = found.phi_and_strain {
        let [xx, xy, yy] = found.stress;
        let stress = format!("σ_xy = {xy:.6e}, σ_xx = {xx:.6e}, σ_yy = {yy:.6e} γ/length");
        lines.line("stress", format!("{stress} at strain {strain}"));
    }
    if let Some(jamming) = run.jamming() {
        let way = match jamming.slope {
            Some(slope) => format!("extrapolated from φ = {coverage:.8} with dp/dφ = {slope:.4}"),
            None if is_halved(scene, run) => {
                "there the network breaks, under that pressure".to_owned()
            }
            None => "by bisection".to_owned(),
        };
        let (start, back) = (scene.phi, counted(jamming.failed as usize, "step"));
        let jammed = format!(
            "{:.10} ({way}; from a start at φ = {start}, {back} taken back)",
            jamming.phi_j
        );
        lines.line("φ_J", jammed);
    }
    if let Some(law) = run.law() {
        let residual = law.residual();
        let residual = format!("residual {residual:.1e} of the largest overlap");
        lines.line("contact law", residual);
    }
    // Without disks it is the time of the first contact problem.
    let disks_first = run.disks().is_some() && !scene.records_disks();
    let preparation = if disks_first { "disks" } else { "start" };
    let (rate, before) = (super::rate(steps, took), before.as_secs_f64());
    let took = took.as_secs_f64();
    let time = format!("{before:.2} s {preparation}, {took:.2} s relaxation ({rate:.0} steps/s)");
    lines.line("time", time);
    for (output, written) in outputs.iter().zip(&summary.files) {
        output.tell(written, &mut lines);
    }
    lines.into_text()
}

/// Whether a search of φ_J, which is the stage of the run, halves the pressure.
fn is_halved(scene: &Scene, run: &Relaxation) -> bool {
    let way = Way::Halving;
    let stage = scene.stage_of_protocol(run.stage());
    stage.is_some_and(|stage| matches!(stage.act, Act::Jam { way: w, .. } if w == way))
}
