//! Counts how often predicted sets contain the future, task by task in random order.

use super::{Asked, CONFIDENCE, Predicted, Report, Work};
use serde::{Deserialize, Serialize};
use sidestep::bounds::BoundsSettings;
use sidestep::invalid::Invalid;
use sidestep::math::SeededRng;
use sidestep::reach::Tolerance;
use sidestep::shfrs::cache::Memory;
use sidestep::shfrs::file::ShfrsFile;
use sidestep::shfrs::probability::{Count, admits_everything};
use sidestep::shfrs::window::{Trajectory, WindowChoice};

/// A question: how often do the sets contain the future?
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Question {
    /// Number of the question. Its reports repeat the number.
    pub number: u32,
    /// Settings of the sets.
    pub settings: ShfrsFile,
    /// Indices of the tasks to count.
    pub tasks: Vec<usize>,
}

impl Asked for Question {
    fn number(&self) -> u32 {
        self.number
    }
}

/// A window begins at every step, as in replays.
const WINDOWS: WindowChoice = WindowChoice::EveryStep;

/// A question in progress.
pub(super) struct Counting {
    pub(super) number: u32,
    settings: BoundsSettings,
    tolerance: Tolerance,
    /// Indices of the tasks to count, in the order of the question.
    tasks: Vec<usize>,
    /// The order in which the tasks are counted. It is random, so that the first estimates are
    /// unbiased.
    order: Vec<usize>,
    /// Number of tasks counted.
    done: usize,
    count: Count,
    /// Whether all counts were reported to the page.
    is_told: bool,
}

impl Counting {
    pub(super) fn begin(
        question: Question,
        trajectories: &[Trajectory],
        prediction: &Predicted<'_>,
    ) -> Result<Work, Invalid> {
        let settings = question.settings.settings(prediction.actions())?;
        admits_everything(prediction, &settings)?;
        let known = |&place: &usize| place < trajectories.len();
        let tasks: Vec<usize> = question.tasks.into_iter().filter(known).collect();
        longest(tasks.iter().map(|&task| &trajectories[task]), settings.steps())?;
        Ok(Work::Counting(Self {
            number: question.number,
            settings,
            tolerance: prediction.tolerance,
            order: SeededRng::new(0).permutation(tasks.len()),
            count: Count::new(tasks.len()),
            tasks,
            done: 0,
            is_told: true,
        }))
    }

    /// Counts the next task. Returns whether more tasks remain.
    pub(super) fn go_on(
        &mut self,
        trajectories: &[Trajectory],
        prediction: &Predicted<'_>,
        memory: &mut Memory,
    ) -> Result<bool, Invalid> {
        let Some(&place) = self.order.get(self.done) else { return Ok(false) };
        let task = self.tasks[place];
        let windows = WINDOWS.windows(&trajectories[task..=task], self.settings.steps()).concat();
        self.count.put(place, memory.judge(task, &windows, prediction, &self.settings)?);
        (self.done, self.is_told) = (self.done + 1, false);
        Ok(self.done < self.order.len())
    }

    /// Returns the counts so far, or `None` if nothing is new.
    pub(super) fn report(&mut self) -> Option<Report> {
        if std::mem::replace(&mut self.is_told, true) {
            return None;
        }
        let done = self.done as f64 / self.order.len().max(1) as f64;
        let report = Report { number: self.number, done, ..Report::default() };
        Some(match self.count.regions(WINDOWS, self.tolerance, &self.settings, CONFIDENCE) {
            Ok(regions) => Report { regions: Some(regions), ..report },
            // The tasks counted so far may be too short for a window.
            Err(_) if done < 1.0 => report,
            Err(invalid) => Report { trouble: Some(invalid.to_string()), ..report },
        })
    }
}

/// Checks that at least one of these tasks has this number of future steps.
pub(super) fn longest<'a>(
    tasks: impl Iterator<Item = &'a Trajectory>,
    steps: usize,
) -> Result<(), Invalid> {
    let longest = tasks.map(Trajectory::steps).max().unwrap_or(0);
    if steps <= longest {
        return Ok(());
    }
    let expected = format!("at most {longest}, the steps of the longest task counted");
    Err(Invalid::new("steps", expected, steps))
}
