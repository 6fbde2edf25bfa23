//! The selection of participants, in the page's address and in the query for the server's list.

use crate::runtime::{Address, encoded};
use sidestep::api::Stage;

/// Number of participants on a page.
pub(super) const PAGE_LENGTH: u64 = 50;

/// Selection and order of participants.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(super) struct Selection {
    /// Only participants at this stage.
    pub(super) stage: Option<Stage>,
    /// The word of a flag that the participants must have. Empty for all participants.
    pub(super) having: String,
    /// The search text. Empty for all participants.
    pub(super) search: String,
    /// The word of the column to sort by. If empty, the list is sorted by participant number.
    pub(super) sort: String,
    /// Whether the order is descending.
    pub(super) descending: bool,
    /// Number of participants before the current page.
    pub(super) offset: u64,
    /// Whether pilots are shown instead of participants.
    pub(super) pilots: bool,
}

impl Selection {
    /// Reads the selection from the page's address.
    pub(super) fn of(address: &Address) -> Self {
        let text = |name: &str| address.parameter(name).unwrap_or_default().to_owned();
        Self {
            stage: Stage::ALL.into_iter().find(|stage| stage.word() == text("stage")),
            having: text("having"),
            search: text("search"),
            sort: text("sort"),
            descending: text("order") == "desc",
            offset: text("offset").parse().unwrap_or(0),
            pilots: text("pilot") == "true",
        }
    }

    /// The query for the server's list. The page's own address has the same query.
    pub(super) fn query(&self) -> String {
        let mut query = format!("limit={PAGE_LENGTH}");
        let mut add = |name: &str, value: &str| {
            if !value.is_empty() {
                query.push_str(&format!("&{name}={}", encoded(value)));
            }
        };
        add("stage", self.stage.map_or("", Stage::word));
        add("having", &self.having);
        add("search", &self.search);
        add("sort", &self.sort);
        add("order", if self.descending { "desc" } else { "" });
        add("offset", &if self.offset > 0 { self.offset.to_string() } else { String::new() });
        add("pilot", if self.pilots { "true" } else { "" });
        query
    }

    /// Whether the filters hide some participants.
    pub(super) fn is_filtered(&self) -> bool {
        self.stage.is_some() || !self.having.is_empty() || !self.search.is_empty()
    }

    /// Sorts by a column in descending order, or reverses the order if the list is already sorted
    /// by this column in descending order.
    pub(super) fn sort_by(&mut self, column: &str) {
        self.descending = self.sort != column || !self.descending;
        self.sort = column.to_owned();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_selection_is_what_its_address_says() {
        let selection = Selection {
            stage: Some(Stage::Task),
            having: "late_sample".into(),
            search: "a b&c".into(),
            sort: "stored".into(),
            descending: true,
            offset: 50,
            pilots: true,
        };
        assert_eq!(
            selection.query(),
            "limit=50&stage=task&having=late_sample&search=a%20b%26c&sort=stored&order=desc\
             &offset=50&pilot=true"
        );
        let pairs = selection.query().replace("%20", " ").replace("%26", "\u{1}");
        let query = pairs.split('&').map(|pair| {
            let (name, value) = pair.split_once('=').unwrap();
            (name.to_owned(), value.replace('\u{1}', "&"))
        });
        let address = Address { query: query.collect(), ..Address::default() };
        assert_eq!(Selection::of(&address), selection);
        assert_eq!(Selection::of(&Address::default()), Selection::default());
    }

    #[test]
    fn the_same_column_again_turns_the_order() {
        let mut selection = Selection::default();
        let mut orders = Vec::new();
        for column in ["stored", "stored", "number"] {
            selection.sort_by(column);
            orders.push(selection.descending);
        }
        assert_eq!(orders, [true, false, true]);
    }
}
