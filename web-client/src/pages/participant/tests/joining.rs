//! Tests of everything before the first scene: who can take part, consent, keys, languages, links
//! and pilots.

use super::*;
use std::fs::{read_dir, read_to_string};
use std::path::Path;

#[test]
fn from_consent_to_the_code() {
    let mut session = begun();
    session.drive();
    let trial = session.uploaded("t0");
    let parameters = SceneParameters::default();
    trial.check(&parameters).unwrap();
    let scene = plan().phases[0].scenes[0].scene();
    assert!(verify(&parameters, &scene, &trial.inputs, &trial.states).exact);
    let lefts: Vec<_> = (0..50).filter(|&i| trial.inputs[i] == TurnInput::Left).collect();
    assert_eq!(lefts, (15..25).collect::<Vec<_>>(), "held from 3 s to 5 s");
    session.stored("t0");
    assert!(session.text().contains("✓ 1 scene stored"));
    session.drive();
    assert!(session.text().contains("Sending your last scenes"));
    session.stored("t1");
    session.completed();
    assert_eq!(session.kept.keys().collect::<Vec<_>>(), ["sidestep.session.default"]);
}

#[test]
fn a_study_that_takes_nobody_says_so() {
    for (status, words) in
        [(Status::Closed, "This study is closed"), (Status::Archived, "This study is over")]
    {
        let session = open(BTreeMap::new(), &StudyConfig { status, ..StudyConfig::default() });
        assert!(session.words("ended").unwrap().contains(words));
        assert!(session.text().contains("You may close this page."), "{words}");
        let pilot =
            open_at(BTreeMap::new(), &StudyConfig { status, ..StudyConfig::default() }, "pilot");
        assert_eq!(pilot.words("consent").is_some(), status == Status::Closed);
    }
    // The study was closed or became full while the participant read the consent text.
    for (code, words) in [("closed", "This study is closed"), ("full", "This study is full")] {
        let mut session = welcomed();
        session.equipped();
        session.press("continue");
        let full = Problem { return_url: Some("https://r/".into()), ..refusal(code) };
        session.send("enrol", 403, &full);
        assert!(session.words("ended").unwrap().contains(words));
        assert_eq!(goes_to(&session).as_deref(), Some("https://r/"));
    }
    let mut session = opened(BTreeMap::new(), "");
    session.send("texts", 404, &refusal("not_found"));
    assert!(
        session.words("stuck").unwrap().contains("Check the link")
            || session.words("stuck").unwrap().contains("check the link")
    );
}

/// The address of the page's return link.
fn goes_to(session: &Session) -> Option<String> {
    let view = session.page.view();
    view.find("return").and_then(|link| link.attribute("href")).map(str::to_owned)
}

#[test]
fn whoever_cannot_take_part_reads_so_before_consent_with_the_way_back() {
    for (admission, words) in [
        (Admission::Full, "This study is full"),
        (Admission::Closed, "This study is closed"),
        (Admission::Archived, "This study is over"),
        (Admission::Finished, "You have completed this study already"),
        (Admission::Withdrawn, "You have stopped taking part"),
        (Admission::ScreenedOut, "You cannot take part"),
    ] {
        let study = StudyConfig::default();
        let mut session = opened(BTreeMap::new(), "PROLIFIC_PID=P+1 x");
        session.send("texts", 200, &texts());
        session.send("study", 200, &StudyInfo::of(&study, Status::Open.into()));
        assert!(session.words("consent").is_none(), "the server is asked about this person first");
        assert_eq!(session.urls(), ["/api/v1/studies/default?external_id=P%2B1%20x"]);
        let told = StudyInfo::of(&study, admission);
        session.send("study", 200, &StudyInfo { return_url: Some("https://r/".into()), ..told });
        assert!(session.text().contains(words), "{}", session.text());
        assert_eq!(goes_to(&session).as_deref(), Some("https://r/"));
        assert!(session.asked.is_empty() && session.kept.is_empty());
    }
}

#[test]
fn somebody_whom_the_server_has_forgotten_is_asked_nothing_in_vain() {
    let kept = begun().kept;
    let closed = StudyConfig { status: Status::Closed, ..StudyConfig::default() };
    let mut session = open(kept, &closed);
    session.send("progress", 401, &refusal("unauthorized"));
    assert!(session.words("ended").unwrap().contains("This study is closed"));
    assert!(session.kept.is_empty());
}

#[test]
fn the_consent_button_waits_for_a_press_of_its_own() {
    let session = welcomed();
    let view = session.page.view();
    assert!(!view.find("consent").unwrap().takes_focus);
}

#[test]
fn the_instructions_are_those_of_the_study() {
    let words = |study: StudyConfig| {
        let mut session = open(BTreeMap::new(), &study);
        session.instructed();
        session.text()
    };
    let paper = words(StudyConfig::default());
    assert!(paper.contains("A scene takes 10 seconds."), "{paper}");
    assert!(paper.contains("You see it during the warm-up only."), "{paper}");
    let mut study = StudyConfig::default();
    study.parameters.steps = 40;
    study.phases.retain(|phase| phase.phase == Phase::Task);
    let other = words(study);
    assert!(other.contains("A scene takes 8 seconds."), "{other}");
    assert!(other.contains("the scenes do not"), "{other}");
}

#[test]
fn a_key_press_comes_before_the_enrolment() {
    let mut session = welcomed();
    session.press("consent");
    session.pass(2000.0);
    assert!(session.page.view().press("continue").is_none(), "no key was pressed");
    session.hear(&key("ArrowLeft", true));
    session.hear(&key("ArrowRight", true));
    assert!(session.page.view().press("continue").is_some());
    assert!(session.asked.is_empty(), "nobody is enrolled yet");
}

#[test]
fn other_keys_can_steer() {
    let mut session = welcomed();
    session.press("consent");
    session.press("choose-keys");
    let press =
        |code: &str, key: &str| Event::Key { code: code.into(), key: key.into(), down: true };
    for (code, printed) in [("Space", " "), ("KeyJ", "j"), ("KeyJ", "j"), ("KeyL", "l")] {
        session.hear(&press(code, printed));
    }
    assert!(session.text().contains('J') && session.text().contains('L'));
    session.hear(&press("KeyJ", "j"));
    session.hear(&press("KeyL", "l"));
    session.pass(2000.0);
    assert!(session.page.view().press("continue").is_some());
    assert!(session.kept["sidestep.keys"].contains("KeyJ"));
    assert!(session.page.hear(&key("ArrowLeft", true)).is_none(), "the arrows steer no longer");
}

#[test]
fn a_device_without_a_keyboard_is_told_before_consent() {
    let mut session = opened(BTreeMap::new(), "");
    session.page.context.touch_only = true;
    session.send("texts", 200, &texts());
    session.send("study", 200, &StudyInfo::of(&StudyConfig::default(), Status::Open.into()));
    assert!(session.words("touch").unwrap().contains("https://lab.example/s/default"));
    session.press("anyway");
    assert!(session.words("consent").is_some());
}

#[test]
fn people_who_share_a_browser_are_told_apart() {
    let study = StudyConfig::default();
    let mut first = open_at(BTreeMap::new(), &study, "PROLIFIC_PID=P1&STUDY_ID=s&other=x");
    first.equipped();
    first.press("continue");
    let body = first.asked[0].body.clone().unwrap();
    let enrolment: Enrolment = serde_json::from_str(&body).unwrap();
    assert_eq!(enrolment.external_id.as_deref(), Some("P1"));
    assert_eq!(enrolment.parameters, Object::from_iter([("STUDY_ID".into(), "s".into())]));
    first.send("enrol", 201, &enrolled());
    let again = open_at(first.kept.clone(), &study, "PROLIFIC_PID=p-1");
    assert!(again.words("consent").is_some(), "another text is another id");
    let again = open_at(first.kept.clone(), &study, "PROLIFIC_PID=p1");
    assert_eq!(again.urls(), [routes::ME]);
    let second = open_at(first.kept, &study, "PROLIFIC_PID=P2");
    assert!(second.words("consent").is_some());
    assert_eq!(study.recruitment, Recruitment::default());
}

#[test]
fn a_personal_link_continues_on_another_computer() {
    let mut first = begun();
    first.drive();
    let view = first.page.view();
    let link = view.find("personal-link").unwrap().attribute("value").unwrap().to_owned();
    let fragment = link.strip_prefix("https://lab.example/s/default").unwrap();
    let mut second = open_at(BTreeMap::new(), &StudyConfig::default(), fragment);
    assert_eq!(second.visited, ["/s/default"], "the secret leaves the address bar");
    assert_eq!(second.asked[0].token.as_deref(), Some("secret"));
    second.send("progress", 200, &progress(&["t0"]));
    assert!(second.text().contains("Task 2 of 2"));
    assert!(second.kept["sidestep.session.default"].contains("secret"));
}

#[test]
fn a_pilot_is_kept_apart() {
    let mut session = open_at(BTreeMap::new(), &StudyConfig::default(), "pilot=1");
    assert!(session.words("pilot").unwrap().contains("Test run"));
    session.instructed();
    assert!(session.kept.contains_key("sidestep.session.default.pilot"));
}

#[test]
fn a_browser_rehearses_again_and_again() {
    let study = StudyConfig::default();
    let mut first = open_at(BTreeMap::new(), &study, "simulate=1");
    first.equipped();
    first.press("continue");
    first.send("enrol", 201, &enrolled());
    let goes_on = |link: &str| open_at(first.kept.clone(), &study, link).urls() == [routes::ME];
    assert!(goes_on("simulate=1"), "in the middle, the same test run goes on");
    for other in ["simulate=2", "pilot", ""] {
        assert!(!goes_on(other), "{other} is another run");
    }
    let code = Some("PILOT-1".to_owned());
    let over = Progress { completion_code: code, complete: true, pilot: true, ..progress(&[]) };
    let mut session = open_at(first.kept.clone(), &study, "simulate=1");
    session.send("progress", 200, &over);
    session.press("again");
    assert_eq!(session.left.as_deref(), Some("/s/default"));
    assert!(open_at(session.kept, &study, "simulate=1").words("consent").is_some());
    let mut session = open_at(first.kept.clone(), &study, "simulate=1");
    session.send("progress", 200, &Progress { pilot: false, ..over });
    assert!(session.page.view().find("again").is_none(), "only a test run begins again");
}

#[test]
fn a_link_without_a_proper_id_is_refused_at_once() {
    let mut study = StudyConfig::default();
    let mut refused = |link: &str, is_required: bool| {
        study.recruitment.require_external_id = is_required;
        let session = open_at(BTreeMap::new(), &study, link);
        session.words("stuck").is_some_and(|words| {
            words.contains("Your link is not complete") && words.contains("open the study again")
        })
    };
    let long = format!("external_id={}", "x".repeat(129));
    for link in
        ["PROLIFIC_PID={{%PROLIFIC_PID%}}", "external_id=[PID]", "workerId=${e://Field/id}", &long]
    {
        assert!(refused(link, false), "{link}");
    }
    for link in ["", "external_id=", "other=5f1e"] {
        assert!(refused(link, true) && !refused(link, false), "{link}");
    }
    for link in ["PROLIFIC_PID=5f1e", "pilot", "pilot=1&PROLIFIC_PID={{%PROLIFIC_PID%}}"] {
        assert!(!refused(link, true), "{link}");
    }
}

#[test]
fn another_language_is_asked_for_and_kept() {
    let mut session = welcomed();
    let message = session.page.view().enter("language", FieldValue::Text("de".into()));
    session.tell(message.unwrap());
    assert_eq!(session.urls(), ["/api/v1/studies/default/texts?language=de"]);
    let mut german = texts();
    german.language = "de".into();
    german.sentences.insert("welcome.agree".into(), "Ich bin einverstanden".into());
    session.send("texts", 200, &german);
    assert!(session.text().contains("Ich bin einverstanden"));
    let again = opened(session.kept, "");
    assert!(again.urls().contains(&"/api/v1/studies/default/texts?language=de"));
}

/// Every sentence key in the page's code is in the English language file, and vice versa.
#[test]
fn the_language_file_has_the_sentences_of_the_page() {
    let page = Path::new(env!("CARGO_MANIFEST_DIR")).join("src/pages/participant");
    let files = [page.clone(), page.join("view")].into_iter().flat_map(|it| read_dir(it).unwrap());
    let files = files.map(|entry| entry.unwrap().path());
    let sources = files.chain([page.with_extension("rs")]);
    let sources = sources.filter(|path| path.is_file() && !path.ends_with("tests.rs"));
    let code: String = sources.map(|path| read_to_string(path).unwrap()).collect();
    let sentences = texts().sentences;
    let tables: Vec<_> = sentences.iter().filter_map(|(key, _)| key.split('.').next()).collect();
    for literal in code.split('"').skip(1).step_by(2) {
        let Some((table, rest)) = literal.split_once('.') else { continue };
        if tables.contains(&table)
            && rest.chars().all(|c| c.is_ascii_lowercase() || "_0123456789".contains(c))
        {
            let known = sentences.get(literal).is_some()
                || sentences.get(&format!("{literal}.other")).is_some();
            assert!(known, "the language file lacks {literal}");
        }
    }
    let mut unnamed = Vec::new();
    for (key, _) in sentences.iter() {
        let stem = key.strip_suffix(".one").or(key.strip_suffix(".other")).unwrap_or(key);
        // The server uses the keys of the comprehension check, of the language's name and about
        // robots. The study names the keys of the facts.
        let elsewhere = ["check_", "language.", "robots."];
        let facts = ["investigator", "institution", "contact", "ethics", "retention"];
        let named = elsewhere.iter().any(|table| stem.starts_with(table))
            || facts.iter().any(|fact| stem == format!("welcome.{fact}"));
        if !named && !code.contains(&format!("\"{stem}\"")) {
            unnamed.push(stem);
        }
    }
    assert!(unnamed.is_empty(), "no code names {unnamed:?}");
}
