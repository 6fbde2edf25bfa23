//! Tallies: one row per participant with the values by which lists filter and sort. They are
//! derived from the stored participant, exclusions and trials. Computing them for each list would
//! be slow. Database triggers copy the values of the participant. This module counts the values of
//! trials.

use super::lanes::Lock;
use super::sql::{Connection, Rows, params};
use super::{Store, StoreError};
use sidestep::trial::{Flag, Outcome, Phase};
use sidestep::vehicle::TurnInput;

/// The values of a trial from which its participant's tally is updated.
pub(super) struct Counted<'a> {
    /// Its participant.
    pub(super) participant_id: &'a str,
    /// Its phase.
    pub(super) phase: Phase,
    /// The phase of the next scene, if there is one.
    pub(super) next_phase: Option<Phase>,
    /// Its input in each step.
    pub(super) inputs: &'a [TurnInput],
    /// Its flags.
    pub(super) flags: &'a [Flag],
    /// Its outcome.
    pub(super) outcome: &'a Outcome,
    /// A number derived from the times of its key events, if there are enough events.
    pub(super) key_timing: Option<i64>,
    /// Number of further trials that wait in the participant's browser.
    pub(super) waiting: u32,
}

/// The statement that counts trials that are about to be stored. A row of parameters has the
/// participant, the phase of the next scene, the increment of each count, the number derived from
/// the key times, the number of waiting trials, and the study.
const ADD: Rows = Rows {
    before: "UPDATE tally SET \
                 next_phase = given.column2, \
                 familiarisation = familiarisation + given.column3, \
                 practice = practice + given.column4, \
                 task = task + given.column5, \
                 late_sample = late_sample + given.column6, \
                 focus_lost = focus_lost + given.column7, \
                 interrupted = interrupted + given.column8, \
                 never_steered = never_steered + given.column9, \
                 always_steered = always_steered + given.column10, \
                 danger_entered = danger_entered + given.column11, \
                 same_timing = same_timing + CASE WHEN EXISTS (SELECT 1 FROM trial \
                     WHERE trial.study_id = given.column14 AND trial.key_timing = given.column12) \
                     THEN given.column5 ELSE 0 END, \
                 waiting = given.column13 \
             FROM (VALUES ",
    after: ") AS given WHERE tally.participant_id = given.column1",
};

/// Counts a trial that is about to be stored. Its scene is stored already.
pub(super) fn add(db: &Connection, study_id: i64, trial: &Counted<'_>) -> Result<(), StoreError> {
    let is_in = |phase| i64::from(trial.phase == phase);
    let counts = |holds: bool| i64::from(holds && trial.phase == Phase::Task);
    let has = |flag| counts(trial.flags.contains(&flag));
    let always = trial.inputs.iter().all(|&input| input != TurnInput::Straight);
    let row = params![
        trial.participant_id,
        trial.next_phase.map(Phase::word),
        is_in(Phase::Familiarisation),
        is_in(Phase::Practice),
        is_in(Phase::Task),
        has(Flag::LateSample),
        has(Flag::FocusLost),
        has(Flag::Interrupted),
        counts(trial.outcome.avoidance.is_none()),
        counts(always),
        counts(trial.outcome.first_step_in_danger.is_some()),
        trial.key_timing,
        trial.waiting,
        study_id,
    ];
    // Two trials with the same key times have the same target, because the count of the later trial
    // must find the earlier trial.
    let timing = trial.key_timing.map(|timing| format!("timing {study_id} {timing}"));
    let targets: Vec<_> =
        [Some(trial.participant_id), timing.as_deref()].into_iter().flatten().collect();
    Ok(db.execute_row_later(&ADD, &targets, row)?)
}

/// Records the number of further trials that wait in the participant's browser, when a trial was
/// uploaded again.
pub(super) fn waits(db: &Connection, participant_id: &str, waiting: u32) -> Result<(), StoreError> {
    db.prepare_cached("UPDATE tally SET waiting = $2 WHERE participant_id = $1 AND waiting <> $2")?
        .execute(params![participant_id, waiting])?;
    Ok(())
}

/// Records that a scene was appended to the plan.
pub(super) fn goes_on(db: &Connection, trial_id: &str) -> Result<(), StoreError> {
    db.prepare_cached(
        "UPDATE tally SET next_phase = coalesce(next_phase, phase) FROM scene \
         WHERE scene.trial_id = $1 AND tally.participant_id = scene.participant_id",
    )?
    .execute([trial_id])?;
    Ok(())
}

/// The counts over a participant's scenes that have trials.
const COUNTS: &str = "count(*) FILTER (WHERE phase = 'familiarisation') AS warm, \
    count(*) FILTER (WHERE phase = 'practice') AS practised, \
    count(*) FILTER (WHERE phase = 'task') AS tasks, \
    count(*) FILTER (WHERE phase = 'task' AND ';' || flags || ';' LIKE '%;late_sample;%') AS late, \
    count(*) FILTER (WHERE phase = 'task' AND ';' || flags || ';' LIKE '%;focus_lost;%') AS lost, \
    count(*) FILTER (WHERE phase = 'task' AND ';' || flags || ';' LIKE '%;interrupted;%') AS broken, \
    count(*) FILTER (WHERE phase = 'task' AND avoidance_first IS NULL) AS never, \
    count(*) FILTER (WHERE phase = 'task' AND first_step_in_danger IS NOT NULL) AS danger";

/// Recounts all stored trials of a participant.
pub(super) fn count(db: &Connection, participant_id: &str) -> Result<(), StoreError> {
    let straight =
        db.choose("instr(inputs, x'00') > 0", "position(CAST('\\x00' AS bytea) IN inputs) > 0");
    let update = format!(
        "UPDATE tally SET familiarisation = warm, practice = practised, task = tasks, \
                 late_sample = late, focus_lost = lost, interrupted = broken, never_steered = never, \
                 always_steered = always, danger_entered = danger, same_timing = again, \
                 next_phase = CASE WHEN warm + practised + tasks > 0 THEN \
                     (SELECT phase FROM scene WHERE scene.participant_id = $1 \
                          AND ordinal = warm + practised + tasks) END \
             FROM (SELECT \
                 {COUNTS}, \
                 count(*) FILTER (WHERE phase = 'task' AND NOT ({straight})) AS always, \
                 count(*) FILTER (WHERE phase = 'task' AND EXISTS (SELECT 1 FROM trial AS earlier \
                     WHERE earlier.study_id = trial.study_id \
                         AND earlier.key_timing = trial.key_timing \
                         AND earlier.sequence < trial.sequence)) AS again \
                 FROM scene JOIN trial ON trial.trial_id = scene.trial_id \
                 WHERE scene.participant_id = $1) AS counted \
             WHERE tally.participant_id = $1"
    );
    Ok(db.execute(&update, [participant_id]).map(drop)?)
}

impl Store {
    /// Recounts the trials of a participant after some were lost.
    pub async fn count_again(&self, participant_id: &str) -> Result<(), StoreError> {
        let participant_id = participant_id.to_owned();
        let locks = [Lock::Participant(participant_id.clone())];
        self.write_behind(locks, move |db| count(db, &participant_id)).await
    }

    /// The ids of participants whose tally differs from the stored data.
    pub async fn wrong_tallies(&self) -> Result<Vec<String>, StoreError> {
        self.read_long(|db| {
            let mut statement = db.prepare_cached(&format!(
                "WITH counted AS (SELECT participant_id, {COUNTS} \
                     FROM scene JOIN trial ON trial.trial_id = scene.trial_id GROUP BY participant_id) \
                 SELECT id FROM participant \
                 LEFT JOIN tally ON tally.participant_id = id \
                 LEFT JOIN counted ON counted.participant_id = id \
                 WHERE (participant.study_id, participant.pilot, participant.number, \
                     participant.last_seen_at_ms, participant.comprehension_attempts, \
                     understood_at_ms IS NOT NULL, withdrawn_at_ms IS NOT NULL, \
                     screened_out_at_ms IS NOT NULL, completion_code IS NOT NULL, \
                     import_hash IS NOT NULL, \
                     EXISTS (SELECT 1 FROM exclusion \
                         WHERE exclusion.participant_id = participant.id \
                             AND ended_at_ms IS NULL)) IS DISTINCT FROM \
                     (tally.study_id, tally.pilot, tally.number, tally.last_seen_at_ms, \
                      tally.comprehension_attempts, understood, withdrawn, screened_out, complete, \
                      imported, excluded) \
                     OR (coalesce(warm, 0), coalesce(practised, 0), coalesce(tasks, 0), \
                     coalesce(late, 0), coalesce(lost, 0), coalesce(broken, 0), coalesce(never, 0), \
                     coalesce(danger, 0)) IS DISTINCT FROM \
                     (familiarisation, practice, task, late_sample, focus_lost, interrupted, \
                      never_steered, danger_entered) \
                     OR stored > 0 AND next_phase IS DISTINCT FROM (SELECT phase FROM scene \
                         WHERE scene.participant_id = id AND ordinal = stored) ORDER BY 1"
            ))?;
            Ok(statement.query_map([], |row| row.get(0))?.collect::<Result<_, _>>()?)
        })
        .await
    }
}
