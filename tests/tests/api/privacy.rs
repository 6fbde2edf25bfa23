//! Files with participants' data are private from their creation on, and no temporary file is left
//! behind.
#![cfg(target_os = "linux")]

use reqwest::Method;
use rustix::fs::inotify::{CreateFlags, Reader, WatchFlags, add_watch, init};
use sidestep::api::routes;
use sidestep_tests::process::{Process, binary};
use sidestep_tests::server::SHORT_STUDY;
use sidestep_tests::{Driver, Folder, run};
use std::collections::{BTreeMap, HashMap};
use std::fs;
use std::mem::MaybeUninit;
use std::os::fd::OwnedFd;
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use std::process::Stdio;
use std::thread::JoinHandle;
use std::time::{Duration, Instant};
use tokio::process::Command;

/// Inspects each file and folder in a folder and its subfolders as soon as it appears. Stops when a
/// file `end` appears.
struct Watch {
    root: PathBuf,
    looking: JoinHandle<BTreeMap<PathBuf, u32>>,
}

impl Watch {
    fn of(root: &Path) -> Self {
        let notify = init(CreateFlags::CLOEXEC).unwrap();
        let mut seen = Seen { notify, folders: HashMap::new(), modes: BTreeMap::new() };
        seen.watch(root);
        seen.modes.clear();
        Self { root: root.to_owned(), looking: std::thread::spawn(|| seen.look()) }
    }

    /// All paths that were seen, each with the union of its permissions over time.
    fn end(self) -> BTreeMap<PathBuf, u32> {
        fs::write(self.root.join("end"), "").unwrap();
        self.looking.join().unwrap()
    }
}

struct Seen {
    notify: OwnedFd,
    folders: HashMap<i32, PathBuf>,
    modes: BTreeMap<PathBuf, u32>,
}

impl Seen {
    fn watch(&mut self, folder: &Path) {
        let flags = WatchFlags::CREATE | WatchFlags::MOVED_TO | WatchFlags::ATTRIB;
        // The folder might have been deleted already.
        let Ok(watch) = add_watch(&self.notify, folder, flags) else { return };
        self.folders.insert(watch, folder.to_owned());
        // Entries that were created before the watch.
        for entry in fs::read_dir(folder).into_iter().flatten().flatten() {
            self.see(entry.path());
        }
    }

    fn see(&mut self, path: PathBuf) {
        let Ok(about) = path.symlink_metadata() else { return };
        *self.modes.entry(path.clone()).or_default() |= about.permissions().mode() & 0o777;
        if about.is_dir() && !self.folders.values().any(|known| *known == path) {
            self.watch(&path);
        }
    }

    fn look(mut self) -> BTreeMap<PathBuf, u32> {
        let notify = self.notify.try_clone().unwrap();
        let mut room = [MaybeUninit::uninit(); 65_536];
        let mut reader = Reader::new(notify, &mut room);
        loop {
            let event = reader.next().unwrap();
            let name = event.file_name().map(|name| name.to_str().unwrap().to_owned());
            let (Some(name), Some(folder)) = (name, self.folders.get(&event.wd())) else {
                continue;
            };
            if name == "end" {
                return self.modes;
            }
            let path = folder.join(name);
            self.see(path);
        }
    }
}

/// A shell command line under which new files are world-readable by default.
fn careless(temporary: &Path, last: &str) -> String {
    format!("umask 000; export TMPDIR='{}'; exec \"$@\" {last}", temporary.display())
}

async fn carelessly(temporary: &Path, args: &[&str]) {
    let shell = careless(temporary, "");
    let mut command = Command::new("sh");
    command.args(["-c", &shell, "sh"]).arg(binary()).args(args);
    let said = command.output().await.unwrap();
    assert!(said.status.success(), "{args:?}: {}", String::from_utf8_lossy(&said.stderr));
}

fn old_database() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("data/old-database/sidestep.db")
}

#[tokio::test]
async fn files_are_private_from_the_moment_they_are_there() {
    let folder = Folder::default();
    let data = folder.path("data");
    let at = |name: &str| data.join(name).display().to_string();
    let url = |name: &str| format!("sqlite:{}", at(name));
    let temporary = data.join("tmp");
    fs::create_dir_all(&temporary).unwrap();
    fs::copy(old_database(), at("old.db")).unwrap();
    // SQLite creates the other files of a database with the permissions of the database file.
    fs::set_permissions(at("old.db"), fs::Permissions::from_mode(0o600)).unwrap();
    let trials = folder.name("trials.csv");
    let simulate =
        ["simulate", "--participants", "2", "--tasks", "3", "--seed", "1", "--out", &trials];
    run(&simulate).await.json();
    let study = folder.file("study.toml", format!("slug = \"default\"{SHORT_STUDY}"));

    let watch = Watch::of(&data);
    let shell = careless(
        &temporary,
        &format!("--backups '{}' --check-every 0.01 --study '{study}'", at("kept/backups")),
    );
    let launcher = ["sh", "-c", &shell, "sh"];
    let mut server = Process::start_through(&launcher, &folder, &url("study.db")).await;
    Driver::enrol(&server).await.drive(&server, 5).await;
    let key = server.key().await;
    for format in ["csv", "sqlite"] {
        let route = format!("{}?format={format}", routes::exports("default"));
        let archive = server.request(Method::GET, &route).bearer_auth(&key).send().await.unwrap();
        assert!(archive.status() == 200 && !archive.bytes().await.unwrap().is_empty());
    }
    let begun = Instant::now();
    let is_kept = || {
        let found = fs::read_dir(at("kept/backups")).into_iter().flatten().flatten();
        found.into_iter().any(|entry| entry.file_name().to_string_lossy().starts_with("sidestep-"))
    };
    while !is_kept() {
        assert!(begun.elapsed() < Duration::from_secs(600), "a backup");
        tokio::time::sleep(Duration::from_millis(20)).await;
    }
    let from = url("study.db");
    for command in [
        &["import", "--study", "imported", "--trials", &trials, "--database", &from][..],
        &["import", "--study", "imported", "--trials", &trials, "--database", &url("new.db")],
        &["backup", "--database", &from, "--out", &at("backup.db")],
        &["restore", "--from", &at("backup.db"), "--database", &url("restored.db")],
        &["copy", "--from", &from, "--to", &url("copy.db")],
        &["salvage", "--from", &at("copy.db"), "--database", &url("salvaged.db")],
        &["check", "--database", &url("old.db")],
    ] {
        carelessly(&temporary, command).await;
    }
    for format in ["csv", "jsonl", "parquet", "psych-ds", "sqlite"] {
        let out = at(&format!("exports/{format}"));
        let export = [
            "export",
            "--study",
            "default",
            "--database",
            &from,
            "--format",
            format,
            "--out",
            &out,
        ];
        carelessly(&temporary, &export).await;
    }
    // The copy of an older file goes to the system's temporary folder if its own folder is not
    // writable.
    server.kill().await;
    let seen = watch.end();
    let loose: Vec<_> = seen.iter().filter(|(_, mode)| *mode & 0o077 != 0).collect();
    assert!(loose.is_empty(), "{loose:#?}");
    // Check that the watch has seen the expected files.
    let saw = |part: &str| seen.keys().any(|path| path.to_string_lossy().contains(part));
    for part in [
        "study.db-wal",
        "new.db",
        "backup.db",
        ".sidestep-backup-",
        "restored.db",
        "copy.db",
        "salvaged.db",
        "damaged.db",
        ".sidestep-copy-",
        "kept/backups/sidestep-",
        ".sidestep-draft-",
        ".sidestep-part-",
        ".sidestep-export-",
        "exports/sqlite/study.sqlite",
        "exports/psych-ds/data/",
        "manifest.json",
    ] {
        assert!(saw(part), "{part} in {:#?}", seen.keys());
    }
}

/// Names of temporary files in these folders.
fn unfinished(folders: &[&Path]) -> Vec<String> {
    let entries = folders.iter().flat_map(|folder| fs::read_dir(folder).into_iter().flatten());
    let names = entries.map(|entry| entry.unwrap().file_name().into_string().unwrap());
    names.filter(|name| name.starts_with(".sidestep-")).collect()
}

#[tokio::test]
async fn what_a_killed_command_left_is_removed_by_the_next_one() {
    let folder = Folder::default();
    let temporary = folder.path("tmp");
    fs::create_dir_all(&temporary).unwrap();
    fs::create_dir_all(folder.path("out")).unwrap();
    fs::copy(old_database(), folder.path("old.db")).unwrap();
    let (trials, from) = (folder.name("trials.csv"), folder.database("study.db"));
    let simulate = ["simulate", "--participants", "10", "--seed", "1", "--out", &trials];
    run(&simulate).await.json();
    let import = ["import", "--study", "default", "--trials", &trials, "--database", &from];
    run(&import).await.json();
    run(&["backup", "--database", &from, "--out", &folder.name("backup.db")]).await.json();
    let (out, root) = (folder.path("out"), folder.root());
    let into = |name: &str| folder.name(&format!("out/{name}"));
    let url = |name: &str| folder.database(&format!("out/{name}"));
    let commands: [(&[&str], &[&Path]); 5] = [
        (&["backup", "--database", &from, "--out", &into("b.db")], &[&out]),
        (&["restore", "--from", &folder.name("backup.db"), "--database", &url("r.db")], &[&out]),
        (&["salvage", "--from", &folder.name("backup.db"), "--database", &url("s.db")], &[&out]),
        (&["export", "--database", &from, "--out", &into("e")], &[&folder.path("out/e")]),
        (&["check", "--database", &folder.database("old.db")], &[root, &temporary]),
    ];
    for (args, folders) in commands {
        for attempt in 0.. {
            assert!(attempt < 50, "{args:?} was killed in time");
            let mut command = Command::new(binary());
            command.args(args).env("TMPDIR", &temporary).stdout(Stdio::null());
            let mut child = command.kill_on_drop(true).spawn().unwrap();
            while unfinished(folders).is_empty() && child.try_wait().unwrap().is_none() {
                tokio::task::yield_now().await;
            }
            child.kill().await.unwrap();
            if !unfinished(folders).is_empty() {
                break;
            }
            for name in ["b.db", "r.db", "s.db"] {
                let _ = fs::remove_file(folder.path("out").join(name));
            }
            let _ = fs::remove_dir_all(folder.path("out/e"));
        }
        let again =
            Command::new(binary()).args(args).env("TMPDIR", &temporary).output().await.unwrap();
        assert!(again.status.success(), "{args:?}: {}", String::from_utf8_lossy(&again.stderr));
        let left = unfinished(folders);
        assert!(left.is_empty(), "{args:?}: {left:?}");
    }
}
