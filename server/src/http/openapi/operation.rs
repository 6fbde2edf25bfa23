//! Inputs and responses of a method of a route.

use super::problems::{Meaning, meaning};
use super::schemas::Schemas;
use crate::http::error::ApiError;
use axum::Extension;
use axum::Json;
use axum::extract::rejection::PathRejection;
use axum::extract::{MatchedPath, Path, State};
use axum::http::{HeaderMap, Method, StatusCode};
use axum::response::{Response, Sse};
use schemars::JsonSchema;
use serde_json::{Map, Value, json};
use sidestep::api::{Access, Problem};
use std::collections::{BTreeMap, BTreeSet};

/// Who may send a request.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Who {
    /// Anyone.
    #[default]
    Anyone,
    /// Anyone. A participant's token changes the response.
    MaybeParticipant,
    /// A participant, with the token of their enrolment.
    Participant,
    /// An experimenter whose key has at least this access level.
    Experimenter(Access),
}

/// Inputs and responses of a method of a route.
#[derive(Clone, Debug, Default)]
pub struct Operation {
    /// Who may send the request.
    pub who: Who,
    /// Query parameters in OpenAPI's format.
    pub parameters: Vec<Value>,
    /// The schema of the request body.
    pub body: Option<Value>,
    /// Successful responses by HTTP status: a description, and the schemas by media type.
    pub answers: BTreeMap<u16, (String, Map<String, Value>)>,
    /// Codes of problems, by HTTP status.
    pub problems: BTreeMap<u16, BTreeSet<&'static str>>,
}

impl Operation {
    /// Adds problems by their codes.
    pub fn problems(&mut self, codes: &[&'static str]) {
        for code in codes {
            self.problem(meaning(code, None));
        }
    }

    /// Adds a problem.
    pub fn problem(&mut self, (code, status, _): Meaning) {
        self.problems.entry(status).or_default().insert(code);
    }

    /// Adds a successful response. A status can have several media types, which are alternatives.
    pub fn answer(&mut self, status: u16, media_type: &str, schema: Value) {
        let (_, content) = self.answers.entry(status).or_default();
        content.insert(media_type.to_owned(), json!({ "schema": schema }));
    }

    /// Adds the parameters of a query of this type.
    pub fn query<T: JsonSchema>(&mut self, schemas: &mut Schemas) {
        let schema = schemas.of_query::<T>();
        let required =
            schema.get("required").and_then(Value::as_array).cloned().unwrap_or_default();
        for (name, schema) in
            schema.get("properties").and_then(Value::as_object).into_iter().flatten()
        {
            let mut schema = schema.clone();
            let description = schema.as_object_mut().and_then(|it| it.remove("description"));
            self.parameters.push(json!({
                "name": name,
                "in": "query",
                "required": required.contains(&json!(name)),
                "description": description.unwrap_or_default(),
                "schema": present(schema),
            }));
        }
    }
}

/// Removes null from the schema of a parameter, because clients omit a parameter instead of sending
/// null.
fn present(mut schema: Value) -> Value {
    if let Some(Value::Array(kinds)) = schema.get_mut("type") {
        kinds.retain(|kind| kind != "null");
        if let [only] = kinds.as_slice() {
            schema["type"] = only.clone();
        }
    } else if let Some(Value::Array(choices)) = schema.get_mut("anyOf") {
        choices.retain(|choice| choice.get("type").is_none_or(|kind| kind != "null"));
        if let [only] = choices.as_slice() {
            return only.clone();
        }
    }
    schema
}

/// A part of a request that a handler extracts.
pub trait Input {
    /// Adds the inputs that this type extracts, and the problems that it reports.
    fn describe(_: &mut Operation, _: &mut Schemas) {}
}

impl<S> Input for State<S> {}
impl Input for HeaderMap {}
impl Input for Method {}
impl Input for MatchedPath {}
impl<T> Input for Extension<T> {}
impl<T> Input for Option<Extension<T>> {}

impl<T> Input for Result<Path<T>, PathRejection> {
    fn describe(operation: &mut Operation, _: &mut Schemas) {
        operation.problems(&["not_found"]);
    }
}

/// A result of a handler.
pub trait Output {
    /// Adds the successful responses with their bodies, and the problems.
    fn describe(operation: &mut Operation, schemas: &mut Schemas);
}

/// This type does not describe its body, so the table of routes describes it.
impl Output for Response {
    fn describe(_: &mut Operation, _: &mut Schemas) {}
}

impl<T: JsonSchema> Output for Json<T> {
    fn describe(operation: &mut Operation, schemas: &mut Schemas) {
        operation.answer(200, "application/json", schemas.of_answer::<T>());
    }
}

/// A created resource.
impl<T: JsonSchema> Output for (StatusCode, Json<T>) {
    fn describe(operation: &mut Operation, schemas: &mut Schemas) {
        operation.answer(201, "application/json", schemas.of_answer::<T>());
    }
}

/// A success without a body.
impl Output for StatusCode {
    fn describe(operation: &mut Operation, _: &mut Schemas) {
        operation.answers.entry(204).or_default();
    }
}

impl Output for String {
    fn describe(operation: &mut Operation, _: &mut Schemas) {
        operation.answer(200, "text/plain", json!({ "type": "string" }));
    }
}

impl<S> Output for Sse<S> {
    fn describe(operation: &mut Operation, _: &mut Schemas) {
        operation.answer(200, "text/event-stream", json!({ "type": "string" }));
    }
}

impl<T: Output> Output for Result<T, ApiError> {
    fn describe(operation: &mut Operation, schemas: &mut Schemas) {
        T::describe(operation, schemas);
        operation.problems(&["busy", "storage"]);
    }
}

/// The schema of a problem body that has one of these codes.
pub fn problem(schemas: &mut Schemas, codes: &BTreeSet<&'static str>) -> Value {
    let problem = schemas.of_answer::<Problem>();
    json!({ "allOf": [problem, { "properties": { "code": { "enum": codes } } }] })
}
