//! The participants of a study, with everything that is stored about them except their trials.

use super::sql::{OptionalExtension, Row, params};
use super::{Store, StoreError};
use serde::de::DeserializeOwned;
use serde_json::Value;
use std::collections::BTreeMap;

/// A participant of a study.
#[derive(Clone, Debug)]
pub struct RosterEntry {
    /// Their number within the study, from 1.
    pub number: i64,
    /// Their id.
    pub id: String,
    /// Their place in the study's design, if they have one.
    pub place: Option<i64>,
    /// The recruiting service's id, as received.
    pub external_id: Option<String>,
    /// Hash of the configuration of their enrolment.
    pub config_hash: String,
    /// Whether they were imported from a file.
    pub imported: bool,
    /// The language and hash of the consent text that they agreed to.
    pub consent: [Option<String>; 2],
    /// When they enrolled, were last seen, passed the comprehension check, were screened out,
    /// answered the questions, completed and withdrew (ms since 1970).
    pub times_ms: [Option<i64>; 7],
    /// How often they answered the comprehension check.
    pub comprehension_attempts: i64,
    /// The completion code, if they completed.
    pub completion_code: Option<String>,
    /// Whether their data were deleted.
    pub data_deleted: bool,
    /// Number of stored trials in each phase, in the order of
    /// [`Phase::ALL`](sidestep::trial::Phase::ALL). The trials were counted when they were stored.
    pub trials: [i64; 3],
    /// Recorded URL parameters.
    pub parameters: BTreeMap<String, String>,
    /// Answers by the question's name.
    pub answers: BTreeMap<String, Value>,
    /// When an experimenter excluded them (ms since 1970), and why. `None` if analyses use them.
    pub exclusion: Option<(i64, String)>,
}

impl Store {
    /// The participants of a study, ordered by number. With `pilots`, returns its pilot participants
    /// instead.
    pub async fn roster(
        &self,
        study_id: i64,
        pilots: bool,
    ) -> Result<Vec<RosterEntry>, StoreError> {
        self.read_long(move |db| {
            // Reads the table itself, because a damaged index may miss rows.
            let people = db.choose("participant NOT INDEXED", "participant");
            let mut statement = db.prepare_cached(&format!(
                "SELECT participant.number, participant.id, place, external_id, config_hash, import_hash IS NOT NULL, \
                     consent_language, consent_hash, enrolled_at_ms, participant.last_seen_at_ms, \
                     understood_at_ms, screened_out_at_ms, answered_at_ms, completed_at_ms, \
                     withdrawn_at_ms, participant.comprehension_attempts, completion_code, data_deleted, \
                     parameters, answers, exclusion.at_ms, exclusion.reason, \
                     familiarisation, practice, task \
                 FROM {people} LEFT JOIN exclusion \
                     ON exclusion.participant_id = participant.id AND ended_at_ms IS NULL \
                 LEFT JOIN tally ON tally.study_id = participant.study_id \
                     AND tally.pilot = participant.pilot AND tally.number = participant.number \
                 WHERE participant.study_id = $1 AND participant.pilot = $2 \
                 ORDER BY participant.number"
            ))?;
            let entry = |row: &Row| {
                let time = |i: usize| row.get::<_, Option<i64>>(8 + i);
                Ok(RosterEntry {
                    number: row.get(0)?,
                    id: row.get(1)?,
                    place: row.get(2)?,
                    external_id: row.get(3)?,
                    config_hash: row.get(4)?,
                    imported: row.get(5)?,
                    consent: [row.get(6)?, row.get(7)?],
                    times_ms: [
                        time(0)?,
                        time(1)?,
                        time(2)?,
                        time(3)?,
                        time(4)?,
                        time(5)?,
                        time(6)?,
                    ],
                    comprehension_attempts: row.get(15)?,
                    completion_code: row.get(16)?,
                    data_deleted: row.get(17)?,
                    trials: [row.get(22)?, row.get(23)?, row.get(24)?],
                    parameters: object(row, 18)?,
                    answers: object(row, 19)?,
                    exclusion: row.get::<_, Option<i64>>(20)?.zip(row.get(21)?),
                })
            };
            statement.query_and_then(params![study_id, pilots], entry)?.collect()
        })
        .await
    }

    /// Number of stored trials of a participant, as counted when they were stored. Returns `None` if
    /// the participant was deleted.
    pub async fn stored_trials(&self, participant_id: &str) -> Result<Option<i64>, StoreError> {
        let participant_id = participant_id.to_owned();
        self.read_long(move |db| {
            let query = "SELECT stored FROM tally WHERE participant_id = $1";
            let stored = db.prepare_cached(query)?.query_row([participant_id], |row| row.get(0));
            Ok(stored.optional()?)
        })
        .await
    }
}

/// Parses the JSON object in a column. It is empty if the column is NULL.
fn object<T: DeserializeOwned + Default>(row: &Row, at: usize) -> Result<T, StoreError> {
    let text: Option<String> = row.get(at)?;
    text.map_or(Ok(T::default()), |text| serde_json::from_str(&text).map_err(StoreError::corrupt))
}
