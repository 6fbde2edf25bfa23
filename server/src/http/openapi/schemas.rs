//! JSON schemas of requests and responses, derived from their Rust types.

use schemars::generate::{Contract, SchemaSettings};
use schemars::{JsonSchema, SchemaGenerator};
use serde_json::{Map, Value};
use std::collections::BTreeSet;

const OF_ANSWERS: &str = "#/components/schemas/";
const OF_REQUESTS: &str = "#/components/requests/";

/// The schemas collected so far. A field may be optional in requests, which are deserialized, but
/// required in responses, which are serialized. So a type that is used in both may have two schemas.
#[derive(Debug)]
pub struct Schemas {
    requests: SchemaGenerator,
    answers: SchemaGenerator,
}

impl Default for Schemas {
    fn default() -> Self {
        let settings = |contract, path: &str| {
            SchemaSettings::draft2020_12().with(|settings| {
                settings.contract = contract;
                settings.meta_schema = None;
                settings.definitions_path =
                    path.trim_matches('#').trim_end_matches('/').to_owned().into();
            })
        };
        Self {
            requests: settings(Contract::Deserialize, OF_REQUESTS).into_generator(),
            answers: settings(Contract::Serialize, OF_ANSWERS).into_generator(),
        }
    }
}

impl Schemas {
    /// The schema of data that clients send.
    pub fn of_request<T: JsonSchema>(&mut self) -> Value {
        self.requests.subschema_for::<T>().into()
    }

    /// The inline schema of data that clients send, without a reference.
    pub fn of_query<T: JsonSchema>(&mut self) -> Value {
        T::json_schema(&mut self.requests).into()
    }

    /// The schema of data that the server sends.
    pub fn of_answer<T: JsonSchema>(&mut self) -> Value {
        self.answers.subschema_for::<T>().into()
    }

    /// Adds the named schemas to a document, and resolves all its references.
    pub fn put_into(mut self, document: &mut Value) {
        let mut schemas = self.answers.take_definitions(true);
        let requests = self.requests.take_definitions(true);
        let twofold = twofold(&requests, &schemas);
        for (name, schema) in requests {
            let name = named(&name, &twofold);
            schemas.entry(name).or_insert(schema);
        }
        document["components"]["schemas"] = Value::Object(schemas);
        resolve(document, &twofold);
    }
}

/// The names of types whose schemas differ between requests and responses, directly or in a nested
/// schema.
fn twofold(requests: &Map<String, Value>, answers: &Map<String, Value>) -> BTreeSet<String> {
    let mut twofold = BTreeSet::new();
    loop {
        let before = twofold.len();
        for (name, schema) in requests {
            let mut resolved = schema.clone();
            resolve(&mut resolved, &twofold);
            if answers.get(name).is_some_and(|answer| *answer != resolved) {
                twofold.insert(name.clone());
            }
        }
        if twofold.len() == before {
            return twofold;
        }
    }
}

fn named(name: &str, twofold: &BTreeSet<String>) -> String {
    if twofold.contains(name) { format!("{name}Input") } else { name.to_owned() }
}

/// Replaces references to request schemas with the final names of these schemas, and links in
/// descriptions with plain words.
fn resolve(value: &mut Value, twofold: &BTreeSet<String>) {
    match value {
        Value::Object(members) => {
            for (key, member) in members.iter_mut() {
                if let ("$ref", Value::String(to)) = (key.as_str(), &mut *member)
                    && let Some(name) = to.strip_prefix(OF_REQUESTS)
                {
                    *to = format!("{OF_ANSWERS}{}", named(name, twofold));
                }
                if let ("description", Value::String(text)) = (key.as_str(), &mut *member) {
                    *text = plain(text);
                }
                resolve(member, twofold);
            }
        }
        Value::Array(items) => items.iter_mut().for_each(|item| resolve(item, twofold)),
        _ => {}
    }
}

/// A doc comment without links to other items, and with one line per paragraph.
fn plain(text: &str) -> String {
    let mut plain = String::new();
    let mut rest = text;
    while let Some(begin) = rest.find("[`") {
        let Some(length) = rest[begin..].find("`]") else { break };
        plain.push_str(&rest[..begin]);
        plain.push_str(&rest[begin + 1..=begin + length]);
        rest = &rest[begin + length + 2..];
        if let Some(link) = rest.strip_prefix('(')
            && let Some(end) = link.find(')')
        {
            rest = &link[end + 1..];
        }
    }
    plain.push_str(rest);
    let paragraphs = plain.split("\n\n").map(|paragraph| paragraph.replace('\n', " "));
    paragraphs.collect::<Vec<_>>().join("\n\n")
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn comments_become_plain_words() {
        let text = "As in\n[`Upload`](super::Upload), see [`VERSION`].\n\nEnd [x].";
        assert_eq!(plain(text), "As in `Upload`, see `VERSION`.\n\nEnd [x].");
    }

    #[test]
    fn a_type_with_two_schemas_has_two_names() {
        #[derive(serde::Serialize, serde::Deserialize, JsonSchema)]
        struct Inner {
            #[serde(default)]
            count: u8,
        }
        #[derive(serde::Serialize, serde::Deserialize, JsonSchema)]
        struct Outer {
            inner: Inner,
        }
        let mut schemas = Schemas::default();
        let mut document = json!({
            "request": schemas.of_request::<Outer>(),
            "answer": schemas.of_answer::<Outer>(),
        });
        schemas.put_into(&mut document);
        assert_eq!(document["request"]["$ref"], "#/components/schemas/OuterInput");
        assert_eq!(document["answer"]["$ref"], "#/components/schemas/Outer");
        let named = &document["components"]["schemas"];
        assert_eq!(
            named["OuterInput"]["properties"]["inner"]["$ref"],
            "#/components/schemas/InnerInput"
        );
        assert_eq!(named["Inner"]["required"], json!(["count"]));
        assert_eq!(named["InnerInput"].get("required"), None);
    }
}
