//! What a page of the laboratory shows when it has nothing else, and the heading of those that do.

use crate::view::{Node, el};

/// While the server is asked.
pub(super) fn loading<M>() -> Node<M> {
    el("main").class("card").child(el("p").class("quiet").attr("role", "status").text("Loading…"))
}

/// When a page cannot be shown.
pub(super) fn stuck<M>(heading: &str, why: &str) -> Node<M> {
    el("main")
        .class("card")
        .key("stuck")
        .child(heading_of_page(heading))
        .child(el("p").test_id("stuck").text(why))
        .child(el("p").child(el("a").attr("href", "/lab").text("Back to the trials")))
}

/// The heading of a page, which takes the focus when the page opens.
pub(super) fn heading_of_page<M>(words: &str) -> Node<M> {
    el("h1").attr("tabindex", -1).focus().text(words)
}
