//! Draws sets again from their known bounds.

use super::{NestedSet, Shfrs, ShfrsSettings};
use crate::bounds::InputBounds;
use crate::invalid::{Invalid, length};
use crate::reach::{ReachableSet, Workspace};
use crate::vehicle::Pose;
use core::ops::ControlFlow;

impl Shfrs {
    /// The sets of a human who starts at `start`. `bounds` has one entry per ε of the settings. The
    /// sets are identical to the sets that a prediction with these bounds draws.
    ///
    /// # Errors
    /// [`Invalid`] if the number of bounds is not the number of ε, and the errors of
    /// [`ReachableSet::new`].
    pub fn redrawn(
        start: Pose,
        bounds: &[InputBounds],
        speed_mps: f64,
        step_s: f64,
        settings: &ShfrsSettings,
    ) -> Result<Self, Invalid> {
        let epsilon = settings.bounds.epsilon();
        length("bounds", epsilon.len(), bounds.len())?;
        let mut workspace = Workspace::default();
        let draw = |(&epsilon, bounds): (&f64, &InputBounds)| {
            let reachable = ReachableSet::new(start, bounds, speed_mps, step_s)?;
            let mut set = NestedSet::empty(bounds.clone());
            let goes_on = &mut || ControlFlow::Continue(());
            let _ = set.take(epsilon, bounds, &reachable, settings, &mut workspace, goes_on);
            Ok(set)
        };
        Ok(Self { sets: epsilon.iter().zip(bounds).map(draw).collect::<Result<_, Invalid>>()? })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bounds::ActionChoice;
    use crate::bounds::{ActionModel, ActionSpace, BoundsSettings, Rollout};
    use crate::scene::{JointState, SceneParameters};

    struct Always;

    impl ActionModel for Always {
        fn actions(&self) -> ActionSpace<'_> {
            ActionSpace::Levels(&[-0.5, 0.0, 0.5])
        }

        fn probabilities(&self, _: &[JointState], out: &mut [f64]) {
            out.copy_from_slice(&[0.1, 0.7, 0.2]);
        }
    }

    #[test]
    fn sets_are_drawn_again_as_they_were() {
        let parameters = SceneParameters::default();
        let choice = ActionChoice::TopK(vec![2, 1, 1, 3]);
        let bounds = BoundsSettings::new(vec![0.0, 0.2, 1.0], choice, Rollout::Base, 3).unwrap();
        let settings = ShfrsSettings::new(bounds).with_by_step(true);
        let human = Pose::new(1.0, 2.0, 0.5);
        let now = JointState { human, robot: Pose::new(9.0, 2.0, 3.0) };
        let found = super::super::predict(&[now], &parameters, &Always, &settings).unwrap();
        let bounds: Vec<_> = found.sets.iter().map(|set| set.bounds.clone()).collect();
        assert_eq!(Shfrs::redrawn(human, &bounds, 2.0, 0.2, &settings), Ok(found));
        let few = Shfrs::redrawn(human, &bounds[..2], 2.0, 0.2, &settings).unwrap_err();
        assert_eq!(few.field, "bounds");
    }
}
