//! Tests of network failures, of invalid links, and of a computer that sleeps.

use super::*;

#[test]
fn all_that_the_page_needs_is_asked_again() {
    let mut session = opened(BTreeMap::new(), "");
    session.unreachable("study");
    session.unreachable("texts");
    assert!(session.words("trouble").unwrap().contains("keeps trying"));
    session.wake("retry");
    session.send("study", 200, &StudyInfo::of(&StudyConfig::default(), Status::Open.into()));
    session.send("texts", 200, &texts());
    assert!(session.words("consent").is_some() && session.words("trouble").is_none());
}

#[test]
fn another_language_is_asked_for_until_it_comes() {
    let mut session = welcomed();
    session.tell(Msg::Language("de".into()));
    session.unreachable("texts");
    assert!(session.words("trouble").unwrap().contains("keeps trying"));
    session.wake("retry");
    assert!(session.urls()[0].ends_with("?language=de"), "{:?}", session.urls());
    session.send("texts", 200, &texts());
    assert_eq!(session.words("trouble"), None);
}

#[test]
fn the_result_of_the_check_is_sent_until_it_is_stored() {
    let mut session = opened(BTreeMap::new(), "");
    let check =
        CheckForm { text: "Yes?".into(), options: vec!["Yes".into(), "No".into()], answer: 0 };
    session.send("study", 200, &StudyInfo::of(&StudyConfig::default(), Status::Open.into()));
    session.send("texts", 200, &Texts { check: vec![check], ..texts() });
    session.equipped();
    session.press("continue");
    session.send("enrol", 201, &enrolled());
    session.send("progress", 200, &Progress { understood: false, ..progress(&[]) });
    session.press("continue");
    let right = Form::new(vec![("check-0".into(), FieldValue::Text("0".into()))]);
    let message = session.page.view().submit("comprehension", right);
    session.tell(message.unwrap());
    let sent = session.asked[0].body.clone();
    session.unreachable("check");
    assert!(session.words("trouble").unwrap().contains("keeps trying"));
    session.wake("retry");
    assert_eq!(session.asked[0].body, sent);
    session.send(
        "check",
        200,
        &ComprehensionStored {
            screened_out: false,
            after_wrong: AfterWrong::Mark,
            return_url: None,
        },
    );
    assert_eq!(session.words("trouble"), None);
    session.press("continue");
    assert!(session.words("start").is_some());
}

#[test]
fn a_withdrawal_is_sent_until_it_is_stored_unless_the_person_goes_back() {
    for back in [false, true] {
        let mut session = begun();
        session.press("stop");
        session.press("withdraw-delete");
        session.unreachable("withdraw");
        assert!(session.words("trouble").unwrap().contains("keeps trying"));
        if back {
            session.press("back");
        }
        session.wake("retry");
        let urls = [[routes::ME.to_owned() + "?data=delete"], [routes::ME.to_owned()]];
        assert_eq!(session.urls(), urls[usize::from(back)]);
    }
}

#[test]
fn a_link_that_is_wrong_leaves_the_participation_of_this_browser_alone() {
    // First, the link is opened in a browser that has stored nothing.
    let mut stranger = opened(BTreeMap::new(), "#continue=forged");
    stranger.send("study", 200, &StudyInfo::of(&StudyConfig::default(), Status::Open.into()));
    stranger.send("texts", 200, &texts());
    stranger.send("progress", 401, &refusal("unauthorised"));
    assert!(stranger.asked.is_empty(), "what would come later says nothing of the link");
    assert!(stranger.words("trouble").unwrap().contains("not valid"));
    assert!(stranger.words("consent").is_some());
    // Then, the link is opened in the browser of a participant.
    let kept = begun().kept;
    let mut session = open_at(kept.clone(), &StudyConfig::default(), "#continue=forged");
    assert_eq!(session.asked[0].token.as_deref(), Some("forged"));
    session.send("progress", 401, &refusal("unauthorised"));
    session.send("study", 200, &StudyInfo::of(&StudyConfig::default(), Status::Open.into()));
    session.send("texts", 200, &texts());
    assert_eq!(session.asked[0].token.as_deref(), Some("secret"));
    session.send("progress", 200, &progress(&["t0"]));
    assert!(session.words("start").is_some());
    assert_eq!(session.kept, kept);
}

#[test]
fn a_reload_before_the_answer_to_an_enrolment_enrols_nobody_else() {
    let mut first = welcomed();
    first.equipped();
    first.press("continue");
    let name = |session: &Session| {
        let body = session.asked[0].body.as_ref().unwrap();
        serde_json::from_str::<Enrolment>(body).unwrap().request_id.unwrap()
    };
    let mut second = open(first.kept.clone(), &StudyConfig::default());
    second.page.context.random_name = Some("fedcba9876543210".into());
    second.equipped();
    second.press("continue");
    assert_eq!(name(&second), name(&first));
    second.send("enrol", 200, &enrolled());
    assert!(!second.kept.keys().any(|name| name.contains("request")), "{:?}", second.kept.keys());
}

#[test]
fn a_countdown_that_nobody_saw_begins_again() {
    let mut session = begun();
    session.press("start");
    session.pass(COUNTDOWN_MS / 2.0);
    session.at(session.now_ms + 60_000.0).frame();
    assert!(session.words("start").is_some());
    // The scene has not moved, so it does not count as an exposure.
    assert!(!session.kept.keys().any(|name| name.contains("exposures")));
    session.drive();
    assert_eq!(session.uploaded("t0").exposures, 1);
}
