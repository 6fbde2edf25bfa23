//! A moment of a recorded trial, as in the laboratory's replay.

use crate::commands::CommandError;
use crate::commands::game::GameArgs;
use crate::commands::prediction::PredictorSource;
use crate::commands::solving::{Interrupt, flagged, safety_levels};
use crate::commands::trials_file;
use crate::http::predictors;
use crate::store::{Purpose, Store};
use crate::study_recording;
use sidestep::api::{scene_words, trial_heading};
use sidestep::chart::Drawing;
use sidestep::invalid::Invalid;
use sidestep::learn::participant::{self, Driven};
use sidestep::predict::Predictor;
use sidestep::safety::SafetyLevels;
use sidestep::scene::{Scene, SceneParameters};
use sidestep::shfrs::window::Trajectory;
use sidestep::trial_view::source::{FROM_FILE, Needs, Source, features_of, fitted};
use sidestep::trial_view::view::View;
use sidestep::trial_view::{Learned, Method, Playback, Recorded, side_by_side};
use std::path::{Path, PathBuf};

/// Selects the trial and the view.
#[derive(Clone, Debug, clap::Args)]
#[command(next_help_heading = "Replay")]
pub(super) struct ReplayArgs {
    /// Replay: CSV file of trials from `sidestep export`. The flags of the game define the vehicles.
    #[arg(long, value_name = "FILE.csv", conflicts_with = "database", requires = "participant")]
    trials: Option<PathBuf>,
    /// Replay: participant in --trials.
    #[arg(long, value_name = "NAME", requires = "trials")]
    participant: Option<String>,
    /// Replay: database with the trial: sqlite:FILE or postgres://USER@HOST/DATABASE.
    #[arg(long, value_name = "URL", requires = "trial")]
    database: Option<String>,
    /// Replay: trial id, as in the URL of its replay (--database), or trial number (--trials).
    #[arg(long, value_name = "TRIAL")]
    trial: Option<String>,
    /// Replay: the view, as in the query of a replay's URL, such as 't=3.4&show=v-hr,shfrs'.
    ///
    /// It may also name the predictor: predictor=earlier, history, learned-disturbance, empirical,
    /// gaussian, constant, constant-velocity, hold-the-input or worst-case. With --database it may
    /// also name a model of an analysis: analysis=ID&file=NAME.
    #[arg(long, value_name = "QUERY", default_value = "")]
    view: String,
    /// Replay: length of a step in --trials (s).
    #[arg(long, value_name = "S", default_value_t = 0.2, allow_negative_numbers = true)]
    step: f64,
    /// Replay: number of steps of a trial in --trials.
    #[arg(long, value_name = "N", default_value_t = 50)]
    trial_steps: usize,
}

impl ReplayArgs {
    /// Whether a flag that selects a trial was given.
    pub(super) fn is_given(&self) -> bool {
        self.trials.is_some() || self.database.is_some() || self.trial.is_some()
    }
}

/// A trial, the title of its figure, and the same participant's earlier trials.
struct Found {
    recorded: Recorded,
    heading: String,
    earlier: Vec<Driven>,
    /// The models of analyses that the view names.
    models: Vec<(Source, Predictor)>,
}

/// Draws the moment of the trial. The predictor is `predictor` or the predictor that the view
/// names; giving both is an error. By default, it is a model trained on the participant's earlier
/// trials, as in the laboratory.
pub(super) async fn replay(
    args: &ReplayArgs,
    game: GameArgs,
    predictor: Option<PredictorSource<'_>>,
    interrupt: &Interrupt,
) -> Result<Drawing, CommandError> {
    let Looked { view, source, beside, is_named } = Looked::of(&args.view)?;
    if predictor.is_some() && is_named {
        let message = "--predictor: expected nothing beside the predictor that --view names";
        return Err(CommandError::Input(message.to_owned()));
    }
    let is_given = predictor.is_some();
    let given = predictor.map(|source| source.predictor().clone());
    let sources: Vec<&Source> =
        given.is_none().then_some(&source).into_iter().chain(&beside).collect();
    let found = match (&args.trials, &args.database) {
        (Some(file), _) => of_file(args, file, game, &sources)?,
        (None, Some(url)) => {
            of_database(url, args.trial.as_deref().unwrap_or_default(), &sources).await?
        }
        (None, None) => {
            let message = "--kind replay: expected --database URL --trial ID, or --trials FILE.csv \
                           --participant NAME --trial NUMBER";
            return Err(CommandError::Input(message.to_owned()));
        }
    };
    let safety = safety_levels(&found.recorded.parameters, interrupt).await?;
    let failed = |invalid: Invalid| CommandError::Input(format!("{}: {invalid}", found.heading));
    let pane = |method: Method| {
        let mut playback = Playback::new(found.recorded.clone())?;
        playback.use_safety(safety.clone())?;
        playback.use_method(Some(method.for_human(&found.recorded.parameters.human)?))?;
        playback.go(&view)?;
        Ok::<_, Invalid>(playback)
    };
    let method = match given {
        Some(predictor) => Learned::usual(predictor).map_err(failed)?.into(),
        None => found.method(&source, &safety)?,
    };
    let mut first = pane(method).map_err(failed)?;
    let Some(beside) = beside else { return Ok(first.figure(&view, &found.heading)) };
    let mut second = pane(found.method(&beside, &safety)?).map_err(failed)?;
    let captions =
        [if is_given { FROM_FILE.to_owned() } else { source.caption() }, beside.caption()];
    let panes = [(&mut first, captions[0].as_str()), (&mut second, captions[1].as_str())];
    Ok(side_by_side(panes, &view, &found.heading))
}

impl Found {
    /// The prediction method of this source.
    fn method(&self, source: &Source, safety: &SafetyLevels) -> Result<Method, CommandError> {
        let failed = |invalid: Invalid| CommandError::Input(format!("{}: {invalid}", self.heading));
        let way = match source {
            Source::Way(way) => way,
            Source::Model { .. } => {
                let model = self.models.iter().find(|(known, _)| known == source);
                let model = model.map(|(_, predictor)| predictor.clone()).ok_or_else(gone)?;
                return Learned::usual(model).map(Method::from).map_err(failed);
            }
        };
        let trained = match way.needs() {
            Needs::Nothing => None,
            Needs::Trials(family) => {
                let parameters = &self.recorded.parameters;
                let earlier = self.earlier.iter();
                let trajectory = |(inputs, states): &Driven| {
                    Trajectory::driven(states.clone(), inputs, parameters)
                };
                let earlier = earlier.map(trajectory).collect::<Result<Vec<_>, _>>();
                let fitted = earlier.and_then(|earlier| fitted(family, parameters, &earlier));
                return fitted.map(|it| it.sets.into()).map_err(failed);
            }
            Needs::Model(set) => {
                let features = features_of(set).map_err(CommandError::failure)?;
                let trained = participant::train(&features, Some(safety), &self.earlier);
                let trained = trained.map_err(CommandError::failure)?;
                if let Some(why) = &trained.fallback {
                    eprintln!("sidestep: predicted by the frequencies of the inputs: {why}");
                }
                Some(trained.predictor)
            }
        };
        way.learned(trained).map(Method::from).map_err(failed)
    }
}

/// The parsed --view.
struct Looked {
    view: View,
    source: Source,
    /// The predictor in the second pane, if any.
    beside: Option<Source>,
    /// Whether --view names a predictor.
    is_named: bool,
}

impl Looked {
    fn of(query: &str) -> Result<Self, CommandError> {
        let query = query.strip_prefix('?').unwrap_or(query);
        let pairs = query.split('&').filter(|pair| !pair.is_empty());
        let pairs = pairs.map(|pair| pair.split_once('=').unwrap_or((pair, "")));
        let pairs: Vec<(&str, String)> =
            pairs.map(|(name, value)| (name, decoded(value))).collect();
        let pairs = || pairs.iter().map(|(name, value)| (*name, value.as_str()));
        let wrong = |invalid: Invalid| flagged(invalid.within("view"));
        let names = [&View::NAMES[..], &Source::NAMES, &View::PAGE_NAMES].concat();
        if let Some((other, _)) = pairs().find(|(name, _)| !names.contains(name)) {
            let expected = format!("the names {} of a link to a replay", names.join(", "));
            return Err(flagged(Invalid::new("view", expected, other)));
        }
        let (source, beside) = Source::of_query(pairs()).map_err(wrong)?;
        let is_named = pairs().any(|(name, _)| ["predictor", "analysis", "file"].contains(&name));
        Ok(Self { view: View::of_query(pairs()).map_err(wrong)?, source, beside, is_named })
    }
}

/// Percent-decodes a value in a URL. For example, `%2F` is a slash.
fn decoded(value: &str) -> String {
    let mut bytes = Vec::new();
    let mut rest = value.as_bytes();
    while let Some((&first, after)) = rest.split_first() {
        let digit = |place: usize| char::from(*after.get(place)?).to_digit(16);
        rest = match (first, digit(0).zip(digit(1))) {
            (b'%', Some((high, low))) => {
                bytes.push((16 * high + low) as u8);
                &after[2..]
            }
            _ => {
                bytes.push(first);
                after
            }
        };
    }
    String::from_utf8_lossy(&bytes).into_owned()
}

fn gone() -> CommandError {
    let message = "--view: a model of an analysis is in a database; expected --database beside it";
    CommandError::Input(message.to_owned())
}

async fn of_database(
    url: &str,
    trial_id: &str,
    sources: &[&Source],
) -> Result<Found, CommandError> {
    let store = Store::open(url, Purpose::Read).await?;
    let trial = store.trial(trial_id).await?;
    let Some(trial) = trial else {
        store.close().await;
        return Err(CommandError::Input(format!("--trial {trial_id}: no such trial in {url}")));
    };
    let parameters = store.config(&trial.config_hash).await?.parameters;
    let earlier = study_recording::earlier(&store, &trial).await?.into_iter();
    let earlier = earlier.map(|other| (other.inputs, other.states)).collect();
    let mut models = Vec::new();
    for source in sources {
        if let Source::Model { analysis, file } = source {
            let model = predictors::of_analysis(&store, trial_id, analysis, file).await;
            let model = model
                .map_err(|error| CommandError::Input(format!("--view: {}", error.sentence())))?;
            let model = Predictor::try_from(model.predictor).map_err(CommandError::failure)?;
            models.push(((*source).clone(), model));
        }
    }
    store.close().await;
    let (study, number) = (&trial.study, trial.head.participant_number);
    let words = scene_words(trial.head.phase, trial.head.index, trial.head.attempt);
    let heading = trial_heading(study, number, &words, trial.is_synthetic());
    let (inputs, states) = (trial.content.inputs, trial.content.states);
    Ok(Found {
        recorded: Recorded { parameters, scene: trial.scene, inputs, states },
        heading,
        earlier,
        models,
    })
}

fn of_file(
    args: &ReplayArgs,
    file: &Path,
    game: GameArgs,
    sources: &[&Source],
) -> Result<Found, CommandError> {
    if sources.iter().any(|source| matches!(source, Source::Model { .. })) {
        return Err(gone());
    }
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
    // A file does not contain the goal. The robot is assumed to reach its goal at the end of the
    // trial.
    let scene = Scene::new(&parameters, start.human, start.robot);
    let heading = format!("participant {name} / {} / trial {wanted}", trial.phase.word());
    let (inputs, states) = (trial.inputs, trial.states);
    let recorded = Recorded { parameters, scene, inputs, states };
    Ok(Found { recorded, heading, earlier, models: Vec::new() })
}
