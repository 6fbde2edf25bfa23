//! Files as spreadsheets and editors write them.

use serde_json::Value;
use sidestep_tests::process::binary;
use sidestep_tests::{Folder, run};
use std::process::{Command, Stdio};

/// The trials of two synthetic participants, as a CSV table.
async fn trials(folder: &Folder) -> String {
    let out = folder.name("trials.csv");
    let args = ["simulate", "--participants", "2", "--tasks", "4", "--seed", "5", "--out", &out];
    run(&args).await.json();
    folder.text("trials.csv")
}

/// Rewrites a table with other separators of columns and decimals.
fn rewritten(text: &str, separator: &str, decimal: &str) -> String {
    text.replace(',', separator).replace('.', decimal)
}

fn utf_16(text: &str) -> Vec<u8> {
    "\u{feff}".encode_utf16().chain(text.encode_utf16()).flat_map(u16::to_le_bytes).collect()
}

/// The features of a file of trials, and the messages of the command.
async fn features(folder: &Folder, file: &str) -> (Vec<u8>, String) {
    let out = folder.path("features.csv");
    let said = run(&["features", "--trials", file, "--out", out.to_str().unwrap()]).await;
    said.json();
    (std::fs::read(out).unwrap(), said.err)
}

#[tokio::test]
async fn trials_are_read_however_a_spreadsheet_writes_them() {
    let folder = Folder::default();
    let text = trials(&folder).await;
    let (expected, said) = features(&folder, &folder.name("trials.csv")).await;
    assert_eq!(said, "");
    let crlf = |text: String| text.replace("\r\n", "\n").replace('\n', "\r\n");
    for (bytes, words) in [
        (rewritten(&text, ";", ",").into_bytes(), "columns between semicolons, decimal commas"),
        (rewritten(&text, ";", ".").into_bytes(), "columns between semicolons\n"),
        (crlf(rewritten(&text, "\t", ",")).into_bytes(), "columns between tabs, decimal commas"),
        (utf_16(&rewritten(&text, "\t", ",")), "UTF-16, columns between tabs, decimal commas"),
        (utf_16(&text), "read as a table with UTF-16\n"),
        (
            format!("sep=;\r\n{}", rewritten(&text, ";", ",")).into_bytes(),
            "columns between semicolons, decimal commas",
        ),
    ] {
        let file = folder.file("other.csv", bytes);
        let (found, said) = features(&folder, &file).await;
        assert_eq!(found, expected, "{words}");
        assert!(said.contains("other.csv: read as") && said.contains(words), "{words}: {said}");
        // An import also reads the same trials.
        let database = folder.database("study.db");
        let said = run(&["import", "--database", &database, "--trials", &file]).await;
        assert_eq!(said.json()["trials"], 8, "{words}");
        assert_eq!(said.err.matches("read as").count(), 1, "{}", said.err);
        std::fs::remove_file(folder.path("study.db")).unwrap();
    }
    let mixed = rewritten(&text, ";", ",").replacen(",0;", ".0;", 1);
    // The first number of the first row has a decimal point, and the next one a comma.
    let file = folder.file("mixed.csv", mixed.as_str());
    let said = run(&["import", "--database", &folder.database("x.db"), "--trials", &file]).await;
    said.refused(
        2,
        &["mixed.csv: line 2: hx: expected a decimal point, as the numbers before have"],
    );
    let bare = &utf_16(&text)[2..];
    let file = folder.file("bare.csv", bare);
    let said = run(&["import", "--database", &folder.database("x.db"), "--trials", &file]).await;
    said.refused(2, &["bare.csv: line 1: row", "UTF-16 without a mark", "save the file as UTF-8"]);
}

#[tokio::test]
async fn tables_come_through_a_pipe() {
    let folder = Folder::default();
    let text = trials(&folder).await;
    let (expected, _) = features(&folder, &folder.name("trials.csv")).await;
    let piped = |args: &[&str], text: &str| {
        let mut command = Command::new(binary());
        command.args(args).stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
        let mut child = command.spawn().unwrap();
        let mut stdin = child.stdin.take().unwrap();
        std::io::Write::write_all(&mut stdin, text.as_bytes()).unwrap();
        drop(stdin);
        sidestep_tests::process::Said::from(child.wait_with_output().unwrap())
    };
    let out = folder.name("out.csv");
    piped(&["features", "--trials", "-", "--out", &out], &text).json();
    assert_eq!(std::fs::read(&out).unwrap(), expected);
    let said = piped(&["features", "--trials", "-", "--out", &out], "a,b\n");
    said.refused(2, &["stdin: line 1: header"]);
    let database = folder.database("study.db");
    let said = piped(&["import", "--database", &database, "--trials", "-"], &text).json();
    assert_eq!(said["trials"], 8);
    let states = "x;y;psi\n5,5;0,25;1\n-3;1;0,5\n";
    let said = piped(&["value", "--states", "-", "--out", &out], states);
    assert_eq!(said.json()["states"], Value::from(2));
    assert!(
        said.err.contains("stdin: read as a table with columns between semicolons"),
        "{}",
        said.err
    );
    assert!(folder.text("out.csv").contains("\n5.5,0.25,1.0,"), "{}", folder.text("out.csv"));
}

/// If a reader closes the pipe early, the command reports no error, like other programs.
#[tokio::test]
async fn a_reader_that_has_read_enough_is_no_error() {
    let args = ["simulate", "--participants", "20", "--seed", "1", "--out", "-"];
    let mut command = Command::new(binary());
    command.args(args).stdout(Stdio::piped()).stderr(Stdio::piped());
    let mut child = command.spawn().unwrap();
    let mut first = [0; 11];
    let mut stdout = child.stdout.take().unwrap();
    std::io::Read::read_exact(&mut stdout, &mut first).unwrap();
    assert_eq!(&first, b"participant");
    drop(stdout);
    let said = sidestep_tests::process::Said::from(child.wait_with_output().unwrap());
    assert_eq!((said.code, said.err.as_str()), (Some(0), ""));
}

#[tokio::test]
async fn study_files_of_editors() {
    let folder = Folder::default();
    let text = "slug = \"a\"\ntitle = \"Größe\"\nphases = [{ phase = \"task\", scenes = 4 }]\n";
    let design = async |name: &str, bytes: &[u8]| {
        let file = folder.file(name, bytes);
        run(&["design", "--study", &file, "--out", &folder.name(&format!("{name}-out"))]).await
    };
    let plain = design("utf8.toml", text.as_bytes()).await;
    assert_eq!(plain.code, Some(0), "{}", plain.err);
    let marked = design("mark.toml", format!("\u{feff}{text}").as_bytes()).await;
    assert_eq!(marked.code, Some(0), "{}", marked.err);
    assert!(!marked.err.contains("read as"), "{}", marked.err);
    let latin: Vec<u8> = text.chars().map(|c| u8::try_from(u32::from(c)).unwrap()).collect();
    for (name, bytes, encoding) in
        [("latin.toml", latin, "Windows-1252"), ("wide.toml", utf_16(text), "UTF-16")]
    {
        let said = design(name, &bytes).await;
        assert_eq!(said.code, Some(0), "{}", said.err);
        let words = format!("{name}: warning: read as {encoding}");
        assert!(said.err.contains(&words) && said.err.contains("save it as UTF-8"), "{}", said.err);
    }
    // "Größe" in Mac Roman. Its bytes stand for other letters in Windows-1252.
    let mac = text.as_bytes().iter().flat_map(|byte| match byte {
        0xc3 => vec![],
        0xb6 => vec![0x9a],
        0x9f => vec![0xa7],
        other => vec![*other],
    });
    let said = design("mac.toml", &mac.collect::<Vec<_>>()).await;
    said.refused(
        2,
        &["mac.toml: expected UTF-8 text, found a byte 0x9a", "save the file as UTF-8"],
    );
    // A field in the wrong table, and a slightly misspelled study name.
    let quota = design("quota.toml", format!("quota = 5\n{text}").as_bytes()).await;
    quota.refused(2, &["quota.toml:1: quota", "found \"quota\", which belongs in [recruitment]"]);
    let database = folder.database("study.db");
    let trials = folder.name("trials.csv");
    run(&["simulate", "--participants", "1", "--seed", "5", "--out", &trials]).await.json();
    let import = ["import", "--database", &database, "--study", "demo", "--trials", &trials];
    run(&import).await.json();
    let export = ["export", "--database", &database, "--out", &folder.name("out"), "--study"];
    let said = run(&[&export[..], &["Demo"]].concat()).await;
    said.refused(2, &["--study Demo", "which has demo; did you mean demo?"]);
    let said = run(&[&export[..], &["other"]].concat()).await;
    said.refused(2, &["--study other", "which has demo"]);
    assert!(!said.err.contains("did you mean"), "{}", said.err);
}
