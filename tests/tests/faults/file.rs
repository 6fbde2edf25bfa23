//! A database that may not be written.

use sidestep::api::Progress;
use sidestep_tests::process::{Said, binary};
use sidestep_tests::{Driver, Folder, Process, run};
use std::os::unix::fs::{MetadataExt, PermissionsExt};
use std::path::Path;
use std::process::Command;

#[tokio::test]
async fn a_read_only_database_is_refused_and_unchanged() {
    let folder = Folder::default();
    let server = Process::start(&folder).await;
    let driver = Driver::enrol(&server).await;
    let sent = driver.drive(&server, 2).await;
    server.kill().await;
    // The log's content into the file, so that there is one file to compare.
    let database = folder.database("sidestep.db");
    sidestep_tests::behind(&database).execute_batch("PRAGMA wal_checkpoint(TRUNCATE)").unwrap();
    let file = folder.path("sidestep.db");
    let before = std::fs::read(&file).unwrap();

    let set = |path: &Path, mode| {
        std::fs::set_permissions(path, std::fs::Permissions::from_mode(mode)).unwrap();
    };
    set(&file, 0o400);
    set(folder.root(), 0o500);
    // Root could write nevertheless, and gives up that right.
    let is_root = std::fs::metadata("/proc/self").unwrap().uid() == 0;
    let launcher =
        if is_root { &["setpriv", "--bounding-set=-dac_override"][..] } else { &["env"] };
    let site = folder.name("site");
    let output = Command::new(launcher[0])
        .args(&launcher[1..])
        .arg(binary())
        .args(["serve", "--listen", "127.0.0.1:0", "--static", &site, "--database", &database])
        .env_remove("SIDESTEP_ADMIN_KEY")
        .output()
        .unwrap();
    set(folder.root(), 0o700);
    set(&file, 0o600);
    Said::from(output).refused(1, &["sidestep.db", "writable"]);
    assert!(std::fs::read(&file).unwrap() == before, "the file has changed");

    let server = Process::start(&folder).await;
    let me: Progress = driver.me(&server).await.into(200);
    assert_eq!(me.stored, sent.iter().map(|(id, _)| id.clone()).collect::<Vec<_>>());
    server.kill().await;
    run(&["check", "--database", &database]).await.json();
}
