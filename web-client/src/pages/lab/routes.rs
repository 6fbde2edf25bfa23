//! Which page of the laboratory an address names: one line a page.

use super::hosted::{AnyMsg, AnyPage, host};
use super::self_check::SelfCheckPage;
use super::trials::Trials;
use crate::pages::replay::ReplayPage;
use crate::runtime::{Address, Commands};

/// An address of the laboratory and the page that it names.
pub(super) struct Route {
    /// Its path. A last part `{id}` stands for any one name, which `open` is given.
    pub(super) path: &'static str,
    /// What the navigation calls it, if it is there.
    pub(super) nav: Option<&'static str>,
    /// Opens the page.
    pub(super) open: Open,
}

type Open = fn(&Address, &str) -> (AnyPage, Commands<AnyMsg>);

/// Every page, in the order of the navigation.
#[rustfmt::skip]
pub(super) static ROUTES: &[Route] = &[
    Route { path: "/lab", nav: Some("Trials"), open: |address, _| host(Trials::open(address)) },
    Route { path: "/lab/replay/{id}", nav: None, open: |_, id| host(ReplayPage::open(id)) },
    Route { path: "/lab/self-check", nav: Some("Self-check"), open: |_, _| host(SelfCheckPage::open()) },
];

impl Route {
    /// The name that stands for `{id}` if `path` is of this route; empty where there is none.
    pub(super) fn matches<'a>(&self, path: &'a str) -> Option<&'a str> {
        let path = path.trim_end_matches('/');
        match self.path.strip_suffix("{id}") {
            None => (path == self.path).then_some(""),
            Some(before) => {
                path.strip_prefix(before).filter(|id| !id.is_empty() && !id.contains('/'))
            }
        }
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
        for nowhere in
            ["/lab/replay", "/lab/replay/", "/lab/replay/a/b", "/lab/none", "/laboratory"]
        {
            assert_eq!(named(nowhere), None, "{nowhere}");
        }
    }
}
