//! `softjam manual`: manual pages and shell completions, made of the same definitions as `--help`.

use super::{Verdict, print};
use anyhow::Context as _;
use clap_complete::Shell;
use std::path::PathBuf;

#[derive(clap::Args)]
#[command(after_help = "\
Examples:
  softjam manual --pages ~/.local/share/man/man1      then: man softjam-record
  softjam manual --completions bash > ~/.local/share/bash-completion/completions/softjam

Exit codes: 0 written, 1 could not be written, 2 a bad flag")]
#[group(required = true)]
pub struct Arguments {
    /// Write a manual page for the program and one for each of its verbs into this folder.
    #[arg(long, value_name = "FOLDER")]
    pages: Option<PathBuf>,

    /// Print the completions of a shell.
    #[arg(long, value_name = "SHELL")]
    completions: Option<Shell>,
}

pub fn run(arguments: &Arguments, command: &clap::Command) -> anyhow::Result<Verdict> {
    if let Some(folder) = &arguments.pages {
        std::fs::create_dir_all(folder)
            .and_then(|()| clap_mangen::generate_to(command.clone(), folder))
            .with_context(|| format!("cannot write into {}", folder.display()))?;
    }
    if let Some(shell) = arguments.completions {
        let mut text = Vec::new();
        clap_complete::generate(shell, &mut command.clone(), "softjam", &mut text);
        print(&String::from_utf8_lossy(&text))?;
    }
    Ok(Verdict::Good)
}
