//! Summaries of the studies of a database: their state, and the progress of their participants.

use super::sql::{self, Connection, Row, params};
use super::{Store, StoreError};
use serde::Deserialize;
use sidestep::api::StudySummary;
use sidestep::study::Status;

impl Store {
    /// Every study with its counts, oldest first, or only the study with the given name.
    pub async fn summaries(
        &self,
        slug: Option<String>,
        now_ms: i64,
    ) -> Result<Vec<StudySummary>, StoreError> {
        self.read_long(move |db| summaries(db, slug.as_deref(), now_ms)).await
    }

    /// Totals over all studies, pilots included.
    pub async fn counts(&self) -> Result<Counts, StoreError> {
        self.read_long(|db| {
            let query = "SELECT (SELECT count(*) FROM participant), (SELECT count(*) FROM trial), \
                 (SELECT CAST(sum(waiting) AS BIGINT) FROM tally \
                     WHERE NOT (complete OR withdrawn OR screened_out OR imported)), \
                 (SELECT count(*) FROM analysis WHERE state = 'queued'), \
                 (SELECT count(*) FROM analysis WHERE state = 'running')";
            Ok(db.query_row(query, [], |row| {
                Ok(Counts {
                    participants: row.get(0)?,
                    trials: row.get(1)?,
                    backlog: row.get::<_, Option<i64>>(2)?.unwrap_or(0),
                    queued: row.get(3)?,
                    running: row.get(4)?,
                })
            })?)
        })
        .await
    }
}

/// Totals over all studies.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counts {
    /// Participants, enrolled or imported.
    pub participants: i64,
    /// Stored trials.
    pub trials: i64,
    /// Trials that wait in participants' browsers, as last reported by them.
    pub backlog: i64,
    /// Queued analyses.
    pub queued: i64,
    /// Running analyses.
    pub running: i64,
}

/// A participant counts as active for this long after they were last seen (ms).
const ACTIVE_MS: i64 = 600_000;

/// The fields of a configuration that a list shows.
#[derive(Default, Deserialize)]
#[serde(default)]
struct Said {
    title: String,
    status: String,
    synthetic: bool,
}

fn summaries(
    db: &Connection,
    slug: Option<&str>,
    now_ms: i64,
) -> Result<Vec<StudySummary>, StoreError> {
    let mut statement = db.prepare_cached(
        "SELECT slug, json, participants, pilots, complete, active, doubtful, trials, last_seen_at_ms \
         FROM study JOIN study_config ON study_config.hash = study.config_hash \
         LEFT JOIN (SELECT study_id, count(*) FILTER (WHERE NOT pilot) AS participants, \
                 count(*) FILTER (WHERE pilot) AS pilots, \
                 count(*) FILTER (WHERE NOT pilot AND complete) AS complete, \
                 count(*) FILTER (WHERE NOT (pilot OR complete OR withdrawn OR screened_out \
                     OR imported) AND last_seen_at_ms >= $2) AS active, \
                 count(*) FILTER (WHERE NOT pilot AND doubtful) AS doubtful, \
                 CAST(sum(stored) FILTER (WHERE NOT pilot) AS BIGINT) AS trials, \
                 max(last_seen_at_ms) FILTER (WHERE NOT pilot) AS last_seen_at_ms \
             FROM tally GROUP BY study_id) AS counts ON counts.study_id = study.id \
         WHERE $1 IS NULL OR slug = $1 ORDER BY study.id",
    )?;
    let summary = |row: &Row| {
        let count = |name: &str| -> sql::Result<u64> {
            Ok(row.get::<_, Option<i64>>(name)?.unwrap_or(0).unsigned_abs())
        };
        // A study whose configuration cannot be read has no title and admits no participants. The
        // other studies are still shown.
        let config: Said = serde_json::from_str(&row.get::<_, String>("json")?).unwrap_or_default();
        let status = Status::ALL.into_iter().find(|status| status.word() == config.status);
        Ok(StudySummary {
            slug: row.get("slug")?,
            title: config.title,
            status: status.unwrap_or(Status::Closed),
            synthetic: config.synthetic,
            participants: count("participants")?,
            complete: count("complete")?,
            active: count("active")?,
            doubtful: count("doubtful")?,
            trials: count("trials")?,
            pilots: count("pilots")?,
            last_seen_at_ms: row.get("last_seen_at_ms")?,
        })
    };
    statement.query_and_then(params![slug, now_ms - ACTIVE_MS], summary)?.collect()
}
