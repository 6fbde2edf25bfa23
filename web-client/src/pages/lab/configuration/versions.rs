//! The earlier and current configurations of a study.

use super::Msg;
use crate::pages::parts::{self, cell};
use crate::view::{self, el};
use sidestep::api::ConfigurationVersion;

type Node = view::Node<Msg>;

/// Maximum number of fields named in a row.
const MOST_NAMED: usize = 6;

/// A table of all versions, newest first.
pub(super) fn versions(versions: &[ConfigurationVersion]) -> Node {
    let about = el("p").class("quiet").text(
        "A change makes a new version for new participants; participants who have begun keep theirs. \
         Exports name each participant’s configuration by its hash.",
    );
    let rows = versions.iter().enumerate().map(|(i, version)| row(version, i == 0));
    let columns = ["Version", "Label", "From", "Participants", "What changed", "File"];
    let table = parts::table(columns, rows).test_id("versions");
    el("section")
        .child(el("h2").text("Versions"))
        .child(about)
        .child(el("div").class("scroll").attr("tabindex", 0).child(table))
}

fn row(version: &ConfigurationVersion, is_present: bool) -> Node {
    let number = el("td").text(format!("{} ", version.number));
    let present = is_present.then(|| el("span").class("chip open").text("current"));
    let named: Vec<&str> = version.changed.iter().take(MOST_NAMED).map(String::as_str).collect();
    let further = version.changed.len() - named.len();
    let changed = match (version.number, further) {
        (1, _) => "–".to_owned(),
        (_, 0) => named.join(", "),
        (_, further) => format!("{}, and {further} more", named.join(", ")),
    };
    let file = el("details")
        .child(el("summary").text("Show"))
        .child(el("p").child(el("small").class("quiet").text(format!("SHA-256 {}", version.hash))))
        .child(el("pre").text(&version.toml));
    el("tr").key(version.number).children([
        number.children(present),
        cell(&version.label),
        el("td").child(el("time").moment(version.since_ms)),
        cell(version.participants.to_string()),
        cell(changed).class("wraps"),
        el("td").child(file),
    ])
}
