//! A trial that is looked at: where the vehicles are at any time of it, what is predicted then, and a
//! picture of all that. Pages, files and commands show the same picture.

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

/// What is known of a trial.
#[derive(Clone, Debug, PartialEq)]
pub struct Recorded {
    /// Vehicles, steps and danger radius.
    pub parameters: SceneParameters,
    /// The scene.
    pub scene: Scene,
    /// The input held in each step.
    pub inputs: Vec<TurnInput>,
    /// The joint state before each step, and the one after the last step.
    pub states: Vec<JointState>,
}

impl Recorded {
    /// What the trial and its goal need, with room for the human to go so far from each position, m.
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

/// A learned function G, and how sets are predicted with it.
#[derive(Clone, Debug)]
pub struct Learned {
    /// The function.
    pub predictor: Predictor,
    /// How sets are predicted.
    pub settings: ShfrsSettings,
}

/// The probability of each input.
pub type Probabilities = [(TurnInput, f64); 3];

/// A trial that is looked at. It keeps its memory from frame to frame.
pub struct Playback {
    recorded: Recorded,
    window: Window,
    safety: Option<SafetyLevels>,
    /// V_HR and V_RH of each state, m.
    levels: Vec<[f64; 2]>,
    method: Option<Method>,
    /// The probabilities at the beginning of each step, once they are known, if the method has some.
    forecast: Vec<Probabilities>,
    now: Now,
    /// The states up to now.
    history: Vec<JointState>,
    predictor: ShfrsPredictor,
    /// The probabilities now, once they are known; then the sets are the predictor's.
    probabilities: Option<Probabilities>,
    curves: Curves,
    /// What is written at the bar of the scale.
    scale: Rc<str>,
    /// Where lines cross the edges of what is hatched.
    crossings: Vec<Crossing>,
}

/// A moment of the trial.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Now {
    /// Time into the trial, s.
    pub time_s: f64,
    /// The present step; the number of steps at the end.
    pub step: usize,
    /// Where the vehicles are.
    pub state: JointState,
}

/// Room around everything that a trial shows, m.
const MARGIN_M: f64 = 3.5;

impl Playback {
    /// A trial at its start.
    ///
    /// # Errors
    /// [`Invalid`] if there is not one state more than inputs.
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

    /// Everything that the trial and its goal need to be visible.
    #[must_use]
    pub fn window(&self) -> Window {
        self.window
    }

    /// Shows this part of the world from now on.
    pub fn show_window(&mut self, window: Window) {
        self.window = window;
    }

    /// Makes the window large enough for the trial, its goal, and sets that reach `steps` steps ahead of the human.
    pub fn make_room(&mut self, steps: usize) {
        let SceneParameters { human, step_s, .. } = self.recorded.parameters;
        self.window = self.recorded.window(human.speed_mps * step_s * steps as f64);
    }

    /// Takes over what was driven so far of a trial that is under way. The last step may differ from what
    /// was recorded of it before.
    ///
    /// # Errors
    /// [`Invalid`] if there is not one state more than inputs; else as of [`Self::use_learned`].
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

    /// The safety levels, once they are known.
    #[must_use]
    pub fn safety(&self) -> Option<&SafetyLevels> {
        self.safety.as_ref()
    }

    /// V_HR and V_RH of each state, m; nothing until they are known.
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

    /// The sets that were learned instead of a function, if those predict.
    #[must_use]
    pub fn empirical(&self) -> Option<&EmpiricalSets> {
        match &self.method {
            Some(Method::Empirical(sets)) => Some(sets),
            _ => None,
        }
    }

    /// The predicted probabilities at the beginning of each step; nothing until they are known, or if what
    /// predicts has none.
    #[must_use]
    pub fn forecast(&self) -> &[Probabilities] {
        &self.forecast
    }

    /// The moment that is looked at.
    #[must_use]
    pub fn now(&self) -> Now {
        self.now
    }

    /// The predicted probabilities at this moment, once they are known, if what predicts has some.
    #[must_use]
    pub fn probabilities(&self) -> Option<&Probabilities> {
        self.probabilities.as_ref()
    }

    /// The predicted sets at this moment, from the smallest to the largest; none until they are known.
    pub fn sets<'a>(&'a self) -> impl DoubleEndedIterator<Item = PredictedSet<'a>> {
        let learned = self.probabilities.iter().flat_map(move |_| &self.predictor.shfrs().sets);
        let placed = |it: &'a EmpiricalSets| {
            it.sets().iter().map(move |set| PredictedSet::of(it.family(), set))
        };
        let empirical = self.empirical().into_iter().flat_map(placed);
        learned.map(PredictedSet::from).chain(empirical)
    }

    /// How many sets are predicted at this moment; none until they are known.
    #[must_use]
    pub fn set_count(&self) -> usize {
        match self.empirical() {
            Some(empirical) => empirical.sets().len(),
            None => self.probabilities.map_or(0, |_| self.predictor.shfrs().sets.len()),
        }
    }

    /// Length of the trial, s.
    #[must_use]
    pub fn duration_s(&self) -> f64 {
        self.recorded.inputs.len() as f64 * self.recorded.parameters.step_s
    }

    /// Whether the solve of this vehicle's safety level had not settled when it ended, so that the level
    /// proves nothing.
    #[must_use]
    pub fn is_doubtful(&self, evader: Evader) -> bool {
        self.safety.as_ref().is_some_and(|safety| safety.of(evader).unsettled_m().is_some())
    }

    /// Uses these safety levels from now on.
    ///
    /// # Errors
    /// As of [`Self::use_learned`].
    pub fn use_safety(&mut self, safety: SafetyLevels) -> Result<(), Invalid> {
        self.safety = Some(safety);
        self.curves = Curves::default();
        self.levels.clear();
        self.measure();
        self.forecast.clear();
        self.foresee()
    }

    /// Predicts with this function from now on, or not at all.
    ///
    /// # Errors
    /// As of [`Self::use_method`].
    pub fn use_learned(&mut self, learned: Option<Learned>) -> Result<(), Invalid> {
        self.use_method(learned.map(Method::Learned))
    }

    /// Predicts in this way from now on, or not at all.
    ///
    /// # Errors
    /// [`Invalid`] if a function does not say how likely each input is; then nothing predicts.
    pub fn use_method(&mut self, method: Option<Method>) -> Result<(), Invalid> {
        self.forecast.clear();
        self.probabilities = None;
        self.method = method;
        self.foresee()
    }

    /// Predicts sets in this way from now on, if there is a function.
    pub fn use_settings(&mut self, settings: ShfrsSettings) {
        if let Some(Method::Learned(learned)) = &mut self.method {
            learned.settings = settings;
        }
    }

    /// Works out the safety levels of the states whose levels are not known.
    fn measure(&mut self) {
        let Some(safety) = &self.safety else { return };
        let level = |s: &JointState| [safety.human_level(s), safety.robot_level(s)];
        self.levels.extend(self.recorded.states[self.levels.len()..].iter().map(level));
    }

    /// Works out the probabilities of the steps whose probabilities are not known. If that fails, nothing
    /// predicts.
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

    /// Goes to the time of the view, and predicts what it shows.
    ///
    /// # Errors
    /// The errors of [`ShfrsPredictor::predict`]; then nothing is predicted.
    pub fn go(&mut self, view: &View) -> Result<(), Invalid> {
        let Recorded { parameters, inputs, states, .. } = &self.recorded;
        let time_s = view.time_s.clamp(0.0, self.duration_s());
        // The tolerance keeps a time that is a whole number of steps in its own step.
        const ROUNDING: f64 = 1e-9;
        let step = ((time_s / parameters.step_s + ROUNDING) as usize).min(inputs.len());
        let within_s = (time_s - step as f64 * parameters.step_s).max(0.0);
        let begun = within_s > ROUNDING * parameters.step_s;
        let state = match inputs.get(step) {
            None => states[step],
            Some(&input) => states[step].advance(parameters, input, within_s),
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

    /// Predicts no sets at this moment, as long as the settings of the prediction are not valid.
    pub fn hide_sets(&mut self) {
        self.probabilities = None;
    }

    /// Paints what the view shows of the moment that was gone to.
    pub fn paint(&mut self, view: &View, picture: &mut Picture) {
        grid::paint(picture, self.window, &self.scale);
        for (layer, shown) in LAYERS.iter().zip(view.shown) {
            if shown {
                (layer.paint)(self, &view.style, picture);
            }
        }
        picture.extend(stage::vehicles_and_goal(&self.recorded.scene, self.now.state));
    }

    /// What the signs of the picture mean.
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

    /// Steps of the predictions; the paper's number without any.
    #[must_use]
    pub fn steps_ahead(&self) -> usize {
        match &self.method {
            Some(Method::Learned(learned)) => learned.settings.bounds.steps(),
            Some(Method::Empirical(sets)) => sets.steps(),
            None => USUAL_STEPS,
        }
    }

    /// The area of a set's tube as a share of the worst case's: of everything that the human's vehicle can
    /// reach meanwhile.
    #[must_use]
    pub fn share_of_worst_case(&self, set: &PredictedSet<'_>) -> f64 {
        let worst = worst_case_area_m2(&self.recorded.parameters, self.steps_ahead());
        // A polygon is larger than its set by its accuracy.
        worst.map_or(1.0, |worst| (set.area_m2 / worst).min(1.0))
    }

    /// How far ahead predictions look, s.
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

/// How likely each input is after these states.
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

/// How many steps ahead the paper predicts.
const USUAL_STEPS: usize = 10;

/// A predictor of turns has a class for each.
const MOST_CLASSES: usize = 3;

#[cfg(test)]
mod tests;
