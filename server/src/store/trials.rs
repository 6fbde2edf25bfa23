//! Storing trials. The module `stored` reads them.

mod stored;

pub(super) use self::stored::whole;
pub use self::stored::{StoredTrial, TrialHead, Unreadable};

use self::stored::recipe;
use super::lanes::Lock;
use super::participants::{self, COLUMNS, TOKEN, Visitor};
use super::scenes::{self, SCENE, phase_of, scene_of};
use super::sql::{Connection, OptionalExtension, Question, Rows, Value, params};
use super::tallies::{self, Counted};
use super::{Store, StoreError};
use crate::support::bytes::{pack, pack_inputs, pack_states};
use crate::trial_content::{Content, Recipe};
use sidestep::scene::Scene;
use sidestep::study::StudyConfig;
use sidestep::trial::{Flag, Outcome, Phase};
use std::sync::Arc;

/// A trial to store.
#[derive(Clone, Debug)]
pub struct NewTrial {
    /// The id of its planned scene.
    pub trial_id: String,
    /// How the content hash is computed.
    pub recipe: Recipe,
    /// Hash of the content.
    pub content_hash: [u8; 32],
    /// When the trial was received.
    pub received_at_ms: i64,
    /// The driven trial.
    pub content: Content,
    /// Its flags.
    pub flags: Vec<Flag>,
    /// Its outcome.
    pub outcome: Outcome,
    /// A number derived from the times of its key events, if there are enough events.
    pub key_timing: Option<i64>,
    /// The id for a further trial in the same scene, if the scene must be driven again.
    pub repeated_as: Option<String>,
    /// Number of further trials that wait in the participant's browser.
    pub waiting: u32,
}

/// A scene of a participant's plan.
#[derive(Clone, Debug)]
pub struct AssignedScene {
    /// Its phase.
    pub phase: Phase,
    /// 1, or 2 if the scene is driven again because its first trial was interrupted.
    pub attempt: u32,
    /// Both vehicles and the goal.
    pub scene: Scene,
}

/// Data about an upload that are known before its body is read: the participant and the assigned scene.
#[derive(Clone, Debug)]
pub struct Assignment {
    /// The participant.
    pub visitor: Visitor,
    /// The configuration of their enrolment.
    pub config: Arc<StudyConfig>,
    /// The scene of the trial, or `None` if the trial is not in their plan.
    pub scene: Option<AssignedScene>,
}

/// The outcome of an upload.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum PutTrial {
    /// The trial was stored.
    Stored {
        /// The next trial, or `None` after the last trial.
        next: Option<String>,
    },
    /// The same content had been stored before.
    Same {
        /// The next trial, or `None` after the last trial.
        next: Option<String>,
    },
    /// The trial was stored before with different content, which is kept.
    Different,
    /// Another trial must be stored first.
    OutOfOrder {
        /// The next trial.
        next: String,
    },
    /// The participant has withdrawn, so nothing was stored.
    Withdrawn,
    /// The trial is not in this participant's plan.
    Unknown,
}

impl Store {
    /// The participant with this token, and the scene assigned to them as `trial_id`. Returns
    /// `None` for an unknown token.
    pub async fn assignment(
        &self,
        token_hash: [u8; 32],
        trial_id: &str,
    ) -> Result<Option<Assignment>, StoreError> {
        let (store, trial_id) = (self.clone(), trial_id.to_owned());
        let asked = format!(
            "SELECT {COLUMNS}, {TOKEN}, scene.phase, scene.attempt, {SCENE} FROM participant_token \
             JOIN participant ON participant.id = participant_token.participant_id \
             JOIN study ON study.id = participant.study_id \
             LEFT JOIN scene ON scene.trial_id = $2 AND scene.participant_id = participant.id \
             WHERE participant_token.hash = $1"
        );
        self.read(move |db| {
            let mut statement = db.prepare_cached(&asked)?;
            let mut found = statement.query_and_then(params![token_hash, trial_id], |row| {
                let after = Visitor::WIDTH;
                let scene = match row.get::<_, Option<String>>(after)? {
                    Some(phase) => Some(AssignedScene {
                        phase: phase_of(&phase)?,
                        attempt: row.get(after + 1)?,
                        scene: scene_of(row, after + 2)?,
                    }),
                    None => None,
                };
                Ok::<_, StoreError>((Visitor::of(row)?, scene))
            })?;
            let Some(found) = found.next() else { return Ok(None) };
            let (visitor, scene) = found?;
            let config = store.config_in(db, &visitor.participant.config_hash)?;
            Ok(Some(Assignment { visitor, config, scene }))
        })
        .await
    }

    /// Stores a participant's trial if it is the next one. A stored trial never changes.
    ///
    /// # Errors
    /// On [`StoreError`], nothing was stored.
    pub async fn put_trial(
        &self,
        participant_id: &str,
        trial: NewTrial,
    ) -> Result<PutTrial, StoreError> {
        let participant_id = participant_id.to_owned();
        let locks = [Lock::Participant(participant_id.clone())];
        let place = place(&participant_id, &trial.trial_id);
        self.write_first(locks, Some(place), move |db| put(db, &participant_id, &trial)).await
    }
}

/// Flags as stored and exported: words joined by semicolons.
#[must_use]
pub fn flag_words(flags: &[Flag]) -> String {
    let words: Vec<_> = flags.iter().map(|flag| flag.word()).collect();
    words.join(";")
}

/// The position of a trial in its plan, read under the write lock.
struct Place {
    study_id: i64,
    withdrawn: bool,
    stored: Option<(i64, [u8; 32])>,
    /// Whether the trial is the first, or the trial before it is stored. Trials are stored in order, so
    /// all earlier trials are stored, too.
    its_turn: bool,
    next: Option<String>,
    phase: Phase,
    next_phase: Option<Phase>,
}

/// The query for the positions of trials in their participants' plans. A row of parameters has the ids
/// of the participant and of the trial.
const PLACE: Rows = Rows {
    before: "SELECT participant.id, participant.study_id, participant.withdrawn_at_ms IS NOT NULL, \
                 trial.content_version, trial.content_hash, \
                 scene.ordinal = 0 OR EXISTS (SELECT 1 FROM scene AS ahead \
                     JOIN trial ON trial.trial_id = ahead.trial_id \
                     WHERE ahead.participant_id = scene.participant_id \
                         AND ahead.ordinal = scene.ordinal - 1), \
                 after.trial_id, scene.phase, after.phase \
             FROM (VALUES ",
    after: ") AS asked JOIN scene ON scene.trial_id = asked.column2 \
                 AND scene.participant_id = asked.column1 \
             JOIN participant ON participant.id = scene.participant_id \
             LEFT JOIN trial ON trial.trial_id = scene.trial_id \
             LEFT JOIN scene AS after ON after.participant_id = scene.participant_id \
                 AND after.ordinal = scene.ordinal + 1",
};

/// The query for the position of a trial in its participant's plan.
fn place(participant_id: &str, trial_id: &str) -> Question {
    let text = |text: &str| Value::Text(text.to_owned().into());
    (&PLACE, vec![text(participant_id), text(trial_id)])
}

fn put(db: &Connection, participant_id: &str, trial: &NewTrial) -> Result<PutTrial, StoreError> {
    let found = db.query_ahead(place(participant_id, &trial.trial_id), |row| {
        let version: Option<i64> = row.get(3)?;
        let phase = |word: Option<String>| word.as_deref().map(phase_of).transpose();
        Ok::<_, StoreError>(Place {
            study_id: row.get(1)?,
            withdrawn: row.get(2)?,
            stored: match version {
                Some(version) => Some((version, row.get(4)?)),
                None => None,
            },
            its_turn: row.get(5)?,
            next: row.get(6)?,
            phase: phase_of(&row.get::<_, String>(7)?)?,
            next_phase: phase(row.get(8)?)?,
        })
    })?;
    let Some(place) = found else {
        return Ok(match is_withdrawn(db, participant_id)? {
            true => PutTrial::Withdrawn,
            false => PutTrial::Unknown,
        });
    };
    if place.withdrawn {
        return Ok(PutTrial::Withdrawn);
    }
    if let Some((version, hash)) = place.stored {
        let recipe = recipe(version)?;
        let same = match recipe == trial.recipe {
            true => trial.content_hash,
            false => recipe.hash(&trial.content),
        };
        return Ok(match hash == same {
            true => {
                tallies::waits(db, participant_id, trial.waiting)?;
                PutTrial::Same { next: scenes::next(db, participant_id)? }
            }
            false => PutTrial::Different,
        });
    }
    if !place.its_turn {
        let next = scenes::next(db, participant_id)?;
        let next = next.ok_or_else(|| StoreError::corrupt("a plan without a next trial"))?;
        return Ok(PutTrial::OutOfOrder { next });
    }
    let whose = Driven {
        study_id: place.study_id,
        participant_id,
        phase: place.phase,
        next_phase: place.next_phase,
    };
    insert(db, &whose, trial)?;
    participants::seen(db, participant_id, trial.received_at_ms)?;
    let Some(again) = &trial.repeated_as else {
        return Ok(PutTrial::Stored { next: place.next });
    };
    scenes::repeat(db, &trial.trial_id, again)?;
    tallies::goes_on(db, again)?;
    Ok(PutTrial::Stored { next: place.next.or_else(|| Some(again.clone())) })
}

fn is_withdrawn(db: &Connection, participant_id: &str) -> Result<bool, StoreError> {
    let query = "SELECT withdrawn_at_ms IS NOT NULL FROM participant WHERE id = $1";
    let found = db.prepare_cached(query)?.query_row([participant_id], |row| row.get(0));
    Ok(found.optional()?.unwrap_or(false))
}

/// The participant of a trial, and its position in the plan.
struct Driven<'a> {
    /// The id of the study's row.
    study_id: i64,
    /// The participant.
    participant_id: &'a str,
    /// The phase of the trial.
    phase: Phase,
    /// The phase of the next scene, if there is one.
    next_phase: Option<Phase>,
}

const INSERT: Rows = Rows {
    before: "INSERT INTO trial (trial_id, study_id, content_version, content_hash, received_at_ms, \
                 started_at_ms, inputs, states, sampled_at_ms, key_events, page_events, exposures, \
                 display, flags, closest_m, first_step_in_danger, avoidance_first, avoidance_last, \
                 key_timing) VALUES ",
    after: "",
};

/// Stores a trial and counts it.
fn insert(db: &Connection, whose: &Driven<'_>, new: &NewTrial) -> Result<(), StoreError> {
    let content = &new.content;
    let counted = Counted {
        participant_id: whose.participant_id,
        phase: whose.phase,
        next_phase: whose.next_phase,
        inputs: &content.inputs,
        flags: &new.flags,
        outcome: &new.outcome,
        key_timing: new.key_timing,
        waiting: new.waiting,
    };
    tallies::add(db, whose.study_id, &counted)?;
    insert_uncounted(db, whose.study_id, new)
}

/// Stores a trial without counting it.
pub(super) fn insert_uncounted(
    db: &Connection,
    study_id: i64,
    new: &NewTrial,
) -> Result<(), StoreError> {
    let step = |step: Option<usize>| step.map(|step| step as i64);
    let (content, avoidance) = (&new.content, new.outcome.avoidance);
    let row = params![
        new.trial_id,
        study_id,
        new.recipe.number(),
        new.content_hash,
        new.received_at_ms,
        content.started_at_ms,
        pack_inputs(&content.inputs),
        pack_states(&content.states),
        content.sampled_at_ms.as_ref().map(|times| pack(times.iter().copied())),
        content.key_events,
        content.page_events,
        content.exposures,
        content.display,
        flag_words(&new.flags),
        new.outcome.closest_m,
        step(new.outcome.first_step_in_danger),
        step(avoidance.map(|(first, _)| first)),
        step(avoidance.map(|(_, last)| last)),
        new.key_timing,
    ];
    Ok(db.execute_row_later(&INSERT, &[&new.trial_id], row)?)
}
