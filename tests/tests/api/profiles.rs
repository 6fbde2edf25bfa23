//! A participant in the laboratory: pictures of trials, notes, exclusion, and deletion on request.

use crate::analyses::{ask, done, show};
use crate::people::come;
use reqwest::Method;
use serde_json::{Value, json};
use sidestep::api::{
    AuditPage, Drives, KeyMade, Note, ParticipantDetail, ParticipantPage, Stage, TrainedPredictor,
    TrialDetail, routes,
};
use sidestep::scene::SceneParameters;
use sidestep_tests::server::SHORT_STUDY;
use sidestep_tests::{Answer, Driver, Folder, Server, run};

async fn send(server: &Server, method: Method, route: &str, body: Value) -> Answer {
    Answer::of(server.request(method, route).bearer_auth(&server.key).json(&body)).await
}

async fn profile(server: &Server, id: &str) -> ParticipantDetail {
    server.admin(&routes::admin_participant(id)).await.into(200)
}

fn id(driver: &Driver) -> &str {
    &driver.enrolled.participant_id
}

async fn people(server: &Server, query: &str) -> ParticipantPage {
    server.admin(&format!("{}?{query}", routes::admin_participants("default"))).await.into(200)
}

/// The audit trail about people, oldest first.
async fn audit(server: &Server) -> Vec<(String, Option<String>)> {
    let page: AuditPage = server.admin(routes::AUDIT).await.into(200);
    let entries = page.entries.into_iter().rev();
    let about = entries.filter(|entry| entry.study.as_deref() == Some("default"));
    about.map(|entry| (entry.action.word().to_owned(), entry.subject)).collect()
}

#[tokio::test]
async fn a_participant_is_shown_whole() {
    let server = Server::with_study(SHORT_STUDY).await;
    let driver = come(&server, "P-7").await;
    driver.drive(&server, 4).await;
    let found = profile(&server, id(&driver)).await;
    assert_eq!((found.summary.number, found.summary.stage), (1, Stage::Task));
    assert_eq!((found.study.as_str(), found.danger_radius_m), ("default", 3.0));
    assert_eq!((found.configuration_number, &found.configuration_label[..]), (Some(1), "1"));
    assert_eq!(found.summary.external_id.as_deref(), Some("P-7"));
    assert_eq!((found.exclusion, found.notes.len(), found.trials.len()), (None, 0, 4));
    let picture = &found.trials[2];
    let trial: TrialDetail =
        server.admin(&routes::admin_trial(&picture.summary.trial_id)).await.into(200);
    assert_eq!(picture.summary, trial.summary);
    assert_eq!((picture.human.len(), picture.robot.len(), picture.inputs.0.len()), (26, 26, 50));
    for (shown, state) in picture.human.iter().zip(trial.states.iter().step_by(2)) {
        assert!((shown[0] - state.human.x).abs() <= 0.005 + 1e-9);
        assert!((shown[1] - state.human.y).abs() <= 0.005 + 1e-9);
    }
    let letters = trial.inputs.iter().map(|input| ['L', 'S', 'R'][(1 - input.sign()) as usize]);
    assert_eq!(String::from(picture.inputs.clone()), letters.collect::<String>());

    // A pilot can also be viewed and replayed.
    let pilot = json!({ "consent": true, "pilot": true });
    let pilot = Driver { enrolled: Driver::ask(&server, pilot).await.into(201) };
    pilot.drive(&server, 1).await;
    let pilots = people(&server, "pilot=true").await;
    let tried = profile(&server, &pilots.participants[0].participant_id).await;
    let replay = routes::admin_trial(&tried.trials[0].summary.trial_id);
    server.admin(&replay).await.into::<TrialDetail>(200);

    // A user with read access sees no personal data.
    let new = json!({ "name": "looks", "access": "read" });
    let key: KeyMade = send(&server, Method::POST, routes::ADMIN_KEYS, new).await.into(201);
    let look = server.request(Method::GET, &routes::admin_participant(id(&driver)));
    let look: ParticipantDetail = Answer::of(look.bearer_auth(&key.secret)).await.into(200);
    assert_eq!((look.summary.external_id, look.answers.len()), (None, 0));
    for (method, route) in [
        (Method::POST, routes::admin_notes(id(&driver))),
        (Method::PUT, routes::admin_exclusion(id(&driver))),
        (Method::DELETE, routes::admin_participant(id(&driver))),
    ] {
        let request = server.request(method, &route).bearer_auth(&key.secret);
        Answer::of(request.json(&json!({ "text": "x" }))).await.problem(403, "access", None);
    }
    server.admin(&routes::admin_participant("nobody")).await.problem(404, "not_found", None);
}

#[tokio::test]
async fn notes_are_written_and_deleted() {
    let server = Server::with_study(SHORT_STUDY).await;
    let driver = come(&server, "P-7").await;
    let notes = routes::admin_notes(id(&driver));
    let write =
        async |text: &str| send(&server, Method::POST, &notes, json!({ "text": text })).await;
    let first: Note = write("Called at noon.\nWill finish today. <b>").await.into(201);
    let second: Note = write("Finished.").await.into(201);
    assert_eq!(profile(&server, id(&driver)).await.notes, [first.clone(), second.clone()]);
    for wrong in ["", " \n ", "a\u{7}", &"x".repeat(2_001)] {
        write(wrong).await.problem(422, "invalid", Some("text"));
    }
    let delete = async |note: &str| {
        let route = routes::admin_note(id(&driver), note);
        send(&server, Method::DELETE, &route, json!({})).await
    };
    assert_eq!(delete(&first.id.to_string()).await.status, 204);
    for gone in [first.id.to_string(), "x".to_owned(), "999".to_owned()] {
        delete(&gone).await.problem(404, "not_found", None);
    }
    assert_eq!(profile(&server, id(&driver)).await.notes, [second]);
    let nobody = routes::admin_notes("nobody");
    let lost = send(&server, Method::POST, &nobody, json!({ "text": "x" })).await;
    lost.problem(404, "not_found", None);
    let said = |action: &str| (action.to_owned(), Some("1".to_owned()));
    let expected = [said("note_added"), said("note_added"), said("note_deleted")];
    assert_eq!(audit(&server).await, expected, "by number, without the text");
}

#[tokio::test]
async fn excluded_participants_stay_and_no_analysis_uses_them() {
    let server = Server::with_study("phases = [{ phase = \"task\", scenes = 8 }]").await;
    let mut drivers = Vec::new();
    for who in 1..=3 {
        let driver = Driver::enrol(&server).await;
        driver.drive_restlessly(&server, &SceneParameters::default(), who).await;
        drivers.push(driver);
    }
    let before = done(&server, &ask(&server, json!({})).await.id).await;
    assert_eq!(before.summary.result.as_ref().unwrap().participants, 3);
    assert!(!before.summary.stale);
    // A pilot is not part of the data.
    let pilot = json!({ "consent": true, "pilot": true });
    let pilot = Driver { enrolled: Driver::ask(&server, pilot).await.into(201) };
    pilot.drive(&server, 1).await;
    assert!(!show(&server, &before.summary.id).await.summary.stale);
    let third = routes::admin_exclusion(id(&drivers[2]));
    let exclude =
        async |reason: &str| send(&server, Method::PUT, &third, json!({ "reason": reason })).await;
    for wrong in ["", "two\nlines", &"x".repeat(201)] {
        exclude(wrong).await.problem(422, "invalid", Some("reason"));
    }
    assert_eq!(exclude("held the phone").await.status, 204);
    assert_eq!(exclude("held the phone").await.status, 204, "the same again");
    let found = profile(&server, id(&drivers[2])).await;
    let exclusion = found.exclusion.unwrap();
    assert_eq!((exclusion.reason.as_str(), found.trials.len()), ("held the phone", 8));
    let list = people(&server, "having=excluded").await;
    assert_eq!((list.total, list.participants[0].number), (1, 3));
    assert!(list.participants[0].excluded);
    assert!(show(&server, &before.summary.id).await.summary.stale, "its data have changed");

    // Analyses leave out excluded participants and report them. Exports contain excluded
    // participants, with the reason.
    let without = done(&server, &ask(&server, json!({})).await.id).await;
    let result = without.summary.result.unwrap();
    assert_eq!(result.participants, 2);
    assert_eq!(result.excluded[0].participant, "3");
    assert!(result.excluded[0].reason.contains("held the phone"), "{:?}", result.excluded);
    assert_eq!(server.export("default").await.lines().count(), 1 + 3 * 8 * 50);
    let route = format!("{}?format=csv", routes::admin_participants("default"));
    let table = server.admin_text(&route).await;
    let (header, rows) = table.split_once('\n').unwrap();
    let at = header.split(',').position(|name| name == "exclusion_reason").unwrap();
    let reasons: Vec<_> = rows.lines().map(|row| row.split(',').nth(at).unwrap()).collect();
    assert_eq!(reasons, ["", "", "held the phone"]);
    // Commands also leave out and report excluded participants, from a database and from an export.
    let (folder, database) = (Folder::default(), server.database());
    let export = folder.name("export");
    let said = run(&["export", "--database", &database, "--format", "csv", "--out", &export]).await;
    assert_eq!(said.code, Some(0), "{}", said.err);
    let steps = format!("{export}/steps.csv");
    let mut features = Vec::new();
    for (source, name) in [(["--database", &database], "a.csv"), (["--trials", &steps], "b.csv")] {
        let out = folder.name(name);
        let said = run(&[&["features", "--out", &out], &source[..]].concat()).await;
        assert_eq!(said.code, Some(0), "{}", said.err);
        assert!(said.err.contains("held the phone"), "{}", said.err);
        features.push(folder.text(name));
    }
    assert_eq!(features[0].lines().count(), 1 + 2 * 8 * 50);
    assert!(features[0] == features[1]);

    // Including the participant again is another change. A second inclusion changes nothing.
    for _ in 0..2 {
        assert_eq!(send(&server, Method::DELETE, &third, json!({})).await.status, 204);
    }
    assert!(profile(&server, id(&drivers[2])).await.exclusion.is_none());
    assert!(show(&server, &without.summary.id).await.summary.stale);
    let said: Vec<_> = audit(&server).await.into_iter().map(|(action, _)| action).collect();
    assert_eq!(said.iter().filter(|action| *action == "excluded").count(), 1, "{said:?}");
    assert_eq!(said.iter().filter(|action| *action == "included").count(), 1, "{said:?}");
}

#[tokio::test]
async fn a_participant_is_deleted_on_request() {
    let server = Server::with_study(SHORT_STUDY).await;
    let driver = come(&server, "P-7").await;
    let sent = driver.drive(&server, 2).await;
    let note = json!({ "text": "Knows the robot's builder." });
    send(&server, Method::POST, &routes::admin_notes(id(&driver)), note).await.into::<Note>(201);
    let reason = json!({ "reason": "knows the builder" });
    send(&server, Method::PUT, &routes::admin_exclusion(id(&driver)), reason).await;
    let route = routes::admin_participant(id(&driver));
    for _ in 0..2 {
        assert_eq!(send(&server, Method::DELETE, &route, json!({})).await.status, 204);
    }
    let gone = profile(&server, id(&driver)).await;
    assert!(gone.data_deleted && gone.withdrawn_at_ms.is_some());
    assert_eq!((gone.notes.len(), gone.exclusion, gone.trials.len()), (0, None, 0));
    assert_eq!((gone.summary.external_id, gone.summary.stored), (None, 0));
    server.admin(&routes::admin_trial(&sent[0].0)).await.problem(404, "not_found", None);
    driver.me(&server).await.problem(410, "withdrawn", None);
    assert_eq!(people(&server, "search=P-7").await.total, 0);
    let nobody = routes::admin_participant("nobody");
    send(&server, Method::DELETE, &nobody, json!({})).await.problem(404, "not_found", None);
    let deleted = ("participant_deleted".to_owned(), Some("1".to_owned()));
    assert_eq!(audit(&server).await.last(), Some(&deleted));
}

#[tokio::test]
async fn the_drives_of_a_participant_are_their_tasks_to_the_bit() {
    let server = Server::with_study(SHORT_STUDY).await;
    let driver = come(&server, "P-7").await;
    let route = routes::admin_drives(id(&driver));
    let found: Drives = server.admin(&route).await.into(200);
    assert_eq!((found.tasks.len(), found.data_deleted), (0, false));
    let sent = driver.drive(&server, 5).await;
    let found: Drives = server.admin(&route).await.into(200);
    assert_eq!((found.study.as_str(), found.number, found.pilot), ("default", 1, false));
    // Of five scenes, one is familiarisation and one practice.
    let words: Vec<&str> = found.tasks.iter().map(|task| task.words.as_str()).collect();
    assert_eq!(words, ["task 1", "task 2", "task 3"]);
    for (task, (trial_id, _)) in found.tasks.iter().zip(&sent[2..]) {
        assert_eq!(&task.trial_id, trial_id);
        let trial: TrialDetail = server.admin(&routes::admin_trial(trial_id)).await.into(200);
        assert_eq!((task.inputs.0.clone(), task.states()), (trial.inputs, trial.states));
        assert_eq!((&task.scene, found.parameters), (&trial.scene, trial.parameters));
        let ids = [&found.value_function_hr, &found.value_function_rh];
        assert_eq!(ids, [&trial.value_function_hr, &trial.value_function_rh]);
    }
    // The model of a task is trained on the trials before the task. The response names these
    // trials.
    let predictor = routes::admin_predictor(&sent[3].0);
    let predictor: TrainedPredictor = server.admin(&predictor).await.into(200);
    let before: Vec<&String> = sent[..3].iter().map(|(id, _)| id).collect();
    assert_eq!(predictor.trained_on.iter().collect::<Vec<_>>(), before);
    // Access without a key is refused, and an unknown participant is not found.
    assert_eq!(server.get(&route).await.status, 401);
    assert_eq!(server.admin(&routes::admin_drives("nobody")).await.status, 404);
    // Deleted data are gone.
    let participant = routes::admin_participant(id(&driver));
    let deleted = server.request(Method::DELETE, &participant).bearer_auth(&server.key);
    assert_eq!(Answer::of(deleted).await.status, 204);
    let found: Drives = server.admin(&route).await.into(200);
    assert_eq!((found.tasks.len(), found.data_deleted), (0, true));
}
