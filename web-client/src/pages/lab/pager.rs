//! Navigation in a long list: the current range, and buttons for the previous and the next page.

use crate::pages::parts::button;
use crate::view::{Node, el};

/// A pager for a list of `total` entries in pages of `length`. The current page shows `shown`
/// entries after the first `offset`. `go` takes the number of entries before a page and returns the
/// message that shows the page. Returns `None` for an empty list.
pub(super) fn pager<M>(
    (offset, shown, total): (u64, usize, u64),
    length: u64,
    go: impl Fn(u64) -> M,
) -> Option<Node<M>> {
    let shown = shown as u64;
    if shown == 0 && offset == 0 {
        return None;
    }
    let words = match shown {
        0 => format!("None of {total} here"),
        _ => format!("{}–{} of {total}", offset + 1, offset + shown),
    };
    let turn = |name: &str, words: &str, to: Option<u64>| {
        let target = go(to.unwrap_or(offset));
        button(name, target).attr_if(to.is_none(), "disabled", "").text(words)
    };
    let before = (offset > 0).then(|| offset.saturating_sub(length));
    let after = (offset + shown < total && shown > 0).then_some(offset + length);
    Some(
        el("div")
            .class("pager")
            .child(turn("previous", "Previous", before))
            .child(el("span").test_id("range").text(words))
            .child(turn("next", "Next", after)),
    )
}
