//! The time of day jumps while the server runs.

use reqwest::Method;
use sidestep::api::{Progress, routes};
use sidestep_tests::{Answer, Driver, Folder, Process, driven, run};
use std::path::PathBuf;

/// The library `libfaketime` (from Debian's package of this name). It shifts a program's time of
/// day, but does not change the speed of its clock.
fn library() -> Option<PathBuf> {
    let folders = std::fs::read_dir("/usr/lib").ok()?.flatten();
    let mut found = folders.map(|folder| folder.path().join("faketime/libfaketime.so.1"));
    found.find(|library| library.is_file())
}

/// During a participation, the clock jumps by a day back, an hour forward, years forward and back,
/// and to before 1970.
#[tokio::test]
async fn steps_of_the_clock_lose_and_double_nothing() {
    let library = library().expect("libfaketime (Debian: apt-get install libfaketime)");
    let folder = Folder::default();
    let step = |offset: &str| drop(folder.file("offset", offset));
    step("+0d");
    let preload = format!("LD_PRELOAD={}", library.display());
    let offset = format!("FAKETIME_TIMESTAMP_FILE={}", folder.name("offset"));
    let launcher =
        ["env", &preload, &offset, "FAKETIME_NO_CACHE=1", "FAKETIME_DONT_FAKE_MONOTONIC=1"];
    let database = folder.database("sidestep.db");
    let mut server = Process::start_through(&launcher, &folder, &database).await;
    let key = server.key().await;
    let driver = Driver::enrol(&server).await;
    let (mut sent, mut received) = (Vec::new(), Vec::new());
    let scenes = driver.scenes();
    for ((trial_id, scene), offset) in
        scenes.iter().zip(["+0d", "-1d", "+1h", "+20y", "-70y", "-50y", "+0d"])
    {
        step(offset);
        let trial = driven(scene);
        for status in [201, 200] {
            let answer = driver.send(&server, trial_id, &trial).await;
            assert_eq!(answer.status, status, "{offset}: {}", answer.body);
        }
        sent.push(trial_id.clone());
        let me: Progress = driver.me(&server).await.into(200);
        assert_eq!(me.stored, sent, "{offset}");
        assert_eq!(server.get("/readyz").await.status, 200, "{offset}");
        let detail = server.request(Method::GET, &routes::admin_trial(trial_id)).bearer_auth(&key);
        let detail = Answer::of(detail).await;
        assert_eq!(detail.status, 200, "{offset}: {}", detail.body);
        received.push(detail.body["received_at_ms"].as_i64().unwrap());
    }
    // Check that the clock really jumped.
    let [before, back, _, years, ..] = received[..] else { panic!("{received:?}") };
    assert!(before - back > 80_000_000 && years - before > 19 * 365 * 86_400_000, "{received:?}");
    assert!(received[5] < years, "{received:?}");
    // A person who joins in another year is a new participant, and continues today.
    step("+20y");
    let late = Driver::enrol(&server).await;
    step("+0d");
    late.drive(&server, 1).await;
    server.kill().await;

    // The server starts with a clock behind its stored times.
    step("-1d");
    let server = Process::start_through(&launcher, &folder, &database).await;
    let me: Progress = driver.me(&server).await.into(200);
    assert_eq!(me.stored, sent);
    let (trial_id, scene) = &scenes[sent.len()];
    assert_eq!(driver.send(&server, trial_id, &driven(scene)).await.status, 201);
    server.kill().await;
    let report = run(&["check", "--database", &database]).await.json();
    assert_eq!(report["trials"], sent.len() + 2, "{report}");
    assert_eq!(report["wrong"], serde_json::json!([]));
}
