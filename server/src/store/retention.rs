//! Deletion of data that a retention rule no longer allows.

use super::audit::{self, NewEntry};
use super::lanes::Lock;
use super::sql::{OptionalExtension, params};
use super::{Store, StoreError, participants};

/// The data that a rule concerns. The rule applies to participants last seen before a given time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Concern {
    /// All data of every participant.
    Data,
    /// The data of participants who did not finish the study and were not imported.
    Unfinished,
    /// Data that identify a participant.
    Identity,
}

impl Concern {
    fn condition(self) -> &'static str {
        match self {
            Self::Data => "TRUE",
            Self::Unfinished => "completed_at_ms IS NULL AND import_hash IS NULL",
            Self::Identity => "(external_id IS NOT NULL OR parameters IS NOT NULL)",
        }
    }
}

/// A participant whose data are due for deletion.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Due {
    /// The participant.
    pub id: String,
    /// Their number in the study.
    pub number: i64,
    /// Whether they are a pilot. Pilots have their own numbers.
    pub pilot: bool,
}

/// The SQL condition for a participant whom a rule concerns and who was last seen before this time.
fn due(before: &str, concern: Concern) -> String {
    let concerns = concern.condition();
    format!("last_seen_at_ms < {before} AND data_deleted = FALSE AND {concerns}")
}

impl Store {
    /// The participants of a study whom a rule concerns and who were last seen before `before_ms`,
    /// ordered by number.
    pub async fn participants_due(
        &self,
        study_id: i64,
        concern: Concern,
        before_ms: i64,
    ) -> Result<Vec<Due>, StoreError> {
        self.read_long(move |db| {
            let query = format!(
                "SELECT id, number, pilot FROM participant WHERE study_id = $1 AND {} \
                 ORDER BY pilot, number",
                due("$2", concern)
            );
            let mut statement = db.prepare_cached(&query)?;
            let due = statement.query_map(params![study_id, before_ms], |row| {
                Ok(Due { id: row.get(0)?, number: row.get(1)?, pilot: row.get(2)? })
            })?;
            Ok(due.collect::<Result<_, _>>()?)
        })
        .await
    }

    /// The ids of a study's analyses that ended before `before_ms`, in order.
    pub async fn analyses_due(
        &self,
        study_id: i64,
        before_ms: i64,
    ) -> Result<Vec<String>, StoreError> {
        self.read_long(move |db| {
            let query = "SELECT id FROM analysis WHERE study_id = $1 AND ended_at_ms < $2 \
                         ORDER BY sequence";
            let mut statement = db.prepare_cached(query)?;
            let due = statement.query_map([study_id, before_ms], |row| row.get(0))?;
            Ok(due.collect::<Result<_, _>>()?)
        })
        .await
    }

    /// Number of audit entries older than `before_ms`.
    pub async fn audit_due(&self, before_ms: i64) -> Result<i64, StoreError> {
        self.read_long(move |db| {
            let query = "SELECT count(*) FROM audit WHERE at_ms < $1";
            Ok(db.query_row(query, [before_ms], |row| row.get(0))?)
        })
        .await
    }

    /// Deletes a participant's data that a rule concerns, unless the participant was seen at or
    /// after `before_ms`. Returns whether it deleted anything.
    ///
    /// After identifying data were deleted, participants can continue only in the browser in which
    /// they began. Their trials stay.
    pub async fn delete_due(
        &self,
        id: &str,
        concern: Concern,
        before_ms: i64,
        entry: NewEntry,
    ) -> Result<bool, StoreError> {
        let id = id.to_owned();
        let locks = [Lock::Analyses, Lock::Participant(id.clone())];
        let deleted = self.write(locks, move |db| {
            let query =
                format!("SELECT 1 FROM participant WHERE id = $1 AND {}", due("$2", concern));
            let still = db.prepare_cached(&query)?.query_row(params![id, before_ms], |_| Ok(()));
            if still.optional()?.is_none() {
                return Ok(false);
            }
            match concern {
                Concern::Data | Concern::Unfinished => {
                    participants::withdraw(db, &id, entry.at_ms)?;
                    participants::delete_data(db, &id)?;
                }
                Concern::Identity => {
                    let forget = "UPDATE participant SET external_id = NULL, external_key = NULL, \
                                  parameters = NULL WHERE id = $1";
                    db.execute(forget, [&id])?;
                }
            }
            audit::add(db, &entry)?;
            Ok(true)
        });
        let deleted = deleted.await?;
        if deleted {
            self.forget_deleted();
        }
        Ok(deleted)
    }

    /// Deletes audit entries older than `before_ms`, and adds an entry about the deletion. Returns
    /// the number of deleted entries.
    pub async fn shorten_audit(
        &self,
        before_ms: i64,
        mut entry: NewEntry,
    ) -> Result<usize, StoreError> {
        self.write([], move |db| {
            let deleted = db.execute("DELETE FROM audit WHERE at_ms < $1", [before_ms])?;
            entry.subject = Some(deleted.to_string());
            audit::add(db, &entry)?;
            Ok(deleted)
        })
        .await
    }
}
