//! The examples that load an export, run with the real packages.

use sidestep_tests::server::SHORT_STUDY;
use sidestep_tests::{Driver, Folder, Server, run};
use std::path::Path;
use tokio::process::Command;

/// Runs the example on a folder. Returns stdout if it succeeds, and stderr otherwise.
async fn load(folder: &str, package: &str) -> Result<String, String> {
    let python = std::env::var_os("SIDESTEP_READERS");
    let python = python.expect("SIDESTEP_READERS: run the tests with `cargo xtask test`");
    let example = Path::new(env!("CARGO_MANIFEST_DIR")).join("../examples/load_export.py");
    // The option makes Python's warnings errors.
    let mut command = Command::new(python);
    command.arg("-Werror").arg(example).args([folder, package]);
    let said = command.output().await.unwrap();
    let text = |bytes| String::from_utf8(bytes).unwrap().replace("\r\n", "\n");
    if said.status.success() { Ok(text(said.stdout)) } else { Err(text(said.stderr)) }
}

#[tokio::test]
async fn pandas_polars_and_pyarrow_read_what_was_driven() {
    let server = Server::with_study(SHORT_STUDY).await;
    for count in [5, 3] {
        Driver::enrol(&server).await.drive(&server, count).await;
    }
    let (folder, database) = (Folder::default(), server.database());
    let mut summaries = Vec::new();
    for format in ["csv", "parquet", "psych-ds"] {
        let out = folder.name(format);
        let args = ["export", "--database", &database, "--format", format, "--out", &out];
        run(&args).await.json();
        for package in ["pandas", "polars", "pyarrow"] {
            let said = load(&out, package).await;
            summaries.push(said.unwrap_or_else(|why| panic!("{package}, {format}: {why}")));
        }
    }
    // Each participant's five trials are one familiarisation, one practice trial and three tasks.
    assert!(summaries[0].starts_with("2 participants, 4 tasks, 400 steps\n"), "{}", summaries[0]);
    assert!(summaries.iter().all(|said| said == &summaries[0]), "{summaries:#?}");

    // The example rejects an incomplete export.
    let out = folder.name("csv");
    let steps = folder.text("csv/steps.csv");
    std::fs::write(folder.path("csv/steps.csv"), &steps[..steps.len() / 2]).unwrap();
    assert!(load(&out, "pandas").await.unwrap_err().contains("steps.csv: expected SHA-256"));
    std::fs::remove_file(folder.path("csv/manifest.json")).unwrap();
    assert!(load(&out, "pandas").await.unwrap_err().contains("is not complete"));
}
