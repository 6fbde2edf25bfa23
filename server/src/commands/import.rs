//! `sidestep import`.

use super::{CommandError, print_json};
use crate::clock::now_ms;
use crate::content::{Content, Recipe};
use crate::formats::trials_csv;
use crate::jobs::safety;
use crate::store::imports::{Import, NewImport};
use crate::store::scenes::PlannedRow;
use crate::store::trials::NewTrial;
use crate::store::{Missing, OpenError, Store};
use serde::Serialize;
use sha2::{Digest, Sha256};
use sidestep::invalid::Invalid;
use sidestep::recording::{Fault, RecordedParticipant, RecordedTrial};
use sidestep::scene::{Scene, SceneParameters};
use sidestep::study::StudyConfig;
use sidestep::synthetic;
use sidestep::trial::{Flag, flags, outcome};
use std::fs::File;
use std::path::PathBuf;
use std::sync::Arc;
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
    // A file that is refused leaves no new database behind.
    let present = match Store::open(&args.database, Missing::Refuse).await {
        Err(OpenError::Absent(_)) => None,
        opened => Some(opened?),
    };
    let known = match &present {
        Some(store) => store.study(&args.study).await?,
        None => None,
    };
    let config = known.map_or_else(|| Arc::new(wanted), |study| study.config);
    let complain = |error: &dyn std::fmt::Display| CommandError::Input(format!("{name}: {error}"));
    let people = trials_csv::read(std::io::BufReader::new(file), &config.parameters)
        .map_err(|error| complain(&error))?;
    let store = match present {
        Some(store) => store,
        None => Store::open(&args.database, Missing::Create).await?,
    };
    // Everything is computed before anything is written: a server may receive uploads meanwhile.
    let new: Vec<_> = people.iter().map(|person| import_of(&config.parameters, person)).collect();
    let slug = config.slug.clone();
    let ids: Vec<_> = new.iter().map(|person| person.id.clone()).collect();
    let flagged = |person: &NewImport| {
        person.trials.iter().filter(|(_, trial)| Flag::question(&trial.flags)).count()
    };
    let counts: Vec<_> = new.iter().map(|person| (person.trials.len(), flagged(person))).collect();
    let skipped = match store.import(config, new, now_ms()).await? {
        Import::Done { skipped } => skipped,
        Import::StudyChanged => {
            let message = format!("study {slug} was changed meanwhile; try again");
            return Err(CommandError::Failure(message));
        }
        Import::TrialKnown { trial_id } => {
            let expected = "trials that are not in this database yet";
            let what = Invalid::new("trial_id", expected, &trial_id);
            let mut trials = people.iter().flat_map(|person| &person.trials);
            let trial = trials.rfind(|trial| trial.trial_id.as_ref() == Some(&trial_id));
            return Err(complain(&Fault { line: trial.and_then(|trial| trial.line), what }));
        }
    };
    if let Some(study) = store.study(&slug).await? {
        safety::keep_exact(&store, &study).await?;
    }
    store.close().await;
    let mut done = Imported { skipped: skipped.len(), ..Imported::default() };
    for (_, (trials, flagged)) in ids.iter().zip(counts).filter(|(id, _)| !skipped.contains(id)) {
        done.participants += 1;
        done.trials += trials;
        done.flagged += flagged;
    }
    if done.skipped > 0 {
        let skipped = done.skipped;
        eprintln!("{name}: {skipped} participants were in study {slug} already and were skipped");
    }
    print_json(&done)
}

/// A participant of the file, as the store keeps them.
fn import_of(parameters: &SceneParameters, person: &RecordedParticipant) -> NewImport {
    let display = match synthetic::recognised(std::slice::from_ref(person)) {
        Some(_) => r#"{"synthetic":true}"#,
        None => "{}",
    };
    let mut rows: Vec<PlannedRow> = Vec::new();
    let mut hash = Sha256::new();
    hash.update(person.name.as_bytes());
    let trials = person.trials.iter().map(|trial| {
        let row = planned(parameters, &rows, trial);
        let new = imported(parameters, &row, trial, display);
        hash.update(trial.phase.word());
        hash.update(trial.number.to_le_bytes());
        hash.update(new.content_hash);
        rows.push(row.clone());
        (row, new)
    });
    let trials = trials.collect();
    NewImport { id: Uuid::new_v4().to_string(), hash: hex::encode(hash.finalize()), trials }
}

fn imported(
    parameters: &SceneParameters,
    row: &PlannedRow,
    trial: &RecordedTrial,
    display: &str,
) -> NewTrial {
    let content = Content {
        started_at_ms: trial.started_at_ms,
        inputs: trial.inputs.clone(),
        states: trial.states.clone(),
        sampled_at_ms: trial.sampled_at_ms.clone(),
        key_events: "[]".to_owned(),
        page_events: None,
        exposures: None,
        display: display.to_owned(),
    };
    NewTrial {
        trial_id: row.trial_id.clone(),
        recipe: Recipe::PackedBytes,
        content_hash: Recipe::PackedBytes.hash(&content),
        received_at_ms: now_ms(),
        content,
        flags: flags_of(parameters, &row.scene, trial),
        outcome: outcome(parameters, &trial.inputs, &trial.states),
        repeated_as: None,
    }
}

/// The planned scene of a trial that comes after `earlier` ones. A file holds no plan: the scene is the
/// trial's first state, and a further attempt at a scene is one from the same state.
fn planned(
    parameters: &SceneParameters,
    earlier: &[PlannedRow],
    trial: &RecordedTrial,
) -> PlannedRow {
    let start = trial.states[0];
    let scene = Scene::new(parameters, start.human, start.robot);
    let in_phase = || earlier.iter().filter(|row| row.phase == trial.phase);
    let first = in_phase().find(|row| row.scene == scene).filter(|_| trial.attempt > 1);
    let is_taken =
        |index: usize| in_phase().any(|row| row.index == index && row.attempt == trial.attempt);
    let (index, attempt) = match first {
        Some(first) if !is_taken(first.index) => (first.index, trial.attempt),
        _ => (in_phase().map(|row| row.index + 1).max().unwrap_or(0), 1),
    };
    PlannedRow {
        trial_id: trial.trial_id.clone().unwrap_or_else(|| Uuid::new_v4().to_string()),
        ordinal: earlier.len() as i64,
        phase: trial.phase,
        index,
        attempt,
        scene,
        stored: false,
    }
}

/// The flags that the recording shows, those that it was exported with, and `imported`.
fn flags_of(parameters: &SceneParameters, scene: &Scene, trial: &RecordedTrial) -> Vec<Flag> {
    let times = trial.sampled_at_ms.as_deref().unwrap_or_default();
    let mut flags = flags(parameters, scene, &trial.inputs, &trial.states, times);
    flags.extend(&trial.flags);
    flags.push(Flag::Imported);
    flags.sort_unstable();
    flags.dedup();
    flags
}
