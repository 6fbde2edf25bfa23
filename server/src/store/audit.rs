//! The audit trail: who exported, changed or deleted what.

use super::sql::{Connection, Row, params};
use super::{Store, StoreError};
use sidestep::api::{Action, AuditEntry};

/// An entry to be written.
#[derive(Clone, Debug)]
pub struct NewEntry {
    /// The time.
    pub at_ms: i64,
    /// The key, or `None` for the key in the environment variable.
    pub key_id: Option<i64>,
    /// The name of the key.
    pub who: String,
    /// The action.
    pub action: Action,
    /// The study, if the action concerns a study.
    pub study: Option<String>,
    /// The object of the action, if the action does not imply it.
    pub subject: Option<String>,
}

impl Store {
    /// Writes an entry for an action that changes nothing in the database.
    ///
    /// # Errors
    /// [`StoreError::Revoked`] if the key was revoked.
    pub async fn note(&self, entry: NewEntry) -> Result<(), StoreError> {
        self.write([], move |db| add(db, &entry)).await
    }

    /// Records a refused request, at most once a minute for each key and route.
    pub async fn note_refusal(&self, entry: NewEntry) -> Result<(), StoreError> {
        const MINUTE_MS: i64 = 60_000;
        self.write([], move |db| {
            let lately = "SELECT 1 FROM audit WHERE action = 'refused' AND who = $1 AND subject = $2 \
                          AND at_ms > $3";
            let since_ms = entry.at_ms - MINUTE_MS;
            let params = params![entry.who, entry.subject, since_ms];
            if db.prepare_cached(lately)?.exists(params)? { Ok(()) } else { add(db, &entry) }
        })
        .await
    }

    /// At most `limit` entries, newest first, with sequence numbers below `before`.
    pub async fn audit_page(&self, before: i64, limit: i64) -> Result<Vec<AuditEntry>, StoreError> {
        self.read_long(move |db| {
            let mut statement = db.prepare_cached(
                "SELECT sequence, at_ms, who, action, study, subject FROM audit \
                 WHERE sequence < $1 ORDER BY sequence DESC LIMIT $2",
            )?;
            statement.query_and_then([before, limit], entry_of)?.collect()
        })
        .await
    }
}

/// Writes an entry in the transaction of the change. If the key was revoked since the request
/// began, nothing is changed.
pub(super) fn add(db: &Connection, entry: &NewEntry) -> Result<(), StoreError> {
    let NewEntry { at_ms, key_id, who, action, study, subject } = entry;
    if let Some(id) = key_id {
        let valid = "SELECT 1 FROM api_key WHERE id = $1 AND revoked_at_ms IS NULL";
        if !db.prepare_cached(valid)?.exists([id])? {
            return Err(StoreError::Revoked);
        }
    }
    db.prepare_cached(
        "INSERT INTO audit (at_ms, who, action, study, subject) VALUES ($1, $2, $3, $4, $5)",
    )?
    .execute(params![at_ms, who, action.word(), study, subject])?;
    Ok(())
}

fn entry_of(row: &Row) -> Result<AuditEntry, StoreError> {
    let word: String = row.get(3)?;
    let action = Action::ALL.into_iter().find(|action| action.word() == word);
    Ok(AuditEntry {
        sequence: row.get(0)?,
        at_ms: row.get(1)?,
        who: row.get(2)?,
        action: action.ok_or_else(|| StoreError::unknown_word(&word))?,
        study: row.get(4)?,
        subject: row.get(5)?,
    })
}
