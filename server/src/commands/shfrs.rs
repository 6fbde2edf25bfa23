//! `sidestep shfrs`.

mod evaluation;
mod files;

use super::json_file::Document;
use super::solving::{Interrupt, bar, safety_levels};
use super::trials_file::Faults;
use super::trials_source::TrialsArgs;
use super::{CommandError, Words, one_of, print_json, unwritable};
use crate::formats::atomic_folder::Draft;
use crate::support::threads;
use evaluation::{Evaluation, LeftOut, Questions};
use sidestep::bounds::{ActionChoice, BoundsSettings, Rollout};
use sidestep::features::FeatureSet;
use sidestep::invalid::Invalid;
use sidestep::learn::participant::{self, Driven, Trained};
use sidestep::predict::{Predictor, PredictorFile};
use sidestep::recording::{Recording, flagged as flagged_trials};
use sidestep::safety::SafetyLevels;
use sidestep::shfrs::PredictedHuman;
use sidestep::shfrs::file::ShfrsFile;
use sidestep::shfrs::guarantee::{Guarantee, Unit};
use sidestep::shfrs::tuning::Split;
use sidestep::shfrs::window::{Trajectory, WindowChoice};
use sidestep::shfrs::window_sets::Prediction;
use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::time::Duration;

/// Compute stochastic human forward reachable sets (SHFRS) of recorded trials.
///
/// Computes the probabilities of regions, tunes the sets with a guarantee, and compares their area
/// with the area of other predictions of the same coverage.
///
/// Trajectories (tasks only) are split at random into training, calibration and test sets. The
/// training set tunes the choice of actions, and trains the predictor unless one is given. The
/// calibration set determines ε. The test set measures the achieved coverage. Tuning chooses both
/// the actions that count (τ, or k for each step) and ε; a common result is ε = 0 with a low τ. A
/// given predictor must not have been trained on the calibration or test set.
///
/// Trajectories of one person are alike. In a split by trajectories, every person is in all three
/// sets, and guarantees hold for new tasks of these people. In a split by people, each person is in
/// one set, one random trajectory of each person calibrates or tests, and guarantees hold for new
/// people; this needs far more people. A guarantee that needs more trajectories or people than
/// there are is left out; the others are computed.
///
/// Writes to DIR: regions.csv (p of sets and regions with intervals, by choice of windows),
/// tuning.csv (ε_1 by probability and guarantee), pareto.csv and pareto.svg (coverage against
/// area of SHFRS and of simpler predictions), danger.csv (bounds on the probability that the
/// human comes within the radius of the robot, by test trajectory), regions.svg (predictions in the
/// colours of the paper; the circle is the robot's present danger zone), predictor.json (the
/// predictor that was used) and shfrs.json (all numbers with their settings, tolerances and
/// guarantees in words). Lengths are in m, areas in m², times in s, ε and turn rates in rad/s. In
/// GAME the human is the evader and the robot is the pursuer.
#[derive(Clone, Debug, clap::Args)]
pub struct ShfrsArgs {
    #[command(flatten)]
    trials: TrialsArgs,
    /// Predictor of the human's next input [default: logistic regression on the training set].
    #[arg(long, value_name = "FILE.json")]
    predictor: Option<PathBuf>,
    /// Features of the predictor trained here: names of features, or one of the paper's sets.
    ///
    /// The paper's sets are hrd, hr, … (B with safety levels and distance).
    #[arg(long, value_name = "NAME,…", value_delimiter = ',', conflicts_with = "predictor")]
    #[arg(default_value = "hrd,robot_ahead,robot_left")]
    features: Vec<String>,
    /// Regions: JSON settings, as saved by the laboratory's explorer.
    ///
    /// They replace --epsilon, --k, --tau, --q, --steps and --rollout.
    #[arg(long, value_name = "FILE.json")]
    #[arg(conflicts_with_all = ["epsilon", "k", "tau", "q", "steps", "rollout"])]
    settings: Option<PathBuf>,
    /// Folder for the files; created if it does not exist.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Only trials of this participant; may be repeated [default: all].
    #[arg(long, value_name = "NAME")]
    participant: Vec<String>,
    /// By how much each set widens the bounds (rad/s), ascending; the last must admit every turn rate.
    #[arg(long, value_name = "RAD/S,…", value_delimiter = ',', allow_hyphen_values = true)]
    #[arg(default_value = "0,0.15,0.25,0.4,1")]
    epsilon: Vec<f64>,
    /// Regions: number of the likeliest actions at each step ahead; by default 2, 2, then 1.
    #[arg(long, value_name = "K,…", value_delimiter = ',', conflicts_with = "tau")]
    k: Option<Vec<usize>>,
    /// Regions: actions with at least this probability, in (0, 1], instead of k.
    #[arg(long, value_name = "P", allow_negative_numbers = true)]
    tau: Option<f64>,
    /// Regions: shortest interval of turn rates with at least this probability, in (0, 1], instead of k.
    ///
    /// One number for all steps, or one for each step ahead.
    #[arg(long, value_name = "P,…", value_delimiter = ',', conflicts_with_all = ["k", "tau"])]
    #[arg(allow_negative_numbers = true)]
    q: Option<Vec<f64>>,
    /// Number of steps ahead, T.
    #[arg(long, value_name = "T", default_value_t = 10)]
    steps: usize,
    /// Regions: whether roll-outs of Algorithm 1 are widened by ε_1.
    #[arg(long, value_parser = one_of(ROLLOUTS), default_value = "base")]
    rollout: Rollout,
    /// Tuning, Pareto and danger: window of each trajectory.
    #[arg(long, value_enum, default_value = "random-one")]
    windows: WindowsArg,
    /// Tuning and Pareto: desired probabilities that a trajectory stays inside F_1, in (0, 1).
    #[arg(long, value_name = "P,…", value_delimiter = ',', allow_hyphen_values = true)]
    #[arg(default_value = "0.75,0.9,0.95")]
    probability: Vec<f64>,
    /// Tuning: guarantees to give.
    #[arg(long, value_enum, value_delimiter = ',', default_value = "conformal,pac")]
    guarantee: Vec<GuaranteeArg>,
    /// Tuning, pac and fixed-sequence: share of calibrations that may fail, in (0, 1).
    #[arg(long, value_name = "P", default_value_t = 0.05, allow_negative_numbers = true)]
    delta: f64,
    /// Unit of the split. Guarantees hold for new tasks of these people, or for new people.
    #[arg(long, value_enum, default_value = "trajectories")]
    split: SplitArg,
    /// Share of the trajectories (or people) in the training set, in (0, 1).
    #[arg(long, value_name = "SHARE", default_value_t = Split::USUAL.training)]
    #[arg(allow_negative_numbers = true)]
    training: f64,
    /// Share of the trajectories (or people) in the calibration set, in (0, 1); the rest is the test set.
    #[arg(long, value_name = "SHARE", default_value_t = Split::USUAL.calibration)]
    #[arg(allow_negative_numbers = true)]
    calibration: f64,
    /// Seed of the random split and the random windows.
    #[arg(long, value_name = "N", default_value_t = Split::USUAL.seed)]
    seed: u64,
    /// Confidence of the intervals, in (0, 1).
    #[arg(long, value_name = "P", default_value_t = 0.95, allow_negative_numbers = true)]
    confidence: f64,
}

const ROLLOUTS: Words<Rollout> = &[
    ("paper", Rollout::Paper, "Widened by ε_1, as the paper prints it"),
    ("base", Rollout::Base, "Not widened; regions are guaranteed to grow with ε_1"),
];

#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
enum WindowsArg {
    /// A window from a random step.
    RandomOne,
    /// A window from the first step in which the human turns.
    AvoidanceOnset,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
enum SplitArg {
    /// Split all trajectories, regardless of the person.
    Trajectories,
    /// Split people, each with all their trajectories.
    People,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
enum GuaranteeArg {
    /// The guarantee holds on average over calibrations.
    Conformal,
    /// The guarantee holds for each calibration, except for a share δ of them.
    Pac,
    /// Like pac, but with the paper's roll-outs, whose sets need not be nested.
    FixedSequence,
}

/// Number of levels of ε that the fixed-sequence test uses.
const SEQUENCE: usize = 101;

/// Computes the results, then writes the files.
///
/// # Errors
/// [`CommandError`] for invalid flags or files or too few trajectories for a guarantee (input), or
/// if a file cannot be written (failure).
pub async fn run(mut args: ShfrsArgs) -> Result<(), CommandError> {
    let interrupt = Interrupt::listen();
    if let Some(path) = args.settings.clone() {
        args.take(&Document(&path))?;
    }
    let recording = args.trials.recording(Faults::Refuse).await?;
    let (parameters, synthetic) = (recording.scene, recording.provenance.synthetic.clone());
    let (excluded, flags) = (recording.exclusions.clone(), flagged_trials(&recording.participants));
    let recorded = args.recorded(recording)?;
    let given = args.predictor.as_deref().map(read_predictor).transpose()?;
    let questions = args.questions()?;
    let longest = recorded.iter().map(|recorded| recorded.trajectory.steps()).max().unwrap_or(0);
    if args.steps > longest {
        let expected = format!("at most {longest}, the steps of the longest trial");
        return Err(flagged(Invalid::new("steps", expected, args.steps)));
    }
    let draft = Draft::begin(&args.out).map_err(|e| unwritable(&args.out, &e))?;
    let safety = safety_levels(&parameters, &interrupt).await?;
    let person = people(&recorded);
    let parts = match questions.unit {
        Unit::People => questions.split.parts_of_people(&person),
        _ => questions.split.parts(recorded.len()),
    };
    let parts = parts.map_err(flagged)?;
    let sizes = [&parts.training, &parts.calibration, &parts.test].map(Vec::len);
    let all = match questions.unit {
        Unit::People => person.iter().max().map_or(0, |last| last + 1),
        _ => recorded.len(),
    };
    let left_out = questions.left_out(sizes[1]).map_err(flagged)?;
    enough(&questions, &left_out, sizes[1], all, &args.trials.name())?;
    if sizes.contains(&0) {
        let expected = "shares (with --training) that leave something in all three parts";
        let [training, calibration, test] = sizes;
        let found = format!("{training} to train, {calibration} to calibrate, {test} to test");
        return Err(flagged(Invalid::new("calibration", expected, found)));
    }
    let given = given.map(|predictor| {
        let path = args.predictor.as_deref().unwrap_or(Path::new(""));
        (predictor, path.display().to_string())
    });
    let questions_unit = questions.unit;
    let counts = [recorded.len(), parts.training.len(), parts.calibration.len(), parts.test.len()];
    let out = args.out.clone();
    let bar = bar(Evaluation::stages(&questions), BAR);
    bar.enable_steady_tick(TICK);
    let shown = bar.clone();
    let work = move || {
        shown.set_message("predictor");
        let (predictor, origin) = match given {
            Some(given) => given,
            None => args.trained(&safety, &recorded, &parts.training)?,
        };
        let human = PredictedHuman::new(&predictor, &safety, &parameters)
            .map_err(|invalid| CommandError::Input(format!("predictor: {invalid}")))?;
        let prediction = Prediction::new(&parameters, &human);
        let regions = args.bounds_settings(predictor.classes().len())?;
        let mut evaluation =
            Evaluation::of(&recorded, &parts, prediction, &regions, &questions, &origin, &shown)?;
        evaluation.left_out = left_out;
        evaluation.synthetic = synthetic;
        Ok::<_, CommandError>((evaluation, PredictorFile::from(&predictor)))
    };
    let found = interrupt.unless_stopped(threads::run("shfrs", None, work)).await;
    bar.finish_and_clear();
    let (evaluation, predictor) = found?.map_err(CommandError::failure)??;
    for left_out in &evaluation.left_out {
        eprintln!("{left_out}");
    }
    files::write(&draft, &evaluation, &predictor)?;
    draft.keep(&[], &interrupt.token).map_err(|e| interrupt.unwritten(&out, &e))?;
    let [trajectories, training, calibration, test] = counts;
    print_json(&serde_json::json!({
        "folder": out,
        "files": files::FILES,
        "trajectories": trajectories,
        "training": training,
        "calibration": calibration,
        "test": test,
        "split": questions_unit.word(),
        "left_out": evaluation.left_out,
        "predictor": evaluation.predictor,
        "synthetic": evaluation.synthetic.is_some(),
        "excluded": excluded,
        "flagged": flags,
    }))
}

/// The template of the progress bar.
const BAR: &str = "[{bar:40}] {pos:>2}/{len}  {elapsed_precise}  {msg}";

/// Update interval of the elapsed time on the bar.
const TICK: Duration = Duration::from_millis(100);

/// A trial of the file.
struct Recorded {
    participant: String,
    trial: u64,
    trajectory: Trajectory,
    driven: Driven,
}

impl ShfrsArgs {
    /// Replaces the flags by the settings of a file.
    fn take(&mut self, document: &Document<'_>) -> Result<(), CommandError> {
        let file: ShfrsFile = document.read()?;
        // k is checked against the predictor later, after the predictor was read.
        file.settings(usize::MAX).map_err(|invalid| document.complain(&invalid))?;
        self.steps = file.steps;
        (self.epsilon, self.rollout) = (file.epsilon, file.rollout);
        (self.k, self.tau, self.q) = (file.k, file.tau, file.q);
        Ok(())
    }

    fn recorded(&self, recording: Recording) -> Result<Vec<Recorded>, CommandError> {
        let name = self.trials.name();
        let complain = |e: &dyn std::fmt::Display| CommandError::Input(format!("{name}: {e}"));
        let people = recording.participants;
        for wanted in &self.participant {
            if !people.iter().any(|person| person.name == *wanted) {
                let found = people.iter().map(|person| person.name.as_str()).collect::<Vec<_>>();
                let expected = format!("--participant: expected one of {}", found.join(", "));
                return Err(complain(&format!("{expected}, found {wanted}")));
            }
        }
        let mut recorded = Vec::new();
        for person in people {
            if !self.participant.is_empty() && !self.participant.contains(&person.name) {
                continue;
            }
            for trial in person.trials {
                let trajectory =
                    Trajectory::of(&trial, &recording.scene).map_err(|e| complain(&e))?;
                recorded.push(Recorded {
                    participant: person.name.clone(),
                    trial: trial.number,
                    trajectory,
                    driven: (trial.inputs, trial.states),
                });
            }
        }
        Ok(recorded)
    }

    /// Trains a predictor on the training set. Also returns a description of it in words.
    fn trained(
        &self,
        safety: &SafetyLevels,
        recorded: &[Recorded],
        training: &[usize],
    ) -> Result<(Predictor, String), CommandError> {
        let names = self.features.iter().flat_map(|word| match FeatureSet::subset(word) {
            Ok(set) => Vec::from(set),
            Err(_) => vec![word.clone()],
        });
        let features = FeatureSet::of(&names.collect::<Vec<String>>()).map_err(flagged)?;
        let driven: Vec<Driven> = training.iter().map(|&i| recorded[i].driven.clone()).collect();
        let Trained { predictor, fallback } =
            participant::train(&features, Some(safety), &driven).map_err(CommandError::failure)?;
        let what = match fallback {
            None => {
                let (features, n) = (self.features.join(", "), driven.len());
                format!("logistic regression on {features}, from {n} trajectories")
            }
            Some(reason) => format!("the frequencies of the inputs ({reason})"),
        };
        Ok((predictor, what))
    }

    /// Settings of Algorithm 1 for the regions.
    fn bounds_settings(&self, actions: usize) -> Result<BoundsSettings, CommandError> {
        let q = self.q.as_ref().map(|q| match q[..] {
            [same] => vec![same; self.steps],
            _ => q.clone(),
        });
        let lists = [("k", self.k.as_ref().map(Vec::len)), ("q", q.as_ref().map(Vec::len))];
        for (name, found) in lists.into_iter().filter_map(|(name, length)| Some((name, length?))) {
            let expected = self.steps;
            if found != expected {
                let message =
                    format!("--{name}: expected {expected} numbers (--steps), found {found}");
                return Err(CommandError::Input(message));
            }
        }
        let choice = match (&self.k, self.tau, &q) {
            (None, None, None) => evaluation::choice_of_the_paper(self.steps, actions),
            (k, tau, q) => ActionChoice::of_file(self.steps, k.as_deref(), tau, q.as_deref())
                .map_err(flagged)?,
        };
        BoundsSettings::new(self.epsilon.clone(), choice, self.rollout, actions).map_err(flagged)
    }

    fn questions(&self) -> Result<Questions, CommandError> {
        if self.steps == 0 {
            return Err(flagged(Invalid::new("steps", "at least 1", 0)));
        }
        let delta = self.delta;
        let guarantee = |wanted: &GuaranteeArg| match wanted {
            GuaranteeArg::Conformal => Guarantee::Conformal,
            GuaranteeArg::Pac => Guarantee::Pac { delta },
            GuaranteeArg::FixedSequence => Guarantee::FixedSequence { delta, levels: SEQUENCE },
        };
        let questions = Questions {
            steps: self.steps,
            probabilities: self.probability.clone(),
            guarantees: self.guarantee.iter().map(guarantee).collect(),
            windows: match self.windows {
                WindowsArg::RandomOne => WindowChoice::RandomOne { seed: self.seed },
                WindowsArg::AvoidanceOnset => WindowChoice::AvoidanceOnset,
            },
            split: Split {
                training: self.training,
                calibration: self.calibration,
                seed: self.seed,
            },
            confidence: self.confidence,
            unit: match self.split {
                SplitArg::Trajectories => Unit::Trajectories,
                SplitArg::People => Unit::People,
            },
        };
        questions.check().map_err(flagged)?;
        Ok(questions)
    }
}

/// The number of the person who drove each trajectory. People are numbered from 0 in order of
/// appearance.
fn people(recorded: &[Recorded]) -> Vec<usize> {
    let mut places = HashMap::new();
    let names = recorded.iter().map(|recorded| recorded.participant.as_str());
    names
        .map(|name| {
            let next = places.len();
            *places.entry(name).or_insert(next)
        })
        .collect()
}

/// Checks, before the computation, that at least one requested guarantee can be given. `all` is the
/// total number of trials (or people), and `calibration` is the number in the calibration set.
fn enough(
    questions: &Questions,
    left_out: &[LeftOut],
    calibration: usize,
    all: usize,
    name: &str,
) -> Result<(), CommandError> {
    let asked = questions.guarantees.len() * questions.probabilities.len();
    let least = left_out.iter().min_by_key(|of| of.needed).filter(|_| left_out.len() == asked);
    let Some(LeftOut { guarantee, p, needed, .. }) = least else { return Ok(()) };
    let what = match questions.unit {
        Unit::People => "people",
        _ => "tasks",
    };
    let expected = format!(
        "at least {needed} {what} to calibrate with (a share of {}) for p = {p} ({guarantee})",
        questions.split.calibration
    );
    let found = format!("{calibration} of {all}");
    Err(CommandError::Input(format!("{name}: expected {expected}, found {found}")))
}

/// Converts a library error to an error about the flag.
fn flagged(invalid: Invalid) -> CommandError {
    CommandError::Input(format!("--{invalid}"))
}

fn read_predictor(path: &Path) -> Result<Predictor, CommandError> {
    let document = Document(path);
    let file: PredictorFile = document.read()?;
    file.of_turns().map_err(|invalid| document.complain(&invalid))
}
