//! The routes of the laboratory, one line per page, and the programs that contain the pages.

use super::access::AccessPage;
use super::analyses::Analyses;
use super::analysis::AnalysisView;
use super::configuration::ConfigurationPage;
use super::export::Export;
use super::home::Home;
use super::hosted::{AnyMsg, AnyPage, host};
use super::participants::Participants;
use super::profile::Profile;
use super::self_check::SelfCheckPage;
use super::trials::Trials;
use super::visit::Visit;
use crate::pages::demo::DemoPage;
use crate::pages::explorer::ExplorerPage;
use crate::pages::reachability::Reachability;
use crate::pages::replay::ReplayPage;
use crate::runtime::Commands;

/// An address of the laboratory and its page.
pub struct Route {
    /// The path of the address. A part `{id}` matches any id.
    pub(super) path: &'static str,
    /// Opens the page.
    pub(super) open: Open,
}

type Open = fn(&Visit<'_>) -> (AnyPage, Commands<AnyMsg>);

/// A part of the laboratory that is a separate program, so that users download only what they need.
pub trait Program: 'static {
    /// The pages of the program.
    const PAGES: &'static [&'static [Route]];
    /// Whether the pages solve games.
    const SOLVES: bool;
    /// Whether the pages show solids.
    const SHOWS_SOLIDS: bool;
    /// Whether the pages use pointer events.
    const POINTS: bool;
    /// Whether the pages offer or open files.
    const OFFERS_FILES: bool;
    /// Whether the pages show two pictures side by side.
    const HAS_PANES: bool;
}

/// The pages about studies, participants, analyses, exports and access.
pub struct Laboratory;

impl Program for Laboratory {
    const PAGES: &'static [&'static [Route]] = &[LABORATORY];
    const SOLVES: bool = false;
    const SHOWS_SOLIDS: bool = false;
    const POINTS: bool = false;
    const OFFERS_FILES: bool = false;
    const HAS_PANES: bool = false;
}

/// Pages that draw scenes and predicted sets.
pub struct Viewer;

impl Program for Viewer {
    const PAGES: &'static [&'static [Route]] = &[VIEWER];
    const SOLVES: bool = true;
    const SHOWS_SOLIDS: bool = false;
    const POINTS: bool = false;
    const OFFERS_FILES: bool = true;
    const HAS_PANES: bool = true;
}

/// The page about value functions.
pub struct Inspector;

impl Program for Inspector {
    const PAGES: &'static [&'static [Route]] = &[INSPECTOR];
    const SOLVES: bool = true;
    const SHOWS_SOLIDS: bool = true;
    const POINTS: bool = true;
    const OFFERS_FILES: bool = true;
    const HAS_PANES: bool = false;
}

/// The demonstration, which can be open to all.
pub struct Demonstration;

impl Program for Demonstration {
    const PAGES: &'static [&'static [Route]] = &[DEMONSTRATION];
    const SOLVES: bool = false;
    const SHOWS_SOLIDS: bool = false;
    const POINTS: bool = false;
    const OFFERS_FILES: bool = false;
    const HAS_PANES: bool = false;
}

/// Entries of the navigation: address and label.
pub(super) const NAVIGATION: [(&str, &str); 5] = [
    ("/lab", "Studies"),
    ("/lab/reachability", "Reachability"),
    ("/lab/demo", "Demonstration"),
    ("/lab/access", "Access"),
    ("/lab/self-check", "Self-check"),
];

/// The address at which the demonstration needs no sign-in. The operator must enable it.
pub(super) const OPEN_TO_ALL: &str = "/demo";

/// The addresses that belong to other programs. All other addresses below `/lab` belong to
/// [`Laboratory`].
const APART: [&str; 4] =
    ["/lab/replay/{id}", "/lab/explorer/{id}", "/lab/reachability", "/lab/demo"];

#[rustfmt::skip]
pub(super) static LABORATORY: &[Route] = &[
    Route { path: "/lab", open: |visit| host(Home::open(visit)) },
    Route { path: "/lab/studies/{id}", open: |visit| host(Participants::open(visit)) },
    Route { path: "/lab/participants/{id}", open: |visit| host(Profile::open(visit)) },
    Route { path: "/lab/studies/{id}/trials", open: |visit| host(Trials::open(visit)) },
    Route { path: "/lab/studies/{id}/analyses", open: |visit| host(Analyses::open(visit)) },
    Route { path: "/lab/analyses/{id}", open: |visit| host(AnalysisView::open(visit)) },
    Route { path: "/lab/studies/{id}/export", open: |visit| host(Export::open(visit)) },
    Route { path: "/lab/studies/{id}/configuration", open: |visit| host(ConfigurationPage::open(visit)) },
    Route { path: "/lab/new", open: |visit| host(ConfigurationPage::open_new(visit)) },
    Route { path: "/lab/access", open: |visit| host(AccessPage::open(visit)) },
    Route { path: "/lab/self-check", open: |_| host(SelfCheckPage::open()) },
];

#[rustfmt::skip]
pub(super) static VIEWER: &[Route] = &[
    Route { path: "/lab/replay/{id}", open: |visit| host(ReplayPage::open(visit.id, visit.address)) },
    Route { path: "/lab/explorer/{id}", open: |visit| host(ExplorerPage::open(visit.id, visit.address)) },
];

#[rustfmt::skip]
pub(super) static INSPECTOR: &[Route] = &[
    Route { path: "/lab/reachability", open: |visit| host(Reachability::open(visit.address, visit.window_px)) },
];

#[rustfmt::skip]
pub(super) static DEMONSTRATION: &[Route] = &[
    Route { path: "/lab/demo", open: |visit| host(DemoPage::open(visit.address)) },
    Route { path: OPEN_TO_ALL, open: |visit| host(DemoPage::open(visit.address)) },
];

impl Route {
    /// Returns the id in `path` if `path` matches this route. The id is empty if the route has no
    /// `{id}`.
    pub(super) fn matches<'a>(&self, path: &'a str) -> Option<&'a str> {
        named(self.path, path)
    }
}

/// Returns the text for `{id}` if `path` matches the pattern. The text is empty if the pattern has
/// no `{id}`.
fn named<'a>(pattern: &str, path: &'a str) -> Option<&'a str> {
    let path = path.trim_end_matches('/');
    let Some((before, after)) = pattern.split_once("{id}") else {
        return (path == pattern).then_some("");
    };
    let id = path.strip_prefix(before)?.strip_suffix(after)?;
    (!id.is_empty() && !id.contains('/')).then_some(id)
}

/// Whether this address belongs to a program other than [`Laboratory`].
pub(super) fn is_apart(path: &str) -> bool {
    APART.iter().any(|pattern| named(pattern, path).is_some())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_address_names_one_page() {
        let named = |path: &'static str| {
            let found: Vec<_> = [LABORATORY, VIEWER, INSPECTOR, DEMONSTRATION]
                .into_iter()
                .flatten()
                .filter_map(|route| Some((route.path, route.matches(path)?)))
                .collect();
            assert!(found.len() <= 1, "{path}: {found:?}");
            found.first().copied()
        };
        assert_eq!(named("/lab"), Some(("/lab", "")));
        assert_eq!(named("/lab/"), Some(("/lab", "")));
        assert_eq!(named("/lab/self-check"), Some(("/lab/self-check", "")));
        assert_eq!(named("/lab/demo"), Some(("/lab/demo", "")));
        assert_eq!(named("/demo"), Some(("/demo", "")));
        assert_eq!(named("/lab/replay/t-1"), Some(("/lab/replay/{id}", "t-1")));
        assert_eq!(named("/lab/studies/pilot"), Some(("/lab/studies/{id}", "pilot")));
        assert_eq!(named("/lab/studies/a/trials"), Some(("/lab/studies/{id}/trials", "a")));
        assert_eq!(named("/lab/reachability"), Some(("/lab/reachability", "")));
        for nowhere in [
            "/lab/replay",
            "/lab/replay/",
            "/lab/replay/a/b",
            "/lab/studies",
            "/lab/studies//trials",
            "/lab/none",
            "/laboratory",
        ] {
            assert_eq!(named(nowhere), None, "{nowhere}");
        }
    }

    #[test]
    fn other_programs_have_their_pages_apart() {
        let apart = [VIEWER, INSPECTOR, DEMONSTRATION].into_iter().flatten();
        let in_lab = apart.filter(|route| route.path.starts_with("/lab"));
        assert!(in_lab.map(|route| route.path).eq(APART));
        assert!(LABORATORY.iter().all(|route| !is_apart(route.path)));
    }
}
