//! The queue of analyses, and their results. The module `jobs` has the worker's operations.

mod jobs;

pub use self::jobs::Job;

use self::jobs::delete_files;
use super::audit::{self, NewEntry};
use super::lanes::Lock;
use super::sql::{Connection, OptionalExtension, Row, params};
use super::{Store, StoreError};
use sidestep::api::{AnalysisFile, AnalysisResult, AnalysisState};
use sidestep::comparison::Request;

/// Maximum number of queued analyses.
pub const LONGEST_QUEUE: i64 = 100;

/// An analysis without its files.
#[derive(Clone, Debug)]
pub struct StoredAnalysis {
    /// Sequence number of the analysis, in the order of requests. A number is never used twice.
    pub sequence: i64,
    /// Its id in URLs.
    pub id: String,
    /// The study's name.
    pub study: String,
    /// The request.
    pub request: Request,
    /// Its state.
    pub state: AnalysisState,
    /// Number of finished pieces of work.
    pub done: i64,
    /// Number of all pieces of work, or 0 until they are counted.
    pub of: i64,
    /// Number of pieces that were computed for this analysis, not reused from an earlier analysis.
    pub fresh: i64,
    /// When it was requested.
    pub created_at_ms: i64,
    /// When it began.
    pub started_at_ms: Option<i64>,
    /// When it ended.
    pub ended_at_ms: Option<i64>,
    /// The reason why it failed.
    pub message: Option<String>,
    /// Summary of its result, once it is done.
    pub result: Option<AnalysisResult>,
    /// Whether the study's data have changed since the analysis began.
    pub stale: bool,
}

/// The outcome of requesting an analysis.
#[derive(Clone, Debug)]
pub enum Asked {
    /// It is queued.
    New(Box<StoredAnalysis>),
    /// An identical request is already queued, and its result would be the same.
    Waiting(Box<StoredAnalysis>),
    /// [`LONGEST_QUEUE`] analyses are queued already.
    QueueFull,
}

impl Store {
    /// Appends an analysis with this `id` to the queue, unless an equivalent request is already queued.
    pub async fn ask_analysis(
        &self,
        id: String,
        study_id: i64,
        request: &Request,
        entry: NewEntry,
    ) -> Result<Asked, StoreError> {
        let request = serde_json::to_string(request).map_err(StoreError::corrupt)?;
        self.write([Lock::Analyses], move |db| {
            let waiting = db.query_row(
                "SELECT id FROM analysis \
                 WHERE study_id = $1 AND request = $2 AND state = 'queued'",
                params![study_id, request],
                |row| row.get::<_, String>(0),
            );
            if let Some(waiting) = waiting.optional()? {
                return Ok(Asked::Waiting(Box::new(known(db, &waiting)?)));
            }
            let query = "SELECT count(*) FROM analysis WHERE state = 'queued'";
            if db.query_row(query, [], |row| row.get::<_, i64>(0))? >= LONGEST_QUEUE {
                return Ok(Asked::QueueFull);
            }
            db.execute(
                "INSERT INTO analysis (id, study_id, request, state, created_at_ms) \
                 VALUES ($1, $2, $3, 'queued', $4)",
                params![id, study_id, request, entry.at_ms],
            )?;
            audit::add(db, &entry)?;
            Ok(Asked::New(Box::new(known(db, &id)?)))
        })
        .await
    }

    /// At most `limit` analyses of a study, newest first, with sequence numbers below `before`.
    pub async fn analyses_page(
        &self,
        study_id: i64,
        before: i64,
        limit: i64,
    ) -> Result<Vec<StoredAnalysis>, StoreError> {
        self.read_long(move |db| {
            let mut statement = db.prepare_cached(&format!(
                "{} WHERE analysis.study_id = $1 AND analysis.sequence < $2 \
                 ORDER BY analysis.sequence DESC LIMIT $3",
                select(db)
            ))?;
            statement.query_and_then(params![study_id, before, limit], stored_of)?.collect()
        })
        .await
    }

    /// The analysis with this id, and its files by name if it is done.
    pub async fn analysis(
        &self,
        id: &str,
    ) -> Result<Option<(StoredAnalysis, Vec<AnalysisFile>)>, StoreError> {
        let id = id.to_owned();
        self.read_long(move |db| {
            let Some(analysis) = find(db, &id)? else { return Ok(None) };
            let mut statement = db.prepare_cached(
                "SELECT name, size FROM analysis_file WHERE part = 0 AND analysis = \
                     (SELECT sequence FROM analysis WHERE id = $1 AND state = 'done') \
                 ORDER BY name",
            )?;
            let files = statement.query_map([&id], |row| {
                Ok(AnalysisFile { name: row.get(0)?, octets: row.get::<_, i64>(1)?.unsigned_abs() })
            })?;
            Ok(Some((analysis, files.collect::<Result<_, _>>()?)))
        })
        .await
    }

    /// One file of a finished analysis, compressed with gzip.
    pub async fn analysis_file(&self, id: &str, name: &str) -> Result<Option<Vec<u8>>, StoreError> {
        let (id, name) = (id.to_owned(), name.to_owned());
        self.read_long(move |db| {
            let mut statement = db.prepare_cached(
                "SELECT bytes FROM analysis_file WHERE name = $2 AND analysis = \
                     (SELECT sequence FROM analysis WHERE id = $1 AND state = 'done') \
                 ORDER BY part",
            )?;
            let parts = statement.query_map([id, name], |row| row.get::<_, Vec<u8>>(0))?;
            let parts: Vec<_> = parts.collect::<Result<_, _>>()?;
            Ok((!parts.is_empty()).then(|| parts.concat()))
        })
        .await
    }

    /// Cancels an analysis that has not ended. Its worker notices this when it next stores progress
    /// or a file. Returns the analysis in its new state.
    pub async fn cancel_analysis(
        &self,
        id: &str,
        entry: NewEntry,
    ) -> Result<Option<StoredAnalysis>, StoreError> {
        let id = id.to_owned();
        self.write([Lock::Analyses], move |db| {
            let cancelled = db.query_row(
                "UPDATE analysis SET state = 'cancelled', ended_at_ms = $2 \
                 WHERE id = $1 AND state IN ('queued', 'running') RETURNING sequence",
                params![id, entry.at_ms],
                |row| row.get(0),
            );
            if let Some(sequence) = cancelled.optional()? {
                delete_files(db, sequence)?;
                audit::add(db, &entry)?;
            }
            find(db, &id)
        })
        .await
    }

    /// Deletes an analysis with its files. Returns whether it existed.
    pub async fn delete_analysis(&self, id: &str, entry: NewEntry) -> Result<bool, StoreError> {
        let id = id.to_owned();
        self.write_behind([Lock::Analyses], move |db| {
            let deleted = db.execute("DELETE FROM analysis WHERE id = $1", [id])? > 0;
            if deleted {
                audit::add(db, &entry)?;
            }
            Ok(deleted)
        })
        .await
    }
}

/// The query whose columns [`stored_of`] reads. `PARAMETERS` stands for the study's parameters in
/// the dialect of the database.
const SELECT: &str = "SELECT analysis.sequence, analysis.id, study.slug, request, state, done, total, \
                          fresh, analysis.created_at_ms, started_at_ms, ended_at_ms, message, \
                          result, state = 'done' AND (started_at_ms < coalesce((SELECT received_at_ms \
                              FROM trial JOIN scene ON scene.trial_id = trial.trial_id \
                              JOIN participant ON participant.id = scene.participant_id \
                              WHERE trial.study_id = study.id AND phase = 'task' AND pilot = FALSE \
                              ORDER BY trial.sequence DESC LIMIT 1), 0) \
                          OR started_at_ms < coalesce((SELECT max(CASE WHEN ended_at_ms > at_ms \
                                  THEN ended_at_ms ELSE at_ms END) \
                              FROM exclusion JOIN participant ON participant.id = participant_id \
                              WHERE participant.study_id = study.id), 0) \
                          OR (SELECT PARAMETERS FROM study_config \
                              WHERE hash = study.config_hash) \
                             <> (SELECT PARAMETERS FROM study_version \
                                 JOIN study_config ON hash = study_version.config_hash \
                                 WHERE study_id = study.id AND since_ms <= started_at_ms \
                                 ORDER BY number DESC LIMIT 1)) AS stale \
                      FROM analysis JOIN study ON study.id = analysis.study_id";

fn select(db: &Connection) -> String {
    let parameters = db.choose(
        "json_extract(json, '$.parameters')",
        "CAST(CAST(json AS JSONB) -> 'parameters' AS TEXT)",
    );
    SELECT.replace("PARAMETERS", parameters)
}

fn stored_of(row: &Row) -> Result<StoredAnalysis, StoreError> {
    let (request, state): (String, String) = (row.get(3)?, row.get(4)?);
    let result: Option<String> = row.get(12)?;
    let result = result.as_deref().map(serde_json::from_str).transpose();
    let state = AnalysisState::from_word(&state).ok_or_else(|| StoreError::unknown_word(&state))?;
    Ok(StoredAnalysis {
        sequence: row.get(0)?,
        id: row.get(1)?,
        study: row.get(2)?,
        request: serde_json::from_str(&request).map_err(StoreError::corrupt)?,
        state,
        done: row.get(5)?,
        of: row.get(6)?,
        fresh: row.get(7)?,
        created_at_ms: row.get(8)?,
        started_at_ms: row.get(9)?,
        ended_at_ms: row.get(10)?,
        message: row.get(11)?,
        result: result.map_err(StoreError::corrupt)?,
        stale: row.get("stale")?,
    })
}

fn find(db: &Connection, id: &str) -> Result<Option<StoredAnalysis>, StoreError> {
    let mut statement = db.prepare_cached(&format!("{} WHERE analysis.id = $1", select(db)))?;
    statement.query_and_then([id], stored_of)?.next().transpose()
}

fn known(db: &Connection, id: &str) -> Result<StoredAnalysis, StoreError> {
    find(db, id)?.ok_or_else(|| StoreError::Defect("an analysis vanished".to_owned()))
}

/// Deletes the files and cells that were computed from a participant's data. Call this before
/// deleting the data. A running analysis restarts without the participant. Participants without
/// trials belong to no analysis.
pub(super) fn withdraw(db: &Connection, participant_id: &str) -> Result<(), StoreError> {
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
        db.execute(statement, [participant_id])?;
    }
    Ok(())
}

/// Removes a participant from all analyses, and returns these analyses.
pub(super) fn leave(db: &Connection, participant_id: &str) -> Result<Vec<i64>, StoreError> {
    let mut leave = db.prepare_cached(
        "DELETE FROM analysis_participant WHERE participant_id = $1 RETURNING analysis",
    )?;
    Ok(leave.query_map([participant_id], |row| row.get(0))?.collect::<Result<_, _>>()?)
}

/// Adds a participant to these analyses again.
pub(super) fn join(
    db: &Connection,
    participant_id: &str,
    analyses: &[i64],
) -> Result<(), StoreError> {
    let mut join = db.prepare_cached(
        "INSERT INTO analysis_participant (analysis, participant_id) VALUES ($1, $2)",
    )?;
    for analysis in analyses {
        join.execute(params![analysis, participant_id])?;
    }
    Ok(())
}
