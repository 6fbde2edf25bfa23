//! The scenes of participants' plans.

use super::StoreError;
use super::sql::{Connection, OptionalExtension, Row, Rows, params};
use sidestep::scene::Scene;
use sidestep::trial::Phase;
use sidestep::vehicle::Pose;
use uuid::Uuid;

/// One planned scene.
#[derive(Clone, Debug)]
pub struct PlannedRow {
    /// The id under which its trial is stored.
    pub trial_id: String,
    /// Index in the whole plan, from 0.
    pub ordinal: i64,
    /// Its phase.
    pub phase: Phase,
    /// Index within the phase, from 0.
    pub index: usize,
    /// 1, or 2 if the scene is driven again because its first trial was interrupted.
    pub attempt: u32,
    /// Both vehicles and the goal.
    pub scene: Scene,
    /// Whether its trial is stored.
    pub stored: bool,
}

/// Ids for the trials of a plan. They are random and independent of the time, but share a prefix,
/// so that they are adjacent in the database's index. Otherwise, a plan would change one index page
/// per trial.
pub fn trial_ids() -> impl Iterator<Item = String> {
    let (plan, _) = Uuid::new_v4().as_u64_pair();
    std::iter::repeat_with(move || {
        let mut bytes = *Uuid::new_v4().as_bytes();
        bytes[..SHARED].copy_from_slice(&plan.to_be_bytes()[..SHARED]);
        uuid::Builder::from_random_bytes(bytes).into_uuid().to_string()
    })
}

/// Length of the prefix that the ids of a plan share (bytes). The other ten bytes are random.
const SHARED: usize = 6;

/// The columns that [`scene_of`] reads.
pub(super) const SCENE: &str = "human_x, human_y, human_psi, robot_x, robot_y, robot_psi, \
                                goal_x, goal_y, policy";

/// The scene in the columns [`SCENE`], which begin at `at`.
pub(super) fn scene_of(row: &Row, at: usize) -> Result<Scene, StoreError> {
    let number = |i: usize| row.get::<_, f64>(at + i);
    let policy: Option<String> = row.get(at + 8)?;
    let policy = policy.as_deref().map(serde_json::from_str).transpose();
    Ok(Scene {
        human: Pose::from([number(0)?, number(1)?, number(2)?]),
        robot: Pose::from([number(3)?, number(4)?, number(5)?]),
        goal: [number(6)?, number(7)?],
        policy: policy.map_err(StoreError::corrupt)?,
    })
}

pub(super) fn phase_of(word: &str) -> Result<Phase, StoreError> {
    Phase::from_word(word).ok_or_else(|| StoreError::unknown_word(word))
}

const INSERT: Rows = Rows {
    before: "INSERT INTO scene (trial_id, participant_id, ordinal, phase, idx, attempt, human_x, \
                 human_y, human_psi, robot_x, robot_y, robot_psi, goal_x, goal_y, policy) VALUES ",
    after: "",
};

pub(super) fn insert(
    db: &Connection,
    participant_id: &str,
    planned: &PlannedRow,
) -> Result<(), StoreError> {
    let Scene { human, robot, goal, policy } = &planned.scene;
    let policy = policy.as_ref().map(serde_json::to_string).transpose();
    let row = params![
        planned.trial_id,
        participant_id,
        planned.ordinal,
        planned.phase.word(),
        planned.index as i64,
        planned.attempt,
        human.x,
        human.y,
        human.psi,
        robot.x,
        robot.y,
        robot.psi,
        goal[0],
        goal[1],
        policy.map_err(StoreError::corrupt)?,
    ];
    Ok(db.execute_row_later(&INSERT, &[&planned.trial_id], row)?)
}

/// Appends the scene of a trial to its participant's plan, as the next attempt.
pub(super) fn repeat(db: &Connection, trial_id: &str, new_id: &str) -> Result<(), StoreError> {
    db.prepare_cached(
        "INSERT INTO scene (trial_id, participant_id, ordinal, phase, idx, attempt, human_x, \
             human_y, human_psi, robot_x, robot_y, robot_psi, goal_x, goal_y, policy) \
         SELECT $2, participant_id, (SELECT max(ordinal) + 1 FROM scene AS other \
                 WHERE other.participant_id = scene.participant_id), \
             phase, idx, attempt + 1, human_x, human_y, human_psi, robot_x, robot_y, robot_psi, \
             goal_x, goal_y, policy \
         FROM scene WHERE trial_id = $1",
    )?
    .execute([trial_id, new_id])?;
    Ok(())
}

/// The first trial of a participant's plan that is not stored.
pub(super) fn next(db: &Connection, participant_id: &str) -> Result<Option<String>, StoreError> {
    let mut statement = db.prepare_cached(
        "SELECT trial_id FROM scene WHERE participant_id = $1 \
             AND NOT EXISTS (SELECT 1 FROM trial WHERE trial.trial_id = scene.trial_id) \
         ORDER BY ordinal LIMIT 1",
    )?;
    Ok(statement.query_row([participant_id], |row| row.get(0)).optional()?)
}

/// A participant's whole plan, in order.
pub(super) fn plan(db: &Connection, participant_id: &str) -> Result<Vec<PlannedRow>, StoreError> {
    let mut statement = db.prepare_cached(&format!(
        "SELECT scene.trial_id, ordinal, phase, idx, attempt, trial.trial_id IS NOT NULL, {SCENE} \
         FROM scene LEFT JOIN trial ON trial.trial_id = scene.trial_id \
         WHERE scene.participant_id = $1 ORDER BY ordinal"
    ))?;
    let planned = |row: &Row| {
        Ok(PlannedRow {
            trial_id: row.get(0)?,
            ordinal: row.get(1)?,
            phase: phase_of(&row.get::<_, String>(2)?)?,
            index: usize::try_from(row.get::<_, i64>(3)?).map_err(StoreError::corrupt)?,
            attempt: row.get(4)?,
            stored: row.get(5)?,
            scene: scene_of(row, 6)?,
        })
    };
    statement.query_and_then([participant_id], planned)?.collect()
}
