//! Trials that are imported from a file.

use super::scenes::{self, PlannedRow};
use super::studies;
use super::trials::{self, NewTrial};
use super::{Store, StoreError};
use rusqlite::{Connection, params};
use sidestep::study::StudyConfig;
use std::collections::HashSet;
use std::sync::Arc;

/// A participant whose trials come from a file.
#[derive(Clone, Debug)]
pub struct NewImport {
    /// The new participant's id.
    pub id: String,
    /// SHA-256 of the participant's part of the file: imported again, it is the same participant.
    pub hash: String,
    /// Their trials in order; the scene of each is its first state.
    pub trials: Vec<(PlannedRow, NewTrial)>,
}

/// The outcome of an import.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Import {
    /// All participants of the file are in the study now.
    Done {
        /// Ids of the participants who had been imported before.
        skipped: Vec<String>,
    },
    /// The study's parameters changed since the file was read; nothing was imported.
    StudyChanged,
    /// Another participant has a trial with this id; nothing was imported.
    TrialKnown {
        /// The trial.
        trial_id: String,
    },
}

impl Store {
    /// Imports participants into the study with the name of `config`, which is created if missing.
    ///
    /// # Errors
    /// [`StoreError`]; nothing was imported then.
    pub async fn import(
        &self,
        config: Arc<StudyConfig>,
        people: Vec<NewImport>,
        now_ms: i64,
    ) -> Result<Import, StoreError> {
        self.write_behind(move |db| import(db, &config, &people, now_ms)).await
    }
}

fn import(
    db: &Connection,
    config: &Arc<StudyConfig>,
    people: &[NewImport],
    now_ms: i64,
) -> Result<Import, StoreError> {
    let present = studies::find(db, &config.slug)?;
    let study = match present {
        Some(study) if study.config.parameters != config.parameters => {
            return Ok(Import::StudyChanged);
        }
        Some(study) => study,
        None => studies::put(db, config, now_ms)?,
    };
    let mut is_there =
        db.prepare("SELECT 1 FROM participant WHERE study_id = ?1 AND import_hash = ?2")?;
    let mut is_planned = db.prepare("SELECT 1 FROM scene WHERE trial_id = ?1")?;
    // Everything is checked before anything is written, so that a refusal changes nothing.
    let (mut skipped, mut new, mut ids) = (Vec::new(), Vec::new(), HashSet::new());
    for person in people {
        if is_there.exists(params![study.id, person.hash])? {
            skipped.push(person.id.clone());
            continue;
        }
        for (scene, _) in &person.trials {
            let trial_id = &scene.trial_id;
            if !ids.insert(trial_id) || is_planned.exists([trial_id])? {
                return Ok(Import::TrialKnown { trial_id: trial_id.clone() });
            }
        }
        new.push(person);
    }
    for person in new {
        db.prepare_cached(
            "INSERT INTO participant (id, study_id, number, config_hash, import_hash, \
                 enrolled_at_ms, last_seen_at_ms) \
             SELECT ?1, ?2, coalesce(max(number), 0) + 1, ?3, ?4, ?5, ?5 \
             FROM participant WHERE study_id = ?2 AND pilot = 0",
        )?
        .execute(params![person.id, study.id, study.config_hash, person.hash, now_ms])?;
        for (scene, trial) in &person.trials {
            scenes::insert(db, &person.id, scene)?;
            trials::insert(db, study.id, trial)?;
        }
    }
    Ok(Import::Done { skipped })
}
