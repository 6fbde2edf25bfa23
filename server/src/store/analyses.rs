//! Analyses: the queue, their files, and cells that later analyses reuse.

use super::audit::{self, NewEntry};
use super::lanes::Lock;
use super::sql::{Connection, OptionalExtension, Row, params};
use super::{Store, StoreError};
use sidestep::api::{AnalysisFile, AnalysisResult, AnalysisState};
use sidestep::comparison::Request;
use std::collections::HashSet;
use std::sync::Arc;

/// Maximum number of queued analyses.
pub const LONGEST_QUEUE: i64 = 100;

/// An analysis fails after this many interrupted attempts, because it seems to crash the server.
const MOST_ATTEMPTS: i64 = 3;

/// Lease of an analysis (ms). If the server that began the analysis records nothing for this long,
/// another server takes the analysis over.
const LEASE_MS: i64 = 60_000;

/// Bytes of a file per transaction.
const PART_BYTES: usize = 1 << 20;

/// An analysis without its files.
#[derive(Clone, Debug)]
pub struct StoredAnalysis {
    /// Sequence number of the analysis, in the order of requests. It is never used twice.
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
    /// Number of pieces that were computed for this analysis, not reused from an earlier one.
    pub fresh: i64,
    /// When it was requested.
    pub created_at_ms: i64,
    /// When it began.
    pub started_at_ms: Option<i64>,
    /// When it ended.
    pub ended_at_ms: Option<i64>,
    /// Why it failed.
    pub message: Option<String>,
    /// Summary of its result, once it is done.
    pub result: Option<AnalysisResult>,
    /// Whether the study's data have changed since it began.
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

/// An analysis that a worker is computing.
#[derive(Clone, Debug)]
pub struct Job {
    /// The [sequence number](StoredAnalysis::sequence) of the analysis.
    pub sequence: i64,
    /// Number of the attempt. When the analysis is begun again, earlier attempts are no longer wanted.
    pub attempt: i64,
    /// The id of the study's row.
    pub study_id: i64,
    /// The study's name.
    pub study: String,
    /// The request.
    pub request: Request,
}

impl Store {
    /// Appends an analysis to the queue, under `id` if it is new.
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

    /// Cancels an analysis that has not ended. Its worker will notice. Returns the analysis in its new state.
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

    /// Whether an analysis waits for a worker: it is queued, or, on a shared database, its lease has expired.
    pub async fn awaits_worker(&self, now_ms: i64) -> Result<bool, StoreError> {
        let is_shared = self.is_shared();
        self.read(move |db| {
            let waiting = format!(
                "SELECT EXISTS (SELECT 1 FROM analysis WHERE state = 'queued' \
                     OR state = 'running' AND $2 AND coalesce(lease_until_ms, 0) < {})",
                now(db)
            );
            Ok(db.query_row(&waiting, params![now_ms, is_shared], |row| row.get(0))?)
        })
        .await
    }

    /// Requeues analyses whose server stopped or lost the database. On a database of one server,
    /// these are all running analyses. On a shared database, these are the running analyses whose
    /// lease has expired. An analysis that was interrupted too often fails instead.
    pub async fn recover_analyses(&self, now_ms: i64) -> Result<(), StoreError> {
        let is_shared = self.is_shared();
        self.write_behind([Lock::Analyses], move |db| {
            let lost = format!(
                "state = 'running' AND (NOT $2 OR coalesce(lease_until_ms, 0) < {})",
                now(db)
            );
            db.execute(
                &format!(
                    "UPDATE analysis SET state = 'failed', ended_at_ms = $1, message = 'begun ' || \
                         attempts || ' times without coming to an end; see the server''s log' \
                     WHERE {lost} AND attempts >= $3"
                ),
                params![now_ms, is_shared, MOST_ATTEMPTS],
            )?;
            let again = format!("UPDATE analysis SET state = 'queued' WHERE {lost}");
            db.execute(&again, params![now_ms, is_shared])?;
            Ok(())
        })
        .await
    }

    /// Takes the oldest queued analysis for `worker`, a name of this server's run, and records the
    /// participants whose data it uses.
    pub async fn begin_analysis(
        &self,
        worker: &str,
        now_ms: i64,
    ) -> Result<Option<Job>, StoreError> {
        let worker = worker.to_owned();
        self.write_behind([Lock::Analyses], move |db| begin(db, &worker, now_ms)).await
    }

    /// Records the progress of a job: finished pieces, all pieces, and pieces that were computed
    /// instead of reused. Renews the lease. Returns whether the job is still wanted.
    pub async fn note_progress(
        &self,
        job: &Job,
        [done, of, fresh]: [usize; 3],
        now_ms: i64,
    ) -> Result<bool, StoreError> {
        let (sequence, attempt) = (job.sequence, job.attempt);
        self.write_behind([Lock::Analyses], move |db| {
            let updated = db
                .prepare_cached(
                    "UPDATE analysis SET done = $3, total = $4, fresh = $5 \
                     WHERE sequence = $1 AND state = 'running' AND attempts = $2",
                )?
                .execute(params![sequence, attempt, done as i64, of as i64, fresh as i64])?;
            renew(db, sequence, now_ms)?;
            Ok(updated > 0)
        })
        .await
    }

    /// Stores a file of a job that is still wanted. Each part of the file is stored in its own
    /// transaction. The parts become visible when the analysis is done. `size` is the size before
    /// compression (bytes). Returns whether the job is still wanted.
    pub async fn put_analysis_file(
        &self,
        job: &Job,
        name: &str,
        size: usize,
        bytes: Vec<u8>,
        now_ms: i64,
    ) -> Result<bool, StoreError> {
        let bytes = Arc::new(bytes);
        for (part, from) in (0i64..).zip((0..bytes.len()).step_by(PART_BYTES)) {
            let (sequence, attempt, name) = (job.sequence, job.attempt, name.to_owned());
            let bytes = Arc::clone(&bytes);
            let put = self.write_behind([Lock::Analyses], move |db| {
                let to = bytes.len().min(from + PART_BYTES);
                let inserted = db
                    .prepare_cached(
                        "INSERT INTO analysis_file (analysis, name, part, size, bytes) \
                         SELECT sequence, $3, $4, $5, $6 FROM analysis \
                         WHERE sequence = $1 AND state = 'running' AND attempts = $2",
                    )?
                    .execute(params![
                        sequence,
                        attempt,
                        name,
                        part,
                        size as i64,
                        &bytes[from..to]
                    ])?;
                renew(db, sequence, now_ms)?;
                Ok(inserted > 0)
            });
            if !put.await? {
                return Ok(false);
            }
        }
        Ok(true)
    }

    /// Ends an analysis that is still wanted, as done with a result, or as failed with a message.
    /// If it is done, the study's cells under keys other than `used` are deleted. If it failed, its
    /// files are deleted. Returns whether the analysis was wanted.
    pub async fn end_analysis(
        &self,
        job: &Job,
        ending: &Result<AnalysisResult, String>,
        used: HashSet<String>,
        now_ms: i64,
    ) -> Result<bool, StoreError> {
        let (sequence, attempt, study_id) = (job.sequence, job.attempt, job.study_id);
        let message = ending.as_ref().err().cloned();
        let result = ending.as_ref().ok().map(serde_json::to_string).transpose();
        let result = result.map_err(StoreError::corrupt)?;
        self.write_behind([Lock::Analyses], move |db| {
            let done = result.is_some();
            let state = if done { AnalysisState::Done } else { AnalysisState::Failed };
            let updated = db.execute(
                "UPDATE analysis SET state = $3, ended_at_ms = $4, message = $5, result = $6 \
                 WHERE sequence = $1 AND state = 'running' AND attempts = $2",
                params![sequence, attempt, state.word(), now_ms, message, result],
            )?;
            match (updated > 0, done) {
                (true, true) => keep_cells_only(db, study_id, &used)?,
                // Files that were written before the failure would never be visible.
                (true, false) => delete_files(db, sequence)?,
                (false, _) => (),
            }
            Ok(updated > 0)
        })
        .await
    }

    /// Requeues a running analysis as if it had never begun.
    pub async fn give_back_analysis(&self, job: &Job) -> Result<(), StoreError> {
        let (sequence, attempt) = (job.sequence, job.attempt);
        self.write_behind([Lock::Analyses], move |db| {
            db.execute(
                "UPDATE analysis SET state = 'queued', attempts = attempts - 1, \
                     started_at_ms = NULL \
                 WHERE sequence = $1 AND state = 'running' AND attempts = $2",
                [sequence, attempt],
            )?;
            Ok(())
        })
        .await
    }

    /// The stored cells of a study under this key.
    pub async fn cells(&self, study_id: i64, key: &str) -> Result<Option<Vec<u8>>, StoreError> {
        let key = key.to_owned();
        self.read(move |db| {
            let query = "SELECT octets FROM analysis_cell WHERE study_id = $1 AND key = $2";
            let mut statement = db.prepare_cached(query)?;
            Ok(statement.query_row(params![study_id, key], |row| row.get(0)).optional()?)
        })
        .await
    }

    /// Stores cells for later analyses. If the job is no longer wanted, nothing is stored, because
    /// its cells may contain withdrawn data.
    pub async fn put_cells(&self, job: &Job, key: &str, bytes: Vec<u8>) -> Result<(), StoreError> {
        let (sequence, attempt, key) = (job.sequence, job.attempt, key.to_owned());
        self.write_behind([Lock::Analyses], move |db| {
            db.prepare_cached(
                "INSERT INTO analysis_cell (study_id, key, octets) \
                 SELECT study_id, $3, $4 FROM analysis \
                 WHERE sequence = $1 AND state = 'running' AND attempts = $2 \
                 ON CONFLICT (study_id, key) DO NOTHING",
            )?
            .execute(params![sequence, attempt, key, bytes])?;
            Ok(())
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

fn delete_files(db: &Connection, sequence: i64) -> Result<(), StoreError> {
    db.execute("DELETE FROM analysis_file WHERE analysis = $1", [sequence])?;
    Ok(())
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

fn begin(db: &Connection, worker: &str, now_ms: i64) -> Result<Option<Job>, StoreError> {
    let take = format!(
        "UPDATE analysis SET state = 'running', attempts = attempts + 1, started_at_ms = $1, \
             done = 0, total = 0, fresh = 0, worker = $2 \
         WHERE sequence = (SELECT sequence FROM analysis WHERE state = 'queued' \
             ORDER BY sequence LIMIT 1 {}) \
         RETURNING sequence, attempts, study_id, request",
        db.choose("", "FOR UPDATE SKIP LOCKED")
    );
    let begun = db.query_row(&take, params![now_ms, worker], |row| {
        Ok((row.get(0)?, row.get(1)?, row.get(2)?, row.get::<_, String>(3)?))
    });
    let Some((sequence, attempt, study_id, request)) = begun.optional()? else {
        return Ok(None);
    };
    renew(db, sequence, now_ms)?;
    delete_files(db, sequence)?;
    for statement in [
        "DELETE FROM analysis_participant WHERE analysis = $1",
        "INSERT INTO analysis_participant (analysis, participant_id) \
         SELECT analysis.sequence, participant.id FROM analysis \
         JOIN participant ON participant.study_id = analysis.study_id \
         WHERE analysis.sequence = $1 AND EXISTS (SELECT 1 FROM trial \
             JOIN scene ON scene.trial_id = trial.trial_id \
             WHERE scene.participant_id = participant.id)",
    ] {
        db.execute(statement, [sequence])?;
    }
    let query = "SELECT slug FROM study WHERE id = $1";
    let study = db.query_row(query, [study_id], |row| row.get(0))?;
    let request = serde_json::from_str(&request).map_err(StoreError::corrupt)?;
    Ok(Some(Job { sequence, attempt, study_id, study, request }))
}

/// The current time (ms). If several servers share the database, this is the database's clock,
/// because the servers' clocks may differ. Otherwise it is $1.
fn now(db: &Connection) -> &'static str {
    db.choose("$1", "CAST(extract(epoch FROM clock_timestamp()) * 1000 AS BIGINT)")
}

/// Renews the lease of a running analysis.
fn renew(db: &Connection, sequence: i64, now_ms: i64) -> Result<(), StoreError> {
    let renew = format!(
        "UPDATE analysis SET lease_until_ms = {} + $2 WHERE sequence = $3 AND state = 'running'",
        now(db)
    );
    db.prepare_cached(&renew)?.execute([now_ms, LEASE_MS, sequence])?;
    Ok(())
}

fn keep_cells_only(
    db: &Connection,
    study_id: i64,
    used: &HashSet<String>,
) -> Result<(), StoreError> {
    let mut statement = db.prepare_cached("SELECT key FROM analysis_cell WHERE study_id = $1")?;
    let keys = statement.query_map([study_id], |row| row.get::<_, String>(0))?;
    let keys: Vec<_> = keys.collect::<Result<_, _>>()?;
    let mut delete =
        db.prepare_cached("DELETE FROM analysis_cell WHERE study_id = $1 AND key = $2")?;
    for key in keys.iter().filter(|key| !used.contains(*key)) {
        delete.execute(params![study_id, key])?;
    }
    Ok(())
}
