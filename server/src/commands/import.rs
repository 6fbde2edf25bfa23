//! `sidestep import`.

mod two_passes;

use super::solving::Interrupt;
use super::trials_file::excluded_beside;
use super::{CommandError, print_json, table_file};
use crate::jobs::safety;
use crate::store::imports::{Destination, Import, NewImport};
use crate::store::scenes::PlannedRow;
use crate::store::trials::NewTrial;
use crate::store::{OpenError, Purpose, Store};
use crate::support::clock::now_ms;
use crate::trial_content::{Content, Recipe};
use serde::Serialize;
use sha2::{Digest, Sha256};
use sidestep::invalid::Invalid;
use sidestep::plausibility;
use sidestep::recording::{Fault, RecordedParticipant, RecordedTrial};
use sidestep::scene::{Scene, SceneParameters};
use sidestep::study::StudyConfig;
use sidestep::synthetic;
use sidestep::trial::{Flag, Record, flags, outcome, verify};
use std::fmt::Display;
use std::ops::ControlFlow;
use std::path::PathBuf;
use std::sync::Arc;
use tokio::sync::mpsc;
use two_passes::Source;
use uuid::Uuid;

/// Import trials from a file into a study: the whole file or nothing.
///
/// Skips participants who were imported from the same file before. States that do not replay from
/// the inputs are kept and flagged. Exclusions in a participants.csv beside steps.csv are kept;
/// questionnaires, notes, key presses and codes are not imported. The file is read twice: it is
/// checked to its end before anything is stored. Then participants are stored a few at a time,
/// while a server may run. After an error, they are deleted again. After a power failure, the
/// participants already stored are complete. Run the import again to add the rest.
#[derive(Clone, Debug, clap::Args)]
pub struct ImportArgs {
    /// Database: sqlite:FILE, created if it does not exist, or postgres://USER@HOST/DATABASE.
    #[arg(long, value_name = "URL", default_value = "sqlite:sidestep.db")]
    pub database: String,
    /// Name of the study in URLs. A study that does not exist is created with the paper's protocol.
    #[arg(long, value_name = "SLUG", default_value = "default")]
    pub study: String,
    /// CSV file of trials, such as steps.csv of an export; - reads stdin.
    ///
    /// It needs at least the columns participant,trial,step,t,hx,hy,hpsi,rx,ry,rpsi,omega in any
    /// order. The delimiter may be a semicolon or a tab, with decimal commas, as spreadsheets write
    /// them. Memory does not grow with the file if the rows of each participant are together. If a
    /// manifest.json beside the file names it, its SHA-256 must match.
    #[arg(long, value_name = "FILE")]
    pub trials: PathBuf,
}

/// The counts of an import.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Imported {
    /// Participants who were imported.
    pub participants: usize,
    /// Trials of the imported participants.
    pub trials: usize,
    /// Trials with a flag other than `imported`.
    pub flagged: usize,
    /// Participants of the file who were imported earlier.
    pub skipped: usize,
    /// Imported participants who are excluded according to the table of participants beside the file.
    pub excluded: usize,
}

/// Imports the file and prints the counts.
///
/// # Errors
/// [`CommandError`] for a file that is not a trials.csv (input, with the line), or a database error
/// (failure).
pub async fn run(args: ImportArgs) -> Result<(), CommandError> {
    super::backup::no_address("--trials", &args.trials)?;
    let name = table_file::name(&args.trials);
    let complain = |error: &dyn Display| CommandError::Input(format!("{name}: {error}"));
    let source = Source::open(&args.trials).map_err(|e| complain(&format!("cannot read: {e}")))?;
    let wanted = StudyConfig { slug: args.study.clone(), ..StudyConfig::default() };
    wanted.check().map_err(|e| {
        CommandError::Input(format!("--study: expected {}, found {}", e.expected, e.found))
    })?;
    // Do not create a new database yet, because the file might be refused.
    let present = match Store::open(&args.database, Purpose::Change).await {
        Err(OpenError::Absent(_)) => None,
        opened => Some(opened?),
    };
    let known = match &present {
        Some(store) => store.study(&args.study).await?,
        None => None,
    };
    let config = known.map_or_else(|| Arc::new(wanted), |study| study.config);
    let reasons = excluded_beside(&args.trials)?;
    let interrupt = Interrupt::listen();
    let (study, only_synthetic) = (Arc::clone(&config), config.synthetic);
    let parameters = study.parameters;
    let checking = tokio::task::spawn_blocking(move || source.checked(&parameters));
    let checked = interrupt.unless_stopped(checking).await?.map_err(CommandError::failure)?;
    let (file, dialect) = checked.map_err(|error| complain(&error))?;
    table_file::tell(&args.trials, dialect);
    let store = match present {
        Some(store) => store,
        None => Store::open(&args.database, Purpose::Create).await?,
    };
    let Some(destination) = store.begin_import(config, now_ms()).await? else {
        let message = format!("study {} was changed meanwhile; try again", args.study);
        return Err(CommandError::Failure(message));
    };
    // This thread reads and computes, while the store's own thread writes.
    let (sender, mut batches) = mpsc::channel(2);
    let reading = tokio::task::spawn_blocking(move || {
        let mut batch = Batch::default();
        let mut refused = None;
        let read = file.each(&parameters, |person| {
            if only_synthetic && synthetic::recognised(std::slice::from_ref(&person)).is_none() {
                let expected = "1 in a study that takes synthetic participants only";
                let found = format!("participant {} without this mark", person.name);
                let what = Invalid::new("synthetic", expected, found);
                refused = Some(Fault { line: person.line, what });
                return ControlFlow::Break(());
            }
            let exclusion = reasons.get(&person.name).cloned();
            batch.add(&study, person, exclusion);
            let is_full = batch.trials >= BATCH;
            match is_full && sender.blocking_send(std::mem::take(&mut batch)).is_err() {
                true => ControlFlow::Break(()),
                false => ControlFlow::Continue(()),
            }
        });
        if let Some(fault) = refused {
            return Err(fault.to_string());
        }
        // If the import has failed, sending fails too, because the receiver was dropped.
        let _ = read.is_ok() && sender.blocking_send(batch).is_ok();
        read
    });
    let mut done = Done::default();
    let mut stored = Ok(());
    while let Some(batch) = batches.recv().await {
        stored = match interrupt.check() {
            Ok(()) => done.store(&store, &destination, batch, &complain).await,
            stopped => stopped,
        };
        if stored.is_err() {
            break;
        }
    }
    drop(batches);
    let read = reading.await.map_err(CommandError::failure)?;
    if let Err(error) = stored.and_then(|()| read.map_err(|error| complain(&error))) {
        if let Err(undo) = store.undo_import(&destination, &done.ids).await {
            let left = format!("{} participants stay in the study: {undo}", done.ids.len());
            return Err(CommandError::Failure(format!("{error}; {left}")));
        }
        store.close().await;
        return Err(error);
    }
    safety::keep_exact(&store, &destination.study).await?;
    store.close().await;
    let counts = done.counts;
    if counts.skipped > 0 {
        let (skipped, slug) = (counts.skipped, &args.study);
        eprintln!("{name}: {skipped} participants were in study {slug} already and were skipped");
    }
    if counts.flagged > 0 && counts.flagged == counts.trials {
        eprintln!(
            "{name}: every trial is flagged: its states do not replay from its inputs, or this study's vehicles cannot \
             drive them. Columns hpsi and rpsi are headings in radians, omega is a turn rate in rad/s; sidestep features \
             --trials says what does not fit"
        );
    }
    print_json(&counts)
}

/// Number of trials in a batch after which its participants are stored.
const BATCH: usize = 256;

/// A batch of participants from the file.
#[derive(Default)]
struct Batch {
    people: Vec<NewImport>,
    /// The id and the line of each trial that has an id in the file.
    lines: Vec<(String, u64)>,
    trials: usize,
}

impl Batch {
    fn add(&mut self, study: &StudyConfig, person: RecordedParticipant, exclusion: Option<String>) {
        let line = |trial: &RecordedTrial| Some((trial.trial_id.clone()?, trial.line?));
        self.lines.extend(person.trials.iter().filter_map(line));
        self.trials += person.trials.len();
        self.people.push(NewImport { exclusion, ..import_of(study, person) });
    }
}

/// The counts so far, and the ids of the imported participants.
#[derive(Default)]
struct Done {
    counts: Imported,
    ids: Vec<String>,
}

impl Done {
    async fn store(
        &mut self,
        store: &Store,
        destination: &Destination,
        batch: Batch,
        complain: &impl Fn(&dyn Display) -> CommandError,
    ) -> Result<(), CommandError> {
        let Batch { people, lines, .. } = batch;
        let flagged = |person: &NewImport| {
            person.trials.iter().filter(|(_, trial)| Flag::question(&trial.flags)).count()
        };
        let counts = |person: &NewImport| {
            let excluded = usize::from(person.exclusion.is_some());
            (person.id.clone(), [person.trials.len(), flagged(person), excluded])
        };
        let counts: Vec<_> = people.iter().map(counts).collect();
        match store.import(&destination.study, people, now_ms()).await? {
            Import::Done { skipped } => {
                self.counts.skipped += skipped.len();
                let new = counts.into_iter().filter(|(id, ..)| !skipped.contains(id));
                for (id, [trials, flagged, excluded]) in new {
                    self.counts.participants += 1;
                    self.counts.trials += trials;
                    self.counts.flagged += flagged;
                    self.counts.excluded += excluded;
                    self.ids.push(id);
                }
                Ok(())
            }
            Import::TrialKnown { trial_id } => {
                let expected = "trials that are not in this database yet";
                let what = Invalid::new("trial_id", expected, &trial_id);
                let line = lines.into_iter().rfind(|(id, _)| *id == trial_id);
                Err(complain(&Fault { line: line.map(|(_, line)| line), what }))
            }
        }
    }
}

/// Converts a participant of the file for the store.
fn import_of(study: &StudyConfig, person: RecordedParticipant) -> NewImport {
    let display = match synthetic::recognised(std::slice::from_ref(&person)) {
        Some(_) => r#"{"synthetic":true}"#,
        None => "{}",
    };
    let mut rows: Vec<PlannedRow> = Vec::new();
    let mut hash = Sha256::new();
    hash.update(person.name.as_bytes());
    let trials = person.trials.into_iter().map(|trial| {
        let (row, trial) = planned(study, &rows, trial);
        hash.update(trial.phase.word());
        hash.update(trial.number.to_le_bytes());
        let new = imported(&study.parameters, &row, trial, display);
        hash.update(new.content_hash);
        rows.push(row.clone());
        (row, new)
    });
    let trials = trials.collect();
    let (id, hash) = (Uuid::new_v4().to_string(), hex::encode(hash.finalize()));
    NewImport { id, hash, exclusion: None, trials }
}

fn imported(
    parameters: &SceneParameters,
    row: &PlannedRow,
    trial: RecordedTrial,
    display: &str,
) -> NewTrial {
    let flags = flags_of(parameters, &row.scene, &trial);
    let outcome = outcome(parameters, &trial.inputs, &trial.states);
    let content = Content {
        started_at_ms: trial.started_at_ms,
        inputs: trial.inputs,
        states: trial.states,
        sampled_at_ms: trial.sampled_at_ms,
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
        flags,
        outcome,
        key_timing: None,
        repeated_as: None,
        waiting: 0,
    }
}

/// The planned scene of a trial, given the planned scenes of the `earlier` trials. A file has no plan,
/// so the scene is derived from the trial's first state. A trial that the file marks as a further
/// attempt gets the index of the earlier trial with the same scene, if there is one. A file does not
/// say which of the study's robots the trial has, so it is the first whose rule moves it as recorded,
/// and its state after the last step follows from that rule. If there is none, the robot counts as
/// one that drives straight.
fn planned(
    study: &StudyConfig,
    earlier: &[PlannedRow],
    mut trial: RecordedTrial,
) -> (PlannedRow, RecordedTrial) {
    let (parameters, start) = (&study.parameters, trial.states[0]);
    let mut scene = Scene::new(parameters, start.human, start.robot);
    let last = trial.inputs.len().saturating_sub(1);
    let (inputs, states) = (&trial.inputs[..last], &trial.states[..=last]);
    let candidates = study.robots.iter().filter_map(|robot| {
        let candidate = Scene { policy: Some(Box::new(robot.clone())), ..scene.clone() };
        let replay = verify(parameters, &candidate, inputs, states);
        plausibility::is_rounding(parameters, last, &replay).then_some((replay.exact, candidate))
    });
    // An exact replay is better than one up to rounding.
    if let Some((_, found)) = candidates.min_by_key(|(exact, _)| !exact) {
        scene = found;
        if let (Some(&input), Some(before)) = (trial.inputs.last(), states.last()) {
            let robot_radps = scene.robot_turn_rate(parameters, states);
            trial.states[last + 1] =
                before.advance(parameters, input, robot_radps, parameters.step_s);
        }
    }
    let in_phase = || earlier.iter().filter(|row| row.phase == trial.phase);
    let first = in_phase().find(|row| row.scene == scene).filter(|_| trial.attempt > 1);
    let is_taken =
        |index: usize| in_phase().any(|row| row.index == index && row.attempt == trial.attempt);
    let (index, attempt) = match first {
        Some(first) if !is_taken(first.index) => (first.index, trial.attempt),
        _ => (in_phase().map(|row| row.index + 1).max().unwrap_or(0), 1),
    };
    let row = PlannedRow {
        trial_id: trial.trial_id.clone().unwrap_or_else(|| Uuid::new_v4().to_string()),
        ordinal: earlier.len() as i64,
        phase: trial.phase,
        index,
        attempt,
        scene,
        stored: false,
    };
    (row, trial)
}

/// The flags of a trial: the flags computed from the recording, the flags in the file, and `imported`.
fn flags_of(parameters: &SceneParameters, scene: &Scene, trial: &RecordedTrial) -> Vec<Flag> {
    let times = trial.sampled_at_ms.as_deref().unwrap_or_default();
    let mut flags = flags(parameters, scene, &trial.inputs, &trial.states, times);
    let started_at_ms = trial.started_at_ms;
    flags.extend(Record { started_at_ms, sampled_at_ms: times, ..Record::default() }.flags());
    flags.extend(&trial.flags);
    flags.push(Flag::Imported);
    flags.sort_unstable();
    flags.dedup();
    flags
}
