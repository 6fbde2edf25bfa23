//! The audit trail: who exported, changed or deleted what.

use super::{Store, StoreError};
use rusqlite::{Connection, Row, params};
use sidestep::api::{Action, AuditEntry};

/// An entry to be written.
#[derive(Clone, Debug)]
pub struct NewEntry {
    /// The time.
    pub at_ms: i64,
    /// The name of the key.
    pub who: String,
    /// What was done.
    pub action: Action,
    /// The study, if it concerns one.
    pub study: Option<String>,
    /// To what, if the action does not say it.
    pub subject: Option<String>,
}

impl Store {
    /// Writes an entry about something that changes nothing in the database.
    pub async fn note(&self, entry: NewEntry) -> Result<(), StoreError> {
        self.write(move |db| add(db, &entry)).await
    }

    /// At most `limit` entries, newest first, from before `before`.
    pub async fn audit_page(&self, before: i64, limit: i64) -> Result<Vec<AuditEntry>, StoreError> {
        self.read_long(move |db| {
            let mut statement = db.prepare_cached(
                "SELECT sequence, at_ms, who, action, study, subject FROM audit \
                 WHERE sequence < ?1 ORDER BY sequence DESC LIMIT ?2",
            )?;
            statement.query_and_then([before, limit], entry_of)?.collect()
        })
        .await
    }
}

/// Writes an entry in the transaction of the change.
pub(super) fn add(db: &Connection, entry: &NewEntry) -> Result<(), StoreError> {
    let NewEntry { at_ms, who, action, study, subject } = entry;
    db.prepare_cached(
        "INSERT INTO audit (at_ms, who, action, study, subject) VALUES (?1, ?2, ?3, ?4, ?5)",
    )?
    .execute(params![at_ms, who, action.word(), study, subject])?;
    Ok(())
}

fn entry_of(row: &Row<'_>) -> Result<AuditEntry, StoreError> {
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
