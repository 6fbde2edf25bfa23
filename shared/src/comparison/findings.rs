//! Findings: the results that a report puts into words.

use super::cell::{Cell, Experiment};
use super::gains::{Gain, GainFamily, Power, Test};
use super::metrics::Calibration;
use super::models::{BEYOND, Grids, ModelName};
use super::rollout::{Horizon, Simple};
use super::run::RolloutsOf;
use super::tables::{Comparison, Metric, Pooled};
use crate::stats::rank::is_shown;
use serde::Serialize;

/// Strength of the evidence.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// At least one test has p < 5 % after correction over its whole family.
    Shown,
    /// At least one test has p < 5 % before correction, but no test has p < 5 % after it.
    Hint,
    /// No test has p < 5 %, even before correction.
    NotShown,
    /// In every test, too few participants differ for the test to reject its null hypothesis.
    TooFew,
}

impl Verdict {
    fn of<'a>(gains: impl Iterator<Item = &'a Gain> + Clone) -> Self {
        let any = |p: fn(&Gain) -> f64| gains.clone().any(|gain| is_shown(p(gain)));
        if any(|gain| gain.holm) {
            Self::Shown
        } else if any(|gain| gain.paired.p) {
            Self::Hint
        } else if gains.clone().all(|gain| gain.paired.interval.is_none()) {
            Self::TooFew
        } else {
            Self::NotShown
        }
    }
}

/// The joint result of several tests.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Answer {
    /// Strength of the evidence.
    pub verdict: Verdict,
    /// The gain of each model. Gains in experiment I come first. There is at least one gain.
    pub gains: Vec<Gain>,
    /// The power of the tests.
    pub power: Power,
}

impl Answer {
    /// Returns `None` if there are no gains.
    fn of(power: Power, gains: Vec<Gain>) -> Option<Self> {
        let verdict = Verdict::of(gains.iter());
        (!gains.is_empty()).then_some(Self { verdict, gains, power })
    }
}

/// Whether safety levels help in addition to distance. The first model's test in experiment I is
/// included in full.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SafetyOverDistance {
    /// The result of all models and experiments.
    pub answer: Answer,
    /// The test of the first model in experiment I.
    pub main: Test,
    /// Mean accuracies of the first model in experiment I, with safety levels and with distance
    /// alone (per cent).
    pub accuracies: [f64; 2],
}

/// Whether safety levels change how well the start and end of avoidance are predicted.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct StartAndEnd {
    /// Verdict over the start and the end.
    pub verdict: Verdict,
    /// Result for the first steps of avoidance.
    pub start: Answer,
    /// Result for the last steps of avoidance.
    pub end: Answer,
}

/// A driver's results at the longest horizon.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Furthest {
    /// The driver's name: [`ModelName::word`] or [`Simple::word`].
    pub driver: &'static str,
    /// The name of the driver's feature set; empty for a simple driver.
    pub features: &'static str,
    /// Share of correct windows.
    pub accuracy: f64,
    /// Gain in accuracy over driving straight on, in percentage points.
    pub over_straight: f64,
    /// Mean error of the predicted position (m).
    pub distance_m: f64,
}

/// The number of drivers that beat both holding the last input and driving straight on.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct Beaten {
    /// Number of drivers with a higher accuracy.
    pub more_often_right: usize,
    /// Number of drivers with a smaller position error.
    pub closer: usize,
    /// Number of all drivers.
    pub of: usize,
}

impl Beaten {
    fn by(drivers: &[Furthest], [held, straight]: [&Furthest; 2]) -> Self {
        let often = held.accuracy.max(straight.accuracy);
        let near_m = held.distance_m.min(straight.distance_m);
        Self {
            more_often_right: drivers.iter().filter(|of| of.accuracy > often).count(),
            closer: drivers.iter().filter(|of| of.distance_m < near_m).count(),
            of: drivers.len(),
        }
    }
}

/// Roll-outs at the longest horizon.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct RolloutFacts {
    /// The horizon, in steps.
    pub steps: usize,
    /// Number of windows of each driver.
    pub windows: usize,
    /// The paper's models on B_hrd.
    pub papers: Vec<Furthest>,
    /// How many of the paper's models beat the simple drivers.
    pub papers_beaten: Beaten,
    /// The models of [`BEYOND`] that were trained.
    pub beyond: Vec<Furthest>,
    /// How many models of `beyond` beat the simple drivers.
    pub beyond_beaten: Beaten,
    /// The simple driver that holds the last input.
    pub held: Furthest,
    /// The simple driver that drives straight on.
    pub straight: Furthest,
}

/// Calibration of the probabilities on B_hrd.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct CalibrationFacts {
    /// One entry per experiment and model of the paper.
    pub entries: Vec<(ModelName, Experiment, Calibration)>,
    /// The smallest and the largest calibration error of these entries.
    pub errors: [f64; 2],
}

/// A model that often chose the largest C of its grid. A larger C might be better.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct GridEdge {
    /// The model.
    pub model: ModelName,
    /// The largest C of the model's grid.
    pub greatest: f64,
    /// Number of the model's cells that chose this C.
    pub chosen: usize,
    /// Number of the model's cells.
    pub of: usize,
}

/// All findings. A field is `None` if its data are missing.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Findings {
    /// Whether B_hrd is better than B_d.
    pub safety_over_distance: Option<SafetyOverDistance>,
    /// Whether the body frame is better than the safety levels.
    pub body_frame_instead: Option<Answer>,
    /// Whether the safety levels help in addition to the body frame.
    pub body_frame_too: Option<Answer>,
    /// Whether B_hrd is better than predicting the person's commonest input.
    pub over_baseline: Option<Answer>,
    /// Whether B_hrd finds the first and last steps of avoidance better than B_d.
    pub start_and_end: Option<StartAndEnd>,
    /// Whether B_h is better than B_r.
    pub which_level: Option<Answer>,
    /// Roll-outs of predictors.
    pub rollouts: Option<RolloutFacts>,
    /// Calibration of the probabilities.
    pub calibration: Option<CalibrationFacts>,
    /// Models whose grid might need a larger C.
    pub grid_edges: Vec<GridEdge>,
}

impl Findings {
    /// Derives the findings from all results.
    pub(super) fn of(
        comparison: &Comparison,
        tests: &[Test],
        families: &[GainFamily; 3],
        pooled: &[Pooled],
        rollouts: &[RolloutsOf],
        grids: &Grids,
    ) -> Self {
        let participants = comparison.participants.len();
        let tested = |metric, pair| answer_of_tests(participants, tests, metric, pair);
        let [instead, too, baseline] = families.each_ref().map(|family| {
            Answer::of(Power::of(participants, family.gains.len()), family.gains.clone())
        });
        Self {
            safety_over_distance: safety_over_distance(comparison, tests),
            body_frame_instead: instead,
            body_frame_too: too,
            over_baseline: baseline,
            start_and_end: tested(Metric::Start, ("hrd", "d"))
                .zip(tested(Metric::End, ("hrd", "d")))
                .map(|(start, end)| StartAndEnd {
                    verdict: Verdict::of(start.gains.iter().chain(&end.gains)),
                    start,
                    end,
                }),
            which_level: tested(Metric::Accuracy, ("h", "r")),
            rollouts: rollout_facts(rollouts),
            calibration: calibration_facts(pooled),
            grid_edges: grid_edges(comparison, grids),
        }
    }
}

/// The tests of one metric and one pair of sets, and the number of tests in the metric's family.
fn of_pair<'a>(tests: &'a [Test], metric: Metric, pair: (&str, &str)) -> (Vec<&'a Test>, usize) {
    let family = tests.iter().filter(|test| test.gain.metric == metric);
    let of_pair = family.clone().filter(|test| (test.first, test.second) == pair);
    let mut of_pair: Vec<&Test> = of_pair.collect();
    // The tests of experiment I come first.
    of_pair.sort_by_key(|test| test.gain.experiment);
    (of_pair, family.count())
}

fn answer_of_tests(
    participants: usize,
    tests: &[Test],
    metric: Metric,
    pair: (&str, &str),
) -> Option<Answer> {
    let (of_pair, family) = of_pair(tests, metric, pair);
    let gains = of_pair.into_iter().map(|test| test.gain.clone()).collect();
    Answer::of(Power::of(participants, family), gains)
}

fn safety_over_distance(comparison: &Comparison, tests: &[Test]) -> Option<SafetyOverDistance> {
    let pair = ("hrd", "d");
    let (of_pair, _) = of_pair(tests, Metric::Accuracy, pair);
    let main = (*of_pair.first()?).clone();
    let sets = [main.first, main.second];
    let accuracies = comparison.accuracies(main.gain.model, main.gain.experiment, &sets);
    let answer = answer_of_tests(comparison.participants.len(), tests, Metric::Accuracy, pair)?;
    Some(SafetyOverDistance { answer, main, accuracies: accuracies.try_into().ok()? })
}

fn rollout_facts(all: &[RolloutsOf]) -> Option<RolloutFacts> {
    let horizons = |driver, features| -> Option<&[Horizon]> {
        let of = all.iter().find(|of| of.driver == driver && of.features == features)?;
        Some(&of.horizons)
    };
    let straight = horizons(Simple::Straight.word(), "")?.last()?;
    let furthest = |(driver, features)| -> Option<Furthest> {
        let of = horizons(driver, features)?.last()?;
        let (accuracy, distance_m) = (of.accuracy(), of.mean_distance_m());
        let over_straight = of.over(straight).accuracy_points;
        Some(Furthest { driver, features, accuracy, over_straight, distance_m })
    };
    let simple = |driver: Simple| furthest((driver.word(), ""));
    let papers = ModelName::PAPERS.map(|model| furthest((model.word(), "hrd")));
    let papers: Vec<Furthest> = papers.into_iter().flatten().collect();
    let beyond: Vec<Furthest> =
        BEYOND.iter().map(|of| (of.model.word(), of.features)).filter_map(furthest).collect();
    let (held, straight) = (simple(Simple::Held)?, simple(Simple::Straight)?);
    let of_held = horizons(held.driver, held.features)?;
    (!papers.is_empty()).then(|| RolloutFacts {
        steps: of_held.len(),
        windows: of_held.last().map_or(0, |of| of.windows),
        papers_beaten: Beaten::by(&papers, [&held, &straight]),
        papers,
        beyond_beaten: Beaten::by(&beyond, [&held, &straight]),
        beyond,
        held,
        straight,
    })
}

fn calibration_facts(pooled: &[Pooled]) -> Option<CalibrationFacts> {
    let mut entries = Vec::new();
    for experiment in Experiment::ALL {
        for model in ModelName::PAPERS {
            let is = |of: &&Pooled| of.is(Some(model), experiment, "hrd");
            let found = pooled.iter().find(is).filter(|of| of.calibration.rows > 0);
            entries.extend(found.map(|of| (model, experiment, of.calibration)));
        }
    }
    let errors = || entries.iter().map(|(_, _, of)| of.calibration_error);
    let errors = [errors().fold(f64::INFINITY, f64::min), errors().fold(0.0, f64::max)];
    (!entries.is_empty()).then_some(CalibrationFacts { entries, errors })
}

fn grid_edges(comparison: &Comparison, grids: &Grids) -> Vec<GridEdge> {
    let strengths = |model: ModelName| Some((model, model.training()?.strengths(grids)?));
    let grids = ModelName::TRAINED.into_iter().filter_map(strengths);
    let edges = grids.filter_map(|(model, grid)| {
        let greatest = grid.iter().copied().reduce(f64::max).filter(|_| grid.len() > 1)?;
        let chosen = |cell: &&Cell| {
            let settings = serde_json::from_str::<serde_json::Value>(&cell.hyperparameters);
            settings.is_ok_and(|settings| settings["C"] == greatest)
        };
        let cells = || comparison.cells.iter().filter(|cell| cell.model == model);
        let (chosen, of) = (cells().filter(chosen).count(), cells().count());
        // The largest C is reported if more than a fifth of the cells chose it. If five values were
        // equally good, a fifth of the cells would choose it by chance.
        (5 * chosen > of).then_some(GridEdge { model, greatest, chosen, of })
    });
    edges.collect()
}
