//! Automatic backups and checks of a server.

use reqwest::Method;
use sidestep::api::{DataCheck, DataCheckState, routes};
use sidestep_server::commands::serve::ServeArgs;
use sidestep_tests::server::SHORT_STUDY;
use sidestep_tests::{Driver, Server, behind, run};
use std::time::{Duration, Instant};

/// Checks the data every second, starting after 0.1 s.
fn often(args: &mut ServeArgs) {
    args.keeping.first = Duration::from_millis(100);
    args.keeping.check_every = 1.0 / 3600.0;
}

async fn until(server: &Server, is_wanted: impl Fn(&DataCheck) -> bool) -> DataCheck {
    let begun = Instant::now();
    loop {
        let check: DataCheck = server.admin(routes::DATA_CHECK).await.into(200);
        if is_wanted(&check) {
            return check;
        }
        assert!(begun.elapsed() < Duration::from_secs(600), "{check:?}");
        tokio::time::sleep(Duration::from_millis(50)).await;
    }
}

#[tokio::test]
async fn stored_data_are_checked_while_the_server_runs() {
    let server = Server::with_study_and(SHORT_STUDY, often).await;
    assert_eq!(server.admin(routes::DATA_CHECK).await.into::<DataCheck>(200).backup, None);
    Driver::enrol(&server).await.drive(&server, 3).await;
    let check = until(&server, |it| it.trials == Some(3)).await;
    assert_eq!((check.fault_count, check.message), (0, None));
    let wrong = "UPDATE trial SET closest_m = closest_m + 1 \
                 WHERE sequence = (SELECT max(sequence) FROM trial)";
    behind(&server.database()).execute(wrong).await.unwrap();
    let check = until(&server, |it| it.fault_count == 1).await;
    assert!(check.faults[0].contains("closest range"), "{check:?}");
    // The laboratory and the operator are notified, and participants can still drive.
    let ready = server.get("/readyz").await;
    assert_eq!(ready.status, 200);
    let text = async |route: &str| {
        server.request(Method::GET, route).send().await.unwrap().text().await.unwrap()
    };
    assert!(text("/metrics").await.contains("\nsidestep_data_faults 1\n"));
    assert_eq!(text("/readyz").await, "ready\nfaults in stored data: 1; see 'sidestep check'\n");
    let late = Driver::enrol(&server).await;
    late.drive(&server, 1).await;
}

#[tokio::test]
async fn a_backup_is_written_now_and_then_and_the_oldest_are_deleted() {
    let folder = tempfile::tempdir().unwrap();
    let backups = folder.path().to_owned();
    // The age of this file counts from its modification time, which is now.
    let another = backups.join("sidestep-20200101T000000Z-00000000.db");
    std::fs::write(&another, "that of another database").unwrap();
    let server = Server::with_study_and(SHORT_STUDY, often).await;
    Driver::enrol(&server).await.drive(&server, 2).await;
    let wanted = backups.clone();
    let change = |args: &mut ServeArgs| {
        (args.keeping.backups, args.keeping.backups_kept) = (Some(wanted.clone()), 2);
    };
    let server = server.stop().await.start_with(None, change).await;
    let is_done = |it: &DataCheck| it.state == DataCheckState::Done && it.trials == Some(2);
    let first = until(&server, is_done).await.backup.unwrap();
    let old = first.name.replace("sidestep-20", "sidestep-19");
    std::fs::write(backups.join(&old), "an old one").unwrap();
    let next = |it: &DataCheck| it.backup.as_ref().is_some_and(|it| it.name != first.name);
    let second = until(&server, next).await.backup.unwrap();
    let metrics = server.request(Method::GET, "/metrics").send().await.unwrap();
    let metrics = metrics.text().await.unwrap();
    assert!(metrics.contains("\nsidestep_backup_timestamp_seconds "), "{metrics}");
    // At its start, the server already knows the backups in the folder.
    let server = server.stop().await.start_with(None, change).await;
    let known = until(&server, |it| it.backup.is_some()).await.backup.unwrap();
    assert!(known.name >= second.name, "{known:?}");
    server.stop().await;
    assert!(!backups.join(old).exists() && another.exists(), "two of this database are kept");
    let newest = backups.join(&second.name);
    assert!(newest.metadata().unwrap().len() == second.bytes);
    let to = format!("sqlite:{}", folder.path().join("restored.db").display());
    let from = newest.display().to_string();
    let restored = run(&["restore", "--from", &from, "--database", &to]).await.json();
    assert_eq!(restored["trials"], 2, "{restored}");
}

#[tokio::test]
async fn a_faulty_trial_is_told_and_ends_no_backups() {
    let folder = tempfile::tempdir().unwrap();
    let server = Server::with_study(SHORT_STUDY).await;
    Driver::enrol(&server).await.drive(&server, 3).await;
    let faulty = "UPDATE trial SET closest_m = closest_m + 1 \
                  WHERE trial_id = (SELECT max(trial_id) FROM trial)";
    behind(&server.database()).execute(faulty).await.unwrap();
    let wanted = folder.path().to_owned();
    let change = |args: &mut ServeArgs| {
        often(args);
        args.keeping.backups = Some(wanted.clone());
    };
    let server = server.stop().await.start_with(None, change).await;
    let found = until(&server, |it| it.state == DataCheckState::Done).await;
    assert_eq!((found.trials, found.fault_count, found.faults.len()), (Some(3), 1, 1));
    let backup = found.backup.unwrap().name;
    server.stop().await;
    let from = folder.path().join(backup).display().to_string();
    let to = format!("sqlite:{}", folder.path().join("restored.db").display());
    let restore = ["restore", "--from", &from, "--database", &to];
    run(&restore).await.refused(1, &["not sound"]);
    let restored = run(&[&restore[..], &["--with-faulty-trials"]].concat()).await.json();
    assert_eq!((&restored["trials"], restored["wrong"].as_array().unwrap().len()), (&3.into(), 1));
}

#[tokio::test]
async fn a_folder_for_backups_that_cannot_be_one_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let (database, file) = (folder.path().join("new.db"), folder.path().join("file"));
    std::fs::write(&file, "").unwrap();
    let database = format!("sqlite:{}", database.display());
    let below = file.join("backups").display().to_string();
    let refused = run(&["serve", "--database", &database, "--backups", &below]).await;
    refused.refused(2, &["--backups", "backups", "expected a folder", "Not a directory"]);
    assert!(!folder.path().join("new.db").exists());
    let here = folder.path().display().to_string();
    let never = ["serve", "--database", &database, "--backups", &here, "--check-every", "0"];
    run(&never).await.refused(2, &["--check-every 0", "--backups"]);
    let refused = run(&["serve", "--check-every", "-1"]).await;
    refused.refused(2, &["--check-every", "expected 0, or a number from 0.01 to 8784"]);
}
