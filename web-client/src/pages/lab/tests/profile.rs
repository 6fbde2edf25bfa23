//! Tests of the page of one participant.

use super::studies::person;
use super::*;
use sidestep::api::{ExcludedBy, Note, ParticipantDetail, Stage, TrialPicture};

fn detail() -> ParticipantDetail {
    let summary = trial(unequal(), [None, None]).summary;
    let picture = TrialPicture {
        summary,
        human: vec![[0.0, 0.0], [4.0, 1.0]],
        robot: vec![[10.0, 0.0], [6.0, 0.0]],
        inputs: "SLLRS".to_owned().try_into().unwrap(),
    };
    ParticipantDetail {
        summary: person(7, Stage::Task),
        study: "pilot".into(),
        configuration: "0123456789abcdef".into(),
        synthetic: false,
        configuration_number: Some(2),
        configuration_label: "spring".into(),
        danger_radius_m: 3.0,
        withdrawn_at_ms: None,
        data_deleted: false,
        answers: [("age".to_owned(), 31.into())].into(),
        parameters: [("STUDY_ID".to_owned(), "s1".to_owned())].into(),
        exclusion: None,
        notes: vec![Note { id: 3, text: "Called.".into(), at_ms: 1, who: "Ada".into() }],
        trials: vec![picture],
    }
}

fn opened(access: Access) -> Session {
    let mut session = signed_in_to("/lab/participants/p7", access);
    session.send("participant", 200, &detail());
    session
}

#[test]
fn a_program_is_no_person() {
    let mut session = opened(Access::Read);
    assert!(session.page.view().find("marked-synthetic").is_none());
    session.changed();
    session.send("participant", 200, &ParticipantDetail { synthetic: true, ..detail() });
    assert!(session.words("marked-synthetic").unwrap().contains("a program drove"));
}

#[test]
fn a_participant_is_shown_with_their_trials_as_pictures() {
    let session = opened(Access::Export);
    assert_eq!(session.page.title(), "Participant 7 · Sidestep laboratory");
    let about = session.words("about").unwrap();
    for words in ["7 of 59", "passed at attempt 2", "EXT7", "version 2, labelled “spring”", "s1"]
    {
        assert!(about.contains(words), "{words}: {about}");
    }
    assert!(session.words("answers").unwrap().contains("31"));
    let view = session.page.view();
    let link = view.find("replay-link").unwrap();
    assert_eq!(link.attribute("href"), Some("/lab/replay/t"));
    assert!(session.words("timeline").unwrap().contains("task 1"));
    // A user without the right to manage cannot change anything.
    for control in ["new-note", "exclude-form", "delete", "delete-note-3"] {
        assert!(session.words(control).is_none(), "{control}");
    }
    assert!(session.words("notes").unwrap().contains("Called."));
}

#[test]
fn notes_and_exclusions_are_written_and_taken_back() {
    let mut session = opened(Access::Manage);
    let form = |name: &str, text: &str| {
        Form::new(vec![(name.to_owned(), FieldValue::Text(text.to_owned()))])
    };
    session.tell(session.page.view().submit("new-note", form("text", " Came late. ")).unwrap());
    let request = session.asked.last().unwrap();
    assert_eq!(
        (request.method, request.url.as_str()),
        ("POST", "/api/v1/admin/participants/p7/notes")
    );
    assert_eq!(request.body.as_deref(), Some(r#"{"text":"Came late."}"#));
    session.answer(
        "change",
        422,
        br#"{"code":"invalid","message":"expected text","field":"text"}"#,
    );
    assert_eq!(session.words("trouble").unwrap(), "Expected text.");
    session.press("delete-note-3");
    session.answer("change", 204, b"");
    assert_eq!(session.words("trouble"), None);
    session.send("participant", 200, &detail());
    session.tell(session.page.view().submit("exclude-form", form("reason", "phone")).unwrap());
    session.answer("change", 204, b"");
    let exclusion = ExcludedBy { reason: "phone".into(), at_ms: 1, who: "Ada".into() };
    let excluded = ParticipantDetail { exclusion: Some(exclusion), ..detail() };
    session.send("participant", 200, &excluded);
    assert!(session.words("reason").unwrap().ends_with("phone"));
    assert!(session.words("exclude-form").is_none());
    session.press("include");
    let request = session.asked.last().unwrap();
    let url = "/api/v1/admin/participants/p7/exclusion";
    assert_eq!((request.method, request.url.as_str()), ("DELETE", url));
}

#[test]
fn data_are_deleted_at_the_second_press() {
    let mut session = opened(Access::Manage);
    session.press("delete");
    session.press("keep");
    session.press("delete");
    session.press("sure");
    assert_eq!(session.asked.last().unwrap().method, "DELETE");
    session.answer("change", 204, b"");
    let deleted = ParticipantDetail { data_deleted: true, trials: Vec::new(), ..detail() };
    session.send("participant", 200, &deleted);
    assert_eq!(session.words("no-trials").unwrap(), "The data were deleted.");
    assert!(session.words("delete").is_none() && session.words("exclude-form").is_none());
}

#[test]
fn a_participant_without_trials_or_who_is_not_there_says_so() {
    let mut session = signed_in("/lab/participants/p7");
    session.send("participant", 200, &ParticipantDetail { trials: Vec::new(), ..detail() });
    assert_eq!(session.words("no-trials").unwrap(), "No trial is stored yet.");
    session.go("/lab/participants/none");
    let none = br#"{"code":"not_found","message":"there is no such participant"}"#;
    session.answer("participant", 404, none);
    assert!(session.words("stuck").unwrap().contains("no such participant"));
}
