//! `cargo xtask validate`: measures the value functions and writes what it found.
//!
//! The example `validate` of the library computes and prints numbers; here they become
//! `docs/validation/reachability.md` ([`page`]) and its pictures ([`figures`]). Every number
//! on the page comes from there, except those of [`peers`], which take minutes to measure
//! and depend on the machine: they are kept in `docs/validation/peers.json`.

mod figures;
mod page;
mod peers;
mod report;

use std::fs;
use std::path::Path;
use std::process::Command;

use anyhow::{Context, Result};

use crate::workspace::{Workspace, output_of, stage};
use report::Report;

/// Measure the value functions against closed form, reference and peers; write the page.
#[derive(clap::Args)]
pub(crate) struct Options {
    /// Measure the peers again too: minutes, on a machine with nothing else to do.
    #[arg(long)]
    peers: bool,
}

/// Where the page, its pictures and the peers' figures are.
const FOLDER: &str = "docs/validation";

/// Measures and writes.
///
/// # Errors
/// When the library cannot be built, a solve fails or a file cannot be written.
pub(crate) fn run(workspace: &Workspace, options: &Options) -> Result<()> {
    let mut build = workspace.cargo(["build", "--locked", "--release", "--package", "sidestep"]);
    stage("library", build.args(["--example", "validate"]))?;
    eprintln!("==> measurements");
    let answer =
        output_of("the example validate", &mut Command::new(workspace.example("validate")))?;
    let report: Report =
        serde_json::from_str(&answer).context("the example validate printed something else")?;

    let folder = workspace.path(FOLDER);
    let peers_path = folder.join("peers.json");
    let kept = read(&peers_path)?;
    let kept = peers::Peers::parse(&kept).with_context(|| peers_path.display().to_string())?;
    let peers = if options.peers { kept.measured_again(workspace)? } else { kept };
    if options.peers {
        write(&peers_path, &peers.text()?)?;
    }

    for figure in figures::FIGURES {
        write(&folder.join(figure.file), &(figure.draw)(&report)?)?;
    }
    let page = folder.join("reachability.md");
    write(&page, &page::page(&report, &peers))?;
    println!("{}", page.display());
    Ok(())
}

fn read(path: &Path) -> Result<String> {
    fs::read_to_string(path).with_context(|| format!("cannot read {}", path.display()))
}

fn write(path: &Path, text: &str) -> Result<()> {
    fs::write(path, text).with_context(|| format!("cannot write {}", path.display()))
}
