//! The command as a process: exit codes, and death without notice.

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
        (any, "postgres://u:secret@h", &site, None, 1, &["postgres:…", "found no database"]),
        (any, "postgres://u:secret@127.0.0.1:9/d", &site, None, 1, &["postgres://u@127.0.0.1:9/d"]),
        (any, "sqlite::memory:", &site, None, 2, &["sqlite:FILE"]),
        (any, &spare, "/tmp", None, 1, &[built]),
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
