//! `cargo xtask validate`: measures what the library computes and writes what it found.
//!
//! For each page of `docs/validation` an example of the library computes, draws the pictures and
//! prints numbers; here these become the page. Nothing is measured here.

mod words;
mod learning;
mod reachability;
mod shfrs;

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context, Result};
use serde::de::DeserializeOwned;

use crate::workspace::{Workspace, output_of, stage};

/// Measure value functions, reachable sets and learning against closed forms, references and
/// peers; write the pages of docs/validation.
#[derive(clap::Args)]
pub(crate) struct Options {
    /// The page to write anew; all of them if none is named.
    #[arg(value_enum)]
    page: Option<Page>,
    /// Measure the peers of the value functions again too: minutes, on a machine with nothing
    /// else to do.
    #[arg(long)]
    peers: bool,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
enum Page {
    /// Value functions: reachability.md.
    Reachability,
    /// Reachable sets and their probabilities: shfrs.md.
    Shfrs,
    /// Models, the comparison and its tests: learning.md.
    Learning,
}

/// Measures and writes.
///
/// # Errors
/// When the library cannot be built, a measurement fails or a file cannot be written.
pub(crate) fn run(workspace: &Workspace, options: &Options) -> Result<()> {
    let wanted = |page| options.page.is_none_or(|only| only == page);
    if wanted(Page::Reachability) {
        reachability::run(workspace, options.peers)?;
    }
    if wanted(Page::Shfrs) {
        shfrs::run(workspace)?;
    }
    if wanted(Page::Learning) {
        learning::run(workspace)?;
    }
    Ok(())
}

/// Where the pages and their pictures are.
fn folder(workspace: &Workspace) -> PathBuf {
    workspace.path("docs/validation")
}

/// What an example of the library prints.
fn measured<R: DeserializeOwned>(workspace: &Workspace, example: &str) -> Result<R> {
    stage("library", workspace.compile("build").args(["--example", example]))?;
    eprintln!("==> measurements");
    let what = format!("the example {example}");
    let answer = output_of(&what, &mut Command::new(workspace.example(example)))?;
    serde_json::from_str(&answer).with_context(|| format!("{what} printed something else"))
}

fn read(path: &Path) -> Result<String> {
    fs::read_to_string(path).with_context(|| format!("cannot read {}", path.display()))
}

fn write(path: &Path, text: &str) -> Result<()> {
    fs::write(path, text).with_context(|| format!("cannot write {}", path.display()))
}
