//! What participants are to drive.

use super::{Db, unknown_word};
use sidestep::scene::Scene;
use sidestep::trial::Phase;
use sidestep::vehicle::Pose;

/// One planned scene.
#[derive(Clone, Debug)]
pub struct PlannedRow {
    /// Under which its trial is stored.
    pub trial_id: String,
    /// Place in the whole plan, from 0.
    pub ordinal: i64,
    /// Its phase.
    pub phase: Phase,
    /// Place within the phase, from 0.
    pub index: usize,
    /// Both vehicles and the goal.
    pub scene: Scene,
    /// Whether its trial is stored.
    pub stored: bool,
}

/// The columns of a scene.
#[derive(sqlx::FromRow)]
pub(super) struct SceneColumns {
    pub(super) ordinal: i64,
    pub(super) phase: String,
    pub(super) idx: i64,
    human_x: f64,
    human_y: f64,
    human_psi: f64,
    robot_x: f64,
    robot_y: f64,
    robot_psi: f64,
    goal_x: f64,
    goal_y: f64,
}

impl SceneColumns {
    pub(super) fn scene(&self) -> Scene {
        Scene {
            human: Pose::from([self.human_x, self.human_y, self.human_psi]),
            robot: Pose::from([self.robot_x, self.robot_y, self.robot_psi]),
            goal: [self.goal_x, self.goal_y],
        }
    }

    pub(super) fn phase(&self) -> Result<Phase, sqlx::Error> {
        Phase::from_word(&self.phase).ok_or_else(|| unknown_word(&self.phase))
    }

    pub(super) fn index(&self) -> usize {
        usize::try_from(self.idx).unwrap_or_default()
    }
}

#[derive(sqlx::FromRow)]
struct Row {
    trial_id: String,
    stored: bool,
    #[sqlx(flatten)]
    columns: SceneColumns,
}

/// Writes a planned scene down.
///
/// # Errors
/// If the database cannot be written.
pub async fn insert(
    db: &mut Db,
    participant_id: &str,
    planned: &PlannedRow,
) -> Result<(), sqlx::Error> {
    let Scene { human, robot, goal } = planned.scene;
    sqlx::query(
        "INSERT INTO scene (trial_id, participant_id, ordinal, phase, idx, human_x, human_y, \
             human_psi, robot_x, robot_y, robot_psi, goal_x, goal_y) \
         VALUES ($1, $2, $3, $4, $5, $6, $7, $8, $9, $10, $11, $12, $13)",
    )
    .bind(&planned.trial_id)
    .bind(participant_id)
    .bind(planned.ordinal)
    .bind(planned.phase.word())
    .bind(planned.index as i64)
    .bind(human.x)
    .bind(human.y)
    .bind(human.psi)
    .bind(robot.x)
    .bind(robot.y)
    .bind(robot.psi)
    .bind(goal[0])
    .bind(goal[1])
    .execute(db)
    .await
    .map(drop)
}

/// A scene of a participant's plan; nobody else's.
///
/// # Errors
/// If the database cannot be read.
pub async fn find(
    db: &mut Db,
    participant_id: &str,
    trial_id: &str,
) -> Result<Option<Scene>, sqlx::Error> {
    let row: Option<SceneColumns> =
        sqlx::query_as("SELECT * FROM scene WHERE trial_id = $1 AND participant_id = $2")
            .bind(trial_id)
            .bind(participant_id)
            .fetch_optional(db)
            .await?;
    Ok(row.map(|row| row.scene()))
}

/// Whether anyone's plan has that trial.
///
/// # Errors
/// If the database cannot be read.
pub async fn exists(db: &mut Db, trial_id: &str) -> Result<bool, sqlx::Error> {
    sqlx::query_scalar("SELECT count(*) > 0 FROM scene WHERE trial_id = $1")
        .bind(trial_id)
        .fetch_one(db)
        .await
}

/// The first trial of a participant's plan that is not stored.
///
/// # Errors
/// If the database cannot be read.
pub async fn next(db: &mut Db, participant_id: &str) -> Result<Option<String>, sqlx::Error> {
    sqlx::query_scalar(
        "SELECT trial_id FROM scene WHERE participant_id = $1 \
             AND NOT EXISTS (SELECT 1 FROM trial WHERE trial.trial_id = scene.trial_id) \
         ORDER BY ordinal LIMIT 1",
    )
    .bind(participant_id)
    .fetch_optional(db)
    .await
}

/// A participant's whole plan, in order.
///
/// # Errors
/// If the database cannot be read.
pub async fn of_participant(
    db: &mut Db,
    participant_id: &str,
) -> Result<Vec<PlannedRow>, sqlx::Error> {
    let rows: Vec<Row> = sqlx::query_as(
        "SELECT scene.*, trial.trial_id IS NOT NULL AS stored FROM scene \
         LEFT JOIN trial ON trial.trial_id = scene.trial_id \
         WHERE scene.participant_id = $1 ORDER BY scene.ordinal",
    )
    .bind(participant_id)
    .fetch_all(db)
    .await?;
    let planned = |row: Row| {
        Ok(PlannedRow {
            ordinal: row.columns.ordinal,
            phase: row.columns.phase()?,
            index: row.columns.index(),
            scene: row.columns.scene(),
            trial_id: row.trial_id,
            stored: row.stored,
        })
    };
    rows.into_iter().map(planned).collect()
}
