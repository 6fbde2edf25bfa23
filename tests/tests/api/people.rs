//! The list of participants in the laboratory.

use serde_json::json;
use sidestep::api::{KeyEvent, ParticipantPage, ParticipantSummary, Quality, Stage, routes};
use sidestep::scene::Scene;
use sidestep::vehicle::TurnInput;
use sidestep_server::store::{Purpose, Store};
use sidestep_tests::server::SHORT_STUDY;
use sidestep_tests::{Driver, Server, behind, driven, driver};

async fn people(server: &Server, query: &str) -> ParticipantPage {
    let route = format!("{}?{query}", routes::admin_participants("default"));
    server.admin(&route).await.into(200)
}

fn numbers(page: &ParticipantPage) -> Vec<i64> {
    page.participants.iter().map(|person| person.number).collect()
}

pub(crate) async fn come(server: &Server, external_id: &str) -> Driver {
    let body = json!({ "consent": true, "external_id": external_id });
    Driver { enrolled: Driver::ask(server, body).await.into(201) }
}

/// Drives all scenes with a constant input, and with key events at these times.
pub(crate) async fn drive(
    server: &Server,
    driver: &Driver,
    input: TurnInput,
    key_times_ms: &[f64],
) {
    for (trial_id, scene) in driver.scenes() {
        let mut trial = driver::upload(&scene, vec![input; steps(&scene)]);
        let event = |(i, &t_ms): (usize, &f64)| KeyEvent {
            t_ms,
            key: "ArrowLeft".to_owned(),
            down: i % 2 == 0,
        };
        trial.key_events = key_times_ms.iter().enumerate().map(event).collect();
        assert_eq!(driver.send(server, &trial_id, &trial).await.status, 201);
    }
}

fn steps(_: &Scene) -> usize {
    sidestep::scene::SceneParameters::default().steps
}

#[tokio::test]
async fn the_list_says_how_far_everybody_is_and_what_to_look_at() {
    let server = Server::with_study(&format!("{SHORT_STUDY}[comprehension]\nattempts = 1\n")).await;
    let check = async |driver: &Driver, passed: bool| {
        let body = json!({ "attempts": 1, "passed": passed });
        assert_eq!(driver.put(&server, routes::COMPREHENSION, &body).await.status, 200);
    };
    let [joined, practising, driving, closing, done, screened_out, gone] = {
        let mut all = Vec::new();
        for id in ["p1", "P2", "p3", "p4", "p5", "p6", "p7"] {
            all.push(come(&server, id).await);
        }
        <[Driver; 7]>::try_from(all).ok().unwrap()
    };
    check(&joined, true).await;
    practising.drive(&server, 1).await;
    driving.drive(&server, 3).await;
    drive(&server, &closing, TurnInput::Left, &[10.5, 20.25, 700.125, 800.0]).await;
    drive(&server, &done, TurnInput::Straight, &[10.5, 20.25, 700.125, 800.0]).await;
    done.complete(&server).await;
    check(&screened_out, false).await;
    gone.drive(&server, 2).await;
    gone.withdraw(&server, "delete").await;
    let pilot = Driver::ask(&server, json!({ "consent": true, "pilot": true })).await;
    assert_eq!(pilot.status, 201);

    let page = people(&server, "").await;
    let stages: Vec<_> = page.participants.iter().map(|person| person.stage).collect();
    use Stage::{Closing, Complete, Joined, Practice, ScreenedOut, Task, Withdrawn};
    let expected = [Joined, Practice, Task, Closing, Complete, ScreenedOut, Withdrawn];
    assert_eq!((stages, page.total), (expected.to_vec(), 7));
    assert!(page.stages.iter().all(|count| count.participants == 1) && page.stages.len() == 7);
    let of = |number: usize| -> &ParticipantSummary { &page.participants[number - 1] };
    assert_eq!((of(1).understood, of(1).comprehension_attempts), (true, 1));
    assert_eq!((of(1).quality.failed_checks, of(6).quality.failed_checks), (0, 1));
    assert_eq!((of(3).stored, of(3).planned, of(3).waiting), (3, 5, 0));
    // The key times of the fourth participant's first task equal the key times of the participant's
    // warm-up, but of no other earlier trial. All later tasks have the same key times.
    let quality = of(4).quality;
    assert_eq!((quality.always_steered, quality.never_steered, quality.same_timing), (3, 0, 3));
    let quality = of(5).quality;
    assert_eq!((quality.always_steered, quality.never_steered, quality.same_timing), (0, 3, 3));
    assert_eq!((of(5).completion_code.is_some(), of(2).external_id.as_deref()), (true, Some("P2")));
    assert_eq!((of(7).quality, of(7).stored, &of(7).external_id), (Quality::default(), 0, &None));
    let pilots = people(&server, "pilot=true").await;
    assert_eq!((pilots.total, pilots.participants[0].pilot), (1, true));

    for (query, found) in [
        ("sort=stored&order=desc&limit=3", vec![4, 5, 3]),
        ("sort=stored&order=desc&limit=3&offset=3", vec![2, 1, 6]),
        ("order=desc&limit=2", vec![7, 6]),
        ("stage=practice", vec![2]),
        ("having=always_steered", vec![4]),
        ("having=failed_checks", vec![6]),
        ("having=same_timing&sort=never_steered&order=desc", vec![5, 4]),
        ("having=same_timing&stage=complete", vec![5]),
        ("search=p2", vec![2]),
        ("search=%20P3%20", vec![3]),
        ("search=6", vec![6]),
        ("search=%25", vec![]),
        ("search=", vec![1, 2, 3, 4, 5, 6, 7]),
    ] {
        assert_eq!(numbers(&people(&server, query).await), found, "{query}");
    }
    assert_eq!(people(&server, "having=same_timing&limit=1").await.total, 2);
    for (query, field) in [
        ("sort=shoe_size", "sort"),
        ("order=up", "order"),
        ("stage=asleep", "stage"),
        ("having=number", "having"),
        ("limit=501", "limit"),
        ("offset=-1", "offset"),
        ("sorted=number", "sorted"),
    ] {
        let route = format!("{}?{query}", routes::admin_participants("default"));
        server.admin(&route).await.problem(422, "invalid", Some(field));
    }
}

#[tokio::test]
async fn a_wrong_tally_is_found() {
    let server = Server::with_study(SHORT_STUDY).await;
    let driver = Driver::enrol(&server).await;
    driver.drive(&server, 5).await;
    let url = server.database();
    let wrong = async || {
        let store = Store::open(&url, Purpose::Read).await.unwrap();
        store.wrong_tallies().await.unwrap()
    };
    assert!(wrong().await.is_empty());
    let id = driver.enrolled.participant_id.as_str();
    for (damage, repair) in [
        ("UPDATE tally SET task = task + 1", "UPDATE tally SET task = task - 1"),
        ("UPDATE tally SET excluded = TRUE", "UPDATE tally SET excluded = FALSE"),
        ("UPDATE tally SET complete = TRUE", "UPDATE tally SET complete = FALSE"),
        ("UPDATE tally SET number = 9", "UPDATE tally SET number = 1"),
        ("DELETE FROM tally", ""),
    ] {
        behind(&url).execute(damage).await.unwrap();
        assert_eq!(wrong().await, [id], "{damage}");
        behind(&url).execute(repair).await.unwrap();
        assert_eq!(wrong().await.is_empty(), !repair.is_empty());
    }
}

#[tokio::test]
async fn trials_that_wait_in_a_browser_are_shown_until_they_are_sent() {
    let server = Server::with_study(SHORT_STUDY).await;
    let driver = Driver::enrol(&server).await;
    let [first, second, ..] = &driver.scenes()[..] else { panic!("no scenes") };
    let send = async |(id, scene): &(String, Scene), query: &str| {
        let route = format!("{}{query}", routes::my_trial(id));
        driver.put(&server, &route, &serde_json::to_value(driven(scene)).unwrap()).await
    };
    let waiting = async || people(&server, "").await.participants[0].waiting;
    assert_eq!(send(first, "?waiting=3").await.status, 201);
    assert_eq!(waiting().await, 3);
    assert_eq!(people(&server, "having=waiting").await.total, 1);
    // The response was lost, so the browser sends the trial again. Meanwhile, one more trial waits
    // in the browser.
    assert_eq!(send(first, "?waiting=4").await.status, 200);
    assert_eq!(waiting().await, 4);
    assert_eq!(send(second, "").await.status, 201);
    assert_eq!((waiting().await, people(&server, "having=waiting").await.total), (0, 0));
    for wrong in ["?waiting=-1", "?waiting=many", "?waiting=4294967296"] {
        send(second, wrong).await.problem(422, "invalid", Some("waiting"));
    }
}
