//! The studies of a database at a glance: their state, and how many people are how far.

use super::{Store, StoreError};
use rusqlite::{Connection, Row, named_params};
use sidestep::api::StudySummary;
use sidestep::study::Status;

impl Store {
    /// Every study with its counts, oldest first; only that of this name, if one is given.
    pub async fn summaries(
        &self,
        slug: Option<String>,
        now_ms: i64,
    ) -> Result<Vec<StudySummary>, StoreError> {
        self.read_long(move |db| summaries(db, slug.as_deref(), now_ms)).await
    }
}

/// How long after the last stored trial a participant counts as active, ms.
const ACTIVE_MS: i64 = 600_000;

fn summaries(
    db: &Connection,
    slug: Option<&str>,
    now_ms: i64,
) -> Result<Vec<StudySummary>, StoreError> {
    // A study whose configuration cannot be read has no title and takes nobody; the others are still
    // shown.
    let mut statement = db.prepare_cached(
        "SELECT slug, coalesce(iif(json_valid(json), json ->> '$.title', NULL), '') AS title, \
             coalesce(iif(json_valid(json), json ->> '$.status', NULL), '') AS status, \
             coalesce(iif(json_valid(json), json ->> '$.synthetic', NULL), 0) AS synthetic, counts.* \
         FROM study JOIN study_config ON study_config.hash = study.config_hash \
         LEFT JOIN (SELECT study_id, sum(pilot = 0) AS participants, sum(pilot) AS pilots, \
                 sum(pilot = 0 AND complete) AS complete, \
                 sum(pilot = 0 AND NOT (complete OR withdrawn OR screened_out OR imported) \
                     AND last_seen_at_ms >= :active_since) AS active, \
                 sum(pilot = 0 AND doubtful) AS doubtful, \
                 sum(iif(pilot = 0, stored, 0)) AS trials, \
                 max(iif(pilot = 0, last_seen_at_ms, NULL)) AS last_seen_at_ms \
             FROM tally GROUP BY study_id) AS counts ON counts.study_id = study.id \
         WHERE :slug IS NULL OR slug = :slug ORDER BY study.id",
    )?;
    let chosen = named_params! { ":slug": slug, ":active_since": now_ms - ACTIVE_MS };
    let summary = |row: &Row<'_>| {
        let count = |name: &str| -> rusqlite::Result<u64> {
            Ok(row.get::<_, Option<i64>>(name)?.unwrap_or(0).unsigned_abs())
        };
        let word: String = row.get("status")?;
        let status = Status::ALL.into_iter().find(|status| status.word() == word);
        Ok(StudySummary {
            slug: row.get("slug")?,
            title: row.get("title")?,
            status: status.unwrap_or(Status::Closed),
            synthetic: row.get("synthetic")?,
            participants: count("participants")?,
            complete: count("complete")?,
            active: count("active")?,
            doubtful: count("doubtful")?,
            trials: count("trials")?,
            pilots: count("pilots")?,
            last_seen_at_ms: row.get("last_seen_at_ms")?,
        })
    };
    statement.query_and_then(chosen, summary)?.collect()
}
