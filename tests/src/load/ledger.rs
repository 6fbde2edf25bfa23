//! Checks the promises to a crowd: every acknowledged trial is stored once, bit for bit.

use super::person::Person;
use crate::Database;
use sidestep::api::TrialUpload;
use sidestep_server::support::bytes::{pack, pack_inputs, pack_states};
use std::collections::{HashMap, HashSet};

/// Result of a comparison with the database.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Comparison {
    /// Acknowledged trials of people whose data should not be deleted.
    pub acknowledged: usize,
    /// Acknowledged but missing.
    pub lost: usize,
    /// Acknowledged but stored with another content.
    pub different: usize,
    /// Stored twice.
    pub twice: usize,
    /// Stored although their deletion was acknowledged.
    pub undeleted: usize,
    /// Stored without an acknowledgement: the server was killed, or the person gone, before it.
    pub unacknowledged: usize,
}

impl Comparison {
    /// Number of broken promises.
    #[must_use]
    pub fn broken(&self) -> usize {
        self.lost + self.different + self.twice + self.undeleted
    }
}

/// The columns of a trial that come from its upload; as text, they are the same in every database.
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
        // No other person's trial began at the same instant.
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

/// Whether a row contains what was sent.
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
