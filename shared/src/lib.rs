//! The one library behind Sidestep: the same code simulates a trial in the
//! participant's browser, replays it on the server and analyses it afterwards.
//!
//! # Conventions
//! SI units and radians. World frame: x to the right, y up, heading
//! counter-clockwise from +x and wrapped to (−π, π]. A *relative state* is the
//! pursuer's pose in the evader's frame (x ahead, y to the left). Time steps are
//! integers; seconds appear only at the edges. A turn to the left is positive.
//!
//! # Glossary
//! | word | meaning |
//! |---|---|
//! | Pose | position and heading of a vehicle |
//! | TurnInput | what the keys ask for: Right −ω, Straight 0, Left +ω |
//! | Scene | where both vehicles start, and the robot's goal |
//! | JointState | the poses of human and robot at one instant |
//! | Step | 0.2 s with one held input |
//! | Trial | a driven scene: inputs and the states they led through |
//! | Phase | familiarisation, practice or task |
//! | danger zone | disc of radius R_c around the robot |
//! | safety level | metres; ≤ 0 means that the other vehicle can force a collision |
//! | InputBounds | lowest and highest turn rate of each coming step (Algorithm 1) |
//! | ReachableSet | every position reachable under such bounds |
//! | SHFRS | nested reachable sets with probabilities |
//! | Trajectory | a recorded trial: joint states, and the turn rates held between them |
//! | Window | a stretch of a trajectory, from which a prediction is made and judged |
//! | Family | predicted sets that grow with a level (for SHFRS the level is ε) |
//! | score | the least level whose set a window's trajectory stays inside |
//!
//! # Example
//! Where a human may be in the next two seconds who turns left as likely as not, whatever the
//! robot does: bounds on the turn rate by Algorithm 1, and the exact set under them.
//! ```
//! use sidestep::bounds::{ActionChoice, ActionModel, BoundsSettings, Rollout, input_bounds};
//! use sidestep::reach::{PolygonSettings, ReachableSet, Tolerance};
//! use sidestep::scene::{JointState, SceneParameters};
//! use sidestep::vehicle::Pose;
//!
//! struct Dancer;
//! impl ActionModel for Dancer {
//!     fn actions(&self) -> &[f64] {
//!         &[-0.5, 0.0, 0.5] // rad/s
//!     }
//!     fn probabilities(&self, _history: &[JointState], out: &mut [f64]) {
//!         out.copy_from_slice(&[0.0, 0.5, 0.5]);
//!     }
//! }
//!
//! # fn main() -> Result<(), sidestep::invalid::Invalid> {
//! let now = JointState { human: Pose::new(0.0, 0.0, 0.0), robot: Pose::new(12.0, 0.0, 3.0) };
//! let parameters = SceneParameters::default(); // the paper's vehicles and steps
//! // Two sets: the two likeliest actions at each of ten steps, and every turn rate.
//! let choice = ActionChoice::TopK(vec![2; 10]);
//! let settings = BoundsSettings::new(vec![0.0, 1.0], choice, Rollout::Base, 3)?;
//! let found = input_bounds(&[now], &parameters, &Dancer, |_| 0.0, &settings)?;
//! assert_eq!((found.sets[0].lo()[0], found.sets[0].hi()[0]), (0.0, 0.5));
//!
//! let [left, all] = [0, 1].map(|j| ReachableSet::new(now.human, &found.sets[j], 2.0, 0.2));
//! let tube = left?.tube_polygon(PolygonSettings::default()); // m, counter-clockwise
//! assert!(tube.iter().all(|vertex| vertex[1] > -1e-3));
//! let straight_on = Pose::new(4.0, 0.0, 0.0);
//! assert!(all?.contains_state(10, straight_on, Tolerance::default()));
//! # Ok(())
//! # }
//! ```
//!
//! # Purity and module order
//! Nothing here knows of clocks, files, sockets or browsers, and no module uses
//! one that is declared below it.

pub mod invalid;
pub mod math;
mod real;
mod parallel;
mod parallel_map;
pub mod stats;
pub mod chart;
pub mod vehicle;
pub mod reachability;
pub mod scene;
pub mod trial;
pub mod study;
pub mod synthetic;
pub mod safety;
pub mod features;
pub mod dataset;
pub mod predict;
pub mod learn;
pub mod bounds;
pub mod reach;
pub mod shfrs;
pub mod comparison;
pub mod api;
