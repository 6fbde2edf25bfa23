//! The tests that every back end must pass use only the store's operations. The tests at the end
//! are for SQLite's writer.

use super::audit::NewEntry;
use super::enrolments::{Enrolment, Gate, NewParticipant};
use super::lanes::Lock;
use super::participants::{Completion, Scope};
use super::retention::Concern;
use super::scenes::PlannedRow;
use super::sql::{Connection, Row};
use super::trials::{NewTrial, PutTrial};
use super::{Database, Purpose, Store, StoreError};
use crate::transfer::{self, TransferError};
use crate::trial_content::{Content, Recipe};
use sidestep::api::{Action, ComprehensionResult};
use sidestep::comparison::Request;
use sidestep::scene::{Scene, SceneParameters};
use sidestep::study::StudyConfig;
use sidestep::trial::{Phase, outcome, simulate};
use sidestep::vehicle::{Pose, TurnInput};
use sqlx::{Connection as _, Executor};
use std::pin::Pin;
use std::sync::{Arc, Mutex, mpsc};
use std::task::{Context, Poll, Waker};
use std::time::Duration;
use tempfile::TempDir;
use tokio::sync::oneshot;
use tokio_util::sync::CancellationToken;

/// A new, separate store. It is in the PostgreSQL cluster that `SIDESTEP_TEST_POSTGRES` names (an
/// address with DATABASE instead of the database name). Without this variable, the store is a file.
pub(crate) async fn store() -> (TempDir, Store) {
    let (folder, url) = address().await;
    (folder, Store::open(&url, Purpose::Create).await.unwrap())
}

/// The address of a new database.
async fn address() -> (TempDir, String) {
    let folder = TempDir::new().unwrap();
    let Ok(cluster) = std::env::var("SIDESTEP_TEST_POSTGRES") else {
        let url = format!("sqlite:{}", folder.path().join("test.db").display());
        return (folder, url);
    };
    let name = format!("store_{}", uuid::Uuid::new_v4().simple());
    let address = cluster.replace("DATABASE", "postgres");
    let mut session = sqlx::PgConnection::connect(&address).await.unwrap();
    session.execute(sqlx::AssertSqlSafe(format!("CREATE DATABASE {name}"))).await.unwrap();
    (folder, cluster.replace("DATABASE", &name))
}

/// A store in a file in its own folder.
pub(crate) async fn file_store() -> (TempDir, Store) {
    let folder = TempDir::new().unwrap();
    let url = format!("sqlite:{}", folder.path().join("test.db").display());
    let store = Store::open(&url, Purpose::Create).await.unwrap();
    (folder, store)
}

/// Identifiers by which an enrolling participant can be recognised.
#[derive(Clone, Debug, Default)]
pub(crate) struct Known {
    pub(crate) external_key: Option<String>,
    pub(crate) request_hash: Option<[u8; 32]>,
}

/// Everyone may enrol.
const OPEN: Gate = Gate { is_open: true, quota: 0, away_before_ms: 0 };

/// Enrols a participant with a plan of two tasks. The ids of the trials begin with the participant's
/// name.
pub(crate) async fn someone(store: &Store, name: &str, known: Known) -> Enrolment {
    let enrolled = arrives(store, name, known, OPEN, 1).await;
    let (human, robot) = (Pose::from([0.0, 0.0, 0.0]), Pose::from([15.0, 10.0, -2.0]));
    let scene = Scene::new(&StudyConfig::default().parameters, human, robot);
    let planned = |index: usize| PlannedRow {
        trial_id: format!("{name}-{index}"),
        ordinal: index as i64,
        phase: Phase::Task,
        index,
        attempt: 1,
        scene: scene.clone(),
        stored: false,
    };
    if let Enrolment::New(new) = &enrolled {
        store.put_plan(&new.id, vec![planned(0), planned(1)]).await.unwrap();
    }
    enrolled
}

/// Enrols a participant without a plan.
async fn arrives(store: &Store, name: &str, known: Known, gate: Gate, now_ms: i64) -> Enrolment {
    let study = store.put_study(&StudyConfig::default(), 0).await.unwrap();
    let new = NewParticipant {
        id: name.to_owned(),
        study_id: study.id,
        request_hash: known.request_hash,
        external_id: known.external_key.clone(),
        external_key: known.external_key,
        pilot_place: None,
        config_hash: study.config_hash,
        locale: None,
        screen: None,
        parameters: None,
        consent: None,
        enrolled_at_ms: now_ms,
    };
    store.enrol(new, gate, token(name)).await.unwrap()
}

fn token(name: &str) -> [u8; 32] {
    crate::support::secrets::hash(name)
}

pub(crate) fn trial(trial_id: &str, turn: TurnInput) -> NewTrial {
    let parameters = SceneParameters::default();
    let robot = Pose::from([15.0, 10.0, -2.0]);
    let scene = Scene::new(&parameters, Pose::from([0.0, 0.0, 0.0]), robot);
    let inputs = vec![turn; 50];
    let states = simulate(&parameters, &scene, &inputs);
    let outcome = outcome(&parameters, &inputs, &states);
    let content = Content {
        started_at_ms: Some(7.0),
        inputs,
        states,
        sampled_at_ms: Some((0..50).map(f64::from).collect()),
        key_events: "[]".to_owned(),
        page_events: Some("[]".to_owned()),
        exposures: Some(1),
        display: "{}".to_owned(),
    };
    NewTrial {
        trial_id: trial_id.to_owned(),
        recipe: Recipe::UploadWithPage,
        content_hash: Recipe::UploadWithPage.hash(&content),
        received_at_ms: 5,
        content,
        flags: Vec::new(),
        outcome,
        key_timing: None,
        repeated_as: None,
        waiting: 0,
    }
}

#[tokio::test]
async fn counting_trials_again_finds_what_was_counted() {
    let (_folder, store) = store().await;
    for (name, turns) in [
        ("ada", &[TurnInput::Left, TurnInput::Straight][..]),
        ("bob", &[TurnInput::Right]),
        ("eve", &[]),
    ] {
        someone(&store, name, Known::default()).await;
        for (i, turn) in turns.iter().enumerate() {
            let new = NewTrial { key_timing: Some(1), ..trial(&format!("{name}-{i}"), *turn) };
            store.put_trial(name, new).await.unwrap();
        }
    }
    let tallies = async || {
        let read = |db: &Connection| {
            let mut statement = db.prepare_cached(
                "SELECT participant_id, next_phase, task, never_steered, always_steered, \
                     danger_entered, same_timing FROM tally ORDER BY participant_id",
            )?;
            let row = |row: &Row| {
                let counts: [i64; 5] =
                    [row.get(2)?, row.get(3)?, row.get(4)?, row.get(5)?, row.get(6)?];
                Ok((row.get::<_, String>(0)?, row.get::<_, Option<String>>(1)?, counts))
            };
            Ok(statement.query_map([], row)?.collect::<Result<Vec<_>, _>>()?)
        };
        store.read_long(read).await.unwrap()
    };
    let counted = tallies().await;
    assert_eq!(counted[0].2[..3], [2, 1, 1], "{counted:?}");
    assert_eq!(counted[1].2[4], 1, "{counted:?}");
    for name in ["ada", "bob", "eve"] {
        store.count_again(name).await.unwrap();
    }
    assert_eq!(tallies().await, counted);
    store.drop_unsound("ada-1").await.unwrap();
    assert_eq!(store.wrong_tallies().await.unwrap(), ["ada"]);
    store.count_again("ada").await.unwrap();
    assert_eq!(store.wrong_tallies().await.unwrap(), [""; 0]);
}

#[tokio::test]
async fn trials_that_wait_together_are_stored_as_one_by_one() {
    let (_folder, store) = store().await;
    for name in ["ada", "bob", "eve"] {
        someone(&store, name, Known::default()).await;
    }
    let put = async |name: &str, i: usize, again: Option<&str>| {
        let repeated_as = again.map(str::to_owned);
        let new = trial(&format!("{name}-{i}"), TurnInput::Left);
        store.put_trial(name, NewTrial { key_timing: Some(1), repeated_as, ..new }).await
    };
    // While this operation blocks the writer of a file, the other operations are queued together. On
    // PostgreSQL, they arrive at about the same time.
    let first = store.write([], |_| {
        std::thread::sleep(Duration::from_millis(100));
        Ok(())
    });
    let (_, a, b, unknown, next, wrong) = tokio::join!(
        first,
        put("ada", 0, None),
        put("bob", 0, None),
        put("bob", 9, None),
        put("ada", 1, None),
        // A scene has this id already.
        put("eve", 0, Some("bob-1")),
    );
    for stored in [a, b, next] {
        assert!(matches!(stored, Ok(PutTrial::Stored { .. })), "{stored:?}");
    }
    assert!(matches!(unknown, Ok(PutTrial::Unknown)), "{unknown:?}");
    assert!(matches!(wrong, Err(StoreError::Defect(_))), "{wrong:?}");
    if store.is_shared() {
        // The trials may have been stored in two transactions.
        return;
    }
    assert_eq!(store.wrong_tallies().await.unwrap(), [""; 0]);
    let same = "SELECT CAST(sum(same_timing) AS BIGINT) FROM tally";
    let same = store.read(move |db| Ok(db.query_row(same, [], |row| row.get::<_, i64>(0))?)).await;
    assert_eq!(same.unwrap(), 2, "all but the first");
}

#[tokio::test]
async fn trials_are_stored_once_and_in_order() {
    let (_folder, store) = store().await;
    someone(&store, "ada", Known::default()).await;
    let put = async |who: &str, id: &str, turn| store.put_trial(who, trial(id, turn)).await;
    let (left, right) = (TurnInput::Left, TurnInput::Right);
    let next = |id: &str| Some(id.to_owned());
    let early = PutTrial::OutOfOrder { next: "ada-0".to_owned() };
    assert_eq!(put("ada", "ada-1", left).await, Ok(early));
    assert_eq!(put("ada", "ada-0", left).await, Ok(PutTrial::Stored { next: next("ada-1") }));
    assert_eq!(put("ada", "ada-0", left).await, Ok(PutTrial::Same { next: next("ada-1") }));
    assert_eq!(put("ada", "ada-0", right).await, Ok(PutTrial::Different));
    assert_eq!(put("ada", "ada-1", right).await, Ok(PutTrial::Stored { next: None }));
    assert_eq!(put("ada", "bob-0", right).await, Ok(PutTrial::Unknown));
    let stored = store.trials_of("ada").await.unwrap();
    assert_eq!(stored.len(), 2);
    assert_eq!(stored[0].content.inputs, trial("ada-0", left).content.inputs);
    assert_eq!(stored[0].content_hash, stored[0].recipe.hash(&stored[0].content));
    store.withdraw("ada", false, 9, None).await.unwrap();
    assert_eq!(put("ada", "ada-0", left).await, Ok(PutTrial::Withdrawn));
    store.withdraw("ada", true, 10, None).await.unwrap();
    assert_eq!(put("ada", "ada-0", left).await, Ok(PutTrial::Withdrawn));
    let counts = store.counts().await.unwrap();
    assert_eq!((counts.participants, counts.trials), (1, 0));
}

#[tokio::test]
async fn an_upload_is_compared_by_the_recipe_of_the_row() {
    let (_folder, store) = store().await;
    someone(&store, "ada", Known::default()).await;
    let mut stored = trial("ada-0", TurnInput::Left);
    stored.recipe = Recipe::PackedBytes;
    stored.content_hash = stored.recipe.hash(&stored.content);
    store.put_trial("ada", stored).await.unwrap();
    let same = store.put_trial("ada", trial("ada-0", TurnInput::Left)).await.unwrap();
    assert_eq!(same, PutTrial::Same { next: Some("ada-1".to_owned()) });
    let other = store.put_trial("ada", trial("ada-0", TurnInput::Right)).await.unwrap();
    assert_eq!(other, PutTrial::Different);
}

#[tokio::test]
async fn whoever_is_known_keeps_their_plan() {
    let (_folder, store) = store().await;
    let named = |external: Option<&str>, request: Option<&str>| Known {
        external_key: external.map(str::to_owned),
        request_hash: request.map(token),
    };
    let is = |outcome: Enrolment| match outcome {
        Enrolment::New(_) => "new".to_owned(),
        Enrolment::Known(known, Scope::Full) => known.id,
        Enrolment::Known(known, Scope::Continue) => format!("{} by name", known.id),
        Enrolment::Over(_) => "over".to_owned(),
        other => format!("{other:?}"),
    };
    assert_eq!(is(someone(&store, "a", named(Some("x"), Some("r"))).await), "new");
    assert_eq!(is(someone(&store, "b", named(Some("x"), None)).await), "a by name");
    assert_eq!(is(someone(&store, "c", named(None, Some("r"))).await), "a");
    assert_eq!(is(someone(&store, "d", named(Some("y"), Some("s"))).await), "new");
    // Every token that was issued to them is valid.
    for name in ["a", "b", "c"] {
        let visitor = store.visitor(token(name)).await.unwrap().unwrap();
        assert_eq!(visitor.participant.id, "a");
        assert_eq!(visitor.scope == Scope::Full, name != "b");
    }
    let found = store.assignment(token("c"), "a-1").await.unwrap().unwrap();
    assert!(found.visitor.participant.id == "a" && found.scene.is_some());
    assert!(store.assignment(token("c"), "d-0").await.unwrap().unwrap().scene.is_none());
    store.withdraw("a", false, 1, None).await.unwrap();
    assert_eq!(is(someone(&store, "e", named(None, Some("r"))).await), "over");
    store.withdraw("a", true, 1, None).await.unwrap();
    assert_eq!(is(someone(&store, "f", named(Some("x"), Some("r"))).await), "new");
    assert_eq!(store.visitor(token("f")).await.unwrap().unwrap().participant.number, 3);
}

#[tokio::test]
async fn a_completion_keeps_its_first_code() {
    let (_folder, store) = store().await;
    someone(&store, "ada", Known::default()).await;
    let complete = async |code: &str, required: bool| {
        let visitor = store.visitor(token("ada")).await.unwrap().unwrap();
        store.complete(&visitor, required, code.to_owned(), 1).await.unwrap()
    };
    assert_eq!(complete("A", false).await, Completion::Incomplete { missing: 2, of: 2 });
    for id in ["ada-0", "ada-1"] {
        store.put_trial("ada", trial(id, TurnInput::Left)).await.unwrap();
    }
    assert_eq!(complete("A", true).await, Completion::Unanswered);
    assert_eq!(store.put_answers("ada", Scope::Full, "{}".to_owned(), 1).await, Ok(true));
    for code in ["A", "B"] {
        let code = complete(code, true).await;
        assert_eq!(code, Completion::Complete { code: "A".to_owned(), visible: true });
    }
    assert_eq!(store.put_answers("ada", Scope::Full, "{}".to_owned(), 1).await, Ok(true));
    assert_eq!(store.put_answers("ada", Scope::Full, "{\"x\":1}".to_owned(), 1).await, Ok(false));
    store.withdraw("ada", false, 1, None).await.unwrap();
    assert_eq!(complete("C", false).await, Completion::Withdrawn);
}

#[tokio::test]
async fn somebody_new_gets_the_lowest_free_place() {
    let (_folder, store) = store().await;
    let gate = |quota, away_before_ms| Gate { is_open: true, quota, away_before_ms };
    let comes = async |name: &str, gate: Gate, now_ms: i64| match arrives(
        &store,
        name,
        Known::default(),
        gate,
        now_ms,
    )
    .await
    {
        Enrolment::New(new) => new.place,
        Enrolment::Full => None,
        other => panic!("{other:?}"),
    };
    for (name, place) in [("a", 0), ("b", 1), ("c", 2)] {
        assert_eq!(comes(name, gate(0, 0), 10).await, Some(place));
    }
    store.withdraw("b", false, 11, None).await.unwrap();
    assert_eq!(comes("d", gate(0, 0), 20).await, Some(1));
    // Without a quota, a participant who stays away keeps their place.
    assert_eq!(comes("e", gate(0, 15), 21).await, Some(3));
    store.withdraw("a", true, 22, None).await.unwrap();
    assert_eq!(comes("f", gate(0, 0), 23).await, Some(0));
    // Four participants have places: c, d, e and f. Participant c has been away since the time 10.
    assert_eq!(comes("g", gate(4, 0), 30).await, None);
    assert_eq!(comes("g", gate(4, 15), 30).await, Some(2));
    assert_eq!(comes("h", gate(4, 15), 30).await, None);
    let checks = async |id: &str, attempts, passed, most, now_ms| {
        let result = ComprehensionResult { attempts, passed };
        store.check_understanding(id, None, result, most, now_ms).await
    };
    // A participant who returns counts for the quota again, and keeps the same place.
    checks("c", 1, true, 0, 31).await.unwrap();
    assert_eq!(comes("i", gate(5, 15), 32).await, None);
    // Participant f is screened out after two failed attempts. The place is free, and the result stays.
    assert_eq!(checks("f", 1, false, 2, 33).await, Ok(false));
    assert_eq!(checks("f", 2, false, 2, 34).await, Ok(true));
    assert_eq!(checks("f", 3, true, 2, 35).await, Ok(true));
    assert_eq!(comes("j", gate(5, 15), 36).await, Some(0));
}

#[tokio::test]
async fn a_plan_is_stored_once() {
    let (_folder, store) = store().await;
    let enrolled = someone(&store, "ada", Known::default()).await;
    let Enrolment::New(ada) = enrolled else { panic!("{enrolled:?}") };
    let mut other = store.plan(&ada.id).await.unwrap();
    other.truncate(1);
    other[0].trial_id = "other".to_owned();
    let kept = store.put_plan(&ada.id, other.clone()).await.unwrap();
    assert_eq!(kept.len(), 2);
    arrives(&store, "bob", Known::default(), OPEN, 1).await;
    store.withdraw("bob", false, 2, None).await.unwrap();
    assert!(store.put_plan("bob", other).await.unwrap().is_empty());
}

#[tokio::test]
async fn an_interrupted_trial_is_followed_by_another_attempt() {
    let (_folder, store) = store().await;
    someone(&store, "ada", Known::default()).await;
    let mut first = trial("ada-0", TurnInput::Left);
    first.repeated_as = Some("again-0".to_owned());
    let put = async |new: NewTrial| store.put_trial("ada", new).await.unwrap();
    let next = |id: &str| Some(id.to_owned());
    assert_eq!(put(first.clone()).await, PutTrial::Stored { next: next("ada-1") });
    first.repeated_as = Some("again-1".to_owned());
    assert_eq!(put(first).await, PutTrial::Same { next: next("ada-1") });
    let stored = put(trial("ada-1", TurnInput::Left)).await;
    assert_eq!(stored, PutTrial::Stored { next: next("again-0") });
    let plan = store.plan("ada").await.unwrap();
    let places: Vec<_> = plan.iter().map(|row| (row.ordinal, row.index, row.attempt)).collect();
    assert_eq!(places, [(0, 0, 1), (1, 1, 1), (2, 0, 2)]);
    assert_eq!(plan[2].scene, plan[0].scene);
    let last = put(trial("again-0", TurnInput::Left)).await;
    assert_eq!(last, PutTrial::Stored { next: None });
}

#[tokio::test]
async fn a_job_that_is_not_wanted_any_more_writes_nothing() {
    let (_folder, store) = store().await;
    someone(&store, "ada", Known::default()).await;
    store.put_trial("ada", trial("ada-0", TurnInput::Left)).await.unwrap();
    let study = store.study("default").await.unwrap().unwrap();
    let request = Request::default();
    let entry = entry(Action::AnalysisRequested);
    store.ask_analysis("first".to_owned(), study.id, &request, entry).await.unwrap();
    let job = store.begin_analysis("a server", 2).await.unwrap().unwrap();
    let long = vec![7; 3 << 20];
    assert!(store.put_analysis_file(&job, "long", 5, long.clone(), 2).await.unwrap());
    store.withdraw("ada", true, 3, None).await.unwrap();
    assert!(!store.note_progress(&job, [1, 2, 1], 3).await.unwrap());
    assert!(!store.put_analysis_file(&job, "more", 5, vec![1], 3).await.unwrap());
    store.put_cells(&job, "key", vec![1]).await.unwrap();
    assert_eq!(store.cells(study.id, "key").await.unwrap(), None);
    let failed = Err("no data".to_owned());
    assert!(!store.end_analysis(&job, &failed, Default::default(), 4).await.unwrap());
    let again = store.begin_analysis("a server", 5).await.unwrap().unwrap();
    assert_eq!((again.sequence, again.attempt), (job.sequence, 2));
    assert!(store.put_analysis_file(&again, "long", 5, long, 5).await.unwrap());
    assert!(store.end_analysis(&again, &failed, Default::default(), 6).await.unwrap());
    let parts = store.read(|db| {
        Ok(db.query_row("SELECT count(*) FROM analysis_file", [], |row| row.get::<_, i64>(0))?)
    });
    assert_eq!(parts.await.unwrap(), 0, "an analysis that failed keeps no file");
}

fn entry(action: Action) -> NewEntry {
    let (key_id, who) = (None, "first key".to_owned());
    NewEntry { at_ms: 1, key_id, who, action, study: None, subject: None }
}

/// Contents of a copied study: a hash of each participant's rows, and the trials in order.
async fn copied(store: &Store, slug: &str) -> (Vec<[u8; 32]>, Vec<String>) {
    let study = store.study(slug).await.unwrap().unwrap();
    let [people, _] = store.copied_ids(study.id).await.unwrap();
    let mut hashes = Vec::new();
    for id in people {
        hashes.push(store.participant_copy(&id).await.unwrap().unwrap().hash());
    }
    let trials = store.trials_page(study.id, i64::MAX, 100).await.unwrap();
    (hashes, trials.into_iter().map(|trial| trial.trial_id).collect())
}

#[tokio::test]
async fn a_copy_has_everything_and_can_be_repeated() {
    let (_folder, from) = file_store().await;
    let (_folder, to) = store().await;
    let (_folder, back) = file_store().await;
    for name in ["ada", "bob", "cleo"] {
        someone(&from, name, Known::default()).await;
    }
    for id in ["bob-0", "ada-0", "bob-1"] {
        let name = &id[..3];
        assert!(from.put_trial(name, trial(id, TurnInput::Left)).await.is_ok());
    }
    from.withdraw("cleo", false, 7, None).await.unwrap();
    let entry = || entry(Action::Excluded);
    assert!(from.exclude("ada", Some("fell asleep".to_owned()), entry()).await.unwrap());
    from.add_note("ada", "a note".to_owned(), entry()).await.unwrap();
    // The destination has another study.
    let other = StudyConfig { slug: "other".to_owned(), ..StudyConfig::default() };
    to.put_study(&other, 3).await.unwrap();

    let stop = CancellationToken::new();
    let slugs = [StudyConfig::default().slug];
    let ignore = |_, _| ();
    let first = transfer::copy(&from, &to, &slugs, &stop, ignore).await.unwrap();
    assert_eq!((first.participants, first.present, first.trials), (3, 0, 3));
    let again = transfer::copy(&from, &to, &slugs, &stop, ignore).await.unwrap();
    assert_eq!((again.participants, again.present), (3, 3));
    assert_eq!(first.sha256, again.sha256);
    transfer::copy(&to, &back, &slugs, &stop, ignore).await.unwrap();
    let expected = copied(&from, &slugs[0]).await;
    assert_eq!(expected.1, ["bob-1", "ada-0", "bob-0"]);
    for store in [&to, &back] {
        assert_eq!(copied(store, &slugs[0]).await, expected);
        assert_eq!(store.wrong_tallies().await.unwrap(), Vec::<String>::new());
    }

    // An analysis at the destination keeps its participants when they are copied again.
    let study_id = to.study(&slugs[0]).await.unwrap().unwrap().id;
    to.ask_analysis("first".to_owned(), study_id, &Request::default(), entry()).await.unwrap();
    let job = to.begin_analysis("a server", 8).await.unwrap().unwrap();
    let members = async || {
        let members = |db: &Connection| {
            let query = "SELECT participant_id FROM analysis_participant ORDER BY participant_id";
            let mut statement = db.prepare_cached(query)?;
            Ok(statement.query_map([], |row| row.get(0))?.collect::<Result<Vec<String>, _>>()?)
        };
        to.read_long(members).await.unwrap()
    };
    assert_eq!(members().await, ["ada", "bob"]);

    // A participant who has stored more trials since the copy is copied again.
    from.put_trial("ada", trial("ada-1", TurnInput::Right)).await.unwrap();
    let more = transfer::copy(&from, &to, &slugs, &stop, ignore).await.unwrap();
    assert_eq!((more.present, more.trials), (2, 4));
    assert_eq!(copied(&to, &slugs[0]).await, copied(&from, &slugs[0]).await);

    assert_eq!(members().await, ["ada", "bob"]);
    assert!(to.note_progress(&job, [1, 2, 1], 8).await.unwrap());

    // A participant who was seen later at the destination, or was deleted at the destination, is
    // left unchanged.
    let late = NewTrial { received_at_ms: 9, ..trial("cleo-0", TurnInput::Left) };
    assert!(matches!(to.put_trial("cleo", late).await, Ok(PutTrial::Withdrawn)));
    let seen = move |db: &Connection| {
        let later =
            "UPDATE participant SET last_seen_at_ms = last_seen_at_ms + 1 WHERE id = 'cleo'";
        Ok(db.execute(later, [])?)
    };
    to.write([], seen).await.unwrap();
    let refused = transfer::copy(&from, &to, &slugs, &stop, ignore).await;
    assert!(
        matches!(&refused, Err(TransferError::Ahead { id, .. }) if id == "cleo"),
        "{refused:?}"
    );
    from.write([], seen).await.unwrap();
    to.withdraw("bob", true, 20, None).await.unwrap();
    assert_eq!(members().await, ["ada"]);
    let job = to.begin_analysis("a server", 21).await.unwrap().unwrap();
    let refused = transfer::copy(&from, &to, &slugs, &stop, ignore).await;
    assert!(matches!(&refused, Err(TransferError::Ahead { id, .. }) if id == "bob"), "{refused:?}");
    assert!(to.trial_ids("bob").await.unwrap().is_empty());
    // A deletion is copied, and analyses that use the data restart.
    for name in ["bob", "ada"] {
        from.withdraw(name, true, 20, None).await.unwrap();
    }
    transfer::copy(&from, &to, &slugs, &stop, ignore).await.unwrap();
    assert!(members().await.is_empty());
    assert!(!to.note_progress(&job, [1, 2, 1], 22).await.unwrap());
    assert_eq!(copied(&to, &slugs[0]).await, copied(&from, &slugs[0]).await);

    // A study of the same name that was created at another time is another study.
    let (_folder, other) = file_store().await;
    other.put_study(&StudyConfig::default(), 99).await.unwrap();
    let refused = transfer::copy(&other, &to, &slugs, &stop, ignore).await;
    assert!(matches!(refused, Err(TransferError::OtherStudy(_))), "{refused:?}");
}

/// After a copy command was killed, the database does not seem complete.
#[tokio::test(flavor = "multi_thread")]
async fn a_copy_that_was_not_finished_is_refused_until_it_is() {
    let (_folder, url) = address().await;
    Store::open(&url, Purpose::Copy).await.unwrap().close().await;
    for purpose in [Purpose::Alone, Purpose::Create, Purpose::Change, Purpose::Read] {
        let error = Store::open(&url, purpose).await.unwrap_err().to_string();
        assert!(error.contains("a copy into it was not finished"), "{error}");
    }
    let store = Store::open(&url, Purpose::Copy).await.unwrap();
    someone(&store, "copied", Known::default()).await;
    store.end_copy().await.unwrap();
    store.close().await;
    // A copy into a database that has data is always possible.
    for purpose in [Purpose::Copy, Purpose::Alone, Purpose::Read] {
        Store::open(&url, purpose).await.unwrap().close().await;
    }
}

#[tokio::test]
async fn what_one_operation_does_wrong_costs_no_other() {
    let (_folder, store) = file_store().await;
    // All of these operations are committed together.
    let held = store.held().await;
    let paper = StudyConfig::default();
    let sound = store.put_study(&paper, 1);
    let other = StudyConfig { slug: "other".to_owned(), ..StudyConfig::default() };
    let breaks = store.write([], |db| {
        db.batch("DELETE FROM study_version; DELETE FROM study")?;
        Err::<(), _>(StoreError::Defect("half way".to_owned()))
    });
    let panics = store.write([], |db| -> Result<(), StoreError> {
        db.batch("DELETE FROM study_version; DELETE FROM study")?;
        panic!("on purpose")
    });
    let last = store.put_study(&other, 1);
    let release = async {
        drop(held);
    };
    let (sound, broken, panicked, last, ()) = tokio::join!(sound, breaks, panics, last, release);
    assert!(sound.is_ok() && last.is_ok());
    assert_eq!(broken, Err(StoreError::Defect("half way".to_owned())));
    assert!(matches!(panicked, Err(StoreError::Defect(_))), "{panicked:?}");
    assert_eq!(store.slugs().await.unwrap().len(), 2);
}

#[tokio::test]
async fn a_trial_that_fails_costs_no_other() {
    let (_folder, store) = store().await;
    store.put_study(&StudyConfig::default(), 1).await.unwrap();
    let mut uploads = tokio::task::JoinSet::new();
    for number in 0..64_i64 {
        let store = store.clone();
        uploads.spawn(async move {
            let fails = number % 7 == 3;
            let stored =
                store.write_first([Lock::Participant(number.to_string())], None, move |db| {
                    let add =
                        "INSERT INTO audit (at_ms, who, action) VALUES ($1, 'test', 'key_created')";
                    db.execute(add, [number])?;
                    match number % 14 {
                        3 => Err(StoreError::Defect("half way".to_owned())),
                        10 => panic!("on purpose"),
                        _ => Ok(number),
                    }
                });
            (fails, stored.await)
        });
    }
    let mut sound = 0;
    while let Some(done) = uploads.join_next().await {
        let (fails, stored) = done.unwrap();
        assert_eq!(stored.is_err(), fails, "{stored:?}");
        sound += i64::from(!fails);
    }
    let query = "SELECT count(*) FROM audit WHERE who = 'test'";
    let count: i64 =
        store.read(move |db| Ok(db.query_row(query, [], |row| row.get(0))?)).await.unwrap();
    assert_eq!(count, sound, "each sound one once, the others not at all");
}

#[tokio::test]
async fn whoever_comes_back_is_kept() {
    let (_folder, store) = store().await;
    let cid = || Known { external_key: Some("c".to_owned()), ..Known::default() };
    for (name, known) in [("ann", Known::default()), ("ben", Known::default()), ("cid", cid())] {
        someone(&store, name, known).await;
    }
    let study = store.study("default").await.unwrap().unwrap();
    let due = store.participants_due(study.id, Concern::Data, 100).await.unwrap();
    assert_eq!(due.iter().map(|due| due.id.as_str()).collect::<Vec<_>>(), ["ann", "ben", "cid"]);
    let late = NewTrial { received_at_ms: 100, ..trial("ben-0", TurnInput::Left) };
    store.put_trial("ben", late).await.unwrap();
    // Opening the page again counts as presence.
    arrives(&store, "again", cid(), OPEN, 100).await;
    for (due, deleted) in due.iter().zip([true, false, false]) {
        let entry = entry(Action::ParticipantDeleted);
        let found = store.delete_due(&due.id, Concern::Data, 100, entry).await;
        assert_eq!(found, Ok(deleted), "{due:?}");
    }
    assert_eq!(store.trial_ids("ben").await.unwrap(), ["ben-0"]);
    assert!(store.participants_due(study.id, Concern::Data, 100).await.unwrap().is_empty());
}

/// Polls an operation once. Afterwards it waits in the queue, or is refused.
pub(crate) fn begun<T>(operation: &mut Pin<Box<impl Future<Output = T>>>) -> Poll<T> {
    operation.as_mut().poll(&mut Context::from_waker(Waker::noop()))
}

impl Store {
    /// Runs an operation that blocks the writer until `wait` receives a message or its sender is dropped.
    pub(crate) async fn hold(&self, begin: oneshot::Sender<()>, wait: mpsc::Receiver<()>) {
        let work = move |_: &Connection| {
            let _ = begin.send(());
            let _ = wait.recv();
            Ok(())
        };
        let _ = self.write([], work).await;
    }

    /// Blocks the writer until the returned sender is dropped.
    pub(crate) async fn held(&self) -> mpsc::Sender<()> {
        let (go, wait) = mpsc::channel::<()>();
        let (begin, began) = oneshot::channel();
        let store = self.clone();
        tokio::spawn(async move { store.hold(begin, wait).await });
        began.await.unwrap();
        go
    }

    /// Waits until this number of trials and this number of other requests are queued.
    pub(crate) async fn until_waiting(&self, wanted: [usize; 2]) {
        let Database::Sqlite(database) = &self.open.database else { panic!("a file has a writer") };
        while database.waiting()[..2] != wanted {
            tokio::task::yield_now().await;
        }
    }

    /// Like [`Self::held`], with a queue full of cancelled operations.
    pub(crate) async fn stuffed(&self) -> mpsc::Sender<()> {
        let held = self.held().await;
        while begun(&mut Box::pin(self.write([], |_| Ok(())))).is_pending() {}
        held
    }
}

#[tokio::test]
async fn a_full_queue_is_refused_at_once() {
    let (_folder, store) = file_store().await;
    let held = store.stuffed().await;
    assert_eq!(store.write([], |_| Ok(())).await, Err(StoreError::Busy));
    assert_eq!(store.ready().await, Err(StoreError::Busy));
    drop(held);
    while store.ready().await.is_err() {
        tokio::task::yield_now().await;
    }
}

type Order = Arc<Mutex<Vec<&'static str>>>;

/// Operations that record the order in which they run.
fn noting() -> (Order, impl Fn(&'static str) -> Noted) {
    let order = Order::default();
    let noted = Arc::clone(&order);
    (order, move |what| {
        let order = Arc::clone(&noted);
        Box::new(move |_: &Connection| {
            order.lock().unwrap().push(what);
            Ok(())
        })
    })
}

type Noted = Box<dyn FnMut(&Connection) -> Result<(), StoreError> + Send>;

#[tokio::test]
async fn trials_go_ahead_of_a_class_that_enrols() {
    let (_folder, store) = file_store().await;
    let held = store.held().await;
    let (order, noted) = noting();
    let mut class: Vec<_> = (0..600).map(|_| Box::pin(store.write([], noted("class")))).collect();
    assert!(class.iter_mut().all(|enrolment| begun(enrolment).is_pending()));
    let mut trial = Box::pin(store.write_first([], None, noted("trial")));
    assert!(begun(&mut trial).is_pending());
    drop(held);
    assert_eq!(trial.await, Ok(()));
    for enrolment in class {
        assert_eq!(enrolment.await, Ok(()));
    }
    assert_eq!(order.lock().unwrap()[0], "trial");
}

#[tokio::test]
async fn requests_wait_for_one_piece_of_background_work_at_most() {
    let (_folder, store) = file_store().await;
    let held = store.held().await;
    let (order, noted) = noting();
    let mut jobs: Vec<_> =
        (0..20).map(|_| Box::pin(store.write_behind([], noted("job")))).collect();
    let mut requests: Vec<_> =
        (0..64).map(|_| Box::pin(store.write_first([], None, noted("request")))).collect();
    assert!(jobs.iter_mut().all(|job| begun(job).is_pending()));
    assert!(requests.iter_mut().all(|request| begun(request).is_pending()));
    drop(held);
    for request in requests {
        assert_eq!(request.await, Ok(()));
    }
    for job in jobs {
        assert_eq!(job.await, Ok(()));
    }
    let order = order.lock().unwrap();
    let first_65 = order[..65].iter().filter(|&&what| what == "job").count();
    assert!(first_65 <= 1, "{order:?}");
    assert_eq!(order.len(), 84);
}
