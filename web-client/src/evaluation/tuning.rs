//! Tunes settings for the smallest area at a given coverage, as `sidestep shfrs` does.

use super::areas::WINDOWS;
use super::counting::longest;
use super::{Asked, CONFIDENCE, Predicted, Report, Work};
use serde::{Deserialize, Serialize};
use sidestep::bounds::Rollout;
use sidestep::invalid::Invalid;
use sidestep::shfrs::file::ShfrsFile;
use sidestep::shfrs::guarantee::Guarantee;
use sidestep::shfrs::tuning::{Parts, Sample, TuningSettings, candidates, tune_watched};
use sidestep::shfrs::window::Trajectory;
use sidestep::stats::Estimate;

/// What to tune the settings for.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Aim {
    /// Number of the request. Its reports repeat the number.
    pub number: u32,
    /// The probability that a trajectory stays inside F_1, in (0, 1).
    pub p: f64,
    /// If the guarantee must hold for the individual calibration, the probability that the
    /// calibration fails. `None` if the guarantee must hold only on average over calibrations.
    pub delta: Option<f64>,
    /// The number of future steps T.
    pub steps: usize,
    /// Indices of the tasks that are used to choose the actions, to choose ε and to measure the
    /// coverage.
    pub parts: Parts,
}

impl Asked for Aim {
    fn number(&self) -> u32 {
        self.number
    }
}

impl Aim {
    /// The guarantee that the settings must have.
    #[must_use]
    pub fn guarantee(&self) -> Guarantee {
        self.delta.map_or(Guarantee::Conformal, |delta| Guarantee::Pac { delta })
    }
}

/// Result of tuning.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Found {
    /// The settings, with one set.
    pub settings: ShfrsFile,
    /// The requested probability.
    pub p: f64,
    /// The choice of actions, in words.
    pub actions: String,
    /// The guarantee in words, with its scope.
    pub statement: String,
    /// The numbers of tasks that were used to choose the actions, to choose ε and to measure the
    /// coverage, and the number of tasks without a window.
    pub tasks: [usize; 4],
    /// The share of the test tasks that stay inside, with its confidence interval.
    pub coverage: Estimate,
    /// Mean area of the tube of F_1 (m²).
    pub mean_area_m2: f64,
    /// The mean area as a fraction of the worst case's area.
    pub share_of_worst_case: f64,
}

/// Tuning in progress.
pub(super) struct Tuning {
    pub(super) number: u32,
    aim: Aim,
    sample: Sample,
    found: Option<Found>,
}

impl Tuning {
    pub(super) fn begin(
        aim: Aim,
        trajectories: &[Trajectory],
        _: &Predicted<'_>,
    ) -> Result<Work, Invalid> {
        let sample = aim.parts.sample(trajectories);
        longest(trajectories.iter(), aim.steps)?;
        Ok(Work::Tuning(Self { number: aim.number, aim, sample, found: None }))
    }

    /// Does all the tuning in one call, and passes progress reports to `progress`.
    pub(super) fn go_on(
        &mut self,
        prediction: &Predicted<'_>,
        progress: &mut dyn FnMut(Report),
    ) -> Result<bool, Invalid> {
        let settings = TuningSettings::new(
            self.aim.p,
            self.aim.guarantee(),
            candidates(prediction.actions(), self.aim.steps),
        )
        .with_windows(WINDOWS)
        .with_confidence(CONFIDENCE);
        let number = self.number;
        // The last report carries the result.
        let tell = &mut |done: f64| {
            progress(Report { number, done: done.min(0.99), ..Report::default() });
        };
        let tuned = tune_watched(&self.sample, *prediction, &settings, tell)?;
        let settings = prediction.settings(vec![tuned.epsilon], &tuned.choice, Rollout::Base)?;
        self.found = Some(Found {
            settings: ShfrsFile::from(&settings),
            p: tuned.p,
            actions: tuned.choice.to_string(),
            statement: tuned.statement,
            tasks: [tuned.training, tuned.calibration, tuned.test, tuned.without_window],
            coverage: tuned.coverage,
            mean_area_m2: tuned.mean_area_m2,
            share_of_worst_case: tuned.share_of_worst_case,
        });
        Ok(false)
    }

    /// Returns the result the first time, and `None` afterwards.
    pub(super) fn report(&mut self) -> Option<Report> {
        let found = Some(self.found.take()?);
        Some(Report { number: self.number, done: 1.0, found, ..Report::default() })
    }
}
