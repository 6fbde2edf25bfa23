//! A robot near a person replans ten times a second. It takes the fastest plan that is clear of
//! every set, and brakes if there is no such plan. `cargo run --release -p sidestep --example
//! plan`.
#![allow(clippy::print_stdout, reason = "it shows what the robot does")]

use sidestep::bounds::{ActionChoice, BoundsSettings, Rollout};
use sidestep::clearance::{Footprint, OnlinePredictor, Plan, PlanLimits};
use sidestep::features::FeatureSet;
use sidestep::predict::Predictor;
use sidestep::safety::SafetyLevels;
use sidestep::scene::{JointState, SceneParameters};
use sidestep::vehicle::{Pose, dubins};
use std::ops::ControlFlow;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let parameters = SceneParameters { step_s: 0.1, ..SceneParameters::default() };
    let safety = SafetyLevels::solve(&parameters, &mut |_| ControlFlow::Continue(()))?;
    // The probabilities of right, straight and left. `train` makes a better model of a person.
    let model = Predictor::constant(FeatureSet::none(), vec![-1, 0, 1], vec![0.2, 0.6, 0.2])?;
    let choice = ActionChoice::TopK(vec![1; 10]); // the likeliest input of each step, widened by ε (rad/s)
    let settings = BoundsSettings::new(vec![0.0, 0.25, 1.0], choice, Rollout::Base, 3)?;
    let mut online = OnlinePredictor::new(model, safety, parameters, settings)?;
    let body = Footprint::disc(0.4)?.grown(0.3)?; // the robot's radius and the person's (m)
    let limits = PlanLimits::new(1.5, 1.0);
    let (mut human, mut robot) = (Pose::new(0.0, 0.0, 0.0), Pose::new(6.0, -4.0, 1.6));
    for tick in 0..40 {
        online.push(JointState { human, robot })?;
        online.predict()?;
        let (mut speed_mps, mut clear_m) = (2.0, 0.0);
        while clear_m <= 0.0 && speed_mps > 0.0 {
            speed_mps -= 0.5; // straight on, one second ahead
            let plan = Plan::driven(robot, &[(speed_mps, 0.0); 10], 0.1, limits)?;
            clear_m = online.clear(&plan, &body)?.of(2).at_least_m;
        }
        let now_s = 0.1 * f64::from(tick);
        println!("{now_s:.1} s: drives {speed_mps} m/s, {clear_m:.2} m clear of every set");
        human = dubins::arc(human, 2.0, 0.0, 0.1);
        robot = dubins::arc(robot, speed_mps, 0.0, 0.1);
    }
    Ok(())
}
