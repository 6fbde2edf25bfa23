//! Stochastic human forward reachable sets (SHFRS): nested sets of positions that the human can
//! reach. They are predicted from the states so far.

pub mod file;
pub mod window;
pub mod family;
pub mod window_sets;
pub mod widened;
pub mod baselines;
pub mod probability;
pub mod cache;
pub mod scores;
pub mod guarantee;
pub mod danger;
#[cfg(test)]
mod testing;
pub mod pareto;
#[cfg(feature = "study")]
pub mod pareto_charts;
pub mod tuning;
mod redrawn;

use crate::bounds::{
    ActionChoice, ActionModel, ActionSpace, Algorithm1, BoundsSettings, InputBounds, Motion,
    Rollout,
};
use crate::features::FEATURES;
use crate::invalid::Invalid;
use crate::predict::Predictor;
use crate::reach::polygon::signed_area;
use crate::reach::{Outline, PolygonSettings, ReachableSet, Workspace};
use crate::safety::SafetyLevels;
use crate::scene::{JointState, SceneParameters};
use core::ops::ControlFlow;

/// Uses a predictor as the learned function G of Algorithm 1.
pub struct PredictedHuman<'a> {
    predictor: &'a Predictor,
    safety: &'a SafetyLevels,
    actions: Actions<'a>,
}

/// The turn rates of a predictor's classes (rad/s).
enum Actions<'a> {
    /// Turn rates that the predictor specifies.
    Given(&'a [f64]),
    /// Turn rates of classes that are turn directions, and the number N of classes. Only the first
    /// N entries are used, one per class.
    OfTurns([f64; 3], usize),
}

/// Maximum number of features of a predictor. A predictor uses each feature at most once.
const MOST_FEATURES: usize = FEATURES.len();

impl<'a> PredictedHuman<'a> {
    /// A human with the turn range of `parameters`, predicted by `predictor`.
    ///
    /// # Errors
    /// The errors of [`Self::within`].
    pub fn new(
        predictor: &'a Predictor,
        safety: &'a SafetyLevels,
        parameters: &SceneParameters,
    ) -> Result<Self, Invalid> {
        Self::within(predictor, safety, parameters.human.turn_range())
    }

    /// A human whose turn rate ranges from `turn_rate.0` to `turn_rate.1` (rad/s), predicted by
    /// `predictor`. If the predictor specifies no turn rates for its classes, class −1 means the
    /// lowest turn rate, class 0 means straight and class 1 means the highest turn rate.
    ///
    /// # Errors
    /// [`Invalid`] if the predictor specifies no turn rates and a class is not −1, 0 or 1.
    pub fn within(
        predictor: &'a Predictor,
        safety: &'a SafetyLevels,
        turn_rate: (f64, f64),
    ) -> Result<Self, Invalid> {
        let actions = match predictor.actions() {
            Some(actions) => Actions::Given(actions),
            None => {
                let mut rates = [0.0; 3];
                for (i, &class) in predictor.classes().iter().enumerate() {
                    let rate = match class {
                        -1 => Some(turn_rate.0),
                        0 => Some(0.0),
                        1 => Some(turn_rate.1),
                        _ => None,
                    };
                    let (Some(rate), Some(place)) = (rate, rates.get_mut(i)) else {
                        let expected = "-1 (right), 0 (straight) or 1 (left), each once, or a turn \
                                        rate for each class in `actions`";
                        return Err(Invalid::new(format!("classes[{i}]"), expected, class));
                    };
                    *place = rate;
                }
                Actions::OfTurns(rates, predictor.classes().len())
            }
        };
        Ok(Self { predictor, safety, actions })
    }
}

impl ActionModel for PredictedHuman<'_> {
    fn actions(&self) -> ActionSpace<'_> {
        ActionSpace::Levels(match &self.actions {
            Actions::Given(actions) => actions,
            Actions::OfTurns(rates, count) => &rates[..*count],
        })
    }

    fn probabilities(&self, history: &[JointState], out: &mut [f64]) {
        let features = self.predictor.features();
        let mut row = [0.0; MOST_FEATURES];
        let row = &mut row[..features.len()];
        features.compute_into(history, self.safety, row);
        self.predictor.probabilities_into(row, out);
    }
}

/// Settings for predicting and drawing sets.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct ShfrsSettings {
    /// Settings of Algorithm 1.
    pub bounds: BoundsSettings,
    /// Settings of the polygons.
    pub polygon: PolygonSettings,
    /// Whether to compute a polygon of the positions after each step, in addition to the tube.
    pub by_step: bool,
}

impl ShfrsSettings {
    /// Settings with these bounds and [`PolygonSettings::default`], for tubes only.
    #[must_use]
    pub fn new(bounds: BoundsSettings) -> Self {
        Self { bounds, polygon: PolygonSettings::default(), by_step: false }
    }

    /// The paper's settings (Figure 3, left): ε = 0, 0.15, 0.25, 0.4, 1.0 rad/s, and k = 2 in the
    /// first two of ten steps and k = 1 in the others. A predictor with a single action always has
    /// k = 1. Roll-outs are [`Rollout::Base`], which keeps regions nested when ε changes. Polygons
    /// are accurate to 1 mm. These values of ε suit a human whose maximum turn rate is 0.5 rad/s.
    /// For another maximum, [`in_proportion`](crate::bounds::in_proportion) scales them so that the
    /// last ε admits every turn.
    ///
    /// # Errors
    /// [`Invalid`] if there are no actions.
    pub fn paper(actions: usize) -> Result<Self, Invalid> {
        let k = (0..10).map(|i| if i < 2 { actions.min(2) } else { 1 }).collect();
        let epsilon = vec![0.0, 0.15, 0.25, 0.4, 1.0];
        let bounds = BoundsSettings::new(epsilon, ActionChoice::TopK(k), Rollout::Base, actions)?;
        // 1 mm is far below a pixel at any zoom level of a scene.
        Ok(Self { polygon: PolygonSettings::new(1e-3, 8)?, ..Self::new(bounds) })
    }

    /// Sets [`Self::bounds`], the settings of Algorithm 1.
    #[must_use]
    pub fn with_bounds(self, bounds: BoundsSettings) -> Self {
        Self { bounds, ..self }
    }

    /// Sets [`Self::polygon`], the settings of the polygons.
    #[must_use]
    pub fn with_polygon(self, polygon: PolygonSettings) -> Self {
        Self { polygon, ..self }
    }

    /// Sets [`Self::by_step`], whether to compute a polygon for each step in addition to the tube.
    #[must_use]
    pub fn with_by_step(self, by_step: bool) -> Self {
        Self { by_step, ..self }
    }
}

/// One of the nested sets F_1 ⊆ F_2 ⊆ …
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct NestedSet {
    /// The widening ε of the bounds (rad/s).
    pub epsilon: f64,
    /// The bounds on the human's turn rate.
    pub bounds: InputBounds,
    /// All positions that are reachable within the steps ahead, as a closed counter-clockwise
    /// polygon in the world frame (m).
    pub tube: Vec<[f64; 2]>,
    /// Whether the tube's polygon follows the set or is a convex polygon around it.
    pub tube_outline: Outline,
    /// Area of the tube (m²).
    pub area_m2: f64,
    /// One polygon per step, which contains the positions that are reachable after exactly that
    /// many steps, in the format of `tube`. Empty unless [`ShfrsSettings::by_step`] is set.
    pub steps: Vec<Vec<[f64; 2]>>,
    /// Like `tube_outline`, for each polygon of `steps`.
    pub step_outlines: Vec<Outline>,
}

impl NestedSet {
    /// An empty set. [`Self::take`] fills it and reuses its buffers.
    fn empty(bounds: InputBounds) -> Self {
        Self {
            epsilon: 0.0,
            bounds,
            tube: Vec::new(),
            tube_outline: Outline::Refined { margin_m: 0.0 },
            area_m2: 0.0,
            steps: Vec::new(),
            step_outlines: Vec::new(),
        }
    }

    /// Replaces this set by `reachable`, the reachable set under `bounds`. Calls `goes_on` before
    /// each polygon and stops if it returns `Break`.
    fn take(
        &mut self,
        epsilon: f64,
        bounds: &InputBounds,
        reachable: &ReachableSet,
        settings: &ShfrsSettings,
        workspace: &mut Workspace,
        goes_on: &mut dyn FnMut() -> ControlFlow<()>,
    ) -> ControlFlow<()> {
        self.epsilon = epsilon;
        self.bounds.clone_from(bounds);
        goes_on()?;
        self.tube_outline =
            reachable.tube_polygon_into(settings.polygon, workspace, &mut self.tube);
        self.area_m2 = signed_area(&self.tube);
        self.steps.resize_with(if settings.by_step { reachable.steps() } else { 0 }, Vec::new);
        self.step_outlines.clear();
        for (i, polygon) in self.steps.iter_mut().enumerate() {
            goes_on()?;
            let outline = reachable.step_polygon_into(i + 1, settings.polygon, workspace, polygon);
            self.step_outlines.push(outline);
        }
        ControlFlow::Continue(())
    }
}

/// Nested forward reachable sets of the human. Their probabilities are estimated from recorded
/// trajectories, not from a single prediction.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Shfrs {
    /// The sets, from the smallest to the largest.
    pub sets: Vec<NestedSet>,
}

/// Predicts sets frame by frame and reuses the buffers of the previous frame.
///
/// # Example
/// ```
/// use core::ops::ControlFlow;
/// use sidestep::features::FeatureSet;
/// use sidestep::predict::Predictor;
/// use sidestep::safety::SafetyLevels;
/// use sidestep::scene::{JointState, SceneParameters};
/// use sidestep::shfrs::{PredictedHuman, ShfrsPredictor, ShfrsSettings};
/// use sidestep::vehicle::Pose;
///
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// let parameters = SceneParameters::default();
/// let safety = SafetyLevels::solve(&parameters, &mut |_| ControlFlow::Continue(()))?;
/// // Usually a trained model. The classes are right, straight and left.
/// let predictor =
///     Predictor::constant(FeatureSet::subset("hrd")?, vec![-1, 0, 1], vec![0.6, 0.3, 0.1])?;
/// let human = PredictedHuman::new(&predictor, &safety, &parameters)?;
/// let now = JointState { human: Pose::new(1.0, 2.0, 0.5), robot: Pose::new(9.0, 2.0, 3.0) };
///
/// let mut online = ShfrsPredictor::default();
/// let shfrs = online.predict(&[now], &parameters, &human, &ShfrsSettings::paper(3)?)?;
/// let areas = shfrs.sets.iter().map(|set| set.area_m2); // of F_1 ⊆ F_2 ⊆ …
/// assert!(areas.is_sorted() && shfrs.sets.len() == 5);
/// # Ok(())
/// # }
/// ```
#[derive(Clone, Debug, Default)]
pub struct ShfrsPredictor {
    algorithm: Algorithm1,
    /// The reachable sets from which the polygons of `shfrs` are computed.
    reachable: Vec<ReachableSet>,
    /// The speed (m/s) and the time step (s) of `reachable`.
    made_for: Option<(f64, f64)>,
    workspace: Workspace,
    shfrs: Shfrs,
}

impl ShfrsPredictor {
    /// The sets of the latest predicted frame. Empty before the first frame and after a cancelled
    /// prediction.
    #[must_use]
    pub fn shfrs(&self) -> &Shfrs {
        &self.shfrs
    }

    /// Predicts the sets from the joint states up to now. Assumes that the robot drives straight
    /// ahead.
    ///
    /// # Errors
    /// The errors of [`Algorithm1::run`].
    pub fn predict(
        &mut self,
        history: &[JointState],
        parameters: &SceneParameters,
        model: &impl ActionModel,
        settings: &ShfrsSettings,
    ) -> Result<&Shfrs, Invalid> {
        let goes_on = &mut || ControlFlow::Continue(());
        let _ = self.run(history, parameters, model, settings, goes_on)?;
        Ok(&self.shfrs)
    }

    /// Like [`Self::predict`], but calls `goes_on` before each polygon. If it returns `Break`, the
    /// prediction is cancelled and the result is `None`.
    ///
    /// # Errors
    /// The errors of [`Self::predict`].
    pub fn predict_while(
        &mut self,
        history: &[JointState],
        parameters: &SceneParameters,
        model: &impl ActionModel,
        settings: &ShfrsSettings,
        goes_on: &mut dyn FnMut() -> ControlFlow<()>,
    ) -> Result<Option<&Shfrs>, Invalid> {
        if self.run(history, parameters, model, settings, goes_on)?.is_break() {
            self.shfrs.sets.clear();
            return Ok(None);
        }
        Ok(Some(&self.shfrs))
    }

    fn run(
        &mut self,
        history: &[JointState],
        parameters: &SceneParameters,
        model: &impl ActionModel,
        settings: &ShfrsSettings,
        goes_on: &mut dyn FnMut() -> ControlFlow<()>,
    ) -> Result<ControlFlow<()>, Invalid> {
        let motion = Motion::from(parameters);
        let straight_on = |_: &[JointState]| 0.0;
        let found = self.algorithm.run(history, &motion, model, straight_on, &settings.bounds)?;
        let start = found.low[0].human;
        let (speed, step) = (motion.human_speed_mps, motion.step_s);
        if self.made_for.replace((speed, step)) != Some((speed, step)) {
            self.reachable.clear();
        }
        let sets = &mut self.shfrs.sets;
        sets.truncate(found.sets.len());
        for (j, (bounds, &epsilon)) in found.sets.iter().zip(settings.bounds.epsilon()).enumerate()
        {
            match self.reachable.get_mut(j) {
                Some(reachable) => reachable.reset(start, bounds)?,
                None => self.reachable.push(ReachableSet::new(start, bounds, speed, step)?),
            }
            if j == sets.len() {
                sets.push(NestedSet::empty(bounds.clone()));
            }
            let (reachable, workspace) = (&self.reachable[j], &mut self.workspace);
            if sets[j].take(epsilon, bounds, reachable, settings, workspace, goes_on).is_break() {
                return Ok(ControlFlow::Break(()));
            }
        }
        Ok(ControlFlow::Continue(()))
    }
}

/// [`ShfrsPredictor::predict`] for a single frame.
///
/// # Errors
/// The errors of [`Algorithm1::run`].
pub fn predict(
    history: &[JointState],
    parameters: &SceneParameters,
    model: &impl ActionModel,
    settings: &ShfrsSettings,
) -> Result<Shfrs, Invalid> {
    let mut predictor = ShfrsPredictor::default();
    predictor.predict(history, parameters, model, settings)?;
    Ok(predictor.shfrs)
}

#[cfg(test)]
mod tests;
