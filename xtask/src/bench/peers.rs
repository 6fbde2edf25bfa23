//! `cargo xtask bench peers`: solves the air3D game with our solver and with hj_reachability, on
//! the same grid, with the same scheme, horizon, CFL number and number of threads.
//!
//! `tests/peers/air3d.py` runs the peer; the library's example `air3d` runs our solver. The example
//! measures the accuracy of both solutions against the closed form, in the same way.
//!
//! `cargo xtask bench peers -- --lanes avx2` limits both solvers to the SIMD width that most
//! machines have.

use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode};

use anyhow::{Context, Result, bail};
use clap::{Parser, ValueEnum};
use serde::{Deserialize, Serialize};

use crate::python::environment;
use crate::workspace::{Workspace, output_of, stage};

/// One comparison.
struct Case {
    /// Number of nodes along x, y and ψ.
    grid: &'static str,
    /// Our name of the scheme.
    scheme: &'static str,
    /// The peer's name of the scheme.
    accuracy: &'static str,
    /// Target speed-up over the peer on two idle cores.
    target: f64,
    /// Whether the peer takes minutes. If so, each side solves once; otherwise the fastest of three
    /// solves counts.
    long: bool,
}

/// All comparisons.
const CASES: &[Case] = &[
    Case { grid: "51x40x50", scheme: "eno2", accuracy: "medium", target: 12.0, long: false },
    Case { grid: "51x40x50", scheme: "weno5", accuracy: "very_high", target: 6.0, long: false },
    Case { grid: "101x101x101", scheme: "eno2", accuracy: "medium", target: 40.0, long: true },
    Case { grid: "101x101x101", scheme: "weno5", accuracy: "very_high", target: 20.0, long: true },
];

impl Case {
    /// Number of solves on each side, as a command-line argument.
    fn runs(&self) -> &'static str {
        if self.long { "1" } else { "3" }
    }
}

/// Number of threads of our solver. The peer's script uses the same number of cores.
const THREADS: &str = "2";

/// Arguments after `--`.
#[derive(Parser)]
struct Arguments {
    /// Limit of the SIMD width of both solvers.
    #[arg(long)]
    lanes: Option<Lanes>,
}

/// SIMD widths, named as in the example `air3d`.
#[derive(Clone, Copy, PartialEq, Eq, Debug, ValueEnum)]
enum Lanes {
    #[value(name = "128-bit")]
    Bits128,
    #[value(name = "avx2")]
    Avx2,
    #[value(name = "avx512")]
    Avx512,
}

impl Lanes {
    /// The values of the environment variables `LANES` (for the example) and `XLA_FLAGS` (for the
    /// peer).
    fn variables(self) -> [(&'static str, &'static str); 2] {
        let (ours, theirs) = match self {
            Self::Bits128 => ("128-bit", "--xla_cpu_max_isa=SSE4_2"),
            Self::Avx2 => ("avx2", "--xla_cpu_max_isa=AVX2"),
            Self::Avx512 => ("avx512", "--xla_cpu_max_isa=AVX512"),
        };
        [("LANES", ours), ("XLA_FLAGS", theirs)]
    }

    /// Limits the SIMD width of `command` to `most`, if given.
    fn limit(most: Option<Self>, command: &mut Command) {
        if let Some(lanes) = most {
            command.envs(lanes.variables());
        }
    }
}

/// The fields of the example's output that are used here.
#[derive(Deserialize)]
struct Ours {
    wall_s: f64,
    lanes: String,
    axes: [Nodes; 3],
    accuracy: Accuracy,
    peer: Option<Accuracy>,
}

/// The output of the peer's script.
#[derive(Deserialize)]
struct Theirs {
    wall_s: f64,
    axes: [Nodes; 3],
    versions: Versions,
}

/// First node, last node and number of nodes of an axis.
type Nodes = (f64, f64, usize);

/// Accuracy against the closed form, as the example `air3d` defines it.
#[derive(Clone, Copy, Debug, Deserialize, Serialize)]
struct Accuracy {
    mean_dx: f64,
    max_dx: f64,
    volume_percent: f64,
}

impl Theirs {
    /// Names and versions of the peer's packages.
    fn solver(&self) -> String {
        let Versions { hj_reachability, jax } = &self.versions;
        format!("hj_reachability {hj_reachability}, jax {jax}")
    }
}

#[derive(Deserialize)]
struct Versions {
    hj_reachability: String,
    jax: String,
}

/// Runs every comparison (without the long ones if `quick`) and prints the table.
///
/// If Python or its packages are missing, still prints our own figures and then fails.
///
/// # Errors
/// When our own solver cannot be built or run.
pub(super) fn run(workspace: &Workspace, quick: bool, arguments: &[OsString]) -> Result<ExitCode> {
    let name = OsString::from("bench peers --");
    let Arguments { lanes } = Arguments::try_parse_from(std::iter::once(&name).chain(arguments))?;
    let (compared, missing) = compare(workspace, quick, lanes)?;
    let rows = compared.iter().map(|one| row(one.case, &one.ours, one.theirs.as_ref()));
    let rows: Vec<_> = std::iter::once(HEADINGS.map(str::to_owned)).chain(rows).collect();
    print!("{}", table(&rows));
    for error in &missing {
        eprintln!("error: {error:#}");
    }
    Ok(if missing.is_empty() { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}

/// The figures of one solver for one case.
#[derive(Serialize)]
pub(crate) struct Figures {
    solver: String,
    grid: &'static str,
    scheme: &'static str,
    wall_s: f64,
    #[serde(flatten)]
    accuracy: Accuracy,
}

/// Runs every comparison and returns, case by case, the peer's figures and then ours.
///
/// # Errors
/// When our own solver cannot be built or run, or the peer is missing.
pub(crate) fn measure(workspace: &Workspace) -> Result<Vec<Figures>> {
    let (compared, mut missing) = compare(workspace, false, None)?;
    if !missing.is_empty() {
        return Err(missing.swap_remove(0));
    }
    let mut figures = Vec::new();
    for Compared { case, ours, theirs } in compared {
        let Case { grid, scheme, .. } = *case;
        let theirs = theirs.zip(ours.peer).context("the peer left no values")?;
        let (solver, wall_s) = (theirs.0.solver(), theirs.0.wall_s);
        figures.push(Figures { solver, grid, scheme, wall_s, accuracy: theirs.1 });
        let (solver, wall_s, accuracy) = ("sidestep".to_owned(), ours.wall_s, ours.accuracy);
        figures.push(Figures { solver, grid, scheme, wall_s, accuracy });
    }
    Ok(figures)
}

/// The results of both solvers for one case.
struct Compared {
    case: &'static Case,
    ours: Ours,
    theirs: Option<Theirs>,
}

/// Runs the comparisons. Also returns the errors of the peer, if it is missing or fails.
fn compare(
    workspace: &Workspace,
    quick: bool,
    lanes: Option<Lanes>,
) -> Result<(Vec<Compared>, Vec<anyhow::Error>)> {
    let mut build = workspace.compile("build");
    stage("our solver", build.args(["--example", "air3d"]))?;
    let mut missing = Vec::new();
    let python = environment(workspace, "requirements.txt", "venv")
        .map_err(|error| missing.push(error))
        .ok();

    let mut compared = Vec::new();
    for case in CASES.iter().filter(|case| !(quick && case.long)) {
        eprintln!("==> {} {}", case.grid, case.scheme);
        let values = workspace.output("peers").join(format!("{}-{}.npy", case.grid, case.scheme));
        let theirs = python.as_deref().and_then(|python| {
            let solved = solve_theirs(workspace, python, case, lanes, &values);
            solved.map_err(|error| missing.push(error)).ok()
        });
        let ours = solve_ours(workspace, case, lanes, theirs.is_some().then_some(&values))?;
        if let Some(theirs) = &theirs {
            same_nodes(&ours.axes, &theirs.axes)?;
        }
        compared.push(Compared { case, ours, theirs });
    }
    Ok((compared, missing))
}

/// Runs the peer on `case`. The peer writes its values to the file `values`.
fn solve_theirs(
    workspace: &Workspace,
    python: &Path,
    case: &Case,
    lanes: Option<Lanes>,
    values: &Path,
) -> Result<Theirs> {
    let mut script = Command::new(python);
    Lanes::limit(lanes, &mut script);
    script.arg(workspace.path("tests/peers/air3d.py"));
    script.args(["--grid", case.grid, "--accuracy", case.accuracy]);
    script.args(["--runs", case.runs(), "--values"]).arg(values);
    let answer = output_of("the peer's script", &mut script)?;
    serde_json::from_str(&answer).with_context(|| format!("the peer's script printed {answer:?}"))
}

/// Solves `case` with our solver, and measures the accuracy of the peer's values in the file `values`.
fn solve_ours(
    workspace: &Workspace,
    case: &Case,
    lanes: Option<Lanes>,
    values: Option<&PathBuf>,
) -> Result<Ours> {
    let mut example = Command::new(workspace.example("air3d"));
    Lanes::limit(lanes, &mut example);
    example.args([case.grid, case.scheme, THREADS, case.runs()]).args(values);
    let answer = output_of("the example air3d", &mut example)?;
    serde_json::from_str(&answer).with_context(|| format!("the example air3d printed {answer:?}"))
}

/// Fails unless both solvers use the same nodes, within the peer's 32-bit precision.
fn same_nodes(ours: &[Nodes; 3], theirs: &[Nodes; 3]) -> Result<()> {
    let close = |a: f64, b: f64| (a - b).abs() < 1e-5;
    let same = |a: &Nodes, b: &Nodes| a.2 == b.2 && close(a.0, b.0) && close(a.1, b.1);
    if !ours.iter().zip(theirs).all(|(a, b)| same(a, b)) {
        bail!(
            "expected the same first node, last node and number of nodes along each axis, \
             found {ours:?} here and {theirs:?} there"
        );
    }
    Ok(())
}

/// Cells of a row of the table.
type Row = [String; 11];

const HEADINGS: [&str; 11] = [
    "solver",
    "grid",
    "scheme",
    "our lanes",
    "wall s",
    "our wall s",
    "ratio",
    "target",
    "error dx, mean/max",
    "ours",
    "volume error %, ours",
];

fn row(case: &Case, ours: &Ours, theirs: Option<&Theirs>) -> Row {
    let none = || "-".to_owned();
    let seconds = |seconds: f64| format!("{seconds:.3}");
    let off = |accuracy: &Accuracy| format!("{:.3}/{:.2}", accuracy.mean_dx, accuracy.max_dx);
    let volume = |accuracy: &Accuracy| format!("{:+.2}", accuracy.volume_percent);
    [
        theirs.map_or_else(none, Theirs::solver),
        case.grid.to_owned(),
        case.scheme.to_owned(),
        ours.lanes.clone(),
        theirs.map_or_else(none, |theirs| seconds(theirs.wall_s)),
        seconds(ours.wall_s),
        theirs.map_or_else(none, |theirs| format!("{:.1}", theirs.wall_s / ours.wall_s)),
        format!("{:.0}", case.target),
        ours.peer.as_ref().map_or_else(none, off),
        off(&ours.accuracy),
        format!("{}, {}", ours.peer.as_ref().map_or_else(none, volume), volume(&ours.accuracy)),
    ]
}

/// Formats the rows as aligned columns, two spaces apart.
pub(super) fn table<const N: usize>(rows: &[[String; N]]) -> String {
    let mut text = String::new();
    for row in rows {
        let mut line = String::new();
        for (column, cell) in row.iter().enumerate() {
            let width = rows.iter().map(|row| row[column].chars().count()).max().unwrap_or(0);
            line += &format!("{cell:width$}  ");
        }
        text += line.trim_end();
        text.push('\n');
    }
    text
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    const OURS: &str = r#"{"wall_s":0.5,"steps":364,"lanes":"avx2",
        "axes":[[-6.0,20.0,51],[-10.0,10.0,40],[0.0,6.157521601035995,50]],
        "accuracy":{"mean_dx":0.017,"max_dx":0.889,"volume_percent":-0.067},
        "peer":{"mean_dx":0.021,"max_dx":0.894,"volume_percent":0.017},"apart_m":1.9}"#;
    const THEIRS: &str = r#"{"wall_s": 4.0,
        "axes": [[-6.0, 20.0, 51], [-10.0, 10.0, 40], [0.0, 6.157521724700928, 50]],
        "versions": {"hj_reachability": "0.7.0", "jax": "0.10.2"}}"#;

    fn both() -> (Ours, Theirs) {
        let ours = serde_json::from_str(OURS).expect("as the example prints it");
        (ours, serde_json::from_str(THEIRS).expect("as the script prints it"))
    }

    #[test]
    fn a_row_has_both_sides_and_their_ratio() {
        let (ours, theirs) = both();
        let row = row(&CASES[1], &ours, Some(&theirs)).join(" | ");
        assert_eq!(
            row,
            "hj_reachability 0.7.0, jax 0.10.2 | 51x40x50 | weno5 | avx2 | 4.000 | 0.500 | 8.0 | 6 | \
             0.021/0.89 | 0.017/0.89 | +0.02, -0.07"
        );
    }

    #[test]
    fn our_figures_stand_without_the_peer() {
        let (ours, _) = both();
        let row = row(&CASES[1], &Ours { peer: None, ..ours }, None).join(" | ");
        assert_eq!(
            row,
            "- | 51x40x50 | weno5 | avx2 | - | 0.500 | - | 6 | - | 0.017/0.89 | -, -0.07"
        );
    }

    #[test]
    fn both_sides_keep_to_the_lanes() {
        let arguments = Arguments::try_parse_from(["peers", "--lanes", "avx2"]).expect("a name");
        let mut command = Command::new("python3");
        Lanes::limit(arguments.lanes, &mut command);
        let set: Vec<_> = command.get_envs().filter_map(|(_, value)| value?.to_str()).collect();
        assert_eq!(set, ["avx2", "--xla_cpu_max_isa=AVX2"]);
        let error = Arguments::try_parse_from(["peers", "--lanes", "sse"]).err().expect("no lanes");
        assert!(error.to_string().contains("128-bit, avx2, avx512"), "{error}");
    }

    #[test]
    fn another_grid_is_noticed() {
        let (ours, mut theirs) = both();
        same_nodes(&ours.axes, &theirs.axes).expect("they differ by rounding alone");
        // An axis that also has a node at the end of the period.
        theirs.axes[2] = (0.0, 6.283_185_5, 50);
        let error = same_nodes(&ours.axes, &theirs.axes).expect_err("ψ differs");
        assert!(error.to_string().contains("6.2831855"), "{error}");
    }

    #[test]
    fn the_table_is_in_columns() {
        let (ours, theirs) = both();
        let text = table(&[HEADINGS.map(str::to_owned), row(&CASES[1], &ours, Some(&theirs))]);
        let columns: Vec<_> =
            text.lines().map(|line| line.find(" 0.500").or(line.find(" our wall"))).collect();
        assert_eq!(columns[0], columns[1], "{text}");
    }

    #[test]
    fn every_version_is_pinned() {
        let packages = ["hj_reachability==", "jax==", "jaxlib==", "numpy=="];
        for (file, packages) in [
            ("requirements.txt", &packages[..]),
            ("learning-requirements.txt", &["scikit-learn==1.9"]),
            ("readers-requirements.txt", &["pandas==", "polars==", "pyarrow=="]),
        ] {
            let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../tests/peers");
            let requirements = fs::read_to_string(folder.join(file)).expect("it is committed");
            let mut lines = requirements.lines().filter(|line| !line.starts_with('#'));
            assert!(lines.all(|line| line.contains("==")), "{requirements}");
            for package in packages {
                assert!(requirements.contains(package), "{package}");
            }
        }
    }
}
