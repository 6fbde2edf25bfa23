//! The command as a process: exit codes, and output that nobody reads.

use sidestep_tests::{Folder, Process, run};

#[tokio::test]
async fn a_start_that_fails_says_what_to_do() {
    let folder = Folder::default();
    let running = Process::start(&folder).await;
    assert_eq!(running.announcement[0], "Sidestep is ready.");
    let site = folder.name("site");
    let spare = folder.database("spare.db");
    let study = folder.file("study.toml", "slug = \"a\"\n[parameters.human]\nspeed_mps = -2");
    let impossible =
        folder.file("impossible.toml", "slug = \"a\"\n[parameters]\ndanger_radius_m = 30.0");
    let port = running.origin.trim_start_matches("http://");
    let nowhere = "sqlite:/proc/nowhere/sidestep.db";
    let built = "no client bundle in /tmp: run 'cargo xtask build' or pass --static DIR";
    let any = "127.0.0.1:0";
    for (listen, database, site, study, code, words) in [
        (port, &spare[..], &site[..], None, 1, &["--listen", "in use", "another"][..]),
        ("8081", &spare, &site, None, 2, &["--listen", "such as 127.0.0.1:8080", "found 8081"]),
        (any, nowhere, &site, None, 1, &["/proc/nowhere/sidestep.db", "writable"]),
        (any, "postgres://u:secret@h", &site, None, 2, &["postgres:…", "found no database"]),
        (any, "postgres://u:secret@127.0.0.1:9/d", &site, None, 1, &["postgres://u@127.0.0.1:9/d"]),
        (any, "sqlite::memory:", &site, None, 2, &["sqlite:FILE"]),
        (any, &spare, "/tmp", None, 2, &["--static /tmp", built]),
        (
            any,
            &spare,
            &site,
            Some(&study[..]),
            2,
            &[&study, "study.toml:3: parameters.human.speed_mps", "expected", "found -2"],
        ),
        (any, &spare, &site, Some(&impossible[..]), 2, &[&impossible, "danger radius", "duration"]),
        (any, &spare, &site, Some("missing.toml"), 2, &["missing.toml"]),
    ] {
        let mut args = vec!["serve", "--listen", listen, "--database", database, "--static", site];
        args.extend(study.into_iter().flat_map(|study| ["--study", study]));
        run(&args).await.refused(code, words);
    }
}

#[tokio::test]
async fn commands_without_a_database_make_none() {
    let folder = Folder::default();
    let (none, out) = (folder.database("none.db"), folder.name("out"));
    let said = run(&["check", "--database", &none]).await;
    said.refused(1, &["none.db", "it does not exist"]);
    run(&["export", "--database", &none, "--out", &out]).await.refused(1, &["none.db"]);
    let elsewhere = Folder::default();
    let bad = elsewhere.file("bad.csv", "participant;trial");
    run(&["import", "--database", &none, "--trials", &bad]).await.refused(2, &[&bad, "header"]);
    assert!(folder.names().is_empty());
    for (name, content, words) in
        [("empty.db", "", "it is empty"), ("text.db", "a,b\n", "not a database")]
    {
        let file = folder.file(name, content);
        let said = run(&["check", "--database", &folder.database(name)]).await;
        said.refused(1, &[name, words]);
        assert!(!said.err.contains("writable"), "{}", said.err);
        assert_eq!(folder.text(name), content);
        std::fs::remove_file(file).unwrap();
    }
    let file = ["check", "--database", "study.db"];
    run(&file).await.refused(2, &["sqlite:FILE", "write sqlite:study.db"]);
    let format = ["export", "--database", &none, "--format", "xlsx", "--out", &out];
    run(&format).await.refused(2, &["--format", "csv", "xlsx"]);
    let missing = ["import", "--database", &none, "--trials", "missing.csv"];
    run(&missing).await.refused(2, &["missing.csv"]);
    let server = Process::start(&folder).await;
    let database = folder.database("sidestep.db");
    let unknown = ["export", "--database", &database, "--study", "other", "--out", &out];
    run(&unknown).await.refused(2, &["--study other", "which has default"]);
    let said = run(&["export", "--database", &database, "--out", &out]).await;
    said.json();
    assert!(said.err.contains("study default has no trials yet"), "{}", said.err);
    drop(server);
}

#[tokio::test]
async fn a_short_key_in_the_environment_is_refused() {
    let output = std::process::Command::new(sidestep_tests::process::binary())
        .args(["serve", "--listen", "127.0.0.1:0", "--static", "/nowhere"])
        .env("SIDESTEP_ADMIN_KEY", "short")
        .output()
        .unwrap();
    let words = "SIDESTEP_ADMIN_KEY: expected 16 characters or more, found 5";
    sidestep_tests::process::Said::from(output).refused(2, &[words]);
}

/// Creates a file of synthetic trials, and a database that contains them, in `folder`. Returns the
/// path of the file and the address of the database.
async fn imported(folder: &Folder) -> (String, String) {
    let (trials, db) = (folder.name("trials.csv"), folder.database("study.db"));
    let simulate =
        ["simulate", "--participants", "1", "--tasks", "2", "--seed", "1", "--out", &trials];
    run(&simulate).await.json();
    run(&["import", "--study", "default", "--trials", &trials, "--database", &db]).await.json();
    (trials, db)
}

/// The exit code is 2 for bad input, and 1 for a failure with valid input.
#[tokio::test]
async fn exit_codes_tell_bad_input_from_failures() {
    let folder = Folder::default();
    let (trials, db) = imported(&folder).await;
    let garbage = folder.file("garbage.db", [7; 5000]);
    let (file, at) = (folder.file("file", "{"), |name: &str| folder.name(name));
    let (new, below) = (folder.database("new.db"), at("file/below"));
    for (code, args, words) in [
        (
            2,
            &["restore", "--from", &garbage, "--database", &new][..],
            &["--from", "not a database"][..],
        ),
        (
            2,
            &["restore", "--from", &at("none.db"), "--database", &new],
            &["--from", "No such file"],
        ),
        (
            2,
            &["restore", "--from", &at("study.db"), "--database", &db],
            &["--database", "it has data"],
        ),
        (
            1,
            &["restore", "--from", &at("study.db"), "--database", &format!("sqlite:{below}")],
            &["file"],
        ),
        (2, &["salvage", "--from", &garbage, "--database", &new], &["--from", "not a database"]),
        (1, &["check", "--database", &folder.database("garbage.db")], &["not a database"]),
        (1, &["backup", "--database", &db, "--out", &at("none/b.db")], &["there is no folder"]),
        (2, &["backup", "--database", &db, "--out", &garbage], &["--out", "does not exist"]),
        (2, &["copy", "--from", "study.db", "--to", &new], &["--from study.db", "sqlite:study.db"]),
        (2, &["copy", "--from", &db, "--to", "mysql:x"], &["--to mysql:…"]),
        (1, &["copy", "--from", &db, "--to", &format!("sqlite:{below}")], &["file/below"]),
        (1, &["export", "--database", &db, "--out", &file], &["cannot write"]),
        (
            2,
            &["export", "--database", &db, "--out", &at("out"), "--configuration", "x"],
            &["--configuration"],
        ),
        (2, &["analyze", "--trials", &at("none.csv"), "--out", &at("out")], &["none.csv"]),
        (
            1,
            &["features", "--trials", &trials, "--out", &at("none/f.csv")],
            &["there is no folder"],
        ),
        (2, &["features", "--trials", &file, "--out", &at("f.csv")], &["header"]),
        (2, &["bounds", "--input", &file], &["not JSON"]),
        (2, &["reach", "--input", folder.root().to_str().unwrap()], &["cannot read"]),
        (2, &["design", "--study", &at("none.toml"), "--out", &at("out")], &["none.toml"]),
        (2, &["value", "--states", &at("none.csv"), "--out", &at("v.csv")], &["none.csv"]),
        (2, &["solve", "--radius", "-1", "--out", &at("x.npz")], &["--radius"]),
        (1, &["solve", "--out", &at("none/x.npz")], &["there is no folder"]),
        (2, &["plot", "--kind", "slices", "--out", &at("x.gif")], &["--out"]),
        (
            1,
            &["simulate", "--participants", "1", "--seed", "1", "--url", "http://127.0.0.1:1"],
            &["no answer"],
        ),
    ] {
        run(args).await.refused(code, words);
    }
    assert_eq!(folder.names(), ["file", "garbage.db", "study.db", "trials.csv"]);
}

/// If nobody reads stdout, for example after `| head`, a command ends silently. Failures are still
/// reported.
#[tokio::test]
async fn nobody_need_read_what_a_command_says() {
    let folder = Folder::default();
    let (_, db) = imported(&folder).await;
    let damaged = folder.database("damaged.db");
    std::fs::copy(folder.name("study.db"), folder.name("damaged.db")).unwrap();
    let change = "UPDATE trial SET closest_m = closest_m + 1";
    sidestep_tests::behind(&damaged).execute(change).await.unwrap();
    let (out, none) = (folder.name("out"), folder.database("none.db"));
    for (code, args) in [
        (0, &["--help"][..]),
        (0, &["export", "--help"]),
        (0, &["check", "--database", &db]),
        (0, &["export", "--database", &db, "--out", &out]),
        (0, &["simulate", "--participants", "1", "--seed", "1", "--out", "-"]),
        (0, &["solve", "--out", &folder.name("x.npz")]),
        (1, &["check", "--database", &damaged]),
        (1, &["export", "--database", &damaged, "--out", &out]),
        (0, &["export", "--database", &damaged, "--out", &out, "--allow-damaged"]),
        (1, &["check", "--database", &none]),
        (2, &["bounds", "--input", &folder.name("none.json")]),
        (2, &["no-such-command"]),
    ] {
        for reads_errors in [true, false] {
            let (reader, unread) = std::io::pipe().unwrap();
            drop(reader);
            let mut command = std::process::Command::new(sidestep_tests::process::binary());
            command.args(args).stdout(unread.try_clone().unwrap());
            command.stderr(match reads_errors {
                true => std::process::Stdio::piped(),
                false => unread.into(),
            });
            let ended = command.output().unwrap();
            let said = String::from_utf8_lossy(&ended.stderr);
            assert_eq!(ended.status.code(), Some(code), "{args:?}: {said}");
            assert!(
                !said.contains("panicked") && !said.contains("Broken pipe"),
                "{args:?}: {said}"
            );
            assert!(
                code > 0 || args.contains(&"--allow-damaged") || said.is_empty(),
                "{args:?}: {said}"
            );
        }
    }
}

#[tokio::test]
async fn a_file_that_must_not_be_read_is_told_so() {
    let folder = Folder::default();
    let file = folder.file("study.db", "");
    let forbidden = std::os::unix::fs::PermissionsExt::from_mode(0o000);
    std::fs::set_permissions(&file, forbidden).unwrap();
    if std::fs::File::open(&file).is_ok() {
        // Root can read everything.
        return;
    }
    let said = run(&["check", "--database", &format!("sqlite:{file}")]).await;
    said.refused(1, &["Permission denied", "permission to read it"]);
}

#[tokio::test]
async fn a_complaint_does_not_repeat_a_whole_file() {
    let folder = Folder::default();
    let long = "x".repeat(300_000);
    for text in [format!("title = \"{long}\""), format!("slug = \"{long}\""), format!("{long} = 1")]
    {
        let study = folder.file("study.toml", text);
        let said = run(&["design", "--study", &study, "--out", &folder.name("out")]).await;
        assert!(said.code == Some(2) && said.err.len() < 2000, "{}", said.err.len());
    }
}
