//! How often the predicted sets of a pane contain this participant's future. As in the explorer, a
//! worker counts over the tasks that did not train the predictor. For learned sets, the server
//! sends the counts.

use super::choice::{Choice, Pane};
use super::{Msg, Replay};
use crate::evaluation::Part;
use crate::json;
use crate::pages::coverage::{Coverage, worded};
use crate::pages::parts::count;
use crate::runtime::{Answer, Command, Commands, Evaluate, Request, read};
use sidestep::api::{Drives, TrialDetail, routes};
use sidestep::predict::PredictorFile;
use sidestep::shfrs::file::ShfrsFile;
use sidestep::shfrs::probability::Probabilities;
use sidestep::trial::Phase;
use sidestep::trial_view::Playback;
use std::rc::Rc;

/// The participant's tasks. `None` before they have arrived, and if they cannot be read.
#[derive(Default)]
pub(super) struct Tasks(Option<(Drives, Vec<u8>)>);

impl Tasks {
    /// Requests the tasks of this trial's participant. Returns `None` if the trial is not a task,
    /// because the other phases have too few trials to count.
    fn ask(trial: &TrialDetail) -> Option<Command<Msg>> {
        let route = routes::admin_drives(&trial.summary.participant_id);
        let is_task = trial.summary.phase == Phase::Task;
        is_task.then(|| Command::Send(Request::get("drives", route, Msg::Drives)))
    }

    /// Parses the server's answer. The bytes are kept to forward them to the evaluators.
    pub(super) fn of(answer: Answer) -> Self {
        let drives = answer.ok().and_then(|it| Some((read(Ok(it.clone())).ok()?, it)));
        Self(drives)
    }
}

/// The probabilities for a pane's sets.
#[derive(Default)]
pub(super) struct Chances {
    coverage: Coverage,
    /// Counts that the server sent.
    told: Option<Probabilities>,
}

impl Chances {
    /// The messages that make the evaluator count for this predictor. `None` until all of their
    /// content is known.
    fn question(
        &mut self,
        tasks: Option<&Tasks>,
        choice: &Choice,
        playback: &Playback,
    ) -> Option<[(Part, Vec<u8>); 5]> {
        self.coverage.forget();
        self.told = choice.held().cloned();
        let ((drives, content), trained_on) = (tasks?.0.as_ref()?, choice.trained_on()?);
        let (safety, learned) = (playback.safety()?, playback.learned()?);
        let all = drives.tasks.iter().enumerate();
        let unseen = all.filter(|(_, task)| !trained_on.contains(&task.trial_id));
        let unseen = unseen.map(|(place, _)| place).collect();
        let settings = ShfrsFile::from(&learned.settings.bounds);
        let predictor = json::write(&PredictorFile::from(&learned.predictor));
        Some([
            (Part::Drives, content.clone()),
            (Part::Human, safety.human.encode()),
            (Part::Robot, safety.robot.encode()),
            (Part::Predictor, predictor.into_bytes()),
            (Part::Question, json::write(&self.coverage.ask(settings, unseen)).into_bytes()),
        ])
    }

    /// Processes a report from the evaluator. Returns whether it was the last one.
    fn take(&mut self, answer: Answer) -> bool {
        let Some(report) = self.coverage.newest(answer) else { return false };
        let is_over = report.done >= 1.0;
        self.coverage.take(report);
        is_over
    }

    /// The counts for this number of sets.
    pub(super) fn probabilities(&self, sets: usize) -> Option<&Probabilities> {
        let counted = || self.coverage.regions(sets).map(|(regions, _)| &regions.probabilities);
        self.told.as_ref().or_else(counted)
    }

    /// Explains the probabilities, or says why there are none. `None` until that is known.
    pub(super) fn words(&self, sets: usize, of: &str) -> Option<String> {
        let counted = self.probabilities(sets).map(|p| {
            format!(
                "p: share of {} windows of {} whose future stays inside, with {:.0} % intervals. {of}",
                p.windows,
                count(p.trajectories, "task"),
                100.0 * p.confidence
            )
        });
        counted
            .or_else(|| self.coverage.trouble.as_ref().map(|why| format!("No p: {}", worded(why))))
    }
}

impl Replay {
    /// Starts counting for a pane if its input is complete.
    pub(super) fn count(&mut self, pane: Pane) -> Commands<Msg> {
        // The tasks are requested only when there are sets to count, so that the trial is loaded
        // first.
        let beside = self.beside.as_ref().map_or(&[][..], |beside| beside.playback.forecast());
        if self.tasks.is_none() && !(self.playback.forecast().is_empty() && beside.is_empty()) {
            self.tasks = Some(Tasks::default());
            return Tasks::ask(&self.trial).into_iter().collect();
        }
        let tasks = self.tasks.as_ref();
        let question = match (pane, &mut self.beside) {
            (Pane::First, _) => self.chances.question(tasks, &self.choice, &self.playback),
            (Pane::Second, Some(it)) => it.chances.question(tasks, &it.choice, &it.playback),
            (Pane::Second, None) => None,
        };
        let name = pane.evaluator();
        let told = question.into_iter().flatten().map(|(part, content)| {
            let then = Rc::new(move |answer| Msg::Chances(pane, answer));
            Command::Evaluate(Box::new(move || Evaluate { name, part, content, then }))
        });
        [Command::Cancel(name)].into_iter().chain(told).collect()
    }

    /// Processes a report from a pane's evaluator.
    pub(super) fn take_chances(&mut self, pane: Pane, answer: Answer) -> Commands<Msg> {
        let chances = match (pane, &mut self.beside) {
            (Pane::First, _) => &mut self.chances,
            (Pane::Second, Some(beside)) => &mut beside.chances,
            (Pane::Second, None) => return Vec::new(),
        };
        let is_over = chances.take(answer);
        is_over.then_some(Command::Cancel(pane.evaluator())).into_iter().collect()
    }
}
