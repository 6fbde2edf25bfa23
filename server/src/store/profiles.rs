//! A participant's complete record, with experimenters' notes and whether analyses use it.

use super::audit::{self, NewEntry};
use super::lanes::Lock;
use super::people::person;
use super::sql::{Connection, OptionalExtension, Row, params};
use super::trials::{StoredTrial, whole};
use super::{Store, StoreError};
use serde_json::Value;
use sidestep::api::{ExcludedBy, Note, ParticipantSummary};
use std::collections::{BTreeMap, HashMap};

/// A participant's complete record.
#[derive(Clone, Debug)]
pub struct Profile {
    /// The participant's entry in the list.
    pub summary: ParticipantSummary,
    /// The study's name.
    pub study: String,
    /// Hash of the configuration of their enrolment.
    pub config_hash: String,
    /// When they withdrew, if they have withdrawn.
    pub withdrawn_at_ms: Option<i64>,
    /// Whether their data were deleted.
    pub data_deleted: bool,
    /// Answers by the question's name.
    pub answers: BTreeMap<String, Value>,
    /// Recorded URL parameters.
    pub parameters: BTreeMap<String, String>,
    /// Who excluded them from analyses and why, if they are excluded.
    pub exclusion: Option<ExcludedBy>,
    /// Experimenters' notes, oldest first.
    pub notes: Vec<Note>,
    /// The trials in plan order.
    pub trials: Vec<StoredTrial>,
}

impl Store {
    /// The participant with this id.
    pub async fn profile(&self, id: &str) -> Result<Option<Profile>, StoreError> {
        let id = id.to_owned();
        self.read_long(move |db| profile(db, &id)).await
    }

    /// Adds a note about a participant. Returns `None` if there is no such participant.
    ///
    /// # Errors
    /// [`StoreError::Revoked`] if the key was revoked.
    pub async fn add_note(
        &self,
        id: &str,
        text: String,
        entry: NewEntry,
    ) -> Result<Option<Note>, StoreError> {
        let id = id.to_owned();
        self.write([Lock::Participant(id.clone())], move |db| {
            if !said(db, &id, &entry)? {
                return Ok(None);
            }
            let (at_ms, who) = (entry.at_ms, entry.who);
            let query = "INSERT INTO note (participant_id, text, at_ms, who) \
                         VALUES ($1, $2, $3, $4) RETURNING id";
            let id = db.query_row(query, params![id, text, at_ms, who], |row| row.get(0))?;
            Ok(Some(Note { id, text, at_ms, who }))
        })
        .await
    }

    /// Deletes a note. Returns whether it existed.
    ///
    /// # Errors
    /// [`StoreError::Revoked`] if the key was revoked.
    pub async fn delete_note(
        &self,
        id: &str,
        note: i64,
        entry: NewEntry,
    ) -> Result<bool, StoreError> {
        let id = id.to_owned();
        let deleted = self
            .write([Lock::Participant(id.clone())], move |db| {
                let delete = "DELETE FROM note WHERE id = $1 AND participant_id = $2";
                Ok(db.execute(delete, params![note, id])? > 0 && said(db, &id, &entry)?)
            })
            .await?;
        // A note may contain text that must not be recoverable.
        self.forget_deleted();
        Ok(deleted)
    }

    /// Excludes a participant from analyses for this reason, or includes them again if there is no
    /// reason. Returns whether the participant exists.
    ///
    /// # Errors
    /// [`StoreError::Revoked`] if the key was revoked.
    pub async fn exclude(
        &self,
        id: &str,
        reason: Option<String>,
        entry: NewEntry,
    ) -> Result<bool, StoreError> {
        let id = id.to_owned();
        self.write([Lock::Participant(id.clone())], move |db| {
            let present = exclusion(db, &id)?;
            // An identical exclusion changes nothing and keeps its date.
            if present.as_ref().map(|it| &it.reason) == reason.as_ref() {
                return Ok(number(db, &id)?.is_some());
            }
            if !said(db, &id, &entry)? {
                return Ok(false);
            }
            let end = "UPDATE exclusion SET ended_at_ms = $2 \
                       WHERE participant_id = $1 AND ended_at_ms IS NULL";
            db.execute(end, params![id, entry.at_ms])?;
            if let Some(reason) = reason {
                put_exclusion(db, &id, &reason, entry.at_ms, &entry.who)?;
            }
            Ok(true)
        })
        .await
    }

    /// The participants of a study who are excluded from analyses: id and reason.
    pub async fn exclusions(&self, study_id: i64) -> Result<HashMap<String, String>, StoreError> {
        self.read_long(move |db| {
            let mut statement = db.prepare_cached(
                "SELECT participant_id, reason FROM exclusion \
                 JOIN participant ON participant.id = participant_id \
                 WHERE study_id = $1 AND ended_at_ms IS NULL",
            )?;
            let rows = statement.query_map([study_id], |row| Ok((row.get(0)?, row.get(1)?)))?;
            Ok(rows.collect::<Result<_, _>>()?)
        })
        .await
    }
}

/// Excludes a participant who is not excluded.
pub(super) fn put_exclusion(
    db: &Connection,
    id: &str,
    reason: &str,
    at_ms: i64,
    who: &str,
) -> Result<(), StoreError> {
    let put = "INSERT INTO exclusion (participant_id, reason, at_ms, who) VALUES ($1, $2, $3, $4)";
    db.execute(put, params![id, reason, at_ms, who])?;
    Ok(())
}

/// Writes the audit entry about a participant, with study and number. Returns whether the participant exists.
fn said(db: &Connection, id: &str, entry: &NewEntry) -> Result<bool, StoreError> {
    let Some((study, number)) = number(db, id)? else { return Ok(false) };
    let (study, subject) = (Some(study), Some(number));
    audit::add(db, &NewEntry { study, subject, ..entry.clone() })?;
    Ok(true)
}

/// The study and number of a participant whose data have not been deleted.
fn number(db: &Connection, id: &str) -> Result<Option<(String, String)>, StoreError> {
    let mut statement = db.prepare_cached(
        "SELECT slug, CASE WHEN pilot THEN 'pilot ' ELSE '' END || number FROM participant \
         JOIN study ON study.id = study_id WHERE participant.id = $1 AND NOT data_deleted",
    )?;
    Ok(statement.query_row([id], |row| Ok((row.get(0)?, row.get(1)?))).optional()?)
}

fn exclusion(db: &Connection, id: &str) -> Result<Option<ExcludedBy>, StoreError> {
    let mut statement = db.prepare_cached(
        "SELECT reason, at_ms, who FROM exclusion \
         WHERE participant_id = $1 AND ended_at_ms IS NULL",
    )?;
    let found =
        |row: &Row| Ok(ExcludedBy { reason: row.get(0)?, at_ms: row.get(1)?, who: row.get(2)? });
    Ok(statement.query_row([id], found).optional()?)
}

fn profile(db: &Connection, id: &str) -> Result<Option<Profile>, StoreError> {
    let Some(summary) = person(db, id)? else { return Ok(None) };
    let mut statement = db.prepare_cached(
        "SELECT id, text, at_ms, who FROM note WHERE participant_id = $1 ORDER BY id",
    )?;
    let note = |row: &Row| {
        Ok(Note { id: row.get(0)?, text: row.get(1)?, at_ms: row.get(2)?, who: row.get(3)? })
    };
    let notes = statement.query_map([id], note)?.collect::<Result<_, _>>()?;
    let mut statement = db.prepare_cached(
        "SELECT slug, participant.config_hash, withdrawn_at_ms, data_deleted, answers, parameters \
         FROM participant JOIN study ON study.id = study_id WHERE participant.id = $1",
    )?;
    let profile = statement.query_row([id], |row| {
        let text = |at: usize| -> Result<String, StoreError> {
            Ok(row.get::<_, Option<String>>(at)?.unwrap_or_else(|| "{}".to_owned()))
        };
        Ok(Profile {
            summary,
            study: row.get(0)?,
            config_hash: row.get(1)?,
            withdrawn_at_ms: row.get(2)?,
            data_deleted: row.get(3)?,
            answers: serde_json::from_str(&text(4)?).map_err(StoreError::corrupt)?,
            parameters: serde_json::from_str(&text(5)?).map_err(StoreError::corrupt)?,
            exclusion: exclusion(db, id)?,
            notes,
            trials: whole(db, "participant_id", id)?,
        })
    });
    Ok(profile.optional()?)
}
