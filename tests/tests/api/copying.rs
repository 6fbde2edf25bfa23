//! Backups, and copies between databases.

use sidestep_tests::server::SHORT_STUDY;
use sidestep_tests::{Driver, Folder, Server, run};

/// The exported steps of the study `default`.
async fn steps(database: &str) -> String {
    let folder = Folder::default();
    let out = folder.name("out");
    let export =
        ["export", "--study", "default", "--database", database, "--format", "csv", "--out"];
    run(&[&export[..], &[&out]].concat()).await.json();
    folder.text("out/steps.csv")
}

#[tokio::test]
async fn a_backup_of_a_server_that_collects_is_restored_whole() {
    let server = Server::with_study(SHORT_STUDY).await;
    let driver = Driver::enrol(&server).await;
    driver.drive(&server, 5).await;
    let folder = Folder::default();
    let (database, out) = (server.database(), folder.name("backup.db"));
    let backup = ["backup", "--database", &database, "--out", &out];
    let report = run(&backup).await.json();
    assert_eq!((&report["trials"], &report["participants"]), (&5.into(), &1.into()));
    run(&backup).await.refused(2, &["--out", "backup.db", "does not exist"]);

    let restored = folder.database("restored.db");
    let restore = ["restore", "--from", &out, "--database", &restored];
    assert_eq!(run(&restore).await.json()["trials"], 5);
    assert_eq!(steps(&restored).await, steps(&database).await);
    run(&restore).await.refused(2, &["--database", "restored.db", "it has data"]);
    // The laboratory's key also works with the restored database.
    let key = server.key.clone();
    let again = Server::on(restored, None).await;
    let request = again.request(reqwest::Method::GET, sidestep::api::routes::ADMIN_STUDIES);
    assert_eq!(request.bearer_auth(key).send().await.unwrap().status(), 200);

    let broken = folder.file("broken.db", "no database");
    let elsewhere = folder.database("elsewhere.db");
    let restore = ["restore", "--from", &broken, "--database", &elsewhere];
    run(&restore).await.refused(2, &["--from", "broken.db: ", "not a database"]);
    let restore = ["restore", "--from", "nowhere.db", "--database", &elsewhere];
    run(&restore).await.refused(2, &["--from nowhere.db", "cannot read"]);
    let left = folder.names();
    assert!(!left.iter().any(|name| name == "elsewhere.db" || name.starts_with('.')), "{left:?}");
}

#[tokio::test]
async fn what_a_lost_database_left_in_its_log_is_not_lost() {
    let folder = Folder::default();
    let server = Server::with_study(SHORT_STUDY).await;
    let out = folder.name("backup.db");
    run(&["backup", "--database", &server.database(), "--out", &out]).await.json();
    folder.file("lost.db-wal", "the only copy of a trial");
    let to = format!("sqlite:{}", folder.name("lost.db"));
    let restore = ["restore", "--from", &out, "--database", &to];
    let words = ["lost.db: ", "write-ahead log", "lost.db-wal", "put its database back"];
    run(&restore).await.refused(2, &[&["--database"], &words[..]].concat());
    let trials = folder.name("trials.csv");
    let simulate = ["simulate", "--participants", "1", "--seed", "1", "--out", &trials];
    run(&simulate).await.json();
    for empty in [false, true] {
        if empty {
            folder.file("lost.db", "");
        }
        for command in [
            &["serve", "--listen", "127.0.0.1:0", "--database", &to][..],
            &["check", "--database", &to],
            &["import", "--trials", &trials, "--study", "new", "--database", &to],
            &[
                "export",
                "--study",
                "default",
                "--database",
                &to,
                "--out",
                &folder.name("export.csv"),
            ],
            &["backup", "--database", &to, "--out", &folder.name("again.db")],
            &["copy", "--from", &server.database(), "--to", &to],
            &["copy", "--from", &to, "--to", &folder.database("elsewhere.db")],
        ] {
            run(command).await.refused(1, &words);
        }
    }
    assert_eq!(folder.text("lost.db-wal"), "the only copy of a trial");
    std::fs::remove_file(folder.name("lost.db")).unwrap();
    // A backup under the name `lost.db` is also refused, because it would be next to the log of the
    // lost database.
    let onto = ["backup", "--database", &server.database(), "--out", &folder.name("lost.db")];
    run(&onto).await.refused(1, &["lost.db: cannot write", "write-ahead log", "another folder"]);
    // An empty file without a log counts as a missing database.
    std::fs::remove_file(folder.name("lost.db-wal")).unwrap();
    folder.file("lost.db", "");
    assert_eq!(run(&restore).await.json()["studies"], 1);
    run(&["check", "--database", &to]).await.json();
}

#[cfg(unix)]
#[tokio::test]
async fn a_file_is_used_by_the_name_of_a_link_too() {
    let folder = Folder::default();
    let file = format!("sqlite:{}", folder.name("file.db"));
    let link = format!("sqlite:{}", folder.name("link.db"));
    std::os::unix::fs::symlink(folder.name("file.db"), folder.name("link.db")).unwrap();
    let simulate = ["simulate", "--participants", "1", "--seed", "1", "--out"];
    let trials = folder.name("trials.csv");
    run(&[&simulate[..], &[&trials]].concat()).await.json();
    let import = ["import", "--study", "linked", "--trials", &trials, "--database"];
    run(&[&import[..], &[&link]].concat()).await.refused(1, &["link.db", "cannot open"]);
    run(&[&import[..], &[&file]].concat()).await.json();
    let by_link = run(&["check", "--database", &link]).await.json();
    assert_eq!(by_link, run(&["check", "--database", &file]).await.json());
    run(&["copy", "--from", &file, "--to", &link]).await.refused(2, &["--to", "another database"]);
}

#[tokio::test]
async fn a_database_in_use_is_no_backup() {
    let folder = Folder::default();
    let server = Server::on(folder.database("used.db"), None).await;
    let (from, to) = (folder.name("used.db"), folder.database("restored.db"));
    let restore = ["restore", "--from", &from, "--database", &to];
    run(&restore).await.refused(2, &["--from", "expected a backup", "sidestep backup"]);
    server.stop().await;
}

#[tokio::test]
async fn a_password_is_in_no_message() {
    for url in [
        "POSTGRES://side:WRONG@h/d",
        "postgress://side:WRONG@h/d",
        "sqlite:postgres://side:WRONG@h/d",
        "sqlite://side:WRONG@h/d",
        "sqlite:side:WRONG@h/d?sslmode=require",
        "mysql://side:WRONG@h/d",
        " postgres://side:WRONG@h/d",
        "'postgres://side:WRONG@h/d'",
        "host=h password=WRONG",
        "postgres://side:p@WRONG@h/d",
    ] {
        let refused = run(&["check", "--database", url]).await;
        assert!(!format!("{refused:?}").contains("WRONG"), "{refused:?}");
        refused.refused(2, &["--database", "expected"]);
    }
    let misplaced = run(&["check", "postgres://side:WRONG@h/d"]).await;
    assert!(!format!("{misplaced:?}").contains("WRONG"), "{misplaced:?}");
    misplaced.refused(2, &["unexpected argument 'postgres:…'"]);
    let misplaced = run(&["postgres://side:WRONG@h/d"]).await;
    assert!(!format!("{misplaced:?}").contains("WRONG"), "{misplaced:?}");
    misplaced.refused(2, &["unrecognized subcommand 'postgres:…'"]);
}

/// A database with the name of a log of another database is refused, because SQLite would overwrite
/// or delete it.
#[tokio::test]
async fn no_database_has_the_name_of_a_log() {
    let folder = Folder::default();
    let served = folder.database("served.db");
    let server = Server::on(served.clone(), None).await;
    for end in ["-wal", "-shm", "-journal"] {
        let (name, url) = (folder.name(&format!("served.db{end}")), format!("{served}{end}"));
        run(&["serve", "--database", &url]).await.refused(1, &[end, "another name"]);
        let backup = ["backup", "--database", &served, "--out", &name];
        run(&backup).await.refused(2, &["--out", end, "another name"]);
    }
    server.stop().await;
}

#[tokio::test]
async fn a_file_that_is_served_is_not_filled_by_others() {
    let folder = Folder::default();
    let server = Server::on(folder.database("served.db"), None).await;
    let copy = ["copy", "--from", &server.database(), "--to", &server.database()];
    run(&copy).await.refused(2, &["--to", "another database"]);
    let other = Server::on(folder.database("other.db"), None).await;
    let copy = ["copy", "--from", &other.database(), "--to", &server.database()];
    run(&copy).await.refused(1, &["served.db", "another 'sidestep serve'"]);
    server.stop().await;
    other.stop().await;
}

#[tokio::test]
async fn a_study_moves_to_another_database() {
    let server = Server::with_study(SHORT_STUDY).await;
    for trials in [5, 2] {
        Driver::enrol(&server).await.drive(&server, trials).await;
    }
    let folder = Folder::default();
    let (from, to) = (server.database(), folder.database("to.db"));
    let copy = ["copy", "--from", &from, "--to", &to, "--study", "default"];
    let first = run(&copy).await.json();
    assert_eq!((&first["participants"], &first["trials"]), (&2.into(), &7.into()));
    let again = run(&copy).await.json();
    assert_eq!((&again["present"], &again["sha256"]), (&2.into(), &first["sha256"]));
    assert_eq!(steps(&to).await, steps(&from).await);
    run(&["check", "--database", &to]).await.json();
    let unknown = ["copy", "--from", &from, "--to", &to, "--study", "other"];
    run(&unknown).await.refused(2, &["--study other", "no such study", "default"]);
    // Another spelling of the same address is recognised as the same database.
    let same = match from.strip_prefix("sqlite:") {
        Some(file) => format!("sqlite://{file}"),
        None => from.replacen("postgres:", "postgresql:", 1),
    };
    run(&["copy", "--from", &from, "--to", &same]).await.refused(2, &["--to", "another database"]);
}
