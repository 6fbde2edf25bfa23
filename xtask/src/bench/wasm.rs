//! `cargo xtask bench wasm`: the solver and its functions as a program of this machine and
//! as WebAssembly in headless Chromium, in the same run and on one thread each.
//!
//! Both sides are the example `speed` of the web client, built as server and solver are
//! shipped. It is no part of the site.

use std::fs;
use std::path::Path;
use std::process::{Command, ExitCode, Stdio};

use anyhow::{Context, Result, bail};

use crate::build::build_solver;
use crate::site::{Bundle, bundle};
use crate::test::chromium;
use crate::workspace::{Workspace, cannot_start, output_of, stage};

/// One measurement.
struct Case {
    /// As the example calls it.
    name: &'static str,
    /// What it may take at most on this machine, s.
    native_budget: Option<f64>,
    /// The same in the browser.
    wasm_budget: Option<f64>,
}

/// Everything that is measured: one line each.
const CASES: &[Case] = &[
    Case::new("polar standard solve", Some(0.1), Some(0.5)),
    Case::new("level curve", None, Some(1e-3)),
    Case::new("exact value", None, None),
    Case::new("exact values, batch", None, None),
    Case::new("value and gradient", None, None),
    Case::new("predicted sets", None, Some(1e-3)),
    Case::new("predicted sets, by step", None, None),
];

impl Case {
    const fn new(name: &'static str, native_budget: Option<f64>, wasm_budget: Option<f64>) -> Self {
        Self { name, native_budget, wasm_budget }
    }
}

/// The example that is measured.
const EXAMPLE: &str = "speed";

/// What the example answers: names, and seconds of one item.
type Figures = Vec<(String, f64)>;

/// Measures both sides and prints the table.
///
/// Without a browser it still prints the figures of this machine, and then fails.
///
/// # Errors
/// When either side cannot be built, or the one of this machine cannot be run.
pub(super) fn run(workspace: &Workspace) -> Result<ExitCode> {
    // Of the whole workspace, so that the tests' dependencies serve here too.
    let mut build = workspace.cargo(["build", "--locked", "--release", "--workspace"]);
    stage("native", build.args(["--example", EXAMPLE]))?;
    workspace.ensure_wasm_target()?;
    stage("WebAssembly", build_solver(workspace).args(["--example", EXAMPLE]))?;
    let compiled = workspace.compiled_client(&format!("examples/{EXAMPLE}"));
    let bundle = bundle(EXAMPLE, &compiled)?;

    eprintln!("==> measuring");
    let native = output_of("the example", &mut Command::new(workspace.example(EXAMPLE)))?;
    let native = figures(&native)?;
    let wasm = in_browser(&bundle, &workspace.bench());
    print!("{}", table(&native, wasm.as_ref().ok()));
    if let Err(error) = wasm {
        eprintln!("error: no figures for WebAssembly: {error:#}");
        return Ok(ExitCode::FAILURE);
    }
    Ok(ExitCode::SUCCESS)
}

/// Opens a page in Chromium that runs the program, and reads its text. Page and profile
/// are left in `folder`.
fn in_browser(bundle: &Bundle, folder: &Path) -> Result<Figures> {
    let chromium = chromium()?;
    let page = folder.join("wasm.html");
    fs::create_dir_all(folder)
        .and_then(|()| fs::write(&page, page_of(bundle)?))
        .with_context(|| format!("cannot write {}", page.display()))?;
    let mut command = Command::new(chromium);
    command.args(["--headless=new", "--no-sandbox", "--disable-gpu", "--no-first-run"]);
    command.args(["--disable-background-networking", "--disable-component-update"]);
    command.arg(format!("--user-data-dir={}", folder.join("profile").display()));
    command.arg("--dump-dom").arg(format!("file://{}", page.display()));
    let output = command.stdin(Stdio::null()).output().with_context(|| cannot_start(&command))?;
    if !output.status.success() {
        // It also complains of much that does not matter, so only now.
        bail!("Chromium failed: {}", String::from_utf8_lossy(&output.stderr));
    }
    let text = String::from_utf8(output.stdout).context("Chromium printed no UTF-8")?;
    figures(body_of(&text)?)
}

/// A page with the program in it, since a page from a file may load no other file. All
/// runs before the page counts as loaded, which is when Chromium prints it.
fn page_of(bundle: &Bundle) -> std::io::Result<String> {
    let octets = serde_json::to_string(&bundle.wasm)?;
    let start = format!("initSync({{ module: new Uint8Array({octets}) }});");
    let script = format!("<script type=module>\n{}\n{start}\n</script>", bundle.js.trim_end());
    Ok(format!("<!doctype html>\n<head><meta charset=utf-8>\n{script}\n</head>\n<body></body>\n"))
}

/// The text of a page whose body has no elements.
fn body_of(page: &str) -> Result<&str> {
    let body = page.rsplit_once("<body>").and_then(|(_, body)| body.split_once("</body>"));
    Ok(body.context("Chromium printed no page")?.0)
}

/// Reads what the example answered.
fn figures(answer: &str) -> Result<Figures> {
    serde_json::from_str(answer).with_context(|| format!("the example answered {answer:?}"))
}

/// The table: a line for each case, budgets beside what they are for.
fn table(native: &Figures, wasm: Option<&Figures>) -> String {
    let of = |figures: &Figures, name: &str| {
        figures.iter().find(|(found, _)| found == name).map(|(_, seconds)| *seconds)
    };
    let mut text =
        row("one thread, fastest sample", ["native", "budget", "WASM", "budget"], "ratio");
    for case in CASES {
        let native = of(native, case.name);
        let wasm = wasm.and_then(|wasm| of(wasm, case.name));
        let ratio = native.zip(wasm).map(|(native, wasm)| format!("{:.2}", wasm / native));
        let cells = [
            shown(native),
            verdict(native, case.native_budget),
            shown(wasm),
            verdict(wasm, case.wasm_budget),
        ];
        text += &row(case.name, cells.each_ref().map(String::as_str), &ratio.unwrap_or("-".into()));
    }
    text
}

fn row(name: &str, [native, native_budget, wasm, wasm_budget]: [&str; 4], ratio: &str) -> String {
    format!("{name:26} {native:>10} {native_budget:>16} {wasm:>10} {wasm_budget:>16} {ratio:>6}\n")
}

/// A budget, and whether it was met.
fn verdict(seconds: Option<f64>, budget: Option<f64>) -> String {
    let Some(budget) = budget else { return "-".to_owned() };
    let met = seconds.map_or("", |seconds| if seconds <= budget { " met" } else { " MISSED" });
    format!("{}{met}", shown(Some(budget)))
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

    const NATIVE: &str = r#"[["polar standard solve",0.08],["level curve",2e-4]]"#;
    const WASM: &str = r#"[["polar standard solve",0.2],["level curve",0.0011]]"#;

    #[test]
    fn a_line_has_both_sides_their_budgets_and_their_ratio() {
        let (native, wasm) = (figures(NATIVE).expect("JSON"), figures(WASM).expect("JSON"));
        let text = table(&native, Some(&wasm));
        let words = |line: usize| -> Vec<_> {
            text.lines().nth(line).expect("a line").split_whitespace().collect()
        };
        let solve = "polar standard solve 80.0 ms 100.0 ms met 200.0 ms 500.0 ms met 2.50";
        assert_eq!(words(1).join(" "), solve);
        assert_eq!(words(2).join(" "), "level curve 200.0 µs - 1.1 ms 1.0 ms MISSED 5.50");
    }

    #[test]
    fn figures_of_this_machine_stand_without_a_browser() {
        let text = table(&figures(NATIVE).expect("JSON"), None);
        let line = text.lines().nth(1).expect("a line").split_whitespace().collect::<Vec<_>>();
        assert_eq!(line.join(" "), "polar standard solve 80.0 ms 100.0 ms met - 500.0 ms -");
    }

    #[test]
    fn the_answer_is_the_body_of_the_page() {
        let bundle = Bundle { entry: EXAMPLE, js: "'<body>';".to_owned(), wasm: vec![0, 97] };
        let page = page_of(&bundle).expect("a page");
        assert!(
            page.contains("'<body>';\ninitSync({ module: new Uint8Array([0,97]) });"),
            "{page}"
        );
        let page = page.replace("<body>", &format!("<body>{NATIVE}"));
        assert_eq!(body_of(&page).expect("a body"), NATIVE);
        let error = figures("panicked").expect_err("that is no list");
        assert!(error.to_string().contains("panicked"), "{error}");
    }

    #[test]
    fn every_case_is_measured_by_the_example() {
        let example = concat!(env!("CARGO_MANIFEST_DIR"), "/../web-client/examples/speed.rs");
        let example = fs::read_to_string(example).expect("the example");
        for case in CASES {
            assert!(example.contains(&format!("\"{}\"", case.name)), "{}", case.name);
        }
    }
}
