//! Deserializes documents (JSON, TOML, queries) into typed values. If a document does not match the
//! type, the error is an [`Invalid`]: the field, what was expected and what was found. This error
//! is built from the parts of Serde's errors, not from their messages. The only exception is a
//! number that is too large, which is detected by the parser's message.

mod nearest;

use crate::invalid::{Invalid, SEPARATOR};
use core::fmt;
pub use nearest::{did_you_mean, nearest};
use serde::de::value::{MapAccessDeserializer, MapDeserializer, SeqDeserializer, StrDeserializer};
use serde::de::{
    DeserializeOwned, Deserializer, Expected, IgnoredAny, IntoDeserializer, SeqAccess, Unexpected,
    Visitor,
};
use serde::forward_to_deserialize_any;
use serde_json::Value;

/// The reason why a text could not be parsed.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum Unread {
    /// The text is not JSON. Contains the parser's message, with line and column.
    #[error("{0}")]
    NotJson(String),
    /// The text is JSON, but does not match the type.
    #[error(transparent)]
    Invalid(#[from] Invalid),
}

/// Maximum accepted nesting depth of lists and objects. Documents are a few levels deep; a hundred
/// thousand nested brackets would overflow the stack.
const DEEPEST: usize = 64;

/// Whether lists and objects of a text are nested more than 64 levels deep. No document needs this
/// depth, and it could overflow the stack of a recursive parser.
#[must_use]
pub fn is_too_deep(text: &str) -> bool {
    nesting(text) > DEEPEST
}

/// Parses one JSON value of type `T`. Nothing but white space is allowed after the value.
///
/// # Errors
/// [`Unread`]. A syntax error anywhere in the text takes precedence over a value that does not match
/// the type.
pub fn from_json<T: DeserializeOwned>(text: &str) -> Result<T, Unread> {
    if is_too_deep(text) {
        return Err(Unread::NotJson(format!("nested more than {DEEPEST} deep")));
    }
    let error = match serde_json::from_str(text) {
        Ok(value) => return Ok(value),
        Err(error) => error,
    };
    serde_json::from_str::<IgnoredAny>(text).map_err(|e| Unread::NotJson(e.to_string()))?;
    let mut reader = serde_json::Deserializer::from_str(text);
    // JSON's grammar allows numbers that a double cannot hold, and lone surrogates ("\ud800") that
    // a string cannot hold. Only the parser's message distinguishes the two.
    let value: Value = serde_path_to_error::deserialize(&mut reader).map_err(|e| {
        if !e.inner().to_string().starts_with("number out of range") {
            return Unread::NotJson(e.inner().to_string());
        }
        let expected = "a number that a double can hold";
        Invalid::new(e.path().to_string(), expected, "one that is too large").into()
    })?;
    match from_value::<T>(&value) {
        Err(invalid) => Err(invalid.into()),
        // The text has a duplicate field. The parsed value has each field only once.
        Ok(_) => Err(Invalid::new("", "each field once", error).into()),
    }
}

/// Parses one JSON object as a `T`. Nothing but white space is allowed after the object. (Serde
/// would also accept a list of the fields in order.)
///
/// # Errors
/// The errors of [`from_json`], and [`Invalid`] for a value that is not an object.
pub fn object_from_json<T: DeserializeOwned>(text: &str) -> Result<T, Unread> {
    if text.trim_start().starts_with('{') {
        return from_json(text);
    }
    let value: Value = from_json(text)?;
    Err(Invalid::new("", "an object, {…}", found_value(&value)).into())
}

/// The nesting depth of lists and objects in a JSON text.
fn nesting(text: &str) -> usize {
    let (mut depth, mut deepest, mut in_string, mut escaped) = (0usize, 0, false, false);
    for byte in text.bytes() {
        match byte {
            _ if escaped => escaped = false,
            b'\\' if in_string => escaped = true,
            b'"' => in_string = !in_string,
            b'[' | b'{' if !in_string => depth += 1,
            b']' | b'}' if !in_string => depth = depth.saturating_sub(1),
            _ => {}
        }
        deepest = deepest.max(depth);
    }
    deepest
}

/// Converts a value to a `T`.
///
/// # Errors
/// [`Invalid`] naming the field within the value. An empty name stands for the value itself.
pub fn from_value<T: DeserializeOwned>(value: &Value) -> Result<T, Invalid> {
    serde_path_to_error::deserialize(Node(value)).map_err(|error| {
        let path = error.path().to_string();
        let Misfit(invalid) = error.into_inner();
        if path == "." { invalid } else { invalid.within(&path) }
    })
}

/// A value of the document being deserialized.
struct Node<'a>(&'a Value);

impl<'de> IntoDeserializer<'de, Misfit> for Node<'de> {
    type Deserializer = Self;

    fn into_deserializer(self) -> Self {
        self
    }
}

impl<'de> Deserializer<'de> for Node<'de> {
    type Error = Misfit;

    fn deserialize_any<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Misfit> {
        match self.0 {
            Value::Null => visitor.visit_unit(),
            Value::Bool(flag) => visitor.visit_bool(*flag),
            Value::Number(number) => {
                if let Some(whole) = number.as_u64() {
                    visitor.visit_u64(whole)
                } else if let Some(whole) = number.as_i64() {
                    visitor.visit_i64(whole)
                } else {
                    visitor.visit_f64(number.as_f64().unwrap_or(f64::NAN))
                }
            }
            Value::String(text) => visitor.visit_borrowed_str(text),
            Value::Array(list) => {
                let mut entries = SeqDeserializer::new(list.iter().map(Node));
                let value = visitor.visit_seq(&mut entries)?;
                match entries.size_hint() {
                    Some(left) if left > 0 => {
                        let expected = format!("a list of {}", list.len() - left);
                        let found = format!("a list of {}", list.len());
                        Err(Misfit(Invalid::new("", expected, found)))
                    }
                    _ => Ok(value),
                }
            }
            Value::Object(object) => {
                let fields = object.iter().map(|(name, value)| (name.as_str(), Node(value)));
                visitor.visit_map(MapDeserializer::new(fields))
            }
        }
    }

    fn deserialize_option<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Misfit> {
        match self.0 {
            Value::Null => visitor.visit_none(),
            _ => visitor.visit_some(self),
        }
    }

    fn deserialize_newtype_struct<V: Visitor<'de>>(
        self,
        _: &'static str,
        visitor: V,
    ) -> Result<V::Value, Misfit> {
        visitor.visit_newtype_struct(self)
    }

    /// Accepts a variant's name, or an object whose only field has that name.
    fn deserialize_enum<V: Visitor<'de>>(
        self,
        _: &'static str,
        variants: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, Misfit> {
        match self.0 {
            Value::String(word) => visitor.visit_enum(StrDeserializer::new(word)),
            Value::Object(object) => {
                let fields = object.iter().map(|(name, value)| (name.as_str(), Node(value)));
                visitor.visit_enum(MapAccessDeserializer::new(MapDeserializer::new(fields)))
            }
            other => Err(Misfit(Invalid::new("", one_of(variants), found_value(other)))),
        }
    }

    forward_to_deserialize_any! {
        bool i8 i16 i32 i64 i128 u8 u16 u32 u64 u128 f32 f64 char str string bytes byte_buf unit
        unit_struct seq tuple tuple_struct map struct identifier ignored_any
    }
}

/// Maximum number of characters of an unknown name that an error shows.
const MOST_SHOWN: usize = 60;

/// Carries an [`Invalid`] through Serde.
#[derive(Debug)]
struct Misfit(Invalid);

impl fmt::Display for Misfit {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.fmt(out)
    }
}

impl core::error::Error for Misfit {}

impl serde::de::Error for Misfit {
    /// Recovers the parts of an [`Invalid`] from its text.
    fn custom<T: fmt::Display>(message: T) -> Self {
        let text = format!("{message:#}");
        let mut parts = text.splitn(3, SEPARATOR);
        Self(match (parts.next(), parts.next(), parts.next()) {
            (Some(field), Some(expected), Some(found)) => Invalid::new(field, expected, found),
            _ => Invalid::new("", text, "something else"),
        })
    }

    fn invalid_type(found: Unexpected<'_>, expected: &dyn Expected) -> Self {
        Self(Invalid::new("", expectation(expected), finding(found)))
    }

    fn invalid_value(found: Unexpected<'_>, expected: &dyn Expected) -> Self {
        Self::invalid_type(found, expected)
    }

    fn invalid_length(length: usize, expected: &dyn Expected) -> Self {
        Self(Invalid::new("", expectation(expected), format!("a list of {length}")))
    }

    fn unknown_variant(variant: &str, expected: &'static [&'static str]) -> Self {
        Self(Invalid::new("", one_of(expected), format!("{variant:?}")))
    }

    /// Leaves [`Invalid::field`] empty, because the path that is added later ends with this field.
    fn unknown_field(field: &str, expected: &'static [&'static str]) -> Self {
        let meant = did_you_mean(field, expected.iter().copied());
        let expected = format!("one of the fields {}", one_of(expected));
        let found: String = field.chars().take(MOST_SHOWN).collect();
        Self(Invalid::new("", expected, format!("{found:?}{meant}")))
    }

    fn missing_field(field: &'static str) -> Self {
        Self(Invalid::new(field, "a value", "nothing"))
    }
}

/// Describes a visitor's expectation in the document's terms, because Serde names Rust types.
fn expectation(expected: &dyn Expected) -> String {
    let expected = expected.to_string();
    let entries = ["an array of length ", "a tuple of size "];
    if let Some(count) = entries.iter().find_map(|kind| expected.strip_prefix(kind)) {
        return format!("a list of {count}");
    }
    match expected.as_str() {
        "f32" | "f64" => "a number",
        "u32" => "a whole number from 0 to 4294967295",
        "u8" | "u16" | "u64" | "usize" => "a whole number ≥ 0",
        "i8" | "i16" | "i32" | "i64" => "a whole number",
        "a boolean" => "true or false",
        "a sequence" => "a list, […]",
        "a map" => "an object, {…}",
        other if other.starts_with("struct ") => "an object, {…}",
        other => other,
    }
    .to_owned()
}

/// Describes an unexpected value as it appears in the document.
fn finding(found: Unexpected<'_>) -> String {
    match found {
        Unexpected::Bool(flag) => flag.to_string(),
        Unexpected::Unsigned(number) => number.to_string(),
        Unexpected::Signed(number) => number.to_string(),
        // 3.0 is not a whole number in TOML. If it were printed as `3`, the error would contradict
        // itself.
        Unexpected::Float(number) if number.fract() == 0.0 => format!("{number}.0"),
        Unexpected::Float(number) => number.to_string(),
        Unexpected::Str(text) => format!("{text:?}"),
        Unexpected::Unit | Unexpected::Option => "nothing".to_owned(),
        Unexpected::Seq => "a list".to_owned(),
        Unexpected::Map => "an object".to_owned(),
        other => other.to_string(),
    }
}

fn found_value(value: &Value) -> String {
    match value {
        Value::Null => "nothing".to_owned(),
        Value::Array(_) => "a list".to_owned(),
        other => other.to_string(),
    }
}

/// Joins words as in `a, b or c`.
fn one_of(words: &[&str]) -> String {
    match words {
        [] => "nothing".to_owned(),
        [only] => (*only).to_owned(),
        [first @ .., last] => format!("{} or {last}", first.join(", ")),
    }
}

/// Parses a decimal number of at most 15 digits, such as `-0.25`, to the nearest double. (The standard
/// library's parser handles every decimal, but would make the client a tenth larger.)
#[must_use]
pub fn decimal(text: &str) -> Option<f64> {
    let (sign, digits) = match text.trim().strip_prefix(['-', '−']) {
        Some(digits) => (-1.0, digits),
        None => (1.0, text.trim()),
    };
    let (whole, part) = digits.split_once('.').unwrap_or((digits, ""));
    let count = whole.len() + part.len();
    let is_number = whole.bytes().chain(part.bytes()).all(|byte| byte.is_ascii_digit());
    if !is_number || whole.is_empty() || count > 15 {
        return None;
    }
    let digit = |number: u64, byte: u8| 10 * number + u64::from(byte - b'0');
    let number = whole.bytes().chain(part.bytes()).fold(0, digit);
    // Both numbers are exact, so the quotient is the nearest double.
    let divisor = (0..part.len()).fold(1u64, |power, _| 10 * power);
    Some(sign * (number as f64 / divisor as f64))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::JointState;
    use crate::vehicle::{Pose, TurnInput};
    use proptest::prelude::*;
    use serde::Deserialize;

    #[derive(Debug, PartialEq, Deserialize)]
    #[serde(deny_unknown_fields)]
    struct Plan {
        turns: Vec<TurnInput>,
        pace: Option<Pace>,
        start: Option<JointState>,
        steps: u8,
    }

    #[derive(Debug, PartialEq, Deserialize)]
    #[serde(rename_all = "lowercase")]
    enum Pace {
        Slow,
        Fast,
        At(f64),
    }

    #[test]
    fn what_fits_is_read() {
        let text = r#"{"turns": [-1, 1], "pace": {"at": 2}, "steps": 3}"#;
        let plan = Plan {
            turns: vec![TurnInput::Right, TurnInput::Left],
            pace: Some(Pace::At(2.0)),
            start: None,
            steps: 3,
        };
        let value = serde_json::from_str(text).unwrap();
        assert_eq!(from_value::<Plan>(&value), Ok(plan));
        assert!(from_json::<Plan>(text).is_ok());
    }

    #[test]
    fn complaints_name_field_expected_and_found() {
        let said = |text: &str| from_json::<Plan>(text).unwrap_err().to_string();
        let cases = [
            (r#"{"turns": []}"#, "steps: expected a value, found nothing"),
            (
                r#"{"turns": [0, 7]}"#,
                "turns[1]: expected -1 (right), 0 (straight) or 1 (left), found 7",
            ),
            (r#"{"turns": [0.5]}"#, "turns[0]: expected a whole number, found 0.5"),
            (r#"{"steps": -1}"#, "steps: expected a whole number ≥ 0, found -1"),
            (r#"{"steps": 256}"#, "steps: expected a whole number ≥ 0, found 256"),
            (r#"{"steps": "3"}"#, "steps: expected a whole number ≥ 0, found \"3\""),
            (r#"{"steps": null}"#, "steps: expected a whole number ≥ 0, found nothing"),
            (r#"{"pace": "quick"}"#, "pace: expected slow, fast or at, found \"quick\""),
            (r#"{"pace": 3}"#, "pace: expected slow, fast or at, found 3"),
            (r#"{"turns": {}}"#, "turns: expected a list, […], found an object"),
            (
                r#"{"start": {"human": [0, 0], "robot": [0, 0, 0]}}"#,
                "start.human: expected a list of 3, found a list of 2",
            ),
            (
                r#"{"start": {"human": [0, 0, 0, 0], "robot": [0, 0, 0]}}"#,
                "start.human: expected a list of 3, found a list of 4",
            ),
            (
                r#"{"start": {"human": [0, "x", 0], "robot": [0, 0, 0]}}"#,
                "start.human[1]: expected a number, found \"x\"",
            ),
            (r#"{"start": "here"}"#, "start: expected an object, {…}, found \"here\""),
            (
                r#"{"stops": 3}"#,
                "stops: expected one of the fields turns, pace, start or steps, found \"stops\"; did \
                 you mean steps?",
            ),
            (
                r#"{"velocity": 3}"#,
                "velocity: expected one of the fields turns, pace, start or steps, found \"velocity\"",
            ),
            ("3", "expected an object, {…}, found 3"),
            (
                r#"{"steps": 1e999}"#,
                "steps: expected a number that a double can hold, found one that is too large",
            ),
        ];
        for (text, expected) in cases {
            assert_eq!(said(text), expected, "{text}");
        }
        let list = object_from_json::<Plan>(" [[], null, null, 3]").unwrap_err().to_string();
        assert_eq!(list, "expected an object, {…}, found a list");
        let twice = said(r#"{"turns": [], "steps": 1, "steps": 1}"#);
        assert!(twice.starts_with("expected each field once, found "), "{twice}");
    }

    #[test]
    fn a_text_that_is_not_json_is_told_before_its_shape() {
        let check = |text: &str, words: &str| match from_json::<Pose>(text) {
            Err(Unread::NotJson(said)) => assert!(said.contains(words), "{said}"),
            other => panic!("{text}: {other:?}"),
        };
        check("[\"x\"", "line 1 column");
        check("[0, 0, 0] x", "line 1 column");
        check("NaN", "line 1 column");
        check(r#""\ud800""#, "hex escape");
        check(r#"{"\udc00": 1e999}"#, "hex escape");
        check(&"[".repeat(100_000), "nested more than 64 deep");
        let brackets_in_text = format!("\"{}\\\"[\"", "[".repeat(100));
        assert_eq!(from_json::<String>(&brackets_in_text).map(|text| text.len()), Ok(102));
    }

    #[test]
    fn decimals_are_read_as_the_standard_library_reads_them() {
        for text in ["0", "3.4", "-0.25", "123456789.012345", "0.000001", "7.", "00.10"] {
            assert_eq!(decimal(text), text.parse().ok(), "{text}");
        }
        assert_eq!(decimal(" −1.5 "), Some(-1.5));
        for text in ["", "-", ".", ".5", "1e3", "NaN", "inf", "1,2", "+1", "1234567890123456", "٣"]
        {
            assert_eq!(decimal(text), None, "{text}");
        }
    }

    proptest! {
        #[test]
        fn decimals_of_any_digits(digits in 0u64..1_000_000_000_000_000, places in 0usize..15) {
            let digits = format!("{digits:015}");
            let text = format!("{}.{}", &digits[..15 - places], &digits[15 - places..]);
            prop_assert_eq!(decimal(&text), text.parse().ok());
        }
    }
}
