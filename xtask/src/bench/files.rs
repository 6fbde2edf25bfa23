//! `cargo xtask bench files`: measures import and export of a million steps. The baseline is the program
//! `sqlite3` with the same rows in one table.
//!
//! The benchmark does not install `sqlite3` (Debian package `sqlite3`) and also works without it. Runs of
//! Sidestep and of `sqlite3` alternate, and the run with the median time is reported.

use std::fs::File;
use std::path::Path;
use std::process::{Command, ExitCode, Stdio};

use anyhow::{Context, Result};

use super::peers::table;
use super::process::{Measured, measured};
use crate::workspace::{Workspace, stage};

/// Number of simulated people. Each drives 50 trials of 50 steps.
const PEOPLE: u32 = 400;
const STEPS: f64 = 1e6;

/// Memory limit of an import or export (MB).
const MEMORY_MB: f64 = 120.0;

/// The table in sqlite3, with the columns of steps.csv.
const TABLE: &str = "CREATE TABLE steps (participant INTEGER, trial INTEGER, step INTEGER, t REAL, \
    hx REAL, hy REAL, hpsi REAL, rx REAL, ry REAL, rpsi REAL, omega REAL, study TEXT, phase TEXT, \
    phase_index INTEGER, attempt INTEGER, trial_id TEXT, participant_id TEXT, flags TEXT, \
    started_at_ms REAL, sampled_at_ms REAL, received_at_ms INTEGER, synthetic INTEGER, due_at_ms REAL, \
    exposures INTEGER, damaged INTEGER)";

/// Measures, and prints the table. Fails if a target is missed.
///
/// # Errors
/// When the program cannot be built or run.
pub(super) fn run(workspace: &Workspace, quick: bool) -> Result<ExitCode> {
    stage("server", workspace.compile("build").args(["--bin", "sidestep"]))?;
    // Use a folder on disk, because the system's folder for temporary files might be in memory.
    let folder = tempfile::tempdir_in(workspace.path("target")).context("a folder for files")?;
    let at = |name: &str| folder.path().join(name);
    let sidestep = || Command::new(workspace.server());
    let people = PEOPLE.to_string();
    let simulate =
        ["simulate", "--seed", "1", "--keys", "clock", "--participants", &people, "--out"];
    measured(sidestep().args(simulate).arg(at("simulated.csv")), Stdio::null())?;
    let database = |name: &str| format!("sqlite:{}", at(name).display());
    let import = |file: &Path| {
        delete(&at("ours.db"))?;
        let mut command = sidestep();
        command.args(["import", "--database", &database("ours.db"), "--trials"]).arg(file);
        measured(&mut command, Stdio::null())
    };
    let export = |format: &str| {
        let mut command = sidestep();
        command.args(["export", "--database", &database("ours.db"), "--format", format, "--out"]);
        measured(command.arg(at(format)), Stdio::null())
    };
    // Import and export once first, so that sqlite3 and Sidestep later import the same file.
    import(&at("simulated.csv"))?;
    export("csv")?;
    std::fs::rename(at("csv").join("steps.csv"), at("steps.csv"))?;

    let peer = has_sqlite3();
    let rounds = if quick { 1 } else { 5 };
    let mut ours: [Vec<Measured>; 6] = [const { Vec::new() }; 6];
    let mut theirs: [Vec<Measured>; 2] = [const { Vec::new() }; 2];
    for _ in 0..rounds {
        ours[0].push(import(&at("steps.csv"))?);
        if peer {
            delete(&at("theirs.db"))?;
            let load = format!(".import --csv --skip 1 '{}' steps", at("steps.csv").display());
            let mut command = Command::new("sqlite3");
            command.arg(at("theirs.db")).args([TABLE, &load]);
            theirs[0].push(measured(&mut command, Stdio::null())?);
        }
        ours[1].push(export("csv")?);
        if peer {
            let mut command = Command::new("sqlite3");
            command.args(["-csv", "-header"]).arg(at("theirs.db")).arg("SELECT * FROM steps");
            theirs[1].push(measured(&mut command, File::create(at("theirs.csv"))?)?);
        }
        ours[2].push(export("jsonl")?);
        ours[3].push(export("parquet")?);
        ours[4].push(export("psych-ds")?);
        ours[5].push(export("sqlite")?);
    }
    let mut kept = true;
    let mut rows =
        vec![["what", "steps/s", "sqlite3", "ratio", "target", "memory MB", ""].map(str::to_owned)];
    let names = [
        "import",
        "export csv",
        "export jsonl",
        "export parquet",
        "export psych-ds",
        "export sqlite",
    ];
    let targets = [3e5, 1e6, 5e5, 1e6, 1e6, 2e5];
    let mut theirs = theirs.map(|runs| (!runs.is_empty()).then(|| median(runs))).into_iter();
    for ((name, ours), target) in names.into_iter().zip(ours).zip(targets) {
        let (ours, theirs) = (median(ours), theirs.next().flatten());
        let per_s = STEPS / ours.wall_s;
        let ratio = theirs.as_ref().map(|theirs| theirs.wall_s / ours.wall_s);
        // Import has no target ratio, because sqlite3 does not validate what it imports.
        let slow =
            per_s < target || (name == "export csv" && ratio.is_some_and(|ratio| ratio < 0.5));
        let missed = slow || ours.memory_mb.is_some_and(|mb| mb > MEMORY_MB);
        kept &= !missed;
        rows.push([
            name.to_owned(),
            format!("{per_s:.0}"),
            theirs.map_or_else(|| "-".to_owned(), |theirs| format!("{:.0}", STEPS / theirs.wall_s)),
            ratio.map_or_else(|| "-".to_owned(), |ratio| format!("{ratio:.2}")),
            format!("≥ {target}, ≤ {MEMORY_MB} MB"),
            ours.memory(),
            if missed { "MISSED" } else { "" }.to_owned(),
        ]);
    }
    print!("{}", table(&rows));
    if !peer {
        eprintln!("no comparison: sqlite3 is not installed (Debian package sqlite3)");
    }
    Ok(if kept { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}

fn has_sqlite3() -> bool {
    let mut version = Command::new("sqlite3");
    let status = version.arg("--version").stdout(Stdio::null()).stderr(Stdio::null()).status();
    status.is_ok_and(|status| status.success())
}

/// Deletes a database with its log files.
fn delete(database: &Path) -> Result<()> {
    for ending in ["db", "db-wal", "db-shm"] {
        let file = database.with_extension(ending);
        if file.exists() {
            std::fs::remove_file(file)?;
        }
    }
    Ok(())
}

/// The run with the median time of a non-empty list.
fn median(mut runs: Vec<Measured>) -> Measured {
    runs.sort_by(|a, b| a.wall_s.total_cmp(&b.wall_s));
    runs.swap_remove(runs.len() / 2)
}
