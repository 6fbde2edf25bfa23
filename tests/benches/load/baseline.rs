//! The baseline: plain SQLite on the same disk.

use std::time::Instant;

use sidestep_tests::Folder;
use sqlx::sqlite::{SqliteConnectOptions, SqliteJournalMode, SqliteSynchronous};
use sqlx::{ConnectOptions, Connection, Result};

const STEPS: usize = 50;

const KEY_EVENTS: &str = r#"[{"t_ms":1990.5,"key":"ArrowLeft","down":true},{"t_ms":5012.0,"key":"ArrowLeft","down":false}]"#;

const DISPLAY: &str = r#"{"refresh_hz":60.0,"frames":612,"longest_frame_ms":18.4}"#;

/// Inserts trials durably for `seconds` s, with `per_commit` trials in each transaction and with
/// the server's row sizes and settings. Returns the number of trials per second.
pub(crate) async fn inserts(folder: &Folder, per_commit: usize, seconds: f64) -> f64 {
    let begin = Instant::now();
    let goes_on = || begin.elapsed().as_secs_f64() < seconds;
    let count = insert(folder, per_commit, goes_on).await.expect("SQLite inserts");
    count as f64 / begin.elapsed().as_secs_f64()
}

async fn insert(folder: &Folder, per_commit: usize, goes_on: impl Fn() -> bool) -> Result<usize> {
    let mut db = SqliteConnectOptions::new()
        .filename(folder.path(&format!("baseline-{per_commit}.db")))
        .create_if_missing(true)
        .journal_mode(SqliteJournalMode::Wal)
        .synchronous(SqliteSynchronous::Full)
        .connect()
        .await?;
    sqlx::raw_sql(
        "CREATE TABLE trial (sequence INTEGER PRIMARY KEY, trial_id TEXT NOT NULL UNIQUE,
             content_hash BLOB NOT NULL, inputs BLOB NOT NULL, states BLOB NOT NULL,
             sampled_at_ms BLOB NOT NULL, key_events TEXT NOT NULL, display TEXT NOT NULL) STRICT",
    )
    .execute(&mut db)
    .await?;
    let states = vec![0x5a_u8; 48 * (STEPS + 1)];
    let mut count = 0;
    while goes_on() {
        // A single statement inserts all trials, so that only SQLite is measured. The ids are as
        // long and as unordered as the server's ids.
        let insert = sqlx::query(
            "WITH RECURSIVE one(number) AS
                 (SELECT 1 UNION ALL SELECT number + 1 FROM one WHERE number < ?1)
             INSERT INTO trial (trial_id, content_hash, inputs, states, sampled_at_ms, key_events,
                 display)
             SELECT hex(randomblob(18)), ?2, ?3, ?4, ?5, ?6, ?7 FROM one",
        )
        .bind(per_commit as i64)
        .bind(&states[..32])
        .bind(&states[..STEPS])
        .bind(&states[..])
        .bind(&states[..8 * STEPS])
        .bind(KEY_EVENTS)
        .bind(DISPLAY);
        insert.execute(&mut db).await?;
        count += per_commit;
    }
    db.close().await?;
    Ok(count)
}
