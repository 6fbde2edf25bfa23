//! The experimenter's keys and sessions, stored as hashes only.

use super::{Store, StoreError};
use rusqlite::{OptionalExtension, params};

impl Store {
    /// The hashes of the valid keys.
    pub async fn keys(&self) -> Result<Vec<Vec<u8>>, StoreError> {
        self.read(|db| {
            let mut statement = db.prepare_cached("SELECT hash FROM admin_key")?;
            Ok(statement.query_map([], |row| row.get(0))?.collect::<Result<_, _>>()?)
        })
    }

    /// Stores a key with that hash, unless there is a key already and no `other` is wanted. The new
    /// key replaces the old one and ends every session: an experimenter asks for another key after
    /// losing the old one or fearing that someone else has it. Returns whether the key was stored.
    pub async fn put_key(
        &self,
        hash: [u8; 32],
        other: bool,
        now_ms: i64,
    ) -> Result<bool, StoreError> {
        self.write(move |db| {
            let there =
                db.query_row("SELECT 1 FROM admin_key LIMIT 1", [], |_| Ok(())).optional()?;
            if there.is_some() && !other {
                return Ok(false);
            }
            db.execute("DELETE FROM admin_key", [])?;
            db.execute("DELETE FROM session", [])?;
            db.execute(
                "INSERT INTO admin_key (hash, created_at_ms) VALUES (?1, ?2)",
                params![hash, now_ms],
            )?;
            Ok(true)
        })
        .await
    }

    /// Begins a session, and deletes expired sessions.
    pub async fn add_session(
        &self,
        hash: [u8; 32],
        now_ms: i64,
        expires_at_ms: i64,
    ) -> Result<(), StoreError> {
        self.write(move |db| {
            db.execute("DELETE FROM session WHERE expires_at_ms <= ?1", [now_ms])?;
            db.execute(
                "INSERT INTO session (hash, expires_at_ms) VALUES (?1, ?2)",
                params![hash, expires_at_ms],
            )?;
            Ok(())
        })
        .await
    }

    /// Whether a session with that hash exists and has not expired.
    pub async fn has_session(&self, hash: [u8; 32], now_ms: i64) -> Result<bool, StoreError> {
        self.read(|db| {
            let query = "SELECT 1 FROM session WHERE hash = ?1 AND expires_at_ms > ?2";
            let mut statement = db.prepare_cached(query)?;
            Ok(statement.exists(params![hash, now_ms])?)
        })
    }

    /// Ends a session.
    pub async fn end_session(&self, hash: [u8; 32]) -> Result<(), StoreError> {
        self.write(move |db| {
            db.execute("DELETE FROM session WHERE hash = ?1", [hash])?;
            Ok(())
        })
        .await
    }
}
