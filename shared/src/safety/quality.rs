//! How well safety levels distinguish states, and whether they have converged.

use super::SafetyLevels;
use crate::reachability::{PursuitGame, QUANTUM_M, ValueFunction};
use crate::scene::Evader;
use serde::{Deserialize, Serialize};

/// The accuracy (m) of a level that was solved on a grid, for a radius of about 3 m. The 99th
/// percentile of the polar solver's error in the paper's game is 1.7 cm
/// (docs/validation/reachability.md).
const GRID_ACCURACY_M: f64 = 0.02;

/// The convergence of a safety level, and its spread over the compared steps.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(schemars::JsonSchema))]
pub struct LevelQuality {
    /// Whether the value function converged; true for a closed form.
    pub converged: bool,
    /// The change in the last 16 sweeps (m), averaged over the grid's rows, if the function did not
    /// converge. Its error may be several hundred times as large.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub last_change_m: Option<f64>,
    /// Standard deviation of the level over the steps (m).
    pub spread_m: f64,
    /// The accuracy of the level (m), valid if it converged.
    pub accuracy_m: f64,
}

impl LevelQuality {
    /// The quality of a level. `levels` are the values of `function` in the steps (m).
    #[must_use]
    pub fn of(function: &ValueFunction, levels: &[f64]) -> Self {
        // A closed form is exact, but differences below the quantum of stored values are ignored.
        let accuracy = match function {
            ValueFunction::Exact(_) => QUANTUM_M,
            ValueFunction::Sampled(_) => GRID_ACCURACY_M,
        };
        // Sorting makes the sums bit-identical for every order of the participants.
        let mut levels = levels.to_vec();
        levels.sort_by(f64::total_cmp);
        let count = levels.len().max(1) as f64;
        let mean = levels.iter().sum::<f64>() / count;
        let square = levels.iter().map(|level| (level - mean) * (level - mean)).sum::<f64>();
        let last_change_m = function.unsettled_m();
        Self {
            converged: last_change_m.is_none(),
            last_change_m,
            spread_m: (square / count).sqrt(),
            accuracy_m: accuracy * function.game().length_unit_m(),
        }
    }

    /// Whether the level varies between steps by less than its accuracy. Models standardise the
    /// level, which would enlarge its errors to the size of any other feature.
    #[must_use]
    pub fn is_nearly_constant(&self) -> bool {
        self.spread_m < self.accuracy_m
    }

    /// Whether it is sound to draw conclusions from models that use the level.
    #[must_use]
    pub fn is_sound(&self) -> bool {
        self.converged && !self.is_nearly_constant()
    }
}

/// The quality of both levels.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(schemars::JsonSchema))]
pub struct SafetyQuality {
    /// V_HR: the human evades.
    pub v_hr: LevelQuality,
    /// V_RH: the robot evades.
    pub v_rh: LevelQuality,
}

impl SafetyQuality {
    /// The quality of the levels from `safety`. `human` and `robot` are V_HR and V_RH in the steps
    /// (m).
    #[must_use]
    pub fn of(safety: &SafetyLevels, [human, robot]: [&[f64]; 2]) -> Self {
        Self {
            v_hr: LevelQuality::of(&safety.human, human),
            v_rh: LevelQuality::of(&safety.robot, robot),
        }
    }

    /// The quality of the level of `evader`.
    #[must_use]
    pub fn level(&self, evader: Evader) -> &LevelQuality {
        match evader {
            Evader::Human => &self.v_hr,
            Evader::Robot => &self.v_rh,
        }
    }
}

impl SafetyLevels {
    /// A warning for each value function that did not converge, with its game and the consequences.
    #[must_use]
    pub fn complaints(&self) -> Vec<String> {
        let complaint = |evader: Evader| {
            let function = self.of(evader);
            let moved = function.unsettled_m()?;
            let PursuitGame { evader: flees, pursuer: chases, .. } = function.game();
            let (name, who, other) = match evader {
                Evader::Human => ("V_HR", "human", "robot"),
                Evader::Robot => ("V_RH", "robot", "human"),
            };
            let chase = if chases.speed_mps > flees.speed_mps {
                ". This is expected when the pursuer is faster: it can always try again, so the \
                 true level is low almost everywhere"
            } else {
                ""
            };
            Some(format!(
                "{name} did not converge (the {who} evades with {} m/s and {} rad/s, the {other} \
                 pursues with {} m/s and {} rad/s): it still moved by {moved:.1e} m in the last 16 \
                 sweeps and may be too high by decimetres{chase}. Differences between its values \
                 come partly from the solver: draw no conclusions from features and sets that use it",
                flees.speed_mps, flees.turn_rate_radps, chases.speed_mps, chases.turn_rate_radps,
            ))
        };
        Evader::ALL.into_iter().filter_map(complaint).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::reachability::{Solved, polar, solve};
    use crate::scene::SceneParameters;
    use crate::vehicle::VehicleModel;
    use core::ops::ControlFlow;

    fn equal() -> SafetyLevels {
        SafetyLevels::solve(&SceneParameters::default(), &mut |_| ControlFlow::Continue(()))
            .unwrap()
    }

    /// Safety levels whose V_RH has not converged, because its solve was stopped after a few sweeps
    /// over a small grid. The robot is slower than the human and turns faster.
    fn broken_off() -> SafetyLevels {
        let game = PursuitGame {
            evader: VehicleModel { speed_mps: 1.5, turn_rate_radps: 0.8 },
            pursuer: VehicleModel { speed_mps: 2.0, turn_rate_radps: 0.5 },
            radius_m: 3.0,
        };
        let settings = polar::Settings {
            range_nodes: 33,
            angle_nodes: 48,
            most_sweeps: 32,
            ..polar::Settings::default()
        };
        let solution =
            polar::solve::<f32>(&game, &settings, &mut |_| ControlFlow::Continue(())).unwrap();
        assert!(!solution.converged);
        let sampled = crate::reachability::SampledValue::from_polar(game, &solution).unwrap();
        SafetyLevels { robot: ValueFunction::Sampled(sampled.into()), ..equal() }
    }

    #[test]
    fn a_level_that_differs_is_sound() {
        let quality = SafetyQuality::of(&equal(), [&[1.0, 3.0], &[1.0, 1.0005]]);
        assert_eq!((quality.v_hr.spread_m, quality.v_hr.converged), (1.0, true));
        assert!(quality.level(Evader::Human).is_sound());
        let robot = quality.level(Evader::Robot);
        assert!(robot.converged && robot.is_nearly_constant() && !robot.is_sound());
        assert!(equal().complaints().is_empty());
    }

    #[test]
    fn a_grid_is_not_as_accurate() {
        let mut parameters = SceneParameters::default();
        parameters.robot.turn_rate_radps = 0.35;
        let options = crate::reachability::Options {
            accuracy: crate::reachability::Accuracy::Draft,
            ..Default::default()
        };
        let game = parameters.game(Evader::Human);
        let Solved { function, converged, .. } =
            solve(game, &options, &mut |_| ControlFlow::Continue(())).unwrap();
        assert_eq!(converged, Some(true));
        let by = |metres: f64| LevelQuality::of(&function, &[-metres, metres]);
        assert!(by(0.019).is_nearly_constant() && by(0.021).is_sound());
        assert_eq!(by(1.0).last_change_m, None);
    }

    #[test]
    fn what_did_not_converge_is_named() {
        let safety = broken_off();
        let quality = SafetyQuality::of(&safety, [&[-1.0, 1.0]; 2]);
        assert!(quality.v_hr.is_sound() && !quality.v_rh.is_sound());
        assert!(!quality.v_rh.is_nearly_constant() && quality.v_rh.last_change_m > Some(1e-3));
        let complaints = safety.complaints();
        assert_eq!(complaints.len(), 1);
        for part in [
            "V_RH did not converge",
            "the robot evades with 1.5 m/s and 0.8 rad/s",
            "the human pursues with 2 m/s and 0.5 rad/s",
            "draw no conclusions",
        ] {
            assert!(complaints[0].contains(part), "{part}: {complaints:?}");
        }
    }
}
