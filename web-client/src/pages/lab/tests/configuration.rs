//! Studies that are set up in the laboratory.

use super::studies::study;
use super::*;
use sidestep::api::{Change, Configuration, DraftChecked, Remark, StudyInfo, StudySummary};
use sidestep::study::{Status, StudyConfig};

fn configuration(toml: &str, participants: u64) -> Configuration {
    Configuration { study: "pilot".into(), hash: "abc".into(), toml: toml.into(), participants }
}

fn sound(changes: Vec<Change>) -> DraftChecked {
    let picture = Some("<svg><text>Scenes</text></svg>".into());
    DraftChecked { complaint: None, warnings: Vec::new(), changes, picture }
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
    fn type_text(&mut self, text: &str) {
        let typed = self.page.view().enter("toml", FieldValue::Text(text.into()));
        self.tell(typed.unwrap());
    }
}

#[test]
fn a_text_is_checked_while_it_is_written_and_stored_at_the_second_press() {
    let mut session = opened(Access::Manage);
    assert_eq!(session.words("toml").unwrap(), "slug = \"pilot\"\n");
    assert!(session.words("store").is_none() && !session.guarded, "nothing has changed");
    session.type_text("slug = ");
    session.type_text("slug = \"pilot\"\ncountdown");
    assert!(session.guarded);
    assert_eq!((session.timers.len(), session.asked.len()), (1, 0), "one check after a pause");
    session.wake("pause");
    let body = session.asked[0].body.clone().unwrap();
    assert!(body.contains("countdown") && body.contains(r#""base":"abc""#), "{body}");
    let complaint = Remark { line: 2, message: "expected TOML".into() };
    let unsound = DraftChecked { complaint: Some(complaint), picture: None, ..sound(Vec::new()) };
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
    assert!(session.words("toml").unwrap().contains("Theirs") && session.words("reload").is_none());
}

#[test]
fn a_study_is_made_or_copied_under_another_name() {
    let mut session = signed_in("/lab/new");
    session.send("check", 200, &sound(Vec::new()));
    session.type_text("slug = \"third\"");
    session.press("store");
    let request = session.asked.last().unwrap();
    assert_eq!((request.method, request.url.as_str()), ("POST", routes::ADMIN_STUDIES));
    session.answer("store", 409, br#"{"code":"taken","message":"there is a study third already"}"#);
    assert!(session.words("trouble").unwrap().contains("study third already"));
    session.press("store");
    session.send("store", 201, &Configuration { study: "third".into(), ..configuration("", 0) });
    assert_eq!(session.visited.last().unwrap(), "/lab/studies/third/configuration");

    let mut session = signed_in("/lab/new?from=pilot");
    let toml = "slug = \"pilot\"\ntitle = \"P\"\nstatus = \"closed\"\n\n[texts.en]\nslug = \"x\"\n";
    session.send("configuration", 200, &configuration(toml, 9));
    let copy = "slug = \"pilot-copy\"\ntitle = \"P\"\n\n[texts.en]\nslug = \"x\"\n";
    assert_eq!(session.words("toml").unwrap(), copy);
}

#[test]
fn a_study_is_closed_and_has_its_links() {
    let mut session = opened(Access::Manage);
    let links = session.words("links").unwrap();
    assert!(links.contains("https://lab.example/s/"), "{links}");
    assert!(links.contains("PROLIFIC_PID={{%PROLIFIC_PID%}}&STUDY_ID="), "{links}");
    session.press("set-closed");
    let request = session.asked.last().unwrap();
    assert_eq!(request.body.as_deref(), Some(r#"{"status":"closed"}"#));
    session.send("status", 200, &configuration("", 2));
    session.send("study", 200, &StudySummary { status: Status::Closed, ..study("pilot", 2) });
    assert!(session.words("status-words").unwrap().starts_with("Nobody new"));
    assert!(session.words("links").is_none() && session.words("set-open").is_some());
    // Not while something is written that would be lost.
    session.type_text("slug = \"pilot\"\n# more");
    assert!(session.page.view().press("set-open").is_none());
}

#[test]
fn who_may_not_manage_reads_the_configuration() {
    let session = opened(Access::Export);
    assert_eq!(session.page.view().find("toml").unwrap().attribute("readonly"), Some(""));
    for button in ["set-closed", "store", "copy"] {
        assert!(session.words(button).is_none(), "{button}");
    }
}
