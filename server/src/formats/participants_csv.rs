//! The participants of a study as a CSV file, and the meaning of every column of an export.

use super::exports::text;
use super::trials_csv::COLUMNS;
use crate::store::roster::RosterEntry;
use serde::Serialize;
use serde_json::Value;
use sidestep::study::{Question, QuestionKind, StudyConfig};
use std::collections::BTreeSet;

/// A column of an exported file.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Column {
    /// The file.
    pub file: &'static str,
    /// The column's name.
    pub name: String,
    /// What its values are: `number`, `whole number`, `text`, `word` or `hash`.
    #[serde(rename = "type")]
    pub kind: &'static str,
    /// The unit of a number that has one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub unit: Option<&'static str>,
    /// The values that occur, if they are few or bounded.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub range: Option<String>,
    /// What a value means.
    pub meaning: String,
}

type Fixed = (&'static str, &'static str, &'static str, &'static str);

/// Name, type, unit and meaning of the columns of participants.csv that every study has.
const FIXED: [Fixed; 22] = [
    ("participant", "whole number", "", "the participant's number in the study, from 1"),
    ("participant_id", "word", "", "the participant's id on the server"),
    ("external_id", "text", "", "the recruiting service's id of the person, as it came"),
    ("place", "whole number", "", "place in the study's design, from 0; it decides the scenes"),
    ("configuration", "hash", "", "SHA-256 of the study's configuration at the enrolment"),
    ("imported", "whole number", "", "1 if the trials were read from a file, else 0"),
    ("consent_language", "word", "", "language of the text that the participant agreed to"),
    ("consent_hash", "hash", "", "SHA-256 of the text and facts that the participant agreed to"),
    ("enrolled_at_ms", "whole number", "ms since 1970", "when the participant enrolled"),
    ("last_seen_at_ms", "whole number", "ms since 1970", "when the server last stored something"),
    ("understood_at_ms", "whole number", "ms since 1970", "when the check was passed"),
    ("screened_out_at_ms", "whole number", "ms since 1970", "when wrong answers ended it"),
    ("answered_at_ms", "whole number", "ms since 1970", "when the questions were answered"),
    ("completed_at_ms", "whole number", "ms since 1970", "when the participation was completed"),
    ("withdrawn_at_ms", "whole number", "ms since 1970", "when the participant withdrew"),
    ("comprehension_attempts", "whole number", "", "how often the check was answered"),
    ("completion_code", "word", "", "the code that the participant was given"),
    ("data_deleted", "whole number", "", "1 if the participant had their data deleted, else 0"),
    ("familiarisation", "whole number", "", "stored trials of familiarisation"),
    ("practice", "whole number", "", "stored practice trials"),
    ("task", "whole number", "", "stored tasks, further attempts included"),
    ("study", "word", "", "name of the study in addresses"),
];

/// Name, type, unit and meaning of the columns of trials.csv.
const TRIALS: [Fixed; COLUMNS.len()] = [
    ("participant", "whole number", "", "as in participants.csv"),
    ("trial", "whole number", "", "number of the trial among all of the participant, from 0"),
    ("step", "whole number", "", "number of the step in the trial, from 0"),
    ("t", "number", "s", "time of the step's start after the scene's start"),
    ("hx", "number", "m", "human's position before the step, world frame, x to the right"),
    ("hy", "number", "m", "human's position before the step, world frame, y up"),
    ("hpsi", "number", "rad", "human's heading before the step, counter-clockwise from +x"),
    ("rx", "number", "m", "robot's position before the step, world frame, x to the right"),
    ("ry", "number", "m", "robot's position before the step, world frame, y up"),
    ("rpsi", "number", "rad", "robot's heading before the step, counter-clockwise from +x"),
    ("omega", "number", "rad/s", "turn rate held in the step; positive turns left"),
    ("study", "word", "", "name of the study in addresses"),
    ("phase", "word", "", "familiarisation, practice or task; only tasks are analysed"),
    ("phase_index", "whole number", "", "place of the scene within its phase, from 0"),
    ("attempt", "whole number", "", "1; 2 if the scene was driven again after an interruption"),
    ("trial_id", "word", "", "the trial's id on the server"),
    ("participant_id", "word", "", "as in participants.csv"),
    ("flags", "word", "", "what an analyst should know, words joined by semicolons"),
    ("started_at_ms", "number", "ms since 1970", "start of the scene by the participant's clock"),
    ("sampled_at_ms", "number", "ms", "when the step's input was sampled, after the scene's start"),
    ("received_at_ms", "whole number", "ms since 1970", "when the server stored the trial"),
    ("synthetic", "whole number", "", "1 if a program drove, else 0"),
    ("due_at_ms", "number", "ms", "when the step's input was due, after the scene's start"),
    ("exposures", "whole number", "", "how often the scene was shown, this time included"),
];

/// The columns of the link's parameters and of the answers.
struct Extra {
    parameters: Vec<String>,
    answers: Vec<String>,
}

impl Extra {
    /// Those of the present configuration in its order, then others that participants have.
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

/// The file: a row for each participant.
///
/// # Errors
/// [`csv::Error`] if a row cannot be written.
pub fn participants_csv(study: &StudyConfig, people: &[RosterEntry]) -> csv::Result<Vec<u8>> {
    let extra = Extra::of(study, people);
    let mut writer = csv::Writer::from_writer(Vec::new());
    for (name, ..) in &FIXED {
        writer.write_field(name)?;
    }
    for name in &extra.parameters {
        writer.write_field(format!("parameter_{name}"))?;
    }
    for name in &extra.answers {
        writer.write_field(format!("answer_{name}"))?;
    }
    writer.write_record(None::<&[u8]>)?;
    for person in people {
        let flag = |set: bool| if set { "1" } else { "0" }.to_owned();
        let number = |number: Option<i64>| number.map(|n| n.to_string()).unwrap_or_default();
        let word = |word: &Option<String>| word.as_deref().map(text).unwrap_or_default();
        let mut fields = vec![
            person.number.to_string(),
            person.id.clone(),
            word(&person.external_id),
            number(person.place),
            person.config_hash.clone(),
            flag(person.imported),
            word(&person.consent[0]),
            word(&person.consent[1]),
        ];
        fields.extend(person.times_ms.map(number));
        fields.push(person.comprehension_attempts.to_string());
        fields.push(word(&person.completion_code));
        fields.push(flag(person.data_deleted));
        fields.extend(person.trials.map(|count| count.to_string()));
        fields.push(text(&study.slug));
        let parameters = extra
            .parameters
            .iter()
            .map(|name| person.parameters.get(name).map(|value| text(value)).unwrap_or_default());
        fields.extend(parameters);
        fields.extend(extra.answers.iter().map(|name| match person.answers.get(name) {
            None | Some(Value::Null) => String::new(),
            Some(Value::String(answer)) => text(answer),
            Some(other) => other.to_string(),
        }));
        writer.write_record(&fields)?;
    }
    writer.into_inner().map_err(|error| error.into_error().into())
}

/// The meaning of every column of an export's files.
#[must_use]
pub fn dictionary(study: &StudyConfig, people: &[RosterEntry]) -> Vec<Column> {
    let fixed = |file, (name, kind, unit, meaning): Fixed| Column {
        file,
        name: name.to_owned(),
        kind,
        unit: (!unit.is_empty()).then_some(unit),
        range: None,
        meaning: meaning.to_owned(),
    };
    let mut columns: Vec<_> = TRIALS.iter().map(|&column| fixed("trials.csv", column)).collect();
    columns.extend(FIXED.iter().map(|&column| fixed("participants.csv", column)));
    let extra = Extra::of(study, people);
    let file = "participants.csv";
    columns.extend(extra.parameters.iter().map(|name| Column {
        file,
        name: format!("parameter_{name}"),
        kind: "text",
        unit: None,
        range: None,
        meaning: format!("the parameter {name} of the link that the participant opened"),
    }));
    columns.extend(extra.answers.iter().map(|name| {
        let question = study.questions.iter().find(|question| question.name == *name);
        let (kind, range) = question.map_or(("text", None), kind_of);
        let words = question.map(|question| {
            let language = study.first_language();
            format!("answer to: {}", question.text.get(language, language))
        });
        let earlier = || "answer to a question of an earlier configuration".to_owned();
        let meaning = words.unwrap_or_else(earlier);
        Column { file, name: format!("answer_{name}"), kind, unit: None, range, meaning }
    }));
    columns
}

fn kind_of(question: &Question) -> (&'static str, Option<String>) {
    match question.kind {
        QuestionKind::Text => ("text", None),
        QuestionKind::Choice => {
            let values: Vec<_> = question.options.iter().map(|o| o.value.as_str()).collect();
            ("word", Some(values.join(", ")))
        }
        QuestionKind::Scale => {
            ("whole number", Some(format!("{} to {}", question.from, question.to)))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_column_of_trials_has_a_meaning() {
        assert_eq!(TRIALS.map(|(name, ..)| name), COLUMNS);
    }
}
