//! `sidestep check`.

use super::{CommandError, print_json};
use crate::store::trials::StoredTrial;
use crate::store::{Missing, Store};
use serde::Serialize;
use sidestep::scene::SceneParameters;
use sidestep::trial::{Flag, flags, outcome};

/// Check a database: whether the file is sound, and whether every trial replays as when it was
/// stored.
///
/// Prints a JSON summary; exit code 1 if anything is wrong.
#[derive(Clone, Debug, clap::Args)]
pub struct CheckArgs {
    /// Database: sqlite: followed by a file.
    #[arg(long, value_name = "URL", default_value = "sqlite:sidestep.db")]
    pub database: String,
}

/// The result of a check.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Report {
    /// Studies that were checked.
    pub studies: usize,
    /// Participants that were checked.
    pub participants: usize,
    /// Trials replayed.
    pub trials: usize,
    /// Trials with flags; these are not errors of the database.
    pub flagged: usize,
    /// Damaged pages and references to rows that do not exist.
    pub damage: Vec<String>,
    /// Trials that differ from what was stored.
    pub wrong: Vec<Wrong>,
}

/// A trial that differs from what was stored.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Wrong {
    /// The trial.
    pub trial_id: String,
    /// What is wrong with it.
    pub what: String,
}

/// Checks, prints the report, and fails if anything is wrong.
///
/// # Errors
/// [`CommandError::Failure`] if anything is wrong or the check cannot be done.
pub async fn run(args: CheckArgs) -> Result<(), CommandError> {
    let store = Store::open(&args.database, Missing::Refuse).await?;
    let report = report(&store).await?;
    store.close().await;
    print_json(&report)?;
    let faults = report.damage.len() + report.wrong.len();
    if faults == 0 {
        return Ok(());
    }
    let message = format!("{}: {faults} faults; the report lists them", args.database);
    Err(CommandError::Failure(message))
}

async fn report(store: &Store) -> Result<Report, CommandError> {
    let mut report = Report { damage: store.damage().await?, ..Report::default() };
    for counts in store.studies().await? {
        report.studies += 1;
        let Some(study) = store.study(&counts.slug).await? else {
            continue;
        };
        for id in store.participant_ids(study.id).await? {
            report.participants += 1;
            for trial in store.trials_of(&id).await? {
                let config = store.config(&trial.config_hash).await?;
                report.trials += 1;
                report.flagged += usize::from(!trial.head.flags.is_empty());
                if let Some(what) = fault(&config.parameters, &trial) {
                    let trial_id = trial.head.trial_id;
                    report.wrong.push(Wrong { trial_id, what });
                }
            }
        }
    }
    Ok(report)
}

/// What is wrong with a trial, if anything is.
fn fault(parameters: &SceneParameters, trial: &StoredTrial) -> Option<String> {
    let (inputs, states) = (&trial.content.inputs, &trial.content.states);
    if inputs.len() != parameters.steps || states.len() != parameters.steps + 1 {
        let (inputs, states) = (inputs.len(), states.len());
        return Some(format!(
            "expected {} inputs and one state more, found {inputs} and {states}",
            parameters.steps
        ));
    }
    let stored = &trial.head.flags;
    if trial.content_hash != trial.recipe.hash(&trial.content) {
        return Some("the content is not that of its hash".to_owned());
    }
    let times = trial.content.sampled_at_ms();
    let found = flags(parameters, &trial.scene, inputs, states, times);
    // A file's trial keeps flags for which the evidence is not in the file.
    let agree = if stored.contains(&Flag::Imported) {
        found.iter().all(|flag| stored.contains(flag))
    } else {
        found == *stored
    };
    if !agree {
        return Some(format!("expected flags {found:?}, found {stored:?}"));
    }
    let outcome = outcome(parameters, inputs, states);
    (outcome != trial.head.outcome)
        .then(|| format!("expected {outcome:?}, found {:?}", trial.head.outcome))
}
