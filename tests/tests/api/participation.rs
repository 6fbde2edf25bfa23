//! Participation from enrolment to completion or withdrawal.

use serde_json::{Value, json};
use sidestep::api::{Completed, Enrolled, Progress, TrialStored, routes};
use sidestep::trial::Phase;
use sidestep_tests::server::SHORT_STUDY;
use sidestep_tests::{Driver, Server, driven};

#[tokio::test]
async fn the_papers_study_from_enrolment_to_the_code() {
    let server = Server::start().await;
    let info = server.get(&routes::study("default")).await;
    assert_eq!(info.body["phases"][2]["scenes"], 50);
    assert_eq!(info.body["parameters"]["danger_radius_m"], 3.0);
    let driver = Driver::enrol(&server).await;
    let scenes = driver.scenes();
    assert_eq!(scenes.len(), 59);
    let phases = &driver.enrolled.plan.phases;
    assert!(phases[0].show_danger_zone && !phases[2].show_danger_zone);

    for (i, (trial_id, scene)) in scenes.iter().enumerate() {
        let missing = driver.complete(&server).await;
        let message = missing.problem(409, "incomplete", None);
        assert!(message.starts_with(&format!("{} of 59", 59 - i)), "{message}");
        let answer = driver.send(&server, trial_id, &driven(scene)).await;
        let stored: TrialStored = answer.into(201);
        assert_eq!(stored.trial_id, *trial_id);
        assert_eq!(stored.next.as_ref(), scenes.get(i + 1).map(|(id, _)| id));
    }
    let code: Completed = driver.complete(&server).await.into(200);
    assert_eq!(code.completion_code.len(), 10);
    let again: Completed = driver.complete(&server).await.into(200);
    assert_eq!(again, code);
    let me: Progress = driver.me(&server).await.into(200);
    assert_eq!(me.stored.len(), 59);
    assert_eq!(me.next, None);
    assert_eq!(me.completion_code, Some(code.completion_code));
    assert_eq!(me.plan, driver.enrolled.plan);
}

#[tokio::test]
async fn the_same_again_is_welcome_and_something_else_is_not() {
    let server = Server::with_study(SHORT_STUDY).await;
    let driver = Driver::enrol(&server).await;
    let (trial_id, scene) = driver.scenes()[0].clone();
    let trial = driven(&scene);
    assert_eq!(driver.send(&server, &trial_id, &trial).await.status, 201);
    assert_eq!(driver.send(&server, &trial_id, &trial).await.status, 200);

    // The same content in another form: fields in reverse order, and more spaces.
    let fields = serde_json::to_value(&trial).unwrap();
    let fields: Vec<String> = fields
        .as_object()
        .unwrap()
        .iter()
        .rev()
        .map(|(name, value)| format!("\"{name}\" : {value}"))
        .collect();
    let dressed = format!("{{ {} }}", fields.join(" ,\n"));
    let route = routes::my_trial(&trial_id);
    let request = driver.request(&server, reqwest::Method::PUT, &route);
    let request = request.header("content-type", "application/json; charset=utf-8");
    let answer = request.body(dressed).send().await.unwrap();
    assert_eq!(answer.status(), 200);

    let mut other = trial.clone();
    other.started_at_ms += 1.0;
    let answer = driver.send(&server, &trial_id, &other).await;
    answer.problem(409, "different_content", None);
    assert_eq!(driver.send(&server, &trial_id, &trial).await.status, 200);
    assert_eq!(server.export("default").await.lines().count(), 51);
}

#[tokio::test]
async fn a_hundred_parallel_copies_leave_one_row() {
    let server = Server::with_study(SHORT_STUDY).await;
    let driver = Driver::enrol(&server).await;
    let (trial_id, scene) = driver.scenes()[0].clone();
    let trial = driven(&scene);
    let copies = (0..100).map(|_| driver.send(&server, &trial_id, &trial));
    let answers = futures_util::future::join_all(copies).await;
    let count = |status| answers.iter().filter(|a| a.status == status).count();
    assert_eq!((count(201), count(200)), (1, 99));
    assert_eq!(server.export("default").await.lines().count(), 51);
}

#[tokio::test]
async fn trials_come_in_order() {
    let server = Server::with_study(SHORT_STUDY).await;
    let driver = Driver::enrol(&server).await;
    let scenes = driver.scenes();
    let (second, scene) = &scenes[1];
    let answer = driver.send(&server, second, &driven(scene)).await;
    let message = answer.problem(409, "out_of_order", None);
    assert!(message.contains(&scenes[0].0), "{message}");
    driver.drive(&server, 2).await;
    let me: Progress = driver.me(&server).await.into(200);
    assert_eq!(me.next.as_ref(), Some(&scenes[2].0));
    assert_eq!(me.stored, [scenes[0].0.clone(), scenes[1].0.clone()]);
}

#[tokio::test]
async fn a_known_external_id_resumes_and_both_tokens_work() {
    let server = Server::with_study(SHORT_STUDY).await;
    let body = json!({
        "consent": true, "external_id": "P-17", "locale": "de-DE", "screen": { "width": 1280 }
    });
    let first: Enrolled = Driver::ask(&server, body.clone()).await.into(201);
    let first = Driver { enrolled: first };
    first.drive(&server, 1).await;
    let again: Enrolled = Driver::ask(&server, body).await.into(200);
    assert_eq!(again.participant_id, first.enrolled.participant_id);
    assert_eq!(again.plan, first.enrolled.plan);
    assert_ne!(again.token, first.enrolled.token);
    // The second trial is still in the outbox of the first computer. The third trial is driven on
    // the second computer.
    let again = Driver { enrolled: again };
    let scenes = first.scenes();
    let send = async |driver: &Driver, i: usize| {
        driver.send(&server, &scenes[i].0, &driven(&scenes[i].1)).await.status
    };
    assert_eq!(send(&first, 1).await, 201);
    assert_eq!(send(&again, 2).await, 201);
    let other: Enrolled =
        Driver::ask(&server, json!({"consent": true, "external_id": "P-18"})).await.into(201);
    assert_ne!(other.participant_id, first.enrolled.participant_id);
}

#[tokio::test]
async fn two_tabs_that_enrol_at_once_are_one_person() {
    let server = Server::with_study(SHORT_STUDY).await;
    let body = json!({ "consent": true, "external_id": "twice" });
    let tabs = (0..8).map(|_| Driver::ask(&server, body.clone()));
    let answers = futures_util::future::join_all(tabs).await;
    assert_eq!(answers.iter().filter(|a| a.status == 201).count(), 1);
    assert_eq!(answers.iter().filter(|a| a.status == 200).count(), 7);
    let ids: std::collections::HashSet<_> =
        answers.iter().map(|a| a.body["participant_id"].as_str().unwrap().to_owned()).collect();
    assert_eq!(ids.len(), 1);
}

#[tokio::test]
async fn withdrawal_keeps_or_deletes() {
    let server = Server::with_study(SHORT_STUDY).await;
    let body = json!({ "consent": true, "external_id": "leaver", "locale": "en" });
    let enrolled: Enrolled = Driver::ask(&server, body.clone()).await.into(201);
    let driver = Driver { enrolled };
    let sent = driver.drive(&server, 2).await;
    driver.withdraw(&server, "everything").await.problem(422, "invalid", Some("data"));
    for _ in 0..2 {
        assert_eq!(driver.withdraw(&server, "keep").await.status, 200);
    }
    driver.me(&server).await.problem(410, "withdrawn", None);
    driver.complete(&server).await.problem(410, "withdrawn", None);
    let (trial_id, trial) = &sent[1];
    let late = driver.send(&server, trial_id, trial).await;
    late.problem(410, "withdrawn", None);
    Driver::ask(&server, body.clone()).await.problem(410, "withdrawn", None);
    assert_eq!(server.export("default").await.lines().count(), 101);

    for _ in 0..2 {
        assert_eq!(driver.withdraw(&server, "delete").await.status, 200);
    }
    assert_eq!(server.export("default").await.lines().count(), 1);
    driver.me(&server).await.problem(410, "withdrawn", None);
    // After deletion, the same person is a new participant, with the next number.
    let anew: Enrolled = Driver::ask(&server, body).await.into(201);
    let anew = Driver { enrolled: anew };
    anew.drive(&server, 1).await;
    let export = server.export("default").await;
    assert!(export.lines().nth(1).unwrap().starts_with("2,0,0,0.0,"));
    if !server.database().starts_with("sqlite:") {
        return;
    }
    let bytes = std::fs::read(server.path("sidestep.db")).unwrap();
    let wal = std::fs::read(server.path("sidestep.db-wal")).unwrap();
    let count = |bytes: &[u8]| bytes.windows(6).filter(|w| w == b"leaver").count();
    // The name occurs once in the table and once in its index, for the new enrolment only.
    assert!(count(&bytes) <= 2, "deleted names are overwritten");
    assert!(count(&bytes) + count(&wal) >= 1);
}

#[tokio::test]
async fn a_restart_keeps_everything() {
    let server = Server::with_study(SHORT_STUDY).await;
    let driver = Driver::enrol(&server).await;
    driver.drive(&server, 3).await;
    let before = server.export("default").await;
    let server = server.restarted().await;
    assert_eq!(server.export("default").await, before);
    let me: Progress = driver.me(&server).await.into(200);
    assert_eq!(me.stored.len(), 3);
    let (id, scene) = driver.scenes()[3].clone();
    assert_eq!(driver.send(&server, &id, &driven(&scene)).await.status, 201);
    assert_eq!(server.admin(routes::SESSION).await.status, 200, "the key holds");
}

#[tokio::test]
async fn an_edited_study_is_for_people_to_come() {
    let server = Server::with_study(SHORT_STUDY).await;
    let before = Driver::enrol(&server).await;
    let changed = "phases = [{ phase = \"task\", scenes = 2 }]\n\
                   [parameters]\ndanger_radius_m = 2.5\n";
    let server = server.restarted_with_study(changed).await;
    let after = Driver::enrol(&server).await;
    assert_eq!(after.scenes().len(), 2);
    let me: Progress = before.me(&server).await.into(200);
    assert_eq!(me.plan, before.enrolled.plan);
    assert_eq!(me.plan.phases[0].phase, Phase::Familiarisation);
    // Each trial is shown with the parameters under which it was driven.
    before.drive(&server, 1).await;
    let detail = server.admin(&routes::admin_trial(&before.scenes()[0].0)).await;
    assert_eq!(detail.body["parameters"]["danger_radius_m"], 3.0);
    assert_eq!(detail.body["flags"], Value::Array(vec![]));
}
