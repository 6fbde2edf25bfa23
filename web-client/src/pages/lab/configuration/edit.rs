//! Changes that the fields and buttons of the form make to a study.

use super::document::{change, get, set, text, unset};
use serde_json::{Value, json};

/// A change to the study.
#[derive(Clone, Debug)]
pub(in crate::pages::lab) enum Edit {
    /// Sets a field.
    Set(String, Value),
    /// Removes a field.
    Unset(String),
    /// Changes the kind of a question and removes the fields of the old kind.
    Kind(String, Value),
    /// Gives the robot at this path another rule, and removes the settings of the old rule.
    Rule(String, String),
    /// Sets several fields.
    Fill(Vec<(&'static str, Value)>),
    /// Inserts an item into a list.
    Insert(String, usize, Value),
    /// Removes an item from a list.
    Remove(String, usize),
    /// Swaps an item with the one before it.
    MoveUp(String, usize),
}

impl Edit {
    /// Applies the change.
    pub(super) fn apply(self, study: &mut Value) {
        match self {
            Self::Set(path, value) => set(study, &path, value),
            Self::Unset(path) => unset(study, &path),
            Self::Kind(path, kind) => {
                // The path ends with `.kind`.
                let Some((question, _)) = path.rsplit_once('.') else { return };
                let Some(old) = get(study, question).cloned() else { return };
                let kind = kind.as_str().unwrap_or_default();
                let mut new = new_question(text(&old, "name"), kind);
                for kept in ["text", "required"] {
                    set(&mut new, kept, old.get(kept).cloned().unwrap_or_default());
                }
                set(study, question, new);
            }
            Self::Rule(robot, rule) => {
                let new = new_robot(text(study, &format!("{robot}.name")), &rule);
                set(study, &robot, new);
            }
            Self::Fill(fields) => {
                for (path, value) in fields {
                    set(study, path, value);
                }
            }
            Self::Insert(list, at, entry) => {
                // An empty list may be absent.
                if get(study, &list).is_none() {
                    set(study, &list, json!([]));
                }
                change(study, &list, |entries| entries.insert(at.min(entries.len()), entry));
            }
            Self::Remove(list, at) => {
                let mut is_there = false;
                change(study, &list, |entries| {
                    is_there = at < entries.len();
                    if is_there {
                        entries.remove(at);
                    }
                });
                let moved = |answer: usize| answer - usize::from(is_there && answer > at);
                move_answer(study, &list, moved);
            }
            Self::MoveUp(list, at) => {
                let mut is_there = false;
                change(study, &list, |entries| {
                    is_there = (1..entries.len()).contains(&at);
                    if is_there {
                        entries.swap(at - 1, at);
                    }
                });
                move_answer(study, &list, |answer| match answer {
                    _ if !is_there => answer,
                    _ if answer == at => at - 1,
                    _ if answer + 1 == at => at,
                    _ => answer,
                });
            }
        }
    }
}

/// When the options of a check question move, adjusts the index of the right answer so that it
/// still selects the same option.
fn move_answer(study: &mut Value, list: &str, moved: impl Fn(usize) -> usize) {
    let Some(question) = list.strip_suffix(".options") else { return };
    let path = format!("{question}.answer");
    if let Some(answer) = get(study, &path).and_then(Value::as_u64) {
        set(study, &path, json!(moved(answer as usize)));
    }
}

/// A new, empty question to ask after the last scene.
pub(super) fn new_question(name: &str, kind: &str) -> Value {
    let mut question = json!({ "name": name, "kind": kind, "text": {}, "required": false });
    if kind == "choice" {
        set(&mut question, "options", json!([new_option("a"), new_option("b")]));
    }
    question
}

/// A new option for a question after the last scene.
pub(super) fn new_option(value: &str) -> Value {
    json!({ "value": value, "text": {} })
}

/// A new robot with this rule, with settings that a study can start from.
pub(super) fn new_robot(name: &str, rule: &str) -> Value {
    let mut robot = json!({ "name": name, "rule": rule });
    match rule {
        "way_points" => set(&mut robot, "way_points_m", json!([new_way_point(5.0)])),
        "script" => set(&mut robot, "turns", json!([new_turn(1.0)])),
        "evades" => set(&mut robot, "threshold_m", json!(0.5)),
        _ => {}
    }
    robot
}

/// A new way point this far ahead (m).
pub(super) fn new_way_point(ahead_m: f64) -> Value {
    json!([ahead_m, 0.0])
}

/// A new part of a script, which ends at this time (s).
pub(super) fn new_turn(until_s: f64) -> Value {
    json!({ "until_s": until_s, "turn_rate_radps": 0.0 })
}

/// A new, empty question for the comprehension check.
pub(super) fn new_check() -> Value {
    json!({ "text": {}, "options": [{}, {}], "answer": 0 })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn another_kind_keeps_only_what_every_question_has() {
        let mut study = json!({ "questions": [new_question("effort", "scale")] });
        set(&mut study, "questions[0].text.en", json!("How hard?"));
        set(&mut study, "questions[0].to", json!(9));
        Edit::Kind("questions[0].kind".into(), json!("text")).apply(&mut study);
        let expected = json!({ "name": "effort", "kind": "text", "text": { "en": "How hard?" },
                               "required": false });
        assert_eq!(study["questions"][0], expected);
        Edit::Kind("questions[0].kind".into(), json!("choice")).apply(&mut study);
        assert_eq!(study["questions"][0]["options"].as_array().unwrap().len(), 2);
    }

    #[test]
    fn lists_grow_shrink_and_change_their_order() {
        let mut study = json!({ "list": ["a", "b"] });
        for edit in [
            Edit::Insert("list".into(), 9, json!("c")),
            Edit::MoveUp("list".into(), 2),
            Edit::Remove("list".into(), 0),
            // These edits happen if a button is pressed twice.
            Edit::MoveUp("list".into(), 7),
            Edit::MoveUp("list".into(), 0),
            Edit::Remove("list".into(), 7),
            Edit::Remove("absent".into(), 0),
        ] {
            edit.apply(&mut study);
        }
        assert_eq!(study, json!({ "list": ["c", "b"] }));
    }

    #[test]
    fn the_right_answer_stays_the_same_option() {
        let mut study = json!({ "check": { "options": ["a", "b", "right"], "answer": 2 } });
        let options = || "check.options".to_owned();
        Edit::MoveUp(options(), 2).apply(&mut study);
        assert_eq!(study["check"], json!({ "options": ["a", "right", "b"], "answer": 1 }));
        Edit::MoveUp(options(), 2).apply(&mut study);
        assert_eq!(study["check"], json!({ "options": ["a", "b", "right"], "answer": 2 }));
        Edit::Remove(options(), 0).apply(&mut study);
        Edit::Remove(options(), 5).apply(&mut study);
        assert_eq!(study["check"], json!({ "options": ["b", "right"], "answer": 1 }));
    }
}
