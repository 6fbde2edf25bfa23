//! Which page of the laboratory an address names: one line a page.

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
use crate::pages::replay::ReplayPage;
use crate::runtime::Commands;

/// An address of the laboratory and the page that it names.
pub(super) struct Route {
    /// Its path. A part `{id}` stands for any one name.
    pub(super) path: &'static str,
    /// What the navigation calls it, if it is there.
    pub(super) nav: Option<&'static str>,
    /// Opens the page.
    pub(super) open: Open,
}

type Open = fn(&Visit<'_>) -> (AnyPage, Commands<AnyMsg>);

/// Every page, in the order of the navigation.
#[rustfmt::skip]
pub(super) static ROUTES: &[Route] = &[
    Route { path: "/lab", nav: Some("Studies"), open: |visit| host(Home::open(visit)) },
    Route { path: "/lab/studies/{id}", nav: None, open: |visit| host(Participants::open(visit)) },
    Route { path: "/lab/participants/{id}", nav: None, open: |visit| host(Profile::open(visit)) },
    Route { path: "/lab/studies/{id}/trials", nav: None, open: |visit| host(Trials::open(visit)) },
    Route { path: "/lab/studies/{id}/analyses", nav: None, open: |visit| host(Analyses::open(visit)) },
    Route { path: "/lab/analyses/{id}", nav: None, open: |visit| host(AnalysisView::open(visit)) },
    Route { path: "/lab/studies/{id}/export", nav: None, open: |visit| host(Export::open(visit)) },
    Route { path: "/lab/studies/{id}/configuration", nav: None, open: |visit| host(ConfigurationPage::open(visit)) },
    Route { path: "/lab/new", nav: None, open: |visit| host(ConfigurationPage::open_new(visit)) },
    Route { path: "/lab/replay/{id}", nav: None, open: |visit| host(ReplayPage::open(visit.id, visit.address)) },
    Route { path: "/lab/access", nav: Some("Access"), open: |visit| host(AccessPage::open(visit)) },
    Route { path: "/lab/self-check", nav: Some("Self-check"), open: |_| host(SelfCheckPage::open()) },
];

impl Route {
    /// The name that stands for `{id}` if `path` is of this route; empty where there is none.
    pub(super) fn matches<'a>(&self, path: &'a str) -> Option<&'a str> {
        let path = path.trim_end_matches('/');
        let Some((before, after)) = self.path.split_once("{id}") else {
            return (path == self.path).then_some("");
        };
        let id = path.strip_prefix(before)?.strip_suffix(after)?;
        (!id.is_empty() && !id.contains('/')).then_some(id)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_address_names_one_page() {
        let named = |path: &'static str| {
            let found: Vec<_> = ROUTES
                .iter()
                .filter_map(|route| Some((route.path, route.matches(path)?)))
                .collect();
            assert!(found.len() <= 1, "{path}: {found:?}");
            found.first().copied()
        };
        assert_eq!(named("/lab"), Some(("/lab", "")));
        assert_eq!(named("/lab/"), Some(("/lab", "")));
        assert_eq!(named("/lab/self-check"), Some(("/lab/self-check", "")));
        assert_eq!(named("/lab/replay/t-1"), Some(("/lab/replay/{id}", "t-1")));
        assert_eq!(named("/lab/studies/pilot"), Some(("/lab/studies/{id}", "pilot")));
        assert_eq!(named("/lab/studies/a/trials"), Some(("/lab/studies/{id}/trials", "a")));
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
}
