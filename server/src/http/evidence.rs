//! Request bodies with records from a participant's browser. These records are evidence, so they are
//! stored whatever they contain.

use crate::http::error::ApiError;
use crate::http::json::{self, JsonBody};
use crate::http::openapi::operation::{Input, Operation};
use crate::http::openapi::schemas::Schemas;
use axum::extract::{FromRequest, Request};
use schemars::JsonSchema;
use serde::de::DeserializeOwned;
use std::borrow::Cow;

/// A [`JsonBody`] in which U+FFFD replaces each character that a database or file cannot contain:
/// control characters other than tab and line ends, and unpaired surrogates ("\ud800").
/// Participants who type or paste such a character must not be rejected.
pub struct EvidenceBody<T>(pub T);

impl<T: DeserializeOwned, S: Send + Sync> FromRequest<S> for EvidenceBody<T> {
    type Rejection = ApiError;

    async fn from_request(request: Request, _: &S) -> Result<Self, ApiError> {
        let bytes = json::body(request).await?;
        match std::str::from_utf8(&bytes) {
            Ok(text) => json::parse(legible(text).as_bytes()).map(Self),
            // Report the same error as for any other body.
            Err(_) => json::parse(&bytes).map(Self),
        }
    }
}

impl<T: JsonSchema> Input for EvidenceBody<T> {
    fn describe(operation: &mut Operation, schemas: &mut Schemas) {
        JsonBody::<T>::describe(operation, schemas);
    }
}

/// The JSON text, with U+FFFD instead of those characters in its strings that a file cannot
/// contain. Invalid JSON stays invalid.
fn legible(text: &str) -> Cow<'_, str> {
    // Only a backslash (for escapes), DEL, and the first byte of U+0080 to U+009F can begin such a
    // character. Most bodies contain none of these bytes.
    if memchr::memchr3(b'\\', 0x7f, 0xc2, text.as_bytes()).is_none() {
        return Cow::Borrowed(text);
    }
    let mut found = String::with_capacity(text.len());
    let (mut rest, mut in_string) = (text, false);
    while let Some(next) = rest.chars().next() {
        let length = if in_string && next == '\\' { escape_length(rest) } else { next.len_utf8() };
        let (piece, after) = rest.split_at(length);
        in_string ^= next == '"';
        let is_hidden = match next {
            '\\' => is_hidden_escape(piece),
            // JSON with any other unescaped control character is invalid.
            other => other >= '\u{7f}' && is_hidden(other.into()),
        };
        found.push_str(if in_string && is_hidden { "\u{fffd}" } else { piece });
        rest = after;
    }
    Cow::Owned(found)
}

/// Length of the escape at the start of a text (bytes). For a surrogate pair, the length of both escapes.
fn escape_length(text: &str) -> usize {
    let one = |text: &str| match text.as_bytes().get(1) {
        Some(b'u') => code(text).map(|code| (6, code)),
        _ => None,
    };
    match one(text) {
        Some((length, 0xd800..0xdc00)) => match one(&text[length..]) {
            Some((second, 0xdc00..0xe000)) if text[length..].starts_with('\\') => length + second,
            _ => length,
        },
        Some((length, _)) => length,
        // A backslash and the next character.
        None => text.chars().take(2).map(char::len_utf8).sum(),
    }
}

/// The code in `\uXXXX` at the start of a text.
fn code(text: &str) -> Option<u32> {
    let digits = text.get(2..6)?;
    let is_hex = digits.bytes().all(|digit| digit.is_ascii_hexdigit());
    is_hex.then(|| u32::from_str_radix(digits, 16).ok()).flatten()
}

/// Whether an escape is a character that a file cannot contain.
fn is_hidden_escape(escape: &str) -> bool {
    match escape.as_bytes().get(1) {
        Some(b'b' | b'f') => true,
        // The escapes of a surrogate pair are twice as long.
        Some(b'u') if escape.len() == 6 => code(escape).is_some_and(is_hidden),
        _ => false,
    }
}

/// Whether a file cannot contain the character with this code: a control character other than tab
/// and line ends, or an unpaired surrogate.
fn is_hidden(code: u32) -> bool {
    match char::from_u32(code) {
        Some(c) => c.is_control() && !matches!(c, '\t' | '\n' | '\r'),
        None => true,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn what_no_file_can_hold_is_replaced_and_nothing_else() {
        let same = [
            r#"{"a":1}"#,
            r#""plain""#,
            r#""\n\t\r\"\\\/ \u00e4 \u000a""#,
            r#""\ud83d\ude00""#,
            r#""\\u0000 \\ud800""#,
            "\"\u{e4}\u{a0}\u{fffd}\"",
            // Invalid JSON is unchanged, so that the parser reports it.
            r#""\"#,
            r#""\u12"#,
            r#""\u+123""#,
            r#"\u0000"#,
            "\u{7f}",
            "\"\u{1}\\n\"",
        ];
        for text in same {
            assert_eq!(legible(text), text);
        }
        for (text, expected) in [
            (r#""\u0000""#, "\"\u{fffd}\""),
            (r#"{"\ud800":"a\udc00b"}"#, "{\"\u{fffd}\":\"a\u{fffd}b\"}"),
            // The first high surrogate is unpaired. The second one is part of a pair.
            (r#""\ud83d\ud83d\ude00""#, "\"\u{fffd}\\ud83d\\ude00\""),
            (r#""\ud83dxude00""#, "\"\u{fffd}xude00\""),
            (r#""\ude00\ud83d""#, "\"\u{fffd}\u{fffd}\""),
            (r#""\b\f\u001F\u007f\u0085""#, "\"\u{fffd}\u{fffd}\u{fffd}\u{fffd}\u{fffd}\""),
            ("\"\u{7f}\u{80}\"", "\"\u{fffd}\u{fffd}\""),
            (r#""\\\ud800""#, "\"\\\\\u{fffd}\""),
        ] {
            assert_eq!(legible(text), expected, "{text}");
        }
    }

    proptest! {
        /// Tests arbitrary browser strings, which consist of 16-bit units. The units are written as
        /// JSON.stringify writes them, or as escapes.
        #[test]
        fn every_string_of_a_browser_is_read(units in prop::collection::vec(
            prop_oneof![0u16..0x100, 0xd7f0u16..0xe010, any::<u16>()], 0..40), escaped in any::<bool>()) {
            let expected: String = char::decode_utf16(units.iter().copied())
                .map(|unit| unit.ok().filter(|c| !is_hidden(u32::from(*c))).unwrap_or('\u{fffd}'))
                .collect();
            let mut text = "\"".to_owned();
            for unit in char::decode_utf16(units.iter().copied()) {
                match unit {
                    Ok(c) if !escaped => {
                        let json = serde_json::to_string(&c.to_string()).unwrap();
                        text += &json[1..json.len() - 1];
                    }
                    Ok(c) => {
                        let mut pair = [0; 2];
                        for unit in c.encode_utf16(&mut pair) {
                            text += &format!("\\u{unit:04x}");
                        }
                    }
                    Err(half) => text += &format!("\\u{:04X}", half.unpaired_surrogate()),
                }
            }
            text.push('"');
            prop_assert_eq!(serde_json::from_str::<String>(&legible(&text)).unwrap(), expected);
        }

        #[test]
        fn no_text_is_too_odd(text in ".{0,40}", cut in 0usize..40) {
            legible(&text);
            let json = serde_json::to_string(&text).unwrap();
            let cut = json.floor_char_boundary(cut);
            legible(&json[..cut]);
        }
    }
}
