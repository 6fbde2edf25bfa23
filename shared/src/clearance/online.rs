//! Predictions from a stream of states, for a robot's control loop.

use super::interval::{ClearanceSettings, Clearances};
use super::plan::{Footprint, Plan};
use super::separating_line::{ClearanceFinder, HumanFuture};
use crate::bounds::{Algorithm1, BoundsSettings, InputBounds, Motion, Rollout};
use crate::invalid::Invalid;
use crate::math::{hypot, wrap_angle};
use crate::plausibility::{Departure, check_step, departure_at};
use crate::predict::Predictor;
use crate::safety::SafetyLevels;
use crate::scene::{JointState, SceneParameters};
use crate::shfrs::PredictedHuman;
use crate::shfrs::tuning::Tuned;
use crate::vehicle::{Pose, SpeedRange};
use std::sync::Arc;

/// Whether a state continues the history.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Continuity {
    /// The history continues or begins.
    Continues,
    /// The history continues, but the human's vehicle cannot have driven this step. No plan is
    /// clear until the next step ([`OnlinePredictor::departure`]).
    Departed,
    /// The human jumped. The history was cleared and begins with this state. No plan is clear until
    /// the next step.
    Restarted,
}

/// The assumption about the human's next steps.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum NextSteps {
    /// The human drives like the vehicle if the vehicle could have driven the last step. Otherwise (if
    /// the person stood still, for instance) no plan is clear, and every clearance is −∞.
    #[default]
    LikeLast,
    /// The human drives like the vehicle, regardless of the last step. Clearances hold only under this
    /// assumption: they can be positive although a person stands in the way.
    AssumeVehicle,
}

/// A predictor that owns its data and its history. Push each new state, predict, then query the
/// clearance of plans. The history is as long as the features require. After the first round of these
/// calls, later rounds allocate memory only if their plans are longer.
#[derive(Clone, Debug)]
pub struct OnlinePredictor {
    predictor: Arc<Predictor>,
    safety: Arc<SafetyLevels>,
    parameters: SceneParameters,
    /// The speeds with which the human can drive on.
    speed: SpeedRange,
    settings: BoundsSettings,
    /// Number of states that the features need.
    needed: usize,
    history: Vec<JointState>,
    /// The human's pose before the last pushed state.
    before: Option<Pose>,
    algorithm: Algorithm1,
    finder: ClearanceFinder,
    /// Whether the algorithm has run on the present history.
    predicted: bool,
    next: NextSteps,
}

/// If the human moves or turns in a step by more than this multiple of the vehicle's maximum, the step
/// counts as a jump.
const JUMP: f64 = 2.0;

impl OnlinePredictor {
    /// Predicts the human of `parameters` with `settings`. In the roll-outs the robot drives
    /// straight on, at the speed in `parameters`.
    /// [`FeatureSet::safety`](crate::features::FeatureSet::safety) computes `safety`. That function
    /// returns immediately if no feature needs safety levels.
    ///
    /// # Errors
    /// [`Invalid`] if a parameter is not valid, the predictor's classes are unknown, their number
    /// differs from the number of actions in the settings, or a feature looks back to the beginning
    /// of the drive.
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
            let found = "one that looks back to the beginning of the drive";
            return Err(Invalid::new("features", expected, found));
        };
        Ok(Self {
            predictor,
            safety,
            parameters,
            speed: parameters.human.speed_mps.into(),
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

    /// Predicts with the tuned choice of actions and roll-outs, and with the tuned ε for F_1.
    /// `further` are the ε of further sets (rad/s), ascending from the tuned ε. An ε of twice the
    /// human's maximum turn rate admits every turn.
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

    /// Replaces the clearance settings.
    #[must_use]
    pub fn with_clearance(self, settings: ClearanceSettings) -> Self {
        Self { finder: ClearanceFinder::new(settings), ..self }
    }

    /// Replaces the assumption about the human's next steps.
    #[must_use]
    pub fn with_next_steps(self, next: NextSteps) -> Self {
        Self { next, ..self }
    }

    /// Lets the human choose the speed from a range (m/s), as people on foot do. The sets, the clearances and
    /// [`Self::departure`] then allow every speed of the range. Without this, they assume the constant speed
    /// of the parameters. Features, roll-outs and calibrations use that speed in any case. So the range must
    /// contain it: otherwise the sets would not contain the humans of a calibration.
    ///
    /// # Errors
    /// [`Invalid`] if the range does not contain the human's speed in the parameters.
    pub fn with_speed(self, speed: SpeedRange) -> Result<Self, Invalid> {
        speed.check()?;
        let usual = self.parameters.human.speed_mps;
        if !(speed.lo_mps()..=speed.hi_mps()).contains(&usual) {
            let expected =
                format!("a range that contains the speed of the parameters, {usual} m/s");
            return Err(Invalid::new("speed_mps", expected, speed));
        }
        Ok(Self { speed, ..self })
    }

    /// The speeds with which the human can drive on.
    #[must_use]
    pub fn speed(&self) -> SpeedRange {
        self.speed
    }

    /// The settings of Algorithm 1, which determine the sets.
    #[must_use]
    pub fn settings(&self) -> &BoundsSettings {
        &self.settings
    }

    /// The vehicles and the duration of a step.
    #[must_use]
    pub fn parameters(&self) -> &SceneParameters {
        &self.parameters
    }

    /// Number of states that a prediction needs.
    #[must_use]
    pub fn states_needed(&self) -> usize {
        self.needed
    }

    /// The latest states, at most [`Self::states_needed`]. The last one is the present state.
    #[must_use]
    pub fn history(&self) -> &[JointState] {
        &self.history
    }

    /// The human's pose one step before the last state; `None` before the second state.
    #[must_use]
    pub fn before(&self) -> Option<Pose> {
        self.before
    }

    /// Whether [`Self::predict`] has run since the latest state was pushed.
    #[must_use]
    pub fn is_predicted(&self) -> bool {
        self.predicted
    }

    /// Clears the history.
    pub fn reset(&mut self) {
        self.history.clear();
        self.before = None;
        self.predicted = false;
    }

    /// Appends a state. It must follow the last state by one step (`step_s` of the parameters). If the
    /// human moved or turned by more than twice the vehicle's maximum in a step, earlier states are
    /// dropped. If a state was missed, call [`Self::reset`] and start again.
    ///
    /// The sets assume that the human continues at the speed of the parameters (or within
    /// [a range](Self::with_speed)) and within the maximum turn rate. They prove nothing for a human who
    /// moves slower or faster.
    /// Therefore, if the human's vehicle cannot have driven the step within a tolerance of a millimetre
    /// and a milliradian, `push` returns [`Continuity::Departed`], and no plan is clear until the next
    /// step ([`Self::departure`]). Positions with more noise need [`NextSteps::AssumeVehicle`].
    ///
    /// # Errors
    /// [`Invalid`] if a coordinate is not finite or beyond
    /// [`Pose::MOST`](crate::vehicle::Pose::MOST); the history is then unchanged.
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

    /// The reason why the sets do not bound the human's next steps: the human's vehicle in the
    /// parameters cannot have driven the last step within a tolerance of a millimetre and a
    /// milliradian. `None` if it could have driven the step, if only one state is known, or with
    /// [`NextSteps::AssumeVehicle`].
    #[must_use]
    pub fn departure(&self) -> Option<Departure> {
        let (before, last) = (self.before?, self.history.last()?);
        let found = departure_at(&self.parameters, self.speed, before, last.human);
        found.filter(|_| self.next == NextSteps::LikeLast)
    }

    /// Checks that the human's vehicle in the parameters could have driven the last step within a
    /// tolerance of a millimetre and a milliradian. The sets and their probabilities assume that the
    /// vehicle can also drive the human's next steps. Neither [`NextSteps`] nor [`Self::with_speed`] has an effect
    /// on this check: the humans of a calibration had the speed of the parameters.
    ///
    /// # Errors
    /// [`Invalid`] if the vehicle cannot have driven the step ([`check_step`]). With fewer than two
    /// states there is no step to check.
    pub fn check_human(&self) -> Result<(), Invalid> {
        let (Some(before), Some(last)) = (self.before, self.history.last()) else { return Ok(()) };
        check_step(&self.parameters, before, last.human)
            .map_err(|invalid| invalid.within("state.human"))
    }

    fn jumped(&self, last: &JointState, state: &JointState) -> bool {
        let (human, step_s) = (self.parameters.human, self.parameters.step_s);
        let moved = hypot(state.human.x - last.human.x, state.human.y - last.human.y);
        let turned = wrap_angle(state.human.psi - last.human.psi).abs();
        moved > JUMP * self.speed.hi_mps() * step_s
            || turned > JUMP * human.turn_rate_radps * step_s
    }

    /// Computes the bounds of each set F_1 ⊆ F_2 ⊆ … from the states so far. They hold for a human who
    /// drives like the vehicle; see [`Self::departure`].
    ///
    /// # Errors
    /// [`Invalid`] if there are fewer states than the features need, or if Algorithm 1 fails
    /// ([`Algorithm1::run`]).
    pub fn predict(&mut self) -> Result<&[InputBounds], Invalid> {
        let held = self.history.len();
        if held < self.needed {
            let states = if self.needed == 1 { "state" } else { "states" };
            let expected = format!("at least {} {states}, as the features require", self.needed);
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

    /// Computes the clearance from each predicted set, in each step, of a plan that begins now. If
    /// there is a [departure](Self::departure), for instance because the human stood still, every
    /// clearance is −∞, and [`Clearances::unproved`] returns the reason.
    ///
    /// # Errors
    /// [`Invalid`] if [`Self::predict`] has not run since the last state was pushed; and the errors of
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
            speed: self.speed,
            step_s: self.parameters.step_s,
        };
        self.finder.find_unless(departed, &future, plan, footprint)
    }
}
