//! Reachable sets, compared with drives, with enumerated inputs and with a reference, and checked
//! for consistency. The tests print their measurements (`cargo test --release -- --nocapture`).
#![allow(clippy::unwrap_used, reason = "a test that panics has failed")]
#![allow(clippy::print_stdout, reason = "the measured errors are worth reading")]

mod cases;
mod speeds;
mod starts;
mod properties;
mod hard;
mod known_failures;
mod growth;
mod classes;
mod promises;
mod region;
mod hull;
mod simple;
mod closeness;
mod cancel;
mod membership;
mod reference;

use sidestep::bounds::InputBounds;
use sidestep::math::SeededRng;
use sidestep::reach::{ReachableSet, StartSet};
use sidestep::vehicle::{Pose, dubins};
use starts::pose_at;

const SPEED_MPS: f64 = 2.0;
const STEP_S: f64 = 0.2;
const RATE_RADPS: f64 = 0.5;

/// The set of the paper's vehicle.
fn set(start: impl Into<StartSet>, lo: &[f64], hi: &[f64]) -> ReachableSet {
    let range = (-RATE_RADPS, RATE_RADPS);
    let bounds = InputBounds::new(lo.to_vec(), hi.to_vec(), range).unwrap();
    ReachableSet::new(start, &bounds, SPEED_MPS, STEP_S).unwrap()
}

fn origin() -> Pose {
    Pose::new(0.0, 0.0, 0.0)
}

/// The poses after each of the `parts` parts of every step. The inputs change at random. Each input
/// is either one of the bounds or any admissible rate.
fn random_drive(
    start: Pose,
    lo: &[f64],
    hi: &[f64],
    parts: usize,
    rng: &mut SeededRng,
) -> Vec<Pose> {
    let (mut pose, mut share) = (start, rng.unit());
    let restless = rng.uniform(0.0, 0.3);
    let only_bounds = rng.below(2) == 0;
    let mut poses = Vec::new();
    for (low, high) in lo.iter().zip(hi) {
        for _ in 0..parts {
            if rng.unit() < restless {
                share = rng.unit();
            }
            let share = if only_bounds { share.round() } else { share };
            pose = dubins::arc(pose, SPEED_MPS, low + (high - low) * share, STEP_S / parts as f64);
            poses.push(pose);
        }
    }
    poses
}

/// The rate in each part, as a position from 0 to 1 between the bounds. Most rates are one of the
/// bounds.
fn any_drive(parts: usize, rng: &mut SeededRng) -> Vec<f64> {
    let (mut share, restless) = (rng.unit().round(), rng.uniform(0.0, 0.5));
    let next = |_| {
        if rng.unit() < restless {
            share = [0.0, 1.0, rng.unit()][rng.below(3)];
        }
        share
    };
    (0..parts).map(next).collect()
}

/// A random pose of an uncertain start. With `corners`, half of the coordinates are at their
/// limits.
fn random_pose(start: &StartSet, corners: bool, rng: &mut SeededRng) -> Pose {
    let mut signed = || {
        let any = rng.uniform(-1.0, 1.0);
        if corners && rng.below(2) == 0 { any.signum() } else { any }
    };
    let shares = [signed(), signed(), signed()];
    pose_at(start, shares)
}
