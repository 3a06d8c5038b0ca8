//! `softjam VERB --help`: complete, and true.

use super::{folder, run};
use softjam::scene::Scene;

const VERBS: [&str; 8] = [
    "record", "replay", "info", "convert", "join", "figure", "manual", "scene",
];

fn help(verb: &str) -> String {
    let folder = folder();
    let (code, text, errors) = run(folder.path(), &[verb, "--help"]);
    assert_eq!(code, Some(0), "{errors}");
    text
}

/// A flag's text, line breaks taken out; empty if the flag is not there.
fn text_of(help: &str, flag: &str) -> String {
    let mut lines = help
        .lines()
        .skip_while(|line| !line.split([' ', ',', '[', '=']).any(|word| word == flag));
    let first = lines.next().unwrap_or_default();
    let indented = |line: &&str| !line.trim_start().starts_with('-') && line.starts_with("     ");
    let rest = lines.take_while(indented);
    let words = core::iter::once(first)
        .chain(rest)
        .flat_map(str::split_whitespace);
    words.collect::<Vec<_>>().join(" ")
}

#[test]
fn every_verb_has_examples_whose_flags_exist_and_its_exit_codes() {
    for verb in VERBS {
        let text = help(verb);
        let (usage, after) = text
            .split_once("Examples:")
            .unwrap_or_else(|| panic!("{verb} has no examples"));
        assert!(after.contains("Exit codes:"), "{verb}: no exit codes");
        let examples: Vec<&str> = after
            .lines()
            .filter(|line| line.trim_start().starts_with(&format!("softjam {verb}")))
            .collect();
        assert!(examples.len() >= 2, "{verb}: {examples:?}");
        for word in examples.iter().flat_map(|line| line.split_whitespace()) {
            let flag = word.split('=').next().unwrap_or_default();
            if flag.starts_with('-') && flag.len() > 1 {
                assert!(
                    !text_of(usage, flag).is_empty(),
                    "{verb}: an example has {flag}, the options do not"
                );
            }
        }
        let described = |line: &&str| line.trim_start().starts_with("--");
        for line in usage.lines().filter(described) {
            let flag = line.split_whitespace().next().unwrap_or_default();
            let flag = flag.split(['[', '=']).next().unwrap_or_default();
            let words = text_of(usage, flag).split_whitespace().count();
            assert!(words >= 4, "{verb} {flag} is not explained");
        }
    }
}

#[test]
fn defaults_in_the_help_are_those_of_the_scene() {
    let scene = Scene::default();
    let text = help("record");
    let defaults = [
        ("--particles", scene.particles.to_string()),
        ("--phi", scene.phi.to_string()),
        ("--aspect", scene.aspect.to_string()),
        ("--seed", scene.seed.to_string()),
        ("--start", "random".to_owned()),
        ("--line-tension", scene.line_tension.to_string()),
        ("--threshold", format!("{:e}", scene.threshold)),
        ("--steps", scene.steps.to_string()),
        ("--vertices", scene.contours.vertices.to_string()),
    ];
    for (flag, default) in defaults {
        let said = text_of(&text, flag);
        assert!(
            said.contains(&format!("[default: {default}]")),
            "{flag} is {default}: {said}"
        );
    }
    let toml = scene.to_toml();
    for (flag, field) in [
        ("--minimizer", "minimizer"),
        ("--forces", "forces"),
        ("--contact-rule", "contact_rule"),
        ("--contact-solver", "contact_solver"),
    ] {
        let line = toml.lines().find(|l| l.starts_with(&format!("{field} = ")));
        let default = line.and_then(|l| l.split('"').nth(1)).expect(field);
        let said = text_of(&text, flag);
        assert!(
            said.contains(&format!("[default: {default}]")),
            "{flag}: {said}"
        );
    }
}

#[test]
fn messages_name_the_thing_its_value_and_the_way_out() {
    let folder = folder();
    let at = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).expect(name);
    at(
        "disks.toml",
        "file = \"a.csv\"\n[disks]\nthreshold = 1e-3\n",
    );
    at(
        "default.toml",
        "file = \"a.csv\"\n[disks]\nthreshold = 1e-6\nsteps = 50000\n",
    );
    at("a.csv", "# box = 6, 6\nx,y,radius\n1,1,0.5\n2,1,0.5\n");
    super::record(folder.path(), "metrics.rrd", &["--channels", "metrics"]);
    let told: [(i32, &[&str], &[&str]); 10] = [
        (
            2,
            &["record", "--phi", "abc"],
            &["'abc'", "--phi", "a number"],
        ),
        (2, &["record", "-N", "2.5"], &["'2.5'", "whole number"]),
        (
            2,
            &["record", "--start", "file"],
            &["start = \"file\"", "--file"],
        ),
        (
            2,
            &["record", "--forces", "none"],
            &["`none`", "`central` or `gradient`"],
        ),
        (
            2,
            &["record", "disks.toml"],
            &["disks", "as it stands", "leave [disks] out"],
        ),
        (
            1,
            &["record", "-o", "no/x.rrd"],
            &["no/x.rrd", "no folder no"],
        ),
        (
            2,
            &["record", "--from", "metrics.rrd"],
            &["metrics.rrd", "--channels state"],
        ),
        (
            2,
            &["convert", "metrics.rrd", "metrics.rrd"],
            &["metrics.rrd", "another file"],
        ),
        (
            2,
            &["figure", "metrics.rrd", "-o", "x.svg"],
            &["metrics.rrd", "--channels state"],
        ),
        (1, &["replay", "a.csv"], &["a.csv", "not a recording"]),
    ];
    for (expected, arguments, words) in told {
        let (code, _, errors) = run(folder.path(), arguments);
        assert_eq!(code, Some(expected), "{arguments:?}: {errors}");
        for word in words {
            assert!(
                errors.contains(word),
                "{arguments:?}: no {word} in {errors}"
            );
        }
    }
    // What every recorded scene has in its text says nothing against it.
    let (code, _, errors) = run(folder.path(), &["record", "default.toml", "-o", "a.rrd"]);
    assert_eq!(code, Some(0), "{errors}");
}

#[test]
fn info_says_how_far_particles_are_squeezed() {
    let folder = folder();
    super::record(folder.path(), "a.rrd", &[]);
    let (_, out, _) = run(folder.path(), &["info", "a.rrd", "--json"]);
    let info: serde_json::Value = serde_json::from_str(&out).expect("JSON");
    let mean = info["squeeze"]["mean"].as_f64().expect("a mean");
    // p = Σ f r / 2V and Σf/2πγ summed over particles are both sums over contacts: with r = 1.1 to 15 %.
    let (p, volume) = (info["metrics"]["pressure"].as_f64(), {
        let side = |k: usize| info["box"][k].as_f64().expect("a side");
        side(0) * side(1)
    });
    let forces = 2.0 * volume * p.expect("a pressure") / 1.1;
    let estimate = 2.0 * forces / (2.0 * std::f64::consts::PI) / 64.0;
    assert!(
        (mean / estimate - 1.0).abs() < 0.15,
        "{mean} and {estimate}"
    );
    assert!(info["squeeze"]["largest"].as_f64() > Some(mean));
}
