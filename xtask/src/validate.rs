//! `cargo xtask validate`: measures the library's accuracy and writes the pages about it.
//!
//! For each page, an example of the library or of the browser tests runs the measurements, draws the pictures
//! and prints its numbers as JSON. This command stores the numbers in `docs/validation/measured` and fills a
//! template of `docs/validation/templates` with them.

mod figure3;
mod peers;
mod template;

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context, Result};
use clap::ValueEnum;
use serde_json::Value;

use crate::workspace::{Workspace, output_of, stage};
use crate::{build, test};

/// Measure value functions, reachable sets and learning against closed forms, references and peers, and the
/// timing of the participant's page; write the pages of docs/validation and docs/timing.md.
#[derive(clap::Args)]
pub(crate) struct Options {
    /// The page to write [default: all pages].
    #[arg(value_enum)]
    page: Option<Page>,
    /// Also repeat the measurements of other solvers. This takes minutes and needs an idle machine.
    #[arg(long)]
    peers: bool,
    /// Measure nothing, and write the pages from the stored numbers. Use this after a change of wording.
    #[arg(long, conflicts_with = "peers")]
    kept: bool,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Page {
    /// Value functions: writes reachability.md.
    Reachability,
    /// Reachable sets and their probabilities: writes shfrs.md.
    Shfrs,
    /// Models, the comparison and its tests: writes learning.md.
    Learning,
    /// The participant's page in a browser: writes ../timing.md. This takes ten minutes and needs an idle
    /// machine.
    Timing,
}

/// Measures and writes the pages.
///
/// # Errors
/// When the library or the program cannot be built, a measurement fails, a file cannot be written,
/// or a template names a number that was not measured.
pub(crate) fn run(workspace: &Workspace, options: &Options) -> Result<()> {
    let docs = workspace.path("docs/validation");
    for page in Page::value_variants() {
        if options.page.is_some_and(|only| only != *page) {
            continue;
        }
        if !options.kept {
            page.measure(workspace, &docs, options.peers)?;
        }
        let path = page.file(&docs);
        write(&path, &page.text(&docs)?)?;
        println!("{}", path.display());
    }
    Ok(())
}

impl Page {
    /// The path of the page. `docs` is the folder of pages and pictures.
    fn file(self, docs: &Path) -> PathBuf {
        match self {
            Self::Timing => docs.with_file_name("timing.md"),
            _ => docs.join(format!("{self:?}.md").to_lowercase()),
        }
    }

    fn template(self, docs: &Path) -> PathBuf {
        docs.join(format!("templates/{self:?}.md.jinja").to_lowercase())
    }

    fn measured(self, docs: &Path) -> PathBuf {
        docs.join(format!("measured/{self:?}.json").to_lowercase())
    }

    /// Reads the stored numbers of the last measurement.
    fn kept(self, docs: &Path) -> Result<Value> {
        let path = self.measured(docs);
        serde_json::from_str(&read(&path)?).with_context(|| path.display().to_string())
    }

    /// Measures, and stores the numbers and the pictures.
    fn measure(self, workspace: &Workspace, docs: &Path, peers: bool) -> Result<()> {
        let example = match self {
            Self::Reachability => "validate",
            Self::Shfrs => "validate_shfrs",
            Self::Learning => "validate_learning",
            Self::Timing => "timing",
        };
        stage("library", workspace.compile("build").args(["--example", example]))?;
        let mut program = Command::new(workspace.example(example));
        if self == Self::Timing {
            build::run(workspace, &build::Options::default())?;
            program.env("SIDESTEP_BIN", workspace.server()).env(test::VARIABLE, test::chromium()?);
        }
        eprintln!("==> measurements");
        let mut found = answer(&format!("the example {example}"), &mut program)?;
        match self {
            Self::Reachability => {
                for (file, svg) in found["figures"].take().as_object().into_iter().flatten() {
                    write(&docs.join(file), svg.as_str().context("a picture is not text")?)?;
                }
                found["peers"] = match peers {
                    true => peers::measured(workspace)?,
                    false => self.kept(docs)?["peers"].take(),
                };
            }
            Self::Shfrs => found["figure3"] = figure3::panels(workspace, docs)?,
            Self::Learning | Self::Timing => {}
        }
        write(&self.measured(docs), &format!("{found:#}\n"))
    }

    /// Renders the page from the stored numbers.
    fn text(self, docs: &Path) -> Result<String> {
        let template = self.template(docs);
        template::filled(&read(&template)?, self.kept(docs)?)
            .with_context(|| template.display().to_string())
    }
}

/// Parses the JSON output of a program. `what` names the program in errors.
fn answer(what: &str, program: &mut Command) -> Result<Value> {
    let text = output_of(what, program)?;
    serde_json::from_str(&text).with_context(|| format!("{what} printed invalid JSON"))
}

fn read(path: &Path) -> Result<String> {
    fs::read_to_string(path).with_context(|| format!("cannot read {}", path.display()))
}

fn write(path: &Path, text: &str) -> Result<()> {
    fs::write(path, text).with_context(|| format!("cannot write {}", path.display()))
}

#[cfg(test)]
mod tests {
    use super::*;

    const DOCS: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../docs/validation");

    #[test]
    fn every_page_is_its_template_with_the_kept_numbers() {
        for page in Page::value_variants() {
            let text = page.text(Path::new(DOCS)).expect("a page");
            let committed = read(&page.file(Path::new(DOCS))).expect("the page is committed");
            assert!(text == committed, "{page:?}: call `cargo xtask validate --kept` and commit");
        }
    }

    #[test]
    fn every_picture_is_on_a_page() {
        let page = |page: &Page| read(&page.file(Path::new(DOCS))).expect("the page is committed");
        let pages: String = Page::value_variants().iter().map(page).collect();
        let entries = fs::read_dir(DOCS).expect("the folder is committed");
        let names = entries.map(|entry| entry.expect("an entry").file_name().into_string());
        let names = names.map(|name| name.expect("a name")).filter(|name| name.ends_with(".svg"));
        let pictures: Vec<String> = names.collect();
        assert_eq!(pictures.len(), pages.matches("![").count());
        for name in pictures {
            assert!(pages.contains(&format!("]({name})")), "{name}");
        }
    }

    #[test]
    fn every_cell_that_differs_is_explained() {
        let learning = Page::Learning.kept(Path::new(DOCS)).expect("numbers");
        let different = learning["cells"]["different"].as_array().expect("cells");
        assert!(!different.is_empty());
        assert!(different.iter().all(|cell| cell["why"] != "open"), "nothing explains a cell");
    }
}
