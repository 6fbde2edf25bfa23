//! A study as a tree of values. A path such as `phases[0].scenes` names a field, as in the server's
//! error messages.

use serde_json::{Map, Value};

/// One part of a path.
enum Part<'a> {
    Name(&'a str),
    Place(usize),
}

fn parts(path: &str) -> impl Iterator<Item = Part<'_>> {
    path.split(['.', '[']).map(|part| match part.strip_suffix(']') {
        Some(place) => Part::Place(place.parse().unwrap_or(usize::MAX)),
        None => Part::Name(part),
    })
}

/// The value of a field.
pub(super) fn get<'a>(study: &'a Value, path: &str) -> Option<&'a Value> {
    parts(path).try_fold(study, |value, part| match part {
        Part::Name(name) => value.get(name),
        Part::Place(place) => value.get(place),
    })
}

/// The text of a field. Empty if the field has no text.
pub(super) fn text<'a>(study: &'a Value, path: &str) -> &'a str {
    get(study, path).and_then(Value::as_str).unwrap_or_default()
}

/// The number in a field.
pub(super) fn number(study: &Value, path: &str) -> Option<f64> {
    get(study, path)?.as_f64()
}

/// Whether a field is true.
pub(super) fn flag(study: &Value, path: &str) -> bool {
    get(study, path).and_then(Value::as_bool).unwrap_or_default()
}

/// The items of a list; empty if the field is not a list.
pub(super) fn list<'a>(study: &'a Value, path: &str) -> &'a [Value] {
    get(study, path).and_then(Value::as_array).map_or(&[], Vec::as_slice)
}

/// Sets a field. Creates missing objects along the path, but no list items.
pub(super) fn set(study: &mut Value, path: &str, new: Value) {
    let field = parts(path).try_fold(study, |value, part| match part {
        Part::Place(place) => value.get_mut(place),
        Part::Name(name) => {
            if !value.is_object() {
                *value = Value::Object(Map::new());
            }
            Some(value.as_object_mut()?.entry(name).or_insert(Value::Null))
        }
    });
    if let Some(field) = field {
        *field = new;
    }
}

/// Removes a field from its object.
pub(super) fn unset(study: &mut Value, path: &str) {
    let Some((object, name)) = path.rsplit_once('.') else { return };
    if let Some(object) = get_mut(study, object).and_then(Value::as_object_mut) {
        object.remove(name);
    }
}

/// Applies a change to a list.
pub(super) fn change(study: &mut Value, path: &str, change: impl FnOnce(&mut Vec<Value>)) {
    if let Some(list) = get_mut(study, path).and_then(Value::as_array_mut) {
        change(list);
    }
}

fn get_mut<'a>(study: &'a mut Value, path: &str) -> Option<&'a mut Value> {
    parts(path).try_fold(study, |value, part| match part {
        Part::Name(name) => value.get_mut(name),
        Part::Place(place) => value.get_mut(place),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn fields_are_found_by_the_paths_of_complaints() {
        let mut study = json!({ "title": "A", "phases": [{ "scenes": 6 }, { "scenes": 3 }] });
        assert_eq!(get(&study, "phases[1].scenes"), Some(&json!(3)));
        assert_eq!(number(&study, "phases[0].scenes"), Some(6.0));
        assert_eq!((text(&study, "title"), text(&study, "absent")), ("A", ""));
        assert_eq!(get(&study, "phases[2].scenes"), None);
        set(&mut study, "phases[1].scenes", json!(null));
        set(&mut study, "phases[7].scenes", json!(1));
        set(&mut study, "consent.text.zh-CN", json!("你好"));
        change(&mut study, "phases", |phases| drop(phases.remove(0)));
        unset(&mut study, "title.en");
        let expected = json!({ "title": "A", "phases": [{ "scenes": null }],
                               "consent": { "text": { "zh-CN": "你好" } } });
        assert_eq!(study, expected);
        unset(&mut study, "consent.text.zh-CN");
        assert_eq!(get(&study, "consent.text"), Some(&json!({})));
        assert_eq!(list(&study, "phases").len(), 1);
        assert!(list(&study, "title").is_empty() && !flag(&study, "title"));
    }
}
