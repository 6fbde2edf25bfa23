//! Work on analyses: leases, progress, files, and cells (cached results that later analyses reuse).

use crate::store::lanes::Lock;
use crate::store::sql::{Connection, OptionalExtension, params};
use crate::store::{Store, StoreError};
use sidestep::api::{AnalysisResult, AnalysisState};
use sidestep::comparison::Request;
use std::collections::HashSet;
use std::sync::Arc;

/// An analysis fails after this many interrupted attempts, because it seems to crash the server.
const MOST_ATTEMPTS: i64 = 3;

/// Lease of an analysis (ms). If the server that began the analysis records nothing for this long,
/// another server takes the analysis over.
const LEASE_MS: i64 = 60_000;

/// Bytes of a file per transaction.
const PART_BYTES: usize = 1 << 20;

/// An analysis that a worker is computing.
#[derive(Clone, Debug)]
pub struct Job {
    /// The [sequence number](super::StoredAnalysis::sequence) of the analysis.
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
    /// Whether an analysis waits for a worker, because it is queued or, on a shared database, its lease
    /// has expired.
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

    /// Takes the oldest queued analysis for `worker`, the name of this run of the server, and records
    /// the participants whose data it uses.
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

    /// If an analysis is still wanted, ends it as done with a result, or as failed with a message.
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

pub(super) fn delete_files(db: &Connection, sequence: i64) -> Result<(), StoreError> {
    db.execute("DELETE FROM analysis_file WHERE analysis = $1", [sequence])?;
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

/// The SQL expression for the current time (ms). If several servers share the database, it is the
/// database's clock, because the servers' clocks can differ. Otherwise it is the parameter $1.
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
