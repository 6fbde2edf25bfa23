//! Participants and their tokens.

use super::{Db, analyses};

/// A participant.
#[derive(Clone, Debug, sqlx::FromRow)]
pub struct Participant {
    /// Who, here.
    pub id: String,
    /// The study's row.
    pub study_id: i64,
    /// From 1 within the study.
    pub number: i64,
    /// The configuration they were enrolled under.
    pub config_hash: String,
    /// Issued once every planned trial is stored.
    pub completion_code: Option<String>,
    /// When they withdrew.
    pub withdrawn_at_ms: Option<i64>,
}

/// Someone to be written down.
#[derive(Clone, Debug, Default)]
pub struct NewParticipant<'a> {
    /// Who, here.
    pub id: &'a str,
    /// The study's row.
    pub study_id: i64,
    /// The recruiting service's name for the person.
    pub external_id: Option<&'a str>,
    /// The configuration they are enrolled under.
    pub config_hash: &'a str,
    /// Seed of the scenes.
    pub seed: Option<u64>,
    /// SHA-256 of what was read from a file.
    pub import_hash: Option<&'a str>,
    /// Language.
    pub locale: Option<&'a str>,
    /// The screen, as JSON.
    pub screen: Option<&'a str>,
    /// Now.
    pub enrolled_at_ms: i64,
}

/// Writes a participant down under the study's next number, which is returned.
///
/// # Errors
/// If the external id or import is known in this study, or the database cannot be written.
pub async fn insert(db: &mut Db, new: &NewParticipant<'_>) -> Result<i64, sqlx::Error> {
    sqlx::query_scalar(
        "INSERT INTO participant (id, study_id, number, external_id, config_hash, seed, \
             import_hash, locale, screen, enrolled_at_ms) \
         SELECT $1, $2, coalesce(max(number), 0) + 1, $3, $4, $5, $6, $7, $8, $9 \
         FROM participant WHERE study_id = $2 \
         RETURNING number",
    )
    .bind(new.id)
    .bind(new.study_id)
    .bind(new.external_id)
    .bind(new.config_hash)
    .bind(new.seed.map(u64::cast_signed))
    .bind(new.import_hash)
    .bind(new.locale)
    .bind(new.screen)
    .bind(new.enrolled_at_ms)
    .fetch_one(db)
    .await
}

/// The participant whom a recruiting service knows by that id.
///
/// # Errors
/// If the database cannot be read.
pub async fn by_external_id(
    db: &mut Db,
    study_id: i64,
    external_id: &str,
) -> Result<Option<Participant>, sqlx::Error> {
    sqlx::query_as(
        "SELECT id, study_id, number, config_hash, completion_code, withdrawn_at_ms \
         FROM participant WHERE study_id = $1 AND external_id = $2",
    )
    .bind(study_id)
    .bind(external_id)
    .fetch_optional(db)
    .await
}

/// Whether a person with that content was read from a file before.
///
/// # Errors
/// If the database cannot be read.
pub async fn is_imported(db: &mut Db, study_id: i64, hash: &str) -> Result<bool, sqlx::Error> {
    sqlx::query_scalar(
        "SELECT count(*) > 0 FROM participant WHERE study_id = $1 AND import_hash = $2",
    )
    .bind(study_id)
    .bind(hash)
    .fetch_one(db)
    .await
}

/// The participant to whom a token with that hash was given.
///
/// # Errors
/// If the database cannot be read.
pub async fn by_token(
    db: &mut Db,
    token_hash: &[u8; 32],
) -> Result<Option<Participant>, sqlx::Error> {
    sqlx::query_as(
        "SELECT id, study_id, number, config_hash, completion_code, withdrawn_at_ms \
         FROM participant WHERE id = \
             (SELECT participant_id FROM participant_token WHERE hash = $1)",
    )
    .bind(&token_hash[..])
    .fetch_optional(db)
    .await
}

/// Lets a token with that hash speak for a participant, beside those given before.
///
/// # Errors
/// If the database cannot be written.
pub async fn add_token(
    db: &mut Db,
    participant_id: &str,
    token_hash: &[u8; 32],
    now_ms: i64,
) -> Result<(), sqlx::Error> {
    sqlx::query(
        "INSERT INTO participant_token (hash, participant_id, created_at_ms) VALUES ($1, $2, $3)",
    )
    .bind(&token_hash[..])
    .bind(participant_id)
    .bind(now_ms)
    .execute(db)
    .await
    .map(drop)
}

/// Whether a participant has withdrawn, read under the write lock.
///
/// # Errors
/// If the database cannot be read.
pub async fn is_withdrawn(db: &mut Db, participant_id: &str) -> Result<bool, sqlx::Error> {
    sqlx::query_scalar("SELECT withdrawn_at_ms IS NOT NULL FROM participant WHERE id = $1")
        .bind(participant_id)
        .fetch_one(db)
        .await
}

/// Marks a participation complete, unless it is, and returns its code: the first one.
///
/// # Errors
/// If the database cannot be written.
pub async fn complete(
    db: &mut Db,
    participant_id: &str,
    code: &str,
    now_ms: i64,
) -> Result<String, sqlx::Error> {
    sqlx::query_scalar(
        "UPDATE participant SET completion_code = coalesce(completion_code, $2), \
             completed_at_ms = coalesce(completed_at_ms, $3) WHERE id = $1 \
         RETURNING completion_code",
    )
    .bind(participant_id)
    .bind(code)
    .bind(now_ms)
    .fetch_one(db)
    .await
}

/// Notes a withdrawal; a second one changes nothing.
///
/// # Errors
/// If the database cannot be written.
pub async fn withdraw(db: &mut Db, participant_id: &str, now_ms: i64) -> Result<(), sqlx::Error> {
    sqlx::query(
        "UPDATE participant SET withdrawn_at_ms = coalesce(withdrawn_at_ms, $2) WHERE id = $1",
    )
    .bind(participant_id)
    .bind(now_ms)
    .execute(db)
    .await
    .map(drop)
}

/// Deletes what a withdrawn participant drove and said, and what was found from it. What
/// stays is a number that took part and left, so that counts remain true.
///
/// # Errors
/// If the database cannot be written.
pub async fn delete_data(db: &mut Db, participant_id: &str) -> Result<(), sqlx::Error> {
    analyses::withdraw(db, participant_id).await?;
    for statement in [
        "DELETE FROM trial WHERE trial_id IN \
             (SELECT trial_id FROM scene WHERE participant_id = $1)",
        "DELETE FROM scene WHERE participant_id = $1",
        "UPDATE participant SET data_deleted = 1, external_id = NULL, locale = NULL, \
             screen = NULL, seed = NULL WHERE id = $1",
    ] {
        sqlx::query(statement).bind(participant_id).execute(&mut *db).await?;
    }
    Ok(())
}

/// Ids of a study's participants in the order of their numbers.
///
/// # Errors
/// If the database cannot be read.
pub async fn ids(db: &mut Db, study_id: i64) -> Result<Vec<String>, sqlx::Error> {
    sqlx::query_scalar("SELECT id FROM participant WHERE study_id = $1 ORDER BY number")
        .bind(study_id)
        .fetch_all(db)
        .await
}

/// How many people there are in all studies.
///
/// # Errors
/// If the database cannot be read.
pub async fn count(db: &mut Db) -> Result<i64, sqlx::Error> {
    sqlx::query_scalar("SELECT count(*) FROM participant").fetch_one(db).await
}
