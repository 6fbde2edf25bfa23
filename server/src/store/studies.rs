//! Studies and their configurations.
//!
//! A configuration is identified by the SHA-256 of its stored JSON. Only this file computes the
//! hash, when it stores new JSON. Other code reads the hash from the row. A configuration stored by
//! an earlier version keeps its hash, even if this version would write different JSON.

use super::audit::{self, NewEntry};
use super::lanes::Lock;
use super::sql::{self, Connection, OptionalExtension, Row, params};
use super::{Store, StoreError};
use sha2::{Digest, Sha256};
use sidestep::study::StudyConfig;
use std::sync::{Arc, PoisonError};

/// A study with the configuration of new participants.
#[derive(Clone, Debug)]
pub struct StoredStudy {
    /// The id of the study's row.
    pub id: i64,
    /// Name in URLs.
    pub slug: String,
    /// The configuration of new participants.
    pub config: Arc<StudyConfig>,
    /// The hash of this configuration in the database.
    pub config_hash: String,
}

/// One of the configurations that a study has had.
#[derive(Clone, Debug)]
pub struct StudyVersion {
    /// Its number within the study, from 1.
    pub number: u32,
    /// The hash of the configuration. If the configuration was stored with several statuses, this is
    /// its hash with the last status under which participants enrolled.
    pub hash: String,
    /// The configuration, with the last status that it had.
    pub config: Arc<StudyConfig>,
    /// The time since which new participants get the configuration (ms since 1970).
    pub since_ms: i64,
    /// Whether it came from the study file of a command.
    pub by_file: bool,
    /// Number of participants who enrolled under it, without pilots.
    pub participants: u64,
}

impl StudyVersion {
    /// Whether this configuration equals `config`, apart from the status.
    #[must_use]
    pub fn says(&self, config: &StudyConfig) -> bool {
        *self.config == StudyConfig { status: self.config.status, ..config.clone() }
    }

    /// Merges a later version that differs only in its status.
    fn take(&mut self, later: Self) {
        if self.participants == 0 || later.participants > 0 {
            self.hash = later.hash;
        }
        self.config = later.config;
        self.by_file |= later.by_file;
        self.participants += later.participants;
    }
}

/// The outcome of changing a study.
#[derive(Clone, Debug)]
pub enum ChangeStudy {
    /// The study now has the new configuration.
    Stored(StoredStudy),
    /// Another experimenter has changed the study. Nothing was stored.
    ChangedMeanwhile,
    /// There is no such study.
    Unknown,
}

impl Store {
    /// The study with this name.
    pub async fn study(&self, slug: &str) -> Result<Option<StoredStudy>, StoreError> {
        let slug = slug.to_owned();
        self.read(move |db| find(db, &slug)).await
    }

    /// The hash and stored JSON of each configuration under which participants and pilots of a
    /// study enrolled, and of the current configuration, ordered by hash.
    pub async fn configurations(&self, study_id: i64) -> Result<Vec<(String, String)>, StoreError> {
        self.read_long(move |db| {
            let mut statement = db.prepare_cached(
                "SELECT hash, json FROM study_config WHERE hash IN \
                     (SELECT config_hash FROM participant WHERE study_id = $1 \
                      UNION SELECT config_hash FROM study WHERE id = $1) \
                 ORDER BY hash",
            )?;
            let rows = statement.query_map([study_id], |row| Ok((row.get(0)?, row.get(1)?)))?;
            Ok(rows.collect::<Result<_, _>>()?)
        })
        .await
    }

    /// The configurations that new participants of a study have been given, oldest first. Opening
    /// and closing a study creates no version.
    pub async fn study_versions(&self, study_id: i64) -> Result<Vec<StudyVersion>, StoreError> {
        let store = self.clone();
        self.read(move |db| {
            let mut statement = db.prepare_cached(
                "SELECT config_hash, since_ms, by_file, \
                     (SELECT count(*) FROM participant WHERE study_id = version.study_id \
                      AND config_hash = version.config_hash AND pilot = FALSE) \
                 FROM study_version version WHERE study_id = $1 ORDER BY number",
            )?;
            let row = |row: &Row| -> Result<(String, i64, bool, i64), sql::Error> {
                Ok((row.get(0)?, row.get(1)?, row.get(2)?, row.get(3)?))
            };
            let rows: Vec<_> = statement.query_map([study_id], row)?.collect::<Result<_, _>>()?;
            let mut versions: Vec<StudyVersion> = Vec::new();
            for (i, &(ref hash, since_ms, by_file, enrolled)) in rows.iter().enumerate() {
                // If a configuration is used again, its participants are counted at its last version.
                let comes_back = rows[i + 1..].iter().any(|(later, ..)| later == hash);
                let new = StudyVersion {
                    number: versions.len() as u32 + 1,
                    hash: hash.clone(),
                    config: store.config_in(db, hash)?,
                    since_ms,
                    by_file,
                    participants: if comes_back { 0 } else { enrolled.unsigned_abs() },
                };
                match versions.last_mut().filter(|last| last.says(&new.config)) {
                    Some(last) => last.take(new),
                    None => versions.push(new),
                }
            }
            Ok(versions)
        })
        .await
    }

    /// The configuration with this hash.
    ///
    /// # Errors
    /// [`StoreError`], also if the configuration does not exist.
    pub async fn config(&self, hash: &str) -> Result<Arc<StudyConfig>, StoreError> {
        let (store, hash) = (self.clone(), hash.to_owned());
        self.read(move |db| store.config_in(db, &hash)).await
    }

    /// The configuration with this hash. The store parses each configuration once and caches it.
    pub(super) fn config_in(
        &self,
        db: &Connection,
        hash: &str,
    ) -> Result<Arc<StudyConfig>, StoreError> {
        let configs = &self.open.configs;
        if let Some(known) = configs.read().unwrap_or_else(PoisonError::into_inner).get(hash) {
            return Ok(Arc::clone(known));
        }
        let config = Arc::new(config(db, hash)?);
        let mut configs = configs.write().unwrap_or_else(PoisonError::into_inner);
        configs.insert(hash.to_owned(), Arc::clone(&config));
        Ok(config)
    }

    /// Creates a study from a study file, or gives an existing study this configuration for new
    /// participants. Enrolled participants keep their configuration.
    pub async fn put_study(
        &self,
        new: &StudyConfig,
        now_ms: i64,
    ) -> Result<StoredStudy, StoreError> {
        let new = Arc::new(new.clone());
        self.write([Lock::Studies], move |db| put(db, &new, now_ms, true)).await
    }

    /// Creates a study, with an audit entry. Returns `None` if the name is taken.
    ///
    /// # Errors
    /// [`StoreError::Revoked`] if the key was revoked.
    pub async fn make_study(
        &self,
        new: &StudyConfig,
        entry: NewEntry,
    ) -> Result<Option<StoredStudy>, StoreError> {
        let new = Arc::new(new.clone());
        self.write([Lock::Studies], move |db| {
            if find(db, &new.slug)?.is_some() {
                return Ok(None);
            }
            audit::add(db, &entry)?;
            put(db, &new, entry.at_ms, false).map(Some)
        })
        .await
    }

    /// Gives a study this configuration for new participants, with an audit entry, if its current
    /// configuration has the hash `base`.
    ///
    /// # Errors
    /// [`StoreError::Revoked`] if the key was revoked.
    pub async fn change_study(
        &self,
        new: &StudyConfig,
        base: String,
        entry: NewEntry,
    ) -> Result<ChangeStudy, StoreError> {
        let new = Arc::new(new.clone());
        self.write([Lock::Studies], move |db| {
            let Some(known) = find(db, &new.slug)? else { return Ok(ChangeStudy::Unknown) };
            if known.config_hash != base {
                return Ok(ChangeStudy::ChangedMeanwhile);
            }
            audit::add(db, &entry)?;
            put(db, &new, entry.at_ms, false).map(ChangeStudy::Stored)
        })
        .await
    }

    /// Whether a configuration that the study has had names robots.
    pub async fn has_named_robots(&self, slug: &str) -> Result<bool, StoreError> {
        let slug = slug.to_owned();
        self.read(move |db| {
            // In JSON, a text of the study cannot contain these characters, because its quotation
            // marks are escaped.
            let asked = "SELECT EXISTS (SELECT 1 FROM study \
                         JOIN study_version ON study_version.study_id = study.id \
                         JOIN study_config ON study_config.hash = study_version.config_hash \
                         WHERE slug = $1 AND json LIKE '%\"robots\":[%')";
            Ok(db.prepare_cached(asked)?.query_row([slug], |row| row.get(0))?)
        })
        .await
    }

    /// The names of all studies, oldest first.
    pub async fn slugs(&self) -> Result<Vec<String>, StoreError> {
        self.read(move |db| {
            let mut statement = db.prepare_cached("SELECT slug FROM study ORDER BY id")?;
            let slugs = statement.query_map([], |row| row.get(0))?;
            Ok(slugs.collect::<Result<_, _>>()?)
        })
        .await
    }
}

/// The study with this name.
pub(super) fn find(db: &Connection, slug: &str) -> Result<Option<StoredStudy>, StoreError> {
    let mut statement =
        db.prepare_cached("SELECT id, slug, config_hash FROM study WHERE slug = $1")?;
    let row =
        statement.query_row([slug], |row| Ok((row.get(0)?, row.get(1)?, row.get::<_, String>(2)?)));
    let Some((id, slug, config_hash)) = row.optional()? else { return Ok(None) };
    let config = Arc::new(config(db, &config_hash)?);
    Ok(Some(StoredStudy { id, slug, config, config_hash }))
}

/// The key of a configuration or a value function: SHA-256 of its content, in hexadecimal digits.
pub(super) fn key_of(content: &[u8]) -> String {
    hex::encode(Sha256::digest(content))
}

fn config(db: &Connection, hash: &str) -> Result<StudyConfig, StoreError> {
    let mut statement = db.prepare_cached("SELECT json FROM study_config WHERE hash = $1")?;
    let json: String = statement.query_row([hash], |row| row.get(0))?;
    let faulty = |error| StoreError::Corrupt(format!("configuration {hash}: {error}"));
    serde_json::from_str(&json).map_err(faulty)
}

/// Stores a configuration under the hash of its JSON, unless the study already has an equal
/// configuration.
pub(super) fn put(
    db: &Connection,
    new: &Arc<StudyConfig>,
    now_ms: i64,
    by_file: bool,
) -> Result<StoredStudy, StoreError> {
    // Compares values, because an earlier version may have written different JSON.
    if let Some(known) = find(db, &new.slug)?
        && known.config == *new
    {
        if by_file {
            // The version may come from the laboratory, or from a database that did not record its origin.
            db.execute(
                "UPDATE study_version SET by_file = TRUE WHERE study_id = $1 AND NOT by_file \
                     AND number = (SELECT max(number) FROM study_version WHERE study_id = $1)",
                [known.id],
            )?;
        }
        return Ok(known);
    }
    let json = serde_json::to_string(&**new).map_err(StoreError::corrupt)?;
    let hash = key_of(json.as_bytes());
    db.execute(
        "INSERT INTO study_config (hash, json) VALUES ($1, $2) ON CONFLICT (hash) DO NOTHING",
        params![hash, json],
    )?;
    let id = db.query_row(
        "INSERT INTO study (slug, config_hash, created_at_ms) VALUES ($1, $2, $3) \
         ON CONFLICT (slug) DO UPDATE SET config_hash = excluded.config_hash RETURNING id",
        params![new.slug, hash, now_ms],
        |row| row.get(0),
    )?;
    db.execute(
        "INSERT INTO study_version (study_id, number, config_hash, since_ms, by_file) \
         SELECT $1, 1 + coalesce(max(number), 0), $2, $3, $4 FROM study_version \
         WHERE study_id = $1",
        params![id, hash, now_ms, by_file],
    )?;
    Ok(StoredStudy { id, slug: new.slug.clone(), config: Arc::clone(new), config_hash: hash })
}
