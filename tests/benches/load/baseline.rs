//! The baseline: SQLite on the same disk, with nothing around it.

use std::time::Instant;

use rusqlite::{Connection, Result, params};
use sidestep::math::SeededRng;
use sidestep_tests::Folder;

const STEPS: usize = 50;

const KEY_EVENTS: &str = r#"[{"t_ms":1990.5,"key":"ArrowLeft","down":true},{"t_ms":5012.0,"key":"ArrowLeft","down":false}]"#;

const DISPLAY: &str = r#"{"refresh_hz":60.0,"frames":612,"longest_frame_ms":18.4}"#;

/// Inserts trials durably for `seconds` s, `per_commit` in each transaction, with the server's rows
/// and settings. Returns the number of trials a second.
pub(crate) fn inserts(folder: &Folder, per_commit: usize, seconds: f64) -> f64 {
    let begin = Instant::now();
    let goes_on = || begin.elapsed().as_secs_f64() < seconds;
    let count = insert(folder, per_commit, goes_on).expect("SQLite inserts");
    count as f64 / begin.elapsed().as_secs_f64()
}

fn insert(folder: &Folder, per_commit: usize, goes_on: impl Fn() -> bool) -> Result<usize> {
    let db = Connection::open(folder.path(&format!("baseline-{per_commit}.db")))?;
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
    // As long as the server's ids, and as unordered.
    let mut rng = SeededRng::new(1);
    let mut count = 0;
    while goes_on() {
        db.execute_batch("BEGIN IMMEDIATE")?;
        for _ in 0..per_commit {
            insert.execute(params![
                format!("{:036}", rng.below(usize::MAX)),
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
    Ok(count)
}
