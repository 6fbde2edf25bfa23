//! Participants: enrolment, tokens, completion, withdrawal.

use super::scenes::{self, PlannedRow};
use super::{Store, StoreError, analyses};
use rusqlite::{Connection, OptionalExtension, Row, params};

/// A participant.
#[derive(Clone, Debug)]
pub struct Participant {
    /// Their id.
    pub id: String,
    /// The study's row.
    pub study_id: i64,
    /// Their number within the study, from 1.
    pub number: i64,
    /// Hash of the configuration of their enrolment.
    pub config_hash: String,
    /// The completion code, once every planned trial is stored.
    pub completion_code: Option<String>,
    /// When they withdrew, if they did.
    pub withdrawn_at_ms: Option<i64>,
}

impl Participant {
    /// Reads the columns id, `study_id`, number, `config_hash`, `completion_code` and
    /// `withdrawn_at_ms`.
    pub(super) fn of(row: &Row<'_>) -> rusqlite::Result<Self> {
        Ok(Self {
            id: row.get(0)?,
            study_id: row.get(1)?,
            number: row.get(2)?,
            config_hash: row.get(3)?,
            completion_code: row.get(4)?,
            withdrawn_at_ms: row.get(5)?,
        })
    }
}

/// How a participant who enrols may be known already.
#[derive(Clone, Debug, Default)]
pub struct Known {
    /// The recruiting service's id of the participant.
    pub external_id: Option<String>,
    /// Hash of the request's id, which the client drew.
    pub request_hash: Option<[u8; 32]>,
}

/// A participant who enrols.
#[derive(Clone, Debug)]
pub struct NewParticipant {
    /// Their id, if they are new.
    pub id: String,
    /// The study's row.
    pub study_id: i64,
    /// By what they may be recognised.
    pub known: Known,
    /// Hash of the configuration of their enrolment.
    pub config_hash: String,
    /// Seed of the scenes.
    pub seed: u64,
    /// Language.
    pub locale: Option<String>,
    /// The screen, as JSON.
    pub screen: Option<String>,
    /// Their scenes; none for a participant who is probably known.
    pub plan: Option<Vec<PlannedRow>>,
    /// The current time.
    pub enrolled_at_ms: i64,
}

/// The outcome of an enrolment. Its token is valid unless the participant has withdrawn.
#[derive(Clone, Debug)]
pub enum Enrolment {
    /// The participant is new.
    New,
    /// The participant enrolled before and keeps their plan.
    Known(Participant),
    /// The participant has withdrawn.
    Withdrawn,
    /// They are new and came without a plan; nothing was stored.
    Unplanned,
}

/// The outcome of a completion.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Completion {
    /// Every trial is stored; the code is that of the first completion.
    Complete {
        /// The code.
        code: String,
    },
    /// Trials are missing.
    Incomplete {
        /// Number of missing trials.
        missing: usize,
        /// Number of planned trials.
        of: usize,
    },
    /// The participant has withdrawn.
    Withdrawn,
}

const COLUMNS: &str =
    "participant.id, study_id, number, config_hash, completion_code, withdrawn_at_ms";

impl Store {
    /// The participant to whom the token with this hash belongs.
    pub async fn participant(
        &self,
        token_hash: [u8; 32],
    ) -> Result<Option<Participant>, StoreError> {
        self.read(|db| {
            let mut statement = db.prepare_cached(&format!(
                "SELECT {COLUMNS} FROM participant_token \
                 JOIN participant ON participant.id = participant_token.participant_id \
                 WHERE participant_token.hash = ?1"
            ))?;
            Ok(statement.query_row([token_hash], Participant::of).optional()?)
        })
    }

    /// Whether a participant who enrols is known and needs no plan. Only [`Store::enrol`] decides:
    /// until then the answer may change.
    pub async fn is_known(&self, study_id: i64, known: &Known) -> Result<bool, StoreError> {
        self.read(|db| Ok(find(db, study_id, known)?.is_some()))
    }

    /// Stores a participant with their plan, under the study's next number, or finds the known
    /// participant. Either way a token with that hash becomes valid, beside earlier tokens.
    ///
    /// # Errors
    /// [`StoreError`]; nothing was stored then.
    pub async fn enrol(
        &self,
        new: NewParticipant,
        token_hash: [u8; 32],
    ) -> Result<Enrolment, StoreError> {
        self.write(move |db| {
            if let Some(known) = find(db, new.study_id, &new.known)? {
                if known.withdrawn_at_ms.is_some() {
                    return Ok(Enrolment::Withdrawn);
                }
                add_token(db, &known.id, token_hash, new.enrolled_at_ms)?;
                return Ok(Enrolment::Known(known));
            }
            let Some(plan) = &new.plan else { return Ok(Enrolment::Unplanned) };
            insert(db, &new)?;
            for scene in plan {
                scenes::insert(db, &new.id, scene)?;
            }
            add_token(db, &new.id, token_hash, new.enrolled_at_ms)?;
            Ok(Enrolment::New)
        })
        .await
    }

    /// A participant's whole plan, in order.
    pub async fn plan(&self, participant_id: &str) -> Result<Vec<PlannedRow>, StoreError> {
        self.read(|db| scenes::plan(db, participant_id))
    }

    /// Completes a participation if no trial is missing.
    pub async fn complete(
        &self,
        participant_id: &str,
        code: String,
        now_ms: i64,
    ) -> Result<Completion, StoreError> {
        let id = participant_id.to_owned();
        self.write(move |db| {
            let (of, stored, withdrawn): (i64, i64, bool) = db.query_row(
                "SELECT (SELECT count(*) FROM scene WHERE participant_id = ?1), \
                     (SELECT count(*) FROM scene JOIN trial ON trial.trial_id = scene.trial_id \
                      WHERE participant_id = ?1), \
                     (SELECT withdrawn_at_ms IS NOT NULL FROM participant WHERE id = ?1)",
                [&id],
                |row| Ok((row.get(0)?, row.get(1)?, row.get(2)?)),
            )?;
            if withdrawn {
                return Ok(Completion::Withdrawn);
            }
            if stored < of {
                let [missing, of] = [of - stored, of].map(|n| n.unsigned_abs() as usize);
                return Ok(Completion::Incomplete { missing, of });
            }
            let code = db.query_row(
                "UPDATE participant SET completion_code = coalesce(completion_code, ?2), \
                     completed_at_ms = coalesce(completed_at_ms, ?3) WHERE id = ?1 \
                 RETURNING completion_code",
                params![id, code, now_ms],
                |row| row.get(0),
            )?;
            Ok(Completion::Complete { code })
        })
        .await
    }

    /// Stores a withdrawal; a second one changes nothing. With `delete`, the participant's trials and
    /// personal fields are deleted, with all results computed from them. Their number remains, so that
    /// counts stay true. Deleted rows are overwritten at once, and leave the write-ahead log as soon as
    /// no reader uses it.
    pub async fn withdraw(
        &self,
        participant_id: &str,
        delete: bool,
        now_ms: i64,
    ) -> Result<(), StoreError> {
        let id = participant_id.to_owned();
        self.write(move |db| {
            db.execute(
                "UPDATE participant SET withdrawn_at_ms = coalesce(withdrawn_at_ms, ?2) \
                 WHERE id = ?1",
                params![id, now_ms],
            )?;
            if !delete {
                return Ok(());
            }
            analyses::withdraw(db, &id)?;
            for statement in [
                "DELETE FROM trial WHERE trial_id IN \
                     (SELECT trial_id FROM scene WHERE participant_id = ?1)",
                "DELETE FROM scene WHERE participant_id = ?1",
                "UPDATE participant SET data_deleted = 1, external_id = NULL, locale = NULL, \
                     screen = NULL, seed = NULL, request_hash = NULL WHERE id = ?1",
            ] {
                db.execute(statement, [&id])?;
            }
            Ok(())
        })
        .await?;
        if delete {
            self.open.writer.empty_log();
        }
        Ok(())
    }

    /// The ids of a study's participants, in the order of their numbers.
    pub async fn participant_ids(&self, study_id: i64) -> Result<Vec<String>, StoreError> {
        self.read_long(move |db| {
            let query = "SELECT id FROM participant WHERE study_id = ?1 ORDER BY number";
            let mut statement = db.prepare_cached(query)?;
            Ok(statement.query_map([study_id], |row| row.get(0))?.collect::<Result<_, _>>()?)
        })
        .await
    }

    /// The numbers of participants and of trials in all studies.
    pub async fn counts(&self) -> Result<[i64; 2], StoreError> {
        self.read_long(|db| {
            let query = "SELECT (SELECT count(*) FROM participant), (SELECT count(*) FROM trial)";
            Ok(db.query_row(query, [], |row| Ok([row.get(0)?, row.get(1)?]))?)
        })
        .await
    }
}

fn find(db: &Connection, study_id: i64, known: &Known) -> Result<Option<Participant>, StoreError> {
    let by = |column: &str, value: &dyn rusqlite::ToSql| {
        let query =
            format!("SELECT {COLUMNS} FROM participant WHERE study_id = ?1 AND {column} = ?2");
        let mut statement = db.prepare_cached(&query)?;
        statement.query_row(params![study_id, value], Participant::of).optional()
    };
    if let Some(external_id) = &known.external_id
        && let Some(found) = by("external_id", external_id)?
    {
        return Ok(Some(found));
    }
    Ok(match &known.request_hash {
        Some(request_hash) => by("request_hash", request_hash)?,
        None => None,
    })
}

fn insert(db: &Connection, new: &NewParticipant) -> Result<(), StoreError> {
    db.prepare_cached(
        "INSERT INTO participant (id, study_id, number, external_id, request_hash, config_hash, \
             seed, locale, screen, enrolled_at_ms) \
         SELECT ?1, ?2, coalesce(max(number), 0) + 1, ?3, ?4, ?5, ?6, ?7, ?8, ?9 \
         FROM participant WHERE study_id = ?2",
    )?
    .execute(params![
        new.id,
        new.study_id,
        new.known.external_id,
        new.known.request_hash,
        new.config_hash,
        new.seed.cast_signed(),
        new.locale,
        new.screen,
        new.enrolled_at_ms,
    ])?;
    Ok(())
}

fn add_token(
    db: &Connection,
    participant_id: &str,
    token_hash: [u8; 32],
    now_ms: i64,
) -> Result<(), StoreError> {
    db.prepare_cached(
        "INSERT INTO participant_token (hash, participant_id, created_at_ms) VALUES (?1, ?2, ?3)",
    )?
    .execute(params![token_hash, participant_id, now_ms])?;
    Ok(())
}
