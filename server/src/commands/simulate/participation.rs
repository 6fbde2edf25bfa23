//! Synthetic participants through the HTTP interface, as real ones take part.

use super::super::{CommandError, print_json};
use super::{FlagCounts, SimulateArgs, bar};
use crate::clock::now_ms;
use indicatif::ProgressBar;
use reqwest::{Client, Method, RequestBuilder, StatusCode, Url};
use serde::de::DeserializeOwned;
use serde_json::{Value, json};
use sidestep::api::{
    Answers, Completed, ComprehensionResult, ComprehensionStored, Enrolled, Enrolment, KeyEvent,
    Object, Problem, Progress, QuestionForm, SCHEMA_VERSION, StudyInfo, Texts, TrialStored,
    TrialUpload, routes,
};
use sidestep::scene::SceneParameters;
use sidestep::study::{QuestionKind, StudyConfig};
use sidestep::synthetic::{KeyChange, Keys, SyntheticDrive, SyntheticParticipant};
use sidestep::trial::Phase;
use sidestep::vehicle::TurnInput;
use std::collections::HashSet;
use std::error::Error;
use std::time::Duration;

/// A little longer than a server takes to give up on a request itself.
const PATIENCE: Duration = Duration::from_secs(40);

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
    let server = Server::at(url)
        .ok_or_else(|| bad("url", "an address such as http://127.0.0.1:8080", url))?
        .map_err(CommandError::failure)?;
    let study = server.study(&args.study).await?;
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
        server: &Server,
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
        let enrol = server.request(Method::POST, &routes::participants(&study.slug));
        let me: Enrolled = server.ask("the enrolment", enrol.json(&body)).await?;
        let mine =
            |method, route: &str| server.request(method, route).bearer_auth(me.token.as_str());
        let known = mine(Method::GET, routes::ME);
        let known: Progress = server.ask("the state of a participation", known).await?;
        if !known.understood {
            let body = ComprehensionResult { attempts: 1, passed: true };
            let put = mine(Method::PUT, routes::COMPREHENSION).json(&body);
            server.ask::<ComprehensionStored>("the check of understanding", put).await?;
        }
        let stored: HashSet<String> = known.stored.into_iter().collect();
        let mut tasks = 0;
        // Numbers count all phases, whatever is left out.
        let wanted: Vec<_> = (0..)
            .zip(me.plan.scenes())
            .filter(|(_, (phase, _))| {
                tasks += u64::from(phase.phase == Phase::Task);
                phase.phase != Phase::Task || tasks <= self.most
            })
            .collect();
        let all = wanted.len() == me.plan.scenes().count();
        self.bar.set_length(people * wanted.len() as u64);
        for (trial, (_, planned)) in wanted {
            if stored.contains(&planned.trial_id) {
                self.already_stored += 1;
            } else {
                let scene = planned.scene();
                let drive = person.drive(trial, &study.parameters, &scene, Keys::Clock);
                self.flags.count(&study.parameters, &scene, &drive);
                let put = mine(Method::PUT, &routes::my_trial(&planned.trial_id));
                let put = put.json(&upload(&study.parameters, drive));
                server.ask::<TrialStored>("a trial", put).await?;
            }
            self.trials += 1;
            self.bar.inc(1);
        }
        if all && !known.answered {
            let put =
                mine(Method::PUT, routes::ANSWERS).json(&answers(&server.texts(study).await?));
            server.accepted("the answers", put).await?;
        }
        if all && !known.complete {
            let complete = mine(Method::POST, routes::COMPLETE);
            server.ask::<Completed>("the completion", complete).await?;
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

/// A server that is asked.
struct Server {
    client: Client,
    /// Without a slash at the end.
    origin: String,
}

impl Server {
    /// None if it is not an http address, or one with a password or a query.
    fn at(url: &str) -> Option<Result<Self, reqwest::Error>> {
        let parsed = Url::parse(url).ok()?;
        let plain = parsed.scheme() == "http"
            && parsed.has_host()
            && parsed.username().is_empty()
            && parsed.password().is_none()
            && parsed.query().is_none()
            && parsed.fragment().is_none();
        let origin = parsed.as_str().trim_end_matches('/').to_owned();
        // An answer from elsewhere would not be the server's.
        let client = Client::builder()
            .timeout(PATIENCE)
            .redirect(reqwest::redirect::Policy::none())
            .no_proxy()
            .build();
        plain.then(|| client.map(|client| Self { client, origin }))
    }

    fn request(&self, method: Method, route: &str) -> RequestBuilder {
        self.client.request(method, format!("{}{route}", self.origin))
    }

    /// What is driven there.
    async fn study(&self, slug: &str) -> Result<StudyInfo, CommandError> {
        let request = self.request(Method::GET, &routes::study(slug));
        let (status, body) = self.answer(request).await?;
        if status == StatusCode::NOT_FOUND && serde_json::from_slice::<Problem>(&body).is_ok() {
            let origin = &self.origin;
            return Err(CommandError::Input(format!("--study {slug}: no such study at {origin}")));
        }
        let study: StudyInfo = self.understood("the study", status, &body)?;
        if study.schema_version != SCHEMA_VERSION {
            let (origin, theirs) = (&self.origin, study.schema_version);
            return Err(CommandError::Failure(format!(
                "{origin}: expected version {SCHEMA_VERSION} of the interface, found {theirs}"
            )));
        }
        Ok(study)
    }

    /// What participants read in English.
    async fn texts(&self, study: &StudyInfo) -> Result<Texts, CommandError> {
        let route = format!("{}?language=en", routes::texts(&study.slug));
        self.ask("the texts", self.request(Method::GET, &route)).await
    }

    /// A request that is expected to succeed without a body in its answer.
    async fn accepted(&self, what: &str, request: RequestBuilder) -> Result<(), CommandError> {
        let (status, body) = self.answer(request).await?;
        if status == StatusCode::NO_CONTENT {
            return Ok(());
        }
        self.understood::<Value>(what, status, &body).map(drop)
    }

    /// The answer to a request that is expected to succeed.
    async fn ask<T: DeserializeOwned>(
        &self,
        what: &str,
        request: RequestBuilder,
    ) -> Result<T, CommandError> {
        let (status, body) = self.answer(request).await?;
        self.understood(what, status, &body)
    }

    async fn answer(&self, request: RequestBuilder) -> Result<(StatusCode, Vec<u8>), CommandError> {
        let unreachable = |error: reqwest::Error| {
            let (origin, why) = (&self.origin, root_cause(&error));
            CommandError::Failure(format!("{origin}: no answer: {why}; is a server running there?"))
        };
        let response = request.send().await.map_err(unreachable)?;
        let status = response.status();
        let body = response.bytes().await.map_err(unreachable)?;
        Ok((status, body.to_vec()))
    }

    /// The body of a success; anything else in the server's own words. What was sent is not
    /// repeated: it holds the token.
    fn understood<T: DeserializeOwned>(
        &self,
        what: &str,
        status: StatusCode,
        body: &[u8],
    ) -> Result<T, CommandError> {
        let origin = &self.origin;
        if !status.is_success() {
            let said = serde_json::from_slice::<Problem>(body).map_or_else(
                |_| "not in the words of a Sidestep server".to_owned(),
                |Problem { message, field, .. }| match field {
                    Some(field) => format!("{field}: {message}"),
                    None => message,
                },
            );
            let message = format!("{origin}: {what} was refused ({}): {said}", status.as_u16());
            return Err(CommandError::Failure(message));
        }
        serde_json::from_slice(body).map_err(|error| {
            let message = format!("{origin}: {what}: not the answer of a Sidestep server: {error}");
            CommandError::Failure(message)
        })
    }
}

/// The innermost error, such as a connection that was refused.
fn root_cause(error: &reqwest::Error) -> String {
    let mut cause: &dyn Error = error;
    while let Some(source) = cause.source() {
        cause = source;
    }
    cause.to_string()
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

    #[test]
    fn addresses() {
        let origin = |url| Server::at(url).map(|server| server.unwrap().origin);
        assert_eq!(origin("http://[::1]:80/").as_deref(), Some("http://[::1]"));
        assert_eq!(origin("http://lab:8080/study/").as_deref(), Some("http://lab:8080/study"));
        for bad in ["", "lab:8080", "https://lab", "http://", "http://a:b@lab", "http://lab?x"] {
            assert_eq!(origin(bad), None, "{bad}");
        }
    }
}
