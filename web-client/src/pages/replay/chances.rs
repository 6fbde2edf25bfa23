//! How often the predicted sets hold this participant's future: counted beside the page, over the tasks that
//! did not train the predictor, as in the explorer.

use super::Msg;
use crate::evaluation::Part;
use crate::json;
use crate::pages::coverage::Coverage;
use crate::pages::parts::count;
use crate::runtime::{Answer, Command, Commands, Evaluate, Request, read};
use sidestep::api::{Drives, TrialDetail, routes};
use sidestep::playback::Playback;
use sidestep::predict::PredictorFile;
use sidestep::shfrs::file::PRESETS;
use sidestep::shfrs::probability::Regions;
use sidestep::trial::Phase;
use std::rc::Rc;

/// What is known of the sets' probabilities.
#[derive(Default)]
pub(super) struct Chances {
    /// The participant's tasks, once they are here: what was read, and what the server sent.
    drives: Option<(Drives, Vec<u8>)>,
    /// The ids of the trials that trained the predictor, once that is here.
    trained_on: Option<Vec<String>>,
    coverage: Coverage,
}

/// The evaluator's name.
const NAME: &str = "chances";

impl Chances {
    /// Asks for the tasks. Other phases are too short to count on.
    pub(super) fn begin(trial: &TrialDetail) -> Commands<Msg> {
        let route = routes::admin_drives(&trial.summary.participant_id);
        let ask = || Command::Send(Request::get("drives", route, Msg::Drives));
        (trial.summary.phase == Phase::Task).then(ask).into_iter().collect()
    }

    /// Takes the tasks that the server sent.
    pub(super) fn arrived(&mut self, answer: Answer) {
        if let Ok(content) = answer
            && let Ok(drives) = read::<Drives>(Ok(content.clone()))
        {
            self.drives = Some((drives, content));
        }
    }

    /// Another predictor, which these trials trained; none as long as it is not known.
    pub(super) fn trained_on(&mut self, trials: Option<Vec<String>>) {
        self.trained_on = trials;
    }

    /// Counts anew, once everything is known.
    pub(super) fn ask(&mut self, playback: &Playback) -> Commands<Msg> {
        self.coverage.forget();
        let mut commands = vec![Command::Cancel(NAME)];
        let (Some((drives, content)), Some(trained_on)) = (&self.drives, &self.trained_on) else {
            return commands;
        };
        let (Some(safety), Some(learned)) = (playback.safety(), playback.learned()) else {
            return commands;
        };
        let tasks = drives.tasks.iter().enumerate();
        let unseen = tasks.filter(|(_, task)| !trained_on.contains(&task.trial_id));
        let unseen = unseen.map(|(place, _)| place).collect();
        let settings = PRESETS[0].settings(learned.predictor.classes().len());
        let predictor = json::write(&PredictorFile::from(&learned.predictor));
        let parts = [
            (Part::Drives, content.clone()),
            (Part::Human, safety.human.encode()),
            (Part::Robot, safety.robot.encode()),
            (Part::Predictor, predictor.into_bytes()),
            (Part::Question, json::write(&self.coverage.ask(settings, unseen)).into_bytes()),
        ];
        commands.extend(parts.map(|(part, content)| {
            let tell = move || Evaluate { name: NAME, part, content, then: Rc::new(Msg::Chances) };
            Command::Evaluate(Box::new(tell))
        }));
        commands
    }

    /// Takes what the evaluator has to say.
    pub(super) fn take(&mut self, answer: Answer) -> Commands<Msg> {
        let Some(report) = self.coverage.newest(answer) else { return Vec::new() };
        let is_over = report.done >= 1.0;
        self.coverage.take(report);
        is_over.then_some(Command::Cancel(NAME)).into_iter().collect()
    }

    /// What was counted for so many sets.
    pub(super) fn regions(&self, sets: usize) -> Option<&Regions> {
        self.coverage.regions(sets).map(|(regions, _)| regions)
    }

    /// What the probabilities mean, or why there are none; nothing as long as that is not known.
    pub(super) fn words(&self, sets: usize) -> Option<String> {
        let counted = self.regions(sets).map(|regions| {
            let p = &regions.probabilities;
            format!(
                "p: share of {} windows of {} that did not train the predictor whose future stays \
                 inside, with {:.0} % intervals.",
                p.windows,
                count(p.trajectories, "task"),
                100.0 * p.confidence
            )
        });
        counted.or_else(|| self.coverage.trouble.as_ref().map(|why| format!("No p: {why}")))
    }
}
