//! A participant, and the holder of a participant's token.

use crate::store::sql::{self, Row};
use crate::store::{Store, StoreError};

/// A participant.
#[derive(Clone, Debug)]
pub struct Participant {
    /// Their id.
    pub id: String,
    /// The id of the study's row.
    pub study_id: i64,
    /// Their number within the study, from 1.
    pub number: i64,
    /// Hash of the configuration of their enrolment.
    pub config_hash: String,
    /// Whether this is a pilot.
    pub pilot: bool,
    /// Their place in the study's design, or `None` for imported participants and old enrolments.
    pub place: Option<i64>,
    /// The recruiting service's id of the participant, as received.
    pub external_id: Option<String>,
    /// Whether they passed the comprehension check.
    pub understood: bool,
    /// How often they answered the comprehension check.
    pub comprehension_attempts: u32,
    /// Whether they answered the questions after the last scene.
    pub answered: bool,
    /// Whether the comprehension check ended their participation.
    pub screened_out: bool,
    /// The completion code, once every planned trial is stored.
    pub completion_code: Option<String>,
    /// When they withdrew, if they have withdrawn.
    pub withdrawn_at_ms: Option<i64>,
    /// When they were last seen.
    pub last_seen_at_ms: i64,
}

/// The columns that [`Participant::of`] reads.
pub(in crate::store) const COLUMNS: &str = "participant.id, participant.study_id, number, \
    participant.config_hash, pilot, place, external_id, understood_at_ms IS NOT NULL, \
    answered_at_ms IS NOT NULL, screened_out_at_ms IS NOT NULL, completion_code, withdrawn_at_ms, \
    comprehension_attempts, participant.last_seen_at_ms";

impl Participant {
    /// Reads the columns [`COLUMNS`].
    pub(in crate::store) fn of(row: &Row) -> sql::Result<Self> {
        Ok(Self {
            id: row.get(0)?,
            study_id: row.get(1)?,
            number: row.get(2)?,
            config_hash: row.get(3)?,
            pilot: row.get(4)?,
            place: row.get(5)?,
            external_id: row.get(6)?,
            understood: row.get(7)?,
            answered: row.get(8)?,
            screened_out: row.get(9)?,
            completion_code: row.get(10)?,
            withdrawn_at_ms: row.get(11)?,
            comprehension_attempts: row.get(12)?,
            last_seen_at_ms: row.get(13)?,
        })
    }
}

/// Permissions of a token.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Scope {
    /// Permits everything. The token belongs to the browser that enrolled.
    Full,
    /// Permits only to continue the study. The token was given to a client that knew only the external
    /// id.
    Continue,
}

impl Scope {
    /// The word in the database.
    pub(in crate::store) fn word(self) -> &'static str {
        match self {
            Self::Full => "full",
            Self::Continue => "continue",
        }
    }
}

/// The holder of a token.
#[derive(Clone, Debug)]
pub struct Visitor {
    /// The participant.
    pub participant: Participant,
    /// Hash of the token.
    pub token_hash: [u8; 32],
    /// Permissions of the token.
    pub scope: Scope,
    /// Whether the participation was completed with this token.
    pub completed: bool,
    /// Hash of the study's current configuration.
    pub present_config_hash: String,
    /// How often the holder of a [`Scope::Continue`] token answered the comprehension check.
    pub check_attempts: u32,
}

/// The columns that [`Visitor::of`] reads after [`COLUMNS`], of the tables `participant_token` and
/// `study`.
pub(in crate::store) const TOKEN: &str =
    "participant_token.hash, scope, participant_token.completed, study.config_hash, check_attempts";

impl Visitor {
    /// The number of columns that [`Self::of`] reads.
    pub(in crate::store) const WIDTH: usize = 19;

    /// Reads the columns [`COLUMNS`] and [`TOKEN`].
    pub(in crate::store) fn of(row: &Row) -> Result<Self, StoreError> {
        let scope: String = row.get(15)?;
        let scopes = [Scope::Full, Scope::Continue];
        let known = scopes.into_iter().find(|known| known.word() == scope);
        Ok(Self {
            participant: Participant::of(row)?,
            token_hash: row.get(14)?,
            scope: known.ok_or_else(|| StoreError::unknown_word(&scope))?,
            completed: row.get(16)?,
            present_config_hash: row.get(17)?,
            check_attempts: row.get(18)?,
        })
    }

    /// How often the holder answered the comprehension check.
    #[must_use]
    pub fn attempts(&self) -> u32 {
        match self.scope {
            Scope::Full => self.participant.comprehension_attempts,
            Scope::Continue => self.check_attempts,
        }
    }

    /// Whether the holder may see the completion code. A client that knows only the external id
    /// does not see a code that was given to another client.
    #[must_use]
    pub fn may_see_code(&self) -> bool {
        self.scope == Scope::Full || self.completed
    }
}

impl Store {
    /// The holder of the token with this hash.
    pub async fn visitor(&self, token_hash: [u8; 32]) -> Result<Option<Visitor>, StoreError> {
        self.read(move |db| {
            let mut statement = db.prepare_cached(&format!(
                "SELECT {COLUMNS}, {TOKEN} FROM participant_token \
                 JOIN participant ON participant.id = participant_token.participant_id \
                 JOIN study ON study.id = participant.study_id \
                 WHERE participant_token.hash = $1"
            ))?;
            let mut found = statement.query_and_then([token_hash], Visitor::of)?;
            found.next().transpose()
        })
        .await
    }
}
