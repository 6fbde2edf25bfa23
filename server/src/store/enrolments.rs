//! Enrolment: whether a participant is new or known, and which place of the study they get.
//!
//! A place (0, 1, 2, …) decides which scenes a participant drives, so that scenes are
//! counterbalanced across participants. A new participant gets the lowest free place. A place is
//! free if it was never taken, or if its holder withdrew or was screened out. If the study has a
//! quota, a participant who has not finished and has been away for the study's hold time no longer
//! counts for the quota. When all places of the quota are taken, the next new participant gets the
//! lowest place of a participant who is away.

use super::lanes::Lock;
use super::participants::{self, Participant, Scope, find};
use super::sql::{Connection, OptionalExtension, params};
use super::{Store, StoreError};

/// A request to enrol.
#[derive(Clone, Debug)]
pub struct NewParticipant {
    /// Their id, if they are new.
    pub id: String,
    /// The id of the study's row.
    pub study_id: i64,
    /// Hash of the request id that the client drew.
    pub request_hash: Option<[u8; 32]>,
    /// The recruiting service's id of the person, as received.
    pub external_id: Option<String>,
    /// The external id, normalised.
    pub external_key: Option<String>,
    /// For a pilot, a place drawn at random. Pilots hold no place of the study.
    pub pilot_place: Option<u32>,
    /// Hash of the configuration of their enrolment.
    pub config_hash: String,
    /// The language in which the participant read the consent text.
    pub locale: Option<String>,
    /// The screen, as JSON.
    pub screen: Option<String>,
    /// Recorded URL parameters, as JSON.
    pub parameters: Option<String>,
    /// Language and hash of the consent text that they agreed to.
    pub consent: Option<(String, String)>,
    /// When they enrol.
    pub enrolled_at_ms: i64,
}

/// Who may enrol now.
#[derive(Clone, Copy, Debug)]
pub struct Gate {
    /// Whether new participants are admitted. Pilots are always admitted.
    pub is_open: bool,
    /// Maximum number of participants, or 0 if it is unlimited.
    pub quota: u64,
    /// A participant who has not finished and was last seen before this time does not count for the quota.
    pub away_before_ms: i64,
}

/// The outcome of an enrolment.
#[derive(Clone, Debug)]
pub enum Enrolment {
    /// The participant is new. Their token is valid.
    New(Participant),
    /// The participant enrolled before. A token with this scope is valid.
    Known(Participant, Scope),
    /// The participant withdrew or was screened out.
    Over(Participant),
    /// The study admits no new participants.
    Closed,
    /// The quota is reached.
    Full,
}

impl Store {
    /// Stores a participant with the study's next number and a place, or finds the known
    /// participant. A token with this hash becomes valid in addition to earlier tokens. A new
    /// participant has no plan yet.
    ///
    /// # Errors
    /// On [`StoreError`], nothing was stored.
    pub async fn enrol(
        &self,
        new: NewParticipant,
        gate: Gate,
        token_hash: [u8; 32],
    ) -> Result<Enrolment, StoreError> {
        let locks = [Lock::Study(new.study_id)];
        self.write_enrolment(locks, move |db| enrol(db, &new, gate, token_hash)).await
    }

    /// The participant of a study with this normalised external id, if any.
    ///
    /// # Errors
    /// [`StoreError`].
    pub async fn known(
        &self,
        study_id: i64,
        external_key: String,
    ) -> Result<Option<Participant>, StoreError> {
        self.read(move |db| find(db, study_id, "external_key", &external_key)).await
    }

    /// The language of the consent text that a participant agreed to, if known.
    ///
    /// # Errors
    /// [`StoreError`].
    pub async fn agreed_language(
        &self,
        participant_id: &str,
    ) -> Result<Option<String>, StoreError> {
        let id = participant_id.to_owned();
        self.read(move |db| {
            let mut statement =
                db.prepare_cached("SELECT consent_language FROM participant WHERE id = $1")?;
            Ok(statement.query_row([id], |row| row.get(0)).optional()?.flatten())
        })
        .await
    }

    /// Whether the study's quota is reached.
    pub async fn is_full(&self, study_id: i64, gate: Gate) -> Result<bool, StoreError> {
        if gate.quota == 0 {
            return Ok(false);
        }
        self.read(move |db| Ok(active(db, study_id, gate.away_before_ms)? >= gate.quota)).await
    }
}

fn enrol(
    db: &Connection,
    new: &NewParticipant,
    gate: Gate,
    token_hash: [u8; 32],
) -> Result<Enrolment, StoreError> {
    // Only the browser that enrolled knows the request id, but anyone may know an external id.
    let known = match &new.request_hash {
        Some(hash) => find(db, new.study_id, "request_hash", hash)?.map(|it| (it, Scope::Full)),
        None => None,
    };
    let known = match (known, &new.external_key) {
        (None, Some(key)) => {
            find(db, new.study_id, "external_key", key)?.map(|it| (it, Scope::Continue))
        }
        (known, _) => known,
    };
    if let Some((participant, scope)) = known {
        if participant.withdrawn_at_ms.is_some() || participant.screened_out {
            return Ok(Enrolment::Over(participant));
        }
        add_token(db, &participant.id, token_hash, scope, new.enrolled_at_ms)?;
        participants::seen(db, &participant.id, new.enrolled_at_ms)?;
        return Ok(Enrolment::Known(participant, scope));
    }
    // Pilots may test a closed study, because they are not part of the data.
    if !gate.is_open && new.pilot_place.is_none() {
        return Ok(Enrolment::Closed);
    }
    let place = match new.pilot_place {
        Some(place) => i64::from(place),
        None => match take_place(db, new.study_id, gate)? {
            Some(place) => place,
            None => return Ok(Enrolment::Full),
        },
    };
    insert(db, new, place)?;
    add_token(db, &new.id, token_hash, Scope::Full, new.enrolled_at_ms)?;
    let participant = find(db, new.study_id, "id", &new.id)?;
    let lost = || StoreError::Defect("an enrolment left no row".to_owned());
    Ok(Enrolment::New(participant.ok_or_else(lost)?))
}

/// The place for a new participant. Returns `None` if the study is full.
fn take_place(db: &Connection, study_id: i64, gate: Gate) -> Result<Option<i64>, StoreError> {
    if gate.quota > 0 && active(db, study_id, gate.away_before_ms)? >= gate.quota {
        return Ok(None);
    }
    let free = lowest_free(db, study_id)?;
    if gate.quota == 0 || free.unsigned_abs() < gate.quota {
        return Ok(Some(free));
    }
    let given_up = db
        .prepare_cached(
            "UPDATE participant SET holds_place = FALSE WHERE id = \
                 (SELECT id FROM participant WHERE study_id = $1 AND holds_place \
                      AND completed_at_ms IS NULL AND last_seen_at_ms < $2 \
                  ORDER BY place LIMIT 1) \
                 AND completed_at_ms IS NULL AND last_seen_at_ms < $2 \
             RETURNING place",
        )?
        .query_row(params![study_id, gate.away_before_ms], |row| row.get(0))
        .optional()?;
    Ok(given_up.or(Some(free)))
}

fn lowest_free(db: &Connection, study_id: i64) -> Result<i64, StoreError> {
    let (held, after): (i64, i64) = db
        .prepare_cached(
            "SELECT count(*), coalesce(max(place) + 1, 0) FROM participant \
             WHERE study_id = $1 AND holds_place",
        )?
        .query_row([study_id], |row| Ok((row.get(0)?, row.get(1)?)))?;
    if held == after {
        return Ok(after);
    }
    let gap = db
        .prepare_cached(
            "SELECT min(candidate) FROM \
                 (SELECT 0 AS candidate UNION ALL \
                  SELECT place + 1 FROM participant WHERE study_id = $1 AND holds_place) AS candidates \
             WHERE NOT EXISTS (SELECT 1 FROM participant \
                 WHERE study_id = $1 AND holds_place AND place = candidate)",
        )?
        .query_row([study_id], |row| row.get(0))?;
    Ok(gap)
}

/// Number of participants who count for the quota: they have finished, or they were seen since
/// `away_before_ms`.
fn active(db: &Connection, study_id: i64, away_before_ms: i64) -> Result<u64, StoreError> {
    let count: i64 = db
        .prepare_cached(
            "SELECT count(*) FROM participant WHERE study_id = $1 AND pilot = FALSE \
                 AND import_hash IS NULL AND withdrawn_at_ms IS NULL \
                 AND screened_out_at_ms IS NULL \
                 AND (completed_at_ms IS NOT NULL OR last_seen_at_ms >= $2)",
        )?
        .query_row(params![study_id, away_before_ms], |row| row.get(0))?;
    Ok(count.unsigned_abs())
}

fn insert(db: &Connection, new: &NewParticipant, place: i64) -> Result<(), StoreError> {
    let pilot = new.pilot_place.is_some();
    let (language, consent) = new.consent.as_ref().map(|(tag, hash)| (tag, hash)).unzip();
    db.prepare_cached(
        "INSERT INTO participant (id, study_id, pilot, number, place, holds_place, external_id, \
             external_key, request_hash, config_hash, locale, screen, parameters, \
             consent_language, consent_hash, enrolled_at_ms, last_seen_at_ms) \
         SELECT $1, $2, $3, coalesce(max(number), 0) + 1, $4, NOT $3, $5, $6, $7, $8, $9, $10, $11, \
             $12, $13, $14, $14 \
         FROM participant WHERE study_id = $2 AND pilot = $3",
    )?
    .execute(params![
        new.id,
        new.study_id,
        pilot,
        place,
        new.external_id,
        new.external_key.as_ref().filter(|_| !pilot),
        new.request_hash,
        new.config_hash,
        new.locale,
        new.screen,
        new.parameters,
        language,
        consent,
        new.enrolled_at_ms,
    ])?;
    Ok(())
}

fn add_token(
    db: &Connection,
    participant_id: &str,
    token_hash: [u8; 32],
    scope: Scope,
    now_ms: i64,
) -> Result<(), StoreError> {
    db.prepare_cached(
        "INSERT INTO participant_token (hash, participant_id, created_at_ms, scope) \
         VALUES ($1, $2, $3, $4)",
    )?
    .execute(params![token_hash, participant_id, now_ms, scope.word()])?;
    Ok(())
}
