//! Makes the client's site, which is the folder that the server serves. The sources are `static/`
//! and the compiled client.
//!
//! ```text
//! read_static ─┐
//! bundle ──────┴→ compose → publish → page_sizes
//! ```
//!
//! Pages (`static/*.html`) keep their names, and browsers always revalidate them. The name of every
//! other file contains a hash of its content, so that browsers can cache it forever. A page refers
//! to an asset as `{{style.css}}` or `{{participant.js}}`.

mod bundle;
mod hashed;
mod placeholders;
mod publish;
mod style;

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::Path;

use anyhow::{Context, Result, bail};

pub(crate) use self::bundle::{Bundle, bundle};
pub(crate) use self::publish::publish;
use crate::workspace::Runs;

/// The programs of the web client (its binary targets), and where each of them runs.
pub(crate) const ENTRIES: [(&str, Runs); 9] = [
    (PARTICIPANT, Runs::InPage),
    (PARTICIPANT_ROBOTS, Runs::InPage),
    ("lab", Runs::InPage),
    ("viewer", Runs::InPage),
    ("reachability", Runs::InPage),
    ("demo", Runs::InPage),
    (SIMULATOR, Runs::InPage),
    (SOLVER, Runs::InWorker),
    (EVALUATOR, Runs::InWorker),
];

/// The programs that pages start when they load.
pub(crate) const PAGE_ENTRIES: [&str; 6] =
    [PARTICIPANT, PARTICIPANT_ROBOTS, "lab", "viewer", "reachability", "demo"];

/// The program that every participant downloads.
const PARTICIPANT: &str = "participant";

/// The program that every participant of a study with robots that follow rules downloads instead.
const PARTICIPANT_ROBOTS: &str = "participant_robots";

/// The program that computes value functions. Pages reference it but start it (in a worker) only
/// when they need it.
pub(crate) const SOLVER: &str = "solver";

/// The program that evaluates and tunes predicted sets. Pages reference it but start it (in a
/// worker) only when they need it.
pub(crate) const EVALUATOR: &str = "evaluator";

/// The program that simulates a participant. Pages reference it but start it only for a simulated
/// participant.
const SIMULATOR: &str = "simulator";

/// Size budget of a participant's page (bytes): html, css, js and wasm, compressed with brotli.
const PARTICIPANT_BUDGET: usize = 80_000;

/// Size budget of any other page (bytes).
const PAGE_BUDGET: usize = 400_000;

/// The content of files by relative path, with `/` as separator.
pub(crate) type Files = BTreeMap<String, Vec<u8>>;

/// All files of the site, and the assets that each page loads.
pub(crate) struct Site {
    /// The served files, before compression.
    pub(crate) files: Files,
    /// The html pages, and one entry for each program that pages start on demand.
    pages: Vec<Page>,
}

/// A page and its references.
struct Page {
    /// Path of its file.
    name: String,
    /// The client's programs that the page starts when it loads.
    entries: Vec<&'static str>,
    /// The paths of the files that the page loads.
    assets: BTreeSet<String>,
}

/// Reads `static/` and its sub-folders, except hidden files.
///
/// # Errors
/// When the folder or a file in it cannot be read.
pub(crate) fn read_static(folder: &Path) -> Result<Files> {
    let mut files = Files::new();
    collect(folder, "", &mut files)?;
    Ok(files)
}

/// Adds the files of `folder`. `prefix` is the path of `folder` within `static/`.
fn collect(folder: &Path, prefix: &str, files: &mut Files) -> Result<()> {
    let entries =
        fs::read_dir(folder).with_context(|| format!("cannot read {}", folder.display()))?;
    for entry in entries {
        let path = entry?.path();
        let Some(name) = path.file_name().and_then(|name| name.to_str()) else {
            bail!("{}: expected a name in UTF-8: rename it", path.display());
        };
        if name.starts_with('.') {
            continue;
        }
        if path.is_dir() {
            collect(&path, &format!("{prefix}{name}/"), files)?;
        } else {
            let content =
                fs::read(&path).with_context(|| format!("cannot read {}", path.display()))?;
            files.insert(format!("{prefix}{name}"), content);
        }
    }
    Ok(())
}

/// Adds a content hash to the name of every asset and inserts these names into the pages.
///
/// # Errors
/// If a page or style sheet is not UTF-8 or refers to a missing asset.
pub(crate) fn compose(sources: Files, bundles: Vec<Bundle>) -> Result<Site> {
    let mut files = Files::new();
    // Placeholder name → path of the asset.
    let mut assets = BTreeMap::new();
    let (html, others): (Files, Files) =
        sources.into_iter().partition(|(name, _)| name.ends_with(".html"));
    let (sheets, plain): (Files, Files) =
        others.into_iter().partition(|(name, _)| name.ends_with(".css"));

    for (name, content) in plain {
        add_asset(&mut files, &mut assets, name, content);
    }
    for (name, content) in sheets {
        let text = utf8(&name, content)?;
        let filled = placeholders::fill(&name, &text, &assets)?;
        let sheet = style::without_space(&filled.text);
        add_asset(&mut files, &mut assets, name, sheet.into_bytes());
    }
    for bundle in bundles {
        let wasm = hashed::name(&format!("{}.wasm", bundle.entry), &bundle.wasm);
        let script = bundle.script_for(&wasm);
        let entry = bundle.entry;
        add_asset(&mut files, &mut assets, format!("{entry}.wasm"), bundle.wasm);
        add_asset(&mut files, &mut assets, format!("{entry}.js"), script.into_bytes());
    }

    let mut pages = Vec::new();
    for (name, content) in with_robots(html)? {
        let text = utf8(&name, content)?;
        let filled = placeholders::fill(&name, &text, &assets)?;
        files.insert(name.clone(), filled.text.into_bytes());
        pages.push(page(name, &filled.used, &assets));
    }
    // Programs started on demand are listed like pages, because they are loaded separately.
    for entry in [SOLVER, EVALUATOR, SIMULATOR] {
        let files = [format!("{entry}.js"), format!("{entry}.wasm")];
        let files = files.iter().filter_map(|name| assets.get(name).cloned()).collect();
        pages.push(Page { name: entry.to_owned(), entries: Vec::new(), assets: files });
    }
    Ok(Site { files, pages })
}

/// Adds the participant's page with the program for robots that follow rules.
fn with_robots(mut html: Files) -> Result<Files> {
    if let Some(page) = html.get("participant.html").cloned() {
        let page = utf8("participant.html", page)?;
        let page = page.replace("{{participant.", "{{participant_robots.");
        html.insert("participant_robots.html".to_owned(), page.into_bytes());
    }
    Ok(html)
}

/// Adds `content` as an asset whose file name contains its hash.
fn add_asset(
    files: &mut Files,
    assets: &mut BTreeMap<String, String>,
    name: String,
    content: Vec<u8>,
) {
    let path = format!("assets/{}", hashed::name(&name, &content));
    files.insert(path.clone(), content);
    assets.insert(name, path);
}

/// Lists what a page loads: the assets that it references and the wasm of each program that it
/// starts. Programs that are started on demand do not count.
fn page(name: String, used: &BTreeSet<String>, assets: &BTreeMap<String, String>) -> Page {
    let entries: Vec<&str> =
        PAGE_ENTRIES.into_iter().filter(|entry| used.contains(&format!("{entry}.js"))).collect();
    let started = entries.iter().map(|entry| format!("{entry}.wasm"));
    let on_demand = [SOLVER, EVALUATOR, SIMULATOR].map(|entry| format!("{entry}.js"));
    let named = used.iter().filter(|name| !on_demand.contains(name)).cloned();
    let loaded: BTreeSet<String> = named.chain(started).collect();
    let assets = loaded.iter().filter_map(|name| assets.get(name).cloned()).collect();
    Page { name, entries, assets }
}

/// The text of a source file.
fn utf8(name: &str, content: Vec<u8>) -> Result<String> {
    String::from_utf8(content)
        .with_context(|| format!("static/{name}: expected UTF-8: save it in that encoding"))
}

/// Download size of a page (bytes), compressed with brotli.
pub(crate) struct PageSize {
    /// Path of the page's file.
    pub(crate) name: String,
    /// Size of the html file.
    pub(crate) html: usize,
    /// Total size of the style sheets.
    pub(crate) css: usize,
    /// Total size of the scripts.
    pub(crate) js: usize,
    /// Total size of the wasm programs.
    pub(crate) wasm: usize,
    /// Size budget. `None` for programs that pages start on demand.
    pub(crate) budget: Option<usize>,
}

impl PageSize {
    /// Total size.
    pub(crate) fn total(&self) -> usize {
        self.html + self.css + self.js + self.wasm
    }

    /// Whether the page exceeds its size budget.
    pub(crate) fn is_over_budget(&self) -> bool {
        self.budget.is_some_and(|budget| self.total() > budget)
    }
}

/// Computes the download size of each page from the brotli-compressed sizes of all files.
pub(crate) fn page_sizes(site: &Site, sizes: &BTreeMap<String, usize>) -> Vec<PageSize> {
    let brotli = |path: &str| sizes.get(path).copied().unwrap_or(0);
    let size = |page: &Page| {
        let sum = |extension: &str| {
            let of_kind = page.assets.iter().filter(|path| path.ends_with(extension));
            of_kind.map(|path| brotli(path)).sum()
        };
        PageSize {
            name: page.name.clone(),
            html: brotli(&page.name),
            css: sum(".css"),
            js: sum(".js"),
            wasm: sum(".wasm"),
            budget: match page.entries.contains(&PARTICIPANT) {
                true => Some(PARTICIPANT_BUDGET),
                false => page.name.ends_with(".html").then_some(PAGE_BUDGET),
            },
        }
    };
    site.pages.iter().map(size).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Composes a site from these sources and a tiny client.
    fn composed(sources: &[(&str, &str)]) -> Result<Site> {
        let sources = sources
            .iter()
            .map(|(name, text)| ((*name).to_owned(), text.as_bytes().to_vec()))
            .collect();
        let bundles = ENTRIES.map(|(entry, _)| Bundle {
            entry,
            js: String::new(),
            wasm: entry.as_bytes().to_vec(),
        });
        compose(sources, bundles.into())
    }

    /// The path of the only asset whose path has this start and end.
    fn asset<'a>(site: &'a Site, start: &str, end: &str) -> &'a str {
        let start = format!("assets/{start}-");
        let mut found =
            site.files.keys().filter(|path| path.starts_with(&start) && path.ends_with(end));
        let path = found.next().expect("there is such an asset");
        assert_eq!(found.next(), None);
        path
    }

    fn text<'a>(site: &'a Site, path: &str) -> &'a str {
        str::from_utf8(&site.files[path]).expect("text")
    }

    #[test]
    fn pages_load_assets_by_their_hashed_names() {
        let site = composed(&[
            ("index.html", "<script src={{participant.js}}></script>"),
            ("icons/robot.svg", "<svg/>"),
            ("style.css", "a { background: url({{icons/robot.svg}}) }"),
        ])
        .expect("a valid site");

        let script = asset(&site, "participant", ".js");
        assert_eq!(text(&site, "index.html"), format!("<script src=/{script}></script>"));
        let wasm = asset(&site, "participant", ".wasm");
        let wasm = wasm.strip_prefix("assets/").expect("an asset");
        assert!(text(&site, script).contains(&format!("'{wasm}'")));
        let icon = asset(&site, "icons/robot", ".svg");
        assert_eq!(
            text(&site, asset(&site, "style", ".css")),
            format!("a{{background:url(/{icon})}}")
        );
    }

    #[test]
    fn an_asset_that_is_not_there_is_named_with_its_file() {
        let error = composed(&[("lab.html", "<img src={{face.png}}>")])
            .err()
            .expect("there is no face.png");
        let message = error.to_string();
        assert!(message.contains("static/lab.html"), "{message}");
        assert!(message.contains("{{face.png}}"), "{message}");
    }

    #[test]
    fn a_page_costs_what_it_starts_and_nothing_else() {
        let site = composed(&[
            ("index.html", "{{participant.js}} {{simulator.js}} {{style.css}}"),
            ("lab.html", "{{lab.js}} {{solver.js}} {{evaluator.js}} {{style.css}}"),
            ("style.css", "a{b:c}"),
        ])
        .expect("a valid site");
        let totals = |wasm| -> Vec<_> {
            let size = |path: &String| if path.ends_with(".wasm") { wasm } else { 1 };
            let sizes = site.files.keys().map(|path| (path.clone(), size(path))).collect();
            let pages = page_sizes(&site, &sizes);
            pages.into_iter().map(|p| (p.name.clone(), p.total(), p.is_over_budget())).collect()
        };
        for (wasm, participants, others) in [
            (PARTICIPANT_BUDGET - 3, false, false),
            (PARTICIPANT_BUDGET, true, false),
            (PAGE_BUDGET - 3, true, false),
            (PAGE_BUDGET, true, true),
        ] {
            let expected = [
                ("index.html".to_owned(), wasm + 3, participants),
                ("lab.html".to_owned(), wasm + 3, others),
                ("solver".to_owned(), wasm + 1, false),
                ("evaluator".to_owned(), wasm + 1, false),
                ("simulator".to_owned(), wasm + 1, false),
            ];
            assert_eq!(totals(wasm), expected);
        }
    }
}
