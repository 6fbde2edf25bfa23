//! Small predictors and drives for the tests in this folder.

use super::window::Trajectory;
use crate::bounds::{ActionModel, ActionSpace};
use crate::scene::JointState;
use crate::vehicle::Pose;
use crate::vehicle::dubins::arc;

/// Constant probabilities of right, straight and left.
pub(super) struct Always(pub(super) [f64; 3]);

impl ActionModel for Always {
    fn actions(&self) -> ActionSpace<'_> {
        ActionSpace::Levels(&[-0.5, 0.0, 0.5])
    }

    fn probabilities(&self, _: &[JointState], out: &mut [f64]) {
        out.copy_from_slice(&self.0);
    }
}

/// A drive at 2 m/s that holds each of these turn rates (rad/s) for 0.2 s, far from a robot.
pub(super) fn drive(rates: &[f64]) -> Trajectory {
    drive_told(rates, rates)
}

/// A drive with the turn rates `rates`, whose recording contains the turn rates `told` instead.
pub(super) fn drive_told(rates: &[f64], told: &[f64]) -> Trajectory {
    trajectory(Pose::new(-40.0, 0.0, 3.0), rates, told)
}

/// A drive from the origin along x, against a robot that drives straight on from `robot`.
pub(super) fn drive_against(robot: Pose, rates: &[f64]) -> Trajectory {
    trajectory(robot, rates, rates)
}

fn trajectory(robot: Pose, rates: &[f64], told: &[f64]) -> Trajectory {
    let mut states = vec![JointState { human: Pose::new(0.0, 0.0, 0.0), robot }];
    for &rate in rates {
        let JointState { human, robot } = states[states.len() - 1];
        states.push(JointState {
            human: arc(human, 2.0, rate, 0.2),
            robot: arc(robot, 2.0, 0.0, 0.2),
        });
    }
    Trajectory::new(states, told.to_vec()).unwrap()
}
