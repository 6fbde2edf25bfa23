//! Checks the server's promise to a crowd: every acknowledged trial is stored exactly once, bit for
//! bit.

use super::person::Person;
use crate::Database;
use sidestep::api::TrialUpload;
use sidestep_server::support::bytes::{pack, pack_inputs, pack_states};
use std::collections::{HashMap, HashSet};

/// Result of a comparison with the database.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Comparison {
    /// Number of acknowledged trials, except trials of people who asked for deletion.
    pub acknowledged: usize,
    /// Number of trials that were acknowledged but are not stored.
    pub lost: usize,
    /// Number of acknowledged trials that are stored with different content.
    pub different: usize,
    /// Number of trials that are stored more than once.
    pub twice: usize,
    /// Number of trials that are stored although their deletion was acknowledged.
    pub undeleted: usize,
    /// Number of trials that are stored but were not acknowledged, because the server was killed or
    /// the person had left before the answer.
    pub unacknowledged: usize,
}

impl Comparison {
    /// Number of broken promises.
    #[must_use]
    pub fn broken(&self) -> usize {
        self.lost + self.different + self.twice + self.undeleted
    }
}

/// The columns of a trial that come from its upload. Their texts are equal in SQLite and
/// PostgreSQL.
const QUERY: &str = "SELECT trial.trial_id, scene.participant_id, trial.started_at_ms, trial.inputs, \
                     trial.states, trial.sampled_at_ms, trial.key_events, trial.display \
                     FROM trial JOIN scene ON scene.trial_id = trial.trial_id \
                     ORDER BY trial.sequence";

/// Compares every trial of these people with the database, column by column.
///
/// # Panics
/// If the database cannot be read.
pub async fn compare(people: &[Person], database: &Database) -> Comparison {
    let mut found = Comparison::default();
    let mut expected: HashMap<&str, (&Person, usize)> = HashMap::new();
    let mut seen: HashMap<String, u32> = HashMap::new();
    let deleted = |person: &Person| person.withdrawal.is_some_and(|w| w.delete && w.acknowledged);
    let spared = |person: &Person| person.withdrawal.is_none_or(|withdrawal| !withdrawal.delete);
    let gone = people.iter().filter(|person| deleted(person));
    let gone: HashSet<&str> = gone.map(|person| &person.id[..]).collect();
    for person in people.iter().filter(|person| spared(person)) {
        let trials = person.acknowledged().enumerate();
        expected.extend(trials.map(|(place, trial_id)| (trial_id, (person, place))));
    }
    found.acknowledged = expected.len();
    let compared = |row: &[&str]| {
        if gone.contains(row[1]) {
            found.undeleted += 1;
        }
        // The start time identifies a trial, because no two trials of the crowd start at the same
        // time.
        let times = seen.entry(row[2].to_owned()).or_default();
        *times += 1;
        found.twice += usize::from(*times == 2);
        match expected.remove(row[0]) {
            Some((person, place)) => {
                found.different += usize::from(!is_as_sent(row, &person.trial(place)));
            }
            None => found.unacknowledged += 1,
        }
    };
    database.each_row(QUERY, compared).await;
    found.lost = expected.len();
    found
}

/// Whether a row contains what the person sent.
fn is_as_sent(row: &[&str], sent: &TrialUpload) -> bool {
    let json = |value| serde_json::to_string(value).expect("JSON");
    let key_events = serde_json::to_string(&sent.key_events).expect("JSON");
    row[2] == sent.started_at_ms.to_string()
        && row[3] == hex::encode(pack_inputs(&sent.inputs))
        && row[4] == hex::encode(pack_states(&sent.states))
        && row[5] == hex::encode(pack(sent.sampled_at_ms.iter().copied()))
        && row[6] == key_events
        && row[7] == json(&sent.display)
}
