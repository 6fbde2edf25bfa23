//! Playback of a trial: the vehicles' positions and the predictions at any time of the trial, and a
//! picture of both. Pages, files and commands show the same picture.

pub mod style;
mod curves;
mod hatch;
mod grid;
mod shade;
mod level_set;
mod danger_zone;
mod predicted;
mod shfrs;
mod samples;
mod avoidance;
mod future;
mod trajectory;
pub mod layers;
pub mod view;
pub mod source;
mod figure;

pub use figure::{legend_of_both, side_by_side};
pub use predicted::{Level, Method, PredictedSet};

use self::curves::Curves;
use self::hatch::Crossing;
use self::layers::LAYERS;
use self::style::Sets;
use self::view::View;
use crate::bounds::ActionModel as _;
use crate::chart::{LegendItem, Sign, colours};
use crate::invalid::Invalid;
use crate::picture::{Picture, Window, stage};
use crate::predict::Predictor;
use crate::safety::SafetyLevels;
use crate::scene::{Evader, JointState, Scene, SceneParameters};
use crate::shfrs::baselines::{EmpiricalSets, worst_case_area_m2};
use crate::shfrs::{PredictedHuman, ShfrsPredictor, ShfrsSettings};
use crate::vehicle::TurnInput;
use std::rc::Rc;

/// A recorded trial.
#[derive(Clone, Debug, PartialEq)]
pub struct Recorded {
    /// Vehicles, steps and danger radius.
    pub parameters: SceneParameters,
    /// The scene.
    pub scene: Scene,
    /// The input held in each step.
    pub inputs: Vec<TurnInput>,
    /// The joint states before each step and after the last step.
    pub states: Vec<JointState>,
}

impl Recorded {
    /// The window that shows the trial and its goal, and everything within `reach_m` (m) of each
    /// position of the human.
    fn window(&self, reach_m: f64) -> Window {
        let goal = self.scene.goal;
        let begin = Window { low: goal, high: goal }.including(goal, MARGIN_M);
        self.states.iter().fold(begin, |window, state| {
            window
                .including(state.human.position(), reach_m.max(MARGIN_M))
                .including(state.robot.position(), MARGIN_M)
        })
    }
}

/// A learned function G, and the settings for predicting sets with it.
#[derive(Clone, Debug)]
pub struct Learned {
    /// The function.
    pub predictor: Predictor,
    /// Settings for predicting sets.
    pub settings: ShfrsSettings,
}

/// The probability of each input.
pub type Probabilities = [(TurnInput, f64); 3];

/// Playback of a trial. It reuses its buffers from frame to frame.
pub struct Playback {
    recorded: Recorded,
    window: Window,
    safety: Option<SafetyLevels>,
    /// V_HR and V_RH of each state (m).
    levels: Vec<[f64; 2]>,
    method: Option<Method>,
    /// The probabilities at the start of each step. Empty until they are computed, or if the method
    /// has none.
    forecast: Vec<Probabilities>,
    now: Now,
    /// The states up to now.
    history: Vec<JointState>,
    predictor: ShfrsPredictor,
    /// The current probabilities. `None` until they are computed. If they are present, the
    /// predictor's sets are current, too.
    probabilities: Option<Probabilities>,
    curves: Curves,
    /// Label of the scale bar.
    scale: Rc<str>,
    /// Buffer for the crossings of hatching lines and polygon edges.
    crossings: Vec<Crossing>,
}

/// A moment of the trial.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Now {
    /// Time since the start of the trial (s).
    pub time_s: f64,
    /// Index of the current step. At the end of the trial, it equals the number of steps.
    pub step: usize,
    /// The poses of both vehicles.
    pub state: JointState,
}

/// Margin around everything in a trial (m).
const MARGIN_M: f64 = 3.5;

impl Playback {
    /// A trial at its start.
    ///
    /// # Errors
    /// [`Invalid`] unless there is exactly one more state than inputs.
    pub fn new(recorded: Recorded) -> Result<Self, Invalid> {
        let Recorded { inputs, states, .. } = &recorded;
        one_more(inputs, states)?;
        let window = recorded.window(0.0);
        let now = Now { time_s: 0.0, step: 0, state: states[0] };
        Ok(Self {
            recorded,
            window,
            safety: None,
            levels: Vec::new(),
            method: None,
            forecast: Vec::new(),
            now,
            history: Vec::new(),
            predictor: ShfrsPredictor::default(),
            probabilities: None,
            curves: Curves::default(),
            scale: grid::WORDS.into(),
            crossings: Vec::new(),
        })
    }

    /// The trial.
    #[must_use]
    pub fn recorded(&self) -> &Recorded {
        &self.recorded
    }

    /// The visible part of the world, which includes the trial and its goal.
    #[must_use]
    pub fn window(&self) -> Window {
        self.window
    }

    /// Sets the visible part of the world.
    pub fn show_window(&mut self, window: Window) {
        self.window = window;
    }

    /// Enlarges the window to fit the trial, its goal, and sets that extend `steps` steps ahead of
    /// the human.
    pub fn make_room(&mut self, steps: usize) {
        let SceneParameters { human, step_s, .. } = self.recorded.parameters;
        self.window = self.recorded.window(human.speed_mps * step_s * steps as f64);
    }

    /// Updates the recording of a trial that is still being driven. `inputs` and `states` contain
    /// the whole drive so far. They can correct the step that was recorded last.
    ///
    /// # Errors
    /// [`Invalid`] unless there is exactly one more state than inputs, and the errors of
    /// [`Self::use_learned`].
    pub fn record(&mut self, inputs: &[TurnInput], states: &[JointState]) -> Result<(), Invalid> {
        one_more(inputs, states)?;
        let recorded = &mut self.recorded;
        let same =
            recorded.states.iter().zip(states).take_while(|(known, now)| known == now).count();
        recorded.inputs.clear();
        recorded.inputs.extend_from_slice(inputs);
        recorded.states.truncate(same);
        recorded.states.extend_from_slice(&states[same..]);
        self.levels.truncate(same);
        self.measure();
        self.forecast.truncate(same);
        self.foresee()
    }

    /// The safety levels, once set.
    #[must_use]
    pub fn safety(&self) -> Option<&SafetyLevels> {
        self.safety.as_ref()
    }

    /// V_HR and V_RH of each state (m). Empty until the safety levels are set.
    #[must_use]
    pub fn levels(&self) -> &[[f64; 2]] {
        &self.levels
    }

    /// The learned function and its settings, if there is one.
    #[must_use]
    pub fn learned(&self) -> Option<&Learned> {
        match &self.method {
            Some(Method::Learned(learned)) => Some(learned),
            _ => None,
        }
    }

    /// The empirical sets, if they are the prediction method.
    #[must_use]
    pub fn empirical(&self) -> Option<&EmpiricalSets> {
        match &self.method {
            Some(Method::Empirical(sets)) => Some(sets),
            _ => None,
        }
    }

    /// The predicted probabilities at the start of each step. Empty until they are computed, or if
    /// the method has none.
    #[must_use]
    pub fn forecast(&self) -> &[Probabilities] {
        &self.forecast
    }

    /// The current moment.
    #[must_use]
    pub fn now(&self) -> Now {
        self.now
    }

    /// The predicted probabilities at this moment. `None` until they are computed, or if the method
    /// has none.
    #[must_use]
    pub fn probabilities(&self) -> Option<&Probabilities> {
        self.probabilities.as_ref()
    }

    /// The predicted sets at this moment, from the smallest to the largest. Empty until they are
    /// predicted.
    pub fn sets<'a>(&'a self) -> impl DoubleEndedIterator<Item = PredictedSet<'a>> {
        let learned = self.probabilities.iter().flat_map(move |_| &self.predictor.shfrs().sets);
        let placed = |it: &'a EmpiricalSets| {
            it.sets().iter().map(move |set| PredictedSet::of(it.family(), set))
        };
        let empirical = self.empirical().into_iter().flat_map(placed);
        learned.map(PredictedSet::from).chain(empirical)
    }

    /// The number of predicted sets at this moment, or 0 until they are predicted.
    #[must_use]
    pub fn set_count(&self) -> usize {
        match self.empirical() {
            Some(empirical) => empirical.sets().len(),
            None => self.probabilities.map_or(0, |_| self.predictor.shfrs().sets.len()),
        }
    }

    /// Length of the trial (s).
    #[must_use]
    pub fn duration_s(&self) -> f64 {
        self.recorded.inputs.len() as f64 * self.recorded.parameters.step_s
    }

    /// Whether the solve of this vehicle's safety level ended before it converged, so that the
    /// level proves nothing.
    #[must_use]
    pub fn is_doubtful(&self, evader: Evader) -> bool {
        self.safety.as_ref().is_some_and(|safety| safety.of(evader).unsettled_m().is_some())
    }

    /// Sets the safety levels.
    ///
    /// # Errors
    /// The errors of [`Self::use_learned`].
    pub fn use_safety(&mut self, safety: SafetyLevels) -> Result<(), Invalid> {
        self.safety = Some(safety);
        self.curves = Curves::default();
        self.levels.clear();
        self.measure();
        self.forecast.clear();
        self.foresee()
    }

    /// Sets the learned function that predicts. `None` turns prediction off.
    ///
    /// # Errors
    /// The errors of [`Self::use_method`].
    pub fn use_learned(&mut self, learned: Option<Learned>) -> Result<(), Invalid> {
        self.use_method(learned.map(Method::Learned))
    }

    /// Sets the prediction method. `None` turns prediction off.
    ///
    /// # Errors
    /// [`Invalid`] if a learned function has classes other than left, straight and right.
    /// Prediction is then off.
    pub fn use_method(&mut self, method: Option<Method>) -> Result<(), Invalid> {
        self.forecast.clear();
        self.probabilities = None;
        self.method = method;
        self.foresee()
    }

    /// Sets the settings for predicting sets, if the method is a learned function.
    pub fn use_settings(&mut self, settings: ShfrsSettings) {
        if let Some(Method::Learned(learned)) = &mut self.method {
            learned.settings = settings;
        }
    }

    /// Computes the safety levels of the states that do not have them yet.
    fn measure(&mut self) {
        let Some(safety) = &self.safety else { return };
        let level = |s: &JointState| [safety.human_level(s), safety.robot_level(s)];
        self.levels.extend(self.recorded.states[self.levels.len()..].iter().map(level));
    }

    /// Computes the probabilities of the steps that do not have them yet. If that fails, prediction
    /// is turned off.
    fn foresee(&mut self) -> Result<(), Invalid> {
        let foreseen = self.forecast_on();
        foreseen.inspect_err(|_| self.method = None)
    }

    fn forecast_on(&mut self) -> Result<(), Invalid> {
        let (Some(Method::Learned(learned)), Some(safety)) = (&self.method, &self.safety) else {
            return Ok(());
        };
        let Recorded { parameters, states, .. } = &self.recorded;
        let human = PredictedHuman::new(&learned.predictor, safety, parameters)?;
        let classes = learned.predictor.classes().len();
        if classes > MOST_CLASSES {
            return Err(Invalid::new("classes", "at most 3: left, straight and right", classes));
        }
        let next = self.forecast.len() + 1;
        let forecast =
            (next..=states.len()).map(|seen| probabilities(&human, learned, &states[..seen]));
        self.forecast.extend(forecast);
        Ok(())
    }

    /// Moves to the view's time and computes the predictions that the view shows.
    ///
    /// # Errors
    /// The errors of [`ShfrsPredictor::predict`]. After an error, nothing is predicted.
    pub fn go(&mut self, view: &View) -> Result<(), Invalid> {
        let Recorded { parameters, inputs, states, .. } = &self.recorded;
        let time_s = view.time_s.clamp(0.0, self.duration_s());
        // A time at a whole number of steps must not fall into the previous step because of
        // rounding errors.
        const ROUNDING: f64 = 1e-9;
        let step = ((time_s / parameters.step_s + ROUNDING) as usize).min(inputs.len());
        let within_s = (time_s - step as f64 * parameters.step_s).max(0.0);
        let begun = within_s > ROUNDING * parameters.step_s;
        let state = match inputs.get(step) {
            None => states[step],
            Some(&input) => {
                states[step].within_step(parameters, input, &states[step + 1], within_s)
            }
        };
        self.now = Now { time_s, step, state };
        self.history.clear();
        self.history.extend_from_slice(&states[..step]);
        self.history.push(state);
        self.probabilities = None;
        let learned = match &mut self.method {
            None => return Ok(()),
            Some(Method::Learned(learned)) => learned,
            Some(Method::Empirical(sets)) => {
                let last = if begun { Some(step) } else { step.checked_sub(1) };
                let held = last.and_then(|last| inputs.get(last)).copied();
                sets.place(state.human, held.unwrap_or(TurnInput::Straight));
                return Ok(());
            }
        };
        let Some(safety) = &self.safety else { return Ok(()) };
        let human = PredictedHuman::new(&learned.predictor, safety, parameters)?;
        learned.settings.by_step = view.style.sets != Sets::Tube;
        self.predictor.predict(&self.history, parameters, &human, &learned.settings)?;
        self.probabilities = Some(probabilities(&human, learned, &self.history));
        Ok(())
    }

    /// Hides the sets that a learned function predicts at this moment, for example while the
    /// prediction's settings are invalid.
    pub fn hide_sets(&mut self) {
        self.probabilities = None;
    }

    /// Paints the layers of the view at the current moment.
    pub fn paint(&mut self, view: &View, picture: &mut Picture) {
        grid::paint(picture, self.window, &self.scale);
        for (layer, shown) in LAYERS.iter().zip(view.shown) {
            if shown {
                (layer.paint)(self, &view.style, picture);
            }
        }
        picture.extend(stage::vehicles_and_goal(&self.recorded.scene, self.now.state));
    }

    /// The legend of the picture.
    #[must_use]
    pub fn legend(&self, view: &View) -> Vec<LegendItem> {
        let vehicle = |text, colour| LegendItem::sign(text, &Sign::Arrow(0.0, 22.0), colour);
        let mut items = vec![
            vehicle("human", colours::HUMAN),
            vehicle("robot, on its way to the red square", colours::ROBOT),
        ];
        for (layer, shown) in LAYERS.iter().zip(view.shown) {
            if shown {
                items.extend((layer.legend)(self, &view.style));
            }
        }
        items
    }

    /// Number of steps that the predictions look ahead. Without a prediction method, it is the
    /// paper's number.
    #[must_use]
    pub fn steps_ahead(&self) -> usize {
        match &self.method {
            Some(Method::Learned(learned)) => learned.settings.bounds.steps(),
            Some(Method::Empirical(sets)) => sets.steps(),
            None => USUAL_STEPS,
        }
    }

    /// The area of a set's tube as a share of the worst case, which is the area that the human's
    /// vehicle can reach in the same time.
    #[must_use]
    pub fn share_of_worst_case(&self, set: &PredictedSet<'_>) -> f64 {
        let worst = worst_case_area_m2(&self.recorded.parameters, self.steps_ahead());
        // A polygon can exceed its set by up to the polygon's accuracy.
        worst.map_or(1.0, |worst| (set.area_m2 / worst).min(1.0))
    }

    /// Horizon of the predictions (s).
    #[must_use]
    pub fn seconds_ahead(&self) -> f64 {
        self.steps_ahead() as f64 * self.recorded.parameters.step_s
    }
}

fn one_more(inputs: &[TurnInput], states: &[JointState]) -> Result<(), Invalid> {
    if states.len() == inputs.len() + 1 {
        return Ok(());
    }
    let expected = format!("{}, one more than inputs", inputs.len() + 1);
    Err(Invalid::new("states", expected, states.len()))
}

/// The probability of each input after these states.
fn probabilities(
    human: &PredictedHuman<'_>,
    learned: &Learned,
    history: &[JointState],
) -> Probabilities {
    let mut p = [0.0; MOST_CLASSES];
    let classes = learned.predictor.classes();
    let p = &mut p[..classes.len().min(MOST_CLASSES)];
    human.probabilities(history, p);
    let of = |input: TurnInput| {
        let class = classes.iter().position(|&class| class == input.sign());
        (input, class.and_then(|class| p.get(class)).copied().unwrap_or(0.0))
    };
    [TurnInput::Left, TurnInput::Straight, TurnInput::Right].map(of)
}

/// Number of steps that the paper's predictions look ahead.
const USUAL_STEPS: usize = 10;

/// Maximum number of classes of a predictor of turns: one class per direction.
const MOST_CLASSES: usize = 3;

#[cfg(test)]
mod tests;
