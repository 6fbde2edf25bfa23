//! A participant's drives in a compact form, for the predictions and counts of the laboratory's
//! explorer.

use crate::invalid::Invalid;
use crate::scene::{JointState, Scene, SceneParameters};
use crate::shfrs::window::Trajectory;
use crate::trial_view::Recorded;
use crate::vehicle::{Pose, TurnInput};
use serde::{Deserialize, Serialize};

/// The input held in each step. In JSON, a string with one letter for each step: `L` (left), `S`
/// (straight) or `R` (right).
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
#[cfg_attr(feature = "openapi", derive(schemars::JsonSchema), schemars(with = "String"))]
pub struct Inputs(pub Vec<TurnInput>);

const LETTERS: [(char, TurnInput); 3] =
    [('L', TurnInput::Left), ('S', TurnInput::Straight), ('R', TurnInput::Right)];

impl From<Inputs> for String {
    fn from(Inputs(inputs): Inputs) -> Self {
        let letter = |input| LETTERS.iter().find(|(_, known)| *known == input);
        inputs.into_iter().filter_map(letter).map(|(letter, _)| letter).collect()
    }
}

impl TryFrom<String> for Inputs {
    type Error = Invalid;

    fn try_from(text: String) -> Result<Self, Invalid> {
        let input = |(step, letter)| {
            let known = LETTERS.iter().find(|(known, _)| *known == letter);
            known.map(|(_, input)| *input).ok_or_else(|| {
                Invalid::new(format!("inputs[{step}]"), "L, S or R", format!("{letter:?}"))
            })
        };
        text.chars().enumerate().map(input).collect::<Result<_, _>>().map(Self)
    }
}

/// The tasks of one participant that analyses use: one attempt at each scene.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(schemars::JsonSchema))]
pub struct Drives {
    /// The study's name in URLs.
    pub study: String,
    /// The participant's number within the study, from 1; pilots are numbered separately.
    pub number: i64,
    /// Whether this is a pilot.
    pub pilot: bool,
    /// Whether the participant's data were deleted.
    pub data_deleted: bool,
    /// Why an experimenter excluded the participant from analyses. Absent if not excluded.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub excluded: Option<String>,
    /// Whether the participant is a program and not a person; see
    /// [`ParticipantDetail`](super::ParticipantDetail).
    #[serde(default)]
    pub synthetic: bool,
    /// Vehicles, danger radius and clock of the tasks.
    pub parameters: SceneParameters,
    /// Id of the value function V_HR. Null while the server has none.
    pub value_function_hr: Option<String>,
    /// Id of the value function V_RH. Null while the server has none.
    pub value_function_rh: Option<String>,
    /// The tasks, in the order of the plan.
    pub tasks: Vec<Drive>,
}

/// One task.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "openapi", derive(schemars::JsonSchema))]
pub struct Drive {
    /// Id of the trial.
    pub trial_id: String,
    /// The scene in words, such as `task 3`.
    pub words: String,
    /// The scene that was driven.
    pub scene: Scene,
    /// The input held in each step.
    pub inputs: Inputs,
    /// States before each step and after the last step. Each state contains x (m), y (m) and
    /// heading (rad), first of the human and then of the robot.
    pub states: Vec<[f64; 6]>,
}

impl Drive {
    /// A task with these inputs and states.
    #[must_use]
    pub fn new(
        trial_id: String,
        words: String,
        scene: Scene,
        inputs: &[TurnInput],
        states: &[JointState],
    ) -> Self {
        let numbers = |JointState { human, robot }: &JointState| {
            [human.x, human.y, human.psi, robot.x, robot.y, robot.psi]
        };
        let (inputs, states) = (Inputs(inputs.to_vec()), states.iter().map(numbers).collect());
        Self { trial_id, words, scene, inputs, states }
    }

    /// The joint states before each step and after the last step.
    #[must_use]
    pub fn states(&self) -> Vec<JointState> {
        let state = |&[x, y, psi, a, b, c]: &[f64; 6]| JointState {
            human: Pose { x, y, psi },
            robot: Pose { x: a, y: b, psi: c },
        };
        self.states.iter().map(state).collect()
    }

    /// The drive as a recorded trial for playback.
    #[must_use]
    pub fn recorded(&self, parameters: SceneParameters) -> Recorded {
        Recorded {
            parameters,
            scene: self.scene.clone(),
            inputs: self.inputs.0.clone(),
            states: self.states(),
        }
    }

    /// The drive as a trajectory for predictions.
    ///
    /// # Errors
    /// The errors of [`Trajectory::driven`].
    pub fn trajectory(&self, parameters: &SceneParameters) -> Result<Trajectory, Invalid> {
        Trajectory::driven(self.states(), &self.inputs.0, parameters)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::trial::simulate;

    #[test]
    fn a_drive_holds_inputs_and_states_to_the_bit() {
        let parameters = SceneParameters::default();
        let scene = Scene::new(&parameters, Pose::new(-8.0, 0.1, 0.3), Pose::new(8.0, 1.0, 3.1));
        let inputs: Vec<TurnInput> = TurnInput::ALL.into_iter().cycle().take(50).collect();
        let states = simulate(&parameters, &scene, &inputs);
        let drive = Drive::new("t".into(), "task 1".into(), scene, &inputs, &states);
        let text = serde_json::to_string(&drive).unwrap();
        let read: Drive = serde_json::from_str(&text).unwrap();
        let Recorded { inputs: read_inputs, states: read_states, .. } = read.recorded(parameters);
        assert_eq!((read_inputs, read_states), (inputs.clone(), states.clone()));
        let trajectory = read.trajectory(&parameters).unwrap();
        assert_eq!((trajectory.steps(), trajectory.states()), (50, &states[..]));
        assert_eq!(
            trajectory.turn_rates()[..3],
            inputs[..3].iter().map(|&i| parameters.human.turn_rate(i)).collect::<Vec<_>>()
        );
    }
}
