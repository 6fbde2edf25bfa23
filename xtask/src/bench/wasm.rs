//! `cargo xtask bench wasm`, `cargo xtask bench shfrs` and `cargo xtask bench playback`: measure the library
//! as a native program and as WebAssembly in headless Chromium, in the same run. Each side uses one thread,
//! except for tuning, which uses all threads.
//!
//! Both sides run the web client's example `speed`. The native program is built like the server, the
//! WebAssembly program like the code in a page or a worker. The example is not part of the site.

use std::fs;
use std::path::Path;
use std::process::{Command, ExitCode, Stdio};

use anyhow::{Context, Result, bail};

use crate::site::{Bundle, bundle};
use crate::test::chromium;
use crate::workspace::{Runs, Workspace, cannot_start, output_of, stage};

/// One measurement.
#[derive(Debug, PartialEq)]
struct Case {
    /// Name of the measurement in the example.
    name: &'static str,
    /// Time limits (s), natively and in the browser.
    targets: [Option<f64>; 2],
    /// The baseline, which is another measurement of the same run.
    baseline: Option<&'static str>,
}

impl Case {
    const fn new(name: &'static str) -> Self {
        Self { name, targets: [None; 2], baseline: None }
    }

    const fn native(mut self, most_s: f64) -> Self {
        self.targets[0] = Some(most_s);
        self
    }

    const fn wasm(mut self, most_s: f64) -> Self {
        self.targets[1] = Some(most_s);
        self
    }

    const fn against(mut self, baseline: &'static str) -> Self {
        self.baseline = Some(baseline);
        self
    }
}

/// A group of measurements that run together.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Group {
    /// Name of the group in the example.
    name: &'static str,
    /// Where the site does this work.
    runs: Runs,
    cases: &'static [Case],
}

/// Computing a value function.
pub(super) const SOLVE: Group = Group {
    name: "solve",
    runs: Runs::InWorker,
    cases: &[
        Case::new("polar standard solve").native(0.1).wasm(0.5),
        Case::new("slower, more agile pursuer").wasm(0.5),
        Case::new("slower pursuer").wasm(0.5),
        Case::new("less agile pursuer").wasm(0.5),
        Case::new("faster pursuer, no convergence"),
    ],
};

/// Evaluating a value function.
pub(super) const VALUE: Group = Group {
    name: "value",
    runs: Runs::InPage,
    cases: &[
        Case::new("level curve").wasm(1e-3),
        Case::new("level curve, closed form").against("level curve"),
        Case::new("exact value"),
        Case::new("exact values, batch").against("exact value"),
        Case::new("value and gradient").against("exact value"),
    ],
};

/// Predicted sets.
pub(super) const SHFRS: Group = Group {
    name: "shfrs",
    runs: Runs::InPage,
    cases: &[
        Case::new("polygons, 0 inside").native(1e-4).wasm(2e-4),
        Case::new("polygons, 0 inside, fresh memory").against("polygons, 0 inside"),
        Case::new("polygons, general").native(1.5e-3).wasm(3e-3).against("polygons, 0 inside"),
        Case::new("polygons, general, fresh memory").against("polygons, general"),
        Case::new("membership, inside").native(1e-5),
        Case::new("membership, near").native(1e-5),
        Case::new("membership, outside").native(1e-5),
        Case::new("Algorithm 1, base").native(3e-5),
        Case::new("Algorithm 1, base, fresh memory").against("Algorithm 1, base"),
        Case::new("Algorithm 1, paper").native(3e-5),
        Case::new("Algorithm 1, paper, fresh memory").against("Algorithm 1, paper"),
        Case::new("overlay, tubes").wasm(1e-3),
        Case::new("overlay, tubes, slowest moment").against("overlay, tubes"),
        Case::new("overlay, tubes, fresh memory").against("overlay, tubes"),
        Case::new("overlay, per step").wasm(1e-3).against("overlay, tubes"),
        Case::new("overlay, per step, slowest moment").against("overlay, per step"),
        Case::new("overlay, per step, fresh memory").against("overlay, per step"),
    ],
};

/// Counting and tuning predicted sets.
pub(super) const EVALUATION: Group = Group {
    name: "evaluation",
    runs: Runs::InWorker,
    cases: &[
        Case::new("coverage, 400 drives, directly"),
        Case::new("coverage, 400 drives, other ε").wasm(1.0).against(DIRECTLY),
        Case::new("coverage, 400 drives, other k").wasm(1.0).against(DIRECTLY),
        Case::new("coverage, 400 drives, other T").wasm(1.0).against(DIRECTLY),
        Case::new("tuning, 400 drives").native(2.0),
    ],
};

/// Frames of a replay.
pub(super) const PLAYBACK: Group = Group {
    name: "playback",
    runs: Runs::InPage,
    cases: &[
        Case::new("frame, usual layers").wasm(4e-3),
        Case::new("frame, usual layers, slowest moment").wasm(4e-3),
        Case::new("frame, all layers").wasm(4e-3).against(USUAL),
        Case::new("frame, all layers, slowest moment").wasm(4e-3),
        Case::new("frame, hatched").wasm(4e-3).against(USUAL),
        Case::new("frame, hatched, slowest moment").wasm(4e-3),
    ],
};

/// The baseline for frames.
const USUAL: &str = "frame, usual layers";

/// The baseline for coverage, computed without a cache.
const DIRECTLY: &str = "coverage, 400 drives, directly";

/// The example that is measured.
const EXAMPLE: &str = "speed";

/// The example's output: the name of each measurement and its time per item (s).
type Figures = Vec<(String, f64)>;

/// Measures groups in sequence; stops at the first that fails.
///
/// # Errors
/// When either side cannot be built, or the native side cannot be run.
pub(super) fn run(workspace: &Workspace, groups: &[Group]) -> Result<ExitCode> {
    for group in groups {
        let code = measure(workspace, group)?;
        if code != ExitCode::SUCCESS {
            return Ok(code);
        }
    }
    Ok(ExitCode::SUCCESS)
}

/// Measures both sides of a group and prints the table.
///
/// Without a browser it prints the native figures and then fails.
fn measure(workspace: &Workspace, group: &Group) -> Result<ExitCode> {
    stage("native", workspace.compile("build").args(["--example", EXAMPLE]))?;
    workspace.ensure_wasm_target()?;
    let mut build = workspace.compile_for_browsers("build", group.runs);
    stage("WebAssembly", build.args(["--example", EXAMPLE]))?;
    let compiled = workspace.compiled_client(&format!("examples/{EXAMPLE}"));
    let bundle = bundle(EXAMPLE, &compiled)?;

    eprintln!("==> measuring");
    let mut example = Command::new(workspace.example(EXAMPLE));
    let native = figures(&output_of("the example", example.arg(group.name))?)?;
    let wasm = in_browser(&bundle, group.name, &workspace.output("bench"));
    print!("{}", table(group.cases, &native, wasm.as_ref().ok()));
    let names =
        |figures: &Figures| figures.iter().map(|(name, _)| name.clone()).collect::<Vec<_>>();
    if names(&native) != group.cases.iter().map(|case| case.name).collect::<Vec<_>>() {
        bail!("expected the cases of the table in its order, the example measured others");
    }
    if let Err(error) = wasm {
        eprintln!("error: no figures for WebAssembly: {error:#}");
        return Ok(ExitCode::FAILURE);
    }
    Ok(ExitCode::SUCCESS)
}

/// Opens a page in Chromium that runs the program, and reads the page's text. The page and the browser
/// profile remain in `folder`.
fn in_browser(bundle: &Bundle, group: &str, folder: &Path) -> Result<Figures> {
    let chromium = chromium()?;
    let page = folder.join("wasm.html");
    fs::create_dir_all(folder)
        .and_then(|()| fs::write(&page, bundle.page()?))
        .with_context(|| format!("cannot write {}", page.display()))?;
    let mut command = Command::new(chromium);
    command.args(["--headless=new", "--no-sandbox", "--disable-gpu", "--no-first-run"]);
    command.args(["--disable-background-networking", "--disable-component-update"]);
    command.arg(format!("--user-data-dir={}", folder.join("profile").display()));
    command.arg("--dump-dom").arg(format!("file://{}#{group}", page.display()));
    let output = command.stdin(Stdio::null()).output().with_context(|| cannot_start(&command))?;
    if !output.status.success() {
        // Chromium's messages are printed only on failure, because many of them are irrelevant.
        bail!("Chromium failed: {}", String::from_utf8_lossy(&output.stderr));
    }
    let text = String::from_utf8(output.stdout).context("Chromium printed no UTF-8")?;
    figures(body_of(&text)?)
}

/// The text of a page whose body has no elements.
fn body_of(page: &str) -> Result<&str> {
    let body = page.rsplit_once("<body>").and_then(|(_, body)| body.split_once("</body>"));
    Ok(body.context("Chromium printed no page")?.0)
}

/// Parses the example's output.
fn figures(answer: &str) -> Result<Figures> {
    serde_json::from_str(answer).with_context(|| format!("the example answered {answer:?}"))
}

/// Formats the table, with one line per case. For each side, it has the time, the target and their ratio. Then
/// it has the ratio of WebAssembly to native, and the ratios of both to the baseline.
fn table(cases: &[Case], native: &Figures, wasm: Option<&Figures>) -> String {
    let of = |figures: Option<&Figures>, name: &str| {
        figures?.iter().find(|(found, _)| found == name).map(|(_, seconds)| *seconds)
    };
    let head = ["native", "target", "ratio", "WASM", "target", "ratio", "WASM/native"];
    let mut text = row("fastest sample", head, "ratio to the baseline, native and WASM");
    for case in cases {
        let sides = [of(Some(native), case.name), of(wasm, case.name)];
        let [[native_s, native_target, native_ratio], [wasm_s, wasm_target, wasm_ratio]] = [0, 1]
            .map(|side| {
                let target = case.targets[side];
                [shown(sides[side]), shown(target), verdict(sides[side], target)]
            });
        let between = ratio(sides[1], sides[0]);
        let cells =
            [native_s, native_target, native_ratio, wasm_s, wasm_target, wasm_ratio, between];
        let baseline = case.baseline.map_or_else(String::new, |name| {
            let ratios =
                [Some(native), wasm].map(|figures| (of(figures, case.name), of(figures, name)));
            let [native, wasm] = ratios.map(|(found, base)| ratio(found, base));
            format!("{native} and {wasm} of {name}")
        });
        text += &row(case.name, cells.each_ref().map(String::as_str), &baseline);
    }
    text
}

fn row(name: &str, [a, b, c, d, e, f, g]: [&str; 7], baseline: &str) -> String {
    let line =
        format!("{name:34} {a:>9} {b:>9} {c:>11}  {d:>9} {e:>9} {f:>11}  {g:>11}  {baseline}");
    line.trim_end().to_owned() + "\n"
}

/// The ratio to the target, and "MISSED" if the time exceeds the target.
fn verdict(seconds: Option<f64>, target: Option<f64>) -> String {
    let missed = seconds.zip(target).is_some_and(|(seconds, target)| seconds > target);
    ratio(seconds, target) + if missed { " MISSED" } else { "" }
}

fn ratio(seconds: Option<f64>, base: Option<f64>) -> String {
    seconds.zip(base).map_or_else(|| "-".to_owned(), |(s, base)| format!("{:.2}", s / base))
}

fn shown(seconds: Option<f64>) -> String {
    match seconds {
        None => "-".to_owned(),
        Some(s) if s < 1e-6 => format!("{:.1} ns", 1e9 * s),
        Some(s) if s < 1e-3 => format!("{:.1} µs", 1e6 * s),
        Some(s) => format!("{:.1} ms", 1e3 * s),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const NATIVE: &str = r#"[["solve",0.08],["curve",2e-4]]"#;
    const CASES: [Case; 2] =
        [Case::new("solve").native(0.1).wasm(0.5), Case::new("curve").wasm(1e-3).against("solve")];
    const WASM: &str = r#"[["solve",0.2],["curve",0.0011]]"#;

    #[test]
    fn a_line_has_both_sides_their_budgets_and_their_ratio() {
        let (native, wasm) = (figures(NATIVE).expect("JSON"), figures(WASM).expect("JSON"));
        let text = table(&CASES, &native, Some(&wasm));
        let words = |line: usize| -> Vec<_> {
            text.lines().nth(line).expect("a line").split_whitespace().collect()
        };
        let solve = "solve 80.0 ms 100.0 ms 0.80 200.0 ms 500.0 ms 0.40 2.50";
        assert_eq!(words(1).join(" "), solve);
        let curve = "curve 200.0 µs - - 1.1 ms 1.0 ms 1.10 MISSED 5.50 0.00 and 0.01 of solve";
        assert_eq!(words(2).join(" "), curve);
    }

    #[test]
    fn figures_of_this_machine_stand_without_a_browser() {
        let text = table(&CASES, &figures(NATIVE).expect("JSON"), None);
        let line = text.lines().nth(1).expect("a line").split_whitespace().collect::<Vec<_>>();
        assert_eq!(line.join(" "), "solve 80.0 ms 100.0 ms 0.80 - 500.0 ms - -");
    }

    #[test]
    fn the_answer_is_the_body_of_the_page() {
        let page = "<script>'<body>';</script>\n<body></body>\n";
        let page = page.replace("<body>", &format!("<body>{NATIVE}"));
        assert_eq!(body_of(&page).expect("a body"), NATIVE);
        let error = figures("panicked").expect_err("that is no list");
        assert!(error.to_string().contains("panicked"), "{error}");
    }

    #[test]
    fn baselines_are_measured_too() {
        for Group { cases, .. } in [SOLVE, VALUE, SHFRS, EVALUATION, PLAYBACK] {
            for baseline in cases.iter().filter_map(|case| case.baseline) {
                assert!(cases.iter().any(|case| case.name == baseline), "{baseline}");
            }
        }
    }
}
