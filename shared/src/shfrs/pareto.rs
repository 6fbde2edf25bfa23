//! Compares families of predicted sets by coverage and area, on the same windows.
//!
//! Levels are calibrated on some trajectories and evaluated on others. The set of a calibrated
//! level contains a new trajectory with probability ≥ p. This guarantee of split conformal
//! prediction holds on average over trajectories that are exchangeable with the calibration
//! trajectories. It does not hold for each scene or each participant.

use super::baselines::{
    Gaussian, Mode, Nominal, PerModeEmpirical, WORST_CASE, constant_velocity, hold_the_input,
    learned_disturbance, worst_case,
};
use super::family::Family;
use super::guarantee::Guarantee;
use super::scores::{SHFRS, Scores, ShfrsFamily, single};
use super::window::{Trajectory, Window, WindowChoice};
use super::window_sets::Prediction;
use crate::bounds::{ActionChoice, ActionModel};
use crate::invalid::Invalid;
use crate::stats::{Tally, open_probability, share};
use serde::{Deserialize, Serialize};

/// The families to compare.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum Compared {
    /// SHFRS with this choice of actions.
    Shfrs(ActionChoice),
    /// Every position that the human can reach.
    WorstCase,
    /// Driving straight on.
    ConstantVelocity,
    /// Holding the input of the last step.
    HoldTheInput,
    /// The most likely action with a bounded disturbance.
    LearnedDisturbance,
    /// Normal distributions around a drive with the held input.
    Gaussian,
    /// Convex hulls of recorded futures, grouped by the most likely action.
    LikelyAction,
    /// Convex hulls of recorded futures, grouped by the held input.
    HeldInput,
}

impl Compared {
    /// All families except SHFRS.
    pub const BASELINES: [Self; 7] = [
        Self::WorstCase,
        Self::ConstantVelocity,
        Self::HoldTheInput,
        Self::LearnedDisturbance,
        Self::Gaussian,
        Self::LikelyAction,
        Self::HeldInput,
    ];

    /// Creates the family for this `prediction`. Families learned from recorded futures use every
    /// window of `steps` steps of `training`.
    ///
    /// # Errors
    /// [`Invalid`] if there are too few windows, or the settings do not match the model.
    pub fn family<'a, M: ActionModel + Sync>(
        &self,
        prediction: Prediction<'a, M>,
        training: &[Trajectory],
        steps: usize,
    ) -> Result<Box<dyn Family + Send + 'a>, Invalid> {
        let (parameters, model) = (prediction.parameters, prediction.model);
        let windows = || WindowChoice::EveryStep.windows(training, steps).concat();
        Ok(match self {
            Self::Shfrs(choice) => Box::new(ShfrsFamily::new(prediction, choice)?),
            Self::WorstCase => Box::new(worst_case(parameters)),
            Self::ConstantVelocity => Box::new(constant_velocity(parameters)),
            Self::HoldTheInput => Box::new(hold_the_input(parameters)),
            Self::LearnedDisturbance => Box::new(learned_disturbance(parameters, model)),
            Self::Gaussian => Box::new(Gaussian::learn(Nominal::Held, parameters, &windows())?),
            Self::LikelyAction => {
                let mode = Mode::MostLikely(model);
                Box::new(PerModeEmpirical::learn(mode, parameters, &windows())?)
            }
            Self::HeldInput => {
                Box::new(PerModeEmpirical::learn(Mode::<&M>::Held, parameters, &windows())?)
            }
        })
    }
}

/// The settings of a comparison.
#[derive(Clone, Debug, PartialEq)]
pub struct ParetoSettings {
    targets: Vec<f64>,
    confidence: f64,
    choice: WindowChoice,
    steps: usize,
    points: usize,
}

/// Default maximum number of levels on a curve.
pub const POINTS: usize = 60;

impl ParetoSettings {
    /// - `targets`: probabilities p in (0, 1) that a set contains a trajectory
    /// - `confidence`: confidence of the coverage intervals, in (0, 1)
    /// - `choice` and `steps` ≥ 1: the windows (at most one per trajectory) and their length
    /// - `points` ≥ 2: maximum number of levels on a curve
    ///
    /// # Errors
    /// [`Invalid`] that names the field.
    pub fn new(
        targets: Vec<f64>,
        confidence: f64,
        choice: WindowChoice,
        steps: usize,
        points: usize,
    ) -> Result<Self, Invalid> {
        if targets.is_empty() {
            return Err(Invalid::new("targets", "at least one probability", "none"));
        }
        for (i, &target) in targets.iter().enumerate() {
            open_probability(&format!("targets[{i}]"), target)?;
        }
        open_probability("confidence", confidence)?;
        single(choice)?;
        if steps == 0 {
            return Err(Invalid::new("steps", "at least 1", steps));
        }
        if points < 2 {
            return Err(Invalid::new("points", "at least 2", points));
        }
        Ok(Self { targets, confidence, choice, steps, points })
    }
}

/// The result of a comparison.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Pareto {
    /// The choice of windows, [`WindowChoice::word`].
    pub window_choice: String,
    /// Steps of a window.
    pub steps: usize,
    /// Number of calibration trajectories with a window.
    pub calibration_trajectories: usize,
    /// Number of test trajectories with a window.
    pub test_trajectories: usize,
    /// Confidence of the intervals.
    pub confidence: f64,
    /// One row for each family (in the given order) and each target.
    pub rows: Vec<ParetoRow>,
    /// One curve for each family, in the given order.
    pub curves: Vec<ParetoCurve>,
}

impl Pareto {
    /// The mean area of a row as a share of the mean area of the worst-case family. Returns `None`
    /// if the comparison does not include the worst-case family.
    #[must_use]
    pub fn share_of_worst_case(&self, row: &ParetoRow) -> Option<f64> {
        let worst = self.rows.iter().find(|of| of.family == WORST_CASE)?;
        Some(row.mean_area_m2 / worst.mean_area_m2)
    }

    /// Adds the results of further families, which must have been computed on the same windows.
    pub fn extend(&mut self, other: Self) {
        self.rows.extend(other.rows);
        self.curves.extend(other.curves);
    }
}

/// A family at its calibrated level for a target.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ParetoRow {
    /// The name of the family, [`Family::name`].
    pub family: String,
    /// The target probability p.
    pub target: f64,
    /// The name of the level, [`Family::level_name`].
    pub level_name: String,
    /// The calibrated level: the ⌈(n + 1)p⌉-th smallest of n calibration scores
    /// ([`Guarantee::Conformal`]).
    pub level: f64,
    /// Share of the test windows inside the set of this level.
    pub coverage: f64,
    /// Lower end of the interval of `coverage` (Clopper and Pearson).
    pub coverage_low: f64,
    /// Upper end of the interval of `coverage`.
    pub coverage_high: f64,
    /// Mean area of the set of this level over the test windows (m²).
    pub mean_area_m2: f64,
}

/// The coverage and area of a family on the test windows, at levels that are scores of these
/// windows.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ParetoCurve {
    /// The name of the family, [`Family::name`].
    pub family: String,
    /// The points, in ascending order of coverage.
    pub points: Vec<ParetoPoint>,
}

impl ParetoCurve {
    /// Whether it is the curve of an SHFRS family.
    #[must_use]
    pub fn is_shfrs(&self) -> bool {
        self.family.starts_with(SHFRS)
    }
}

/// One level of a curve.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ParetoPoint {
    /// The level, in the family's unit.
    pub level: f64,
    /// Share of the test windows inside the set.
    pub coverage: f64,
    /// Mean area over the test windows (m²).
    pub mean_area_m2: f64,
}

/// Compares `families`, which must have been trained on other trajectories. The families are
/// distributed over threads, but the result does not depend on the number of threads.
///
/// # Errors
/// [`Invalid`] if no calibration or no test trajectory has a window, there are too few trajectories
/// for a target (the error states how many are needed), or a prediction fails.
pub fn pareto(
    families: &mut [Box<dyn Family + Send + '_>],
    calibration: &[Trajectory],
    test: &[Trajectory],
    settings: &ParetoSettings,
) -> Result<Pareto, Invalid> {
    let windows = |name, trajectories| {
        let windows = settings.choice.windows(trajectories, settings.steps).concat();
        let found = format!("none in {} trajectories", trajectories.len());
        let expected = format!("a window of {} steps", settings.steps);
        if windows.is_empty() { Err(Invalid::new(name, expected, found)) } else { Ok(windows) }
    };
    let calibration = windows("calibration", calibration)?;
    let test = windows("test", test)?;
    let judged = each(families, |family| judge(family, &calibration, &test, settings))?;
    let (rows, curves): (Vec<_>, Vec<_>) = judged.into_iter().unzip();
    Ok(Pareto {
        window_choice: settings.choice.word().to_owned(),
        steps: settings.steps,
        calibration_trajectories: calibration.len(),
        test_trajectories: test.len(),
        confidence: settings.confidence,
        rows: rows.concat(),
        curves,
    })
}

type Judged = (Vec<ParetoRow>, ParetoCurve);

/// Runs `judge` for each family, on all available threads.
fn each<'a>(
    families: &mut [Box<dyn Family + Send + 'a>],
    judge: impl Fn(&mut (dyn Family + Send + 'a)) -> Result<Judged, Invalid> + Sync,
) -> Result<Vec<Judged>, Invalid> {
    let judge = |family: &mut Box<dyn Family + Send + 'a>| judge(family.as_mut());
    #[cfg(not(target_arch = "wasm32"))]
    {
        use rayon::prelude::*;
        families.par_iter_mut().with_max_len(1).map(judge).collect()
    }
    #[cfg(target_arch = "wasm32")]
    families.iter_mut().map(judge).collect()
}

fn judge(
    family: &mut (dyn Family + Send + '_),
    calibration: &[Window<'_>],
    test: &[Window<'_>],
    settings: &ParetoSettings,
) -> Result<Judged, Invalid> {
    let calibrated = scores(family, calibration)?;
    let scores = scores(family, test)?;
    let n = scores.len();
    let inside = |level: f64| scores.sorted().partition_point(|&score| score <= level);
    let row = |&target: &f64| {
        let level = Guarantee::Conformal.level(&calibrated, target)?;
        let hits = inside(level);
        let tally = |i| Tally { hits: usize::from(i < hits), of: 1 };
        let tallies: Vec<Tally> = (0..n).map(tally).collect();
        let coverage = share(&tallies, settings.confidence)?;
        Ok(ParetoRow {
            family: family.name(),
            target,
            level_name: family.level_name().to_owned(),
            level,
            coverage: coverage.value,
            coverage_low: coverage.low,
            coverage_high: coverage.high,
            mean_area_m2: mean_area(family, test, level)?,
        })
    };
    let rows = settings.targets.iter().map(row).collect::<Result<_, Invalid>>()?;
    // Keeps only the largest of several levels that differ only by rounding errors.
    let mut levels: Vec<f64> = scores.sorted().iter().rev().copied().collect();
    levels.dedup_by(|smaller, larger| *larger - *smaller <= 1e-6 * family.most());
    levels.reverse();
    let point = |level| {
        let coverage = inside(level) as f64 / n as f64;
        Ok(ParetoPoint { level, coverage, mean_area_m2: mean_area(family, test, level)? })
    };
    let points = thinned(&levels, settings.points).map(point).collect::<Result<_, Invalid>>()?;
    Ok((rows, ParetoCurve { family: family.name(), points }))
}

fn scores(
    family: &mut (dyn Family + Send + '_),
    windows: &[Window<'_>],
) -> Result<Scores, Invalid> {
    let scores = windows.iter().map(|window| family.score(window));
    Scores::new(scores.collect::<Result<_, _>>()?)
}

fn mean_area(
    family: &mut (dyn Family + Send + '_),
    windows: &[Window<'_>],
    level: f64,
) -> Result<f64, Invalid> {
    let areas = windows.iter().map(|window| family.area_m2(window, level));
    Ok(areas.sum::<Result<f64, Invalid>>()? / windows.len() as f64)
}

/// At most `most` of the values, at evenly spaced indices that include both ends of the list.
fn thinned(values: &[f64], most: usize) -> impl Iterator<Item = f64> {
    let count = values.len().min(most);
    let last = values.len() - 1;
    let at = move |i: usize| if count < 2 { last } else { i * last / (count - 1) };
    (0..count).map(move |i| values[at(i)])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::JointState;
    use crate::vehicle::Pose;

    /// Sets whose area equals their level. The score of a window is its first turn rate.
    struct Plain(&'static str);

    impl Family for Plain {
        fn name(&self) -> String {
            self.0.to_owned()
        }

        fn most(&self) -> f64 {
            100.0
        }

        fn score(&mut self, window: &Window<'_>) -> Result<f64, Invalid> {
            Ok(window.turn_rates()[0])
        }

        fn area_m2(&mut self, window: &Window<'_>, level: f64) -> Result<f64, Invalid> {
            Ok(level + window.begin() as f64)
        }
    }

    /// One-step drives with turn rates 1, 2, … `n`, shuffled.
    fn drives(n: usize) -> Vec<Trajectory> {
        let pose = Pose::new(0.0, 0.0, 0.0);
        let state = JointState { human: pose, robot: pose };
        let drive = |i: usize| Trajectory::new(vec![state; 2], vec![(i * 7 % n + 1) as f64]);
        (0..n).map(|i| drive(i).unwrap()).collect()
    }

    fn settings(targets: Vec<f64>) -> ParetoSettings {
        ParetoSettings::new(targets, 0.95, WindowChoice::RandomOne { seed: 1 }, 1, 5).unwrap()
    }

    #[test]
    fn levels_are_conformal_ranks() {
        let mut families: Vec<Box<dyn Family + Send>> = vec![Box::new(Plain("plain"))];
        let found = settings(vec![0.5, 0.75, 0.9]);
        let found = pareto(&mut families, &drives(19), &drives(10), &found).unwrap();
        let levels: Vec<f64> = found.rows.iter().map(|row| row.level).collect();
        // The ⌈20p⌉-th smallest of 19 scores.
        assert_eq!(levels, [10.0, 15.0, 18.0]);
        let coverages: Vec<f64> = found.rows.iter().map(|row| row.coverage).collect();
        assert_eq!(coverages, [1.0; 3]);
        assert_eq!((found.calibration_trajectories, found.test_trajectories), (19, 10));
        assert_eq!(found.window_choice, "random_one");
        assert_eq!(found.rows[0].mean_area_m2, 10.0);
        // The required rank ⌈20 · 0.96⌉ = ⌈19.2⌉ = 20 exceeds the number of scores.
        let complaint = pareto(&mut families, &drives(19), &drives(10), &settings(vec![0.96]));
        assert_eq!(complaint.unwrap_err().found, "19");
    }

    #[test]
    fn curves_go_from_the_least_score_to_the_largest() {
        let mut families: Vec<Box<dyn Family + Send>> = vec![Box::new(Plain("plain"))];
        let found = pareto(&mut families, &drives(3), &drives(11), &settings(vec![0.5])).unwrap();
        let points = &found.curves[0].points;
        let levels: Vec<f64> = points.iter().map(|point| point.level).collect();
        assert_eq!(levels, [1.0, 3.0, 6.0, 8.0, 11.0]);
        assert_eq!(points[0].coverage, 1.0 / 11.0);
        assert_eq!(points[4].coverage, 1.0);
    }

    #[test]
    fn the_number_of_threads_changes_nothing() {
        let compare = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            let mut families: Vec<Box<dyn Family + Send>> =
                ["a", "b", "c"].map(|name| Box::new(Plain(name)) as _).into();
            let settings = settings(vec![0.5, 0.9]);
            pool.install(|| pareto(&mut families, &drives(30), &drives(30), &settings)).unwrap()
        };
        let one = compare(1);
        assert_eq!(one, compare(4));
        let names: Vec<&str> = one.curves.iter().map(|curve| curve.family.as_str()).collect();
        assert_eq!(names, ["a", "b", "c"]);
    }

    #[test]
    fn complaints_name_the_field() {
        let one = WindowChoice::RandomOne { seed: 1 };
        let field = |targets: &[f64], confidence, choice, steps, points| {
            let settings = ParetoSettings::new(targets.to_vec(), confidence, choice, steps, points);
            settings.unwrap_err().field
        };
        assert_eq!(field(&[], 0.9, one, 1, 9), "targets");
        assert_eq!(field(&[0.5, 1.0], 0.9, one, 1, 9), "targets[1]");
        assert_eq!(field(&[0.5], f64::NAN, one, 1, 9), "confidence");
        assert_eq!(field(&[0.5], 0.9, WindowChoice::EveryStep, 1, 9), "window_choice");
        assert_eq!(field(&[0.5], 0.9, one, 0, 9), "steps");
        assert_eq!(field(&[0.5], 0.9, one, 1, 1), "points");
        let long = ParetoSettings::new(vec![0.5], 0.9, one, 2, 9).unwrap();
        let complaint = pareto(&mut [], &drives(3), &drives(3), &long).unwrap_err();
        assert_eq!(complaint.field, "calibration");
    }
}
