//! The experimenters' keys and sessions, stored only as hashes.

use super::audit::{self, NewEntry};
use super::lanes::Lock;
use super::sql::{Connection, OptionalExtension, Row, params};
use super::{Store, StoreError};
use sidestep::api::{Access, KeySummary};

/// A key.
#[derive(Clone, Debug)]
pub struct StoredKey {
    /// Its number.
    pub id: i64,
    /// Its name.
    pub name: String,
    /// Its access level.
    pub access: Access,
    /// Whether the server created it at its first start.
    pub is_first: bool,
    /// When it was last used, to the minute.
    pub last_used_at_ms: Option<i64>,
    /// Whether it was revoked.
    pub is_revoked: bool,
}

/// The owner of a session.
#[derive(Clone, Debug)]
pub enum Holder {
    /// The holder of a stored key.
    Key(StoredKey),
    /// The holder of the key in the environment variable.
    Environment,
}

/// The outcome of a revocation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Revocation {
    /// The key is revoked, now or earlier.
    Revoked,
    /// The key is the server's first key, which only a new first key replaces.
    First,
    /// There is no such key.
    Unknown,
}

/// The name of the key that the server creates at its first start.
const FIRST: &str = "first key";

/// The name of the key in the environment variable.
pub const ENVIRONMENT: &str = "SIDESTEP_ADMIN_KEY";

/// Names that experimenters cannot give to further keys.
const RESERVED: [&str; 2] = [FIRST, ENVIRONMENT];

/// The columns that [`StoredKey::of`] reads.
const COLUMNS: &str =
    "api_key.id, name, access, is_first, last_used_at_ms, revoked_at_ms IS NOT NULL";

impl StoredKey {
    fn of(row: &Row) -> Result<Self, StoreError> {
        Ok(Self {
            id: row.get(0)?,
            name: row.get(1)?,
            access: access_of(row.get(2)?)?,
            is_first: row.get(3)?,
            last_used_at_ms: row.get(4)?,
            is_revoked: row.get(5)?,
        })
    }
}

impl Store {
    /// The key with this hash, revoked or not.
    pub async fn key(&self, hash: [u8; 32]) -> Result<Option<StoredKey>, StoreError> {
        self.read(move |db| {
            let mut statement =
                db.prepare_cached(&format!("SELECT {COLUMNS} FROM api_key WHERE hash = $1"))?;
            statement.query_and_then([hash], StoredKey::of)?.next().transpose()
        })
        .await
    }

    /// Whether this key has not been revoked.
    ///
    /// # Errors
    /// [`StoreError`] if the database cannot be read.
    pub async fn is_valid_key(&self, id: i64) -> Result<bool, StoreError> {
        self.read(move |db| {
            let query = "SELECT 1 FROM api_key WHERE id = $1 AND revoked_at_ms IS NULL";
            Ok(db.prepare_cached(query)?.exists([id])?)
        })
        .await
    }

    /// All keys, oldest first, including revoked ones.
    pub async fn keys(&self) -> Result<Vec<KeySummary>, StoreError> {
        self.read(move |db| {
            let mut statement = db.prepare_cached(&format!("{SUMMARIES} ORDER BY id"))?;
            statement.query_and_then([], summary_of)?.collect()
        })
        .await
    }

    /// Stores the first key with this hash, unless a first key exists and `other` is false. The new key
    /// replaces the old one and ends every session, because an experimenter asks for a new key if the
    /// old key was lost or may have leaked. Returns whether the key was stored.
    pub async fn put_first_key(
        &self,
        hash: [u8; 32],
        other: bool,
        now_ms: i64,
    ) -> Result<bool, StoreError> {
        self.write([Lock::Keys], move |db| {
            let there =
                db.query_row("SELECT 1 FROM api_key WHERE is_first", [], |_| Ok(())).optional()?;
            if there.is_some() && !other {
                return Ok(false);
            }
            db.execute("DELETE FROM session", [])?;
            db.execute("DELETE FROM api_key WHERE is_first", [])?;
            insert(db, FIRST, hash, Access::Manage, true, now_ms)?;
            Ok(true)
        })
        .await
    }

    /// Stores a further key. Returns `None` if the name is reserved, or if another key has this name,
    /// even a revoked key.
    pub async fn add_key(
        &self,
        name: &str,
        hash: [u8; 32],
        access: Access,
        entry: NewEntry,
    ) -> Result<Option<KeySummary>, StoreError> {
        let name = name.to_owned();
        self.write([Lock::Keys], move |db| {
            let query = "SELECT 1 FROM api_key WHERE lower(name) = lower($1)";
            let is_reserved = RESERVED.iter().any(|other| name.eq_ignore_ascii_case(other));
            if is_reserved || db.prepare_cached(query)?.exists([&name])? {
                return Ok(None);
            }
            let id = insert(db, &name, hash, access, false, entry.at_ms)?;
            audit::add(db, &entry)?;
            summary(db, id)
        })
        .await
    }

    /// Revokes a key and ends its sessions. Idempotent.
    pub async fn revoke_key(&self, id: i64, mut entry: NewEntry) -> Result<Revocation, StoreError> {
        self.write([Lock::Keys], move |db| {
            let found: Option<(String, bool, bool)> = db
                .query_row(
                    "SELECT name, is_first, revoked_at_ms IS NOT NULL FROM api_key WHERE id = $1",
                    [id],
                    |row| Ok((row.get(0)?, row.get(1)?, row.get(2)?)),
                )
                .optional()?;
            match found {
                None => return Ok(Revocation::Unknown),
                Some((_, true, _)) => return Ok(Revocation::First),
                Some((_, _, true)) => return Ok(Revocation::Revoked),
                Some((name, ..)) => entry.subject = Some(name),
            }
            // The entry comes before the change, because a key can revoke itself.
            audit::add(db, &entry)?;
            let revoke = "UPDATE api_key SET revoked_at_ms = $2 WHERE id = $1";
            db.execute(revoke, params![id, entry.at_ms])?;
            db.execute("DELETE FROM session WHERE key_id = $1", [id])?;
            Ok(Revocation::Revoked)
        })
        .await
    }

    /// Records that a key is used now.
    pub async fn note_use(&self, id: i64, now_ms: i64) -> Result<(), StoreError> {
        self.write([], move |db| {
            let note = "UPDATE api_key SET last_used_at_ms = $2 WHERE id = $1";
            db.prepare_cached(note)?.execute([id, now_ms])?;
            Ok(())
        })
        .await
    }

    /// Begins a session of a key, or of the key in the environment variable, and deletes expired sessions.
    pub async fn add_session(
        &self,
        hash: [u8; 32],
        key_id: Option<i64>,
        expires_at_ms: i64,
        entry: NewEntry,
    ) -> Result<(), StoreError> {
        self.write([], move |db| {
            db.execute("DELETE FROM session WHERE expires_at_ms <= $1", [entry.at_ms])?;
            db.execute(
                "INSERT INTO session (hash, expires_at_ms, key_id) VALUES ($1, $2, $3)",
                params![hash, expires_at_ms, key_id],
            )?;
            audit::add(db, &entry)
        })
        .await
    }

    /// The owner of the session with this hash, unless it has expired.
    pub async fn session(&self, hash: [u8; 32], now_ms: i64) -> Result<Option<Holder>, StoreError> {
        self.read(move |db| {
            let mut statement = db.prepare_cached(&format!(
                "SELECT {COLUMNS} FROM session LEFT JOIN api_key ON api_key.id = session.key_id \
                 WHERE session.hash = $1 AND expires_at_ms > $2"
            ))?;
            let holder = |row: &Row| match row.get::<_, Option<i64>>(0)? {
                Some(_) => Ok(Holder::Key(StoredKey::of(row)?)),
                None => Ok(Holder::Environment),
            };
            statement.query_and_then(params![hash, now_ms], holder)?.next().transpose()
        })
        .await
    }

    /// Ends a session.
    pub async fn end_session(&self, hash: [u8; 32]) -> Result<(), StoreError> {
        self.write([], move |db| {
            db.execute("DELETE FROM session WHERE hash = $1", [hash])?;
            Ok(())
        })
        .await
    }
}

const SUMMARIES: &str =
    "SELECT id, name, access, created_at_ms, last_used_at_ms, revoked_at_ms FROM api_key";

fn insert(
    db: &Connection,
    name: &str,
    hash: [u8; 32],
    access: Access,
    is_first: bool,
    now_ms: i64,
) -> Result<i64, StoreError> {
    let query = "INSERT INTO api_key (name, hash, access, is_first, created_at_ms) \
                 VALUES ($1, $2, $3, $4, $5) RETURNING id";
    let new = params![name, hash, access.word(), is_first, now_ms];
    Ok(db.query_row(query, new, |row| row.get(0))?)
}

fn summary(db: &Connection, id: i64) -> Result<Option<KeySummary>, StoreError> {
    let mut statement = db.prepare_cached(&format!("{SUMMARIES} WHERE id = $1"))?;
    statement.query_and_then([id], summary_of)?.next().transpose()
}

fn summary_of(row: &Row) -> Result<KeySummary, StoreError> {
    Ok(KeySummary {
        id: row.get(0)?,
        name: row.get(1)?,
        access: access_of(row.get(2)?)?,
        created_at_ms: row.get(3)?,
        last_used_at_ms: row.get(4)?,
        revoked_at_ms: row.get(5)?,
    })
}

fn access_of(word: String) -> Result<Access, StoreError> {
    let access = Access::ALL.into_iter().find(|access| access.word() == word);
    access.ok_or_else(|| StoreError::unknown_word(&word))
}
