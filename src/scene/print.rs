//! The scene as a commented TOML text.

use super::{Act, Increment, Preparation, Radii, Scene, Start, Until};
use crate::models::Kind;
use crate::text::is_hidden;
use core::fmt::Write as _;

impl Scene {
    /// The scene as TOML, every field written out with its meaning, range and unit; [`from_toml`](Self::from_toml)
    /// gives it back exactly.
    #[must_use]
    pub fn to_toml(&self) -> String {
        let mut page = Page::default();
        page.text("# softjam scene. Lengths in the unit of the radii (by default the diameter of the small particle), forces in that of the line\n# tension, mass 1.");
        self.write_packing(&mut page);
        self.write_relaxation(&mut page);
        self.write_recording(&mut page);
        self.write_protocol(&mut page);
        page.text
    }

    /// [`to_toml`](Self::to_toml) as recordings of a format have it: the first knew one model, which it did not name, and one stage.
    #[must_use]
    pub fn to_toml_of(&self, format: u32) -> String {
        let mut text = self.to_toml();
        if format == 1 && self.model == Kind::default() && !self.records_disks() {
            for write in [Self::write_model, Self::write_record_of_disks] {
                let mut page = Page::default();
                write(self, &mut page);
                text = text.replacen(&page.text, "", 1);
            }
        }
        text
    }

    fn write_record_of_disks(&self, page: &mut Page) {
        page.text("# When contours, contacts and state of these disks are recorded: unless it is off, they are the first stage of the\n# recording, and steps count from their start.");
        page.line("record", quoted(&self.disks.record.to_string()));
    }

    fn write_model(&self, page: &mut Page) {
        page.field(
            "Model: \"morse-witten\" (droplets, linear in the forces), \"rounded-polygon\" and \"wet-foam\" (droplets that keep their area, between\n# straight films and exactly), or \"disks\" (undeformed, f = k delta).",
            "model",
            value(&self.model),
        );
    }

    fn write_packing(&self, page: &mut Page) {
        if let Start::File {
            path,
            blake3,
            preparation,
        } = &self.start
        {
            page.field(
                "Start: \"random\", \"hexagonal\" or \"file\".",
                "start",
                quoted("file"),
            );
            page.field(
                "CSV file of x, y, radius (or diameter) with its box, \"-\" for standard input; particles, radii and box come from it.",
                "file",
                quoted(path),
            );
            if let Some(hash) = blake3 {
                page.field(
                    "BLAKE3 that the file must have.",
                    "file_blake3",
                    quoted(hash),
                );
            }
            page.field(
                "Particles of the file that stand on one point, or on a periodic image of it, are put beside each other; false refuses them.",
                "separate",
                *preparation != Preparation::AsItStands,
            );
        } else {
            page.field(
                "Number of particles, 1 … 10000000.",
                "particles",
                self.particles,
            );
            page.field(
                "Coverage of the undeformed disks, sum of pi R^2 / (L_x L_y), 0 < phi < 1.3.",
                "phi",
                number(self.phi),
            );
            page.field(
                "Aspect L_x / L_y of the periodic box, 0.1 … 10 (hexagonal: the nearest that fits the lattice).",
                "aspect",
                number(self.aspect),
            );
            match &self.radii {
                Radii::Species(species) => {
                    let list: Vec<String> = species
                        .iter()
                        .map(|s| {
                            format!(
                                "{{ radius = {}, fraction = {} }}",
                                number(s.radius),
                                number(s.fraction)
                            )
                        })
                        .collect();
                    page.field(
                        "Undeformed radii and their shares by number, which sum to 1; or: spread = { min = 0.4, max = 0.7 }.",
                        "species",
                        format!("[{}]", list.join(", ")),
                    );
                }
                Radii::Spread { min, max } => page.field(
                    "Undeformed radii, uniform between two values; or: species = [{ radius = 0.5, fraction = 1.0 }].",
                    "spread",
                    format!("{{ min = {}, max = {} }}", number(*min), number(*max)),
                ),
            }
            let start = if self.start == Start::Hexagonal {
                "hexagonal"
            } else {
                "random"
            };
            page.field(
                "Start: \"random\", \"hexagonal\", or \"file\" with file = \"PACKING.csv\" (x, y, radius; \"# box = L_x, L_y\").",
                "start",
                quoted(start),
            );
            page.field(
                "Seed of the ChaCha8 generator behind random centres and radii.",
                "seed",
                self.seed,
            );
        }
        page.field(
            match self.model {
                Kind::MorseWitten | Kind::RoundedPolygon | Kind::WetFoam => {
                    "Line tension gamma of the contours, > 0."
                }
                Kind::Disks => "Unit of force gamma, > 0: k = 4 pi gamma / 3 (R_i + R_j).",
            },
            "line_tension",
            number(self.line_tension),
        );
    }

    fn write_relaxation(&self, page: &mut Page) {
        page.field(
            "Converged when the largest net force f_max (units of gamma) is not above this.",
            "threshold",
            number(self.threshold),
        );
        page.field(
            "The run ends at this step in any case.",
            "steps",
            self.steps,
        );
        self.write_model(page);
        page.field(
            "Minimiser: \"fire\", or \"fire+newton\" (FIRE through the rearrangements, then Newton's method).",
            "minimizer",
            value(&self.minimizer),
        );
        if self.model == Kind::MorseWitten {
            page.field(
            "Forces: \"central\" (along the lines of centres) or \"gradient\" (of the stored energy).",
            "forces",
            value(&self.forces),
        );
        }
        match self.dt_max {
            Some(dt_max) => page.field("Upper bound of the time step.", "dt_max", number(dt_max)),
            None => page.text(
                "\n# Upper bound of the time step; without it, 1.2 / omega_max from the start's largest frequency.\n# dt_max = 0.2",
            ),
        }
        if self.model == Kind::MorseWitten {
            page.field(
            "Contact list: \"complementarity\" (f >= 0, gap >= 0, f gap = 0 in every step) or \"saitoh\" (one drop-and-add a step).",
            "contact_rule",
            value(&self.contact_rule),
        );
            page.field(
            "Solver of A f = delta: \"conjugate-gradient\", \"sparse-cholesky\" or \"gauss-jordan\".",
            "contact_solver",
            value(&self.contact_solver),
        );
        }
        if self.model != Kind::Disks {
            page.field(
                match self.model {
                    Kind::MorseWitten => {
                        "Residual of A f = delta relative to the largest overlap, 1e-14 … 1e-6."
                    }
                    _ => "Violation of the contact law relative to the largest overlap, 1e-14 … 1e-6.",
                },
                "contact_tolerance",
                number(self.contact_tolerance),
            );
        }
        let fire = &self.fire;
        page.text("\n# FIRE 2.0 (Guénolé et al., 2020): N_delay, f_inc, f_dec, alpha_start, f_alpha; the first and the least\n# time step as fractions of dt_max.\n[fire]");
        page.line("delay", fire.delay);
        page.line("increase", number(fire.increase));
        page.line("decrease", number(fire.decrease));
        page.line("mixing", number(fire.mixing));
        page.line("mixing_decay", number(fire.mixing_decay));
        page.line("first_dt", number(fire.first_dt));
        page.line("least_dt", number(fire.least_dt));
        if self.model == Kind::Disks {
            return;
        }
        if self.starts_from_file() {
            page.text("\n# With relax = true the undeformed disks of the file are relaxed first: to this f_max, or for that many steps.\n[disks]");
            page.line("relax", self.starts_from_disks());
        } else {
            page.text("\n# The undeformed disks that the run starts from: relaxed to this f_max, or for that many steps.\n[disks]");
        }
        page.line("threshold", number(self.disks.threshold));
        page.line("steps", self.disks.steps);
        self.write_record_of_disks(page);
    }

    fn write_recording(&self, page: &mut Page) {
        page.text(match self.model {
            Kind::MorseWitten => "\n# Polygons: vertices equally spaced in angle, 3 … 4096; placement \"contacts\" puts one more on each contact,\n# \"equal\" does not (and cuts the cusps off).\n[contours]",
            Kind::RoundedPolygon | Kind::WetFoam => "\n# Polygons: vertices of a turn along arcs, 3 … 4096, beside both ends of each film; placement is of no use to them.\n[contours]",
            Kind::Disks => "\n# Polygons: vertices of a circle, 3 … 4096; placement is of no use to disks.\n[contours]",
        });
        page.line("vertices", self.contours.vertices);
        page.line("placement", value(&self.contours.placement));
        page.text("\n# When each channel is recorded: \"every K\" steps, \"log K\" steps a decade, or \"off\". The first and the last\n# frame are recorded in any case. Without state a recording cannot be replayed.\n[channels]");
        for (name, schedule) in self.channels.named() {
            page.line(name, quoted(&schedule.to_string()));
        }
        page.text("# Contours and contacts are drawn anew when a particle has moved by more than this (mean radii), or a pressure or\n# force has changed by more than ten times this (means), since they were last drawn; 0 draws every time.");
        page.line("redraw", number(self.channels.redraw));
    }

    /// The stages, each a table of its own at the end of the page.
    fn write_protocol(&self, page: &mut Page) {
        if !self.protocol.is_empty() {
            page.text("\n# What is done to the box behind the relaxation, stage by stage: \"relax\", \"compress\" or \"decompress\" (to a coverage phi or a\n# pressure), \"jam\" (finds φ_J), \"shear\". Each state is relaxed to the stage's f_max; one that is not after so many steps ends the run.");
        }
        for stage in &self.protocol {
            page.text("\n[[protocol]]");
            page.line("act", quoted(stage.act.name()));
            match stage.act {
                Act::Relax => {}
                Act::Compress { until, by } => {
                    match until {
                        Until::Phi(phi) => page.line("phi", number(phi)),
                        Until::Pressure(pressure) => page.line("pressure", number(pressure)),
                    }
                    match by {
                        Increment::Absolute(step) => page.line("step", number(step)),
                        Increment::Relative(step) => page.line("relative_step", number(step)),
                    }
                }
                Act::Jam { way, end } => {
                    page.line("way", value(&way));
                    page.line("end", number(end));
                }
                Act::Shear {
                    mode,
                    strain,
                    step,
                    cycles,
                } => {
                    page.line("mode", value(&mode));
                    page.line("strain", number(strain));
                    page.line("step", number(step));
                    page.line("cycles", cycles);
                }
            }
            page.line("threshold", number(stage.threshold));
            page.line("steps", stage.steps);
        }
    }
}

#[derive(Default)]
struct Page {
    text: String,
}

impl Page {
    fn text(&mut self, text: &str) {
        self.text.push_str(text);
        self.text.push('\n');
    }

    fn line(&mut self, name: &str, value: impl core::fmt::Display) {
        // Writing to a String cannot fail.
        let _ = writeln!(self.text, "{name} = {value}");
    }

    fn field(&mut self, comment: &str, name: &str, value: impl core::fmt::Display) {
        let _ = writeln!(self.text, "\n# {comment}");
        self.line(name, value);
    }
}

/// The shortest text that reads back as the same f64.
fn number(x: f64) -> String {
    format!("{x:?}")
}

/// A string on one line; characters that are not seen are written as TOML's escapes.
fn quoted(text: &str) -> String {
    if !text.contains(is_hidden) {
        return toml::Value::String(text.into()).to_string();
    }
    let mut quoted = String::from("\"");
    for c in text.chars() {
        match c {
            '"' | '\\' => quoted.extend(['\\', c]),
            c if is_hidden(c) => {
                let _ = write!(quoted, "\\U{:08X}", u32::from(c));
            }
            c => quoted.push(c),
        }
    }
    quoted.push('"');
    quoted
}

/// A unit variant in its name in the file.
fn value<T: serde::Serialize>(variant: &T) -> String {
    toml::Value::try_from(variant).map_or_else(|_| quoted(""), |v| v.to_string())
}
