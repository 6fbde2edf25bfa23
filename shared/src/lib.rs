//! The library behind Sidestep. The same code simulates trials in the participant's browser, replays
//! them on the server and evaluates them in analyses.
//!
//! # Where to begin
//! | task | type or function | example |
//! |---|---|---|
//! | how dangerous is a state, and which turn is best? | [`PursuitGame`](reachability::PursuitGame) and [`solve`](reachability::solve()); for identical vehicles: [`ExactValue`](reachability::ExactValue) | `value` |
//! | save and load a value function | [`ValueFunction::encode`](reachability::ValueFunction::encode) and `decode`; export to NumPy: [`npz`](reachability::npz::npz) | |
//! | save and load a predictor | [`PredictorFile`](predict::PredictorFile), as JSON | |
//! | a custom game | [`ControlAffine`](reachability::ControlAffine) or [`Game`](reachability::Game), [`cartesian::solve`](reachability::cartesian::solve) | `own_game` |
//! | learn a person's next input | [`train`](learn::participant::train), [`Predictor`](predict::Predictor) | `train` |
//! | where can a person be? | sets to draw: [`ShfrsPredictor`](shfrs::ShfrsPredictor); bounds alone: [`input_bounds`](bounds::input_bounds) | `online` |
//! | the exact set under bounds, and whether it contains a state | [`ReachableSet`](reach::ReachableSet) | below |
//! | sets that contain the next drive with a stated probability | [`tune`](shfrs::tuning::tune) | `tune` |
//! | in a robot's control loop, is a plan clear of the person? | [`OnlinePredictor`](clearance::OnlinePredictor), [`Plan`](clearance::Plan), [`CoverageBounds`](clearance::CoverageBounds) | `plan` |
//! | the state of a game from two poses | [`relative_state`](vehicle::dubins::relative_state) | |
//!
//! Examples: `cargo run --release -p sidestep --example value`.
//!
//! # Model of the human
//! The human is modelled as a Dubins car: a point that moves at constant speed v and turns at a
//! rate of at most ω. SHFRS hold only for this model, not for a human who stops or walks at another speed.
//! [Reachable sets](reach::ReachableSet) and [clearances](clearance::OnlinePredictor::with_speed) also allow a
//! human who chooses the speed from a [range](vehicle::SpeedRange). Guarantees are calibrated on trajectories
//! of the model, at constant speed. Recorded tracks of pedestrians do not follow it and are rejected
//! ([`Trajectory::check`](shfrs::window::Trajectory::check)).
//!
//! # Features
//! | feature | adds |
//! |---|---|
//! | none | everything that runs on a robot: games and their values, predictors, reachable sets, tuning, plans |
//! | `learn` | trials, their recordings, and the training of predictors |
//! | `study` (default) | experiments with people: studies, synthetic participants, the paper's comparison, replays, charts and the server's wire types; includes `learn` |
//! | `openapi` | JSON schemas of the wire types; includes `study` |
//!
//! A robot's planner needs none of these features: `sidestep = { version = "0.1", default-features
//! = false }`.
//!
//! # Conventions
//! All quantities are in SI units and radians. World frame: x to the right, y up, heading
//! counter-clockwise from +x and wrapped to (−π, π]. A *relative state* is the pursuer's pose in
//! the evader's frame (x ahead, y to the left). A turn to the left is positive. Time is counted in
//! integer steps; only interfaces use seconds.
//!
//! # Glossary
//! Code, files and documents use one word for each idea. Names of types begin with a capital
//! letter.
//!
//! | word | meaning |
//! |---|---|
//! | human, robot | the two vehicles; the human avoids the robot, which drives straight to its goal |
//! | VehicleModel | speed and largest turn rate of a vehicle, a Dubins car |
//! | SpeedRange | lowest and highest speed of a human who changes speed at any time |
//! | Pose | position and heading of a vehicle |
//! | JointState | the poses of human and robot at one instant |
//! | TurnInput | the held key: Right −ω, Straight 0, Left +ω |
//! | Scene | start poses of both vehicles, and the robot's goal |
//! | Step | a time step of 0.2 s, in which one input is held |
//! | Trial | a driven scene: its inputs and joint states |
//! | Phase | familiarisation, practice or task; only tasks are analysed |
//! | Participant | a person, or a synthetic participant, who drives |
//! | Outcome | smallest distance, first step in the danger zone, first and last turn of a trial |
//! | Flag | evidence about a trial that an analyst should know; it never changes the trial |
//! | Recording | the trials of participants, with their origin |
//! | Trajectory | the part of a trial that predictions need: joint states, and the turn rates between them |
//! | Window | a part of a trajectory on which a prediction is made and evaluated |
//! | danger zone | the disc of radius R_c around the robot |
//! | PursuitGame | an evader, a pursuer and a radius; the evader maximises the least distance, the pursuer minimises it |
//! | ValueFunction | V of a game: the least distance under optimal play, minus the radius (m) |
//! | SafetyLevels | V_HR (the human evades) and V_RH (the robot evades); if a level is ≤ 0 m, the other vehicle can force a collision |
//! | level set | the curve on which V has a given value |
//! | row | one step of a trial, as features and a label |
//! | feature | a number computed from the joint states so far; a predictor's input |
//! | label, class | the input of a step, as the number that a predictor learns to predict |
//! | experiment | 1 predicts the turn direction, 2 predicts avoidance (whether the human turns at all) |
//! | Predictor | a trained model with its features: a probability for each class |
//! | cell | one model of one participant, on one feature set in one experiment, with its accuracy |
//! | roll-out | a simulation of the coming steps whose inputs are predictions |
//! | InputBounds | lowest and highest turn rate of each coming step (Algorithm 1) |
//! | extremal | a path whose end is on the boundary of a reachable set (Pontryagin's principle) |
//! | switching time | the time at which the turn rate of an extremal changes from one bound to the other |
//! | front, rear | the two parts of the boundary: paths that get farthest end on the front, paths that get least far on the rear |
//! | ReachableSet | every state that is reachable under input bounds |
//! | tube | every position that is reachable at any instant of the steps ahead |
//! | SHFRS | stochastic human forward reachable sets: nested reachable sets with probabilities |
//! | region | a nested set minus the set inside it |
//! | Family | predicted sets that grow with a level (for SHFRS the level is ε) |
//! | score | the smallest level whose set contains a window's trajectory |
//! | coverage | the share of windows whose trajectory a set contains |
//! | Plan | the robot's planned poses, step by step |
//! | footprint | the ground that the robot covers |
//! | clearance | the smallest distance between footprint and human at the same instant, over all drives in a set |
//!
//! # Example
//! A human turns left or drives straight on, each with probability ½. Where can this human be within
//! the next two seconds? Algorithm 1 gives bounds on the turn rate; [`reach`] computes the exact set
//! under them.
//! ```
//! use sidestep::bounds::{
//!     ActionChoice, ActionModel, ActionSpace, BoundsSettings, Rollout, input_bounds,
//! };
//! use sidestep::reach::{PolygonSettings, ReachableSet, Tolerance};
//! use sidestep::scene::{JointState, SceneParameters};
//! use sidestep::vehicle::Pose;
//!
//! struct Dancer;
//! impl ActionModel for Dancer {
//!     fn actions(&self) -> ActionSpace<'_> {
//!         ActionSpace::Levels(&[-0.5, 0.0, 0.5]) // rad/s
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
//! let settings = BoundsSettings::new(vec![0.0, 1.0], choice, Rollout::Base, 3)?; // three actions
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
//! No module uses clocks, files, sockets or browsers, and no module depends on a module declared
//! below it.

#![cfg_attr(docsrs, feature(doc_cfg))]

pub mod invalid;
pub mod document;
pub mod math;
mod real;
mod parallel;
pub mod stats;
#[cfg(feature = "study")]
pub mod chart;
pub mod vehicle;
pub mod reachability;
pub mod scene;
#[cfg(feature = "study")]
pub mod picture;
#[cfg(feature = "study")]
pub mod value_view;
#[cfg(feature = "learn")]
pub mod trial;
#[cfg(feature = "learn")]
pub mod recording;
pub mod plausibility;
#[cfg(feature = "study")]
pub mod behaviour;
#[cfg(feature = "study")]
pub mod study;
#[cfg(feature = "study")]
pub mod synthetic;
pub mod safety;
pub mod features;
#[cfg(feature = "learn")]
pub mod dataset;
pub mod predict;
#[cfg(feature = "learn")]
pub mod learn;
pub mod bounds;
pub mod reach;
pub mod shfrs;
pub mod clearance;
#[cfg(feature = "study")]
pub mod trial_view;
#[cfg(feature = "study")]
pub mod comparison;
#[cfg(feature = "study")]
pub mod api;
