//! `sidestep import`.

use super::{CommandError, print_json};
use crate::clock::now_ms;
use crate::content;
use crate::formats::trials_csv;
use crate::jobs::safety;
use crate::store::participants::{self, NewParticipant};
use crate::store::scenes::{self, PlannedRow};
use crate::store::studies::{self, Study};
use crate::store::trials::{self, NewTrial};
use crate::store::{Db, Missing, Store};
use serde::Serialize;
use sha2::{Digest, Sha256};
use sidestep::invalid::Invalid;
use sidestep::recording::{Fault, RecordedParticipant, RecordedTrial};
use sidestep::scene::{Scene, SceneParameters};
use sidestep::study::StudyConfig;
use sidestep::synthetic;
use sidestep::trial::{Flag, flags, outcome};
use std::collections::BTreeMap;
use std::fs::File;
use std::path::PathBuf;
use uuid::Uuid;

/// Import trials from a file into a study: the whole file or nothing.
///
/// Participants that were imported from the same file before are skipped. States that do
/// not replay from the inputs are kept and flagged.
#[derive(Clone, Debug, clap::Args)]
pub struct ImportArgs {
    /// Database: sqlite: followed by a file, which is created if it does not exist.
    #[arg(long, value_name = "URL", default_value = "sqlite:sidestep.db")]
    pub database: String,
    /// Name of the study in addresses; the study is created with the paper's protocol if it
    /// does not exist.
    #[arg(long, value_name = "SLUG", default_value = "default")]
    pub study: String,
    /// CSV file with at least the columns
    /// participant,trial,step,t,hx,hy,hpsi,rx,ry,rpsi,omega in any order.
    #[arg(long, value_name = "FILE")]
    pub trials: PathBuf,
}

/// The counts of an import.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Imported {
    /// Participants who were imported.
    pub participants: usize,
    /// Their trials.
    pub trials: usize,
    /// Trials with a flag other than that they were imported.
    pub flagged: usize,
    /// Participants of the file who had been imported before.
    pub skipped: usize,
}

/// Imports and prints the counts.
///
/// # Errors
/// [`CommandError`] for a file that is not a trials.csv (input, with the line), or a
/// database that refuses (failure).
pub async fn run(args: ImportArgs) -> Result<(), CommandError> {
    let name = args.trials.display().to_string();
    let file = File::open(&args.trials)
        .map_err(|e| CommandError::Input(format!("{name}: cannot read: {e}")))?;
    let wanted = StudyConfig { slug: args.study.clone(), ..StudyConfig::default() };
    wanted.check().map_err(|e| {
        CommandError::Input(format!("--study: expected {}, found {}", e.expected, e.found))
    })?;
    let store = Store::open(&args.database, Missing::Create).await?;
    // Read before the write lock is taken: a server may be collecting meanwhile.
    let known = studies::find(&mut *store.reader().await?, &args.study).await?;
    let config = known.map_or(wanted, |study| study.config);
    let complain = |error: &dyn std::fmt::Display| CommandError::Input(format!("{name}: {error}"));
    let people = trials_csv::read(std::io::BufReader::new(file), &config.parameters)
        .map_err(|error| complain(&error))?;
    let mut db = store.write().await?;
    let study = found_or_made(&mut db, &config).await?;
    let mut done = Imported::default();
    for person in &people {
        let hash = hash(person);
        if participants::is_imported(&mut db, study.id, &hash).await? {
            done.skipped += 1;
            continue;
        }
        done.participants += 1;
        insert(&mut db, &study, person, &hash, &mut done)
            .await?
            .map_err(|fault| complain(&fault))?;
    }
    db.commit().await?;
    store.close().await;
    if done.skipped > 0 {
        let (skipped, slug) = (done.skipped, &study.slug);
        eprintln!("{name}: {skipped} participants were in study {slug} already and were skipped");
    }
    print_json(&done)
}

/// The study, as it was when the file was read with its parameters.
async fn found_or_made(db: &mut Db, config: &StudyConfig) -> Result<Study, CommandError> {
    if let Some(study) = studies::find(db, &config.slug).await? {
        if study.config.parameters == config.parameters {
            return Ok(study);
        }
        let message = format!("study {} was changed meanwhile; try again", config.slug);
        return Err(CommandError::Failure(message));
    }
    studies::put(db, config, now_ms()).await?;
    safety::keep_exact(db, config).await?;
    let found = studies::find(db, &config.slug).await?;
    found.ok_or_else(|| CommandError::Failure("the study that was made is not there".to_owned()))
}

/// Of the person's name in the file and all their trials.
fn hash(person: &RecordedParticipant) -> String {
    let mut hash = Sha256::new();
    hash.update(person.name.as_bytes());
    for trial in &person.trials {
        hash.update(trial.phase.word());
        hash.update(trial.number.to_le_bytes());
        hash.update(content_hash(trial));
    }
    hex::encode(hash.finalize())
}

fn content_hash(trial: &RecordedTrial) -> [u8; 32] {
    content::of_import(&trial.inputs, &trial.states, trial.sampled_at_ms.as_deref())
}

/// One person with plan and trials. The inner error is the file's.
async fn insert(
    db: &mut Db,
    study: &Study,
    person: &RecordedParticipant,
    import_hash: &str,
    done: &mut Imported,
) -> Result<Result<(), Fault>, CommandError> {
    let id = Uuid::new_v4().to_string();
    let new = NewParticipant {
        id: &id,
        study_id: study.id,
        config_hash: &study.config.hash(),
        import_hash: Some(import_hash),
        enrolled_at_ms: now_ms(),
        ..NewParticipant::default()
    };
    participants::insert(db, &new).await?;
    let parameters = &study.config.parameters;
    let display = match synthetic::recognised(std::slice::from_ref(person)) {
        Some(_) => r#"{"synthetic":true}"#,
        None => "{}",
    };
    let mut in_phase = BTreeMap::new();
    for (ordinal, trial) in (0..).zip(&person.trials) {
        let trial_id = match &trial.trial_id {
            Some(trial_id) if scenes::exists(db, trial_id).await? => {
                let expected = "trials that are not in this database yet";
                let what = Invalid::new("trial_id", expected, trial_id);
                return Ok(Err(Fault { line: trial.line, what }));
            }
            Some(trial_id) => trial_id.clone(),
            None => Uuid::new_v4().to_string(),
        };
        let index = in_phase.entry(trial.phase).or_insert(0);
        let row = planned(parameters, &trial_id, ordinal, *index, trial);
        *index += 1;
        scenes::insert(db, &id, &row).await?;
        let flags = flags_of(parameters, &row.scene, trial);
        trials::insert(
            db,
            &NewTrial {
                trial_id: &trial_id,
                content_hash: content_hash(trial),
                received_at_ms: now_ms(),
                started_at_ms: trial.started_at_ms,
                inputs: &trial.inputs,
                states: &trial.states,
                sampled_at_ms: trial.sampled_at_ms.as_deref(),
                key_events: "[]",
                display,
                flags: &flags,
                outcome: outcome(parameters, &trial.inputs, &trial.states),
            },
        )
        .await?;
        done.trials += 1;
        done.flagged += usize::from(flags.len() > 1);
    }
    Ok(Ok(()))
}

/// A file holds no plan: the scene is what was driven from.
fn planned(
    parameters: &SceneParameters,
    trial_id: &str,
    ordinal: i64,
    index: usize,
    trial: &RecordedTrial,
) -> PlannedRow {
    let start = trial.states[0];
    PlannedRow {
        trial_id: trial_id.to_owned(),
        ordinal,
        phase: trial.phase,
        index,
        scene: Scene::new(parameters, start.human, start.robot),
        stored: false,
    }
}

/// What the recording shows, what was known when it was exported, and that it was
/// imported.
fn flags_of(parameters: &SceneParameters, scene: &Scene, trial: &RecordedTrial) -> Vec<Flag> {
    let times = trial.sampled_at_ms.as_deref().unwrap_or_default();
    let mut flags = flags(parameters, scene, &trial.inputs, &trial.states, times);
    flags.extend(&trial.flags);
    flags.push(Flag::Imported);
    flags.sort_unstable();
    flags.dedup();
    flags
}
