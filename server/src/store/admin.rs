//! The experimenter's keys and sessions: hashes only.

use super::Db;

/// Hashes of the keys that are valid.
///
/// # Errors
/// If the database cannot be read.
pub async fn keys(db: &mut Db) -> Result<Vec<Vec<u8>>, sqlx::Error> {
    sqlx::query_scalar("SELECT hash FROM admin_key").fetch_all(db).await
}

/// Makes a key with that hash the only one, and ends every session: whoever asks
/// for a new key has lost the old one, or fears that someone else has it.
///
/// # Errors
/// If the database cannot be written.
pub async fn replace_key(db: &mut Db, hash: &[u8; 32], now_ms: i64) -> Result<(), sqlx::Error> {
    for statement in ["DELETE FROM admin_key", "DELETE FROM session"] {
        sqlx::query(statement).execute(&mut *db).await?;
    }
    sqlx::query("INSERT INTO admin_key (hash, created_at_ms) VALUES ($1, $2)")
        .bind(&hash[..])
        .bind(now_ms)
        .execute(db)
        .await
        .map(drop)
}

/// Begins a session, and forgets those that are over.
///
/// # Errors
/// If the database cannot be written.
pub async fn add_session(
    db: &mut Db,
    hash: &[u8; 32],
    now_ms: i64,
    expires_at_ms: i64,
) -> Result<(), sqlx::Error> {
    sqlx::query("DELETE FROM session WHERE expires_at_ms <= $1")
        .bind(now_ms)
        .execute(&mut *db)
        .await?;
    sqlx::query("INSERT INTO session (hash, expires_at_ms) VALUES ($1, $2)")
        .bind(&hash[..])
        .bind(expires_at_ms)
        .execute(db)
        .await
        .map(drop)
}

/// Whether a session with that hash goes on.
///
/// # Errors
/// If the database cannot be read.
pub async fn has_session(db: &mut Db, hash: &[u8; 32], now_ms: i64) -> Result<bool, sqlx::Error> {
    sqlx::query_scalar("SELECT count(*) > 0 FROM session WHERE hash = $1 AND expires_at_ms > $2")
        .bind(&hash[..])
        .bind(now_ms)
        .fetch_one(db)
        .await
}

/// Ends a session.
///
/// # Errors
/// If the database cannot be written.
pub async fn end_session(db: &mut Db, hash: &[u8; 32]) -> Result<(), sqlx::Error> {
    sqlx::query("DELETE FROM session WHERE hash = $1").bind(&hash[..]).execute(db).await.map(drop)
}
