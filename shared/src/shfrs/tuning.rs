//! Tuning: minimises the area subject to p_{F_1} ≥ p, with a guarantee.
//!
//! Trajectories are split into three parts. The *training* part selects the choice of actions with
//! the least area. The *calibration* part, which is not used in that selection, determines ε_1 so
//! that the guarantee holds. The *test* part measures coverage and area.

mod least_area;

use super::baselines::worst_case_area_m2;
use super::guarantee::{Guarantee, Unit, fixed_sequence};
use super::probability::holds;
use super::scores::{Scores, single};
use super::widened::{least_widening, tube_area_m2};
use super::window::{Trajectory, Window, WindowChoice};
use super::window_sets::Prediction;
use crate::bounds::{ActionChoice, ActionModel, BoundsSettings, Rollout};
use crate::invalid::Invalid;
use crate::math::SeededRng;
use crate::parallel::parallel_map;
use crate::stats::{Estimate, Tally, open_probability, share};
use least_area::{least_area, ranks};
use serde::{Deserialize, Serialize};

/// The shares of trajectories for training and calibration. The rest is for testing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Split {
    /// Share for training, in (0, 1).
    pub training: f64,
    /// Share for calibration, in (0, 1). `training` + `calibration` is at most 1.
    pub calibration: f64,
    /// Seed of the random split.
    pub seed: u64,
}

impl Split {
    /// The default split, also on the command line and in the laboratory: 40 % training, 30 %
    /// calibration, 30 % test.
    pub const USUAL: Self = Self { training: 0.4, calibration: 0.3, seed: 0 };
}

/// XORed with the seed, so that people and their trajectories are drawn with different random numbers.
const ONE_EACH: u64 = 0x6f6e_655f_6561_6368;

impl Default for Split {
    /// [`Split::USUAL`].
    fn default() -> Self {
        Self::USUAL
    }
}

/// The trajectories of each part of a random split, as indices.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Parts {
    /// Trajectories that select the choice of actions.
    pub training: Vec<usize>,
    /// Trajectories that calibrate ε_1.
    pub calibration: Vec<usize>,
    /// Trajectories that measure the coverage.
    pub test: Vec<usize>,
}

/// Recorded trajectories, split into three parts.
#[derive(Clone, Debug, PartialEq)]
pub struct Sample {
    /// Trajectories that select the choice of actions.
    pub training: Vec<Trajectory>,
    /// Trajectories that calibrate ε_1.
    pub calibration: Vec<Trajectory>,
    /// Trajectories that measure the coverage; may be empty.
    pub test: Vec<Trajectory>,
}

impl Parts {
    /// The trajectories of each part.
    ///
    /// # Panics
    /// If an index of the split is out of range.
    #[must_use]
    pub fn sample(&self, trajectories: &[Trajectory]) -> Sample {
        let pick = |part: &[usize]| part.iter().map(|&i| trajectories[i].clone()).collect();
        Sample {
            training: pick(&self.training),
            calibration: pick(&self.calibration),
            test: pick(&self.test),
        }
    }
}

impl Split {
    /// Splits the indices 0 … `n` − 1. Shares are rounded to whole trajectories.
    ///
    /// # Errors
    /// [`Invalid`] if a share is not in (0, 1), or their sum exceeds 1.
    pub fn parts(&self, n: usize) -> Result<Parts, Invalid> {
        open_probability("training", self.training)?;
        open_probability("calibration", self.calibration)?;
        let sum = self.training + self.calibration;
        if sum > 1.0 + 1e-9 {
            let expected = "shares of training and calibration that sum to at most 1";
            return Err(Invalid::new("calibration", expected, sum));
        }
        let mut training = SeededRng::new(self.seed).permutation(n);
        let upto = |share: f64| ((share * n as f64).round() as usize).min(n);
        let test = training.split_off(upto(sum));
        let calibration = training.split_off(upto(self.training).min(training.len()));
        Ok(Parts { training, calibration, test })
    }

    /// Splits trajectories so that each person is in only one part. `person[i]` is the index, from
    /// 0, of the person who drove trajectory i. The shares apply to people. The training part has
    /// every trajectory of its people. The other parts have one random trajectory of each person
    /// ([`Unit::People`]).
    ///
    /// # Errors
    /// The errors of [`Self::parts`].
    pub fn parts_of_people(&self, person: &[usize]) -> Result<Parts, Invalid> {
        let people = person.iter().max().map_or(0, |last| last + 1);
        let mut own = vec![Vec::new(); people];
        for (trajectory, &person) in person.iter().enumerate() {
            own[person].push(trajectory);
        }
        own.retain(|own| !own.is_empty());
        let of_people = self.parts(own.len())?;
        let mut rng = SeededRng::new(self.seed ^ ONE_EACH);
        let mut one = |&person: &usize| own[person][rng.below(own[person].len())];
        Ok(Parts {
            calibration: of_people.calibration.iter().map(&mut one).collect(),
            test: of_people.test.iter().map(&mut one).collect(),
            training: of_people.training.iter().flat_map(|&person| own[person].clone()).collect(),
        })
    }
}

/// The aim and the settings of tuning.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct TuningSettings {
    /// Probability p that a trajectory stays inside F_1, in (0, 1).
    pub p: f64,
    /// The kind of guarantee.
    pub guarantee: Guarantee,
    /// The choice of windows, with at most one window per trajectory.
    pub windows: WindowChoice,
    /// The candidates, all with the same number of steps; [`candidates`] returns the default ones.
    pub candidates: Vec<ActionChoice>,
    /// Confidence of the interval of the measured coverage, in (0, 1).
    pub confidence: f64,
    /// The unit of observation of the sample's calibration and test trajectories.
    pub unit: Unit,
}

impl TuningSettings {
    /// Settings with one random window per trajectory (seed 0), and intervals of 95 % confidence.
    #[must_use]
    pub fn new(p: f64, guarantee: Guarantee, candidates: Vec<ActionChoice>) -> Self {
        let windows = WindowChoice::RandomOne { seed: 0 };
        let unit = Unit::Trajectories;
        Self { p, guarantee, windows, candidates, confidence: 0.95, unit }
    }

    /// Sets [`Self::windows`], the choice of windows.
    #[must_use]
    pub fn with_windows(self, windows: WindowChoice) -> Self {
        Self { windows, ..self }
    }

    /// Sets [`Self::unit`]. Use [`Unit::People`] for a sample from [`Split::parts_of_people`].
    #[must_use]
    pub fn with_unit(self, unit: Unit) -> Self {
        Self { unit, ..self }
    }

    /// Sets [`Self::confidence`], the confidence of the interval of the measured coverage.
    #[must_use]
    pub fn with_confidence(self, confidence: f64) -> Self {
        Self { confidence, ..self }
    }
}

/// Thresholds τ of the adaptive candidates. A finer grid overfits the training part: with steps of
/// 0.01, the calibrated tubes become larger, not smaller.
const TAUS: [f64; 14] =
    [0.005, 0.01, 0.02, 0.03, 0.05, 0.07, 0.1, 0.15, 0.2, 0.25, 0.3, 0.35, 0.4, 0.5];

/// The default candidates: adaptive choices with τ from 0.005 to 0.5, and schedules of k. A
/// schedule includes all `actions` before step a, half of them (rounded up) before step b, and one
/// action from step b on (for three actions: 3, 2, 1). The candidates include the schedules for all
/// a ≤ b.
#[must_use]
pub fn candidates(actions: usize, steps: usize) -> Vec<ActionChoice> {
    let mut found: Vec<ActionChoice> =
        TAUS.iter().map(|&tau| ActionChoice::Adaptive { tau, steps }).collect();
    for a in 0..=steps {
        for b in a..=steps {
            let k = |i| {
                if i < a {
                    actions
                } else if i < b {
                    actions.div_ceil(2)
                } else {
                    1
                }
            };
            let schedule = ActionChoice::TopK((0..steps).map(k).collect());
            if !found.contains(&schedule) {
                found.push(schedule);
            }
        }
    }
    found
}

/// A tuned setting with its guarantee and its measured coverage and area.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Tuned {
    /// The choice of actions.
    #[serde(serialize_with = "in_words")]
    pub choice: ActionChoice,
    /// ε_1 (rad/s).
    pub epsilon: f64,
    /// `base` or `paper` roll-outs.
    pub rollout: String,
    /// The target probability, p.
    pub p: f64,
    /// The kind of guarantee, [`Guarantee::word`].
    pub guarantee: String,
    /// The guarantee in words, with its scope and the number of trajectories.
    pub statement: String,
    /// The exchangeable units over which the guarantee holds.
    pub unit: Unit,
    /// The choice of windows, [`WindowChoice::word`].
    pub window_choice: String,
    /// Steps ahead, T.
    pub steps: usize,
    /// Number of training trajectories.
    pub training: usize,
    /// Number of calibration trajectories.
    pub calibration: usize,
    /// Number of test trajectories.
    pub test: usize,
    /// Number of trajectories without a window; these are omitted.
    pub without_window: usize,
    /// Share of the test trajectories that stay inside, with its interval.
    pub coverage: Estimate,
    /// Confidence of that interval.
    pub confidence: f64,
    /// Mean area (m²) of the tube of F_1 over the test part, or over the calibration part if there
    /// is no test part.
    pub mean_area_m2: f64,
    /// This mean area as a share of the worst-case area, the area of everything that the vehicle can
    /// reach. If the share is near 1, the guarantee says no more than the vehicle model.
    pub share_of_worst_case: f64,
    /// Largest distance from the set (m) at which a recorded position counted as inside.
    pub tolerance_m: f64,
    /// Largest heading difference from the set (rad) at which a recorded heading counted as inside.
    pub tolerance_rad: f64,
}

fn in_words<S: serde::Serializer>(choice: &ActionChoice, to: S) -> Result<S::Ok, S::Error> {
    to.collect_str(choice)
}

/// Tunes on recorded trajectories. The predictor must not have been trained on the calibration or
/// test trajectories; otherwise the guarantee is void.
///
/// # Example
/// How much must bounds be widened so that a person's next drive stays inside with probability ≥ 0.75?
/// ```
/// use sidestep::bounds::{ActionChoice, ActionModel, ActionSpace};
/// use sidestep::scene::{JointState, SceneParameters};
/// use sidestep::shfrs::guarantee::Guarantee;
/// use sidestep::shfrs::window_sets::Prediction;
/// use sidestep::shfrs::tuning::{Split, TuningSettings, tune};
/// use sidestep::shfrs::window::Trajectory;
/// use sidestep::synthetic::{Keys, SyntheticParticipant};
///
/// struct Straight; // a person who is expected to drive straight on
/// impl ActionModel for Straight {
///     fn actions(&self) -> ActionSpace<'_> {
///         ActionSpace::Levels(&[-0.5, 0.0, 0.5]) // rad/s
///     }
///     fn probabilities(&self, _history: &[JointState], out: &mut [f64]) {
///         out.copy_from_slice(&[0.1, 0.8, 0.1]);
///     }
/// }
///
/// # fn main() -> Result<(), sidestep::invalid::Invalid> {
/// let (parameters, person) = (SceneParameters::default(), SyntheticParticipant::new(7, 0));
/// let drives = (0..30).map(|trial| person.own_trial(trial, Keys::Clock).1);
/// let driven = drives.map(|drive| Trajectory::driven(drive.states, &drive.inputs, &parameters));
/// let trajectories = driven.collect::<Result<Vec<_>, _>>()?;
/// let sample = Split::default().parts(trajectories.len())?.sample(&trajectories);
/// let candidates = vec![ActionChoice::TopK(vec![1; 5])];
/// let settings = TuningSettings::new(0.75, Guarantee::Conformal, candidates);
/// let tuned = tune(&sample, Prediction::new(&parameters, &Straight), &settings)?;
/// assert!((0.0..=1.0).contains(&tuned.epsilon)); // rad/s
/// println!("{}: ε = {:.3} rad/s", tuned.statement, tuned.epsilon);
/// # Ok(())
/// # }
/// ```
///
/// # Errors
/// [`Invalid`] if a setting is invalid, the choice of windows allows several per trajectory, or
/// there are too few trajectories for the guarantee (the error states how many are needed).
pub fn tune(
    sample: &Sample,
    prediction: Prediction<'_, impl ActionModel + Sync>,
    settings: &TuningSettings,
) -> Result<Tuned, Invalid> {
    tune_watched(sample, prediction, settings, &mut |_| {})
}

/// Like [`tune`], but reports its progress, from 0 to 1, to `progress`.
///
/// # Errors
/// The errors of [`tune`].
pub fn tune_watched(
    sample: &Sample,
    prediction: Prediction<'_, impl ActionModel + Sync>,
    settings: &TuningSettings,
    progress: &mut dyn FnMut(f64),
) -> Result<Tuned, Invalid> {
    let families = families(&prediction, settings)?;
    let steps = families[0].steps();
    let parts = [&sample.training, &sample.calibration, &sample.test];
    let [training, calibration, test] =
        parts.map(|part| settings.windows.windows(part, steps).concat());
    let trajectories: usize = parts.map(Vec::len).iter().sum();
    let windows = training.len() + calibration.len() + test.len();
    settings.guarantee.enough(calibration.len(), settings.p)?;
    if training.is_empty() {
        return Err(Invalid::new("training trajectories", "at least 1", 0));
    }
    let held = settings.guarantee.held(calibration.len(), settings.p)?;
    let ranks = ranks(held, training.len());
    let chosen = &families[least_area(&training, &prediction, &families, &ranks, progress)?];
    let (epsilon, rollout) = match settings.guarantee {
        Guarantee::Conformal | Guarantee::Pac { .. } => {
            let scores = parallel_map(&calibration, |window| {
                let base = prediction.bounds(window.history(), chosen)?.raw;
                least_widening(&base, window, prediction.parameters, prediction.tolerance)
            })?;
            (settings.guarantee.level(&Scores::new(scores)?, settings.p)?, Rollout::Base)
        }
        Guarantee::FixedSequence { delta, levels } => {
            let level =
                |i: usize| prediction.full_range() * (levels - 1 - i) as f64 / (levels - 1) as f64;
            let hits = |i: usize| {
                let used = prediction.settings(vec![level(i)], chosen.choice(), Rollout::Paper)?;
                inside(&calibration, &prediction, &used)
            };
            let n = calibration.len();
            let accepted = fixed_sequence(levels, hits, n, settings.p, delta)?;
            (level(accepted), Rollout::Paper)
        }
    };
    let used = prediction.settings(vec![epsilon], chosen.choice(), rollout)?;
    let tally = Tally { hits: inside(&test, &prediction, &used)?, of: test.len() };
    let measured = if test.is_empty() { &calibration } else { &test };
    let areas = parallel_map(measured, |window| {
        tube_area_m2(&prediction.bounds(window.history(), &used)?.sets[0], prediction.parameters)
    })?;
    let mean_area_m2 = areas.iter().sum::<f64>() / areas.len() as f64;
    let share_of_worst_case = mean_area_m2 / worst_case_area_m2(prediction.parameters, steps)?;
    Ok(Tuned {
        choice: chosen.choice().clone(),
        epsilon,
        rollout: rollout.word().to_owned(),
        p: settings.p,
        guarantee: settings.guarantee.word().to_owned(),
        statement: settings.guarantee.statement(settings.p, calibration.len(), settings.unit)
            + &beside_worst_case(share_of_worst_case),
        unit: settings.unit,
        window_choice: settings.windows.word().to_owned(),
        steps,
        training: training.len(),
        calibration: calibration.len(),
        test: test.len(),
        without_window: trajectories - windows,
        coverage: share_of_one(tally, settings.confidence)?,
        confidence: settings.confidence,
        mean_area_m2,
        share_of_worst_case,
        tolerance_m: prediction.tolerance.position_m,
        tolerance_rad: prediction.tolerance.heading_rad,
    })
}

/// A set with at least this share of the worst-case area says hardly more than the vehicle's
/// limits.
const SAYS_NOTHING: f64 = 0.95;

/// A warning if the set is hardly smaller than the worst-case set, or an empty string otherwise.
fn beside_worst_case(share: f64) -> String {
    if share < SAYS_NOTHING {
        return String::new();
    }
    format!(
        " The set is {:.1} % of all that the vehicle can reach: the guarantee says next to nothing beyond the \
         vehicle's limits.",
        100.0 * share
    )
}

/// The share of trajectories that stay inside, with one window per trajectory.
fn share_of_one(Tally { hits, of }: Tally, confidence: f64) -> Result<Estimate, Invalid> {
    let tallies: Vec<Tally> =
        (0..of).map(|i| Tally { hits: usize::from(i < hits), of: 1 }).collect();
    share(&tallies, confidence)
}

/// Checks the settings. Returns the settings of Algorithm 1 for each candidate.
fn families(
    prediction: &Prediction<'_, impl ActionModel>,
    settings: &TuningSettings,
) -> Result<Vec<BoundsSettings>, Invalid> {
    open_probability("p", settings.p)?;
    open_probability("confidence", settings.confidence)?;
    settings.guarantee.check()?;
    single(settings.windows)?;
    let family = |(i, choice): (usize, &ActionChoice)| {
        prediction
            .settings(vec![0.0], choice, Rollout::Base)
            .map_err(|invalid| invalid.within(&format!("candidates[{i}]")))
    };
    let families: Vec<BoundsSettings> =
        settings.candidates.iter().enumerate().map(family).collect::<Result<_, _>>()?;
    let Some(steps) = families.first().map(BoundsSettings::steps) else {
        return Err(Invalid::new("candidates", "at least one", "none"));
    };
    if let Some(i) = families.iter().position(|family| family.steps() != steps) {
        let expected = format!("{steps} steps, like the first candidate");
        return Err(Invalid::new(format!("candidates[{i}]"), expected, families[i].steps()));
    }
    Ok(families)
}

/// The number of windows that stay inside F_1.
fn inside(
    windows: &[Window<'_>],
    prediction: &Prediction<'_, impl ActionModel + Sync>,
    settings: &BoundsSettings,
) -> Result<usize, Invalid> {
    // A set that admits every turn rate contains every trajectory by definition.
    if settings.epsilon()[0] >= prediction.full_range() {
        return Ok(windows.len());
    }
    let held = parallel_map(windows, |window| {
        holds(&prediction.bounds(window.history(), settings)?.sets[0], window, prediction)
    })?;
    Ok(held.into_iter().filter(|&held| held).count())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_are_parts() {
        let parts = Split::default().parts(101).unwrap();
        assert_eq!((parts.training.len(), parts.calibration.len(), parts.test.len()), (40, 31, 30));
        let mut all = [parts.training, parts.calibration, parts.test].concat();
        all.sort_unstable();
        assert_eq!(all, (0..101).collect::<Vec<_>>());
        let people = [0, 0, 0, 1, 2, 2, 3, 4, 4, 4, 5, 6, 6, 7, 8, 9, 9];
        for seed in 0..50 {
            let Parts { training, calibration, test } =
                Split { seed, ..Split::USUAL }.parts_of_people(&people).unwrap();
            assert_eq!((calibration.len(), test.len()), (3, 3));
            let who = |part: &[usize]| part.iter().map(|&i| people[i]).collect::<Vec<_>>();
            let mut everybody = [who(&training), who(&calibration), who(&test)].concat();
            everybody.sort_unstable();
            everybody.dedup();
            assert_eq!(everybody, (0..10).collect::<Vec<_>>());
            let alone = [who(&calibration), who(&test)].concat();
            assert!(alone.iter().all(|person| !who(&training).contains(person)));
            // The training part has all trajectories of its people.
            let trains = |i: &usize| who(&training).contains(&people[*i]);
            assert_eq!((0..people.len()).filter(trains).count(), training.len());
        }
        let none = Split { training: 0.5, calibration: 0.5, seed: 1 }.parts(7).unwrap();
        assert!(none.test.is_empty());
        let field = |training, calibration| {
            Split { training, calibration, seed: 0 }.parts(9).unwrap_err().field
        };
        assert_eq!(field(0.0, 0.5), "training");
        assert_eq!(field(0.5, f64::NAN), "calibration");
        assert_eq!(field(0.6, 0.5), "calibration");
    }

    #[test]
    fn schedules_come_down_from_all_actions_to_one() {
        let schedules = |actions, steps| candidates(actions, steps).len() - TAUS.len();
        assert_eq!(schedules(3, 10), 66);
        assert_eq!(schedules(2, 4), 5);
        assert_eq!(schedules(1, 4), 1);
        assert!(candidates(5, 3).contains(&ActionChoice::TopK(vec![5, 3, 1])));
    }
}
