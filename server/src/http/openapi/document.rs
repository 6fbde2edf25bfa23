//! The complete OpenAPI document.

use super::operation::{Operation, Who, problem};
use super::problems::meaning;
use super::schemas::Schemas;
use crate::http::app::COOKIE;
use axum::http::Method;
use serde_json::{Map, Value, json};

/// A method of a route, with its documentation.
#[derive(Clone, Copy, Debug)]
pub struct Entry<'a> {
    /// The group in the document.
    pub group: &'a str,
    /// The HTTP method.
    pub method: &'a Method,
    /// The path, with parameters in braces.
    pub path: &'a str,
    /// A one-line summary.
    pub summary: &'a str,
    /// Further details; may be empty.
    pub detail: &'a str,
}

/// Path parameters: the path segment before the parameter, the description, and the type.
const PARAMETERS: [(&str, &str, &str); 8] = [
    ("studies", "The study's name in URLs, such as `default`.", "string"),
    (
        "value-functions",
        "Id of a value function: SHA-256 of its game and solution method.",
        "string",
    ),
    ("keys", "Number of the key.", "integer"),
    ("notes", "Number of the note.", "integer"),
    ("participants", "Id of the participant.", "string"),
    ("trials", "Id of the trial.", "string"),
    ("analyses", "Id of the analysis.", "string"),
    ("files", "Name of the file, such as `report.html` or `models/lr-1-hrd-1.json`.", "string"),
];

/// The document. Methods of routes are added to it one by one.
#[derive(Debug, Default)]
pub struct Document {
    groups: Vec<(&'static str, &'static str)>,
    paths: Map<String, Value>,
    schemas: Schemas,
}

impl Document {
    /// Adds a group with its description.
    pub fn group(&mut self, name: &'static str, text: &'static str) {
        self.groups.push((name, text));
    }

    /// Adds a method of a route. `describe` adds the inputs and responses of the method.
    pub fn add(&mut self, entry: Entry<'_>, describe: impl FnOnce(&mut Operation, &mut Schemas)) {
        let mut operation = Operation::default();
        describe(&mut operation, &mut self.schemas);
        operation.problems(&[
            "host",
            "timeout",
            "long_address",
            "unknown_host",
            "throttled",
            "internal",
        ]);
        if !entry.method.is_safe() {
            operation.problems(&["cross_site"]);
        }
        let path = entry.path.replace("{*", "{");
        let written = self.written(&path, entry, operation);
        let methods = self.paths.entry(path).or_insert_with(|| json!({}));
        methods[entry.method.as_str().to_lowercase()] = written;
    }

    fn written(&mut self, path: &str, entry: Entry<'_>, operation: Operation) -> Value {
        let Operation { who, parameters, body, answers, problems } = operation;
        let mut responses = Map::new();
        for (status, (text, content)) in answers {
            let text = match (status, text.is_empty()) {
                (_, false) => text,
                (201, _) => "Stored.".to_owned(),
                (204, _) => "Done; no content.".to_owned(),
                _ => "The requested content.".to_owned(),
            };
            let mut answer = json!({ "description": text });
            if !content.is_empty() {
                answer["content"] = Value::Object(content);
            }
            responses.insert(status.to_string(), answer);
        }
        for (status, codes) in &problems {
            let lines =
                codes.iter().map(|code| format!("`{code}`: {}.", meaning(code, Some(*status)).2));
            let schema = problem(&mut self.schemas, codes);
            let answer = json!({
                "description": lines.collect::<Vec<_>>().join(" "),
                "content": { "application/json": { "schema": schema } },
            });
            responses.insert(status.to_string(), answer);
        }
        let mut written = json!({
            "tags": [entry.group],
            "operationId": operation_id(entry.method, path),
            "summary": entry.summary,
            "parameters": path_parameters(path).into_iter().chain(parameters).collect::<Vec<_>>(),
            "responses": responses,
            "security": security(who),
        });
        let mut detail = entry.detail.to_owned();
        if let Who::Experimenter(access) = who {
            detail = format!("{detail} Needs a key with the right to {}.", access.word());
        }
        if !detail.trim().is_empty() {
            written["description"] = detail.trim().into();
        }
        if let Some(schema) = body {
            written["requestBody"] = json!({ "required": true, "content": { "application/json": { "schema": schema } } });
        }
        written
    }

    /// The complete document.
    #[must_use]
    pub fn finished(self) -> Value {
        let tag = |(name, text): &(&str, &str)| json!({ "name": name, "description": text });
        let mut document = json!({
            "openapi": "3.1.0",
            "jsonSchemaDialect": "https://json-schema.org/draft/2020-12/schema",
            "info": {
                "title": "Sidestep",
                "version": env!("CARGO_PKG_VERSION"),
                "license": { "name": "MIT OR Apache-2.0", "identifier": "MIT OR Apache-2.0" },
                "description": "The interface between a Sidestep server, the participants' pages, the \
                    laboratory and programs. Bodies are JSON in UTF-8, of at most 262144 bytes. Lengths \
                    are in metres, angles in radians counter-clockwise from +x, times in the unit at \
                    the end of the name. Every unsuccessful response has a problem body: a `code` for \
                    programs, a `message` for people, and the `field` that it is about.",
            },
            "servers": [{ "url": "/" }],
            "tags": self.groups.iter().map(tag).collect::<Vec<_>>(),
            "paths": self.paths,
            "components": { "securitySchemes": {
                "participant": {
                    "type": "http",
                    "scheme": "bearer",
                    "description": "The token in the response to an enrolment.",
                },
                "key": {
                    "type": "http",
                    "scheme": "bearer",
                    "description": "An experimenter's key.",
                },
                "session": {
                    "type": "apiKey",
                    "in": "cookie",
                    "name": COOKIE,
                    "description": "The cookie of a signed-in experimenter.",
                },
            } },
        });
        self.schemas.put_into(&mut document);
        document
    }
}

fn security(who: Who) -> Value {
    match who {
        Who::Anyone => json!([]),
        Who::MaybeParticipant => json!([{}, { "participant": [] }]),
        Who::Participant => json!([{ "participant": [] }]),
        Who::Experimenter(_) => json!([{ "key": [] }, { "session": [] }]),
    }
}

/// The parameters of a path. The segment before a parameter determines its description.
fn path_parameters(path: &str) -> Vec<Value> {
    let words: Vec<&str> = path.split('/').collect();
    let described = |pair: &[&str]| {
        let name = pair[1].strip_prefix('{')?.strip_suffix('}')?;
        let (_, text, kind) = PARAMETERS.into_iter().find(|(word, ..)| *word == pair[0])?;
        let schema = match kind {
            "integer" => json!({ "type": "integer", "format": "int64" }),
            _ => json!({ "type": "string", "minLength": 1 }),
        };
        let (place, required) = ("path", true);
        Some(json!({
            "name": name, "in": place, "required": required, "description": text, "schema": schema,
        }))
    };
    words.windows(2).filter_map(described).collect()
}

/// The operation id of a method, such as `put_participants_me_trials_trial_id`.
fn operation_id(method: &Method, path: &str) -> String {
    let words = path.trim_start_matches("/api/v1").split('/').filter(|word| !word.is_empty());
    let words = words.map(|word| word.trim_matches(['{', '}']).replace(['-', '.'], "_"));
    std::iter::once(method.as_str().to_lowercase()).chain(words).collect::<Vec<_>>().join("_")
}
