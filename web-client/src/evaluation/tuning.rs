//! Settings with the least area for a coverage that is asked for, as `sidestep shfrs` tunes them.

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

/// What tuning is to reach.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Aim {
    /// Its reports have this number.
    pub number: u32,
    /// The probability that a trajectory stays inside F_1, in (0, 1).
    pub p: f64,
    /// How often the calibration may fail, if the guarantee is to hold for each calibration; else it holds on
    /// average over calibrations.
    pub delta: Option<f64>,
    /// Steps ahead, T.
    pub steps: usize,
    /// The places of the tasks to choose the actions, to calibrate ε and to measure the coverage.
    pub parts: Parts,
}

impl Asked for Aim {
    fn number(&self) -> u32 {
        self.number
    }
}

impl Aim {
    /// What is to be guaranteed.
    #[must_use]
    pub fn guarantee(&self) -> Guarantee {
        self.delta.map_or(Guarantee::Conformal, |delta| Guarantee::Pac { delta })
    }
}

/// What tuning has found.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Found {
    /// The settings: one set.
    pub settings: ShfrsFile,
    /// The probability that was asked for.
    pub p: f64,
    /// The choice of actions, in words.
    pub actions: String,
    /// The guarantee in words, with its scope.
    pub statement: String,
    /// Numbers of tasks for the choice of actions, for ε and for the coverage, and without a window.
    pub tasks: [usize; 4],
    /// Share of the test tasks that stay inside, with its interval.
    pub coverage: Estimate,
    /// Mean area of the tube of F_1, m².
    pub mean_area_m2: f64,
    /// The same as a share of the worst case's.
    pub share_of_worst_case: f64,
}

/// An aim that is being reached.
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

    /// Tunes in a single piece, which tells how far it has come.
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
        // The last report has the result.
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

    /// What was found, once.
    pub(super) fn report(&mut self) -> Option<Report> {
        let found = Some(self.found.take()?);
        Some(Report { number: self.number, done: 1.0, found, ..Report::default() })
    }
}
