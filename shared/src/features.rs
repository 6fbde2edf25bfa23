//! The inputs of predictors: features of the joint states so far (`features/table.rs` defines all
//! of them), and ordered sets of features.

mod table;

pub use table::{Compute, FEATURES, Feature};

use crate::invalid::Invalid;
use crate::reachability::{Progress, SolveError};
use crate::safety::SafetyLevels;
use crate::scene::{Evader, JointState, SceneParameters};
use core::ops::ControlFlow;
use serde::{Deserialize, Serialize};

/// The human's past turns. A model with these features has memory, so in a roll-out it can predict
/// that a key is held and later released.
const HISTORY: [&str; 3] = ["turned_1", "turned_2", "turned_5"];

/// The name of the largest set: both safety levels, distance, the body frame and the human's past
/// turns.
pub const HISTORY_SET: &str = "hrd_body_history";

/// An ordered set of features.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(try_from = "Vec<String>", into = "Vec<String>")]
pub struct FeatureSet(Vec<usize>);

impl FeatureSet {
    /// The paper's sets: the base features B, and the safety levels and the distance that the
    /// letters select (`hrd`, `hr`, `hd`, `rd`, `h`, `r`, `d`). The empty string selects B alone.
    ///
    /// # Errors
    /// [`Invalid`] for any other letter, a repeated letter or letters in another order.
    pub fn subset(letters: &str) -> Result<Self, Invalid> {
        let base = ["abs_dx", "abs_dy", "dpsi", "cos_dpsi", "sin_dpsi"];
        let mut names: Vec<&str> = base.to_vec();
        let mut rest = letters;
        for (letter, name) in [('h', "v_h"), ('r', "v_r"), ('d', "distance")] {
            if let Some(after) = rest.strip_prefix(letter) {
                names.push(name);
                rest = after;
            }
        }
        if !rest.is_empty() {
            return Err(Invalid::new(
                "features",
                "some of the letters h, r, d in this order",
                letters,
            ));
        }
        Self::of(&names)
    }

    /// Features by name, in the given order.
    ///
    /// # Errors
    /// [`Invalid`] for an empty list, an unknown name or a repeated name.
    pub fn of<S: AsRef<str>>(names: &[S]) -> Result<Self, Invalid> {
        if names.is_empty() {
            return Err(Invalid::new("features", "at least one feature", "none"));
        }
        let mut chosen = Vec::with_capacity(names.len());
        for (i, name) in names.iter().enumerate() {
            let name = name.as_ref();
            let known = || {
                let names: Vec<_> = FEATURES.iter().map(|feature| feature.name).collect();
                format!("one of {}", names.join(", "))
            };
            let index = FEATURES
                .iter()
                .position(|feature| feature.name == name)
                .ok_or_else(|| Invalid::new(format!("features[{i}]"), known(), name))?;
            if chosen.contains(&index) {
                return Err(Invalid::new(format!("features[{i}]"), "each feature once", name));
            }
            chosen.push(index);
        }
        Ok(Self(chosen))
    }

    /// The set [`HISTORY_SET`].
    ///
    /// # Errors
    /// Never, because the table has these names.
    pub fn with_history() -> Result<Self, Invalid> {
        let mut names: Vec<String> = Self::subset("hrd")?.into();
        names.extend(["robot_ahead", "robot_left"].iter().chain(&HISTORY).map(|&n| n.to_owned()));
        Self::of(&names)
    }

    /// The empty set, for a predictor that uses no features.
    #[must_use]
    pub fn none() -> Self {
        Self(Vec::new())
    }

    /// All features, in table order.
    #[must_use]
    pub fn all() -> Self {
        Self((0..FEATURES.len()).collect())
    }

    /// The table entries of this set's features.
    pub fn features(&self) -> impl ExactSizeIterator<Item = &'static Feature> {
        self.0.iter().map(|&index| &FEATURES[index])
    }

    /// The first feature that depends on the game, if any.
    pub fn of_game(&self) -> Option<&'static Feature> {
        self.features().find(|feature| matches!(feature.compute, Compute::FromGame(_)))
    }

    /// The safety levels that these features need. If a feature depends on the game, they are the
    /// safety levels of `parameters`. Otherwise, no feature uses safety levels. The result is then
    /// the levels of two identical vehicles, which need no numerical solve.
    ///
    /// # Errors
    /// The errors of [`SafetyLevels::solve`].
    pub fn safety(
        &self,
        parameters: &SceneParameters,
        progress: &mut dyn FnMut(Progress) -> ControlFlow<()>,
    ) -> Result<SafetyLevels, SolveError> {
        if self.of_game().is_some() {
            return SafetyLevels::solve(parameters, progress);
        }
        SafetyLevels::solve(&SceneParameters { human: parameters.robot, ..*parameters }, progress)
    }

    /// Writes the features to `row`, which must have the length of the set. `history` contains the
    /// joint states from the start of the trial to the current one, one per step. It must not be
    /// empty.
    pub fn compute_into(&self, history: &[JointState], safety: &SafetyLevels, row: &mut [f64]) {
        for (feature, value) in self.features().zip(row) {
            *value = feature.value(history, safety);
        }
    }

    /// Like [`Self::compute_into`], but uses the row of the previous state, if there is one.
    /// Features that look back to the start of the trial then cost no more than other features.
    pub fn compute_after(
        &self,
        before: Option<&[f64]>,
        history: &[JointState],
        safety: &SafetyLevels,
        row: &mut [f64],
    ) {
        let Some(before) = before else { return self.compute_into(history, safety, row) };
        for ((feature, value), &before) in self.features().zip(row).zip(before) {
            *value = if feature.name == "turned" {
                before + table::last_turn(history)
            } else {
                feature.value(history, safety)
            };
        }
    }

    /// Whether a feature is the safety level of `evader` or a component of its gradient.
    #[must_use]
    pub fn has_level(&self, evader: Evader) -> bool {
        let (level, slopes) = match evader {
            Evader::Human => ("v_h", "dv_h_"),
            Evader::Robot => ("v_r", "dv_r_"),
        };
        self.features().any(|of| of.name == level || of.name.starts_with(slopes))
    }

    /// The number of states that the features need, including the current state. Earlier states of
    /// a longer history do not matter. `None` if a feature looks back to the start of the drive.
    #[must_use]
    pub fn states_needed(&self) -> Option<usize> {
        let needed = |of: &Feature| match of.name {
            "turned_1" => Some(2),
            "turned_2" => Some(3),
            "turned_5" => Some(6),
            "turned" => None,
            _ => Some(1),
        };
        self.features().map(needed).try_fold(1, |most, of| Some(most.max(of?)))
    }

    /// The number of features.
    #[must_use]
    pub fn len(&self) -> usize {
        self.0.len()
    }

    /// Whether the set is empty.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }
}

impl From<FeatureSet> for Vec<String> {
    fn from(set: FeatureSet) -> Self {
        set.features().map(|feature| feature.name.to_owned()).collect()
    }
}

impl TryFrom<Vec<String>> for FeatureSet {
    type Error = Invalid;

    fn try_from(names: Vec<String>) -> Result<Self, Invalid> {
        Self::of(&names)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::vehicle::{Pose, TurnInput};

    #[test]
    fn the_papers_sets() {
        let names = |letters| Vec::<String>::from(FeatureSet::subset(letters).unwrap());
        assert_eq!(names("hrd")[5..], ["v_h", "v_r", "distance"]);
        assert_eq!(names("rd")[5..], ["v_r", "distance"]);
        assert_eq!(names("").len(), 5);
        assert!(FeatureSet::subset("dh").is_err());
        assert!(FeatureSet::subset("hh").is_err());
    }

    #[test]
    fn a_row_follows_from_the_one_before() {
        let parameters = SceneParameters::default();
        let progress = &mut |_| ControlFlow::Continue(());
        let safety = SafetyLevels::solve(&parameters, progress).unwrap();
        let mut rng = crate::math::SeededRng::new(7);
        let start = JointState { human: Pose::new(0.0, 0.0, 2.9), robot: Pose::new(9.0, 1.0, 3.0) };
        let mut history = vec![start];
        let set = FeatureSet::all();
        let [mut before, mut row, mut whole] = [(); 3].map(|()| vec![0.0; set.len()]);
        set.compute_after(None, &history, &safety, &mut before);
        for _ in 0..300 {
            let input = TurnInput::ALL[rng.below(3)];
            let now = history[history.len() - 1].advance(&parameters, input, 0.0, 0.7);
            history.push(now);
            set.compute_after(Some(&before), &history, &safety, &mut row);
            set.compute_into(&history, &safety, &mut whole);
            assert_eq!(row, whole);
            before.clone_from(&row);
        }
    }

    #[test]
    fn which_sets_have_which_level() {
        let [human, robot] = Evader::ALL;
        let of = |set: &FeatureSet| [set.has_level(human), set.has_level(robot)];
        let papers = ["hrd", "hr", "hd", "rd", "h", "r", "d"];
        for letters in papers {
            let set = FeatureSet::subset(letters).unwrap();
            assert_eq!(of(&set), [letters.contains('h'), letters.contains('r')], "{letters}");
        }
        assert_eq!(of(&FeatureSet::of(&["dv_r_turn"]).unwrap()), [false, true]);
        assert_eq!(of(&FeatureSet::all()), [true; 2]);
    }

    /// A feature is of an evader's level if and only if its values change with that value function.
    /// The other value function has the same speeds and other turn rates.
    #[test]
    fn a_feature_is_of_the_level_that_it_computes_with() {
        let parameters = SceneParameters::default();
        let mut slower = parameters;
        slower.human.turn_rate_radps = 0.6;
        slower.robot.turn_rate_radps = 0.6;
        let solve = |parameters: &SceneParameters| {
            SafetyLevels::solve(parameters, &mut |_| ControlFlow::Continue(())).unwrap()
        };
        let (usual, other) = (solve(&parameters), solve(&slower));
        let mut rng = crate::math::SeededRng::new(3);
        let mut pose =
            || Pose::new(rng.uniform(-6.0, 6.0), rng.uniform(-6.0, 6.0), rng.uniform(-3.1, 3.1));
        let states: Vec<_> =
            (0..200).map(|_| JointState { human: pose(), robot: pose() }).collect();
        for feature in FEATURES {
            let set = FeatureSet::of(&[feature.name]).unwrap();
            for evader in Evader::ALL {
                let mut mixed = usual.clone();
                match evader {
                    Evader::Human => mixed.human = other.human.clone(),
                    Evader::Robot => mixed.robot = other.robot.clone(),
                }
                let changes = |state: &JointState| {
                    feature.value(&[*state], &usual) != feature.value(&[*state], &mixed)
                };
                let found = states.iter().any(changes);
                assert_eq!(found, set.has_level(evader), "{}: has_level({evader:?})", feature.name);
            }
        }
    }

    /// A value that is not finite would exclude a participant.
    #[test]
    fn features_are_finite_in_every_state() {
        let parameters = SceneParameters::default();
        let safety = SafetyLevels::solve(&parameters, &mut |_| ControlFlow::Continue(())).unwrap();
        let human = Pose::new(1.0, -2.0, 0.4);
        for robot in [human, Pose::new(1.0, -2.0, 0.4 + crate::math::PI), Pose::new(1e4, 0.0, 0.0)]
        {
            let state = JointState { human, robot };
            for feature in FEATURES {
                let value = feature.value(&[state], &safety);
                assert!(value.is_finite(), "{}: {value} at {state:?}", feature.name);
            }
        }
    }

    #[test]
    fn levels_are_solved_only_where_a_feature_needs_them() {
        let mut parameters = SceneParameters::default();
        parameters.robot.turn_rate_radps = 0.35;
        // Only the closed form never calls `progress`.
        let stop = &mut |_| ControlFlow::Break(());
        assert!(FeatureSet::of(&["distance"]).unwrap().safety(&parameters, stop).is_ok());
        let solved = FeatureSet::of(&["v_h"]).unwrap().safety(&parameters, stop);
        assert_eq!(solved, Err(SolveError::Cancelled));
    }

    /// For each feature alone, [`FeatureSet::states_needed`] states are necessary and sufficient.
    #[test]
    fn features_look_back_as_far_as_they_say() {
        let parameters = SceneParameters::default();
        let safety = SafetyLevels::solve(&parameters, &mut |_| ControlFlow::Continue(())).unwrap();
        let (human, robot) = (Pose::new(0.0, 0.0, 0.4), Pose::new(9.0, 1.0, 3.0));
        let mut history = vec![JointState { human, robot }];
        for step in 0..30 {
            // The human never drives straight on, so that each step counts.
            let input = if step % 3 == 0 { TurnInput::Right } else { TurnInput::Left };
            history.push(history[step].advance(&parameters, input, 0.0, 0.17 + 0.01 * step as f64));
        }
        for feature in FEATURES {
            let set = FeatureSet::of(&[feature.name]).unwrap();
            let value = |states: usize| {
                let mut row = [f64::NAN];
                set.compute_into(&history[history.len() - states..], &safety, &mut row);
                row[0].to_bits()
            };
            let needed = set.states_needed().unwrap_or(history.len());
            for states in needed..=history.len() {
                assert_eq!(value(states), value(history.len()), "{}", feature.name);
            }
            assert!(needed == 1 || value(needed - 1) != value(needed), "{}", feature.name);
        }
        assert_eq!(FeatureSet::all().states_needed(), None);
        assert_eq!(FeatureSet::with_history().unwrap().states_needed(), Some(6));
        assert_eq!(FeatureSet::none().states_needed(), Some(1));
    }

    #[test]
    fn unknown_features_are_named() {
        let complaint = FeatureSet::of(&["abs_dx", "speed"]).unwrap_err();
        assert_eq!((complaint.field.as_str(), complaint.found.as_str()), ("features[1]", "speed"));
    }
}
