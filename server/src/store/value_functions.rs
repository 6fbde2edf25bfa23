//! Octets of value functions, and which of them a configuration's safety levels are
//! read from.

use super::{Db, undecodable};
use sidestep::scene::Evader;
use sidestep::study::StudyConfig;

/// Keeps octets under their id, and says that the safety level of `evader` is read
/// from them. Where there is a function already, that one stands.
///
/// # Errors
/// If the configuration is not there or the database cannot be written.
pub async fn put(
    db: &mut Db,
    config_hash: &str,
    evader: Evader,
    id: &str,
    octets: &[u8],
) -> Result<(), sqlx::Error> {
    sqlx::query(
        "INSERT INTO value_function (id, octets) VALUES ($1, $2) ON CONFLICT (id) DO NOTHING",
    )
    .bind(id)
    .bind(octets)
    .execute(&mut *db)
    .await?;
    sqlx::query(
        "INSERT INTO safety_function (config_hash, evader, value_function_id) \
         VALUES ($1, $2, $3) ON CONFLICT (config_hash, evader) DO NOTHING",
    )
    .bind(config_hash)
    .bind(evader.word())
    .bind(id)
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

/// The id of the function that the safety level of `evader` is read from.
///
/// # Errors
/// If the database cannot be read.
pub async fn id_of(
    db: &mut Db,
    config_hash: &str,
    evader: Evader,
) -> Result<Option<String>, sqlx::Error> {
    sqlx::query_scalar(
        "SELECT value_function_id FROM safety_function WHERE config_hash = $1 AND evader = $2",
    )
    .bind(config_hash)
    .bind(evader.word())
    .fetch_optional(db)
    .await
}

/// Every configuration that lacks a function, with its hash.
///
/// # Errors
/// If the database cannot be read.
pub async fn unsolved(db: &mut Db) -> Result<Vec<(String, StudyConfig)>, sqlx::Error> {
    let rows: Vec<(String, String)> = sqlx::query_as(
        "SELECT hash, json FROM study_config WHERE \
             (SELECT count(*) FROM safety_function WHERE config_hash = hash) < 2",
    )
    .fetch_all(db)
    .await?;
    let parsed = |(hash, json): (String, String)| {
        Ok((hash, serde_json::from_str(&json).map_err(undecodable)?))
    };
    rows.into_iter().map(parsed).collect()
}
