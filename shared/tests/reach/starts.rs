//! Poses of uncertain starts.

use sidestep::math::{PI, sin_cos};
use sidestep::reach::{PositionUncertainty, StartSet};
use sidestep::vehicle::Pose;

/// A pose of an uncertain start, given by three numbers from −1 to 1. The first two are the
/// position in a box (along and across the heading) or in a disc (angle and radius). The third is
/// the deviation of the heading as a share of its uncertainty.
pub(crate) fn pose_at(start: &StartSet, [along, across, turn]: [f64; 3]) -> Pose {
    let (a, b) = match start.position() {
        PositionUncertainty::None => (0.0, 0.0),
        PositionUncertainty::Disc { radius_m } => {
            let (sin, cos) = sin_cos(PI * along);
            (radius_m * across * cos, radius_m * across * sin)
        }
        PositionUncertainty::Box { along_m, across_m } => (along_m * along, across_m * across),
        position => unreachable!("no pose is drawn from {position:?}"),
    };
    let pose = start.pose();
    let (sin, cos) = sin_cos(pose.psi);
    let psi = pose.psi + start.heading_rad() * turn;
    Pose::new(pose.x + cos * a - sin * b, pose.y + sin * a + cos * b, psi)
}
