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
    sidestep_tests::behind(&database).execute("PRAGMA wal_checkpoint(TRUNCATE)").await.unwrap();
    let file = folder.path("sidestep.db");
    let before = std::fs::read(&file).unwrap();

    let set = |path: &Path, mode| {
        std::fs::set_permissions(path, std::fs::Permissions::from_mode(mode)).unwrap();
    };
    set(&file, 0o400);
    // Root could write nevertheless, and gives up that right.
    let is_root = std::fs::metadata("/proc/self").unwrap().uid() == 0;
    let launcher =
        if is_root { &["setpriv", "--bounding-set=-dac_override"][..] } else { &["env"] };
    let site = folder.name("site");
    let said = |args: &[&str]| {
        let mut command = Command::new(launcher[0]);
        command.args(&launcher[1..]).arg(binary()).args(args).args(["--database", &database]);
        Said::from(command.env_remove("SIDESTEP_ADMIN_KEY").output().unwrap())
    };
    // SQLite opens a file that it must not write to, in a folder that it may write to or not.
    for folder_mode in [0o700, 0o500] {
        set(folder.root(), folder_mode);
        let serve = said(&["serve", "--listen", "127.0.0.1:0", "--static", &site]);
        let check = said(&["check"]);
        set(folder.root(), 0o700);
        serve.refused(1, &["sidestep.db", "writable"]);
        assert_eq!(check.json()["trials"], 2, "reading goes on");
    }
    set(&file, 0o600);
    assert!(std::fs::read(&file).unwrap() == before, "the file has changed");

    let server = Process::start(&folder).await;
    let me: Progress = driver.me(&server).await.into(200);
    assert_eq!(me.stored, sent.iter().map(|(id, _)| id.clone()).collect::<Vec<_>>());
    server.kill().await;
    run(&["check", "--database", &database]).await.json();
}
