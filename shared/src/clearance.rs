//! Checks whether a planned trajectory of the robot stays clear of every position that the human can
//! reach, and bounds the probability of a collision.
//!
//! * [`Plan`]: the robot's poses step by step, with any speeds and turn rates. [`Footprint`]: a disc or
//!   a convex polygon, with a margin.
//! * [`ClearanceFinder`]: a guaranteed lower bound on the distance between footprint and human, for
//!   each nested set and each step. It holds at every instant of the step and for all turn rates. The
//!   finder uses no polygons of the sets, so it does not inherit their errors.
//! * [`Clearances`]: the results, including the largest set that the plan is clear of.
//!   [`CoverageBounds`]: the resulting bound on the probability of a collision, after a calibration.
//! * [`OnlinePredictor`]: prediction and clearances in a robot's control loop, without lifetime
//!   parameters and without allocation.
//!
//! # Example
//! A robot crosses the path of a human who has driven straight on so far. The robot pushes each new
//! state and then compares plans.
//! ```
//! use sidestep::bounds::{ActionChoice, BoundsSettings, Rollout};
//! use sidestep::features::FeatureSet;
//! use sidestep::clearance::{Footprint, OnlinePredictor, Plan, PlanLimits};
//! use sidestep::predict::Predictor;
//! use sidestep::scene::{JointState, SceneParameters};
//! use sidestep::vehicle::Pose;
//! use std::ops::ControlFlow;
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let parameters = SceneParameters::default(); // 2 m/s, ±0.5 rad/s, steps of 0.2 s
//! let predictor = Predictor::constant(FeatureSet::none(), vec![-1, 0, 1], vec![0.1, 0.8, 0.1])?;
//! let safety = predictor.features().safety(&parameters, &mut |_| ControlFlow::Continue(()))?;
//! // Three sets: straight on, turns of up to 0.2 rad/s, and every turn, over ten steps.
//! let choice = ActionChoice::TopK(vec![1; 10]);
//! let settings = BoundsSettings::new(vec![0.0, 0.2, 1.0], choice, Rollout::Base, 3)?; // three actions
//! let mut online = OnlinePredictor::new(predictor, safety, parameters, settings)?;
//!
//! let robot = Pose::new(2.0, -2.4, 1.57); // to the human's right, about to cross the human's path
//! online.push(JointState { human: Pose::new(0.0, 0.0, 0.0), robot })?;
//! online.predict()?;
//! let footprint = Footprint::disc(0.3)?.grown(0.3)?; // the robot, and a person's body
//! let limits = PlanLimits::new(1.5, 1.0);
//!
//! let cross = Plan::driven(robot, &[(1.2, 0.0); 10], 0.2, limits)?;
//! let clearances = online.clear(&cross, &footprint)?;
//! assert_eq!(clearances.largest_clear(0.0), Some(1)); // not clear of the set with every turn
//!
//! let wait = Plan::driven(robot, &[(0.0, 0.0); 10], 0.2, limits)?;
//! let clearances = online.clear(&wait, &footprint)?;
//! assert_eq!(clearances.largest_clear(0.0), Some(2));
//! println!("{:.2} m from where the human may be", clearances.of(2).at_least_m);
//! # Ok(())
//! # }
//! ```

mod plan;
mod interval;
mod headings;
mod upper_bound;
mod branch_and_bound;
mod separating_line;
mod coverage;
mod online;

pub use coverage::{CollisionBound, CoverageBounds};
pub use interval::{Clearance, ClearanceSettings, Clearances};
pub use online::{Continuity, NextSteps, OnlinePredictor};
pub use plan::{Footprint, Plan, PlanLimits};
pub use separating_line::{ClearanceFinder, HumanFuture};
