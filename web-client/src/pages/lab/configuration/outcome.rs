//! The server's remarks on a draft, and the buttons to store it.

use super::editor::Mode;
use super::fields::{name_of, without_path};
use super::{ConfigurationPage, Msg};
use crate::pages::parts::button;
use crate::view::{self, el};
use sidestep::api::{DraftChecked, Remark};

type Node = view::Node<Msg>;

/// Maximum number of warnings shown.
const MOST_WARNINGS: usize = 3;

/// The part beside the draft: the server's remarks, the differences, and the buttons to store the
/// draft.
pub(super) fn said(page: &ConfigurationPage) -> Vec<Node> {
    let Some(checked) = &page.editor.checked else {
        return vec![el("p").class("quiet").attr("role", "status").text("Checking…")];
    };
    let names = Names::of(page);
    let mut said = remarks(checked, page.editor.mode(), &names);
    if page.stored && !page.is_changed() {
        let words = "Stored. New participants get this configuration.";
        said.push(el("p").class("saved").attr("role", "status").test_id("stored").text(words));
    }
    if page.overtaken {
        let words = "Somebody else has stored another configuration since you began. Yours is not \
                     stored. Copy what you need from the study file, then:";
        said.push(el("p").class("trouble").text(words));
        said.push(button("reload", Msg::Reload).text("Show the current configuration"));
    }
    if !page.may_manage || !page.is_changed() {
        return said;
    }
    // The draft can be stored only after the last input was checked, because only the check
    // converts the form to text.
    let is_sound = checked.complaint.is_none() && page.editor.is_current();
    let store = |words: &str| {
        button("store", Msg::Store).class("primary").attr_if(!is_sound, "disabled", "").text(words)
    };
    if page.slug.is_none() {
        said.push(store("Create the study"));
        return said;
    }
    said.extend(changes(checked));
    let is_same = checked.changes.is_empty();
    if page.confirming && is_sound {
        let participants = page.base.as_ref().map_or(0, |base| base.participants);
        let words = match participants {
            0 => "Nobody has begun yet.".to_owned(),
            1 => "1 participant has begun and keeps the configuration of that time; new \
                  participants get this one."
                .to_owned(),
            many => format!(
                "{many} participants have begun and keep the configuration of that time; new \
                 participants get this one."
            ),
        };
        said.push(
            el("div")
                .class("confirm")
                .child(el("p").test_id("keeps").text(words))
                .child(
                    button("confirm", Msg::Confirm)
                        .class("primary")
                        .focus()
                        .text("Use for new participants"),
                )
                .child(button("go-on", Msg::GoOn).class("plain").text("Keep editing")),
        );
    } else if !is_same || !is_sound {
        said.push(store("Store…"));
    }
    said
}

/// The names of fields: the labels of the form if the form is shown, otherwise the names in the
/// study file.
struct Names<'a> {
    labels: Vec<(String, String)>,
    language: &'a str,
}

impl<'a> Names<'a> {
    fn of(page: &'a ConfigurationPage) -> Self {
        let (labels, language) = match page.editor.mode() {
            Mode::Form => page.editor.labels(page.slug.is_none(), page.may_manage),
            Mode::Text => (Vec::new(), ""),
        };
        Self { labels, language }
    }

    /// The text of a remark, with the name of the field instead of its path.
    fn said(&self, remark: &Remark) -> String {
        let named = remark
            .field
            .as_deref()
            .and_then(|field| Some((field, name_of(&self.labels, field, self.language)?)));
        match named {
            Some((field, name)) => format!("{name}: {}", without_path(&remark.message, field)),
            None => remark.message.clone(),
        }
    }
}

/// The error or the warnings, named by line or by field.
fn remarks(checked: &DraftChecked, mode: Mode, names: &Names<'_>) -> Vec<Node> {
    let remark = |remark: &Remark| {
        let line = remark.line.filter(|_| mode == Mode::Text);
        let line = line.map(|line| el("b").text(format!("Line {line}: ")));
        el("p").children(line).text(names.said(remark))
    };
    if let Some(complaint) = &checked.complaint {
        return vec![
            remark(complaint).class("trouble").attr("role", "status").test_id("complaint"),
        ];
    }
    let words = match mode {
        Mode::Form => "The configuration is valid.",
        Mode::Text => "The file is valid.",
    };
    let mut remarks =
        vec![el("p").class("saved").attr("role", "status").test_id("sound").text(words)];
    let shown = checked.warnings.iter().take(MOST_WARNINGS);
    remarks.extend(shown.map(|warning| remark(warning).class("waiting")));
    if checked.warnings.len() > MOST_WARNINGS {
        let further = checked.warnings.len() - MOST_WARNINGS;
        remarks.push(el("p").class("waiting").text(format!(
            "And {further} more. Tick only the languages that your texts have, under About the \
             study."
        )));
    }
    remarks
}

/// The differences between the draft and the stored configuration.
fn changes(checked: &DraftChecked) -> Option<Node> {
    if checked.complaint.is_some() {
        return None;
    }
    if checked.changes.is_empty() {
        return Some(el("p").class("quiet").text("It is the same as the current configuration."));
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
