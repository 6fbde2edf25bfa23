//! Reading stored trials.

use crate::store::scenes::{SCENE, phase_of, scene_of};
use crate::store::sql::{Connection, OptionalExtension, Row, params};
use crate::store::{Store, StoreError};
use crate::support::bytes::{unpack, unpack_inputs, unpack_states};
use crate::trial_content::{Content, Recipe};
use serde::Deserialize;
use sidestep::scene::Scene;
use sidestep::trial::{Flag, Outcome, Phase};

/// Identity and outcome of a trial.
#[derive(Clone, Debug)]
pub struct TrialHead {
    /// Sequence number of the trial, in the order of storing. A number is never used twice.
    pub sequence: i64,
    /// The trial.
    pub trial_id: String,
    /// The participant who drove it.
    pub participant_id: String,
    /// The participant's number within the study, from 1.
    pub participant_number: i64,
    /// Index in the participant's plan, from 0.
    pub ordinal: i64,
    /// Its phase.
    pub phase: Phase,
    /// Index within its phase, from 0.
    pub index: usize,
    /// 1, or 2 if the scene was driven again because its first trial was interrupted.
    pub attempt: u32,
    /// When it was stored.
    pub received_at_ms: i64,
    /// Its flags.
    pub flags: Vec<Flag>,
    /// Its outcome.
    pub outcome: Outcome,
}

/// A stored trial with its content.
#[derive(Clone, Debug)]
pub struct StoredTrial {
    /// The trial's entry in lists.
    pub head: TrialHead,
    /// The study's name.
    pub study: String,
    /// Hash of the configuration of its participant.
    pub config_hash: String,
    /// The assigned scene.
    pub scene: Scene,
    /// The driven trial.
    pub content: Content,
    /// How the content hash is computed.
    pub recipe: Recipe,
    /// Hash of the content, computed when it was stored.
    pub content_hash: [u8; 32],
}

/// A stored trial that cannot be read.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Unreadable {
    /// The trial.
    pub trial_id: String,
    /// The reason.
    pub what: String,
}

impl StoredTrial {
    /// Whether the upload's `display`, or the imported file, identifies the driver as a program.
    #[must_use]
    pub fn is_synthetic(&self) -> bool {
        #[derive(Deserialize)]
        struct Said {
            #[serde(default)]
            synthetic: serde_json::Value,
        }
        let said = serde_json::from_str(&self.content.display);
        said.is_ok_and(|said: Said| said.synthetic == serde_json::Value::Bool(true))
    }
}

impl Store {
    /// At most `limit` trials of a study, without pilots, newest first, with sequence numbers below `before`.
    pub async fn trials_page(
        &self,
        study_id: i64,
        before: i64,
        limit: i64,
    ) -> Result<Vec<TrialHead>, StoreError> {
        self.read_long(move |db| {
            let mut statement = db.prepare_cached(&format!(
                "SELECT {HEAD} FROM stored_trial \
                 WHERE study_id = $1 AND sequence < $2 AND pilot = FALSE \
                 ORDER BY sequence DESC LIMIT $3"
            ))?;
            statement.query_and_then(params![study_id, before, limit], head_of)?.collect()
        })
        .await
    }

    /// The trial with this id.
    pub async fn trial(&self, trial_id: &str) -> Result<Option<StoredTrial>, StoreError> {
        let trial_id = trial_id.to_owned();
        let found = self.read_long(move |db| whole(db, "trial_id", &trial_id)).await?;
        Ok(found.into_iter().next())
    }

    /// The stored trials before and after this one. They belong to the same participant, or to the
    /// participants with the next lower and higher numbers.
    pub async fn neighbours(&self, trial_id: &str) -> Result<[Option<String>; 2], StoreError> {
        let trial_id = trial_id.to_owned();
        self.read(move |db| {
            let find = |beyond: &str, order: &str| {
                let of = |participant: &str, condition: &str| {
                    format!(
                        "SELECT scene.trial_id FROM scene \
                         JOIN trial ON trial.trial_id = scene.trial_id \
                         WHERE scene.participant_id = {participant} {condition} \
                         ORDER BY ordinal {order} LIMIT 1"
                    )
                };
                let own = of("here.participant_id", &format!("AND ordinal {beyond} here.ordinal"));
                let other = format!(
                    "(SELECT other.participant_id FROM tally AS other \
                      WHERE (other.study_id, other.pilot) = (person.study_id, person.pilot) \
                          AND other.number {beyond} person.number AND other.stored > 0 \
                      ORDER BY other.number {order} LIMIT 1)"
                );
                let query = format!(
                    "SELECT coalesce(({own}), ({})) FROM scene AS here \
                     JOIN participant AS person ON person.id = here.participant_id \
                     WHERE here.trial_id = $1",
                    of(&other, "")
                );
                let found = db.prepare_cached(&query)?.query_row([&trial_id], |row| row.get(0));
                Ok::<_, StoreError>(found.optional()?.flatten())
            };
            Ok([find("<", "DESC")?, find(">", "ASC")?])
        })
        .await
    }

    /// The ids of all trials of a participant, in plan order.
    pub async fn trial_ids(&self, participant_id: &str) -> Result<Vec<String>, StoreError> {
        let participant_id = participant_id.to_owned();
        self.read_long(move |db| {
            let query = "SELECT trial_id FROM stored_trial WHERE participant_id = $1 \
                         ORDER BY ordinal";
            let mut statement = db.prepare_cached(query)?;
            Ok(statement
                .query_map([participant_id], |row| row.get(0))?
                .collect::<Result<_, _>>()?)
        })
        .await
    }

    /// All trials of a participant, in plan order.
    pub async fn trials_of(&self, participant_id: &str) -> Result<Vec<StoredTrial>, StoreError> {
        let participant_id = participant_id.to_owned();
        self.read_long(move |db| whole(db, "participant_id", &participant_id)).await
    }

    /// Like [`Self::trials_of`], but returns an error with the id for each trial that cannot be read.
    ///
    /// # Errors
    /// [`StoreError`] if even the ids of the trials cannot be read.
    pub async fn each_trial_of(
        &self,
        participant_id: &str,
    ) -> Result<Vec<Result<StoredTrial, Unreadable>>, StoreError> {
        let all = participant_id.to_owned();
        match self.read_long(move |db| each(db, "participant_id", &all)).await {
            // A damaged page aborts a query.
            Err(StoreError::Corrupt(_)) => {}
            read => return read,
        }
        let mut found = Vec::new();
        for trial_id in self.planned_ids(participant_id).await? {
            let one = trial_id.clone();
            match self.read_long(move |db| each(db, "trial_id", &one)).await {
                Ok(read) => found.extend(read),
                Err(StoreError::Corrupt(what)) => found.push(Err(Unreadable { trial_id, what })),
                Err(error) => return Err(error),
            }
        }
        Ok(found)
    }

    /// The ids of all trials in a participant's plan, driven or not.
    async fn planned_ids(&self, participant_id: &str) -> Result<Vec<String>, StoreError> {
        let participant_id = participant_id.to_owned();
        self.read_long(move |db| {
            let query = "SELECT trial_id FROM scene WHERE participant_id = $1 ORDER BY ordinal";
            let mut statement = db.prepare_cached(query)?;
            Ok(statement
                .query_map([participant_id], |row| row.get(0))?
                .collect::<Result<_, _>>()?)
        })
        .await
    }
}

/// The columns that [`head_of`] reads.
const HEAD: &str = "sequence, trial_id, participant_id, participant_number, ordinal, phase, idx, \
                    received_at_ms, flags, closest_m, first_step_in_danger, avoidance_first, \
                    avoidance_last, attempt";

fn head_of(row: &Row) -> Result<TrialHead, StoreError> {
    let step = |column: usize| -> Result<Option<usize>, StoreError> {
        let step: Option<i64> = row.get(column)?;
        step.map(usize::try_from).transpose().map_err(StoreError::corrupt)
    };
    Ok(TrialHead {
        sequence: row.get(0)?,
        trial_id: row.get(1)?,
        participant_id: row.get(2)?,
        participant_number: row.get(3)?,
        ordinal: row.get(4)?,
        phase: phase_of(&row.get::<_, String>(5)?)?,
        index: usize::try_from(row.get::<_, i64>(6)?).map_err(StoreError::corrupt)?,
        attempt: row.get(13)?,
        received_at_ms: row.get(7)?,
        flags: flags(&row.get::<_, String>(8)?)?,
        outcome: Outcome {
            closest_m: row.get(9)?,
            first_step_in_danger: step(10)?,
            avoidance: step(11)?.zip(step(12)?),
        },
    })
}

/// The trials with this value in a column, in plan order.
pub(in crate::store) fn whole(
    db: &Connection,
    column: &'static str,
    value: &str,
) -> Result<Vec<StoredTrial>, StoreError> {
    let corrupt = |unreadable: Unreadable| StoreError::Corrupt(unreadable.what);
    each(db, column, value)?.into_iter().map(|read| read.map_err(corrupt)).collect()
}

/// Like [`whole`], but returns an error with the id for each trial that cannot be read.
fn each(
    db: &Connection,
    column: &'static str,
    value: &str,
) -> Result<Vec<Result<StoredTrial, Unreadable>>, StoreError> {
    let mut statement = db.prepare_cached(&format!(
        "SELECT {HEAD}, study, config_hash, started_at_ms, inputs, states, sampled_at_ms, \
             key_events, page_events, exposures, display, content_version, content_hash, {SCENE} \
         FROM stored_trial WHERE {column} = $1 ORDER BY ordinal"
    ))?;
    let trial = |row: &Row| -> Result<StoredTrial, StoreError> {
        let sampled_at_ms: Option<Vec<u8>> = row.get(19)?;
        let content = Content {
            started_at_ms: row.get(16)?,
            inputs: unpack_inputs(&row.get::<_, Vec<u8>>(17)?).map_err(StoreError::corrupt)?,
            states: unpack_states(&row.get::<_, Vec<u8>>(18)?),
            sampled_at_ms: sampled_at_ms.as_deref().map(unpack),
            key_events: row.get(20)?,
            page_events: row.get(21)?,
            exposures: row.get(22)?,
            display: row.get(23)?,
        };
        Ok(StoredTrial {
            head: head_of(row)?,
            study: row.get(14)?,
            config_hash: row.get(15)?,
            content,
            recipe: recipe(row.get(24)?)?,
            content_hash: row.get(25)?,
            scene: scene_of(row, 26)?,
        })
    };
    let read = |row: &Row| match trial(row) {
        Err(StoreError::Corrupt(what)) => Ok(Err(Unreadable { trial_id: row.get(1)?, what })),
        read => read.map(Ok),
    };
    statement.query_and_then([value], read)?.collect()
}

pub(super) fn recipe(number: i64) -> Result<Recipe, StoreError> {
    let unknown = || StoreError::Corrupt(format!("unknown content version {number}"));
    Recipe::from_number(number).ok_or_else(unknown)
}

fn flags(words: &str) -> Result<Vec<Flag>, StoreError> {
    let known = |word| Flag::from_word(word).ok_or_else(|| StoreError::unknown_word(word));
    words.split(';').filter(|word| !word.is_empty()).map(known).collect()
}
