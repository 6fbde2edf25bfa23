//! `cargo xtask build`: builds the client's bundle and the server, ready to run.

use std::time::{Duration, Instant};

use anyhow::{Result, bail};

use crate::site::{self, ENTRIES, PageSize};
use crate::workspace::{Runs, Workspace, both, stage};

/// Build client and server (release), ready to run from any working directory.
///
/// Writes the server to `target/release/sidestep` and the client to `target/release/site/`.
#[derive(Default, clap::Args)]
pub(crate) struct Options {
    /// Build only the client. This is enough after a change to the client or to `static/`.
    #[arg(long)]
    pub(crate) client_only: bool,
}

/// Builds, then prints the download size of each page and the time of each stage.
///
/// # Errors
/// When compiling fails, a file in `static/` is invalid, or a page exceeds its size budget.
pub(crate) fn run(workspace: &Workspace, options: &Options) -> Result<()> {
    let (pages, times) = if options.client_only {
        client(workspace)?
    } else {
        let ((pages, mut times), took) = both(|| client(workspace), || server(workspace))?;
        times.push(("server", took));
        (pages, times)
    };
    report(&pages, &times);
    match pages.iter().find(|page| page.is_over_budget()) {
        Some(page) => bail!(
            "{} loads {} bytes, more than its budget of {}: see what the client's last dependency or \
             table added",
            page.name,
            page.total(),
            page.budget.unwrap_or_default(),
        ),
        None => Ok(()),
    }
}

/// Stages with their times.
type Times = Vec<(&'static str, Duration)>;

/// Builds the client's bundle. Returns the sizes of its pages and the time of each stage.
fn client(workspace: &Workspace) -> Result<(Vec<PageSize>, Times)> {
    workspace.ensure_wasm_target()?;
    let mut times = Vec::new();
    for (name, runs) in [("client", Runs::InPage), ("workers", Runs::InWorker)] {
        let entries = ENTRIES.iter().filter(|(_, where_it_runs)| *where_it_runs == runs);
        let mut build = workspace.compile_for_browsers("build", runs);
        build.args(entries.flat_map(|(entry, _)| ["--bin", entry]));
        times.push((name, stage(name, &mut build)?));
    }

    let start = Instant::now();
    let mut bundles = Vec::new();
    for (entry, _) in ENTRIES {
        bundles.push(site::bundle(entry, &workspace.compiled_client(entry))?);
    }
    let composed = site::compose(site::read_static(&workspace.path("static"))?, bundles)?;
    let sizes = site::publish(&composed.files, &workspace.site())?;
    times.push(("site", start.elapsed()));
    Ok((site::page_sizes(&composed, &sizes), times))
}

/// Builds only the server.
///
/// # Errors
/// When compiling fails.
pub(crate) fn server(workspace: &Workspace) -> Result<Duration> {
    stage("server", workspace.compile("build").args(["--bin", "sidestep"]))
}

/// Prints the sizes of the pages and the times of the stages as two tables.
fn report(pages: &[PageSize], times: &[(&str, Duration)]) {
    println!("page              KB   html    css     js   wasm   (brotli)");
    for page in pages {
        println!(
            "{:14} {:5.1}  {:5.1}  {:5.1}  {:5.1}  {:5.1}",
            page.name,
            kilobytes(page.total()),
            kilobytes(page.html),
            kilobytes(page.css),
            kilobytes(page.js),
            kilobytes(page.wasm),
        );
    }
    println!("stage              s");
    for (name, time) in times {
        println!("{name:14} {:5.1}", time.as_secs_f64());
    }
}

/// Bytes as kilobytes.
fn kilobytes(bytes: usize) -> f64 {
    bytes as f64 / 1000.0
}
