//! Computes the area that each family of sets needs for a given coverage, one family after another
//! (SHFRS first).

use super::counting::longest;
use super::{Asked, CONFIDENCE, Predicted, Report, Work};
use serde::{Deserialize, Serialize};
use sidestep::invalid::Invalid;
use sidestep::shfrs::file::ShfrsFile;
use sidestep::shfrs::guarantee::Guarantee;
use sidestep::shfrs::pareto::{Compared, POINTS, Pareto, ParetoSettings, pareto};
use sidestep::shfrs::tuning::{Parts, Sample, Split};
use sidestep::shfrs::window::{Trajectory, WindowChoice};

/// A question: how much area does a coverage cost?
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct AreaQuestion {
    /// Number of the question. Its reports repeat the number.
    pub number: u32,
    /// Settings, of which only the choice of actions and the number of future steps are used. The
    /// widenings are ignored.
    pub settings: ShfrsFile,
    /// Indices of the tasks for training, for calibration and for the test.
    pub parts: Parts,
}

impl Asked for AreaQuestion {
    fn number(&self) -> u32 {
        self.number
    }
}

/// Target coverages, as in the `sidestep` command. Targets for which there are too few tasks are
/// left out.
const TARGETS: [f64; 3] = [0.75, 0.9, 0.95];

/// The smallest target coverage. If there are too few tasks for it, nothing is compared.
pub const LEAST_TARGET: f64 = TARGETS[0];

/// One random window per task, drawn as in the `sidestep` command.
pub(super) const WINDOWS: WindowChoice = WindowChoice::RandomOne { seed: Split::USUAL.seed };

/// Cached results for the baselines, in order. `of` contains the parts and the number of future
/// steps for which the results are valid.
#[derive(Default)]
pub(super) struct Known {
    of: Option<(Parts, usize)>,
    baselines: Vec<Pareto>,
}

/// A comparison in progress.
pub(super) struct Comparing {
    pub(super) number: u32,
    parts: Parts,
    sample: Sample,
    steps: usize,
    settings: ParetoSettings,
    /// The families to compare, in order.
    compared: Vec<Compared>,
    done: usize,
    found: Option<Pareto>,
    is_told: bool,
}

impl Comparing {
    pub(super) fn begin(
        AreaQuestion { number, settings, parts }: AreaQuestion,
        trajectories: &[Trajectory],
        prediction: &Predicted<'_>,
    ) -> Result<Work, Invalid> {
        let settings = settings.settings(prediction.actions())?;
        let (choice, steps) = (settings.choice().clone(), settings.steps());
        let sample = parts.sample(trajectories);
        longest(trajectories.iter(), steps)?;
        let calibration = WINDOWS.windows(&sample.calibration, steps).concat().len();
        Guarantee::Conformal.enough(calibration, TARGETS[0])?;
        let is_possible = |&target: &f64| Guarantee::Conformal.enough(calibration, target).is_ok();
        let targets = TARGETS.into_iter().filter(is_possible).collect();
        let settings = ParetoSettings::new(targets, CONFIDENCE, WINDOWS, steps, POINTS)?;
        let compared = [Compared::Shfrs(choice)].into_iter().chain(Compared::BASELINES).collect();
        let (done, found, is_told) = (0, None, true);
        Ok(Work::Comparing(Self {
            number,
            parts,
            sample,
            steps,
            settings,
            compared,
            done,
            found,
            is_told,
        }))
    }

    /// Evaluates the next family. Returns whether more families remain.
    pub(super) fn go_on(
        &mut self,
        prediction: &Predicted<'_>,
        known: &mut Known,
    ) -> Result<bool, Invalid> {
        let Some(compared) = self.compared.get(self.done) else { return Ok(false) };
        let same = |(parts, steps): &(Parts, usize)| *parts == self.parts && *steps == self.steps;
        if !known.of.as_ref().is_some_and(same) {
            *known = Known { of: Some((self.parts.clone(), self.steps)), baselines: Vec::new() };
        }
        let baseline = self.done.checked_sub(1);
        let found = match baseline.and_then(|place| known.baselines.get(place)) {
            Some(found) => found.clone(),
            None => {
                let Sample { training, calibration, test } = &self.sample;
                let mut family = [compared.family(*prediction, training, self.steps)?];
                let found = pareto(&mut family, calibration, test, &self.settings)?;
                if baseline.is_some() {
                    known.baselines.push(found.clone());
                }
                found
            }
        };
        match &mut self.found {
            Some(all) => all.extend(found),
            None => self.found = Some(found),
        }
        (self.done, self.is_told) = (self.done + 1, false);
        Ok(self.done < self.compared.len())
    }

    /// Returns the results so far, or `None` if nothing is new.
    pub(super) fn report(&mut self) -> Option<Report> {
        if std::mem::replace(&mut self.is_told, true) {
            return None;
        }
        let done = self.done as f64 / self.compared.len() as f64;
        let pareto = self.found.clone();
        Some(Report { number: self.number, done, pareto, ..Report::default() })
    }
}
