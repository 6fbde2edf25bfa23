//! The explorer for one participant's predicted sets. Every change of a setting updates the sets at
//! the current instant and the probabilities counted over the participant's tasks.

mod predictor;
mod tuning;
mod areas;
mod beside;
mod controls;
mod sets;
mod keys;
mod link;
mod view;

use self::areas::Areas;
use self::keys::key;
use self::predictor::Choice;
use self::tuning::Tuning;
use super::coverage::Coverage;
use super::parts;
use super::safety::Sources;
use crate::form::FieldValue;
use crate::json;
use crate::runtime::{
    Address, Answer, Command, Commands, Event, Failure, Page, Request, Solving, read,
};
use crate::view::Node;
use sidestep::api::{Drives, routes, trial_heading};
use sidestep::document::{from_value, is_too_deep};
use sidestep::invalid::Invalid;
use sidestep::picture::Picture;
use sidestep::scene::Evader;
use sidestep::shfrs::ShfrsSettings;
use sidestep::shfrs::file::{PRESETS, ShfrsFile};
use sidestep::trial_view::Playback;
use sidestep::trial_view::view::View;

/// The page of one participant.
pub enum ExplorerPage {
    /// The tasks of the participant with this id are loading. The address describes the view.
    Loading(String, Address),
    /// There is nothing to explore, for this reason.
    Failed(String),
    /// The tasks are loaded.
    Open(Box<Explorer>),
}

/// Messages to the explorer.
#[derive(Clone, Debug)]
pub enum Msg {
    /// The server sent the tasks.
    Drives(Answer),
    /// A report about the value function in which this vehicle evades, from the server or the
    /// solver.
    ValueFunction(Evader, Solving),
    /// Stop solving.
    StopSolving,
    /// Request or solve the missing value functions again.
    SolveAgain,
    /// Use another predictor.
    Choose(FieldValue),
    /// Use other features for the predictor that this page trains.
    Features(FieldValue),
    /// The server sent the predictor.
    Predictor(Answer),
    /// The server listed the study's analyses.
    Analyses(Answer),
    /// The server listed the participant's models in this analysis.
    Models(String, Answer),
    /// A report from the evaluator.
    Report(Answer),
    /// A report from the comparer.
    Areas(Answer),
    /// A report from the tuner.
    Tuned(Answer),
    /// Set the coverage to tune for.
    Aim(FieldValue),
    /// Set the guarantee to tune for.
    Guarantee(FieldValue),
    /// Start tuning.
    Tune,
    /// Stop tuning.
    StopTuning,
    /// Predict with the tuned settings.
    UseFound,
    /// Use the paper's settings at this index in [`PRESETS`].
    Preset(usize),
    /// Set the number of future steps.
    Steps(FieldValue),
    /// Set the number of sets.
    Count(FieldValue),
    /// Set the widening of the set at this index.
    Epsilon(usize, FieldValue),
    /// Choose actions by their number or by their probability.
    By(FieldValue),
    /// Admit at least this number of actions, up to the step in the field.
    UpTo(usize, FieldValue),
    /// Set the number of actions at each step.
    K(FieldValue),
    /// Set the probability threshold for actions.
    Tau(FieldValue),
    /// Set the probability of the shortest interval, for all steps.
    Q(FieldValue),
    /// Set the kind of roll-outs.
    Rollout(FieldValue),
    /// Set all settings, as JSON.
    Json(FieldValue),
    /// Offer the settings as a file.
    Save,
    /// Count only the tasks that did not train the predictor, or count all tasks.
    Counted(FieldValue),
    /// Show another task.
    Task(FieldValue),
    /// Go this many tasks forward, or back if negative.
    Next(i32),
    /// Go to another time (s).
    Seek(FieldValue),
    /// Go this many steps forward, or back if negative.
    Step(i32),
    /// Show or hide the layer at this index.
    Layer(usize),
    /// Switch to the other colours.
    Colours,
    /// Update the link.
    Link,
}

impl ExplorerPage {
    /// Creates the page and its first commands.
    #[must_use]
    pub fn open(participant_id: &str, address: &Address) -> (Self, Commands<Msg>) {
        let ask = Request::get("drives", routes::admin_drives(participant_id), Msg::Drives);
        (Self::Loading(participant_id.to_owned(), address.clone()), vec![Command::Send(ask)])
    }

    /// The page after the server has answered with the tasks.
    fn opened(id: &str, address: &Address, answer: Answer) -> (Self, Commands<Msg>) {
        let content = match answer {
            Ok(content) => content,
            Err(Failure { status, sentence, .. }) => {
                let why = "There is no such participant.".to_owned();
                return (Self::Failed(if status == 404 { why } else { sentence }), Vec::new());
            }
        };
        let explorer = read(Ok(content.clone()))
            .map_err(|failure| failure.sentence)
            .and_then(|drives| Explorer::open(id, address, drives, content));
        match explorer {
            Ok((explorer, commands)) => (Self::Open(Box::new(explorer)), commands),
            Err(why) => (Self::Failed(why), Vec::new()),
        }
    }
}

impl Page for ExplorerPage {
    type Msg = Msg;

    fn update(&mut self, message: Msg, _: f64) -> Commands<Msg> {
        match (message, &mut *self) {
            (Msg::Drives(answer), Self::Loading(id, address)) => {
                let (page, commands) = Self::opened(id, address, answer);
                *self = page;
                commands
            }
            (message, Self::Open(explorer)) => explorer.update(message),
            _ => Vec::new(),
        }
    }

    fn view(&self) -> Node<Msg> {
        match self {
            Self::Loading(..) => parts::loading(),
            Self::Failed(why) => parts::stuck("Nothing to explore", why),
            Self::Open(explorer) => view::page(explorer),
        }
    }

    fn title(&self) -> String {
        match self {
            Self::Open(explorer) => explorer.title(),
            _ => "Explorer".to_owned(),
        }
    }

    fn hear(&self, event: &Event) -> Option<Msg> {
        match (self, event) {
            (Self::Open(_), Event::Key { code, down: true, .. }) => key(code),
            _ => None,
        }
    }

    fn owns_key(&self, code: &str) -> bool {
        matches!(self, Self::Open(_)) && key(code).is_some()
    }

    fn draw(&self, _: f64, picture: &mut Picture) -> bool {
        let Self::Open(explorer) = self else { return false };
        picture.copy(&explorer.picture);
        true
    }
}

/// The explorer of a participant's tasks.
pub struct Explorer {
    participant_id: String,
    drives: Drives,
    /// The tasks as the server sent them, to be forwarded to the evaluators.
    content: Vec<u8>,
    /// Index of the current task.
    task: usize,
    sources: Sources<Msg>,
    choice: Choice,
    /// The settings that the controls show. They can be invalid.
    wanted: ShfrsFile,
    /// What is wrong with these settings or with the last input, if anything.
    complaint: Option<Invalid>,
    coverage: Coverage,
    areas: Areas,
    tuning: Tuning,
    playback: Playback,
    view: View,
    picture: Picture,
    /// The reason why no sets are predicted.
    trouble: Option<String>,
    /// Error message about the link.
    misread: Option<String>,
}

/// Delay before the link is updated (ms), because browsers limit how often a page may change its
/// address.
const LINK_AFTER_MS: f64 = 250.0;

impl Explorer {
    fn update(&mut self, message: Msg) -> Commands<Msg> {
        let before = self.address();
        let mut commands = match message {
            Msg::Link => return vec![Command::ReplaceAddress(before)],
            message => self.take(message),
        };
        self.show();
        if self.address() != before {
            let message = Msg::Link;
            commands.push(Command::Wake { timer: "link", after_ms: LINK_AFTER_MS, message });
        }
        commands
    }

    fn take(&mut self, message: Msg) -> Commands<Msg> {
        match message {
            Msg::ValueFunction(evader, solving) => {
                self.sources.take(evader, solving);
                return self.take_safety();
            }
            Msg::StopSolving => return self.sources.stop(),
            Msg::SolveAgain => return self.sources.retry(),
            Msg::Choose(value) => {
                self.choice.choose(&value);
                return self.ask_predictor();
            }
            Msg::Features(value) => {
                self.choice.set_features(value.text());
                return self.ask_predictor();
            }
            Msg::Predictor(answer) => return self.take_predictor(answer),
            Msg::Analyses(answer) => return self.choice.analyses(answer, self.drives.number),
            Msg::Models(analysis, answer) => self.choice.offered.models(analysis, answer),
            Msg::Report(answer) => return self.take_report(answer),
            Msg::Areas(answer) => self.areas.take(answer),
            Msg::Tuned(answer) => return self.take_tuned(answer),
            Msg::Aim(value) => {
                self.tuning.set_p(&value);
                return self.stop_tuning();
            }
            Msg::Guarantee(value) => {
                self.tuning.set_guarantee(&value);
                return self.stop_tuning();
            }
            Msg::Tune => return self.tune(),
            Msg::StopTuning => return self.stop_tuning(),
            Msg::UseFound => return self.use_found(),
            Msg::Preset(place) => {
                let actions = self.actions();
                let turn_rate = self.drives.parameters.human.turn_rate_radps;
                return self.change(|wanted| {
                    if let Some(preset) = PRESETS.get(place) {
                        let suited = preset.settings(actions).for_turn_rate(turn_rate);
                        // The kind of roll-outs is a separate setting, so keep it.
                        *wanted = suited.with_rollout(wanted.rollout);
                    }
                    Ok(())
                });
            }
            Msg::Steps(value) => return self.change(|wanted| wanted.set("T", &words(&value))),
            Msg::Count(value) => {
                return self.change(|wanted| {
                    wanted.resize(value.number().map_or(0, |sets| sets as usize));
                    Ok(())
                });
            }
            Msg::Epsilon(place, value) => {
                return self.change(|wanted| {
                    let number = value.number();
                    let number = number.ok_or_else(|| {
                        Invalid::new(format!("epsilon[{place}]"), "a number", "none")
                    })?;
                    wanted.widen(place, number);
                    Ok(())
                });
            }
            Msg::By(value) => {
                return self.change(|wanted| {
                    let k = vec!["1"; wanted.steps].join(",");
                    let (name, value) = match value.text() {
                        "tau" => ("tau", "0.1"),
                        "q" => ("q", "0.9"),
                        _ => ("k", k.as_str()),
                    };
                    wanted.set(name, value)
                });
            }
            Msg::UpTo(k, value) => {
                return self.change(|wanted| {
                    let upto = value.number().map_or(0, |upto| upto as usize);
                    controls::count_up_to(wanted, k, upto);
                    Ok(())
                });
            }
            Msg::K(value) => return self.change(|wanted| wanted.set("k", value.text())),
            Msg::Tau(value) => return self.change(|wanted| wanted.set("tau", &words(&value))),
            Msg::Q(value) => return self.change(|wanted| wanted.set("q", &words(&value))),
            Msg::Rollout(value) => {
                return self.change(|wanted| wanted.set("rollout", value.text()));
            }
            Msg::Json(value) => {
                return self.change(|wanted| {
                    let text = Some(value.text()).filter(|text| !is_too_deep(text));
                    let read: Option<serde_json::Value> =
                        text.and_then(|text| json::read(text.as_bytes()));
                    let expected = "settings as in the file";
                    let read = read.ok_or_else(|| Invalid::new("JSON", expected, "other text"))?;
                    *wanted = from_value(&read).map_err(|invalid| invalid.within("JSON"))?;
                    Ok(())
                });
            }
            Msg::Save => return vec![self.file()],
            Msg::Counted(value) => {
                self.coverage.counts_all = value.text() == "all";
                return self.ask_coverage();
            }
            Msg::Task(value) => {
                let chosen = value.text();
                let task = self.drives.tasks.iter().position(|it| it.trial_id == chosen);
                return self.go_to(task.unwrap_or(self.task));
            }
            Msg::Next(by) => {
                let last = self.drives.tasks.len() as i32 - 1;
                return self.go_to((self.task as i32 + by).clamp(0, last) as usize);
            }
            Msg::Seek(value) => {
                let time_s = value.number().unwrap_or(0.0);
                self.view.time_s = time_s.clamp(0.0, self.playback.duration_s());
            }
            Msg::Step(by) => {
                let step_s = self.drives.parameters.step_s;
                let last = self.playback.recorded().inputs.len() as i32;
                let step = (self.playback.now().step as i32 + by).clamp(0, last);
                self.view.time_s = f64::from(step) * step_s;
            }
            Msg::Layer(place) => {
                if let Some(shown) = self.view.shown.get_mut(place) {
                    *shown = !*shown;
                }
            }
            Msg::Colours => {
                let other =
                    if self.view.query().contains("colours=safe") { "paper" } else { "safe" };
                let _ = self.view.set("colours", other);
            }
            Msg::Drives(_) | Msg::Link => {}
        }
        Vec::new()
    }

    fn title(&self) -> String {
        let Drives { study, number, synthetic, .. } = &self.drives;
        trial_heading(study, *number, "explorer", *synthetic)
    }

    /// The number of the predictor's actions, or the number of all inputs if there is no predictor.
    fn actions(&self) -> usize {
        let learned = self.playback.learned();
        learned.map_or(ACTIONS, |learned| learned.predictor.classes().len())
    }

    /// Whether the settings are valid. With invalid settings, no sets and no numbers are shown.
    fn is_valid(&self) -> bool {
        self.wanted.settings(self.actions()).is_ok()
    }

    /// Changes the settings. Input that cannot be read changes nothing.
    fn change(
        &mut self,
        change: impl FnOnce(&mut ShfrsFile) -> Result<(), Invalid>,
    ) -> Commands<Msg> {
        let mut wanted = self.wanted.clone();
        if let Err(invalid) = change(&mut wanted) {
            self.complaint = Some(invalid);
            return Vec::new();
        }
        self.wanted = wanted;
        self.use_settings()
    }

    /// Predicts with the settings of the controls, if they are valid.
    fn use_settings(&mut self) -> Commands<Msg> {
        let actions = self.actions();
        let settings = self
            .wanted
            .settings(actions)
            .and_then(|bounds| Ok(ShfrsSettings::paper(actions)?.with_bounds(bounds)));
        match settings {
            Ok(settings) => {
                self.complaint = None;
                self.playback.use_settings(settings);
                self.ask_coverage()
            }
            Err(invalid) => {
                self.complaint = Some(invalid);
                // Counting and tuning in progress use outdated settings, so discard them. The
                // request for a predictor that is still loading must not be cancelled.
                if self.playback.learned().is_some() {
                    self.coverage.forget();
                }
                self.stop_tuning()
            }
        }
    }

    /// Switches to another task. A predictor that is trained on the tasks before the current one
    /// changes as well.
    fn go_to(&mut self, task: usize) -> Commands<Msg> {
        if task == self.task {
            return Vec::new();
        }
        let recorded = self.drives.tasks[task].recorded(self.drives.parameters);
        let Ok(mut playback) = Playback::new(recorded) else { return Vec::new() };
        let learned = self.playback.learned().cloned();
        if let Some(safety) = self.playback.safety().cloned() {
            // Without a predictor, these calls cannot fail. With this predictor, they have
            // succeeded before.
            let _ = playback.use_safety(safety);
            let _ = playback.use_learned(learned);
        }
        (self.task, self.playback) = (task, playback);
        self.view.time_s = self.view.time_s.min(self.playback.duration_s());
        if self.choice.depends_on_task() { self.ask_predictor() } else { Vec::new() }
    }

    /// Updates the picture.
    fn show(&mut self) {
        self.trouble = self.playback.go(&self.view).err().map(|invalid| invalid.to_string());
        if !self.is_valid() {
            self.playback.hide_sets();
        }
        self.playback.make_room(self.wanted.steps);
        let picture = &mut self.picture;
        picture.begin(CANVAS, self.playback.window());
        picture.tell("data-step", self.playback.now().step);
        picture.tell("data-trial", &self.drives.tasks[self.task].trial_id);
        self.playback.paint(&self.view, picture);
    }
}

/// The value of a slider, formatted as in a link.
fn words(value: &FieldValue) -> String {
    value.number().map_or_else(|| "nothing".to_owned(), |number| number.to_string())
}

/// Number of inputs.
const ACTIONS: usize = 3;

/// The canvas element's id.
const CANVAS: &str = "explorer";
