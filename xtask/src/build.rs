//! `cargo xtask build`: the client's bundle and the server, ready to run.

use std::process::Command;
use std::time::{Duration, Instant};

use anyhow::Result;

use crate::site::{self, ENTRIES, PAGE_ENTRIES, PARTICIPANT_BUDGET, PageSize, SOLVER};
use crate::workspace::{WASM_TARGET, Workspace, stage};

/// Build client and server (release), ready to run from any working directory.
///
/// Leaves `target/release/sidestep` and the client in `target/release/site/`.
#[derive(Default, clap::Args)]
pub(crate) struct Options {
    /// Leave the server as it is: enough after a change to the client or to `static/`.
    #[arg(long)]
    client_only: bool,
}

/// Builds, then prints what a page costs to load and how long each stage took.
///
/// # Errors
/// When a compiler refuses, or `static/` does not fit the client.
pub(crate) fn run(workspace: &Workspace, options: &Options) -> Result<()> {
    workspace.ensure_wasm_target()?;

    let mut client = build_client(workspace);
    client.args(PAGE_ENTRIES.iter().flat_map(|entry| ["--bin", entry]));
    let mut times = vec![("client", stage("client", &mut client)?)];
    let mut solver = build_solver(workspace);
    times.push(("solver", stage("solver", solver.args(["--bin", SOLVER]))?));

    let start = Instant::now();
    let mut bundles = Vec::new();
    for entry in ENTRIES {
        bundles.push(site::bundle(entry, &workspace.compiled_client(entry))?);
    }
    let composed = site::compose(site::read_static(&workspace.path("static"))?, bundles)?;
    let sizes = site::publish(&composed.files, &workspace.site())?;
    times.push(("site", start.elapsed()));

    if !options.client_only {
        // All members are named so that cargo settles on the same features of the
        // same dependencies as for the tests, and does not compile them twice.
        let arguments = ["build", "--locked", "--release", "--workspace", "--bin", "sidestep"];
        times.push(("server", stage("server", &mut workspace.cargo(arguments))?));
    }

    report(&site::page_sizes(&composed, &sizes), &times);
    Ok(())
}

/// A build of the web client; what of it is to be added.
pub(crate) fn build_client(workspace: &Workspace) -> Command {
    let mut client = workspace.cargo(["build", "--locked", "--profile", "client"]);
    client.args(["--target", WASM_TARGET, "--package", "sidestep-web"]);
    client
}

/// The same, as the solver is built.
///
/// Pages are to be small; the solver is to be fast, and every browser of these days has
/// lanes of 128 bits. Lanes change no bit of any result.
pub(crate) fn build_solver(workspace: &Workspace) -> Command {
    let mut solver = build_client(workspace);
    solver.args(["--config", "profile.client.opt-level=3"]);
    solver.env("CARGO_TARGET_WASM32_UNKNOWN_UNKNOWN_RUSTFLAGS", "-C target-feature=+simd128");
    solver
}

/// Prints the two tables.
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
    for page in pages.iter().filter(|page| page.is_over_budget()) {
        eprintln!(
            "warning: {} loads {} bytes, more than the {PARTICIPANT_BUDGET} that participants \
             are promised: see what the client's last dependency or table added",
            page.name,
            page.total(),
        );
    }
}

/// Bytes in thousands.
fn kilobytes(bytes: usize) -> f64 {
    bytes as f64 / 1000.0
}
