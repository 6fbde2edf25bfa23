//! Tests of setting up studies in the laboratory.

use super::studies::study;
use super::*;
use serde_json::{Value, json};
use sidestep::api::{
    Change, Configuration, ConfigurationVersion, DraftChecked, FormDraft, Remark, StudyInfo,
    StudySummary,
};
use sidestep::study::{Status, StudyConfig};

pub(super) fn configuration(toml: &str, participants: u64) -> Configuration {
    let version = ConfigurationVersion {
        number: 2,
        hash: "abc".into(),
        label: "1".into(),
        since_ms: 0,
        participants,
        toml: toml.into(),
        changed: vec!["trials.countdown_s".into()],
    };
    let (study, hash) = ("pilot".into(), "abc".into());
    Configuration { study, hash, toml: toml.into(), participants, versions: vec![version] }
}

fn sound(changes: Vec<Change>) -> DraftChecked {
    let picture = Some("<svg><text>Scenes</text></svg>".into());
    let config = Some(serde_json::to_value(StudyConfig::default()).unwrap());
    let languages = vec!["en".into(), "de".into()];
    DraftChecked { changes, picture, config, languages, ..DraftChecked::default() }
}

fn change() -> Change {
    Change { field: "trials.countdown_s".into(), before: Some("3".into()), after: Some("5".into()) }
}

fn opened(access: Access) -> Session {
    let mut session = signed_in_to("/lab/studies/pilot/configuration", access);
    session.send("study", 200, &study("pilot", 2));
    let open = StudyConfig::default();
    session.send("info", 200, &StudyInfo::of(&open, Status::Open.into()));
    session.send("configuration", 200, &configuration("slug = \"pilot\"\n", 2));
    session.send("check", 200, &sound(Vec::new()));
    session
}

impl Session {
    /// Switches from the form to the study file, and types this text.
    fn type_text(&mut self, text: &str) {
        self.press("as-text");
        let typed = self.page.view().enter("toml", FieldValue::Text(text.into()));
        self.tell(typed.unwrap());
    }
}

#[test]
fn a_text_is_checked_while_it_is_written_and_stored_at_the_second_press() {
    let mut session = opened(Access::Manage);
    session.press("as-text");
    assert_eq!(session.words("toml").unwrap(), "slug = \"pilot\"\n");
    assert!(session.words("store").is_none() && !session.guarded, "nothing has changed");
    session.type_text("slug = ");
    session.type_text("slug = \"pilot\"\ncountdown");
    assert!(session.guarded);
    assert_eq!((session.timers.len(), session.asked.len()), (1, 0), "one check after a pause");
    session.wake("pause");
    let body = session.asked[0].body.clone().unwrap();
    assert!(body.contains("countdown") && body.contains(r#""base":"abc""#), "{body}");
    let complaint = Remark { line: Some(2), field: None, message: "expected TOML".into() };
    let unsound = DraftChecked { complaint: Some(complaint), ..DraftChecked::default() };
    session.send("check", 200, &unsound);
    assert_eq!(session.words("complaint").unwrap(), "Line 2:  expected TOML");
    assert!(session.page.view().press("store").is_none());
    session.type_text("slug = \"pilot\"\n[trials]\ncountdown_s = 5");
    session.wake("pause");
    session.send("check", 200, &sound(vec![change()]));
    assert!(session.words("changes").unwrap().contains("trials.countdown_s 3  →  5"));
    session.press("store");
    assert!(session.asked.is_empty());
    assert!(session.words("keeps").unwrap().starts_with("2 participants have begun and keep"));
    session.press("go-on");
    session.press("store");
    session.press("confirm");
    let request = session.asked.last().unwrap();
    assert_eq!(
        (request.method, request.url.as_str()),
        ("PUT", "/api/v1/admin/studies/pilot/configuration")
    );
    session.send("store", 200, &configuration("slug = \"pilot\"\n[trials]\ncountdown_s = 5\n", 2));
    assert!(!session.guarded);
    session.send("check", 200, &sound(Vec::new()));
    assert!(session.words("stored").unwrap().contains("New participants"));
}

#[test]
fn who_is_overtaken_is_told_and_loses_nothing() {
    let mut session = opened(Access::Manage);
    session.type_text("slug = \"pilot\"\ntitle = \"Mine\"");
    session.wake("pause");
    session.send("check", 200, &sound(vec![change()]));
    session.press("store");
    session.press("confirm");
    let changed = br#"{"code":"changed","message":"somebody else has changed this study"}"#;
    session.answer("store", 409, changed);
    assert!(session.words("trouble").unwrap().contains("Somebody else"));
    session.press("store");
    session.press("confirm");
    assert!(session.asked.last().unwrap().body.as_ref().unwrap().contains("Mine"));
    session.answer("store", 409, changed);
    session.press("reload");
    session.send("configuration", 200, &configuration("slug = \"pilot\"\ntitle = \"Theirs\"", 2));
    session.press("as-text");
    assert!(session.words("toml").unwrap().contains("Theirs") && session.words("reload").is_none());
}

#[test]
fn a_study_is_made_or_copied_under_another_name() {
    let mut session = signed_in("/lab/new");
    session.send("check", 200, &sound(Vec::new()));
    session.type_text("slug = \"third\"");
    assert!(session.page.view().press("store").is_none(), "not checked yet");
    session.wake("pause");
    session.send("check", 200, &sound(Vec::new()));
    session.press("store");
    let request = session.asked.last().unwrap();
    assert_eq!((request.method, request.url.as_str()), ("POST", routes::ADMIN_STUDIES));
    session.answer("store", 409, br#"{"code":"taken","message":"there is a study third already"}"#);
    assert!(session.words("trouble").unwrap().contains("study third already"));
    session.press("store");
    session.send("store", 201, &Configuration { study: "third".into(), ..configuration("", 0) });
    assert_eq!(session.visited.last().unwrap(), "/lab/studies/third/configuration");

    let mut session = signed_in("/lab/new?from=pilot");
    let toml = "slug = \"pilot\"\ntitle = \"P\"\nstatus = \"open\"\n\n[texts.en]\nslug = \"x\"\n";
    session.send("configuration", 200, &configuration(toml, 9));
    session.press("as-text");
    let copy =
        "slug = \"pilot-copy\"\nstatus = \"closed\"\ntitle = \"P\"\n\n[texts.en]\nslug = \"x\"\n";
    assert_eq!(session.words("toml").unwrap(), copy);
}

#[test]
fn a_new_study_begins_closed_and_is_named_after_its_title() {
    let mut session = signed_in("/lab/new");
    let text = session.asked.last().unwrap().body.clone().unwrap();
    assert!(text.contains(r#"status = \"closed\""#), "{text}");
    let mut config = serde_json::to_value(StudyConfig::default()).unwrap();
    (config["slug"], config["status"]) = (json!("my-study"), json!("closed"));
    session.send("check", 200, &DraftChecked { config: Some(config), ..sound(Vec::new()) });
    let shown = |session: &Session| {
        let view = session.page.view();
        view.find("field-slug").unwrap().attribute("value").unwrap().to_owned()
    };
    let sent = |session: &mut Session| {
        session.wake("pause");
        let body = session.asked.last().unwrap().body.clone().unwrap();
        serde_json::from_str::<FormDraft>(&body).unwrap().config
    };
    session.enter("title", FieldValue::Text("Ways past a robot".into()));
    assert_eq!(shown(&session), "ways-past-a-robot");
    session.enter("title", FieldValue::Text("避让机器人".into()));
    let config = sent(&mut session);
    assert_eq!(
        (&config["slug"], &config["status"]),
        (&json!("ways-past-a-robot"), &json!("closed"))
    );
    // A slug that the user has entered does not follow the title.
    session.enter("slug", FieldValue::Text("spring".into()));
    session.enter("title", FieldValue::Text("Another title".into()));
    session.enter("status", FieldValue::Text("open".into()));
    let config = sent(&mut session);
    assert_eq!((&config["slug"], &config["status"]), (&json!("spring"), &json!("open")));
    assert_eq!(config["title"], "Another title");
}

#[test]
fn a_study_is_closed_and_has_its_links() {
    let mut session = opened(Access::Manage);
    let links = session.words("links").unwrap();
    assert!(links.contains("https://lab.example/s/"), "{links}");
    assert!(links.contains("PROLIFIC_PID={{%PROLIFIC_PID%}}&STUDY_ID="), "{links}");
    assert_eq!(session.words("set-closed").unwrap(), "Close to new participants");
    assert!(session.words("try").is_none());
    session.press("set-closed");
    let request = session.asked.last().unwrap();
    assert_eq!(request.body.as_deref(), Some(r#"{"status":"closed"}"#));
    session.send("status", 200, &configuration("", 2));
    session.send("study", 200, &StudySummary { status: Status::Closed, ..study("pilot", 2) });
    assert!(session.words("status-words").unwrap().starts_with("Nobody new"));
    assert!(session.words("links").is_none() && session.words("set-open").is_some());
    for name in ["try", "rehearse"] {
        let view = session.page.view();
        let link = view.find(name).unwrap().attribute("href").unwrap();
        assert!(link.starts_with("/s/pilot?"), "{link}");
    }
    // The status cannot be changed while this would discard edits.
    session.type_text("slug = \"pilot\"\n# more");
    assert!(session.page.view().press("set-open").is_none());
}

#[test]
fn who_may_not_manage_reads_the_configuration() {
    let mut session = opened(Access::Export);
    let field = session.page.view().find("field-title").unwrap().attribute("disabled").is_some();
    assert!(field);
    session.press("as-text");
    assert_eq!(session.page.view().find("toml").unwrap().attribute("readonly"), Some(""));
    for button in ["set-closed", "store", "copy"] {
        assert!(session.words(button).is_none(), "{button}");
    }
}

impl Session {
    /// Enters a value in a field of the form.
    fn enter(&mut self, field: &str, value: FieldValue) {
        let entered = self.page.view().enter(&format!("field-{field}"), value);
        self.tell(entered.unwrap_or_else(|| panic!("no field {field}")));
    }

    /// Returns the study that the form sends after a pause in typing.
    fn sent(&mut self) -> Value {
        self.wake("pause");
        let request = self.asked.last().unwrap();
        assert_eq!((request.method, request.url.as_str()), ("POST", routes::ADMIN_FORM_DRAFTS));
        let sent: FormDraft = serde_json::from_str(request.body.as_ref().unwrap()).unwrap();
        assert_eq!(sent.base.as_deref(), Some("abc"));
        sent.config
    }

    fn written(&mut self, toml: &str, changes: Vec<Change>) {
        self.send("check", 200, &DraftChecked { toml: Some(toml.into()), ..sound(changes) });
    }
}

fn number(number: f64) -> FieldValue {
    FieldValue::Number(Some(number))
}

#[test]
fn every_field_of_the_form_is_a_field_of_the_study() {
    let session = opened(Access::Manage);
    let config = serde_json::to_value(StudyConfig::default()).unwrap();
    let view = session.page.view();
    let shown: Vec<_> =
        view.test_ids().into_iter().filter_map(|name| name.strip_prefix("field-")).collect();
    let of = |path: &str| shown.contains(&path);
    // This test does not check tables in lists, texts by language and sentences. The form of an
    // existing study has no field for its status and its slug.
    let without = ["status", "slug", "questions", "texts", "phases", "comprehension.questions"];
    let mut leaves = Vec::new();
    paths(&config, String::new(), &mut leaves);
    for path in leaves.iter().filter(|path| !without.contains(&path.as_str())) {
        assert!(
            of(path) || of(&format!("{path}.en")),
            "the form has no field for {path}: {shown:?}"
        );
    }
    for field in &shown {
        let is_there = leaves.iter().any(|leaf| field.starts_with(leaf.as_str()));
        assert!(is_there, "a study has no field {field}");
    }
}

fn paths(value: &Value, path: String, found: &mut Vec<String>) {
    match value {
        Value::Object(fields) if !fields.is_empty() => {
            for (name, value) in fields {
                let path = if path.is_empty() { name.clone() } else { format!("{path}.{name}") };
                paths(value, path, found);
            }
        }
        _ => found.push(path),
    }
}

#[test]
fn the_form_becomes_a_study_file_and_the_file_a_form() {
    let mut session = opened(Access::Manage);
    assert!(session.words("store").is_none() && session.words("toml").is_none());
    session.enter("phases[2].scenes", number(20.0));
    session.enter("consent.investigator", FieldValue::Text("Ada".into()));
    session.enter("parameters.human.speed_mps", number(1.5));
    assert!(session.guarded);
    // The text does not contain the form's input yet.
    assert!(session.page.view().press("store").is_none());
    let sent = session.sent();
    assert_eq!(sent["phases"][2]["scenes"], 20);
    assert_eq!(sent["consent"]["investigator"], "Ada");
    assert_eq!(sent["parameters"]["human"]["speed_mps"], 1.5);
    session.written("slug = \"pilot\"\nwritten = true\n", vec![change()]);
    session.press("store");
    session.press("confirm");
    assert!(session.asked.last().unwrap().body.as_ref().unwrap().contains("written = true"));
    session.send("store", 200, &configuration("slug = \"pilot\"\nwritten = true\n", 2));
    assert!(!session.guarded);
    // Now in the other direction: from the text to the form.
    session.type_text("slug = \"pilot\"\ntitle = \"Typed\"");
    session.wake("pause");
    let mut config = serde_json::to_value(StudyConfig::default()).unwrap();
    config["title"] = json!("Typed");
    let checked = DraftChecked { config: Some(config), ..sound(vec![change()]) };
    // The text area in which the user types is not replaced.
    let area =
        |view: crate::view::Node<_>| view.find("toml").unwrap().identity().map(str::to_owned);
    let typed_in = area(session.page.view());
    session.send("check", 200, &checked);
    assert_eq!(area(session.page.view()), typed_in);
    session.press("as-form");
    let title = session.page.view();
    assert_eq!(title.find("field-title").unwrap().attribute("value"), Some("Typed"));
}

#[test]
fn a_mistake_is_said_beside_its_field() {
    let mut session = opened(Access::Manage);
    session.enter("phases[2].scenes", FieldValue::Number(None));
    assert_eq!(session.sent()["phases"][2]["scenes"], Value::Null);
    let message = "phases[2].scenes: expected a whole number, found null".to_owned();
    let field = Some("phases[2].scenes".to_owned());
    let complaint = Some(Remark { line: None, field, message });
    session.send("check", 200, &DraftChecked { complaint, ..DraftChecked::default() });
    assert_eq!(session.words("beside").unwrap(), "Expected a whole number, found null");
    let view = session.page.view();
    let field = view.find("field-phases[2].scenes").unwrap();
    assert_eq!(field.attribute("aria-invalid"), Some("true"));
    assert!(view.press("store").is_none() && session.words("store").is_some());
    let said = "Tasks: number of scenes: expected a whole number, found null";
    assert_eq!(session.words("complaint").unwrap(), said);
    session.press("as-text");
    assert!(session.words("complaint").unwrap().starts_with("phases[2].scenes: expected"));
}

#[test]
fn lists_of_the_form_grow_and_shrink() {
    let mut session = opened(Access::Manage);
    session.enter("phases.practice", FieldValue::Checked(false));
    session.press("add-questions");
    session.enter("questions[0].text.en", FieldValue::Text("How hard?".into()));
    session.enter("questions[0].kind", FieldValue::Text("scale".into()));
    session.enter("questions[0].to", number(9.0));
    session.press("add-comprehension.questions");
    session.press("add-comprehension.questions[0].options");
    session.press("language-de");
    session.enter("comprehension.questions[0].options[2].de", FieldValue::Text("Nein".into()));
    let sent = session.sent();
    let phases: Vec<_> = sent["phases"].as_array().unwrap().iter().map(|p| &p["phase"]).collect();
    assert_eq!(phases, ["familiarisation", "task"]);
    let question = &sent["questions"][0];
    assert_eq!((&question["kind"], &question["to"]), (&json!("scale"), &json!(9)));
    assert_eq!(question["text"], json!({ "en": "How hard?" }));
    assert_eq!(sent["comprehension"]["questions"][0]["options"], json!([{}, {}, { "de": "Nein" }]));
    session.enter("phases.practice", FieldValue::Checked(true));
    session.press("remove-questions[0]");
    session.press("fill-prolific");
    let sent = session.sent();
    assert_eq!(sent["phases"][1], json!({ "phase": "practice", "scenes": 3 }));
    assert_eq!(sent["questions"], json!([]));
    assert_eq!(sent["recruitment"]["external_id"], json!(["PROLIFIC_PID"]));
    assert_eq!(sent["recruitment"]["require_external_id"], true);
}

#[test]
fn versions_are_listed() {
    let session = opened(Access::Read);
    let words = session.words("versions").unwrap();
    assert!(words.contains("current") && words.contains("trials.countdown_s"), "{words}");
}
