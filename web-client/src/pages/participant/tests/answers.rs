//! Tests of the comprehension check, the questions and the withdrawal.

use super::*;

#[test]
fn understanding_is_checked_before_the_scenes() {
    let mut study = StudyConfig::default();
    study.comprehension.attempts = 3;
    let mut session = opened(BTreeMap::new(), "");
    let check = |answer| CheckForm {
        text: "Keep out of {radius} m?".into(),
        options: vec!["Yes".into(), "No".into()],
        answer,
    };
    session.send("study", 200, &StudyInfo::of(&study, Status::Open.into()));
    session.send("texts", 200, &Texts { check: vec![check(0), check(1)], ..texts() });
    session.equipped();
    session.press("continue");
    session.send("enrol", 201, &enrolled());
    session.send("progress", 200, &Progress { understood: false, ..progress(&[]) });
    session.press("continue");
    assert!(session.text().contains("Keep out of 3 m?"));
    let answer = |session: &mut Session, answers: [&str; 2]| {
        let field = |(place, value): (usize, &&str)| {
            (!value.is_empty())
                .then(|| (format!("check-{place}"), FieldValue::Text((*value).into())))
        };
        let fields = answers.iter().enumerate().filter_map(field).collect();
        let message = session.page.view().submit("comprehension", Form::new(fields));
        session.tell(message.unwrap());
    };
    let sent = |session: &Session| {
        let request = session.asked.iter().find(|request| request.name == "check")?;
        serde_json::from_str::<ComprehensionResult>(request.body.as_ref().unwrap()).ok()
    };
    answer(&mut session, ["0", ""]);
    assert!(session.words("missing").is_some() && sent(&session).is_none());
    assert_eq!(marked(&session, "comprehension"), [false, true]);
    let open = ComprehensionStored {
        screened_out: false,
        after_wrong: AfterWrong::Mark,
        return_url: None,
    };
    answer(&mut session, ["0", "0"]);
    assert_eq!(sent(&session), Some(ComprehensionResult { attempts: 1, passed: false }));
    session.send("check", 200, &open);
    assert!(session.text().contains("Please choose another answer."));
    assert!(session.text().contains("You can try 2 more times."));
    // Reading the instructions again does not give new attempts.
    session.press("again");
    session.press("continue");
    assert!(session.text().contains("You can try 2 more times."));
    assert!(!session.text().contains("Please choose another answer."));
    answer(&mut session, ["0", "1"]);
    assert_eq!(sent(&session), Some(ComprehensionResult { attempts: 2, passed: true }));
    assert!(session.page.view().press("continue").is_none(), "it is not stored yet");
    session.send("check", 200, &open);
    assert!(session.text().starts_with("You can begin"), "{}", session.text());
    session.press("continue");
    assert!(session.words("start").is_some());
}

/// For each question of a form, whether it is marked as unanswered.
fn marked(session: &Session, form: &str) -> Vec<bool> {
    let view = session.page.view();
    let questions = view.find(form).unwrap().children.iter().filter_map(|child| match child {
        Child::Node(node) if matches!(node.tag, "fieldset" | "div") => Some(node),
        _ => None,
    });
    let is_marked =
        |question: &Node<Msg>| question.words().contains("Please answer this question.");
    questions.map(is_marked).collect()
}

#[test]
fn somebody_who_is_screened_out_is_sent_back() {
    let mut session = begun();
    let stored = ComprehensionStored {
        screened_out: true,
        after_wrong: AfterWrong::Mark,
        return_url: Some("https://r/".into()),
    };
    let answer = serde_json::to_vec(&stored).unwrap();
    session.tell(Msg::Understood(Ok(answer)));
    assert!(session.words("ended").unwrap().contains("You cannot take part"));
    let view = session.page.view();
    assert_eq!(view.find("return").unwrap().attribute("href"), Some("https://r/"));
}

#[test]
fn whoever_comes_back_after_the_end_finds_the_link() {
    let begun = begun().kept;
    for (code, words) in [("screened_out", "You cannot take part"), ("withdrawn", "Thank you")] {
        let mut session = open(begun.clone(), &StudyConfig::default());
        let gone = Problem { return_url: Some("https://r/".into()), ..refusal(code) };
        session.send("progress", 410, &gone);
        assert!(session.words("ended").unwrap().contains(words), "{:?}", session.words("ended"));
        let view = session.page.view();
        assert_eq!(view.find("return").unwrap().attribute("href"), Some("https://r/"));
    }
}

#[test]
fn questions_come_after_the_scenes() {
    let question = |name: &str, kind, required| QuestionForm {
        name: name.into(),
        kind,
        text: name.into(),
        required,
        options: vec![("a".into(), "A".into()), ("b".into(), "B".into())],
        range: (1, 5),
        ends: ("low".into(), "high".into()),
        max_chars: 100,
    };
    let questions = vec![
        question("why", QuestionKind::Text, false),
        question("who", QuestionKind::Text, true),
        question("which", QuestionKind::Choice, false),
        question("hard", QuestionKind::Scale, true),
    ];
    let mut session = opened(BTreeMap::new(), "");
    session.send("study", 200, &StudyInfo::of(&StudyConfig::default(), Status::Open.into()));
    session.send("texts", 200, &Texts { questions, ..texts() });
    session.equipped();
    session.press("continue");
    session.send("enrol", 201, &enrolled());
    session.send("progress", 200, &Progress { answered: false, ..progress(&["t0"]) });
    session.press("start");
    session.pass(COUNTDOWN_MS + 11_000.0);
    // The last trial is still being sent.
    let fill = |fields: &[(&str, &str)]| {
        let field =
            |&(name, value): &(&str, &str)| (name.to_owned(), FieldValue::Text(value.into()));
        Form::new(fields.iter().map(field).collect())
    };
    let submit = |session: &mut Session, form| {
        let message = session.page.view().submit("questions", form);
        session.tell(message.unwrap());
    };
    submit(&mut session, fill(&[("why", " because ")]));
    assert!(session.words("missing").is_some());
    assert_eq!(marked(&session, "questions"), [false, true, false, true]);
    let view = session.page.view();
    let who = view.find("answer-who").unwrap();
    assert_eq!(who.attribute("aria-invalid"), Some("true"));
    submit(&mut session, fill(&[("why", " because "), ("who", "I"), ("hard", "4")]));
    let body = session.asked.iter().find(|request| request.name == "answers").unwrap().body.clone();
    let answers: Answers = serde_json::from_str(&body.unwrap()).unwrap();
    assert_eq!(
        serde_json::to_value(answers.answers).unwrap(),
        serde_json::json!({"hard": 4, "who": "I", "why": "because"})
    );
    session.send("answers", 200, &serde_json::json!({}));
    session.stored("t1");
    session.completed();
}

#[test]
fn stopping_keeps_or_deletes() {
    for (button, url, words) in [
        ("withdraw-keep", "/api/v1/participants/me?data=keep", "keeps what you did"),
        ("withdraw-delete", "/api/v1/participants/me?data=delete", "have been deleted"),
    ] {
        let mut session = begun();
        session.drive();
        session.unreachable("upload");
        session.press("stop");
        session.press("back");
        session.press("stop");
        if button == "withdraw-keep" {
            // Trials in the outbox are sent first.
            assert!(session.words("saved").unwrap().contains("1 scene not sent yet"));
            assert_eq!(session.page.view().press(button).map(drop), None);
            session.wake("upload-retry");
            session.stored("t0");
        }
        session.press(button);
        let withdrawal = session.asked.iter().find(|request| request.name == "withdraw");
        assert_eq!(withdrawal.unwrap().url, url);
        session.send("withdraw", 200, &Withdrawn { return_url: Some("https://r/".into()) });
        assert!(session.words("ended").unwrap().contains(words));
        // If the data are deleted, nothing remains in the browser. Otherwise, the participant can
        // return to this page.
        let kept: Vec<_> = session.kept.keys().map(String::as_str).collect();
        let expected: &[_] =
            if button == "withdraw-keep" { &["sidestep.session.default"] } else { &[] };
        assert_eq!(kept, expected);
        assert!(!session.guarded);
    }
}

/// A study that asks new questions in the comprehension check after a wrong answer.
#[test]
fn after_a_wrong_answer_other_questions_come() {
    for after_wrong in [AfterWrong::Renew, AfterWrong::Reread] {
        let mut study = StudyConfig::default();
        study.comprehension.after_wrong = after_wrong;
        let form = |text: &str, answer| CheckForm {
            text: text.into(),
            options: vec!["Yes".into(), "No".into()],
            answer,
        };
        let mut session = opened(BTreeMap::new(), "");
        session.send("study", 200, &StudyInfo::of(&study, Status::Open.into()));
        session.send("texts", 200, &Texts { check: vec![form("Anybody’s?", 0)], ..texts() });
        session.equipped();
        session.press("continue");
        session.send("enrol", 201, &enrolled());
        session.send("texts", 200, &Texts { check: vec![form("One?", 0)], ..texts() });
        session.send("progress", 200, &Progress { understood: false, ..progress(&[]) });
        session.press("continue");
        assert!(session.text().contains("One?"), "{}", session.text());
        let answer = |session: &mut Session, option: &str| {
            let field = ("check-0".to_owned(), FieldValue::Text(option.into()));
            let message = session
                .page
                .view()
                .submit("comprehension", Form::new([field].into_iter().collect()));
            session.tell(message.unwrap());
        };
        let stored = ComprehensionStored { screened_out: false, after_wrong, return_url: None };
        answer(&mut session, "1");
        session.send("check", 200, &stored);
        // The page does not show which answer was wrong. It ignores answers until the new questions
        // have arrived.
        answer(&mut session, "0");
        assert_eq!(session.urls(), ["/api/v1/studies/default/texts"]);
        assert!(
            !session.text().contains("That is not right") && !session.text().contains("Right.")
        );
        session.send("texts", 200, &Texts { check: vec![form("Two?", 1)], ..texts() });
        assert!(session.words("hint").unwrap().starts_with("Not all answers were right."));
        if after_wrong == AfterWrong::Reread {
            assert!(session.words("comprehension").is_none());
            session.press("continue");
        }
        assert!(session.text().contains("Two?"));
        answer(&mut session, "1");
        let sent = session.asked[0].body.as_ref().unwrap();
        let sent: ComprehensionResult = serde_json::from_str(sent).unwrap();
        assert_eq!(sent, ComprehensionResult { attempts: 2, passed: true });
        session.send("check", 200, &stored);
        session.press("continue");
        assert!(session.words("start").is_some() && session.words("hint").is_none());
    }
}
