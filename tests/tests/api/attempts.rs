//! Interrupted trials: flags, further attempts, storage and exports.

use serde_json::{Value, json};
use sidestep::api::{PlannedScene, Progress, TrialStored, TrialUpload, routes};
use sidestep::trial::{PageEvent, PageEventKind, Phase};
use sidestep_tests::{Driver, Server, driven, run};

const STUDY: &str = "phases = [{ phase = \"practice\", scenes = 1 }, \
                     { phase = \"task\", scenes = 2 }]\n[trials]\nrepeat_interrupted = true\n";

fn interrupted(scene: &sidestep::scene::Scene) -> TrialUpload {
    let mut trial = driven(scene);
    trial.page_events = vec![PageEvent { t_ms: 2_000.5, kind: PageEventKind::Hidden }];
    trial.exposures = 2;
    trial
}

/// The next scene to drive, and its phase.
async fn next(server: &Server, driver: &Driver) -> Option<(Phase, PlannedScene)> {
    let me: Progress = driver.me(server).await.into(200);
    let id = me.next?;
    let (phase, scene) = me.plan.scenes().find(|(_, scene)| scene.trial_id == id).unwrap();
    Some((phase.phase, scene.clone()))
}

#[tokio::test]
async fn an_interrupted_task_is_driven_again_once_at_the_end() {
    let server = Server::with_study(STUDY).await;
    let driver = Driver::enrol(&server).await;
    let scenes = driver.scenes();
    // Practice is not repeated, and every attempt at the first task is interrupted.
    for (i, trial) in [interrupted(&scenes[0].1), interrupted(&scenes[1].1)].iter().enumerate() {
        let stored: TrialStored = driver.send(&server, &scenes[i].0, trial).await.into(201);
        assert_eq!(stored.next.as_ref(), Some(&scenes[i + 1].0));
        assert_eq!(driver.send(&server, &scenes[i].0, trial).await.status, 200);
    }
    let mut other = interrupted(&scenes[1].1);
    other.exposures = 3;
    let other = driver.send(&server, &scenes[1].0, &other).await;
    other.problem(409, "different_content", None);
    let last: TrialStored =
        driver.send(&server, &scenes[2].0, &driven(&scenes[2].1)).await.into(201);
    let (phase, again) = next(&server, &driver).await.unwrap();
    assert_eq!((last.next.as_ref(), phase), (Some(&again.trial_id), Phase::Task));
    assert_eq!((again.index, again.attempt, again.scene()), (0, 2, scenes[1].1.clone()));
    driver.complete(&server).await.problem(409, "incomplete", None);
    let stored = driver.send(&server, &again.trial_id, &interrupted(&again.scene())).await;
    assert_eq!(stored.into::<TrialStored>(201).next, None, "at most one further attempt");
    assert_eq!(driver.complete(&server).await.status, 200);

    let flags = async |id: &str| server.admin(&routes::admin_trial(id)).await.body["flags"].clone();
    let expected = json!(["interrupted", "focus_lost", "shown_before"]);
    assert_eq!((flags(&scenes[1].0).await, flags(&scenes[2].0).await), (expected, json!([])));
    let export = server.export("default").await;
    let header: Vec<_> = export.lines().next().unwrap().split(',').collect();
    let column = |name: &str| -> Vec<String> {
        let at = header.iter().position(|column| *column == name).unwrap();
        let cells = export.lines().skip(1).map(|line| line.split(',').nth(at).unwrap().to_owned());
        cells.collect()
    };
    let attempts: Vec<_> = column("attempt").into_iter().step_by(50).collect();
    assert_eq!(attempts, ["1", "1", "1", "2"]);
    assert_eq!(column("exposures")[150], "2");
    assert_eq!(column("due_at_ms")[3], "600.0");
    assert_eq!(column("phase_index")[150], "0");
    let report = run(&["check", "--database", &server.database()]).await.json();
    assert_eq!((&report["wrong"], &report["flagged"]), (&json!([]), &json!(3)));
}

#[tokio::test]
async fn without_the_setting_nothing_is_driven_again() {
    let server = Server::with_study("phases = [{ phase = \"task\", scenes = 1 }]").await;
    let driver = Driver::enrol(&server).await;
    let (id, scene) = driver.scenes()[0].clone();
    let stored: TrialStored = driver.send(&server, &id, &interrupted(&scene)).await.into(201);
    assert_eq!(stored.next, None);
    assert_eq!(driver.complete(&server).await.status, 200);
}

#[tokio::test]
async fn pages_record_only_what_can_be() {
    let server = Server::with_study(STUDY).await;
    let driver = Driver::enrol(&server).await;
    let (id, scene) = driver.scenes()[0].clone();
    let honest = serde_json::to_value(interrupted(&scene)).unwrap();
    type Change = fn(&mut Value);
    let changes: [(Change, &str); 8] = [
        (|t| t["exposures"] = json!(0), "exposures"),
        (|t| t["exposures"] = json!(1.5), "exposures"),
        (|t| t["exposures"] = json!(-1), "exposures"),
        (|t| t["page_events"] = json!({}), "page_events"),
        (|t| t["page_events"][0]["kind"] = json!("slept"), "page_events[0].kind"),
        (|t| t["page_events"][0]["t_ms"] = json!(null), "page_events[0].t_ms"),
        (|t| t["page_events"][0]["why"] = json!("x"), "page_events[0].why"),
        (
            |t| {
                t["page_events"] = json!(vec![json!({ "t_ms": 1.0, "kind": "shown" }); 1001]);
            },
            "page_events",
        ),
    ];
    for (change, field) in changes {
        let mut trial = honest.clone();
        change(&mut trial);
        let answer = driver.put(&server, &routes::my_trial(&id), &trial).await;
        answer.problem(422, "invalid", Some(field));
    }
    assert_eq!(next(&server, &driver).await.unwrap().1.trial_id, id);
}
