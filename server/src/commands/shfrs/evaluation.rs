//! The computations of `sidestep shfrs`.

use super::super::CommandError;
use super::{Recorded, flagged};
use indicatif::ProgressBar;
use serde::Serialize;
use sidestep::bounds::{ActionChoice, ActionModel, BoundsSettings, Motion};
use sidestep::invalid::Invalid;
use sidestep::scene::SceneParameters;
use sidestep::shfrs::danger::{DangerBounds, danger_bounds, statement};
use sidestep::shfrs::family::Family;
use sidestep::shfrs::guarantee::{Guarantee, Unit};
use sidestep::shfrs::pareto::{Compared, POINTS, Pareto, ParetoSettings, pareto};
use sidestep::shfrs::probability::{Regions, regions_of_people};
use sidestep::shfrs::scores::{Scores, ShfrsFamily};
use sidestep::shfrs::tuning::{Parts, Sample, Split, Tuned, TuningSettings, candidates, tune};
use sidestep::shfrs::window::{Trajectory, Window, WindowChoice};
use sidestep::shfrs::window_sets::Prediction;
use sidestep::stats::open_probability;
use std::fmt;

use crate::figure::RegionsPanel;

/// The settings of an evaluation, except for the settings of the regions.
pub(super) struct Questions {
    pub(super) steps: usize,
    pub(super) probabilities: Vec<f64>,
    pub(super) guarantees: Vec<Guarantee>,
    pub(super) windows: WindowChoice,
    pub(super) split: Split,
    pub(super) confidence: f64,
    /// The unit of the split.
    pub(super) unit: Unit,
}

/// A guarantee that is left out because the calibration set is too small.
#[derive(Clone, Debug, Serialize)]
pub(super) struct LeftOut {
    /// The guarantee, spelled as in `--guarantee`.
    pub(super) guarantee: String,
    pub(super) p: f64,
    /// The needed and the actual size of the calibration set.
    pub(super) needed: usize,
    pub(super) found: usize,
    pub(super) unit: Unit,
}

impl fmt::Display for LeftOut {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { guarantee, p, needed, found, unit } = self;
        let unit = unit.word();
        write!(
            f,
            "p = {p} ({guarantee}) is left out: expected at least {needed} {unit} to calibrate with, found {found}"
        )
    }
}

impl Questions {
    /// The guarantees that need more than `calibration` trajectories or people.
    pub(super) fn left_out(&self, calibration: usize) -> Result<Vec<LeftOut>, Invalid> {
        let mut left_out = Vec::new();
        for guarantee in &self.guarantees {
            for &p in &self.probabilities {
                let needed = guarantee.needed(p)?;
                if calibration < needed {
                    let guarantee = guarantee.word().replace('_', "-");
                    left_out.push(LeftOut {
                        guarantee,
                        p,
                        needed,
                        found: calibration,
                        unit: self.unit,
                    });
                }
            }
        }
        Ok(left_out)
    }

    /// Whether a calibration set of this size is large enough for a guarantee.
    fn can(&self, guarantee: Guarantee, p: f64, calibration: usize) -> Result<bool, Invalid> {
        Ok(calibration >= guarantee.needed(p)?)
    }

    pub(super) fn check(&self) -> Result<(), Invalid> {
        for &p in &self.probabilities {
            open_probability("probability", p)?;
        }
        for guarantee in &self.guarantees {
            guarantee.check()?;
        }
        open_probability("confidence", self.confidence)?;
        self.split.parts(0).map(drop)
    }
}

/// All results.
#[derive(Serialize)]
pub(super) struct Evaluation {
    /// A description of the predictor's origin.
    pub(super) predictor: String,
    pub(super) participants: usize,
    pub(super) trajectories: Parted,
    /// The unit of the split. Guarantees and intervals count these units.
    pub(super) split: Unit,
    /// The regions for each choice of windows, if the choice gives at least one window.
    pub(super) regions: Vec<Regions>,
    /// The parts of the split from which the regions' probabilities are computed.
    pub(super) regions_from: String,
    /// If the trials are synthetic, the evidence for this.
    pub(super) synthetic: Option<String>,
    pub(super) tuning: Vec<Tuned>,
    /// Guarantees that are left out because the calibration set is too small.
    pub(super) left_out: Vec<LeftOut>,
    pub(super) pareto: Pareto,
    pub(super) danger: Danger,
    #[serde(skip)]
    pub(super) panels: Vec<RegionsPanel>,
}

/// Numbers of trajectories in the three parts.
#[derive(Serialize)]
pub(super) struct Parted {
    training: usize,
    calibration: usize,
    test: usize,
}

/// Bounds on the probability of entering the danger zone, evaluated on the test part.
#[derive(Serialize)]
pub(super) struct Danger {
    /// The choice of actions.
    choice: String,
    statement: String,
    mean_low: f64,
    /// Fraction of windows in which the human came within the radius at a step.
    entered: f64,
    mean_high: f64,
    pub(super) windows: Vec<DangerRow>,
}

/// The danger bounds of one test trajectory.
#[derive(Serialize)]
pub(super) struct DangerRow {
    pub(super) participant: String,
    pub(super) trial: u64,
    pub(super) step: usize,
    pub(super) bounds: DangerBounds,
    pub(super) entered: bool,
}

/// The paper's choice of actions: the two likeliest actions at each of the first two steps, and the
/// likeliest action at each later step.
pub(super) fn choice_of_the_paper(steps: usize, actions: usize) -> ActionChoice {
    ActionChoice::TopK((0..steps).map(|i| if i < 2 { actions.min(2) } else { 1 }).collect())
}

/// Choices of windows for the regions' probabilities. The random choice uses this seed.
fn region_windows(seed: u64) -> [WindowChoice; 3] {
    [WindowChoice::EveryStep, WindowChoice::RandomOne { seed }, WindowChoice::AvoidanceOnset]
}

impl Evaluation {
    /// Number of stages that [`Self::of`] reports on the progress bar.
    pub(super) fn stages(questions: &Questions) -> u64 {
        let tuned = questions.guarantees.len() * questions.probabilities.len();
        // Add three stages: the comparison, the danger zone and the panels.
        (region_windows(0).len() + tuned + 3) as u64
    }

    /// Computes all results and reports progress on `bar`.
    pub(super) fn of<M: ActionModel + Sync>(
        recorded: &[Recorded],
        parts: &Parts,
        prediction: Prediction<'_, M>,
        settings: &BoundsSettings,
        questions: &Questions,
        predictor: &str,
        bar: &ProgressBar,
    ) -> Result<Self, CommandError> {
        let trajectories: Vec<Trajectory> =
            recorded.iter().map(|recorded| recorded.trajectory.clone()).collect();
        let sample = parts.sample(&trajectories);
        // Trajectories that were not used to train the predictor or to tune the choice of actions.
        let unseen: Vec<Trajectory> = [&sample.calibration[..], &sample.test[..]].concat();
        let person = super::people(recorded);
        let drove: Vec<usize> =
            parts.calibration.iter().chain(&parts.test).map(|&i| person[i]).collect();
        let mut found = Vec::new();
        for choice in region_windows(questions.split.seed) {
            bar.set_message(format!("regions, {}", choice.word().replace('_', " ")));
            // A choice can give no window, for example because nobody turned early enough.
            if choice.windows(&unseen, settings.steps()).iter().any(|windows| !windows.is_empty()) {
                let confidence = questions.confidence;
                let regions =
                    regions_of_people(&unseen, &drove, choice, prediction, settings, confidence);
                found.push(regions.map_err(flagged)?);
            }
            bar.inc(1);
        }
        let mut tuning = Vec::new();
        for &guarantee in &questions.guarantees {
            for &p in &questions.probabilities {
                if !questions.can(guarantee, p, parts.calibration.len()).map_err(flagged)? {
                    bar.inc(1);
                    continue;
                }
                bar.set_message(format!("tuning, {} {p}", guarantee.word().replace('_', " ")));
                let settings = TuningSettings::new(
                    p,
                    guarantee,
                    candidates(prediction.actions(), questions.steps),
                )
                .with_windows(questions.windows)
                .with_confidence(questions.confidence)
                .with_unit(questions.unit);
                tuning.push(tune(&sample, prediction, &settings).map_err(flagged)?);
                bar.inc(1);
            }
        }
        bar.set_message("coverage against area");
        let pareto = compare(&sample, prediction, questions, &tuning).map_err(flagged)?;
        bar.inc(1);
        bar.set_message("danger zone");
        let choice = tuning.first().map_or_else(
            || choice_of_the_paper(questions.steps, prediction.actions()),
            |t| t.choice.clone(),
        );
        let danger =
            danger(recorded, parts, &sample, prediction, questions, &choice).map_err(flagged)?;
        bar.inc(1);
        bar.set_message("pictures");
        let mut names: Vec<&str> = recorded.iter().map(|r| r.participant.as_str()).collect();
        names.dedup();
        let panels = panels(recorded, parts, prediction, settings).map_err(flagged)?;
        bar.inc(1);
        Ok(Self {
            predictor: predictor.to_owned(),
            participants: names.len(),
            trajectories: Parted {
                training: parts.training.len(),
                calibration: parts.calibration.len(),
                test: parts.test.len(),
            },
            split: questions.unit,
            regions: found,
            regions_from: "the calibration and test parts".to_owned(),
            synthetic: None,
            tuning,
            left_out: Vec::new(),
            pareto,
            danger,
            panels,
        })
    }
}

/// Compares SHFRS with simpler predictions. The SHFRS use two kinds of action choices: those tuned for
/// the first guarantee, and the paper's choice.
fn compare<M: ActionModel + Sync>(
    sample: &Sample,
    prediction: Prediction<'_, M>,
    questions: &Questions,
    tuning: &[Tuned],
) -> Result<Pareto, Invalid> {
    let mut choices: Vec<ActionChoice> = Vec::new();
    let paper = choice_of_the_paper(questions.steps, prediction.actions());
    let first = |tuned: &&Tuned| tuned.guarantee == tuning[0].guarantee;
    for choice in tuning.iter().filter(first).map(|tuned| &tuned.choice).chain([&paper]) {
        if !choices.contains(choice) {
            choices.push(choice.clone());
        }
    }
    let compared = choices.into_iter().map(Compared::Shfrs).chain(Compared::BASELINES);
    let family =
        |compared: Compared| compared.family(prediction, &sample.training, questions.steps);
    let mut families = compared.map(family).collect::<Result<Vec<_>, _>>()?;
    let mut targets = questions.probabilities.clone();
    let n = sample.calibration.len();
    targets.retain(|&p| questions.can(Guarantee::Conformal, p, n).unwrap_or(false));
    let settings = ParetoSettings::new(
        targets,
        questions.confidence,
        questions.windows,
        questions.steps,
        POINTS,
    )?;
    pareto(&mut families, &sample.calibration, &sample.test, &settings)
}

fn danger<M: ActionModel + Sync>(
    recorded: &[Recorded],
    parts: &Parts,
    sample: &Sample,
    prediction: Prediction<'_, M>,
    questions: &Questions,
    choice: &ActionChoice,
) -> Result<Danger, Invalid> {
    let mut family = ShfrsFamily::new(prediction, choice)?;
    let name = family.name();
    let scores = Scores::of(&mut family, &sample.calibration, questions.windows, questions.steps)?;
    let radius_m = prediction.parameters.danger_radius_m;
    let mut rows = Vec::new();
    let windows = questions.windows.windows(&sample.test, questions.steps);
    for (&i, window) in parts.test.iter().zip(&windows) {
        let Some(window) = window.first() else { continue };
        let mut bounds = danger_bounds(window.history(), &prediction, choice, &scores)?;
        bounds.statement = statement(bounds.calibration, questions.unit);
        rows.push(DangerRow {
            participant: recorded[i].participant.clone(),
            trial: recorded[i].trial,
            step: window.begin(),
            bounds,
            entered: window.future().iter().any(|state| state.distance_m() <= radius_m),
        });
    }
    let mean = |of: &dyn Fn(&DangerRow) -> f64| {
        rows.iter().map(of).sum::<f64>() / rows.len().max(1) as f64
    };
    Ok(Danger {
        choice: name,
        statement: rows.first().map_or_else(String::new, |row| row.bounds.statement.clone()),
        mean_low: mean(&|row| row.bounds.low),
        entered: mean(&|row| f64::from(u8::from(row.entered))),
        mean_high: mean(&|row| row.bounds.high),
        windows: rows,
    })
}

/// Maximum number of predictions in the figure.
const PANELS: usize = 3;

/// Predictions at the first turn of the first test trajectories that have a turn. If no trajectory
/// has one, predictions at the start of the first test trajectories.
fn panels<M: ActionModel>(
    recorded: &[Recorded],
    parts: &Parts,
    prediction: Prediction<'_, M>,
    settings: &BoundsSettings,
) -> Result<Vec<RegionsPanel>, Invalid> {
    let parameters: &SceneParameters = prediction.parameters;
    let steps = settings.steps();
    let onset = |i: &&usize| {
        let trajectory = &recorded[**i].trajectory;
        trajectory.onset().and_then(|begin| Window::new(trajectory, begin, steps)).is_some()
    };
    let turning: Vec<&usize> = parts.test.iter().filter(onset).take(PANELS).collect();
    let chosen: Vec<&usize> =
        if turning.is_empty() { parts.test.iter().take(PANELS).collect() } else { turning };
    let panel = |i: usize| {
        let Recorded { participant, trial, trajectory, .. } = &recorded[i];
        let begin = trajectory.onset().unwrap_or(0);
        let found = prediction.bounds(&trajectory.states()[..=begin], settings)?;
        RegionsPanel::new(
            [format!("participant {participant}, trial {trial}, step {begin}"), String::new()],
            trajectory.states()[begin],
            &found.sets,
            &Motion::from(parameters),
            parameters.danger_radius_m,
        )
    };
    chosen.into_iter().map(|&i| panel(i)).collect()
}
