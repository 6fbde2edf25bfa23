//! Tests everything that an operator can do to a database file, at any time. After each such fault,
//! every command runs.
//!
//! After each fault, `check` reports only complete, existing databases as sound. Every acknowledged
//! trial is in the database file, in a file that the operator has moved elsewhere, or in a file
//! that an error message names.

use sidestep_tests::process::Said;
use sidestep_tests::{Driver, Folder, Process, driven, run};
use std::collections::BTreeSet;
use std::fmt::Write as _;
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// A fault of the file `sidestep.db`. `other.db` is another database, and `backup.db` is a backup
/// of an earlier state of `sidestep.db`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Fault {
    Delete,
    RenameAway,
    RenameOver,
    BackupOver,
    Truncate,
    CopyOver,
    CopyOverAlone,
    CatOver,
    RestoreInto,
    HideByMode,
    StrangeLog,
    StrangeIndex,
    HalfCopy,
    EmptyLog,
    DeleteLog,
    DeleteIndex,
    OverwriteLog,
}

const FAULTS: [Fault; 17] = [
    Fault::Delete,
    Fault::RenameAway,
    Fault::RenameOver,
    Fault::BackupOver,
    Fault::Truncate,
    Fault::CopyOver,
    Fault::CopyOverAlone,
    Fault::CatOver,
    Fault::RestoreInto,
    Fault::HideByMode,
    Fault::StrangeLog,
    Fault::StrangeIndex,
    Fault::HalfCopy,
    Fault::EmptyLog,
    Fault::DeleteLog,
    Fault::DeleteIndex,
    Fault::OverwriteLog,
];

impl Fault {
    fn words(self) -> &'static str {
        match self {
            Self::Delete => "the file is deleted",
            Self::RenameAway => "the file is moved away, to `aside.db`",
            Self::RenameOver => "another database is moved over it",
            Self::BackupOver => "an earlier backup of it is moved over it",
            Self::Truncate => "it is cut off after two pages",
            Self::CopyOver => "an earlier backup is copied over it, in place",
            Self::CopyOverAlone => {
                "an earlier backup is copied over it, and its log and `-shm` are deleted"
            }
            Self::RestoreInto => {
                "an earlier backup is written into it by SQLite, as `.restore` of sqlite3 does"
            }
            Self::CatOver => "another database is written over it, in place",
            Self::HideByMode => "nobody may read it for a while",
            Self::StrangeLog => "another database's log is copied over its log",
            Self::StrangeIndex => "its `-shm` is overwritten",
            Self::HalfCopy => "half a copy of a backup is put in its place",
            Self::EmptyLog => "its log is emptied",
            Self::DeleteLog => "its log is deleted",
            Self::DeleteIndex => "its `-shm` is deleted",
            Self::OverwriteLog => "a page in the middle of its log is overwritten",
        }
    }

    /// Whether only a running server can detect the fault, because the file without its log is a
    /// valid earlier state.
    fn is_of_a_server(self) -> bool {
        matches!(self, Self::EmptyLog | Self::DeleteLog | Self::DeleteIndex)
    }
}

/// Time of the fault.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Moment {
    /// After a server was killed, before anything is started.
    AfterKill,
    /// Between a stop and a start.
    AfterStop,
    /// While a server is idle.
    Idle,
    /// While a server stores trials.
    UnderLoad,
}

const MOMENTS: [Moment; 4] =
    [Moment::AfterKill, Moment::AfterStop, Moment::Idle, Moment::UnderLoad];

impl Moment {
    fn words(self) -> &'static str {
        match self {
            Self::AfterKill => "after a kill",
            Self::AfterStop => "after a stop",
            Self::Idle => "while a server is idle",
            Self::UnderLoad => "while a server stores",
        }
    }
}

struct Place {
    folder: Folder,
    /// Acknowledged trials.
    acknowledged: BTreeSet<String>,
    /// The trials in the backup, and the trials in the other database.
    known: Vec<BTreeSet<String>>,
}

impl Place {
    fn path(&self, name: &str) -> PathBuf {
        self.folder.path(name)
    }

    fn database(&self) -> String {
        self.folder.database("sidestep.db")
    }

    /// Creates a database with four trials, of which the backup has two, and another database.
    async fn new() -> (Self, Process, Driver) {
        let folder = Folder::default();
        let server = Process::start(&folder).await;
        let driver = Driver::enrol(&server).await;
        driver.drive(&server, 1).await;
        std::fs::copy(folder.path("sidestep.db-wal"), folder.path("other.log")).unwrap();
        server.stop().await;
        std::fs::rename(folder.path("sidestep.db"), folder.path("other.db")).unwrap();
        let server = Process::start(&folder).await;
        let driver = Driver::enrol(&server).await;
        let mut acknowledged: BTreeSet<String> =
            driver.drive(&server, 2).await.into_iter().map(|(id, _)| id).collect();
        run(&[
            "backup",
            "--database",
            &folder.database("sidestep.db"),
            "--out",
            &folder.name("backup.db"),
        ])
        .await
        .json();
        let older = acknowledged.clone();
        for (id, scene) in &driver.scenes()[2..4] {
            assert_eq!(driver.send(&server, id, &driven(scene)).await.status, 201);
            acknowledged.insert(id.clone());
        }
        let other = trials(&folder.path("other.db")).await.unwrap();
        (Self { folder, acknowledged, known: vec![older, other] }, server, driver)
    }

    /// Causes the fault.
    fn suffer(&self, fault: Fault) {
        let [file, other, backup] =
            ["sidestep.db", "other.db", "backup.db"].map(|name| self.path(name));
        match fault {
            Fault::Delete => std::fs::remove_file(&file).unwrap(),
            Fault::RenameAway => std::fs::rename(&file, self.path("aside.db")).unwrap(),
            Fault::RenameOver => std::fs::rename(&other, &file).unwrap(),
            Fault::BackupOver => std::fs::rename(&backup, &file).unwrap(),
            Fault::Truncate => {
                std::fs::OpenOptions::new()
                    .write(true)
                    .open(&file)
                    .unwrap()
                    .set_len(8_192)
                    .unwrap();
            }
            Fault::CopyOver | Fault::CopyOverAlone | Fault::CatOver => {
                let from = if fault == Fault::CatOver { &other } else { &backup };
                let bytes = std::fs::read(from).unwrap();
                // Overwrite the content of the existing file, as cp and cat do.
                let mut to =
                    std::fs::OpenOptions::new().write(true).truncate(true).open(&file).unwrap();
                std::io::Write::write_all(&mut to, &bytes).unwrap();
                if fault == Fault::CopyOverAlone {
                    for end in ["-wal", "-shm"] {
                        // After a clean stop, there is no such file.
                        let _ = std::fs::remove_file(self.path(&format!("sidestep.db{end}")));
                    }
                }
            }
            Fault::RestoreInto => {
                let restore = "import sqlite3, sys; [to, by] = map(sqlite3.connect, sys.argv[1:]); by.backup(to)";
                let python = std::process::Command::new("python3")
                    .args(["-c", restore])
                    .args([&file, &backup])
                    .status();
                assert!(python.unwrap().success());
            }
            Fault::HideByMode => {
                std::fs::set_permissions(&file, std::fs::Permissions::from_mode(0o000)).unwrap();
            }
            Fault::StrangeLog => {
                let _ =
                    std::fs::copy(self.path("other.log"), self.path("sidestep.db-wal")).unwrap();
            }
            Fault::StrangeIndex => {
                std::fs::write(self.path("sidestep.db-shm"), [7; 32_768]).unwrap()
            }
            Fault::EmptyLog => std::fs::write(self.path("sidestep.db-wal"), []).unwrap(),
            Fault::DeleteLog => std::fs::remove_file(self.path("sidestep.db-wal")).unwrap(),
            Fault::DeleteIndex => std::fs::remove_file(self.path("sidestep.db-shm")).unwrap(),
            Fault::OverwriteLog => {
                let log =
                    std::fs::OpenOptions::new().write(true).open(self.path("sidestep.db-wal"));
                let log = log.unwrap();
                let middle = log.metadata().unwrap().len() / 2;
                std::os::unix::fs::FileExt::write_all_at(&log, &[7; 4096], middle).unwrap();
            }
            Fault::HalfCopy => {
                let bytes = std::fs::read(&backup).unwrap();
                std::fs::remove_file(&file).unwrap();
                std::fs::write(&file, &bytes[..bytes.len() / 2]).unwrap();
            }
        }
    }

    /// The databases in the folder that contain all acknowledged trials.
    async fn keepers(&self) -> Vec<String> {
        let mut found = Vec::new();
        for name in self.folder.names() {
            let path = self.path(&name);
            if name.ends_with(".db")
                && trials(&path).await.is_some_and(|has| has.is_superset(&self.acknowledged))
            {
                found.push(name);
            }
        }
        found
    }
}

/// The trials in a copy of a file with its log. `None` if the copy cannot be read.
async fn trials(file: &Path) -> Option<BTreeSet<String>> {
    let copy = Folder::default();
    std::fs::copy(file, copy.path("copy.db")).ok()?;
    let log = PathBuf::from(format!("{}-wal", file.display()));
    if log.exists() {
        std::fs::copy(log, copy.path("copy.db-wal")).ok()?;
    }
    let database = sidestep_tests::Database::file(copy.root(), "copy.db");
    let reading = tokio::spawn(async move {
        let mut found = BTreeSet::new();
        database
            .each_row("SELECT trial_id FROM trial", |row| found.extend([row[0].to_owned()]))
            .await;
        found
    });
    reading.await.ok()
}

/// Runs a case and describes its outcome.
async fn case(fault: Fault, moment: Moment) -> String {
    let (mut place, server, driver) = Place::new().await;
    let mut said = String::new();
    match moment {
        Moment::AfterKill => {
            server.kill().await;
            place.suffer(fault);
        }
        Moment::AfterStop => {
            server.stop().await;
            place.suffer(fault);
        }
        Moment::Idle | Moment::UnderLoad => {
            let waiting: Vec<_> = driver.scenes().into_iter().skip(4).collect();
            place.suffer(fault);
            if moment == Moment::UnderLoad {
                for (id, scene) in waiting.iter().take(2) {
                    let answer = driver.send(&server, id, &driven(scene)).await;
                    match answer.status {
                        201 => drop(place.acknowledged.insert(id.clone())),
                        status => assert_eq!(status, 503, "{fault:?} {moment:?}: {}", answer.body),
                    }
                }
            }
            let harmless = matches!(fault, Fault::HideByMode | Fault::StrangeIndex);
            let due = Instant::now() + Duration::from_secs(1);
            loop {
                let ready = server.get("/readyz").await;
                let body = ready.body.to_string();
                if body.contains("rescued")
                    || body.contains("-ahead log, which")
                    || harmless
                    || Instant::now() > due
                {
                    assert!(ready.status == 503 || harmless, "{fault:?} {moment:?}: still ready");
                    said += &body;
                    break;
                }
                tokio::time::sleep(Duration::from_millis(50)).await;
            }
            server.stop().await;
        }
    }
    if fault == Fault::HideByMode {
        // Root can read the file in spite of its mode, so the mode is restored before the commands
        // run.
        std::fs::set_permissions(place.path("sidestep.db"), std::fs::Permissions::from_mode(0o600))
            .unwrap();
    }
    let log = std::fs::read(place.path("sidestep.db-wal")).ok().filter(|log| !log.is_empty());
    // Run every command on the file in its current state. If a command calls the file sound, the
    // file must be sound.
    let database = place.database();
    let out = |name: &str| place.folder.name(name);
    let mut states = Vec::new();
    for args in [
        vec!["check", "--database", &database],
        vec![
            "export",
            "--database",
            &database,
            "--study",
            "default",
            "--format",
            "csv",
            "--out",
            &out("export"),
        ],
        vec!["backup", "--database", &database, "--out", &out("after.db")],
        vec!["copy", "--from", &database, "--to", &format!("sqlite:{}", out("copied.db"))],
        vec!["restore", "--from", &out("backup.db"), "--database", &database],
    ] {
        let done: Said = run(&args).await;
        states.push(format!("{} {}", args[0], done.code.unwrap_or(-1)));
        said += &done.err;
        if done.code == Some(0) && args[0] != "restore" {
            let has = trials(&place.path("sidestep.db")).await.unwrap();
            let is_one = has == place.acknowledged
                || place.known.contains(&has)
                || (fault.is_of_a_server() && has.is_subset(&place.acknowledged));
            assert!(
                is_one,
                "{fault:?} {moment:?}: {} calls sound what is none of them: {has:?}",
                args[0]
            );
        }
    }
    match Process::try_start_on(
        &place.folder,
        &sidestep_tests::Database::file(place.folder.root(), "sidestep.db"),
    )
    .await
    {
        Ok(server) => {
            states.push("serve runs".to_owned());
            server.stop().await;
        }
        Err(error) => {
            states.push("serve refuses".to_owned());
            said += &error;
        }
    }
    // The test does not combine a file and a log that the commands refuse to combine.
    let is_sound = states.iter().any(|state| state == "check 0");
    let mut keepers = place.keepers().await;
    keepers.retain(|name| name != "sidestep.db" || is_sound);
    let states = states.join(", ");
    let named =
        |name: &String| name == "sidestep.db" || name == "aside.db" || said.contains(name.as_str());
    if let Some(name) = keepers.iter().find(|name| named(name)) {
        let digits = |part: &str| part.parse::<u64>().is_ok();
        let words: Vec<_> =
            name.split('.').map(|part| if digits(part) { "TIME" } else { part }).collect();
        return format!("{states} | all in `{}`", words.join("."));
    }
    assert!(
        keepers.is_empty(),
        "{fault:?} {moment:?}: nobody says that {keepers:?} has them: {said}"
    );
    if fault == Fault::RenameAway {
        // The log stayed behind, and the message says what to do.
        assert!(said.contains("put its database back beside it"), "{said}");
        std::fs::rename(place.path("aside.db"), place.path("sidestep.db")).unwrap();
        assert!(!place.keepers().await.is_empty(), "{fault:?} {moment:?}: {said}");
        return format!("{states} | all in `aside.db` with `sidestep.db-wal`");
    }
    if fault == Fault::StrangeLog && moment == Moment::AfterStop {
        assert!(said.contains("move the log to another folder"), "{said}");
        std::fs::rename(place.path("sidestep.db-wal"), place.path("strange.log")).unwrap();
        assert!(!place.keepers().await.is_empty(), "{fault:?} {moment:?}: {said}");
        return format!("{states} | all in `sidestep.db`");
    }
    // The operator has destroyed content. The rest stays unchanged, and a message says where it is
    // or how to save it.
    let destroyed = match fault {
        Fault::Truncate
        | Fault::CopyOver
        | Fault::CopyOverAlone
        | Fault::CatOver
        | Fault::RestoreInto => true,
        Fault::Delete | Fault::RenameOver | Fault::BackupOver | Fault::HalfCopy => {
            matches!(moment, Moment::AfterKill | Moment::AfterStop)
        }
        // These faults destroyed the content of the log.
        Fault::StrangeLog | Fault::EmptyLog | Fault::OverwriteLog => true,
        _ => false,
    };
    assert!(destroyed, "{fault:?} {moment:?}: acknowledged trials are nowhere: {said}");
    if let Some(log) = &log {
        let after = std::fs::read(place.path("sidestep.db-wal")).ok();
        assert!(after.as_ref() == Some(log), "{fault:?} {moment:?}: a command changed the log");
    }
    if said.contains("rescued-wal") && fault != Fault::RestoreInto {
        return format!("{states} | destroyed; the log is kept in `sidestep.db.TIME.rescued-wal`");
    }
    let is_salvaged = matches!(fault, Fault::EmptyLog | Fault::OverwriteLog | Fault::RestoreInto);
    if !is_salvaged && said.contains("sidestep.db-wal") {
        return format!("{states} | destroyed; `sidestep.db-wal` is left as it was");
    }
    if said.contains("sidestep salvage") {
        let salvaged = format!("sqlite:{}", out("salvaged.db"));
        run(&["salvage", "--from", &out("sidestep.db"), "--database", &salvaged]).await;
        let saved = trials(&place.path("salvaged.db")).await.unwrap_or_default();
        let known: BTreeSet<_> = place.known.iter().flatten().chain(&place.acknowledged).collect();
        assert!(saved.iter().all(|id| known.contains(id)), "{fault:?} {moment:?}: {saved:?}");
        let of = place.acknowledged.len();
        let here = saved.intersection(&place.acknowledged).count();
        // The log still has everything that was stored before the other database was written over
        // this one.
        assert!(here == of || fault != Fault::RestoreInto, "{moment:?}: {here} of {of}");
        return format!("{states} | salvage saves {here} of {of}");
    }
    assert!(log.is_none(), "{fault:?} {moment:?}: nobody names the log: {said}");
    format!("{states} | destroyed with the file")
}

#[tokio::test]
async fn whatever_is_done_to_the_file_nothing_is_merged_or_lost_in_silence() {
    let mut table = String::from(
        "| what is done | when | exit codes | where the acknowledged trials are |\n|---|---|---|---|\n",
    );
    for fault in FAULTS {
        for moment in MOMENTS {
            let has_server = matches!(moment, Moment::Idle | Moment::UnderLoad);
            let has_log = has_server || moment == Moment::AfterKill;
            if fault.is_of_a_server() && !has_server || fault == Fault::OverwriteLog && !has_log {
                continue;
            }
            let found = case(fault, moment).await;
            writeln!(table, "| {} | {} | {found} |", fault.words(), moment.words()).unwrap();
        }
    }
    eprintln!("{table}");
}

/// SQLite has cached pages, so it does not notice the damage until it reads them again.
#[tokio::test]
async fn a_page_that_is_overwritten_in_place_is_noticed() {
    let folder = Folder::default();
    let server = Process::start(&folder).await;
    Driver::enrol(&server).await.drive(&server, 3).await;
    server.stop().await;
    let server = Process::start(&folder).await;
    let driver = Driver::enrol(&server).await;
    let (first, second) = (&driver.scenes()[0], &driver.scenes()[1]);
    assert_eq!(driver.send(&server, &first.0, &driven(&first.1)).await.status, 201);
    let path = folder.path("sidestep.db");
    let file = std::fs::OpenOptions::new().write(true).open(&path).unwrap();
    // A new modification time is not damage.
    file.set_modified(std::time::SystemTime::now()).unwrap();
    tokio::time::sleep(Duration::from_secs(1)).await;
    assert_eq!(server.get("/readyz").await.status, 200);
    // Overwrite a page that contains the browser's display data.
    let content = std::fs::read(&path).unwrap();
    let is_of_trial = |page: &[u8]| page.windows(10).any(|part| part == b"refresh_hz");
    let page = content.chunks(4096).position(is_of_trial).unwrap() as u64;
    std::os::unix::fs::FileExt::write_all_at(&file, &[7; 4096], page * 4096).unwrap();
    let due = Instant::now() + Duration::from_secs(30);
    while server.get("/readyz").await.status == 200 {
        assert!(Instant::now() < due, "nobody notices");
        tokio::time::sleep(Duration::from_millis(50)).await;
    }
    let ready = server.get("/readyz").await.body.to_string();
    assert!(ready.contains("damaged"), "{ready}");
    assert_eq!(driver.send(&server, &second.0, &driven(&second.1)).await.status, 503);
    // If the file is also deleted, the server's open file is the only copy.
    let database = folder.database("sidestep.db");
    let aside = folder.path("aside.db");
    std::fs::rename(&path, &aside).unwrap();
    let rescued = loop {
        let names = folder.names();
        let is_rescued = |name: &&String| name.ends_with(".rescued.db");
        if let Some(name) = names.iter().find(is_rescued) {
            break name.clone();
        }
        assert!(Instant::now() < due, "nothing is rescued: {names:?}");
        tokio::time::sleep(Duration::from_millis(50)).await;
    };
    let ready = server.get("/readyz").await.body.to_string();
    assert!(ready.contains(&rescued), "{ready}");
    server.stop().await;
    let log = format!("{rescued}-wal");
    for (rescued, original) in [(&*rescued, "aside.db"), (&*log, "sidestep.db-wal")] {
        let [one, other] =
            [rescued, original].map(|name| std::fs::read(folder.path(name)).unwrap());
        assert!(one == other && !one.is_empty(), "{rescued}");
    }
    std::fs::rename(&aside, &path).unwrap();
    // No server starts on the file with its log. A server starts on the file alone, but finds the
    // damage while it runs.
    let damaged = sidestep_tests::Database::file(folder.root(), "sidestep.db");
    let refused = Process::try_start_on(&folder, &damaged).await.err().unwrap();
    assert!(refused.contains("not whole together") && refused.contains("salvage"), "{refused}");
    let log = folder.path("sidestep.db-wal");
    std::fs::rename(&log, folder.path("kept.log")).unwrap();
    let server = Process::start_on(&folder, &damaged).await;
    while server.get("/readyz").await.status == 200 {
        assert!(Instant::now() < due, "nobody notices");
        tokio::time::sleep(Duration::from_millis(50)).await;
    }
    server.stop().await;
    std::fs::rename(folder.path("kept.log"), &log).unwrap();
    let _ = std::fs::remove_file(folder.path("sidestep.db-shm"));
    let check = run(&["check", "--database", &database]).await;
    assert!(check.code == Some(1) && check.err.contains("sidestep salvage"), "{}", check.err);
    let salvage = ["salvage", "--from", &folder.name("sidestep.db"), "--database"];
    let said = run(&[&salvage[..], &[&folder.database("saved.db")]].concat()).await;
    let saved: serde_json::Value = serde_json::from_str(&said.out).unwrap();
    assert!(saved["trials"].as_u64().unwrap() >= 2, "{saved}: {}", said.err);
}

/// The mark tells which database a log belongs to. Sidestep reads the mark only from its own page,
/// so text that looks like a mark has no effect.
#[tokio::test]
async fn what_people_enter_is_no_mark() {
    let folder = Folder::default();
    let server = Process::start(&folder).await;
    Driver::enrol(&server).await.drive(&server, 3).await;
    server.stop().await;
    let server = Process::start(&folder).await;
    let (a, digits) = ("a".repeat(32), "0".repeat(16));
    let forged = format!("sidestep mark {a} {:020} {digits} {digits}", 9);
    let body = serde_json::json!({ "consent": true, "external_id": forged });
    assert_eq!(Driver::ask(&server, body).await.status, 201);
    tokio::time::sleep(Duration::from_millis(600)).await;
    assert_eq!(server.get("/readyz").await.status, 200);
    Driver::enrol(&server).await.drive(&server, 3).await;
    server.kill().await;
    let database = folder.database("sidestep.db");
    assert_eq!(run(&["check", "--database", &database]).await.json()["trials"], 6);
    Process::start(&folder).await.stop().await;
}

#[tokio::test]
async fn a_file_of_an_earlier_version_is_sound_from_the_first_moment() {
    let old = Path::new(env!("CARGO_MANIFEST_DIR")).join("data/old-database/sidestep.db");
    let folder = Folder::default();
    std::fs::copy(old, folder.path("sidestep.db")).unwrap();
    let server = Process::start(&folder).await;
    let database = folder.database("sidestep.db");
    let check = ["check", "--database", &database];
    let trials = run(&check).await.json()["trials"].clone();
    server.kill().await;
    assert_eq!(run(&check).await.json()["trials"], trials);
    Process::start(&folder).await.stop().await;
}
