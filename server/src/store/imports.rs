//! Imports trials from a file, batch by batch.

use super::lanes::Lock;
use super::profiles;
use super::scenes::{self, PlannedRow};
use super::sql::{Connection, Rows, ToSql, params};
use super::studies::{self, StoredStudy};
use super::tallies;
use super::trials::{self, NewTrial};
use super::{Store, StoreError};
use sidestep::study::StudyConfig;
use std::collections::HashSet;
use std::sync::Arc;

/// A participant whose trials come from a file.
#[derive(Clone, Debug)]
pub struct NewImport {
    /// The new participant's id.
    pub id: String,
    /// SHA-256 of the participant's part of the file. It identifies the participant if the file is
    /// imported again.
    pub hash: String,
    /// The reason why an experimenter excluded the participant before the file was written. `None`
    /// if the participant was not excluded.
    pub exclusion: Option<String>,
    /// The trials in order. The scene of a trial is its first state.
    pub trials: Vec<(PlannedRow, NewTrial)>,
}

/// The study into which a file is imported.
#[derive(Clone, Debug)]
pub struct Destination {
    /// The study.
    pub study: StoredStudy,
    /// Whether it was created for the import.
    pub is_new: bool,
}

/// The outcome of a batch.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Import {
    /// All participants of the batch are in the study.
    Done {
        /// Ids of the participants who had been imported before.
        skipped: Vec<String>,
    },
    /// Another participant has a trial with this id. Nothing in the batch was imported.
    TrialKnown {
        /// The trial.
        trial_id: String,
    },
}

/// Maximum number of participants deleted in one transaction.
const UNDONE_AT_ONCE: usize = 16;

impl Store {
    /// Finds or creates the study with the name of `config`. Returns `None` if the study's
    /// parameters differ from the parameters of `config`.
    pub async fn begin_import(
        &self,
        config: Arc<StudyConfig>,
        now_ms: i64,
    ) -> Result<Option<Destination>, StoreError> {
        self.write_behind([Lock::Studies], move |db| match studies::find(db, &config.slug)? {
            Some(study) if study.config.parameters != config.parameters => Ok(None),
            Some(study) => Ok(Some(Destination { study, is_new: false })),
            None => {
                let study = studies::put(db, &config, now_ms, false)?;
                Ok(Some(Destination { study, is_new: true }))
            }
        })
        .await
    }

    /// Imports some participants of a file, in one transaction.
    ///
    /// # Errors
    /// On [`StoreError`], nothing was imported.
    pub async fn import(
        &self,
        study: &StoredStudy,
        people: Vec<NewImport>,
        now_ms: i64,
    ) -> Result<Import, StoreError> {
        let study = study.clone();
        self.write_behind([Lock::Study(study.id)], move |db| import(db, &study, &people, now_ms))
            .await
    }

    /// Undoes an import. Deletes these participants, who must have been imported, with their
    /// trials. Also deletes the study if it was created for the import and has no other
    /// participants.
    pub async fn undo_import(
        &self,
        destination: &Destination,
        ids: &[String],
    ) -> Result<(), StoreError> {
        for ids in ids.chunks(UNDONE_AT_ONCE) {
            let ids = ids.to_vec();
            let locks = [Lock::Study(destination.study.id)];
            self.write_behind(locks, move |db| ids.iter().try_for_each(|id| delete(db, id)))
                .await?;
        }
        if !destination.is_new {
            return Ok(());
        }
        let StoredStudy { id, config_hash, .. } = destination.study.clone();
        self.write_behind([Lock::Studies], move |db| {
            db.execute(
                "DELETE FROM study_version WHERE study_id = $1 \
                     AND NOT EXISTS (SELECT 1 FROM participant WHERE study_id = $1)",
                [id],
            )?;
            db.execute(
                "DELETE FROM study WHERE id = $1 \
                     AND NOT EXISTS (SELECT 1 FROM participant WHERE study_id = $1)",
                [id],
            )?;
            db.execute(
                "DELETE FROM study_config WHERE hash = $1 \
                     AND NOT EXISTS (SELECT 1 FROM study WHERE config_hash = $1) \
                     AND NOT EXISTS (SELECT 1 FROM study_version WHERE config_hash = $1) \
                     AND NOT EXISTS (SELECT 1 FROM participant WHERE config_hash = $1) \
                     AND NOT EXISTS (SELECT 1 FROM safety_function WHERE config_hash = $1)",
                [config_hash],
            )?;
            Ok(())
        })
        .await
    }
}

/// The query that finds which of these trials are in a plan.
const PLANNED: Rows = Rows {
    before: "SELECT scene.trial_id FROM (VALUES ",
    after: ") AS asked JOIN scene ON scene.trial_id = asked.column1",
};

fn import(
    db: &Connection,
    study: &StoredStudy,
    people: &[NewImport],
    now_ms: i64,
) -> Result<Import, StoreError> {
    let mut is_there =
        db.prepare_cached("SELECT 1 FROM participant WHERE study_id = $1 AND import_hash = $2")?;
    // Everything is checked before the first write, so that a refusal changes nothing.
    let (mut skipped, mut new, mut ids) = (Vec::new(), Vec::new(), HashSet::new());
    for person in people {
        if is_there.exists(params![study.id, person.hash])? {
            skipped.push(person.id.clone());
            continue;
        }
        let trial_ids = || person.trials.iter().map(|(scene, _)| &scene.trial_id);
        let twice = trial_ids().find(|trial_id| !ids.insert(*trial_id)).cloned();
        let asked = trial_ids().map(|trial_id| vec![trial_id.value().into_owned()]);
        let planned = db.query_rows(&PLANNED, asked.collect())?;
        let planned = planned.first().map(|row| row.get(0)).transpose()?;
        if let Some(trial_id) = twice.or(planned) {
            return Ok(Import::TrialKnown { trial_id });
        }
        new.push(person);
    }
    for person in new {
        db.prepare_cached(
            "INSERT INTO participant (id, study_id, number, config_hash, import_hash, \
                 enrolled_at_ms, last_seen_at_ms) \
             VALUES ($1, $2, coalesce((SELECT max(number) FROM participant \
                 WHERE study_id = $2 AND pilot = FALSE), 0) + 1, $3, $4, $5, $5)",
        )?
        .execute(params![person.id, study.id, study.config_hash, person.hash, now_ms])?;
        if let Some(reason) = &person.exclusion {
            profiles::put_exclusion(db, &person.id, reason, now_ms, "import")?;
        }
        for (scene, trial) in &person.trials {
            scenes::insert(db, &person.id, scene)?;
            trials::insert_uncounted(db, study.id, trial)?;
        }
        tallies::count(db, &person.id)?;
    }
    Ok(Import::Done { skipped })
}

fn delete(db: &Connection, id: &str) -> Result<(), StoreError> {
    for query in [
        "DELETE FROM trial WHERE trial_id IN (SELECT trial_id FROM scene WHERE participant_id = $1)",
        "DELETE FROM scene WHERE participant_id = $1",
        "DELETE FROM exclusion WHERE participant_id = $1",
        "DELETE FROM participant WHERE id = $1 AND import_hash IS NOT NULL",
    ] {
        db.prepare_cached(query)?.execute([id])?;
    }
    Ok(())
}
