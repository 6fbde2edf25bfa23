//! Studies and their configurations.

use super::{Db, undecodable};
use sidestep::study::StudyConfig;

/// A study with the configuration that new participants get.
#[derive(Clone, Debug)]
pub struct Study {
    /// Row.
    pub id: i64,
    /// Name in addresses.
    pub slug: String,
    /// What new participants go through.
    pub config: StudyConfig,
}

/// How much a study holds.
#[derive(Clone, Debug, sqlx::FromRow)]
pub struct StudyCounts {
    /// Name in addresses.
    pub slug: String,
    /// Name shown to people, from the present configuration.
    pub title: String,
    /// People who enrolled or were read from files.
    pub participants: i64,
    /// Trials stored.
    pub trials: i64,
}

/// The study of that name.
///
/// # Errors
/// If the database cannot be read.
pub async fn find(db: &mut Db, slug: &str) -> Result<Option<Study>, sqlx::Error> {
    let row: Option<(i64, String, String)> = sqlx::query_as(
        "SELECT study.id, study.slug, study_config.json FROM study \
         JOIN study_config ON study_config.hash = study.config_hash WHERE study.slug = $1",
    )
    .bind(slug)
    .fetch_optional(db)
    .await?;
    row.map(|(id, slug, json)| {
        let config = serde_json::from_str(&json).map_err(undecodable)?;
        Ok(Study { id, slug, config })
    })
    .transpose()
}

/// The configuration of that hash: what a participant was enrolled under.
///
/// # Errors
/// If it is not there or the database cannot be read.
pub async fn config(db: &mut Db, hash: &str) -> Result<StudyConfig, sqlx::Error> {
    let json: String = sqlx::query_scalar("SELECT json FROM study_config WHERE hash = $1")
        .bind(hash)
        .fetch_one(db)
        .await?;
    serde_json::from_str(&json).map_err(undecodable)
}

/// Makes a study, or gives an existing one this configuration for people to come.
/// Those who are enrolled keep theirs.
///
/// # Errors
/// If the database cannot be written.
pub async fn put(db: &mut Db, config: &StudyConfig, now_ms: i64) -> Result<(), sqlx::Error> {
    let json = serde_json::to_string(config).map_err(undecodable)?;
    sqlx::query(
        "INSERT INTO study_config (hash, json) VALUES ($1, $2) ON CONFLICT (hash) DO NOTHING",
    )
    .bind(config.hash())
    .bind(json)
    .execute(&mut *db)
    .await?;
    sqlx::query(
        "INSERT INTO study (slug, config_hash, created_at_ms) VALUES ($1, $2, $3) \
         ON CONFLICT (slug) DO UPDATE SET config_hash = excluded.config_hash",
    )
    .bind(&config.slug)
    .bind(config.hash())
    .bind(now_ms)
    .execute(db)
    .await?;
    Ok(())
}

/// Every study with its counts, oldest first.
///
/// # Errors
/// If the database cannot be read.
pub async fn counts(db: &mut Db) -> Result<Vec<StudyCounts>, sqlx::Error> {
    sqlx::query_as(
        "SELECT study.slug, study_config.json ->> '$.title' AS title, \
             (SELECT count(*) FROM participant WHERE participant.study_id = study.id) \
                 AS participants, \
             (SELECT count(*) FROM trial JOIN scene ON scene.trial_id = trial.trial_id \
                 JOIN participant ON participant.id = scene.participant_id \
                 WHERE participant.study_id = study.id) AS trials \
         FROM study JOIN study_config ON study_config.hash = study.config_hash ORDER BY study.id",
    )
    .fetch_all(db)
    .await
}
