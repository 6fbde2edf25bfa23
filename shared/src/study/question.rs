//! Questions after the last scene, with typed answers.

use super::localised::Localised;
use super::protocol::MAX_SENTENCE;
use crate::invalid::Invalid;
use serde::{Deserialize, Serialize};
use serde_json::Value;

/// Type of an answer.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case")]
pub enum QuestionKind {
    /// Free text.
    Text,
    /// One of several options.
    Choice,
    /// A whole number on a scale.
    Scale,
}

/// A question after the last scene.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Question {
    /// Name of the column in exports: lower-case letters, digits and underscores.
    pub name: String,
    /// Type of the answer.
    pub kind: QuestionKind,
    /// The question, by language.
    pub text: Localised,
    /// Whether the participant must answer. Default: false.
    #[serde(default)]
    pub required: bool,
    /// Options of a choice: 2 to 30.
    #[serde(default)]
    pub options: Vec<Choice>,
    /// Lowest number of a scale. Default: 1.
    #[serde(default = "one")]
    pub from: i64,
    /// Highest number of a scale; at most 20 above the lowest. Default: 7.
    #[serde(default = "seven")]
    pub to: i64,
    /// Label of the lowest number of a scale, by language.
    #[serde(default)]
    pub low: Localised,
    /// Label of the highest number of a scale, by language.
    #[serde(default)]
    pub high: Localised,
    /// Maximum length of a text (characters), 1 to 10000. Default: 2000.
    #[serde(default = "two_thousand")]
    pub max_chars: usize,
}

/// An option of a choice.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Choice {
    /// The value in exports: lower-case letters, digits and underscores.
    pub value: String,
    /// The option's text, by language.
    pub text: Localised,
}

fn one() -> i64 {
    1
}

fn seven() -> i64 {
    7
}

fn two_thousand() -> usize {
    2000
}

impl Question {
    pub(super) fn check(&self) -> Result<(), Invalid> {
        check_word("name", &self.name)?;
        self.text.check_given("text", MAX_SENTENCE)?;
        match self.kind {
            QuestionKind::Text => {
                if !(1..=10_000).contains(&self.max_chars) {
                    let expected = "a whole number from 1 to 10000";
                    return Err(Invalid::new("max_chars", expected, self.max_chars));
                }
            }
            QuestionKind::Choice => {
                if !(2..=30).contains(&self.options.len()) {
                    return Err(Invalid::new("options", "2 to 30 options", self.options.len()));
                }
                for (i, option) in self.options.iter().enumerate() {
                    let within = |error: Invalid| error.within(&format!("options[{i}]"));
                    check_word("value", &option.value).map_err(within)?;
                    option.text.check_given("text", MAX_SENTENCE).map_err(within)?;
                    if self.options[..i].iter().any(|other| other.value == option.value) {
                        return Err(within(Invalid::new("value", "a new value", &option.value)));
                    }
                    let others = self.options[..i].iter().map(|other| &other.text);
                    option.text.check_new("text", others).map_err(within)?;
                }
            }
            QuestionKind::Scale => {
                if !(-1000..=1000).contains(&self.from) {
                    let expected = "a whole number from -1000 to 1000";
                    return Err(Invalid::new("from", expected, self.from));
                }
                if !(1..=20).contains(&self.to.saturating_sub(self.from)) {
                    let expected = format!("a number 1 to 20 above from ({})", self.from);
                    return Err(Invalid::new("to", expected, self.to));
                }
                self.low.check("low", MAX_SENTENCE)?;
                self.high.check("high", MAX_SENTENCE)?;
            }
        }
        self.check_unused()
    }

    /// Rejects fields that belong to another kind of question and would therefore have no effect.
    fn check_unused(&self) -> Result<(), Invalid> {
        use QuestionKind::{Choice, Scale, Text};
        let fields = [
            ("options", Choice, !self.options.is_empty()),
            ("from", Scale, self.from != one()),
            ("to", Scale, self.to != seven()),
            ("low", Scale, !self.low.is_empty()),
            ("high", Scale, !self.high.is_empty()),
            ("max_chars", Text, self.max_chars != two_thousand()),
        ];
        let word = |kind| match kind {
            Text => "text",
            Choice => "choice",
            Scale => "scale",
        };
        match fields.into_iter().find(|(_, kind, given)| *given && *kind != self.kind) {
            None => Ok(()),
            Some((field, kind, _)) => {
                let expected = format!("this field for kind = \"{}\" only", word(kind));
                let found = format!("kind = \"{}\"", word(self.kind));
                Err(Invalid::new(field, expected, found))
            }
        }
    }

    /// Checks that an answer fits this question: a string for a text, an option's value for a
    /// choice, a whole number for a scale.
    ///
    /// # Errors
    /// [`Invalid`] naming the question.
    pub fn check_answer(&self, answer: &Value) -> Result<(), Invalid> {
        let refuse = |expected: String, found: String| {
            Err(Invalid::new(format!("answers.{}", self.name), expected, found))
        };
        match (self.kind, answer) {
            (QuestionKind::Text, Value::String(text)) => {
                let count = text.chars().count();
                if count > self.max_chars {
                    let expected = format!("at most {} characters", self.max_chars);
                    return refuse(expected, count.to_string());
                }
                let is_hidden = |c: char| c.is_control() && !matches!(c, '\n' | '\r' | '\t');
                if text.chars().any(is_hidden) {
                    let expected = "no control characters except line breaks";
                    return refuse(expected.to_owned(), "a control character".to_owned());
                }
                Ok(())
            }
            (QuestionKind::Choice, Value::String(value))
                if self.options.iter().any(|option| option.value == *value) =>
            {
                Ok(())
            }
            (QuestionKind::Scale, Value::Number(number))
                if number.as_i64().is_some_and(|n| (self.from..=self.to).contains(&n)) =>
            {
                Ok(())
            }
            (kind, _) => {
                let expected = match kind {
                    QuestionKind::Text => "a text".to_owned(),
                    QuestionKind::Choice => "the value of an option".to_owned(),
                    QuestionKind::Scale => {
                        format!("a whole number from {} to {}", self.from, self.to)
                    }
                };
                // The error does not repeat the answer, which may be personal.
                let found = match answer {
                    Value::Null => "null",
                    Value::Bool(_) => "true or false",
                    Value::Number(_) => "another number",
                    Value::String(_) => "another text",
                    Value::Array(_) => "a list",
                    Value::Object(_) => "an object",
                };
                refuse(expected, found.to_owned())
            }
        }
    }
}

/// Checks that a word can be a column name or a value in exports.
fn check_word(field: &str, word: &str) -> Result<(), Invalid> {
    let fits = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '_';
    if !(1..=40).contains(&word.len()) || !word.chars().all(fits) {
        let expected = "1 to 40 lower-case letters, digits and underscores";
        return Err(Invalid::new(field, expected, format!("{word:?}")));
    }
    Ok(())
}
