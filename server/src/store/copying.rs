//! Copies studies from one database to another, to move between SQLite and PostgreSQL, or to back
//! up a PostgreSQL database as a file.
//!
//! Each participant is copied in one transaction with everything stored about them, so an
//! interrupted copy can resume. If the destination already has the participant, the hashes of all
//! their rows in both databases are compared. If they differ, the participant is copied again,
//! unless the destination's copy is newer. Rows keep their ids, and trials keep their order. The
//! models and files of analyses are copied. The cached cells of analyses are not copied, because
//! they can be recomputed.

mod columns;
mod rows;
pub mod salvage;

use super::analyses;
use super::lanes::Lock;
use super::sql::{Connection, OptionalExtension, Value, params};
use super::{Store, StoreError};
use columns::{ANALYSIS_TABLES, PARTICIPANT_TABLES, Table};
use rows::{Rows, insert, read};
use sha2::{Digest, Sha256};
use std::collections::BTreeMap;

/// A study without its participants and analyses.
#[derive(Clone, Debug)]
pub struct StudyCopy {
    /// Its name.
    pub slug: String,
    /// The id of its row in the source database.
    pub study_id: i64,
    config_hash: String,
    created_at_ms: i64,
    /// Configurations by their hash.
    configs: Vec<(String, String)>,
    versions: Vec<(i64, String, i64, bool)>,
    /// The encoded value functions by id. `safety` has the configuration and evader of each function.
    functions: BTreeMap<String, Vec<u8>>,
    safety: Vec<(String, String, String)>,
    /// The highest number of any of its trials.
    last_trial: i64,
}

impl StudyCopy {
    /// Whether it has value functions.
    #[must_use]
    pub fn has_functions(&self) -> bool {
        !self.safety.is_empty()
    }

    /// The study without its value functions.
    #[must_use]
    pub fn without_functions(self) -> Self {
        Self { functions: BTreeMap::new(), safety: Vec::new(), ..self }
    }
}

/// A participant or an analysis with all rows.
#[derive(Clone, Debug)]
pub struct RowsCopy {
    /// The id.
    pub id: String,
    /// Rows of each table.
    tables: Vec<Rows>,
}

impl RowsCopy {
    /// SHA-256 of all rows.
    #[must_use]
    pub fn hash(&self) -> [u8; 32] {
        let mut hasher = Sha256::new();
        for rows in &self.tables {
            rows.hash(&mut hasher);
        }
        hasher.finalize().into()
    }

    /// Whether this copy of a participant is newer than the other copy. It is newer if the participant
    /// was seen later, or if only this copy's data were deleted. It is also newer if it has more trials
    /// and the other copy's data were not deleted.
    fn is_ahead_of(&self, other: &Self) -> bool {
        let [here, there] = [self, other].map(|copy| copy.number("last_seen_at_ms"));
        let has_more = self.trials() > other.trials() && !other.is_deleted();
        here > there || (self.is_deleted() && !other.is_deleted()) || has_more
    }

    fn is_deleted(&self) -> bool {
        self.number("data_deleted") == Some(1)
    }

    /// An integer from the participant's own row.
    fn number(&self, column: &str) -> Option<i64> {
        let first = PARTICIPANT_TABLES.iter().zip(&self.tables).next();
        first.and_then(|(table, rows)| rows.number(table, column))
    }

    /// The hash of a participant's configuration.
    fn config_hash(&mut self) -> Option<&mut Value<'static>> {
        let (table, rows) = PARTICIPANT_TABLES.iter().zip(&mut self.tables).next()?;
        rows.value_mut(table, "config_hash")
    }

    /// The keys of a participant's rows in a table.
    fn keys(&self, table: &str) -> impl Iterator<Item = &str> {
        let of =
            PARTICIPANT_TABLES.iter().zip(&self.tables).filter(move |(it, _)| it.name == table);
        of.flat_map(|(_, rows)| rows.keys())
    }

    /// Number of trials.
    #[must_use]
    pub fn trials(&self) -> usize {
        let of =
            |(table, rows): (&Table, &Rows)| if table.name == "trial" { rows.len() } else { 0 };
        PARTICIPANT_TABLES.iter().zip(&self.tables).map(of).sum()
    }
}

/// The destination of a copied study.
#[derive(Clone, Copy, Debug)]
pub struct CopyTarget {
    study_id: i64,
    /// Offset that is added to the number of each trial.
    shift: i64,
}

/// The reason why a study is not copied.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum CopyRefusal {
    /// Another study has this name.
    OtherStudy,
}

/// The outcome of copying a participant.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PutCopy {
    /// The participant was stored.
    Stored,
    /// The destination already has the same data of the participant.
    Present,
    /// The destination has newer data than the copy, and keeps them.
    Ahead,
}

impl Store {
    /// A study without its participants and analyses.
    pub async fn study_copy(&self, slug: &str) -> Result<Option<StudyCopy>, StoreError> {
        let slug = slug.to_owned();
        self.read_long(move |db| study_copy(db, &slug)).await
    }

    /// The ids of all participants of a study, including pilots, and of its analyses, each in order.
    pub async fn copied_ids(&self, study_id: i64) -> Result<[Vec<String>; 2], StoreError> {
        self.read_long(move |db| {
            let ids = |query: &str| -> Result<Vec<String>, StoreError> {
                let mut statement = db.prepare_cached(query)?;
                Ok(statement.query_map([study_id], |row| row.get(0))?.collect::<Result<_, _>>()?)
            };
            Ok([
                ids("SELECT id FROM participant WHERE study_id = $1 ORDER BY pilot, number")?,
                ids("SELECT id FROM analysis WHERE study_id = $1 ORDER BY sequence")?,
            ])
        })
        .await
    }

    /// Creates a study at the destination, or finds the study that an earlier copy began.
    pub async fn begin_copy(
        &self,
        copy: StudyCopy,
    ) -> Result<Result<CopyTarget, CopyRefusal>, StoreError> {
        self.write_behind([Lock::Studies], move |db| begin(db, &copy)).await
    }

    /// A participant with all rows.
    pub async fn participant_copy(&self, id: &str) -> Result<Option<RowsCopy>, StoreError> {
        let id = id.to_owned();
        self.read_long(move |db| rows_copy(db, PARTICIPANT_TABLES, &id)).await
    }

    /// An analysis with all rows.
    pub async fn analysis_copy(&self, id: &str) -> Result<Option<RowsCopy>, StoreError> {
        let id = id.to_owned();
        self.read_long(move |db| rows_copy(db, ANALYSIS_TABLES, &id)).await
    }

    /// Stores a participant with all rows. An earlier copy that differs is replaced, unless it has
    /// newer data.
    pub async fn put_participant_copy(
        &self,
        target: CopyTarget,
        copy: RowsCopy,
    ) -> Result<PutCopy, StoreError> {
        let locks = [Lock::Studies, Lock::Study(target.study_id), Lock::Analyses];
        self.write_behind(locks, move |db| {
            if let Some(known) = rows_copy(db, PARTICIPANT_TABLES, &copy.id)? {
                if known.hash() == copy.hash() {
                    return Ok(PutCopy::Present);
                }
                if known.is_ahead_of(&copy) {
                    return Ok(PutCopy::Ahead);
                }
                if copy.is_deleted() && !known.is_deleted() {
                    analyses::withdraw(db, &copy.id)?;
                }
            }
            // The rows of the participant are replaced, so the participant is removed from the
            // analyses here and added again below.
            let analyses = analyses::leave(db, &copy.id)?;
            for table in PARTICIPANT_TABLES.iter().rev() {
                db.execute(&table.delete(), [&copy.id])?;
            }
            for (table, rows) in PARTICIPANT_TABLES.iter().zip(&copy.tables) {
                insert(db, table, rows, target.study_id, target.shift)?;
            }
            analyses::join(db, &copy.id, &analyses)?;
            Ok(PutCopy::Stored)
        })
        .await
    }

    /// Stores an analysis with all rows, unless it exists. A running analysis is stored as queued.
    /// Returns whether it was stored.
    pub async fn put_analysis_copy(
        &self,
        target: CopyTarget,
        copy: RowsCopy,
    ) -> Result<bool, StoreError> {
        self.write_behind([Lock::Analyses], move |db| {
            let known = "SELECT sequence FROM analysis WHERE id = $1";
            if db.query_row(known, [&copy.id], |row| row.get::<_, i64>(0)).optional()?.is_some() {
                return Ok(false);
            }
            let mut sequence = target.study_id;
            for (table, rows) in ANALYSIS_TABLES.iter().zip(&copy.tables) {
                insert(db, table, rows, sequence, 0)?;
                if table.name == "analysis" {
                    sequence = db.query_row(known, [&copy.id], |row| row.get(0))?;
                }
            }
            db.execute(
                "UPDATE analysis SET state = 'queued', worker = NULL, lease_until_ms = NULL \
                 WHERE sequence = $1 AND state = 'running'",
                [sequence],
            )?;
            Ok(true)
        })
        .await
    }

    /// The experimenters' keys and the audit trail, for a copy of a whole database.
    pub async fn access_copy(&self) -> Result<RowsCopy, StoreError> {
        self.read_long(|db| {
            let tables = columns::ACCESS_TABLES.iter().map(|table| read(db, table, None));
            Ok(RowsCopy { id: String::new(), tables: tables.collect::<Result<_, _>>()? })
        })
        .await
    }

    /// Stores the keys and the audit trail, if the database has no keys. Returns whether they were
    /// stored.
    pub async fn put_access_copy(&self, copy: RowsCopy) -> Result<bool, StoreError> {
        self.write_behind([Lock::Keys], move |db| {
            let is_empty: bool =
                db.query_row("SELECT NOT EXISTS (SELECT 1 FROM api_key)", [], |row| row.get(0))?;
            if !is_empty {
                return Ok(false);
            }
            for (table, rows) in columns::ACCESS_TABLES.iter().zip(&copy.tables) {
                insert(db, table, rows, 0, 0)?;
                columns::never_use_again(db, table.name)?;
            }
            Ok(true)
        })
        .await
    }
}

fn study_copy(db: &Connection, slug: &str) -> Result<Option<StudyCopy>, StoreError> {
    let query = "SELECT id, config_hash, created_at_ms FROM study WHERE slug = $1";
    let found = db.query_row(query, [slug], |row| {
        Ok((row.get::<_, i64>(0)?, row.get::<_, String>(1)?, row.get::<_, i64>(2)?))
    });
    let Some((study_id, config_hash, created_at_ms)) = found.optional()? else { return Ok(None) };
    let versions = versions(db, study_id)?;
    const CONFIGS: &str = "SELECT config_hash FROM study WHERE id = $1 \
                           UNION SELECT config_hash FROM participant WHERE study_id = $1 \
                           UNION SELECT config_hash FROM study_version WHERE study_id = $1";
    let configs = db
        .prepare_cached(&format!(
            "SELECT hash, json FROM study_config WHERE hash IN ({CONFIGS}) ORDER BY hash"
        ))?
        .query_map([study_id], |row| Ok((row.get(0)?, row.get(1)?)))?
        .collect::<Result<_, _>>()?;
    let safety: Vec<(String, String, String)> = db
        .prepare_cached(&format!(
            "SELECT config_hash, evader, value_function_id FROM safety_function \
             WHERE config_hash IN ({CONFIGS}) ORDER BY config_hash, evader"
        ))?
        .query_map([study_id], |row| Ok((row.get(0)?, row.get(1)?, row.get(2)?)))?
        .collect::<Result<_, _>>()?;
    let mut functions = BTreeMap::new();
    for (.., id) in &safety {
        let query = "SELECT octets FROM value_function WHERE id = $1";
        functions.insert(id.clone(), db.query_row(query, [id], |row| row.get(0))?);
    }
    let last = "SELECT coalesce(max(sequence), 0) FROM trial WHERE study_id = $1";
    let last_trial = db.query_row(last, [study_id], |row| row.get(0))?;
    let slug = slug.to_owned();
    Ok(Some(StudyCopy {
        slug,
        study_id,
        config_hash,
        created_at_ms,
        configs,
        versions,
        functions,
        safety,
        last_trial,
    }))
}

/// Number, configuration, time and origin of each version of a study.
fn versions(db: &Connection, study_id: i64) -> Result<Vec<(i64, String, i64, bool)>, StoreError> {
    let query = "SELECT number, config_hash, since_ms, by_file FROM study_version \
                 WHERE study_id = $1 ORDER BY number";
    let mut statement = db.prepare_cached(query)?;
    let rows = statement
        .query_map([study_id], |row| Ok((row.get(0)?, row.get(1)?, row.get(2)?, row.get(3)?)))?;
    Ok(rows.collect::<Result<_, _>>()?)
}

fn begin(db: &Connection, copy: &StudyCopy) -> Result<Result<CopyTarget, CopyRefusal>, StoreError> {
    let known =
        db.query_row("SELECT id, created_at_ms FROM study WHERE slug = $1", [&copy.slug], |row| {
            Ok((row.get::<_, i64>(0)?, row.get::<_, i64>(1)?))
        });
    let known = known.optional()?;
    if known.is_some_and(|(_, created_at_ms)| created_at_ms != copy.created_at_ms) {
        return Ok(Err(CopyRefusal::OtherStudy));
    }
    for (hash, json) in &copy.configs {
        db.execute(
            "INSERT INTO study_config (hash, json) VALUES ($1, $2) ON CONFLICT (hash) DO NOTHING",
            [hash, json],
        )?;
    }
    let study_id = match known {
        Some((id, _)) => {
            let update = "UPDATE study SET config_hash = $2 WHERE id = $1";
            db.execute(update, params![id, copy.config_hash])?;
            id
        }
        None => db.query_row(
            "INSERT INTO study (slug, config_hash, created_at_ms) VALUES ($1, $2, $3) RETURNING id",
            params![copy.slug, copy.config_hash, copy.created_at_ms],
            |row| row.get(0),
        )?,
    };
    for (number, hash, since_ms, by_file) in &copy.versions {
        db.execute(
            "INSERT INTO study_version (study_id, number, config_hash, since_ms, by_file) \
             VALUES ($1, $2, $3, $4, $5) ON CONFLICT (study_id, number) DO NOTHING",
            params![study_id, number, hash, since_ms, by_file],
        )?;
    }
    for (id, bytes) in &copy.functions {
        db.execute(
            "INSERT INTO value_function (id, octets) VALUES ($1, $2) ON CONFLICT (id) DO NOTHING",
            params![id, bytes],
        )?;
    }
    for (hash, evader, id) in &copy.safety {
        db.execute(
            "INSERT INTO safety_function (config_hash, evader, value_function_id) \
             VALUES ($1, $2, $3) ON CONFLICT (config_hash, evader) DO NOTHING",
            [hash, evader, id],
        )?;
    }
    Ok(Ok(CopyTarget { study_id, shift: shift(db, study_id, copy.last_trial)? }))
}

/// The offset for the numbers of copied trials, so that no number is used twice. It is 0 in a
/// database without trials of other studies. The numbers are reserved immediately, so trials that
/// arrive during the copy get higher numbers.
fn shift(db: &Connection, study_id: i64, last_trial: i64) -> Result<i64, StoreError> {
    let others = "SELECT coalesce(max(sequence), 0) FROM trial WHERE study_id <> $1 \
                      AND sequence < (SELECT coalesce(min(sequence), 9223372036854775807) FROM trial \
                                      WHERE study_id = $1)";
    let shift = db.query_row(others, [study_id], |row| row.get(0))?;
    columns::take_numbers(db, "trial", shift + last_trial)?;
    Ok(shift)
}

fn rows_copy(
    db: &Connection,
    tables: &'static [Table],
    id: &str,
) -> Result<Option<RowsCopy>, StoreError> {
    let tables: Vec<Rows> =
        tables.iter().map(|table| read(db, table, Some(id))).collect::<Result<_, _>>()?;
    let exists = tables.first().is_some_and(|rows| rows.len() > 0);
    Ok(exists.then(|| RowsCopy { id: id.to_owned(), tables }))
}
