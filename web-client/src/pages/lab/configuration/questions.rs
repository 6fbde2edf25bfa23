//! Questions in the form: the questions after the last scene and the questions of the comprehension
//! check.

use super::document::{list, number, text};
use super::edit::new_option;
use super::fields::Fields;
use super::{Edit, Msg};
use crate::view::{self, el};
use serde_json::{Value, json};

type Node = view::Node<Msg>;

/// The kinds of answers, with their descriptions.
const KINDS: [(&str, &str); 3] =
    [("text", "free text"), ("choice", "one of several options"), ("scale", "a number on a scale")];

/// The fields of a question after the last scene.
pub(super) fn question(fields: &Fields<'_>, i: usize, question: &Value) -> Node {
    let path = format!("questions[{i}]");
    let of = |field: &str| format!("{path}.{field}");
    let at = of("kind");
    let kind = move |kind: &str| Edit::Kind(at.clone(), kind.into());
    let mut inside = vec![
        fields.localised(&of("text"), "Question", ""),
        fields.line(&of("name"), "Name of its column in exports", ""),
        fields.kind(&of("kind"), "The answer is", &KINDS, kind),
        fields.tick(&of("required"), "An answer is required", ""),
    ];
    match text(question, "kind") {
        "choice" => {
            let options = of("options");
            let rows = (0..list(question, "options").len()).map(|k| {
                let option = format!("{options}[{k}]");
                el("div")
                    .class("row")
                    .child(fields.line(&format!("{option}.value"), "Value in exports", ""))
                    .child(fields.localised(&format!("{option}.text"), "Option", ""))
                    .child(fields.entry_buttons(&options, k, "option"))
            });
            inside.extend(rows);
            let letters = "abcdefghijklmnopqrstuvwxyz".chars().map(String::from);
            let taken = |value: &String| {
                list(question, "options").iter().any(|option| text(option, "value") == value)
            };
            let value = letters.into_iter().find(|value| !taken(value)).unwrap_or_default();
            let first = format!(".text.{}", fields.language);
            inside.push(fields.add(&options, "Add an option", new_option(&value), &first));
        }
        "scale" => inside.extend([
            fields.number(&of("from"), "From", "", ""),
            fields.number(&of("to"), "To", "", ""),
            fields.localised(&of("low"), "The lowest number means", ""),
            fields.localised(&of("high"), "The highest number means", ""),
        ]),
        _ => inside.push(fields.number(&of("max_chars"), "At most", "characters", "")),
    }
    entry(fields, "questions", i, inside)
}

/// The fields of a question of the comprehension check.
pub(super) fn check(fields: &Fields<'_>, i: usize, options: usize) -> Node {
    let path = format!("comprehension.questions[{i}]");
    let right = number(fields.given, &format!("{path}.answer"));
    let of = format!("{path}.options");
    let mut inside = vec![fields.localised(&format!("{path}.text"), "Question", "")];
    inside.extend((0..options).map(|k| {
        let at = format!("{path}.answer");
        let is_right = right == Some(k as f64);
        let radio = el("input")
            .attrs(&[("type", "radio"), ("name", &at)])
            .attr_if(is_right, "checked", "")
            .attr_if(!fields.may_manage, "disabled", "")
            .test_id(&format!("right-{of}[{k}]"))
            .on_input(move |_| Msg::Edit(Edit::Set(at.clone(), json!(k))));
        let right = el("label").class("check").child(radio).child(el("span").text("right"));
        el("div")
            .class("row")
            .child(fields.localised(&format!("{of}[{k}]"), "Option", ""))
            .child(right)
            .child(fields.entry_buttons(&of, k, "option"))
    }));
    inside.push(fields.add(&of, "Add an option", json!({}), &format!(".{}", fields.language)));
    entry(fields, "comprehension.questions", i, inside)
}

fn entry(fields: &Fields<'_>, of: &str, i: usize, inside: Vec<Node>) -> Node {
    el("fieldset")
        .class("question field wide")
        .child(el("legend").text(format!("Question {}", i + 1)))
        .child(el("div").class("fields").children(inside))
        .child(fields.entry_buttons(of, i, "question"))
}
