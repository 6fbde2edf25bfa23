//! Predictions state by state, as a robot's loop needs them.

use super::clearance::{ClearanceSettings, Clearances};
use super::finder::{ClearanceFinder, HumanFuture};
use super::plan::{Footprint, Plan};
use crate::bounds::{Algorithm1, BoundsSettings, InputBounds, Motion, Rollout};
use crate::invalid::Invalid;
use crate::math::{hypot, wrap_angle};
use crate::motion::{Departure, check_step, departure};
use crate::predict::Predictor;
use crate::safety::SafetyLevels;
use crate::scene::{JointState, SceneParameters};
use crate::shfrs::PredictedHuman;
use crate::shfrs::tuning::Tuned;
use crate::vehicle::Pose;
use std::sync::Arc;

/// Whether a state followed from those before.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Continuity {
    /// The history goes on, or begins.
    Continues,
    /// The history goes on, but the human's vehicle cannot have driven this step: no plan is clear until the next one
    /// ([`OnlinePredictor::departure`]).
    Departed,
    /// The human jumped: the history was forgotten and begins with this state. No plan is clear until the next one.
    Restarted,
}

/// What is known of the human's next steps.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum NextSteps {
    /// The vehicle's, if the vehicle can have driven the last step. If it cannot (the person stood still, for instance),
    /// no plan is clear: every clearance is −∞.
    #[default]
    LikeLast,
    /// The vehicle's, whatever the last step was. Clearances then hold only for a human who drives like the vehicle from now
    /// on: they can be positive although somebody stands in the way.
    AssumeVehicle,
}

/// A prediction that owns what it needs and keeps its own history: push each new state, then predict,
/// then ask for the clearance of plans. It keeps as many states as the features look back. After a first
/// round, further rounds with no longer plans allocate nothing.
#[derive(Clone, Debug)]
pub struct OnlinePredictor {
    predictor: Arc<Predictor>,
    safety: Arc<SafetyLevels>,
    parameters: SceneParameters,
    settings: BoundsSettings,
    /// How many states the features need.
    needed: usize,
    history: Vec<JointState>,
    /// The human's pose before the last one that was pushed.
    before: Option<Pose>,
    algorithm: Algorithm1,
    finder: ClearanceFinder,
    /// Whether the algorithm ran on the present history.
    predicted: bool,
    next: NextSteps,
}

/// A human who gets on or turns more than this many times as much as the vehicle can in a step jumps.
const JUMP: f64 = 2.0;

impl OnlinePredictor {
    /// Predicts the human of `parameters` with `settings`. In the roll-outs the robot drives straight on,
    /// at the speed of `parameters`. [`FeatureSet::safety`](crate::features::FeatureSet::safety) makes
    /// `safety`, at once where no feature needs it.
    ///
    /// # Errors
    /// [`Invalid`] if a parameter is not valid, the predictor's classes are not understood or their
    /// number is not that of the settings, or a feature looks back to the beginning of the drive.
    pub fn new(
        predictor: impl Into<Arc<Predictor>>,
        safety: impl Into<Arc<SafetyLevels>>,
        parameters: SceneParameters,
        settings: BoundsSettings,
    ) -> Result<Self, Invalid> {
        let (predictor, safety) = (predictor.into(), safety.into());
        parameters.check().map_err(|invalid| invalid.within("parameters"))?;
        PredictedHuman::new(&predictor, &safety, &parameters)?;
        let classes = predictor.classes().len();
        if classes != settings.actions() {
            let expected = format!("settings for the predictor's {classes} actions");
            return Err(Invalid::new("settings.actions", expected, settings.actions()));
        }
        let Some(needed) = predictor.features().states_needed() else {
            let expected = "features that look back a fixed number of steps";
            return Err(Invalid::new("features", expected, "one since the beginning of the drive"));
        };
        Ok(Self {
            predictor,
            safety,
            parameters,
            settings,
            needed,
            history: Vec::with_capacity(needed),
            before: None,
            algorithm: Algorithm1::default(),
            finder: ClearanceFinder::default(),
            predicted: false,
            next: NextSteps::default(),
        })
    }

    /// Predicts with what was tuned: its choice of actions, its roll-outs and its ε for F_1. `further` are the ε of further
    /// sets, rad/s, rising from the tuned one; twice the human's turn rate admits everything.
    ///
    /// # Errors
    /// The errors of [`Self::new`] and of [`BoundsSettings::new`].
    pub fn tuned(
        tuned: &Tuned,
        further: &[f64],
        predictor: impl Into<Arc<Predictor>>,
        safety: impl Into<Arc<SafetyLevels>>,
        parameters: SceneParameters,
    ) -> Result<Self, Invalid> {
        let predictor = predictor.into();
        let rollout = [Rollout::Base, Rollout::Paper];
        let Some(rollout) = rollout.into_iter().find(|rollout| rollout.word() == tuned.rollout)
        else {
            return Err(Invalid::new("tuned.rollout", "base or paper", &tuned.rollout));
        };
        let epsilon = [&[tuned.epsilon], further].concat();
        let actions = predictor.classes().len();
        let settings = BoundsSettings::new(epsilon, tuned.choice.clone(), rollout, actions)?;
        Self::new(predictor, safety, parameters, settings)
    }

    /// The same with other settings of the clearance.
    #[must_use]
    pub fn with_clearance(self, settings: ClearanceSettings) -> Self {
        Self { finder: ClearanceFinder::new(settings), ..self }
    }

    /// The same with another assumption about the human's next steps.
    #[must_use]
    pub fn with_next_steps(self, next: NextSteps) -> Self {
        Self { next, ..self }
    }

    /// The settings of the sets.
    #[must_use]
    pub fn settings(&self) -> &BoundsSettings {
        &self.settings
    }

    /// The vehicles, and the length of a step.
    #[must_use]
    pub fn parameters(&self) -> &SceneParameters {
        &self.parameters
    }

    /// How many states a prediction needs.
    #[must_use]
    pub fn states_needed(&self) -> usize {
        self.needed
    }

    /// The latest states, at most as many as are needed, the present one last.
    #[must_use]
    pub fn history(&self) -> &[JointState] {
        &self.history
    }

    /// The human's pose one step before the last state; none before the second state.
    #[must_use]
    pub fn before(&self) -> Option<Pose> {
        self.before
    }

    /// Whether there is a prediction of the latest state.
    #[must_use]
    pub fn is_predicted(&self) -> bool {
        self.predicted
    }

    /// Forgets all states.
    pub fn reset(&mut self) {
        self.history.clear();
        self.before = None;
        self.predicted = false;
    }

    /// Appends the state one step, `step_s` of the parameters, after the last one. If the human moved or turned more than twice as
    /// much as the vehicle can in a step, the states before are forgotten. Where a state was missed, call [`Self::reset`] and
    /// begin anew. Sets assume that the human goes on at the speed of the parameters and within its turn rate: for one who
    /// stands still, or moves slower or faster, they prove nothing. So a step that the human's vehicle cannot have driven, to a
    /// millimetre and a milliradian, is told, and no plan is clear until the next step ([`Self::departure`]). Positions with
    /// more noise than that need [`NextSteps::AssumeVehicle`].
    ///
    /// # Errors
    /// [`Invalid`] if a coordinate is not finite or beyond [`Pose::MOST`](crate::vehicle::Pose::MOST); the history is then
    /// unchanged.
    pub fn push(&mut self, state: JointState) -> Result<Continuity, Invalid> {
        state.check().map_err(|invalid| invalid.within("state"))?;
        self.predicted = false;
        self.before = self.history.last().map(|last| last.human);
        let jumped = self.history.last().is_some_and(|last| self.jumped(last, &state));
        if jumped {
            self.history.clear();
        }
        if self.history.len() == self.needed {
            self.history.remove(0);
        }
        self.history.push(state);
        Ok(match (jumped, self.departure()) {
            (true, _) => Continuity::Restarted,
            (false, Some(_)) => Continuity::Departed,
            (false, None) => Continuity::Continues,
        })
    }

    /// Why the sets say nothing of the human's next steps: the last step was none that the human's vehicle of the parameters
    /// can drive, to a millimetre and a milliradian. None if it was, if one state alone is known, or with
    /// [`NextSteps::AssumeVehicle`].
    #[must_use]
    pub fn departure(&self) -> Option<Departure> {
        let (before, last) = (self.before?, self.history.last()?);
        let found = departure(&self.parameters, before, last.human);
        found.filter(|_| self.next == NextSteps::LikeLast)
    }

    /// Whether the human moved in the last step as the human's vehicle of the parameters can, to a millimetre and a milliradian.
    /// The sets, and what is said of their probability, assume that the next steps are such. [`NextSteps`] changes nothing here.
    ///
    /// # Errors
    /// [`Invalid`] if not ([`check_step`]). One state alone has no step: it passes.
    pub fn check_human(&self) -> Result<(), Invalid> {
        let (Some(before), Some(last)) = (self.before, self.history.last()) else { return Ok(()) };
        check_step(&self.parameters, before, last.human)
            .map_err(|invalid| invalid.within("state.human"))
    }

    fn jumped(&self, last: &JointState, state: &JointState) -> bool {
        let (human, step_s) = (self.parameters.human, self.parameters.step_s);
        let moved = hypot(state.human.x - last.human.x, state.human.y - last.human.y);
        let turned = wrap_angle(state.human.psi - last.human.psi).abs();
        moved > JUMP * human.speed_mps * step_s || turned > JUMP * human.turn_rate_radps * step_s
    }

    /// The bounds of each set F_1 ⊆ F_2 ⊆ … from the states so far: turn rates of a human who drives like the vehicle, which
    /// [`Self::departure`] may contradict.
    ///
    /// # Errors
    /// [`Invalid`] if there are fewer states than the features need, or Algorithm 1 fails
    /// ([`Algorithm1::run`]).
    pub fn predict(&mut self) -> Result<&[InputBounds], Invalid> {
        let held = self.history.len();
        if held < self.needed {
            let states = if self.needed == 1 { "state" } else { "states" };
            let expected = format!("at least {} {states}, as the features look back", self.needed);
            return Err(Invalid::new("history", expected, held));
        }
        self.predicted = false;
        let human = PredictedHuman::new(&self.predictor, &self.safety, &self.parameters)?;
        let motion = Motion::from(&self.parameters);
        let straight_on = |_: &[JointState]| 0.0;
        let found =
            self.algorithm.run(&self.history, &motion, &human, straight_on, &self.settings)?;
        self.predicted = true;
        Ok(&found.sets)
    }

    /// The clearance of a plan that begins now from each predicted set, in each step. It is −∞ after a step of a human who does
    /// not drive like the vehicle, who stands still for instance: [`Clearances::unproved`] says why.
    ///
    /// # Errors
    /// [`Invalid`] if there is no prediction since the last state was pushed; and the errors of
    /// [`ClearanceFinder::find`].
    pub fn clear(&mut self, plan: &Plan, footprint: &Footprint) -> Result<&Clearances, Invalid> {
        if !self.predicted {
            return Err(Invalid::new("predict", "a call since the latest state", "none"));
        }
        let departed = self.departure();
        let found = self.algorithm.found();
        let future = HumanFuture {
            start: found.low[0].human,
            sets: &found.sets,
            speed_mps: self.parameters.human.speed_mps,
            step_s: self.parameters.step_s,
        };
        self.finder.find_unless(departed, &future, plan, footprint)
    }
}
