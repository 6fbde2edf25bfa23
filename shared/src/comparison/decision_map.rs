//! Maps of the probability of a turn for each position of the robot.

use super::cell::{Cell, Experiment};
use super::models::ModelName;
use super::tables::Comparison;
use crate::invalid::Invalid;
use crate::math::{PI, sin_cos};
use crate::parallel::parallel_map;
use crate::predict::Predictor;
use crate::reachability::CurveSettings;
use crate::safety::SafetyLevels;
use crate::scene::{Evader, JointState};
use crate::vehicle::Pose;

/// The models' probability of a turn for each position of the robot around the human. Positions are
/// [ahead, left] in the human's body frame, with the human at the origin.
#[derive(Clone, Debug, PartialEq)]
pub struct DecisionMap {
    /// The name of the models' feature set.
    pub features: &'static str,
    /// The robot's heading relative to the human's heading (rad, counter-clockwise).
    pub heading: f64,
    /// Name of the encounter with this heading.
    pub encounter: &'static str,
    /// Mean probability of a turn in each of [`Self::SIDE`] × [`Self::SIDE`] cells. Rows go from
    /// behind to ahead, and the cells of a row go from right to left. The mean is over participants
    /// and over eight world headings of the human, because the paper's features depend on this
    /// heading.
    pub probabilities: Vec<f64>,
    /// The level set {V_HR = 0} as closed curves of [ahead, left] (m). Inside the curves, the robot
    /// could force a collision.
    pub boundary: Vec<Vec<[f64; 2]>>,
}

/// The model whose decisions are mapped.
const MAPPED_MODEL: ModelName = ModelName::Svm;
/// The experiment of the mapped model.
const MAPPED_EXPERIMENT: Experiment = Experiment::Avoidance;

const SETS: [&str; 2] = ["hrd", "d"];
const ENCOUNTERS: [(f64, &str); 2] = [(PI, "head-on"), (0.5 * PI, "crossing from the right")];

/// The human's headings in the world (rad). A rotation by π does not change the paper's features,
/// so these four headings represent all eight.
const WORLD_HEADINGS: [f64; 4] = [0.0, 0.25 * PI, 0.5 * PI, 0.75 * PI];

impl DecisionMap {
    /// Number of cells along each side.
    pub const SIDE: usize = 32;
    /// Side of a cell (m).
    pub const CELL_M: f64 = 0.75;
    /// Coordinate of the rear edge of the first row (m, positive ahead of the human).
    pub const BEHIND_M: f64 = -8.0;
    /// Coordinate of the right edge of the first column (m, positive to the human's left).
    pub const RIGHT_M: f64 = -12.0;

    /// The centre of a cell: [ahead, left] (m).
    #[must_use]
    pub fn middle(cell: usize) -> [f64; 2] {
        let (row, column) = (cell / Self::SIDE, cell % Self::SIDE);
        let along = |begin: f64, i: usize| begin + Self::CELL_M * (i as f64 + 0.5);
        [along(Self::BEHIND_M, row), along(Self::RIGHT_M, column)]
    }
}

/// A map for each feature set and encounter.
///
/// # Errors
/// Never, because the comparison's predictors and headings are valid.
pub(super) fn decision_maps(
    comparison: &Comparison,
    safety: &SafetyLevels,
) -> Result<Vec<DecisionMap>, Invalid> {
    let mut maps = Vec::new();
    for features in SETS {
        for (heading, encounter) in ENCOUNTERS {
            let probabilities = probabilities(comparison, features, heading, safety)?;
            let curve = CurveSettings::default();
            let boundary = safety.of(Evader::Human).level_curves(heading, 0.0, curve)?;
            maps.push(DecisionMap { features, heading, encounter, probabilities, boundary });
        }
    }
    Ok(maps)
}

/// The probabilities in the cells of a map. Empty if there is no model on these features.
fn probabilities(
    comparison: &Comparison,
    features: &str,
    heading: f64,
    safety: &SafetyLevels,
) -> Result<Vec<f64>, Invalid> {
    let cells = comparison.of(MAPPED_MODEL, MAPPED_EXPERIMENT, features);
    let predictor = |cell: &Cell| Predictor::try_from(cell.predictor.clone());
    let predictors: Vec<Predictor> = cells.map(predictor).collect::<Result<_, _>>()?;
    if predictors.is_empty() {
        return Ok(Vec::new());
    }
    let turns = |predictor: &Predictor, state: JointState| {
        let mut row = vec![0.0; predictor.features().len()];
        predictor.features().compute_into(&[state], safety, &mut row);
        let mut p = vec![0.0; predictor.classes().len()];
        predictor.probabilities_into(&row, &mut p);
        let pairs = predictor.classes().iter().zip(p);
        pairs.filter(|(class, _)| **class != 0).map(|(_, p)| p).sum::<f64>()
    };
    let mean = |&cell: &usize| {
        let states = WORLD_HEADINGS.map(|world| state(DecisionMap::middle(cell), heading, world));
        let each = predictors.iter().flat_map(|of| states.map(|state| turns(of, state)));
        Ok(each.sum::<f64>() / (predictors.len() * states.len()) as f64)
    };
    // The sum of each cell has a fixed order, so the number of threads does not change the result.
    let cells: Vec<usize> = (0..DecisionMap::SIDE * DecisionMap::SIDE).collect();
    parallel_map(&cells, mean)
}

/// The human at the origin, heading along `world`, and the robot at [ahead, left] of the human.
fn state([ahead, left]: [f64; 2], heading: f64, world: f64) -> JointState {
    let (sin, cos) = sin_cos(world);
    let robot = Pose::new(ahead * cos - left * sin, ahead * sin + left * cos, world + heading);
    JointState { human: Pose::new(0.0, 0.0, world), robot }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_robot_is_where_the_human_sees_it() {
        for world in WORLD_HEADINGS {
            let seen = state([3.0, -2.0], 0.5 * PI, world).robot_seen_by_human();
            for (found, expected) in seen.into_iter().zip([3.0, -2.0, 0.5 * PI]) {
                assert!((found - expected).abs() < 1e-12, "{seen:?}");
            }
        }
        assert_eq!(DecisionMap::middle(0), [-7.625, -11.625]);
        assert_eq!(DecisionMap::middle(DecisionMap::SIDE + 1), [-6.875, -10.875]);
        let last = DecisionMap::middle(DecisionMap::SIDE * DecisionMap::SIDE - 1);
        assert_eq!(last, [15.625, 11.625]);
    }
}
