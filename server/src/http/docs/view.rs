//! The content of the documentation page, derived from the OpenAPI document.

use serde::Serialize;
use serde_json::Value;

/// The content of the page.
#[derive(Debug, Serialize)]
pub(super) struct View<'a> {
    version: &'a str,
    text: &'a str,
    groups: Vec<Group<'a>>,
    types: Vec<Type<'a>>,
}

#[derive(Debug, Serialize)]
struct Group<'a> {
    name: &'a str,
    text: &'a str,
    operations: Vec<Operation<'a>>,
}

#[derive(Debug, Serialize)]
struct Operation<'a> {
    id: &'a str,
    method: String,
    path: &'a str,
    summary: &'a str,
    text: &'a str,
    who: &'static str,
    parameters: Vec<Row<'a>>,
    body: Option<Vec<Piece>>,
    answers: Vec<Answer<'a>>,
    example: String,
}

#[derive(Debug, Serialize)]
struct Answer<'a> {
    status: &'a str,
    body: Vec<Piece>,
    text: &'a str,
}

#[derive(Debug, Serialize)]
struct Type<'a> {
    name: &'a str,
    text: &'a str,
    rows: Vec<Row<'a>>,
    kind: Vec<Piece>,
}

/// A parameter or a field.
#[derive(Debug, Serialize)]
struct Row<'a> {
    name: &'a str,
    kind: Vec<Piece>,
    required: bool,
    text: &'a str,
}

/// A part of the description of a value: the name of a type, or other text.
#[derive(Debug, PartialEq, Serialize)]
struct Piece {
    text: String,
    link: bool,
}

/// The content of the page for an OpenAPI document.
pub(super) fn of(document: &Value) -> View<'_> {
    let groups = items(&document["tags"]).iter().map(|tag| {
        let name = text(tag, "name");
        Group { name, text: text(tag, "description"), operations: operations(document, name) }
    });
    let types = members(&document["components"]["schemas"]).map(|(name, schema)| Type {
        name,
        text: text(schema, "description"),
        rows: fields(schema),
        kind: words(schema),
    });
    View {
        version: text(&document["info"], "version"),
        text: text(&document["info"], "description"),
        groups: groups.collect(),
        types: types.collect(),
    }
}

fn operations<'a>(document: &'a Value, group: &str) -> Vec<Operation<'a>> {
    let mut found = Vec::new();
    for (path, methods) in members(&document["paths"]) {
        for (method, it) in members(methods) {
            if it["tags"][0] == group {
                found.push(operation(path, method.to_uppercase(), it));
            }
        }
    }
    found
}

fn operation<'a>(path: &'a str, method: String, it: &'a Value) -> Operation<'a> {
    let parameters = items(&it["parameters"]).iter().map(|parameter| Row {
        name: text(parameter, "name"),
        kind: words(&parameter["schema"]),
        required: parameter["required"] == true,
        text: text(parameter, "description"),
    });
    let body =
        it.get("requestBody").map(|body| words(&body["content"]["application/json"]["schema"]));
    let answers = members(&it["responses"]).map(|(status, answer)| Answer {
        status,
        body: bodies(&answer["content"]),
        text: text(answer, "description"),
    });
    let who = match &it["security"] {
        Value::Array(schemes) if schemes.is_empty() => "Anyone.",
        Value::Array(schemes) if schemes[0].get("participant").is_some() => {
            "A participant, with the token of their enrolment."
        }
        Value::Array(schemes) if schemes[0].get("key").is_some() => {
            "An experimenter, with a key or the session's cookie."
        }
        _ => "Anyone; participants may send their token.",
    };
    Operation {
        id: text(it, "operationId"),
        example: example(path, &method, it),
        method,
        path,
        summary: text(it, "summary"),
        text: text(it, "description"),
        who,
        parameters: parameters.collect(),
        body,
        answers: answers.collect(),
    }
}

/// A curl command that sends an example request.
fn example(path: &str, method: &str, it: &Value) -> String {
    let mut command = "curl".to_owned();
    if method != "GET" {
        command += &format!(" -X {method}");
    }
    match it["security"].get(0) {
        Some(scheme) if scheme.get("key").is_some() => {
            command += " -H \"Authorization: Bearer $KEY\"";
        }
        Some(scheme) if scheme.get("participant").is_some() => {
            command += " -H \"Authorization: Bearer $TOKEN\"";
        }
        _ => {}
    }
    if it.get("requestBody").is_some() {
        command += " -H \"Content-Type: application/json\" -d @body.json";
    }
    let required = items(&it["parameters"])
        .iter()
        .filter(|parameter| parameter["in"] == "query" && parameter["required"] == true)
        .map(|parameter| format!("{}=…", text(parameter, "name")));
    let query = required.collect::<Vec<_>>().join("&");
    let path = path.replace("{slug}", "default");
    let mark = if query.is_empty() { "" } else { "?" };
    format!("{command} \"http://127.0.0.1:8080{path}{mark}{query}\"")
}

fn bodies(content: &Value) -> Vec<Piece> {
    let mut pieces = Vec::new();
    for (i, (kind, body)) in members(content).enumerate() {
        if i > 0 {
            pieces.push(plain("; "));
        }
        match kind {
            "application/json" => pieces.extend(words(&body["schema"])),
            kind => pieces.push(plain(kind)),
        }
    }
    pieces
}

/// The fields of an object's schema.
fn fields(schema: &Value) -> Vec<Row<'_>> {
    let required = items(&schema["required"]);
    members(&schema["properties"])
        .map(|(name, field)| Row {
            name,
            kind: words(field),
            required: required.iter().any(|it| it == name),
            text: text(field, "description"),
        })
        .collect()
}

/// Describes the type of a schema in words.
fn words(schema: &Value) -> Vec<Piece> {
    if let Some(name) = schema.get("$ref").and_then(Value::as_str) {
        let name = name.rsplit('/').next().unwrap_or(name);
        return vec![Piece { text: name.to_owned(), link: true }];
    }
    if let Some(choices) = ["oneOf", "anyOf"].iter().find_map(|key| schema.get(*key)) {
        return joined(items(choices).iter().map(words), " or ");
    }
    if let Some(all) = schema.get("allOf") {
        return items(all).first().map(words).unwrap_or_default();
    }
    if let Some(only) = schema.get("const") {
        return vec![plain(&only.to_string())];
    }
    if let Some(values) = schema.get("enum") {
        let values = items(values).iter().map(|value| vec![plain(&value.to_string())]);
        return joined(values, " or ");
    }
    let kinds = match schema.get("type") {
        Some(Value::Array(kinds)) => kinds.clone(),
        Some(kind) => vec![kind.clone()],
        None => return vec![plain("any JSON")],
    };
    joined(kinds.iter().map(|kind| of_kind(kind.as_str().unwrap_or_default(), schema)), " or ")
}

fn of_kind(kind: &str, schema: &Value) -> Vec<Piece> {
    let range = |least: &str, most: &str, of: &str| {
        let bound = |key: &str| schema.get(key).map(Value::to_string);
        match (bound(least), bound(most)) {
            (Some(least), Some(most)) if least == most => format!(", {least}{of}"),
            (Some(least), Some(most)) => format!(", {least} to {most}{of}"),
            (Some(least), None) => format!(", at least {least}{of}"),
            (None, Some(most)) => format!(", at most {most}{of}"),
            (None, None) => String::new(),
        }
    };
    match kind {
        "array" => {
            let mut pieces = vec![plain("list of ")];
            pieces.extend(schema.get("items").map_or_else(Vec::new, words));
            if let Some(places) = schema.get("prefixItems") {
                pieces.extend(joined(items(places).iter().map(words), ", "));
            }
            pieces.push(plain(&range("minItems", "maxItems", " of them")));
            pieces
        }
        "object" => match schema.get("additionalProperties") {
            Some(values) if values.is_object() => {
                joined([vec![plain("object of ")], words(values)].into_iter(), "")
            }
            _ => vec![plain("object")],
        },
        "string" => {
            vec![plain(&format!("string{}", range("minLength", "maxLength", " characters")))]
        }
        "integer" => vec![plain(&format!("whole number{}", range("minimum", "maximum", "")))],
        "number" => vec![plain(&format!("number{}", range("minimum", "maximum", "")))],
        kind => vec![plain(kind)],
    }
}

fn joined(parts: impl Iterator<Item = Vec<Piece>>, between: &str) -> Vec<Piece> {
    let mut pieces: Vec<Piece> = Vec::new();
    for part in parts {
        if !pieces.is_empty() && !between.is_empty() {
            pieces.push(plain(between));
        }
        pieces.extend(part);
    }
    pieces
}

fn plain(text: &str) -> Piece {
    Piece { text: text.to_owned(), link: false }
}

fn text<'a>(value: &'a Value, key: &str) -> &'a str {
    value.get(key).and_then(Value::as_str).unwrap_or_default()
}

fn items(value: &Value) -> &[Value] {
    value.as_array().map_or(&[], Vec::as_slice)
}

fn members(value: &Value) -> impl Iterator<Item = (&str, &Value)> {
    value.as_object().into_iter().flatten().map(|(name, value)| (name.as_str(), value))
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn values_in_words() {
        let said = |schema: Value| words(&schema).into_iter().map(|it| it.text).collect::<String>();
        assert_eq!(
            said(json!({ "type": ["integer", "null"], "minimum": 0 })),
            "whole number, at least 0 or null"
        );
        assert_eq!(said(json!({ "enum": ["csv"], "type": "string" })), "\"csv\"");
        let list = json!({ "type": "array", "items": { "$ref": "#/components/schemas/Pose" } });
        assert_eq!(said(list), "list of Pose");
        assert_eq!(said(json!({})), "any JSON");
    }
}
