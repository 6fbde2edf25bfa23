//! A moment of a recorded trial, as the laboratory's replay shows it.

use crate::commands::CommandError;
use crate::commands::game::GameArgs;
use crate::commands::prediction::PredictorSource;
use crate::commands::solving::{Interrupt, flagged, safety_levels};
use crate::commands::trials_file;
use crate::recordings;
use crate::store::{Missing, Store};
use sidestep::chart::Drawing;
use sidestep::features::FeatureSet;
use sidestep::invalid::Invalid;
use sidestep::playback::view::View;
use sidestep::playback::{Learned, Playback, Recorded};
use sidestep::predict::Predictor;
use sidestep::scene::{Scene, SceneParameters};
use sidestep::shfrs::ShfrsSettings;
use sidestep::training::{self, Driven};
use std::path::{Path, PathBuf};

/// Which trial, and how it is looked at.
#[derive(Clone, Debug, clap::Args)]
#[command(next_help_heading = "Replay")]
pub(super) struct ReplayArgs {
    /// Replay: CSV file of trials, as `sidestep export` writes it; the flags of the game say which vehicles
    /// drove.
    #[arg(long, value_name = "FILE.csv", conflicts_with = "database", requires = "participant")]
    trials: Option<PathBuf>,
    /// Replay: the participant in --trials.
    #[arg(long, value_name = "NAME", requires = "trials")]
    participant: Option<String>,
    /// Replay: database of the trial, sqlite: and a file.
    #[arg(long, value_name = "URL", requires = "trial")]
    database: Option<String>,
    /// Replay: with --database the trial's id, as in the address of its replay; with --trials its number.
    #[arg(long, value_name = "TRIAL")]
    trial: Option<String>,
    /// Replay: how it is looked at, as the address of a replay says after the question mark, such as
    /// 't=3.4&show=v-hr,shfrs'.
    #[arg(long, value_name = "QUERY", default_value = "")]
    view: String,
    /// Replay: length of a step in --trials, s.
    #[arg(long, value_name = "S", default_value_t = 0.2, allow_negative_numbers = true)]
    step: f64,
    /// Replay: steps of a trial in --trials.
    #[arg(long, value_name = "N", default_value_t = 50)]
    trial_steps: usize,
}

impl ReplayArgs {
    /// Whether one of the flags was given that choose a trial.
    pub(super) fn is_given(&self) -> bool {
        self.trials.is_some() || self.database.is_some() || self.trial.is_some()
    }
}

/// A trial, its name, and the trials of the same participant before it.
struct Found {
    recorded: Recorded,
    heading: String,
    earlier: Vec<Driven>,
}

/// The moment as a figure. Without a predictor, one is trained on the participant's earlier trials, as in
/// the laboratory.
pub(super) async fn replay(
    args: &ReplayArgs,
    game: GameArgs,
    predictor: Option<PredictorSource<'_>>,
    interrupt: &Interrupt,
) -> Result<Drawing, CommandError> {
    let view = view(&args.view)?;
    let Found { recorded, heading, earlier } = match (&args.trials, &args.database) {
        (Some(file), _) => of_file(args, file, game)?,
        (None, Some(url)) => of_database(url, args.trial.as_deref().unwrap_or_default()).await?,
        (None, None) => {
            let message = "--kind replay: expected --database URL --trial ID, or --trials FILE.csv \
                           --participant NAME --trial NUMBER";
            return Err(CommandError::Input(message.to_owned()));
        }
    };
    let safety = safety_levels(&recorded.parameters, interrupt).await?;
    let predictor: Predictor = match predictor {
        Some(source) => source.predictor().clone(),
        None => {
            let features = FeatureSet::subset("hrd").map_err(CommandError::failure)?;
            let trained = training::train(&features, Some(&safety), &earlier);
            let trained = trained.map_err(CommandError::failure)?;
            if let Some(why) = &trained.fallback {
                eprintln!("sidestep: predicted by the frequencies of the inputs: {why}");
            }
            trained.predictor
        }
    };
    let failed = |invalid: Invalid| CommandError::Input(format!("{heading}: {invalid}"));
    let settings = ShfrsSettings::paper(predictor.classes().len()).map_err(failed)?;
    let mut playback = Playback::new(recorded).map_err(failed)?;
    playback.use_safety(safety).map_err(failed)?;
    playback.use_learned(Some(Learned { predictor, settings })).map_err(failed)?;
    playback.go(&view).map_err(failed)?;
    Ok(playback.figure(&view, &heading))
}

/// The view that a query describes.
fn view(query: &str) -> Result<View, CommandError> {
    let query = query.strip_prefix('?').unwrap_or(query);
    let pairs = query.split('&').filter(|pair| !pair.is_empty());
    let pairs = pairs.map(|pair| pair.split_once('=').unwrap_or((pair, "")));
    View::of_query(pairs).map_err(|invalid| flagged(invalid.within("view")))
}

async fn of_database(url: &str, trial_id: &str) -> Result<Found, CommandError> {
    let store = Store::open(url, Missing::Refuse).await?;
    let trial = store.trial(trial_id).await?;
    let Some(trial) = trial else {
        store.close().await;
        return Err(CommandError::Input(format!("--trial {trial_id}: no such trial in {url}")));
    };
    let parameters = store.config(&trial.config_hash).await?.parameters;
    let earlier = recordings::earlier(&store, &trial).await?.into_iter();
    let earlier = earlier.map(|other| (other.inputs, other.states)).collect();
    store.close().await;
    let (study, number) = (&trial.study, trial.head.participant_number);
    let words = sidestep::api::scene_words(trial.head.phase, trial.head.index, trial.head.attempt);
    let heading = format!("{study} / participant {number} / {words}");
    let (inputs, states) = (trial.content.inputs, trial.content.states);
    Ok(Found {
        recorded: Recorded { parameters, scene: trial.scene, inputs, states },
        heading,
        earlier,
    })
}

fn of_file(args: &ReplayArgs, file: &Path, game: GameArgs) -> Result<Found, CommandError> {
    let game = game.game()?;
    let parameters = SceneParameters {
        human: game.evader,
        robot: game.pursuer,
        danger_radius_m: game.radius_m,
        step_s: args.step,
        steps: args.trial_steps,
    };
    parameters.check().map_err(flagged)?;
    let name = args.participant.as_deref().unwrap_or_default();
    let mut person = trials_file::participant(file, &parameters, name)?;
    let wanted = args.trial.as_deref().unwrap_or_default();
    let place = person.trials.iter().position(|trial| trial.number.to_string() == wanted);
    let Some(place) = place else {
        let (found, n) = (file.display(), person.trials.len());
        let message = format!(
            "--trial: expected the number of one of the {n} trials of participant {name} in \
             {found}, found {wanted:?}"
        );
        return Err(CommandError::Input(message));
    };
    let trial = person.trials.remove(place);
    person.trials.truncate(place);
    person.keep_one_attempt();
    let earlier = person.trials.into_iter().map(|trial| (trial.inputs, trial.states)).collect();
    let start = trial.states[0];
    // A file does not say where the goal is: the robot reaches it at the end of the trial.
    let scene = Scene::new(&parameters, start.human, start.robot);
    let heading = format!("participant {name} / {} / trial {wanted}", trial.phase.word());
    let (inputs, states) = (trial.inputs, trial.states);
    Ok(Found { recorded: Recorded { parameters, scene, inputs, states }, heading, earlier })
}
