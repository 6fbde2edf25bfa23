//! Tests of the list of studies, of their participants and of their trials.

use super::*;
use sidestep::api::{
    ParticipantPage, ParticipantSummary, Quality, Stage, StageCount, StudySummary,
};
use sidestep::study::Status;

pub(super) fn study(slug: &str, participants: u64) -> StudySummary {
    StudySummary {
        slug: slug.into(),
        title: format!("Study {slug}"),
        status: Status::Open,
        synthetic: false,
        participants,
        complete: participants / 2,
        active: 1,
        doubtful: 0,
        trials: 22,
        pilots: 0,
        last_seen_at_ms: Some(5),
    }
}

/// A page of trials with these ids.
fn listed(ids: &[&str], next_before: Option<i64>) -> TrialPage {
    let summary = trial(unequal(), [None, None]).summary;
    let trials = ids.iter().map(|id| TrialSummary { trial_id: (*id).into(), ..summary.clone() });
    TrialPage { trials: trials.collect(), next_before }
}

pub(super) fn person(number: i64, stage: Stage) -> ParticipantSummary {
    ParticipantSummary {
        participant_id: format!("p{number}"),
        number,
        pilot: false,
        external_id: Some(format!("EXT{number}")),
        stage,
        completion_code: (stage == Stage::Complete).then(|| "CODE".into()),
        comprehension_attempts: 2,
        understood: true,
        stored: 7,
        planned: 59,
        waiting: 0,
        enrolled_at_ms: 1,
        last_seen_at_ms: 2,
        quality: Quality { late_sample: 3, same_timing: 1, ..Quality::default() },
        excluded: false,
    }
}

fn people(participants: Vec<ParticipantSummary>, total: u64) -> ParticipantPage {
    let count = StageCount { stage: Stage::Task, participants: total };
    ParticipantPage { participants, total, stages: vec![count] }
}

#[test]
fn every_study_is_on_the_first_page_and_what_needs_attention() {
    let mut session = signed_in("/lab");
    assert!(session.text().contains("Loading"));
    let doubtful = StudySummary { doubtful: 2, ..study("second", 9) };
    session.send("studies", 200, &vec![study("default", 1), doubtful.clone()]);
    let view = session.page.view();
    let link = view.find("study-second").unwrap();
    assert_eq!(link.attribute("href"), Some("/lab/studies/second"));
    let words = view.find("studies").unwrap().words();
    assert!(words.find("Study second") < words.find("Study default"), "the newest first: {words}");
    assert!(session.words("doubtful").unwrap().starts_with("2 participants steered never"));
    assert!(view.find("first-steps").is_none());
    // Changes are shown without a reload. If the server does not answer, the previous list stays.
    session.changed();
    session.send("studies", 200, &vec![study("default", 30)]);
    assert!(session.words("studies").unwrap().contains("30"));
    session.changed();
    session.unreachable("studies");
    assert!(session.words("old").unwrap().contains("cannot be reached"));
    assert!(session.words("studies").unwrap().contains("30"));
}

#[test]
fn a_new_server_says_how_to_begin() {
    let mut session = signed_in("/lab");
    session.send("studies", 200, &vec![study("default", 0)]);
    let view = session.page.view();
    let href = |name: &str| view.find(name).unwrap().attribute("href").unwrap().to_owned();
    assert_eq!(href("try"), "/s/default?pilot");
    assert_eq!(href("rehearse"), "/s/default?simulate=1&speed=10");
    assert_eq!(session.words("demo").unwrap(), "sidestep serve --demo");
    // People cannot take part in a demonstration study whose data are still being generated.
    let demo = StudySummary { synthetic: true, ..study("demo", 0) };
    session.changed();
    session.send("studies", 200, &vec![demo]);
    assert!(session.page.view().find("first-steps").is_none());
}

#[test]
fn synthetic_participants_are_marked_wherever_their_study_is_shown() {
    let demo = StudySummary { synthetic: true, ..study("demo", 12) };
    let mut session = signed_in("/lab");
    session.send("studies", 200, &vec![demo.clone()]);
    let marked = |session: &Session| session.words("marked-synthetic");
    assert!(marked(&session).unwrap().contains("a program drove, no person"));
    session.changed();
    session.send("studies", 200, &vec![study("default", 3)]);
    assert_eq!(marked(&session), None);
    for page in ["", "/trials", "/analyses", "/export", "/configuration"] {
        let mut session = signed_in(&format!("/lab/studies/demo{page}"));
        session.send("study", 200, &demo);
        match page {
            "" => session.send("participants", 200, &people(Vec::new(), 0)),
            "/trials" => session.send("newest", 200, &listed(&[], None)),
            "/analyses" => session.send("analyses", 200, &super::analyses::list(Vec::new())),
            "/configuration" => {
                let draft = super::configuration::configuration("slug = \"demo\"\n", 1);
                session.send("configuration", 200, &draft);
            }
            _ => {}
        }
        assert!(marked(&session).is_some(), "{page}: {}", session.text());
    }
}

#[test]
fn a_study_that_is_not_there_says_so() {
    for page in ["/lab/studies/none", "/lab/studies/none/trials"] {
        let mut session = signed_in(page);
        session.answer("study", 404, br#"{"code":"not_found","message":"there is no such study"}"#);
        assert!(session.words("stuck").unwrap().contains("There is no such study"), "{page}");
    }
}

#[test]
fn participants_are_chosen_sorted_and_paged_by_the_server() {
    let mut session = signed_in("/lab/studies/pilot?stage=task");
    let list = |session: &Session| session.urls().last().unwrap().to_string();
    let start = "/api/v1/admin/studies/pilot/participants?limit=50";
    assert_eq!(list(&session), format!("{start}&stage=task"));
    session.send("study", 200, &study("pilot", 120));
    session.send("participants", 200, &people(vec![person(1, Stage::Task)], 120));
    let row = session.words("participants").unwrap();
    for words in ["EXT1", "7 / 59", "passed, 2 tries", "late samples 3", "identical timing 1"] {
        assert!(row.contains(words), "{words}: {row}");
    }
    assert_eq!(session.words("range").unwrap(), "1–1 of 120");
    // A new selection starts at the first page and changes the address.
    session.press("next");
    assert_eq!(list(&session), format!("{start}&stage=task&offset=50"));
    session.press("stage-all");
    assert_eq!(list(&session), start);
    session.press("sort-stored");
    assert_eq!(list(&session), format!("{start}&sort=stored&order=desc"));
    let entered = session.page.view().enter("having", FieldValue::Text("late_sample".into()));
    session.tell(entered.unwrap());
    let searched = Form::new(vec![("search".into(), FieldValue::Text(" a b ".into()))]);
    session.tell(session.page.view().submit("search-form", searched).unwrap());
    let query = "limit=50&having=late_sample&search=a%20b&sort=stored&order=desc";
    assert!(list(&session).ends_with(query), "{}", list(&session));
    assert_eq!(session.visited.last().unwrap(), &format!("/lab/studies/pilot?{query}"));
    session.send("participants", 200, &people(Vec::new(), 0));
    assert!(session.words("nobody").unwrap().contains("matches the filters"));
    let pilots = session.page.view().enter("pilots", FieldValue::Checked(true));
    session.tell(pilots.unwrap());
    assert_eq!(list(&session), format!("{start}&pilot=true"));
    session.send("participants", 200, &people(Vec::new(), 0));
    assert!(session.words("nobody").unwrap().contains("No test runs yet"));
}

#[test]
fn participants_are_shown_as_they_come() {
    let mut session = signed_in("/lab/studies/pilot");
    session.send("study", 200, &study("pilot", 0));
    session.send("participants", 200, &people(Vec::new(), 0));
    assert!(session.words("nobody").unwrap().contains("No participants yet"));
    session.changed();
    session.send("study", 200, &study("pilot", 1));
    session.send("participants", 200, &people(vec![person(1, Stage::Complete)], 1));
    assert!(session.words("participants").unwrap().contains("CODE"));
    assert!(session.words("counts").unwrap().starts_with("1 participant ·"));
    // A page that does not follow changes gets no change events.
    session.go("/lab/self-check");
    assert!(session.following.is_empty());
}

#[test]
fn who_may_only_look_is_offered_nothing_to_take_away() {
    for (access, offered) in [(Access::Read, false), (Access::Export, true)] {
        let mut session = signed_in_to("/lab/studies/pilot", access);
        session.send("study", 200, &study("pilot", 1));
        session.send("participants", 200, &people(vec![person(1, Stage::Complete)], 1));
        assert_eq!(session.words("export").is_some(), offered);
        assert_eq!(session.text().contains("External id"), offered);
        session.go("/lab/studies/pilot/trials");
        session.send("study", 200, &study("pilot", 1));
        session.send("newest", 200, &listed(&["t"], None));
        assert_eq!(session.words("export").is_some(), offered);
    }
}

#[test]
fn a_study_is_shown_with_its_trials_or_not_yet() {
    for (ids, table) in [(&["t"][..], true), (&[], false)] {
        let mut session = signed_in("/lab/studies/pilot/trials");
        session.send("study", 200, &study("pilot", 9));
        let view = session.page.view();
        assert!(view.find("trials").is_none() && view.words().contains("Loading"));
        session.send("newest", 200, &listed(ids, None));
        let view = session.page.view();
        assert_eq!(view.find("trials").is_some(), table);
        assert_eq!(view.words().contains("No trials yet"), !table);
        assert_eq!(session.page.title(), "Study pilot: trials · Sidestep laboratory");
    }
}

#[test]
fn new_trials_come_before_the_others_once() {
    let mut session = signed_in("/lab/studies/pilot/trials");
    session.send("study", 200, &study("pilot", 9));
    session.send("newest", 200, &listed(&["b", "a"], Some(7)));
    let links = |session: &Session| session.words("trials").unwrap().matches("Replay").count() - 1;
    for (newest, shown) in [(&["b", "a"][..], 2), (&["d", "c", "b"], 4), (&["f", "e"], 2)] {
        session.changed();
        session.send("newest", 200, &listed(newest, Some(8)));
        assert_eq!(links(&session), shown, "after {newest:?}");
    }
}

#[test]
fn older_trials_come_once_however_often_they_are_asked_for() {
    let mut session = signed_in("/lab/studies/pilot/trials");
    session.send("study", 200, &study("pilot", 9));
    session.send("newest", 200, &listed(&["b"], Some(7)));
    let more = session.page.view().press("more").unwrap();
    session.tell(more.clone());
    session.tell(more);
    assert_eq!(session.urls().len(), 1);
    assert!(session.urls()[0].ends_with("&before=7"), "{:?}", session.urls());
    assert!(session.page.view().press("more").is_none(), "the button is off meanwhile");
    // After a failure, the list and the button remain.
    session.unreachable("older");
    assert!(session.words("trials").is_some());
    assert!(session.words("no-more").unwrap().contains("cannot be reached"));
    session.press("more");
    assert_eq!(session.words("no-more"), None);
    session.send("older", 200, &listed(&["a"], None));
    let table = session.words("trials").unwrap();
    assert_eq!(table.matches("Replay").count(), 3, "the column and two rows: {table}");
    assert!(session.words("more").is_none());
}
