//! Trials as they were driven.

use super::octets::{pack, pack_inputs, pack_states, unpack, unpack_inputs, unpack_states};
use super::scenes::SceneColumns;
use super::{Db, undecodable, unknown_word};
use serde::Deserialize;
use sidestep::scene::{JointState, Scene};
use sidestep::trial::{Flag, Outcome, Phase};
use sidestep::vehicle::TurnInput;

/// A trial to be stored.
#[derive(Clone, Debug)]
pub struct NewTrial<'a> {
    /// The planned scene that was driven.
    pub trial_id: &'a str,
    /// SHA-256 of the content.
    pub content_hash: [u8; 32],
    /// Now.
    pub received_at_ms: i64,
    /// The participant's clock, where it is known.
    pub started_at_ms: Option<f64>,
    /// The input held in each step.
    pub inputs: &'a [TurnInput],
    /// Before each step, and after the last.
    pub states: &'a [JointState],
    /// When each input was sampled, where it is known.
    pub sampled_at_ms: Option<&'a [f64]>,
    /// What the keys did, as JSON.
    pub key_events: &'a str,
    /// The display, as JSON.
    pub display: &'a str,
    /// What an analyst should know.
    pub flags: &'a [Flag],
    /// What came of it.
    pub outcome: Outcome,
}

/// Which trial it is, and what came of it.
#[derive(Clone, Debug)]
pub struct TrialHead {
    /// Rises with every trial stored.
    pub sequence: i64,
    /// The trial.
    pub trial_id: String,
    /// Who drove it.
    pub participant_id: String,
    /// Their number within the study, from 1.
    pub participant_number: i64,
    /// Place in the participant's plan, from 0.
    pub ordinal: i64,
    /// Its phase.
    pub phase: Phase,
    /// Place within its phase, from 0.
    pub index: usize,
    /// When it was stored.
    pub received_at_ms: i64,
    /// What an analyst should know.
    pub flags: Vec<Flag>,
    /// What came of it.
    pub outcome: Outcome,
}

/// A stored trial, whole.
#[derive(Clone, Debug)]
pub struct StoredTrial {
    /// Which, and what came of it.
    pub head: TrialHead,
    /// The study's name.
    pub study: String,
    /// The configuration it was driven under.
    pub config_hash: String,
    /// What was assigned.
    pub scene: Scene,
    /// The participant's clock at the start.
    pub started_at_ms: Option<f64>,
    /// The input held in each step.
    pub inputs: Vec<TurnInput>,
    /// Before each step, and after the last.
    pub states: Vec<JointState>,
    /// When each input was sampled, ms after the start.
    pub sampled_at_ms: Option<Vec<f64>>,
    /// What the keys did, as JSON.
    pub key_events: String,
    /// The display, as JSON.
    pub display: String,
    /// SHA-256 of the content when it was stored.
    pub content_hash: Vec<u8>,
}

impl StoredTrial {
    /// What an upload's display, or a file when it was imported, says of who drove.
    #[must_use]
    pub fn is_synthetic(&self) -> bool {
        #[derive(Deserialize)]
        struct Said {
            #[serde(default)]
            synthetic: serde_json::Value,
        }
        let said = serde_json::from_str(&self.display);
        said.is_ok_and(|said: Said| said.synthetic == serde_json::Value::Bool(true))
    }
}

#[derive(sqlx::FromRow)]
struct HeadColumns {
    sequence: i64,
    trial_id: String,
    participant_id: String,
    participant_number: i64,
    received_at_ms: i64,
    flags: String,
    closest_m: f64,
    first_step_in_danger: Option<i64>,
    avoidance_first: Option<i64>,
    avoidance_last: Option<i64>,
    #[sqlx(flatten)]
    scene: SceneColumns,
}

#[derive(sqlx::FromRow)]
struct WholeColumns {
    #[sqlx(flatten)]
    head: HeadColumns,
    study: String,
    config_hash: String,
    started_at_ms: Option<f64>,
    inputs: Vec<u8>,
    states: Vec<u8>,
    sampled_at_ms: Option<Vec<u8>>,
    key_events: String,
    display: String,
    content_hash: Vec<u8>,
}

impl TryFrom<HeadColumns> for TrialHead {
    type Error = sqlx::Error;

    fn try_from(row: HeadColumns) -> Result<Self, sqlx::Error> {
        let step = |column: Option<i64>| column.and_then(|step| usize::try_from(step).ok());
        Ok(Self {
            ordinal: row.scene.ordinal,
            phase: row.scene.phase()?,
            index: row.scene.index(),
            flags: flags(&row.flags)?,
            outcome: Outcome {
                closest_m: row.closest_m,
                first_step_in_danger: step(row.first_step_in_danger),
                avoidance: step(row.avoidance_first).zip(step(row.avoidance_last)),
            },
            sequence: row.sequence,
            trial_id: row.trial_id,
            participant_id: row.participant_id,
            participant_number: row.participant_number,
            received_at_ms: row.received_at_ms,
        })
    }
}

impl TryFrom<WholeColumns> for StoredTrial {
    type Error = sqlx::Error;

    fn try_from(row: WholeColumns) -> Result<Self, sqlx::Error> {
        Ok(Self {
            scene: row.head.scene.scene(),
            head: row.head.try_into()?,
            study: row.study,
            config_hash: row.config_hash,
            started_at_ms: row.started_at_ms,
            inputs: unpack_inputs(&row.inputs).map_err(undecodable)?,
            states: unpack_states(&row.states),
            sampled_at_ms: row.sampled_at_ms.as_deref().map(unpack),
            key_events: row.key_events,
            display: row.display,
            content_hash: row.content_hash,
        })
    }
}

/// Flags as they are stored and exported: words joined by semicolons.
#[must_use]
pub fn flag_words(flags: &[Flag]) -> String {
    let words: Vec<_> = flags.iter().map(|flag| flag.word()).collect();
    words.join(";")
}

fn flags(words: &str) -> Result<Vec<Flag>, sqlx::Error> {
    let known = |word| Flag::from_word(word).ok_or_else(|| unknown_word(word));
    words.split(';').filter(|word| !word.is_empty()).map(known).collect()
}

/// Stores a trial.
///
/// # Errors
/// If its scene has one, or the database cannot be written.
pub async fn insert(db: &mut Db, new: &NewTrial<'_>) -> Result<(), sqlx::Error> {
    let step = |step: Option<usize>| step.map(|step| step as i64);
    let avoidance = new.outcome.avoidance;
    sqlx::query(
        "INSERT INTO trial (trial_id, content_hash, received_at_ms, started_at_ms, inputs, states, \
             sampled_at_ms, key_events, display, flags, closest_m, first_step_in_danger, \
             avoidance_first, avoidance_last) \
         VALUES ($1, $2, $3, $4, $5, $6, $7, $8, $9, $10, $11, $12, $13, $14)",
    )
    .bind(new.trial_id)
    .bind(&new.content_hash[..])
    .bind(new.received_at_ms)
    .bind(new.started_at_ms)
    .bind(pack_inputs(new.inputs))
    .bind(pack_states(new.states))
    .bind(new.sampled_at_ms.map(|times| pack(times.iter().copied())))
    .bind(new.key_events)
    .bind(new.display)
    .bind(flag_words(new.flags))
    .bind(new.outcome.closest_m)
    .bind(step(new.outcome.first_step_in_danger))
    .bind(step(avoidance.map(|(first, _)| first)))
    .bind(step(avoidance.map(|(_, last)| last)))
    .execute(db)
    .await
    .map(drop)
}

/// The content hash of a trial, if it is stored.
///
/// # Errors
/// If the database cannot be read.
pub async fn content_hash(db: &mut Db, trial_id: &str) -> Result<Option<Vec<u8>>, sqlx::Error> {
    sqlx::query_scalar("SELECT content_hash FROM trial WHERE trial_id = $1")
        .bind(trial_id)
        .fetch_optional(db)
        .await
}

/// At most `limit` trials of a study, newest first, from before `before`.
///
/// # Errors
/// If the database cannot be read.
pub async fn page(
    db: &mut Db,
    study_id: i64,
    before: i64,
    limit: i64,
) -> Result<Vec<TrialHead>, sqlx::Error> {
    let rows: Vec<HeadColumns> = sqlx::query_as(
        "SELECT * FROM stored_trial WHERE study_id = $1 AND sequence < $2 \
         ORDER BY sequence DESC LIMIT $3",
    )
    .bind(study_id)
    .bind(before)
    .bind(limit)
    .fetch_all(db)
    .await?;
    rows.into_iter().map(TrialHead::try_from).collect()
}

/// The trial of that id.
///
/// # Errors
/// If the database cannot be read.
pub async fn find(db: &mut Db, trial_id: &str) -> Result<Option<StoredTrial>, sqlx::Error> {
    let row: Option<WholeColumns> =
        sqlx::query_as("SELECT * FROM stored_trial WHERE trial_id = $1")
            .bind(trial_id)
            .fetch_optional(db)
            .await?;
    row.map(StoredTrial::try_from).transpose()
}

/// Everything that a participant drove, in the plan's order.
///
/// # Errors
/// If the database cannot be read.
pub async fn of_participant(
    db: &mut Db,
    participant_id: &str,
) -> Result<Vec<StoredTrial>, sqlx::Error> {
    let rows: Vec<WholeColumns> =
        sqlx::query_as("SELECT * FROM stored_trial WHERE participant_id = $1 ORDER BY ordinal")
            .bind(participant_id)
            .fetch_all(db)
            .await?;
    rows.into_iter().map(StoredTrial::try_from).collect()
}

/// How many trials there are in all studies.
///
/// # Errors
/// If the database cannot be read.
pub async fn count(db: &mut Db) -> Result<i64, sqlx::Error> {
    sqlx::query_scalar("SELECT count(*) FROM trial").fetch_one(db).await
}
