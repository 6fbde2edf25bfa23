//! Database faults: only stored data are acknowledged, and the service recovers as soon as the
//! cause is gone.

use reqwest::{Method, StatusCode};
use serde_json::json;
use sidestep::api::{Progress, routes};
use sidestep_tests::server::SHORT_STUDY;
use sidestep_tests::{Answer, Driver, Folder, Process, Server, driven, run, sqlite};
use sqlx::Executor;
use std::path::Path;

#[tokio::test]
async fn a_lock_of_another_process_is_waited_for_and_then_refused() {
    let server = Server::on_a_file(SHORT_STUDY).await;
    let driver = Driver::enrol(&server).await;
    let (trial_id, scene) = driver.scenes()[0].clone();
    let trial = driven(&scene);
    let mut other = sqlite::open(&server.path("sidestep.db")).await.unwrap();
    other.execute("BEGIN IMMEDIATE").await.unwrap();
    // Reading still works.
    assert_eq!(driver.me(&server).await.status, 200);
    let request = driver.request(&server, Method::PUT, &routes::my_trial(&trial_id));
    let refused = request.json(&trial).send().await.unwrap();
    assert_eq!(refused.status(), StatusCode::SERVICE_UNAVAILABLE);
    assert_eq!(refused.headers()["retry-after"], "5");
    server.get("/readyz").await.problem(503, "not_ready", None);
    other.execute("ROLLBACK").await.unwrap();
    assert_eq!(server.get("/readyz").await.status, 200);
    assert_eq!(driver.send(&server, &trial_id, &trial).await.status, 201);
}

#[tokio::test]
async fn a_deleted_database_acknowledges_nothing() {
    let server = Server::on_a_file(SHORT_STUDY).await;
    let driver = Driver::enrol(&server).await;
    let (trial_id, scene) = driver.scenes()[0].clone();
    let trial = driven(&scene);
    let (file, aside) = (server.path("sidestep.db"), server.path("aside.db"));
    std::fs::rename(&file, &aside).unwrap();
    for _ in 0..2 {
        driver.send(&server, &trial_id, &trial).await.problem(503, "storage", None);
        let ready = server.get("/readyz").await;
        assert!(ready.problem(503, "not_ready", None).contains("deleted, moved or replaced"));
        // Remote clients do not learn the path of the file.
        let from_outside =
            server.request(Method::GET, "/readyz").header("forwarded", "for=192.0.2.7");
        let told = Answer::of(from_outside).await;
        let told = told.problem(503, "not_ready", None);
        assert_eq!(told, "no trial can be stored now; the server's log says why");
    }
    // If another file appears at the same path, the server does not write to it.
    std::fs::write(&file, b"").unwrap();
    driver.send(&server, &trial_id, &trial).await.problem(503, "storage", None);
    assert_eq!(std::fs::metadata(&file).unwrap().len(), 0);
    std::fs::rename(&aside, &file).unwrap();
    let again = driver.send(&server, &trial_id, &trial).await;
    assert!([200, 201].contains(&again.status), "{}", again.body);
    assert_eq!(server.get("/readyz").await.status, 200);
    let server = server.restarted().await;
    let me: Progress = driver.me(&server).await.into(200);
    assert_eq!(me.stored, [trial_id]);
}

/// Checks that nothing is acknowledged while nothing can be written. Then frees space, and checks
/// that the participant and new participants can continue.
#[cfg(target_os = "linux")]
pub(crate) async fn waits_for_room(
    server: &Process,
    fill: impl FnOnce(),
    make_room: impl FnOnce(),
) {
    let driver = Driver::enrol(server).await;
    let new = || Driver::ask(server, json!({ "consent": true }));
    let scenes = &driver.scenes()[..3];
    fill();
    for _ in 0..3 {
        let (trial_id, scene) = &scenes[0];
        driver.send(server, trial_id, &driven(scene)).await.problem(503, "storage", None);
        new().await.problem(503, "storage", None);
    }
    assert_eq!(server.get("/readyz").await.status, 503);
    let me: Progress = driver.me(server).await.into(200);
    assert!(me.stored.is_empty());
    make_room();
    for (trial_id, scene) in scenes {
        assert_eq!(driver.send(server, trial_id, &driven(scene)).await.status, 201);
    }
    let me: Progress = driver.me(server).await.into(200);
    assert_eq!(me.stored, [0, 1, 2].map(|i: usize| scenes[i].0.clone()));
    assert_eq!(new().await.status, 201);
}

/// The server runs on its own file system of 12 MB, which another file then fills.
#[cfg(target_os = "linux")]
#[tokio::test]
async fn writing_goes_on_when_a_full_disk_has_room_again() {
    let folder = Folder::default();
    let disk = folder.path("disk");
    std::fs::create_dir(&disk).unwrap();
    let mount = format!("mount -t tmpfs -o size=12m none '{}'", disk.display());
    let script = format!("{mount} && exec \"$0\" \"$@\"");
    let launcher = ["unshare", "--user", "--map-root-user", "--mount", "sh", "-c", &script];
    let allowed = std::process::Command::new(launcher[0]).args(&launcher[1..]).arg("true").output();
    if !allowed.as_ref().is_ok_and(|output| output.status.success()) {
        eprintln!("not tested: this system lets no user mount a file system: {allowed:?}");
        return;
    }
    let database = format!("sqlite:{}", disk.join("sidestep.db").display());
    let server = Process::start_through(&launcher, &folder, &database).await;
    // The root directory as the server sees it.
    let root = format!("/proc/{}/root", server.id());
    let filler = Path::new(&root).join(disk.strip_prefix("/").unwrap()).join("filler");
    let fill = || {
        let mut file = std::fs::File::create(&filler).unwrap();
        while std::io::Write::write_all(&mut file, &[1; 4096]).is_ok() {}
    };
    waits_for_room(&server, fill, || std::fs::remove_file(&filler).unwrap()).await;
    assert_eq!(server.get("/readyz").await.status, 200);
}

/// The file size is limited as by `ulimit -f`, at a time when SQLite's log is already longer than
/// the limit.
#[cfg(target_os = "linux")]
#[tokio::test]
async fn writing_goes_on_when_files_may_be_longer_again() {
    let folder = Folder::default();
    let server = Process::start(&folder).await;
    let id = server.id().to_string();
    let limit = |most: &str| {
        let most = format!("--fsize={most}:unlimited");
        let set = std::process::Command::new("prlimit").args(["--pid", &id, &most]).status();
        assert!(set.unwrap().success());
    };
    waits_for_room(&server, || limit("4096"), || limit("unlimited")).await;
    assert_eq!(server.get("/readyz").await.status, 200);
}

#[tokio::test]
async fn one_server_a_database() {
    let server = Server::on_a_file(SHORT_STUDY).await;
    let site = server.path("site").display().to_string();
    let database = server.database();
    let second = ["serve", "--listen", "127.0.0.1:0", "--static", &site, "--database", &database];
    run(&second).await.refused(1, &["another 'sidestep serve' uses this database"]);
    // Commands can use the database while the server runs.
    run(&["check", "--database", &database]).await.json();
    assert_eq!(Driver::enrol(&server).await.scenes().len(), 5);
}

#[cfg(unix)]
#[tokio::test]
async fn nobody_else_reads_the_file() {
    use std::os::unix::fs::PermissionsExt;
    let server = Server::on_a_file(SHORT_STUDY).await;
    Driver::enrol(&server).await;
    for name in ["sidestep.db", "sidestep.db-wal"] {
        let mode = std::fs::metadata(server.path(name)).unwrap().permissions().mode();
        assert_eq!(mode & 0o777, 0o600, "{name}");
    }
}
