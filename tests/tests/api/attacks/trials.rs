//! Trials that are odd, wrong, repeated or out of order.

use futures_util::future::join_all;
use serde_json::{Value, json};
use sidestep::api::{Enrolled, Progress, routes};
use sidestep_tests::{Driver, Server, driven};

async fn stored(server: &Server, driver: &Driver) -> Vec<String> {
    driver.me(server).await.into::<Progress>(200).stored
}

/// A change to an honest upload, and the field that the server then rejects.
type Change = (fn(&mut Value), &'static str);

async fn refused(server: &Server, changes: &[Change]) {
    let driver = Driver::enrol(server).await;
    let (trial_id, scene) = driver.scenes()[0].clone();
    for (change, field) in changes {
        let mut trial = serde_json::to_value(driven(&scene)).unwrap();
        change(&mut trial);
        let answer = driver.put(server, &routes::my_trial(&trial_id), &trial).await;
        assert!(!answer.problem(422, "invalid", Some(field)).is_empty());
    }
    assert!(stored(server, &driver).await.is_empty());
}

pub(super) async fn case_06_recordings_that_do_not_replay(server: &Server) {
    let driver = Driver::enrol(server).await;
    let scenes = driver.scenes();
    let mut teleport = driven(&scenes[0].1);
    teleport.states[30].human.x += 5.0;
    let mut elsewhere = driven(&scenes[2].1);
    elsewhere.sampled_at_ms[40..].iter_mut().for_each(|t| *t += 80.0);
    for ((id, _), trial) in scenes.iter().zip([&teleport, &elsewhere]) {
        assert_eq!(driver.send(server, id, trial).await.status, 201);
    }
    let flags = async |i: usize| {
        let answer = server.admin(&routes::admin_trial(&scenes[i].0)).await;
        (answer.body["flags"].clone(), answer.body["replay"].clone())
    };
    let (first, replay) = flags(0).await;
    assert_eq!(first, json!(["replay_mismatch"]));
    assert_eq!(replay["first_difference"], 30);
    let error = replay["max_position_error_m"].as_f64().unwrap();
    assert!((error - 5.0).abs() < 1e-12, "{error}");
    let (second, replay) = flags(1).await;
    assert_eq!(second, json!(["start_mismatch", "late_sample"]));
    assert_eq!(replay["exact"], true);
}

pub(super) async fn case_07_wrong_counts_and_missing_times(server: &Server) {
    refused(
        server,
        &[
            (|t| t["inputs"] = json!(vec![0; 49]), "inputs"),
            (|t| t["states"] = json!([]), "states"),
            (|t| t["states"][17]["human"] = json!([0, 0]), "states[17].human"),
            (|t| t["sampled_at_ms"][9] = json!(null), "sampled_at_ms[9]"),
        ],
    )
    .await;
}

pub(super) async fn case_08_unknown_inputs_trials_and_fields(server: &Server) {
    refused(
        server,
        &[
            (|t| t["inputs"][7] = json!(2), "inputs[7]"),
            (|t| t["inputs"][7] = json!(0.5), "inputs[7]"),
            (|t| t["states"][3]["speed"] = json!(1), "states[3].speed"),
            (
                |t| t["key_events"] = json!([{ "t_ms": 1, "key": "a".repeat(129), "down": true }]),
                "key_events[0].key",
            ),
            (|t| t["key_events"] = json!([{ "t_ms": 1, "key": "a" }]), "key_events[0].down"),
            (|t| t["display"] = json!({ "x": "y".repeat(9000) }), "display"),
            (|t| t["display"] = json!(1), "display"),
            (|t| t["extra"] = json!(1), "extra"),
            (|t| t["phase"] = json!("task"), "phase"),
        ],
    )
    .await;
    let driver = Driver::enrol(server).await;
    let trial = driven(&driver.scenes()[0].1);
    driver.send(server, "unknown", &trial).await.problem(404, "not_found", None);
}

pub(super) async fn case_09_the_same_trial_again(server: &Server) {
    let driver = Driver::enrol(server).await;
    let (id, scene) = driver.scenes()[0].clone();
    for status in [201, 200, 200] {
        assert_eq!(driver.send(server, &id, &driven(&scene)).await.status, status);
    }
    assert_eq!(stored(server, &driver).await, [id]);
    assert_eq!(server.export("default").await.lines().count(), 51);
}

pub(super) async fn case_10_the_same_trial_with_other_content(server: &Server) {
    let driver = Driver::enrol(server).await;
    let (id, scene) = driver.scenes()[0].clone();
    assert_eq!(driver.send(server, &id, &driven(&scene)).await.status, 201);
    let first = server.export("default").await;
    let mut other = driven(&scene);
    other.started_at_ms += 1.0;
    driver.send(server, &id, &other).await.problem(409, "different_content", None);
    assert_eq!(server.export("default").await, first, "the first is kept");
}

pub(super) async fn case_11_a_hundred_duplicates_at_once(server: &Server) {
    let driver = Driver::enrol(server).await;
    let (id, scene) = driver.scenes()[0].clone();
    let trial = driven(&scene);
    let answers = join_all((0..100).map(|_| driver.send(server, &id, &trial))).await;
    let count = |status| answers.iter().filter(|answer| answer.status == status).count();
    assert_eq!((count(201), count(200)), (1, 99));
    assert_eq!(server.export("default").await.lines().count(), 51);
}

pub(super) async fn case_12_skipping_ahead_and_after_withdrawal(server: &Server) {
    let driver = Driver::enrol(server).await;
    let scenes = driver.scenes();
    let send = async |i: usize| driver.send(server, &scenes[i].0, &driven(&scenes[i].1)).await;
    send(1).await.problem(409, "out_of_order", None);
    assert_eq!(send(0).await.status, 201);
    assert_eq!(driver.withdraw(server, "keep").await.status, 200);
    send(1).await.problem(410, "withdrawn", None);
    assert_eq!(server.export("default").await.lines().count(), 51);
}

/// The same participation is open in two tabs. The trial that is stored first counts, and the other
/// tab gets an error. (In a browser, the later tab also takes over the participation; the browser
/// tests check this.)
pub(super) async fn case_13_two_tabs(server: &Server) {
    let body = json!({ "consent": true, "request_id": "one-request-of-two-tabs" });
    let tabs = join_all([(); 2].map(|()| Driver::ask(server, body.clone()))).await;
    let mut tabs: Vec<_> = tabs.into_iter().map(|answer| (answer.status, answer.body)).collect();
    tabs.sort_by_key(|(status, _)| *status);
    assert_eq!([tabs[0].0, tabs[1].0], [200, 201], "one participant");
    let tabs = tabs
        .into_iter()
        .map(|(_, body)| Driver { enrolled: serde_json::from_value::<Enrolled>(body).unwrap() });
    let tabs: Vec<_> = tabs.collect();
    assert_eq!(tabs[0].enrolled.participant_id, tabs[1].enrolled.participant_id);
    let (id, scene) = tabs[0].scenes()[0].clone();
    let mut other = driven(&scene);
    other.exposures = 2;
    let sent = [driven(&scene), other];
    let answers = join_all([0, 1].map(|i| tabs[i].send(server, &id, &sent[i]))).await;
    let mut statuses = [answers[0].status, answers[1].status];
    statuses.sort_unstable();
    assert_eq!(statuses, [201, 409]);
    assert_eq!(stored(server, &tabs[0]).await, [id]);
}
