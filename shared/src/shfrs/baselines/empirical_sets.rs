//! Polygons of the sets of a family learned from recorded futures, placed at the human's pose. They
//! serve to draw a single moment.

use super::swept::swept;
use super::{Gaussian, LearnedFamily, Mode, Nominal, PerModeEmpirical};
use crate::bounds::{ActionModel, ActionSpace};
use crate::invalid::Invalid;
use crate::math::sin_cos;
use crate::reach::{PolygonSettings, ReachableSet};
use crate::scene::{JointState, SceneParameters};
use crate::shfrs::widened::widened;
use crate::shfrs::window::{Trajectory, Window, WindowChoice};
use crate::vehicle::{Pose, TurnInput};
use serde::{Deserialize, Serialize};

/// The families learned only from recorded futures, without a model of the human.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(schemars::JsonSchema))]
#[serde(rename_all = "lowercase")]
#[non_exhaustive]
pub enum EmpiricalFamily {
    /// Convex hulls of recorded futures, grouped by the held input.
    Empirical,
    /// Normal distributions of the future pose around a drive with the held input.
    Gaussian,
}

impl EmpiricalFamily {
    /// The name of the family in URLs.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Empirical => "empirical",
            Self::Gaussian => "gaussian",
        }
    }
}

/// Nested sets of a learned family, at the learned levels. They depend only on the human's pose and
/// on the input of the last step.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(schemars::JsonSchema))]
pub struct EmpiricalSets {
    /// The family.
    family: EmpiricalFamily,
    /// Number of steps ahead.
    steps: usize,
    /// The sets in the human's frame if the last step turned right, from the smallest to the
    /// largest.
    right: Vec<EmpiricalSet>,
    /// The sets if the last step was straight, or there was no last step.
    straight: Vec<EmpiricalSet>,
    /// The sets if the last step turned left.
    left: Vec<EmpiricalSet>,
    /// The sets as placed by the latest call of [`Self::place`].
    #[serde(skip)]
    placed: Vec<EmpiricalSet>,
}

/// One of the nested sets.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(schemars::JsonSchema))]
pub struct EmpiricalSet {
    /// The family's level.
    pub level: f64,
    /// Area (m²) of all positions within the steps ahead.
    pub area_m2: f64,
    /// Closed counter-clockwise polygons (m). Their union is the set of all positions within the
    /// steps ahead. If nothing was recorded, the set is empty, and so is each polygon.
    pub tube: Vec<Vec<[f64; 2]>>,
    /// The positions after each step, one polygon per step.
    pub steps: Vec<Vec<[f64; 2]>>,
}

/// A learned family, and its sets at the learned levels.
pub struct Fitted {
    family: Box<dyn LearnedFamily + Send>,
    /// The sets.
    pub sets: EmpiricalSets,
}

/// Shares of the training windows that the sets contain. An additional set contains everything.
const SHARES: [f64; 4] = [0.5, 0.75, 0.9, 0.95];

/// A model type that has no values, for modes that need no model.
enum Nobody {}

impl ActionModel for Nobody {
    fn actions(&self) -> ActionSpace<'_> {
        match *self {}
    }

    fn probabilities(&self, _: &[JointState], _: &mut [f64]) {
        match *self {}
    }
}

impl Fitted {
    /// Learns from every window of `steps` ≥ 1 steps of `trajectories`. The learned levels are the
    /// least levels whose sets contain 50, 75, 90 and 95 % of these windows, and the level of the
    /// worst-case set.
    ///
    /// # Errors
    /// [`Invalid`] if there are too few windows.
    pub fn learn(
        family: EmpiricalFamily,
        parameters: &SceneParameters,
        trajectories: &[Trajectory],
        steps: usize,
    ) -> Result<Self, Invalid> {
        let windows = WindowChoice::EveryStep.windows(trajectories, steps).concat();
        if windows.is_empty() {
            let expected = format!("at least one of {steps} steps or more, to learn from");
            return Err(Invalid::new("earlier trials", expected, "none"));
        }
        let mut fitted: Box<dyn LearnedFamily + Send> = match family {
            EmpiricalFamily::Empirical => {
                Box::new(PerModeEmpirical::learn(Mode::<Nobody>::Held, parameters, &windows)?)
            }
            EmpiricalFamily::Gaussian => {
                Box::new(Gaussian::learn(Nominal::Held, parameters, &windows)?)
            }
        };
        let mut scores = windows
            .iter()
            .map(|window| fitted.least_level(window))
            .collect::<Result<Vec<_>, _>>()?;
        scores.sort_by(f64::total_cmp);
        let level = |share: f64| scores[((share * scores.len() as f64).ceil() as usize).max(1) - 1];
        let levels: Vec<f64> = SHARES.into_iter().map(level).chain([fitted.most()]).collect();
        let worst = worst_case(parameters, steps, fitted.most())?;
        let mut of = |held| {
            let drive = after_a_step(held, parameters, steps)?;
            shapes(fitted.as_mut(), &drive, &levels, &worst)
        };
        let sets = EmpiricalSets {
            family,
            steps,
            right: of(TurnInput::Right)?,
            straight: of(TurnInput::Straight)?,
            left: of(TurnInput::Left)?,
            placed: Vec::new(),
        };
        Ok(Self { family: fitted, sets })
    }

    /// For each window of each trajectory (from every step), the index, from 0, of the smallest set
    /// that contains the window's future. The result is the input of
    /// [`probabilities`](crate::shfrs::probability::probabilities).
    ///
    /// # Errors
    /// [`Invalid`] if the family cannot score a window.
    pub fn smallest_holding(
        &self,
        trajectories: &[Trajectory],
    ) -> Result<Vec<Vec<usize>>, Invalid> {
        let EmpiricalSets { straight: levels, steps, .. } = &self.sets;
        let smallest = |window: &Window<'_>| {
            let score = self.family.least_level(window)?;
            let place = levels.iter().position(|set| score <= set.level);
            Ok(place.unwrap_or(levels.len() - 1))
        };
        let windows = WindowChoice::EveryStep.windows(trajectories, *steps);
        windows.iter().map(|windows| windows.iter().map(smallest).collect()).collect()
    }
}

impl EmpiricalSets {
    /// The family.
    #[must_use]
    pub fn family(&self) -> EmpiricalFamily {
        self.family
    }

    /// Number of steps ahead.
    #[must_use]
    pub fn steps(&self) -> usize {
        self.steps
    }

    /// Number of sets.
    #[must_use]
    pub fn count(&self) -> usize {
        self.straight.len()
    }

    /// The sets as placed by the latest call of [`Self::place`], from the smallest to the largest.
    /// Empty before the first call.
    #[must_use]
    pub fn sets(&self) -> &[EmpiricalSet] {
        &self.placed
    }

    /// Moves the sets to a human at this pose whose last step had this input.
    pub fn place(&mut self, human: Pose, held: TurnInput) {
        let (sin, cos) = sin_cos(human.psi);
        let place = |[x, y]: [f64; 2]| [human.x + cos * x - sin * y, human.y + sin * x + cos * y];
        let all = |from: &[Vec<[f64; 2]>], to: &mut Vec<Vec<[f64; 2]>>| {
            to.resize_with(from.len(), Vec::new);
            for (from, to) in from.iter().zip(to) {
                to.clear();
                to.extend(from.iter().map(|&position| place(position)));
            }
        };
        let shapes = match held {
            TurnInput::Right => &self.right,
            TurnInput::Straight => &self.straight,
            TurnInput::Left => &self.left,
        };
        self.placed.resize_with(shapes.len(), EmpiricalSet::default);
        for (shape, placed) in shapes.iter().zip(&mut self.placed) {
            (placed.level, placed.area_m2) = (shape.level, shape.area_m2);
            all(&shape.tube, &mut placed.tube);
            all(&shape.steps, &mut placed.steps);
        }
    }
}

/// A drive whose first step has the input `held`. This step is the history of the window that
/// starts at step 1.
fn after_a_step(
    held: TurnInput,
    parameters: &SceneParameters,
    steps: usize,
) -> Result<Trajectory, Invalid> {
    let here = Pose::new(0.0, 0.0, 0.0);
    let mut inputs = vec![TurnInput::Straight; steps + 1];
    inputs[0] = held;
    let states = vec![JointState { human: here, robot: here }; steps + 2];
    Trajectory::driven(states, &inputs, parameters)
}

/// The sets at these levels for the window of `drive` from step 1 on, in the human's frame.
fn shapes(
    family: &mut dyn LearnedFamily,
    drive: &Trajectory,
    levels: &[f64],
    worst: &EmpiricalSet,
) -> Result<Vec<EmpiricalSet>, Invalid> {
    let windows = Window::new(drive, 1, worst.steps.len()).into_iter();
    let each = windows.flat_map(|window| levels.iter().map(move |&level| (window, level)));
    let shape = |(window, level): (Window<'_>, f64)| {
        let area_m2 = family.area_m2(&window, level)?;
        let Some(steps) = family.step_sets(&window, level) else {
            return Ok(EmpiricalSet { level, area_m2, ..worst.clone() });
        };
        // Without recordings, the set is empty, and does not even contain the current position.
        let is_empty = steps.iter().all(Vec::is_empty);
        let tube = if is_empty { steps.clone() } else { swept(&steps) };
        Ok(EmpiricalSet { level, area_m2, tube, steps })
    };
    each.map(shape).collect()
}

/// All positions that a human at the origin can reach. The caller sets the area.
fn worst_case(
    parameters: &SceneParameters,
    steps: usize,
    level: f64,
) -> Result<EmpiricalSet, Invalid> {
    let SceneParameters { human, step_s, .. } = *parameters;
    let range = human.turn_range();
    let bounds = widened(&vec![range; steps], 0.0, range)?;
    let here = Pose::new(0.0, 0.0, 0.0);
    let reachable = ReachableSet::new(here, &bounds, human.speed_mps, step_s)?;
    // The same polygon settings as `ShfrsSettings::paper`.
    let settings = PolygonSettings::new(1e-3, 8)?;
    let steps = (1..=steps).map(|step| reachable.step_polygon(step, settings)).collect();
    let tube = vec![reachable.tube_polygon(settings)];
    Ok(EmpiricalSet { level, area_m2: 0.0, tube, steps })
}

#[cfg(test)]
mod tests;
