//! Octets of value functions.

use super::Db;
use sidestep::reachability::ValueFunction;

/// Keeps a function's octets under its id.
///
/// # Errors
/// If the database cannot be written.
pub async fn put(db: &mut Db, function: &ValueFunction) -> Result<(), sqlx::Error> {
    sqlx::query(
        "INSERT INTO value_function (id, octets) VALUES ($1, $2) ON CONFLICT (id) DO NOTHING",
    )
    .bind(function.id())
    .bind(function.encode())
    .execute(db)
    .await
    .map(drop)
}

/// The octets of that id.
///
/// # Errors
/// If the database cannot be read.
pub async fn find(db: &mut Db, id: &str) -> Result<Option<Vec<u8>>, sqlx::Error> {
    sqlx::query_scalar("SELECT octets FROM value_function WHERE id = $1")
        .bind(id)
        .fetch_optional(db)
        .await
}
