//! `cargo xtask bench learning`: the paper's comparison. scikit-learn and `sidestep analyze`
//! compute it for one participant; `sidestep analyze` alone also computes it for all eight.
//!
//! `tests/peers/learning.py` is the peer's side. Our time includes work that the peer does not do:
//! feature sets with the body frame, calibration, models beyond the paper, roll-outs and output
//! files.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode, Stdio};

use anyhow::{Context, Result, ensure};
use serde::Deserialize;

use super::peers::table;
use super::process::{Measured, measured};
use crate::python::environment;
use crate::workspace::{Workspace, output_of, stage};

/// Target speed-up over the peer.
const RATIO: f64 = 15.0;

/// Threads and time limit (s) of each comparison of all eight participants.
const WHOLE: [(&str, f64); 2] = [("2", 20.0), ("1", 35.0)];

/// Memory limit (MB).
const MEMORY_MB: f64 = 400.0;

/// The fields of the script's output that are used here.
#[derive(Deserialize)]
struct Theirs {
    wall_s: f64,
    fits: u32,
    versions: Versions,
}

#[derive(Deserialize)]
struct Versions {
    scikit_learn: String,
    numpy: String,
}

/// Measures, and prints the table. Fails if a target is missed. Without Python or its packages,
/// prints only our own figures and fails.
///
/// # Errors
/// When the program cannot be built or run.
pub(super) fn run(workspace: &Workspace) -> Result<ExitCode> {
    stage("server", workspace.compile("build").args(["--bin", "sidestep"]))?;
    let folder = tempfile::tempdir().context("a folder for results")?;
    let data = |name: &str| workspace.path("shared/tests/data").join(name);
    let (trials, features) = (data("trials.csv"), data("features.csv"));
    let first = folder.path().join("first.csv");
    fs::write(&first, of_first_participant(&fs::read_to_string(&trials)?))?;

    let mut rows = vec![
        ["what", "wall s", "peer's wall s", "ratio", "target", "memory MB", ""].map(str::to_owned),
    ];
    let ours = analyze(workspace, &first, &features, "2", &folder.path().join("first"))?;
    let theirs = theirs(workspace, &features);
    let mut kept = true;
    let mut says = |kept_here: bool| {
        kept &= kept_here;
        if kept_here { String::new() } else { "MISSED".to_owned() }
    };
    if let Ok(theirs) = &theirs {
        let ratio = theirs.wall_s / ours.wall_s;
        eprintln!(
            "scikit-learn {}, numpy {}: {} fits in two processes",
            theirs.versions.scikit_learn, theirs.versions.numpy, theirs.fits
        );
        rows.push([
            "one participant, 2 threads".to_owned(),
            format!("{:.2}", ours.wall_s),
            format!("{:.1}", theirs.wall_s),
            format!("{ratio:.1}"),
            format!("≥ {RATIO}"),
            ours.memory(),
            says(ratio >= RATIO),
        ]);
    }
    for (threads, most) in WHOLE {
        let out = folder.path().join(threads);
        let ours = analyze(workspace, &trials, &features, threads, &out)?;
        let small = ours.memory_mb.is_none_or(|mb| mb <= MEMORY_MB);
        rows.push([
            format!(
                "eight participants, {threads} thread{}",
                if threads == "1" { "" } else { "s" }
            ),
            format!("{:.1}", ours.wall_s),
            "-".to_owned(),
            format!("{:.2}", ours.wall_s / most),
            format!("≤ {most} s"),
            ours.memory(),
            says(ours.wall_s <= most && small),
        ]);
    }
    print!("{}", table(&rows));
    if let Err(error) = &theirs {
        eprintln!("error: {error:#}");
    }
    Ok(if kept && theirs.is_ok() { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}

/// The CSV header and the rows of the first participant.
fn of_first_participant(trials: &str) -> String {
    let mut lines = trials.lines();
    let header = lines.next().unwrap_or_default();
    let name = |line: &str| line.split(',').next().map(str::to_owned);
    let first = lines.clone().next().and_then(name);
    let own = lines.filter(|line| name(line) == first);
    std::iter::once(header).chain(own).flat_map(|line| [line, "\n"]).collect()
}

fn theirs(workspace: &Workspace, features: &Path) -> Result<Theirs> {
    let python = environment(workspace, "learning-requirements.txt", "learning")?;
    let mut script = Command::new(python);
    script.arg(workspace.path("tests/peers/learning.py"));
    script.arg("--features").arg(features).args(["--participant", "0", "--processes", "2"]);
    let answer = output_of("the peer's script", &mut script)?;
    serde_json::from_str(&answer).with_context(|| format!("the peer's script printed {answer:?}"))
}

/// Runs `sidestep analyze` with a new output folder, so that no earlier result is reused.
fn analyze(
    workspace: &Workspace,
    trials: &Path,
    features: &Path,
    threads: &str,
    out: &PathBuf,
) -> Result<Measured> {
    ensure!(!out.exists(), "{} already exists", out.display());
    let mut command = Command::new(workspace.server());
    command.arg("analyze").arg("--trials").arg(trials).arg("--features").arg(features);
    // The peer's script runs only the paper's comparison.
    command.args(["--paper-only", "--threads", threads]).arg("--out").arg(out);
    measured(&mut command, Stdio::null())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_participant_is_cut_out() {
        let trials = "participant,trial\n7,0\n7,1\n70,0\n";
        assert_eq!(of_first_participant(trials), "participant,trial\n7,0\n7,1\n");
    }
}
