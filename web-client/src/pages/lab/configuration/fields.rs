//! The fields of the form. Each has a path in the study, a label, and the server's error message
//! about it.

use super::document::{flag, get, list, number, text};
use super::settings::{Control, Setting};
use super::{Edit, Msg};
use crate::form::FieldValue;
use crate::pages::parts::button;
use crate::view::{self, el};
use serde_json::{Value, json};
use sidestep::api::Remark;
use std::cell::RefCell;

type Node = view::Node<Msg>;

/// What the fields are created from.
pub(super) struct Fields<'a> {
    /// The study that filled the form. Input does not change it, so that nothing moves under the
    /// cursor.
    pub(super) given: &'a Value,
    /// The study including the user's input.
    pub(super) study: &'a Value,
    /// The error in the study, if any.
    pub(super) complaint: Option<&'a Remark>,
    /// The language whose texts are shown.
    pub(super) language: &'a str,
    /// The name of the control to focus after the form is rebuilt.
    pub(super) focus: &'a str,
    pub(super) may_manage: bool,
    /// Path and label of each control, in the order of their creation.
    pub(super) labels: RefCell<Vec<(String, String)>>,
}

impl Fields<'_> {
    /// The control of a setting.
    pub(super) fn setting(&self, setting: &Setting) -> Node {
        let Setting { path, control, label, hint } = *setting;
        match control {
            Control::Number(unit) => self.number(path, label, unit, hint),
            Control::Tick => self.tick(path, label, hint),
            Control::Line => self.line(path, label, hint),
            Control::Short => self.line(path, label, hint).class("field"),
            Control::Names => self.names(path, label, hint),
            Control::Fact => self.fact(path, label, hint),
            Control::Markdown => self.markdown(path, label, hint),
            Control::Choice(words) => self.choice(path, label, hint, words),
        }
    }

    /// A field for a single-line text.
    pub(super) fn line(&self, path: &str, label: &str, hint: &str) -> Node {
        let input = el("input").attr("type", "text").attr("value", text(self.given, path));
        self.labelled(path, label, "", hint, entered_text(input, path))
    }

    /// A field for a number, with its unit.
    pub(super) fn number(&self, path: &str, label: &str, unit: &str, hint: &str) -> Node {
        let value = number(self.given, path).map_or_else(String::new, |number| number.to_string());
        let at = path.to_owned();
        let input = el("input").attrs(&[("type", "number"), ("step", "any"), ("value", &value)]);
        let input = input.on_input(move |entered| {
            Msg::Edit(Edit::Set(at.clone(), entered.number().map_or(Value::Null, tidy)))
        });
        self.labelled(path, label, unit, hint, input).class("field")
    }

    /// A check box.
    pub(super) fn tick(&self, path: &str, label: &str, hint: &str) -> Node {
        let at = path.to_owned();
        let edit = move |ticked: bool| Msg::Edit(Edit::Set(at.clone(), ticked.into()));
        self.ticked(path, label, hint, flag(self.given, path), edit)
    }

    /// A selection list. `words` contains the values and their labels.
    pub(super) fn choice(
        &self,
        path: &str,
        label: &str,
        hint: &str,
        words: &[(&str, &str)],
    ) -> Node {
        let at = path.to_owned();
        let select = self
            .select(path, words)
            .on_input(move |entered| Msg::Edit(Edit::Set(at.clone(), entered.text().into())));
        self.labelled(path, label, "", hint, select)
    }

    fn select(&self, path: &str, words: &[(&str, &str)]) -> Node {
        let chosen = text(self.given, path);
        let option = |(value, label): &(&str, &str)| {
            let option = el("option").attr("value", *value).text(*label);
            option.attr_if(*value == chosen, "selected", "")
        };
        el("select").children(words.iter().map(option))
    }

    /// A button that changes which fields the form has. `focus` names the control to focus
    /// afterwards.
    pub(super) fn button(&self, name: &str, edit: Edit, focus: &str) -> Node {
        let button = button(name, Msg::Rebuild(edit, focus.to_owned()));
        let button = button.attr_if(!self.may_manage, "disabled", "");
        if self.focus == name { button.focus() } else { button }
    }

    /// A button that adds an item to a list. Afterwards, the item's field `first` (such as `.name`)
    /// is focused.
    pub(super) fn add(&self, to: &str, words: &str, new: Value, first: &str) -> Node {
        let at = list(self.given, to).len();
        let focus = format!("field-{to}[{at}]{first}");
        let add = self.button(&format!("add-{to}"), Edit::Insert(to.to_owned(), at, new), &focus);
        el("div").class("field wide").child(add.text(words))
    }

    /// Buttons that move an item up and remove it.
    pub(super) fn entry_buttons(&self, of: &str, i: usize, noun: &str) -> Node {
        let up = (i > 0).then(|| {
            let focus = format!("up-{of}[{}]", i - 1);
            // The first item has no button to move it up.
            let focus = if i > 1 { focus } else { format!("remove-{of}[0]") };
            self.button(&format!("up-{of}[{i}]"), Edit::MoveUp(of.to_owned(), i), &focus)
                .class("plain")
                .attr("aria-label", format!("Move {noun} {} up", i + 1))
                .text("↑")
        });
        let remove = self
            .button(
                &format!("remove-{of}[{i}]"),
                Edit::Remove(of.to_owned(), i),
                &format!("add-{of}"),
            )
            .class("plain")
            .attr("aria-label", format!("Remove {noun} {}", i + 1))
            .text(format!("Remove {noun}"));
        el("div").class("entry-buttons").children(up).child(remove)
    }

    /// A check box that changes the form's fields or their content.
    pub(super) fn ticked(
        &self,
        path: &str,
        label: &str,
        hint: &str,
        is_so: bool,
        edit: impl Fn(bool) -> Msg + 'static,
    ) -> Node {
        self.labels.borrow_mut().push((path.to_owned(), label.to_owned()));
        let input = el("input").attr("type", "checkbox").attr_if(is_so, "checked", "");
        let input =
            input.on_input(move |entered| edit(matches!(entered, FieldValue::Checked(true))));
        let label = el("label")
            .class("check")
            .child(self.control(path, input))
            .child(el("span").text(label));
        self.with_complaint(el("div").class("field wide").child(label), path, hint)
    }

    /// The kind of an item. It determines which other fields the item has, so `edit` makes the
    /// change to another kind.
    pub(super) fn kind(
        &self,
        path: &str,
        label: &str,
        words: &[(&str, &str)],
        edit: impl Fn(&str) -> Edit + 'static,
    ) -> Node {
        let at = path.to_owned();
        let select = self
            .select(path, words)
            .on_input(move |entered| Msg::Rebuild(edit(entered.text()), format!("field-{at}")));
        self.labelled(path, label, "", "", select)
    }

    /// A field for names, separated by commas.
    fn names(&self, path: &str, label: &str, hint: &str) -> Node {
        let names: Vec<&str> = get(self.given, path)
            .and_then(Value::as_array)
            .map(|names| names.iter().filter_map(Value::as_str).collect())
            .unwrap_or_default();
        let at = path.to_owned();
        let input = el("input").attr("type", "text").attr("value", names.join(", "));
        let input = input.on_input(move |entered| {
            let names = entered.text().split(',').map(str::trim).filter(|name| !name.is_empty());
            Msg::Edit(Edit::Set(at.clone(), names.collect::<Vec<_>>().into()))
        });
        self.labelled(path, label, "", hint, input)
    }

    /// A field for a text in the current language.
    pub(super) fn localised(&self, path: &str, label: &str, hint: &str) -> Node {
        let path = format!("{path}.{}", self.language);
        let input = el("input").attr("type", "text").attr("value", text(self.given, &path));
        let input = input.attr("lang", self.language);
        self.labelled(&path, label, "", hint, entered_translation(input, &path))
    }

    /// A field for a longer text in the current language.
    fn markdown(&self, path: &str, label: &str, hint: &str) -> Node {
        let path = format!("{path}.{}", self.language);
        let area = el("textarea").attr("rows", 6).attr("lang", self.language);
        let area = entered_translation(area.text(text(self.given, &path)), &path);
        self.labelled(&path, label, "", hint, area)
    }

    /// A fact about the study: either one text for all languages, or the text in the current
    /// language.
    fn fact(&self, path: &str, label: &str, hint: &str) -> Node {
        match get(self.given, path) {
            Some(Value::Object(_)) => self.localised(path, label, hint),
            _ => self.line(path, label, hint),
        }
    }

    /// A field with its label, unit, hint and error.
    fn labelled(&self, path: &str, label: &str, unit: &str, hint: &str, input: Node) -> Node {
        self.labels.borrow_mut().push((path.to_owned(), label.to_owned()));
        let id = id(path);
        let entry = el("div").class("entry").child(self.control(path, input).attr("id", &id));
        let unit = (!unit.is_empty()).then(|| el("span").class("unit").text(unit));
        let field = el("div")
            .class("field wide")
            .child(el("label").attr("for", &id).text(label))
            .child(entry.children(unit));
        self.with_complaint(field, path, hint)
    }

    fn control(&self, path: &str, input: Node) -> Node {
        let is_wrong = self.complaint_within(path).is_some();
        let name = format!("field-{path}");
        let input = if self.focus == name { input.focus() } else { input };
        input
            .test_id(&name)
            .attr("autocomplete", "off")
            .attr_if(!self.may_manage, "disabled", "")
            .attr_if(is_wrong, "aria-invalid", "true")
            .attr_if(is_wrong, "aria-describedby", &format!("{}-complaint", id(path)))
    }

    fn with_complaint(&self, field: Node, path: &str, hint: &str) -> Node {
        let hint = (!hint.is_empty()).then(|| el("small").class("quiet").text(hint));
        field.children(hint).children(self.complaint_within(path).map(|what| {
            el("p")
                .class("trouble")
                .attr("id", format!("{}-complaint", id(path)))
                .test_id("beside")
                .text(what)
        }))
    }

    /// The error message for this field or for a field inside it, without the field's path.
    pub(super) fn complaint_within(&self, path: &str) -> Option<String> {
        let complaint = self.complaint?;
        let field = complaint.field.as_deref()?;
        let is_within = |field: &str| {
            let rest = field.strip_prefix(path);
            rest.is_some_and(|rest| rest.is_empty() || rest.starts_with(['.', '[']))
        };
        // If a text is missing in every language, the path in the error has no language at the end.
        let is_missing = || is_within(&format!("{field}.{}", self.language));
        (is_within(field) || is_missing()).then(|| sentence(complaint, field))
    }

    /// The error message for a whole section, such as `encounters`, but not for one of its fields.
    pub(super) fn complaint_about(&self, path: &str) -> Option<String> {
        let complaint = self.complaint?;
        let field = complaint.field.as_deref().filter(|field| *field == path)?;
        Some(sentence(complaint, field))
    }
}

/// The error message as a sentence, without the field's path.
fn sentence(complaint: &Remark, field: &str) -> String {
    let mut letters = without_path(&complaint.message, field).chars();
    let first = letters.next().map(char::to_uppercase).into_iter().flatten();
    first.chain(letters).collect()
}

/// The text of a remark without the field's path.
pub(super) fn without_path<'a>(said: &'a str, field: &str) -> &'a str {
    said.strip_prefix(field).and_then(|rest| rest.strip_prefix(": ")).unwrap_or(said)
}

/// The name of a field in the form: the label of its control, or the label of the closest enclosing
/// control.
pub(super) fn name_of(labels: &[(String, String)], field: &str, language: &str) -> Option<String> {
    let missing = format!("{field}.{language}");
    let mut found: Option<&(String, String)> = None;
    for known in labels {
        let rest = field.strip_prefix(&known.0);
        let is_within = rest.is_some_and(|rest| rest.is_empty() || rest.starts_with(['.', '[']));
        let is_closer = found.is_none_or(|(path, _)| path.len() < known.0.len());
        if (is_within || known.0 == missing) && is_closer {
            found = Some(known);
        }
    }
    let (_, label) = found?;
    let place = |list: &str| {
        let (_, rest) = field.split_once(list)?;
        rest.split_once(']')?.0.parse::<usize>().ok().map(|place| place + 1)
    };
    let question = place("questions[").map(|n| format!("Question {n}"));
    let option = place("options[").map(|n| format!("option {n}"));
    // The text of a question or option is named only by its position.
    let label = Some(label.clone()).filter(|label| label != "Question" && label != "Option");
    let robot = place("robots[").map(|n| format!("Robot {n}"));
    let point = place("way_points_m[").map(|n| format!("way point {n}"));
    let turn = place("turns[").map(|n| format!("turn {n}"));
    let parts: Vec<String> =
        [question, option, robot, point, turn, label].into_iter().flatten().collect();
    Some(parts.join(", "))
}

/// A number as it appears in a study file: an integer if the number is whole.
fn tidy(number: f64) -> Value {
    let is_whole = number.fract() == 0.0 && number.abs() < 9e15;
    if is_whole { json!(number as i64) } else { json!(number) }
}

fn id(path: &str) -> String {
    format!("field-{}", path.replace(['.', '[', ']'], "-"))
}

fn entered_text(input: Node, path: &str) -> Node {
    let at = path.to_owned();
    input.on_input(move |entered| Msg::Edit(Edit::Set(at.clone(), entered.text().into())))
}

/// An input for a translation. If the user deletes the text, the entry of the language is removed
/// as well.
fn entered_translation(input: Node, path: &str) -> Node {
    let at = path.to_owned();
    input.on_input(move |entered| {
        Msg::Edit(match entered.text() {
            "" => Edit::Unset(at.clone()),
            text => Edit::Set(at.clone(), text.into()),
        })
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fields_are_named_by_the_labels_of_their_controls() {
        let labels = [
            ("phases[2].scenes", "Tasks: number of scenes"),
            ("phases", "Phases"),
            ("questions[0].text.en", "Question"),
            ("questions[0].options[1].value", "Value in exports"),
            ("questions[0].options[1].text.en", "Option"),
            ("questions", "Questions after the last scene"),
        ];
        let labels = labels.map(|(path, label)| (path.to_owned(), label.to_owned()));
        for (field, name) in [
            ("phases[2].scenes", "Tasks: number of scenes"),
            ("phases[2].phase", "Phases"),
            ("questions[0].text", "Question 1"),
            ("questions[0].options[1].value", "Question 1, option 2, Value in exports"),
            ("questions[0].options[1].text", "Question 1, option 2"),
            ("questions", "Questions after the last scene"),
        ] {
            assert_eq!(name_of(&labels, field, "en").as_deref(), Some(name), "{field}");
        }
        assert_eq!(name_of(&labels, "texts.en", "en"), None);
    }
}
