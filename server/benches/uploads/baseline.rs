//! The baseline: SQLite on the same disk, with nothing around it.

use std::path::Path;
use std::time::{Duration, Instant};

use rusqlite::{Connection, params};

const STEPS: usize = 50;

const KEY_EVENTS: &str = r#"[{"t_ms":1990.5,"key":"ArrowLeft","down":true},{"t_ms":5012.0,"key":"ArrowLeft","down":false}]"#;

const DISPLAY: &str = r#"{"refresh_hz":60.0,"frames":612,"longest_frame_ms":18.4}"#;

/// Trials a second that a loop inserts durably, so many a transaction. Rows and settings are
/// the server's.
pub(crate) fn inserts(folder: &Path, per_commit: usize, time: Duration) -> anyhow::Result<f64> {
    let db = Connection::open(folder.join(format!("baseline-{per_commit}.db")))?;
    db.execute_batch(
        "PRAGMA journal_mode = WAL;
         PRAGMA synchronous = FULL;
         CREATE TABLE trial (sequence INTEGER PRIMARY KEY, trial_id TEXT NOT NULL UNIQUE,
             content_hash BLOB NOT NULL, inputs BLOB NOT NULL, states BLOB NOT NULL,
             sampled_at_ms BLOB NOT NULL, key_events TEXT NOT NULL, display TEXT NOT NULL) STRICT",
    )?;
    let states = vec![0x5a_u8; 48 * (STEPS + 1)];
    let mut insert = db.prepare(
        "INSERT INTO trial (trial_id, content_hash, inputs, states, sampled_at_ms, key_events, \
         display) VALUES ($1, $2, $3, $4, $5, $6, $7)",
    )?;
    let (begin, mut count) = (Instant::now(), 0);
    while begin.elapsed() < time {
        db.execute_batch("BEGIN IMMEDIATE")?;
        for _ in 0..per_commit {
            insert.execute(params![
                uuid::Uuid::new_v4().to_string(),
                &states[..32],
                &states[..STEPS],
                states,
                &states[..8 * STEPS],
                KEY_EVENTS,
                DISPLAY,
            ])?;
        }
        db.execute_batch("COMMIT")?;
        count += per_commit;
    }
    Ok(count as f64 / begin.elapsed().as_secs_f64())
}
