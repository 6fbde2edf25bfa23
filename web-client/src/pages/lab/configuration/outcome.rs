//! What the server says of a study file.

use super::Msg;
use crate::view::{self, el};
use sidestep::api::{DraftChecked, Remark};

type Node = view::Node<Msg>;

/// What is wrong or to be known, by line.
pub(super) fn remarks(checked: &DraftChecked) -> Vec<Node> {
    let line = |remark: &Remark| {
        el("p").child(el("b").text(format!("Line {}: ", remark.line))).text(&remark.message)
    };
    if let Some(complaint) = &checked.complaint {
        return vec![line(complaint).class("trouble").attr("role", "status").test_id("complaint")];
    }
    let mut remarks = vec![
        el("p").class("saved").attr("role", "status").test_id("sound").text("The file is valid."),
    ];
    remarks.extend(checked.warnings.iter().map(|warning| line(warning).class("waiting")));
    remarks
}

/// The differences from the present configuration.
pub(super) fn changes(checked: &DraftChecked) -> Option<Node> {
    if checked.complaint.is_some() {
        return None;
    }
    if checked.changes.is_empty() {
        return Some(el("p").class("quiet").text("It says the same as the present configuration."));
    }
    let value = |value: &Option<String>| match value {
        Some(value) => el("code").text(value),
        None => el("span").class("quiet").text("not there"),
    };
    let rows = checked.changes.iter().map(|change| {
        el("div")
            .child(el("dt").text(&change.field))
            .child(el("dd").child(value(&change.before)).text(" → ").child(value(&change.after)))
    });
    Some(
        el("div")
            .child(el("h3").text("What changes"))
            .child(el("dl").class("changes").test_id("changes").children(rows)),
    )
}

/// How the scenes are spread.
pub(super) fn picture(checked: &DraftChecked) -> Option<Node> {
    let svg = checked.picture.as_ref()?;
    Some(
        el("section")
            .child(el("h2").text("Scenes"))
            .child(el("div").class("design").attr("tabindex", 0).test_id("design").html(svg)),
    )
}
