//! Messages between the page and its three evaluators, which work in parallel. One trains the
//! predictor and counts, one compares areas, and one tunes.

use super::predictor::Ask;
use super::{Explorer, Msg};
use crate::evaluation::Part;
use crate::json;
use crate::runtime::{Answer, Command, Commands, Evaluate};
use sidestep::predict::{Predictor, PredictorFile};
use sidestep::shfrs::ShfrsSettings;
use sidestep::trial_view::Learned;
use std::rc::Rc;

/// An evaluator, which runs in a worker.
struct Beside {
    name: &'static str,
    /// Converts the evaluator's reports to messages of the page.
    then: fn(Answer) -> Msg,
}

/// Trains the predictor, and counts how often sets contain the future.
const COUNTER: Beside = Beside { name: "evaluator", then: Msg::Report };
/// Computes the area that a coverage needs.
const COMPARER: Beside = Beside { name: "comparer", then: Msg::Areas };
/// Tunes the settings.
const TUNER: Beside = Beside { name: "tuner", then: Msg::Tuned };

impl Beside {
    /// Sends a message to this evaluator.
    fn tell(&self, part: Part, content: Vec<u8>) -> Command<Msg> {
        let &Self { name, then } = self;
        let tell = move || Evaluate { name, part, content, then: Rc::new(then) };
        Command::Evaluate(Box::new(tell))
    }
}

impl Explorer {
    /// Uses the value functions as soon as both are loaded.
    pub(super) fn take_safety(&mut self) -> Commands<Msg> {
        if self.playback.safety().is_some() {
            return Vec::new();
        }
        let Some(safety) = self.sources.functions() else { return Vec::new() };
        let _ = self.playback.use_safety(safety);
        let mut commands = self.introduce(&COUNTER);
        commands.extend(self.ask_predictor());
        commands
    }

    /// Once the safety levels are known, requests the chosen predictor from the server or from the
    /// evaluator.
    pub(super) fn ask_predictor(&mut self) -> Commands<Msg> {
        self.coverage.forget();
        self.areas.forget();
        self.tuning.forget();
        let mut commands = vec![Command::Cancel(COMPARER.name), Command::Cancel(TUNER.name)];
        let _ = self.playback.use_learned(None);
        if self.playback.safety().is_none() {
            return commands;
        }
        let trial_id = &self.drives.tasks[self.task].trial_id;
        match self.choice.ask(trial_id, self.drives.tasks.len(), self.coverage.next()) {
            Ask::Server(request) => commands.push(Command::Send(request)),
            Ask::Evaluator(training) => {
                commands.push(COUNTER.tell(Part::Training, json::write(&training).into_bytes()));
            }
            Ask::Nobody(Ok(file)) => commands.extend(self.use_file(file)),
            Ask::Nobody(Err(invalid)) => self.choice.refuse(&invalid.to_string()),
        }
        commands
    }

    /// Processes the server's answer with the predictor.
    pub(super) fn take_predictor(&mut self, answer: Answer) -> Commands<Msg> {
        self.choice.arrived(answer).map(|file| self.use_file(file)).unwrap_or_default()
    }

    /// Uses a predictor that the evaluator did not train, and sends it to the evaluator.
    fn use_file(&mut self, file: PredictorFile) -> Commands<Msg> {
        let mut commands = vec![COUNTER.tell(Part::Predictor, json::write(&file).into_bytes())];
        self.predict_with(file);
        commands.extend(self.use_settings());
        commands
    }

    /// Processes a report from the evaluator.
    pub(super) fn take_report(&mut self, answer: Answer) -> Commands<Msg> {
        let Some(mut report) = self.coverage.newest(answer) else { return Vec::new() };
        let Some(file) = report.predictor.take() else {
            if let (None, Some(why)) = (self.playback.learned(), &report.trouble) {
                self.choice.refuse(why);
            }
            let is_over = report.done >= 1.0;
            self.coverage.take(report);
            if self.coverage.trouble.is_some() {
                self.areas.hide();
            } else if is_over {
                return self.ask_areas();
            }
            return Vec::new();
        };
        self.choice.trained(report.fallback);
        self.predict_with(file);
        self.use_settings()
    }

    /// Uses this predictor for predictions from now on.
    fn predict_with(&mut self, file: PredictorFile) {
        let learned = Predictor::try_from(file).and_then(|predictor| {
            let settings = ShfrsSettings::paper(predictor.classes().len())?;
            Ok(Learned { predictor, settings })
        });
        let used = learned.and_then(|learned| self.playback.use_learned(Some(learned)));
        if let Err(invalid) = used {
            self.choice.refuse(&invalid.to_string());
        }
    }

    /// Asks how often the sets contain the future. The evaluator drops the previous question.
    pub(super) fn ask_coverage(&mut self) -> Commands<Msg> {
        if self.playback.learned().is_none() || !self.is_valid() {
            return Vec::new();
        }
        let mut commands = self.stop_tuning();
        if self.areas.outdate(&self.wanted) {
            commands.push(COMPARER.tell(Part::Stop, Vec::new()));
        }
        let tasks = self.counted();
        let question = self.coverage.ask(self.wanted.clone(), tasks);
        commands.push(COUNTER.tell(Part::Question, json::write(&question).into_bytes()));
        commands
    }

    /// Asks how much area a coverage needs, unless this was already asked for these settings.
    fn ask_areas(&mut self) -> Commands<Msg> {
        if self.lacks_tasks_to_compare().is_some() {
            return Vec::new();
        }
        let Some(question) = self.areas.ask(&self.wanted, self.choice.parts(&self.drives)) else {
            return Vec::new();
        };
        let is_introduced = std::mem::replace(&mut self.areas.is_introduced, true);
        let mut commands = if is_introduced { Vec::new() } else { self.introduce(&COMPARER) };
        commands.push(COMPARER.tell(Part::AreaQuestion, json::write(&question).into_bytes()));
        commands
    }

    /// Starts tuning, in an evaluator that is cancelled as soon as tuning ends.
    pub(super) fn tune(&mut self) -> Commands<Msg> {
        if self.playback.learned().is_none() || !self.is_valid() {
            return Vec::new();
        }
        let mut commands = self.stop_tuning();
        let aim = self.tuning.ask(self.wanted.steps, self.choice.parts(&self.drives));
        commands.extend(self.introduce(&TUNER));
        commands.push(TUNER.tell(Part::Aim, json::write(&aim).into_bytes()));
        commands
    }

    /// Cancels tuning, if it is in progress.
    pub(super) fn stop_tuning(&mut self) -> Commands<Msg> {
        if !self.tuning.is_busy() {
            return Vec::new();
        }
        self.tuning.stop();
        vec![Command::Cancel(TUNER.name)]
    }

    /// Processes a report from the tuner. When the result has arrived, predicts with it.
    pub(super) fn take_tuned(&mut self, answer: Answer) -> Commands<Msg> {
        if !self.tuning.take(answer) {
            return Vec::new();
        }
        let mut commands = vec![Command::Cancel(TUNER.name)];
        commands.extend(self.use_found());
        commands
    }

    /// Predicts with the tuned settings.
    pub(super) fn use_found(&mut self) -> Commands<Msg> {
        let Some(found) = self.tuning.found().map(|found| found.settings.clone()) else {
            return Vec::new();
        };
        self.change(|wanted| {
            wanted.begin_with(&found);
            Ok(())
        })
    }

    /// Sends an evaluator its input: the tasks, the value functions and, if there is one, the
    /// predictor.
    fn introduce(&self, evaluator: &Beside) -> Commands<Msg> {
        let safety = self.playback.safety().into_iter().flat_map(|safety| {
            [(Part::Human, safety.human.encode()), (Part::Robot, safety.robot.encode())]
        });
        let learned = self.playback.learned().map(|learned| {
            let file = PredictorFile::from(&learned.predictor);
            (Part::Predictor, json::write(&file).into_bytes())
        });
        let parts = [(Part::Drives, self.content.clone())].into_iter().chain(safety).chain(learned);
        parts.map(|(part, content)| evaluator.tell(part, content)).collect()
    }

    /// Indices of the tasks to count.
    fn counted(&self) -> Vec<usize> {
        if self.coverage.counts_all {
            return (0..self.drives.tasks.len()).collect();
        }
        self.choice.unseen(&self.drives)
    }
}
