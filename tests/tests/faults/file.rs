//! A database that is read-only or that cannot be used, and commands that must not change it.

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
    // Write the log back into the database, so that there is only one file to compare.
    let database = folder.database("sidestep.db");
    sidestep_tests::behind(&database).execute("PRAGMA wal_checkpoint(TRUNCATE)").await.unwrap();
    let file = folder.path("sidestep.db");
    let before = std::fs::read(&file).unwrap();

    let set = |path: &Path, mode| {
        std::fs::set_permissions(path, std::fs::Permissions::from_mode(mode)).unwrap();
    };
    set(&file, 0o400);
    // Root could still write, so the process drops this capability.
    let is_root = std::fs::metadata("/proc/self").unwrap().uid() == 0;
    let launcher =
        if is_root { &["setpriv", "--bounding-set=-dac_override"][..] } else { &["env"] };
    let site = folder.name("site");
    let said = |args: &[&str]| {
        let mut command = Command::new(launcher[0]);
        command.args(&launcher[1..]).arg(binary()).args(args).args(["--database", &database]);
        Said::from(command.env_remove("SIDESTEP_ADMIN_KEY").output().unwrap())
    };
    // SQLite opens a read-only file, whether or not its folder is writable.
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

#[tokio::test]
async fn commands_that_read_leave_an_unclosed_database_as_it_is() {
    let folder = Folder::default();
    let server = Process::start(&folder).await;
    Driver::enrol(&server).await.drive(&server, 2).await;
    server.kill().await;
    let (database, out) = (folder.database("sidestep.db"), |name: &str| folder.name(name));
    let files = ["sidestep.db", "sidestep.db-wal"].map(|name| folder.path(name));
    let content = || files.each_ref().map(|file| std::fs::read(file).unwrap());
    let before = content();
    assert_eq!(run(&["check", "--database", &database]).await.json()["trials"], 2);
    let export = ["export", "--database", &database, "--study", "default", "--out", &out("export")];
    run(&export).await.json();
    run(&["backup", "--database", &database, "--out", &out("backup.db")]).await.json();
    run(&["copy", "--from", &database, "--to", &folder.database("copy.db")]).await.json();
    assert!(content() == before, "a command has changed the database");
}

/// For these paths, SQLite would only say that it cannot open the file, or wait forever, or create
/// a separate log for each name of the file.
#[tokio::test]
async fn what_is_no_file_of_one_name_is_refused_with_the_reason() {
    let folder = Folder::default();
    let server = Process::start(&folder).await;
    Driver::enrol(&server).await.drive(&server, 2).await;
    server.stop().await;
    let before = std::fs::read(folder.path("sidestep.db")).unwrap();
    std::fs::hard_link(folder.path("sidestep.db"), folder.path("twin.db")).unwrap();
    std::os::unix::fs::symlink(folder.path("nowhere"), folder.path("dangling.db")).unwrap();
    std::os::unix::fs::symlink(folder.path("sidestep.db"), folder.path("link.db")).unwrap();
    std::fs::create_dir(folder.path("folder.db")).unwrap();
    assert!(Command::new("mkfifo").arg(folder.path("pipe.db")).status().unwrap().success());

    let site = folder.name("site");
    let serve = ["serve", "--listen", "127.0.0.1:0", "--static", &site];
    let trials = folder.name("trials.csv");
    run(&["simulate", "--participants", "1", "--seed", "1", "--out", &trials]).await.json();
    let import = ["import", "--study", "imported", "--trials", &trials];
    let (saved, new) = (folder.name("saved.db"), folder.database("new.db"));
    for (name, word) in
        [("dangling.db", "a symbolic link"), ("folder.db", "directory"), ("pipe.db", "pipe")]
    {
        let database = folder.database(name);
        for args in [&serve[..], &import, &["check"], &["backup", "--out", &saved]] {
            run(&[args, &["--database", &database]].concat()).await.refused(1, &[name, word]);
        }
        run(&["copy", "--from", &database, "--to", &new]).await.refused(1, &[name, word]);
        let from = folder.name(name);
        for command in ["restore", "salvage"] {
            let said = run(&[command, "--from", &from, "--database", &new]).await;
            said.refused(2, &["--from", name]);
        }
    }
    // A command that only reads needs no log. A symbolic link leads to the same log as the file
    // itself.
    for name in ["sidestep.db", "twin.db"] {
        let database = folder.database(name);
        for args in [&serve[..], &import] {
            let said = run(&[args, &["--database", &database]].concat()).await;
            said.refused(1, &[name, "hard links", "delete the names"]);
        }
        assert_eq!(run(&["check", "--database", &database]).await.json()["trials"], 2);
    }
    assert!(std::fs::read(folder.path("sidestep.db")).unwrap() == before);
    std::fs::remove_file(folder.path("twin.db")).unwrap();
    run(&[&import[..], &["--database", &folder.database("link.db")]].concat()).await.json();
    let files = ["saved.db", "new.db", "link.db-wal"];
    assert!(files.iter().all(|name| !folder.path(name).exists()));
}

/// If the index of the log is missing, SQLite creates a new index, and does not notice that the
/// server uses another one.
#[tokio::test]
async fn commands_refuse_another_index_of_the_log_than_the_server_has() {
    for is_replaced in [false, true] {
        let folder = Folder::default();
        let server = Process::start(&folder).await;
        Driver::enrol(&server).await.drive(&server, 2).await;
        let trials = folder.name("trials.csv");
        run(&["simulate", "--participants", "2", "--seed", "1", "--out", &trials]).await.json();
        let (database, index) = (folder.database("sidestep.db"), folder.path("sidestep.db-shm"));
        run(&["check", "--database", &database]).await.json();
        std::fs::remove_file(&index).unwrap();
        if is_replaced {
            std::fs::write(&index, []).unwrap();
        }
        let log = std::fs::read(folder.path("sidestep.db-wal")).unwrap();
        let (slug, out) = ("imported", folder.name("backup.db"));
        for args in [
            vec!["import", "--study", slug, "--trials", &trials, "--database", &database],
            vec!["check", "--database", &database],
            vec!["backup", "--database", &database, "--out", &out],
        ] {
            run(&args).await.refused(1, &["another index", "sidestep.db-shm", "stop that server"]);
        }
        assert!(std::fs::read(folder.path("sidestep.db-wal")).unwrap() == log);
        server.kill().await;
        assert_eq!(run(&["check", "--database", &database]).await.json()["trials"], 2);
    }
}
