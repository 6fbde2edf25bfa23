//! The replay of one trial: a time slider, the safety levels, the predicted sets
//! and what the participant really did.

mod chart;
mod safety;
mod choice;
mod view;

use self::choice::{Choice, Named};
use self::safety::Sources;
use super::parts;
use crate::form::FieldValue;
use crate::overlays::{LAYERS, Moment, stage};
use crate::runtime::{Address, Answer, Command, Commands, Failure, Page, Request, Solving, read};
use crate::shape::{Picture, Shape, Window};
use crate::view::Node;
use sidestep::api::{TrainedPredictor, TrialDetail, routes};
use sidestep::bounds::ActionModel as _;
use sidestep::invalid::Invalid;
use sidestep::predict::Predictor;
use sidestep::safety::SafetyLevels;
use sidestep::scene::{Evader, JointState};
use sidestep::shfrs::{PredictedHuman, ShfrsPredictor, ShfrsSettings};
use sidestep::vehicle::TurnInput;

/// The page of one trial.
pub enum ReplayPage {
    /// The trial is on its way, to be predicted with this model of an analysis if the link names one.
    Loading(Option<Named>),
    /// There is nothing to replay, for this reason.
    Failed(String),
    /// The trial is here.
    Open(Box<Replay>),
}

/// What the replay can be told.
#[derive(Clone, Debug)]
pub enum Msg {
    /// The server sent the trial.
    Trial(Answer),
    /// The server sent the predictor.
    Predictor(Answer),
    /// Another predictor is to be used.
    Choose(FieldValue),
    /// The server listed the study's analyses.
    Analyses(Answer),
    /// The server listed the participant's models in this analysis.
    Models(String, Answer),
    /// The server or the solver reports on the value function of this vehicle as the evader.
    ValueFunction(Evader, Solving),
    /// Stop solving.
    StopSolving,
    /// Ask for, or solve, again what is missing.
    SolveAgain,
    /// Plays, or pauses.
    Play,
    /// Goes to this step.
    Seek(usize),
    /// Shows sets for each step, or for the whole time ahead.
    ByStep,
    /// Shows or hides the layer at this place in [`LAYERS`].
    Layer(usize),
    /// A frame is about to be shown.
    Frame,
}

impl ReplayPage {
    /// The page as it opens.
    #[must_use]
    pub fn open(trial_id: &str, address: &Address) -> (Self, Commands<Msg>) {
        let ask = Request::get("trial", routes::admin_trial(trial_id), Msg::Trial);
        (Self::Loading(Named::of(address)), vec![Command::Send(ask)])
    }
}

impl Page for ReplayPage {
    type Msg = Msg;

    fn update(&mut self, message: Msg, now_ms: f64) -> Commands<Msg> {
        match (message, self) {
            (Msg::Trial(answer), page) => match (read(answer), &mut *page) {
                (Ok(trial), Self::Loading(named)) => {
                    let (replay, commands) = Replay::open(trial, Choice::new(named.take()));
                    *page = Self::Open(Box::new(replay));
                    commands
                }
                (Ok(_), _) => Vec::new(),
                (Err(Failure { status, sentence, .. }), page) => {
                    let why = "There is no such trial. Its participant may have withdrawn it.";
                    *page = Self::Failed(if status == 404 { why.to_owned() } else { sentence });
                    Vec::new()
                }
            },
            (message, Self::Open(replay)) => replay.update(message, now_ms),
            _ => Vec::new(),
        }
    }

    fn view(&self) -> Node<Msg> {
        match self {
            Self::Loading(_) => parts::loading(),
            Self::Failed(why) => parts::stuck("Nothing to replay", why),
            Self::Open(replay) => view::page(replay),
        }
    }

    fn title(&self) -> String {
        match self {
            Self::Open(replay) => replay.title(),
            _ => "Replay".to_owned(),
        }
    }

    /// The slider and the numbers move with the picture.
    fn tick(&mut self, _: f64) -> Option<Msg> {
        self.wants_frames().then_some(Msg::Frame)
    }

    fn wants_frames(&self) -> bool {
        matches!(self, Self::Open(replay) if replay.is_playing())
    }

    fn draw(&self, _: f64, picture: &mut Picture) -> bool {
        let Self::Open(replay) = self else { return false };
        replay.show(picture);
        true
    }
}

/// A trial that is replayed.
pub struct Replay {
    trial: TrialDetail,
    sources: Sources,
    safety: Option<SafetyLevels>,
    /// V_HR and V_RH of each state, m.
    levels: Vec<(f64, f64)>,
    choice: Choice,
    learned: Option<Learned>,
    /// Time into the trial, s.
    time_s: f64,
    /// Time of the last frame while it plays, ms.
    playing_since: Option<f64>,
    /// Which of [`LAYERS`] are shown.
    shown: Vec<bool>,
    /// What each of them draws at this moment; nothing for those that are hidden.
    drawn: Vec<Vec<Shape>>,
    window: Window,
    /// The states up to now, and whoever predicts from them: kept from frame to frame.
    history: Vec<JointState>,
    predictor: ShfrsPredictor,
    /// How likely each input is at this moment, once that is known; the sets are the
    /// predictor's.
    prediction: Option<Vec<(TurnInput, f64)>>,
    /// Whether sets are drawn for each step instead of for the whole time ahead.
    by_step: bool,
    /// What is wrong, if something is.
    trouble: Option<String>,
}

struct Learned {
    predictor: Predictor,
    trials: usize,
    fallback: Option<String>,
    settings: ShfrsSettings,
}

impl Replay {
    /// The replay of a trial, at its start.
    fn open(trial: TrialDetail, choice: Choice) -> (Self, Commands<Msg>) {
        let positions = trial.states.iter().flat_map(|s| [s.human.position(), s.robot.position()]);
        let goal = trial.scene.goal;
        let window =
            positions.chain([goal]).fold(Window { low: goal, high: goal }, |window, position| {
                window.including(position, 3.5)
            });
        let mut replay = Self {
            sources: Sources::new(&trial),
            trial,
            safety: None,
            levels: Vec::new(),
            choice,
            learned: None,
            time_s: 0.0,
            playing_since: None,
            shown: vec![true; LAYERS.len()],
            drawn: Vec::new(),
            window,
            history: Vec::new(),
            predictor: ShfrsPredictor::default(),
            prediction: None,
            by_step: false,
            trouble: None,
        };
        let mut commands = replay.sources.begin(&replay.trial);
        commands.extend(replay.choice.begin(&replay.trial));
        replay.draw();
        (replay, commands)
    }

    fn update(&mut self, message: Msg, now_ms: f64) -> Commands<Msg> {
        let mut commands = Vec::new();
        match message {
            Msg::Trial(_) => {}
            Msg::Predictor(answer) => self.take_predictor(read(answer)),
            Msg::Choose(value) => {
                commands = self.choice.choose(&value, &self.trial);
                // What is shown is never of another predictor than the chosen one.
                self.learned = None;
                self.predict();
            }
            Msg::Analyses(answer) => commands = self.choice.analyses(answer, &self.trial),
            Msg::Models(analysis, answer) => self.choice.models(analysis, answer),
            Msg::ValueFunction(evader, solving) => {
                self.sources.take(evader, solving);
                self.take_safety();
            }
            Msg::StopSolving => commands = self.sources.stop(),
            Msg::SolveAgain => commands = self.sources.retry(&self.trial),
            Msg::Play if self.is_playing() => self.playing_since = None,
            Msg::Play => {
                if self.time_s >= self.duration_s() {
                    self.seek(0.0);
                }
                self.playing_since = Some(now_ms);
            }
            Msg::Seek(step) => {
                self.playing_since = None;
                self.seek(step as f64 * self.trial.parameters.step_s);
            }
            Msg::ByStep => {
                self.by_step = !self.by_step;
                self.predict();
            }
            Msg::Layer(place) => {
                if let Some(shown) = self.shown.get_mut(place) {
                    *shown = !*shown;
                }
            }
            Msg::Frame => self.play_to(now_ms),
        }
        self.draw();
        commands
    }

    fn title(&self) -> String {
        let TrialDetail { study, summary, .. } = &self.trial;
        let (number, scene) = (summary.participant_number, summary.scene_words());
        format!("{study} / participant {number} / {scene}")
    }

    /// Puts the value functions to use, once both are here.
    fn take_safety(&mut self) {
        if self.safety.is_some() {
            return;
        }
        if let Some(safety) = self.sources.functions() {
            let level = |s: &JointState| (safety.human_level(s), safety.robot_level(s));
            self.levels = self.trial.states.iter().map(level).collect();
            self.safety = Some(safety);
            self.predict();
        }
    }

    /// Whether the solve of this vehicle's safety level had not settled when it ended, so that
    /// the level proves nothing.
    fn is_doubtful(&self, evader: Evader) -> bool {
        self.safety.as_ref().is_some_and(|safety| safety.of(evader).unsettled_m().is_some())
    }

    fn take_predictor(&mut self, trained: Result<TrainedPredictor, Failure>) {
        let trained = trained.map_err(|failure| failure.sentence);
        let learned =
            trained.and_then(|TrainedPredictor { predictor, trials, fallback, source }| {
                let learned = Predictor::try_from(predictor).and_then(|predictor| {
                    let settings = ShfrsSettings::paper(predictor.classes().len())?;
                    Ok(Learned { predictor, trials, fallback, settings })
                });
                Ok((learned.map_err(|invalid| invalid.to_string())?, source))
            });
        let (learned, answer) = match learned {
            Ok((learned, source)) => (Some(learned), Ok(source)),
            Err(why) => (None, Err(format!("No predicted sets. {why}"))),
        };
        self.learned = learned;
        self.choice.arrived(answer);
        self.predict();
    }

    /// Length of the trial, s.
    fn duration_s(&self) -> f64 {
        self.trial.inputs.len() as f64 * self.trial.parameters.step_s
    }

    /// The present step; the number of steps at the end.
    fn step(&self) -> usize {
        // The tolerance keeps a time that is a whole number of steps in its own step.
        ((self.time_s / self.trial.parameters.step_s + 1e-9) as usize).min(self.trial.inputs.len())
    }

    fn state(&self) -> JointState {
        let step = self.step();
        let state = self.trial.states[step];
        match self.trial.inputs.get(step) {
            None => state,
            Some(&input) => {
                let begun = step as f64 * self.trial.parameters.step_s;
                state.advance(&self.trial.parameters, input, (self.time_s - begun).max(0.0))
            }
        }
    }

    fn seek(&mut self, time_s: f64) {
        self.time_s = time_s.clamp(0.0, self.duration_s());
        self.predict();
    }

    fn is_playing(&self) -> bool {
        self.playing_since.is_some()
    }

    /// Plays on to `now_ms` on the page's clock.
    fn play_to(&mut self, now_ms: f64) {
        let Some(last) = self.playing_since else { return };
        self.playing_since = Some(now_ms);
        self.seek(self.time_s + (now_ms - last).max(0.0) / 1000.0);
        if self.time_s >= self.duration_s() {
            self.playing_since = None;
        }
    }

    /// Predicts anew for the present moment.
    fn predict(&mut self) {
        match self.predicted() {
            Ok(prediction) => (self.prediction, self.trouble) = (prediction, None),
            Err(invalid) => {
                self.prediction = None;
                self.trouble = Some(invalid.to_string());
            }
        }
    }

    /// How likely each input is; also predicts the sets.
    fn predicted(&mut self) -> Result<Option<Vec<(TurnInput, f64)>>, Invalid> {
        let state = self.state();
        let step = self.step();
        let (Some(learned), Some(safety)) = (&mut self.learned, &self.safety) else {
            return Ok(None);
        };
        let parameters = &self.trial.parameters;
        let human = PredictedHuman::new(&learned.predictor, safety, parameters)?;
        self.history.clear();
        self.history.extend_from_slice(&self.trial.states[..step]);
        self.history.push(state);
        let mut p = vec![0.0; learned.predictor.classes().len()];
        human.probabilities(&self.history, &mut p);
        let of_class = |input: TurnInput| {
            let class = learned.predictor.classes().iter().position(|&c| c == input.sign());
            (input, class.map_or(0.0, |class| p[class]))
        };
        let probabilities = TurnInput::ALL.into_iter().rev().map(of_class).collect();
        learned.settings.by_step = self.by_step;
        self.predictor.predict(&self.history, parameters, &human, &learned.settings)?;
        Ok(Some(probabilities))
    }

    /// Works out what the chosen layers show at this moment.
    fn draw(&mut self) {
        let moment = Moment {
            trial: &self.trial,
            step: self.step(),
            state: self.state(),
            safety: self.safety.as_ref(),
            shfrs: self.prediction.as_ref().map(|_| self.predictor.shfrs()),
            by_step: self.by_step,
        };
        let shapes = LAYERS
            .iter()
            .zip(&self.shown)
            .map(|(layer, &shown)| if shown { (layer.shapes)(&moment) } else { Vec::new() });
        self.drawn = shapes.collect();
    }

    fn show(&self, picture: &mut Picture) {
        picture.begin("replay", self.window);
        picture.tell("data-step", self.step());
        picture.tell("data-trial", &self.trial.summary.trial_id);
        picture.shapes.push(Shape::Grid { every_m: 5 });
        picture.shapes.extend(self.drawn.iter().flatten().cloned());
        picture.shapes.extend(stage::vehicles_and_goal(&self.trial.scene, self.state()));
    }
}
