//! Parts that several pages share.

use crate::runtime::Address;
use crate::view::{Node, el};
use sidestep::comparison::models::ModelName;
use sidestep::trial::Flag;

/// The page to show while loading.
pub(super) fn loading<M>() -> Node<M> {
    el("main").class("card").child(el("p").class("quiet").attr("role", "status").text("Loading…"))
}

/// The page to show if a page of the laboratory cannot be shown.
pub(super) fn stuck<M>(title: &str, why: &str) -> Node<M> {
    el("main")
        .class("card")
        .key("stuck")
        .child(heading(title))
        .child(el("p").test_id("stuck").text(why))
        .child(el("p").child(el("a").attr("href", "/lab").text("All studies")))
}

/// The title of a page, which takes the focus when the page opens.
pub(super) fn heading<M>(words: &str) -> Node<M> {
    el("h1").attr("tabindex", -1).focus().text(words)
}

/// A button that sends `message`.
pub(super) fn button<M>(test_id: &str, message: M) -> Node<M> {
    el("button").attr("type", "button").test_id(test_id).on_press(message)
}

/// An error message. Screen readers read it aloud immediately.
pub(super) fn alert<M>(test_id: &str, text: &str) -> Node<M> {
    el("p").class("trouble").attr("role", "alert").test_id(test_id).text(text)
}

/// An error message about the first query parameter that is not in `known`, if there is such a
/// parameter.
pub(super) fn unknown(address: &Address, known: &[&[&str]]) -> Option<String> {
    let is_known = |name: &str| known.iter().any(|names| names.contains(&name));
    let (name, _) = address.query.iter().find(|(name, _)| !is_known(name))?;
    Some(format!(
        "This page does not use {name} in its link: expected {}.",
        known.concat().join(", ")
    ))
}

/// A name and its value, for a list of facts.
pub(super) fn fact<M>(name: &str, value: impl Into<String>) -> Node<M> {
    el("div").child(el("dt").text(name)).child(el("dd").text(value))
}

/// A notice that a program drove, for every page that shows data of synthetic participants. Returns
/// `None` for data of people.
pub(super) fn synthetic<M>(is_so: bool) -> Option<Node<M>> {
    let words = "Synthetic: a program drove, no person.";
    is_so.then(|| el("p").class("synthetic").test_id("marked-synthetic").text(words))
}

/// A table with these column headers.
pub(super) fn table<M>(
    columns: impl IntoIterator<Item = impl Into<String>>,
    rows: impl IntoIterator<Item = Node<M>>,
) -> Node<M> {
    let columns = columns.into_iter().map(|words| el("th").attr("scope", "col").text(words));
    el("table")
        .child(el("thead").child(el("tr").children(columns)))
        .child(el("tbody").children(rows))
}

/// A cell of a table.
pub(super) fn cell<M>(words: impl Into<String>) -> Node<M> {
    el("td").text(words)
}

/// A number with its noun.
pub(super) fn count(n: impl ToString, noun: &str) -> String {
    let n = n.to_string();
    let ending = if n == "1" { "" } else { "s" };
    format!("{n} {noun}{ending}")
}

/// Formats a file size.
pub(super) fn size(bytes: u64) -> String {
    match bytes {
        0..1_000 => format!("{bytes} bytes"),
        1_000..1_000_000 => format!("{} KB", bytes / 1_000),
        _ => format!("{:.1} MB", bytes as f64 * 1e-6),
    }
}

/// Formats a fraction from 0 to 1 as a percentage.
pub(super) fn percent(share: f64) -> String {
    format!("{:.1} %", 100.0 * share)
}

/// The label of a kind of model.
pub(super) fn model(word: &str) -> &str {
    // A newer server may know other kinds of models.
    ModelName::of_word(word).map_or(word, |model| model.row().label)
}

/// The flags of a trial in words. Empty if the trial has no flags.
pub(super) fn flags(flags: &[Flag]) -> String {
    let words: Vec<_> = flags.iter().map(|flag| flag.word().replace('_', " ")).collect();
    words.join(", ")
}
