//! Random bounds of four kinds, and random drives within them.

use serde::Serialize;
use sidestep::bounds::InputBounds;
use sidestep::invalid::Invalid;
use sidestep::math::SeededRng;
use sidestep::reach::{ReachableSet, StartSet};
use sidestep::vehicle::{Pose, dubins};

use crate::{RATE_RADPS, SPEED_MPS, STEP_S};

/// The turn rates that bounds admit. The geometry depends on them: straight extremals exist only if
/// straight driving is admitted. Otherwise the rear boundary needs more than one switch.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub(crate) enum Kind {
    /// Every turn rate is admitted in every step.
    Everything,
    /// Straight driving is admitted in every step, sometimes as the only turn rate.
    Straight,
    /// Only turns to one side are admitted, the same side in every step.
    #[serde(rename = "one side")]
    OneSide,
    /// Any bounds: signs change from step to step, and some steps admit a single turn rate.
    Any,
}

pub(crate) const KINDS: [Kind; 4] = [Kind::Everything, Kind::Straight, Kind::OneSide, Kind::Any];

/// The lowest and the highest turn rate of each step (rad/s).
pub(crate) type Rates = (Vec<f64>, Vec<f64>);

impl Kind {
    /// Random bounds of `steps` steps. In half of the cases, successive steps often have equal
    /// bounds.
    pub(crate) fn bounds(self, steps: usize, rng: &mut SeededRng) -> Rates {
        let (steady, side) = (rng.below(2) == 0, [-1.0, 1.0][rng.below(2)]);
        let mut held = None;
        let mut next = |_| match held {
            Some(pair) if steady && rng.below(3) > 0 => pair,
            _ => *held.insert(self.pair(side, rng)),
        };
        (0..steps).map(&mut next).unzip()
    }

    fn pair(self, side: f64, rng: &mut SeededRng) -> (f64, f64) {
        let mut rate = || rng.uniform(-RATE_RADPS, RATE_RADPS);
        let (a, b) = (rate(), rate());
        let ordered = |a: f64, b: f64| (a.min(b), a.max(b));
        match (self, rng.below(8)) {
            (Self::Everything, _) | (Self::Any, 1) => (-RATE_RADPS, RATE_RADPS),
            (Self::Straight, 0) => (0.0, 0.0),
            (Self::Straight, 1) => (-a.abs(), 0.0),
            (Self::Straight, _) => (-a.abs(), b.abs()),
            (Self::OneSide, _) => ordered(side * a.abs(), side * b.abs()),
            (Self::Any, 0) => (a, a),
            (Self::Any, _) => ordered(a, b),
        }
    }
}

/// The reachable set under these bounds.
pub(crate) fn set(start: impl Into<StartSet>, (lo, hi): &Rates) -> Result<ReachableSet, Invalid> {
    let bounds = InputBounds::new(lo.clone(), hi.clone(), (-RATE_RADPS, RATE_RADPS))?;
    ReachableSet::new(start, &bounds, SPEED_MPS, STEP_S)
}

/// A random pose, within 9 m of the origin along each axis.
pub(crate) fn any_pose(rng: &mut SeededRng) -> Pose {
    Pose::new(rng.uniform(-9.0, 9.0), rng.uniform(-9.0, 9.0), rng.uniform(-3.1, 3.1))
}

/// A random drive: the states at the ends of `parts` equal parts of each step. The turn rate
/// changes at random, also within a step. In two thirds of the drives, it is always at a bound.
pub(crate) fn drive(
    mut pose: Pose,
    (lo, hi): &Rates,
    parts: usize,
    rng: &mut SeededRng,
) -> Vec<Pose> {
    let (mut share, restless, bang) = (rng.unit(), rng.uniform(0.0, 0.4), rng.below(3) > 0);
    let mut states = Vec::with_capacity(lo.len() * parts);
    for (low, high) in lo.iter().zip(hi) {
        for _ in 0..parts {
            if rng.unit() < restless {
                share = rng.unit();
            }
            let share = if bang { share.round() } else { share };
            let rate = low + (high - low) * share;
            pose = dubins::arc(pose, SPEED_MPS, rate, STEP_S / parts as f64);
            states.push(pose);
        }
    }
    states
}
