//! The typed client, tested against a server.

use sidestep::api::{Access, ComprehensionResult, Draft, Enrolment, NewKey, Stage};
use sidestep::comparison::Request;
use sidestep::study::Status;
use sidestep_server::client::{Client, ClientError};
use sidestep_tests::server::SHORT_STUDY;
use sidestep_tests::{Server, driven};

fn consent() -> Enrolment {
    serde_json::from_value(serde_json::json!({ "consent": true })).unwrap()
}

/// The error code of a refused request.
fn code<T>(answer: Result<T, ClientError>) -> String {
    answer.err().and_then(|error| error.code().map(str::to_owned)).expect("a refusal")
}

#[tokio::test]
async fn a_participation_from_enrolment_to_withdrawal() {
    let server = Server::with_study(SHORT_STUDY).await;
    let client = Client::at(&server.origin).unwrap().unwrap();
    assert_eq!(client.study("default").await.unwrap().title, "Short");
    assert_eq!(code(client.study("none").await), "not_found");
    assert_eq!(client.texts("default", "de").await.unwrap().language, "de");
    let me = client.enrol("default", &consent()).await.unwrap();
    let passed = ComprehensionResult { attempts: 2, passed: true };
    assert!(!me.check_understanding(&passed).await.unwrap().screened_out);
    assert_eq!(code(me.complete().await), "incomplete");
    let plan: Vec<_> = me.plan().scenes().map(|(_, scene)| scene.clone()).collect();
    for planned in &plan {
        let stored = me.store(&planned.trial_id, &driven(&planned.scene())).await.unwrap();
        assert_eq!(stored.trial_id, planned.trial_id);
    }
    let progress = me.progress().await.unwrap();
    assert_eq!((progress.stored.len(), progress.next), (5, None));
    let done = me.complete().await.unwrap();
    assert_eq!(me.progress().await.unwrap().completion_code, Some(done.completion_code));
    me.withdraw(true).await.unwrap();
    assert_eq!(code(me.progress().await), "withdrawn");
}

#[tokio::test]
async fn the_laboratory_by_a_key() {
    let server = Server::with_study(SHORT_STUDY).await;
    let client = Client::at(&server.origin).unwrap().unwrap();
    let me = client.enrol("default", &consent()).await.unwrap();
    let first = me.plan().scenes().next().unwrap().1.clone();
    me.store(&first.trial_id, &driven(&first.scene())).await.unwrap();

    let lab = client.laboratory(&server.key);
    assert_eq!(lab.session().await.unwrap().access, Access::Manage);
    let new = NewKey { name: "a reader".to_owned(), access: Access::Read };
    let made = lab.make_key(&new).await.unwrap();
    assert_eq!(code(lab.make_key(&new).await), "taken");
    let reader = client.laboratory(&made.secret);
    assert_eq!(code(reader.keys().await), "access");
    assert_eq!(reader.studies().await.unwrap().len(), 1);
    lab.revoke_key(made.key.id).await.unwrap();
    assert_eq!(code(reader.studies().await), "unauthorized");
    assert!(lab.audit("").await.unwrap().entries.len() >= 3);

    let configuration = lab.configuration("default").await.unwrap();
    let draft = Draft { toml: configuration.toml, base: Some(configuration.hash) };
    assert_eq!(lab.check_draft(&draft).await.unwrap().complaint, None);
    lab.change_study("default", &draft).await.unwrap();
    let other = Draft { toml: "slug = \"other\"\ntitle = \"Other\"".to_owned(), base: None };
    assert_eq!(lab.make_study(&other).await.unwrap().study, "other");
    lab.set_status("other", Status::Archived).await.unwrap();
    assert_eq!(lab.study("other").await.unwrap().status, Status::Archived);
    assert_eq!(code(client.enrol("other", &consent()).await), "archived");

    let people = lab.participants("default", "").await.unwrap();
    assert_eq!((people.total, people.participants[0].stage), (1, Stage::Practice));
    let id = me.participant_id();
    let note = lab.add_note(id, "late").await.unwrap();
    lab.exclude(id, Some("asleep")).await.unwrap();
    let detail = lab.participant(id).await.unwrap();
    assert_eq!((detail.notes.len(), detail.exclusion.unwrap().reason), (1, "asleep".to_owned()));
    lab.exclude(id, None).await.unwrap();
    lab.delete_note(id, note.id).await.unwrap();
    assert_eq!(lab.trials("default", "").await.unwrap().trials[0].trial_id, first.trial_id);
    assert!(lab.trial(&first.trial_id).await.unwrap().replay.exact);
    assert_eq!(lab.predictor(&first.trial_id).await.unwrap().trials, 0);
    assert!(lab.self_check().await.unwrap().trials > 0);

    let asked = lab.ask_analysis("default", &Request::default()).await.unwrap().id;
    lab.analysis(&asked).await.unwrap();
    assert_eq!(lab.analyses("default", "").await.unwrap().analyses.len(), 1);
    assert_eq!(code(lab.analysis_file(&asked, "none.csv").await), "not_found");
    lab.predictors(&asked, "experiment=1&limit=5").await.unwrap();
    assert_eq!(code(lab.predictors(&asked, "limit=0").await), "invalid");
    assert_eq!(code(lab.predictor_of(&first.trial_id, &asked, "none").await), "not_found");
    lab.delete_analysis(&asked).await.unwrap();
    assert_eq!(code(lab.cancel_analysis(&asked).await), "not_found");
    lab.delete_participant(id).await.unwrap();
    assert_eq!(lab.delete_pilots("default").await.unwrap().deleted, 0);
    assert!(!lab.export("default", "").await.unwrap().is_empty());
    assert!(lab.export("default", "format=csv").await.unwrap().starts_with(b"PK"));
    let second = lab.participants("default", "limit=1&offset=1").await.unwrap();
    assert!(second.participants.iter().all(|person| person.number == 2));
    let wrong = lab.trials("default", "limit=many").await.unwrap_err().to_string();
    assert!(wrong.contains("limit"), "{wrong}");
}

#[tokio::test]
async fn what_is_no_sidestep_server_is_said_so() {
    let nobody = Client::at("http://127.0.0.1:1").unwrap().unwrap();
    let error = nobody.study("default").await.unwrap_err();
    assert!(matches!(error, ClientError::Unreachable { .. }), "{error}");
    assert!(error.to_string().ends_with("is a server running there?"), "{error}");
}
