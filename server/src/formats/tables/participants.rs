//! The table with a row for each participant: who they are, what they did and when, and what they answered.

use crate::formats::table::Kind::{Hash, Text, Whole, Word};
use crate::formats::table::{Batch, Column, Kind};
use crate::store::roster::RosterEntry;
use serde_json::Value;
use sidestep::study::{Question, QuestionKind, StudyConfig};
use sidestep::trial::Flag;
use std::collections::BTreeSet;

/// Name, kind, unit and meaning of the columns that exist in every study.
const FIXED: [(&str, Kind, &str, &str); 26] = [
    ("participant", Whole, "", "the participant's number in the study, from 1"),
    ("participant_id", Word, "", "the participant's id on the server"),
    ("external_id", Text, "", "the recruiting service's id of the person, as it came"),
    ("place", Whole, "", "place in the study's design, from 0; it decides the scenes"),
    ("configuration", Hash, "", "SHA-256 of the study's configuration at the enrolment"),
    ("imported", Whole, "", "1 if the trials were read from a file, else 0"),
    ("consent_language", Word, "", "language of the text that the participant agreed to"),
    ("consent_hash", Hash, "", "SHA-256 of the text and facts that the participant agreed to"),
    ("enrolled_at_ms", Whole, "ms since 1970", "when the participant enrolled"),
    (
        "last_seen_at_ms",
        Whole,
        "ms since 1970",
        "when the server last stored data of the participant, or they returned",
    ),
    ("understood_at_ms", Whole, "ms since 1970", "when the check was passed"),
    ("screened_out_at_ms", Whole, "ms since 1970", "when wrong answers ended the participation"),
    ("answered_at_ms", Whole, "ms since 1970", "when the questions were answered"),
    ("completed_at_ms", Whole, "ms since 1970", "when the participation was completed"),
    ("withdrawn_at_ms", Whole, "ms since 1970", "when the participant withdrew"),
    ("comprehension_attempts", Whole, "", "how often the check was answered"),
    ("completion_code", Word, "", "the code that the participant was given"),
    ("data_deleted", Whole, "", "1 if the participant had their data deleted, else 0"),
    ("familiarisation", Whole, "", "stored trials of familiarisation"),
    ("practice", Whole, "", "stored practice trials"),
    ("task", Whole, "", "stored tasks, further attempts included"),
    ("study", Word, "", "name of the study in addresses"),
    ("excluded_at_ms", Whole, "ms since 1970", "when an experimenter excluded the participant"),
    ("exclusion_reason", Text, "", "why analyses leave the participant out; empty if they do not"),
    (
        "synthetic",
        Whole,
        "",
        "1 if the study takes programs and no people, else 0; pilots may be people",
    ),
    (
        "flags",
        Word,
        "",
        "replaced_characters if an answer or parameter held a character that no file can hold, with U+FFFD in its place",
    ),
];

/// The columns that depend on the study: the names of recruitment parameters, and the names of
/// answers.
#[derive(Debug)]
struct Extra {
    parameters: Vec<String>,
    answers: Vec<String>,
}

impl Extra {
    /// The names in the present configuration, in its order, followed by further names that occur in
    /// the data.
    fn of(study: &StudyConfig, people: &[RosterEntry]) -> Self {
        let joined = |known: Vec<String>, found: BTreeSet<&String>| {
            let more = found.into_iter().filter(|name| !known.contains(name)).cloned();
            let more: Vec<_> = more.collect();
            [known, more].concat()
        };
        let questions = study.questions.iter().map(|question| question.name.clone()).collect();
        Self {
            parameters: joined(
                study.recruitment.record.clone(),
                people.iter().flat_map(|person| person.parameters.keys()).collect(),
            ),
            answers: joined(
                questions,
                people.iter().flat_map(|person| person.answers.keys()).collect(),
            ),
        }
    }
}

/// The participants of a study, as a table.
#[derive(Debug)]
pub struct Participants<'a> {
    study: &'a StudyConfig,
    people: &'a [RosterEntry],
    extra: Extra,
}

impl<'a> Participants<'a> {
    /// The table of these people. It has columns for the parameters and answers of the study's present
    /// configuration, followed by columns for parameters and answers of earlier configurations.
    #[must_use]
    pub fn new(study: &'a StudyConfig, people: &'a [RosterEntry]) -> Self {
        Self { study, people, extra: Extra::of(study, people) }
    }

    /// The columns.
    #[must_use]
    pub fn columns(&self) -> Vec<Column> {
        let fixed =
            |&(name, kind, unit, meaning): &(&'static str, Kind, &'static str, &'static str)| {
                let column = Column::new(name, kind, meaning);
                if unit.is_empty() { column } else { column.unit(unit) }
            };
        let parameter = |name: &String| {
            let meaning = format!("the parameter {name} of the link that the participant opened");
            Column::new(format!("parameter_{name}"), Text, meaning)
        };
        let answer = |name: &String| {
            let question = self.study.questions.iter().find(|question| question.name == *name);
            let (mut kind, range) = question.map_or((Text, None), kind_of);
            // An earlier configuration might have asked a different question under the same name.
            let is_number = |answer: &Value| answer.is_null() || answer.is_i64();
            let mut answers = self.people.iter().filter_map(|person| person.answers.get(name));
            if kind == Whole && !answers.all(is_number) {
                kind = Text;
            }
            let words = question.map(|question| {
                let language = self.study.first_language();
                format!("answer to: {}", question.text.get(language, language))
            });
            let earlier = || "answer to a question of an earlier configuration".to_owned();
            let column = Column::new(format!("answer_{name}"), kind, words.unwrap_or_else(earlier));
            Column { range: range.map(Into::into), ..column }
        };
        let fixed = FIXED.iter().map(fixed);
        let extra = self.extra.parameters.iter().map(parameter);
        fixed.chain(extra).chain(self.extra.answers.iter().map(answer)).collect()
    }

    /// All rows.
    #[must_use]
    pub fn rows(&self) -> Batch {
        let columns = self.columns();
        let mut batch = Batch::new(&columns);
        for person in self.people {
            let mut row = batch.add(1);
            row.whole(|_| Some(person.number));
            row.text(&*person.id);
            row.text(person.external_id.as_deref());
            row.whole(|_| person.place);
            row.text(&*person.config_hash);
            row.whole(|_| Some(i64::from(person.imported)));
            row.text(person.consent[0].as_deref());
            row.text(person.consent[1].as_deref());
            for time in person.times_ms {
                row.whole(|_| time);
            }
            row.whole(|_| Some(person.comprehension_attempts));
            row.text(person.completion_code.as_deref());
            row.whole(|_| Some(i64::from(person.data_deleted)));
            for count in person.trials {
                row.whole(|_| Some(count));
            }
            row.text(&*self.study.slug);
            row.whole(|_| person.exclusion.as_ref().map(|(at_ms, _)| *at_ms));
            row.text(person.exclusion.as_ref().map(|(_, reason)| reason.as_str()));
            row.whole(|_| Some(i64::from(self.study.synthetic)));
            row.text(if is_replaced(person) { Flag::ReplacedCharacters.word() } else { "" });
            for name in &self.extra.parameters {
                row.text(person.parameters.get(name).map(String::as_str));
            }
            let answers = &columns[FIXED.len() + self.extra.parameters.len()..];
            for (name, column) in self.extra.answers.iter().zip(answers) {
                let answer = person.answers.get(name);
                if column.kind == Whole {
                    row.whole(|_| answer.and_then(Value::as_i64));
                    continue;
                }
                match answer {
                    None | Some(Value::Null) => row.text(None),
                    Some(Value::String(answer)) => row.text(&**answer),
                    Some(other) => row.text(&*other.to_string()),
                }
            }
        }
        batch
    }
}

/// Whether a text of this person contains U+FFFD, which replaces characters that a file cannot contain.
fn is_replaced(person: &RosterEntry) -> bool {
    let answers = person.answers.values().filter_map(Value::as_str);
    let mut texts = answers.chain(person.parameters.values().map(String::as_str));
    texts.any(|text| text.contains(char::REPLACEMENT_CHARACTER))
}

fn kind_of(question: &Question) -> (Kind, Option<String>) {
    match question.kind {
        QuestionKind::Text => (Text, None),
        QuestionKind::Choice => {
            let values: Vec<_> = question.options.iter().map(|o| o.value.as_str()).collect();
            (Word, Some(values.join(", ")))
        }
        QuestionKind::Scale => (Whole, Some(format!("{} to {}", question.from, question.to))),
    }
}
