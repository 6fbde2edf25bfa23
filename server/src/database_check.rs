//! Checks whether a database is sound. Checks its file and its references, and replays every trial.

use crate::store::trials::{StoredTrial, Unreadable, flag_words};
use crate::store::{Store, StoreError};
use serde::{Deserialize, Serialize};
use sidestep::scene::{Scene, SceneParameters};
use sidestep::study::StudyConfig;
use sidestep::trial::{Flag, Outcome, outcome, outcome_of_straight_robot};
use std::sync::Arc;

/// The result of a check.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Report {
    /// Number of studies checked.
    pub studies: usize,
    /// Number of participants checked.
    pub participants: usize,
    /// Number of trials replayed.
    pub trials: usize,
    /// Number of trials with a flag other than `imported`. Such trials are not faulty.
    pub flagged: usize,
    /// Damaged pages, references to rows that do not exist, tallies (stored counts) that do not
    /// match the trials, altered configurations and value functions, and studies whose
    /// configuration cannot be read.
    pub damage: Vec<String>,
    /// Trials that cannot be read or that differ from the stored results.
    pub wrong: Vec<Wrong>,
}

impl Report {
    /// Returns the value. If it is damaged, adds a line to the report and returns an empty value,
    /// so that the check continues.
    fn read<T: Default>(
        &mut self,
        whose: &str,
        read: Result<T, StoreError>,
    ) -> Result<T, StoreError> {
        match read {
            Err(StoreError::Corrupt(what)) => {
                self.damage.push(format!("{whose}: {what}"));
                Ok(T::default())
            }
            read => read,
        }
    }

    /// Number of faults.
    #[must_use]
    pub fn faults(&self) -> usize {
        self.damage.len() + self.wrong.len()
    }

    /// The first fault, in words.
    #[must_use]
    pub fn first(&self) -> Option<String> {
        let wrong = || {
            let Wrong { trial_id, what } = self.wrong.first()?;
            Some(format!("trial {trial_id}: {what}"))
        };
        self.damage.first().cloned().or_else(wrong)
    }
}

/// A trial that cannot be read or that differs from the stored results.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Wrong {
    /// The trial.
    pub trial_id: String,
    /// The fault.
    pub what: String,
}

/// Checks the file, and replays every trial.
///
/// # Errors
/// [`StoreError`] if the database cannot be read.
pub async fn report(store: &Store) -> Result<Report, StoreError> {
    let damage = damage_of_database(store).await?;
    let mut report = Report { damage, ..Report::default() };
    for slug in report.read("the studies", store.slugs().await)? {
        report.studies += 1;
        let whole = format!("study {slug}");
        let Some(study) = report.read(&whole, store.study(&slug).await)? else { continue };
        let people = format!("{whole}: its participants cannot be listed");
        for id in report.read(&people, store.participant_ids(study.id, true).await)? {
            report.participants += 1;
            let trials = format!("{whole}, participant {id}: no trial can be read");
            for trial in report.read(&trials, examined(store, &id).await)? {
                let wrong = match trial {
                    Ok(Examined { trial, fault, .. }) => {
                        report.trials += 1;
                        report.flagged += usize::from(Flag::question(&trial.head.flags));
                        fault.map(|what| Wrong { trial_id: trial.head.trial_id, what })
                    }
                    Err(Wrong { trial_id, what }) => {
                        Some(Wrong { trial_id, what: format!("study {slug}: {what}") })
                    }
                };
                report.wrong.extend(wrong);
            }
        }
    }
    Ok(report)
}

/// Faults of a database outside its trials: damaged pages, references to rows that do not exist,
/// tallies (stored counts) that do not match the trials, and altered configurations or value
/// functions.
///
/// # Errors
/// [`StoreError`] if the database cannot be read.
pub async fn damage_of_database(store: &Store) -> Result<Vec<String>, StoreError> {
    let mut report = Report::default();
    let mut damage = report.read("the file", store.damage().await)?;
    let wrong = report.read("the tallies", store.wrong_tallies().await)?;
    let wrong_tally =
        |id| format!("participant {id}: the tally does not follow from what is stored");
    damage.extend(wrong.into_iter().map(wrong_tally));
    damage.extend(report.read("configurations and value functions", store.altered().await)?);
    damage.append(&mut report.damage);
    Ok(damage)
}

/// A trial that was read and replayed. It has a state before each step and after the last step. It
/// has either a sampling time for each step or no times.
#[derive(Clone, Debug)]
pub struct Examined {
    /// The trial.
    pub trial: StoredTrial,
    /// The configuration of the trial's participant.
    pub config: Arc<StudyConfig>,
    /// The trial's fault, if any.
    pub fault: Option<String>,
}

/// All trials of a participant, in plan order. Each trial is replayed. For a trial that cannot be read,
/// returns its id and the reason.
///
/// # Errors
/// [`StoreError`] if the ids of the trials cannot be read.
pub async fn examined(
    store: &Store,
    participant_id: &str,
) -> Result<Vec<Result<Examined, Wrong>>, StoreError> {
    let mut read = Vec::new();
    for trial in store.each_trial_of(participant_id).await? {
        read.push(match trial {
            Ok(trial) => match store.config(&trial.config_hash).await {
                Ok(config) => Ok((trial, config)),
                Err(StoreError::Corrupt(what)) => {
                    Err(Wrong { trial_id: trial.head.trial_id, what })
                }
                Err(error) => return Err(error),
            },
            Err(Unreadable { trial_id, what }) => Err(Wrong { trial_id, what }),
        });
    }
    let replay = |read: Result<_, Wrong>| {
        let (trial, config): (StoredTrial, Arc<StudyConfig>) = read?;
        is_whole(&trial)?;
        let fault = fault(&config.parameters, &trial);
        Ok(Examined { trial, config, fault })
    };
    // Replaying takes milliseconds, and must not delay the server's other requests.
    let replaying = move || read.into_iter().map(replay).collect();
    let replayed = tokio::task::spawn_blocking(replaying).await;
    replayed.map_err(|error| StoreError::Defect(error.to_string()))
}

/// Accepts a trial with a state before each step and after the last step, and with all sampling
/// times or none.
fn is_whole(trial: &StoredTrial) -> Result<(), Wrong> {
    let content = &trial.content;
    let steps = content.inputs.len();
    let times = content.sampled_at_ms.as_ref().map_or(steps, Vec::len);
    if content.states.len() == steps + 1 && times == steps {
        return Ok(());
    }
    let states = content.states.len();
    let what = format!(
        "expected one state more than inputs, and as many times, found {steps} inputs, {states} states and {times} times"
    );
    Err(Wrong { trial_id: trial.head.trial_id.clone(), what })
}

/// The fault of a trial, if any.
fn fault(parameters: &SceneParameters, trial: &StoredTrial) -> Option<String> {
    let (inputs, states) = (&trial.content.inputs, &trial.content.states);
    if inputs.len() != parameters.steps || states.len() != parameters.steps + 1 {
        let (inputs, states) = (inputs.len(), states.len());
        return Some(format!(
            "expected {} inputs and one state more, found {inputs} and {states}",
            parameters.steps
        ));
    }
    // The goal follows from the start, because a robot that drives straight reaches its goal.
    let Scene { human, robot, goal, .. } = trial.scene;
    let expected = Scene::new(parameters, human, robot).goal;
    let is_there = |i: usize| (goal[i] - expected[i]).abs() <= 1e-6;
    if !(is_there(0) && is_there(1)) {
        return Some(format!("goal: expected {expected:?}, found {goal:?}"));
    }
    let stored = &trial.head.flags;
    if trial.content_hash != trial.recipe.hash(&trial.content) {
        return Some("the content is not that of its hash".to_owned());
    }
    let found = match trial.content.flags(parameters, &trial.scene) {
        Ok(found) => found,
        Err(error) => return Some(format!("page events or display: {error}")),
    };
    // An imported trial can have flags whose evidence is not in its content. A trial of an earlier
    // version lacks the flags that were introduced later.
    let expected = |flag: &&Flag| stored.contains(flag) || !Flag::LATER.contains(flag);
    let agree = if stored.contains(&Flag::Imported) {
        found.iter().filter(expected).all(|flag| stored.contains(flag))
    } else {
        found.iter().filter(expected).eq(stored)
    };
    if !agree {
        let words = |flags: &[Flag]| match flags {
            [] => "none".to_owned(),
            some => flag_words(some),
        };
        return Some(format!("flags: expected {}, found {}", words(&found), words(stored)));
    }
    let outcome = outcome(parameters, inputs, states);
    // Earlier versions stored the outcome of an imported robot that turns as if it drove straight
    // within each step.
    let earlier = || outcome_of_straight_robot(parameters, inputs, states);
    (outcome != trial.head.outcome && earlier() != trial.head.outcome)
        .then(|| format!("expected {}, found {}", told(&outcome), told(&trial.head.outcome)))
}

/// An outcome in words.
fn told(outcome: &Outcome) -> String {
    let danger = match outcome.first_step_in_danger {
        Some(step) => format!("danger from step {step}"),
        None => "no danger".to_owned(),
    };
    let turns = match outcome.avoidance {
        Some((first, last)) => format!("turns from step {first} to {last}"),
        None => "no turn".to_owned(),
    };
    format!("a closest range of {} m, {danger} and {turns}", outcome.closest_m)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::store::tests::{Known, file_store, someone, trial};
    use sidestep::vehicle::TurnInput;
    use sqlx::sqlite::SqliteConnectOptions;
    use sqlx::{AssertSqlSafe, ConnectOptions, Executor};

    #[tokio::test]
    async fn what_cannot_be_read_is_named_and_the_rest_is_checked() {
        let (folder, store) = file_store().await;
        someone(&store, "ada", Known::default()).await;
        for id in ["ada-0", "ada-1"] {
            let mut new = trial(id, TurnInput::Left);
            new.content.sampled_at_ms = Some((0..50).map(|step| 200.0 * f64::from(step)).collect());
            new.content_hash = new.recipe.hash(&new.content);
            store.put_trial("ada", new).await.unwrap();
        }
        let sound = report(&store).await.unwrap();
        assert_eq!((sound.trials, sound.wrong, sound.damage), (2, vec![], vec![]));
        let file = folder.path().join("test.db");
        let mut db = SqliteConnectOptions::new().filename(file).connect().await.unwrap();
        db.execute("PRAGMA ignore_check_constraints = ON").await.unwrap();
        for (table, column, value, reason) in [
            ("trial", "flags", "'odd'", "unknown word \"odd\""),
            ("trial", "inputs", "x'07'", "found 7"),
            ("trial", "content_version", "9", "unknown content version 9"),
            ("scene", "phase", "'odd'", "unknown word \"odd\""),
            ("scene", "goal_x", "goal_x + 1", "goal: expected"),
            ("trial", "closest_m", "closest_m + 1", "m, no danger and turns from step 0 to 49"),
        ] {
            let change = format!(
                "CREATE TEMP TABLE was AS SELECT {column} AS value FROM {table} \
                     WHERE trial_id = 'ada-0'; \
                 UPDATE {table} SET {column} = {value} WHERE trial_id = 'ada-0'"
            );
            db.execute(AssertSqlSafe(change)).await.unwrap();
            let found = report(&store).await.unwrap();
            let [Wrong { trial_id, what }] = &found.wrong[..] else { panic!("{found:?}") };
            assert!(trial_id == "ada-0" && what.contains(reason), "{what}");
            let restore = format!(
                "UPDATE {table} SET {column} = (SELECT value FROM was) WHERE trial_id = 'ada-0'; \
                 DROP TABLE was"
            );
            db.execute(AssertSqlSafe(restore)).await.unwrap();
        }
        for json in ["3", "{"] {
            let change = sqlx::query("UPDATE study_config SET json = ?1").bind(json);
            change.execute(&mut db).await.unwrap();
            let found = report(&store).await.unwrap();
            let [altered, what] = &found.damage[..] else { panic!("{found:?}") };
            assert!(altered.ends_with("its content was altered"), "{altered}");
            assert!(what.starts_with("study default: configuration "), "{what}");
        }
    }
}
