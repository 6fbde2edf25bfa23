//! Synthetic participants through the HTTP interface, as real ones take part.

use super::super::{CommandError, print_json};
use super::{FlagCounts, SimulateArgs, bar};
use crate::client::Client;
use crate::clock::now_ms;
use indicatif::ProgressBar;
use serde_json::{Value, json};
use sidestep::api::{
    Answers, ComprehensionResult, Enrolment, KeyEvent, Object, QuestionForm, SCHEMA_VERSION,
    StudyInfo, Texts, TrialUpload,
};
use sidestep::scene::SceneParameters;
use sidestep::study::{QuestionKind, StudyConfig};
use sidestep::synthetic::{KeyChange, Keys, SyntheticDrive, SyntheticParticipant};
use sidestep::trial::Phase;
use sidestep::vehicle::TurnInput;
use std::collections::HashSet;

/// Lets everyone take part, one after the other, and prints the summary.
pub(super) async fn take_part(args: &SimulateArgs, url: &str) -> Result<(), CommandError> {
    let bad = |flag: &str, expected: &str, found: &str| {
        CommandError::Input(format!("--{flag}: expected {expected}, found {found}"))
    };
    if args.keys() != Keys::Clock {
        let expected = "clock with --url, since a study samples keys at each step's beginning";
        return Err(bad("keys", expected, "free"));
    }
    let wanted = StudyConfig { slug: args.study.clone(), ..StudyConfig::default() };
    wanted.check().map_err(|e| bad("study", &e.expected, &e.found))?;
    let server = Client::at(url)
        .ok_or_else(|| bad("url", "an address such as http://127.0.0.1:8080", url))?
        .map_err(CommandError::failure)?;
    let study = study(&server, &args.study).await?;
    let mut done = Done {
        most: args.tasks.unwrap_or(u64::MAX),
        bar: bar(0),
        trials: 0,
        already_stored: 0,
        flags: FlagCounts::default(),
    };
    for number in 0..args.participants {
        let person = SyntheticParticipant::new(args.seed, number);
        let name = format!("synthetic-{}-{number}", args.seed);
        done.person(&server, &study, &person, name, args.participants).await?;
    }
    done.bar.finish_and_clear();
    print_json(&json!({
        "synthetic": true,
        "participants": args.participants,
        "trials": done.trials,
        "already_stored": done.already_stored,
        "flags": done.flags,
        "url": url,
        "study": args.study,
    }))
}

/// What has been done so far.
struct Done {
    /// Tasks of each person, at the most.
    most: u64,
    bar: ProgressBar,
    /// Stored now or before.
    trials: u64,
    already_stored: u64,
    /// Of what was stored now.
    flags: FlagCounts,
}

impl Done {
    /// From enrolment to completion, or to the last task that is wanted; what the server has
    /// already is not sent again.
    async fn person(
        &mut self,
        server: &Client,
        study: &StudyInfo,
        person: &SyntheticParticipant,
        name: String,
        people: u64,
    ) -> Result<(), CommandError> {
        let body = Enrolment {
            consent: true,
            external_id: Some(name),
            parameters: Object::default(),
            pilot: false,
            request_id: None,
            locale: Some("en".to_owned()),
            screen: Some(synthetic()),
        };
        let me = server.enrol(&study.slug, &body).await?;
        let known = me.progress().await?;
        if !known.understood {
            me.check_understanding(&ComprehensionResult { attempts: 1, passed: true }).await?;
        }
        let stored: HashSet<String> = known.stored.into_iter().collect();
        let mut tasks = 0;
        // Numbers count all phases, whatever is left out.
        let wanted: Vec<_> = (0..)
            .zip(me.plan().scenes())
            .filter(|(_, (phase, _))| {
                tasks += u64::from(phase.phase == Phase::Task);
                phase.phase != Phase::Task || tasks <= self.most
            })
            .collect();
        let all = wanted.len() == me.plan().scenes().count();
        self.bar.set_length(people * wanted.len() as u64);
        for (trial, (_, planned)) in wanted {
            if stored.contains(&planned.trial_id) {
                self.already_stored += 1;
            } else {
                let scene = planned.scene();
                let drive = person.drive(trial, &study.parameters, &scene, Keys::Clock);
                self.flags.count(&study.parameters, &scene, &drive);
                me.store(&planned.trial_id, &upload(&study.parameters, drive)).await?;
            }
            self.trials += 1;
            self.bar.inc(1);
        }
        if all && !known.answered {
            me.answer(&answers(&server.texts(&study.slug, "en").await?)).await?;
        }
        if all && !known.complete {
            me.complete().await?;
        }
        Ok(())
    }
}

/// Valid answers to all questions: the first option, the middle of a scale, a word.
fn answers(texts: &Texts) -> Answers {
    let answer = |question: &QuestionForm| match question.kind {
        QuestionKind::Text => {
            Value::from("synthetic".chars().take(question.max_chars).collect::<String>())
        }
        QuestionKind::Choice => {
            question.options.first().map_or(Value::Null, |o| o.0.clone().into())
        }
        QuestionKind::Scale => Value::from(i64::midpoint(question.range.0, question.range.1)),
    };
    let questions = texts.questions.iter();
    Answers { answers: questions.map(|q| (q.name.clone(), answer(q))).collect() }
}

/// Screen and display of nobody.
fn synthetic() -> Object<Value> {
    Object::from_iter([("synthetic".to_owned(), json!(true))])
}

fn upload(parameters: &SceneParameters, drive: SyntheticDrive) -> TrialUpload {
    // Nobody waited for it: it began as long ago as it takes.
    let started_at_ms = now_ms() as f64 - 1000.0 * parameters.duration_s();
    TrialUpload {
        started_at_ms: started_at_ms.max(0.0),
        key_events: key_events(&drive.key_changes),
        inputs: drive.inputs,
        states: drive.states,
        sampled_at_ms: drive.sampled_at_ms,
        page_events: Vec::new(),
        exposures: 1,
        display: synthetic(),
    }
}

/// One finger: a key goes up before another one goes down.
fn key_events(changes: &[KeyChange]) -> Vec<KeyEvent> {
    let name = |input| match input {
        TurnInput::Left => Some("ArrowLeft"),
        TurnInput::Right => Some("ArrowRight"),
        TurnInput::Straight => None,
    };
    let mut events = Vec::new();
    let mut held = None;
    for change in changes {
        let mut event = |key: Option<&str>, down| {
            events.extend(key.map(|key| KeyEvent {
                t_ms: change.at_ms,
                key: key.to_owned(),
                down,
            }));
        };
        event(held, false);
        held = name(change.input);
        event(held, true);
    }
    events
}

/// What is driven there.
async fn study(server: &Client, slug: &str) -> Result<StudyInfo, CommandError> {
    let origin = server.origin();
    let study = server.study(slug).await.map_err(|error| match error.code() {
        Some("not_found") => {
            CommandError::Input(format!("--study {slug}: no such study at {origin}"))
        }
        _ => error.into(),
    })?;
    if study.schema_version != SCHEMA_VERSION {
        let theirs = study.schema_version;
        return Err(CommandError::Failure(format!(
            "{origin}: expected version {SCHEMA_VERSION} of the interface, found {theirs}"
        )));
    }
    Ok(study)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keys_go_up_before_others_go_down() {
        use TurnInput::{Left, Right, Straight};
        let change = |at_ms, input| KeyChange { at_ms, input };
        let changes = [change(50.0, Left), change(400.0, Right), change(950.0, Straight)];
        let events: Vec<_> =
            key_events(&changes).into_iter().map(|e| (e.t_ms, e.key, e.down)).collect();
        let expected = [
            (50.0, "ArrowLeft", true),
            (400.0, "ArrowLeft", false),
            (400.0, "ArrowRight", true),
            (950.0, "ArrowRight", false),
        ];
        assert_eq!(events, expected.map(|(t_ms, key, down)| (t_ms, key.to_owned(), down)));
    }
}
