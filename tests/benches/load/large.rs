//! The start of a server on a large database.

use std::path::Path;
use std::time::Instant;

use sidestep_tests::load::figures::{at_most, row};
use sidestep_tests::{Database, Driver, Folder, Process, sqlite};
use sqlx::{AssertSqlSafe, SqliteConnection};

/// Measures how long a server takes to be ready on a database with this number of trials. The
/// database file is kept in the folder for temporary files and reused by the next run.
pub(crate) async fn measure(trials: usize) {
    let name = format!("sidestep-{trials}-trials.db");
    let database = Database::file(Path::new(env!("CARGO_TARGET_TMPDIR")), &name);
    let folder = Folder::default();
    let Database::Sqlite(file) = &database else { unreachable!("a file") };
    if !file.exists() {
        let begin = Instant::now();
        make(&folder, file, trials).await;
        row("the database was made in", format!("{:.0} s", begin.elapsed().as_secs_f64()), name);
    }
    let stored = database.number("SELECT count(*) FROM trial").await;
    for time in ["first", "second", "third"] {
        let begin = Instant::now();
        let server = Process::start_on(&folder, &database).await;
        let ready_s = begin.elapsed().as_secs_f64();
        let ready = server.get("/readyz").await.status;
        row(
            &format!("start on {stored} trials, the {time} time"),
            format!("{:.0} ms", 1e3 * ready_s),
            format!("{}; /readyz answers {ready}", at_most(ready_s, 2.0, " s")),
        );
        server.kill().await;
    }
}

/// Creates the database. One participant drives all trials, and the other participants are copies.
async fn make(folder: &Folder, file: &Path, trials: usize) {
    let aside = file.with_extension("part");
    for ending in ["part", "part-wal", "part-shm"] {
        let _ = std::fs::remove_file(file.with_extension(ending));
    }
    let server = Process::start_on(folder, &Database::Sqlite(aside.clone())).await;
    let driver = Driver::enrol(&server).await;
    let each = driver.scenes().len();
    driver.drive(&server, each).await;
    server.kill().await;
    let people = trials.div_ceil(each).try_into().expect("fewer people");
    let copied = sqlite::with(&aside, async |db| copy(db, people).await);
    copied.await.expect("copies of a participant");
    std::fs::rename(aside, file).expect("the database");
}

/// Copies the only participant, with all rows that refer to it, until there are `people`
/// participants.
async fn copy(db: &mut SqliteConnection, people: u32) -> sqlx::Result<()> {
    let begin = "PRAGMA synchronous = OFF; PRAGMA foreign_keys = OFF; BEGIN";
    sqlx::raw_sql(begin).execute(&mut *db).await?;
    for number in 2..=people {
        for (table, changed) in [
            ("participant", &["id", "number", "place", "seed"][..]),
            ("participant_token", &["hash", "participant_id"]),
            ("scene", &["trial_id", "participant_id"]),
            ("trial", &["sequence", "trial_id"]),
            ("tally", &["participant_id"]),
        ] {
            let copying = AssertSqlSafe(copying(db, table, changed).await?);
            sqlx::query(copying).bind(number).execute(&mut *db).await?;
        }
    }
    sqlx::raw_sql("COMMIT; PRAGMA wal_checkpoint(TRUNCATE)").execute(db).await.map(drop)
}

/// The statement that copies the first participant's rows in a table, with new values in the
/// `changed` columns, which identify a row.
async fn copying(db: &mut SqliteConnection, table: &str, changed: &[&str]) -> sqlx::Result<String> {
    let columns = "SELECT name FROM pragma_table_info(?1)";
    let columns: Vec<String> = sqlx::query_scalar(columns).bind(table).fetch_all(db).await?;
    let value = |column: &String| match column.as_str() {
        column if !changed.contains(&column) => column.to_owned(),
        "number" | "place" | "seed" => "?1".to_owned(),
        "sequence" => "NULL".to_owned(),
        "hash" => "randomblob(32)".to_owned(),
        column => format!("{column} || '-' || ?1"),
    };
    let values: Vec<String> = columns.iter().map(value).collect();
    let first = "(SELECT id FROM participant WHERE number = 1)";
    let of_first = match table {
        "participant" => format!("id = {first}"),
        "trial" => {
            format!("trial_id IN (SELECT trial_id FROM scene WHERE participant_id = {first})")
        }
        _ => format!("participant_id = {first}"),
    };
    let (columns, values) = (columns.join(", "), values.join(", "));
    Ok(format!(
        "INSERT OR REPLACE INTO {table} ({columns}) SELECT {values} FROM {table} WHERE {of_first}"
    ))
}
