//! Tallies: what the list of participants shows about their trials. Each follows from the stored trials;
//! the list would be slow if it read them.

use super::{Store, StoreError};
use rusqlite::{Connection, params};
use sidestep::trial::{Flag, Outcome};
use sidestep::vehicle::TurnInput;

/// What is counted of a trial.
pub(super) struct Counted<'a> {
    /// The trial.
    pub(super) trial_id: &'a str,
    /// Its input in each step.
    pub(super) inputs: &'a [TurnInput],
    /// Its flags.
    pub(super) flags: &'a [Flag],
    /// Its outcome.
    pub(super) outcome: &'a Outcome,
    /// A number that follows from the times of its key events, if there are enough.
    pub(super) key_timing: Option<i64>,
    /// How many further trials wait in the participant's browser.
    pub(super) waiting: u32,
}

/// Adds a trial that is about to be stored. Its scene is stored already.
pub(super) fn add(db: &Connection, study_id: i64, trial: &Counted<'_>) -> Result<(), StoreError> {
    let is_same = match trial.key_timing {
        Some(timing) => db
            .prepare_cached("SELECT 1 FROM trial WHERE study_id = ?1 AND key_timing = ?2")?
            .exists([study_id, timing])?,
        None => false,
    };
    let has = |flag| trial.flags.contains(&flag);
    let always = trial.inputs.iter().all(|&input| input != TurnInput::Straight);
    db.prepare_cached(
        "INSERT INTO tally SELECT participant_id, (SELECT phase FROM scene AS next \
             WHERE next.participant_id = scene.participant_id AND next.ordinal = scene.ordinal + 1), \
             phase = 'familiarisation', phase = 'practice', \
             phase = 'task', phase = 'task' AND ?2, phase = 'task' AND ?3, phase = 'task' AND ?4, \
             phase = 'task' AND ?5, phase = 'task' AND ?6, phase = 'task' AND ?7, phase = 'task' AND ?8, ?9 \
         FROM scene WHERE trial_id = ?1 \
         ON CONFLICT DO UPDATE SET next_phase = excluded.next_phase, familiarisation = familiarisation + excluded.familiarisation, \
             practice = practice + excluded.practice, task = task + excluded.task, \
             late_sample = late_sample + excluded.late_sample, \
             focus_lost = focus_lost + excluded.focus_lost, \
             interrupted = interrupted + excluded.interrupted, \
             never_steered = never_steered + excluded.never_steered, \
             always_steered = always_steered + excluded.always_steered, \
             danger_entered = danger_entered + excluded.danger_entered, \
             same_timing = same_timing + excluded.same_timing, waiting = excluded.waiting",
    )?
    .execute(params![
        trial.trial_id,
        has(Flag::LateSample),
        has(Flag::FocusLost),
        has(Flag::Interrupted),
        trial.outcome.avoidance.is_none(),
        always,
        trial.outcome.first_step_in_danger.is_some(),
        is_same,
        trial.waiting,
    ])?;
    Ok(())
}

/// Records how many further trials wait in the participant's browser, when a trial was uploaded again.
pub(super) fn waits(db: &Connection, participant_id: &str, waiting: u32) -> Result<(), StoreError> {
    db.prepare_cached("UPDATE tally SET waiting = ?2 WHERE participant_id = ?1 AND waiting <> ?2")?
        .execute(params![participant_id, waiting])?;
    Ok(())
}

/// A scene was added at the end of the plan.
pub(super) fn goes_on(db: &Connection, trial_id: &str) -> Result<(), StoreError> {
    db.prepare_cached(
        "UPDATE tally SET next_phase = coalesce(next_phase, phase) FROM scene \
         WHERE scene.trial_id = ?1 AND tally.participant_id = scene.participant_id",
    )?
    .execute([trial_id])?;
    Ok(())
}

impl Store {
    /// The ids of participants whose tally does not follow from their stored trials.
    pub async fn wrong_tallies(&self) -> Result<Vec<String>, StoreError> {
        self.read_long(|db| {
            let mut statement = db.prepare(
                "WITH counted AS (SELECT participant_id, sum(phase = 'familiarisation') AS warm, \
                     sum(phase = 'practice') AS practised, sum(phase = 'task') AS tasks, \
                     sum(phase = 'task' AND instr(';' || flags || ';', ';late_sample;') > 0) AS late, \
                     sum(phase = 'task' AND instr(';' || flags || ';', ';focus_lost;') > 0) AS lost, \
                     sum(phase = 'task' AND instr(';' || flags || ';', ';interrupted;') > 0) AS broken, \
                     sum(phase = 'task' AND avoidance_first IS NULL) AS never, \
                     sum(phase = 'task' AND first_step_in_danger IS NOT NULL) AS danger \
                     FROM scene JOIN trial ON trial.trial_id = scene.trial_id GROUP BY participant_id) \
                 SELECT coalesce(counted.participant_id, tally.participant_id) FROM counted \
                 FULL JOIN tally ON tally.participant_id = counted.participant_id \
                 WHERE (warm, practised, tasks, late, lost, broken, never, danger) IS NOT \
                     (familiarisation, practice, task, late_sample, focus_lost, interrupted, \
                      never_steered, danger_entered) \
                     OR next_phase IS NOT (SELECT phase FROM scene \
                         WHERE scene.participant_id = tally.participant_id \
                             AND ordinal = familiarisation + practice + task) ORDER BY 1",
            )?;
            Ok(statement.query_map([], |row| row.get(0))?.collect::<Result<_, _>>()?)
        })
        .await
    }
}
