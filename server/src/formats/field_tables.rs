//! The tables that a settings file can have, with the fields of each table. They are derived from
//! the types into which the file is deserialized.
//!
//! When a struct is deserialized, serde passes the names of its fields to the deserializer. So a
//! deserializer that follows a path into a type learns the fields at the end of the path.

use serde::de::value::{Error, MapDeserializer, SeqDeserializer};
use serde::de::{DeserializeOwned, Deserializer, Error as _, IntoDeserializer, Visitor};
use serde::forward_to_deserialize_any;
use sidestep::document::nearest;
use sidestep::invalid::Invalid;
use std::cell::Cell;

/// A table of a file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FieldTable {
    /// The path of the table, such as `parameters.human` or `questions[].options[]`. It is empty
    /// for the file itself.
    pub path: String,
    /// Its fields.
    pub fields: &'static [&'static str],
}

impl FieldTable {
    /// The name of the table in TOML.
    fn name(&self) -> String {
        match &self.path[..] {
            "" => "the top of the file, before any [table]".to_owned(),
            path if path.ends_with("[]") => format!("[[{}]]", path.replace("[]", "")),
            path => format!("[{}]", path.replace("[]", "")),
        }
    }
}

/// The tables of a type, outermost first.
#[must_use]
pub fn tables<T: DeserializeOwned>() -> Vec<FieldTable> {
    let mut found = Vec::new();
    collect::<T>(&mut Vec::new(), String::new(), &mut found);
    found
}

fn collect<T: DeserializeOwned>(steps: &mut Vec<Step>, path: String, found: &mut Vec<FieldTable>) {
    let shape = Cell::new(Shape::Value);
    // Ignore the result, which is always an error. The probe records the shape in `shape`.
    let _ = T::deserialize(Probe { steps, shape: &shape });
    match shape.get() {
        Shape::Value => {}
        Shape::List => {
            steps.push(Step::Entry);
            collect::<T>(steps, format!("{path}[]"), found);
            steps.pop();
        }
        Shape::Table(fields) => {
            found.push(FieldTable { path: path.clone(), fields });
            for field in fields {
                let joint = if path.is_empty() { "" } else { "." };
                steps.push(Step::Field(field));
                collect::<T>(steps, format!("{path}{joint}{field}"), found);
                steps.pop();
            }
        }
    }
}

/// Explains an error about a field that does not exist in its table. The error then names the
/// tables that have this field or, if no table has it, a similar field. Other errors are unchanged.
#[must_use]
pub fn explained(invalid: Invalid, tables: &[FieldTable]) -> Invalid {
    let (parent, name) = invalid.field.rsplit_once('.').unwrap_or(("", &invalid.field));
    let parent = without_numbers(parent);
    let Some(table) = tables.iter().find(|table| table.path == parent) else { return invalid };
    if name.ends_with(']') || table.fields.contains(&name) {
        return invalid;
    }
    let names = |field: &str| {
        let homes = tables.iter().filter(|table| table.fields.contains(&field));
        homes.map(FieldTable::name).collect::<Vec<_>>().join(" or ")
    };
    let is_typo = !nearest(name, table.fields.iter().copied()).is_empty();
    let elsewhere = names(name);
    let found = match elsewhere.is_empty() {
        false => format!("{name:?}, which belongs in {elsewhere}"),
        true if is_typo => return invalid,
        true => {
            let fields = tables.iter().flat_map(|table| table.fields).copied();
            let meant = nearest(name, fields).into_iter();
            let meant: Vec<_> = meant.map(|field| format!("{field} in {}", names(field))).collect();
            match meant.is_empty() {
                true => return invalid,
                false => format!("{name:?}; did you mean {}?", meant.join(", or ")),
            }
        }
    };
    Invalid { found, ..invalid }
}

/// Removes the indices. For example, `questions[3].options[0]` becomes `questions[].options[]`.
fn without_numbers(path: &str) -> String {
    let mut in_brackets = false;
    let keep = |c: &char| {
        in_brackets = match c {
            '[' => true,
            ']' => false,
            _ => in_brackets,
        };
        !in_brackets || *c == '['
    };
    path.chars().filter(keep).collect()
}

/// One part of the path into a type: a field of a table, or an entry of a list.
#[derive(Clone, Copy, Debug)]
enum Step {
    Field(&'static str),
    Entry,
}

/// The shape at the end of a path.
#[derive(Clone, Copy, Debug)]
enum Shape {
    Table(&'static [&'static str]),
    List,
    Value,
}

/// A deserializer that follows a path into a type and records the shape at its end.
#[derive(Clone, Copy)]
struct Probe<'a> {
    steps: &'a [Step],
    shape: &'a Cell<Shape>,
}

impl Probe<'_> {
    fn stop<V>(self, shape: Shape) -> Result<V, Error> {
        self.shape.set(if self.steps.is_empty() { shape } else { Shape::Value });
        Err(Error::custom("the end of the path"))
    }
}

impl<'de> IntoDeserializer<'de> for Probe<'_> {
    type Deserializer = Self;

    fn into_deserializer(self) -> Self {
        self
    }
}

impl<'de> Deserializer<'de> for Probe<'_> {
    type Error = Error;

    fn deserialize_any<V: Visitor<'de>>(self, _: V) -> Result<V::Value, Error> {
        self.stop(Shape::Value)
    }

    fn deserialize_struct<V: Visitor<'de>>(
        self,
        _: &'static str,
        fields: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, Error> {
        match self.steps {
            [Step::Field(field), steps @ ..] => {
                let only = [(*field, Probe { steps, ..self })];
                visitor.visit_map(MapDeserializer::new(only.into_iter()))
            }
            _ => self.stop(Shape::Table(fields)),
        }
    }

    fn deserialize_seq<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Error> {
        match self.steps {
            [Step::Entry, steps @ ..] => {
                visitor.visit_seq(SeqDeserializer::new([Probe { steps, ..self }].into_iter()))
            }
            _ => self.stop(Shape::List),
        }
    }

    fn deserialize_option<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Error> {
        visitor.visit_some(self)
    }

    fn deserialize_newtype_struct<V: Visitor<'de>>(
        self,
        _: &'static str,
        visitor: V,
    ) -> Result<V::Value, Error> {
        visitor.visit_newtype_struct(self)
    }

    forward_to_deserialize_any! {
        bool i8 i16 i32 i64 i128 u8 u16 u32 u64 u128 f32 f64 char str string bytes byte_buf unit
        unit_struct tuple tuple_struct map enum identifier ignored_any
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::{Value, json};
    use sidestep::document::from_value;
    use sidestep::study::StudyConfig;

    /// The error for a study in which the table at `path` has only this field.
    fn complaint(path: &str, field: &str, tables: &[FieldTable]) -> Invalid {
        let mut value = json!({ field: 1 });
        for part in path.rsplit('.').filter(|part| !part.is_empty()) {
            let name = part.trim_end_matches("[]");
            value = match name == part {
                true => json!({ name: value }),
                false => json!({ name: Value::Array(vec![value]) }),
            };
        }
        explained(from_value::<StudyConfig>(&value).unwrap_err(), tables)
    }

    #[test]
    fn the_tables_of_a_study() {
        let found = tables::<StudyConfig>();
        let fields = |path: &str| found.iter().find(|table| table.path == path).unwrap().fields;
        assert!(fields("").contains(&"slug") && fields("").contains(&"questions"));
        assert!(fields("parameters.human").contains(&"speed_mps"));
        assert!(fields("questions[].options[]").contains(&"value"));
        assert!(fields("recruitment").contains(&"quota"));
        // The complete file in the guide contains only these tables, apart from tables with free
        // keys.
        let guide = include_str!("../../../docs/study.md");
        let (_, guide) = guide.split_once("```toml\n").unwrap();
        let (guide, _) = guide.split_once("```").unwrap();
        let guide: toml::Table = toml::from_str(guide).unwrap();
        let mut paths = Vec::new();
        tables_of(&toml::Value::Table(guide), String::new(), &mut paths);
        for path in &paths {
            let free = ["texts", "consent", "instructions", "debrief"];
            let known = found.iter().any(|table| table.path == *path);
            let is_localised = |path: &str| {
                found.iter().any(|table| {
                    let parent = path.rsplit_once('.').unwrap_or(("", path));
                    table.path == parent.0
                        && table.fields.contains(&parent.1.trim_end_matches("[]"))
                })
            };
            assert!(
                known || is_localised(path) || free.iter().any(|name| path.starts_with(name)),
                "{path}"
            );
        }
    }

    fn tables_of(value: &toml::Value, path: String, found: &mut Vec<String>) {
        match value {
            toml::Value::Table(table) => {
                found.push(path.clone());
                for (name, value) in table {
                    let joint = if path.is_empty() { "" } else { "." };
                    tables_of(value, format!("{path}{joint}{name}"), found);
                }
            }
            toml::Value::Array(list) => {
                list.iter().take(1).for_each(|value| tables_of(value, format!("{path}[]"), found));
            }
            _ => {}
        }
    }

    /// Checks every field in every table that does not have it.
    #[test]
    fn a_misplaced_field_is_told_where_it_belongs() {
        let found = tables::<StudyConfig>();
        let mut fields: Vec<&str> = found.iter().flat_map(|table| table.fields).copied().collect();
        fields.sort_unstable();
        fields.dedup();
        let mut count = 0;
        for table in &found {
            for field in fields.iter().filter(|field| !table.fields.contains(field)) {
                let said = complaint(&table.path, field, &found);
                assert!(said.field.ends_with(field), "{said}");
                assert!(said.found.starts_with(&format!("{field:?}, which belongs in ")), "{said}");
                for home in found.iter().filter(|home| home.fields.contains(field)) {
                    assert!(said.found.contains(&home.name()), "{said}: {}", home.name());
                }
                count += 1;
            }
        }
        assert!(count > 500, "{count}");
        let said = complaint("", "quota", &found).to_string();
        assert!(said.ends_with("found \"quota\", which belongs in [recruitment]"), "{said}");
    }

    /// Checks every field in its own table, with every one-letter typo.
    #[test]
    fn a_field_with_a_typing_error_is_proposed() {
        let found = tables::<StudyConfig>();
        for table in &found {
            for field in table.fields {
                for typo in typos(field) {
                    if found.iter().any(|table| table.fields.contains(&&typo[..])) {
                        continue;
                    }
                    let said = complaint(&table.path, &typo, &found);
                    let (_, meant) = said.found.split_once("; did you mean ").unwrap_or(("", ""));
                    let meant: Vec<_> = meant.trim_end_matches('?').split(" or ").collect();
                    assert!(meant.contains(field), "{field}: {said}");
                }
            }
        }
        let said = complaint("questions[]", "id", &found);
        assert_eq!(said.field, "questions[0].id");
        assert!(said.found == "\"id\"", "{said}");
        // The name is misspelt, and the field belongs to another table.
        let said = complaint("", "qouta", &found).to_string();
        assert!(said.ends_with("found \"qouta\"; did you mean quota in [recruitment]?"), "{said}");
    }

    /// The word with a letter omitted, doubled or replaced, or with two letters swapped.
    fn typos(word: &str) -> Vec<String> {
        let mut typos = Vec::new();
        for i in 0..word.len() {
            let (before, after) = word.split_at(i);
            typos.push(format!("{before}{}", &after[1..]));
            typos.push(format!("{before}{}{after}", &after[..1]));
            typos.push(format!("{before}q{}", &after[1..]));
            if after.len() > 1 && after[..1] != after[1..2] {
                typos.push(format!("{before}{}{}{}", &after[1..2], &after[..1], &after[2..]));
            }
        }
        typos.retain(|typo| typo != word && !typo.is_empty());
        typos
    }
}
