//! Analyses: the queue, their files, and cells that the next one need not compute again.

use super::{Db, undecodable, unknown_word};
use sidestep::api::{AnalysisFile, AnalysisResult, AnalysisState};
use sidestep::comparison::Request;
use std::collections::HashSet;

/// An analysis without its files.
#[derive(Clone, Debug)]
pub struct StoredAnalysis {
    /// Rises with every analysis asked for.
    pub sequence: i64,
    /// In addresses.
    pub id: String,
    /// The study's name.
    pub study: String,
    /// What was asked for.
    pub request: Request,
    /// What has become of it.
    pub state: AnalysisState,
    /// Pieces of work that are done.
    pub done: i64,
    /// All of them; 0 before they are counted.
    pub of: i64,
    /// Those of the done ones that were not kept from before.
    pub fresh: i64,
    /// When it was asked for.
    pub created_at_ms: i64,
    /// When it began.
    pub started_at_ms: Option<i64>,
    /// When it ended.
    pub ended_at_ms: Option<i64>,
    /// Why it failed.
    pub message: Option<String>,
    /// What it is about, once it is done.
    pub result: Option<AnalysisResult>,
}

#[derive(sqlx::FromRow)]
struct Columns {
    sequence: i64,
    id: String,
    study: String,
    request: String,
    state: String,
    done: i64,
    total: i64,
    fresh: i64,
    created_at_ms: i64,
    started_at_ms: Option<i64>,
    ended_at_ms: Option<i64>,
    message: Option<String>,
    result: Option<String>,
}

impl TryFrom<Columns> for StoredAnalysis {
    type Error = sqlx::Error;

    fn try_from(row: Columns) -> Result<Self, sqlx::Error> {
        let result = row.result.as_deref().map(serde_json::from_str).transpose();
        Ok(Self {
            request: serde_json::from_str(&row.request).map_err(undecodable)?,
            state: AnalysisState::from_word(&row.state).ok_or_else(|| unknown_word(&row.state))?,
            result: result.map_err(undecodable)?,
            sequence: row.sequence,
            id: row.id,
            study: row.study,
            done: row.done,
            of: row.total,
            fresh: row.fresh,
            created_at_ms: row.created_at_ms,
            started_at_ms: row.started_at_ms,
            ended_at_ms: row.ended_at_ms,
            message: row.message,
        })
    }
}

/// Puts an analysis at the end of the queue.
///
/// # Errors
/// If the database cannot be written.
pub async fn insert(
    db: &mut Db,
    id: &str,
    study_id: i64,
    request: &Request,
    now_ms: i64,
) -> Result<(), sqlx::Error> {
    sqlx::query(
        "INSERT INTO analysis (id, study_id, request, state, created_at_ms) \
         VALUES ($1, $2, $3, 'queued', $4)",
    )
    .bind(id)
    .bind(study_id)
    .bind(serde_json::to_string(request).map_err(undecodable)?)
    .bind(now_ms)
    .execute(db)
    .await
    .map(drop)
}

/// The id of an analysis of this study that waits, with the same request: it would find the same.
///
/// # Errors
/// If the database cannot be read.
pub async fn waiting(
    db: &mut Db,
    study_id: i64,
    request: &Request,
) -> Result<Option<String>, sqlx::Error> {
    sqlx::query_scalar(
        "SELECT id FROM analysis WHERE study_id = $1 AND request = $2 AND state = 'queued'",
    )
    .bind(study_id)
    .bind(serde_json::to_string(request).map_err(undecodable)?)
    .fetch_optional(db)
    .await
}

/// How many wait.
///
/// # Errors
/// If the database cannot be read.
pub async fn queue_length(db: &mut Db) -> Result<i64, sqlx::Error> {
    sqlx::query_scalar("SELECT count(*) FROM analysis WHERE state = 'queued'").fetch_one(db).await
}

/// At most `limit` analyses of a study, newest first, from before `before`.
///
/// # Errors
/// If the database cannot be read.
pub async fn page(
    db: &mut Db,
    study_id: i64,
    before: i64,
    limit: i64,
) -> Result<Vec<StoredAnalysis>, sqlx::Error> {
    let rows: Vec<Columns> = sqlx::query_as(
        "SELECT analysis.*, study.slug AS study FROM analysis \
         JOIN study ON study.id = analysis.study_id \
         WHERE analysis.study_id = $1 AND analysis.sequence < $2 \
         ORDER BY analysis.sequence DESC LIMIT $3",
    )
    .bind(study_id)
    .bind(before)
    .bind(limit)
    .fetch_all(db)
    .await?;
    rows.into_iter().map(StoredAnalysis::try_from).collect()
}

/// The analysis of that id.
///
/// # Errors
/// If the database cannot be read.
pub async fn find(db: &mut Db, id: &str) -> Result<Option<StoredAnalysis>, sqlx::Error> {
    let row: Option<Columns> = sqlx::query_as(
        "SELECT analysis.*, study.slug AS study FROM analysis \
         JOIN study ON study.id = analysis.study_id WHERE analysis.id = $1",
    )
    .bind(id)
    .fetch_optional(db)
    .await?;
    row.map(StoredAnalysis::try_from).transpose()
}

/// The files of an analysis that is done, by name.
///
/// # Errors
/// If the database cannot be read.
pub async fn files(db: &mut Db, id: &str) -> Result<Vec<AnalysisFile>, sqlx::Error> {
    let rows: Vec<(String, i64)> = sqlx::query_as(
        "SELECT name, size FROM analysis_file WHERE analysis = \
             (SELECT sequence FROM analysis WHERE id = $1 AND state = 'done') ORDER BY name",
    )
    .bind(id)
    .fetch_all(db)
    .await?;
    let file = |(name, size): (String, i64)| AnalysisFile { name, octets: size.unsigned_abs() };
    Ok(rows.into_iter().map(file).collect())
}

/// One file of an analysis that is done, compressed with gzip.
///
/// # Errors
/// If the database cannot be read.
pub async fn file(db: &mut Db, id: &str, name: &str) -> Result<Option<Vec<u8>>, sqlx::Error> {
    sqlx::query_scalar(
        "SELECT octets FROM analysis_file WHERE name = $2 AND analysis = \
             (SELECT sequence FROM analysis WHERE id = $1 AND state = 'done')",
    )
    .bind(id)
    .bind(name)
    .fetch_optional(db)
    .await
}

/// Cancels an analysis that is not over; whoever makes it notices. Whether there was one.
///
/// # Errors
/// If the database cannot be written.
pub async fn cancel(db: &mut Db, id: &str, now_ms: i64) -> Result<bool, sqlx::Error> {
    let cancelled: Option<i64> = sqlx::query_scalar(
        "UPDATE analysis SET state = 'cancelled', ended_at_ms = $2 \
         WHERE id = $1 AND state IN ('queued', 'running') RETURNING sequence",
    )
    .bind(id)
    .bind(now_ms)
    .fetch_optional(&mut *db)
    .await?;
    if let Some(sequence) = cancelled {
        delete_files(db, sequence).await?;
    }
    Ok(cancelled.is_some())
}

/// Deletes an analysis with all that belongs to it. Whether there was one.
///
/// # Errors
/// If the database cannot be written.
pub async fn delete(db: &mut Db, id: &str) -> Result<bool, sqlx::Error> {
    let deleted = sqlx::query("DELETE FROM analysis WHERE id = $1").bind(id).execute(db).await?;
    Ok(deleted.rows_affected() > 0)
}

async fn delete_files(db: &mut Db, sequence: i64) -> Result<(), sqlx::Error> {
    sqlx::query("DELETE FROM analysis_file WHERE analysis = $1")
        .bind(sequence)
        .execute(db)
        .await
        .map(drop)
}

/// Deletes what was found from somebody's data, while they are still there: files, and cells of
/// the study. What is being made begins anew, without them. Of somebody who drove nothing,
/// nothing was found.
///
/// # Errors
/// If the database cannot be written.
pub async fn withdraw(db: &mut Db, participant_id: &str) -> Result<(), sqlx::Error> {
    for statement in [
        "DELETE FROM analysis_file WHERE analysis IN \
             (SELECT analysis FROM analysis_participant WHERE participant_id = $1)",
        "DELETE FROM analysis_cell WHERE study_id = \
             (SELECT study_id FROM participant WHERE id = $1) AND EXISTS (SELECT 1 FROM trial \
             JOIN scene ON scene.trial_id = trial.trial_id WHERE scene.participant_id = $1)",
        "UPDATE analysis SET state = 'withdrawn', result = NULL WHERE state = 'done' AND sequence \
             IN (SELECT analysis FROM analysis_participant WHERE participant_id = $1)",
        "UPDATE analysis SET state = 'queued', started_at_ms = NULL, done = 0, total = 0 \
             WHERE state = 'running' AND sequence \
             IN (SELECT analysis FROM analysis_participant WHERE participant_id = $1)",
        "DELETE FROM analysis_participant WHERE participant_id = $1",
    ] {
        sqlx::query(statement).bind(participant_id).execute(&mut *db).await?;
    }
    Ok(())
}

/// An analysis to be made now.
#[derive(Clone, Debug)]
pub struct Job {
    /// Which.
    pub sequence: i64,
    /// Which time it was begun: whoever begins it again makes this one unwanted.
    pub attempt: i64,
    /// Of which study: its row.
    pub study_id: i64,
    /// Its name.
    pub study: String,
    /// What was asked for.
    pub request: Request,
}

/// How often an analysis is begun before it is taken for one that brings the server down.
const MOST_ATTEMPTS: i64 = 3;

/// Puts back into the queue what was begun and did not come to an end, because the server ended
/// or the database failed, unless that has happened too often.
///
/// # Errors
/// If the database cannot be written.
pub async fn recover(db: &mut Db, now_ms: i64) -> Result<(), sqlx::Error> {
    sqlx::query(
        "UPDATE analysis SET state = 'failed', ended_at_ms = $1, message = \
             'begun ' || attempts || ' times without coming to an end; see the server''s log' \
         WHERE state = 'running' AND attempts >= $2",
    )
    .bind(now_ms)
    .bind(MOST_ATTEMPTS)
    .execute(&mut *db)
    .await?;
    sqlx::query("UPDATE analysis SET state = 'queued' WHERE state = 'running'")
        .execute(db)
        .await
        .map(drop)
}

/// Takes the analysis that waited longest, and notes whose data it will hold.
///
/// # Errors
/// If the database cannot be written.
pub async fn begin(db: &mut Db, now_ms: i64) -> Result<Option<Job>, sqlx::Error> {
    let row: Option<(i64, i64, i64, String)> = sqlx::query_as(
        "UPDATE analysis SET state = 'running', attempts = attempts + 1, started_at_ms = $1, \
             done = 0, total = 0, fresh = 0 \
         WHERE sequence = (SELECT min(sequence) FROM analysis WHERE state = 'queued') \
         RETURNING sequence, attempts, study_id, request",
    )
    .bind(now_ms)
    .fetch_optional(&mut *db)
    .await?;
    let Some((sequence, attempt, study_id, request)) = row else {
        return Ok(None);
    };
    delete_files(db, sequence).await?;
    for statement in [
        "DELETE FROM analysis_participant WHERE analysis = $1",
        "INSERT INTO analysis_participant (analysis, participant_id) \
         SELECT analysis.sequence, participant.id FROM analysis \
         JOIN participant ON participant.study_id = analysis.study_id \
         WHERE analysis.sequence = $1 AND EXISTS (SELECT 1 FROM trial \
             JOIN scene ON scene.trial_id = trial.trial_id \
             WHERE scene.participant_id = participant.id)",
    ] {
        sqlx::query(statement).bind(sequence).execute(&mut *db).await?;
    }
    let study: String = sqlx::query_scalar("SELECT slug FROM study WHERE id = $1")
        .bind(study_id)
        .fetch_one(db)
        .await?;
    let request = serde_json::from_str(&request).map_err(undecodable)?;
    Ok(Some(Job { sequence, attempt, study_id, study, request }))
}

/// Notes how far it is. Whether it is still wanted.
///
/// # Errors
/// If the database cannot be written.
pub async fn note_progress(
    db: &mut Db,
    job: &Job,
    [done, of, fresh]: [usize; 3],
) -> Result<bool, sqlx::Error> {
    sqlx::query(
        "UPDATE analysis SET done = $2, total = $3, fresh = $5 \
         WHERE sequence = $1 AND state = 'running' AND attempts = $4",
    )
    .bind(job.sequence)
    .bind(done as i64)
    .bind(of as i64)
    .bind(job.attempt)
    .bind(fresh as i64)
    .execute(db)
    .await
    .map(|updated| updated.rows_affected() > 0)
}

/// Keeps a file of an analysis that is still wanted. Whether it is.
///
/// # Errors
/// If the database cannot be written.
pub async fn put_file(
    db: &mut Db,
    job: &Job,
    name: &str,
    size: usize,
    octets: &[u8],
) -> Result<bool, sqlx::Error> {
    sqlx::query(
        "INSERT INTO analysis_file (analysis, name, size, octets) \
         SELECT sequence, $2, $3, $4 FROM analysis \
         WHERE sequence = $1 AND state = 'running' AND attempts = $5",
    )
    .bind(job.sequence)
    .bind(name)
    .bind(size as i64)
    .bind(octets)
    .bind(job.attempt)
    .execute(db)
    .await
    .map(|inserted| inserted.rows_affected() > 0)
}

/// Ends an analysis that is still wanted: done with a result, or failed with a message.
/// Whether it was.
///
/// # Errors
/// If the database cannot be written.
pub async fn end(
    db: &mut Db,
    job: &Job,
    ending: &Result<AnalysisResult, String>,
    now_ms: i64,
) -> Result<bool, sqlx::Error> {
    let (state, result) = match ending {
        Ok(result) => {
            (AnalysisState::Done, Some(serde_json::to_string(result).map_err(undecodable)?))
        }
        Err(_) => (AnalysisState::Failed, None),
    };
    sqlx::query(
        "UPDATE analysis SET state = $2, ended_at_ms = $3, message = $4, result = $5 \
         WHERE sequence = $1 AND state = 'running' AND attempts = $6",
    )
    .bind(job.sequence)
    .bind(state.word())
    .bind(now_ms)
    .bind(ending.as_ref().err())
    .bind(result)
    .bind(job.attempt)
    .execute(db)
    .await
    .map(|updated| updated.rows_affected() > 0)
}

/// Puts an analysis that is being made back into the queue, as if it had not been begun.
///
/// # Errors
/// If the database cannot be written.
pub async fn give_back(db: &mut Db, job: &Job) -> Result<(), sqlx::Error> {
    sqlx::query(
        "UPDATE analysis SET state = 'queued', attempts = attempts - 1, started_at_ms = NULL \
         WHERE sequence = $1 AND state = 'running' AND attempts = $2",
    )
    .bind(job.sequence)
    .bind(job.attempt)
    .execute(db)
    .await
    .map(drop)
}

/// Cells that were kept under this key for a study, as they were given.
///
/// # Errors
/// If the database cannot be read.
pub async fn cells(db: &mut Db, study_id: i64, key: &str) -> Result<Option<Vec<u8>>, sqlx::Error> {
    sqlx::query_scalar("SELECT octets FROM analysis_cell WHERE study_id = $1 AND key = $2")
        .bind(study_id)
        .bind(key)
        .fetch_optional(db)
        .await
}

/// Keeps cells for the analyses to come, unless this one is not wanted any more: they may come
/// from data that were withdrawn.
///
/// # Errors
/// If the database cannot be written.
pub async fn put_cells(
    db: &mut Db,
    job: &Job,
    key: &str,
    octets: &[u8],
) -> Result<(), sqlx::Error> {
    sqlx::query(
        "INSERT INTO analysis_cell (study_id, key, octets) \
         SELECT study_id, $2, $3 FROM analysis \
         WHERE sequence = $1 AND state = 'running' AND attempts = $4 \
         ON CONFLICT (study_id, key) DO NOTHING",
    )
    .bind(job.sequence)
    .bind(key)
    .bind(octets)
    .bind(job.attempt)
    .execute(db)
    .await
    .map(drop)
}

/// Forgets the study's cells under other keys than these.
///
/// # Errors
/// If the database cannot be written.
pub async fn keep_cells_only(
    db: &mut Db,
    study_id: i64,
    used: &HashSet<String>,
) -> Result<(), sqlx::Error> {
    let keys: Vec<String> = sqlx::query_scalar("SELECT key FROM analysis_cell WHERE study_id = $1")
        .bind(study_id)
        .fetch_all(&mut *db)
        .await?;
    for key in keys.iter().filter(|key| !used.contains(*key)) {
        sqlx::query("DELETE FROM analysis_cell WHERE study_id = $1 AND key = $2")
            .bind(study_id)
            .bind(key)
            .execute(&mut *db)
            .await?;
    }
    Ok(())
}
