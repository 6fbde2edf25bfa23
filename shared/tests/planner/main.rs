//! Clearances of plans, compared with drives, with closed forms and with each other. The tests
//! print their measurements (`cargo test --release -- --nocapture`).
#![allow(clippy::unwrap_used, reason = "a test that panics has failed")]
#![allow(clippy::print_stdout, reason = "the measured figures are worth reading")]

mod clearance;
mod plan;
mod online;

use sidestep::bounds::InputBounds;
use sidestep::clearance::{Plan, PlanLimits};
use sidestep::math::SeededRng;
use sidestep::vehicle::{Pose, SpeedRange, dubins};

/// Speed, step length and maximum turn rate of a human, and the number of steps.
#[derive(Clone, Copy, Debug)]
struct Class {
    speed_mps: f64,
    step_s: f64,
    rate_radps: f64,
    steps: usize,
}

const PAPERS: Class = Class { speed_mps: 2.0, step_s: 0.2, rate_radps: 0.5, steps: 10 };

const FREE: PlanLimits = PlanLimits::new(20.0, 20.0);

fn bounds(lo: &[f64], hi: &[f64]) -> InputBounds {
    InputBounds::new(lo.to_vec(), hi.to_vec(), (-4.0, 4.0)).unwrap()
}

/// Random bounds of either sign. In a third of the cases, driving straight is always admissible.
fn any_bounds(class: Class, rng: &mut SeededRng) -> InputBounds {
    let most = class.rate_radps;
    let straight = rng.below(3) == 0;
    let mut held = (0.0, 0.0);
    let mut all = Vec::new();
    for i in 0..class.steps {
        if i == 0 || rng.below(3) == 0 {
            let (a, b) = (rng.uniform(-most, most), rng.uniform(-most, most));
            held = match rng.below(6) {
                _ if straight => (-a.abs(), b.abs()),
                0 => (a, a),
                1 => (-most, most),
                2 => (0.0, 0.0),
                _ => (a.min(b), a.max(b)),
            };
        }
        all.push(held);
    }
    let (lo, hi): (Vec<_>, Vec<_>) = all.into_iter().unzip();
    bounds(&lo, &hi)
}

/// The start, and the poses after each of the `parts` parts of every step. Turn rates and speeds change at
/// random. Each of them is either a bound or any admissible value.
fn any_drive(
    start: Pose,
    class: Class,
    (bounds, speed): (&InputBounds, SpeedRange),
    parts: usize,
    rng: &mut SeededRng,
) -> Vec<Pose> {
    let (mut pose, mut share) = (start, rng.unit());
    let mut fast = if speed.is_constant() { 1.0 } else { rng.unit() };
    let restless = rng.uniform(0.0, 0.3);
    let only_bounds = rng.below(2) == 0;
    let mut poses = vec![start];
    for (lo, hi) in bounds.lo().iter().zip(bounds.hi()) {
        for _ in 0..parts {
            if rng.unit() < restless {
                share = rng.unit();
            }
            if !speed.is_constant() && rng.unit() < restless {
                fast = rng.unit();
            }
            let [share, fast] =
                [share, fast].map(|share| if only_bounds { share.round() } else { share });
            let speed_mps = speed.lo_mps() + (speed.hi_mps() - speed.lo_mps()) * fast;
            let seconds = class.step_s / parts as f64;
            pose = dubins::arc(pose, speed_mps, lo + (hi - lo) * share, seconds);
            poses.push(pose);
        }
    }
    poses
}

/// A random plan that starts near the origin, with random speeds (also backward) and turn rates.
fn any_plan(class: Class, rng: &mut SeededRng) -> Plan {
    let far = class.speed_mps * class.step_s * class.steps as f64;
    let start = Pose::new(rng.uniform(-far, far), rng.uniform(-far, far), rng.uniform(-3.0, 3.0));
    let mut inputs = vec![(0.0, 0.0)];
    while inputs.len() <= class.steps {
        let last = inputs[inputs.len() - 1];
        let other = (rng.uniform(-1.0, 1.5) * class.speed_mps, rng.uniform(-2.0, 2.0));
        inputs.push(if rng.below(2) == 0 { last } else { other });
    }
    Plan::driven(start, &inputs[1..], class.step_s, FREE).unwrap()
}
